// How libtiff is opened: each file with handlers of its own, none of which writes to the terminal.
// For the .cpp files of this folder only.
#pragma once
#include <tiffio.h>

#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

namespace wedgescope {

/// Tags of GeoTIFF's (OGC 19-008r4) and GDAL's, of which libtiff knows nothing until it is told.
inline constexpr std::uint32_t pixel_scale = 33550, tie_points = 33922, transformation = 34264, key_directory = 34735,
                               key_doubles = 34736, key_words = 34737, gdal_metadata = 42112, gdal_no_data = 42113;

struct FreeTiffOptions {
    void operator()(TIFFOpenOptions* options) const noexcept { TIFFOpenOptionsFree(options); }
};
using TiffOptions = std::unique_ptr<TIFFOpenOptions, FreeTiffOptions>;

inline int say_nothing(TIFF*, void*, const char*, const char*, std::va_list) { return 1; }

/// What went wrong first, as libtiff says it while the system's own reason can still be asked.
struct TiffTrouble {
    int system = 0;
    char words[200] = {};
};

/// For tiff_options(): a TiffTrouble notes it.
inline int note_trouble(TIFF*, void* trouble, const char*, const char* format, std::va_list more) {
    auto& first = *static_cast<TiffTrouble*>(trouble);
    if (first.words[0] == 0) {
        first.system = errno;
        std::vsnprintf(first.words, sizeof first.words, format, more);
    }
    return 1;  // and nobody else hears it
}

/// `errors` hears, with `listener`, what goes wrong, `warnings` what is odd. Null if there is no memory.
inline TiffOptions tiff_options(TIFFErrorHandlerExtR errors = say_nothing, void* listener = nullptr,
                                TIFFErrorHandlerExtR warnings = say_nothing) {
    TiffOptions options(TIFFOpenOptionsAlloc());
    if (!options) return options;
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), errors, listener);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), warnings, listener);
    return options;
}

struct CloseTiff {
    void operator()(TIFF* file) const noexcept { TIFFClose(file); }
};
using TiffReader = std::unique_ptr<TIFF, CloseTiff>;

/// Opened without mapping the file into memory; where its tiles lie is read when it is asked for. Null if it is no TIFF.
inline TiffReader read_tiff(const std::string& path, TIFFErrorHandlerExtR errors = say_nothing,
                            TIFFErrorHandlerExtR warnings = say_nothing, void* listener = nullptr) {
    const TiffOptions options = tiff_options(errors, listener, warnings);
    return TiffReader(options ? TIFFOpenExt(path.c_str(), "rmD", options.get()) : nullptr);
}

}  // namespace wedgescope
