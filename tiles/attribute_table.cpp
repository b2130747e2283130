#include "tiles/attribute_table.hpp"

#include <gdal_rat.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <map>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/gdal_handle.hpp"

namespace wedgescope {
namespace {

/// Letters and digits alone, in small letters: "Class_Name" is "classname".
std::string plain(const std::string& words) {
    std::string out;
    for (const unsigned char c : words)
        if (std::isalnum(c)) out += static_cast<char>(std::tolower(c));
    return out;
}

std::string lower(const std::string& words) {
    const auto first = words.find_first_not_of(" \t"), last = words.find_last_not_of(" \t");
    return first == std::string::npos ? "" : lower_case(words.substr(first, last - first + 1));
}

/// -1: none.
int column_of(const GDALRasterAttributeTable& table, GDALRATFieldUsage usage,
              std::initializer_list<const char*> names) {
    const int columns = table.GetColumnCount();
    for (int i = 0; i < columns; ++i)
        if (table.GetUsageOfCol(i) == usage) return i;
    for (const char* name : names)
        for (int i = 0; i < columns; ++i)
            if (plain(table.GetNameOfCol(i)) == name) return i;
    return -1;
}

}  // namespace

Legend attribute_table_legend(const std::string& path, const Materials& materials) {
    GdalErrors errors;
    const DatasetHandle dataset = by_usual_or_all_drivers([&] { return open_dataset(path); });
    if (!dataset || dataset->GetRasterCount() < 1)
        throw IoError(text("culture '", path, "' cannot be opened: ", errors.reason()));
    const auto refuse = [&](const auto&... what) {
        throw InputError(text("culture-legend is rat, and culture '", path, "' ", what...));
    };
    const GDALRasterAttributeTable* const table = dataset->GetRasterBand(1)->GetDefaultRAT();
    if (!table || table->GetRowCount() == 0)
        refuse("has no raster attribute table; accepted: a raster with one, or another legend");
    std::string columns;
    for (int i = 0; i < table->GetColumnCount(); ++i) columns += (i ? ", " : "") + std::string(table->GetNameOfCol(i));
    const int names = column_of(*table, GFU_Name, {"classname", "classnames", "class", "material", "name", "label"});
    if (names < 0)
        refuse(
            "has an attribute table without names; accepted: a column of usage Name, or one called class_name, class, "
            "material, name or label (it has ",
            columns, ")");
    int first = column_of(*table, GFU_MinMax, {"value", "code", "pixelvalue"}), last = first;
    if (first < 0) {
        first = column_of(*table, GFU_Min, {});
        last = column_of(*table, GFU_Max, {});
    }
    if (first < 0 || last < 0)
        refuse(
            "has an attribute table without codes; accepted: a column of usage MinMax, or one called value or code, or "
            "two of usages Min and Max (it has ",
            columns, ")");

    std::map<int, ClassId> classes;
    for (int row = 0; row < table->GetRowCount(); ++row) {
        const std::string name = lower(table->GetValueAsString(row, names));
        if (name.empty()) continue;
        std::optional<ClassId> id;
        for (std::size_t i = 0; i < materials.size() && !id; ++i)
            if (lower(materials[i].name) == name) id = static_cast<ClassId>(i);
        const auto column = [&](int i) { return text("row ", row, ", ", table->GetNameOfCol(i)); };
        if (!id)
            refuse(": ", column(names), " is '", table->GetValueAsString(row, names),
                   "' in its attribute table; it must be one of ", materials.words(), " (class-table adds others)");
        const auto code = [&](int i) {
            const double value = table->GetValueAsDouble(row, i);
            if (!(value > INT32_MIN && value <= INT32_MAX) || value != std::trunc(value))
                refuse(": ", column(i), " is ", value, " in its attribute table; it must be a whole number of 32 bits");
            return static_cast<std::int64_t>(value);
        };
        const std::int64_t from = code(first), to = code(last);
        constexpr std::int64_t most = 65536;
        if (to < from || to - from >= most)
            refuse(": ", column(first), " to ", table->GetNameOfCol(last), " is ", from, " to ", to,
                   " in its attribute table; accepted: up to ", most, " codes, the smallest first");
        for (std::int64_t c = from; c <= to; ++c)
            if (const auto [at, fresh] = classes.emplace(static_cast<int>(c), *id); !fresh && at->second != *id)
                refuse(": ", column(first), " is ", c, " in its attribute table, which is ", materials[at->second].name,
                       " in a row before; each code may have one name");
        constexpr std::size_t most_in_all = std::size_t{1} << 18;  // a node of the map each
        if (classes.size() > most_in_all)
            refuse(": its attribute table names ", classes.size(), " codes up to row ", row, "; accepted: up to ",
                   most_in_all, " in all");
    }
    if (classes.empty()) refuse("has an attribute table that names no code");
    return Legend("rat", std::move(classes));
}

}  // namespace wedgescope
