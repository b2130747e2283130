#include "tiles/sources.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>
#include <mutex>
#include <numeric>
#include <stdexcept>
#include <utility>
#include <vector>

#include "lib/error.hpp"
#include "tiles/raster_file.hpp"

namespace wedgescope {
namespace {

constexpr std::int64_t slab_posts = std::int64_t{1} << 20;  ///< read and turned at a time: 4 MiB of floats
constexpr double degrees_round = 360;

// ---------------------------------------------------------------- where the terrain's posts are on earth

/// Between WGS84 latitude and longitude and the raster's columns and rows.
class Georeference {
public:
    explicit Georeference(const RasterFacts& facts) : facts_(facts) {
        if (facts_.wgs84_lat_lon) return;
        GdalErrors errors;
        const OGRSpatialReference wgs84 = wgs84_lon_lat();
        to_raster_.reset(OGRCreateCoordinateTransformation(&wgs84, facts_.crs.get()));
        to_wgs84_.reset(OGRCreateCoordinateTransformation(facts_.crs.get(), &wgs84));
        if (!to_raster_ || !to_wgs84_)
            throw DataError(text(facts_.named(), ": PROJ knows no way between WGS84 and its CRS '",
                                 crs_definition(*facts_.crs), "': ", errors.reason()));
    }

    IndexPosition locate(double lat_deg, double lon_deg) {
        double x = lon_deg, y = lat_deg;
        if (to_raster_) {
            const std::lock_guard lock(mutex_);
            GdalErrors errors;
            if (!transform(*to_raster_, x, y))
                throw DataError(text(facts_.named(), ": PROJ finds no place for latitude ", lat_deg, ", longitude ",
                                     lon_deg, " in its CRS '", crs_definition(*facts_.crs), "': ", errors.reason()));
        }
        IndexPosition at{(x - facts_.corner_x) / facts_.step_x - 0.5, (y - facts_.corner_y) / facts_.step_y - 0.5};
        if (facts_.geographic) {
            const double circle = degrees_round / facts_.step_x;
            const double middle = 0.5 * static_cast<double>(facts_.columns - 1);
            at.column -= circle * std::round((at.column - middle) / circle);
        }
        return at;
    }

    std::optional<std::pair<double, double>> lat_lon(double column, double row) {
        double x = facts_.corner_x + (column + 0.5) * facts_.step_x;
        double y = facts_.corner_y + (row + 0.5) * facts_.step_y;
        if (to_wgs84_) {
            const std::lock_guard lock(mutex_);
            GdalErrors quiet;
            if (!transform(*to_wgs84_, x, y)) return std::nullopt;
        }
        if (!(std::fabs(y) <= 90) || !std::isfinite(x)) return std::nullopt;
        return std::pair(y, std::fabs(x) <= 180 ? x : std::remainder(x, degrees_round));
    }

private:
    static bool transform(OGRCoordinateTransformation& way, double& x, double& y) {
        int good = 0;
        way.Transform(1, &x, &y, nullptr, &good);
        return good && std::isfinite(x) && std::isfinite(y);
    }

    RasterFacts facts_;
    std::mutex mutex_;
    std::unique_ptr<OGRCoordinateTransformation> to_raster_, to_wgs84_;
};

// ---------------------------------------------------------------- runs of columns

/// Part of a row of wanted columns that one window reads: `count` wanted from `at` on lie in source columns `source`.
struct Run {
    std::int64_t at = 0, count = 0;
    Interval source;
};

/// Cuts a list of source columns (-1: nowhere) where it jumps by more than `step` or turns.
std::vector<Run> runs(const std::vector<std::int64_t>& source, std::int64_t step) {
    std::vector<Run> found;
    const auto n = static_cast<std::int64_t>(source.size());
    for (std::int64_t i = 0; i < n;) {
        const std::int64_t first = source[static_cast<std::size_t>(i)];
        std::int64_t end = i + 1, last = first;
        for (; end < n; ++end) {
            const std::int64_t next = source[static_cast<std::size_t>(end)];
            if (first < 0 || next < last || next > last + step) break;
            last = next;
        }
        if (first >= 0) found.push_back({i, end - i, {first, last + 1}});
        i = end;
    }
    return found;
}

// ---------------------------------------------------------------- a second raster under the terrain's posts

/// Cell = floor(offset + scale * index) of the terrain's columns or rows.
struct Axis {
    double offset = 0.5, scale = 1;
    std::int64_t cells = 0;
    double circle = 0;  ///< cells in 360 degrees, 0 where there is no circle

    std::int64_t cell(std::int64_t index) const {
        return static_cast<std::int64_t>(std::floor(offset + scale * static_cast<double>(index)));
    }
    /// The cell of the raster that holds what lies in cell `i`, whole circles away if need be; -1 if none does.
    std::int64_t inside(std::int64_t i) const {
        if (i >= 0 && i < cells) return i;
        if (circle > 0)
            for (int turns : {-1, 1, -2, 2}) {
                const double moved = std::floor(static_cast<double>(i) + 0.5 + turns * circle);
                if (moved >= 0 && moved < static_cast<double>(cells)) return static_cast<std::int64_t>(moved);
            }
        return -1;
    }
    /// Cells that the terrain posts of `posts` and all between them lie in.
    Interval under(Interval posts) const {
        const std::int64_t a = cell(posts.begin), b = cell(posts.end - 1);
        return {std::min(a, b), std::max(a, b) + 1};
    }
};

Axis axis(double terrain_corner, double terrain_step, std::int64_t posts, double corner, double step,
          std::int64_t cells, bool longitude) {
    Axis out;
    out.cells = cells;
    if (longitude) {
        // The turn that brings the two middles together.
        out.circle = degrees_round / step;
        const double apart = terrain_corner + 0.5 * static_cast<double>(posts) * terrain_step -
                             (corner + 0.5 * static_cast<double>(cells) * step);
        corner += degrees_round * std::round(apart / degrees_round);
    }
    out.scale = terrain_step / step;
    out.offset = (terrain_corner + 0.5 * terrain_step - corner) / step;
    // Grids that are the same but for rounding are the same.
    const double n = static_cast<double>(posts);
    if (std::fabs(out.scale - 1) * n < 1e-6) {
        out.scale = 1;
        const double centre = std::floor(out.offset) + 0.5;
        if (std::fabs(out.offset - centre) < 1e-6) out.offset = centre;
    }
    return out;
}

std::string extent(const RasterFacts& facts) {
    return text("x ", std::min(facts.corner_x, facts.edge_x()), " to ", std::max(facts.corner_x, facts.edge_x()),
                ", y ", std::min(facts.corner_y, facts.edge_y()), " to ", std::max(facts.corner_y, facts.edge_y()));
}

std::string quoted(const std::string& word) {
    const bool plain = std::all_of(word.begin(), word.end(), [](unsigned char c) {
        return std::isalnum(c) || c == '/' || c == '.' || c == '_' || c == '-' || c == ':' || c == '+' || c == '=';
    });
    if (plain && !word.empty()) return word;
    std::string out = "'";
    for (char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

std::string warp_line(const RasterFacts& terrain, const RasterFacts& layer) {
    const std::filesystem::path source(layer.path);
    const std::string warped = (source.parent_path() / (source.stem().string() + "_warped.tif")).string();
    return text("gdalwarp -t_srs ", quoted(crs_definition(*terrain.crs)), " -r near -tr ", terrain.step_x, " ",
                std::fabs(terrain.step_y), " -te ", std::min(terrain.corner_x, terrain.edge_x()), " ",
                std::min(terrain.corner_y, terrain.edge_y()), " ", std::max(terrain.corner_x, terrain.edge_x()), " ",
                std::max(terrain.corner_y, terrain.edge_y()), " ", quoted(layer.path), " ", quoted(warped));
}

/// A raster registered to the terrain: culture or culture height.
struct Layer {
    RasterFile file;
    Axis columns, rows;

    Layer(const char* role, const std::string& path, const RasterFacts& terrain) : file(role, path) {
        const RasterFacts& facts = file.facts();
        if (facts.crs && terrain.crs) {
            const char* const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES", nullptr};
            GdalErrors quiet;
            if (!facts.crs->IsSame(terrain.crs.get(), options))
                throw DataError(text(facts.named(), " is in CRS '", crs_definition(*facts.crs), "', the dem in '",
                                     crs_definition(*terrain.crs),
                                     "'; accepted: the dem's; use: ", warp_line(terrain, facts)));
        }
        const bool same_size = facts.columns == terrain.columns && facts.rows == terrain.rows;
        if (facts.has_geotransform != terrain.has_geotransform || !facts.has_geotransform) {
            if (!same_size)
                throw DataError(text(facts.named(), " (", facts.columns, " x ", facts.rows, ") and the dem (",
                                     terrain.columns, " x ", terrain.rows,
                                     ") do not both have a geotransform; accepted without: rasters of the same size"));
            columns.cells = facts.columns;
            rows.cells = facts.rows;
            return;
        }
        columns = axis(terrain.corner_x, terrain.step_x, terrain.columns, facts.corner_x, facts.step_x, facts.columns,
                       terrain.geographic);
        rows = axis(terrain.corner_y, terrain.step_y, terrain.rows, facts.corner_y, facts.step_y, facts.rows, false);
        if (intersection(columns.under({0, terrain.columns}), {0, facts.columns}).empty() ||
            intersection(rows.under({0, terrain.rows}), {0, facts.rows}).empty())
            throw DataError(text(facts.named(), " (", extent(facts), ") does not touch the dem (", extent(terrain),
                                 "); accepted: rasters that overlap"));
    }
};

/// Lowest and highest of many floats, NaN left out; in lanes, so that no comparison waits for the one before.
class Range {
public:
    /// Returns the number of NaN.
    std::uint64_t add(const std::vector<float>& values) {
        std::uint32_t none[lanes] = {};
        const std::size_t whole = values.size() / lanes * lanes;
        for (std::size_t i = 0; i < whole; i += lanes)
            for (std::size_t k = 0; k < lanes; ++k) {
                const float z = values[i + k];
                none[k] += z != z;
                low_[k] = z < low_[k] ? z : low_[k];
                high_[k] = z > high_[k] ? z : high_[k];
            }
        for (std::size_t i = whole; i < values.size(); ++i) {
            const float z = values[i];
            none[0] += z != z;
            low_[0] = z < low_[0] ? z : low_[0];
            high_[0] = z > high_[0] ? z : high_[0];
        }
        return std::accumulate(std::begin(none), std::end(none), std::uint64_t{0});
    }
    float lowest() const { return *std::min_element(low_.begin(), low_.end()); }
    float highest() const { return *std::max_element(high_.begin(), high_.end()); }

private:
    static constexpr std::size_t lanes = 16;
    static std::array<float, lanes> filled(float value) {
        std::array<float, lanes> out;
        out.fill(value);
        return out;
    }
    std::array<float, lanes> low_ = filled(std::numeric_limits<float>::infinity());
    std::array<float, lanes> high_ = filled(-std::numeric_limits<float>::infinity());
};

// ---------------------------------------------------------------- the source

class DirectSource final : public WedgeSource {
public:
    explicit DirectSource(const DataBaseParams& params) : params_(params), terrain_("dem", params.dem) {
        const RasterFacts& facts = terrain_.facts();
        if (facts.columns < 2 || facts.rows < 2)
            throw DataError(
                text(facts.named(), " has ", facts.columns, " x ", facts.rows, " posts; accepted: at least 2 x 2"));
        describe(facts);
        if (!params.culture.empty()) open_culture(facts);
        if (!params.culture_height.empty()) {
            if (!(params.culture_height_scale >= 0) || !std::isfinite(params.culture_height_scale))
                throw InputError(
                    text("culture-height-scale is ", params.culture_height_scale, "; accepted: a number from 0 up"));
            height_ = std::make_unique<Layer>("culture-height", params.culture_height, facts);
            data_base_.has_culture_height = true;
        }
    }

    const DataBase& data_base() const override { return data_base_; }

    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        const Window& window = request.window;
        if (window.empty() || window.rows.begin < 0 || window.rows.end > data_base_.rows ||
            (!data_base_.cyclic && (window.columns.begin < 0 || window.columns.end > data_base_.columns)))
            throw std::out_of_range("load: window outside the raster");
        Chunk chunk;
        chunk.window = window;
        chunk.lines_are_columns = request.lines_are_columns;
        load_surface(chunk);
        return chunk;
    }

    LoadCost cost(const ChunkRequest& request) const override {
        const auto posts = static_cast<std::uint64_t>(request.window.posts());
        LoadCost cost{posts, posts * static_cast<std::uint64_t>(terrain_.facts().type_bytes), posts * sizeof(float), 0};
        const std::int64_t width = request.window.columns.size(), rows = request.window.rows.size();
        const auto slab = static_cast<std::size_t>(width * std::min(rows, std::max<std::int64_t>(1, slab_posts / width)));
        cost.beside_bytes = request.lines_are_columns ? slab * sizeof(float) : 0;
        if (height_) {
            const double cells = std::fabs(height_->columns.scale * height_->rows.scale);
            cost.bytes += static_cast<std::uint64_t>(static_cast<double>(posts) * cells) *
                          static_cast<std::uint64_t>(height_->file.facts().type_bytes);
            cost.chunk_bytes *= 2;
            cost.beside_bytes += 2 * slab * sizeof(float);
        }
        return cost;
    }

    std::uint64_t class_bytes(const Window& cells) const override {
        return WedgeSource::class_bytes(cells) * static_cast<std::uint64_t>(culture_->file.facts().type_bytes);
    }

    CultureCells load_classes(const Window& window) override {
        if (!culture_) throw std::out_of_range("load_classes: there is no culture");
        CultureCells cells;
        cells.window = window;
        cells.classes.assign(static_cast<std::size_t>(window.posts()), params_.default_class);
        bool any_unknown = false;
        const std::int64_t read =
            read_codes(window, [&](std::int64_t row, std::int64_t at, const std::int32_t* codes, std::int64_t n) {
                ClassId* to = cells.classes.data() + row * window.columns.size() + at;
                bool unknown = false;
                for (std::int64_t i = 0; i < n; ++i) {
                    const ClassId id = class_of(codes[i]);
                    unknown |= id == unknown_class;
                    to[i] = id;
                }
                any_unknown |= unknown;
            });
        cells.bytes_read = static_cast<std::uint64_t>(read * culture_->file.facts().type_bytes);
        if (!any_unknown) return cells;
        cells.codes.assign(cells.classes.size(), void_code);
        read_codes(window, [&](std::int64_t row, std::int64_t at, const std::int32_t* codes, std::int64_t n) {
            std::copy_n(codes, n, cells.codes.data() + row * window.columns.size() + at);
        });
        return cells;
    }

    float bare_terrain_m(std::int64_t column, std::int64_t row) override {
        if (data_base_.cyclic) column = wrapped(column);
        if (column < 0 || column >= data_base_.columns || row < 0 || row >= data_base_.rows)
            throw std::out_of_range("bare_terrain_m: post outside the raster");
        float z = 0;
        terrain_.read_heights({{column, column + 1}, {row, row + 1}}, &z, 1);
        return z;
    }

    Extremes extremes() override {
        const std::lock_guard lock(extremes_mutex_);
        if (!extremes_) extremes_ = find_extremes();
        return *extremes_;
    }

    std::size_t cache_bytes() const override { return params_.cache_bytes; }

private:
    void describe(const RasterFacts& facts) {
        DataBase& d = data_base_;
        d.name = facts.path;
        d.columns = facts.columns;
        d.rows = facts.rows;
        d.block_columns = facts.block_columns;
        d.block_rows = facts.block_rows;
        d.origin_x = facts.corner_x + 0.5 * facts.step_x;
        d.origin_y = facts.corner_y + 0.5 * facts.step_y;
        d.step_x = facts.step_x;
        d.step_y = facts.step_y;
        d.default_class = params_.default_class;
        d.has_crs = facts.crs != nullptr;
        d.crs_in_metres = !facts.geographic;
        d.metres_per_unit = facts.metres_per_unit;
        if (!facts.crs) return;
        char* wkt = nullptr;
        const char* const options[] = {"FORMAT=WKT2_2019", nullptr};
        if (facts.crs->exportToWkt(&wkt, options) == OGRERR_NONE && wkt) d.crs_wkt = wkt;
        CPLFree(wkt);
        if (facts.geographic) {
            // A thousandth of a post: steps written with ten digits still close the circle.
            const double circle = degrees_round / facts.step_x;
            for (std::int64_t cycle : {facts.columns, facts.columns - 1})
                if (!d.cyclic && std::fabs(static_cast<double>(cycle) - circle) <= 1e-3) {
                    d.cyclic = true;
                    d.cycle_columns = cycle;
                }
        }
        const auto where = std::make_shared<Georeference>(facts);
        d.locate = [where](double lat_deg, double lon_deg) { return where->locate(lat_deg, lon_deg); };
        d.lat_lon = [where](double column, double row) { return where->lat_lon(column, row); };
    }

    void open_culture(const RasterFacts& terrain) {
        if (!params_.legend)
            throw InputError(
                "culture needs culture-legend; accepted: fbfm40, nlcd, worldcover, smc or a CSV file of code,material");
        culture_ = std::make_unique<Layer>("culture", params_.culture, terrain);
        const RasterFacts& facts = culture_->file.facts();
        if (facts.scale != 1 || facts.offset != 0)
            throw DataError(text(facts.named(), " has band scale ", facts.scale, " and offset ", facts.offset,
                                 "; accepted: plain codes, scale 1 and offset 0"));
        data_base_.has_culture = true;
        data_base_.culture_name = params_.culture;
        data_base_.legend_name = params_.legend ? params_.legend->name() : "none";
        data_base_.culture_column_offset = culture_->columns.offset;
        data_base_.culture_column_scale = culture_->columns.scale;
        data_base_.culture_row_offset = culture_->rows.offset;
        data_base_.culture_row_scale = culture_->rows.scale;
        data_base_.culture_columns = facts.columns;
        data_base_.culture_rows = facts.rows;
        data_base_.culture_tile_columns = std::clamp<std::int64_t>(facts.block_columns, 64, 512);
        data_base_.culture_tile_rows = std::clamp<std::int64_t>(facts.block_rows, 64, 512);
        class_of_.resize(table_size, unknown_class);
        for (std::int32_t code = table_begin; code < table_begin + table_size; ++code)
            if (const auto id = params_.legend->find(code))
                class_of_[static_cast<std::size_t>(code - table_begin)] = *id;
    }

    std::int64_t wrapped(std::int64_t column) const {
        const std::int64_t cycle = data_base_.cycle_columns;
        const std::int64_t rest = column % cycle;
        return rest < 0 ? rest + cycle : rest;
    }

    /// The terrain columns of a window, in runs that can be read.
    std::vector<Run> terrain_runs(Interval columns) const {
        if (!data_base_.cyclic || (columns.begin >= 0 && columns.end <= data_base_.columns))
            return {{0, columns.size(), columns}};
        std::vector<std::int64_t> source(static_cast<std::size_t>(columns.size()));
        for (std::size_t i = 0; i < source.size(); ++i)
            source[i] = wrapped(columns.begin + static_cast<std::int64_t>(i));
        return runs(source, 1);
    }

    /// What is needed to read culture heights under a run of terrain columns.
    struct HeightPlan {
        std::vector<std::int64_t> cells;  ///< of each column; -1: none
        std::vector<Run> runs;
        std::int64_t widest = 1;
    };
    HeightPlan height_plan(Interval columns) const {
        HeightPlan plan;
        plan.cells.resize(static_cast<std::size_t>(columns.size()));
        for (std::size_t i = 0; i < plan.cells.size(); ++i)
            plan.cells[i] =
                height_->columns.inside(height_->columns.cell(columns.begin + static_cast<std::int64_t>(i)));
        plan.runs = runs(plan.cells, static_cast<std::int64_t>(std::ceil(height_->columns.scale)));
        for (const Run& run : plan.runs) plan.widest = std::max(plan.widest, run.source.size());
        return plan;
    }

    /// Scaled culture heights at the posts of `rows`, row after row; 0 where none is known. Returns posts read.
    std::int64_t read_culture_heights(const HeightPlan& plan, Interval rows, float* out, std::vector<float>& scratch) {
        const std::size_t width = plan.cells.size();
        std::fill_n(out, width * static_cast<std::size_t>(rows.size()), 0.0F);
        const Axis& axis = height_->rows;
        const Interval raster{0, axis.cells};
        // As many rows at a time as fit; one terrain row needs one row of the layer, however fine it is.
        const double per_row = std::max(1.0, std::fabs(axis.scale));
        const std::int64_t at_once = std::max<std::int64_t>(
            1, static_cast<std::int64_t>(static_cast<double>(slab_posts / plan.widest) / per_row));
        std::int64_t read = 0;
        for (std::int64_t r0 = rows.begin; r0 < rows.end; r0 += at_once) {
            const Interval part{r0, std::min(r0 + at_once, rows.end)};
            const Interval source = intersection(axis.under(part), raster);
            if (source.empty()) continue;
            for (const Run& run : plan.runs) {
                const Window window{run.source, source};
                scratch.resize(static_cast<std::size_t>(window.posts()));
                height_->file.read_heights(window, scratch.data(), window.columns.size());
                refuse_negative(window, scratch);
                read += window.posts();
                for (std::int64_t r = part.begin; r < part.end; ++r) {
                    const std::int64_t cell = axis.cell(r);
                    if (!source.contains(cell)) continue;
                    const float* from = scratch.data() + (cell - source.begin) * window.columns.size();
                    float* to = out + static_cast<std::size_t>(r - rows.begin) * width;
                    for (std::int64_t i = run.at; i < run.at + run.count; ++i) {
                        const float value = from[plan.cells[static_cast<std::size_t>(i)] - run.source.begin];
                        to[i] = std::isnan(value)
                                    ? 0.0F
                                    : static_cast<float>(params_.culture_height_scale * static_cast<double>(value));
                    }
                }
            }
        }
        return read;
    }

    void refuse_negative(const Window& window, const std::vector<float>& values) const {
        for (std::size_t i = 0; i < values.size(); ++i)
            if (values[i] < 0) {
                const auto at = static_cast<std::int64_t>(i);
                throw DataError(text(height_->file.facts().named(), ": height at column ",
                                     window.columns.begin + at % window.columns.size(), ", row ",
                                     window.rows.begin + at / window.columns.size(), " is ", values[i],
                                     "; accepted: 0 and above"));
            }
    }

    /// Rows read at a time for a window so wide: whole rows of blocks where they fit.
    std::vector<Interval> slabs(Interval rows, std::int64_t width) const {
        const std::int64_t block = data_base_.block_rows;
        std::int64_t high = std::max<std::int64_t>(1, slab_posts / width);
        if (high >= block) high = high / block * block;
        std::vector<Interval> found;
        for (std::int64_t r = rows.begin; r < rows.end;) {
            std::int64_t end = r + high;
            if (high >= block) end -= end % block;  // to the next edge of blocks
            end = std::min(end, rows.end);
            found.push_back({r, end});
            r = end;
        }
        return found;
    }

    /// Row-major `from` (rows x width) into lines of columns of `minor` posts, from post `at` of each line on.
    static void turn(const float* from, std::int64_t rows, std::int64_t width, float* to, std::int64_t minor,
                     std::int64_t at) {
        constexpr std::int64_t edge = 16;  // 16 floats fill a cache line
        for (std::int64_t r0 = 0; r0 < rows; r0 += edge)
            for (std::int64_t c0 = 0; c0 < width; c0 += edge) {
                const std::int64_t r1 = std::min(r0 + edge, rows), c1 = std::min(c0 + edge, width);
                for (std::int64_t c = c0; c < c1; ++c)
                    for (std::int64_t r = r0; r < r1; ++r) to[c * minor + at + r] = from[r * width + c];
            }
    }

    void load_surface(Chunk& chunk) {
        const Interval columns = chunk.window.columns, rows = chunk.window.rows;
        const std::int64_t width = columns.size(), minor = chunk.minor_count();
        const auto posts = static_cast<std::size_t>(chunk.window.posts());
        const std::vector<Run> terrain = terrain_runs(columns);
        HeightPlan plan;
        if (height_) plan = height_plan(columns);
        chunk.surface_m.resize(posts);
        std::vector<float> slab, culture, scratch;
        for (const Interval part : slabs(rows, width)) {
            const auto n = static_cast<std::size_t>(part.size() * width);
            const std::int64_t first = part.begin - rows.begin;
            float* surface = chunk.surface_m.data() + first * width;
            if (chunk.lines_are_columns) {
                slab.resize(n);
                surface = slab.data();
            }
            for (const Run& run : terrain) terrain_.read_heights({run.source, part}, surface + run.at, width);
            chunk.posts_read += n;
            chunk.bytes_read += n * static_cast<std::size_t>(terrain_.facts().type_bytes);
            if (height_) {
                culture.resize(n);
                const std::int64_t read = read_culture_heights(plan, part, culture.data(), scratch);
                chunk.bytes_read += static_cast<std::size_t>(read * height_->file.facts().type_bytes);
                if (std::any_of(culture.begin(), culture.end(), [](float h) { return h != 0; })) {
                    for (std::size_t i = 0; i < n; ++i) surface[i] += culture[i];
                    chunk.culture_height_m.resize(posts);
                    if (chunk.lines_are_columns)
                        turn(culture.data(), part.size(), width, chunk.culture_height_m.data(), minor, first);
                    else
                        std::copy(culture.begin(), culture.end(), chunk.culture_height_m.begin() + first * width);
                }
            }
            if (chunk.lines_are_columns) turn(slab.data(), part.size(), width, chunk.surface_m.data(), minor, first);
        }
    }

    /// Calls body(row, at, codes, n) for every run of culture cells in the window that the raster holds.
    template <class Body>
    std::int64_t read_codes(const Window& window, Body&& body) {
        std::vector<std::int64_t> cells(static_cast<std::size_t>(window.columns.size()));
        for (std::size_t i = 0; i < cells.size(); ++i)
            cells[i] = culture_->columns.inside(window.columns.begin + static_cast<std::int64_t>(i));
        const std::vector<Run> found = runs(cells, 1);
        const Interval rows = intersection(window.rows, {0, culture_->rows.cells});
        std::vector<std::int32_t> codes;
        std::int64_t read = 0;
        const std::int64_t block = culture_->file.facts().block_rows;
        for (const Run& run : found)
            for (std::int64_t r = rows.begin; r < rows.end;) {
                std::int64_t end = r + std::max<std::int64_t>(1, slab_posts / run.source.size());
                if (end - r >= block) end -= end % block;
                end = std::min(end, rows.end);
                const Window part{run.source, {r, end}};
                codes.resize(static_cast<std::size_t>(part.posts()));
                culture_->file.read_codes(part, codes.data());
                read += part.posts();
                for (std::int64_t y = r; y < end; ++y)
                    body(y - window.rows.begin, run.at, codes.data() + (y - r) * part.columns.size(),
                         part.columns.size());
                r = end;
            }
        return read;
    }

    ClassId class_of(std::int32_t code) const {
        const std::int64_t at = static_cast<std::int64_t>(code) - table_begin;
        if (at >= 0 && at < table_size) return class_of_[static_cast<std::size_t>(at)];
        if (code == void_code) return params_.default_class;
        return params_.legend->find(code).value_or(unknown_class);
    }

    Extremes find_extremes() {
        Extremes out;
        Range bare, surface;
        std::vector<float> terrain, culture, scratch;
        const std::int64_t width = data_base_.cyclic ? data_base_.cycle_columns : data_base_.columns;
        for_each_window(terrain_.facts(), width, slab_posts, [&](const Window& window) {
            const auto n = static_cast<std::size_t>(window.posts());
            terrain.resize(n);
            terrain_.read_heights(window, terrain.data(), window.columns.size());
            out.void_posts += bare.add(terrain);
            if (!height_) return;
            culture.resize(n);
            read_culture_heights(height_plan(window.columns), window.rows, culture.data(), scratch);
            for (std::size_t i = 0; i < n; ++i) terrain[i] += culture[i];
            surface.add(terrain);
        });
        out.any_valid = bare.lowest() <= bare.highest();
        if (out.any_valid) {
            out.lowest_m = bare.lowest();
            out.highest_m = height_ ? surface.highest() : bare.highest();
        }
        return out;
    }

    static constexpr std::int32_t table_begin = -32768, table_size = 32768 + 65536;

    DataBaseParams params_;
    RasterFile terrain_;
    std::unique_ptr<Layer> culture_, height_;
    std::vector<ClassId> class_of_;  ///< of codes from table_begin on
    DataBase data_base_;
    std::mutex extremes_mutex_;
    std::optional<Extremes> extremes_;
};

}  // namespace

std::unique_ptr<WedgeSource> open_direct_source(const DataBaseParams& params) {
    if (params.dem.empty()) throw InputError("dem is missing; accepted: the path of a raster of heights");
    return std::make_unique<DirectSource>(params);
}

}  // namespace wedgescope
