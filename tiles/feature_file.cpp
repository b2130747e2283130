#include "tiles/feature_file.hpp"

#include <fmt/format.h>
#include <gdal_alg.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>

#include "lib/error.hpp"
#include "lib/lower_case.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/into_raster.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/sided_layer.hpp"
#include "tiles/vector_file.hpp"

namespace wedgescope {
namespace {

// The first one that a feature has counts. DFAD's own names and those of its descendants; and what shapefiles leave of them, which
// cut names to ten letters.
constexpr const char* material_fields[] = {"material",         "SMC",   "surface_material_category",
                                           "surface_material", "class", "surface_ma"};
constexpr const char* height_fields[] = {"height", "HGT", "predominant_height", "height_m"};
constexpr const char* cut_height_field = "predominan";  ///< of numbers; else it may be a kind of trees
constexpr const char* directivity_fields[] = {"directivity", "directivit"};
constexpr const char* axis_fields[] = {"axis", "axis_deg"};
/// A raster of one byte a cell; 1 where the geometry lies.
class Mask {
public:
    void draw(const OGRGeometry& geometry, ToCells to, const Window& cells, bool touch, GdalErrors& errors,
              const std::string& where) {
        const auto wide = static_cast<int>(cells.columns.size()), high = static_cast<int>(cells.rows.size());
        bytes_.assign(static_cast<std::size_t>(wide) * static_cast<std::size_t>(high), 0);
        // Its bytes in place: a MEM dataset of its own would be copied out again.
        const DatasetHandle drawing(
            GetGDALDriverManager()->GetDriverByName("MEM")->Create("", wide, high, 0, GDT_Byte, nullptr));
        char pointer[64];
        pointer[CPLPrintPointer(pointer, bytes_.data(), sizeof(pointer) - 1)] = 0;
        char** options = CSLSetNameValue(nullptr, "DATAPOINTER", pointer);
        const bool added = drawing && drawing->AddBand(GDT_Byte, options) == CE_None;
        CSLDestroy(options);
        to.column = cells.columns.begin;
        to.row = cells.rows.begin;
        OGRGeometryH shape = OGRGeometry::ToHandle(const_cast<OGRGeometry*>(&geometry));
        char* how[] = {const_cast<char*>("OPTIM=RASTER"), const_cast<char*>(touch ? "ALL_TOUCHED=TRUE" : nullptr),
                       nullptr};
        int band = 1;
        double value = 1;
        if (!added || GDALRasterizeGeometries(GDALDataset::ToHandle(drawing.get()), 1, &band, 1, &shape,
                                              &ToCells::transform, &to, &value, how, nullptr, nullptr) != CE_None)
            throw DataError(text(where, " cannot be drawn: ", errors.reason()));
        drawing->FlushCache(false);
    }
    const std::uint8_t* row(std::int64_t r, std::int64_t wide) const { return bytes_.data() + r * wide; }

private:
    std::vector<std::uint8_t> bytes_;
};

}  // namespace

struct FeatureFile::Handle {
    struct Layer {
        OGRLayer* layer = nullptr;
        std::string name;
        std::vector<int> materials, heights, directivities, axes;      ///< fields, by their places
        std::unique_ptr<OGRCoordinateTransformation> to_raster, back;  ///< none: as they are
        bool geographic = false;
    };
    DatasetHandle dataset;
    std::vector<Layer> layers;
};

class FeatureFile::Lease {
public:
    explicit Lease(FeatureFile& file) : file_(file) {
        {
            const std::lock_guard lock(file.mutex_);
            if (!file.free_.empty()) {
                handle_ = std::move(file.free_.back());
                file.free_.pop_back();
            }
        }
        if (!handle_) handle_ = file.open();
    }
    ~Lease() {
        const std::lock_guard lock(file_.mutex_);
        file_.free_.push_back(std::move(handle_));
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Handle& operator*() const { return *handle_; }

private:
    FeatureFile& file_;
    std::unique_ptr<Handle> handle_;
};

FeatureFile::FeatureFile(FeatureParams params, const RasterFacts& terrain)
    : params_(std::move(params)), crs_(terrain.crs), geographic_(terrain.geographic) {
    free_.push_back(open());
    std::string names;
    for (const Handle::Layer& layer : free_[0]->layers) {
        has_materials_ |= !layer.materials.empty();
        has_heights_ |= !layer.heights.empty();
        const OGRFeatureDefn& fields = *layer.layer->GetLayerDefn();
        for (int i = 0; i < fields.GetFieldCount(); ++i) {
            const std::string name = fields.GetFieldDefn(i)->GetNameRef();
            names += text(names.empty() ? "" : ", ", name);
            const auto takes = [&](const std::vector<int>& of) {
                return std::find(of.begin(), of.end(), i) != of.end();
            };
            if (!takes(layer.materials) && !takes(layer.heights) && !takes(layer.directivities) && !takes(layer.axes) &&
                std::find(left_out_.begin(), left_out_.end(), name) == left_out_.end())
                left_out_.push_back(name);
        }
    }
    if (!has_materials_ && !has_heights_)
        throw InputError(
            text(named(), " has no field for a material or a height; accepted: material or SMC, height or HGT (it has ",
                 names.empty() ? "none" : names, ")"));
}

FeatureFile::FeatureFile(FeatureParams params) : params_(std::move(params)), attributes_only_(true) {
    free_.push_back(open());
}

FeatureFile::~FeatureFile() = default;

std::string FeatureFile::named() const { return text("features ", in_quotes(params_.path)); }

StoreSource FeatureFile::source() const { return source_of(params_.path); }

std::uint64_t FeatureFile::fingerprint() {
    std::vector<std::string> files{params_.path};
    char** const list = open()->dataset->GetFileList();
    for (char** f = list; f && *f; ++f) files.emplace_back(*f);
    CSLDestroy(list);
    return stamps_checksum(file_stamps(files));
}

std::unique_ptr<FeatureFile::Handle> FeatureFile::open() {
    const std::lock_guard lock(opening_);
    auto handle = std::make_unique<Handle>();
    if (std::error_code ignored; std::filesystem::is_fifo(params_.path, ignored))  // it would be waited for
        throw IoError(text(named(), " is a pipe; accepted: a file, for features are not read from front to end"));
    GdalErrors errors;
    handle->dataset = open_vector(params_.path, true);
    if (!handle->dataset)
        throw IoError(text(named(), " cannot be opened: ", errors.reason(),
                           " (accepted: a vector file that GDAL reads, as GeoPackage, GeoJSON or a shapefile)"));
    std::string names;
    for (int i = 0; i < handle->dataset->GetLayerCount(); ++i) {
        OGRLayer* const layer = handle->dataset->GetLayer(i);
        names += text(names.empty() ? "" : ", ", layer->GetName());
        if (!params_.layer.empty() && params_.layer != layer->GetName()) continue;
        OGRFeatureDefn& definition = *layer->GetLayerDefn();
        if (definition.GetGeomFieldCount() == 0) continue;
        Handle::Layer one;
        one.layer = layer;
        one.name = layer->GetName();
        const auto find = [&](const auto& fields, std::vector<int>& found) {
            for (const char* field : fields)
                if (const int at = definition.GetFieldIndex(field); at >= 0) found.push_back(at);
        };
        find(material_fields, one.materials);
        find(height_fields, one.heights);
        if (const int at = definition.GetFieldIndex(cut_height_field); at >= 0)
            if (const OGRFieldType type = definition.GetFieldDefn(at)->GetType();
                type == OFTInteger || type == OFTInteger64 || type == OFTReal)
                one.heights.push_back(at);
        find(directivity_fields, one.directivities);
        find(axis_fields, one.axes);
        if (attributes_only_) {
            handle->layers.push_back(std::move(one));
            continue;
        }

        RasterFacts facts;
        facts.role = "features";
        facts.path = params_.path;
        facts.has_geotransform = true;
        set_crs(facts, crs_of(*layer));
        one.geographic = facts.crs && facts.geographic;
        if (facts.crs && !crs_)
            throw DataError(
                text(named(), " is in CRS ", in_quotes(facts.crs->definition()),
                     ", and the terrain has none; accepted: features without a CRS, in the raster's own coordinates"));
        if (facts.crs && !facts.crs->same_as(*crs_)) {
            const OGRSpatialReference own = in_gdal(*facts.crs), raster = in_gdal(*crs_);
            one.to_raster.reset(OGRCreateCoordinateTransformation(&own, &raster));
            one.back.reset(OGRCreateCoordinateTransformation(&raster, &own));
            if (!one.to_raster || !one.back)
                throw DataError(text(named(), ": PROJ knows no way from its CRS ",
                                     in_quotes(facts.crs->definition()), " to the terrain's: ", errors.reason()));
        }
        handle->layers.push_back(std::move(one));
    }
    if (handle->layers.empty())
        throw InputError(params_.layer.empty()
                             ? text(named(), " holds no layer with a geometry")
                             : text("features-layer is ", in_quotes(params_.layer), "; ", in_quotes(params_.path),
                                    " has ", names.empty() ? "none" : names));
    return handle;
}

namespace {

/// Without blanks round it; empty: not there, or nothing in it.
std::string value_of(OGRFeature& feature, int field) {
    const std::string words = field_text(feature, field);
    const auto first = words.find_first_not_of(' '), last = words.find_last_not_of(' ');
    return first == std::string::npos ? std::string() : words.substr(first, last - first + 1);
}

template <class Number>
std::optional<Number> number(const std::string& words) {
    Number value{};
    const auto [end, error] = std::from_chars(words.data(), words.data() + words.size(), value);
    if (error != std::errc{} || end != words.data() + words.size()) return std::nullopt;
    return value;
}

}  // namespace

void FeatureFile::refuse(const Handle& handle, std::size_t layer, OGRFeature& feature, int field,
                         const std::string& found, const std::string& accepted) const {
    throw DataError(text(named(), ", layer ", in_quotes(handle.layers[layer].name), ", feature ", feature.GetFID(),
                         ": ", feature.GetFieldDefnRef(field)->GetNameRef(), " is ", in_quotes(found),
                         "; accepted: ", accepted));
}

double FeatureFile::value(const Handle& handle, std::size_t layer, OGRFeature& feature, What what) const {
    constexpr double nothing = -1;
    if (what == What::material) {
        std::optional<ClassId> id = material(handle, layer, feature);
        if (!id) return nothing;
        if (params_.axis_step_deg > 0)
            if (const std::optional<Side> own = side(handle, layer, feature, *id))
                id = params_.materials.find(
                    sided_name(params_.materials[*id].name, own->in_steps(params_.axis_step_deg)));
        if (!id) throw DataError(text(named(), " changed while it was read"));
        return static_cast<double>(*id);
    }
    for (const int field : handle.layers[layer].heights) {
        const std::string found = value_of(feature, field);
        if (found.empty()) continue;
        const std::optional<double> height_m = number<double>(found);
        if (!height_m || !(*height_m >= 0 && *height_m <= static_cast<double>(highest_height_m)))
            refuse(handle, layer, feature, field, found, text("metres from 0 to ", highest_height_m));
        return *height_m > 0 ? *height_m : nothing;
    }
    return nothing;
}

std::optional<ClassId> FeatureFile::material(const Handle& handle, std::size_t layer, OGRFeature& feature) const {
    for (const int field : handle.layers[layer].materials) {
        const std::string found = value_of(feature, field);
        if (found.empty()) continue;
        if (const std::optional<int> code = number<int>(found)) {
            if (const std::optional<ClassId> id = params_.legend.find(*code)) return id;
            refuse(handle, layer, feature, field, found,
                   text("codes of the legend ", params_.legend.name(), " (features-legend), or one of ",
                        params_.materials.words()));
        }
        if (const std::optional<ClassId> id = params_.materials.find(found)) return id;
        refuse(handle, layer, feature, field, found,
               text("codes of the legend ", params_.legend.name(), ", or one of ", params_.materials.words()));
    }
    return std::nullopt;
}

FeatureFile::Side FeatureFile::Side::in_steps(int step_deg) const {
    if (directivity == Directivity::omni) return {id, directivity, 0};
    const int circle = directivity == Directivity::uni ? 360 : 180;
    return {id, directivity, (2 * axis_deg + step_deg) / (2 * step_deg) * step_deg % circle};
}

namespace {

int whole_axis(Directivity directivity, double degrees) {
    const int circle = directivity == Directivity::uni ? 360 : 180;
    const auto near = static_cast<int>(std::lround(degrees)) % circle;
    return near < 0 ? near + circle : near;
}

}  // namespace

std::optional<FeatureFile::Side> FeatureFile::own_side(const Material& own, const Side& side) {
    if (!own.gamma10_db) return std::nullopt;  // water has waves, and these the wind
    if (own.directivity == side.directivity &&
        (own.directivity == Directivity::omni || whole_axis(own.directivity, own.axis_deg) == side.axis_deg))
        return std::nullopt;
    return side;
}

std::string FeatureFile::sided_name(const std::string& name, const Side& side) {
    if (side.directivity == Directivity::omni) return text(name, "-omni");
    return fmt::format("{}-{}-{:03d}", name, word(side.directivity), side.axis_deg);
}

std::optional<FeatureFile::Side> FeatureFile::side(const Handle& handle, std::size_t layer, OGRFeature& feature,
                                                   ClassId id) const {
    const Handle::Layer& from = handle.layers[layer];
    /// Of the first field of some with a value: its place and the value.
    const auto first = [&](const std::vector<int>& fields) -> std::pair<int, std::string> {
        for (const int field : fields)
            if (std::string found = value_of(feature, field); !found.empty()) return {field, std::move(found)};
        return {-1, ""};
    };
    const auto [field, found] = first(from.directivities);
    if (found.empty()) return std::nullopt;
    std::string letters = lower_case(found);
    std::erase_if(letters, [](char c) { return c == '-' || c == ' '; });
    Side side{id, Directivity::omni, 0};
    if (letters == "uni" || letters == "unidirectional" || letters == "1")
        side.directivity = Directivity::uni;
    else if (letters == "bi" || letters == "bidirectional" || letters == "2")
        side.directivity = Directivity::bi;
    else if (letters != "omni" && letters != "omnidirectional" && letters != "3")
        refuse(handle, layer, feature, field, found, "omni, uni or bi, or 1 (uni), 2 (bi), 3 (omni)");
    if (side.directivity != Directivity::omni) {
        const auto [axis_field, axis] = first(from.axes);
        if (axis.empty())
            refuse(handle, layer, feature, field, found,
                   "with it an axis, degrees clockwise from north, in a field axis or axis_deg");
        const std::optional<double> degrees = number<double>(axis);
        if (!degrees || !(*degrees >= -360 && *degrees <= 360))
            refuse(handle, layer, feature, axis_field, axis, "degrees from -360 to 360");
        side.axis_deg = whole_axis(side.directivity, *degrees);
    }
    return own_side(params_.materials[id], side);
}

std::set<FeatureFile::Side> FeatureFile::sides() {
    const Lease lease(*this);
    Handle& handle = *lease;
    GdalErrors errors;
    std::set<Side> found;
    for (std::size_t i = 0; i < handle.layers.size(); ++i) {
        const Handle::Layer& from = handle.layers[i];
        if (from.directivities.empty() || from.materials.empty()) continue;
        from.layer->SetSpatialFilter(nullptr);
        for_each_feature(*from.layer, [&](OGRFeature& feature) {
            if (const std::optional<ClassId> id = material(handle, i, feature))
                if (const std::optional<Side> own = side(handle, i, feature, *id)) found.insert(*own);
        });
    }
    if (errors.failed()) throw IoError(text(named(), " cannot be read: ", errors.reason()));
    return found;
}

SidedClasses sided_classes(const Materials& materials, const std::optional<FeatureParams>& features,
                           const std::optional<SideRasterParams>& raster) {
    std::set<FeatureFile::Side> sides;
    if (features) sides = FeatureFile(*features).sides();
    if (raster) sides.merge(SidedLayer(std::make_unique<RasterFile>("culture", raster->culture), *raster).sides());
    SidedClasses out{materials, 0, 0};
    if (sides.empty()) return out;
    /// A table that has the class already, as an earlier store's has: its row stays if it has that side.
    const auto stands = [&](const FeatureFile::Side& side) {
        const std::string name = FeatureFile::sided_name(materials[side.id].name, side);
        const auto id = materials.find(name);
        if (!id) return false;
        const Material& row = materials[*id];
        if (row.directivity != side.directivity || FeatureFile::own_side(row, {*id, side.directivity, side.axis_deg}))
            throw InputError(text("class-table has a class '", name,
                                  "' with another side than its name tells, and features or directivity need that "
                                  "class; accepted: that side, or another name"));
        return true;
    };
    const std::size_t room = Materials::most - materials.size();
    for (const int step_deg : {1, 2, 3, 5, 6, 9, 10, 15, 18, 30, 45, 90}) {
        std::set<FeatureFile::Side> rounded;
        for (const FeatureFile::Side& side : sides) rounded.insert(side.in_steps(step_deg));
        const auto known = static_cast<std::size_t>(std::count_if(rounded.begin(), rounded.end(), stands));
        if (rounded.size() - known > room) continue;
        out.axis_step_deg = step_deg;
        out.sides = rounded.size();
        for (const FeatureFile::Side& side : rounded) {
            if (stands(side)) continue;
            Material row = materials[side.id];
            row.name = FeatureFile::sided_name(row.name, side);
            if (row.name.size() > Materials::longest_name)
                throw InputError(text("class '", materials[side.id].name, "' is to have a side of its own, as '",
                                      row.name, "'; accepted: names that are at most ", Materials::longest_name,
                                      " characters long with it"));
            row.directivity = side.directivity;
            row.axis_deg = side.axis_deg;
            out.materials = out.materials.with(row);
        }
        return out;
    }
    throw InputError(text("features and directivity have ", sides.size(),
                          " materials with a side of their own, even with axes of 90 degrees more than the ", room,
                          " classes for which there is room"));
}

namespace {

/// The number of the feature that each cell of a window has.
class Owners {
public:
    explicit Owners(const Window& window) : window_(window) {}
    void forget() { owner_.clear(); }
    /// Calls put(place in the window) for the cells of `drawn` that are marked in `mask`, but those of features above `number`.
    template <class Put>
    void take(std::int64_t number, const Mask& mask, const Window& drawn, const Put& put) {
        if (owner_.empty()) owner_.assign(static_cast<std::size_t>(window_.posts()), nobody);
        const Window inside = intersection(drawn, window_);
        for (std::int64_t r = inside.rows.begin; r < inside.rows.end; ++r) {
            const std::uint8_t* const line = mask.row(r - drawn.rows.begin, drawn.columns.size());
            for (std::int64_t c = inside.columns.begin; c < inside.columns.end; ++c) {
                if (!line[c - drawn.columns.begin]) continue;
                const auto at = window_.at(c, r);
                if (owner_[at] > number) continue;
                owner_[at] = number;
                put(at);
            }
        }
    }

private:
    static constexpr std::int64_t nobody = std::numeric_limits<std::int64_t>::min();
    const Window& window_;
    std::vector<std::int64_t> owner_;  // empty: nobody has any
};

}  // namespace

void FeatureFile::burn(const RasterFacts& grid, const Window& window, What what,
                       const std::function<void(std::size_t, double)>& put) {
    if (window.empty()) return;
    const Lease lease(*this);
    Handle& handle = *lease;
    GdalErrors errors;
    const OGREnvelope part = touched_by(grid, window);
    Owners owners(window);
    Mask mask;
    for (std::size_t i = 0; i < handle.layers.size(); ++i) {
        Handle::Layer& from = handle.layers[i];
        if ((what == What::material ? from.materials : from.heights).empty()) continue;
        owners.forget();  // a later layer lies over an earlier one
        IntoRaster into(grid, geographic_, from.to_raster.get(), from.back.get(), from.geographic);
        const auto draw = [&](OGRFeature& feature, const Ask& ask) {
            const double burnt = value(handle, i, feature, what);
            if (burnt < 0) return;
            std::unique_ptr<OGRGeometry> geometry(feature.StealGeometry());
            if (!geometry || geometry->IsEmpty()) return;
            const std::string where =
                text(named(), ", layer ", in_quotes(from.name), ", feature ", feature.GetFID(), ":");
            geometry = into.bring(std::move(geometry), ask, where, errors);
            if (!geometry) return;
            OGREnvelope box;
            geometry->getEnvelope(&box);
            if (!std::isfinite(box.MinX) || !std::isfinite(box.MaxX) || !std::isfinite(box.MinY) ||
                !std::isfinite(box.MaxY))
                throw DataError(text(where, " it has places that are not finite"));
            // What lies near the raster's middle may reach round the earth to its other end.
            const bool round = geographic_ && from.to_raster && !from.geographic;
            for (const double turn : {0.0, 360.0, -360.0}) {
                if (turn != 0 && !round) break;
                const ToCells to{grid.corner_x, grid.corner_y, grid.step_x, grid.step_y, ask.shift_x + turn, 0, 0};
                const Window drawn = cells_of(box, to, window);
                if (intersection(drawn, window).empty()) continue;
                mask.draw(*geometry, to, drawn, params_.touch, errors, where);
                owners.take(feature.GetFID(), mask, drawn, [&](std::size_t at) {
                    put(at, burnt);
                    if (!burnt_.load(std::memory_order_relaxed)) burnt_ = true;
                });
            }
        };
        for (const Ask& ask : asks(part, grid, geographic_, from.back.get(), from.geographic)) {
            if (ask.in)
                from.layer->SetSpatialFilterRect(ask.in->MinX, ask.in->MinY, ask.in->MaxX, ask.in->MaxY);
            else
                from.layer->SetSpatialFilter(nullptr);
            for_each_feature(*from.layer, [&](OGRFeature& feature) { draw(feature, ask); });
        }
    }
    if (errors.failed()) throw IoError(text(named(), " cannot be read: ", errors.reason()));
}

}  // namespace wedgescope
