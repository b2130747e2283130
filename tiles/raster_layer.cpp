#include "tiles/raster_layer.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>

#include "lib/error.hpp"
#include "lib/length.hpp"
#include "lib/lower_case.hpp"
#include "tiles/gdal_handle.hpp"

namespace wedgescope {

namespace {

struct PostType {
    GDALDataType type;
    const char* name;
    int bytes;
};
constexpr PostType usual_types[] = {
    {GDT_Byte, "Byte", 1},     {GDT_UInt16, "UInt16", 2},   {GDT_Int16, "Int16", 2},
    {GDT_UInt32, "UInt32", 4}, {GDT_Int32, "Int32", 4},     {GDT_UInt64, "UInt64", 8},
    {GDT_Int64, "Int64", 8},   {GDT_Float32, "Float32", 4}, {GDT_Float64, "Float64", 8}};

}  // namespace

std::string type_name(GDALDataType type) {
    for (const PostType& usual : usual_types)
        if (usual.type == type) return usual.name;
    return GDALGetDataTypeName(type);
}

GDALDataType type_by_name(const std::string& name) {
    for (const PostType& usual : usual_types)
        if (usual.name == name) return usual.type;
    return GDALGetDataTypeByName(name.c_str());
}

int type_bytes(GDALDataType type) {
    for (const PostType& usual : usual_types)
        if (usual.type == type) return usual.bytes;
    return GDALGetDataTypeSizeBytes(type);
}

namespace {

template <class From, class To>
void widen(const std::byte* from, std::byte* to, std::size_t n) {
    const std::byte *from_end = from + n * sizeof(From), *to_end = to + n * sizeof(To);
    if (to_end <= from || from_end <= to) {
        const auto* __restrict values = reinterpret_cast<const From*>(from);
        auto* __restrict wide = reinterpret_cast<To*>(to);
        for (std::size_t i = 0; i < n; ++i) wide[i] = static_cast<To>(values[i]);
        return;
    }
    // In one place: what is written never comes up with what is still to be read.
    constexpr std::size_t together = 64;
    const auto turn = [&](std::size_t i, std::size_t m) {
        From values[together]{};
        To wide[together];
        std::memcpy(values, from + i * sizeof(From), m * sizeof(From));
        for (std::size_t j = 0; j < together; ++j) wide[j] = static_cast<To>(values[j]);
        std::memcpy(to + i * sizeof(To), wide, m * sizeof(To));
    };
    std::size_t i = 0;
    for (; i + together <= n; i += together) turn(i, together);
    if (i < n) turn(i, n - i);
}

template <class To>
Widening widening_to(GDALDataType from) {
    switch (from) {
        case GDT_Byte:
            return widen<std::uint8_t, To>;
        case GDT_Int16:
            return widen<std::int16_t, To>;
        case GDT_UInt16:
            return widen<std::uint16_t, To>;
        case GDT_Int32:
            return widen<std::int32_t, To>;
        default:
            return nullptr;
    }
}

}  // namespace

Widening widening(GDALDataType from, GDALDataType to) {
    if (to == GDT_Int32) return widening_to<std::int32_t>(from);
    if (to != GDT_Float32) return nullptr;
    if (from == GDT_Float32) return widen<float, float>;
    if (from == GDT_UInt32) return widen<std::uint32_t, float>;
    return widening_to<float>(from);
}

void convert(const std::byte* from, GDALDataType from_type, std::byte* to, GDALDataType to_type, std::int64_t count) {
    if (const Widening widen = widening(from_type, to_type)) return widen(from, to, static_cast<std::size_t>(count));
    if (from_type == to_type) {
        std::memcpy(to, from, static_cast<std::size_t>(count * type_bytes(to_type)));
        return;
    }
    GDALCopyWords(from, from_type, type_bytes(from_type), to, to_type, type_bytes(to_type), static_cast<int>(count));
}

std::optional<double> unit_in_metres(std::string unit) {
    std::erase_if(unit, [](unsigned char c) { return !std::isalnum(c); });
    unit = lower_case(std::move(unit));
    // "metres above mean sea level" too.
    for (const char* word : {"", "m", "unknown", "unspecified", "none"})
        if (unit == word) return 1;
    if (unit.starts_with("metre") || unit.starts_with("meter")) return 1;
    const std::tuple<const char*, const char*, double> parts[] = {
        {"km", "kilo", 1e3}, {"dm", "deci", 1e-1}, {"cm", "centi", 1e-2}, {"mm", "milli", 1e-3}};
    for (const auto& [brief, prefix, metres] : parts)
        if (unit == brief || unit.starts_with(std::string(prefix) + "met")) return metres;
    for (const char* word : {"ft", "foot", "feet", "internationalfoot", "internationalfeet", "footinternational"})
        if (unit == word) return foot_m;
    for (const char* word : {"usft", "ftus", "sft", "ussurveyfoot", "ussurveyfeet", "footus", "surveyfoot",
                             "surveyfeet", "footussurvey", "usfoot", "usfeet"})
        if (unit == word) return 1200.0 / 3937;
    for (const char* word : {"yd", "yard", "yards"})
        if (unit == word) return 0.9144;
    return std::nullopt;
}

void set_grid(RasterFacts& facts, const std::array<double, 6>& g) {
    for (double term : g)
        if (!std::isfinite(term))
            throw DataError(text(facts.named(), " has a geotransform that is not finite: ", term));
    // A shear of less than a thousandth of a cell over the whole raster is rounding.
    if (std::fabs(g[2]) * static_cast<double>(facts.rows) > 1e-3 * std::fabs(g[1]) ||
        std::fabs(g[4]) * static_cast<double>(facts.columns) > 1e-3 * std::fabs(g[5]))
        throw DataError(text(facts.named(), " is rotated (geotransform ", g[1], " ", g[2], " ", g[4], " ", g[5],
                             "); accepted: rows that run east; ", warped_hint));
    if (!(g[1] > 0) || g[5] == 0)
        throw DataError(text(facts.named(), " has cells of ", g[1], " x ", g[5],
                             "; accepted: a width above 0 and a height that is not 0",
                             g[1] < 0 && g[5] != 0 ? text("; ", warped_hint) : ""));
    facts.has_geotransform = true;
    facts.corner_x = g[0];
    facts.step_x = g[1];
    facts.corner_y = g[3];
    facts.step_y = g[5];
}

void set_crs(RasterFacts& facts, std::shared_ptr<const Crs> given) {
    if (!given || !facts.has_geotransform) return;
    if (given->kind() == Crs::Kind::geocentric)
        throw DataError(
            text(facts.named(), " has a geocentric CRS; accepted: latitude and longitude, or a projection"));
    if (given->kind() == Crs::Kind::geographic) {
        if (std::fabs(given->unit() - 1) > 1e-9)
            throw DataError(
                text(facts.named(), " has angles in units of ", given->unit(), " degrees; accepted: degrees"));
        facts.geographic = true;
        facts.wgs84_lat_lon = given->is_wgs84();
    } else {
        facts.metres_per_unit = given->unit() > 0 ? given->unit() : 1;
        if (given->kind() != Crs::Kind::projected) return;  // a local grid: a plane with a unit, nowhere on earth
    }
    facts.crs = std::move(given);
}

void check_terrain_size(const RasterFacts& facts) {
    if (facts.columns < 2 || facts.rows < 2)
        throw DataError(
            text(facts.named(), " has ", facts.columns, " x ", facts.rows, " posts; accepted: at least 2 x 2"));
}

std::int64_t RasterFacts::cycle_columns() const {
    if (!crs || !geographic) return 0;
    // A thousandth of a post: steps written with ten digits still close the circle.
    const double circle = 360 / step_x;
    for (const std::int64_t cycle : {columns, columns - 1})
        if (std::fabs(static_cast<double>(cycle) - circle) <= 1e-3) return cycle;
    return 0;
}

std::int64_t RasterFacts::own_columns() const {
    const std::int64_t cycle = cycle_columns();
    return cycle > 0 ? cycle : columns;
}

double huge_no_data_sign(const RasterFacts& facts) {
    const bool floating = facts.type == GDT_Float32 || facts.type == GDT_Float64;
    if (!facts.has_no_data || !floating || !(std::fabs(facts.no_data) > huge_no_data)) return 0;
    return facts.no_data < 0 ? -1 : 1;
}

void RasterLayer::prepare() {
    // Whether each tile was read is kept, a byte for each (TileLedger).
    constexpr std::int64_t most_tiles = std::int64_t{1} << 30;
    const auto across = [](std::int64_t posts, std::int64_t tile) {
        return posts / std::max<std::int64_t>(tile, 1) + 1;
    };
    if (across(facts_.columns, facts_.unit_columns()) > most_tiles / across(facts_.rows, facts_.unit_rows()))
        throw DataError(text(facts_.named(), " has ", facts_.columns, " x ", facts_.rows, " posts in tiles of ",
                             facts_.unit_columns(), " x ", facts_.unit_rows(), "; accepted: ", most_tiles,
                             " (2^30) tiles at the most"));
    // The same conversion that the values go through: beyond float's range GDAL's.
    if (!(std::fabs(facts_.no_data) > static_cast<double>(std::numeric_limits<float>::max())))
        no_data_ = static_cast<float>(facts_.no_data);
    else
        GDALCopyWords(&facts_.no_data, GDT_Float64, 0, &no_data_, GDT_Float32, 0, 1);
    huge_sign_ = huge_no_data_sign(facts_);
    may_be_void_ = facts_.has_no_data || facts_.has_mask;
    const double largest = facts_.type == GDT_Byte     ? 255
                           : facts_.type == GDT_Int16  ? 32768
                           : facts_.type == GDT_UInt16 ? 65535
                                                       : 1e300;
    may_be_wild_ = (largest * std::fabs(facts_.scale) + std::fabs(facts_.offset)) * facts_.unit_m >
                   static_cast<double>(highest_height_m);
}

std::string place(const Window& window) {
    return text("columns ", window.columns.begin, " to ", window.columns.end - 1, ", rows ", window.rows.begin, " to ",
                window.rows.end - 1);
}

void RasterLayer::read_heights(const Window& window, float* out, std::int64_t stride) {
    if (window.empty()) return;
    read_values(window, out, GDT_Float32, stride * static_cast<std::int64_t>(sizeof(float)));
    make_heights(window, out, stride);
}

void RasterLayer::read_level(int level, const Window& window, float* out, std::int64_t stride) {
    if (level == 0) return read_heights(window, out, stride);
    // A few whole blocks at a time; of every 2^level-th post, the first.
    const std::int64_t post = std::int64_t{1} << level, wide = std::max<std::int64_t>(1, (2048 >> level)),
                       high = std::max<std::int64_t>(1, 128 >> level);
    std::vector<float> slab;
    for (std::int64_t r = window.rows.begin; r < window.rows.end;) {
        const Interval rows{r, std::min(window.rows.end, (r / high + 1) * high)};
        for (std::int64_t c = window.columns.begin; c < window.columns.end;) {
            const Interval columns{c, std::min(window.columns.end, (c / wide + 1) * wide)};
            const Window fine{{columns.begin * post, (columns.end - 1) * post + 1},
                              {rows.begin * post, (rows.end - 1) * post + 1}};
            slab.resize(static_cast<std::size_t>(fine.posts()));
            read_heights(fine, slab.data(), fine.columns.size());
            for (std::int64_t y = 0; y < rows.size(); ++y) {
                float* to = out + (rows.begin - window.rows.begin + y) * stride + columns.begin - window.columns.begin;
                const float* from = slab.data() + y * post * fine.columns.size();
                for (std::int64_t x = 0; x < columns.size(); ++x) to[x] = from[x * post];
            }
            c = columns.end;
        }
        r = rows.end;
    }
}

void RasterLayer::make_heights(const Window& window, float* out, std::int64_t stride, int level) {
    std::vector<std::uint8_t> masks;
    const bool masked = read_mask(window, masks);
    const bool scaled = facts_.scale != 1 || facts_.offset != 0 || facts_.unit_m != 1;
    if (!may_be_void_ && !may_be_wild_ && !scaled && !facts_.signed_byte) return;

    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    const std::int64_t n = window.columns.size();
    for (std::int64_t r = 0; r < window.rows.size(); ++r) {
        float* line = out + r * stride;
        if (facts_.signed_byte)
            for (std::int64_t c = 0; c < n; ++c) line[c] = line[c] > 127 ? line[c] - 256 : line[c];
        if (huge_sign_ != 0) {
            constexpr auto huge = static_cast<float>(huge_no_data);
            const auto sign = static_cast<float>(huge_sign_);
            for (std::int64_t c = 0; c < n; ++c) line[c] = line[c] * sign >= huge ? nan : line[c];
        } else if (facts_.has_no_data) {
            const float none = no_data_;
            for (std::int64_t c = 0; c < n; ++c) line[c] = line[c] == none ? nan : line[c];
        }
        if (masked) {
            const std::uint8_t* mask = masks.data() + r * n;
            for (std::int64_t c = 0; c < n; ++c) line[c] = mask[c] == 0 ? nan : line[c];
        }
        if (scaled) {
            const double scale = facts_.scale, offset = facts_.offset, unit = facts_.unit_m;
            for (std::int64_t c = 0; c < n; ++c)
                line[c] = static_cast<float>((static_cast<double>(line[c]) * scale + offset) * unit);
        }
        if (!may_be_wild_) continue;
        int wild = 0;
        for (std::int64_t c = 0; c < n; ++c) wild |= std::fabs(line[c]) > highest_height_m;
        if (!wild) continue;
        for (std::int64_t c = 0; c < n; ++c)
            if (std::fabs(line[c]) > highest_height_m)
                throw DataError(text(facts_.named(), ": height at column ", (window.columns.begin + c) << level,
                                     ", row ", (window.rows.begin + r) << level, " is ", line[c],
                                     " m; accepted: at most ", highest_height_m,
                                     " m either way, NaN or the declared no-data value"));
    }
}

void refuse_culture(const RasterFacts& facts, std::int64_t column, std::int64_t row, float value, double scale) {
    throw DataError(
        text(facts.named(), ": height at column ", column, ", row ", row, " is ", value,
             value < 0 ? " m; accepted: 0 and above"
                       : text(", and times ", scale, " (culture-height-scale) ", scale * static_cast<double>(value),
                              " m; accepted: at most ", highest_height_m, " m")));
}

void RasterLayer::read_codes(const Window& window, std::int32_t* out) {
    if (window.empty()) return;
    const auto n = static_cast<std::size_t>(window.posts());
    const std::int64_t width = window.columns.size();
    const bool narrow =
        facts_.type == GDT_Byte || facts_.type == GDT_Int16 || facts_.type == GDT_UInt16 || facts_.type == GDT_Int32;
    if (narrow) {
        read_values(window, out, GDT_Int32, width * static_cast<std::int64_t>(sizeof(std::int32_t)));
        if (facts_.signed_byte)
            for (std::size_t i = 0; i < n; ++i) out[i] = out[i] > 127 ? out[i] - 256 : out[i];
        if (facts_.has_no_data && facts_.no_data >= INT32_MIN && facts_.no_data <= INT32_MAX &&
            facts_.no_data == std::trunc(facts_.no_data)) {
            const auto none = static_cast<std::int32_t>(facts_.no_data);
            for (std::size_t i = 0; i < n; ++i) out[i] = out[i] == none ? void_code : out[i];
        }
    } else {
        std::vector<double> wide(n);
        read_values(window, wide.data(), GDT_Float64, width * static_cast<std::int64_t>(sizeof(double)));
        const double none = facts_.type == GDT_Float32 ? static_cast<double>(no_data_) : facts_.no_data;
        for (std::size_t i = 0; i < n; ++i) {
            const double v = wide[i];
            if (std::isnan(v) || (facts_.has_no_data && (v == none || v * huge_sign_ > huge_no_data))) {
                out[i] = void_code;
            } else if (v > INT32_MIN && v <= INT32_MAX && v == std::trunc(v)) {
                out[i] = static_cast<std::int32_t>(v);
            } else {
                const auto at = static_cast<std::int64_t>(i);
                throw DataError(text(
                    facts_.named(), ": code at column ", window.columns.begin + at % window.columns.size(), ", row ",
                    window.rows.begin + at / window.columns.size(), " is ", v, "; accepted: whole numbers of 32 bits"));
            }
        }
    }
    std::vector<std::uint8_t> masks;
    if (read_mask(window, masks))
        for (std::size_t i = 0; i < n; ++i) out[i] = masks[i] == 0 ? void_code : out[i];
}

double RasterLayer::decoded_a_post(std::int64_t block_columns, std::int64_t block_rows) const {
    // Blocks that a run of n posts touches on average, and what they hold.
    const auto ratio = [](std::int64_t block, std::int64_t posts) {
        constexpr std::int64_t window = 1024;
        const auto n = static_cast<double>(std::min(window, posts)), b = static_cast<double>(block);
        return std::min((1 + (n - 1) / b) * b, static_cast<double>(posts)) / n;
    };
    return ratio(block_columns, facts_.columns) * ratio(block_rows, facts_.rows);
}

double RasterLayer::all_bytes() const {
    const auto whole = [](std::int64_t posts, std::int64_t block) {
        return static_cast<double>((posts + block - 1) / block * block);
    };
    return whole(facts_.columns, facts_.unit_columns()) * whole(facts_.rows, facts_.unit_rows()) * facts_.type_bytes;
}

void fill_no_data(const RasterFacts& facts, std::byte* out, std::size_t count) {
    const double value = facts.has_no_data ? facts.no_data : 0;
    constexpr std::size_t most = std::size_t{1} << 24;  // GDAL counts in ints
    for (std::size_t at = 0; at < count; at += most)
        GDALCopyWords(&value, GDT_Float64, 0, out + at * static_cast<std::size_t>(facts.type_bytes), facts.type,
                      facts.type_bytes, static_cast<int>(std::min(most, count - at)));
}

void for_each_window(const RasterFacts& facts, std::int64_t columns, std::int64_t most_posts,
                     const std::function<void(const Window&)>& body) {
    // As many whole blocks side by side as fit; then as many rows of blocks; cut blocks only if one alone is too large.
    const std::int64_t block_rows = std::min(facts.unit_rows(), facts.rows);
    const std::int64_t block_columns = std::min(facts.unit_columns(), columns);
    std::int64_t wide = std::clamp(most_posts / block_rows / block_columns * block_columns, block_columns, columns);
    if (wide > most_posts) wide = most_posts;
    std::int64_t high = most_posts / wide;
    if (high >= block_rows) high = high / block_rows * block_rows;
    high = std::clamp<std::int64_t>(high, 1, facts.rows);
    for (std::int64_t r = 0; r < facts.rows; r += high)
        for (std::int64_t c = 0; c < columns; c += wide)
            body({{c, std::min(c + wide, columns)}, {r, std::min(r + high, facts.rows)}});
}

}  // namespace wedgescope
