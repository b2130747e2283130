// Takes from a run's report what bench/run.sh prints: report_figures REPORT.json writes one line,
//   CPU seconds of sample + sweep + shade in all wedges, of deposit, cells in shadow, cells seen
#include <fmt/format.h>

#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>

int main(int argc, char** argv) {
    if (argc != 2) {
        fmt::print(stderr, "usage: report_figures REPORT.json\n");
        return 2;
    }
    try {
        std::ifstream file(argv[1]);
        const nlohmann::json report = nlohmann::json::parse(file);
        double sweep_s = 0, deposit_s = 0;
        for (const auto& wedge : report.at("wedges")) {
            const auto& cpu = wedge.at("cpu_s");
            for (const char* stage : {"sample", "sweep", "shade"}) sweep_s += cpu.at(stage).get<double>();
            deposit_s += cpu.at("deposit").get<double>();
        }
        const auto& states = report.at("states");
        fmt::print("{:.4f} {:.4f} {} {}\n", sweep_s, deposit_s, states.at("shadow").get<std::uint64_t>(),
                   states.at("seen").get<std::uint64_t>());
    } catch (const std::exception& error) {
        fmt::print(stderr, "report_figures: {}: {}\n", argv[1], error.what());
        return 1;
    }
}
