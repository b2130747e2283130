// Terminal: what the program says on stderr while it works: progress in GDAL's habit, remarks, one-line errors.
// Leaves results to stdout and the commands.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

namespace wedgescope {

/// `0...10...20...` on stderr; silent where that is no terminal or `quiet`.
class Progress {
public:
    explicit Progress(bool quiet);
    ~Progress();  ///< ends a line that stopped half-way
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    void report(double fraction);
    void done();

private:
    bool on_ = false;
    int ticks_ = -1;  ///< printed so far, of 40
};

/// One line on stderr, unless `quiet`.
void remark(bool quiet, std::string_view line);

/// Lines of a table on stderr; like a remark nothing fails where nobody can read them.
void say_as_it_is(const std::string& lines);

/// The same for why something that lies there and might serve is not used; nothing where `why` is empty.
void remark_unused(bool quiet, const std::string& why);
/// What it says.
std::string unused_line(const std::string& why);

/// The message as one line without control characters.
std::string one_line(std::string_view message);

/// Writes to stdout; IoError if that fails (a full disk, a closed pipe).
void print(std::string_view result);

/// 1234567 -> "1.2 MiB"; for people.
std::string readable_bytes(double bytes);
/// 1234567 -> "1 234 567".
std::string grouped(std::uint64_t number);
/// "1 sheet", "1 234 sheets".
std::string counted(std::uint64_t number, std::string_view noun);

}  // namespace wedgescope
