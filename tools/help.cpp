#include "tools/commands.hpp"
#include "tools/options.hpp"
#include "tools/terminal.hpp"
#include "tools/units.hpp"

namespace wedgescope {

void help(const std::vector<std::string>& arguments) {
    const Settings settings = parse_arguments(command_help, arguments);
    if (settings.help || settings.files.empty()) return print(help_text());
    if (settings.files.size() > 1) throw InputError(text("help takes one command at most; found ", settings.files.size()));
    print(help_text(command_by_name(settings.files[0])));
}

}  // namespace wedgescope
