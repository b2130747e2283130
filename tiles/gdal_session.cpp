#include "tiles/gdal_session.hpp"

#include <cpl_conv.h>
#include <dlfcn.h>
#include <gdal_frmts.h>
#include <malloc.h>
#include <ogr_srs_api.h>
#include <ogrsf_frmts.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>

#include "lib/error.hpp"
#include "lib/large_blocks.hpp"
#include "lib/lower_case.hpp"
#include "tiles/gdal_handle.hpp"

/// Of late_libraries.cpp; null where GDAL is linked as other libraries are.
extern "C" __attribute__((weak)) bool wedgescope_late_gdal_loaded() noexcept;
extern "C" __attribute__((weak)) void* wedgescope_late_gdal_function(const char* name) noexcept;

namespace wedgescope {
namespace {

bool gdal_is_loaded() { return !wedgescope_late_gdal_loaded || wedgescope_late_gdal_loaded(); }

/// One line, without a full stop at its end.
std::string one_line(std::string message) {
    std::replace_if(
        message.begin(), message.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
    while (!message.empty() && (message.back() == ' ' || message.back() == '.')) message.pop_back();
    constexpr std::size_t longest = 300;
    if (message.size() > longest) message = message.substr(0, longest) + "...";
    return message;
}

/// GDAL_CACHEMAX as GDAL reads it: megabytes below 100000, else bytes. A share of memory ("10%") is left to GDAL.
std::optional<GIntBig> cache_max(const std::string& value) {
    GIntBig number = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
    if (error != std::errc{} || end != value.data() + value.size() || number < 0) return std::nullopt;
    return number < 100000 ? number * (GIntBig{1} << 20) : number;
}

std::atomic<std::uint64_t> sessions = 0;

/// What GDAL is to be told.
struct Wishes {
    std::mutex mutex;
    std::size_t cache_bytes = 0;
    std::vector<std::pair<std::string, std::string>> config;
    std::vector<std::pair<std::string, std::optional<std::string>>> before;  ///< what GDAL had of these; none: nothing
    std::optional<std::size_t> later_cache_bytes;
};
Wishes& wishes() {
    static Wishes all;
    return all;
}

constexpr const char* pool_size = "GDAL_MAX_DATASET_POOL_SIZE";

/// One for each MiB of cached blocks, for the blocks of a part that is closed go with it. GDAL fails where all that may
/// be open are in use at once, so there are two for each of the machine's threads.
std::size_t parts_for(std::size_t cache_bytes) {
    const std::size_t in_use = 2 * std::max<std::size_t>(1, std::thread::hardware_concurrency());
    return std::max(in_use, std::clamp<std::size_t>(cache_bytes >> 20, 8, 32));
}

/// Those only that know their files by themselves, so that no other driver would have been asked first.
void register_usual() {
    GDALRegister_VRT();
    GDALRegister_GTiff();
    GDALRegister_SRTMHGT();
    GDALRegister_DTED();
    GDALRegister_PNG();
    GDALRegister_AAIGrid();
    GDALRegister_MEM();
}

}  // namespace

void GdalErrors::hear(CPLErr level, CPLErrorNum, const char* message) {
    if (level == CE_Debug) {  // --config CPL_DEBUG ON
        CPLDefaultErrorHandler(level, 0, message);
        return;
    }
    auto* self = static_cast<GdalErrors*>(CPLGetErrorHandlerUserData());
    const std::string line = one_line(message);
    if (level == CE_Warning) {
        if (self->warning_.empty()) self->warning_ = line;
    } else if (level >= CE_Failure) {
        self->failed_ = true;
        self->note_disk();
        if (self->failure_.empty()) self->failure_ = line;
        self->last_ = line;
    }
}

void GdalErrors::note_disk() {
    // Full or bad.
    for (const int of_disk : {ENOSPC, EFBIG, EDQUOT, EIO})
        if (errno == of_disk) disk_error_ = errno;
    errno = 0;
}

std::string GdalErrors::reason() const {
    if (failure_.empty()) return warning_.empty() ? "GDAL gives no reason" : warning_;
    // The first tells the cause, the last the consequence; one that holds the other says it all.
    if (failure_.find(last_) != std::string::npos) return failure_;
    if (last_.find(failure_) != std::string::npos) return last_;
    return failure_ + "; " + last_;
}

std::string GdalErrors::reason_beside(const std::string& path) const {
    std::string said = reason();
    if (said.starts_with(path + ": ")) said.erase(0, path.size() + 2);
    return said;
}

std::string GdalErrors::reason_of_writing(const std::string& written_path) const {
    if (disk_error_ != 0) return system_reason(disk_error_);
    std::string said = reason();
    const auto erase = [&](std::size_t at, std::size_t end) {
        while (end < said.size() && (said[end] == ':' || said[end] == ' ')) ++end;
        said.erase(at, end - at);
    };
    for (std::size_t at = 0; !written_path.empty() && (at = said.find(written_path, at)) != std::string::npos;)
        erase(at, at + written_path.size());
    for (std::size_t at = 0; (at = lower_case(said).find("tiff", at)) != std::string::npos;) {
        const auto in_name = [&](std::size_t i) {
            return i < said.size() && (std::isalnum(static_cast<unsigned char>(said[i])) || said[i] == '_');
        };
        std::size_t begin = at, end = at;
        while (begin > 0 && in_name(begin - 1)) --begin;
        while (in_name(end)) ++end;
        at = end;
        if (end < said.size() && said[end] == ':') erase(at = begin, end);
    }
    const std::size_t begin = std::min(said.find_first_not_of(", "), said.size());  // of what stood behind a path
    said.erase(0, begin);
    if (said.empty()) said = "GDAL gives no reason";
    if (written_path.empty()) return said;
    // Some drivers tell of a block that could not be written when the next one comes: errno knows no more of it then.
    constexpr std::uintmax_t least_free_bytes = 4096;
    std::error_code unknown;
    const auto disk = std::filesystem::space(std::filesystem::path(written_path).parent_path(), unknown);
    return !unknown && disk.available < least_free_bytes ? text(said, "; ", system_reason(ENOSPC)) : said;
}

OGRSpatialReference in_gdal(const Crs& crs) {
    OGRSpatialReference out;
    GdalErrors quiet;
    out.importFromWkt(crs.wkt().c_str());
    out.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    return out;
}

std::shared_ptr<const Crs> from_gdal(const OGRSpatialReference& crs) {
    if (crs.IsEmpty()) return nullptr;
    GdalErrors quiet;
    char* words = nullptr;
    const char* const options[] = {"FORMAT=WKT2_2019", nullptr};
    const bool good = crs.exportToWkt(&words, options) == OGRERR_NONE && words;
    const std::string wkt = good ? words : "";
    CPLFree(words);
    std::string reason;
    if (auto own = Crs::read(wkt, reason)) return own;
    const char* name = crs.GetName();
    throw DataError(text("the CRS '", name ? name : "", "' is none that PROJ can write and read again: ", reason));
}

std::shared_ptr<const Crs> crs_of(OGRLayer& layer) {
    const OGRSpatialReference* given = layer.GetSpatialRef();
    const char* name = given ? given->GetName() : nullptr;
    // GDAL's word for a GeoPackage's layer that was given none.
    if (!given || (name && std::string_view(name).starts_with("Undefined geographic SRS"))) return nullptr;
    return from_gdal(*given);
}

void register_usual_drivers() {
    static std::once_flag once;
    std::call_once(once, register_usual);
}

void register_all_drivers() {
    static std::once_flag once;
    std::call_once(once, [] { GDALAllRegister(); });
}

GdalSession::GdalSession(std::size_t cache_bytes, const std::vector<std::pair<std::string, std::string>>& config) {
    ++sessions;
    // Left to itself malloc would keep dozens of blocks of up to 32 MiB. Smaller ones are worth keeping: to fetch zeroed pages
    // again and again costs a fifth of a run. So are a wedge's for the next, while they take no more than there once was.
    const auto large =
        static_cast<int>(std::clamp<std::size_t>(cache_bytes / 8, std::size_t{1} << 20, std::size_t{8} << 20));
    mallopt(M_MMAP_THRESHOLD, large);
    mallopt(M_TRIM_THRESHOLD, 2 * large);
    keep_large_blocks(std::max(static_cast<std::size_t>(large), std::size_t{2} << 20),
                      std::min(cache_bytes / 2, std::size_t{32} << 20));
    for (const auto& [key, value] : config)
        if (key.empty()) throw InputError(text("config '=", value, "' has no name; accepted: --config NAME=VALUE"));
    {
        const std::lock_guard lock(wishes().mutex);
        wishes().cache_bytes = cache_bytes;
        wishes().config = config;
        wishes().later_cache_bytes.reset();
    }
    if (gdal_is_loaded()) settle();
}

void GdalSession::settle() {
    std::size_t cache_bytes = 0;
    std::vector<std::pair<std::string, std::string>> config;
    {
        const std::lock_guard lock(wishes().mutex);
        cache_bytes = wishes().cache_bytes;
        config = wishes().config;
    }
    CPLSetErrorHandler(CPLQuietErrorHandler);
    // Each handle of a VRT gets its own sources: handles wander between threads, shared sources may not.
    CPLSetConfigOption("VRT_SHARED_SOURCE", "0");
    // Each part of a VRT that stays open keeps buffers of its own.
    CPLSetConfigOption(pool_size, std::to_string(parts_for(cache_bytes)).c_str());
    OSRSetPROJEnableNetwork(0);
    // Not by way of register_usual_drivers(): a thread within its call_once may be waiting for this one.
    register_usual();
    GDALSetCacheMax64(static_cast<GIntBig>(cache_bytes));
    decltype(Wishes::before) before;
    for (const auto& [key, value] : config) {
        const char* const had = CPLGetConfigOption(key.c_str(), nullptr);
        before.emplace_back(key, had ? std::optional<std::string>(had) : std::nullopt);
        CPLSetConfigOption(key.c_str(), value.c_str());
        // The cache is a part of the memory that is granted: it may be smaller.
        if (EQUAL(key.c_str(), "GDAL_CACHEMAX"))
            if (const auto bytes = cache_max(value))
                GDALSetCacheMax64(std::min(*bytes, static_cast<GIntBig>(cache_bytes)));
    }
    // GDAL's cache of what files hold would be beside the memory that is granted.
    CPLSetConfigOption("VSI_CACHE", "FALSE");
    // Last, for another thread may have asked meanwhile; and not under the lock, for which it may be waiting.
    std::optional<std::size_t> later_cache_bytes;
    {
        const std::lock_guard lock(wishes().mutex);
        wishes().before = std::move(before);
        later_cache_bytes = wishes().later_cache_bytes;
    }
    if (later_cache_bytes) GDALSetCacheMax64(static_cast<GIntBig>(*later_cache_bytes));
}

// GDAL takes its drivers down itself when the program ends; whoever still holds a raster then does no harm.
// Its config ends with the session.
GdalSession::~GdalSession() {
    decltype(Wishes::before) before;
    {
        const std::lock_guard lock(wishes().mutex);
        before.swap(wishes().before);
        wishes().config.clear();
    }
    for (auto one = before.rbegin(); one != before.rend(); ++one)
        CPLSetConfigOption(one->first.c_str(), one->second ? one->second->c_str() : nullptr);
}

std::size_t GdalSession::most_parts_open() {
    constexpr int gdals_own = 100;
    return static_cast<std::size_t>(std::max(2, std::atoi(CPLGetConfigOption(pool_size, text(gdals_own).c_str()))));
}

void GdalSession::set_cache_bytes(std::size_t bytes) {
    {
        const std::lock_guard lock(wishes().mutex);
        wishes().later_cache_bytes = bytes;
    }
    if (gdal_is_loaded()) GDALSetCacheMax64(static_cast<GIntBig>(bytes));
}

std::size_t GdalSession::cache_used_bytes() {
    return gdal_is_loaded() ? static_cast<std::size_t>(GDALGetCacheUsed64()) : 0;
}

bool GdalSession::configured() {
    // These change no file, nor what is read from one.
    constexpr std::string_view harmless[] = {"GDAL_CACHEMAX", "GDAL_NUM_THREADS", "CPL_DEBUG", "GDAL_DATA",
                                             "GDAL_DRIVER_PATH"};
    const auto matters = [&](std::string name) {
        std::transform(name.begin(), name.end(), name.begin(),
                       [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
        return std::find(std::begin(harmless), std::end(harmless), name) == std::end(harmless);
    };
    {
        const std::lock_guard lock(wishes().mutex);
        for (const auto& [name, value] : wishes().config)
            if (matters(name)) return true;
    }
    constexpr std::string_view gdals[] = {"GDAL_", "GTIFF_", "OSR_", "CPL_"};
    for (char** variable = environ; variable && *variable; ++variable) {
        const std::string_view name = std::string_view(*variable).substr(0, std::strcspn(*variable, "="));
        const auto begins = [&](std::string_view words) { return name.starts_with(words); };
        if (std::any_of(std::begin(gdals), std::end(gdals), begins) && matters(std::string(name))) return true;
    }
    // Where GDAL looks for options by itself.
    const char* const home = std::getenv("HOME");
    return ::access("/etc/gdal/gdalrc", F_OK) == 0 ||
           (home && ::access((std::string(home) + "/.gdal/gdalrc").c_str(), F_OK) == 0);
}

std::uint64_t GdalSession::number() { return sessions; }

void* GdalSession::function(const char* name) {
    return wedgescope_late_gdal_function ? wedgescope_late_gdal_function(name) : ::dlsym(RTLD_DEFAULT, name);
}

std::string GdalSession::gdal_version() { return GDALVersionInfo("RELEASE_NAME"); }

}  // namespace wedgescope
