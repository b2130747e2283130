#include "tiles/sources.hpp"

#include "lib/error.hpp"
#include "tiles/raster_source.hpp"

namespace wedgescope {
namespace {

/// The same rasters, none of whose posts is read.
class UnreadSource final : public RasterSource {
public:
    UnreadSource(const DataBaseParams& params, float ground_m, const Extremes& guess)
        : RasterSource(params), ground_m_(ground_m) {
        extremes_ = guess;
    }
    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override {
        Chunk chunk;
        chunk.window = request.window;
        chunk.lines_are_columns = request.lines_are_columns;
        chunk.surface_m.assign(static_cast<std::size_t>(request.window.posts()), ground_m_);
        return chunk;
    }
    void read_bare_terrain(const Window& posts, float* heights_m) override {
        std::fill_n(heights_m, posts.posts(), ground_m_);
    }

private:
    float ground_m_;
};

}  // namespace

std::unique_ptr<WedgeSource> open_direct_source(const DataBaseParams& params) {
    if (params.dem.empty()) throw InputError("dem is missing; accepted: the path of a raster of heights");
    return std::make_unique<RasterSource>(params);
}

std::unique_ptr<WedgeSource> open_unread_source(const DataBaseParams& params, float ground_m, const Extremes& guess) {
    return std::make_unique<UnreadSource>(params, ground_m, guess);
}

}  // namespace wedgescope
