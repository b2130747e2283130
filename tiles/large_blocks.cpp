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
/// What a block gets: whole huge pages, or a whole part of one, where that is no more than a 32nd more.
constexpr std::size_t rounded(std::size_t bytes) {
    if (bytes < least_part || bytes > PTRDIFF_MAX) return bytes;
    const std::size_t whole = bytes < page ? std::bit_ceil(bytes) : (bytes + page - 1) / page * page;
    return whole - bytes <= bytes / 32 ? whole : bytes;
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
        const std::lock_guard lock(mutex_);
        if (!is_part(bytes)) {
            Block* const block = take(bytes);
            return block ? block->at : nullptr;
        }
        const std::size_t parts = page / bytes;
        const std::uint32_t all = parts == 32 ? ~0U : (1U << parts) - 1;
        Block* shared = nullptr;
        for (Block& block : blocks_)
            if (block.part == bytes && !block.kept && block.used != all) {
                shared = &block;
                break;
            }
        if (!shared) {
            shared = take(page);
            if (!shared) return nullptr;
            shared->part = bytes;
            shared->used = 0;
        }
        const int first = std::countr_one(shared->used);
        shared->used |= 1U << first;
        return static_cast<char*>(shared->at) + static_cast<std::size_t>(first) * bytes;
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
        std::uint64_t kept = 0;   // when it was freed; 0: it is in use
        std::size_t touched = 0;  // bytes of it that may be resident, whole small pages
        std::size_t part = 0;     // bytes of each part; 0: it is not shared out
        std::uint32_t used = 0;   // which parts
    };

    Block* take(std::size_t bytes) noexcept {
        const std::size_t pages = (bytes + page - 1) / page;
        Block* room = nullptr;
        for (Block& block : blocks_) {
            if (block.kept && block.pages == pages) {
                block.kept = 0;
                kept_bytes_ -= block.touched;
                fit(block, bytes);
                use(block);
                return &block;
            }
            if (!block.at && !room) room = &block;
        }
        if (!room) room = drop_oldest();
        if (!room) return nullptr;
        void* at = map(pages);
        while (!at && drop_oldest()) at = map(pages);
        if (!at) return nullptr;
        // Wishes: nothing depends on them. What is left at the end comes in small pages, so that no more is resident than was
        // asked for; all at once, for to fetch each when it is first written takes many times as long.
        const std::size_t whole = bytes / page * page;
        if (whole > 0) ::madvise(at, whole, MADV_HUGEPAGE);
        if (whole < bytes) {
            ::madvise(static_cast<char*>(at) + whole, pages * page - whole, MADV_NOHUGEPAGE);
            fill(static_cast<char*>(at) + whole, bytes - whole);
        }
        *room = {.at = at, .pages = pages, .touched = in_small_pages(bytes)};
        use(*room);
        drop();
        return room;
    }

    /// A kept block shall hold `bytes`: what an earlier one had beyond that is not worth a system call unless it is much.
    static void fit(Block& block, std::size_t bytes) noexcept {
        constexpr std::size_t much = page / 4;
        const std::size_t wanted = in_small_pages(bytes);
        char* const at = static_cast<char*>(block.at);
        if (wanted > block.touched)
            fill(at + block.touched, wanted - block.touched);
        else if (block.touched >= wanted + much)
            ::madvise(at + wanted, block.touched - wanted, MADV_DONTNEED);
        else
            return;
        block.touched = wanted;
    }

    static void fill(void* at, std::size_t bytes) noexcept {
        ::madvise(at, bytes, MADV_POPULATE_WRITE);  // Linux 5.14 and later
    }

    void use(const Block& block) noexcept {
        used_bytes_ += block.touched;
        most_used_ = std::max(most_used_, used_bytes_);
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
