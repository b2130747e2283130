#include "tiles/shared_source.hpp"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <mutex>

#include "lib/spoke_grid.hpp"
#include "lib/transpose.hpp"
#include "tiles/needed_posts.hpp"

namespace wedgescope {

SharedSource::SharedSource(std::unique_ptr<WedgeSource> source, std::size_t memory_bytes)
    : source_(std::move(source)), data_base_(source_->data_base()) {
    const auto mutex = std::make_shared<std::mutex>();
    if (data_base_.locate)
        data_base_.locate = [mutex, locate = data_base_.locate](double lat_deg, double lon_deg) {
            const std::lock_guard lock(*mutex);
            return locate(lat_deg, lon_deg);
        };
    if (data_base_.lat_lon)
        data_base_.lat_lon = [mutex, lat_lon = data_base_.lat_lon](double column, double row) {
            const std::lock_guard lock(*mutex);
            return lat_lon(column, row);
        };
    const double posts = static_cast<double>(data_base_.columns) * static_cast<double>(data_base_.rows),
                 cells = data_base_.has_culture ? static_cast<double>(data_base_.culture_columns) *
                                                      static_cast<double>(data_base_.culture_rows)
                                                : 0,
                 bytes = posts * (data_base_.has_culture_height ? 8 : 4) + cells;
    if (bytes <= static_cast<double>(memory_bytes) / 4) kept_bytes_ = static_cast<std::size_t>(bytes);
}

void SharedSource::read(const Stop* stop) {
    if (!keeps() || read_) return;
    try {
        read_all(stop);
    } catch (const DataError&) {
        // A post that no scene may ask for is no reason to refuse them all.
        kept_bytes_ = 0;
        surface_m_ = culture_m_ = {};
        classes_ = {};
    }
}

void SharedSource::read_all(const Stop* stop) {
    const std::int64_t columns = data_base_.columns, rows = data_base_.rows;
    surface_m_.resize(static_cast<std::size_t>(columns * rows));
    if (data_base_.has_culture_height) culture_m_.resize(surface_m_.size());
    constexpr std::int64_t most_posts = std::int64_t{1} << 19;
    const auto pieces = [&](std::int64_t width, std::int64_t high, std::int64_t block, auto&& body) {
        std::int64_t step = std::max<std::int64_t>(1, most_posts / width);
        if (step >= block) step = step / block * block;
        oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::int64_t>(0, (high + step - 1) / step, 1),
                                  [&](const auto& part) {
                                      for (std::int64_t i = part.begin(); i < part.end(); ++i) {
                                          if (stop) stop->check();
                                          body(Interval{i * step, std::min((i + 1) * step, high)});
                                      }
                                  });
    };
    pieces(columns, rows, data_base_.block_rows, [&](Interval part) {
        const Chunk chunk = source_->load({{0, columns}, part}, false);
        const auto at = static_cast<std::ptrdiff_t>(part.begin * columns);
        std::copy(chunk.surface_m.begin(), chunk.surface_m.end(), surface_m_.begin() + at);
        std::copy(chunk.culture_height_m.begin(), chunk.culture_height_m.end(), culture_m_.begin() + at);
    });
    if (data_base_.has_culture) {
        const std::int64_t wide = data_base_.culture_columns;
        classes_.resize(static_cast<std::size_t>(wide * data_base_.culture_rows));
        std::atomic<bool> known = true;
        pieces(wide, data_base_.culture_rows, data_base_.culture_tile_rows, [&](Interval part) {
            const CultureCells cells = source_->load_classes({{0, wide}, part});
            std::copy(cells.classes.begin(), cells.classes.end(),
                      classes_.begin() + static_cast<std::ptrdiff_t>(part.begin * wide));
            if (!cells.codes.empty()) known = false;
        });
        // A code without a class is asked for by whoever sees it.
        keeps_classes_ = known && !data_base_.cyclic;
    }
    read_ = true;
}

void SharedSource::copy_row(const std::vector<float>& layer, Interval columns, std::int64_t row, float* to) const {
    const float* const from = layer.data() + row * data_base_.columns;
    const std::int64_t cycle = data_base_.cyclic ? data_base_.cycle_columns : data_base_.columns;
    while (!columns.empty()) {
        const std::int64_t first = data_base_.real_column(columns.begin);
        const std::int64_t n = std::min(columns.size(), cycle - first);
        to = std::copy_n(from + first, n, to);
        columns.begin += n;
    }
}

RawVector<float> SharedSource::posts(const std::vector<float>& layer, const Window& window, bool lines_are_columns,
                                     int level) const {
    RawVector<float> out(static_cast<std::size_t>(window.posts()));
    const std::int64_t width = window.columns.size(), high = window.rows.size(), post = std::int64_t{1} << level;
    const auto straight = [&](Interval part, float* to) {
        for (std::int64_t r = part.begin; r < part.end; ++r, to += width) {
            if (level == 0) {
                copy_row(layer, window.columns, r, to);
                continue;
            }
            const float* const from = layer.data() + r * post * data_base_.columns + window.columns.begin * post;
            for (std::int64_t c = 0; c < width; ++c) to[c] = from[c * post];
        }
    };
    if (!lines_are_columns) {
        straight(window.rows, out.data());
        return out;
    }
    constexpr std::int64_t edge = 16;
    std::vector<float> strip(static_cast<std::size_t>(width * edge));
    for (std::int64_t r = 0; r < high; r += edge) {
        const std::int64_t n = std::min(edge, high - r);
        straight({window.rows.begin + r, window.rows.begin + r + n}, strip.data());
        const auto wide = static_cast<std::size_t>(width);
        transpose_floats(strip.data(), wide, static_cast<std::size_t>(n), wide, out.data() + r,
                         static_cast<std::size_t>(high));
    }
    return out;
}

Chunk SharedSource::load(const ChunkRequest& request) {
    if (!read_) return source_->load(request);
    Chunk chunk = begun_chunk(data_base_, request);
    if (const auto height = request.flat_m()) {
        chunk.flat = true;
        chunk.surface_m.assign(static_cast<std::size_t>(chunk.minor_count()), *height);
        return chunk;
    }
    chunk.surface_m = posts(surface_m_, chunk.window, request.lines_are_columns, request.level);
    if (request.level == 0 && !culture_m_.empty()) {
        chunk.culture_height_m = posts(culture_m_, chunk.window, request.lines_are_columns);
        if (std::all_of(chunk.culture_height_m.begin(), chunk.culture_height_m.end(), [](float h) { return h == 0; }))
            chunk.culture_height_m.clear();
    }
    chunk.posts_read = static_cast<std::uint64_t>(chunk.window.posts());
    return chunk;
}

LoadCost SharedSource::cost(const ChunkRequest& request) const {
    if (!keeps()) return source_->cost(request);
    LoadCost cost = WedgeSource::cost(request);
    cost.bytes = 0;
    cost.beside_bytes =
        request.lines_are_columns ? static_cast<std::size_t>(request.window.columns.size()) * 16 * sizeof(float) : 0;
    return cost;
}

std::uint64_t SharedSource::class_bytes(const Window& cells) const { return keeps() ? 0 : source_->class_bytes(cells); }

CultureCells SharedSource::load_classes(const Window& window) {
    if (!keeps_classes_) return source_->load_classes(window);
    CultureCells cells;
    cells.window = window;
    cells.classes.assign(static_cast<std::size_t>(window.posts()), data_base_.default_class);
    const std::int64_t wide = data_base_.culture_columns;
    const Interval columns = intersection(window.columns, {0, wide}),
                   rows = intersection(window.rows, {0, data_base_.culture_rows});
    for (std::int64_t r = rows.begin; r < rows.end && !columns.empty(); ++r)
        std::copy_n(classes_.begin() + static_cast<std::ptrdiff_t>(r * wide + columns.begin), columns.size(),
                    cells.classes.begin() + static_cast<std::ptrdiff_t>(window.at(columns.begin, r)));
    return cells;
}

}  // namespace wedgescope
