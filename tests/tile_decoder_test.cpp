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
    GDALDataset* sheet = GDALDataset::Open(path.c_str());
    REQUIRE(sheet);
    const bool floating = GDALDataTypeIsFloating(layout.type) != 0;
    auto decoder = TileDecoder::of(path, *sheet, edge, type_bytes, floating);
    REQUIRE(decoder);
    RawVector<std::byte> values(bytes);
    for (const int t : {1, 0, 1}) {
        const auto right = [&] { return std::memcmp(values.data(), packed[t].data(), bytes) == 0; };
        INFO("tile " << t);
        CHECK(decoder->decode(*sheet->GetRasterBand(1), t, 0, values, right));
        CHECK(right());
    }
    // No layout gives what was never packed.
    CHECK_FALSE(decoder->decode(*sheet->GetRasterBand(1), 0, 0, values, [] { return false; }));
    GDALClose(sheet);
}

TEST_CASE("a sheet packed otherwise is left to GDAL", "[store]") {
    const Folder folder;
    const std::string path = folder / "tiles.tif";
    GDALDataset* out = create(path, 16, {GDT_Int16, "DEFLATE", "2"});
    REQUIRE(out);
    GDALClose(out);
    GDALDataset* sheet = GDALDataset::Open(path.c_str());
    REQUIRE(sheet);
    CHECK_FALSE(TileDecoder::of(path, *sheet, 16, 2, false));
    GDALClose(sheet);
}
