#include "tiles/png_file.hpp"

#include <png.h>
#include <zlib.h>

#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <memory>
#include <system_error>
#include <vector>

#include "lib/error.hpp"

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
bool encode(png_structp png, png_infop info, std::FILE* file, std::uint32_t columns, std::uint32_t rows,
            const std::uint8_t* const* bands, std::size_t band_count, std::uint8_t* mixed) noexcept {
    if (setjmp(png_jmpbuf(png))) return false;
    png_init_io(png, file);
    png_set_IHDR(png, info, columns, rows, 8, band_count == 2 ? PNG_COLOR_TYPE_GRAY_ALPHA : PNG_COLOR_TYPE_GRAY,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    // Speckle and slopes repeat nothing but runs.
    png_set_filter(png, PNG_FILTER_TYPE_DEFAULT, PNG_FILTER_SUB);
    png_set_compression_strategy(png, Z_RLE);
    png_set_compression_level(png, 1);
    png_set_compression_buffer_size(png, std::size_t{1} << 16);
    png_write_info(png, info);
    for (std::size_t row = 0; row < rows; ++row) {
        const std::uint8_t* grey = bands[0] + row * columns;
        if (band_count == 2) {
            const std::uint8_t* alpha = bands[1] + row * columns;
            for (std::size_t i = 0; i < columns; ++i) {
                mixed[2 * i] = grey[i];
                mixed[2 * i + 1] = alpha[i];
            }
            grey = mixed;
        }
        png_write_row(png, grey);
    }
    png_write_end(png, nullptr);
    return true;
}

}  // namespace

void write_png(const std::string& path, std::int64_t columns, std::int64_t rows,
               std::span<const std::uint8_t* const> bands, const std::string& final_path) {
    const auto fail = [&](const std::string& why) {
        throw IoError(text("output '", final_path, "' cannot be written: ", why));
    };
    const auto system_reason = [] { return std::error_code(errno, std::generic_category()).message(); };
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"), std::fclose);
    if (!file) fail(system_reason());
    std::vector<std::uint8_t> mixed(bands.size() == 2 ? static_cast<std::size_t>(2 * columns) : 0);
    Complaint complaint;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &complaint, complain, say_nothing);
    png_infop info = png ? png_create_info_struct(png) : nullptr;
    if (!info) {
        png_destroy_write_struct(&png, nullptr);
        fail(complaint.words[0] ? complaint.words : "libpng cannot begin");
    }
    errno = 0;
    const bool good = encode(png, info, file.get(), static_cast<std::uint32_t>(columns),
                             static_cast<std::uint32_t>(rows), bands.data(), bands.size(), mixed.data());
    const std::string why = errno != 0 ? system_reason() : complaint.words;
    png_destroy_write_struct(&png, &info);
    if (!good) fail(why);
    errno = 0;
    if (std::fclose(file.release()) != 0) fail(system_reason());
}

}  // namespace wedgescope
