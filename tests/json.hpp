// JSON that the program writes, as tests read it: compiled once for all of them.
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

extern template class nlohmann::basic_json<>;

namespace wedgescope::test {

/// nlohmann::json::parse_error where it is none.
nlohmann::json json_of(const std::string& text);
nlohmann::json json_in(const std::filesystem::path& file);

}  // namespace wedgescope::test
