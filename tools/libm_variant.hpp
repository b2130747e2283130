// Which of its variants the C library's mathematics runs: on every processor the same one.
// Leaves all of the program's own loops, which fuse nothing, to lib/.
#pragma once
#include <string>
#include <string_view>

namespace wedgescope {

/// GLIBC_TUNABLES with FMA and FMA4 hidden, whatever else it sets.
std::string without_fma(std::string_view tunables);

/// glibc's sine, logarithm and others have variants for processors with fused multiply-adds, whose last bits differ; PROJ and
/// GeographicLib call them too, and of values that are rounded afterwards one in thousands lies so that the last bit shows. Where the
/// processor has them and they are not hidden this begins the program anew with them hidden, which takes a millisecond or two; if
/// that cannot be done, or WEDGESCOPE_LIBM says as-is, it goes on as it is. To be called before anything else.
void hide_fma_from_libm(char** arguments);

}  // namespace wedgescope
