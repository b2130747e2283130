// A spill and its file: packed blocks come back as they were, from memory and from disk; its faults, and what it leaves behind.
#include <catch2/catch.hpp>

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <set>

#include "tests/refusal.hpp"
#include "tests/small_disk.hpp"
#include "tests/spilled_ground.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/packed_block.hpp"
#include "tiles/spill.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

/// The one file without a name that this process has open in a folder.
int nameless_file(const Folder& folder) {
    const std::string start = std::filesystem::canonical(folder / ".").string();
    int found = -1;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
        std::error_code error;
        const std::string target = std::filesystem::read_symlink(entry.path(), error).string();
        if (!error && target.starts_with(start) && target.find("(deleted)") != std::string::npos)
            found = std::stoi(entry.path().filename().string());
    }
    return found;
}

std::vector<std::byte> random_bytes(std::mt19937& random, std::size_t n) {
    std::vector<std::byte> bytes(n);
    for (std::byte& b : bytes) b = static_cast<std::byte>(random() & 255);
    return bytes;
}

/// A spill of 6 x 5 blocks and what was put into it.
struct Filled {
    Spill spill;
    std::vector<std::vector<std::byte>> bytes;
    explicit Filled(const SpillParams& params, std::uint64_t expected_bytes = 0) : spill(params) {
        std::mt19937 random(11);
        spill.expect(expected_bytes);
        spill.add_layer({"dem", 32, 190, 155, {{0, 6}, {0, 5}}});
        for (std::int64_t r = 0; r < 5; ++r)
            for (std::int64_t c = 0; c < 6; ++c) {
                bytes.push_back(random_bytes(random, 40 + random() % 900));
                spill.put(0, c, r, static_cast<int>((c + r) % 3), static_cast<double>(c * c + r * r), bytes.back());
            }
        spill.seal();
    }
    bool good(std::int64_t c, std::int64_t r) {
        std::vector<std::byte> buffer;
        const auto found = spill.get(0, c, r, buffer);
        const auto& want = bytes[static_cast<std::size_t>(r * 6 + c)];
        return std::equal(found.begin(), found.end(), want.begin(), want.end());
    }
};
SpillParams small_spill(const Folder& folder, std::size_t memory_bytes) {
    SpillParams params;
    params.folder = folder / ".";
    params.memory_bytes = memory_bytes;
    params.buckets = 3;
    return params;
}

}  // namespace

// ---------------------------------------------------------------- blocks

TEST_CASE("a packed block gives every post back bit for bit, as narrow as it goes", "[spill]") {
    std::mt19937 random(3);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const PackScale plain{}, tenths{0.1, -50, 1}, feet{1, 0, 0.3048};
    struct Case {
        const char* what;
        std::function<float(std::size_t)> post;
        PackScale scale;
        std::size_t bytes_a_post;
    };
    const auto stored = [&](int v, const PackScale& s) {
        return static_cast<float>((static_cast<double>(v) * s.scale + s.offset) * s.unit_m);
    };
    const Case cases[] = {
        {"alike", [](std::size_t) { return 12.25F; }, plain, 0},
        {"all void", [&](std::size_t) { return nan; }, plain, 0},
        {"small", [&](std::size_t i) { return i % 7 == 0 ? nan : static_cast<float>(i % 255); }, plain, 1},
        {"just too large for 8 bits", [](std::size_t i) { return static_cast<float>(i % 256); }, plain, 2},
        {"below zero", [&](std::size_t i) { return i % 5 == 0 ? nan : -static_cast<float>(i % 32768); }, plain, 2},
        {"the number that stands for void", [](std::size_t i) { return i == 4 ? -32768.0F : 1.0F; }, plain, 4},
        {"beyond 16 bits", [](std::size_t i) { return i == 4 ? 32768.0F : 1.0F; }, plain, 4},
        {"a negative zero", [](std::size_t i) { return i == 4 ? -0.0F : 1.0F; }, plain, 4},
        {"fractions", [&](std::size_t) { return static_cast<float>(random()) * 1e-7F; }, plain, 4},
        {"scaled", [&](std::size_t i) { return i % 9 == 0 ? nan : stored(static_cast<int>(i) * 13 - 9000, tenths); },
         tenths, 2},
        {"feet", [&](std::size_t i) { return stored(static_cast<int>(i) - 900, feet); }, feet, 2},
        {"feet, but one that is none",
         [&](std::size_t i) { return i == 700 ? 0.1F : stored(static_cast<int>(i), feet); }, feet, 4},
    };
    constexpr std::int64_t columns = 37, rows = 41, stride = 50;
    for (const Case& k : cases) {
        INFO(k.what);
        std::vector<float> posts(stride * rows, 77.0F);
        for (std::int64_t r = 0; r < rows; ++r)
            for (std::int64_t c = 0; c < columns; ++c)
                posts[static_cast<std::size_t>(r * stride + c)] = k.post(static_cast<std::size_t>(r * columns + c));
        std::vector<std::byte> bytes;
        pack_heights(posts.data(), stride, columns, rows, k.scale, bytes);
        CHECK(bytes.size() == (k.bytes_a_post ? 1 + k.bytes_a_post * columns * rows : 5));
        for (const Window& part :
             {Window{{0, columns}, {0, rows}}, Window{{5, 6}, {40, 41}}, Window{{3, 30}, {7, 20}}}) {
            std::vector<float> out(static_cast<std::size_t>(part.posts()));
            REQUIRE(unpack_heights(bytes, columns, rows, k.scale, part, out.data(), part.columns.size()));
            std::int64_t wrong = 0;
            for (std::int64_t r = part.rows.begin; r < part.rows.end; ++r)
                for (std::int64_t c = part.columns.begin; c < part.columns.end; ++c)
                    wrong += bits(out[static_cast<std::size_t>((r - part.rows.begin) * part.columns.size() + c -
                                                               part.columns.begin)]) !=
                             bits(posts[static_cast<std::size_t>(r * stride + c)]);
            CHECK(wrong == 0);
        }
        std::vector<float> out(columns * rows);
        bytes.push_back(std::byte{0});
        CHECK_FALSE(unpack_heights(bytes, columns, rows, k.scale, {{0, columns}, {0, rows}}, out.data(), columns));
    }
    for (const std::int32_t most : {1, 254, 255, 32767, 32768, INT32_MAX}) {
        std::vector<std::int32_t> codes(columns * rows);
        for (std::int32_t& code : codes)
            code = random() % 5 == 0 ? INT32_MIN : static_cast<std::int32_t>(random() % 3 == 0 ? most : most / 2);
        std::vector<std::byte> bytes;
        pack_codes(codes.data(), columns, columns, rows, bytes);
        std::vector<std::int32_t> out(codes.size());
        REQUIRE(unpack_codes(bytes, columns, rows, {{0, columns}, {0, rows}}, out.data(), columns));
        CHECK(out == codes);
    }
}

TEST_CASE("blocks come back from memory and from the file alike, and the file has no name", "[spill][threads]") {
    const Folder folder;
    for (const std::size_t memory : {std::size_t{0}, std::size_t{3000}, std::size_t{1} << 20}) {
        Filled filled(small_spill(folder, memory));
        CHECK(filled.spill.bytes_held() <= memory);
        CHECK((filled.spill.bytes_spilled() > 0) == (memory < (1 << 20)));
        CHECK(folder.names().empty());
        std::int64_t wrong = 0;
        for (std::int64_t r = 0; r < 5; ++r)
            for (std::int64_t c = 0; c < 6; ++c) wrong += !filled.good(c, r);
        CHECK(wrong == 0);
        std::vector<std::byte> buffer;
        CHECK(filled.spill.get(0, 6, 0, buffer).empty());
        CHECK(filled.spill.get(0, 0, -1, buffer).empty());
    }
    CHECK(folder.names().empty());
}

TEST_CASE("a spill file without a block counts for nothing", "[spill]") {
    const Folder folder;
    Filled filled(small_spill(folder, std::size_t{1} << 20), std::uint64_t{1} << 30);
    CHECK(nameless_file(folder) >= 0);  // made because so much was expected
    CHECK(filled.spill.bytes_held() > 0);
    CHECK(filled.spill.bytes_spilled() == 0);
}

TEST_CASE("every flipped byte of the spill file is named with file and block, and no other block suffers", "[spill]") {
    const Folder folder;
    Filled filled(small_spill(folder, 0));
    const int file = nameless_file(folder);
    REQUIRE(file >= 0);
    std::mt19937 random(20);
    const auto size = static_cast<std::uint64_t>(filled.spill.bytes_spilled());
    std::set<std::uint64_t> places;
    for (std::uint64_t i = 64; i < 64 + 24; ++i) places.insert(i);  // the first block's own header
    while (places.size() < 300) places.insert(64 + random() % (size - 64));
    for (const std::uint64_t at : places) {
        CAPTURE(at);
        unsigned char byte = 0;
        REQUIRE(::pread(file, &byte, 1, static_cast<off_t>(at)) == 1);
        const unsigned char flipped = byte ^ static_cast<unsigned char>(1U << (random() % 8));
        REQUIRE(::pwrite(file, &flipped, 1, static_cast<off_t>(at)) == 1);
        int damaged = 0;
        for (std::int64_t r = 0; r < 5; ++r)
            for (std::int64_t c = 0; c < 6; ++c) {
                try {
                    const bool good = filled.good(c, r);
                    CHECK(good);
                } catch (const DataError& e) {
                    ++damaged;
                    CHECK_THAT(e.what(), Contains(folder / ".") && Contains("block of the dem") &&
                                             Contains(text("columns ", c * 32, " to ")) &&
                                             Contains(text("rows ", r * 32, " to ")));
                }
            }
        CHECK(damaged == 1);
        REQUIRE(::pwrite(file, &byte, 1, static_cast<off_t>(at)) == 1);
    }
    REQUIRE(::ftruncate(file, static_cast<off_t>(size - 1)) == 0);
    CHECK_THAT(refusal([&] {
                   for (std::int64_t r = 0; r < 5; ++r)
                       for (std::int64_t c = 0; c < 6; ++c) filled.good(c, r);
               }),
               Contains("ends at byte") && Contains("block of the dem"));
}

TEST_CASE("a full disk is one line that names the folder and the bytes, and leaves nothing", "[spill][threads]") {
    const Folder folder;
    const std::string message = [&] {
        const SmallDisk disk(4000);
        return refusal([&] { Filled(small_spill(folder, 2000)); });
    }();
    CHECK_THAT(message, Contains(folder / ".") && Contains("bytes") && Contains("File too large"));
    CHECK(folder.names().empty());
}

TEST_CASE("a temporary folder that is none is refused before any work", "[spill]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 200, GDT_Int16));
    std::ofstream(folder / "file") << "x";
    for (const std::string& bad : {folder / "missing", folder / "file", std::string("/proc")}) {
        SpillOptions options = in(folder, little);
        options.temp_folder = bad;
        bool worked = false;
        options.progress = [&](double) { worked = true; };
        const DataBaseParams params = only(folder / "dem.tif");
        const Scene scene = above(params);
        CHECK_THAT(refusal([&] { open_spilled_source(params, scene, options); }),
                   Contains("temp-dir '" + bad + "'") && Contains("accepted"));
        CHECK_FALSE(worked);
    }
}

TEST_CASE("a killed program leaves no spill file", "[spill]") {
    const Folder folder;
    int ready[2];
    REQUIRE(::pipe(ready) == 0);
    const pid_t child = ::fork();
    if (child == 0) {
        ::close(ready[0]);
        const Filled filled(small_spill(folder, 0));
        const char yes = nameless_file(folder) >= 0 ? 'y' : 'n';
        if (::write(ready[1], &yes, 1) != 1) ::_exit(2);
        ::pause();
        ::_exit(0);
    }
    ::close(ready[1]);
    char answer = 0;
    REQUIRE(::read(ready[0], &answer, 1) == 1);
    ::close(ready[0]);
    CHECK(answer == 'y');
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    CHECK(folder.names().empty());
}

TEST_CASE("a spill file that a killed program had to name goes with the next, one that is written stays", "[spill]") {
    const Folder folder;
    for (const char* name : {".wedgescope-spill-aaaaaa", ".wedgescope-spill-bbbbbb", ".kept.tmp-99", ".other.tmp-99"})
        std::ofstream(folder / name) << "half";
    const int writing = ::open((folder / ".wedgescope-spill-bbbbbb").c_str(), O_RDWR);
    REQUIRE(::flock(writing, LOCK_EX) == 0);
    {
        const Filled filled(small_spill(folder, 0));
        CHECK(folder.names() == std::vector<std::string>{".kept.tmp-99", ".other.tmp-99", ".wedgescope-spill-bbbbbb"});
    }
    SpillParams params;
    params.keep = folder / "kept";
    Spill spill(params);
    spill.add_layer({"dem", 32, 32, 32, {{0, 1}, {0, 1}}});
    spill.put(0, 0, 0, 0, 0, std::vector<std::byte>(7));
    spill.keep("");
    CHECK(folder.names() == std::vector<std::string>{".other.tmp-99", ".wedgescope-spill-bbbbbb", "kept"});
    ::close(writing);
}
