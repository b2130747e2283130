#include "tiles/burnt_layer.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/sided_layer.hpp"

namespace wedgescope {

Legend with_features(const std::optional<Legend>& legend, const Materials& materials) {
    std::map<int, ClassId> classes;
    if (legend) classes = legend->classes();
    const std::int32_t first = legend ? first_feature_code : 0;
    for (std::size_t id = 0; id < materials.size(); ++id) {
        const int code = first + static_cast<int>(id);
        if (!classes.emplace(code, static_cast<ClassId>(id)).second)
            throw InputError(text("culture-legend names code ", code, ", and features is given; ", first_feature_code,
                                  " to ", first_feature_code + static_cast<int>(Materials::most) - 1,
                                  " stand for the classes of features"));
    }
    return Legend(legend ? text(legend->name(), " and features") : "features", std::move(classes));
}

BurntLayer::BurntLayer(StoreLayerKind kind, std::unique_ptr<RasterLayer> below, const RasterFacts& grid,
                       std::shared_ptr<FeatureFile> features, double unit_m)
    : codes_(kind == StoreLayerKind::culture), unit_m_(unit_m), below_(std::move(below)),
      features_(std::move(features)) {
    facts_ = below_ ? below_->facts() : grid;
    facts_.role = codes_ ? "culture" : "culture-height";
    if (!below_) facts_.path = features_->params().path;
    facts_.scale = 1;
    facts_.offset = 0;
    facts_.unit.assign(codes_ ? 0 : 1, 'm');  // GCC 12 warns of a literal here
    facts_.unit_m = 1;
    facts_.signed_byte = facts_.has_mask = false;
    const auto become = [&](GDALDataType type, double none) {
        facts_.type = type;
        facts_.no_data = none;
        facts_.has_no_data = true;
    };
    if (!codes_)
        become(GDT_Float32, std::numeric_limits<double>::quiet_NaN());
    else if (!below_)
        become(GDT_Byte, Materials::most);
    else if (below_->facts().type == GDT_Byte)
        become(GDT_Int16, INT16_MIN);
    else
        become(GDT_Int32, INT32_MIN);
    facts_.type_bytes = type_bytes(facts_.type);
    prepare();
}

void BurntLayer::read_heights(const Window& window, float* out, std::int64_t stride) {
    if (window.empty()) return;
    const std::int64_t wide = window.columns.size();
    if (below_)
        below_->read_heights(window, out, stride);
    else
        for (std::int64_t r = 0; r < window.rows.size(); ++r) std::fill_n(out + r * stride, wide, 0.0F);
    features_->burn(facts_, window, FeatureFile::What::height, [&](std::size_t at, double height_m) {
        const auto place = static_cast<std::int64_t>(at);
        out[place / wide * stride + place % wide] = static_cast<float>(height_m / unit_m_);
    });
}

void BurntLayer::read_codes(const Window& window, std::int32_t* out) {
    if (window.empty()) return;
    const std::int32_t first = below_ ? first_feature_code : 0;
    if (below_) {
        below_->read_codes(window, out);
        // Where cells have sides of their own the raster below has been looked at.
        const bool sided = dynamic_cast<const SidedLayer*>(below_.get()) != nullptr;
        const auto posts = static_cast<std::size_t>(window.posts());
        const auto* const taken = std::find_if(out, out + posts, [&](std::int32_t code) {
            return !sided && code >= first_feature_code &&
                   code < first_feature_code + static_cast<std::int32_t>(Materials::most);
        });
        if (taken != out + posts) {
            const std::int64_t at = taken - out, wide = window.columns.size();
            throw DataError(text(below_->facts().named(), ": code at column ", window.columns.begin + at % wide,
                                 ", row ", window.rows.begin + at / wide, " is ", *taken, ", and ", features_->named(),
                                 " is burnt over it; accepted: codes below ", first_feature_code, " or above ",
                                 first_feature_code + static_cast<int>(Materials::most) - 1));
        }
    } else {
        std::fill_n(out, window.posts(), void_code);
    }
    if (!features_ || !features_->has_materials()) return;
    features_->burn(facts_, window, FeatureFile::What::material,
                    [&](std::size_t at, double id) { out[at] = first + static_cast<std::int32_t>(id); });
}

void BurntLayer::store(const std::vector<std::int32_t>& codes, std::vector<std::byte>& stored) const {
    std::vector<std::int32_t> whole = codes;
    std::replace(whole.begin(), whole.end(), void_code, static_cast<std::int32_t>(facts_.no_data));
    GDALCopyWords64(whole.data(), GDT_Int32, sizeof(std::int32_t), stored.data(), facts_.type, facts_.type_bytes,
                    static_cast<GPtrDiff_t>(whole.size()));
}

void BurntLayer::store(const std::vector<float>& heights, std::vector<std::byte>& stored) const {
    std::memcpy(stored.data(), heights.data(), heights.size() * sizeof(float));
}

void BurntLayer::read_values(const Window& window, void* out, GDALDataType type, std::int64_t line_bytes) {
    if (window.empty()) return;
    const auto wide = static_cast<std::size_t>(window.columns.size());
    const auto n = static_cast<std::size_t>(window.posts());
    std::vector<std::byte> stored(n * static_cast<std::size_t>(facts_.type_bytes));
    if (codes_) {
        std::vector<std::int32_t> codes(n);
        read_codes(window, codes.data());
        store(codes, stored);
    } else {
        std::vector<float> heights(n);
        read_heights(window, heights.data(), window.columns.size());
        store(heights, stored);
    }
    auto* line = static_cast<std::byte*>(out);
    for (std::size_t r = 0; r < static_cast<std::size_t>(window.rows.size()); ++r)
        GDALCopyWords64(stored.data() + r * wide * static_cast<std::size_t>(facts_.type_bytes), facts_.type,
                        facts_.type_bytes, line + static_cast<std::int64_t>(r) * line_bytes, type,
                        type_bytes(type), static_cast<GPtrDiff_t>(wide));
}

ReaderBytes BurntLayer::reader_bytes() const {
    ReaderBytes bytes = below_ ? below_->reader_bytes() : ReaderBytes{};
    if (features_) bytes.packed += FeatureFile::handle_bytes;
    return bytes;
}

std::uint64_t BurntLayer::fingerprint(const std::vector<Window>& cells) {
    Checksum sum;
    sum.add(below_ ? below_->fingerprint(cells) : 0);
    if (features_) sum.add(features_->fingerprint());
    return sum.value();
}

}  // namespace wedgescope
