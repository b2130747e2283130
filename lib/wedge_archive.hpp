// WedgeArchive: where finished wedges are kept and found again, and what a kept echo depends on.
// Leaves files, checksums and locks to tiles/work_dir.hpp.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lib/report.hpp"
#include "lib/spoke_grid.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

struct ResolvedScene;

/// Goes up with every change of the engine that changes a bit of an echo or of its states.
inline constexpr int echo_revision = 25;

/// Something a bit of the echo depends on, by the name of the key that a user would look at.
struct Fact {
    std::string name;
    std::string value;  ///< numbers in the shortest form that reads back the same
    friend bool operator==(const Fact&, const Fact&) = default;
};
/// All that the echo of a scene depends on, beside what the posts and culture cells hold: the same list, the same bits of one
/// echo_revision.
/// Nothing that comes after the echo (receiver, tube, noise) and nothing that only splits the work is in it.
std::vector<Fact> echo_facts(const ResolvedScene& scene, const DataBase& data_base);

/// Posts that a wedge may ask for, and the nadir's: strips of 64 lines, each with what its spokes reach. Depends on the
/// scene and the wedge alone.
std::vector<Window> posts_of(const SpokeGrid& grid, const Wedge& wedge, const Window& nadir_patch);

/// Which wedge, and of which data.
struct WedgeKey {
    std::int64_t index = 0;
    Interval azimuth_bins;
    Interval range_bins;
    std::uint64_t data = 0;  ///< WedgeSource::fingerprint of its posts
};

/// What a finished wedge leaves beside its rows.
struct WedgeOutcome {
    std::optional<std::int32_t> unknown_code;  ///< least code on seen ground that the legend does not name
    WedgeReport report;
};

class WedgeArchive {
public:
    virtual ~WedgeArchive() = default;
    /// Azimuth bins of each wedge as the run's first process cut them; empty before that.
    virtual std::vector<Interval> recorded_split() = 0;
    /// Records the split unless another process was first; returns what stands.
    virtual std::vector<Interval> record_split(const std::vector<Interval>& wedges) = 0;
    /// Fills the rows (azimuth bins x range bins, row after row) of a wedge that was kept from the same scene and data.
    /// Nothing if there is none, or none that is whole: the rows may then hold anything. From several threads at once.
    virtual std::optional<WedgeOutcome> find(const WedgeKey& key, std::span<float> echo_w,
                                             std::span<std::uint8_t> state) = 0;
    /// Keeps a finished wedge; it is safe when this returns. From several threads at once. IoError.
    virtual void keep(const WedgeKey& key, const WedgeOutcome& outcome, std::span<const float> echo_w,
                      std::span<const std::uint8_t> state) = 0;
};

}  // namespace wedgescope
