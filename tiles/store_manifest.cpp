#include "tiles/store_manifest.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/json_text.hpp"
#include "tiles/plain_file.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {
namespace {

using json = nlohmann::ordered_json;

constexpr const char* format_name = "wedgescope-store-1";
constexpr std::size_t largest_manifest = std::size_t{1} << 28;
constexpr std::string_view sum_key = "\"checksum\": \"";
constexpr std::size_t sum_digits = 16;
constexpr std::string_view sums_magic = "wedgescope-sums-1\n";

/// JSON knows no NaN and no infinity.
json number(double value) {
    if (std::isnan(value)) return "nan";
    if (std::isinf(value)) return value < 0 ? "-inf" : "inf";
    return value;
}
double number(const json& value) {
    if (!value.is_string()) return value.get<double>();
    const std::string word = value.get<std::string>();
    return word == "nan"    ? std::numeric_limits<double>::quiet_NaN()
           : word == "-inf" ? -std::numeric_limits<double>::infinity()
                            : std::numeric_limits<double>::infinity();
}

DataError damaged_manifest(const std::string& path, const std::string& why) {
    return DataError(text("tile store manifest '", path, "' is damaged: ", why));
}

/// Members of an object of the manifest, each of its own kind and range: a DataError names the one that is not.
class Members {
public:
    Members(const std::string& path, const json& object) : Members(path, object, nullptr, "", -1) {}
    Members object(const char* key) const { return {path_, at(key), this, key, -1}; }
    /// `read` is called with each object of an array.
    template <class Read>
    void each(const char* key, Read&& read) const {
        const json& list = at(key);
        if (!list.is_array()) refuse(key, "an array");
        std::int64_t index = 0;
        for (const json& one : list) read(Members(path_, one, this, key, index++));
    }
    bool has(const char* key) const { return object_.contains(key); }
    bool has_value(const char* key) const { return !at(key).is_null(); }

    std::int64_t whole(const char* key, std::int64_t lowest, std::int64_t highest, const std::string& accepted) const {
        const json& value = at(key);
        const bool fits = value.is_number_unsigned() ? value.get<std::uint64_t>() <= static_cast<std::uint64_t>(most)
                                                     : value.is_number_integer();
        if (!fits || value.get<std::int64_t>() < lowest || value.get<std::int64_t>() > highest) refuse(key, accepted);
        return value.get<std::int64_t>();
    }
    std::int64_t whole(const char* key, std::int64_t lowest, std::int64_t highest) const {
        return whole(key, lowest, highest, text("a whole number from ", lowest, " to ", highest));
    }
    std::uint64_t count(const char* key) const {
        if (!at(key).is_number_unsigned()) refuse(key, "a whole number, 0 or above");
        return at(key).get<std::uint64_t>();
    }
    double finite(const char* key) const {
        if (!at(key).is_number() || !std::isfinite(at(key).get<double>())) refuse(key, "a number");
        return at(key).get<double>();
    }
    double at_least_0(const char* key) const {
        if (!(finite(key) >= 0)) refuse(key, "a number, 0 or above");
        return finite(key);
    }
    double above_0(const char* key) const {
        if (!(finite(key) > 0)) refuse(key, "a number above 0");
        return finite(key);
    }
    double with_words(const char* key) const {
        const json& value = at(key);
        if (!value.is_number() && value != "nan" && value != "inf" && value != "-inf")
            refuse(key, R"(a number, "nan", "inf" or "-inf")");
        return number(value);
    }
    float height(const char* key) const {
        const double value = with_words(key);
        if (!std::isinf(value) && !(std::fabs(value) <= static_cast<double>(std::numeric_limits<float>::max())))
            refuse(key, R"(a number of 32 bits, "inf" or "-inf")");
        return static_cast<float>(value);
    }
    std::array<double, 6> geotransform(const char* key) const {
        const json& list = at(key);
        std::array<double, 6> terms{};
        const auto good = [](const json& term) { return term.is_number() && std::isfinite(term.get<double>()); };
        if (!list.is_array() || list.size() != terms.size() || !std::all_of(list.begin(), list.end(), good) ||
            !(list[1].get<double>() > 0) || list[2] != 0 || list[4] != 0 || list[5] == 0)
            refuse(key, "null, or x, a step above 0, 0, y, 0 and a step that is not 0");
        std::transform(list.begin(), list.end(), terms.begin(), [](const json& term) { return term.get<double>(); });
        return terms;
    }
    std::string words(const char* key) const {
        if (!at(key).is_string()) refuse(key, "a text");
        return at(key).get<std::string>();
    }
    std::uint64_t sum(const char* key) const {
        const std::string digits = words(key);
        if (digits.empty() || digits.size() > sum_digits ||
            digits.find_first_not_of("0123456789abcdef") != std::string::npos)
            refuse(key, text("up to ", sum_digits, " digits 0-9, a-f"));
        return std::strtoull(digits.c_str(), nullptr, 16);
    }
    const json& itself() const { return object_; }

    [[noreturn]] void refuse(const char* key, const std::string& accepted) const {
        constexpr std::size_t longest = 60;
        const auto found = object_.find(key);
        std::string value = "missing";
        if (found != object_.end()) value = found->dump(-1, ' ', false, json::error_handler_t::replace);
        if (value.size() > longest) value = value.substr(0, longest) + "...";
        throw damaged_manifest(path_, text(name(), key, " is ", value, "; accepted: ", accepted));
    }

    static constexpr std::int64_t least = std::numeric_limits<std::int64_t>::min(),
                                  most = std::numeric_limits<std::int64_t>::max();

private:
    Members(const std::string& path, const json& object, const Members* above, const char* key, std::int64_t index)
        : path_(path), object_(object), above_(above), key_(key), index_(index) {
        if (object.is_object()) return;
        std::string own = name();
        if (!own.empty()) own.pop_back();
        throw damaged_manifest(path, text(own.empty() ? "it" : own, " is no JSON object"));
    }
    const json& at(const char* key) const {
        const auto found = object_.find(key);
        if (found == object_.end()) throw damaged_manifest(path_, text(name(), key, " is missing"));
        return *found;
    }
    /// Made up only where it is needed: sheets may be many.
    std::string name() const {
        if (!above_) return "";
        return text(above_->name(), key_, index_ < 0 ? std::string() : text("[", index_, "]"), ".");
    }

    const std::string& path_;
    const json& object_;
    const Members* above_;  ///< null: the whole
    const char* key_;
    std::int64_t index_;  ///< below 0: no array's
};

std::uint64_t from_hex(const json& value) { return std::strtoull(value.get<std::string>().c_str(), nullptr, 16); }

json to_json(const ValueFacts& v) {
    return {{"lowest", number(static_cast<double>(v.lowest))},
            {"highest", number(static_cast<double>(v.highest))},
            {"void_posts", v.voids}};
}
ValueFacts values_from(const Members& j) { return {j.height("lowest"), j.height("highest"), j.count("void_posts")}; }
ValueFacts values_from(const json& j) {
    return {static_cast<float>(number(j.at("lowest"))), static_cast<float>(number(j.at("highest"))),
            j.at("void_posts").get<std::uint64_t>()};
}

constexpr std::pair<const char*, CrsKind> crs_kinds[] = {{"geographic", CrsKind::geographic},
                                                         {"projected", CrsKind::projected},
                                                         {"geocentric", CrsKind::geocentric},
                                                         {"local", CrsKind::local}};

json to_json(const CrsFacts& f) {
    json out{{"revision", CrsFacts::revision},
             {"of", hex(checksum(f.wkt))},
             {"kind", nullptr},
             {"unit", f.unit},
             {"bound", f.bound},
             {"north_first", f.north_first},
             {"wgs84", f.wgs84},
             {"name", f.name},
             {"authority", f.authority},
             {"code", f.code},
             {"proj", f.proj_words},
             {"wkt1", f.wkt_of_old}};
    for (const auto& [word, kind] : crs_kinds)
        if (kind == f.kind) out["kind"] = word;
    if (const auto& m = f.mercator)
        out["transverse_mercator"] = {m->latitude_deg, m->longitude_deg, m->scale, m->easting_m, m->northing_m};
    if (const auto& g = f.in_geotiff)
        out["geotiff"] = {{"epsg", g->epsg},
                          {"geographic", g->geographic},
                          {"name", g->name},
                          {"geographic_name", g->geographic_name},
                          {"linear_unit", g->linear_unit},
                          {"semi_major", g->semi_major_m},
                          {"inverse_flattening", g->inverse_flattening}};
    return out;
}

/// Nothing where facts are not told, or of another WKT, or as another program asked for them.
std::optional<CrsFacts> crs_facts_from(const json& layer, const std::string& wkt) {
    const auto told = layer.find("crs_facts");
    if (told == layer.end() || !told->is_object()) return std::nullopt;
    const json& j = *told;
    if (j.value("revision", json()) != CrsFacts::revision || j.value("of", json()) != hex(checksum(wkt)))
        return std::nullopt;
    CrsFacts f;
    const auto kind = std::find_if(std::begin(crs_kinds), std::end(crs_kinds),
                                   [&](const auto& known) { return j.at("kind") == known.first; });
    if (kind == std::end(crs_kinds)) return std::nullopt;
    f.kind = kind->second;
    f.unit = j.at("unit").get<double>();
    f.bound = j.at("bound").get<bool>();
    f.north_first = j.at("north_first").get<bool>();
    f.wgs84 = j.at("wgs84").get<bool>();
    f.name = j.at("name").get<std::string>();
    f.authority = j.at("authority").get<std::string>();
    f.code = j.at("code").get<std::string>();
    f.proj_words = j.at("proj").get<std::string>();
    f.wkt = wkt;
    f.wkt_of_old = j.at("wkt1").get<std::string>();
    if (const auto m = j.find("transverse_mercator"); m != j.end())
        f.mercator = TransverseMercator{m->at(0).get<double>(), m->at(1).get<double>(), m->at(2).get<double>(),
                                        m->at(3).get<double>(), m->at(4).get<double>()};
    if (const auto g = j.find("geotiff"); g != j.end())
        f.in_geotiff = GeoTiffCrs{g->at("epsg").get<int>(),
                                  g->at("geographic").get<bool>(),
                                  g->at("name").get<std::string>(),
                                  g->at("geographic_name").get<std::string>(),
                                  g->at("linear_unit").get<int>(),
                                  g->at("semi_major").get<double>(),
                                  g->at("inverse_flattening").get<double>()};
    return f;
}

/// What PROJ knew of it when the store was made, if that is told; else PROJ is asked.
std::shared_ptr<const Crs> crs_from(const json& layer, const std::string& wkt, std::string& reason) {
    auto facts = crs_facts_from(layer, wkt);
    return facts ? Crs::remember(std::move(*facts)) : Crs::read(wkt, reason);
}

json to_json(const StoreLayerEntry& layer) {
    const RasterFacts& f = layer.facts;
    json out{{"name", name(layer.kind)},
             {"vrt", layer.vrt},
             {"vrt_checksum", hex(layer.vrt_checksum)},
             {"columns", f.columns},
             {"rows", f.rows},
             {"tile", f.block_columns},
             {"type", type_name(f.type)}};
    out["geotransform"] = f.has_geotransform ? json{f.corner_x, f.step_x, 0, f.corner_y, 0, f.step_y} : json(nullptr);
    out["crs"] = f.crs ? f.crs->wkt() : "";
    if (f.crs) out["crs_facts"] = to_json(f.crs->facts());
    out["metres_per_unit"] = f.metres_per_unit;
    out["scale"] = f.scale;
    out["offset"] = f.offset;
    out["unit"] = f.unit;
    out["no_data"] = f.has_no_data ? number(f.no_data) : json(nullptr);
    out["compression"] = f.compression;
    out["values"] = to_json(layer.values);
    out["sources"] = json::array();
    for (const StoreSource& s : layer.sources)
        out["sources"].push_back({{"path", s.path}, {"bytes", s.bytes}, {"mtime_s", s.mtime_s}});
    out["sheets"] = json::array();
    for (const StoreSheet& s : layer.sheets)
        out["sheets"].push_back({{"column", s.column},
                                 {"row", s.row},
                                 {"file", s.file},
                                 {"bytes", s.bytes},
                                 {"sums", s.sums},
                                 {"sums_checksum", hex(s.sums_checksum)}});
    return out;
}

StoreLayerEntry layer_from(const Members& j, const std::string& folder) {
    constexpr std::int64_t longest_side = std::numeric_limits<int>::max();
    constexpr StoreLayerKind kinds[] = {StoreLayerKind::dem, StoreLayerKind::culture, StoreLayerKind::culture_height};
    StoreLayerEntry layer;
    const auto word = j.words("name");
    const auto kind = std::find_if(std::begin(kinds), std::end(kinds), [&](auto known) { return word == name(known); });
    if (kind == std::end(kinds)) j.refuse("name", "dem, culture or culture_height");
    layer.kind = *kind;
    RasterFacts& f = layer.facts;
    layer.vrt = j.words("vrt");
    layer.vrt_checksum = j.sum("vrt_checksum");
    f.role = layer.kind == StoreLayerKind::culture_height ? "culture-height" : name(layer.kind);
    f.path = layer.kind == StoreLayerKind::dem ? folder : (std::filesystem::path(folder) / layer.vrt).string();
    f.driver = "tile store";
    f.columns = j.whole("columns", 1, longest_side);
    f.rows = j.whole("rows", 1, longest_side);
    constexpr const char* tiles = "64, 128, 256, 512, 1024 or 2048";
    f.block_columns = f.block_rows = j.whole("tile", 64, 2048, tiles);
    if ((f.block_columns & (f.block_columns - 1)) != 0) j.refuse("tile", tiles);
    f.type = type_by_name(j.words("type"));
    // GDAL, which knows what is complex, is loaded late, and here for nothing but rare names, which begin with C.
    if (f.type == GDT_Unknown || j.words("type").starts_with('C'))
        j.refuse("type", "a type of real numbers, such as Int16");
    f.type_bytes = type_bytes(f.type);
    if (j.has_value("geotransform")) {
        const auto g = j.geotransform("geotransform");
        f.has_geotransform = true;
        f.corner_x = g[0];
        f.step_x = g[1];
        f.corner_y = g[3];
        f.step_y = g[5];
    } else {
        f.corner_x = -0.5;
        f.corner_y = static_cast<double>(f.rows) - 0.5;
    }
    if (const auto wkt = j.words("crs"); !wkt.empty()) {
        std::string reason;
        std::shared_ptr<const Crs> crs;
        try {
            crs = crs_from(j.itself(), wkt, reason);
        } catch (const json::exception&) {
            j.refuse("crs_facts", "as tile writes it, or none");
        }
        if (!crs) throw DataError(text("'", folder, "': the CRS in the manifest cannot be understood: ", reason));
        set_crs(f, crs);
    }
    f.metres_per_unit = j.above_0("metres_per_unit");
    f.scale = j.finite("scale");
    f.offset = j.finite("offset");
    f.unit = j.words("unit");
    f.unit_m = unit_in_metres(f.unit).value_or(1);  // of an older build
    if (j.has_value("no_data")) {
        f.has_no_data = true;
        f.no_data = j.with_words("no_data");
    }
    f.compression = j.words("compression");
    layer.values = values_from(j.object("values"));
    j.each("sources", [&](const Members& s) {
        layer.sources.push_back({s.words("path"), s.count("bytes"), s.whole("mtime_s", Members::least, Members::most)});
    });
    j.each("sheets", [&](const Members& s) {
        StoreSheet sheet{s.whole("column", 0, layer.sheet_columns() - 1),
                         s.whole("row", 0, layer.sheet_rows() - 1),
                         s.words("file"),
                         s.words("sums"),
                         s.count("bytes"),
                         s.sum("sums_checksum")};
        if (!layer.sheets.empty() &&
            std::pair(sheet.row, sheet.column) <= std::pair(layer.sheets.back().row, layer.sheets.back().column))
            s.refuse(sheet.row < layer.sheets.back().row ? "row" : "column", "sheets row after row, each once");
        layer.sheets.push_back(std::move(sheet));
    });
    return layer;
}

}  // namespace

const char* name(StoreLayerKind kind) {
    return kind == StoreLayerKind::dem ? "dem" : kind == StoreLayerKind::culture ? "culture" : "culture_height";
}

void ValueFacts::add(const ValueFacts& other) {
    lowest = std::min(lowest, other.lowest);
    highest = std::max(highest, other.highest);
    voids += other.voids;
}

void Disagreement::add(const Disagreement& other) {
    const std::uint64_t sum = posts + other.posts, between = interpolated + other.interpolated;
    // Of several as large the first in the raster's order, so that no order of work shows.
    if (other.largest_m > largest_m ||
        (other.largest_m == largest_m && std::pair(other.row, other.column) < std::pair(row, column)))
        *this = other;
    posts = sum;
    interpolated = between;
}

StoreSource source_of(const std::string& path) {
    StoreSource source{path, 0, 0};
    struct stat facts {};
    if (::stat(path.c_str(), &facts) == 0 && S_ISREG(facts.st_mode)) {
        source.bytes = static_cast<std::uint64_t>(facts.st_size);
        source.mtime_s = static_cast<std::int64_t>(facts.st_mtime);
    }
    return source;
}

Window StoreLayerEntry::posts(std::int64_t column, std::int64_t row) const {
    return {{column * sheet_posts, std::min(facts.columns, (column + 1) * sheet_posts)},
            {row * sheet_posts, std::min(facts.rows, (row + 1) * sheet_posts)}};
}

const StoreLayerEntry* StoreManifest::layer(StoreLayerKind kind) const {
    for (const StoreLayerEntry& layer : layers)
        if (layer.kind == kind) return &layer;
    return nullptr;
}

std::string manifest_text(const StoreManifest& m) {
    json out{{"format", format_name}, {"version", m.version}, {"software", m.software}, {"layers", json::array()}};
    for (const StoreLayerEntry& layer : m.layers) out["layers"].push_back(to_json(layer));
    out["block_map"] = json{{"file", m.block_map}, {"checksum", hex(m.block_map_checksum)}};
    if (!m.detail_map.empty())
        out["detail_map"] =
            json{{"format", detail_map_format}, {"file", m.detail_map}, {"checksum", hex(m.detail_map_checksum)}};
    if (m.block_map_imprint) out["block_map"]["imprint"] = hex(*m.block_map_imprint);
    if (m.detail_map_imprint) out["detail_map"]["imprint"] = hex(*m.detail_map_imprint);
    out["plan"] = json{{"file", m.plan}, {"checksum", hex(m.plan_checksum)}};
    out["legend"] = m.legend_name.empty() ? json(nullptr) : json{{"name", m.legend_name}, {"csv", m.legend_csv}};
    if (m.height_scale) out["culture_height_scale"] = *m.height_scale;
    if (m.class_table) out["class_table"] = store_classes_name;
    // Of all bytes, its own digits taken for zeros.
    out["checksum"] = std::string(sum_digits, '0');
    std::string content = out.dump(1, ' ', false, json::error_handler_t::replace) + "\n";
    const std::size_t at = content.rfind(sum_key) + sum_key.size();
    content.replace(at, sum_digits, hex(checksum(content)));
    return content;
}

StoreManifest read_manifest(const std::string& folder) {
    const std::string path = (std::filesystem::path(folder) / manifest_name).string();
    std::string content = file_text(path, largest_manifest);
    const auto damaged = [&](const std::string& why) { return damaged_manifest(path, why); };
    const std::size_t found = content.rfind(sum_key);
    if (found == std::string::npos || found + sum_key.size() + sum_digits > content.size())
        throw damaged("it holds no checksum");
    const std::string sum = content.substr(found + sum_key.size(), sum_digits);
    content.replace(found + sum_key.size(), sum_digits, sum_digits, '0');
    if (sum != hex(checksum(content))) throw damaged("its content is not what its checksum says");
    const json all = parsed_json<json>(content);
    if (all.is_discarded()) throw damaged("it is no JSON");
    const Members j(path, all);
    if (const auto format = j.words("format"); format != format_name)
        throw DataError(text("'", path, "' has the format '", format, "'; accepted: ", format_name));
    StoreManifest m;
    m.version = j.whole("version", Members::least, Members::most);
    m.software = j.words("software");
    j.each("layers", [&](const Members& layer) {
        m.layers.push_back(layer_from(layer, folder));
        for (std::size_t i = 0; i + 1 < m.layers.size(); ++i)
            if (m.layers[i].kind == m.layers.back().kind) layer.refuse("name", "each layer once");
    });
    if (m.layers.empty() || m.layers[0].kind != StoreLayerKind::dem) throw damaged("it names no terrain");
    m.block_map = j.object("block_map").words("file");
    m.block_map_checksum = j.object("block_map").sum("checksum");
    if (j.object("block_map").has("imprint")) m.block_map_imprint = j.object("block_map").sum("imprint");
    if (j.has("detail_map")) {
        const Members map = j.object("detail_map");
        // One of another format is no map to us, and the store one without levels of detail.
        if (map.has("format") && map.whole("format", Members::least, Members::most) == detail_map_format) {
            m.detail_map = map.words("file");
            m.detail_map_checksum = map.sum("checksum");
            if (map.has("imprint")) m.detail_map_imprint = map.sum("imprint");
        }
    }
    m.plan = j.object("plan").words("file");
    m.plan_checksum = j.object("plan").sum("checksum");
    if (j.has_value("legend")) {
        m.legend_name = j.object("legend").words("name");
        m.legend_csv = j.object("legend").words("csv");
    }
    if (j.has("culture_height_scale")) m.height_scale = j.at_least_0("culture_height_scale");
    m.class_table = j.has("class_table");
    return m;
}

int overview_count(std::int64_t columns, std::int64_t rows, std::int64_t tile) {
    int count = 0;
    while (SheetSums::side(std::max(columns, rows), count) > tile) ++count;
    return count;
}

std::size_t SheetSums::index(int level, std::int64_t column, std::int64_t row) const {
    std::int64_t before = 0;
    for (int k = 0; k < level; ++k) before += across(k) * down(k);
    return static_cast<std::size_t>(before + (level < levels() ? row * across(level) + column : 0));
}

std::string sums_text(const SheetSums& s) {
    json head{{"columns", s.columns},
              {"rows", s.rows},
              {"tile", s.tile},
              {"file_bytes", s.file_bytes},
              {"file_checksum", hex(s.file_checksum)},
              {"values", to_json(s.values)}};
    if (s.disagreement.posts > 0)
        head["disagreement"] = {{"posts", s.disagreement.posts},
                                {"largest_m", static_cast<double>(s.disagreement.largest_m)},
                                {"column", s.disagreement.column},
                                {"row", s.disagreement.row},
                                {"kept_file", s.disagreement.kept_file},
                                {"other_file", s.disagreement.other_file},
                                {"interpolated", s.disagreement.interpolated}};
    if (s.codes.too_many()) {
        head["too_many_unknown_codes"] = {
            {"cells", s.codes.cells()}, {"least", s.codes.least()}, {"greatest", s.codes.greatest()}};
    } else if (!s.codes.empty()) {
        head["unknown_codes"] = json::array();
        for (const auto& [code, cells] : s.codes.counts()) head["unknown_codes"].push_back(json::array({code, cells}));
    }
    const std::string words = head.dump();
    const std::uint64_t length = words.size();
    std::string content(sums_magic);
    content.append(reinterpret_cast<const char*>(&length), sizeof(length));
    content += words;
    content.append(reinterpret_cast<const char*>(s.tiles.data()), s.tiles.size() * sizeof(std::uint64_t));
    const std::uint64_t sum = checksum(content);
    content.append(reinterpret_cast<const char*>(&sum), sizeof(sum));
    return content;
}

SheetSums read_sums(const std::string& path, std::optional<std::uint64_t> expected) {
    constexpr std::size_t most = std::size_t{1} << 24;
    const std::string content = file_text(path, most);
    const DataError damaged(text("checksum file '", path, "' is damaged"));
    std::uint64_t sum = 0, length = 0;
    if (content.size() < sums_magic.size() + 2 * sizeof(sum) || !content.starts_with(sums_magic)) throw damaged;
    if (expected && checksum(content) != *expected) throw damaged;
    const std::size_t end = content.size() - sizeof(sum);
    std::memcpy(&sum, content.data() + end, sizeof(sum));
    if (checksum(std::string_view(content).substr(0, end)) != sum) throw damaged;
    const std::size_t words = sums_magic.size() + sizeof(length);
    std::memcpy(&length, content.data() + sums_magic.size(), sizeof(length));
    if (length > end - words) throw damaged;
    SheetSums s;
    try {
        bool in_codes = false;
        // Pairs of unknown codes, of which there may be very many, are counted and forgotten one by one.
        const auto count = [&](int depth, json::parse_event_t event, const json& parsed) {
            if (event == json::parse_event_t::key && depth == 1) in_codes = parsed == "unknown_codes";
            if (!in_codes || event != json::parse_event_t::array_end || depth != 2) return true;
            s.codes.add(parsed.at(0).get<std::int32_t>(), parsed.at(1).get<std::uint64_t>());
            return false;
        };
        const auto first = content.begin() + static_cast<std::ptrdiff_t>(words);
        if (!is_shallow_json({content.data() + words, length})) throw damaged;
        const json head = json::parse(first, first + static_cast<std::ptrdiff_t>(length), count);
        s.columns = head.at("columns").get<std::int64_t>();
        s.rows = head.at("rows").get<std::int64_t>();
        s.tile = head.at("tile").get<std::int64_t>();
        s.file_bytes = head.at("file_bytes").get<std::uint64_t>();
        s.file_checksum = from_hex(head.at("file_checksum"));
        s.values = values_from(head.at("values"));
        if (head.contains("disagreement")) {
            const json& d = head.at("disagreement");
            s.disagreement = {
                d.at("posts").get<std::uint64_t>(),       static_cast<float>(d.at("largest_m").get<double>()),
                d.at("column").get<std::int64_t>(),       d.at("row").get<std::int64_t>(),
                d.at("kept_file").get<std::int64_t>(),    d.at("other_file").get<std::int64_t>(),
                d.value("interpolated", std::uint64_t{0})};
        }
        if (head.contains("too_many_unknown_codes")) {
            const json& many = head.at("too_many_unknown_codes");
            s.codes =
                CodeCounts::of_too_many(many.at("cells").get<std::uint64_t>(), many.at("least").get<std::int32_t>(),
                                        many.at("greatest").get<std::int32_t>());
        }
    } catch (const json::exception&) {
        throw damaged;
    }
    const std::size_t bytes = end - words - length;
    if (s.columns < 1 || s.rows < 1 || s.tile < 1 || s.columns > sheet_posts || s.rows > sheet_posts ||
        bytes != s.tile_count() * sizeof(std::uint64_t))
        throw damaged;
    s.tiles.resize(s.tile_count());
    std::memcpy(s.tiles.data(), content.data() + words + length, bytes);
    return s;
}

}  // namespace wedgescope
