#include "lib/class_laws.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lib/error.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {

BackscatterLaw class_law(const Material& material, const ClassLawParams& params) {
    if (params.gamma || material.gamma10_db) {
        if (!params.gamma && params.land != LandModel::constant_gamma) {
            BackscatterLaw law = ground_law(material, params.land, params.frequency_hz, params.polarisation);
            if (!law.gamma()) return law;
        }
        const Decibel gamma10 = params.gamma ? *params.gamma : Decibel(*material.gamma10_db);
        const double gamma = gamma_at(gamma10, params.frequency_hz).ratio();
        return BackscatterLaw::constant_gamma(params.polarisation == Polarisation::circular
                                                  ? rounded_significand(gamma / circular_loss.ratio(), 24)
                                                  : gamma);
    }
    return params.water == WaterModel::nrl ? sea_nrl_law(params.frequency_hz, params.polarisation, params.sea_state)
                                           : sea_calm_law(params.frequency_hz, params.polarisation);
}

bool may_need_facets(const ClassLawParams& params) {
    return !params.gamma &&
           (params.land != LandModel::constant_gamma || params.water == WaterModel::calm || params.sea_state > 0);
}

bool may_be_directional(const ClassLawParams& params) {
    const std::vector<Material>& materials = params.materials.rows();
    return !params.gamma && std::any_of(materials.begin(), materials.end(),
                                        [](const Material& m) { return m.directivity != Directivity::omni; });
}

ClassLaws::ClassLaws(std::vector<ClassGamma> gamma) : gamma_(std::move(gamma)) {
    for (const ClassGamma& g : gamma_) most_ = std::max({most_, g.ground, g.wall});
}

ClassLaws::ClassLaws(const ClassLawParams& params)
    : ClassLaws([&] {
          std::vector<ClassGamma> gamma = gamma_table(params.materials, params.frequency_hz, params.gamma);
          if (params.polarisation == Polarisation::circular)
              for (ClassGamma& g : gamma)  // one gamma for everything stays one
                  g.wall =
                      rounded_significand(g.wall / (params.gamma ? circular_loss : circular_wall_loss).ratio(), 24);
          return gamma;
      }()) {
    const std::vector<Material>& materials = params.materials.rows();
    if (may_be_directional(params))
        for (const Material& m : materials) {
            const double axis = Angle::degrees(m.axis_deg).rad();
            facings_.push_back({m.directivity, rounded(std::sin(axis), 40), rounded(std::cos(axis), 40)});
        }
    std::vector<BackscatterTable> tables;
    for (const Material& material : materials) tables.emplace_back(class_law(material, params));
    keep(tables);
}

void ClassLaws::keep(const std::vector<BackscatterTable>& tables) {
    bool all_constant = true;
    for (std::size_t id = 0; id < tables.size(); ++id) {
        gamma_[id].ground = tables[id].most();
        all_constant = all_constant && tables[id].constant();
        most_ = std::max(most_, tables[id].most());
        error_db_ = std::max(error_db_, tables[id].error_db());
    }
    if (all_constant) return;
    for (const BackscatterTable& table : tables) {
        rows_.push_back({entries_.size(), table.intervals() - 1, table.begin(), table.scale()});
        if (const auto gamma = table.constant())
            entries_.insert(entries_.end(), 2, *gamma);  // not rounded to float, as the same gamma alone
        else
            entries_.insert(entries_.end(), table.data(), table.data() + table.intervals() + 1);
    }
}

ClassLaws ClassLaws::only(const std::vector<bool>& ground, const std::vector<bool>& walls) const {
    if (ground.size() != gamma_.size() || walls.size() != gamma_.size())
        throw Error(
            text("laws of ", gamma_.size(), " classes, asked for some of ", ground.size(), " and ", walls.size()));
    ClassLaws some = *this;
    for (std::size_t id = 0; id < gamma_.size(); ++id) {
        if (!walls[id]) some.gamma_[id].wall = 0;
        if (ground[id]) continue;
        some.gamma_[id].ground = 0;
        if (constant()) continue;
        const std::size_t end = id + 1 < rows_.size() ? rows_[id + 1].first : entries_.size();
        for (std::size_t i = rows_[id].first; i < end; ++i) some.entries_[i] = 0;
    }
    return some;
}

ClassLaws ClassLaws::area_of_ground(std::size_t classes, ClassId id) {
    ClassLaws laws(std::vector<ClassGamma>(classes, ClassGamma{}));
    std::vector<BackscatterTable> tables(classes, BackscatterTable(BackscatterLaw::constant_gamma(0)));
    tables.at(id) = BackscatterTable(BackscatterLaw([](Angle) { return 1.0; }, least_grazing));
    laws.keep(tables);
    return laws;
}

ClassLaws ClassLaws::area_of_walls(std::size_t classes, ClassId id) {
    std::vector<ClassGamma> gamma(classes, ClassGamma{});
    gamma.at(id).wall = 1;
    return ClassLaws(std::move(gamma));
}

}  // namespace wedgescope
