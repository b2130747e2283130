// Power stack: power images of one size as the bands of one GeoTIFF, each with metadata of its own.
// Leaves single images to polar_raster.hpp, and which images and what is said of them to tools/track_stack.hpp.
//
// Bands lie one after the other, as they are, not packed: where a cell stands in the file is known before any is there. So each
// thread writes its image at once, in any order and past all others, and the file is the same; and the disk is asked for the room
// of all of them before the first. GDAL writes none of it: its cache of blocks is the whole process's, and its metadata would
// be held for all bands until the end. The file: header, directory and its lists, bands, metadata; a BigTIFF where that may pass 4 GiB.
//
// Memory: buffer_bytes a writing thread, and as much for metadata and directory.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "tiles/claim.hpp"
#include "tiles/output_file.hpp"
#include "tiles/polar_raster.hpp"

namespace wedgescope {

struct StackContent {
    std::int64_t columns = 0, rows = 0;
    std::size_t bands = 0;
    PowerUnit unit = PowerUnit::watt;
    Metadata metadata;  ///< of all bands
    std::uint64_t most_classic_bytes = 0xffffffff;  ///< what may become longer is a BigTIFF
};

class PowerStack {
public:
    static constexpr std::size_t most_bands = 65535;  ///< TIFF counts them in 16 bits
    static constexpr std::size_t buffer_bytes = std::size_t{64} << 10;
    static constexpr std::size_t band_words = std::size_t{4} << 10;  ///< a band's metadata, about

    /// To file.temporary_path(), with room on disk for all bands; the caller commits. IoError, here and below, names the
    /// final file.
    PowerStack(const StackContent& content, const OutputFile& file);
    PowerStack(const PowerStack&) = delete;
    PowerStack& operator=(const PowerStack&) = delete;

    /// All cells of a band, row after row, once. From several threads.
    void write(std::size_t band, std::span<const float> power_w);
    /// Of the next band, from the first on. From one thread at a time.
    void describe(const std::string& description, const Metadata& items);
    /// When every band is written and described.
    void close();

private:
    /// Of the TIFF's directory: what `value` says of 0 to count - 1.
    struct Entry {
        std::uint16_t tag = 0, type = 0;
        std::uint64_t count = 0;
        std::function<std::uint64_t(std::uint64_t)> value;
    };
    void make_entries();
    std::uint64_t front_bytes() const;
    void lay_out();
    void reserve() const;
    void write_front();
    void write_at(std::uint64_t at, const void* from, std::size_t count) const;
    void add_item(const std::string& name, const std::string& more, const std::string& value);
    void flush_words();
    [[noreturn]] void fail(int why, const std::string& more = "") const;

    StackContent content_;
    std::string final_path_;
    Descriptor file_;
    bool big_ = false;
    std::vector<Entry> entries_;
    std::uint64_t strip_rows_ = 0, strips_ = 0;  ///< of a band
    std::uint64_t row_bytes_ = 0, band_bytes_ = 0, bands_begin_ = 0, words_begin_ = 0, words_end_ = 0;
    std::string words_;  ///< metadata that is not in the file yet
    std::size_t described_ = 0;
};

}  // namespace wedgescope
