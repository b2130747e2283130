#include "tools/command_table.hpp"

#include "lib/error.hpp"
#include "tools/near_words.hpp"

namespace wedgescope {

const std::vector<CommandInfo>& command_table() {
    static const std::vector<CommandInfo> table = {
        {command_simulate, "simulate", "wedgescope simulate [options] [scene.ini]",
         "data base + scene -> scope picture, echo, power and state layers, response of the ground, report",
         "Every option below is also a key of the scene file (lines 'key = value'; # behind a blank begins a comment, "
         "but not within double quotes round the value). The command line wins; relative paths in the file start from "
         "its folder. Outputs appear under their names only when they are whole.",
         "wedgescope simulate --dem terrain.tif --latlon 33.9,-117.3 --altitude-msl 7000ft --range 30nmi -o scope.png"},
        {command_scope, "scope", "wedgescope scope [options] ECHO [setting.ini]",
         "stored echo image -> scope picture with another receiver, display, noise",
         "ECHO is what simulate --echo has written. Whatever is not given is as it was then; the picture is, byte for "
         "byte, the one that simulate makes with the same setting, and nothing of the data base is read. Settings that "
         "need a new sweep are refused with the reason, unless they are as they were. Beam, pulse, sector and heading "
         "may change as long as the echo image holds what they gather and its bins stay (azimuth-bins and range-bin, "
         "where they are auto, follow beam and pulse: give them).",
         "wedgescope scope --if-gain 40dB --display ppi echo.tif -o scope.png"},
        {command_coverage, "coverage", "wedgescope coverage [options] IN OUT",
         "terrain raster -> which of its posts are seen, how high, far and steep they lie, or what a radar gets of "
         "them",
         "OUT has IN's grid; the mask holds 255 where the ground is seen, 0 where it is not, 1 where there is no data "
         "or out of range. gdal_viewshed's options -ox -oy -oz -tz -md -cc -ov -vv -iv -a_nodata -b -f (or -of) -co "
         "-om -q are understood too, lengths in the raster's units (-b 1 and -om NORMAL only: --layer height gives "
         "what -om GROUND does); with -ox and -oy the ground is a plane, the sensor stands over the nearest post, and "
         "defaults are gdal_viewshed's. With --observers many sensors are looked from in one run. Radar, antenna, "
         "ground and "
         "weather are for --layer response alone, as are culture, culture-legend, class-table and material.",
         "wedgescope coverage --latlon 33.9,-117.3 --altitude-agl 500m terrain.tif seen.tif"},
        {command_budget, "budget", "wedgescope budget [options] [scene.ini] --at AZIMUTH,RANGE | --at-latlon LAT,LON",
         "link budget of one cell, line by line from the transmitter to the grey level",
         "Takes every option of simulate that decides on the picture. Each line is a number with its unit; those from "
         "the transmitter to the clouds add up to the echo, which is the cell's in simulate's images. What depends on "
         "the ground (pattern, gases, rain, cloud) is the mean over all that the cell gathers through pulse and beam, "
         "weighted with what it returns. Where a scene file says where the sensor is, --latlon on the command line "
         "without --at names the place on the ground.",
         "wedgescope budget scene.ini --at 40deg,12nmi"},
        {command_evaluate, "evaluate", "wedgescope evaluate MODEL [NAME=VALUE...] [options] | evaluate --list [MODEL]",
         "any model of the library as a calculator, over a CSV table or for single values",
         "MODEL takes its inputs from the columns of the table (--in), named with their units in brackets, such as 'r "
         "[km]', and from NAME=VALUE, which hold for all rows; what has a default may be left out. Each row of the "
         "table is written as it stands, with the model's outputs behind it. Without a table the outputs are printed, "
         "one a line, or with -o as a table of one row. --list names the models; --list MODEL gives its inputs, "
         "ranges, outputs and source.",
         "wedgescope evaluate sight hs=3000m h=250m s=20km"},
        {command_info, "info", "wedgescope info [options] FILE... | info --plan [simulate's options] [scene.ini]",
         "what rasters and tile stores hold, or what a scene file (*.ini) resolves to",
         "For a raster: grid, CRS, heights, voids; with --culture-legend also its codes, how often each occurs, and "
         "their materials. For a tile store: its layers, and with --verify whether all of it is as it was written. For "
         "a scene file: where the sensor is, what is swept, sizes and memory. With --plan, which takes every option of "
         "simulate, but for a track: what a run would do at one place, without running.",
         "wedgescope info --culture-legend fbfm40 culture.tif"},
        {command_tile, "tile", "wedgescope tile [options] RASTER... FOLDER",
         "terrain rasters, culture -> a tile store that --dem takes",
         "One or many terrain rasters (cells of a mosaic may differ in posting) become one data base: tiled, with "
         "block map, overviews and checksums, which any GDAL program opens too (FOLDER/dem.vrt). Of a post that "
         "several rasters hold, the first in the order given that has a value there wins.",
         "wedgescope tile n33_w118.dt2 n33_w117.dt2 --culture fuel.tif --culture-legend fbfm40 inland"},
        {command_help, "help", "wedgescope help [COMMAND | sets [NAME]]",
         "this page, a command's options, or the shipped radar sets", "", "wedgescope help simulate"},
    };
    return table;
}

const CommandInfo& info_of(Command command) {
    for (const CommandInfo& info : command_table()) {
        if (info.command == command) return info;
    }
    throw Error("no such command");
}

const CommandInfo& command_by_name(std::string_view name) {
    std::vector<std::string> names;
    for (const CommandInfo& info : command_table()) {
        if (name == info.name) return info;
        names.emplace_back(info.name);
    }
    std::string all;
    for (const auto& n : names) all += (all.empty() ? "" : ", ") + n;
    throw InputError(text("unknown command ", in_quotes(name), suggestion(name, names), " (there are ", all, ")"));
}

std::string whose(std::string_view word) {
    const Key* key = find_key(word);
    if (!key) return "";
    std::vector<std::string> owners;
    for (const CommandInfo& info : command_table())
        if (key->commands & info.command) owners.push_back(text(info.name, "'s"));
    if (owners.empty()) return "";
    std::string all = "; it is ";
    for (std::size_t i = 0; i < owners.size(); ++i)
        all += text(i == 0 ? "" : i + 1 < owners.size() ? ", " : " and ", owners[i]);
    return all;
}

}  // namespace wedgescope
