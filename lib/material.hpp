// Materials: what the classes of the ground return: constant gamma, walls, names; and the legends
// that turn culture codes into classes.
// Leaves where a class lies to the wedge source.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lib/decibel.hpp"

namespace wedgescope {

using ClassId = std::uint8_t;

struct Material {
    const char* name;                       ///< the word the `material` key and legends take
    std::optional<double> gamma10_db;       ///< at 10 GHz; none: returns nothing (calm water)
    std::optional<double> gamma_wall10_db;  ///< of walls; none: as gamma10_db
};

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
