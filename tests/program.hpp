// Programs started by a test, as a shell would: what they wrote, how they ended and what they held at the most.
#pragma once
#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace wedgescope::test {

struct Ended {
    int code = 0;                      ///< exit code, or 128 + signal
    std::string err;                   ///< standard error
    std::uint64_t peak_rss_bytes = 0;  ///< of the program, or of this one if that held more
};

/// Starts `arguments` (the first is the program's path); standard error goes to `error_path`, standard output to `output_path`;
/// standard input is the test's unless `input_path` names a file.
inline pid_t start(const std::vector<std::string>& arguments, const std::string& error_path,
                   const std::string& output_path = "/dev/null", const std::string& input_path = "") {
    std::vector<char*> words;
    for (const std::string& word : arguments) words.push_back(const_cast<char*>(word.c_str()));
    words.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (!input_path.empty()) posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, input_path.c_str(), O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, error_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    pid_t child = 0;
    const int failed = posix_spawn(&child, words[0], &actions, nullptr, words.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failed) throw std::runtime_error("cannot start " + arguments[0]);
    return child;
}

inline Ended wait_for(pid_t child, const std::string& error_path) {
    int status = 0;
    rusage usage{};
    if (wait4(child, &status, 0, &usage) != child) throw std::runtime_error("cannot wait");
    Ended ended;
    ended.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    std::ostringstream all;
    all << std::ifstream(error_path, std::ios::binary).rdbuf();
    ended.err = all.str();
    ended.peak_rss_bytes = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
    return ended;
}

inline Ended run_program(const std::vector<std::string>& arguments, const std::string& error_path) {
    return wait_for(start(arguments, error_path), error_path);
}

}  // namespace wedgescope::test
