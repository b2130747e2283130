// OutputFile: a file that appears under its final name only when it is whole; anything else is removed, also when
// a signal ends the run, and after `kill -9` by the next one of the same name. Leaves what is written to others.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "tiles/claim.hpp"

namespace wedgescope {

class OutputFile {
public:
    /// What is behind a raster's name in those of the files that may lie beside it as parts of it.
    static constexpr const char* side_files[] = {".aux.xml", ".geoloc.tif", ".ovr", ".msk", ".msk.ovr"};

    /// Removes first what processes left of the same name that were killed before this one first wrote into the folder.
    /// InputError if the final name, or a side file of it, exists and `overwrite` is off, or if it is no plain file;
    /// IoError if its folder is missing or cannot be written to.
    OutputFile(std::string final_path, bool overwrite);
    /// The same errors, but for a folder that cannot be written to, without making anything.
    static void check(const std::string& final_path, bool overwrite);
    /// Removes what was written unless it was committed.
    ~OutputFile();
    OutputFile(OutputFile&&) noexcept;
    OutputFile& operator=(OutputFile&&) = delete;

    const std::string& final_path() const { return final_path_; }
    /// What to write to: the final name in a folder of its own beside it (`.scope.png.tmp-PID-N/scope.png`), where
    /// drivers may put side files (`.aux.xml`, `.geoloc.tif`, `.hdr`, ...) too. Empty once committed.
    const std::string& temporary_path() const { return temporary_path_; }

    /// Flushes to disk and puts everything in place under the final names. Stale side files of the final name
    /// (`.aux.xml`, `.geoloc.tif`, ...) go. Checked for all of them before the first one is moved: InputError if something
    /// stands there and `overwrite` is off, or if two of the outputs bring a side file of the same name. IoError naming the
    /// file.
    /// `may_replace`: asked about every side file that one stands in the place of; throws where it may not.
    using MayReplace = std::function<void(const OutputFile& output, const std::string& side_file)>;
    static void commit(const std::vector<OutputFile*>& files, const MayReplace& may_replace = {});
    void commit() { commit({this}); }

private:
    std::vector<std::string> written() const;
    void remove_folder() noexcept;

    std::string final_path_, folder_, temporary_path_;
    Descriptor claim_;  ///< of folder_
    bool overwrite_ = false;
};

}  // namespace wedgescope
