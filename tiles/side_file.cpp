#include "tiles/side_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <fstream>

#include "lib/error.hpp"
#include "tiles/crs.hpp"
#include "tiles/descriptor.hpp"
#include "tiles/raster_content.hpp"

namespace wedgescope {
namespace {

std::string items(Metadata some, const std::string& domain) {
    if (some.empty()) return "";
    std::sort(some.begin(), some.end());
    std::string out = domain.empty() ? "  <Metadata>\n" : text("  <Metadata domain=\"", domain, "\">\n");
    for (const auto& [key, value] : some)
        out += text("    <MDI key=\"", xml_words(key, true), "\">", xml_words(value), "</MDI>\n");
    return out + "  </Metadata>\n";
}

std::string side_text(const RasterContent& content, const Metadata& geolocation) {
    std::string out = "<PAMDataset>\n";
    if (!content.crs.empty()) {
        std::string reason;
        if (const auto crs = Crs::read(content.crs, reason))
            out += text("  <SRS dataAxisToSRSAxisMapping=\"", crs->axis_mapping(), "\">", xml_words(crs->wkt_of_old()),
                        "</SRS>\n");
    }
    if (content.geotransform) {
        out += "  <GeoTransform>";
        for (std::size_t i = 0; i < 6; ++i)
            out += fmt::format("{}{:24.16e}", i > 0 ? "," : "", (*content.geotransform)[i]);
        out += "</GeoTransform>\n";
    }
    out += items(content.metadata, "") + items(geolocation, "GEOLOCATION");
    for (std::size_t b = 0; b < content.bands.size(); ++b) {
        const BandContent& band = content.bands[b];
        out += text("  <PAMRasterBand band=\"", b + 1, "\">\n    <Description>", xml_words(band.description),
                    "</Description>\n", band.alpha ? "    <ColorInterp>Alpha</ColorInterp>\n" : "",
                    "  </PAMRasterBand>\n");
    }
    return out + "</PAMDataset>\n";
}

}  // namespace

std::string xml_words(std::string_view words, bool quoted) {
    std::string out;
    for (const char c : words) {
        if (c == '&')
            out += "&amp;";
        else if (c == '<')
            out += "&lt;";
        else if (c == '>')
            out += "&gt;";
        else if (c == '"' && quoted)
            out += "&quot;";
        else if (static_cast<unsigned char>(c) >= ' ' || c == '\t' || c == '\n' || c == '\r')  // XML knows no others
            out += c;
    }
    return out;
}

void write_side_file(const RasterContent& content, const Metadata& geolocation, const std::string& path,
                     const std::string& final_path) {
    errno = 0;
    std::ofstream file(path + ".aux.xml", std::ios::binary);
    file << side_text(content, geolocation);
    file.close();
    if (file) return;
    throw IoError(text("output '", final_path, "' cannot be written: ", stream_reason()));
}

}  // namespace wedgescope
