#include "lib/coverage.hpp"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <cmath>
#include <numbers>

#include "lib/coverage_work.hpp"
#include "lib/error.hpp"
#include "lib/raised_source.hpp"
#include "lib/threads.hpp"

namespace wedgescope {

CoverageReport covering::Cover::run() {
    const auto start = std::chrono::steady_clock::now();
    CoverageReport report;
    report.threads = params_.threads > 0 ? params_.threads : tbb::this_task_arena::max_concurrency();
    const auto needed = [&] {
        return fixed_bytes(strips_ahead_) + source_.cache_bytes() +
               desk_bytes() * static_cast<std::size_t>(report.threads);
    };
    while (strips_ahead_ > 1 && needed() > params_.memory_bytes) --strips_ahead_;
    while (report.threads > 1 && needed() > params_.memory_bytes) --report.threads;
    report.peak_budget_bytes = needed();
    threads_ = report.threads;
    if (params_.timeline && !params_.beside_others) params_.timeline->memory(held_bytes(threads_));
    if (params_.layer == CoverageLayer::response) {
        tables_ = std::make_unique<SceneTables>(scene_.scene);
        loss_ = loss_table(scene_, tables_->weather, *scene_.scene.range_m);
        radar_constant_ = radar_constant(scene_.scene.radar);
    }
    order_strips();
    Threads threads(threads_, !params_.beside_others);
    threads.execute([&] {
        handover_.pass();
        {
            const std::lock_guard lock(mutex_);
            go_on();
        }
        tbb::parallel_for(
            0, threads_,
            [this](int) {
                const Handover::Task task(handover_);
                work();
            },
            tbb::simple_partitioner());
        handover_.pass();
    });
    if (error_) std::rethrow_exception(error_);
    for (const Desk& d : desks_) {
        for (std::size_t i = 0; i < d.states.size(); ++i) report.states[i] += d.states[i];
        for (std::size_t i = 0; i < d.did.size(); ++i) report.quadrants[i].add(d.did[i]);
    }
    report.skipped = source_.skipped();
    report.source = source_.report();
    report.write_s = write_s_;
    std::uint64_t inside = 0;
    for (std::uint64_t n : report.states) inside += n;
    report.states[static_cast<std::size_t>(State::outside)] +=
        static_cast<std::uint64_t>(db_.columns * db_.rows) - inside;
    report.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
}

Sampling coverage_sampling(Quality quality) {
    // Its bins are the four quadrants, of two units of slope each. So many spokes from the sensor on are 2 a post over 64 lines
    // at draft, 16 at exact: what stands near by throws shadows much wider than the way between two others. Ranges of a hundred
    // posts take some percent longer for it, longer ones nothing.
    const auto sampling = [](double a_post, double a_unit_of_slope, bool cross_lines) {
        return Sampling{.spokes_per_post = a_post,
                        .spokes_per_bin = a_unit_of_slope * (std::numbers::pi / 2),
                        .lead = 1,
                        .cross_lines = cross_lines,
                        .exact_course = false};
    };
    switch (quality) {
        case Quality::draft:
            return sampling(1, 128, false);
        case Quality::normal:
            return sampling(2, 256, false);
        case Quality::fine:
            return sampling(2, 512, true);
        case Quality::exact:
            return sampling(4, 1024, true);
    }
    return {};
}

namespace {

using covering::Cover;

/// DataError where places between the knots of a line would be those of other posts.
void check_knots(const Cover& work, const WedgeSource& source) {
    constexpr double most_off = 1, many = covering::knot;
    const double off = work.map().unevenness(covering::knot);
    if (off <= most_off) return;
    const SpokeMapParams& at = work.map().params();
    throw DataError(text("dem ", in_quotes(source.data_base().name), ": within ",
                         at.range_m ? text("a range of ", *at.range_m, " m") : "its reach", " of latitude ", at.lat_deg,
                         ", longitude ", at.lon_deg,
                         " its posts are too coarse for coverage: geodesics would be off by ",
                         off < many ? text(std::ceil(off * 100) / 100) : text("more than ", many), " posts (at most ",
                         most_off, "); give a smaller range, or resample it to finer posts"));
}

void check(const Cover& work, const WedgeSource& source, const CoverageParams& params) {
    check_knots(work, source);
    const std::size_t cache = source.cache_bytes(), own = work.fixed_bytes(1) + work.desk_bytes();
    if (own + cache <= params.memory_bytes) return;
    // A guess: the source's cache grows with the budget.
    const double share = std::min(0.9, static_cast<double>(cache) / static_cast<double>(params.memory_bytes));
    throw TooLittleMemory(params.memory_bytes, static_cast<std::size_t>(static_cast<double>(own) / (1 - share)),
                          "this coverage");
}

}  // namespace

std::size_t coverage_bytes(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params) {
    SceneSource own(source, scene.scene);
    const Cover work(scene, *own, params, nullptr);
    check_knots(work, *own);
    return work.fixed_bytes(1) + work.own_desk_bytes();
}

void check_coverage(const ResolvedScene& scene, WedgeSource& source, const CoverageParams& params) {
    SceneSource own(source, scene.scene);
    check(Cover(scene, *own, params, nullptr), *own, params);
}

CoverageReport cover(const ResolvedScene& scene, WedgeSource& given, const CoverageParams& params,
                     const std::function<void(const CoverageTile&)>& write) {
    SceneSource own(given, scene.scene);
    WedgeSource& source = *own;
    Cover work(scene, source, params, &write);
    check(work, source, params);
    if (params.beside_others) return work.run();
    const std::uint64_t data = params.data ? *params.data : source.fingerprint({});
    CoverageReport report = work.run();
    check_unchanged(source, data);
    return report;
}

}  // namespace wedgescope
