// Spill: blocks of bytes in wedge buckets, in memory until their share of it is full, then in one file.
// The only place that names, writes and reads a spill file. Leaves what the bytes mean to packed_block.hpp and which
// blocks there are to partition.hpp.
//
// Who owns what: put() copies a block's bytes; they stay in memory until all blocks together hold more than
// `memory_bytes`. Then the largest bucket goes to the file, near to far, in one run, and its memory is given back, until
// the rest fits. Beside that a spill holds 24 bytes for each block of its layers, stored or not, and 1 MiB while a
// bucket is written. The file of a spill that is not kept never has a name (or loses it as soon as it is open), so
// that nothing stays behind however the program ends; a kept one gets its name when it is whole. Where a file needs a name
// at once, or is killed on the way to its own, the next spill in the folder removes it (claim.hpp).
//
// File: 64 bytes of header (where the index is; kept spills only), blocks, index. A block is 24 bytes (mark, length,
// place, checksum) and its bytes; the checksum (XXH3, 64 bits) covers mark, length, place and bytes. Header and index
// carry a checksum each. All numbers little-endian.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <shared_mutex>
#include <span>
#include <string>
#include <vector>

#include "lib/interval.hpp"
#include "lib/timeline.hpp"

namespace wedgescope {

struct SpillParams {
    std::string folder;  ///< for the file; empty: temporary_folder()
    std::string keep;    ///< the path of a spill that stays; empty: no name. An older one is replaced
    std::size_t memory_bytes = 0;
    int buckets = 1;
    Timeline* timeline = nullptr;  ///< told of what goes to the file and comes back
};

/// CPL_TMPDIR, TMPDIR or /tmp: the first that is set and not empty.
std::string temporary_folder();

/// Blocks of `edge` x `edge` posts (fewer at the far edges) of one raster.
struct SpillLayer {
    std::string name;  ///< for messages: "dem", "culture-height", "culture"
    std::int64_t edge = 128;
    std::int64_t posts_columns = 0, posts_rows = 0;  ///< of the whole raster
    Window blocks;                                   ///< those that may be stored, in units of `edge`
    Window posts(std::int64_t column, std::int64_t row) const {
        return {{column * edge, std::min((column + 1) * edge, posts_columns)},
                {row * edge, std::min((row + 1) * edge, posts_rows)}};
    }
    friend bool operator==(const SpillLayer&, const SpillLayer&) = default;
};

class Spill {
public:
    /// Beside a block's own bytes: in memory (its place in a bucket and the allocator's share) and in the file; and the
    /// file's header.
    static constexpr std::size_t held_overhead = 64, file_overhead = 24, header_bytes = 64;

    explicit Spill(SpillParams params);
    /// A kept one. IoError if it cannot be opened, DataError if it is none or its header or index is damaged.
    static std::unique_ptr<Spill> open_kept(const std::string& path, Timeline* timeline = nullptr);
    ~Spill();
    Spill(const Spill&) = delete;
    Spill& operator=(const Spill&) = delete;

    /// Opens the file now if so many bytes will not fit into memory, so that a bad folder is found before any work.
    void expect(std::uint64_t bytes);
    /// Returns the layer's number. Before the first put() into it; not beside get().
    std::size_t add_layer(SpillLayer layer);
    const SpillLayer& layer(std::size_t number) const { return layers_[number]->facts; }
    std::size_t layer_count() const { return layers_.size(); }

    /// One thread at a time, beside any number of get(). `distance`: order within the bucket. IoError (disk full, ...).
    void put(std::size_t layer, std::int64_t column, std::int64_t row, int bucket, double distance,
             std::span<const std::byte> bytes);
    bool holds(std::size_t layer, std::int64_t column, std::int64_t row) const;
    /// The bytes of a block; empty if there are none. They lie in `buffer` or in the spill and are good until either is
    /// used again. IoError if they cannot be read, DataError naming file and block if they are damaged.
    std::span<const std::byte> get(std::size_t layer, std::int64_t column, std::int64_t row,
                                   std::vector<std::byte>& buffer);
    /// After the last put().
    void seal() { sealed_ = true; }
    /// Everything and the index to disk, and the file under its name. Seals. Only with `keep`.
    void keep(const std::string& description);
    /// What keep() was given.
    const std::string& description() const { return description_; }

    /// Size of the file; 0 while there is no block in it.
    std::uint64_t bytes_spilled() const {
        const std::uint64_t bytes = file_end_;
        return bytes > header_bytes ? bytes : 0;
    }
    std::uint64_t bytes_read() const { return read_; }  ///< from the file
    /// From the files of all spills by the calling thread: what a piece of its work took is a difference of two.
    static std::uint64_t bytes_read_here();
    std::size_t bytes_held() const { return held_; }  ///< blocks in memory
    std::size_t index_bytes() const;

private:
    struct Slot {
        std::unique_ptr<std::byte[]> memory;  ///< none: in the file, if bytes > 0
        std::uint64_t offset = 0;
        std::uint32_t bytes = 0;
    };
    struct Layer {
        SpillLayer facts;
        std::vector<Slot> slots;
    };
    struct Pending {
        double distance = 0;
        std::size_t layer = 0;
        std::int64_t column = 0, row = 0;
    };
    struct Bucket {
        std::vector<Pending> pending;
        std::size_t bytes = 0;
    };

    std::string named() const;
    Slot* slot(std::size_t layer, std::int64_t column, std::int64_t row) const;
    void open_file();
    void open_named_file();  ///< where the system knows no files without a name
    void write(std::span<const std::byte> bytes, std::uint64_t offset);
    void flush(Bucket& bucket);
    void read(std::uint64_t offset, std::span<std::byte> into, const std::string& what) const;
    void read_index();

    SpillParams params_;
    std::string description_;
    std::vector<std::unique_ptr<Layer>> layers_;
    std::vector<Bucket> buckets_;
    int file_ = -1;
    std::string unnamed_;  ///< path of a file to be removed, where the system knows no files without a name
    std::atomic<std::uint64_t> file_end_ = 0;
    mutable std::atomic<std::uint64_t> read_ = 0;
    std::atomic<std::size_t> held_ = 0;
    std::atomic<bool> sealed_ = false;
    mutable std::shared_mutex slots_mutex_;  ///< a bucket's way from memory to the file
};

}  // namespace wedgescope
