// Tiles as libtiff packs them, decoded without it: every type, predictor and shape that the decoder says it knows.
#include <catch2/catch.hpp>

#include <gdal_priv.h>

#include <cstring>
#include <random>

#include "tests/drawn_raster.hpp"
#include "tests/every_target.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/tile_decoder.hpp"

using namespace wedgescope;
using wedgescope::test::Folder;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

struct Layout {
    GDALDataType type;
    const char *compress, *predictor;
};

GDALDataset* create(const std::string& path, int edge, const Layout& layout) {
    CPLStringList options;
    options.SetNameValue("TILED", "YES");
    options.SetNameValue("BLOCKXSIZE", std::to_string(edge).c_str());
    options.SetNameValue("BLOCKYSIZE", std::to_string(edge).c_str());
    options.SetNameValue("COMPRESS", layout.compress);
    if (*layout.predictor) options.SetNameValue("PREDICTOR", layout.predictor);
    return GetGDALDriverManager()->GetDriverByName("GTiff")->Create(path.c_str(), 2 * edge, edge, 1, layout.type,
                                                                    options.List());
}

}  // namespace

TEST_CASE("a tile is decoded to the bits that libtiff packed", "[store]") {
    WEDGESCOPE_ON_EVERY_TARGET;
    const auto layout = GENERATE(values<Layout>({{GDT_Byte, "ZSTD", "1"},
                                                 {GDT_Byte, "ZSTD", "2"},
                                                 {GDT_Int16, "ZSTD", "1"},
                                                 {GDT_Int16, "ZSTD", "2"},
                                                 {GDT_UInt16, "ZSTD", "2"},
                                                 {GDT_Int32, "ZSTD", "2"},
                                                 {GDT_Float32, "ZSTD", "1"},
                                                 {GDT_Float32, "ZSTD", "2"},
                                                 {GDT_Float32, "ZSTD", "3"},
                                                 {GDT_Float64, "ZSTD", "2"},
                                                 {GDT_Float64, "ZSTD", "3"},
                                                 {GDT_Int16, "NONE", ""},
                                                 {GDT_Float32, "NONE", ""}}));
    const int edge = GENERATE(16, 48, 256);
    INFO(GDALGetDataTypeName(layout.type) << ' ' << layout.compress << ' ' << layout.predictor << ' ' << edge);
    const auto type_bytes = static_cast<std::size_t>(GDALGetDataTypeSizeBytes(layout.type));
    const std::size_t bytes = static_cast<std::size_t>(edge) * static_cast<std::size_t>(edge) * type_bytes;
    const Folder folder;
    const std::string path = folder / "tiles.tif";
    // Any bits at all in the first tile: infinities and voids among them. Runs in the second.
    std::mt19937 random(static_cast<unsigned>(edge));
    std::vector<std::byte> packed[2] = {std::vector<std::byte>(bytes), std::vector<std::byte>(bytes)};
    for (std::byte& b : packed[0]) b = static_cast<std::byte>(random());
    for (std::size_t i = 0; i < bytes; ++i) packed[1][i] = static_cast<std::byte>(i / type_bytes / 5);
    {
        GDALDataset* out = create(path, edge, layout);
        REQUIRE(out);
        for (int t = 0; t < 2; ++t) REQUIRE(out->GetRasterBand(1)->WriteBlock(t, 0, packed[t].data()) == CE_None);
        GDALClose(out);
    }
    auto index = TiffIndex::of(path);
    REQUIRE(index);
    const auto decoder = TileDecoder::of(path, std::move(*index), type_bytes);
    REQUIRE(decoder);
    RawVector<std::byte> values(bytes);
    for (const int t : {1, 0, 1}) {
        const auto right = [&] { return std::memcmp(values.data(), packed[t].data(), bytes) == 0; };
        INFO("tile " << t);
        CHECK(decoder->decode(0, t, 0, values, right));
        CHECK(right());
    }
    CHECK_FALSE(decoder->decode(0, 0, 0, values, [] { return false; }));
    CHECK_FALSE(decoder->decode(0, 0, 1, values, [] { return true; }));
    CHECK_FALSE(decoder->decode(1, 0, 0, values, [] { return true; }));
}

TEST_CASE("an index tells what GDAL tells of tiles and overviews", "[store]") {
    const bool big = GENERATE(false, true);
    const Folder folder;
    const std::string path = folder / "levels.tif";
    CPLStringList options;
    options.SetNameValue("TILED", "YES");
    options.SetNameValue("BLOCKXSIZE", "64");
    options.SetNameValue("BLOCKYSIZE", "64");
    options.SetNameValue("COMPRESS", "ZSTD");
    options.SetNameValue("PREDICTOR", "2");
    if (big) options.SetNameValue("BIGTIFF", "YES");
    GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
    GDALDataset* out = driver->Create(path.c_str(), 300, 200, 1, GDT_Int16, options.List());
    REQUIRE(out);
    std::vector<std::int16_t> posts(300 * 200);
    for (std::size_t i = 0; i < posts.size(); ++i) posts[i] = static_cast<std::int16_t>(i * 7);
    REQUIRE(out->GetRasterBand(1)->RasterIO(GF_Write, 0, 0, 300, 200, posts.data(), 300, 200, GDT_Int16, 0, 0,
                                            nullptr) == CE_None);
    const int factors[] = {2, 4};
    REQUIRE(out->BuildOverviews("NEAREST", 2, factors, 0, nullptr, nullptr, nullptr) == CE_None);
    REQUIRE(out->CreateMaskBand(GMF_PER_DATASET) == CE_None);  // no overview
    GDALClose(out);
    const auto index = TiffIndex::of(path);
    REQUIRE(index);
    REQUIRE(index->levels.size() == 3);
    GDALDataset* sheet = GDALDataset::Open(path.c_str());
    REQUIRE(sheet);
    for (int k = 0; k < 3; ++k) {
        GDALRasterBand* band = sheet->GetRasterBand(1);
        if (k > 0) band = band->GetOverview(k - 1);
        const TiffIndex::Level& level = index->levels[static_cast<std::size_t>(k)];
        CHECK(level.columns == band->GetXSize());
        CHECK(level.rows == band->GetYSize());
        int wide = 0, high = 0;
        band->GetBlockSize(&wide, &high);
        CHECK(level.tile_columns == static_cast<unsigned>(wide));
        CHECK(level.tile_rows == static_cast<unsigned>(high));
        CHECK(level.bits == 16);
        const std::size_t across = static_cast<std::size_t>((level.columns + wide - 1) / wide);
        for (std::size_t i = 0; i < level.offsets.size(); ++i) {
            const std::string place = std::to_string(i % across) + "_" + std::to_string(i / across);
            CHECK(std::to_string(level.offsets[i]) == band->GetMetadataItem(("BLOCK_OFFSET_" + place).c_str(), "TIFF"));
            CHECK(std::to_string(level.byte_counts[i]) ==
                  band->GetMetadataItem(("BLOCK_SIZE_" + place).c_str(), "TIFF"));
        }
    }
    GDALClose(sheet);
}

TEST_CASE("what is no TIFF of tiles has no index", "[store]") {
    const Folder folder;
    CHECK_FALSE(TiffIndex::of(folder / "nothing.tif"));
    const std::string path = folder / "strips.tif";
    GDALDataset* out =
        GetGDALDriverManager()->GetDriverByName("GTiff")->Create(path.c_str(), 40, 40, 1, GDT_Byte, nullptr);
    REQUIRE(out);
    GDALClose(out);
    CHECK_FALSE(TiffIndex::of(path));
}

TEST_CASE("a sheet packed otherwise is left to GDAL", "[store]") {
    const Folder folder;
    const std::string path = folder / "tiles.tif";
    GDALDataset* out = create(path, 16, {GDT_Int16, "DEFLATE", "2"});
    REQUIRE(out);
    GDALClose(out);
    auto index = TiffIndex::of(path);
    REQUIRE(index);
    CHECK_FALSE(TileDecoder::of(path, std::move(*index), 2));
}
