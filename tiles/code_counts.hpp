// CodeCounts: how many cells have each code, exactly while there are no more than most_codes of them. Of more it keeps what is
// the same in whatever order cells were added, by however many threads: how many cells there are, the least code and the
// greatest. So what it holds is bounded, whatever the raster. Leaves what a code means to legends.
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>

namespace wedgescope {

class CodeCounts {
public:
    static constexpr std::size_t most_codes = 16384;  ///< a longer list is read by nobody
    /// At the most, of so many cells of so many bytes each.
    static std::size_t bytes(std::int64_t cells, std::int64_t cell_bytes);

    /// What is kept of more than most_codes.
    static CodeCounts of_too_many(std::uint64_t cells, std::int32_t least, std::int32_t greatest);

    void add(std::int32_t code, std::uint64_t cells);
    void add(const CodeCounts& other);

    bool empty() const { return cells_ == 0; }
    /// Of more than most_codes: which there are is forgotten.
    bool too_many() const { return too_many_; }
    /// By code; none if they are too many.
    const std::map<std::int32_t, std::uint64_t>& counts() const { return counts_; }
    std::uint64_t cells() const { return cells_; }
    /// Unless empty.
    std::int32_t least() const { return least_; }
    std::int32_t greatest() const { return greatest_; }

    friend bool operator==(const CodeCounts&, const CodeCounts&) = default;

private:
    void add_all(std::uint64_t cells, std::int32_t least, std::int32_t greatest);
    void forget();

    std::map<std::int32_t, std::uint64_t> counts_;
    bool too_many_ = false;
    std::uint64_t cells_ = 0;
    std::int32_t least_ = std::numeric_limits<std::int32_t>::max(),
                 greatest_ = std::numeric_limits<std::int32_t>::min();
};

}  // namespace wedgescope
