#include "tools/limits.hpp"

#include <fmt/format.h>
#include <zstd.h>

#include <algorithm>
#include <numeric>
#include <span>

#include "lib/random.hpp"
#include "tiles/scratch_file.hpp"
#include "tools/report_json.hpp"

namespace wedgescope {
namespace {

constexpr int tries = 4;

/// Bytes a second of the fastest try.
template <class Work>
double best_rate(double bytes, const Work& work) {
    double least = 1e30;
    for (int i = 0; i < tries; ++i) {
        const double start = now_s();
        work();
        least = std::min(least, now_s() - start);
    }
    return bytes / std::max(least, 1e-9);
}

/// Keeps a result from being optimised away.
void use(std::uint64_t value) {
    [[maybe_unused]] static volatile std::uint64_t used;
    used = value;
}

/// Eight sums side by side, so that no addition waits for the one before it.
std::uint64_t added(const std::vector<std::uint64_t>& numbers) {
    std::uint64_t sums[8] = {};
    for (std::size_t i = 0; i + 8 <= numbers.size(); i += 8)
        for (std::size_t k = 0; k < 8; ++k) sums[k] += numbers[i + k];
    return std::accumulate(std::begin(sums), std::end(sums), std::uint64_t{0});
}

/// Of one tile of rolling ground with a little noise, as ZSTD packs the differences of its rows.
double decode_rate() {
    constexpr std::size_t edge = 256;
    std::vector<std::int16_t> posts(edge * edge), out(edge * edge);
    for (std::size_t r = 0; r < edge; ++r)
        for (std::size_t c = 0; c < edge; ++c) {
            const double x = static_cast<double>(c) / 40, y = static_cast<double>(r) / 55;
            const double noise = 3 * uniform(philox({1, 2}, {static_cast<std::uint32_t>(r * edge + c), 0, 0, 0})[0]);
            posts[r * edge + c] = static_cast<std::int16_t>(400 + 150 * (x - x * x / 7) * (y - y * y / 5) + noise);
        }
    for (std::size_t r = 0; r < edge; ++r)
        for (std::size_t c = edge - 1; c > 0; --c)
            posts[r * edge + c] = static_cast<std::int16_t>(posts[r * edge + c] - posts[r * edge + c - 1]);
    const std::size_t bytes = posts.size() * sizeof(std::int16_t);
    std::vector<char> packed(ZSTD_compressBound(bytes));
    packed.resize(ZSTD_compress(packed.data(), packed.size(), posts.data(), bytes, 9));
    constexpr int tiles = 20;
    return best_rate(static_cast<double>(bytes) * tiles, [&] {
        for (int i = 0; i < tiles; ++i) {
            ZSTD_decompress(out.data(), bytes, packed.data(), packed.size());
            for (std::size_t r = 0; r < edge; ++r) {
                int sum = 0;
                for (std::size_t c = 0; c < edge; ++c) {
                    sum += out[r * edge + c];
                    out[r * edge + c] = static_cast<std::int16_t>(sum);
                }
            }
            use(static_cast<std::uint64_t>(out.back()));
        }
    });
}

double rate_of(const Limits& limits, StageWork::Bound bound) {
    switch (bound) {
        case StageWork::memory:
            return limits.memory;
        case StageWork::file:
            return limits.file;
        case StageWork::decode:
            return limits.decode;
        case StageWork::write:
            return limits.write;
    }
    return 0;
}
constexpr const char* bound_names[] = {"memory", "file", "decode", "write"};

std::string rate(double bytes_s) { return fmt::format("{:.2f} GB/s", bytes_s * 1e-9); }

}  // namespace

Limits measure_limits(const std::string& folder, std::size_t buffer_bytes, const char* given_as) {
    Limits limits;
    std::vector<std::uint64_t> buffer(buffer_bytes / sizeof(std::uint64_t), 1);
    const std::size_t bytes = buffer.size() * sizeof(std::uint64_t);
    const auto amount = static_cast<double>(bytes);
    limits.memory = best_rate(amount, [&] { use(added(buffer)); });
    const std::span<std::byte> raw = std::as_writable_bytes(std::span(buffer));
    {
        ScratchFile file(folder, "the file for measuring this machine", given_as);
        limits.write = best_rate(amount, [&] { file.write(raw, 0); });
        // Into a part that stays in the cache, as a reader's buffer does.
        const std::size_t step = std::min<std::size_t>(bytes, 1 << 18);
        limits.file = best_rate(amount, [&] {
            for (std::size_t at = 0; at < bytes; at += step) file.read(raw.first(std::min(step, bytes - at)), at);
        });
    }
    limits.decode = decode_rate();
    return limits;
}

std::string limits_line(const Limits& limits) {
    return fmt::format("limits of this machine, one thread: memory {}, file {}, decode {}, write {}\n",
                       rate(limits.memory), rate(limits.file), rate(limits.decode), rate(limits.write));
}

std::string limits_table(const std::vector<StageWork>& stages, const Limits& limits) {
    std::string out =
        fmt::format("{:>10} {:>8} {:>10} {:>11} {:>20} {:>9}\n", "stage", "s", "MiB", "reached", "limit", "of it");
    for (const StageWork& stage : stages) {
        if (!(stage.seconds > 0) || !(stage.bytes > 0)) continue;
        const double most = rate_of(limits, stage.bound), reached = stage.bytes / stage.seconds;
        out += fmt::format("{:>10} {:>8.3f} {:>10.2f} {:>11} {:>20} {:>7.1f} %\n", stage.name, stage.seconds,
                           stage.bytes / 1048576, rate(reached),
                           fmt::format("{} {}", bound_names[stage.bound], rate(most)), 100 * reached / most);
    }
    return out + limits_line(limits);
}

}  // namespace wedgescope
