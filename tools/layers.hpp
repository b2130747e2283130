// Layers: the rasters of a simulation (scope, echo, power, states), under temporary names until they are committed.
// Leaves what is in them to tiles and when they appear to the commands.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "lib/stop.hpp"
#include "tiles/output_file.hpp"
#include "tools/run_files.hpp"
#include "tools/settings.hpp"

namespace wedgescope {

/// The keys and paths of the layers that are asked for.
NamedPaths layer_paths(const Settings& settings);

class LayerFiles {
public:
    /// InputError, IoError as OutputFile; IoError where a legend is asked for and the program for it is missing.
    explicit LayerFiles(const Settings& settings);

    /// InputError for a driver, extension or creation option that will not do. Within a GdalSession.
    void check(const Settings& settings) const;
    /// All that are asked for, each under its temporary name. `settings`: with the scene's own place.
    void write(RunResult& result, const Settings& settings, const DataBase& data_base, const Stop& stop);
    /// What is to be committed.
    std::vector<OutputFile*> files();

private:
    std::optional<OutputFile> scope_, echo_, power_, states_;
    std::string legend_helper_;  ///< empty: no legend
};

}  // namespace wedgescope
