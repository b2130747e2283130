#include "tools/key_commands.hpp"

#include <algorithm>
#include <initializer_list>

#include "lib/error.hpp"

namespace wedgescope {

void add_commands(std::vector<Key>& keys) {
    const auto keys_of = [&](std::initializer_list<const char*> names, const auto& change) {
        for (const char* name : names) {
            const auto key = std::find_if(keys.begin(), keys.end(), [&](const Key& one) { return one.name == name; });
            if (key == keys.end()) throw Error(text("no key is called ", name));  // our own mistake
            change(*key);
        }
    };
    const auto to_coverage = [](Key& key) { key.commands |= command_coverage; };
    keys_of({"culture-height", "culture-height-scale", "latlon", "xy", "altitude-msl", "altitude-agl", "altitude-hae",
             "geoid-offset", "heading", "sector", "range", "range-start"},
            to_coverage);
    keys_of({"geometry", "earth", "quality", "max-error", "spokes-per-post", "spoke-lead", "crossings", "course"},
            to_coverage);
    keys_of({"threads", "memory", "source", "temp-dir", "keep-map", "no-cull", "report", "timeline", "profile"},
            to_coverage);
    keys_of({"verbose", "of", "co", "overwrite", "reproducible", "config", "quiet", "help"}, to_coverage);
    const auto to_response = [](Key& key) {
        key.commands |= command_coverage;
        key.of_response = true;
    };
    for (Key& key : keys)
        if (key.group == KeyGroup::antenna || key.group == KeyGroup::ground || key.group == KeyGroup::weather)
            to_response(key);
    keys_of({"set", "frequency", "transmit-power", "gain", "losses", "polarisation", "culture", "culture-legend",
             "material"},
            to_response);
    keys_of({"far-shore"}, [](Key& key) {  // of what a ray meets on its way, not of a post by itself
        key.commands &= ~static_cast<unsigned>(command_coverage);
        key.of_response = false;
    });
    // The link budget of a cell of what simulate makes: all that decides on it, and how it is found.
    for (Key& key : keys)
        if ((key.commands & command_simulate) &&
            (key.group == KeyGroup::data_base || (key.changes_result && key.group != KeyGroup::display)))
            key.commands |= command_budget;
    keys_of({"set", "display", "threads", "memory", "source", "temp-dir", "keep-map", "no-cull", "wedges", "config",
             "quiet", "help"},
            [](Key& key) { key.commands |= command_budget; });
    keys_of({"scan-step", "scan-period"},  // of many pictures
            [](Key& key) { key.commands &= ~static_cast<unsigned>(command_budget); });
    // What follows the echo image, and what the picture takes from the scene beside: the rest needs a new sweep.
    for (Key& key : keys) {
        if (key.after_echo || key.group == KeyGroup::errors) key.commands |= command_scope;
        if (key.group == KeyGroup::data_base) key.needs_sweep = "the echo image holds what was seen of its data base";
        if (key.group == KeyGroup::weather) key.needs_sweep = "what is lost on the way is in every piece of the echo";
        if (key.group == KeyGroup::antenna) key.needs_sweep = "the pattern in elevation weighs every piece of ground";
    }
    keys_of({"heading",   "sector",    "azimuth-bins",    "range-bin", "pulse",      "noise-figure",
             "bandwidth", "beam",      "azimuth-pattern", "display",   "threads",    "memory",
             "output",    "power",     "states",          "report",    "power-unit", "of",
             "co",        "overwrite", "reproducible",    "config",    "quiet",      "help"},
            [](Key& key) {
                key.commands |= command_scope;
                key.needs_sweep.clear();
            });
    const auto because = [&](std::initializer_list<const char*> names, const char* reason) {
        keys_of(names, [&](Key& key) { key.needs_sweep = reason; });
    };
    because({"latlon", "xy", "altitude-msl", "altitude-agl", "altitude-hae", "geoid-offset"},
            "what is seen depends on where the sensor stands");
    because({"scan-step", "scan-period"}, "an echo image is seen from one place");
    because({"geometry", "earth"}, "it decides what the spokes meet and what hides it");
    because({"range"}, "how densely the ground is sampled follows from it");
    because({"range-start"}, "ground that its near edge cuts is added up in other pieces");
    because({"quality", "max-error", "spokes-per-post", "spokes-per-bin", "spoke-lead", "crossings", "course", "refine",
             "detail"},
            "it decides how the ground is sampled");
    because({"frequency", "transmit-power", "gain", "losses"},
            "the echo's watts hold it, and would be rounded otherwise (if-gain brightens the picture as well)");
    because({"gamma"}, "it is what every piece of ground returns");
    because({"polarisation", "backscatter", "water", "sea-state", "wind-direction", "far-shore", "walls"},
            "it decides what every piece of ground returns");
}

}  // namespace wedgescope
