// Models: the table of what `evaluate` can compute, a family a file (models_*.cpp). A model more is an entry more.
#pragma once
#include <string>
#include <vector>

#include "tools/model.hpp"

namespace wedgescope {

struct ModelFamily {
    const char* title;
    std::vector<Model> models;
};
/// Made at the first call.
const std::vector<ModelFamily>& model_table();
/// Names and summaries by family, for people.
std::string model_list();
/// InputError with the nearest model.
const Model& model_by_name(std::string_view name);

// The families.
std::vector<Model> geometry_models();
std::vector<Model> antenna_models();
std::vector<Model> radar_models();
std::vector<Model> surface_models();
std::vector<Model> atmosphere_models();
std::vector<Model> statistics_models();

}  // namespace wedgescope
