// Folder entries: what a folder holds, in one list, so that some of it may be removed while one looks.
// Leaves to its users which of it is theirs.
#pragma once
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

namespace wedgescope {

/// Of a folder, with those of folders in it where the iterator is recursive; `error` where not all of them can be told.
template <class Iterator = std::filesystem::directory_iterator>
std::vector<std::filesystem::directory_entry> folder_entries(const std::string& folder, std::error_code& error) {
    std::vector<std::filesystem::directory_entry> found;
    for (Iterator at(folder, error), end; !error && at != end; at.increment(error)) found.push_back(*at);
    return found;
}

}  // namespace wedgescope
