"""What the C library does with memory that a training frees."""

from __future__ import annotations

import ctypes

# Of glibc's malloc.h. Blocks of up to 32 MiB, its largest threshold, are parts of the heap.
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_MMAP_THRESHOLD, _TRIM_THRESHOLD = 2**25, 2**31 - 1  # bytes


def keep_freed_memory() -> None:
    """Let glibc keep what is freed; other C libraries do as they do.

    Each batch needs the same tens of megabytes again. Given back to the system, as glibc does once
    the end of its heap is free, they come as new pages, each set to zero: a training then takes
    more than twice as long.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _MMAP_THRESHOLD)
        mallopt(_M_TRIM_THRESHOLD, _TRIM_THRESHOLD)
