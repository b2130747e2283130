#include "tests/json.hpp"

#include "tests/file_content.hpp"

template class nlohmann::basic_json<>;

namespace wedgescope::test {

nlohmann::json json_of(const std::string& text) { return nlohmann::json::parse(text); }
nlohmann::json json_in(const std::filesystem::path& file) { return json_of(content(file)); }

}  // namespace wedgescope::test
