// Display: range-azimuth power -> picture on the tube, by inverse mapping (every pixel asks where it comes from,
// so there are no holes). Leaves files, georeferencing and text to tiles/picture.hpp, the other way round to pixel_fill.hpp.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "lib/earth.hpp"
#include "lib/polar.hpp"
#include "lib/receiver.hpp"
#include "lib/scene.hpp"
#include "lib/stop.hpp"

namespace wedgescope {

/// What the display needs of the resolved scene.
struct DisplaySetting {
    DisplayParams params;
    PolarGrid shown;  ///< grid of the power image
    Angle heading;
    double sensor_m = 0;
    double reference_m = 0;
    double sweep_delay_m = 0;  ///< tdppi: slant range of the centre
    double range_start_m = 0;  ///< slant range (arc for gpi-true)
    double range_m = 0;
    Earth earth;
};

/// Where the tube's centre is and how far a pixel is.
struct Frame {
    std::int64_t width = 0, height = 0;
    double centre_column = 0, centre_row = 0;  ///< of the sensor, in pixels from the outer corner of the first
    double metres_per_pixel = 0;               ///< of the display's own radius (ground, slant or delayed range)
    double up_azimuth_rad = 0;                 ///< azimuth of the picture's up direction
};
/// The least frame that holds the sector (the azimuth bins shown) and the tube's centre, its longer side `size` pixels; with a
/// `centre` a square of `size` pixels with the sensor at that place, whose farthest side the largest range just reaches.
/// InputError where the display shows nothing (largest range within the altitude or the sweep delay), or too many rings.
Frame frame(const DisplaySetting& setting);

/// InputError where rings are drawn at a spacing that makes more than 200 of them.
void require_rings(const DisplaySetting& setting);

/// Of a picture and what it is made with, for each pixel.
std::size_t bytes_a_pixel(const DisplayParams& params);

/// Radius on the tube, metres, of a slant range: ground arc at the reference height (gpi), the range bin's own
/// coordinate (ppi, gpi-true), range less delay (tdppi); nothing where it is not shown. And back.
std::optional<double> display_radius_m(const DisplaySetting& setting, double range_m);
std::optional<double> display_range_m(const DisplaySetting& setting, double radius_m);

/// Received power, watts, of each cell: an image of it, or the power image with the noise that the receiver adds to every
/// cell and without its first `blanked` range bins, in which nothing is received. The image must outlive it.
class ReceivedPower {
public:
    // NOLINTNEXTLINE(google-explicit-constructor): an image of received power is one
    ReceivedPower(const PolarImage<float>& received_w) : ReceivedPower(received_w, 0, 0) {}
    ReceivedPower(const PolarImage<float>& power_w, double noise_w, std::size_t blanked)
        : image_w_(&power_w), noise_w_(noise_w), blanked_(blanked) {}

    /// Of a cell and its range bin, both counted from the image's first ones.
    float watts(std::size_t cell, std::size_t range) const {
        return range < blanked_ ? 0.0F : with_mean_noise(image_w_->cells[cell], noise_w_);
    }
    /// Nothing to add and nothing to leave out: it is what cells() says.
    bool plain() const { return noise_w_ == 0 && blanked_ == 0; }
    const float* cells() const { return image_w_->cells.data(); }
    const PolarGrid& grid() const { return image_w_->grid; }

private:
    const PolarImage<float>* image_w_;
    double noise_w_;
    std::size_t blanked_;
};

struct Picture {
    Frame frame;
    std::vector<std::uint8_t> grey;    ///< height x width
    std::vector<std::uint8_t> state;   ///< State codes, nearest cell; outside beyond the frame's sector
    std::vector<double> ring_range_m;  ///< of the range rings drawn, in the display's own radius
    std::uint64_t lit = 0;             ///< pixels that the receiver lets leave black, rings and marks aside
};

/// Received power (on `setting.shown`), bilinear in watts between cell centres (wrapping through north on a
/// full circle) or as pixel_fill.hpp says, then the receiver; states nearest in any case. With `rings` range rings at a round step
/// (1, 2 or 5 x 10^n nautical miles, four to nine of them) or at `ring_spacing_m`, and ticks at the rim each 10 degrees
/// from the azimuth that is up, longer each 30; with `azimuth_marks_rad` radial lines from the heading on, to either side up to
/// 180 degrees, each from where its neighbours are four pixels away. All these add to the picture as a brighter trace does.
/// `used`: a picture whose memory may serve again. Interrupted, where `stop` says so.
Picture picture(const ReceivedPower& received, const PolarImage<std::uint8_t>& state, const DisplaySetting& setting,
                const Receiver& receiver, Picture&& used = {}, const Stop* stop = nullptr);

}  // namespace wedgescope
