#include "tiles/mosaic.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "lib/error.hpp"
#include "tiles/registered_layer.hpp"

namespace wedgescope {
namespace {

// For the buffers of rasters held open.
constexpr std::size_t open_bytes = std::size_t{8} << 20;
/// How far beyond their relief ground between posts may lie without being an error: the accuracy that DTED promises in
/// height (MIL-PRF-89020B, 30 m at 90 %). Between posts twice and three times as far apart as those of real mountains
/// (30 and 90 m) at most 5 in 100 000 exceed it.
constexpr float between_posts_m = 30;
constexpr float nan_m = std::numeric_limits<float>::quiet_NaN();

/// Whole numbers that a float holds each of.
bool is_small_whole(GDALDataType type) { return type == GDT_Byte || type == GDT_Int16 || type == GDT_UInt16; }
bool is_value_of(GDALDataType type, double value) {
    if (type == GDT_Float32 || type == GDT_Float64) return true;
    int clamped = 0, rounded = 0;
    GDALAdjustValueToDataType(type, value, &clamped, &rounded);
    return !clamped && !rounded && !std::isnan(value);
}

}  // namespace

Mosaic::Mosaic(const std::string& role, const std::vector<std::string>& paths) {
    for (const std::string& path : paths) {
        rasters_.push_back(std::make_unique<RasterFile>(role, path));
        if (paths.size() > 1) rasters_.back()->close_idle();
    }
    facts_ = rasters_[0]->facts();
    if (!single()) {
        choose_grid(role);
        facts_.path = text(rasters_.size(), " rasters");
    } else {
        Piece all{};
        all.raster = rasters_[0].get();
        all.posts = {{0, facts_.columns}, {0, facts_.rows}};
        pieces_.push_back(all);
    }
    choose_type();
    find_edges();
    std::size_t packed = 1;
    for (const auto& raster : rasters_) packed = std::max(packed, raster->reader_bytes().packed);
    most_open_ = std::clamp<std::size_t>(open_bytes / packed, 1, most_open_);
}

std::vector<StoreSource> Mosaic::sources() const {
    std::vector<StoreSource> out;
    for (const auto& raster : rasters_) out.push_back(source_of(raster->facts().path));
    return out;
}

std::vector<std::uint64_t> Mosaic::fingerprints() const {
    std::vector<std::uint64_t> out;
    for (const auto& raster : rasters_) out.push_back(raster->fingerprint({}));
    return out;
}

Mosaic::Piece Mosaic::piece_at(std::size_t file, double west, const Grid& grid) const {
    Piece piece{};
    piece.raster = rasters_[file].get();
    piece.file = file;
    const RasterFacts& f = piece.raster->facts();
    const auto columns = along_grid(grid.x0, grid.step_x, west, f.step_x, f.columns);
    const auto rows = along_grid(grid.y0, grid.step_y, f.corner_y, f.step_y, f.rows);
    piece.copied = columns.on_posts && rows.on_posts;
    piece.column = columns.own;
    piece.column_step = columns.step;
    piece.row = rows.own;
    piece.row_step = rows.step;
    piece.posts = {columns.posts, rows.posts};
    return piece;
}

void Mosaic::choose_grid(const std::string& role) {
    const RasterFacts first = rasters_[0]->facts();
    std::vector<double> west, width;
    std::size_t finest_x = 0, finest_y = 0;
    bool eastwards = first.geographic;
    for (std::size_t i = 0; i < rasters_.size(); ++i) {
        const RasterFacts& f = rasters_[i]->facts();
        if (!f.has_geotransform)
            throw DataError(text(
                f.named(), " has no geotransform; accepted where there are several: rasters that know their place"));
        if ((f.crs == nullptr) != (first.crs == nullptr))
            throw DataError(text((f.crs ? first : f).named(), " has no CRS, ", (f.crs ? f : first).named(),
                                 " has one; accepted: rasters of one CRS"));
        refuse_other_crs(f, first, text("'", first.path, "'"));
        west.push_back(f.corner_x);
        width.push_back(static_cast<double>(f.columns) * f.step_x);
        eastwards = eastwards && f.step_x > 0;
        const auto finer = [](double a, double b) { return std::fabs(a) < std::fabs(b) * (1 - 1e-7); };
        if (finer(f.step_x, rasters_[finest_x]->facts().step_x)) finest_x = i;
        if (finer(f.step_y, rasters_[finest_y]->facts().step_y)) finest_y = i;
    }
    if (first.geographic) west = unrolled(west, width);

    const RasterFacts& fx = rasters_[finest_x]->facts();
    const RasterFacts& fy = rasters_[finest_y]->facts();
    const double step_x = fx.step_x, step_y = fy.step_y;
    const Grid grid{west[finest_x] + 0.5 * step_x, fy.corner_y + 0.5 * step_y, step_x, step_y};
    Window all;
    for (std::size_t i = 0; i < rasters_.size(); ++i) {
        pieces_.push_back(piece_at(i, west[i], grid));
        all = {hull(all.columns, pieces_.back().posts.columns), hull(all.rows, pieces_.back().posts.rows)};
    }
    double whole_turns = 0;
    const bool closes = near(360 / step_x, std::round(360 / step_x), 1e-3);  // as RasterFacts::cycle_columns() asks
    const auto seam = eastwards && closes ? seam_of(west, width, 360 - on_a_post * step_x) : std::nullopt;
    if (seam) {
        const auto post = static_cast<std::int64_t>(std::ceil((west[*seam] - west[finest_x]) / step_x - on_a_post));
        all.columns = {post, post + std::llround(360 / step_x)};
        whole_turns = rasters_[*seam]->facts().corner_x - west[*seam];
        lay_on_circle(west, grid, all.columns);
    }
    if (all.columns.size() > INT32_MAX || all.rows.size() > INT32_MAX)
        throw DataError(text("the rasters together span ", all.columns.size(), " x ", all.rows.size(),
                             " posts; accepted: at most ", INT32_MAX, " a side"));
    std::vector<bool> resampled(rasters_.size());
    for (Piece& piece : pieces_) {
        resampled[piece.file] = resampled[piece.file] || !piece.copied;
        piece.column += piece.column_step * static_cast<double>(all.columns.begin);
        piece.row += piece.row_step * static_cast<double>(all.rows.begin);
        for (auto [side, begin] :
             {std::pair(&piece.posts.columns, all.columns.begin), std::pair(&piece.posts.rows, all.rows.begin)}) {
            side->begin -= begin;
            side->end -= begin;
        }
    }
    facts_.role = role;
    facts_.columns = all.columns.size();
    facts_.rows = all.rows.size();
    facts_.corner_x = west[finest_x] + whole_turns + static_cast<double>(all.columns.begin) * step_x;
    facts_.corner_y = fy.corner_y + static_cast<double>(all.rows.begin) * step_y;
    facts_.step_x = step_x;
    facts_.step_y = step_y;
    const auto count = std::count(resampled.begin(), resampled.end(), true);
    resampled_ = count > 0;
    as_stored_ = !resampled_;
    if (resampled_)
        note_ =
            text(count, " of ", rasters_.size(), " rasters resampled bilinearly to steps of ", step_x, ", ", step_y);
}

/// Puts each raster wherever it lies on one circle of posts, so also on the other side of the seam.
void Mosaic::lay_on_circle(const std::vector<double>& west, const Grid& grid, Interval columns) {
    double coarsest = 1;  // posting
    for (const Piece& piece : pieces_) coarsest = std::max(coarsest, 1 / std::fabs(piece.column_step));
    const auto reach = static_cast<std::int64_t>(std::ceil(coarsest)) + 1;  // beyond outermost posts, at the most
    const Interval within{columns.begin - reach, columns.end + reach};
    pieces_.clear();
    for (std::size_t i = 0; i < rasters_.size(); ++i)
        for (const double turn : {0.0, -360.0, 360.0}) {
            const Piece piece = piece_at(i, west[i] + turn, grid);
            if (!intersection(piece.posts.columns, within).empty()) pieces_.push_back(piece);
        }
}

void Mosaic::choose_type() {
    const RasterFacts own = rasters_[0]->facts();
    const auto become = [&](GDALDataType type, double no_data) {
        facts_.type = type;
        facts_.type_bytes = type_bytes(type);
        facts_.has_no_data = true;
        facts_.no_data = no_data;
    };
    facts_.has_mask = facts_.signed_byte = false;
    if (single()) {
        if (own.signed_byte) {
            facts_.type = GDT_Int16;
            facts_.type_bytes = 2;
        }
        if (own.fractions && (own.role == "dem" || own.role == "culture-height")) {
            // As they are read of the raster itself.
            facts_.type = GDT_Float32;
            facts_.type_bytes = type_bytes(GDT_Float32);
            note_ = text("a VRT that makes fractions of ", type_name(own.type), ": stored as Float32");
            if (own.has_mask) become(GDT_Float32, std::numeric_limits<double>::quiet_NaN());
            return;
        }
        if (!own.has_mask || (own.has_no_data && is_value_of(own.type, own.no_data))) return;
        // A mask becomes a no-data value that no cell can have.
        if (own.type == GDT_Byte)
            become(GDT_Int16, INT16_MIN);
        else if (own.type == GDT_Int16 || own.type == GDT_UInt16)
            become(GDT_Int32, INT32_MIN);
        else if (own.type == GDT_Float32 || own.type == GDT_Float64)
            become(own.type, std::numeric_limits<double>::quiet_NaN());
        else
            become(GDT_Float64, std::numeric_limits<double>::quiet_NaN());
        return;
    }
    bool alike = as_stored_, one_no_data = true;
    for (const auto& raster : rasters_) {
        const RasterFacts& f = raster->facts();
        alike = alike && f.type == own.type && f.scale == own.scale && f.offset == own.offset &&
                f.unit_m == own.unit_m && f.signed_byte == own.signed_byte && !f.fractions;
        one_no_data = one_no_data && f.has_no_data && f.no_data == own.no_data;
    }
    // A value that the type does not have stands for no post of the rasters, nor could it for one of the store's.
    one_no_data = one_no_data && is_value_of(own.type, own.no_data);
    const bool metres = own.scale == 1 && own.offset == 0 && own.unit_m == 1;
    const double none = std::numeric_limits<double>::quiet_NaN();
    // On their way values are floats, which do not hold every large whole number: nothing is "as stored" then.
    constexpr double whole_in_float = 1 << 24;
    if (own.type == GDT_Int32 && highest_height_m > whole_in_float * std::abs(own.scale) * own.unit_m) alike = false;
    if (alike && one_no_data && !own.signed_byte && (is_small_whole(own.type) || own.type == GDT_Int32)) return;
    if (alike && own.type == GDT_Float32 && metres) {
        if (!one_no_data) become(GDT_Float32, none);
        return;
    }
    // A no-data value that no raster's post can have.
    if (alike && (own.type == GDT_Byte || own.type == GDT_Int16)) return become(GDT_Int16, INT16_MIN);
    if (alike && (own.type == GDT_UInt16 || own.type == GDT_Int32)) return become(GDT_Int32, INT32_MIN);
    // Metres, whatever the rasters hold.
    if (!resampled_)
        note_ = alike ? text("rasters of ", own.signed_byte ? "Int8" : type_name(own.type),
                             metres ? "" : " with a scale, an offset or a unit of their own")
                      : "rasters of unlike types, scales or units";
    note_ += ": stored as Float32 metres";
    as_stored_ = false;
    facts_.scale = 1;
    facts_.offset = 0;
    facts_.unit.assign(1, 'm');
    facts_.unit_m = 1;
    become(GDT_Float32, none);
}

/// Which rasters reach beyond their outermost posts, and what gaps they leave.
void Mosaic::find_edges() {
    for (Piece& piece : pieces_) piece.area = piece.across = piece.posts;
    if (single()) return;
    std::vector<Neighbours::Place> places;
    for (const Piece& piece : pieces_) {
        const RasterFacts& f = piece.raster->facts();
        places.push_back({Neighbours::side(piece.column, piece.column_step, f.columns),
                          Neighbours::side(piece.row, piece.row_step, f.rows)});
    }
    const Neighbours neighbours(std::move(places));
    find_reaches(neighbours);
    const Neighbours::Gaps gaps = neighbours.gaps(facts_.columns);
    if (gaps.count == 0) return;
    if (!note_.empty()) note_ += "; ";
    note_ += text("rasters leave ", gaps.count, gaps.count == 1 ? " gap" : " gaps",
                  " narrower than two posts, void in the store, the first between '", path(pieces_[gaps.before].file),
                  "' and '", path(pieces_[gaps.behind].file), "'");
}

void Mosaic::find_reaches(const Neighbours& neighbours) {
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
        Piece& piece = pieces_[i];
        piece.reaches = !piece.copied && neighbours[i][0].beyond > 0;
        reaches_ |= piece.reaches;
    }
    for (std::size_t i = 0; i < pieces_.size() && reaches_; ++i) {
        Piece& piece = pieces_[i];
        const RasterFacts& f = piece.raster->facts();
        const auto beyond = [](double own, double step, std::int64_t posts, double reach, std::int64_t most) {
            return intersection(grid_posts(own, step, posts, reach), {0, most});
        };
        if (piece.reaches)
            piece.area = {beyond(piece.column, piece.column_step, f.columns, 0.5, facts_.columns),
                          beyond(piece.row, piece.row_step, f.rows, 0.5, facts_.rows)};
        // Areas that meet: half a post of either from post to post.
        const auto far = [&](std::size_t axis) {
            return 0.5 + 0.5 * neighbours.coarsest(axis) / neighbours[i][axis].posting;
        };
        piece.across = {beyond(piece.column, piece.column_step, f.columns, far(0), facts_.columns),
                        beyond(piece.row, piece.row_step, f.rows, far(1), facts_.rows)};
    }
}

std::vector<std::size_t> Mosaic::pieces_in(const Window& window) const {
    const auto meets = [&](const Window& posts) { return !intersection(window, posts).empty(); };
    std::vector<std::size_t> found;
    bool any = false;
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
        if (!meets(pieces_[i].across)) continue;
        found.push_back(i);
        any |= meets(pieces_[i].area);
    }
    return any ? found : std::vector<std::size_t>{};
}

void Mosaic::used(std::size_t file) {
    if (single()) return;
    const std::lock_guard lock(mutex_);
    open_.remove(file);
    open_.push_front(file);
    if (open_.size() <= most_open_) return;
    rasters_[open_.back()]->close_idle();
    open_.pop_back();
}

void Mosaic::read(const Window& window, const Window& counted, Kind kind, const std::vector<std::size_t>& pieces,
                  Posts& out) {
    if (single()) return read_single(window, kind, out);
    const auto n = static_cast<std::size_t>(window.posts());
    out.heights.assign(n, nan_m);
    const bool overlap = pieces.size() > 1 && !counted.empty();
    if (overlap) out.owners.assign(n, {});
    out.doubts_m.assign(overlap && resampled_ ? n : 0, 0.0F);
    for (const std::size_t index : pieces) {
        used(pieces_[index].file);
        if (pieces_[index].copied)
            add_copied(index, window, overlap ? counted : Window{}, out);
        else
            add_resampled(index, window, overlap ? counted : Window{}, out);
    }
    if (reaches_) close_seams(window, pieces, out);
    store_heights(window, out);
}

/// What a raster has at a post of the grid: kept if nothing is, else compared with what is. `doubt_m`: 0 for a post of
/// its own.
inline void Mosaic::keep_or_compare(std::size_t file, float height_m, float doubt_m, std::int64_t column,
                                    std::int64_t row, const Window& window, const Window& counted, Posts& out) {
    const auto at = window.at(column, row);
    float& kept_m = out.heights[at];
    if (std::isnan(kept_m)) {
        kept_m = height_m;
        if (counted.empty()) return;
        out.owners[at] = Owner(file);
        if (doubt_m > 0) out.doubts_m[at] = doubt_m;
        return;
    }
    if (kept_m == height_m || !counted.contains(column, row)) return;
    const float apart_m = std::fabs(kept_m - height_m);
    const float both_m = doubt_m + (out.doubts_m.empty() ? 0.0F : out.doubts_m[at]);
    if (!(apart_m > both_m)) return;
    Owner& owner = out.owners[at];
    const auto other = static_cast<std::int64_t>(file);
    if (owner.file() == other) return;  // itself, a circle apart
    const bool first = !owner.disputed();
    out.disagreement.add({first ? 1U : 0U, apart_m, column, row, owner.file(), other, first && both_m > 0 ? 1U : 0U});
    owner.dispute();
}

void Mosaic::read_single(const Window& window, Kind kind, Posts& out) {
    RasterFile& raster = *rasters_[0];
    const RasterFacts& own = raster.facts();
    const auto n = static_cast<std::size_t>(window.posts());
    const std::int64_t width = window.columns.size();
    out.stored.resize(n * static_cast<std::size_t>(facts_.type_bytes));
    if (kind == Kind::heights) {
        out.heights.resize(n);
        raster.read_heights(window, out.heights.data(), width);
    } else {
        out.codes.resize(n);
        raster.read_codes(window, out.codes.data());
    }
    raster.read_values(window, out.stored.data(), facts_.type, width * facts_.type_bytes);
    if (own.signed_byte)
        for (std::size_t i = 0; i < n; ++i) {
            std::int16_t value = 0;
            std::memcpy(&value, out.stored.data() + 2 * i, 2);
            if (value > 127) value = static_cast<std::int16_t>(value - 256);
            std::memcpy(out.stored.data() + 2 * i, &value, 2);
        }
    if (!own.has_mask) return;
    const auto size = static_cast<std::size_t>(facts_.type_bytes);
    std::vector<std::byte> none(size);
    GDALCopyWords(&facts_.no_data, GDT_Float64, 0, none.data(), facts_.type, facts_.type_bytes, 1);
    for (std::size_t i = 0; i < n; ++i)
        if (kind == Kind::heights ? std::isnan(out.heights[i]) : out.codes[i] == void_code)
            std::memcpy(out.stored.data() + i * size, none.data(), size);
}

void Mosaic::add_copied(std::size_t index, const Window& window, const Window& counted, Posts& out) {
    const Piece& piece = pieces_[index];
    const Window here = intersection(window, piece.posts);
    if (here.empty()) return;
    // Own posts along an axis, and the first post of the grid's among them.
    struct Own {
        Interval posts;
        std::int64_t first, step;
    };
    const auto own = [](Interval grid, double post, double step) {
        const auto at = [&](std::int64_t i) { return static_cast<std::int64_t>(post + step * static_cast<double>(i)); };
        const std::int64_t a = at(grid.begin), b = at(grid.end - 1);
        return step > 0 ? Own{{a, b + 1}, 0, 1} : Own{{b, a + 1}, a - b, -1};
    };
    const Own columns = own(here.columns, piece.column, piece.column_step),
              rows = own(here.rows, piece.row, piece.row_step);
    const std::int64_t width = here.columns.size();
    out.part.resize(static_cast<std::size_t>(here.posts()));
    piece.raster->read_heights({columns.posts, rows.posts}, out.part.data(), width);
    for (std::int64_t r = here.rows.begin; r < here.rows.end; ++r)
        for (std::int64_t c = here.columns.begin; c < here.columns.end; ++c) {
            const std::int64_t row = rows.first + rows.step * (r - here.rows.begin),
                               column = columns.first + columns.step * (c - here.columns.begin);
            const float z = out.part[static_cast<std::size_t>(row * width + column)];
            if (!std::isnan(z)) keep_or_compare(piece.file, z, 0, c, r, window, counted, out);
        }
}

/// Calls take(column, row, height_m, doubt_m) for the posts of the grid in `here` that are not void; no doubt on a post of
/// its own. Beyond the outermost posts as on them.
template <class Take>
void Mosaic::interpolate(const Piece& piece, const Window& here, std::vector<float>& part, const Take& take) {
    const RasterFacts& f = piece.raster->facts();
    // Own post below, and the share of the one above.
    struct Between {
        std::int64_t post;
        double share;
    };
    const auto between = [](double at, std::int64_t posts) {
        const double on = std::round(at);
        if (near(at, on, on_a_post)) at = on;
        const auto post = std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(at)), 0, posts - 1);
        return Between{post, post + 1 < posts ? std::clamp(at - static_cast<double>(post), 0.0, 1.0) : 0.0};
    };
    const auto side = [&](Interval posts, double own, double step, std::int64_t count, std::vector<Between>& list) {
        Interval needed;
        for (std::int64_t i = posts.begin; i < posts.end; ++i) {
            list.push_back(between(own + step * static_cast<double>(i), count));
            const Between& b = list.back();
            needed = hull(needed, {b.post, b.post + (b.share > 0 ? 2 : 1)});
        }
        return needed;
    };
    std::vector<Between> columns, rows;
    const Window source{side(here.columns, piece.column, piece.column_step, f.columns, columns),
                        side(here.rows, piece.row, piece.row_step, f.rows, rows)};
    part.resize(static_cast<std::size_t>(source.posts()));
    piece.raster->read_heights(source, part.data(), source.columns.size());
    const auto own = [&](std::int64_t c, std::int64_t r) { return static_cast<double>(part[source.at(c, r)]); };
    for (std::int64_t r = here.rows.begin; r < here.rows.end; ++r) {
        const Between& y = rows[static_cast<std::size_t>(r - here.rows.begin)];
        for (std::int64_t c = here.columns.begin; c < here.columns.end; ++c) {
            const Between& x = columns[static_cast<std::size_t>(c - here.columns.begin)];
            double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
            const auto along = [&](std::int64_t row) {
                const double a = own(x.post, row), b = x.share > 0 ? own(x.post + 1, row) : a;
                lowest = std::min({lowest, a, b});
                highest = std::max({highest, a, b});
                return x.share > 0 ? a + (b - a) * x.share : a;
            };
            double z = along(y.post);
            if (y.share > 0) z += (along(y.post + 1) - z) * y.share;
            if (std::isnan(z)) continue;
            const bool on_own_post = x.share == 0 && y.share == 0;
            take(c, r, static_cast<float>(z),
                 on_own_post ? 0.0F : static_cast<float>(highest - lowest) + between_posts_m);
        }
    }
}

void Mosaic::add_resampled(std::size_t index, const Window& window, const Window& counted, Posts& out) {
    const Piece& piece = pieces_[index];
    const Window here = intersection(window, piece.posts);
    if (here.empty()) return;
    interpolate(piece, here, out.part, [&](std::int64_t c, std::int64_t r, float height_m, float doubt_m) {
        keep_or_compare(piece.file, height_m, doubt_m, c, r, window, counted, out);
    });
}

void Mosaic::close_seams(const Window& window, const std::vector<std::size_t>& pieces, Posts& out) {
    const auto is_void = [](float z) { return std::isnan(z); };
    std::vector<float> beyond = std::move(out.doubts_m);  // their memory: they have served
    for (const Seams seams : {Seams::between_columns, Seams::between_rows}) {
        if (std::none_of(out.heights.begin(), out.heights.end(), is_void)) break;
        beyond.assign(out.heights.size(), 0.0F);
        for (const bool far_side : {false, true})
            for (const std::size_t index : pieces) reach_out(index, seams, far_side, window, beyond, out);
    }
    out.doubts_m = std::move(beyond);
}

/// Fills voids beyond a raster's outermost posts with these, and notes in `beyond` how far they lie from it, in posts of the
/// grid, below 0 before its first. `far_side`: goes from what another raster filled to this one's outermost posts instead.
void Mosaic::reach_out(std::size_t index, Seams seams, bool far_side, const Window& window, std::vector<float>& beyond,
                       Posts& out) {
    const Piece& piece = pieces_[index];
    if (!far_side && !piece.reaches) return;
    const bool columns = seams == Seams::between_columns;
    const Window& reach = far_side ? piece.across : piece.area;
    const Interval side = columns ? piece.posts.columns : piece.posts.rows;
    const double own0 = columns ? piece.column : piece.row, step = columns ? piece.column_step : piece.row_step;
    const RasterFacts& f = piece.raster->facts();
    const auto last = static_cast<double>((columns ? f.columns : f.rows) - 1);
    for (const bool before : {true, false}) {
        const auto outside = [&](Interval all) {
            return before ? Interval{all.begin, side.begin} : Interval{side.end, all.end};
        };
        const Window strip{columns ? outside(reach.columns) : piece.area.columns,
                           columns ? piece.area.rows : outside(reach.rows)};
        const Window here = intersection(window, strip);
        const auto wanted = [&](std::size_t at) {
            return far_side ? (before ? beyond[at] > 0 : beyond[at] < 0) : std::isnan(out.heights[at]);
        };
        bool any = false;
        for (std::int64_t r = here.rows.begin; r < here.rows.end && !any; ++r)
            for (std::int64_t c = here.columns.begin; c < here.columns.end && !any; ++c) any = wanted(window.at(c, r));
        if (!any) continue;
        used(pieces_[index].file);
        interpolate(piece, here, out.part, [&](std::int64_t c, std::int64_t r, float height_m, float) {
            const std::size_t at = window.at(c, r);
            if (!wanted(at)) return;
            const double own = own0 + step * static_cast<double>(columns ? c : r);
            const auto here_beyond = static_cast<float>((own < 0 ? own : own - last) / step);
            float &kept_m = out.heights[at], &other_beyond = beyond[at];
            if (!far_side) {
                kept_m = height_m;
                other_beyond = here_beyond;
            } else {
                kept_m += (height_m - kept_m) * (other_beyond / (other_beyond - here_beyond));
                other_beyond = 0;
            }
        });
    }
}

void Mosaic::store_heights(const Window& window, Posts& out) const {
    const std::size_t n = out.heights.size(), size = static_cast<std::size_t>(facts_.type_bytes);
    out.stored.resize(n * size);
    if (facts_.type == GDT_Float32) {
        const auto none = static_cast<float>(facts_.no_data);
        for (std::size_t i = 0; i < n; ++i) {
            const float value = std::isnan(out.heights[i]) ? none : out.heights[i];
            std::memcpy(out.stored.data() + i * size, &value, size);
        }
        return;
    }
    // Whole numbers: back to what the rasters hold.
    for (std::size_t i = 0; i < n; ++i) {
        double value = facts_.no_data;
        if (!std::isnan(out.heights[i])) {
            value = std::round((static_cast<double>(out.heights[i]) / facts_.unit_m - facts_.offset) / facts_.scale);
            if (value == facts_.no_data) {
                const auto at = static_cast<std::int64_t>(i);
                throw DataError(text("height at column ", window.columns.begin + at % window.columns.size(), ", row ",
                                     window.rows.begin + at / window.columns.size(), " of the mosaic is ",
                                     out.heights[i], " m, which its no-data value ", facts_.no_data,
                                     " stands for; accepted: heights above it"));
            }
        }
        GDALCopyWords(&value, GDT_Float64, 0, out.stored.data() + i * size, facts_.type, facts_.type_bytes, 1);
    }
}

}  // namespace wedgescope
