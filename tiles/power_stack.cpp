#include "tiles/power_stack.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <limits>

#include "lib/error.hpp"
#include "tiles/side_file.hpp"
#include "tiles/tiff_handle.hpp"

namespace wedgescope {
namespace {

constexpr std::uint64_t most_strip_bytes = std::uint64_t{256} << 10, alignment = 4096;

std::uint64_t value_bytes(std::uint16_t type) {
    switch (type) {
        case TIFF_ASCII:
            return 1;
        case TIFF_SHORT:
            return 2;
        case TIFF_LONG:
            return 4;
        default:
            return 8;
    }
}

constexpr std::uint64_t rounded_up(std::uint64_t n, std::uint64_t step) { return (n + step - 1) / step * step; }

/// The lowest bytes of a number in the machine's order, as a TIFF's header says it is.
void append_number(std::string& out, std::uint64_t value, std::uint64_t bytes) {
    for (std::uint64_t i = 0; i < bytes; ++i) {
        const std::uint64_t at = std::endian::native == std::endian::little ? i : bytes - 1 - i;
        out += static_cast<char>(value >> (8 * at) & 0xff);
    }
}

}  // namespace

PowerStack::PowerStack(const StackContent& content, const OutputFile& file)
    : content_(content), final_path_(file.final_path()),
      file_(::open(file.temporary_path().c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
    if (!file_) fail(errno);
    row_bytes_ = static_cast<std::uint64_t>(content_.columns) * sizeof(float);
    const auto rows = static_cast<std::uint64_t>(content_.rows);
    band_bytes_ = rows * row_bytes_;
    // Readers count strips in 32 bits.
    constexpr std::uint64_t most_strips = std::uint64_t{1} << 31;
    strip_rows_ = std::clamp(most_strip_bytes / row_bytes_, rows * content_.bands / most_strips + 1, rows);
    strips_ = (rows + strip_rows_ - 1) / strip_rows_;
    make_entries();
    lay_out();
    reserve();
    words_ = "<GDALMetadata>\n";
    for (const auto& [name, value] : content_.metadata) add_item(name, "", value);
}

void PowerStack::make_entries() {
    const std::uint64_t bands = content_.bands, strips = strips_ * bands;
    const auto add = [this](std::uint32_t tag, TIFFDataType type, std::uint64_t count, auto value) {
        entries_.push_back({static_cast<std::uint16_t>(tag), static_cast<std::uint16_t>(type), count, value});
    };
    const auto all = [](std::uint64_t value) { return [value](std::uint64_t) { return value; }; };
    const auto letters = [&add](std::uint32_t tag, std::string words) {
        const std::uint64_t count = words.size() + 1;
        add(tag, TIFF_ASCII, count, [words = std::move(words)](std::uint64_t i) {
            return static_cast<std::uint64_t>(static_cast<unsigned char>(words.c_str()[i]));
        });
    };
    add(TIFFTAG_IMAGEWIDTH, TIFF_LONG, 1, all(static_cast<std::uint64_t>(content_.columns)));
    add(TIFFTAG_IMAGELENGTH, TIFF_LONG, 1, all(static_cast<std::uint64_t>(content_.rows)));
    add(TIFFTAG_BITSPERSAMPLE, TIFF_SHORT, bands, all(8 * sizeof(float)));
    add(TIFFTAG_COMPRESSION, TIFF_SHORT, 1, all(COMPRESSION_NONE));
    add(TIFFTAG_PHOTOMETRIC, TIFF_SHORT, 1, all(PHOTOMETRIC_MINISBLACK));
    add(TIFFTAG_STRIPOFFSETS, TIFF_LONG8, strips, [this](std::uint64_t i) {
        return bands_begin_ + i / strips_ * band_bytes_ + i % strips_ * strip_rows_ * row_bytes_;
    });
    add(TIFFTAG_SAMPLESPERPIXEL, TIFF_SHORT, 1, all(bands));
    add(TIFFTAG_ROWSPERSTRIP, TIFF_LONG, 1, all(strip_rows_));
    add(TIFFTAG_STRIPBYTECOUNTS, TIFF_LONG, strips, [this](std::uint64_t i) {
        const std::uint64_t whole = strip_rows_ * row_bytes_;
        return std::min(whole, band_bytes_ - i % strips_ * whole);
    });
    add(TIFFTAG_PLANARCONFIG, TIFF_SHORT, 1, all(PLANARCONFIG_SEPARATE));
    if (bands > 1) add(TIFFTAG_EXTRASAMPLES, TIFF_SHORT, bands - 1, all(EXTRASAMPLE_UNSPECIFIED));
    add(TIFFTAG_SAMPLEFORMAT, TIFF_SHORT, bands, all(SAMPLEFORMAT_IEEEFP));
    add(gdal_metadata, TIFF_ASCII, 0, all(0));  // it stands elsewhere, and how long it is shows at the end
    if (content_.unit == PowerUnit::dbm) letters(gdal_no_data, fmt::format("{}", no_dbm));
}

/// Up to the first band: header, directory, and the lists that do not fit into it.
std::uint64_t PowerStack::front_bytes() const {
    const std::uint64_t inside = big_ ? 8 : 4;
    std::uint64_t bytes = big_ ? 16 + 8 + 20 * entries_.size() + 8 : 8 + 2 + 12 * entries_.size() + 4;
    for (const Entry& entry : entries_) {
        const std::uint64_t list = entry.count * value_bytes(entry.type);
        if (list > inside) bytes = rounded_up(bytes, 8) + list;
    }
    return bytes;
}

void PowerStack::lay_out() {
    for (const bool big : {false, true}) {
        big_ = big;
        for (Entry& entry : entries_)
            if (entry.tag == TIFFTAG_STRIPOFFSETS) entry.type = big ? TIFF_LONG8 : TIFF_LONG;
        bands_begin_ = rounded_up(front_bytes(), alignment);
        words_begin_ = words_end_ = bands_begin_ + content_.bands * band_bytes_;
        std::uint64_t words = (content_.bands + 1) * 2 * band_words;
        for (const auto& [name, value] : content_.metadata) words += 10 * (name.size() + value.size());
        if (words_begin_ + words <= content_.most_classic_bytes) return;
    }
}

void PowerStack::reserve() const {
    int why = 0;
    do {
        why = ::fallocate(file_.get(), 0, 0, static_cast<off_t>(words_begin_)) == 0 ? 0 : errno;
    } while (why == EINTR);
    // Where the file system knows nothing of the kind, a full disk shows when it is full.
    if (why != 0 && why != EOPNOTSUPP && why != ENOSYS)
        fail(why, text(" (", content_.bands, " frames take ", (words_begin_ >> 20) + 1, " MiB)"));
}

void PowerStack::write(std::size_t band, std::span<const float> power_w) {
    if (power_w.size_bytes() != band_bytes_ || band >= content_.bands)
        throw Error(text("output '", final_path_, "': band ", band + 1, " of ", content_.bands, " is an image of ",
                         power_w.size_bytes(), " bytes instead of ", band_bytes_));
    const std::uint64_t at = bands_begin_ + band * band_bytes_;
    if (content_.unit == PowerUnit::watt) return write_at(at, power_w.data(), power_w.size_bytes());
    std::vector<float> some(std::min(power_w.size(), buffer_bytes / sizeof(float)));
    for (std::size_t begin = 0; begin < power_w.size(); begin += some.size()) {
        const auto from = power_w.subspan(begin, std::min(some.size(), power_w.size() - begin));
        std::transform(from.begin(), from.end(), some.begin(), power_in_dbm);
        write_at(at + begin * sizeof(float), some.data(), from.size_bytes());
    }
}

void PowerStack::describe(const std::string& description, const Metadata& items) {
    const std::string sample = text(" sample=\"", described_++, "\"");
    for (const auto& [name, value] : items) add_item(name, sample, value);
    add_item("DESCRIPTION", sample + " role=\"description\"", description);
    add_item("UNITTYPE", sample + " role=\"unittype\"", content_.unit == PowerUnit::watt ? "W" : "dBm");
    if (words_.size() >= buffer_bytes) flush_words();
}

/// As GDAL has it: values are made XML twice.
void PowerStack::add_item(const std::string& name, const std::string& more, const std::string& value) {
    words_ += "  <Item name=\"" + xml_words(name, true) + "\"" + more + ">" + xml_words(xml_words(value, true), false) +
              "</Item>\n";
}

void PowerStack::flush_words() {
    write_at(words_end_, words_.data(), words_.size());
    words_end_ += words_.size();
    words_.clear();
    if (!big_ && words_end_ > std::numeric_limits<std::uint32_t>::max())
        throw Error(text("output '", final_path_, "': more metadata than room was left for"));
}

void PowerStack::close() {
    if (described_ != content_.bands)
        throw Error(text("output '", final_path_, "': ", described_, " of ", content_.bands, " bands are described"));
    words_ += "</GDALMetadata>\n";
    words_ += '\0';
    flush_words();
    write_front();
    if (::close(file_.release()) != 0) fail(errno);
}

void PowerStack::write_front() {
    const std::uint64_t inside = big_ ? 8 : 4, wide = big_ ? 8 : 4;
    std::string out = std::endian::native == std::endian::little ? "II" : "MM";
    std::uint64_t at = 0;  // where `out` goes
    append_number(out, big_ ? 43 : 42, 2);
    if (big_) {
        append_number(out, 8, 2);  // bytes of an offset
        append_number(out, 0, 2);
    }
    append_number(out, big_ ? 16 : 8, wide);  // where the directory begins: here
    append_number(out, entries_.size(), big_ ? 8 : 2);
    std::uint64_t list_begin = out.size() + entries_.size() * (big_ ? 20 : 12) + wide;
    for (const Entry& entry : entries_) {
        const bool words = entry.tag == gdal_metadata;
        const std::uint64_t count = words ? words_end_ - words_begin_ : entry.count,
                            bytes = count * value_bytes(entry.type);
        append_number(out, entry.tag, 2);
        append_number(out, entry.type, 2);
        append_number(out, count, wide);
        if (words) {
            append_number(out, words_begin_, wide);
        } else if (bytes > inside) {
            list_begin = rounded_up(list_begin, 8);
            append_number(out, list_begin, wide);
            list_begin += bytes;
        } else {
            for (std::uint64_t i = 0; i < count; ++i) append_number(out, entry.value(i), value_bytes(entry.type));
            out.append(inside - bytes, '\0');
        }
    }
    append_number(out, 0, wide);  // no directory behind this one
    for (const Entry& entry : entries_) {
        if (entry.count * value_bytes(entry.type) <= inside) continue;
        out.append(rounded_up(at + out.size(), 8) - at - out.size(), '\0');
        for (std::uint64_t i = 0; i < entry.count; ++i) {
            append_number(out, entry.value(i), value_bytes(entry.type));
            if (out.size() < buffer_bytes) continue;
            write_at(at, out.data(), out.size());
            at += out.size();
            out.clear();
        }
    }
    write_at(at, out.data(), out.size());
}

void PowerStack::write_at(std::uint64_t at, const void* from, std::size_t count) const {
    if (const int error = write_all_at(file_.get(), from, count, at).error) fail(error);
}

void PowerStack::fail(int why, const std::string& more) const {
    throw IoError(text("output '", final_path_, "' cannot be written: ", system_reason(why), more));
}

}  // namespace wedgescope
