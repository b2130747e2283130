#include "tiles/packed_block.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "tiles/raster_layer.hpp"

namespace wedgescope {
namespace {

enum class Packing : std::uint8_t { alike = 1, bits8 = 2, bits16 = 3, whole = 4 };

constexpr std::uint8_t void8 = 255;
constexpr std::int16_t void16 = INT16_MIN;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

float height_of(int stored, const PackScale& s) {
    return static_cast<float>((static_cast<double>(stored) * s.scale + s.offset) * s.unit_m);
}

void start(Packing packing, std::vector<std::byte>& out, std::size_t payload) {
    out.resize(1 + payload);
    out[0] = static_cast<std::byte>(packing);
}

template <class Value>
bool all_alike(const Value* values, std::int64_t stride, std::int64_t columns, std::int64_t rows) {
    const auto first = std::bit_cast<std::uint32_t>(values[0]);
    std::uint32_t different = 0;
    for (std::int64_t r = 0; r < rows && !different; ++r)
        for (std::int64_t c = 0; c < columns; ++c)
            different |= std::bit_cast<std::uint32_t>(values[r * stride + c]) ^ first;
    return different == 0;
}

/// The stored numbers of all posts; false if one does not come back bit for bit.
bool narrow16(const float* posts, std::int64_t stride, std::int64_t columns, std::int64_t rows, const PackScale& s,
              std::int16_t* out) {
    std::uint32_t lost = 0;
    for (std::int64_t r = 0; r < rows && !lost; ++r) {
        const float* row = posts + r * stride;
        std::int16_t* to = out + r * columns;
        if (s.plain()) {
            for (std::int64_t c = 0; c < columns; ++c) {
                const float z = row[c];
                const bool none = z != z, fits = z > -32768.0F && z < 32768.0F;
                const auto stored = static_cast<std::int16_t>(static_cast<std::int32_t>(fits ? z : 0.0F));
                const auto back = std::bit_cast<std::uint32_t>(static_cast<float>(stored));
                lost |= none ? 0U : static_cast<std::uint32_t>(!fits) | (back ^ std::bit_cast<std::uint32_t>(z));
                to[c] = none ? void16 : stored;
            }
            continue;
        }
        for (std::int64_t c = 0; c < columns; ++c) {
            const float z = row[c];
            if (z != z) {
                to[c] = void16;
                continue;
            }
            const double stored = std::nearbyint((static_cast<double>(z) / s.unit_m - s.offset) / s.scale);
            if (!(stored > -32768 && stored < 32768)) return false;
            to[c] = static_cast<std::int16_t>(stored);
            if (std::bit_cast<std::uint32_t>(height_of(to[c], s)) != std::bit_cast<std::uint32_t>(z)) return false;
        }
    }
    return lost == 0;
}

/// 16 bits in out[1..] into 8 if they fit; `none` stands for a void.
void tighten(std::vector<std::byte>& out, std::size_t n) {
    std::int32_t least = 0, most = 0;
    const std::byte* from = out.data() + 1;
    for (std::size_t i = 0; i < n; ++i) {
        std::int16_t v;
        std::memcpy(&v, from + 2 * i, 2);
        if (v == void16) continue;
        least = v < least ? v : least;
        most = v > most ? v : most;
    }
    if (least < 0 || most >= void8) return;
    std::vector<std::byte> tight;
    start(Packing::bits8, tight, n);
    for (std::size_t i = 0; i < n; ++i) {
        std::int16_t v;
        std::memcpy(&v, from + 2 * i, 2);
        tight[1 + i] = static_cast<std::byte>(v == void16 ? void8 : static_cast<std::uint8_t>(v));
    }
    out = std::move(tight);
}

template <class Value>
void keep_whole(const Value* values, std::int64_t stride, std::int64_t columns, std::int64_t rows,
                std::vector<std::byte>& out) {
    static_assert(sizeof(Value) == 4);
    start(Packing::whole, out, static_cast<std::size_t>(columns * rows) * 4);
    for (std::int64_t r = 0; r < rows; ++r)
        std::memcpy(out.data() + 1 + static_cast<std::size_t>(r * columns) * 4, values + r * stride,
                    static_cast<std::size_t>(columns) * 4);
}

template <class Value>
void keep_one(Value value, std::vector<std::byte>& out) {
    start(Packing::alike, out, 4);
    std::memcpy(out.data() + 1, &value, 4);
}

/// Calls line(stored of the row's first wanted post, number in the row, row of out) row by row of `part`.
template <class Line>
void each_line(const std::byte* posts, std::size_t size, std::int64_t columns, const Window& part, Line&& line) {
    for (std::int64_t r = part.rows.begin; r < part.rows.end; ++r)
        line(posts + static_cast<std::size_t>(r * columns + part.columns.begin) * size, r - part.rows.begin);
}

/// Shape and length of the bytes; nothing if they do not agree.
bool known(std::span<const std::byte> bytes, std::int64_t columns, std::int64_t rows, Packing& packing) {
    if (bytes.empty()) return false;
    packing = static_cast<Packing>(bytes[0]);
    const auto n = static_cast<std::size_t>(columns * rows);
    switch (packing) {
        case Packing::alike:
            return bytes.size() == 1 + 4;
        case Packing::bits8:
            return bytes.size() == 1 + n;
        case Packing::bits16:
            return bytes.size() == 1 + 2 * n;
        case Packing::whole:
            return bytes.size() == 1 + 4 * n;
    }
    return false;
}

template <class Value>
void copy_whole(const std::byte* posts, std::int64_t columns, const Window& part, Value* out, std::int64_t stride) {
    each_line(posts, 4, columns, part, [&](const std::byte* from, std::int64_t r) {
        std::memcpy(out + r * stride, from, static_cast<std::size_t>(part.columns.size()) * 4);
    });
}

template <class Value>
void fill(const std::byte* one, const Window& part, Value* out, std::int64_t stride) {
    Value value;
    std::memcpy(&value, one, 4);
    for (std::int64_t r = 0; r < part.rows.size(); ++r)
        for (std::int64_t c = 0; c < part.columns.size(); ++c) out[r * stride + c] = value;
}

}  // namespace

void pack_heights(const float* posts, std::int64_t stride, std::int64_t columns, std::int64_t rows,
                  const PackScale& scale, std::vector<std::byte>& out) {
    if (all_alike(posts, stride, columns, rows)) return keep_one(posts[0], out);
    const auto n = static_cast<std::size_t>(columns * rows);
    std::vector<std::int16_t> stored(n);
    // NaN comes back as the one quiet NaN: whatever made a post void is not kept.
    if (!narrow16(posts, stride, columns, rows, scale, stored.data()))
        return keep_whole(posts, stride, columns, rows, out);
    start(Packing::bits16, out, 2 * n);
    std::memcpy(out.data() + 1, stored.data(), 2 * n);
    tighten(out, n);
}

void pack_codes(const std::int32_t* codes, std::int64_t stride, std::int64_t columns, std::int64_t rows,
                std::vector<std::byte>& out) {
    if (all_alike(codes, stride, columns, rows)) return keep_one(codes[0], out);
    const auto n = static_cast<std::size_t>(columns * rows);
    start(Packing::bits16, out, 2 * n);
    bool lost = false;
    for (std::int64_t r = 0; r < rows && !lost; ++r)
        for (std::int64_t c = 0; c < columns; ++c) {
            const std::int32_t code = codes[r * stride + c];
            const auto stored = code == void_code ? void16 : static_cast<std::int16_t>(code);
            lost |= code != void_code && (stored != code || stored == void16);
            std::memcpy(out.data() + 1 + 2 * static_cast<std::size_t>(r * columns + c), &stored, 2);
        }
    if (lost) return keep_whole(codes, stride, columns, rows, out);
    tighten(out, n);
}

bool unpack_heights(std::span<const std::byte> bytes, std::int64_t columns, std::int64_t rows, const PackScale& scale,
                    const Window& part, float* out, std::int64_t stride) {
    Packing packing{};
    if (!known(bytes, columns, rows, packing)) return false;
    const std::byte* posts = bytes.data() + 1;
    const std::int64_t n = part.columns.size();
    switch (packing) {
        case Packing::alike:
            fill(posts, part, out, stride);
            break;
        case Packing::whole:
            copy_whole(posts, columns, part, out, stride);
            break;
        case Packing::bits8: {
            float heights[256];
            for (int i = 0; i < void8; ++i) heights[i] = scale.plain() ? static_cast<float>(i) : height_of(i, scale);
            heights[void8] = nan;
            each_line(posts, 1, columns, part, [&](const std::byte* from, std::int64_t r) {
                for (std::int64_t c = 0; c < n; ++c)
                    out[r * stride + c] = heights[std::to_integer<std::uint8_t>(from[c])];
            });
            break;
        }
        case Packing::bits16:
            each_line(posts, 2, columns, part, [&](const std::byte* from, std::int64_t r) {
                float* to = out + r * stride;
                const auto stored = [&](std::int64_t c) {
                    std::int16_t v;
                    std::memcpy(&v, from + 2 * c, 2);
                    return v;
                };
                if (scale.plain())
                    for (std::int64_t c = 0; c < n; ++c) {
                        const std::int16_t v = stored(c);
                        const auto z = static_cast<float>(v);
                        to[c] = v == void16 ? nan : z;
                    }
                else
                    for (std::int64_t c = 0; c < n; ++c) {
                        const std::int16_t v = stored(c);
                        const float z = height_of(v, scale);
                        to[c] = v == void16 ? nan : z;
                    }
            });
            break;
    }
    return true;
}

bool unpack_codes(std::span<const std::byte> bytes, std::int64_t columns, std::int64_t rows, const Window& part,
                  std::int32_t* out, std::int64_t stride) {
    Packing packing{};
    if (!known(bytes, columns, rows, packing)) return false;
    const std::byte* codes = bytes.data() + 1;
    const std::int64_t n = part.columns.size();
    switch (packing) {
        case Packing::alike:
            fill(codes, part, out, stride);
            break;
        case Packing::whole:
            copy_whole(codes, columns, part, out, stride);
            break;
        case Packing::bits8:
            each_line(codes, 1, columns, part, [&](const std::byte* from, std::int64_t r) {
                for (std::int64_t c = 0; c < n; ++c) {
                    const auto v = std::to_integer<std::uint8_t>(from[c]);
                    out[r * stride + c] = v == void8 ? void_code : v;
                }
            });
            break;
        case Packing::bits16:
            each_line(codes, 2, columns, part, [&](const std::byte* from, std::int64_t r) {
                for (std::int64_t c = 0; c < n; ++c) {
                    std::int16_t v;
                    std::memcpy(&v, from + 2 * c, 2);
                    out[r * stride + c] = v == void16 ? void_code : v;
                }
            });
            break;
    }
    return true;
}

}  // namespace wedgescope
