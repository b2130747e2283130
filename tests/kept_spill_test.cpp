// A spill kept for scenes from one point: the posts of the rasters, refused where it does not fit or was changed.
#include <catch2/catch.hpp>

#include <fstream>
#include <random>
#include <set>

#include "lib/block_map.hpp"
#include "tests/refusal.hpp"
#include "tests/spilled_ground.hpp"
#include "tiles/gdal_session.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

/// A raster with heights, its kept spill, and a scene from the point it was made for.
struct Kept {
    Folder folder;
    DataBaseParams params;
    Scene scene;
    std::string path;
    explicit Kept(std::size_t memory_bytes = std::size_t{1} << 20) {
        Drawing d = hills(300, 260, GDT_Int16);
        d.no_data = 3;
        draw(folder / "dem.tif", d);
        d.value = [](int c, int r) { return c % 10 == 0 ? r % 7 : 0; };
        d.no_data.reset();
        draw(folder / "height.tif", d);
        params = only(folder / "dem.tif");
        params.culture_height = folder / "height.tif";
        scene = above(params);
        path = folder / "wedges.spill";
        make(memory_bytes);
    }
    void make(std::size_t memory_bytes) const {
        keep_spill(params, scene.platform, folder / ".", in(folder, memory_bytes));
    }
    std::unique_ptr<WedgeSource> open(const Scene& s) const {
        return open_kept_spill(params, s, folder / ".", in(folder, plenty));
    }
};

}  // namespace

TEST_CASE("a kept spill serves other scenes from the same point with the posts of the rasters", "[spill]") {
    for (const std::size_t memory : {std::size_t{1} << 20, plenty}) {
        const Kept kept(memory);
        CHECK(kept.folder.names() == std::vector<std::string>{"dem.tif", "height.tif", "wedges.spill"});
        const auto direct = open_direct_source(kept.params);
        Scene other = kept.scene;
        other.range_m = 700;
        other.platform.altitude_m = 3000;
        for (const Scene& scene : {kept.scene, other}) {
            const auto source = kept.open(scene);
            CHECK(source->report().held_bytes == 0);
            for (const bool by_columns : {false, true}) {
                const Window all{{0, 300}, {0, 260}};
                const Chunk a = direct->load(all, by_columns), b = source->load(all, by_columns);
                CHECK(differences(a.surface_m, b.surface_m) == 0);
                CHECK(differences(a.culture_height_m, b.culture_height_m) == 0);
            }
            CHECK(source->extremes().highest_m == direct->extremes().highest_m);
            CHECK(source->extremes().lowest_m == direct->extremes().lowest_m);
            CHECK(source->extremes().void_posts == direct->extremes().void_posts);
            if (memory != plenty) continue;
            const auto fresh = open_spilled_source(kept.params, kept.scene, in(kept.folder, plenty));
            BlockMap *x = fresh->block_map(), *y = source->block_map();
            REQUIRE((x && y));
            CHECK(x->levels() == y->levels());
            CHECK(x->read(0, {{0, 10}, {0, 9}}).bounds == y->read(0, {{0, 10}, {0, 9}}).bounds);
        }
        kept.make(memory);  // in place of the old one
        CHECK(kept.folder.names() == std::vector<std::string>{"dem.tif", "height.tif", "wedges.spill"});
    }
}

TEST_CASE("a kept spill that does not fit is refused by name", "[spill]") {
    const Kept kept;
    const auto refused = [&](const DataBaseParams& params, const Scene& scene, const std::string& why) {
        CHECK_THAT(refusal([&] { open_kept_spill(params, scene, kept.folder / ".", in(kept.folder, plenty)); }),
                   Contains("wedges.spill") && Contains(why));
    };
    Scene elsewhere = kept.scene;
    elsewhere.platform.xy->x += 11;  // posts are 10 m apart
    refused(kept.params, elsewhere, "was made for column 149.50, row 129.50; the sensor stands over column 150.60");
    DataBaseParams other = kept.params;
    other.culture_height_scale = 2;
    refused(other, kept.scene, "culture-height-scale 1, not 2");
    other = kept.params;
    other.culture_height.clear();
    refused(other, kept.scene, "was made with a culture-height");
    other = kept.params;
    other.culture = kept.folder / "height.tif";
    other.legend = Legend("drawn", {{0, 1}});
    refused(other, kept.scene, "holds no culture");
    std::filesystem::copy(kept.folder / "dem.tif", kept.folder / "copy.tif");
    other = kept.params;
    other.dem = kept.folder / "copy.tif";
    refused(other, kept.scene, "another raster than dem");
    std::filesystem::last_write_time(kept.folder / "dem.tif",
                                     std::filesystem::file_time_type::clock::now() + std::chrono::seconds(5));
    refused(kept.params, kept.scene, "before that was changed");
    std::filesystem::remove(kept.path);
    refused(kept.params, kept.scene, "No such file");
}

TEST_CASE("any byte of a kept spill that is flipped, and any end cut off, is named", "[spill]") {
    const Kept kept;
    std::mt19937 random(77);
    std::fstream file(kept.path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(0, std::ios::end);
    const auto size = static_cast<std::uint64_t>(file.tellg());
    const auto read_all = [&] {
        const auto source = kept.open(kept.scene);
        source->load({{0, 300}, {0, 260}}, false);
    };
    read_all();
    std::set<std::uint64_t> places;
    for (std::uint64_t i = 0; i < 64; ++i) places.insert(i);
    while (places.size() < 140) places.insert(random() % size);
    for (std::uint64_t i = 1; i < 100; i += 9) places.insert(size - i);
    for (const std::uint64_t at : places) {
        CAPTURE(at, size);
        file.seekg(static_cast<std::streamoff>(at));
        const auto byte = static_cast<char>(file.get());
        file.seekp(static_cast<std::streamoff>(at));
        file.put(static_cast<char>(byte ^ static_cast<char>(1U << (random() % 7))));
        file.flush();
        CHECK_THAT(refusal(read_all), Contains("wedges.spill"));
        file.seekp(static_cast<std::streamoff>(at));
        file.put(byte);
        file.flush();
    }
    read_all();
    for (const std::uint64_t end : {size - 1, size / 2, std::uint64_t{63}, std::uint64_t{0}}) {
        std::filesystem::resize_file(kept.path, end);
        CHECK_THAT(refusal(read_all), Contains("wedges.spill") && Contains("damaged"));
    }
}
