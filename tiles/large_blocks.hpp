// Large blocks: operator new of 2 MiB or more, and of 64, 128, 256, 512 KiB or 1 MiB (decoded tiles, small images, several
// to a page), in huge pages where the system grants them on request (/sys/kernel/mm/transparent_hugepage/enabled: madvise
// or always). What lacks no more than a 32nd of its own size, and 128 KiB, to that counts as such; what is left at the end
// of others comes in small pages, all at once. Images, chunks and tiles are filled at once; without this thousands of
// faults of 4 KiB take a quarter to a third of a run. Leaves other blocks to malloc.
//
// Of those freed some are kept for the next ones of their size.
#pragma once
#include <cstddef>

namespace wedgescope {

/// Freed blocks of `always` bytes together, at most, stay with the program; and of `most` bytes as long as the large blocks in
/// use and those kept are together no more than were once in use at a time: what large blocks take does not rise by these.
/// Beside the peak of other memory that comes later they may stand, so `most` belongs into what the program may take beyond
/// its budget.
void keep_large_blocks(std::size_t always, std::size_t most = 0);

}  // namespace wedgescope
