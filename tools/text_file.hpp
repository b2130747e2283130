// Text file: the whole of a small file that people write by hand: scenes, sets, legends, tables of classes and of antennas.
// Leaves what its lines mean to whoever reads it, and long tables, line by line, to table_file.hpp.
#pragma once
#include <cstddef>
#include <string>
#include <string_view>

namespace wedgescope {

/// `subject`: of the messages ("scene file 'x.ini'"); `holds`: what so large a file cannot be ("it holds a line for each class").
/// IoError where it is a folder or cannot be read; InputError where it is larger than `most_mib` or no text.
std::string text_of_file(const std::string& subject, const std::string& path, std::string_view holds,
                         std::size_t most_mib = 1);

}  // namespace wedgescope
