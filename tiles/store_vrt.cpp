#include "tiles/store_vrt.hpp"

#include <cpl_minixml.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <string_view>
#include <vector>

#include "lib/error.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/side_file.hpp"

namespace wedgescope {
namespace {

struct DestroyXml {
    void operator()(CPLXMLNode* node) const { CPLDestroyXMLNode(node); }
};
using Xml = std::unique_ptr<CPLXMLNode, DestroyXml>;

bool is_element(const CPLXMLNode& node, std::string_view name) {
    return node.eType == CXT_Element && name == node.pszValue;
}

/// What GDAL programs add when they keep statistics: how they open sources goes with it.
bool is_added(const CPLXMLNode& node) {
    if (is_element(node, "Histograms")) return true;
    if (node.eType == CXT_Attribute && std::string_view(node.pszValue) == "shared") return true;
    if (!is_element(node, "Metadata")) return false;
    for (const CPLXMLNode* item = node.psChild; item; item = item->psNext)
        if (!std::string_view(CPLGetXMLValue(item, "key", "")).starts_with("STATISTICS_")) return false;
    return true;
}

/// Numbers with commas and blanks between; false: something else is there.
bool numbers_of(const char* words, std::vector<double>& numbers) {
    while (*words) {
        char* end = nullptr;
        numbers.push_back(CPLStrtod(words, &end));
        if (end == words) return false;
        words = end + std::strspn(end, ", ");
    }
    return true;
}

bool same_numbers(const char* a, const char* b) {
    std::vector<double> first, second;
    constexpr double rounding = 1e-12;  // 15 digits
    return numbers_of(a, first) && numbers_of(b, second) &&
           std::equal(first.begin(), first.end(), second.begin(), second.end(), [](double x, double y) {
               return x == y || (std::isnan(x) && std::isnan(y)) || std::abs(x - y) <= rounding * std::abs(x);
           });
}

bool same_crs(const char* a, const char* b) {
    GdalErrors quiet;
    OGRSpatialReference first, second;
    return first.SetFromUserInput(a) == OGRERR_NONE && second.SetFromUserInput(b) == OGRERR_NONE &&
           first.IsSame(&second);
}

bool same_tree(const CPLXMLNode& found, const CPLXMLNode& made) {
    if (found.eType != made.eType || std::string_view(found.pszValue) != made.pszValue) return false;
    const bool crs = is_element(made, "SRS");
    const bool numbers = crs || is_element(made, "GeoTransform") || is_element(made, "NoDataValue") ||
                         is_element(made, "Offset") || is_element(made, "Scale");
    const CPLXMLNode *a = found.psChild, *b = made.psChild;
    for (;; a = a->psNext, b = b->psNext) {
        while (a && is_added(*a)) a = a->psNext;
        if (!a || !b) return !a && !b;
        if (numbers && a->eType == CXT_Text && b->eType == CXT_Text) {
            if (!(crs ? same_crs : same_numbers)(a->pszValue, b->pszValue)) return false;
        } else if (!same_tree(*a, *b)) {
            return false;
        }
    }
}

std::string no_data_words(const RasterFacts& facts) {
    if (facts.type == GDT_Int64) return std::to_string(whole_no_data<std::int64_t>(facts));
    if (facts.type == GDT_UInt64) return std::to_string(whole_no_data<std::uint64_t>(facts));
    return std::isnan(facts.no_data) ? "nan" : text(facts.no_data);
}

}  // namespace

bool is_vrt_of(const std::string& words, const StoreLayerEntry& layer, double scale) {
    // Nothing else is a reason to write it anew.
    if (words.find("STATISTICS_") == std::string::npos && words.find("<Histograms>") == std::string::npos) return false;
    GdalErrors quiet;
    const Xml found(CPLParseXMLString(words.c_str())), made(CPLParseXMLString(vrt_text(layer, scale).c_str()));
    return found && made && !found->psNext && same_tree(*found, *made);
}

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
    if (f.has_no_data) out += text("    <NoDataValue>", no_data_words(f), "</NoDataValue>\n");
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
