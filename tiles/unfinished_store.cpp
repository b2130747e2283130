#include "tiles/unfinished_store.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <system_error>
#include <vector>

#include "lib/error.hpp"
#include "tiles/claim.hpp"
#include "tiles/folder_entries.hpp"
#include "tiles/json_text.hpp"
#include "tiles/sources.hpp"
#include "tiles/store_manifest.hpp"
#include "tiles/tile_store.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

constexpr const char* unfinished_ending = ".part";

/// What a store of this build or an earlier one holds, by its path in the store: an unreadable manifest is to be replaced too.
bool is_stores_own(const fs::path& path) {
    const std::string file = path.filename().string(), folder = path.parent_path().string();
    const auto ends = [&](const std::string& stem, std::initializer_list<const char*> endings) {
        return std::any_of(endings.begin(), endings.end(), [&](const char* end) { return file == stem + end; });
    };
    for (const StoreLayerKind kind : {StoreLayerKind::dem, StoreLayerKind::culture, StoreLayerKind::culture_height}) {
        // GDAL and those who use it write statistics and overviews beside a raster, this program a map of its ground.
        if (folder.empty() &&
            ends(name(kind), {".vrt", ".vrt.aux.xml", ".vrt.ovr", ".vrt.msk", ".vrt.ground", ".vrt.tmp"}))
            return true;
        std::int64_t column = 0, row = 0;
        if (folder == name(kind) && std::sscanf(file.c_str(), "c%" SCNd64 "_r%" SCNd64, &column, &row) == 2 &&
            ends(text("c", column, "_r", row),
                 {".tif", ".sum", ".tif.aux.xml", ".tif.ovr", ".tif.msk", ".tif.ground", ".tif.tmp", ".sum.tmp"}))
            return true;
    }
    if (!folder.empty()) return false;
    for (const char* own :
         {manifest_name, store_plan_name, "unfinished.json", store_map_name, store_detail_name, store_classes_name})
        if (ends(own, {"", ".tmp"})) return true;
    return file == kept_spill_name || is_numbered(file, text(".", kept_spill_name, ".tmp-"));
}

/// Something that differs between the plan of an unfinished store and the one that is asked for, in round brackets:
/// "(layers/0/tile_size is 256 there, 512 now)".
std::string first_difference(const std::string& there, const std::string& now) {
    using nlohmann::json;
    const json before = json::parse(there), changes = json::diff(before, json::parse(now));
    const auto path_of = [](const json& change) { return change.at("path").get<std::string>(); };
    // What another raster is called says more than its size, and that more than what lies beside it.
    const auto rank = [&](const json& change) {
        const std::string path = path_of(change);
        return path.ends_with("/path") ? 0 : path.find("/files/") == std::string::npos ? 1 : 2;
    };
    const auto first = std::min_element(changes.begin(), changes.end(),
                                        [&](const json& a, const json& b) { return rank(a) < rank(b); });
    if (first == changes.end() || path_of(*first).empty()) return {};
    const auto words = [](const json& value) {
        constexpr std::size_t most = 200;
        if (const auto name = value.is_object() ? value.find("name") : value.end(); name != value.end())
            return name->dump();
        const std::string all = value.dump();
        return all.size() <= most ? all : "something long";
    };
    const std::string path = path_of(*first), op = first->at("op");
    const std::string old = op == "add" ? "missing" : words(before.at(json::json_pointer(path))),
                      own = op == "remove" ? "missing" : words(first->at("value"));
    return text(" (", path.substr(1), " is ", old, " there, ", own, " now)");
}

}  // namespace

std::string unfinished_store(const std::string& output) { return UnfinishedStore(output).folder(); }

UnfinishedStore::UnfinishedStore(const std::string& output) : output_(output) {
    while (output_.size() > 1 && output_.back() == '/') output_.pop_back();
    // Beside what a link leads to: that is replaced, not the link.
    std::error_code error;
    if (fs::is_symlink(output_, error) && fs::exists(output_, error)) output_ = fs::canonical(output_, error).string();
    folder_ = output_ + unfinished_ending;
}

std::string UnfinishedStore::inside(const std::string& file) const { return (fs::path(folder_) / file).string(); }

namespace {

/// The first of the files in a folder, by name, that no store has; empty: there is none. `error` where not all can be told.
std::string foreign_file(const std::string& folder, std::error_code& error) {
    std::set<std::string> foreign;
    for (const fs::directory_entry& entry : folder_entries<fs::recursive_directory_iterator>(folder, error))
        if (!fs::is_directory(entry.symlink_status(error)) && !is_stores_own(entry.path().lexically_relative(folder)))
            foreign.insert(entry.path().string());
    return foreign.empty() ? std::string() : *foreign.begin();
}

/// Whether a run may have begun to write this plan: it begins as every plan does, as far as it goes, or never reached the disk.
bool may_be_plan(const std::string& path) {
    constexpr std::string_view begin = "{\n \"format\": \"wedgescope-store-plan-";
    const std::string words = file_begin(path, begin.size());
    return begin.starts_with(words) || is_blank(words);
}

}  // namespace

void UnfinishedStore::check_output(bool overwrite) const {
    std::error_code error;
    const auto status = fs::symlink_status(output_, error);
    if (!fs::exists(status)) return;
    const bool replaceable = is_tile_store(output_) || (fs::is_directory(status) && fs::is_empty(output_, error));
    if (!overwrite)
        throw InputError(text("output '", output_, "' exists",
                              replaceable ? "; add --overwrite" : " and is no tile store; accepted: a new name"));
    if (!replaceable)
        throw InputError(text("output '", output_, "' is no tile store; --overwrite replaces nothing else"));
    const std::string foreign = foreign_file(output_, error);
    if (error)
        throw IoError(text("output '", output_, "' cannot be looked through, as --overwrite needs: ", error.message()));
    if (!foreign.empty())
        throw InputError(text("output '", output_, "' holds '", foreign,
                              "', which is no part of a tile store; --overwrite replaces nothing else"));
}

void UnfinishedStore::check(bool overwrite, bool resume) const {
    if (output_.empty()) throw InputError("output has an empty name; accepted: the path of a folder");
    check_output(overwrite);
    std::error_code error;
    const std::string parent = fs::path(output_).parent_path().string();
    if (!parent.empty() && !fs::is_directory(parent, error))
        throw IoError(text("output '", output_, "': there is no folder '", parent, "'"));
    if (!fs::exists(fs::symlink_status(folder_, error))) return;
    // A store of that name, or what was stopped right before its end.
    if (!resume && fs::exists(inside(manifest_name), error))
        throw InputError(text("'", folder_, "', where '", output_,
                              "' would be made, holds a finished tile store; move it away, or give output another name "
                              "(a run that was stopped right before its end ends with --resume)"));
    if (holds_else()) refuse_foreign();
    refuse_foreign_files();
    if (!overwrite && !resume)
        throw InputError(
            text("'", folder_, "' holds an unfinished run; --resume goes on with it, --overwrite starts anew"));
}

bool UnfinishedStore::holds_else() const {
    std::error_code error;
    const auto begun = [&] {
        const std::string plan = inside(store_plan_name);
        if (!fs::exists(plan, error)) return false;
        // Or JSON, where nobody else's file lies beside it: one that another version wrote.
        return may_be_plan(plan) || (file_begin(plan, 1) == "{" && foreign_file(folder_, error).empty());
    };
    if (begun() || (fs::is_directory(folder_, error) && fs::is_empty(folder_, error))) return false;
    // Another run may have begun it meanwhile, or have ended.
    return fs::exists(fs::symlink_status(folder_, error)) && !begun();
}

void UnfinishedStore::refuse_foreign() const {
    throw InputError(
        text("'", folder_, "', where '", output_, "' would be made, is no unfinished tile store; move it away"));
}

void UnfinishedStore::refuse_foreign_files() const {
    std::error_code another_run_moves_them;
    if (const std::string foreign = foreign_file(folder_, another_run_moves_them); !foreign.empty())
        throw InputError(text("'", folder_, "', where '", output_, "' would be made, holds '", foreign,
                              "', which is no part of a tile store; move it away"));
}

void UnfinishedStore::lock_plan() {
    auto plan = std::make_unique<PlainFile>(inside(store_plan_name), PlainFile::Use::write);
    // Another run may have finished and moved it just before.
    if (!plan->lock() || !plan->stands()) throw IoError(text("'", folder_, "' is in use by another run"));
    plan_ = std::move(plan);
}

void UnfinishedStore::open(const std::string& plan, bool resume) {
    std::error_code error;
    const std::string plan_path = inside(store_plan_name);
    bool planned = false;  // it stands there
    if (::mkdir(folder_.c_str(), 0777) == 0) {
        try {
            lock_plan();
        } catch (const IoError&) {
            ::rmdir(folder_.c_str());
            throw;
        }
    } else if (const int number = errno; number != EEXIST) {
        throw IoError(text("output folder '", folder_, "' cannot be made: ", system_reason(number)));
    } else {
        if (holds_else()) refuse_foreign();
        const bool ours = fs::exists(plan_path, error);
        lock_plan();
        if (resume && ours) {
            const std::string found = file_text(plan_path, std::size_t{1} << 28);
            // Empty or cut short: nobody knows what of.
            const bool whole = is_shallow_json(found) && nlohmann::json::accept(found);
            planned = found == plan;
            if (whole && !planned) {
                plan_.reset();
                throw InputError(
                    text("'", folder_, "' was begun with other rasters or options, or a raster has changed since",
                         first_difference(found, plan),
                         fs::exists(inside(manifest_name), error) ? "; it is whole: move it away"
                                                                  : "; --overwrite without --resume starts anew"));
            }
        }
        if (!planned) {
            refuse_foreign_files();
            remove_all_but_plan();
        }
    }
    if (!planned) {
        plan_->resize(0);
        plan_->write(0, plan.data(), plan.size());
        plan_->sync();
    }
}

void UnfinishedStore::make_folder(const std::string& name) {
    const std::string path = inside(name);
    std::error_code error;
    fs::create_directories(path, error);
    if (error) throw IoError(text("'", path, "' cannot be made: ", error.message()));
    for (const fs::directory_entry& entry : folder_entries(path, error))
        if (!error && entry.path().extension() == ".tmp") fs::remove(entry.path(), error);
    if (error) throw IoError(text("'", path, "' cannot be cleared: ", error.message()));
}

void UnfinishedStore::remove_all_but_plan() const {
    std::error_code error;
    fs::remove(inside(manifest_name), error);  // first: what is left by one killed here is no finished store
    for (const fs::directory_entry& entry : folder_entries(folder_, error))
        if (!error && entry.path().filename() != store_plan_name) fs::remove_all(entry.path(), error);
    if (error) throw IoError(text("'", folder_, "' cannot be cleared: ", error.message()));
}

bool UnfinishedStore::remove_folder() const noexcept {
    try {
        remove_all_but_plan();  // which tells one killed here what the rest is
        return fs::remove_all(folder_) > 0;
    } catch (const std::exception&) {
        return false;
    }
}

bool UnfinishedStore::close(bool keep_sheets) noexcept {
    if (!plan_) return false;
    bool kept = false;
    try {
        std::error_code ignored;
        const auto all = folder_entries<fs::recursive_directory_iterator>(folder_, ignored);
        const auto ends = [](const char* ending) {
            return [ending](const fs::directory_entry& entry) { return entry.path().extension() == ending; };
        };
        kept = keep_sheets && std::any_of(all.begin(), all.end(), ends(".sum"));
        for (const fs::directory_entry& entry : all)
            if (kept && ends(".tmp")(entry)) fs::remove(entry.path(), ignored);
    } catch (const std::exception&) {  // no memory for their names: they stay
        return keep_sheets;
    }
    if (!kept) remove_folder();
    plan_.reset();
    return kept;
}

void UnfinishedStore::replace_output() {
    // Who opens the folder when the earlier store lies there meets its plan: nobody is to take that for a run that was left.
    std::error_code error;
    const std::string its_plan = (fs::path(output_) / store_plan_name).string();
    std::unique_ptr<PlainFile> other;
    try {
        if (fs::is_regular_file(its_plan, error)) other = std::make_unique<PlainFile>(its_plan, PlainFile::Use::write);
    } catch (const IoError&) {  // it is read-only: nobody goes on with it
    }
    if (other) other->lock();
    const auto stays = [&](const std::string& where) {
        throw IoError(text("output '", output_, "' is whole, but of the store before it something stays in '", where,
                           "', which cannot be removed"));
    };
    constexpr unsigned exchange = 2;  // both names change at once where the system can do that
    if (::syscall(SYS_renameat2, AT_FDCWD, folder_.c_str(), AT_FDCWD, output_.c_str(), exchange) == 0) {
        plan_.reset();  // it stands at the output now
        if (!remove_folder()) stays(folder_);
        return;
    }
    if (const int number = errno; number != EINVAL && number != ENOSYS && number != EOPNOTSUPP)
        throw IoError(text("output '", output_, "' cannot be replaced by '", folder_, "': ", system_reason(number)));
    std::string old = output_ + ".old";
    for (int i = 1; fs::exists(fs::symlink_status(old, error)); ++i) old = text(output_, ".old", i);
    rename_path(output_, old);
    try {
        rename_path(folder_, output_);
    } catch (const IoError&) {
        rename_path(old, output_);
        throw;
    }
    plan_.reset();
    fs::remove_all(old, error);
    if (error) stays(old);
}

void UnfinishedStore::move_into_place(bool overwrite) {
    // What came to stand there since the run began is looked at as what stood there before.
    const int number = rename_new(folder_, output_);
    if (number == EEXIST) {
        check_output(overwrite);
        replace_output();
    } else if (number != 0) {
        throw IoError(
            text("output '", output_, "' cannot be put in place of '", folder_, "': ", system_reason(number)));
    }
    plan_.reset();
    const std::string parent = fs::path(output_).parent_path().string();
    sync_directory(parent.empty() ? "." : parent);
}

}  // namespace wedgescope
