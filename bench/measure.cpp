// Runs a command and tells what it took: measure RESULT COMMAND... writes one line to the file RESULT,
//   wall seconds, user seconds, system seconds, peak resident KiB
// and leaves with the command's own exit code. The peak is that of the largest process, as the kernel counts it.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <memory>

namespace {

double seconds(const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) {
        fmt::print(stderr, "usage: measure RESULT COMMAND...\n");
        return 2;
    }
    const auto begin = std::chrono::steady_clock::now();
    const pid_t child = fork();
    if (child < 0) {
        std::perror("measure: fork");
        return 1;
    }
    if (child == 0) {
        execvp(argv[2], argv + 2);
        std::perror(argv[2]);
        _exit(127);
    }
    int status = 0;
    rusage used{};
    if (wait4(child, &status, 0, &used) != child) {
        std::perror("measure: wait4");
        return 1;
    }
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(argv[1], "w"), std::fclose);
    if (!file) {
        std::perror(argv[1]);
        return 1;
    }
    fmt::print(file.get(), "{:.3f} {:.3f} {:.3f} {}\n", wall.count(), seconds(used.ru_utime), seconds(used.ru_stime),
               used.ru_maxrss);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}
