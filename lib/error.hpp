// Errors: what went wrong, in one line that names the object, what was found, and what is accepted.
// Leaves exit codes to tools/program.cpp, which alone turns an error into one.
#pragma once
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace wedgescope {

/// What a message is made of: words, a character or a number. Holds a view of the words.
class MessagePart {
public:
    MessagePart(const std::string& words) : value_(std::string_view(words)) {}
    MessagePart(const char* words) : value_(std::string_view(words ? words : "")) {}
    MessagePart(std::string_view words) : value_(words) {}
    template <class Number>
    requires std::is_arithmetic_v<Number> MessagePart(Number number) {
        if constexpr (std::is_same_v<Number, bool>)
            value_ = std::string_view(number ? "true" : "false");
        else if constexpr (std::is_floating_point_v<Number> || std::is_same_v<Number, char>)
            value_ = number;
        else
            value_ = static_cast<std::conditional_t<std::is_signed_v<Number>, std::int64_t, std::uint64_t>>(number);
    }
    void append_to(std::string& out) const;

private:
    std::variant<std::string_view, char, float, double, std::int64_t, std::uint64_t> value_;
};

/// The parts, written after one another. Numbers are written in the shortest form that reads back the same, whatever the
/// locale.
std::string joined_text(std::initializer_list<MessagePart> parts);

/// The parts of a message: text("row ", 3, " of ", 7). Hundreds of places call it, each with types of its own: hardly a
/// line to instantiate.
template <class... Parts>
std::string text(const Parts&... parts) {
    return joined_text({parts...});
}

/// A user's text as it may stand in a one-line message: in quotes, control characters shown as ?, cut when long.
std::string in_quotes(std::string_view words);

/// Names in quotes: "'a', 'b' and 5 more", of not more than eight.
std::string listed_names(const std::vector<std::string>& names);

/// What errno, or an error that a call returned, says of itself. From any thread.
std::string system_reason(int error);

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
        : InputError(text("memory is ", budget >> 20 > 0 ? text(budget >> 20, " MiB") : text(budget, " bytes"), "; ",
                          subject, " needs at least ", (least + (std::size_t{1} << 20) - 1) >> 20, " MiB", about)),
          subject_(subject), about_(about) {}
    /// The same with another smallest budget.
    TooLittleMemory with(std::size_t budget, std::size_t least) const {
        TooLittleMemory other(budget, least, subject_, about_);
        return context_.empty() ? other : other.within(context_);
    }
    /// The same with `context` in front of the message.
    TooLittleMemory within(const std::string& context) const {
        const std::string all = context_.empty() ? context : text(context, ": ", context_);
        return {text(context, ": ", what()), subject_, about_, all};
    }

private:
    TooLittleMemory(const std::string& message, const std::string& subject, const std::string& about,
                    const std::string& context)
        : InputError(message), subject_(subject), about_(about), context_(context) {}
    std::string subject_, about_, context_;
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

/// A signal that ends the run (SIGINT, SIGTERM and the like): exit code 128 + signal.
class Interrupted : public Error {
public:
    /// `more`: what follows on the line.
    explicit Interrupted(int signal, const std::string& more = "")
        : Error(text("stopped by signal ", signal, more)), signal_(signal) {}
    int signal() const { return signal_; }

private:
    int signal_;
};

/// Runs `body`; an InputError (TooLittleMemory too), DataError or IoError that leaves it gets `context` in front of its message and
/// stays one of these.
template <class Body>
auto with_context(const std::string& context, Body&& body) -> decltype(body()) {
    try {
        return std::forward<Body>(body)();
    } catch (const TooLittleMemory& e) {
        throw e.within(context);
    } catch (const InputError& e) {
        throw InputError(context + ": " + e.what());
    } catch (const DataError& e) {
        throw DataError(context + ": " + e.what());
    } catch (const IoError& e) {
        throw IoError(context + ": " + e.what());
    }
}

}  // namespace wedgescope
