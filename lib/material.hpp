// Materials: what the classes of the ground return: which law, with what numbers, walls, names; and the legends
// that turn culture codes into classes.
// Leaves the laws themselves to backscatter.hpp and where a class lies to the wedge source.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lib/backscatter.hpp"
#include "lib/decibel.hpp"

namespace wedgescope {

using ClassId = std::uint8_t;

struct Material {
    const char* name;                                ///< the word the `material` key and legends take
    std::optional<double> gamma10_db;                ///< at 10 GHz; none: returns nothing (calm water)
    std::optional<double> gamma_wall10_db;           ///< of walls; none: as gamma10_db
    std::optional<UlabyDobsonClass> ulaby_dobson{};  ///< none: constant gamma under that model too
    std::optional<BareSoil> bare_soil{};             ///< what Oh's model takes; none: constant gamma under it too
};

/// The models of land that a scene may choose.
enum class LandModel { constant_gamma, ulaby_dobson, oh };

/// The project's class table (physics 7.4), index = ClassId.
const std::vector<Material>& material_table();
/// InputError naming the accepted words.
ClassId material_by_name(const std::string& key, const std::string& name);

/// What shading needs of a class at one frequency: linear gamma of ground and of walls.
struct ClassGamma {
    double ground = 0;
    double wall = 0;
};
/// gamma10 + 5 log10(f / 10 GHz) for every class (physics 4.1); `constant` (the key `gamma`,
/// at 10 GHz) replaces all of them, walls and water included.
std::vector<ClassGamma> gamma_table(double frequency_hz, std::optional<Decibel> constant);

/// What the ground of a class returns under a model: its constant gamma where the model does not know the class (laws
/// never blend within one), nothing without one. InputError where the model does not reach the frequency.
BackscatterLaw ground_law(const Material& material, LandModel model, double frequency_hz, Polarisation polarisation);

/// Culture code -> class.
class Legend {
public:
    Legend() = default;
    Legend(std::string name, std::map<int, ClassId> classes);
    /// fbfm40, nlcd, worldcover or smc; empty optional for any other word.
    static std::optional<Legend> built_in(const std::string& name);
    /// A CSV text: lines `code,material`, an optional header line, # comments. InputError naming
    /// `source` and the line.
    static Legend from_csv(const std::string& source, const std::string& content);

    const std::string& name() const { return name_; }
    std::optional<ClassId> find(int code) const;
    const std::map<int, ClassId>& classes() const { return classes_; }

private:
    std::string name_;
    std::map<int, ClassId> classes_;
};

}  // namespace wedgescope
