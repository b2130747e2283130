#include "tools/command_line.hpp"

#include <algorithm>
#include <boost/program_options.hpp>
#include <filesystem>
#include <system_error>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tools/command_table.hpp"
#include "tools/near_words.hpp"

namespace po = boost::program_options;

namespace wedgescope {
namespace {

constexpr const char* one_word = "two numbers are one word, as in --latlon 40.5,-117.8 or --sector -45deg,45deg";

/// Does it look like a number, with a unit or without: what was to be a part of a value before it?
bool is_quantity(const std::string& word) {
    const std::size_t digits = word.find_first_not_of("+-.");
    if (digits > 2 || digits == std::string::npos || word[digits] < '0' || word[digits] > '9') return false;
    const std::size_t unit = std::min(word.find_first_not_of("0123456789.eE+-", digits), word.size());
    if (word[unit - 1] == '.') return false;  // an ending
    return std::all_of(word.begin() + static_cast<std::ptrdiff_t>(unit), word.end(),
                       [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); });
}

/// Is that flag there, and not off? What a command line takes may depend on it, so before it is read.
bool has_flag(const std::vector<std::string>& arguments, const std::string& flag) {
    bool on = false;
    for (const std::string& word : arguments) {
        if (word == "--") break;  // files from here on
        if (word == flag) on = true;
        if (word.starts_with(flag + "=")) on = parse_switch(flag, word.substr(flag.size() + 1));
    }
    return on;
}

/// In words of our own, so that a value that looks like an option (-3dB) stays a value.
[[noreturn]] void refuse_unknown(std::string_view option, const CommandInfo& info, unsigned taken) {
    std::string_view word = option;
    while (word.starts_with('-')) word.remove_prefix(1);
    word = word.substr(0, word.find('='));
    const std::string_view written = option.substr(0, option.find('='));
    if (const Key* key = find_key(word); key && (key->commands & taken) && !option.starts_with("--"))
        throw InputError(text("option ", in_quotes(written), " has one dash; did you mean --", word, "?"));
    const std::string_view digits = word.substr(word.starts_with('.') ? 1 : 0);
    if (!digits.empty() && digits.front() >= '0' && digits.front() <= '9')
        throw InputError(text(in_quotes(option), " is no option; ", one_word));
    const std::string owners = whose(word);
    const bool short_output = !option.starts_with("--") && word.starts_with('o') &&
                              (word.size() == 1 || word.find('.') != std::string_view::npos),
               a_file = (taken & (command_coverage | command_tile | command_info)) &&
                        (word == "dem" || word == "output" || short_output);
    std::vector<std::string> known;
    for (const Key& key : key_table())
        if (key.commands & taken) known.push_back(key.name);
    throw InputError(text("unknown option ", in_quotes(written),
                          a_file           ? text("; files are named without an option: ", info.usage)
                          : owners.empty() ? suggestion(word, known, "--")
                                           : owners,
                          " (wedgescope help ", info.name, " lists them all)"));
}

/// The flag that is written so, --quiet or -q.
const Key* flag_named(std::string_view option, unsigned commands) {
    for (const Key& key : key_table()) {
        if (!key.value.empty() || !(key.commands & commands)) continue;
        if (option == "--" + key.name || (key.letter && option == std::string{'-', key.letter})) return &key;
    }
    return nullptr;
}

/// Takes the flags with a value behind '=' out of the arguments: Boost knows flags only without, or with the next word
/// too.
std::vector<std::string> without_valued_flags(const std::vector<std::string>& arguments, const CommandInfo& info,
                                              unsigned taken, std::vector<Given>& given) {
    std::vector<std::string> words;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        const std::string& word = arguments[i];
        if (word == "--") {
            words.insert(words.end(), arguments.begin() + static_cast<std::ptrdiff_t>(i), arguments.end());
            break;
        }
        if (word.starts_with("--=")) refuse_unknown(word, info, taken);  // a file to Boost
        const auto equals = word.find('=');
        const Key* flag = equals == std::string::npos ? nullptr : flag_named(word.substr(0, equals), taken);
        if (flag) {
            given.push_back({flag->name, word.substr(equals + 1), "--" + flag->name, ""});
        } else {
            words.push_back(word);
        }
    }
    return words;
}

po::options_description descriptions(unsigned commands) {
    po::options_description all;
    for (const Key& key : key_table()) {
        if (!(key.commands & commands)) continue;
        const std::string name = key.letter ? key.name + "," + key.letter : key.name;
        auto* value = po::value<std::string>();
        if (key.value.empty()) value->zero_tokens();
        all.add_options()(name.c_str(), value, key.help.c_str());
    }
    return all;
}

/// What Boost could not understand, as the user wrote it.
std::string original_word(po::error_with_option_name error) {
    error.m_error_template = "%original_token%";
    return error.what();
}

/// Of a known option that is written as it may not be.
[[noreturn]] void refuse_syntax(const po::invalid_command_line_syntax& e, const CommandInfo& info, unsigned taken) {
    const std::string name = e.get_option_name();
    if (e.kind() == po::invalid_syntax::missing_parameter) throw InputError(text("option ", name, " needs a value"));
    if (e.kind() == po::invalid_syntax::empty_adjacent_parameter)
        throw InputError(text("option ", name, " needs a value after '='"));
    // A flag's letter, and more behind it.
    const std::string written = original_word(e);
    if (find_key(written.substr(1))) refuse_unknown(written, info, taken);
    const std::string letter = written.substr(0, 2);
    throw InputError(text("option ", in_quotes(written), " cannot be understood; accepted: ", letter, ", ", letter,
                          "=on or ", letter, "=off, and each option a word of its own"));
}

Given given_by(const po::option& option) {
    const std::string& name = option.string_key;
    const char letter = find_key(name)->letter;
    for (const std::string& token : option.original_tokens) {
        // The parser takes `-overwrite` for `-o verwrite`; nobody means that.
        if (letter && token.size() > 2 && token[0] == '-' && token[1] == letter && find_key(token.substr(1)))
            throw InputError(text("option ", in_quotes(token), " has one dash; did you mean -", token, "?"));
    }
    const std::string value = option.value.empty() ? "on" : option.value[0];
    if (value.starts_with("--") && find_key(value.substr(2)))
        throw InputError(text("option --", name, " needs a value"));
    return {name, value, "--" + name, ""};
}

/// Options and files to the ends of `line`.
void split_words(const std::vector<std::string>& words, const CommandInfo& info, unsigned taken, CommandLine& line) {
    using namespace po::command_line_style;
    const po::options_description known = descriptions(taken);
    try {
        const auto parsed = po::command_line_parser(words)
                                .options(known)
                                .style(allow_long | long_allow_adjacent | long_allow_next | allow_short |
                                       short_allow_adjacent | short_allow_next | allow_dash_for_short)
                                .run();
        for (const po::option& option : parsed.options) {
            if (option.string_key.empty())
                line.files.insert(line.files.end(), option.value.begin(), option.value.end());
            else
                line.given.push_back(given_by(option));
        }
    } catch (const po::unknown_option& e) {
        refuse_unknown(e.get_option_name(), info, taken);
    } catch (const po::invalid_command_line_syntax& e) {
        refuse_syntax(e, info, taken);
    } catch (const po::error& e) {
        throw InputError(e.what());
    }
}

void refuse_repeated(const std::vector<Given>& given) {
    for (std::size_t i = 0; i < given.size(); ++i) {
        for (std::size_t j = i + 1; j < given.size(); ++j) {
            if (given[i].key != given[j].key || find_key(given[i].key)->repeatable) continue;
            if (given[i].origin == given[j].origin)
                throw InputError(text("option ", given[i].origin, " is given twice"));
            throw InputError(text(given[j].origin, " is given beside ", given[i].origin, "; both say ", given[i].key,
                                  ", and one of them alone may be given"));
        }
    }
}

}  // namespace

unsigned keys_taken(Command command, const std::vector<std::string>& arguments) {
    if (command == command_scope) return command_scope | command_simulate;
    const bool plan = command == command_info && has_flag(arguments, "--plan");
    return plan ? command_info | command_simulate : static_cast<unsigned>(command);
}

CommandLine read_command_line(Command command, const std::vector<std::string>& arguments,
                              const std::vector<Given>& more) {
    const unsigned taken = keys_taken(command, arguments);
    const CommandInfo& info = info_of(command);
    CommandLine line{more, {}};
    split_words(without_valued_flags(arguments, info, taken, line.given), info, taken, line);
    refuse_repeated(line.given);
    for (const std::string& file : line.files)
        if (!file.empty() && trimmed(file).empty())
            throw InputError(text("a path is ", in_quotes(file), ", nothing but blanks"));
    return line;
}

void refuse_quantities(const std::vector<std::string>& files) {
    std::error_code error;
    for (const std::string& file : files)
        if (is_quantity(file) && !std::filesystem::exists(file, error))
            throw InputError(text(in_quotes(file), " is no file; ", one_word));
}

}  // namespace wedgescope
