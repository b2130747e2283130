// OutputFile: a file that appears under its final name only when it is whole; anything else is removed, also when
// a signal ends the run. Leaves what is written to others.
#pragma once
#include <string>

namespace wedgescope {

class OutputFile {
public:
    /// InputError if the final name exists and `overwrite` is off; IoError if its folder is missing or not writable.
    OutputFile(std::string final_path, bool overwrite);
    /// Removes the temporary file (and its side files) unless commit() was called.
    ~OutputFile();
    OutputFile(OutputFile&&) noexcept;
    OutputFile& operator=(OutputFile&&) = delete;

    const std::string& final_path() const { return final_path_; }
    /// Beside the final one, with its extension (scope.tmp-PID-N.png): what to write to. Empty after commit().
    const std::string& temporary_path() const { return temporary_path_; }
    /// Flushes to disk, renames (everything beside it that carries its name too: `.aux.xml`, `.geoloc.tif`, `.hdr`,
    /// ...), forgets. Old `.aux.xml` and `.geoloc.tif` of the final name go. IoError naming the file.
    void commit();

private:
    void refuse_existing() const;

    std::string final_path_, temporary_path_;
    bool overwrite_ = false;
};

/// Removes the temporary files of every OutputFile alive, for a way out that runs no destructors. Not for use
/// inside a signal handler.
void remove_temporary_files() noexcept;

/// Writes a text file through an OutputFile.
void write_text(const std::string& path, const std::string& content, bool overwrite);

}  // namespace wedgescope
