#include "tools/track.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <new>

#include "lib/plan.hpp"
#include "lib/stopwatch.hpp"
#include "lib/threads.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/output_file.hpp"
#include "tools/budget.hpp"
#include "tools/doubts.hpp"
#include "tools/ground.hpp"
#include "tools/layers.hpp"
#include "tools/run_files.hpp"
#include "tools/run_records.hpp"
#include "tools/side_by_side.hpp"
#include "tools/terminal.hpp"
#include "tools/track_file.hpp"
#include "tools/track_frames.hpp"
#include "tools/track_report.hpp"
#include "tools/track_stack.hpp"

namespace wedgescope {
namespace {

/// "frames 1 to 12 of 20 are written", for the end of an error's line.
std::string finished_words(const Settings& settings, std::size_t written, std::size_t all) {
    const bool stack = !settings.power_stack.empty();
    const NamedPaths layers = layer_paths(settings);
    if (stack && std::all_of(layers.begin(), layers.end(), [](const auto& layer) { return layer.second.empty(); }))
        return text("; no power-stack is written, though ", written, " of ", all, " frames were made");
    const char* also = stack ? " and no power-stack" : "";
    if (written == 0) return text("; none of ", all, " frames is written", also);
    if (written == 1) return text("; frame 1 of ", all, " is written", also);
    return text("; frames 1 to ", written, " of ", all, " are written", also);
}

struct Lanes : LaneCount {
    std::size_t own_bytes = 0;  ///< what one lane may hold, with what all share
};

EngineParams lane_params(const Settings& settings, const Lanes& lanes, int lane,
                         std::shared_ptr<const SceneTables> tables) {
    EngineParams params = engine_params(settings);
    params.threads = lanes.threads_of(lane);
    params.memory_bytes = lanes.own_bytes;
    params.beside_others = true;
    params.tables = std::move(tables);
    return params;
}

/// As many lanes as there are threads, fewer where the memory does not grant each what any of the frames takes.
/// TooLittleMemory if it does not even do for one; InputError too for a row that cannot be, or whose frame no stack can hold.
Lanes share_out(const Settings& settings, const TrackFrames& frames, WedgeSource& source,
                const std::shared_ptr<const SceneTables>& tables, const Stop& stop) {
    Lanes best;
    const auto threads = thread_count(settings);
    best.threads = threads;
    best.lanes = static_cast<int>(std::min<std::size_t>(static_cast<std::size_t>(threads), frames.size()));
    const std::size_t memory = memory_bytes(settings),
                      held = frames.size() * sizeof(FrameReport) + frames.track().bytes() +
                             (settings.power_stack.empty() ? 0 : TrackStack::bytes(threads));
    const std::size_t shared = std::min(memory, source.cache_bytes() + held);
    const auto grant = [&](int lanes) {
        best.lanes = lanes;
        best.own_bytes = (memory - shared) / static_cast<std::size_t>(lanes) + source.cache_bytes();
    };
    grant(best.lanes);
    const std::size_t readers = (memory - shared) / (source.reader_bytes() + (std::size_t{1} << 20));
    std::optional<ResolvedScene> first;
    if (!settings.power_stack.empty()) first = with_context(frames.words(0), [&] { return frames.scene(0, source); });
    std::mutex mutex;
    side_by_side(static_cast<int>(std::clamp<std::size_t>(readers, 1, static_cast<std::size_t>(best.lanes))),
                 frames.size(), [&](int, std::size_t frame) {
                     stop.check();
                     const ResolvedScene whole = with_context(frames.words(frame), [&] {
                         ResolvedScene s = frames.scene(frame, source);
                         if (frames.scans()) frames.check_scan(frame, s, source);
                         if (first) TrackStack::check_bins(*first, s);
                         if (draws(settings)) wedgescope::frame(display_setting(s));  // refuses what it cannot show
                         return s;
                     });
                     const ResolvedScene part = frames.first_part(whole);
                     for (;;) {
                         const Lanes now = [&] {
                             const std::lock_guard lock(mutex);
                             return best;
                         }();
                         EngineParams params = lane_params(settings, now, 0, tables);
                         const std::size_t images = frames.scans() ? image_bytes(whole, params.draw) : 0;
                         params.memory_bytes -= std::min(params.memory_bytes, images);
                         try {
                             const Plan planned = plan(part, source, params);
                             // Other groups have other ground: where there is no room for twice the wedge each is asked.
                             if (frames.scans() && planned.fixed_bytes + 2 * planned.wedge_bytes > params.memory_bytes)
                                 with_context(frames.words(frame), [&] {
                                     frames.for_each_part(frame, whole, source, [&](const ResolvedScene& other) {
                                         stop.check();
                                         plan(other, source, params);
                                     });
                                 });
                             break;
                         } catch (const TooLittleMemory& e) {
                             if (now.lanes == 1) throw e.with(memory, memory + (std::size_t{1} << 20));
                             const std::lock_guard lock(mutex);
                             if (best.lanes == now.lanes) grant(best.lanes - 1);  // else another frame did
                         }
                     }
                 });
    return best;
}

class FrameMaker {
public:
    /// `data`: the fingerprint of the data base before any of it was read. `stack`: null where none is asked for.
    FrameMaker(const Settings& settings, const TrackFrames& frames, WedgeSource& source, std::uint64_t data,
               TrackStack* stack, Timeline* timeline, Stop& stop)
        : settings_(settings), frames_(frames), source_(source), data_(data), stack_(stack), timeline_(timeline),
          stop_(stop), tables_(std::make_shared<const SceneTables>(settings.scene)),
          may_replace_(sparing(input_paths(settings))) {
        report_.frames.resize(frames.size());
    }

    void share_out() {
        lanes_ = wedgescope::share_out(settings_, frames_, source_, tables_, stop_);
        report_.lanes = lanes_;
    }

    /// All frames are written unless it throws.
    void make_all(const std::function<void(double)>& progress) {
        report_.start_s = now_s();
        if (stack_) stack_->begin(frames_.settings(0), frames_.scene(0, source_), frames_.size());
        InOrder<Made> committer(
            frames_.size(),
            [this](Made& made) {
                OutputFile::commit(made.files.files(), may_replace_);
                if (stack_) stack_->put(made.words);
            },
            [&](std::size_t written) { progress(static_cast<double>(written) / static_cast<double>(frames_.size())); });
        std::vector<EngineParams> params;
        for (int lane = 0; lane < lanes_.lanes; ++lane) {
            params.push_back(lane_params(settings_, lanes_, lane, tables_));
            params.back().stop = &stop_;
            params.back().timeline = timeline_;
            params.back().data = data_;
        }
        std::vector<RunResult> results(params.size());
        std::exception_ptr error;
        try {
            const Crew crew(lanes_.threads - lanes_.lanes + 1);
            side_by_side(
                lanes_.lanes, frames_.size(),
                [&](int lane, std::size_t frame) {
                    if (const auto wrong = committer.error()) std::rethrow_exception(wrong);
                    const auto own = static_cast<std::size_t>(lane);
                    make(frame, params[own], results[own], committer);
                },
                [&](std::size_t frame) { committer.leave_out(frame); });
        } catch (...) {
            error = std::current_exception();
        }
        const std::size_t written = committer.end();
        report_.end_s = now_s();
        if (!error) error = committer.error();
        if (error) end(error, written);
    }

    /// A line for each kind of doubt, with how many frames it is about.
    std::vector<std::string> doubts() const {
        std::vector<std::string> lines;
        for (const DoubtCount& d : doubts_)
            if (d.frames > 0)
                lines.push_back(text(d.frames, " of ", frames_.size(), " frames (first ", d.first + 1, "): ", d.line));
        return lines;
    }
    const TrackReport& report() const { return report_; }

private:
    struct Made {
        LayerFiles files;
        TrackStack::Words words;
    };

    void make(std::size_t frame, const EngineParams& params, RunResult& result, InOrder<Made>& committer) {
        stop_.check();
        const Span span(timeline_, "frame", "stage", static_cast<std::int64_t>(frame));
        FrameReport& report = report_.frames[frame];
        report.start_s = now_s();
        const Settings own = frames_.settings(frame);
        auto lap = [&, last = report.start_s](FrameStage stage) mutable {
            const double now = now_s();
            report.of(stage) = static_cast<float>(now - last);
            last = now;
        };
        const ResolvedScene scene = with_context(frames_.words(frame), [&] {
            ResolvedScene s = frames_.scene(frame, source_);
            lap(FrameStage::resolving);
            if (frames_.scans())
                result = run(s, frames_.scan(frame, s, source_), source_, params, std::move(result));
            else
                result = run(s, source_, params, std::move(result));
            lap(FrameStage::sweeping);
            return s;
        });
        const Span write(timeline_, "write", "stage", static_cast<std::int64_t>(frame));
        // What these convert takes its room.
        if (!own.echo.empty() || own.power_unit == PowerUnit::dbm) result.received_w = {};
        Made made{LayerFiles(own), {}};
        made.files.write(result, own, source_.data_base(), stop_);
        if (stack_) made.words = stack_->write(frame, frames_.track()[frame], own, result);
        lap(FrameStage::writing);
        report.end_s = now_s();
        report.take(result);
        note_doubts(result, frame);
        committer.take(frame, std::move(made));
    }

    void note_doubts(const RunResult& result, std::size_t frame) {
        const auto lines = wedgescope::doubts(result, !settings_.output.empty());
        const std::lock_guard lock(doubts_mutex_);
        for (std::size_t kind = 0; kind < lines.size(); ++kind) {
            DoubtCount& d = doubts_[kind];
            if (lines[kind].empty()) continue;
            if (d.frames++ > 0 && d.first < frame) continue;
            d.first = frame;
            d.line = lines[kind];
        }
    }

    [[noreturn]] void end(const std::exception_ptr& error, std::size_t written) {
        const std::string more = finished_words(settings_, written, frames_.size());
        try {
            std::rethrow_exception(error);
        } catch (const Interrupted& e) {
            throw Interrupted(e.signal(), more);
        } catch (const InputError& e) {
            throw InputError(e.what() + more);
        } catch (const DataError& e) {
            throw DataError(e.what() + more);
        } catch (const IoError& e) {
            throw IoError(e.what() + more);
        } catch (const std::bad_alloc&) {
            throw IoError("out of memory" + more);
        }
    }

    const Settings& settings_;
    const TrackFrames& frames_;
    WedgeSource& source_;
    std::uint64_t data_;
    TrackStack* stack_;
    Timeline* timeline_;
    Stop& stop_;
    std::shared_ptr<const SceneTables> tables_;
    const OutputFile::MayReplace may_replace_;
    struct DoubtCount {
        std::size_t frames = 0, first = 0;
        std::string line;  ///< of the first one
    };
    std::array<DoubtCount, doubt_count> doubts_;
    std::mutex doubts_mutex_;
    Lanes lanes_;
    TrackReport report_;
};

/// Everything that can go wrong with any frame's names is found before work begins.
void check_outputs(const Settings& settings, const TrackFrames& frames) {
    check_run_names(settings);
    if (!settings.power_stack.empty()) TrackStack::check(settings, frames.size());
    namespace fs = std::filesystem;
    const NamedPaths inputs = input_paths(settings), others{{"power-stack", settings.power_stack},
                                                            {"report", settings.report},
                                                            {"timeline", settings.timeline}};
    // Where nothing stands yet the name tells; the folders of all frames are the same few.
    std::map<std::string, std::string> taken;
    for (const NamedPaths* paths : {&inputs, &others})
        for (const auto& [key, path] : *paths)
            if (!path.empty()) taken.emplace(canonical_path(path), key);
    check_side_files(others, settings);
    std::map<std::string, fs::path> folders;
    InputParts parts;
    for (std::size_t frame = 0; frame < frames.size(); ++frame)
        for (const auto& [key, path] : layer_paths(frames.settings(frame))) {
            if (path.empty()) continue;
            OutputFile::check(path, settings.overwrite);
            const std::string parent = fs::path(path).parent_path().string();
            if (!folders.count(parent)) folders[parent] = canonical_path(parent.empty() ? "." : parent);
            const std::string name = (folders[parent] / fs::path(path).filename()).string();
            for (const char* side : OutputFile::side_files)
                if (const auto other = taken.find(name + side); other != taken.end())
                    throw InputError(text(other->second, " is ", in_quotes(other->first), ", where a part of ", key,
                                          " of ", frames.words(frame), " may lie; every output needs its own file"));
            if (frame > 0 && !taken.count(name) && !(settings.overwrite && fs::exists(path))) continue;
            NamedPaths outputs = others;
            outputs.emplace_back(key, path);
            check_names(outputs, inputs, settings.driver, parts);
            check_side_files({{key, path}}, settings);
        }
    LayerFiles(frames.settings(0)).check(settings);
}

/// Where a heading is given that is not one of a scene file which the track on the command line stands over; else empty.
std::string heading_beside(const Settings& settings) {
    const bool beside =
        settings.given.contains("heading") && (settings.by_option("heading") || !settings.by_option("track"));
    return beside ? settings.spelled("heading") : "";
}

/// A track from its file to its pictures, step by step.
class TrackRun {
public:
    TrackRun(const Settings& settings, double start_s, Stop& stop)
        : start_s_(start_s), stop_(stop), settings_(settings),
          track_(read_track(settings.track, {settings.scene.platform.heading, heading_beside(settings)}, stop)),
          frames_(settings_, track_), session_(cache_bytes(settings_), settings_.config) {
        check_outputs(settings_, frames_);
        if (!settings_.power_stack.empty()) stack_.emplace(settings_);
        records_.emplace(settings_);
    }

    void run() {
        open();
        Progress progress(settings_.quiet);
        maker_->make_all([&](double fraction) { progress.report(fraction); });
        progress.done();
        write();
        tell();
    }

private:
    void say(const std::string& line) const {
        if (!line.empty()) remark(settings_.quiet, line);
    }

    void open() {
        const Span opening(records_->timeline(), "open", "stage");
        Settings first_frame = frames_.settings(0);
        unfit_map_ =
            find_ground(first_frame, {.levels = true, .many = frames_.size() >= many_scenes, .whole = true}, stop_);
        settings_.ground = first_frame.ground;
        try {
            open_source();
        } catch (const TooLittleMemory& e) {
            maker_.reset();
            source_.reset();
            refuse(e, memory_bytes(settings_), [&](std::size_t memory) {
                const Settings granted = with_memory(settings_, memory);
                const auto source = open_shared_source(granted, stop_);
                share_out(granted, frames_, *source, std::make_shared<const SceneTables>(granted.scene), stop_);
            });
        }
        say(hard_to_read(settings_, *source_, stop_));
        open_s_ = now_s() - start_s_;
    }

    void open_source() {
        source_ = open_shared_source(settings_, stop_);
        const std::uint64_t data = source_->fingerprint({});
        Threads(thread_count(settings_)).execute([&] { source_->read(&stop_); });
        check_unchanged(*source_, data);  // no frame is made of two data bases
        maker_ = std::make_unique<FrameMaker>(settings_, frames_, *source_, data, stack_ ? &*stack_ : nullptr,
                                              records_->timeline(), stop_);
        maker_->share_out();
    }

    /// Frames are written already.
    void write() {
        records_->end_timeline();
        usage_ = usage_since(start_s_);
        std::vector<OutputFile*> files;
        if (stack_) {
            try {
                stack_->close();
            } catch (const IoError& e) {
                throw IoError(e.what() + finished_words(settings_, frames_.size(), frames_.size()));
            }
            files.push_back(&stack_->file());
        }
        if (OutputFile* to = records_->report())
            write_track_report(*to, settings_, frames_, maker_->report(), *source_, open_s_, usage_);
        others_ = records_->commit(files, input_paths(settings_));
    }

    void tell() const {
        for (const std::string& line : idle_effects(frames_.settings(0).scene, source_->data_base(), legend(settings_)))
            say(line);
        for (const std::string& line : idle_receiver(settings_.scene.receiver, settings_.scene.display)) say(line);
        for (const std::string& line : maker_->doubts()) say(line);
        for (const std::string& line : doubts_of_heights(settings_.dem, *source_, settings_.culture_height_scale))
            say(line);
        if (frames_.scans() && frames_.size() == 1)
            say("scan-step has no effect: a track of one row has no motion, and its sensor stands still");
        const TrackReport& report = maker_->report();
        if (settings_.verbose || settings_.profile) say_as_it_is(track_table(report, usage_));
        if (settings_.profile) say_as_it_is(limits_words(settings_, track_work(report, usage_)));
        remark_unused(settings_.quiet, unfit_map_);
        say(text("written: ", written(),
                 fmt::format(" ({:.1f} s, {:.1f} frames/s)", now_s() - start_s_, report.frames_per_second())));
    }

    /// "scope_0001.png to scope_0020.png, report.json".
    std::string written() const {
        std::string words;
        const NamedPaths from = layer_paths(frames_.settings(0)),
                         to = layer_paths(frames_.settings(frames_.size() - 1));
        for (std::size_t i = 0; i < from.size(); ++i) {
            if (from[i].second.empty()) continue;
            words += (words.empty() ? "" : ", ") + from[i].second;
            if (frames_.size() > 1) words += " to " + to[i].second;
        }
        if (!others_.empty()) words += (words.empty() ? "" : ", ") + others_;
        return words;
    }

    double start_s_;
    Stop& stop_;
    Settings settings_;
    const Track track_;
    const TrackFrames frames_;
    const GdalSession session_;
    std::optional<TrackStack> stack_;
    std::optional<RunRecords> records_;
    std::string unfit_map_, others_;
    std::unique_ptr<SharedSource> source_;
    std::unique_ptr<FrameMaker> maker_;
    double open_s_ = 0;
    Usage usage_;
};

}  // namespace

void simulate_track(const Settings& settings, double start_s, Stop& stop) { TrackRun(settings, start_s, stop).run(); }

}  // namespace wedgescope
