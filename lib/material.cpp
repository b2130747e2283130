#include "lib/material.hpp"

#include <charconv>
#include <string_view>
#include <utility>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

std::string_view trimmed(std::string_view s) {
    constexpr std::string_view space = " \t\r\n";
    const std::size_t first = s.find_first_not_of(space);
    if (first == std::string_view::npos) return {};
    s = s.substr(first, s.find_last_not_of(space) - first + 1);
    if (s.size() >= 2 && s.front() == '"' && s.back() == '"') return trimmed(s.substr(1, s.size() - 2));
    return s;
}

std::optional<int> integer(std::string_view s) {
    int value = 0;
    const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
    if (error != std::errc() || end != s.data() + s.size() || s.empty()) return std::nullopt;
    return value;
}

std::optional<ClassId> class_named(std::string_view name) {
    const std::vector<Material>& table = material_table();
    for (std::size_t id = 0; id < table.size(); ++id)
        if (name == table[id].name) return static_cast<ClassId>(id);
    return std::nullopt;
}

std::string accepted_words() {
    std::string words;
    for (const Material& material : material_table()) words += (words.empty() ? "" : ", ") + std::string(material.name);
    return words;
}

struct CodeRange {
    int first, last;
    ClassId id;
};

template <std::size_t n>
Legend legend(const char* name, const CodeRange (&ranges)[n]) {
    std::map<int, ClassId> classes;
    for (const CodeRange& range : ranges)
        for (int code = range.first; code <= range.last; ++code) classes[code] = range.id;
    return Legend(name, std::move(classes));
}

// Physics 7.4: LANDFIRE's 40 fuel models of Scott & Burgan.
constexpr CodeRange fbfm40[] = {{91, 91, 10},  {92, 92, 1},   {93, 93, 6},   {98, 98, 0},  {99, 99, 4},
                                {101, 109, 5}, {121, 149, 7}, {161, 189, 8}, {201, 204, 8}};
// USGS NLCD 2016 / 2021.
constexpr CodeRange nlcd[] = {{11, 11, 0}, {12, 12, 1}, {21, 22, 10}, {23, 24, 11}, {31, 31, 2}, {41, 43, 8},
                              {51, 52, 7}, {71, 74, 5}, {81, 81, 5},  {82, 82, 6},  {90, 90, 8}, {95, 95, 9}};
// ESA WorldCover v100 / v200.
constexpr CodeRange worldcover[] = {{10, 10, 8}, {20, 20, 7}, {30, 30, 5}, {40, 40, 6}, {50, 50, 11}, {60, 60, 2},
                                    {70, 70, 1}, {80, 80, 0}, {90, 90, 9}, {95, 95, 8}, {100, 100, 5}};
// DFAD surface material category.
constexpr CodeRange smc[] = {{1, 1, 15}, {2, 2, 14}, {3, 3, 11},  {4, 4, 10},  {5, 5, 4},   {6, 6, 0},   {7, 7, 2},
                             {8, 8, 3},  {9, 9, 12}, {10, 10, 4}, {11, 11, 9}, {12, 12, 8}, {13, 13, 1}, {14, 14, 13}};

}  // namespace

const std::vector<Material>& material_table() {
    constexpr std::optional<double> none;
    using enum UlabyDobsonClass;
    static const std::vector<Material> table = {
        {"water", none, none},  // at sea-state 0
        {"snow", -15, none, soil},
        {"sand", -20, none, soil, BareSoil{permittivity_by_name("material", "dry-sand"), 0.005}},
        {"rock", -12, none, soil},
        {"soil", -17, -8, soil, BareSoil{permittivity_by_name("material", "dry-soil"), 0.01}},
        {"grass", -16, none, grass},
        {"crops", -15, none, short_vegetation},
        {"shrub", -15, none, shrubs},
        {"trees", -12, -10, shrubs},
        {"marsh", -18, none, short_vegetation},
        {"suburban", -7, 0},
        {"urban", -2, 5},
        {"concrete", -20, 5},
        {"asphalt", -22, none},
        {"part-metal", 3, 10},
        {"metal", 6, 15},
    };
    return table;
}

ClassId material_by_name(const std::string& key, const std::string& name) {
    if (const std::optional<ClassId> id = class_named(name)) return *id;
    throw InputError(text(key, " is '", name, "'; it must be one of ", accepted_words()));
}

std::vector<ClassGamma> gamma_table(double frequency_hz, std::optional<Decibel> constant) {
    const auto linear = [&](double gamma10_db) { return gamma_at(Decibel(gamma10_db), frequency_hz).ratio(); };
    std::vector<ClassGamma> gammas;
    for (const Material& material : material_table()) {
        if (constant) {
            gammas.push_back({linear(constant->db()), linear(constant->db())});
        } else if (!material.gamma10_db) {
            gammas.push_back({0, 0});
        } else {
            gammas.push_back(
                {linear(*material.gamma10_db), linear(material.gamma_wall10_db.value_or(*material.gamma10_db))});
        }
    }
    return gammas;
}

BackscatterLaw ground_law(const Material& material, LandModel model, double frequency_hz, Polarisation polarisation) {
    if (model == LandModel::ulaby_dobson && material.ulaby_dobson)
        return ulaby_dobson_law(*material.ulaby_dobson, frequency_hz, polarisation);
    if (model == LandModel::oh && material.bare_soil) return oh_law(*material.bare_soil, frequency_hz, polarisation);
    if (!material.gamma10_db) return BackscatterLaw::constant_gamma(0);
    return BackscatterLaw::constant_gamma(gamma_at(Decibel(*material.gamma10_db), frequency_hz).ratio());
}

Legend::Legend(std::string name, std::map<int, ClassId> classes)
    : name_(std::move(name)), classes_(std::move(classes)) {}

std::optional<Legend> Legend::built_in(const std::string& name) {
    if (name == "fbfm40") return legend("fbfm40", fbfm40);
    if (name == "nlcd") return legend("nlcd", nlcd);
    if (name == "worldcover") return legend("worldcover", worldcover);
    if (name == "smc") return legend("smc", smc);
    return std::nullopt;
}

Legend Legend::from_csv(const std::string& source, const std::string& content) {
    std::string_view rest = content;
    if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);
    std::map<int, ClassId> classes;
    bool first_line = true;
    for (int number = 1; !rest.empty(); ++number) {
        const std::size_t end = rest.find('\n');
        const std::string_view line = trimmed(rest.substr(0, rest.find_first_of("#\n")));
        rest = end == std::string_view::npos ? std::string_view{} : rest.substr(end + 1);
        if (line.empty()) continue;
        const bool header_allowed = std::exchange(first_line, false);

        const auto fail = [&](const std::string& what) {
            throw InputError(text(source, ", line ", number, ": ", what));
        };
        const std::size_t comma = line.find(',');
        if (comma == std::string_view::npos) fail(text("'", line, "' has no comma; a line is code,material"));
        const std::string_view code_text = trimmed(line.substr(0, comma));
        const std::string_view name = trimmed(line.substr(comma + 1));
        const std::optional<int> code = integer(code_text);
        if (!code) {
            // A header has words on both sides; a mistyped code stands beside a material.
            if (header_allowed && !class_named(name) && !integer(name)) continue;
            fail(text("code is '", code_text, "'; it must be a whole number"));
        }
        std::optional<ClassId> id = class_named(name);
        const std::optional<int> number_of_class = integer(name);
        if (!id && number_of_class && *number_of_class >= 0 && std::cmp_less(*number_of_class, material_table().size()))
            id = static_cast<ClassId>(*number_of_class);
        if (!id)
            fail(text("material is '", name, "'; it must be one of ", accepted_words(),
                      ", or a class number from 0 to ", material_table().size() - 1));
        if (!classes.emplace(*code, *id).second)
            fail(text("code ", *code, " has a line already; each code may have one"));
    }
    if (classes.empty()) throw InputError(text(source, " names no code; it must hold lines code,material"));
    return Legend(source, std::move(classes));
}

std::optional<ClassId> Legend::find(int code) const {
    const auto found = classes_.find(code);
    if (found == classes_.end()) return std::nullopt;
    return found->second;
}

}  // namespace wedgescope
