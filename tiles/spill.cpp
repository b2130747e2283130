#include "tiles/spill.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/claim.hpp"

namespace wedgescope {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::uint32_t block_mark = 0x4B425357;            // "WSBK"
constexpr std::uint64_t file_mark = 0x314C4C4950535357ULL;  // "WSSPILL1"
constexpr std::size_t staging_bytes = std::size_t{1} << 20;

thread_local std::uint64_t read_here = 0;  ///< bytes, by this thread

struct BlockHeader {
    std::uint32_t mark = block_mark;
    std::uint32_t bytes = 0;
    std::uint64_t place = 0;
    std::uint64_t checksum = 0;
};
static_assert(sizeof(BlockHeader) == Spill::file_overhead);

struct FileHeader {
    std::uint64_t mark = file_mark;
    std::uint64_t index_offset = 0, index_bytes = 0, index_checksum = 0;
    std::uint64_t unused[3] = {};
    std::uint64_t checksum = 0;
};
static_assert(sizeof(FileHeader) == Spill::header_bytes);

/// Names of files that are to have none, or not yet their own.
constexpr const char* named_spill = ".wedgescope-spill-";
std::string keep_stem(const std::string& path) {
    return text(".", std::filesystem::path(path).filename().string(), ".tmp-");
}

std::uint64_t checksum_of(const BlockHeader& header, const std::byte* bytes, std::size_t n) {
    return checksum(bytes, n, checksum(&header, offsetof(BlockHeader, checksum)));
}
std::uint64_t checksum_of(const FileHeader& header) { return checksum(&header, offsetof(FileHeader, checksum)); }

std::uint64_t place_of(std::size_t layer, std::int64_t column, std::int64_t row) {
    constexpr std::uint64_t mask = (std::uint64_t{1} << 28) - 1;
    return static_cast<std::uint64_t>(layer) << 56 | (static_cast<std::uint64_t>(column) & mask) << 28 |
           (static_cast<std::uint64_t>(row) & mask);
}

std::string place(const SpillLayer& layer, std::int64_t column, std::int64_t row) {
    const Window posts = layer.posts(column, row);
    return text("block of the ", layer.name, " at columns ", posts.columns.begin, " to ", posts.columns.end - 1,
                ", rows ", posts.rows.begin, " to ", posts.rows.end - 1);
}

/// Values one after the other; take() returns false at the end.
class IndexText {
public:
    IndexText() = default;
    explicit IndexText(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {}
    void put(const void* from, std::size_t n) {
        const auto* first = static_cast<const std::byte*>(from);
        bytes_.insert(bytes_.end(), first, first + n);
    }
    template <class Value>
    void put(const Value& value) {
        put(&value, sizeof value);
    }
    void put_string(const std::string& s) {
        put(static_cast<std::uint64_t>(s.size()));
        put(s.data(), s.size());
    }
    template <class Value>
    bool take(Value& value) {
        if (bytes_.size() - at_ < sizeof value) return false;
        std::memcpy(&value, bytes_.data() + at_, sizeof value);
        at_ += sizeof value;
        return true;
    }
    bool take_string(std::string& s) {
        std::uint64_t n = 0;
        if (!take(n) || n > bytes_.size() - at_) return false;
        s.assign(reinterpret_cast<const char*>(bytes_.data()) + at_, n);
        at_ += n;
        return true;
    }
    std::size_t left() const { return bytes_.size() - at_; }
    const std::vector<std::byte>& bytes() const { return bytes_; }

private:
    std::vector<std::byte> bytes_;
    std::size_t at_ = 0;
};

}  // namespace

std::string temporary_folder() {
    for (const char* name : {"CPL_TMPDIR", "TMPDIR"})
        if (const char* folder = std::getenv(name); folder && *folder) return folder;
    return "/tmp";
}

Spill::Spill(SpillParams params) : params_(std::move(params)) {
    if (!params_.keep.empty())
        params_.folder = std::filesystem::absolute(params_.keep).parent_path().string();
    else if (params_.folder.empty())
        params_.folder = temporary_folder();
    buckets_.resize(static_cast<std::size_t>(std::max(1, params_.buckets)));
}

Spill::~Spill() {
    if (file_ >= 0) ::close(file_);
    if (!unnamed_.empty()) ::unlink(unnamed_.c_str());
}

std::uint64_t Spill::bytes_read_here() { return read_here; }

std::string Spill::named() const {
    return params_.keep.empty() ? text("the spill file in temp-dir '", params_.folder, "'")
                                : text("the kept spill '", params_.keep, "'");
}

void Spill::open_file() {
    if (file_ >= 0) return;
    const auto fail = [&](int reason) {
        throw IoError(text(named(), " cannot be made: ", system_reason(reason),
                           params_.keep.empty() ? "; accepted: a folder that can be written to" : ""));
    };
    struct stat facts {};
    if (::stat(params_.folder.c_str(), &facts) != 0) fail(errno);
    if (!S_ISDIR(facts.st_mode)) fail(ENOTDIR);
    remove_left_behind(params_.folder, [&](const std::string& name) {
        return name.starts_with(named_spill) || (!params_.keep.empty() && is_numbered(name, keep_stem(params_.keep)));
    });
    file_ = ::open(params_.folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666);
    if (file_ >= 0)
        claim(file_);  // for when it gets a name
    else if (errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL)
        open_named_file();
    if (file_ < 0) fail(errno);
    const FileHeader empty{};
    write(std::as_bytes(std::span(&empty, 1)), 0);
    file_end_ = sizeof empty;
}

void Spill::open_named_file() {
    for (int i = 0;; ++i) {
        const std::string path =
            (std::filesystem::path(params_.folder) / text(named_spill, ::getpid(), "-", i)).string();
        // As O_TMPFILE makes it: others may read it where the umask lets them.
        file_ = ::open(path.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666);
        if (file_ < 0 && errno == EEXIST) continue;
        if (file_ < 0) return;
        claim(file_);
        if (stands_at(file_, path)) {
            unnamed_ = path;
            if (params_.keep.empty() && ::unlink(path.c_str()) == 0) unnamed_.clear();
            return;
        }
        ::close(file_);
    }
}

void Spill::expect(std::uint64_t bytes) {
    if (bytes > params_.memory_bytes || !params_.keep.empty()) open_file();
}

std::size_t Spill::add_layer(SpillLayer layer) {
    auto added = std::make_unique<Layer>();
    added->facts = std::move(layer);
    added->slots.resize(static_cast<std::size_t>(added->facts.blocks.posts()));
    layers_.push_back(std::move(added));
    return layers_.size() - 1;
}

std::size_t Spill::index_bytes() const {
    std::size_t bytes = 0;
    for (const auto& layer : layers_) bytes += layer->slots.size() * sizeof(Slot);
    return bytes;
}

Spill::Slot* Spill::slot(std::size_t layer, std::int64_t column, std::int64_t row) const {
    Layer& l = *layers_.at(layer);
    const Window& blocks = l.facts.blocks;
    if (!blocks.contains(column, row)) return nullptr;
    return &l.slots[blocks.at(column, row)];
}

bool Spill::holds(std::size_t layer, std::int64_t column, std::int64_t row) const {
    const Slot* s = slot(layer, column, row);
    return s && s->bytes > 0;
}

void Spill::put(std::size_t layer, std::int64_t column, std::int64_t row, int bucket, double distance,
                std::span<const std::byte> bytes) {
    Slot* s = slot(layer, column, row);
    if (!s || s->bytes > 0 || bytes.empty() || sealed_) throw std::logic_error("Spill::put: no such free block");
    auto memory = std::make_unique_for_overwrite<std::byte[]>(bytes.size());
    std::memcpy(memory.get(), bytes.data(), bytes.size());
    Bucket& b = buckets_.at(static_cast<std::size_t>(bucket));
    b.pending.push_back({distance, layer, column, row});
    b.bytes += bytes.size() + held_overhead;
    held_ += bytes.size() + held_overhead;
    {
        const std::unique_lock lock(slots_mutex_);
        s->memory = std::move(memory);
        s->bytes = static_cast<std::uint32_t>(bytes.size());
    }
    while (held_ > params_.memory_bytes)
        flush(*std::max_element(buckets_.begin(), buckets_.end(),
                                [](const Bucket& x, const Bucket& y) { return x.bytes < y.bytes; }));
}

void Spill::write(std::span<const std::byte> bytes, std::uint64_t offset) {
    const Transfer done = write_all_at(file_, bytes.data(), bytes.size(), offset);
    if (done.error)
        throw IoError(text(named(), " cannot be written: wrote ", offset + done.bytes,
                           " bytes, then: ", system_reason(done.error)));
}

void Spill::flush(Bucket& bucket) {
    Span span(params_.timeline, "spill write", "disk");
    open_file();
    std::sort(bucket.pending.begin(), bucket.pending.end(), [](const Pending& a, const Pending& b) {
        return std::tie(a.layer, a.distance, a.row, a.column) < std::tie(b.layer, b.distance, b.row, b.column);
    });
    std::vector<std::byte> staging;
    staging.reserve(staging_bytes);
    std::vector<std::uint64_t> offsets;
    offsets.reserve(bucket.pending.size());
    std::uint64_t written = file_end_;
    for (const Pending& p : bucket.pending) {
        const Slot& s = *slot(p.layer, p.column, p.row);
        BlockHeader header;
        header.bytes = s.bytes;
        header.place = place_of(p.layer, p.column, p.row);
        header.checksum = checksum_of(header, s.memory.get(), s.bytes);
        if (!staging.empty() && staging.size() + sizeof header + s.bytes > staging_bytes) {
            write(staging, written);
            written += staging.size();
            staging.clear();
        }
        offsets.push_back(written + staging.size());
        const auto head = std::as_bytes(std::span(&header, 1));
        staging.insert(staging.end(), head.begin(), head.end());
        staging.insert(staging.end(), s.memory.get(), s.memory.get() + s.bytes);
    }
    write(staging, written);
    span.add_bytes(written + staging.size() - file_end_);
    file_end_ = written + staging.size();

    const std::unique_lock lock(slots_mutex_);
    for (std::size_t i = 0; i < offsets.size(); ++i) {
        Slot& s = *slot(bucket.pending[i].layer, bucket.pending[i].column, bucket.pending[i].row);
        s.offset = offsets[i];
        s.memory.reset();
    }
    held_ -= bucket.bytes;
    bucket = {};
}

void Spill::read(std::uint64_t offset, std::span<std::byte> into, const std::string& what) const {
    const Transfer done = read_all_at(file_, into.data(), into.size(), offset);
    if (done.error)
        throw IoError(text(named(), " cannot be read at byte ", offset + done.bytes, ", the ", what, ": ",
                           system_reason(done.error)));
    if (done.bytes < into.size())
        throw DataError(text(named(), " is damaged: it ends at byte ", offset + done.bytes, ", inside the ", what));
    read_ += into.size();
    read_here += into.size();
}

std::span<const std::byte> Spill::get(std::size_t layer, std::int64_t column, std::int64_t row,
                                      std::vector<std::byte>& buffer) {
    const Slot* s = slot(layer, column, row);
    if (!s) return {};
    std::uint64_t offset = 0;
    std::size_t bytes = 0;
    {
        std::shared_lock lock(slots_mutex_, std::defer_lock);
        if (!sealed_) lock.lock();
        bytes = s->bytes;
        offset = s->offset;
        if (bytes == 0) return {};
        if (s->memory) {
            if (sealed_) return {s->memory.get(), bytes};
            buffer.resize(bytes);
            std::memcpy(buffer.data(), s->memory.get(), bytes);
            return buffer;
        }
    }
    const SpillLayer& facts = layers_[layer]->facts;
    buffer.resize(sizeof(BlockHeader) + bytes);
    {
        Span span(params_.timeline, "spill read", "disk");
        read(offset, buffer, place(facts, column, row));
        span.add_bytes(buffer.size());
    }
    BlockHeader header;
    std::memcpy(&header, buffer.data(), sizeof header);
    const std::byte* payload = buffer.data() + sizeof header;
    if (header.mark != block_mark || header.bytes != bytes || header.place != place_of(layer, column, row) ||
        header.checksum != checksum_of(header, payload, bytes))
        throw DataError(text(named(), " is damaged: the ", place(facts, column, row), " (byte ", offset,
                             ") does not match its checksum"));
    return {payload, bytes};
}

void Spill::keep(const std::string& description) {
    open_file();
    for (Bucket& bucket : buckets_)
        if (!bucket.pending.empty()) flush(bucket);
    sealed_ = true;
    description_ = description;
    IndexText index;
    index.put_string(description);
    index.put(static_cast<std::uint64_t>(layers_.size()));
    for (const auto& layer : layers_) {
        const SpillLayer& f = layer->facts;
        index.put_string(f.name);
        for (const std::int64_t v : {f.edge, f.posts_columns, f.posts_rows, f.blocks.columns.begin,
                                     f.blocks.columns.end, f.blocks.rows.begin, f.blocks.rows.end})
            index.put(v);
        for (const Slot& s : layer->slots) {
            index.put(s.offset);
            index.put(s.bytes);
        }
    }
    FileHeader header;
    header.index_offset = file_end_;
    header.index_bytes = index.bytes().size();
    header.index_checksum = checksum(index.bytes().data(), index.bytes().size());
    header.checksum = checksum_of(header);
    write(index.bytes(), file_end_);
    file_end_ = file_end_ + index.bytes().size();
    write(std::as_bytes(std::span(&header, 1)), 0);

    const auto fail = [&](const char* what, int error) {
        throw IoError(text(named(), " cannot be ", what, ": ", system_reason(error)));
    };
    if (::fsync(file_) != 0) fail("written to disk", errno);
    const std::string path = params_.keep;
    std::string whole = unnamed_;
    if (whole.empty()) {
        whole = (std::filesystem::path(params_.folder) / text(keep_stem(path), ::getpid())).string();
        ::unlink(whole.c_str());
        if (::linkat(AT_FDCWD, text("/proc/self/fd/", file_).c_str(), AT_FDCWD, whole.c_str(), AT_SYMLINK_FOLLOW) != 0)
            fail("named", errno);
        unnamed_ = whole;
    }
    if (::rename(whole.c_str(), path.c_str()) != 0) fail("put in place", errno);
    unnamed_.clear();
    if (const int error = sync_folder(params_.folder)) fail("written to disk", error);
}

void Spill::read_index() {
    const auto damaged = [&](const char* what) {
        throw DataError(text(named(), " is damaged: ", what, "; tile --around makes it anew"));
    };
    struct stat facts {};
    if (::fstat(file_, &facts) != 0) throw IoError(text(named(), " cannot be read: ", system_reason(errno)));
    const auto size = static_cast<std::uint64_t>(facts.st_size);
    if (size < sizeof(FileHeader)) damaged("it has no header");
    FileHeader header;
    read(0, std::as_writable_bytes(std::span(&header, 1)), "header");
    if (header.mark != file_mark) throw DataError(text(named(), " is no kept spill of this version"));
    if (header.checksum != checksum_of(header)) damaged("its header does not match its checksum");
    if (header.index_offset > size || header.index_bytes != size - header.index_offset)
        damaged(text("it is ", size, " bytes long, not ", header.index_offset + header.index_bytes).c_str());
    std::vector<std::byte> bytes(header.index_bytes);
    read(header.index_offset, bytes, "index");
    if (checksum(bytes.data(), bytes.size()) != header.index_checksum) damaged("its index does not match its checksum");
    IndexText index(std::move(bytes));
    std::uint64_t count = 0;
    if (!index.take_string(description_) || !index.take(count)) damaged("its index is too short");
    for (std::uint64_t i = 0; i < count; ++i) {
        SpillLayer f;
        bool whole = index.take_string(f.name);
        for (std::int64_t* v : {&f.edge, &f.posts_columns, &f.posts_rows, &f.blocks.columns.begin,
                                &f.blocks.columns.end, &f.blocks.rows.begin, &f.blocks.rows.end})
            whole = whole && index.take(*v);
        constexpr std::size_t entry = sizeof(std::uint64_t) + sizeof(std::uint32_t);
        if (!whole || f.edge < 1 || static_cast<std::uint64_t>(f.blocks.posts()) > index.left() / entry)
            damaged("its index is too short");
        std::vector<Slot>& slots = layers_[add_layer(std::move(f))]->slots;
        for (Slot& s : slots) {
            index.take(s.offset);
            index.take(s.bytes);
        }
    }
    file_end_ = size;
    read_ = 0;
}

std::unique_ptr<Spill> Spill::open_kept(const std::string& path, Timeline* timeline) {
    SpillParams params;
    params.keep = path;
    params.timeline = timeline;
    auto spill = std::make_unique<Spill>(params);
    spill->file_ = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);  // no waiting for a pipe's writer
    if (spill->file_ < 0) throw IoError(text(spill->named(), " cannot be opened: ", system_reason(errno)));
    spill->read_index();
    spill->seal();
    return spill;
}

}  // namespace wedgescope
