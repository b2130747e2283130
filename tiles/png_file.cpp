#include "tiles/png_file.hpp"

#include <png.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_pipeline.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <limits>
#include <memory>
#include <new>
#include <system_error>
#include <utility>
#include <vector>

#include "lib/error.hpp"
#include "lib/interval.hpp"
#include "lib/raw_vector.hpp"
#include "lib/threads.hpp"

namespace wedgescope {
namespace {

/// What libpng says, and what the system said with it.
struct Complaint {
    char words[200] = {};
    int reason = 0;
};

[[noreturn]] void complain(png_structp png, png_const_charp message) {
    auto* complaint = static_cast<Complaint*>(png_get_error_ptr(png));
    complaint->reason = errno;
    std::snprintf(complaint->words, sizeof complaint->words, "%s", message);
    png_longjmp(png, 1);
}

void say_nothing(png_structp, png_const_charp) {}

/// A PNG that is written. All is false where libpng jumped back: nothing with a destructor may live in what calls it.
class PngFrame {
public:
    PngFrame() : png_(png_create_write_struct(PNG_LIBPNG_VER_STRING, &complaint_, complain, say_nothing)) {
        if (png_) info_ = png_create_info_struct(png_);
    }
    ~PngFrame() { png_destroy_write_struct(&png_, &info_); }
    PngFrame(const PngFrame&) = delete;
    PngFrame& operator=(const PngFrame&) = delete;

    bool begin(std::FILE* file, std::uint32_t columns, std::uint32_t rows, std::size_t bands) noexcept {
        if (!info_ || setjmp(png_jmpbuf(png_))) return false;
        errno = 0;
        png_init_io(png_, file);
        png_set_IHDR(png_, info_, columns, rows, 8, bands == 2 ? PNG_COLOR_TYPE_GRAY_ALPHA : PNG_COLOR_TYPE_GRAY,
                     PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
        png_write_info(png_, info_);
        return true;
    }
    bool write_chunk(const char* name, const std::vector<std::uint8_t>& bytes) noexcept {
        if (setjmp(png_jmpbuf(png_))) return false;
        errno = 0;
        png_write_chunk(png_, reinterpret_cast<png_const_bytep>(name), bytes.data(), bytes.size());
        return true;
    }
    std::string why() const {
        if (complaint_.reason != 0) return std::error_code(complaint_.reason, std::generic_category()).message();
        return complaint_.words[0] ? complaint_.words : "libpng cannot begin";
    }

private:
    Complaint complaint_;
    png_structp png_ = nullptr;
    png_infop info_ = nullptr;
};

/// Rows of a picture, packed on their own.
struct PackedRows {
    std::vector<std::uint8_t> packed;
    uLong sum = 0;  ///< Adler's, of what is packed
    z_off_t bytes = 0;
};

/// What a thread packs with. Speckle and slopes repeat nothing but runs, so no piece misses what came before it.
class RowPacker {
public:
    RowPacker() {
        constexpr int no_head = -1, window_bits = 15, memory_level = 8;
        if (deflateInit2(&stream_, 1, Z_DEFLATED, no_head * window_bits, memory_level, Z_RLE) != Z_OK)
            throw std::bad_alloc();
    }
    ~RowPacker() { deflateEnd(&stream_); }
    RowPacker(const RowPacker&) = delete;
    RowPacker& operator=(const RowPacker&) = delete;

    /// Each row as what it differs from its left neighbours by. Whole bytes; the last piece ends the stream.
    void pack(std::span<const std::uint8_t* const> bands, std::int64_t columns, Interval rows, bool last,
              PackedRows& piece) {
        const std::size_t channels = bands.size(), line = static_cast<std::size_t>(columns) * channels + 1;
        differences_.resize(line * static_cast<std::size_t>(rows.size()));
        std::uint8_t* to = differences_.data();
        for (std::int64_t row = rows.begin; row < rows.end; ++row, to += line) {
            to[0] = PNG_FILTER_VALUE_SUB;
            for (std::size_t c = 0; c < channels; ++c) {
                const std::uint8_t* const from = bands[c] + row * columns;
                to[1 + c] = from[0];
                for (std::int64_t i = 1; i < columns; ++i)
                    to[1 + static_cast<std::size_t>(i) * channels + c] =
                        static_cast<std::uint8_t>(from[i] - from[i - 1]);
            }
        }
        constexpr std::size_t flush_bytes = 16;
        deflateReset(&stream_);
        packed_.resize(deflateBound(&stream_, static_cast<uLong>(differences_.size())) + flush_bytes);
        if (packed_.size() > std::numeric_limits<uInt>::max()) throw Error("a row of a picture is too long for zlib");
        stream_.next_in = differences_.data();
        stream_.avail_in = static_cast<uInt>(differences_.size());
        stream_.next_out = packed_.data();
        stream_.avail_out = static_cast<uInt>(packed_.size());
        const int said = deflate(&stream_, last ? Z_FINISH : Z_SYNC_FLUSH);
        if (said != (last ? Z_STREAM_END : Z_OK) || stream_.avail_in != 0 || stream_.avail_out == 0)
            throw Error("zlib cannot pack rows of a picture");
        piece.sum = adler32(adler32(0, nullptr, 0), differences_.data(), static_cast<uInt>(differences_.size()));
        piece.bytes = static_cast<z_off_t>(differences_.size());
        piece.packed.assign(packed_.data(), packed_.data() + (packed_.size() - stream_.avail_out));
    }

private:
    z_stream stream_{};
    RawVector<std::uint8_t> differences_, packed_;
};

/// All chunks of image data and the end. False where libpng jumped back.
bool encode(PngFrame& frame, std::int64_t columns, std::int64_t rows, std::span<const std::uint8_t* const> bands,
            int threads) {
    // Where pieces begin does not hang on threads, so no byte does.
    constexpr std::int64_t piece_bytes = std::int64_t{1} << 16;
    const std::int64_t high =
        std::max<std::int64_t>(1, piece_bytes / (columns * static_cast<std::int64_t>(bands.size()) + 1));
    tbb::enumerable_thread_specific<RowPacker> packers;
    const auto pack = [&](Interval own) {
        PackedRows piece;
        packers.local().pack(bands, columns, own, own.end == rows, piece);
        return piece;
    };
    std::atomic<bool> good = true;
    std::int64_t written = 0;  // rows
    uLong sum = adler32(0, nullptr, 0);
    const auto write = [&](PackedRows piece) {
        std::vector<std::uint8_t>& bytes = piece.packed;
        sum = adler32_combine(sum, piece.sum, piece.bytes);
        if (written == 0) {
            constexpr std::uint8_t head[] = {0x78, 0x01};  // deflate, a window of 32 KiB at the most, packed fast
            bytes.insert(bytes.begin(), std::begin(head), std::end(head));
        }
        written = std::min(written + high, rows);
        if (written == rows)
            for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(sum >> shift));
        if (good) good = frame.write_chunk("IDAT", bytes);
    };
    if (threads > 1) {
        std::int64_t next = 0;
        const auto rows_of_next = [&](tbb::flow_control& control) -> Interval {
            if (next == rows || !good) {
                control.stop();
                return {};
            }
            const std::int64_t begin = std::exchange(next, std::min(next + high, rows));
            return {begin, next};
        };
        Threads(threads, false).execute([&] {
            constexpr std::size_t waiting = 2;  // pieces a thread
            tbb::parallel_pipeline(waiting * static_cast<std::size_t>(threads),
                                   tbb::make_filter<void, Interval>(tbb::filter_mode::serial_in_order, rows_of_next) &
                                       tbb::make_filter<Interval, PackedRows>(tbb::filter_mode::parallel, pack) &
                                       tbb::make_filter<PackedRows, void>(tbb::filter_mode::serial_in_order, write));
        });
    } else {
        for (std::int64_t begin = 0; begin < rows && good; begin += high)
            write(pack({begin, std::min(begin + high, rows)}));
    }
    return good && frame.write_chunk("IEND", {});
}

}  // namespace

void write_png(const std::string& path, std::int64_t columns, std::int64_t rows,
               std::span<const std::uint8_t* const> bands, int threads, const std::string& final_path) {
    const auto fail = [&](const std::string& why) {
        throw IoError(text("output '", final_path, "' cannot be written: ", why));
    };
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"), std::fclose);
    if (!file) fail(system_reason(errno));
    PngFrame frame;
    if (!frame.begin(file.get(), static_cast<std::uint32_t>(columns), static_cast<std::uint32_t>(rows), bands.size()) ||
        !encode(frame, columns, rows, bands, std::max(1, threads)))
        fail(frame.why());
    errno = 0;
    if (std::fclose(file.release()) != 0) fail(system_reason(errno));
}

}  // namespace wedgescope
