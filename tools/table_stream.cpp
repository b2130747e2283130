#include "tools/table_stream.hpp"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <utility>

#include "lib/error.hpp"

namespace wedgescope {

TableBytes::TableBytes(const std::string& path, std::string subject, const Stop& stop)
    : subject_(std::move(subject)), stop_(stop) {
    if (path == "-") return;
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) throw IoError(text(subject_, " is a folder"));
    own_ = in_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe needs no writer yet
    if (own_ < 0) throw IoError(text(subject_, " cannot be opened: ", system_reason(errno)));
}

TableBytes::~TableBytes() {
    if (own_ >= 0) ::close(own_);
}

TableBytes::int_type TableBytes::underflow() {
    constexpr int look_ms = 100;  // a signal ends poll, but not one just before it
    for (;;) {
        stop_.check();
        pollfd input{in_, POLLIN, 0};
        const int ready = ::poll(&input, 1, look_ms);
        if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
        const ssize_t got = ::read(in_, buffer_.data(), buffer_.size());
        if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
        if (got < 0) throw IoError(text(subject_, " cannot be read: ", system_reason(errno)));
        setg(buffer_.data(), buffer_.data(), buffer_.data() + got);
        return got == 0 ? traits_type::eof() : traits_type::to_int_type(buffer_[0]);
    }
}

}  // namespace wedgescope
