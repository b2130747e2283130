// Raised source: a wedge source whose surface statistical walls raise: by the share of the ground that the structures of
// each post's class cover. Leaves how much that is to material.hpp, and reading to the source beneath.
//
// A post is raised by what the class of the culture cell that it stands in says (the default class beyond culture and where there
// is none), where the culture height is 0. Where it is not, that is the height of the structures themselves: the surface stays,
// and the culture height of a post of a class with structures comes out as 0, so that no wall is found there a second time. The
// block map's bounds of culture are those of the source or the most that any class is raised by, whichever is more.
//
// Memory: beside a chunk the classes of one tile of culture, as it is read.
#pragma once
#include <memory>
#include <optional>
#include <vector>

#include "lib/scene.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

class RaisedSource final : public WedgeSource {
public:
    /// `raises_m`: by class. `below` must outlive it.
    RaisedSource(WedgeSource& below, std::vector<float> raises_m);
    ~RaisedSource() override;

    const DataBase& data_base() const override { return below_.data_base(); }
    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override;
    LoadCost cost(const ChunkRequest& request) const override;
    std::uint64_t class_bytes(const Window& cells) const override { return below_.class_bytes(cells); }
    CultureCells load_classes(const Window& cells) override { return below_.load_classes(cells); }
    BlockMap* block_map() override;
    DetailMap* detail_map() override { return nullptr; }  // it knows nothing of what is raised
    Skipped skipped() const override { return below_.skipped(); }
    void read_bare_terrain(const Window& posts, float* heights_m) override {
        below_.read_bare_terrain(posts, heights_m);
    }
    Extremes extremes() override { return below_.extremes(); }
    SourceReport report() const override { return below_.report(); }
    std::uint64_t fingerprint(const std::vector<Window>& posts) override { return below_.fingerprint(posts); }
    std::size_t cache_bytes() const override { return below_.cache_bytes(); }
    std::size_t filled_bytes(std::uint64_t bytes_read) const override { return below_.filled_bytes(bytes_read); }
    std::size_t held_bytes() const override { return below_.held_bytes(); }
    std::size_t reader_bytes() const override { return below_.reader_bytes() + tile_bytes(); }

private:
    class Map;
    std::size_t tile_bytes() const;

    WedgeSource& below_;
    std::vector<float> raises_m_;  // unknown_class too
    std::unique_ptr<Map> map_;
};

/// raises_m() of a scene over a data base: empty too where none of its classes can be one that is raised.
std::vector<float> raises_m(const Scene& scene, const DataBase& data_base);

/// A source as a scene sees it: itself, or raised.
class SceneSource {
public:
    SceneSource(WedgeSource& source, const Scene& scene);
    WedgeSource& operator*() { return raised_ ? *raised_ : *source_; }

private:
    WedgeSource* source_;
    std::optional<RaisedSource> raised_;
};

}  // namespace wedgescope
