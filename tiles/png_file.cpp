#include "tiles/png_file.hpp"

#include <png.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <memory>
#include <new>
#include <system_error>
#include <vector>

#include "lib/error.hpp"
#include "lib/interval.hpp"
#include "lib/raw_vector.hpp"

namespace wedgescope {
namespace {

/// What libpng says, until encode() is back.
struct Complaint {
    char words[200] = {};
};

[[noreturn]] void complain(png_structp png, png_const_charp message) {
    auto* complaint = static_cast<Complaint*>(png_get_error_ptr(png));
    std::snprintf(complaint->words, sizeof complaint->words, "%s", message);
    png_longjmp(png, 1);
}

void say_nothing(png_structp, png_const_charp) {}

/// False where libpng jumped back: nothing with a destructor may live here.
bool begin(png_structp png, png_infop info, std::FILE* file, std::uint32_t columns, std::uint32_t rows,
           std::size_t band_count) noexcept {
    if (setjmp(png_jmpbuf(png))) return false;
    png_init_io(png, file);
    png_set_IHDR(png, info, columns, rows, 8, band_count == 2 ? PNG_COLOR_TYPE_GRAY_ALPHA : PNG_COLOR_TYPE_GRAY,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    return true;
}
bool write_chunk(png_structp png, const char* name, const std::vector<std::uint8_t>& bytes) noexcept {
    if (setjmp(png_jmpbuf(png))) return false;
    png_write_chunk(png, reinterpret_cast<png_const_bytep>(name), bytes.data(), bytes.size());
    return true;
}

/// Rows of a picture, packed on their own.
struct Piece {
    std::vector<std::uint8_t> packed;
    uLong sum = 0;  ///< Adler's, of what is packed
    z_off_t bytes = 0;
};

/// What a thread packs with. Speckle and slopes repeat nothing but runs, so no piece misses what came before it.
class Packer {
public:
    Packer() {
        constexpr int no_head = -1, window_bits = 15, memory_level = 8;
        if (deflateInit2(&stream_, 1, Z_DEFLATED, no_head * window_bits, memory_level, Z_RLE) != Z_OK)
            throw std::bad_alloc();
    }
    ~Packer() { deflateEnd(&stream_); }
    Packer(const Packer&) = delete;
    Packer& operator=(const Packer&) = delete;

    /// Each row as what it differs from its left neighbours by. Whole bytes; the last piece ends the stream.
    void pack(std::span<const std::uint8_t* const> bands, std::int64_t columns, Interval rows, bool last,
              Piece& piece) {
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
        piece.sum = adler32(0, nullptr, 0);
        piece.bytes = static_cast<z_off_t>(differences_.size());
        constexpr std::size_t most = std::size_t{1} << 30;  // zlib counts in 32 bits
        std::size_t in = 0, out = 0;
        while (in < differences_.size()) {
            const std::size_t n = std::min(most, differences_.size() - in), room = std::min(most, packed_.size() - out);
            stream_.next_in = differences_.data() + in;
            stream_.avail_in = static_cast<uInt>(n);
            stream_.next_out = packed_.data() + out;
            stream_.avail_out = static_cast<uInt>(room);
            const bool all = in + n == differences_.size();
            const int said = deflate(&stream_, !all ? Z_NO_FLUSH : last ? Z_FINISH : Z_SYNC_FLUSH);
            if (said != (all && last ? Z_STREAM_END : Z_OK)) throw Error("zlib cannot pack rows of a picture");
            const std::size_t taken = n - stream_.avail_in;
            piece.sum = adler32(piece.sum, differences_.data() + in, static_cast<uInt>(taken));
            in += taken;
            out += room - stream_.avail_out;
        }
        piece.packed.assign(packed_.data(), packed_.data() + out);
    }

private:
    z_stream stream_{};
    RawVector<std::uint8_t> differences_, packed_;
};

/// All chunks of image data and the end. False where libpng jumped back.
bool encode(png_structp png, std::int64_t columns, std::int64_t rows, std::span<const std::uint8_t* const> bands,
            int threads) {
    // Where pieces begin does not hang on threads, so no byte does.
    constexpr std::int64_t piece_bytes = std::int64_t{1} << 16, pieces_a_thread = 8;
    const std::int64_t high =
        std::max<std::int64_t>(1, piece_bytes / (columns * static_cast<std::int64_t>(bands.size()) + 1));
    std::vector<Piece> pieces;
    tbb::enumerable_thread_specific<Packer> packers;
    uLong sum = adler32(0, nullptr, 0);
    for (std::int64_t first = 0; first < rows;) {
        const std::int64_t count = std::min<std::int64_t>(pieces_a_thread * threads, (rows - first + high - 1) / high);
        pieces.resize(static_cast<std::size_t>(count));
        const auto pack = [&](std::int64_t i) {
            const std::int64_t from = first + i * high, end = std::min(from + high, rows);
            packers.local().pack(bands, columns, {from, end}, end == rows, pieces[static_cast<std::size_t>(i)]);
        };
        if (threads > 1)
            tbb::task_arena(threads).execute([&] { tbb::parallel_for(std::int64_t{0}, count, pack); });
        else
            for (std::int64_t i = 0; i < count; ++i) pack(i);
        for (Piece& piece : pieces) {
            sum = adler32_combine(sum, piece.sum, piece.bytes);
            std::vector<std::uint8_t>& bytes = piece.packed;
            if (first == 0) {
                constexpr std::uint8_t head[] = {0x78, 0x01};  // deflate, a window of 32 KiB at the most, packed fast
                bytes.insert(bytes.begin(), std::begin(head), std::end(head));
            }
            first = std::min(first + high, rows);
            if (first == rows)
                for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(sum >> shift));
            if (!write_chunk(png, "IDAT", bytes)) return false;
        }
    }
    return write_chunk(png, "IEND", {});
}

}  // namespace

void write_png(const std::string& path, std::int64_t columns, std::int64_t rows,
               std::span<const std::uint8_t* const> bands, int threads, const std::string& final_path) {
    const auto fail = [&](const std::string& why) {
        throw IoError(text("output '", final_path, "' cannot be written: ", why));
    };
    const auto system_reason = [] { return std::error_code(errno, std::generic_category()).message(); };
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"), std::fclose);
    if (!file) fail(system_reason());
    Complaint complaint;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &complaint, complain, say_nothing);
    png_infop info = png ? png_create_info_struct(png) : nullptr;
    if (!info) {
        png_destroy_write_struct(&png, nullptr);
        fail(complaint.words[0] ? complaint.words : "libpng cannot begin");
    }
    const auto end = [&] { png_destroy_write_struct(&png, &info); };
    bool good = false;
    errno = 0;
    try {
        good = begin(png, info, file.get(), static_cast<std::uint32_t>(columns), static_cast<std::uint32_t>(rows),
                     bands.size()) &&
               encode(png, columns, rows, bands, std::max(1, threads));
    } catch (...) {
        end();
        throw;
    }
    const std::string why = errno != 0 ? system_reason() : complaint.words;
    end();
    if (!good) fail(why);
    errno = 0;
    if (std::fclose(file.release()) != 0) fail(system_reason());
}

}  // namespace wedgescope
