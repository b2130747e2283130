// Vector files as GDAL gives them: opened, feature after feature, field by field.
// For the .cpp files of this folder only.
#pragma once
#include <ogrsf_frmts.h>

#include <string>

#include "lib/error.hpp"
#include "tiles/gdal_handle.hpp"

namespace wedgescope {

/// Null: by no driver. `says_why`: then GDAL tells that it knows no such file where no driver tells more.
inline DatasetHandle open_vector(const std::string& path, bool says_why) {
    const unsigned flags = GDAL_OF_VECTOR | GDAL_OF_READONLY | (says_why ? GDAL_OF_VERBOSE_ERROR : 0U);
    return by_usual_or_all_drivers([&] { return DatasetHandle(GDALDataset::Open(path.c_str(), flags)); });
}

/// Calls body(OGRFeature&) for what passes the layer's filter, in the file's order.
template <class Body>
void for_each_feature(OGRLayer& layer, const Body& body) {
    layer.ResetReading();
    for (OGRFeatureUniquePtr feature(layer.GetNextFeature()); feature; feature.reset(layer.GetNextFeature()))
        body(*feature);
}

/// A field's value as text from which numbers read back as they are; empty: not there, or nothing in it.
inline std::string field_text(OGRFeature& feature, int field) {
    if (!feature.IsFieldSetAndNotNull(field)) return {};
    if (feature.GetFieldDefnRef(field)->GetType() == OFTReal) return text(feature.GetFieldAsDouble(field));
    return feature.GetFieldAsString(field);
}

}  // namespace wedgescope
