// Errors: what went wrong, in one line that names the object, what was found, and what is accepted.
// Leaves exit codes to tools/main.cpp, which alone turns an error into one.
#pragma once
#include <fmt/format.h>

#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>

namespace wedgescope {

/// Base of every error a user may cause. what() is one line without a trailing full stop.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// An option or a scene key: exit code 2.
class InputError : public Error {
public:
    using Error::Error;
};

/// A memory budget that does not do. `subject`: what needs more ("this scene"); `about`: what follows on the line.
class TooLittleMemory : public InputError {
public:
    TooLittleMemory(std::size_t budget, std::size_t least, const std::string& subject, const std::string& about = "")
        : InputError(fmt::format("memory is {} MiB; {} needs at least {} MiB{}", budget >> 20, subject,
                                 (least + (std::size_t{1} << 20) - 1) >> 20, about)),
          subject_(subject), about_(about) {}
    /// The same with another smallest budget.
    TooLittleMemory with(std::size_t budget, std::size_t least) const { return {budget, least, subject_, about_}; }

private:
    std::string subject_, about_;
};

/// The content of a raster or of another input file: exit code 1.
class DataError : public Error {
public:
    using Error::Error;
};

/// The machine: a file that cannot be opened, read or written; memory; disk: exit code 1.
class IoError : public Error {
public:
    using Error::Error;
};

/// SIGINT or SIGTERM: exit code 128 + signal.
class Interrupted : public Error {
public:
    /// `more`: what follows on the line.
    explicit Interrupted(int signal, const std::string& more = "")
        : Error(fmt::format("stopped by signal {}{}", signal, more)), signal_(signal) {}
    int signal() const { return signal_; }

private:
    int signal_;
};

/// The pieces of a message, written after one another: text("row ", 3, " of ", 7).
/// Numbers are written in the shortest form that reads back the same, whatever the locale.
template <class... Pieces>
std::string text(const Pieces&... pieces) {
    std::string out;
    (fmt::format_to(std::back_inserter(out), "{}", pieces), ...);
    return out;
}

/// Runs `body`; an Error that leaves it gets `context` in front of its message and keeps its type.
template <class Body>
auto with_context(const std::string& context, Body&& body) -> decltype(body()) {
    try {
        return std::forward<Body>(body)();
    } catch (const InputError& e) {
        throw InputError(context + ": " + e.what());
    } catch (const DataError& e) {
        throw DataError(context + ": " + e.what());
    } catch (const IoError& e) {
        throw IoError(context + ": " + e.what());
    }
}

}  // namespace wedgescope
