// Track stack: the power images of a track's frames as the bands of one file (--power-stack), and what is said of each.
// Leaves the file's format to tiles/power_stack.hpp and numbered files to layers.hpp.
//
// Lanes write their images as they have them; what is said of a frame is put behind the bands in the order of the rows. The file
// appears when the last frame is there: one that some frames are missing from is removed.
#pragma once
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "lib/engine.hpp"
#include "lib/track.hpp"
#include "tiles/output_file.hpp"
#include "tiles/power_stack.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

class TrackStack {
public:
    /// InputError where power-stack will not do for so many frames, whatever they show.
    static void check(const Settings& settings, std::size_t frames);
    /// InputError where the bins of a frame (from 0) are not those of the first.
    static void check_bins(const ResolvedScene& first, const ResolvedScene& scene);
    /// What it holds at the most, written by so many threads.
    static std::size_t bytes(int threads);

    /// InputError, IoError as OutputFile.
    explicit TrackStack(const Settings& settings) : file_(settings.power_stack, settings.overwrite) {}
    /// Makes room for all frames; `first`: the settings and the scene of the first. IoError, here and below.
    void begin(const Settings& first, const ResolvedScene& scene, std::size_t frames);

    /// What is said of a frame.
    struct Words {
        std::string description;
        Metadata items;
    };
    /// A frame's power image. `settings`: with the row's place. From several threads.
    Words write(std::size_t frame, const TrackPoint& point, const Settings& settings, const RunResult& result);
    /// In the order of the frames, from one thread.
    void put(const Words& words);
    void close();

    OutputFile& file() { return file_; }

private:
    OutputFile file_;
    nlohmann::ordered_json scene_;  ///< of the first frame
    std::unique_ptr<PowerStack> stack_;
};

}  // namespace wedgescope
