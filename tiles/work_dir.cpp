#include "tiles/work_dir.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/claim.hpp"
#include "tiles/folder_entries.hpp"
#include "tiles/json_text.hpp"
#include "tiles/plain_file.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;
using json = nlohmann::ordered_json;

constexpr const char* run_name = "run.json";
constexpr const char* run_format = "wedgescope-work-1";
constexpr std::string_view temporary_mark = ".tmp-";

std::string wedge_name(std::int64_t index) { return fmt::format("wedge_{:06}.bin", index); }

bool is_wedge(const std::string& name) {
    constexpr std::string_view begin = "wedge_", end = ".bin";
    if (!name.starts_with(begin) || !name.ends_with(end)) return false;
    const std::string number = name.substr(begin.size(), name.size() - begin.size() - end.size());
    return number.size() >= 6 && number.find_first_not_of("0123456789") == std::string::npos;
}

/// Whether a run may have written this file: it has most of what each has, or never reached the disk.
bool may_be_run(const std::string& path) {
    const std::string words = file_begin(path, 4096);
    int signs = 0;
    for (const char* sign : {"\"format\"", "wedgescope-work-", "\"scene_checksum\"", "\"asked\""})
        signs += words.find(sign) != std::string::npos ? 1 : 0;
    return is_blank(words) || signs >= 2;
}

bool is_temporary(const std::string& name) {
    return (name.starts_with(".wedge_") || name.starts_with(std::string(".") + run_name)) &&
           name.find(temporary_mark) != std::string::npos;
}

/// A file beside the final one, removed unless it is put in place.
class Temporary {
public:
    Temporary(const std::string& folder, const std::string& name) : final_path_(folder + "/" + name) {
        static std::atomic<int> count{0};
        for (;;) {
            path_ = text(folder, "/.", name, temporary_mark, ::getpid(), "-", ++count);
            file_ = Descriptor(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
            if (!file_ && errno == EEXIST) continue;  // another machine's process of the same number
            if (!file_) fail("cannot be made", errno);
            claim(file_.get());
            if (stands_at(file_.get(), path_)) return;
        }
    }
    ~Temporary() {
        if (!path_.empty()) ::unlink(path_.c_str());
    }
    Temporary(const Temporary&) = delete;
    Temporary& operator=(const Temporary&) = delete;

    void write(const void* bytes, std::size_t count) {
        const Transfer done = write_all(file_.get(), bytes, count);
        written_ += done.bytes;
        if (done.error) fail(text("cannot be written, ", written_, " bytes are"), done.error);
    }
    void sync() {
        if (::fsync(file_.get()) != 0) fail("cannot be written to disk", errno);
    }
    /// In place of what may stand there.
    void replace() {
        sync();
        if (::rename(path_.c_str(), final_path_.c_str()) != 0) fail("cannot be put in place", errno);
        path_.clear();
        sync_its_folder();
    }
    /// False if something stands there already.
    bool place() {
        sync();
        if (::link(path_.c_str(), final_path_.c_str()) == 0) {
            ::unlink(path_.c_str());
        } else if (errno == EEXIST) {
            return false;
        } else if (const int error = rename_new(path_, final_path_)) {
            if (error == EEXIST) return false;
            fail("cannot be put in place", error);
        }
        path_.clear();
        sync_its_folder();
        return true;
    }

private:
    [[noreturn]] void fail(const std::string& what, int reason) const {
        throw IoError(text("work file '", final_path_, "' ", what, ": ", system_reason(reason)));
    }
    void sync_its_folder() const {
        if (const int error = sync_folder(fs::path(final_path_).parent_path().string()))
            fail("cannot be written to disk", error);
    }

    std::string final_path_, path_;
    Descriptor file_;
    std::size_t written_ = 0;
};

// ---- the header of a wedge file: words of 64 bits ----

constexpr std::uint64_t wedge_magic = 0x3145474445575357;  // "WSWEDGE1", little-endian
constexpr std::size_t seconds_count = std::size(wedge_seconds), counts_count = std::size(wedge_counts) + skip_count;
constexpr std::size_t header_words = 12 + seconds_count + counts_count + 1;
using Header = std::array<std::uint64_t, header_words>;
enum HeaderWord : std::size_t {
    at_magic,
    at_scene,
    at_data,
    at_index,
    at_azimuth_begin,
    at_azimuth_end,
    at_range_begin,
    at_range_end,
    at_has_unknown,
    at_unknown,
    at_seconds_count,
    at_counts_count,
    at_seconds,
};

Header header_of(std::uint64_t scene, const WedgeKey& key, const WedgeOutcome& outcome) {
    Header h{};
    const auto word = [](std::int64_t v) { return static_cast<std::uint64_t>(v); };
    h[at_magic] = wedge_magic;
    h[at_scene] = scene;
    h[at_data] = key.data;
    h[at_index] = word(key.index);
    h[at_azimuth_begin] = word(key.azimuth_bins.begin);
    h[at_azimuth_end] = word(key.azimuth_bins.end);
    h[at_range_begin] = word(key.range_bins.begin);
    h[at_range_end] = word(key.range_bins.end);
    h[at_has_unknown] = outcome.unknown_code.has_value();
    h[at_unknown] = word(outcome.unknown_code.value_or(0));
    h[at_seconds_count] = seconds_count;
    h[at_counts_count] = counts_count;
    std::size_t at = at_seconds;
    for (const auto& figure : wedge_seconds) std::memcpy(&h[at++], &(outcome.report.*figure.member), sizeof(double));
    for (const auto& figure : wedge_counts) h[at++] = outcome.report.*figure.member;
    for (const std::uint64_t posts : outcome.report.posts_skipped) h[at++] = posts;
    h[at] = checksum(h.data(), at * sizeof(std::uint64_t));
    return h;
}

WedgeOutcome outcome_of(const Header& h) {
    WedgeOutcome outcome;
    if (h[at_has_unknown]) outcome.unknown_code = static_cast<std::int32_t>(h[at_unknown]);
    std::size_t at = at_seconds;
    for (const auto& figure : wedge_seconds) std::memcpy(&(outcome.report.*figure.member), &h[at++], sizeof(double));
    for (const auto& figure : wedge_counts) outcome.report.*figure.member = h[at++];
    for (std::uint64_t& posts : outcome.report.posts_skipped) posts = h[at++];
    return outcome;
}

// ---- what differs ----

/// As it comes back from a file: bytes that are no text are replaced.
std::string as_text(const std::string& value) {
    return json::parse(json(value).dump(-1, ' ', false, json::error_handler_t::replace)).get<std::string>();
}

json object_of(const std::vector<Fact>& facts) {
    json out = json::object();
    for (const Fact& fact : facts) out[fact.name] = as_text(fact.value);
    return out;
}

std::string brief(const json& object, const std::string& name) {
    if (!object.contains(name)) return "not given";
    std::string value = object[name].get<std::string>();
    if (value.size() > 80) value = value.substr(0, 77) + "...";
    return "'" + value + "'";
}

/// "range is '5km' there and '6km' here"; empty if nothing differs.
std::string difference(const json& there, const json& here) {
    std::vector<std::string> names;
    for (const auto& [name, value] : there.items())
        if (!here.contains(name) || here[name] != value) names.push_back(name);
    for (const auto& [name, value] : here.items())
        if (!there.contains(name)) names.push_back(name);
    constexpr std::size_t most = 3;
    std::string out;
    for (std::size_t i = 0; i < std::min(most, names.size()); ++i)
        out += text(i ? ", " : "", names[i], " is ", brief(there, names[i]), " there and ", brief(here, names[i]),
                    " here");
    if (names.size() > most) out += text(", and ", names.size() - most, " more differ");
    return out;
}

std::string listed(std::vector<std::int64_t> numbers) {
    std::sort(numbers.begin(), numbers.end());
    constexpr std::size_t most = 12;
    std::string out;
    for (std::size_t i = 0; i < std::min(most, numbers.size()); ++i) out += text(i ? ", " : "", numbers[i]);
    if (numbers.size() > most) out += text(" and ", numbers.size() - most, " more");
    return out;
}

}  // namespace

WorkDir::WorkDir(std::string path, Start start) : path_(std::move(path)), start_(start) {
    while (path_.size() > 1 && path_.ends_with('/')) path_.pop_back();
    if (::mkdir(path_.c_str(), 0777) == 0) {
        made_ = true;
        return;
    }
    if (errno != EEXIST) throw IoError(text(named(), " cannot be made: ", system_reason(errno)));
    std::error_code error;
    if (!fs::is_directory(path_, error)) throw InputError(text(named(), " is no folder; accepted: a folder"));
    const bool holds_run = fs::exists(file(run_name), error);
    if (holds_run && start == Start::fresh)
        throw InputError(
            text(named(), " holds a run already; add --resume to go on with it or --overwrite to start over"));
    if (holds_run && start == Start::over && fs::is_regular_file(file(run_name), error) && !may_be_run(file(run_name)))
        throw InputError(text(named(), " is no work folder: its '", run_name,
                              "' is no run's; accepted: a missing or empty folder, or one of an earlier run"));
    const std::vector<fs::directory_entry> entries = folder_entries(path_, error);
    if (error) throw IoError(text(named(), " cannot be read: ", error.message()));
    for (const auto& entry : entries) {
        const std::string name = entry.path().filename().string();
        if (!holds_run && name != run_name && !is_wedge(name) && !is_temporary(name))
            throw InputError(text(named(), " is no work folder: it holds '", name,
                                  "' and no run; accepted: a missing or empty folder, or one of an earlier run"));
    }
    if (::access(path_.c_str(), W_OK | X_OK) != 0)
        throw IoError(text(named(), " cannot be written to: ", system_reason(errno)));
    remove_left_behind(path_, is_temporary);
}

WorkDir::~WorkDir() {
    if (made_) ::rmdir(path_.c_str());
}

bool WorkDir::keeps(const std::string& name) { return name == run_name || is_wedge(name) || is_temporary(name); }

void WorkDir::bind(const Run& run) {
    run_ = run;
    Checksum sum;
    for (const Fact& fact : run_.facts) {
        // Lengths first, so that no two lists give the same bytes.
        sum.add(fact.name.size());
        sum.add(fact.name);
        sum.add(fact.value.size());
        sum.add(fact.value);
    }
    sum.add(run_.version);
    scene_ = sum.value();
    if (start_ == Start::over)
        replace_ = true;
    else
        read_run();
}

std::string WorkDir::run_text(const std::vector<Interval>& wedges) const {
    json out;
    out["format"] = run_format;
    out["version"] = run_.version;
    out["scene_checksum"] = hex(scene_);
    out["asked"] = object_of(run_.asked);
    out["facts"] = object_of(run_.facts);
    // First azimuth bin of each wedge, and the end of the last.
    out["wedges"] = json::array();
    for (const Interval& wedge : wedges) out["wedges"].push_back(wedge.begin);
    out["wedges"].push_back(wedges.back().end);
    out["checksum"] = hex(checksum(out.dump()));
    return out.dump(1) + "\n";
}

/// False if there is none.
bool WorkDir::read_run() {
    const std::string name = file(run_name);
    std::string content;
    {
        const Descriptor in(::open(name.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));  // no waiting for a pipe's writer
        if (!in && errno == ENOENT) return false;
        struct stat facts {};
        constexpr off_t most = off_t{1} << 28;  // 2^20 wedges have less
        const bool good = in && ::fstat(in.get(), &facts) == 0;
        if (good && (!S_ISREG(facts.st_mode) || facts.st_size > most))
            throw DataError(text("work file '", name, "' is ", S_ISREG(facts.st_mode) ? "too large" : "no file",
                                 "; give another work-dir"));
        if (good) content.resize(static_cast<std::size_t>(facts.st_size));
        const int error = good ? read_all(in.get(), content.data(), content.size()).error : errno;
        if (!good || error) throw IoError(text("work file '", name, "' cannot be read: ", system_reason(error)));
    }
    const auto damaged = [&] {
        return DataError(text("work file '", name,
                              "' is damaged; give another work-dir, or --overwrite without --resume to start over"));
    };
    json there = parsed_json<json>(content);
    if (!there.is_object() || !there.contains("checksum") || !there["checksum"].is_string()) throw damaged();
    const std::string sum = there["checksum"];
    there.erase("checksum");
    if (sum != hex(checksum(there.dump(-1, ' ', false, json::error_handler_t::replace)))) throw damaged();
    if (!there["format"].is_string()) throw damaged();
    if (there["format"] != run_format)
        throw InputError(
            text(named(), " is of format '", there["format"].get<std::string>(), "'; accepted: '", run_format, "'"));
    const auto are_texts = [](const json& facts) {
        return facts.is_object() &&
               std::all_of(facts.begin(), facts.end(), [](const json& value) { return value.is_string(); });
    };
    if (!there["version"].is_string() || !are_texts(there["asked"]) || !are_texts(there["facts"])) throw damaged();
    if (there["scene_checksum"] != hex(scene_)) {
        const std::string what =
            there["version"] != run_.version
                ? text("version is '", there["version"].get<std::string>(), "' there and '", run_.version, "' here")
                : difference(there["asked"], object_of(run_.asked));
        if (!what.empty())
            throw InputError(text(named(), " holds another scene: ", what,
                                  "; give another work-dir, or --overwrite without --resume to start over"));
        // Asked the same and resolved otherwise: the data base answers differently.
        started_over_ = text("the data base changed the scene (", difference(there["facts"], object_of(run_.facts)),
                             "): all wedges are done again");
        replace_ = true;
        return true;
    }
    split_.clear();
    const json& wedges = there["wedges"];
    // No circle has so many bins.
    constexpr std::int64_t beyond = std::int64_t{1} << 40;
    const auto is_bound = [](const json& bin) {
        return bin.is_number_integer() && std::abs(bin.get<double>()) < static_cast<double>(beyond);
    };
    if (!wedges.is_array() || !std::all_of(wedges.begin(), wedges.end(), is_bound)) throw damaged();
    const auto bounds = wedges.get<std::vector<std::int64_t>>();
    if (bounds.size() < 2 || std::adjacent_find(bounds.begin(), bounds.end(), std::greater_equal<>()) != bounds.end())
        throw damaged();
    if (!run_.azimuth_bins.empty() && Interval{bounds.front(), bounds.back()} != run_.azimuth_bins) throw damaged();
    for (std::size_t i = 0; i + 1 < bounds.size(); ++i) split_.push_back({bounds[i], bounds[i + 1]});
    return true;
}

void WorkDir::remove_wedges() const {
    std::error_code error;
    for (const fs::directory_entry& entry : folder_entries(path_, error))
        if (is_wedge(entry.path().filename().string())) ::unlink(entry.path().c_str());
}

std::vector<Interval> WorkDir::recorded_split() { return replace_ ? std::vector<Interval>{} : split_; }

std::vector<Interval> WorkDir::record_split(const std::vector<Interval>& wedges) {
    if (!replace_ && !split_.empty()) return split_;
    // One process at a time begins a run, or starts one over that no longer fits; who comes after it goes on with its.
    const Descriptor folder(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder) claim(folder.get());
    if (replace_ && start_ != Start::over) {
        replace_ = false;
        if (read_run() && !replace_) return split_;
    }
    Temporary out(path_, run_name);
    const std::string content = run_text(wedges);
    out.write(content.data(), content.size());
    if (replace_) {
        // The wedges first: a run without wedges is sound, wedges without their run are not.
        remove_wedges();
        out.replace();
        replace_ = false;
        split_ = wedges;
    } else if (out.place()) {
        split_ = wedges;
    } else if (!read_run() || replace_) {  // another process was first
        throw InputError(
            text(named(), " is being started by another process for another scene; give another work-dir"));
    }
    return split_;
}

std::optional<WedgeOutcome> WorkDir::find(const WedgeKey& key, std::span<float> echo_w, std::span<std::uint8_t> state) {
    const std::string name = file(wedge_name(key.index));
    const Descriptor in(::open(name.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    if (!in && errno == ENOENT) return std::nullopt;
    const auto damaged = [&](const std::string& why) -> std::optional<WedgeOutcome> {
        const std::lock_guard lock(mutex_);
        damaged_.push_back(text("work file '", name, "' is damaged (", why, "); wedge ", key.index, " is done again"));
        return std::nullopt;
    };
    if (!in) return damaged(system_reason(errno));
    struct stat facts {};
    if (::fstat(in.get(), &facts) != 0 || !S_ISREG(facts.st_mode)) return damaged("it is no file");
    Header h{};
    std::string why;
    const auto reads = [&](void* to, std::size_t count) {
        const Transfer done = read_all(in.get(), to, count);
        why = done.error ? system_reason(done.error) : "it is too short";
        return done.bytes == count;
    };
    if (!reads(h.data(), sizeof h)) return damaged(why);
    if (h[at_magic] != wedge_magic || h[at_seconds_count] != seconds_count || h[at_counts_count] != counts_count)
        return damaged("it is no wedge file of this version");
    if (h.back() != checksum(h.data(), sizeof h - sizeof(std::uint64_t)))
        return damaged("its header's checksum differs");
    if (h[at_scene] != scene_ || h[at_data] != key.data) {
        const std::lock_guard lock(mutex_);
        changed_.push_back(key.index);
        return std::nullopt;
    }
    const Header want = header_of(scene_, key, {});
    if (!std::equal(h.begin() + at_index, h.begin() + at_has_unknown, want.begin() + at_index)) {
        const std::lock_guard lock(mutex_);
        others_.push_back(key.index);
        return std::nullopt;
    }
    std::uint64_t sum = 0;
    char beyond = 0;
    if (!reads(echo_w.data(), echo_w.size_bytes()) || !reads(state.data(), state.size()) || !reads(&sum, sizeof sum))
        return damaged(why);
    if (::read(in.get(), &beyond, 1) != 0) return damaged("it is too long");
    Checksum content;
    content.add(echo_w.data(), echo_w.size_bytes());
    content.add(state.data(), state.size());
    if (content.value() != sum) return damaged("its checksum differs");
    return outcome_of(h);
}

void WorkDir::keep(const WedgeKey& key, const WedgeOutcome& outcome, std::span<const float> echo_w,
                   std::span<const std::uint8_t> state) {
    const Header h = header_of(scene_, key, outcome);
    Checksum content;
    content.add(echo_w.data(), echo_w.size_bytes());
    content.add(state.data(), state.size());
    const std::uint64_t sum = content.value();
    Temporary out(path_, wedge_name(key.index));
    out.write(h.data(), sizeof h);
    out.write(echo_w.data(), echo_w.size_bytes());
    out.write(state.data(), state.size());
    out.write(&sum, sizeof sum);
    out.replace();
}

bool WorkDir::seems_done() const {
    std::error_code error;
    if (start_ != Start::join || !fs::is_regular_file(file(run_name), error)) return false;
    std::ifstream in(file(run_name), std::ios::binary);
    const json run = parsed_json<json>(std::string(std::istreambuf_iterator<char>(in), {}));
    if (!run.is_object() || !run.contains("wedges") || run["wedges"].size() < 2) return false;
    for (std::size_t i = 0; i + 1 < run["wedges"].size(); ++i)
        if (!fs::exists(file(wedge_name(static_cast<std::int64_t>(i))), error)) return false;
    return true;
}

std::size_t WorkDir::kept() const {
    std::size_t count = 0;
    std::error_code error;
    for (std::size_t i = 0; i < split_.size(); ++i)
        count += fs::exists(file(wedge_name(static_cast<std::int64_t>(i))), error);
    return count;
}

std::vector<std::string> WorkDir::remarks() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> lines;
    if (!started_over_.empty()) lines.push_back(started_over_);
    lines.insert(lines.end(), damaged_.begin(), damaged_.end());
    const auto again = [&](const std::vector<std::int64_t>& wedges, const std::string& why) {
        if (!wedges.empty())
            lines.push_back(text(why, "; done again: ", wedges.size() == 1 ? "wedge " : "wedges ", listed(wedges)));
    };
    again(changed_, "the data base changed since");
    again(others_, text("files of '", path_, "' hold other wedges than '", run_name, "' says"));
    return lines;
}

}  // namespace wedgescope
