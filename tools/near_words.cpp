#include "tools/near_words.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

std::size_t edits(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t corner = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = corner + (a[i - 1] != b[j - 1]);
            corner = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
        }
    }
    return row[b.size()];
}

std::optional<std::string> nearest(std::string_view word, const std::vector<std::string>& words) {
    if (word.empty() || word.size() > 64) return std::nullopt;
    const std::string* best = nullptr;
    std::size_t best_cost = std::max<std::size_t>(1, word.size() / 3) + 1;
    for (const std::string& candidate : words) {
        const std::size_t cost = edits(word, candidate);
        if (cost < best_cost) {
            best = &candidate;
            best_cost = cost;
        }
    }
    // A beginning that only one word has counts as near too.
    if (!best && word.size() >= 3) {
        for (const std::string& candidate : words) {
            if (!candidate.starts_with(word)) continue;
            best = &candidate;
            break;
        }
    }
    return best ? std::optional(*best) : std::nullopt;
}

}  // namespace

std::string suggestion(std::string_view word, const std::vector<std::string>& known, const char* prefix) {
    const auto near = nearest(word, known);
    return near ? text("; did you mean ", prefix, *near, "?") : std::string();
}

}  // namespace wedgescope
