// The bytes of a file, to be compared.
#pragma once
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace wedgescope::test {

inline std::string content(const std::filesystem::path& path) {
    std::ostringstream all;
    all << std::ifstream(path, std::ios::binary).rdbuf();
    return all.str();
}

}  // namespace wedgescope::test
