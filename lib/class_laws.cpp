#include "lib/class_laws.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lib/error.hpp"
#include "lib/rounding.hpp"

namespace wedgescope {

namespace {

/// What a model refuses, with the key that asks for it in front.
template <class Law>
auto asked_by(const char* key, const Law& law) {
    try {
        return law();
    } catch (const InputError& error) {
        throw InputError(text(key, ": ", error.what()));
    }
}

BackscatterLaw bare_law(const Material& material, const ClassLawParams& params) {
    if (params.gamma || material.gamma10_db) {
        if (!params.gamma && params.land != LandModel::constant_gamma) {
            BackscatterLaw law =
                asked_by(params.land == LandModel::oh ? "backscatter oh" : "backscatter ulaby-dobson",
                         [&] { return ground_law(material, params.land, params.frequency_hz, params.polarisation); });
            if (!law.gamma()) return law;
        }
        const Decibel gamma10 = params.gamma ? *params.gamma : Decibel(*material.gamma10_db);
        const double gamma = gamma_at(gamma10, params.frequency_hz).ratio();
        return BackscatterLaw::constant_gamma(params.polarisation == Polarisation::circular
                                                  ? rounded_significand(gamma / circular_loss.ratio(), 24)
                                                  : gamma);
    }
    if (params.water == WaterModel::calm)
        return asked_by("water calm", [&] { return sea_calm_law(params.frequency_hz, params.polarisation); });
    return asked_by("sea-state",
                    [&] { return sea_nrl_law(params.frequency_hz, params.polarisation, params.sea_state); });
}

/// Do structures add to what its ground returns?
bool has_statistical_walls(const Material& m, const ClassLawParams& params) {
    return params.walls == Walls::statistical && !params.gamma && m.structures && (m.gamma_wall10_db || m.gamma10_db);
}

}  // namespace

BackscatterLaw class_law(const Material& material, const ClassLawParams& params) {
    BackscatterLaw ground = bare_law(material, params);
    if (!has_statistical_walls(material, params)) return ground;
    const Decibel gamma10(material.gamma_wall10_db ? *material.gamma_wall10_db : *material.gamma10_db);
    double walls = gamma_at(gamma10, params.frequency_hz).ratio() * material.structures->walls();
    if (params.polarisation == Polarisation::circular) walls /= circular_wall_loss.ratio();
    const std::optional<Angle> corner = ground.corner();
    return BackscatterLaw(
        [ground = std::move(ground), walls](Angle grazing) {
            return ground.factor(grazing) * std::sin(grazing.rad()) + walls * std::cos(grazing.rad());
        },
        least_grazing, corner);
}

bool may_need_facets(const ClassLawParams& params) {
    if (params.gamma) return false;
    if (params.land != LandModel::constant_gamma || params.water == WaterModel::calm || params.sea_state > 0)
        return true;
    const std::vector<Material>& materials = params.materials.rows();
    return std::any_of(materials.begin(), materials.end(),
                       [&](const Material& m) { return has_statistical_walls(m, params); });
}

bool may_be_windy(const ClassLawParams& params) {
    return params.wind_from && !params.gamma && params.water == WaterModel::nrl && params.sea_state > 0;
}

bool may_be_directional(const ClassLawParams& params) {
    const std::vector<Material>& materials = params.materials.rows();
    if (may_be_windy(params)) return true;
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
            facings_.push_back(
                {m.directivity, rounded(std::sin(axis), 40), rounded(std::cos(axis), 40), is_of_water(m)});
        }
    if (may_be_windy(params)) {
        windy_ = true;
        wind_ = WindTable(params.frequency_hz);
        upwind_east_ = rounded(std::sin(params.wind_from->rad()), 40);
        upwind_north_ = rounded(std::cos(params.wind_from->rad()), 40);
    }
    std::vector<BackscatterTable> tables;
    std::vector<bool> water;
    for (const Material& material : materials) {
        tables.emplace_back(class_law(material, params));
        water.push_back(is_of_water(material));
    }
    keep(tables, water);
}

namespace {

double turn_of(const BackscatterTable& table) {
    // Where it returns at least 1/e of its most, from the vertical to 45 degrees. A Gaussian lobe exp(-(s / w)^2) is steepest at
    // its width w, by 2 / w.
    constexpr double step = 0.005, to = 0.7, least = 0.37, part_of_gaussian = 0.8, widest = 0.25;
    const auto factor = [&](double sine_of_incidence) {
        return table.at(std::sqrt(1 - sine_of_incidence * sine_of_incidence));
    };
    double most = 0, steepest = 0;
    for (double s = 0; s < to; s += step) most = std::max(most, factor(s));
    if (!(most > 0)) return infinite;
    for (double s = 0; s + step < to; s += step) {
        const double a = factor(s), b = factor(s + step);
        if (a >= least * most && b >= least * most) steepest = std::max(steepest, std::abs(std::log(b / a)) / step);
    }
    const double turn = part_of_gaussian / steepest;
    return turn < widest ? rounded_significand(turn, 8) : infinite;
}

}  // namespace

void ClassLaws::keep(const std::vector<BackscatterTable>& tables, const std::vector<bool>& water) {
    bool all_constant = true;
    for (std::size_t id = 0; id < tables.size(); ++id) {
        gamma_[id].ground = tables[id].most();
        all_constant = all_constant && tables[id].constant();
        most_ = std::max(most_, tables[id].most() * (water[id] ? wind_.most() : 1));
        error_db_ = std::max(error_db_, tables[id].error_db());
        if (!tables[id].constant()) most_turn_ = std::min(most_turn_, turn_of(tables[id]));
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

ClassLaws ClassLaws::areas(const std::vector<bool>& ground, const std::vector<bool>& walls) {
    std::vector<ClassGamma> gamma(ground.size(), ClassGamma{});
    for (std::size_t id = 0; id < gamma.size(); ++id) gamma[id].wall = walls.at(id) ? 1 : 0;
    ClassLaws laws(std::move(gamma));
    if (std::find(ground.begin(), ground.end(), true) == ground.end()) return laws;
    static const BackscatterTable unit(BackscatterLaw([](Angle) { return 1.0; }, least_area_grazing)),
        none(BackscatterLaw::constant_gamma(0));
    std::vector<BackscatterTable> tables;
    for (const bool some : ground) tables.push_back(some ? unit : none);
    laws.keep(tables, std::vector<bool>(ground.size(), false));
    return laws;
}

}  // namespace wedgescope
