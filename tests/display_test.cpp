// The tube: where ranges and azimuths land, against plane trigonometry.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lib/display.hpp"
#include "lib/error.hpp"
#include "lib/pixel_fill.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr std::uint8_t seen = static_cast<std::uint8_t>(State::seen);
constexpr std::uint8_t outside = static_cast<std::uint8_t>(State::outside);

DisplaySetting setting_of(DisplayKind kind) {
    DisplaySetting setting;
    setting.params.kind = kind;
    setting.params.size = 200;
    setting.params.rings = false;
    setting.shown = {360, 100, {0, 360}, {0, 100}};
    setting.sensor_m = 2500;
    setting.reference_m = 500;
    setting.sweep_delay_m = 2000;
    setting.range_m = 10000;
    return setting;
}

/// Grey = dB above 1 W, 12.75 a dB, so that 0 W is black and 100 W is white.
Receiver decibel_receiver() {
    ReceiverParams receiver;
    receiver.mds_dbm = 30;
    receiver.if_gain = Decibel(64);
    return Receiver(receiver, RadarParams{});
}

struct Images {
    PolarImage<float> power;
    PolarImage<std::uint8_t> state;
    explicit Images(const PolarGrid& grid) : power(grid), state(grid) {
        std::fill(state.cells.begin(), state.cells.end(), seen);
    }
};

std::uint8_t grey(const Picture& p, std::int64_t column, std::int64_t row) {
    return p.grey[static_cast<std::size_t>(row * p.frame.width + column)];
}
std::uint8_t state(const Picture& p, std::int64_t column, std::int64_t row) {
    return p.state[static_cast<std::size_t>(row * p.frame.width + column)];
}

}  // namespace

TEST_CASE("on a plane the displays stretch the ground by 1, 1/sin and tan of the angle off the nadir", "[display]") {
    const double height = 2000;
    for (const double off_deg : {1.0, 20.0, 45.0, 70.0, 78.0}) {
        const double off = Angle::degrees(off_deg).rad();
        const double ground = height * std::tan(off), slant = height / std::cos(off);
        CHECK_THAT(*display_radius_m(setting_of(DisplayKind::gpi), slant) / ground, WithinRel(1, 1e-11));
        CHECK_THAT(*display_radius_m(setting_of(DisplayKind::ppi), slant) / ground,
                   WithinRel(1 / std::sin(off), 1e-12));
        CHECK_THAT(*display_radius_m(setting_of(DisplayKind::tdppi), slant) / ground,
                   WithinRel(std::tan(off / 2), 1e-11));
        CHECK(*display_radius_m(setting_of(DisplayKind::gpi_true), ground) == ground);  // its bins are ground already
    }
}

TEST_CASE("radius and range turn into each other on every display, on the round earth too", "[display]") {
    for (const DisplayKind kind : {DisplayKind::gpi, DisplayKind::gpi_true, DisplayKind::ppi, DisplayKind::tdppi}) {
        DisplaySetting setting = setting_of(kind);
        setting.earth = Earth(8.49e6);
        for (const double radius : {0.0, 1.0, 777.0, 80000.0}) {
            const auto range = display_range_m(setting, radius);
            REQUIRE(range);
            CHECK_THAT(*display_radius_m(setting, *range), WithinAbs(radius, 1e-6));
        }
        CHECK_FALSE(display_range_m(setting, -1));
    }
    CHECK_FALSE(display_radius_m(setting_of(DisplayKind::gpi), 1999));
    CHECK_FALSE(display_radius_m(setting_of(DisplayKind::tdppi), 1999));
    CHECK(*display_range_m(setting_of(DisplayKind::gpi), 0) == 2000);
}

TEST_CASE("the frame of a full circle is a square with the sensor in its middle", "[display]") {
    const Frame f = frame(setting_of(DisplayKind::ppi));
    CHECK(f.width == 200);
    CHECK(f.height == 200);
    CHECK(f.centre_column == 100);
    CHECK(f.centre_row == 100);
    CHECK(f.metres_per_pixel == 100);
    CHECK(f.up_azimuth_rad == 0);
}

TEST_CASE("the frame of a sector is the least that holds it and the sensor", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.shown.azimuth_bins = {315, 405};  // 90 degrees round north
    Frame f = frame(setting);
    CHECK(f.width == 200);
    CHECK(f.height == 142);  // 200 / sqrt 2 = 141.42
    CHECK_THAT(f.centre_column, WithinAbs(100, 1e-5));
    CHECK_THAT(f.centre_row, WithinAbs(200 / std::numbers::sqrt2, 1e-5));
    CHECK_THAT(f.metres_per_pixel, WithinRel(10000 * std::numbers::sqrt2 / 200, 1e-9));

    setting.shown.azimuth_bins = {80, 100};  // 20 degrees round east: lies on its side
    f = frame(setting);
    CHECK(f.width == 200);
    CHECK(f.height == 70);  // 400 sin 10 degrees = 69.46
    CHECK_THAT(f.centre_column, WithinAbs(0, 1e-5));

    setting.heading = Angle::degrees(90);  // and up when the heading is up
    setting.params.orientation = Orientation::heading;
    f = frame(setting);
    CHECK(f.width == 70);
    CHECK(f.height == 200);
    CHECK_THAT(f.centre_row, WithinAbs(200, 1e-5));
    CHECK_THAT(f.up_azimuth_rad, WithinAbs(std::numbers::pi / 2, 1e-15));

    setting.params.orientation = Orientation::north;
    setting.shown.azimuth_bins = {180, 450};  // three quarters
    f = frame(setting);
    CHECK(f.width == 200);
    CHECK(f.height == 200);
}

TEST_CASE("a point lies on the tube where its azimuth and range say", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    Images images(setting.shown);
    for (std::size_t i = 88; i < 92; ++i)
        for (std::size_t j = 58; j < 62; ++j) images.power.row(i)[j] = 100;  // 90 degrees, 6 km
    Picture p = picture(images.power, images.state, setting, decibel_receiver());
    CHECK(grey(p, 160, 100) == 255);  // east is right, 60 pixels of 100 m
    CHECK(grey(p, 40, 100) == 0);
    CHECK(grey(p, 100, 40) == 0);

    setting.params.orientation = Orientation::heading;
    setting.heading = Angle::degrees(90);
    p = picture(images.power, images.state, setting, decibel_receiver());
    CHECK(grey(p, 100, 39) == 255);  // now it is up
    CHECK(grey(p, 160, 100) == 0);
}

TEST_CASE("a circle on the ground is a circle of its own radius on a GPI", "[display]") {
    // Level ground 5 km out: slant range sqrt(5^2 + 2^2) km; 200 pixels for twice sqrt(10^2 - 2^2) km.
    DisplaySetting setting = setting_of(DisplayKind::gpi);
    setting.params.size = 1000;
    setting.shown = {360, 20, {0, 360}, {0, 500}};
    Images images(setting.shown);
    const auto bin = static_cast<std::size_t>(std::hypot(5000, 2000) / 20);
    for (std::size_t i = 0; i < 360; ++i) images.power.row(i)[bin] = 100;
    const Picture p = picture(images.power, images.state, setting, decibel_receiver());
    const double expected = 5000 / (2 * std::sqrt(10000. * 10000 - 2000. * 2000)) * 1000;
    double sum = 0, weight = 0;
    for (std::int64_t column = 500; column < 1000; ++column) {
        sum += grey(p, column, 500) * (static_cast<double>(column) + 0.5 - 500);
        weight += grey(p, column, 500);
    }
    REQUIRE(weight > 0);
    CHECK_THAT(sum / weight, WithinAbs(expected, 0.6));  // half a bin of 20 m is half a pixel
}

TEST_CASE("an even ground fills the tube without holes, and nothing lies outside", "[display]") {
    for (const DisplayKind kind : {DisplayKind::gpi, DisplayKind::gpi_true, DisplayKind::ppi, DisplayKind::tdppi}) {
        DisplaySetting setting = setting_of(kind);
        setting.params.size = 600;  // many pixels a cell
        setting.range_start_m = kind == DisplayKind::ppi ? 3000 : 0;
        Images images(setting.shown);
        std::fill(images.power.cells.begin(), images.power.cells.end(), 10.0f);
        const Picture p = picture(images.power, images.state, setting, decibel_receiver());
        const double inner = setting.range_start_m / p.frame.metres_per_pixel;
        std::size_t wrong = 0;
        for (std::int64_t row = 0; row < 600; ++row)
            for (std::int64_t column = 0; column < 600; ++column) {
                const double radius = std::hypot(static_cast<double>(column) - 299.5, static_cast<double>(row) - 299.5);
                const bool inside = radius <= 300 && radius >= inner;
                if (std::abs(radius - 300) < 1e-3 || std::abs(radius - inner) < 1e-3) continue;
                if (grey(p, column, row) != (inside ? 128 : 0) || state(p, column, row) != (inside ? seen : outside))
                    ++wrong;
            }
        CHECK(wrong == 0);
    }
}

TEST_CASE("between cell centres the picture is linear in watts", "[display]") {
    // Cells of 100 m and 1 degree; the centre of cell j lies at (j + 1/2) 100 m.
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 2000;  // 10 m a pixel
    Images images(setting.shown);
    for (std::size_t i = 0; i < 360; ++i)
        for (std::size_t j = 50; j < 100; ++j) images.power.row(i)[j] = 50;  // 17 dB; the cells nearer hold nothing
    Picture p = picture(images.power, images.state, setting, decibel_receiver());
    // From the centre of cell 49 (4950 m) to that of 50 (5050 m): the pixel's centre at 4995 m has 45 % of it,
    // 22.5 W or 13.522 dB. (Linear in dB would be black; nearest too.)
    const auto along = [&](double metres) { return grey(p, 1000, 1000 - static_cast<std::int64_t>(metres / 10)); };
    CHECK(along(4940) == 0);
    CHECK_THAT(static_cast<double>(along(5000)), WithinAbs(255 * 13.522 / 20, 0.6));
    CHECK(along(5060) == 217);  // 16.99 dB

    // Round north: cells of azimuth 359 and 0 mix as others do.
    Images sides(setting.shown);
    for (std::size_t j = 0; j < 100; ++j) sides.power.row(359)[j] = 50;
    p = picture(sides.power, sides.state, setting, decibel_receiver());
    // Half a pixel east of north at 899.5 pixels is 0.0318 degrees: 46.8 % of 50 W, 13.69 dB.
    CHECK_THAT(static_cast<double>(grey(p, 1000, 100)), WithinAbs(255 * 13.69 / 20, 0.6));
    CHECK_THAT(static_cast<double>(grey(p, 999, 100)), WithinAbs(255 * 14.25 / 20, 0.6));  // and 53.2 % as far west
    CHECK(grey(p, 1000 - 8, 100) >= 214);  // half a degree west: all but 2 %
}

TEST_CASE("a sector is clamped at its edges and black beyond", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 1000;
    setting.shown.azimuth_bins = {350, 370};
    Images images(setting.shown);
    for (std::size_t j = 0; j < 100; ++j) images.power.row(0)[j] = 100;  // the first bin only
    const Picture p = picture(images.power, images.state, setting, decibel_receiver());
    const auto pixel = [&](double azimuth_deg, double range_m) {
        const double a = Angle::degrees(azimuth_deg).rad(), r = range_m / p.frame.metres_per_pixel;
        return std::pair{static_cast<std::int64_t>(p.frame.centre_column + r * std::sin(a)),
                         static_cast<std::int64_t>(p.frame.centre_row - r * std::cos(a))};
    };
    const auto [in_column, in_row] = pixel(-9.8, 9000);
    CHECK(grey(p, in_column, in_row) == 255);  // outside the first centre, no darker
    const auto [out_column, out_row] = pixel(-10.2, 9000);
    CHECK(grey(p, out_column, out_row) == 0);
    CHECK(state(p, out_column, out_row) == outside);
    const auto [last_column, last_row] = pixel(9.8, 9000);
    CHECK(grey(p, last_column, last_row) == 0);
    CHECK(state(p, last_column, last_row) == seen);
}

TEST_CASE("the edges of a sector are even lines within it", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 1000;
    setting.params.rings = true;
    setting.params.ring_spacing_m = 1e6;
    setting.shown.azimuth_bins = {350, 370};
    const Images images(setting.shown);  // no power at all
    const Picture p = picture(images.power, images.state, setting, decibel_receiver());
    // As far along the edge as there are no marks, what each row holds of it, left and right: the line's grey over its cosine.
    const double cosine = std::cos(Angle::degrees(10).rad());
    const auto apex = static_cast<std::int64_t>(p.frame.centre_row),
               middle = static_cast<std::int64_t>(p.frame.centre_column);
    for (std::int64_t row = apex - 800; row < apex - 40; ++row) {
        double left = 0, right = 0;
        for (std::int64_t column = 0; column < p.frame.width; ++column) {
            (column < middle ? left : right) += grey(p, column, row);
            if (grey(p, column, row) > 0) CHECK(state(p, column, row) == seen);
        }
        INFO("row " << row);
        CHECK_THAT(left, WithinAbs(96 / cosine, 3));
        CHECK_THAT(right, WithinAbs(96 / cosine, 3));
    }
}

TEST_CASE("a pixel has the state of the cell it lies in", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 2000;
    Images images(setting.shown);
    images.state.row(90)[50] = static_cast<std::uint8_t>(State::shadow);  // 90..91 degrees, 5000..5100 m
    const Picture p = picture(images.power, images.state, setting, decibel_receiver());
    std::size_t shadows = 0;
    for (const std::uint8_t s : p.state) shadows += s == static_cast<std::uint8_t>(State::shadow);
    CHECK(state(p, 1505, 1004) == static_cast<std::uint8_t>(State::shadow));
    CHECK(state(p, 1505, 999) == seen);
    // 100 m x 5050 m x 1 degree = 88.1 pixels of 100 square metres; its outline has 38.
    CHECK(std::abs(static_cast<double>(shadows) - 88.1) < 19);
}

TEST_CASE("range rings stand at a round number of nautical miles, four to nine of them", "[display]") {
    for (const double miles : {0.004, 0.31, 1.0, 2.5, 5.4, 9.9, 18.5, 30.0, 47.0, 100.5, 220.0}) {
        DisplaySetting setting = setting_of(DisplayKind::ppi);
        setting.params.rings = true;
        setting.range_m = miles * 1852;
        setting.shown.range_bin_m = setting.range_m / 100;
        const Images images(setting.shown);
        const Picture p = picture(images.power, images.state, setting, decibel_receiver());
        INFO(miles << " nmi");
        CHECK(p.ring_range_m.size() >= 4);
        CHECK(p.ring_range_m.size() <= 9);
        const double step = p.ring_range_m.front() / 1852;
        const double digit = step / std::pow(10, std::floor(std::log10(step * 1.0001)));
        CHECK((std::abs(digit - 1) < 1e-9 || std::abs(digit - 2) < 1e-9 || std::abs(digit - 5) < 1e-9));
        for (std::size_t k = 0; k < p.ring_range_m.size(); ++k)
            CHECK_THAT(p.ring_range_m[k], WithinRel(step * 1852 * static_cast<double>(k + 1), 1e-12));
        CHECK(p.ring_range_m.back() + step * 1852 >= setting.range_m * (1 - 1e-9));
    }
}

TEST_CASE("rings and marks light a dark tube where they stand, and nothing else", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 1000;
    setting.params.rings = true;
    setting.range_m = 5.5 * 1852;
    const PolarGrid& g = setting.shown;
    const Images images(g);
    const Picture p = picture(images.power, images.state, setting, decibel_receiver());
    REQUIRE(p.ring_range_m.size() == 5);
    const double mile = 1852 / p.frame.metres_per_pixel;  // 90.9 pixels
    for (int k = 1; k <= 5; ++k) {
        int lit = 0;
        for (int d = -2; d <= 2; ++d)
            lit = std::max<int>(lit, grey(p, 500 + static_cast<std::int64_t>(k * mile) + d, 500));
        CHECK(lit > 48);
        CHECK(grey(p, 500 + static_cast<std::int64_t>((k - 0.5) * mile), 500) == 0);
    }
    CHECK(std::max(grey(p, 990, 500), grey(p, 990, 499)) > 48);  // the mark of 90 degrees
    CHECK(grey(p, 500 + static_cast<std::int64_t>(490 * std::sin(0.0873)),
               500 - static_cast<std::int64_t>(490 * std::cos(0.0873))) == 0);  // none at 5

    setting.params.rings = false;
    const Picture bare = picture(images.power, images.state, setting, decibel_receiver());
    CHECK(bare.ring_range_m.empty());
    CHECK(std::all_of(bare.grey.begin(), bare.grey.end(), [](std::uint8_t v) { return v == 0; }));
}

TEST_CASE("a range within the altitude shows nothing and is refused", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::gpi);
    setting.range_m = 1500;
    CHECK_THROWS_AS(frame(setting), InputError);
    CHECK_THROWS_WITH(frame(setting), Catch::Contains("range is 1500.0 m") && Catch::Contains("2000.0 m"));
    setting.params.kind = DisplayKind::tdppi;
    CHECK_THROWS_AS(frame(setting), InputError);
}

TEST_CASE("rings stand where they are asked for", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::tdppi);  // 2 km of delay: radius 8 km
    setting.params.size = 1600;                               // 10 m a pixel
    setting.params.rings = true;
    setting.params.ring_spacing_m = 3000;
    const Images images(setting.shown);
    const Picture p = picture(images.power, images.state, setting, decibel_receiver());
    CHECK(p.ring_range_m == std::vector<double>{3000, 6000});
    for (const int metres : {3000, 6000}) {
        CHECK(std::max(grey(p, 800 + metres / 10, 803), grey(p, 800 + metres / 10 - 1, 803)) > 40);
        CHECK(grey(p, 800 + metres / 10 + 30, 803) == 0);
    }
    setting.params.ring_spacing_m = 8000;  // the rim itself is none
    CHECK(picture(images.power, images.state, setting, decibel_receiver()).ring_range_m.empty());
    setting.params.ring_spacing_m = 39;
    CHECK_THROWS_WITH(frame(setting), Catch::Contains("ring-spacing is 39 m") && Catch::Contains("8000.0 m") &&
                                          Catch::Contains("at least 40.0 m"));
    CHECK_THROWS_AS(require_rings(setting), InputError);
    setting.params.rings = false;  // then it says nothing
    CHECK_NOTHROW(frame(setting));
}

TEST_CASE("azimuth marks are lines from the heading on, to either side", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 2000;  // 10 m a pixel
    setting.heading = Angle::degrees(-70);
    const Images images(setting.shown);
    for (const double step_deg : {30.0, 50.0, 180.0}) {
        setting.params.azimuth_marks_rad = Angle::degrees(step_deg).rad();
        const Picture p = picture(images.power, images.state, setting, decibel_receiver());
        CHECK(p.ring_range_m.empty());
        const auto brightest_at = [&](double from_heading_deg, double radius_pixels) {
            const double a = Angle::degrees(from_heading_deg - 70).rad();
            const auto column = static_cast<std::int64_t>(1000 + radius_pixels * std::sin(a)),
                       row = static_cast<std::int64_t>(1000 - radius_pixels * std::cos(a));
            int brightest = 0;
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) brightest = std::max<int>(brightest, grey(p, column + dx, row + dy));
            return brightest;
        };
        for (int deg = -180; deg < 180; deg += 5) {
            INFO(step_deg << ": " << deg);
            // At a step of 50 degrees the last ones are those of 150 to either side.
            const bool line = std::fmod(std::abs(deg), step_deg) == 0;
            for (const double radius : {60.0, 400.0, 990.0}) CHECK((brightest_at(deg, radius) > 48) == line);
        }
        // Not where lines would run into each other.
        CHECK(brightest_at(0, 4 / Angle::degrees(step_deg).rad() + 3) > 48);
        if (step_deg < 100) CHECK(brightest_at(0, 4 / Angle::degrees(step_deg).rad() - 3) == 0);
    }
    // Beside rings each is as it is alone.
    setting.params.azimuth_marks_rad = Angle::degrees(45).rad();
    const Picture lines = picture(images.power, images.state, setting, decibel_receiver());
    setting.params.rings = true;
    const Picture both = picture(images.power, images.state, setting, decibel_receiver());
    setting.params.azimuth_marks_rad.reset();
    const Picture rings = picture(images.power, images.state, setting, decibel_receiver());
    bool same = true;
    for (std::size_t i = 0; i < both.grey.size(); ++i)
        same = same && both.grey[i] == std::max(lines.grey[i], rings.grey[i]);
    CHECK(same);
    CHECK(both.lit == 0);
}

TEST_CASE("off centre the tube is a square, and the largest range reaches its farthest side", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.centre = TubePlace{0, -0.9};
    Frame f = frame(setting);
    CHECK(f.width == 200);
    CHECK(f.height == 200);
    CHECK(f.centre_column == 100);
    CHECK_THAT(f.centre_row, WithinAbs(190, 1e-5));
    CHECK_THAT(f.metres_per_pixel, WithinRel(10000 / 190.0, 1e-9));  // 190 pixels above it
    setting.params.centre = TubePlace{-1, 0.25};
    f = frame(setting);
    CHECK(f.centre_column == 0);
    CHECK(f.centre_row == 75);
    CHECK_THAT(f.metres_per_pixel, WithinRel(50, 1e-9));

    // A sector's frame is a square too; in the middle all is as on a full circle.
    setting.shown.azimuth_bins = {350, 370};
    setting.params.centre = TubePlace{0, 0};
    f = frame(setting);
    CHECK(f.width == 200);
    CHECK(f.height == 200);
    CHECK(f.metres_per_pixel == 100);

    // Where azimuth and range say, seen from there.
    setting = setting_of(DisplayKind::ppi);
    setting.params.centre = TubePlace{0.5, -0.9};
    setting.params.orientation = Orientation::heading;
    setting.heading = Angle::degrees(90);
    Images images(setting.shown);
    for (std::size_t i = 88; i < 92; ++i)
        for (std::size_t j = 58; j < 62; ++j) images.power.row(i)[j] = 100;  // 90 degrees, 6 km
    const Picture p = picture(images.power, images.state, setting, decibel_receiver());
    CHECK(grey(p, 150, 190 - 114) == 255);  // 6 km of 190 / 10 pixels a kilometre
    CHECK(state(p, 150, 0) == seen);
    CHECK(state(p, 0, 0) == outside);  // beyond the range
}

TEST_CASE("the middle asked for is the picture of a full circle, every bit", "[display]") {
    for (const DisplayKind kind : {DisplayKind::gpi, DisplayKind::tdppi}) {
        DisplaySetting setting = setting_of(kind);
        setting.params.size = 333;
        setting.params.rings = true;
        Images images(setting.shown);
        for (std::size_t k = 0; k < images.power.cells.size(); ++k)
            images.power.cells[k] = static_cast<float>((k * 2654435761u) % 100);
        const Picture fitted = picture(images.power, images.state, setting, decibel_receiver());
        setting.params.centre = TubePlace{0, 0};
        const Picture asked = picture(images.power, images.state, setting, decibel_receiver());
        CHECK(asked.grey == fitted.grey);
        CHECK(asked.state == fitted.state);
        CHECK(asked.frame.metres_per_pixel == fitted.frame.metres_per_pixel);
    }
}

TEST_CASE("cells are painted on the pixels that their centres fall on, and nowhere else", "[display]") {
    for (const DisplayKind kind : {DisplayKind::gpi, DisplayKind::ppi, DisplayKind::tdppi}) {
        DisplaySetting setting = setting_of(kind);
        setting.params.size = 400;
        setting.params.pixel_fill = PixelFill::none;
        setting.shown = {24, 500, {0, 24}, {0, 20}};
        setting.range_start_m = 3000;
        Images images(setting.shown);
        for (std::size_t k = 0; k < images.power.cells.size(); ++k)
            images.power.cells[k] = 2 + static_cast<float>((k * 2654435761u) % 90);
        const Picture p = picture(images.power, images.state, setting, decibel_receiver());
        std::vector<std::uint8_t> expected(p.grey.size(), 0);
        const double half = kind == DisplayKind::ppi ? 10000 : kind == DisplayKind::tdppi ? 8000 : std::sqrt(96e6);
        int painted = 0;
        for (int i = 0; i < 24; ++i)
            for (int j = 0; j < 20; ++j) {
                const double azimuth = Angle::degrees(15 * i + 7.5).rad(), range = 500 * j + 250;
                if (range < 3000) continue;
                const double radius = kind == DisplayKind::ppi     ? range
                                      : kind == DisplayKind::tdppi ? range - 2000
                                                                   : std::sqrt(range * range - 4e6);
                const double pixels = radius / half * 200;
                const auto column = static_cast<std::size_t>(200 + pixels * std::sin(azimuth)),
                           row = static_cast<std::size_t>(200 - pixels * std::cos(azimuth));
                std::uint8_t& pixel = expected[row * 400 + column];
                REQUIRE(pixel == 0);  // cells are far apart here
                pixel = decibel_receiver().grey(static_cast<double>(images.power.row(static_cast<std::size_t>(i))[j]),
                                                range);
                ++painted;
            }
        REQUIRE(painted == 24 * 14);
        CHECK(p.grey == expected);
        CHECK(p.lit == static_cast<std::uint64_t>(painted));

        setting.params.pixel_fill = PixelFill::interpolate;  // states stay
        CHECK(picture(images.power, images.state, setting, decibel_receiver()).state == p.state);
    }
}

TEST_CASE("cells that share a pixel show their mean in watts", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 20;  // 1 km a pixel
    setting.params.pixel_fill = PixelFill::none;
    Images images(setting.shown);
    for (std::size_t i = 0; i < 360; ++i)
        for (std::size_t j = 0; j < 100; ++j) images.power.row(i)[j] = static_cast<float>(i % 7 + 2 * (j % 3));
    std::vector<double> sum(400, 0), count(400, 0);
    for (int i = 0; i < 360; ++i)
        for (int j = 0; j < 100; ++j) {
            const double azimuth = Angle::degrees(i + 0.5).rad(), pixels = (j + 0.5) / 10;
            const auto at = static_cast<std::size_t>(10 - pixels * std::cos(azimuth)) * 20 +
                            static_cast<std::size_t>(10 + pixels * std::sin(azimuth));
            sum[at] += i % 7 + 2 * (j % 3);
            ++count[at];
        }
    const std::vector<double> painted = paint_cells(images.power, setting, frame(setting));
    REQUIRE(painted.size() == 400);
    for (std::size_t at = 0; at < 400; ++at) {
        INFO(at);
        if (count[at] == 0)
            CHECK(painted[at] < 0);
        else
            CHECK_THAT(painted[at], WithinRel(sum[at] / count[at], 1e-12));
    }
}

TEST_CASE("only holes are filled, and even ground leaves none", "[display]") {
    DisplaySetting setting = setting_of(DisplayKind::ppi);
    setting.params.size = 700;
    setting.shown = {90, 400, {0, 90}, {0, 25}};  // cells of 14 pixels, 24 wide at the rim
    Images images(setting.shown);
    const auto drawn = [&](PixelFill fill) {
        setting.params.pixel_fill = fill;
        return picture(images.power, images.state, setting, decibel_receiver());
    };
    for (std::size_t k = 0; k < images.power.cells.size(); ++k)
        images.power.cells[k] = 2 + static_cast<float>((k * 2654435761u) % 90);
    const Picture none = drawn(PixelFill::none), holes = drawn(PixelFill::holes);
    const std::vector<double> painted = paint_cells(images.power, setting, none.frame);
    std::size_t changed = 0, dark = 0, filled = 0, cells = 0;
    for (std::size_t at = 0; at < painted.size(); ++at) {
        if (painted[at] >= 0)
            ++cells, changed += holes.grey[at] != none.grey[at];
        else
            filled += holes.grey[at] > 0;
        // All that the picture shows, and nothing else.
        dark += (holes.grey[at] == 0) != (holes.state[at] == outside) && painted[at] < 0;
    }
    CHECK(changed == 0);
    CHECK(dark == 0);
    CHECK(filled > 300000);
    CHECK(cells > 1500);  // 90 x 25, of which the nearest share pixels
    CHECK(none.lit == cells);
    CHECK(holes.lit == cells + filled);

    std::fill(images.power.cells.begin(), images.power.cells.end(), 10.0f);
    const Picture even = drawn(PixelFill::holes);
    CHECK(even.grey == drawn(PixelFill::interpolate).grey);
}

TEST_CASE("holes are filled as if all of them were looked at in every pass", "[display]") {
    std::uint64_t state = 5;
    const auto draw = [&](std::uint64_t below) {
        state = state * 6364136223846793005U + 1442695040888963407U;
        return (state >> 33) % below;
    };
    for (int trial = 0; trial < 60; ++trial) {
        Frame f;
        f.width = static_cast<std::int64_t>(1 + draw(40));
        f.height = static_cast<std::int64_t>(1 + draw(40));
        const std::uint64_t rare = 2 + draw(60), outside = 1 + draw(9);
        std::vector<double> power;
        std::vector<std::uint32_t> holes;
        for (std::int64_t at = 0; at < f.width * f.height; ++at) {
            const bool painted = draw(rare) == 0;
            power.push_back(painted ? static_cast<double>(draw(1000)) : -1);
            if (!painted && draw(outside + 1) > 0) holes.push_back(static_cast<std::uint32_t>(at));
        }
        std::vector<double> wanted = power;
        std::vector<std::uint32_t> left = holes;
        for (bool more = true; more;) {
            const std::vector<double> before = wanted;
            more = false;
            for (const std::uint32_t at : left) {
                if (before[at] >= 0) continue;
                const std::int64_t column = at % f.width, row = at / f.width;
                double sum = 0;
                int count = 0;
                for (std::int64_t r = row - 1; r <= row + 1; ++r)
                    for (std::int64_t c = column - 1; c <= column + 1; ++c) {
                        if (r < 0 || c < 0 || r >= f.height || c >= f.width) continue;
                        const double beside = before[static_cast<std::size_t>(r * f.width + c)];
                        if (beside >= 0) sum += beside, ++count;
                    }
                if (count == 0) continue;
                wanted[at] = sum / count;
                more = true;
            }
        }
        fill_holes(power, f, holes);
        CHECK(power == wanted);
    }
}

TEST_CASE("a hole takes the mean of its neighbours, pass after pass", "[display]") {
    // -1: a hole to fill; -2: one that lies outside and stays.
    constexpr double a = -1, b = -2;
    std::vector<double> power = {8, 2, a, a, a,   //
                                 a, a, a, a, b,   //
                                 a, a, a, b, b,   //
                                 b, b, b, b, a};  // reached by nothing
    std::vector<std::uint32_t> holes;
    for (std::uint32_t at = 0; at < power.size(); ++at)
        if (power[at] == a) holes.push_back(at);
    for (double& w : power) w = w < 0 ? -1 : w;
    Frame f;
    f.width = 5;
    f.height = 4;
    fill_holes(power, f, holes);
    // First those beside 8 and 2 alone: (8 + 2) / 2, 5, 2, 2; then those beside these.
    const double third = (2 + 2) / 2.0;
    CHECK(power[0] == 8);
    CHECK(power[1] == 2);
    CHECK(power[2] == 2);
    CHECK(power[5] == 5);
    CHECK(power[6] == 5);
    CHECK(power[7] == 2);
    CHECK(power[3] == third);
    CHECK(power[8] == third);
    CHECK(power[10] == 5);
    CHECK(power[11] == 4);    // 5, 5, 2
    CHECK(power[12] == 3.5);  // 5, 2
    CHECK(power[4] == third);
    for (const std::size_t at : {9, 13, 14, 15, 16, 17, 18, 19}) CHECK(power[at] == -1);

    Stop stop;
    stop.request(15);
    CHECK_THROWS_AS(fill_holes(power, f, {19}, &stop), Interrupted);
}
