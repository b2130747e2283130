#include "tools/report_json.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fstream>
#include <numeric>

#include "lib/target.hpp"
#include "tools/scene_json.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {
namespace {

double cpu_s(const WedgeReport& wedge) {
    double sum = 0;
    for (const CpuStage& stage : cpu_stages) sum += wedge.*stage.seconds;
    return sum;
}

/// All wedges that a run did itself as one; its peak is the largest one's.
template <class Iterator>
WedgeReport sum(Iterator begin, Iterator end) {
    WedgeReport total;
    for (Iterator w = begin; w != end; ++w) {
        if (w->reused) continue;
        const std::size_t peak_bytes = std::max(total.peak_bytes, w->peak_bytes);
        for (const auto& seconds : wedge_seconds) total.*seconds.member += (*w).*seconds.member;
        for (const auto& count : wedge_counts) total.*count.member += (*w).*count.member;
        for (std::size_t cause = 0; cause < skip_count; ++cause) total.posts_skipped[cause] += w->posts_skipped[cause];
        total.peak_bytes = peak_bytes;
    }
    return total;
}

double seconds(const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

/// VmHWM of this process; getrusage's figure also counts what a parent held before exec.
std::uint64_t peak_rss_bytes() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
        if (!line.starts_with("VmHWM:")) continue;
        const auto digit = line.find_first_of("0123456789");
        if (digit == std::string::npos) break;
        std::uint64_t kib = 0;
        std::from_chars(line.data() + digit, line.data() + line.size(), kib);
        return kib * 1024;
    }
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

/// A blank and the number, as wide as a column; without decimals where they do not fit.
std::string cell(double value, std::size_t width, int decimals) {
    const std::string exact = fmt::format("{:.{}f}", value, decimals);
    return fmt::format(" {:>{}}", exact.size() <= width ? exact : fmt::format("{:.0f}", value), width);
}

}  // namespace

std::size_t reused_count(const RunReport& report) {
    return static_cast<std::size_t>(
        std::count_if(report.wedges.begin(), report.wedges.end(), [](const WedgeReport& w) { return w.reused; }));
}

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

Usage usage_since(double start_s) {
    rusage used{};
    getrusage(RUSAGE_SELF, &used);
    Usage usage;
    usage.wall_s = now_s() - start_s;
    usage.user_s = seconds(used.ru_utime);
    usage.system_s = seconds(used.ru_stime);
    usage.peak_rss_bytes = peak_rss_bytes();
    usage.major_faults = static_cast<std::uint64_t>(used.ru_majflt);
    std::ifstream io("/proc/self/io");
    for (std::string name; io >> name;) {
        std::uint64_t value = 0;
        if (!(io >> value)) break;
        if (name == "rchar:") usage.read_bytes = value;
        if (name == "wchar:") usage.written_bytes = value;
        if (name == "read_bytes:") usage.disk_read_bytes = value;
        if (name == "write_bytes:") usage.disk_written_bytes = value;
    }
    return usage;
}

std::string crs_name(const std::string& wkt) {
    const auto open = wkt.find('"');
    if (open == std::string::npos) return "";
    const auto close = wkt.find('"', open + 1);
    return close == std::string::npos ? "" : wkt.substr(open + 1, close - open - 1);
}

nlohmann::ordered_json inputs_json(const std::vector<InputFile>& inputs) {
    auto out = nlohmann::ordered_json::array();
    for (const InputFile& input : inputs) {
        nlohmann::ordered_json entry{{"key", input.key}, {"path", input.path}, {"bytes", nullptr}, {"crs", nullptr}};
        if (input.bytes) entry["bytes"] = *input.bytes;
        if (!input.crs.empty()) entry["crs"] = input.crs;
        out.push_back(entry);
    }
    return out;
}

void add_skipped(nlohmann::ordered_json& report, const Skipped& skipped) {
    const auto count = [&](std::size_t cause) {
        return nlohmann::ordered_json{
            {"posts", skipped[cause].posts}, {"tiles", skipped[cause].tiles}, {"bytes", skipped[cause].bytes}};
    };
    report["read"] = count(static_cast<std::size_t>(Skip::none));
    report["skipped"] = nlohmann::ordered_json::object();
    for (std::size_t cause = 1; cause < skip_count; ++cause) report["skipped"][skip_names[cause]] = count(cause);
}

nlohmann::ordered_json source_json(const SourceReport& source) {
    nlohmann::ordered_json out{{"kind", source.kind},
                               {"partition_s", source.partition_s},
                               {"partition_bytes", source.partition_bytes},
                               {"held_bytes", source.held_bytes},
                               {"spilled_bytes", source.spilled_bytes},
                               {"spill_read_bytes", source.spill_read_bytes},
                               {"kept", nullptr}};
    if (!source.kept.empty()) out["kept"] = source.kept;
    return out;
}

void add_usage(nlohmann::ordered_json& report, const Usage& usage) {
    using json = nlohmann::ordered_json;
    report["wall_s"] = usage.wall_s;
    report["user_s"] = usage.user_s;
    report["system_s"] = usage.system_s;
    const auto known = [](const std::optional<std::uint64_t>& v) { return v ? json(*v) : json(nullptr); };
    report["io"] = json{{"read_bytes", known(usage.read_bytes)},
                        {"written_bytes", known(usage.written_bytes)},
                        {"disk_read_bytes", known(usage.disk_read_bytes)},
                        {"disk_written_bytes", known(usage.disk_written_bytes)},
                        {"major_faults", usage.major_faults}};
    report["peak_rss_bytes"] = usage.peak_rss_bytes;
}

std::string source_line(const SourceReport& source) {
    const auto bytes = [](std::uint64_t n) { return readable_bytes(static_cast<double>(n)); };
    if (!source.kept.empty())
        return fmt::format("\nkept spill '{}': {} read back", source.kept, bytes(source.spill_read_bytes));
    if (source.kind != "spilled") return "";
    return fmt::format("\nspilled source: {} read in {:.2f} s, {} held in memory, {} written, {} read back",
                       bytes(source.partition_bytes), source.partition_s, bytes(source.held_bytes),
                       bytes(source.spilled_bytes), bytes(source.spill_read_bytes));
}

std::string usage_lines(const Usage& usage, int threads, std::size_t budget_bytes, std::uint64_t bytes_spilled) {
    std::string out = fmt::format(
        "wall {:.2f} s, user {:.2f} s, system {:.2f} s, {} threads; peak {} resident, {} of the memory budget held\n",
        usage.wall_s, usage.user_s, usage.system_s, threads, readable_bytes(static_cast<double>(usage.peak_rss_bytes)),
        readable_bytes(static_cast<double>(budget_bytes)));
    const auto io = [](const std::optional<std::uint64_t>& v) {
        return v ? readable_bytes(static_cast<double>(*v)) : std::string("?");
    };
    out += fmt::format("read {} ({} from disk), written {} ({} to disk), spilled and read again {}\n",
                       io(usage.read_bytes), io(usage.disk_read_bytes), io(usage.written_bytes),
                       io(usage.disk_written_bytes), readable_bytes(static_cast<double>(bytes_spilled)));
    return out;
}

nlohmann::ordered_json states_json(const std::array<std::uint64_t, state_count>& counts) {
    auto states = nlohmann::ordered_json::object();
    for (std::size_t code = 0; code < counts.size(); ++code) states[state_names[code]] = counts[code];
    return states;
}

nlohmann::ordered_json sampling_json(const Sampling& sampling) {
    return {{"spokes_per_post", sampling.spokes_per_post},
            {"spokes_per_bin", sampling.spokes_per_bin},
            {"spoke_lead", sampling.lead}};
}

nlohmann::ordered_json levels_json(const LevelPosts& posts) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (std::size_t level = 0; level < posts.size(); ++level)
        if (posts[level] > 0)
            out.push_back({{"level", level}, {"posts_read", posts[level]}, {"stand_for", posts[level] << (2 * level)}});
    return out;
}

nlohmann::ordered_json promise_json(const Promise& promise) {
    return {{"rms_db", promise.error.rms_db},
            {"p99_db", promise.error.p99_db},
            {"from_range_m", promise.from_m},
            {"lacks", promise.lacks}};
}

nlohmann::ordered_json report_json(const Settings& settings, const RunResult& run, const std::vector<InputFile>& inputs,
                                   const OuterStages& outer, const Usage& usage) {
    using json = nlohmann::ordered_json;
    const RunReport& report = run.report;
    json out;
    out["format"] = "wedgescope-report-1";
    out["version"] = version();
    json scene = parameters_json(with_resolved(settings, run.scene), true);
    scene["threads"] = std::to_string(report.threads);
    scene["resolved"] = resolved_json(run.scene);
    out["scene"] = scene;
    out["inputs"] = inputs_json(inputs);
    const auto facts = [](const WedgeReport& wedge) {
        json entry;
        json cpu;
        for (const CpuStage& stage : cpu_stages) cpu[stage.name] = wedge.*stage.seconds;
        entry["cpu_s"] = cpu;
        entry["cpu_total_s"] = cpu_s(wedge);
        entry["wall_s"] = wedge.wall_s;
        entry["memory_wait_s"] = wedge.memory_wait_s;
        entry["disk_wait_s"] = wedge.disk_wait_s;
        entry["chunks"] = wedge.chunks;
        entry["posts_read"] = wedge.posts_read;
        entry["posts_skipped"] = json::object();
        for (std::size_t cause = 1; cause < skip_count; ++cause)
            entry["posts_skipped"][skip_names[cause]] = wedge.posts_skipped[cause];
        entry["bytes_read"] = wedge.bytes_read;
        entry["bytes_spilled"] = wedge.bytes_spilled;
        entry["bytes_skipped"] = wedge.bytes_skipped;
        entry["samples"] = wedge.samples;
        entry["visible_pieces"] = wedge.visible_pieces;
        entry["refined_azimuth_bins"] = wedge.refined_bins;
        entry["doubtful_azimuth_bins"] = wedge.doubtful_bins;
        entry["bytes_read_again"] = wedge.bytes_again;
        entry["peak_bytes"] = wedge.peak_bytes;
        return entry;
    };
    out["wedges"] = json::array();
    for (const WedgeReport& wedge : report.wedges) {
        json entry{{"wedge", wedge.index},
                   {"azimuth_bin_begin", wedge.azimuth_bins.begin},
                   {"azimuth_bin_end", wedge.azimuth_bins.end}};
        entry["reused"] = wedge.reused;
        entry.update(facts(wedge));
        out["wedges"].push_back(entry);
    }
    const WedgeReport all = sum(report.wedges.begin(), report.wedges.end());
    out["total"] = facts(all);
    out["total"].erase("wall_s");  // the wedges' overlap in time
    add_skipped(out, report.skipped);
    out["source"] = source_json(report.source);
    out["states"] = states_json(report.states);
    const RunReport::Planned& plan = report.planned;
    out["plan"] = json{
        {"wedges", {{"planned", plan.wedges}, {"actual", report.wedges.size() - reused_count(report)}}},
        {"chunks", {{"planned", plan.chunks}, {"actual", all.chunks}}},
        {"posts", {{"planned", plan.posts}, {"actual", all.posts_read}}},
        {"bytes_read", {{"planned", plan.bytes}, {"actual", all.bytes_read}}},
        {"partition_bytes",
         {{"planned", report.source.planned_partition_bytes}, {"actual", report.source.partition_bytes}}},
        {"bytes_spilled", {{"planned", report.source.planned_spilled_bytes}, {"actual", report.source.spilled_bytes}}},
        // The pass is over before the wedges begin.
        {"peak_bytes",
         {{"planned", std::max(report.source.planned_pass_peak_bytes, plan.peak_bytes)},
          {"actual", std::max(report.source.pass_peak_bytes, report.peak_held_bytes)}}}};
    out["reused"] = reused_count(report);
    LevelPosts posts{};
    for (const WedgeReport& wedge : report.wedges) add_levels(posts, wedge.level_posts);
    out["levels"] = levels_json(posts);
    out["sampling"] = sampling_json(run.sampling);
    out["promise"] = promise_json(run.promise);
    out["stages_wall_s"] =
        json{{"open", outer.open_s},        {"survey", report.survey_s}, {"merge", report.merge_s},
             {"keep", report.keep_s},       {"beam", report.beam_s},     {"receiver", report.receiver_s},
             {"display", report.display_s}, {"write", outer.write_s}};
    add_usage(out, usage);
    out["peak_budget_bytes"] = report.peak_budget_bytes;
    out["threads"] = report.threads;
    out["instruction_set"] = name_of(target_in_use());
    return out;
}

std::string report_table(const RunReport& report, const OuterStages& outer, const Usage& usage, std::size_t most_rows) {
    const double mebibyte = 1048576;
    std::string out = fmt::format(
        "{:>6} {:>12} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7}\n", "",
        "azimuth", "load", "sample", "sweep", "shade", "deposit", "merge", "wall", "disk", "memory", "million",
        "million", "MiB", "MiB", "MiB", "peak");
    out += fmt::format(
        "{:>6} {:>12} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7}\n",
        "wedge", "bins", "s", "s", "s", "s", "s", "s", "s", "wait s", "wait s", "posts", "samples", "read", "spilled",
        "skipped", "MiB");
    const auto row = [&](const std::string& name, const std::string& bins, const WedgeReport& w) {
        out += fmt::format("{:>6} {:>12}", name, bins);
        for (const CpuStage& stage : cpu_stages) out += cell(w.*stage.seconds, 7, 3);
        out += cell(w.wall_s, 8, 3) + cell(w.disk_wait_s, 7, 3) + cell(w.memory_wait_s, 7, 3);
        out += cell(static_cast<double>(w.posts_read) * 1e-6, 7, 3) + cell(static_cast<double>(w.samples) * 1e-6, 7, 3);
        for (const std::uint64_t bytes : {w.bytes_read, w.bytes_spilled, w.bytes_skipped, std::uint64_t{w.peak_bytes}})
            out += cell(static_cast<double>(bytes) / mebibyte, 7, 2);
        out += '\n';
    };
    std::vector<WedgeReport> wedges;
    for (const WedgeReport& w : report.wedges)
        if (!w.reused) wedges.push_back(w);
    std::size_t shown = wedges.size();
    if (wedges.size() > most_rows) {
        shown = most_rows - 1;
        std::stable_sort(wedges.begin(), wedges.end(),
                         [](const WedgeReport& a, const WedgeReport& b) { return cpu_s(a) > cpu_s(b); });
    }
    for (std::size_t i = 0; i < shown; ++i) {
        row(std::to_string(wedges[i].index),
            fmt::format("{}..{}", wedges[i].azimuth_bins.begin, wedges[i].azimuth_bins.end - 1), wedges[i]);
    }
    if (shown < wedges.size()) {
        row("rest", fmt::format("{} wedges", wedges.size() - shown),
            sum(wedges.begin() + static_cast<std::ptrdiff_t>(shown), wedges.end()));
    }
    const WedgeReport total = sum(wedges.begin(), wedges.end());
    row("all", "", total);
    if (wedges.size() < report.wedges.size()) {
        out += fmt::format("reused {} of {} wedges, done by an earlier run\n", report.wedges.size() - wedges.size(),
                           report.wedges.size());
    }

    // Shares: CPU seconds of the wedges' stages, wall seconds of what comes before and after them.
    std::vector<std::pair<std::string, double>> parts;
    for (const CpuStage& stage : cpu_stages) parts.emplace_back(stage.name, total.*stage.seconds);
    for (const auto& [name, s] : {std::pair<const char*, double>{"open", outer.open_s},
                                  {"survey", report.survey_s},
                                  {"keep", report.keep_s},
                                  {"beam", report.beam_s},
                                  {"receiver", report.receiver_s},
                                  {"display", report.display_s},
                                  {"write", outer.write_s}}) {
        parts.emplace_back(name, s);
    }
    double all = 0;
    for (const auto& part : parts) all += part.second;
    out += "share ";
    for (const auto& [name, s] : parts)
        if (200 * s >= all && all > 0) out += fmt::format(" {} {:.0f} %", name, 100 * s / all);
    std::uint64_t cells = 0;
    for (const auto count : report.states) cells += count;
    out += "\nstates";
    for (std::size_t code = 0; code < report.states.size(); ++code) {
        out += fmt::format(" {} {:.1f} %", state_names[code],
                           cells ? 100.0 * static_cast<double>(report.states[code]) / static_cast<double>(cells) : 0.0);
    }
    out += source_line(report.source) + "\n";
    out += usage_lines(usage, report.threads, report.peak_budget_bytes, total.bytes_spilled);
    return out;
}

StageWork load_work(double load_s, std::uint64_t decoded_bytes, const Usage& usage) {
    const auto decoded = static_cast<double>(decoded_bytes);
    const bool packed = usage.read_bytes && static_cast<double>(*usage.read_bytes) < 0.9 * decoded;
    return {"load", load_s, decoded, packed ? StageWork::decode : StageWork::file};
}

std::uint64_t bytes_of_outputs(const Usage& usage, std::uint64_t scratch) {
    const std::uint64_t all = usage.written_bytes.value_or(0);
    return all - std::min(all, scratch);
}

std::vector<StageWork> stage_work(const RunReport& report, double write_s, const Usage& usage) {
    const WedgeReport all = sum(report.wedges.begin(), report.wedges.end());
    const auto cells =
        static_cast<double>(std::accumulate(report.states.begin(), report.states.end(), std::uint64_t{0}));
    const double posts = static_cast<double>(all.posts_read), pieces = static_cast<double>(all.visible_pieces);
    constexpr double post = sizeof(float), sum_cell = sizeof(std::int64_t), image_cell = sizeof(float);
    return {load_work(all.load_s, all.bytes_read, usage),
            {"sweep", all.sample_s + all.sweep_s, posts * post, StageWork::memory},
            {"deposit", all.shade_s + all.deposit_s, pieces * 2 * sum_cell, StageWork::memory},
            {"merge", all.merge_s, cells * (sum_cell + image_cell), StageWork::memory},
            {"beam", report.beam_s, cells * 2 * image_cell, StageWork::memory},
            {"receiver", report.receiver_s, cells * 2 * image_cell, StageWork::memory},
            {"display", report.display_s, cells * (image_cell + sizeof(std::uint8_t)), StageWork::memory},
            {"write", write_s, static_cast<double>(bytes_of_outputs(usage, report.source.spilled_bytes)),
             StageWork::write}};
}

}  // namespace wedgescope
