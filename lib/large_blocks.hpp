// Large blocks: operator new of 48 KiB or more, in huge pages where the system grants them on request
// (/sys/kernel/mm/transparent_hugepage/enabled: madvise or always). Those of less than 8 MiB lie side by side in pages that
// they share, each in the first room that is long enough; others have pages of their own, a huge one at the end too if they
// lack no more than a 32nd of their size and 128 KiB to that, else small ones there, all at once. Images, chunks and tiles are
// filled at once; without this thousands of faults of 4 KiB take a quarter to a third of a run. Leaves other blocks to malloc:
// what lasts of smaller ones (a spill's packed blocks) would hold pages of which the most is free.
//
// Of pages and blocks that are free some are kept for the next ones; what is free of a page in use stays until trim_freed_memory().
// Where no memory is left all that is kept goes. Shared pages hold 8 GiB at the most; beyond that malloc serves.
#pragma once
#include <cstddef>

namespace wedgescope {

/// Freed blocks of `always` bytes together, at most, stay with the program; and of `most` bytes as long as the large blocks in
/// use and those kept are together no more than were once in use at a time: what large blocks take does not rise by these.
/// Beside the peak of other memory that comes later they may stand, so `most` belongs into what the program may take beyond
/// its budget.
void keep_large_blocks(std::size_t always, std::size_t most = 0);

/// Gives back to the system what lies free between blocks in use, malloc's too. For once after much was freed: what comes to lie there
/// gets small pages.
void trim_freed_memory();

}  // namespace wedgescope
