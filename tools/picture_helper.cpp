// wedgescope_picture: the helper program that links OpenImageIO, so that the main program need not.
//   wedgescope_picture legend < legend.json > panel.pgm
// draws a dark panel with text that fits beside a scope picture of the size that the JSON names: as high as it (to
// stand to its right), or as wide (to stand below it) where the picture is wide and low, or wider where the text is.
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace {

using json = nlohmann::json;
namespace oiio = OIIO;

constexpr float panel_grey = 18, rule_grey = 60, label_grey = 140, value_grey = 225, title_grey = 255;

struct Fonts {
    std::string regular = "DejaVuSans", bold = "DejaVuSans-Bold";
    Fonts() {
        // By path where Debian keeps them; else OpenImageIO looks for the names.
        const std::string folder = "/usr/share/fonts/truetype/dejavu/";
        if (::access((folder + "DejaVuSans.ttf").c_str(), R_OK) == 0) regular = folder + "DejaVuSans.ttf";
        if (::access((folder + "DejaVuSans-Bold.ttf").c_str(), R_OK) == 0) bold = folder + "DejaVuSans-Bold.ttf";
    }
};

int text_width(const std::string& words, int size, const std::string& font) {
    if (words.empty()) return 0;
    const oiio::ROI box = oiio::ImageBufAlgo::text_size(words, size, font);
    return box.defined() ? box.width() : 0;
}

/// Text and boxes on one grey image, in pixels from the upper left corner.
class Canvas {
public:
    Canvas(int width, int height) : buffer_(oiio::ImageSpec(width, height, 1, oiio::TypeDesc::UINT8)) {
        fill(0, 0, width, height, panel_grey);
    }
    void fill(int x, int y, int width, int height, float grey) {
        const float colour[] = {grey / 255};
        oiio::ImageBufAlgo::fill(buffer_, oiio::cspan<float>(colour), oiio::ROI(x, x + width, y, y + height));
    }
    /// Black on the left to the brightest grey on the right.
    void ramp(int x, int y, int width, int height, int brightest) {
        for (int i = 0; i < width; ++i) {
            const float share = static_cast<float>(i) / static_cast<float>(std::max(1, width - 1));
            fill(x + i, y, 1, height, static_cast<float>(brightest) * share);
        }
    }
    void write(const std::string& words, int x, int baseline, int size, const std::string& font, float grey,
               bool right = false) {
        if (words.empty()) return;
        // render_text needs the colour of every channel; it knows alignment on the baseline.
        const float colour[] = {grey / 255};
        const auto align = right ? oiio::ImageBufAlgo::TextAlignX::Right : oiio::ImageBufAlgo::TextAlignX::Left;
        if (!oiio::ImageBufAlgo::render_text(buffer_, x, baseline, words, size, font, oiio::cspan<float>(colour), align,
                                             oiio::ImageBufAlgo::TextAlignY::Baseline)) {
            throw std::runtime_error("cannot write text: " + buffer_.geterror());
        }
    }
    std::pair<int, int> size() const { return {buffer_.spec().width, buffer_.spec().height}; }
    std::vector<unsigned char> pixels() const {
        std::vector<unsigned char> out(buffer_.spec().image_pixels());
        if (!buffer_.get_pixels(buffer_.roi(), oiio::TypeDesc::UINT8, out.data()))
            throw std::runtime_error(buffer_.geterror());
        return out;
    }

private:
    oiio::ImageBuf buffer_;
};

struct Section {
    std::string title;
    std::vector<std::pair<std::string, std::string>> lines;
};

struct Legend {
    int width = 0, height = 0;
    std::string title, subtitle;
    std::vector<Section> sections;
    std::string scale_title, black, white;
    int brightest = 255;
};

Legend read_legend(const json& in) {
    Legend legend;
    legend.width = in.at("width");
    legend.height = in.at("height");
    legend.title = in.at("title");
    legend.subtitle = in.at("subtitle");
    for (const json& section : in.at("sections")) {
        Section s{section.at("title"), {}};
        for (const json& line : section.at("lines")) s.lines.emplace_back(line.at(0), line.at(1));
        legend.sections.push_back(std::move(s));
    }
    legend.scale_title = in.at("scale").at("title");
    legend.black = in.at("scale").at("black");
    legend.white = in.at("scale").at("white");
    legend.brightest = in.at("scale").at("brightest");
    return legend;
}

/// The sizes that follow from the size of the letters.
struct Type {
    int letter;
    int line() const { return static_cast<int>(std::lround(letter * 1.5)); }
    int small() const { return std::max(8, static_cast<int>(std::lround(letter * 0.8))); }
    int title() const { return static_cast<int>(std::lround(letter * 1.7)); }
    int margin() const { return static_cast<int>(std::lround(letter * 1.4)); }
    int gap() const { return static_cast<int>(std::lround(letter * 0.75)); }
    int section(const Section& s) const { return gap() + line() * (1 + static_cast<int>(s.lines.size())); }
    int head() const { return title() + static_cast<int>(std::lround(1.6 * small())) + gap(); }
    int scale() const { return gap() + line() + letter + line(); }
};

/// Wide enough for the longest line, label and value a space apart.
int column_width(const Legend& legend, const Type& type, const Fonts& fonts) {
    int width = std::max(text_width(legend.title, type.title(), fonts.bold),
                         text_width(legend.scale_title, type.small(), fonts.bold));
    width = std::max(width, text_width(legend.black, type.letter, fonts.regular) +
                                text_width(legend.white, type.letter, fonts.regular) + 2 * type.letter);
    for (const Section& section : legend.sections) {
        for (const auto& [label, value] : section.lines) {
            const int gap = label.empty() ? 0 : static_cast<int>(1.5 * type.letter);
            width = std::max(width, text_width(label, type.letter, fonts.regular) + gap +
                                        text_width(value, type.letter, fonts.regular));
        }
    }
    return width;
}

int draw_head(Canvas& canvas, const Legend& legend, const Type& type, const Fonts& fonts, int x, int y) {
    canvas.write(legend.title, x, y + type.title(), type.title(), fonts.bold, title_grey);
    canvas.write(legend.subtitle, x, y + type.title() + static_cast<int>(std::lround(1.6 * type.small())), type.small(),
                 fonts.regular, label_grey);
    return y + type.head();
}

int draw_section(Canvas& canvas, const Section& section, const Type& type, const Fonts& fonts, int x, int y,
                 int width) {
    y += type.gap();
    canvas.write(section.title, x, y + type.letter, type.small(), fonts.bold, label_grey);
    const int after = x + text_width(section.title, type.small(), fonts.bold) + type.gap();
    canvas.fill(after, y + type.letter - type.small() / 3, std::max(0, x + width - after), 1, rule_grey);
    y += type.line();
    for (const auto& [label, value] : section.lines) {
        canvas.write(label, x, y + type.letter, type.letter, fonts.regular, label_grey);
        canvas.write(value, x + width, y + type.letter, type.letter, fonts.regular, value_grey, true);
        y += type.line();
    }
    return y;
}

int draw_scale(Canvas& canvas, const Legend& legend, const Type& type, const Fonts& fonts, int x, int y, int width) {
    y += type.gap();
    canvas.write(legend.scale_title, x, y + type.letter, type.small(), fonts.bold, label_grey);
    y += type.line();
    canvas.fill(x, y, width, type.letter, rule_grey);
    canvas.ramp(x + 1, y + 1, width - 2, type.letter - 2, legend.brightest);
    y += type.letter + type.gap() / 2;
    canvas.write(legend.black, x, y + type.letter, type.letter, fonts.regular, value_grey);
    canvas.write(legend.white, x + width, y + type.letter, type.letter, fonts.regular, value_grey, true);
    return y + type.line();
}

Canvas draw_right(const Legend& legend, const Type& type, const Fonts& fonts) {
    const int width = column_width(legend, type, fonts);
    Canvas canvas(width + 2 * type.margin(), legend.height);
    canvas.fill(0, 0, 1, legend.height, rule_grey);
    const int x = type.margin();
    int y = draw_head(canvas, legend, type, fonts, x, type.margin());
    for (const Section& section : legend.sections) y = draw_section(canvas, section, type, fonts, x, y, width);
    draw_scale(canvas, legend, type, fonts, x, y, width);
    return canvas;
}

/// Sections in as many columns as fit, each put into the shortest one so far, in their order.
Canvas draw_below(const Legend& legend, const Type& type, const Fonts& fonts) {
    const int least = column_width(legend, type, fonts);
    const int whole = std::max(legend.width, least + 2 * type.margin());
    const int space = whole - 2 * type.margin();
    const int between = 2 * type.margin();
    const int columns = std::clamp((space + between) / (least + between), 1, 4);
    const int width = (space - (columns - 1) * between) / columns;
    std::vector<int> bottom(static_cast<std::size_t>(columns), 0);
    struct Place {
        int column, y;
    };
    std::vector<Place> places;
    const auto place = [&](int height) {
        const auto lowest = std::min_element(bottom.begin(), bottom.end());
        places.push_back({static_cast<int>(lowest - bottom.begin()), *lowest});
        *lowest += height;
    };
    place(type.head());
    for (const Section& section : legend.sections) place(type.section(section));
    place(type.scale());
    int height = *std::max_element(bottom.begin(), bottom.end()) + 2 * type.margin();
    if (height == legend.height) ++height;  // the height tells the main program where the panel goes
    Canvas canvas(whole, height);
    canvas.fill(0, 0, whole, 1, rule_grey);
    const auto x = [&](std::size_t i) { return type.margin() + places[i].column * (width + between); };
    draw_head(canvas, legend, type, fonts, x(0), type.margin() + places[0].y);
    for (std::size_t i = 0; i < legend.sections.size(); ++i) {
        draw_section(canvas, legend.sections[i], type, fonts, x(i + 1), type.margin() + places[i + 1].y, width);
    }
    const std::size_t last = places.size() - 1;
    draw_scale(canvas, legend, type, fonts, x(last), type.margin() + places[last].y, width);
    return canvas;
}

Canvas draw(const Legend& legend) {
    const Fonts fonts;
    // The largest letters with which one column stands beside the picture.
    for (int letter = std::min(22, std::max(legend.width, legend.height) / 48); letter >= 10; --letter) {
        const Type type{letter};
        int height = 2 * type.margin() + type.head() + type.scale();
        for (const Section& section : legend.sections) height += type.section(section);
        if (height <= legend.height) return draw_right(legend, type, fonts);
    }
    // Or below it, as large as the width allows; smaller ones nobody reads.
    for (int letter = std::clamp(legend.width / 48, 10, 20); letter > 10; --letter) {
        if (column_width(legend, Type{letter}, fonts) + 2 * Type{letter}.margin() <= legend.width)
            return draw_below(legend, Type{letter}, fonts);
    }
    return draw_below(legend, Type{10}, fonts);
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 2 || std::string(arguments[1]) != "legend") {
        std::fputs("usage: wedgescope_picture legend < legend.json > panel.pgm\n", stderr);
        return 2;
    }
    try {
        const std::string input{std::istreambuf_iterator<char>(std::cin), {}};
        const Legend legend = read_legend(json::parse(input));
        if (legend.width < 1 || legend.height < 1 || legend.width > 100000 || legend.height > 100000)
            throw std::runtime_error("size out of bounds");
        oiio::attribute("threads", 1);
        const Canvas canvas = draw(legend);
        const auto pixels = canvas.pixels();
        const auto size = canvas.size();
        std::printf("P5\n%d %d\n255\n", size.first, size.second);
        const bool whole =
            std::fwrite(pixels.data(), 1, pixels.size(), stdout) == pixels.size() && std::fflush(stdout) == 0;
        if (!whole) throw std::runtime_error("cannot write the panel");
        return 0;
    } catch (const std::exception& e) {
        std::printf("%s", e.what());  // to the main program, which makes one message of it
        return 1;
    }
}
