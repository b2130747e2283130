#include "tools/models.hpp"

#include <fmt/format.h>

#include "tools/help.hpp"
#include "tools/near_words.hpp"

namespace wedgescope {

const std::vector<ModelFamily>& model_table() {
    static const std::vector<ModelFamily> table = {{"Geometry", geometry_models()},
                                                   {"Antenna", antenna_models()},
                                                   {"Radar equation, receiver and display", radar_models()},
                                                   {"Land and water", surface_models()},
                                                   {"Atmosphere and weather", atmosphere_models()},
                                                   {"Statistics", statistics_models()}};
    return table;
}

std::string model_list() {
    std::string out;
    for (const ModelFamily& family : model_table()) {
        out += text(out.empty() ? "" : "\n", family.title, "\n");
        for (const Model& model : family.models)
            out += fmt::format("  {:<18} {}\n", model.name, wrapped(model.summary, 21));
    }
    return out;
}

const Model& model_by_name(std::string_view name) {
    std::vector<std::string> names;
    for (const ModelFamily& family : model_table())
        for (const Model& model : family.models) {
            if (model.name == name) return model;
            names.push_back(model.name);
        }
    throw InputError(text("unknown model ", in_quotes(name), suggestion(name, names),
                          " (wedgescope evaluate --list names them all)"));
}

}  // namespace wedgescope
