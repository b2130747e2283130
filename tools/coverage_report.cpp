#include "tools/coverage_report.hpp"

#include "lib/error.hpp"
#include "tools/keys.hpp"
#include "tools/scene_json.hpp"

namespace wedgescope {

using json = nlohmann::ordered_json;

json coverage_parameters(const Settings& settings) {
    json out = json::object();
    for (const Key& key : key_table()) {
        if (!(key.commands & command_coverage) || !key.changes_result) continue;
        const auto value = key.get(settings);
        out[key.name] = value ? json(*value) : json(nullptr);
    }
    return out;
}

json coverage_scene(const Settings& settings) {
    json out = coverage_parameters(settings);
    out["resolved"] = {{"quality", word(settings.scene.quality)}};
    return out;
}

json quadrant_json(const QuadrantReport& q) {
    return json{{"cpu_s", {{"load", q.load_s}, {"sweep", q.sweep_s}}},
                {"cpu_total_s", q.load_s + q.sweep_s},
                {"disk_wait_s", q.disk_wait_s},
                {"runs", q.runs},
                {"posts_read", q.posts_read},
                {"posts_passed", q.posts_passed},
                {"bytes_read", q.bytes_read},
                {"bytes_spilled", q.bytes_spilled}};
}

std::vector<StageWork> coverage_stages(const QuadrantReport& total, const DataBase& db, double write_s,
                                       std::uint64_t written_bytes, const Usage& usage) {
    // Posts pass as they are stored.
    const double posts = static_cast<double>(total.posts_read) * static_cast<double>(db.post_bytes);
    return {load_work(total.load_s, total.bytes_read, usage),
            {"sweep", total.sweep_s, posts, StageWork::memory},
            {"write", write_s, static_cast<double>(written_bytes), StageWork::write}};
}

std::string nothing_judged_line(const Settings& settings) {
    return text("nothing of ", in_quotes(settings.dem),
                " lies within range, sector and pitch, or all of it is void; all of ", in_quotes(settings.output),
                " is no data or out of range");
}

RasterFormat coverage_format(const Settings& settings) {
    RasterFormat format;
    format.driver = settings.driver;
    format.creation = settings.creation;
    format.reproducible = settings.same_bytes();
    format.version = version();
    format.scene_json = json_line(coverage_parameters(settings));
    return format;
}

}  // namespace wedgescope
