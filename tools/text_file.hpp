// Text file: the whole of a small file that people write by hand: scenes, sets, legends, tables of classes and of antennas.
// Leaves what its lines mean to whoever reads it, and long tables, line by line, to table_file.hpp.
#pragma once
#include <cstddef>
#include <string>
#include <string_view>

#include "lib/stop.hpp"

namespace wedgescope {

/// While it lives, a request to stop ends the wait for a pipe that nobody writes to, as of a table: options are read far below
/// whoever knows the stop. One at a time.
class StopsTextReads {
public:
    explicit StopsTextReads(const Stop& stop);
    ~StopsTextReads();
    StopsTextReads(const StopsTextReads&) = delete;
    StopsTextReads& operator=(const StopsTextReads&) = delete;

private:
    const Stop* before_;
};

/// `subject`: of the messages ("scene file 'x.ini'"); `holds`: what so large a file cannot be ("it holds a line for each class").
/// IoError where it is a folder or cannot be read; InputError where it is larger than `most_mib` or no text; Interrupted.
std::string text_of_file(const std::string& subject, const std::string& path, std::string_view holds,
                         std::size_t most_mib = 1);

}  // namespace wedgescope
