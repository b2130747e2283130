// Materials: what the classes of the ground return: which law, with what numbers, walls, names; and the legends
// that turn culture codes into classes.
// Leaves the laws themselves to backscatter.hpp and where a class lies to the wedge source.
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lib/backscatter.hpp"
#include "lib/decibel.hpp"
#include "lib/directivity.hpp"

namespace wedgescope {

using ClassId = std::uint8_t;

/// What stands on the ground of a class and is finer than a post, houses or crowns: so many, each as wide as deep, of one height.
struct Structures {
    double number_km2 = 0;  ///< on a square kilometre; above 0, as the others
    double width_m = 0, height_m = 0;
    /// Area of their faces on one side, on a unit of ground.
    double walls() const { return number_km2 * 1e-6 * height_m * width_m; }
    /// Of the ground that they cover.
    double share() const {
        const double covered = number_km2 * 1e-6 * width_m * width_m;
        return covered < 1 ? covered : 1;
    }
    /// Mean height of what is covered and what is not [P].
    double raise_m() const { return share() * height_m; }
    friend bool operator==(const Structures&, const Structures&) = default;
};

struct Material {
    std::string name;                                ///< the word the `material` key and legends take
    std::optional<double> gamma10_db;                ///< at 10 GHz; none: returns nothing (calm water)
    std::optional<double> gamma_wall10_db;           ///< of walls; none: as gamma10_db
    std::optional<UlabyDobsonClass> ulaby_dobson{};  ///< none: constant gamma under that model too
    std::optional<BareSoil> bare_soil{};             ///< what Oh's model takes; none: constant gamma under it too
    Directivity directivity = Directivity::omni;
    double axis_deg = 0;                     ///< of the outward normal, from north, clockwise; of uni and bi
    std::optional<Structures> structures{};  ///< that statistical walls count; none: its walls are resolved
};

/// The models of land that a scene may choose.
enum class LandModel { constant_gamma, ulaby_dobson, oh };

/// A class table, index = ClassId: the shipped one (docs/classes.csv, physics 7.4), or that with rows of a scene's own.
/// Copies share the rows.
class Materials {
public:
    static constexpr std::size_t longest_name = 48;
    static constexpr std::size_t most = 255;  ///< the last ClassId means a code that no legend names

    Materials();  ///< the shipped table
    /// The shipped table with the rows of a CSV text replaced or added: a line of column names (without it those of
    /// docs/classes.csv in their order), then a class a line, # comments. What a row does not give stays as the class has
    /// it; an empty cell is none. Or all of it in one line, `;` between rows (is_inline_table). InputError naming `source`
    /// and the line.
    static Materials from_csv(const std::string& source, std::string_view content);

    /// This table with a row more, or in place of that of its name. InputError where there are `most` already.
    Materials with(const Material& row) const;

    std::size_t size() const { return rows_->size(); }
    const Material& operator[](std::size_t id) const { return (*rows_)[id]; }
    const std::vector<Material>& rows() const { return *rows_; }
    std::optional<ClassId> find(std::string_view name) const;
    /// InputError naming `key` and the accepted words.
    ClassId by_name(const std::string& key, std::string_view name) const;
    /// All names: "water, snow, ...".
    std::string words() const;
    /// In one line, `;` between rows: those that are not as shipped, whole, as from_csv() takes them; empty: none.
    /// Numbers in the shortest form that reads back the same.
    const std::string& own() const { return own_; }

private:
    void take(std::vector<Material> rows);

    std::shared_ptr<const std::vector<Material>> rows_;
    std::string own_;
};

/// Is it a table itself, and no file's name: does it begin with "name," and have rows that end with `;`, in one line?
bool is_inline_table(std::string_view value);

/// The shipped table's rows.
const std::vector<Material>& material_table();
/// Of the shipped table. InputError naming the accepted words.
ClassId material_by_name(const std::string& key, const std::string& name);

/// What shading needs of a class at one frequency: linear gamma of ground and of walls.
struct ClassGamma {
    double ground = 0;
    double wall = 0;
};
/// gamma10 + 5 log10(f / 10 GHz) for every class (physics 4.1); `constant` (the key `gamma`,
/// at 10 GHz) replaces all of them, walls and water included.
std::vector<ClassGamma> gamma_table(const Materials& materials, double frequency_hz, std::optional<Decibel> constant);
/// Of the shipped table.
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
    static Legend from_csv(const std::string& source, const std::string& content, const Materials& materials = {});
    /// And back, materials by their names.
    std::string csv(const Materials& materials) const;

    const std::string& name() const { return name_; }
    std::optional<ClassId> find(int code) const;
    const std::map<int, ClassId>& classes() const { return classes_; }

private:
    std::string name_;
    std::map<int, ClassId> classes_;
};

}  // namespace wedgescope
