// WorkDir: the work folder: finished wedges as files, and the scene and the split they belong to. A killed run goes on
// from it; several processes may fill one at the same time. Leaves what a wedge depends on to lib/wedge_archive.hpp.
//
// Files: run.json (scene, split) and wedge_NNNNNN.bin, laid out in docs/formats.md. Each is written under a temporary
// name, synced and put in place in one step; whoever writes a temporary claims it (claim.hpp), so that what a
// killed process left behind is known and removed by the next one. Nothing is held in memory but a small header.
#pragma once
#include <mutex>
#include <string>

#include "lib/wedge_archive.hpp"

namespace wedgescope {

class WorkDir final : public WedgeArchive {
public:
    enum class Start {
        fresh,  ///< refused where a run stands already
        over,   ///< forget a run that stands there
        join,   ///< go on with it, or begin
    };
    /// Makes the folder if it is missing. InputError if it holds something else, or a run and `start` is fresh; IoError
    /// if it cannot be made or read. Removes what killed processes left half-written.
    WorkDir(std::string path, Start start);
    /// Removes the folder if this one made it and nothing is in it.
    ~WorkDir() override;
    WorkDir(const WorkDir&) = delete;
    WorkDir& operator=(const WorkDir&) = delete;

    /// Before bind(), at a glance: does each wedge of the run that stands there, and that will be gone on with, have a file?
    bool seems_done() const;

    /// The run that the folder is for.
    struct Run {
        std::string version;      ///< of the program, and of its echo
        std::vector<Fact> asked;  ///< keys that may change the echo, as given: to name what differs
        std::vector<Fact> facts;  ///< all that changes the echo, but for the content of posts and cells
        Interval azimuth_bins{};  ///< that its wedges cover; empty: not told
    };
    /// InputError naming the key if the run that stands there is of another scene; DataError if its file is damaged.
    /// Where the same was asked but the data base now answers otherwise (another height under the sensor), the folder
    /// is started over. Call before anything of WedgeArchive.
    void bind(const Run& run);

    std::vector<Interval> recorded_split() override;
    std::vector<Interval> record_split(const std::vector<Interval>& wedges) override;
    std::optional<WedgeOutcome> find(const WedgeKey& key, std::span<float> echo_w,
                                     std::span<std::uint8_t> state) override;
    void keep(const WedgeKey& key, const WedgeOutcome& outcome, std::span<const float> echo_w,
              std::span<const std::uint8_t> state) override;

    /// Would a file of that name be one of such a folder's own?
    static bool keeps(const std::string& name);
    const std::string& path() const { return path_; }
    /// Wedges of the split that have a file.
    std::size_t kept() const;
    /// What a user should hear: files that were damaged, wedges whose data changed. One line each.
    std::vector<std::string> remarks() const;

private:
    std::string file(const std::string& name) const { return path_ + "/" + name; }
    std::string named() const { return "work-dir '" + path_ + "'"; }
    std::string run_text(const std::vector<Interval>& wedges) const;
    bool read_run();
    void remove_wedges() const;

    std::string path_;
    Start start_;
    bool made_ = false;     ///< the folder
    bool replace_ = false;  ///< what stands there is of no use
    Run run_;
    std::uint64_t scene_ = 0;  ///< checksum of run_
    std::vector<Interval> split_;
    mutable std::mutex mutex_;
    std::vector<std::string> damaged_;
    std::vector<std::int64_t> changed_, others_;  ///< wedges whose files are of other data, and hold other wedges
    std::string started_over_;
};

}  // namespace wedgescope
