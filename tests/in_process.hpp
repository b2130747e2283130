// The program's commands inside a test: what they print and how they end, as of a process, without starting one. What hangs on the
// process itself (memory, pipes, signals, the helper beside the program) is for program.hpp.
#pragma once
#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/program.hpp"
#include "tools/program.hpp"

namespace wedgescope::test {

/// While it lives, what goes to a file descriptor goes to a file instead.
class Redirected {
public:
    Redirected(int descriptor, std::FILE* stream, const std::string& path)
        : descriptor_(descriptor), stream_(stream), before_(::dup(descriptor)) {
        std::fflush(stream_);
        const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        if (before_ < 0 || file < 0 || ::dup2(file, descriptor_) < 0) throw std::runtime_error("cannot write " + path);
        ::close(file);
    }
    ~Redirected() {
        std::fflush(stream_);
        ::dup2(before_, descriptor_);
        ::close(before_);
    }
    Redirected(const Redirected&) = delete;
    Redirected& operator=(const Redirected&) = delete;

private:
    int descriptor_;
    std::FILE* stream_;
    int before_;
};

/// `words`: behind the program's name.
inline Ended run_here(const std::vector<std::string>& words, const std::string& error_path,
                      const std::string& output_path = "/dev/null") {
    Ended ended;
    std::cout.flush();
    std::cerr.flush();
    {
        const Redirected out(STDOUT_FILENO, stdout, output_path), err(STDERR_FILENO, stderr, error_path);
        Stop stop;
        ended.code = run_words(words, stop);
    }
    std::ostringstream all;
    all << std::ifstream(error_path, std::ios::binary).rdbuf();
    ended.err = all.str();
    return ended;
}

}  // namespace wedgescope::test
