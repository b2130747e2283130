#include "tools/track_report.hpp"

#include <fmt/format.h>

#include <tuple>
#include <utility>

#include "lib/target.hpp"
#include "tools/layers.hpp"
#include "tools/run_files.hpp"
#include "tools/scene_json.hpp"
#include "tools/terminal.hpp"

namespace wedgescope {

using json = nlohmann::ordered_json;

namespace {

constexpr std::array<const char*, frame_stages> stage_names = {"resolve",  "survey",  "wedges", "beam",
                                                               "receiver", "display", "write"};

json frame_json(const TrackFrames& frames, std::size_t frame, const FrameReport& r, double start_s) {
    const TrackPoint& point = frames.track()[frame];
    const Settings own = frames.settings(frame);
    json out{{"frame", frame + 1}, {"line", point.line}, {"time_s", point.time_s}};
    if (r.has_lat_lon) {
        out["lat_deg"] = r.lat_deg;
        out["lon_deg"] = r.lon_deg;
    }
    out["x"] = r.x;
    out["y"] = r.y;
    out["sensor_height_m"] = r.sensor_m;
    out["heading_deg"] = point.heading.deg();
    out["range_m"] = r.range_m;
    out["files"] = json::array();
    for (const auto& [key, path] : layer_paths(own))
        if (!path.empty()) out["files"].push_back(path);
    out["start_s"] = r.start_s - start_s;
    out["wall_s"] = r.end_s - r.start_s;
    json wall, cpu;
    for (std::size_t i = 0; i < frame_stages; ++i) wall[stage_names[i]] = r.wall_s[i];
    for (std::size_t i = 0; i < std::size(cpu_stages); ++i) cpu[cpu_stages[i].name] = r.cpu_s[i];
    out["stages_wall_s"] = wall;
    out["cpu_s"] = cpu;
    out["states"] = states_json(r.states);
    out["sampling"] = sampling_json(r.sampling);
    out["samples"] = r.samples;
    out["visible_pieces"] = r.pieces;
    out["refined_azimuth_bins"] = r.refined_bins;
    out["posts"] = r.posts;
    out["levels"] = levels_json(r.level_posts);
    out["bytes_read"] = r.bytes;
    return out;
}

/// Seconds of all frames, by stage: wall and CPU.
std::pair<json, json> sums(const std::vector<FrameReport>& reports) {
    json wall, cpu;
    for (std::size_t i = 0; i < frame_stages; ++i) {
        double sum = 0;
        for (const FrameReport& r : reports) sum += static_cast<double>(r.wall_s[i]);
        wall[stage_names[i]] = sum;
    }
    for (std::size_t i = 0; i < std::size(cpu_stages); ++i) {
        double sum = 0;
        for (const FrameReport& r : reports) sum += static_cast<double>(r.cpu_s[i]);
        cpu[cpu_stages[i].name] = sum;
    }
    return {wall, cpu};
}

}  // namespace

void FrameReport::take(const RunResult& result) {
    const ResolvedScene& s = result.scene;
    has_lat_lon = s.has_lat_lon;
    lat_deg = s.lat_deg;
    lon_deg = s.lon_deg;
    x = s.x;
    y = s.y;
    sensor_m = s.sensor_m;
    range_m = s.scene.range_m.value_or(0);
    const RunReport& r = result.report;
    for (const auto& [stage, seconds] :
         {std::pair(FrameStage::surveying, r.survey_s), std::pair(FrameStage::beaming, r.beam_s),
          std::pair(FrameStage::receiving, r.receiver_s), std::pair(FrameStage::displaying, r.display_s)}) {
        of(stage) = static_cast<float>(seconds);
        of(FrameStage::sweeping) -= of(stage);
    }
    for (const WedgeReport& w : r.wedges) {
        for (std::size_t i = 0; i < std::size(cpu_stages); ++i)
            cpu_s[i] += static_cast<float>(w.*cpu_stages[i].seconds);
        samples += w.samples;
        pieces += w.visible_pieces;
        refined_bins += w.refined_bins;
        posts += w.posts_read;
        bytes += w.bytes_read;
        add_levels(level_posts, w.level_posts);
    }
    states = r.states;
    sampling = result.sampling;
}

void write_track_report(OutputFile& file, const Settings& settings, const TrackFrames& frames,
                        const TrackReport& report, WedgeSource& source, double open_s, const Usage& usage) {
    json head{{"format", "wedgescope-track-1"}, {"version", version()}};
    json scene = parameters_json(settings, true);
    scene["threads"] = std::to_string(report.lanes.threads);
    head["scene"] = scene;
    if (!settings.power_stack.empty()) head["power_stack"] = settings.power_stack;
    head["inputs"] =
        inputs_json(input_files(settings, source.data_base(), settings.files.empty() ? "" : settings.files[0]));
    json tail{{"frame_count", frames.size()},
              {"frames_s", report.wall_s()},
              {"frames_per_second", report.frames_per_second()},
              {"open_s", open_s},
              {"lanes", report.lanes.lanes}};
    std::tie(tail["stages_wall_s"], tail["cpu_s"]) = sums(report.frames);
    std::array<std::uint64_t, state_count> states{};
    LevelPosts posts{};
    for (const FrameReport& r : report.frames) {
        for (std::size_t i = 0; i < states.size(); ++i) states[i] += r.states[i];
        add_levels(posts, r.level_posts);
    }
    tail["states"] = states_json(states);
    tail["levels"] = levels_json(posts);
    add_skipped(tail, source.skipped());
    tail["source"] = source_json(source.report());
    add_usage(tail, usage);
    tail["threads"] = report.lanes.threads;
    tail["instruction_set"] = name_of(target_in_use());

    write_report(
        file, head, "frames", frames.size(),
        [&](std::size_t i) { return frame_json(frames, i, report.frames[i], report.start_s); }, tail);
}

std::string track_table(const TrackReport& report, const Usage& usage) {
    const auto [wall, cpu] = sums(report.frames);
    const auto n = static_cast<double>(report.frames.size());
    std::string out =
        fmt::format("{:.0f} frames in {:.2f} s, {:.1f} frames/s, {} at a time on {} threads\nms a frame:", n,
                    report.wall_s(), report.frames_per_second(), report.lanes.lanes, report.lanes.threads);
    for (const auto& [name, s] : wall.items()) out += fmt::format(" {} {:.2f}", name, 1e3 * s.get<double>() / n);
    out += "\nCPU of the wedges:";
    for (const auto& [name, s] : cpu.items()) out += fmt::format(" {} {:.2f}", name, 1e3 * s.get<double>() / n);
    out += fmt::format("\nwall {:.2f} s, user {:.2f} s, system {:.2f} s; peak {} resident\n", usage.wall_s,
                       usage.user_s, usage.system_s, readable_bytes(static_cast<double>(usage.peak_rss_bytes)));
    return out;
}

std::vector<StageWork> track_work(const TrackReport& report, const Usage& usage) {
    RunReport all;
    all.wedges.emplace_back();
    WedgeReport& wedges = all.wedges.front();
    double write_s = 0;
    for (const FrameReport& r : report.frames) {
        for (std::size_t i = 0; i < std::size(cpu_stages); ++i)
            wedges.*cpu_stages[i].seconds += static_cast<double>(r.cpu_s[i]);
        wedges.posts_read += r.posts;
        wedges.bytes_read += r.bytes;
        wedges.visible_pieces += r.pieces;
        all.beam_s += r.of(FrameStage::beaming);
        all.receiver_s += r.of(FrameStage::receiving);
        all.display_s += r.of(FrameStage::displaying);
        write_s += r.of(FrameStage::writing);
        for (std::size_t code = 0; code < all.states.size(); ++code) all.states[code] += r.states[code];
    }
    return stage_work(all, write_s, usage);
}

}  // namespace wedgescope
