#include "tiles/large_blocks.hpp"

// Sanitizers have an operator new of their own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)

namespace wedgescope {
void keep_large_blocks(std::size_t, std::size_t) {}
}  // namespace wedgescope

#else

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <mutex>
#include <new>

namespace wedgescope {
namespace {

constexpr std::size_t page = std::size_t{2} << 20;

/// Parts of a huge page: of exactly 64 KiB to 1 MiB.
constexpr std::size_t least_part = page / 32, most_part = page / 2;
constexpr bool is_part(std::size_t bytes) {
    return bytes >= least_part && bytes <= most_part && std::has_single_bit(bytes);
}
/// What a block gets: whole huge pages, or a whole part of one, where it lacks but little of that. So much more is in no budget.
constexpr std::size_t rounded(std::size_t bytes) {
    constexpr std::size_t most_more = page / 16;
    if (bytes < least_part || bytes > PTRDIFF_MAX) return bytes;
    const std::size_t whole = bytes < page ? std::bit_ceil(bytes) : (bytes + page - 1) / page * page;
    return whole - bytes <= std::min(bytes / 32, most_more) ? whole : bytes;
}
/// Bytes that small pages hold.
constexpr std::size_t in_small_pages(std::size_t bytes) {
    constexpr std::size_t small_page = 4096;
    return (bytes + small_page - 1) / small_page * small_page;
}

/// All that are held or kept; what finds no place here comes from malloc.
class LargeBlocks {
public:
    /// Null: malloc shall do it.
    void* allocate(std::size_t bytes) noexcept {
        Taken taken;
        {
            const std::lock_guard lock(mutex_);
            taken = is_part(bytes) ? share(bytes) : take(bytes);
        }
        // The block is the caller's by now: nobody has to wait for this.
        if (taken.missing > 0) fill(taken.end, taken.missing);
        return taken.at;
    }

    /// False: it is none of these.
    bool release(void* at) noexcept {
        const auto address = reinterpret_cast<std::uintptr_t>(at);
        if (address % least_part != 0) return false;
        const std::lock_guard lock(mutex_);
        for (Block& block : blocks_) {
            if (!block.at || block.kept) continue;
            const std::uintptr_t offset = address - reinterpret_cast<std::uintptr_t>(block.at);
            if (offset >= (block.part ? page : 1)) continue;
            if (block.part) block.used &= ~(1U << (offset / block.part));
            if (block.used == 0) {
                block.part = 0;
                block.kept = ++stamp_;
                kept_bytes_ += block.touched;
                used_bytes_ -= block.touched;
                drop();
            }
            return true;
        }
        return false;
    }

    void keep(std::size_t bytes, std::size_t most) noexcept {
        const std::lock_guard lock(mutex_);
        always_kept_ = bytes;
        most_kept_ = most;
        drop();
    }

private:
    struct Block {
        void* at = nullptr;
        std::size_t pages = 0;
        std::size_t huge = 0;     // of them; but for these small pages
        std::uint64_t kept = 0;   // when it was freed; 0: it is in use
        std::size_t touched = 0;  // bytes of it that may be resident, whole small pages
        std::size_t part = 0;     // bytes of each part; 0: it is not shared out
        std::uint32_t used = 0;   // which parts
    };

    /// A block or a part of one, and small pages at its end that it has yet to get.
    struct Taken {
        Block* block = nullptr;
        void* at = nullptr;
        char* end = nullptr;
        std::size_t missing = 0;
    };

    Taken share(std::size_t bytes) noexcept {
        const std::size_t parts = page / bytes;
        const std::uint32_t all = parts == 32 ? ~0U : (1U << parts) - 1;
        Taken taken;
        for (Block& block : blocks_)
            if (block.part == bytes && !block.kept && block.used != all) {
                taken.block = &block;
                break;
            }
        if (!taken.block) {
            taken = take(page);
            if (!taken.block) return {};
            taken.block->part = bytes;
            taken.block->used = 0;
        }
        const int first = std::countr_one(taken.block->used);
        taken.block->used |= 1U << first;
        taken.at = static_cast<char*>(taken.block->at) + static_cast<std::size_t>(first) * bytes;
        return taken;
    }

    Taken take(std::size_t bytes) noexcept {
        const std::size_t pages = (bytes + page - 1) / page, huge = bytes / page, touched = in_small_pages(bytes);
        Block* block = nullptr;
        for (Block& other : blocks_) {
            if (other.kept && other.pages == pages && other.huge == huge) {
                block = &other;
                break;
            }
            if (!other.at && !block) block = &other;
        }
        if (!block) block = drop_oldest();
        if (!block) return {};
        if (block->kept) {
            block->kept = 0;
            kept_bytes_ -= block->touched;
            leave_rest(*block, touched);
        } else {
            void* at = map(pages);
            while (!at && drop_oldest()) at = map(pages);
            if (!at) return {};
            *block = {.at = at, .pages = pages, .huge = huge, .touched = huge * page};
            // Wishes: nothing depends on them. What is left at the end comes in small pages, so that no more is resident than
            // was asked for; all at once, for to fetch each when it is first written takes many times as long.
            if (huge > 0) ::madvise(at, huge * page, MADV_HUGEPAGE);
            if (huge < pages) ::madvise(static_cast<char*>(at) + huge * page, page, MADV_NOHUGEPAGE);
        }
        Taken taken{block, block->at, nullptr, 0};
        if (touched > block->touched) {
            taken.end = static_cast<char*>(block->at) + block->touched;
            taken.missing = touched - block->touched;
            block->touched = touched;
        }
        used_bytes_ += block->touched;
        most_used_ = std::max(most_used_, used_bytes_);
        drop();
        return taken;
    }

    /// What a kept block had beyond what it shall hold now is not worth a system call unless it is much.
    static void leave_rest(Block& block, std::size_t touched) noexcept {
        constexpr std::size_t much = page / 4;
        if (block.touched < touched + much) return;
        ::madvise(static_cast<char*>(block.at) + touched, block.touched - touched, MADV_DONTNEED);
        block.touched = touched;
    }

    static void fill(void* at, std::size_t bytes) noexcept {
#ifdef MADV_POPULATE_WRITE  // Linux 5.14
        const int before = errno;
        ::madvise(at, bytes, MADV_POPULATE_WRITE);
        errno = before;
#else
        (void)at, (void)bytes;
#endif
    }

    static void* map(std::size_t pages) noexcept {
        const std::size_t bytes = pages * page;
        void* const all = ::mmap(nullptr, bytes + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (all == MAP_FAILED) return nullptr;
        char* const begin = static_cast<char*>(all);
        const std::size_t before = (page - reinterpret_cast<std::uintptr_t>(begin) % page) % page;
        if (before > 0) ::munmap(begin, before);
        if (before < page) ::munmap(begin + before + bytes, page - before);
        return begin + before;
    }

    bool may_keep() const noexcept {
        return kept_bytes_ <= always_kept_ || (kept_bytes_ <= most_kept_ && used_bytes_ + kept_bytes_ <= most_used_);
    }

    void drop() noexcept {
        while (!may_keep()) drop_oldest();
    }

    /// Gives a kept block back to the system: the one freed first. Its room; null if none is kept.
    Block* drop_oldest() noexcept {
        Block* oldest = nullptr;
        for (Block& block : blocks_)
            if (block.kept && (!oldest || block.kept < oldest->kept)) oldest = &block;
        if (!oldest) return nullptr;
        ::munmap(oldest->at, oldest->pages * page);
        kept_bytes_ -= oldest->touched;
        *oldest = {};
        return oldest;
    }

    std::mutex mutex_;
    std::array<Block, 256> blocks_{};
    std::size_t kept_bytes_ = 0, used_bytes_ = 0, most_used_ = 0;
    std::size_t always_kept_ = 4 * page, most_kept_ = 0;
    std::uint64_t stamp_ = 0;
};

/// Never destroyed: blocks are freed up to the very end.
LargeBlocks& large_blocks() {
    alignas(LargeBlocks) static std::byte room[sizeof(LargeBlocks)];
    static LargeBlocks* const blocks = ::new (static_cast<void*>(room)) LargeBlocks;
    return *blocks;
}

void* allocate(std::size_t bytes) {
    const std::size_t whole = rounded(bytes);
    if ((whole >= page && whole <= PTRDIFF_MAX) || is_part(whole))
        if (void* const block = large_blocks().allocate(whole)) return block;
    return std::malloc(bytes ? bytes : 1);
}

void release(void* block) noexcept {
    if (!block || !large_blocks().release(block)) std::free(block);
}

}  // namespace

void keep_large_blocks(std::size_t bytes, std::size_t most) { large_blocks().keep(bytes, most); }

}  // namespace wedgescope

void* operator new(std::size_t bytes) {
    for (;;) {
        if (void* const block = wedgescope::allocate(bytes)) return block;
        const std::new_handler handler = std::get_new_handler();
        if (!handler) throw std::bad_alloc();
        handler();
    }
}
void operator delete(void* block) noexcept { wedgescope::release(block); }
void operator delete(void* block, std::size_t) noexcept { wedgescope::release(block); }

#endif
