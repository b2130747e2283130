#include "tiles/sided_layer.hpp"

#include <algorithm>
#include <cmath>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/registered_layer.hpp"

namespace wedgescope {
namespace {

constexpr std::int32_t first_bi = 360, omni = 540;

}  // namespace

SidedLayer::SidedLayer(std::unique_ptr<RasterLayer> culture, SideRasterParams params)
    : culture_(std::move(culture)), sides_(std::make_unique<RasterFile>("directivity", params.path)),
      params_(std::move(params)) {
    facts_ = culture_->facts();
    const RasterFacts &a = facts_, &b = sides_->facts();
    const double slack = 1e-3 * std::min(std::fabs(a.step_x), std::fabs(a.step_y));
    const auto near = [&](double x, double y) { return std::fabs(x - y) <= slack; };
    if (a.columns != b.columns || a.rows != b.rows || !near(a.corner_x, b.corner_x) || !near(a.corner_y, b.corner_y) ||
        !near(a.edge_x(), b.edge_x()) || !near(a.edge_y(), b.edge_y()))
        throw DataError(text(b.named(), " has another grid than ", a.named(), ": ", b.columns, " x ", b.rows,
                             " cells from ", b.corner_x, ", ", b.corner_y, ", not ", a.columns, " x ", a.rows, " from ",
                             a.corner_x, ", ", a.corner_y, "; accepted: the culture raster's own"));
    refuse_other_crs(b, a, "the culture");
    refuse_scaled_codes(b);
    prepare();
}

template <class Body>
void SidedLayer::each_sided(const std::int32_t* codes, const std::vector<std::int32_t>& values, Body&& body) const {
    // Neighbours are mostly alike.
    std::int32_t last = void_code;
    std::optional<ClassId> id;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (codes[i] == void_code || values[i] == void_code) continue;
        if (codes[i] != last) id = params_.legend.find(last = codes[i]);
        if (id) body(i, *id, values[i]);
    }
}

std::optional<FeatureFile::Side> SidedLayer::side(ClassId id, std::int32_t value) const {
    const Directivity directivity = value < first_bi ? Directivity::uni
                                    : value < omni   ? Directivity::bi
                                                     : Directivity::omni;
    return FeatureFile::own_side(params_.materials[id], {id, directivity,
                                                         value < first_bi ? value
                                                         : value < omni   ? value - first_bi
                                                                          : 0});
}

void SidedLayer::read(const Window& window, std::int32_t* codes, std::vector<std::int32_t>& values) {
    const auto n = static_cast<std::size_t>(window.posts());
    values.resize(n);
    culture_->read_codes(window, codes);
    sides_->read_codes(window, values.data());
    const std::int64_t wide = window.columns.size();
    const auto where = [&](std::size_t at) {
        const auto place = static_cast<std::int64_t>(at);
        return text("column ", window.columns.begin + place % wide, ", row ", window.rows.begin + place / wide);
    };
    for (std::size_t i = 0; i < n; ++i) {
        if (values[i] != void_code && (values[i] < 0 || values[i] > omni))
            throw DataError(
                text(sides_->facts().named(), ": value at ", where(i), " is ", values[i],
                     "; accepted: 0 to 359 (uni, its axis), 360 to 539 (bi, its axis and 360 more), 540 (omni)"));
        if (codes[i] >= first_feature_code &&
            codes[i] < first_feature_code + static_cast<std::int32_t>(Materials::most))
            throw DataError(text(culture_->facts().named(), ": code at ", where(i), " is ", codes[i], ", and ",
                                 sides_->facts().named(), " lies over it; accepted: codes below ", first_feature_code,
                                 " or above ", first_feature_code + static_cast<int>(Materials::most) - 1));
    }
}

void SidedLayer::read_codes(const Window& window, std::int32_t* out) {
    if (window.empty()) return;
    std::vector<std::int32_t> values;
    read(window, out, values);
    std::map<std::pair<ClassId, std::int32_t>, std::optional<std::int32_t>> known;  // none: as it is
    each_sided(out, values, [&](std::size_t i, ClassId of, std::int32_t value) {
        const auto [at, is_new] = known.try_emplace({of, value});
        if (is_new)
            if (const auto own = side(of, value)) {
                const auto id = params_.materials.find(
                    FeatureFile::sided_name(params_.materials[own->id].name, own->in_steps(params_.axis_step_deg)));
                if (!id) throw DataError(text(sides_->facts().named(), " changed while it was read"));
                at->second = first_feature_code + static_cast<std::int32_t>(*id);
            }
        if (at->second) out[i] = *at->second;
    });
}

std::set<FeatureFile::Side> SidedLayer::sides() {
    std::set<std::pair<ClassId, std::int32_t>> pairs;
    std::vector<std::int32_t> codes, values;
    for_each_window(facts_, facts_.columns, std::int64_t{1} << 20, [&](const Window& window) {
        if (params_.stop) params_.stop->check();
        codes.resize(static_cast<std::size_t>(window.posts()));
        read(window, codes.data(), values);
        std::optional<std::pair<ClassId, std::int32_t>> last;
        each_sided(codes.data(), values, [&](std::size_t, ClassId id, std::int32_t value) {
            const std::pair pair{id, value};
            if (pair != last) pairs.insert(*(last = pair));
        });
    });
    std::set<FeatureFile::Side> found;
    for (const auto& [id, value] : pairs)
        if (const auto own = side(id, value)) found.insert(*own);
    return found;
}

void SidedLayer::read_values(const Window&, void*, GDALDataType, std::int64_t) {
    throw Error("a culture layer with sides is read as codes");
}

ReaderBytes SidedLayer::reader_bytes() const {
    const ReaderBytes a = culture_->reader_bytes(), b = sides_->reader_bytes();
    return {std::max(a.decoded, b.decoded), a.packed + b.packed};
}

std::uint64_t SidedLayer::fingerprint(const std::vector<Window>& cells) {
    Checksum sum;
    sum.add(culture_->fingerprint(cells));
    sum.add(sides_->fingerprint(cells));
    return sum.value();
}

}  // namespace wedgescope
