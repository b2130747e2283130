// Files that appear whole or not at all.
#include <catch2/catch.hpp>

#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tiles/claim.hpp"
#include "tiles/output_file.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using wedgescope::test::Folder;
using Names = std::vector<std::string>;

namespace {

void put(const std::string& path, const std::string& content) { std::ofstream(path) << content; }
std::string get(const std::string& path) {
    std::ifstream in(path);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// A process that has begun to write a file, and waits.
class Writer {
public:
    explicit Writer(const std::string& path) {
        int ready[2];
        if (::pipe(ready) != 0) throw std::runtime_error("no pipe");
        child_ = ::fork();
        if (child_ == 0) {
            OutputFile file(path, true);
            put(file.temporary_path(), "half");
            put(file.temporary_path() + ".geoloc.tif", "half");
            if (::write(ready[1], "y", 1) == 1) ::pause();
            ::_exit(0);
        }
        char answer = 0;
        ::close(ready[1]);
        if (::read(ready[0], &answer, 1) != 1) throw std::runtime_error("the child failed");
        ::close(ready[0]);
    }
    ~Writer() { kill(); }
    void kill() {
        if (child_ > 0) ::kill(child_, SIGKILL), ::waitpid(child_, nullptr, 0);
        child_ = 0;
    }

private:
    pid_t child_ = 0;
};

}  // namespace

TEST_CASE("what a killed process left goes with the next file of the same name, what a living one writes stays",
          "[output_file]") {
    const Folder folder;
    Writer killed(folder / "scope.png");
    const Names left = folder.names();
    REQUIRE(left.size() == 1);
    CHECK_THAT(left[0], Catch::Matchers::StartsWith(".scope.png.tmp-"));
    const Writer living(folder / "scope.png"), neighbour(folder / "scope.pn"), another(folder / "scope.png.tmp-1");
    killed.kill();
    const Names others{".scope.png.tmp-notes",   ".scope.png.tmp-1-",       "scope.png.tmp-1-1",
                       ".scope.png.tmp-1-1.txt", ".scope.png.tmp-20240101", ".scope.png.tmp-2024-0101"};
    for (const std::string& name : others) put(folder / name, "mine");
    // A name that is used again does not make the dead one alive.
    const std::string again = text(".scope.png.tmp-", ::getpid(), "-1");
    std::filesystem::rename(folder / left[0], folder / again);
    REQUIRE(folder.names().size() == 4 + others.size());
    OutputFile file(folder / "scope.png", false);
    CHECK(folder.names().size() == 4 + others.size());  // the living three and its own
    CHECK_FALSE(std::filesystem::exists(folder / (again + "/scope.png")));
    put(file.temporary_path(), "whole");
    file.commit();
    CHECK(get(folder / "scope.png") == "whole");
    CHECK(folder.names().size() == 4 + others.size());
    for (const std::string& name : others) CHECK(get(folder / name) == "mine");
}

TEST_CASE("what a killed process left of the last of many files goes with that one", "[output_file]") {
    const Folder folder;
    { Writer killed(folder / "s_0003.png"), another(folder / "s_0003.png.tmp-1"); }
    CHECK(folder.names().size() == 2);
    for (const char* name : {"s_0001.png", "s_0002.png"}) OutputFile(folder / name, false);
    CHECK(folder.names().size() == 2);
    OutputFile(folder / "s_0003.png", false);
    CHECK_THAT(folder.names().at(0), Catch::Matchers::StartsWith(".s_0003.png.tmp-1.tmp-"));
    OutputFile(folder / "s_0003.png.tmp-1", false);
    CHECK(folder.names().empty());
}

TEST_CASE("one more file takes no longer for the many that stand in its folder", "[output_file]") {
    const Folder folder;
    for (int i = 0; i < 20000; ++i) put(folder / text("frame_", i, ".png"), "");
    using Clock = std::chrono::steady_clock;
    const auto seconds = [](auto&& body) {
        const auto start = Clock::now();
        body();
        return std::chrono::duration<double>(Clock::now() - start).count();
    };
    // Against listing the folder, of which each would take one.
    double listing = 0, files = 0;
    for (int round = 0; round < 5; ++round) {
        listing += seconds([&] { CHECK(folder.names().size() == 20000); });
        files += seconds([&] {
            for (int i = 0; i < 40; ++i) OutputFile(folder / text("scope_", round, "_", i, ".png"), false);
        });
    }
    INFO("200 files " << files << " s, 5 times the names " << listing << " s");
    CHECK(files < 6 * listing);
}

TEST_CASE("where a file cannot be put in place what stood there keeps its side files", "[output_file]") {
    const Folder folder;
    put(folder / "a.tif", "old");
    put(folder / "a.tif.aux.xml", "place of the old");
    OutputFile first(folder / "a.tif", true), second(folder / "b.tif", true);
    for (const OutputFile* file : {&first, &second}) put(file->temporary_path(), "new");
    for (const char* side : {".aux.xml", ".ovr"}) put(first.temporary_path() + side, "of the new");
    // A folder with something in it comes to stand there, which no file can replace.
    std::filesystem::remove(folder / "a.tif");
    std::filesystem::create_directory(folder / "a.tif");
    put(folder / "a.tif/other", "");
    CHECK_THROWS_AS(OutputFile::commit({&first, &second}), IoError);
    CHECK(get(folder / "a.tif.aux.xml") == "place of the old");
    CHECK_FALSE(std::filesystem::exists(folder / "a.tif.ovr"));
    std::filesystem::remove_all(folder / "a.tif");
    // Those of a file that is there already are its own.
    put(folder / "a.tif.ovr", "of the old");
    std::filesystem::create_directory(folder / "b.tif");
    put(folder / "b.tif/other", "");
    put(first.temporary_path() + ".aux.xml", "place of the new");
    CHECK_THROWS_AS(OutputFile::commit({&first, &second}), IoError);
    CHECK(get(folder / "a.tif") == "new");
    CHECK(get(folder / "a.tif.aux.xml") == "place of the new");
    CHECK_FALSE(std::filesystem::exists(folder / "a.tif.ovr"));
    // Nor does a part of it go that the driver named.
    put(folder / "d.hdr", "of the old");
    OutputFile part(folder / "d.img", true);
    std::filesystem::create_directory(folder / "d.img");
    put(folder / "d.img/other", "");
    put(part.temporary_path(), "new");
    put(std::filesystem::path(part.temporary_path()).replace_extension(".hdr").string(), "of the new");
    CHECK_THROWS_WITH(part.commit(), Contains("d.img' cannot be put in place: ") && !Contains(".tmp-"));
    CHECK(get(folder / "d.hdr") == "of the old");
    // A folder of a side file's name is no side file.
    std::filesystem::create_directory(folder / "c.tif.msk");
    OutputFile third(folder / "c.tif", true);
    put(third.temporary_path(), "new");
    CHECK_THROWS_WITH(third.commit(), Contains("c.tif.msk' cannot be removed: Is a directory"));
    CHECK(std::filesystem::is_directory(folder / "c.tif.msk"));
}

TEST_CASE("a name as long as a file system takes can be written", "[output_file]") {
    const Folder folder;
    std::string name(120, 'n');
    for (int i = 0; i < 65; ++i) name += "\u00e9";  // two bytes each
    for (const char* ending : {"a.tif", "b.tif"}) {
        REQUIRE((name + ending).size() == 255);
        OutputFile file(folder / (name + ending), false);
        for (const std::string& made : folder.names()) CHECK(made.size() <= 255);
        put(file.temporary_path(), ending);
        file.commit();
    }
    CHECK(folder.names() == Names{name + "a.tif", name + "b.tif"});
    CHECK(get(folder / (name + "b.tif")) == "b.tif");
}

TEST_CASE("a folder that another process removes before it is claimed is made anew", "[output_file]") {
    const Folder folder;
    std::atomic<bool> over{false};
    std::thread other([&] {
        while (!over)
            remove_left_behind(folder / "", [](const std::string& name) { return name.starts_with(".a.png.tmp-"); });
    });
    for (int i = 0; i < 3000; ++i) {
        OutputFile file(folder / "a.png", true);
        std::ofstream(file.temporary_path()) << i;
        if (!std::filesystem::exists(file.temporary_path())) {
            FAIL_CHECK("turn " << i << ": its folder is gone");
            break;
        }
    }
    over = true;
    other.join();
}

TEST_CASE("nothing stands under the final name before commit, and nothing else after it", "[output_file]") {
    const Folder folder;
    OutputFile file(folder / "scope.png", false);
    CHECK(file.final_path() == folder / "scope.png");
    CHECK_THAT(file.temporary_path(), Contains("/.scope.png.tmp-") && Catch::Matchers::EndsWith("/scope.png"));
    put(file.temporary_path(), "picture");
    CHECK(folder.names().size() == 1);
    CHECK(folder.names() != Names{"scope.png"});
    file.commit();
    CHECK(folder.names() == Names{"scope.png"});
    CHECK(get(folder / "scope.png") == "picture");
}

TEST_CASE("side files move with their file and stale ones go", "[output_file]") {
    const Folder folder;
    put(folder / "echo.tif", "old");
    put(folder / "echo.tif.aux.xml", "old");
    put(folder / "echo.tif.geoloc.tif", "old");
    put(folder / "echo.tif.ovr", "old overviews");
    put(folder / "echo.tif.msk", "an old mask");
    put(folder / "echo.tiff", "a neighbour");
    {
        OutputFile file(folder / "echo.tif", true);
        put(file.temporary_path(), "new");
        put(file.temporary_path() + ".geoloc.tif", "new places");
        file.commit();
    }
    CHECK(folder.names() == Names{"echo.tif", "echo.tif.geoloc.tif", "echo.tiff"});
    CHECK(get(folder / "echo.tif") == "new");
    CHECK(get(folder / "echo.tif.geoloc.tif") == "new places");
    // Drivers such as ENVI put a header beside the data, under the stem.
    OutputFile file(folder / "power.img", false);
    const std::string stem = file.temporary_path().substr(0, file.temporary_path().size() - 4);
    put(file.temporary_path(), "data");
    put(stem + ".hdr", "header");
    put(file.temporary_path() + ".aux.xml", "more");
    file.commit();
    CHECK(get(folder / "power.hdr") == "header");
    CHECK(get(folder / "power.img.aux.xml") == "more");
}

TEST_CASE("an output that is given up leaves nothing behind and the old file as it was", "[output_file]") {
    const Folder folder;
    put(folder / "scope.png", "old");
    {
        OutputFile file(folder / "scope.png", true);
        put(file.temporary_path(), "half");
        put(file.temporary_path() + ".aux.xml", "half");
        OutputFile moved(std::move(file));
        CHECK(folder.names().size() == 2);
    }
    CHECK(folder.names() == Names{"scope.png"});
    CHECK(get(folder / "scope.png") == "old");
}

TEST_CASE("any name will do, and files of like names are left alone", "[output_file]") {
    for (const std::string name : {"run", ".hidden", "-", "run.tif.tmp", "a b.c"}) {
        const Folder folder;
        const Names others{name + ".notes", name + ".png", "run.txt"};
        for (const auto& other : others) put(folder / other, "mine");
        put(folder / name, "old");
        {
            const OutputFile given_up(folder / name, true);
            put(given_up.temporary_path(), "half");
        }
        CHECK(get(folder / name) == "old");
        OutputFile file(folder / name, true);
        put(file.temporary_path(), "new");
        file.commit();
        CHECK(get(folder / name) == "new");
        for (const auto& other : others) CHECK(get(folder / other) == "mine");
        CHECK(folder.names().size() == 4);
    }
}

TEST_CASE("side files meet neither each other nor what stands there", "[output_file]") {
    const Folder folder;
    const auto envi = [&](OutputFile& file) {
        put(file.temporary_path(), "data");
        put(file.temporary_path().substr(0, file.temporary_path().size() - 4) + ".hdr", "header");
    };
    {
        OutputFile a(folder / "p.img", false), b(folder / "p.dat", false);
        envi(a);
        envi(b);
        CHECK_THROWS_WITH(OutputFile::commit({&a, &b}), Contains("p.img") && Contains("p.dat") && Contains("p.hdr"));
    }
    CHECK(folder.names().empty());
    put(folder / "p.hdr", "mine");
    {
        OutputFile a(folder / "p.img", false);
        envi(a);
        CHECK_THROWS_WITH(a.commit(), Contains("p.hdr") && Contains("--overwrite"));
    }
    CHECK(folder.names() == Names{"p.hdr"});
    CHECK(get(folder / "p.hdr") == "mine");
    put(folder / "q.png.aux.xml", "stale");
    CHECK_THROWS_WITH(OutputFile(folder / "q.png", false), Contains("q.png.aux.xml") && Contains("--overwrite"));
    CHECK_THROWS_WITH(OutputFile("/dev/null", true), Contains("/dev/null") && Contains("plain file"));
    CHECK_THROWS_AS(OutputFile("/dev/null", true), InputError);
}

TEST_CASE("an output is refused before any work if it cannot or must not be written", "[output_file]") {
    const Folder folder;
    put(folder / "scope.png", "old");
    CHECK_THROWS_AS(OutputFile(folder / "scope.png", false), InputError);
    CHECK_THROWS_WITH(OutputFile(folder / "scope.png", false),
                      "output '" + folder / "scope.png" + "' exists; add --overwrite");
    CHECK_NOTHROW(OutputFile(folder / "scope.png", true));
    CHECK_THROWS_AS(OutputFile(folder / "none/scope.png", false), IoError);
    CHECK_THROWS_WITH(OutputFile(folder / "none/scope.png", false), Contains("No such file"));
    CHECK_THROWS_AS(OutputFile(folder / "scope.png/scope.png", false), IoError);
    CHECK_THROWS_AS(OutputFile(folder / ".", true), InputError);
    CHECK_THROWS_AS(OutputFile("", true), InputError);
    // Someone else was faster.
    OutputFile file(folder / "late.txt", false);
    put(file.temporary_path(), "mine");
    put(folder / "late.txt", "theirs");
    CHECK_THROWS_AS(file.commit(), InputError);
    CHECK(get(folder / "late.txt") == "theirs");
    // Somebody tidied up.
    OutputFile gone(folder / "gone.txt", false);
    std::filesystem::remove_all(std::filesystem::path(gone.temporary_path()).parent_path());
    CHECK_THROWS_AS(gone.commit(), IoError);
    // What standard output and the like lead to is not replaced, nor is the link.
    std::filesystem::create_symlink("/proc/self/fd/1", folder / "stdout");
    std::filesystem::create_symlink("stdout", folder / "link");
    for (const char* const link : {"stdout", "link"}) {
        CHECK_THROWS_WITH(OutputFile(folder / link, true), Contains("plain file"));
        CHECK(std::filesystem::is_symlink(folder / link));
    }
}
