"""Whether hardly any memory is left where that of the process is limited (``ulimit -v``)."""

from __future__ import annotations

import mmap
import resource

# Memory that must be free before a kernel is called that needs some, or a library is blamed
# [bytes]: Fortran's own library ends the program if a small allocation fails.
RESERVE = 2**24


def is_memory_short(size: int) -> bool:
    """Whether the memory of this process is limited, and less than a size is left [bytes]."""
    if not _is_limited():
        return False
    try:
        mmap.mmap(-1, size).close()
    except OSError:
        return True
    return False


def spare_memory() -> mmap.mmap | None:
    """Memory to be freed where a program ends for lack of it; None where it is not limited."""
    return mmap.mmap(-1, RESERVE) if _is_limited() else None


def _is_limited() -> bool:
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
