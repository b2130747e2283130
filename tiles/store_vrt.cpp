#include "tiles/store_vrt.hpp"

#include <cmath>

#include "lib/error.hpp"
#include "tiles/side_file.hpp"

namespace wedgescope {
std::string vrt_text(const StoreLayerEntry& layer, double scale) {
    const RasterFacts& f = layer.facts;
    std::string out = text("<VRTDataset rasterXSize=\"", f.columns, "\" rasterYSize=\"", f.rows, "\">\n");
    if (f.crs) {
        // As the sheets have it: x first, whatever the CRS's own order of axes.
        out += text("  <SRS dataAxisToSRSAxisMapping=\"", f.crs->axis_mapping(), "\">", xml_words(f.crs->wkt(), true),
                    "</SRS>\n");
    }
    if (f.has_geotransform)
        out += text("  <GeoTransform>", f.corner_x, ", ", f.step_x, ", 0, ", f.corner_y, ", 0, ", f.step_y,
                    "</GeoTransform>\n");
    out += text("  <VRTRasterBand dataType=\"", type_name(f.type), "\" band=\"1\" blockXSize=\"", f.block_columns,
                "\" blockYSize=\"", f.block_rows, "\">\n");
    if (f.has_no_data)
        out += text("    <NoDataValue>", std::isnan(f.no_data) ? "nan" : text(f.no_data), "</NoDataValue>\n");
    if (!f.unit.empty()) out += text("    <UnitType>", xml_words(f.unit, true), "</UnitType>\n");
    if (f.offset != 0) out += text("    <Offset>", f.offset * scale, "</Offset>\n");
    if (f.scale * scale != 1) out += text("    <Scale>", f.scale * scale, "</Scale>\n");
    for (const StoreSheet& sheet : layer.sheets) {
        const Window posts = layer.posts(sheet.column, sheet.row);
        const std::string size = text("xSize=\"", posts.columns.size(), "\" ySize=\"", posts.rows.size(), "\"");
        out += text("    <SimpleSource>\n      <SourceFilename relativeToVRT=\"1\">", xml_words(sheet.file, true),
                    "</SourceFilename>\n      <SourceBand>1</SourceBand>\n      <SourceProperties RasterXSize=\"",
                    posts.columns.size(), "\" RasterYSize=\"", posts.rows.size(), "\" DataType=\"", type_name(f.type),
                    "\" BlockXSize=\"", f.block_columns, "\" BlockYSize=\"", f.block_rows,
                    "\" />\n      <SrcRect xOff=\"0\" yOff=\"0\" ", size, " />\n      <DstRect xOff=\"",
                    posts.columns.begin, "\" yOff=\"", posts.rows.begin, "\" ", size, " />\n    </SimpleSource>\n");
    }
    return out + "  </VRTRasterBand>\n</VRTDataset>\n";
}

}  // namespace wedgescope
