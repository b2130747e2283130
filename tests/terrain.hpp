// Drawn terrain: a wedge source that lives in memory, on a plane with x east, y north, and shapes whose answers are
// known.
#pragma once
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <random>
#include <utility>
#include <vector>

#include "lib/wedge_source.hpp"

namespace wedgescope::test {

inline constexpr float void_post = std::numeric_limits<float>::quiet_NaN();

/// The bounds of a raster, found post by post.
class DrawnMap : public BlockMap {
public:
    DrawnMap(std::int64_t columns, std::int64_t rows, bool cyclic,
             std::function<std::pair<float, float>(std::int64_t column, std::int64_t row)> post)
        : columns_(columns), rows_(rows), cyclic_(cyclic), post_(std::move(post)) {}
    int levels() const override {
        int n = 1;
        while (std::max(columns_, rows_) > (block_posts << (n - 1)) * 64) ++n;
        return n;
    }
    BlockWindow read(int level, const Window& blocks) override {
        BlockWindow out{blocks, {}};
        const std::int64_t edge = block_posts << level;
        for (std::int64_t j = blocks.rows.begin; j < blocks.rows.end; ++j)
            for (std::int64_t i = blocks.columns.begin; i < blocks.columns.end; ++i) {
                BlockBounds b;
                bool any_void = false, any_valid = false;
                for (std::int64_t r = j * edge; r <= std::min((j + 1) * edge, rows_ - 1); ++r)
                    for (std::int64_t c = i * edge; c <= std::min((i + 1) * edge, columns_ - (cyclic_ ? 0 : 1)); ++c) {
                        const auto [z, culture] = post_(c % columns_, r);
                        any_void = any_void || z != z;
                        if (z != z) continue;
                        any_valid = true;
                        b.lowest_m = std::min(b.lowest_m, z);
                        b.highest_m = std::max(b.highest_m, z);
                        b.culture_m = std::max(b.culture_m, culture);
                    }
                b.voids = !any_valid ? Voids::all : any_void ? Voids::some : Voids::none;
                out.bounds.push_back(b);
            }
        return out;
    }

private:
    std::int64_t columns_, rows_;
    bool cyclic_;
    std::function<std::pair<float, float>(std::int64_t, std::int64_t)> post_;
};

/// columns x rows posts, `post_m` apart; post (c, r) stands at x = c post_m, y = -r post_m.
class MemorySource : public WedgeSource {
public:
    MemorySource(std::int64_t columns, std::int64_t rows, double post_m,
                 const std::function<double(double c, double r)>& height)
        : terrain_(static_cast<std::size_t>(columns * rows)) {
        db_.name = "drawn";
        db_.columns = columns;
        db_.rows = rows;
        db_.crs_in_metres = true;
        db_.step_x = post_m;
        db_.step_y = -post_m;
        for (std::int64_t r = 0; r < rows; ++r)
            for (std::int64_t c = 0; c < columns; ++c)
                terrain_[index(c, r)] = static_cast<float>(height(static_cast<double>(c), static_cast<double>(r)));
    }

    /// Culture height, added at the posts.
    void set_culture_height(const std::function<double(double c, double r)>& height) {
        db_.has_culture_height = true;
        culture_height_.resize(terrain_.size());
        for (std::int64_t r = 0; r < db_.rows; ++r)
            for (std::int64_t c = 0; c < db_.columns; ++c)
                culture_height_[index(c, r)] =
                    static_cast<float>(height(static_cast<double>(c), static_cast<double>(r)));
    }
    /// Classes on the posts' own cells.
    void set_classes(const std::function<int(double c, double r)>& id) {
        db_.has_culture = true;
        db_.culture_columns = db_.columns;
        db_.culture_rows = db_.rows;
        db_.culture_tile_columns = db_.culture_tile_rows = 16;
        classes_.resize(terrain_.size());
        for (std::int64_t r = 0; r < db_.rows; ++r)
            for (std::int64_t c = 0; c < db_.columns; ++c)
                classes_[index(c, r)] = static_cast<ClassId>(id(static_cast<double>(c), static_cast<double>(r)));
    }
    DataBase& editable() { return db_; }
    /// Not on a plane but in degrees: post (0, 0) stands there, so many degrees from the next ones. Across the antimeridian too.
    void set_degrees(double west, double north, double step_lon, double step_lat) {
        db_.crs_in_metres = false;
        db_.has_crs = true;
        db_.step_x = step_lon;
        db_.step_y = -step_lat;
        db_.origin_x = west;
        db_.origin_y = north;
        db_.locate = [=](double lat, double lon) {
            return IndexPosition{((lon < west - 180 ? lon + 360 : lon) - west) / step_lon, (north - lat) / step_lat};
        };
        db_.lat_lon = [=](double c, double r) {
            const double lon = west + c * step_lon;
            return std::pair(north - r * step_lat, lon > 180 ? lon - 360 : lon);
        };
    }
    /// From now on bounds are known, and what is not needed is not given.
    void set_block_map() {
        map_ = std::make_unique<DrawnMap>(db_.columns, db_.rows, false, [this](std::int64_t c, std::int64_t r) {
            return std::pair(terrain_[index(c, r)], culture_height_.empty() ? 0.0F : culture_height_[index(c, r)]);
        });
    }
    BlockMap* block_map() override { return map_.get(); }
    std::uint64_t posts_read() const { return posts_read_; }
    /// Was this post given to anybody?
    bool was_read(std::int64_t column, std::int64_t row) const { return !read_.empty() && read_[index(column, row)]; }

    const DataBase& data_base() const override { return db_; }

    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        const Window& window = request.window;
        const bool lines_are_columns = request.lines_are_columns;
        Chunk chunk;
        chunk.window = window;
        chunk.lines_are_columns = lines_are_columns;
        if (const auto height = request.flat_m()) {
            chunk.flat = true;
            chunk.surface_m.assign(static_cast<std::size_t>(chunk.minor_count()), *height);
            return chunk;
        }
        const std::lock_guard lock(mutex_);
        read_.resize(terrain_.size());
        const Interval& major = lines_are_columns ? window.columns : window.rows;
        const Interval& minor = lines_are_columns ? window.rows : window.columns;
        for (std::int64_t i = major.begin; i < major.end; ++i)
            for (std::int64_t j = minor.begin; j < minor.end; ++j) {
                const std::size_t at = lines_are_columns ? index(i, j) : index(j, i);
                const bool needed = is_needed(request, lines_are_columns ? i : j, lines_are_columns ? j : i);
                posts_read_ += needed;
                if (needed) read_[at] = true;
                const float culture = culture_height_.empty() || !needed ? 0.0F : culture_height_[at];
                chunk.surface_m.push_back(needed ? terrain_[at] + culture
                                                 : fill(request, lines_are_columns ? i : j, lines_are_columns ? j : i));
                if (!culture_height_.empty()) chunk.culture_height_m.push_back(culture);
            }
        chunk.posts_read = static_cast<std::uint64_t>(window.posts());
        chunk.bytes_read = chunk.posts_read * (culture_height_.empty() ? 1 : 2) * sizeof(float);
        return chunk;
    }
    CultureCells load_classes(const Window& cells) override {
        CultureCells out;
        out.window = cells;
        for (std::int64_t r = cells.rows.begin; r < cells.rows.end; ++r)
            for (std::int64_t c = cells.columns.begin; c < cells.columns.end; ++c) {
                const bool inside = c >= 0 && r >= 0 && c < db_.columns && r < db_.rows;
                out.classes.push_back(inside ? classes_[index(c, r)] : db_.default_class);
                out.bytes_read += inside;
            }
        return out;
    }
    void read_bare_terrain(const Window& posts, float* heights_m) override {
        for (std::int64_t row = posts.rows.begin; row < posts.rows.end; ++row)
            for (std::int64_t column = posts.columns.begin; column < posts.columns.end; ++column)
                *heights_m++ = terrain_[index(column, row)];
    }
    Extremes extremes() override {
        Extremes e;
        for (std::size_t i = 0; i < terrain_.size(); ++i) {
            const float z = terrain_[i] + (culture_height_.empty() ? 0.0F : culture_height_[i]);
            if (z != z) {
                ++e.void_posts;
                continue;
            }
            e.lowest_m = e.any_valid ? std::min(e.lowest_m, z) : z;
            e.highest_m = e.any_valid ? std::max(e.highest_m, z) : z;
            e.any_valid = true;
        }
        return e;
    }
    std::size_t cache_bytes() const override { return 0; }

private:
    std::size_t index(std::int64_t c, std::int64_t r) const { return static_cast<std::size_t>(r * db_.columns + c); }

    static std::size_t block_index(const ChunkRequest& request, std::int64_t column, std::int64_t row) {
        const Window b = blocks_of({{column, column + 1}, {row, row + 1}});
        return static_cast<std::size_t>((b.rows.begin - request.blocks.rows.begin) * request.blocks.columns.size() +
                                        b.columns.begin - request.blocks.columns.begin);
    }
    /// In a needed block, or at most `margin` posts from one.
    static bool is_needed(const ChunkRequest& request, std::int64_t column, std::int64_t row) {
        if (request.skip.empty()) return true;
        constexpr std::int64_t margin = ChunkRequest::margin;
        for (const std::int64_t r : {row - margin, row, row + margin})
            for (const std::int64_t c : {column - margin, column, column + margin}) {
                const Window b = blocks_of({{c, c + 1}, {r, r + 1}});
                if (!request.blocks.columns.contains(b.columns.begin) || !request.blocks.rows.contains(b.rows.begin))
                    continue;
                if (request.skip[block_index(request, c, r)] == Skip::none) return true;
            }
        return false;
    }
    static float fill(const ChunkRequest& request, std::int64_t column, std::int64_t row) {
        return request.fill_m[block_index(request, column, row)];
    }

    DataBase db_;
    std::unique_ptr<BlockMap> map_;
    std::mutex mutex_;
    std::vector<bool> read_;
    std::uint64_t posts_read_ = 0;
    std::vector<float> terrain_, culture_height_;
    std::vector<ClassId> classes_;
};

/// Smooth seeded noise: a sum of waves of random direction; amplitude about `relief_m`, wavelengths from `longest`
/// posts down.
inline std::function<double(double, double)> rolling(double relief_m, double longest, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> turn(0, 6.283185307179586);
    struct Wave {
        double kx, ky, phase, amplitude;
    };
    std::vector<Wave> waves;
    double wavelength = longest, amplitude = relief_m / 2;
    for (int octave = 0; octave < 6; ++octave, wavelength /= 2, amplitude /= 2)
        for (int i = 0; i < 4; ++i) {
            const double a = turn(random), k = 6.283185307179586 / wavelength;
            waves.push_back({k * std::cos(a), k * std::sin(a), turn(random), amplitude / 2});
        }
    // On posts by the sine of a sum, from what columns and rows have for themselves: a sine takes ten times as long.
    struct Turn {
        double sine, cosine;
    };
    struct Turns {
        std::vector<Turn> column, row;  // of each post its waves, side by side
    };
    constexpr std::size_t posts = 2048;
    const auto turns = std::make_shared<Turns>();
    for (std::size_t at = 0; at < posts; ++at)
        for (const Wave& w : waves) {
            const double x = w.kx * static_cast<double>(at) + w.phase, y = w.ky * static_cast<double>(at);
            turns->column.push_back({w.amplitude * std::sin(x), w.amplitude * std::cos(x)});
            turns->row.push_back({std::sin(y), std::cos(y)});
        }
    const auto is_post = [](double at) { return at >= 0 && at < posts && at == std::floor(at); };
    return [waves, turns, is_post](double c, double r) {
        double z = 0;
        if (is_post(c) && is_post(r)) {
            const Turn* const column = &turns->column[static_cast<std::size_t>(c) * waves.size()];
            const Turn* const row = &turns->row[static_cast<std::size_t>(r) * waves.size()];
            for (std::size_t i = 0; i < waves.size(); ++i)
                z += column[i].sine * row[i].cosine + column[i].cosine * row[i].sine;
            return z;
        }
        for (const Wave& w : waves) z += w.amplitude * std::sin(w.kx * c + w.ky * r + w.phase);
        return z;
    };
}

}  // namespace wedgescope::test
