#include "lib/large_blocks.hpp"

#include <malloc.h>

// Sanitizers have an operator new of their own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)

namespace wedgescope {
void keep_large_blocks(std::size_t, std::size_t) {}
void trim_freed_memory() { ::malloc_trim(0); }
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

/// Blocks of so many bytes and less than so many share huge pages.
constexpr std::size_t least_shared = std::size_t{48} << 10, more_than_shared = 4 * page;

/// What a block gets: whole huge pages where it lacks but little of them. So much more is in no budget.
constexpr std::size_t rounded(std::size_t bytes) {
    constexpr std::size_t most_more = page / 16;
    if (bytes > PTRDIFF_MAX) return bytes;
    const std::size_t whole = (bytes + page - 1) / page * page;
    return whole - bytes <= std::min(bytes / 32, most_more) ? whole : bytes;
}
/// Bytes that small pages hold.
constexpr std::size_t in_small_pages(std::size_t bytes) {
    constexpr std::size_t small_page = 4096;
    return (bytes + small_page - 1) / small_page * small_page;
}

/// Of 2 MiB-aligned memory that nobody has touched; null if there is none.
void* map(std::size_t pages) noexcept {
    const std::size_t bytes = pages * page;
    void* const all = ::mmap(nullptr, bytes + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (all == MAP_FAILED) return nullptr;
    char* const begin = static_cast<char*>(all);
    const std::size_t before = (page - reinterpret_cast<std::uintptr_t>(begin) % page) % page;
    if (before > 0) ::munmap(begin, before);
    if (before < page) ::munmap(begin + before + bytes, page - before);
    return begin + before;
}

/// Some huge pages one after the other and the blocks that lie in them side by side. Each lies in the first room that is long
/// enough, so that the first pages fill and the last ones become empty.
class SharedPages {
public:
    static constexpr std::size_t pages = 16;
    /// What blocks are made of.
    static constexpr std::size_t granule = std::size_t{8} << 10;
    static constexpr std::size_t granules(std::size_t bytes) { return (bytes + granule - 1) / granule; }

    /// How many pages come into use with a block, and how many of them were kept.
    struct Begun {
        std::size_t pages = 0, kept = 0;
    };

    /// Null if there is no memory.
    static SharedPages* make() noexcept {
        void* const room = std::malloc(sizeof(SharedPages));
        void* const at = room ? map(pages) : nullptr;
        if (at) return ::new (room) SharedPages(static_cast<char*>(at));
        std::free(room);
        return nullptr;
    }
    /// Gives all of it back to the system. Nothing of it may be in use.
    static void unmake(SharedPages* shared) noexcept {
        ::munmap(shared->at_, pages * page);
        std::free(shared);
    }
    bool hold(const void* at) const noexcept {
        return reinterpret_cast<std::uintptr_t>(at) - reinterpret_cast<std::uintptr_t>(at_) < pages * page;
    }

    /// The first room of `count` granules; null if there is none.
    void* allocate(std::size_t count, Begun& begun) noexcept {
        if (count > longest_) return nullptr;
        std::size_t room = 0;  // in front of where we are
        longest_ = 0;
        for (std::size_t word = 0; word < used_.size(); ++word)
            for (std::size_t bit = 0; bit < bits;) {
                const std::uint64_t rest = used_[word] >> bit;
                const std::size_t clear = std::min<std::size_t>(std::countr_zero(rest), bits - bit);
                if (room + clear >= count) {
                    longest_ = all;  // who knows, behind it
                    return take(word * bits + bit - room, count, begun);
                }
                room += clear;
                bit += clear;
                longest_ = std::max(longest_, room);
                if (bit == bits) break;
                room = 0;
                bit += static_cast<std::size_t>(std::countr_one(rest >> clear));
            }
        return nullptr;
    }

    /// How many pages are kept now that were in use before.
    std::size_t release(const void* at, std::uint64_t stamp) noexcept {
        const std::size_t first = static_cast<std::size_t>(static_cast<const char*>(at) - at_) / granule,
                          count = length_[first];
        if (count == 0) std::abort();  // no block begins there, or it was freed before
        length_[first] = 0;
        mark(first, count, false);
        longest_ = all;
        std::size_t left = 0;
        for_pages(first, count, [&](std::size_t i) {
            if (in_use(i)) return;
            kept_[i] = stamp;
            ++left;
        });
        return left;
    }

    bool in_use() const noexcept {
        return std::any_of(used_.begin(), used_.end(), [](std::uint64_t word) { return word != 0; });
    }

    /// Gives back to the system what is free of the pages in use.
    void trim() noexcept {
        for (std::size_t i = 0; i < pages; ++i)
            if (in_use(i))
                for (std::size_t from = i * granules_a_page, to = from, end = from + granules_a_page; from < end;
                     from = to) {
                    const bool used = is_used(from);
                    while (to < end && is_used(to) == used) ++to;
                    if (!used) ::madvise(at_ + from * granule, (to - from) * granule, MADV_DONTNEED);
                }
    }

    /// The page that was left first: when; 0 if none is kept.
    std::uint64_t oldest() const noexcept {
        std::uint64_t least = 0;
        for (const std::uint64_t stamp : kept_)
            if (stamp > 0 && (least == 0 || stamp < least)) least = stamp;
        return least;
    }
    /// Gives back to the system all pages that were left then. How many.
    std::size_t drop(std::uint64_t stamp) noexcept {
        std::size_t count = 0;
        for (std::size_t i = 0; i < pages; ++i)
            if (kept_[i] == stamp) {
                ::madvise(at_ + i * page, page, MADV_DONTNEED);
                kept_[i] = 0;
                ++count;
            }
        return count;
    }

private:
    explicit SharedPages(char* at) noexcept : at_(at) { ::madvise(at_, pages * page, MADV_HUGEPAGE); }

    static constexpr std::size_t bits = 64, granules_a_page = page / granule, all = pages * granules_a_page;

    void* take(std::size_t first, std::size_t count, Begun& begun) noexcept {
        for_pages(first, count, [&](std::size_t i) {
            if (in_use(i)) return;
            ++begun.pages;
            if (kept_[i] > 0) ++begun.kept;
            kept_[i] = 0;
        });
        mark(first, count, true);
        length_[first] = static_cast<std::uint16_t>(count);
        return at_ + first * granule;
    }

    template <class Use>
    static void for_pages(std::size_t first, std::size_t count, const Use& use) noexcept {
        for (std::size_t i = first / granules_a_page; i <= (first + count - 1) / granules_a_page; ++i) use(i);
    }

    bool in_use(std::size_t i) const noexcept {
        std::uint64_t any = 0;
        for (std::size_t word = i * granules_a_page / bits; word < (i + 1) * granules_a_page / bits; ++word)
            any |= used_[word];
        return any != 0;
    }
    bool is_used(std::size_t at) const noexcept { return used_[at / bits] >> at % bits & 1; }

    void mark(std::size_t first, std::size_t count, bool use) noexcept {
        for (const std::size_t end = first + count; first < end;) {
            const std::size_t bit = first % bits, some = std::min(bits - bit, end - first);
            const std::uint64_t these = (some == bits ? ~std::uint64_t{0} : (std::uint64_t{1} << some) - 1) << bit;
            if (use)
                used_[first / bits] |= these;
            else
                used_[first / bits] &= ~these;
            first += some;
        }
    }

    char* at_;
    std::size_t longest_ = all;  // no room for more
    std::array<std::uint64_t, all / bits> used_{};
    std::array<std::uint64_t, pages> kept_{};  // when a page was left; 0: it is in use, or not resident
    std::array<std::uint16_t, all> length_{};  // of the block that begins there
};

/// All that are held or kept; what finds no place here comes from malloc.
class LargeBlocks {
public:
    /// Null: malloc shall do it.
    void* allocate(std::size_t bytes) noexcept {
        if (bytes < more_than_shared) {
            const std::lock_guard lock(mutex_);
            return share(SharedPages::granules(bytes));
        }
        Taken taken;
        {
            const std::lock_guard lock(mutex_);
            taken = take(rounded(bytes));
        }
        // The block is the caller's by now: nobody has to wait for this.
        if (taken.missing > 0) fill(taken.end, taken.missing);
        return taken.at;
    }

    /// False: it is none of these.
    bool release(void* at) noexcept {
        if (reinterpret_cast<std::uintptr_t>(at) % SharedPages::granule != 0) return false;
        const std::lock_guard lock(mutex_);
        for (SharedPages* shared : shared_) {
            if (!shared) break;
            if (!shared->hold(at)) continue;
            const std::size_t left = shared->release(at, ++stamp_) * page;
            kept_bytes_ += left;
            used_bytes_ -= left;
            drop();
            return true;
        }
        for (Block& block : blocks_) {
            if (block.at != at || block.kept) continue;
            block.kept = ++stamp_;
            kept_bytes_ += block.touched;
            used_bytes_ -= block.touched;
            drop();
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

    void trim() noexcept {
        const std::lock_guard lock(mutex_);
        for (SharedPages* shared : shared_) {
            if (!shared) break;
            shared->trim();
        }
    }

    /// All that nobody uses, addresses too; false if there is no such thing.
    bool give_all_back() noexcept {
        const std::lock_guard lock(mutex_);
        return give_back_unused();
    }

private:
    struct Block {
        void* at = nullptr;
        std::size_t pages = 0;
        std::size_t huge = 0;     // of them; but for these small pages
        std::uint64_t kept = 0;   // when it was freed; 0: it is in use
        std::size_t touched = 0;  // bytes of it that may be resident, whole small pages
    };

    /// A block, and small pages at its end that it has yet to get.
    struct Taken {
        void* at = nullptr;
        char* end = nullptr;
        std::size_t missing = 0;
    };

    void* share(std::size_t granules) noexcept {
        for (SharedPages*& shared : shared_) {
            if (!shared) shared = SharedPages::make();
            if (!shared) return nullptr;  // where regions can be unmapped for it, operator new does so
            SharedPages::Begun begun;
            void* const at = shared->allocate(granules, begun);
            if (!at) continue;
            kept_bytes_ -= begun.kept * page;
            use(begun.pages * page);
            return at;
        }
        return nullptr;
    }

    void use(std::size_t bytes) noexcept {
        used_bytes_ += bytes;
        most_used_ = std::max(most_used_, used_bytes_);
        drop();
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
        if (!block) {
            block = oldest_kept();
            if (!block) return {};
            give_back(*block);
        }
        if (block->kept) {
            block->kept = 0;
            kept_bytes_ -= block->touched;
            leave_rest(*block, touched);
        } else {
            void* at = map(pages);
            if (!at && give_back_unused()) at = map(pages);
            if (!at) return {};
            *block = {.at = at, .pages = pages, .huge = huge, .touched = huge * page};
            // Wishes: nothing depends on them. What is left at the end comes in small pages, so that no more is resident than
            // was asked for; all at once, for to fetch each when it is first written takes many times as long.
            if (huge > 0) ::madvise(at, huge * page, MADV_HUGEPAGE);
            if (huge < pages) ::madvise(static_cast<char*>(at) + huge * page, page, MADV_NOHUGEPAGE);
        }
        Taken taken{block->at, nullptr, 0};
        if (touched > block->touched) {
            taken.end = static_cast<char*>(block->at) + block->touched;
            taken.missing = touched - block->touched;
            block->touched = touched;
        }
        use(block->touched);
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

    bool may_keep() const noexcept {
        return kept_bytes_ <= always_kept_ || (kept_bytes_ <= most_kept_ && used_bytes_ + kept_bytes_ <= most_used_);
    }

    void drop() noexcept {
        while (!may_keep() && drop_oldest()) {
        }
    }

    bool give_back_unused() noexcept {
        bool any = false;
        while (drop_oldest()) any = true;
        std::size_t left = 0;
        for (SharedPages*& shared : shared_) {
            SharedPages* const own = shared;
            shared = nullptr;
            if (!own) break;
            if (own->in_use()) {
                shared_[left++] = own;
            } else {
                SharedPages::unmake(own);
                any = true;
            }
        }
        return any;
    }

    /// Gives what was freed first of all that is kept back to the system; false if nothing is kept.
    bool drop_oldest() noexcept {
        Block* const oldest = oldest_kept();
        SharedPages* left = nullptr;
        std::uint64_t since = oldest ? oldest->kept : ~std::uint64_t{0};
        for (SharedPages* shared : shared_) {
            if (!shared) break;
            if (const std::uint64_t stamp = shared->oldest(); stamp > 0 && stamp < since) {
                since = stamp;
                left = shared;
            }
        }
        if (left)
            kept_bytes_ -= left->drop(since) * page;
        else if (oldest)
            give_back(*oldest);
        return left || oldest;
    }

    void give_back(Block& kept) noexcept {
        ::munmap(kept.at, kept.pages * page);
        kept_bytes_ -= kept.touched;
        kept = {};
    }

    /// The one that was freed first; null if none is kept.
    Block* oldest_kept() noexcept {
        Block* oldest = nullptr;
        for (Block& block : blocks_)
            if (block.kept && (!oldest || block.kept < oldest->kept)) oldest = &block;
        return oldest;
    }

    std::mutex mutex_;
    std::array<Block, 256> blocks_{};
    std::array<SharedPages*, 256> shared_{};
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
    if (bytes >= least_shared && bytes <= PTRDIFF_MAX)
        if (void* const block = large_blocks().allocate(bytes)) return block;
    return std::malloc(bytes ? bytes : 1);
}

void release(void* block) noexcept {
    if (!block || !large_blocks().release(block)) std::free(block);
}

}  // namespace

void keep_large_blocks(std::size_t bytes, std::size_t most) { large_blocks().keep(bytes, most); }
void trim_freed_memory() {
    large_blocks().trim();
    ::malloc_trim(0);
}

}  // namespace wedgescope

void* operator new(std::size_t bytes) {
    for (;;) {
        if (void* const block = wedgescope::allocate(bytes)) return block;
        if (wedgescope::large_blocks().give_all_back()) continue;
        const std::new_handler handler = std::get_new_handler();
        if (!handler) throw std::bad_alloc();
        handler();
    }
}
void operator delete(void* block) noexcept { wedgescope::release(block); }
void operator delete(void* block, std::size_t) noexcept { wedgescope::release(block); }

#endif
