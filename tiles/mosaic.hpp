// Mosaic: one or many rasters of one layer as one raster on one grid, and what it is stored as.
// For the .cpp files of this folder only. Leaves sheets to sheet_writer.hpp.
//
// One raster keeps its grid and its values as they are. Several lie on the finest posting among them; of a post that
// several hold, the first in the order given that has a value there wins. A raster whose posts stand on those of the
// grid is copied, any other resampled bilinearly between its own posts (void if a post that counts is void).
// GDAL's own resampling is not used: its result depends on the windows that are asked for.
//
// A post of the grid disagrees where the raster whose value is kept and another one have unlike values there. Where
// both have a post of their own any difference counts; where one is interpolated, only what is beyond the relief of the
// posts it was interpolated from by more than `between_posts_m`: ground between posts is not known any better.
//
// Memory: one handle a reading thread for each of the `most_open_` rasters read last; a read takes its window in floats
// once more, where rasters overlap once more for who holds a post, and once more for its doubt, or how far it lies beyond
// a raster, if any is resampled.
#pragma once
#include <algorithm>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tiles/raster_file.hpp"
#include "tiles/raster_places.hpp"
#include "tiles/store_manifest.hpp"

namespace wedgescope {

class Mosaic {
public:
    /// IoError, DataError: rasters that cannot be read or put together.
    Mosaic(const std::string& role, const std::vector<std::string>& paths);

    /// Of the whole, as it is stored.
    const RasterFacts& facts() const { return facts_; }
    /// What was done to unlike rasters, in a sentence; empty: nothing.
    const std::string& note() const { return note_; }
    const std::string& path(std::size_t file) const { return rasters_[file]->facts().path; }
    std::vector<StoreSource> sources() const;
    /// Of each raster's files, in the order of the rasters: sizes and times of change.
    std::vector<std::uint64_t> fingerprints() const;
    bool single() const { return rasters_.size() == 1; }
    bool resampled() const { return resampled_; }

    /// Of a reading thread, over all its handles.
    ReaderBytes reader_bytes() const {
        ReaderBytes most;
        for (const auto& raster : rasters_) {
            const ReaderBytes own = raster->reader_bytes();
            most = {std::max(most.decoded, own.decoded), std::max(most.packed, own.packed)};
        }
        most.packed *= std::min(rasters_.size(), most_open_);
        return most;
    }

    /// Pieces that hold posts of the window or count in it; none if none holds one.
    std::vector<std::size_t> pieces_in(const Window& window) const;

    /// Of a post: the raster whose height is kept, and whether another disagreed with it.
    class Owner {
    public:
        Owner() = default;
        explicit Owner(std::size_t file) : number_(static_cast<std::int32_t>(file) + 1) {}
        std::int64_t file() const { return std::abs(number_) - 1; }  ///< -1: none
        bool disputed() const { return number_ < 0; }
        void dispute() { number_ = -std::abs(number_); }

    private:
        std::int32_t number_ = 0;  // from 1; below 0: disputed
    };
    /// What a read gives, row after row of its window.
    struct Posts {
        std::vector<std::byte> stored;    ///< in facts().type
        std::vector<float> heights;       ///< metres, NaN void
        std::vector<std::int32_t> codes;  ///< void_code where there is none
        Disagreement disagreement;        ///< added to
        // Scratch.
        std::vector<Owner> owners;
        std::vector<float> doubts_m;  ///< of what is kept; empty: none anywhere
        std::vector<float> part;
    };
    enum class Kind { heights, codes };
    /// `counted`: where disagreements count. From several threads at once.
    void read(const Window& window, const Window& counted, Kind kind, const std::vector<std::size_t>& pieces,
              Posts& out);

private:
    /// A raster as it lies on the grid. Where the rasters go round the earth one may lie there more than once, circles apart.
    struct Piece {
        RasterFile* raster;
        std::size_t file;                      ///< its number
        bool copied = true;                    ///< else resampled
        double column = 0, row = 0;            ///< of the grid's post (0, 0) in the raster's own
        double column_step = 1, row_step = 1;  ///< from post to post of the grid
        Window posts;  ///< of the grid that it holds; also beyond it, if that goes round the earth
        bool reaches = false;                  ///< half a post of its own beyond its outermost posts
        Window area, across;  ///< with the posts it reaches; with those that rasters on the other side of a seam reach
    };
    struct Grid {
        double x0, y0, step_x, step_y;  ///< of its post (0, 0)
    };
    enum class Seams { between_columns, between_rows };

    void choose_grid(const std::string& role);
    void lay_on_circle(const std::vector<double>& west, const Grid& grid, Interval columns);
    void choose_type();
    void find_edges();
    void find_reaches(const Neighbours& neighbours);
    void used(std::size_t file);
    void add_copied(std::size_t index, const Window& window, const Window& counted, Posts& out);
    void add_resampled(std::size_t index, const Window& window, const Window& counted, Posts& out);
    template <class Take>
    static void interpolate(const Piece& piece, const Window& here, std::vector<float>& part, const Take& take);
    void close_seams(const Window& window, const std::vector<std::size_t>& pieces, Posts& out);
    void reach_out(std::size_t index, Seams seams, bool far_side, const Window& window, std::vector<float>& beyond,
                   Posts& out);
    static void keep_or_compare(std::size_t file, float height_m, float doubt_m, std::int64_t column, std::int64_t row,
                                const Window& window, const Window& counted, Posts& out);
    void store_heights(const Window& window, Posts& out) const;
    void read_single(const Window& window, Kind kind, Posts& out);

    /// A raster as it lies on the grid where its western edge is at `west`.
    Piece piece_at(std::size_t file, double west, const Grid& grid) const;

    std::vector<std::unique_ptr<RasterFile>> rasters_;
    std::vector<Piece> pieces_;  ///< in the order of the rasters
    RasterFacts facts_;
    std::string note_;
    bool resampled_ = false;  ///< at least one of them
    bool reaches_ = false;    ///< at least one of them
    bool as_stored_ = true;   ///< the rasters' own values are stored, not metres
    std::mutex mutex_;
    std::list<std::size_t> open_;  ///< the last used in front
    std::size_t most_open_ = 32;   ///< fewer where a handle's buffers are large
};

}  // namespace wedgescope
