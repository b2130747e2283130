// Shared source: one data base for many scenes side by side: its posts and classes stay in memory where they fit, and its
// positions may be asked from several threads. The same bits as the source beneath, which keeps all else: reading, block
// map, fingerprint.
//
// Memory: 4 bytes a post, 8 where culture heights stand, and 1 byte a culture cell, if together they are at most a quarter
// of the memory; else nothing, and the caches of the source beneath serve. While it reads, each thread holds a piece of
// half a Mi posts more: what the scenes hold comes later.
#pragma once
#include <memory>

#include "lib/stop.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

class SharedSource final : public WedgeSource {
public:
    SharedSource(std::unique_ptr<WedgeSource> source, std::size_t memory_bytes);

    /// Reads all that is to stay in memory; before the first scene. Nothing stays where some of it cannot be used.
    /// IoError, Interrupted.
    void read(const Stop* stop);

    const DataBase& data_base() const override { return data_base_; }
    using WedgeSource::load;
    Chunk load(const ChunkRequest& request) override;
    LoadCost cost(const ChunkRequest& request) const override;
    std::uint64_t class_bytes(const Window& cells) const override;
    CultureCells load_classes(const Window& cells) override;
    BlockMap* block_map() override { return source_->block_map(); }
    DetailMap* detail_map() override { return source_->detail_map(); }
    Skipped skipped() const override { return source_->skipped(); }
    void read_bare_terrain(const Window& posts, float* heights_m) override {
        source_->read_bare_terrain(posts, heights_m);
    }
    Extremes extremes() override { return source_->extremes(); }
    SourceReport report() const override { return source_->report(); }
    std::uint64_t fingerprint(const std::vector<Window>& posts) override { return source_->fingerprint(posts); }
    std::size_t cache_bytes() const override { return source_->cache_bytes() + kept_bytes_; }
    std::size_t filled_bytes(std::uint64_t bytes_read) const override {
        return source_->filled_bytes(bytes_read) + kept_bytes_;
    }
    std::size_t held_bytes() const override { return source_->held_bytes() + kept_bytes_; }
    std::size_t reader_bytes() const override { return keeps() ? 0 : source_->reader_bytes(); }

    bool keeps() const { return kept_bytes_ > 0; }

private:
    void read_all(const Stop* stop);
    /// Kept posts of a row from `columns` on, which may pass the ends of a cycle.
    void copy_row(const std::vector<float>& layer, Interval columns, std::int64_t row, float* to) const;
    RawVector<float> posts(const std::vector<float>& layer, const Window& window, bool lines_are_columns,
                           int level = 0) const;

    std::unique_ptr<WedgeSource> source_;
    DataBase data_base_;
    std::size_t kept_bytes_ = 0;  ///< that it will hold or holds; 0: none
    bool read_ = false;
    std::vector<float> surface_m_, culture_m_;  ///< row after row
    std::vector<ClassId> classes_;
    bool keeps_classes_ = false;
};

}  // namespace wedgescope
