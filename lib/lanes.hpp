// Lanes: how plain loops over contiguous arrays are compiled for several instruction sets from one source.
// Leaves what the loops do to sample.cpp, sweep.cpp and shade.cpp.
//
// The loops hold only + - * / sqrt, selections and conversions, and the build never fuses a multiplication with an
// addition (-ffp-contract=off), so every instruction set gives the same bits. Sanitizers do not get on with the
// resolver functions that this needs: there the baseline is compiled alone.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define WEDGESCOPE_LANES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define WEDGESCOPE_LANES
#endif

/// In front of a loop: no turn reads what another writes (the arrays are different ones).
#define WEDGESCOPE_INDEPENDENT _Pragma("GCC ivdep")
