// How libtiff is opened: each file with handlers of its own, none of which writes to the terminal.
// For the .cpp files of this folder only.
#pragma once
#include <tiffio.h>

#include <cstdarg>
#include <memory>

namespace wedgescope {

struct FreeTiffOptions {
    void operator()(TIFFOpenOptions* options) const noexcept { TIFFOpenOptionsFree(options); }
};
using TiffOptions = std::unique_ptr<TIFFOpenOptions, FreeTiffOptions>;

inline int say_nothing(TIFF*, void*, const char*, const char*, std::va_list) { return 1; }

/// `errors` hears, with `listener`, what goes wrong; nobody what is odd. Null if there is no memory.
inline TiffOptions tiff_options(TIFFErrorHandlerExtR errors = say_nothing, void* listener = nullptr) {
    TiffOptions options(TIFFOpenOptionsAlloc());
    if (!options) return options;
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), errors, listener);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), say_nothing, nullptr);
    return options;
}

}  // namespace wedgescope
