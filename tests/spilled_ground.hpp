// What tests of the spill and of what is read through it share: small ground, a scene over it, and posts compared bit by bit.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>

#include "lib/scene.hpp"
#include "tests/drawn_raster.hpp"
#include "tiles/sources.hpp"

namespace wedgescope::test {

constexpr std::size_t little = std::size_t{256} << 10, plenty = std::size_t{256} << 20;

inline DataBaseParams only(const std::string& dem) {
    DataBaseParams params;
    params.dem = dem;
    return params;
}

/// Over the middle of the raster, on a flat earth: everything is in reach.
inline Scene above(const DataBaseParams& params) {
    const auto source = open_direct_source(params);
    const DataBase& d = source->data_base();
    Scene s;
    s.platform.xy = PointXY{d.origin_x + 0.5 * static_cast<double>(d.columns - 1) * d.step_x,
                            d.origin_y + 0.5 * static_cast<double>(d.rows - 1) * d.step_y};
    s.platform.altitude_m = 9000;
    s.earth_k.reset();
    return s;
}
inline SpillOptions in(const Folder& folder, std::size_t memory_bytes) {
    SpillOptions options;
    options.temp_folder = folder / ".";
    options.memory_bytes = memory_bytes;
    options.threads = 2;
    return options;
}
inline std::uint32_t bits(float z) { return std::isnan(z) ? 0x7FC00000U : std::bit_cast<std::uint32_t>(z); }
inline std::int64_t differences(std::span<const float> a, std::span<const float> b) {
    if (a.size() != b.size()) return -1;
    std::int64_t n = 0;
    for (std::size_t i = 0; i < a.size(); ++i) n += bits(a[i]) != bits(b[i]);
    return n;
}
/// Hills with every kind of number that the type holds.
inline Drawing hills(int columns, int rows, GDALDataType type) {
    Drawing d;
    d.columns = columns;
    d.rows = rows;
    d.type = type;
    d.value = [](int c, int r) { return std::floor(400 * std::sin(c * 0.05) * std::cos(r * 0.03)) + (c * 7 + r) % 5; };
    return d;
}

}  // namespace wedgescope::test
