// Blocks from operator new: theirs alone, whole, and given back; many sizes, on several threads.
#include "lib/large_blocks.hpp"

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <new>
#include <random>
#include <thread>
#include <vector>

#include "tests/process_bytes.hpp"

using namespace wedgescope;
using namespace wedgescope::test;

namespace {

struct Block {
    unsigned char* at;
    std::size_t bytes;
    unsigned char mark;
};

/// Its own mark at both ends and here and there between.
void fill(const Block& b) { std::memset(b.at, b.mark, b.bytes); }
bool whole(const Block& b) {
    for (std::size_t i = 0; i < b.bytes; i += 997)
        if (b.at[i] != b.mark) return false;
    return b.at[b.bytes - 1] == b.mark;
}

/// So many of them, filled, each with a mark of its own.
[[maybe_unused]] std::vector<Block> hold(std::size_t count, std::size_t bytes) {
    std::vector<Block> blocks;
    for (std::size_t i = 0; i < count; ++i) {
        blocks.push_back({static_cast<unsigned char*>(::operator new(bytes)), bytes, static_cast<unsigned char>(i)});
        fill(blocks.back());
    }
    return blocks;
}
[[maybe_unused]] void free(const std::vector<Block>& blocks) {
    for (const Block& b : blocks) ::operator delete(b.at);
}

/// How a process of its own ends that runs this; what it returns is its code.
template <class Run>
[[maybe_unused]] int status_of(const Run& run) {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(run());
    int status = -1;
    REQUIRE(::waitpid(child, &status, 0) == child);
    return status;
}

}  // namespace

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// These two first, the one that holds less before the other: what was ever in use counts.
TEST_CASE("blocks that grow, shrink and grow again take no more than once was in use", "[large_blocks][quick]") {
    constexpr std::size_t page = std::size_t{2} << 20, kib = std::size_t{1} << 10;
    const std::size_t pages = GENERATE(1, 4);  // side by side, and in pages of their own
    keep_large_blocks(0);
    const std::size_t before = resident_bytes();
    const std::size_t spare = pages == 1 ? std::size_t{3} << 20 : std::size_t{6} << 20, size = pages * page,
                      start = pages == 1 ? 32 : 16, stay = start / 2 + 1;
    keep_large_blocks(page, 16 * size);
    std::vector<Block> first = hold(start, size + 8 * kib);
    const std::size_t most = resident_bytes();
    for (int turn = 0; turn < 3; ++turn) {
        std::vector<Block> gone(first.begin() + static_cast<std::ptrdiff_t>(stay), first.end());
        first.resize(stay);
        free(gone);
        // In their room, first longer, then shorter ones.
        for (const std::size_t bytes : {size + page - 256 * kib, size + 600 * kib}) {
            const std::size_t count = (start - stay) * size / bytes;
            std::vector<Block> others = hold(count, bytes);
            CHECK(resident_bytes() < most + spare);
            for (const Block& b : others) CHECK(whole(b));
            free(others);
        }
        for (const Block& b : hold(start - stay, size + 8 * kib)) first.push_back(b);
        CHECK(resident_bytes() < most + spare);
    }
    for (const Block& b : first) CHECK(whole(b));
    free(first);
    keep_large_blocks(0);
    CHECK(resident_bytes() < before + spare);
    // A little short of whole pages is whole pages; more than a little is not.
    for (const auto& [bytes, wanted] : {std::pair{7 * page - 100 * kib, 7 * page},
                                        {7 * page - 200 * kib, 7 * page - 200 * kib},
                                        {29 * page + 200 * kib, 29 * page + 200 * kib}}) {
        const std::vector<Block> one = hold(1, bytes);
        CHECK(resident_bytes() > before + bytes - 256 * kib);
        CHECK(resident_bytes() < before + wanted + 512 * kib);
        free(one);
    }
    keep_large_blocks(4 * page);
}

TEST_CASE("freed blocks stay up to what is kept, and go back to the system beyond it", "[large_blocks][quick]") {
    constexpr std::size_t block = std::size_t{32} << 20, small = std::size_t{128} << 10;
    const auto hold_and_free = [&] {
        std::vector<Block> held;
        for (int i = 0; i < 4; ++i) held.push_back({static_cast<unsigned char*>(::operator new(block)), block, 1});
        for (std::size_t i = 0; i < block / small; ++i)
            held.push_back({static_cast<unsigned char*>(::operator new(small)), small, 2});
        for (const Block& b : held) fill(b);
        for (const Block& b : held) ::operator delete(b.at);
    };
    keep_large_blocks(0);
    hold_and_free();
    const std::size_t before = resident_bytes();
    hold_and_free();
    CHECK(resident_bytes() < before + (std::size_t{4} << 20));
    keep_large_blocks(2 * block);
    hold_and_free();
    const std::size_t kept = resident_bytes();
    CHECK(kept > before + block);
    CHECK(kept < before + 2 * block + (std::size_t{4} << 20));
    keep_large_blocks(0);
    CHECK(resident_bytes() < before + (std::size_t{4} << 20));
    // More of them as long as no more is held than was before: all that hold_and_free() had at a time.
    constexpr std::size_t peak = 5 * block;
    keep_large_blocks(0, 4 * block);
    hold_and_free();
    CHECK(resident_bytes() > before + 3 * block);
    CHECK(resident_bytes() < before + 4 * block + (std::size_t{4} << 20));
    const Block large{static_cast<unsigned char*>(::operator new(3 * block)), 3 * block, 3};
    fill(large);
    CHECK(resident_bytes() < before + peak + (std::size_t{4} << 20));
    ::operator delete(large.at);
    keep_large_blocks(0);
    CHECK(resident_bytes() < before + (std::size_t{4} << 20));
    keep_large_blocks(std::size_t{8} << 20);
}

TEST_CASE("blocks side by side take the pages that they fill, and leave room to others", "[large_blocks][quick]") {
    constexpr std::size_t page = std::size_t{2} << 20, bytes = std::size_t{257} << 10, count = 160,
                          granule = std::size_t{8} << 10, whole_block = (bytes + granule - 1) / granule * granule;
    keep_large_blocks(0);
    const std::size_t before = resident_bytes();
    std::vector<Block> held = hold(count, bytes);
    CHECK(resident_bytes() > before + count * bytes - 2 * page);
    CHECK(resident_bytes() < before + count * whole_block + 3 * page);
    // In the room of one, and of two neighbours: nothing more becomes resident.
    const std::size_t most = resident_bytes();
    for (const std::size_t size : {bytes, std::size_t{56} << 10, 2 * whole_block, 2 * bytes}) {
        for (std::size_t i = 40; i < 42; ++i) ::operator delete(held[i].at);
        std::vector<Block> others = hold(2 * whole_block / ((size + granule - 1) / granule * granule), size);
        CHECK(resident_bytes() < most + page / 2);
        for (const Block& b : others) {
            CHECK(whole(b));
            ::operator delete(b.at);
        }
        for (std::size_t i = 40; i < 42; ++i) {
            held[i] = {static_cast<unsigned char*>(::operator new(bytes)), bytes, 7};
            fill(held[i]);
        }
    }
    // All but each sixteenth go; what is left holds what it held, and the pages that it lies in until they are trimmed.
    for (std::size_t i = 0; i < count; ++i)
        if (i % 16 != 0) ::operator delete(held[i].at);
    CHECK(resident_bytes() < before + count / 16 * 2 * page);
    CHECK(resident_bytes() < most - 8 * page);
    trim_freed_memory();
    CHECK(resident_bytes() < before + count / 16 * whole_block + page);
    for (std::size_t i = 0; i < count; i += 16) {
        CHECK(whole(held[i]));
        ::operator delete(held[i].at);
    }
    CHECK(resident_bytes() < before + 2 * page);
    keep_large_blocks(std::size_t{8} << 20);
}

TEST_CASE("huge pages are asked for", "[large_blocks][quick]") {
    for (const std::size_t bytes : {std::size_t{100} << 10, std::size_t{5} << 20, std::size_t{20} << 20}) {
        void* const block = ::operator new(bytes);
        std::ifstream maps("/proc/self/smaps");
        std::string line;
        bool inside = false, advised = false;
        while (std::getline(maps, line)) {
            unsigned long long from = 0, to = 0;
            if (std::sscanf(line.c_str(), "%llx-%llx ", &from, &to) == 2)
                inside =
                    from <= reinterpret_cast<std::uintptr_t>(block) && reinterpret_cast<std::uintptr_t>(block) < to;
            else if (inside && line.rfind("VmFlags:", 0) == 0)
                advised = line.find(" hg") != std::string::npos;
        }
        INFO(bytes << " bytes");
        CHECK(advised);
        ::operator delete(block);
    }
}

TEST_CASE("where addresses are short, those of freed blocks serve others", "[large_blocks][quick]") {
    const int status = status_of([] {
        std::size_t pages = 0;
        std::ifstream("/proc/self/statm") >> pages;
        const rlim_t most = pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) + (std::size_t{600} << 20);
        const rlimit limit{most, most};
        ::setrlimit(RLIMIT_AS, &limit);
        keep_large_blocks(std::size_t{1} << 30);
        int wrong = 0;
        for (int turn = 0; turn < 3; ++turn) {
            std::vector<void*> blocks;
            for (int i = 0; i < 64; ++i) blocks.push_back(::operator new (std::size_t{7} << 20));
            for (void* block : blocks) ::operator delete(block);
            ::operator delete(::operator new (std::size_t{400} << 20));
        }
        try {
            ::operator delete(::operator new (std::size_t{700} << 20));
            ++wrong;
        } catch (const std::bad_alloc&) {
        }
        return wrong;
    });
    CHECK(status == 0);
}

TEST_CASE("what is freed twice ends the program", "[large_blocks][quick]") {
    const int status = status_of([] {
        const rlimit none{0, 0};
        ::setrlimit(RLIMIT_CORE, &none);
        ::signal(SIGABRT, SIG_DFL);
        void* volatile block = ::operator new (std::size_t{100} << 10);
        ::operator delete(block);
        ::operator delete(block);
        return 0;
    });
    CHECK(WIFSIGNALED(status));
}

TEST_CASE("small pages at a block's end are there before they are written, and no others", "[large_blocks][quick]") {
#ifdef MADV_POPULATE_WRITE
    constexpr std::size_t huge = std::size_t{8} << 20, tail = std::size_t{3} << 19, spare = std::size_t{1} << 18;
    void* const probe = ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    const bool can = ::madvise(probe, 4096, MADV_POPULATE_WRITE) == 0;  // Linux 5.14
    ::munmap(probe, 4096);
    if (!can) {
        WARN("the kernel populates no pages on request: not tested");
        return;
    }
    keep_large_blocks(0);
    const std::size_t before = resident_bytes();
    // In blocks that are mapped for it, and in one that was kept for less.
    for (const std::size_t first : {tail, tail - spare}) {
        void* const small = ::operator new(huge + first);
        CHECK(resident_bytes() > before + first - spare / 2);
        keep_large_blocks(2 * huge);
        ::operator delete(small);
        void* const block = ::operator new(huge + tail);
        CHECK(resident_bytes() > before + tail - spare / 2);
        CHECK(resident_bytes() < before + tail + spare / 2);
        ::operator delete(block);
        keep_large_blocks(0);
        CHECK(resident_bytes() < before + spare / 2);
    }
    keep_large_blocks(std::size_t{8} << 20);
#endif
}
#endif

TEST_CASE("blocks of every size keep what is written to them, on several threads", "[large_blocks][quick]") {
    std::vector<std::thread> threads;
    std::vector<int> wrong(3);
    for (std::size_t t = 0; t < wrong.size(); ++t)
        threads.emplace_back([&wrong, t] {
            std::mt19937 random(static_cast<unsigned>(t));
            const std::size_t sizes[] = {1,       4096,    65535,    65536,   65537,
                                         131072,  262144,  524288,   1040000, 1048575,
                                         1048576, 1500000, 2040000,  2097152, 2097153,
                                         4100000, 3000000, 4194304,  5000000, 8388607,
                                         8388608, 49151,   10000000, 49152,   std::size_t{9} << 20};
            std::vector<Block> held;
            for (int turn = 0; turn < 600; ++turn) {
                if (held.size() > 20 || (!held.empty() && random() % 3 == 0)) {
                    const std::size_t k = random() % held.size();
                    if (!whole(held[k])) ++wrong[t];
                    if (random() % 2)
                        ::operator delete(held[k].at);
                    else
                        ::operator delete(held[k].at, held[k].bytes);
                    held.erase(held.begin() + static_cast<std::ptrdiff_t>(k));
                    continue;
                }
                const std::size_t bytes = sizes[random() % std::size(sizes)];
                held.push_back(
                    {static_cast<unsigned char*>(::operator new(bytes)), bytes, static_cast<unsigned char>(random())});
                fill(held.back());
            }
            for (const Block& b : held) {
                if (!whole(b)) ++wrong[t];
                ::operator delete(b.at);
            }
        });
    for (std::thread& thread : threads) thread.join();
    CHECK(wrong == std::vector<int>{0, 0, 0});
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST_CASE("a block that cannot be had is bad_alloc", "[large_blocks][quick]") {
    for (const std::size_t much : {std::size_t{1} << 60, SIZE_MAX - 4096, SIZE_MAX}) {
        volatile std::size_t bytes = much;
        CHECK_THROWS_AS(::operator new(bytes), std::bad_alloc);
    }
}
#endif
