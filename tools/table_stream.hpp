// The bytes of a table that a command reads from front to end: a file, a pipe, standard input.
#pragma once
#include <array>
#include <istream>
#include <streambuf>
#include <string>

#include "lib/stop.hpp"

namespace wedgescope {

/// A pipe or a terminal may keep its reader waiting; a request to stop ends the wait.
class TableBytes : public std::streambuf {
public:
    /// Of standard input where the path is "-". `subject`: for messages ("track 'x.csv'"). IoError.
    TableBytes(const std::string& path, std::string subject, const Stop& stop);
    ~TableBytes() override;
    TableBytes(const TableBytes&) = delete;
    TableBytes& operator=(const TableBytes&) = delete;

private:
    int_type underflow() override;

    std::string subject_;
    const Stop& stop_;
    int in_ = 0, own_ = -1;
    std::array<char, 65536> buffer_{};
};

/// Reading throws IoError and, when asked to stop, Interrupted.
class TableStream : private TableBytes, public std::istream {
public:
    TableStream(const std::string& path, std::string subject, const Stop& stop)
        : TableBytes(path, std::move(subject), stop), std::istream(static_cast<TableBytes*>(this)) {
        exceptions(std::ios::badbit);  // what reading throws goes through
    }
};

}  // namespace wedgescope
