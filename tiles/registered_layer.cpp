#include "tiles/registered_layer.hpp"

#include <cctype>
#include <cmath>
#include <filesystem>
#include <utility>

#include "lib/error.hpp"
#include "tiles/gdal_handle.hpp"

namespace wedgescope {
namespace {

Axis axis(double terrain_corner, double terrain_step, std::int64_t posts, double corner, double step,
          std::int64_t cells, bool longitude) {
    Axis out;
    out.cells = cells;
    if (longitude) {
        // The turn that brings the two middles together.
        out.circle = 360 / step;
        const double apart = terrain_corner + 0.5 * static_cast<double>(posts) * terrain_step -
                             (corner + 0.5 * static_cast<double>(cells) * step);
        corner += 360 * std::round(apart / 360);
    }
    out.scale = terrain_step / step;
    out.offset = (terrain_corner + 0.5 * terrain_step - corner) / step;
    // Grids that are the same but for rounding are the same.
    const double n = static_cast<double>(posts);
    if (std::fabs(out.scale - 1) * n < 1e-6) {
        out.scale = 1;
        const double centre = std::floor(out.offset) + 0.5;
        if (std::fabs(out.offset - centre) < 1e-6) out.offset = centre;
    } else {
        // A post on the edge of two cells lies in the second, along columns as along rows: no rounding chooses.
        out.offset += 1e-6;
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

/// For gdalwarp, a value that no height is, and hardly a code.
std::string no_data_words(const RasterFacts& layer) {
    const bool is_unsigned = (layer.type == GDT_Byte && !layer.signed_byte) || layer.type == GDT_UInt16 ||
                             layer.type == GDT_UInt32 || layer.type == GDT_UInt64;
    if (layer.signed_byte || (layer.type_bytes == 1 && layer.type != GDT_Byte)) return " -dstnodata -128";
    if (!is_unsigned) return " -dstnodata -32768";
    if (layer.role != "culture") return " -ot Int32 -dstnodata -32768";
    return layer.type == GDT_Byte ? " -dstnodata 255" : " -dstnodata 65535";
}

/// What lies over the terrain is wanted where that is; more terrain, which may lie beside it, where it is itself.
std::string warp_line(const RasterFacts& terrain, const RasterFacts& layer) {
    const std::filesystem::path source(layer.path);
    const std::string warped = (source.parent_path() / (source.stem().string() + "_warped.tif")).string();
    const bool beside = layer.role == terrain.role;
    const std::string where =
        text(" -te ", std::min(terrain.corner_x, terrain.edge_x()), " ", std::min(terrain.corner_y, terrain.edge_y()),
             " ", std::max(terrain.corner_x, terrain.edge_x()), " ", std::max(terrain.corner_y, terrain.edge_y()));
    // Corners that the turned raster does not reach are no ground at 0 m, nor cells of class 0.
    const std::string nothing = layer.has_no_data ? "" : no_data_words(layer);
    return text("gdalwarp -t_srs ", quoted(terrain.crs->definition()), beside ? " -r bilinear" : " -r near", nothing,
                " -tr ", terrain.step_x, " ", std::fabs(terrain.step_y), beside ? "" : where, " ", quoted(layer.path),
                " ", quoted(warped));
}

}  // namespace

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

std::int64_t Axis::cell(std::int64_t index) const {
    return static_cast<std::int64_t>(std::floor(offset + scale * static_cast<double>(index)));
}

std::int64_t Axis::inside(std::int64_t i) const {
    if (i >= 0 && i < cells) return i;
    if (circle > 0)
        for (int turns : {-1, 1, -2, 2}) {
            const double moved = std::floor(static_cast<double>(i) + 0.5 + turns * circle);
            if (moved >= 0 && moved < static_cast<double>(cells)) return static_cast<std::int64_t>(moved);
        }
    return -1;
}

Interval Axis::under(Interval posts) const {
    const std::int64_t a = cell(posts.begin), b = cell(posts.end - 1);
    return {std::min(a, b), std::max(a, b) + 1};
}

void refuse_other_crs(const RasterFacts& layer, const RasterFacts& terrain, const std::string& dem) {
    if (!layer.crs || !terrain.crs) return;
    if (!layer.crs->same_as(*terrain.crs))
        throw DataError(text(layer.named(), " is in CRS '", layer.crs->definition(), "', ", dem, " in '",
                             terrain.crs->definition(), "'; accepted: that of ", dem,
                             "; use: ", warp_line(terrain, layer)));
}

void refuse_scaled_codes(const RasterFacts& layer) {
    if (layer.scale != 1 || layer.offset != 0)
        throw DataError(text(layer.named(), " has band scale ", layer.scale, " and offset ", layer.offset,
                             "; accepted: plain codes, scale 1 and offset 0"));
}

RegisteredLayer::RegisteredLayer(std::unique_ptr<RasterLayer> raster, const RasterFacts& terrain)
    : raster_(std::move(raster)), ledger_(std::make_unique<TileLedger>(raster_->facts())) {
    const RasterFacts& own = raster_->facts();
    refuse_other_crs(own, terrain, "the dem");
    const bool same_size = own.columns == terrain.columns && own.rows == terrain.rows;
    if (own.has_geotransform != terrain.has_geotransform || !own.has_geotransform) {
        if (!same_size)
            throw DataError(text(own.named(), " (", own.columns, " x ", own.rows, ") and the dem (", terrain.columns,
                                 " x ", terrain.rows,
                                 ") do not both have a geotransform; accepted without: rasters of the same size"));
        columns_.cells = own.columns;
        rows_.cells = own.rows;
        return;
    }
    columns_ = axis(terrain.corner_x, terrain.step_x, terrain.columns, own.corner_x, own.step_x, own.columns,
                    terrain.geographic);
    rows_ = axis(terrain.corner_y, terrain.step_y, terrain.rows, own.corner_y, own.step_y, own.rows, false);
    if (intersection(columns_.under({0, terrain.columns}), {0, own.columns}).empty() ||
        intersection(rows_.under({0, terrain.rows}), {0, own.rows}).empty())
        throw DataError(text(own.named(), " (", extent(own), ") does not touch the dem (", extent(terrain),
                             "); accepted: rasters that overlap"));
}

RegisteredLayer::Plan RegisteredLayer::plan(Interval columns) const {
    Plan plan;
    plan.columns = columns;
    plan.cells.resize(static_cast<std::size_t>(columns.size()));
    for (std::size_t i = 0; i < plan.cells.size(); ++i)
        plan.cells[i] = columns_.inside(columns_.cell(columns.begin + static_cast<std::int64_t>(i)));
    plan.runs = runs(plan.cells, static_cast<std::int64_t>(std::ceil(columns_.scale)));
    for (const Run& run : plan.runs) plan.widest = std::max(plan.widest, run.source.size());
    return plan;
}

std::int64_t RegisteredLayer::read_heights(const Plan& plan, Interval rows, double scale, const NeededPosts& needed,
                                           float* out, std::vector<float>& scratch) {
    const std::size_t width = plan.cells.size();
    std::fill_n(out, width * static_cast<std::size_t>(rows.size()), 0.0F);
    const Interval all_rows{0, rows_.cells};
    // As many rows at a time as fit; one terrain row needs one row of the layer, however fine it is.
    const double per_row = std::max(1.0, std::fabs(rows_.scale));
    const std::int64_t at_once =
        std::max<std::int64_t>(1, static_cast<std::int64_t>(static_cast<double>(near_posts / plan.widest) / per_row));
    std::int64_t read = 0;
    for (std::int64_t r0 = rows.begin; r0 < rows.end; r0 += at_once) {
        const Interval part{r0, std::min(r0 + at_once, rows.end)};
        const Interval source = intersection(rows_.under(part), all_rows);
        if (source.empty()) continue;
        for (const Run& run : plan.runs) {
            const Window window{run.source, source};
            const std::int64_t stride = window.columns.size();
            scratch.assign(static_cast<std::size_t>(window.posts()), 0.0F);
            // The posts whose cells lie in a rectangle of cells: both axes run one way.
            const auto reason = [&](const Window& cells) {
                const auto first = plan.cells.begin() + run.at, last = first + run.count;
                const Interval across{
                    plan.columns.begin + (std::lower_bound(first, last, cells.columns.begin) - plan.cells.begin()),
                    plan.columns.begin + (std::lower_bound(first, last, cells.columns.end) - plan.cells.begin())};
                Interval down{part.end, part.begin};
                for (std::int64_t r = part.begin; r < part.end; ++r)
                    if (cells.rows.contains(rows_.cell(r))) down = {std::min(down.begin, r), r + 1};
                if (across.empty() || down.empty()) return Skip::range;
                return needed.reason({across, down});
            };
            const auto take = [&](const Window& cells) {
                float* to = scratch.data() + (cells.rows.begin - source.begin) * stride + cells.columns.begin -
                            run.source.begin;
                ledger_->touch(cells);
                raster_->read_heights(cells, to, stride);
                check_heights(cells, to, stride, scale);
                read += cells.posts();
            };
            if (needed.all())
                take(window);
            else
                for_each_tile_run(facts(), window, reason, take,
                                  [&](const Window& cells, Skip why) { ledger_->pass(cells, why); });
            for (std::int64_t r = part.begin; r < part.end; ++r) {
                const std::int64_t cell = rows_.cell(r);
                if (!source.contains(cell)) continue;
                const float* from = scratch.data() + (cell - source.begin) * stride;
                float* to = out + static_cast<std::size_t>(r - rows.begin) * width;
                for (std::int64_t i = run.at; i < run.at + run.count; ++i) {
                    const float value = from[plan.cells[static_cast<std::size_t>(i)] - run.source.begin];
                    to[i] = std::isnan(value) ? 0.0F : static_cast<float>(scale * static_cast<double>(value));
                }
            }
        }
    }
    return read;
}

void RegisteredLayer::check_heights(const Window& window, const float* values, std::int64_t stride,
                                    double scale) const {
    const float most = highest_culture(scale);
    for (std::int64_t r = 0; r < window.rows.size(); ++r)
        for (std::int64_t c = 0; c < window.columns.size(); ++c)
            if (const float z = values[r * stride + c]; z < 0 || z > most)
                refuse_culture(facts(), window.columns.begin + c, window.rows.begin + r, z, scale);
}

void RegisteredLayer::pass(const Window& posts, Skip reason) {
    const Interval rows = rows_.under(posts.rows), cells = columns_.under(posts.columns);
    if (columns_.circle == 0) return ledger_->pass({cells, rows}, reason);
    const std::int64_t first = columns_.inside(cells.begin), last = columns_.inside(cells.end - 1);
    if (first >= 0 && last >= first) return ledger_->pass({{first, last + 1}, rows}, reason);
    // Partly outside, or across the end of the circle.
    if (first >= 0) ledger_->pass({{first, columns_.cells}, rows}, reason);
    if (last >= 0) ledger_->pass({{0, last + 1}, rows}, reason);
}

}  // namespace wedgescope
