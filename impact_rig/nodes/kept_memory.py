"""Memory that a process frees and soon needs again, kept instead of being given back."""

import contextlib
import ctypes

LARGEST_KEPT = 32 << 20
"""Up to what size a piece of memory is kept [byte]: the largest that the C library takes for
`M_MMAP_THRESHOLD`; a block of the fastest stream has 2 MB."""
MOST_KEPT = 64 << 20
"""How much of what is free stays at the end of the heap [byte], our choice: a few chunks, and the
blocks of which they are made."""
_M_TRIM_THRESHOLD = -1
_M_MMAP_THRESHOLD = -3


def keep_memory() -> None:
    """Have this process keep memory that it frees, where its C library can.

    Otherwise each block of a fast stream, and each copy on its way, gets new memory of the system,
    page by page, and gives it back: that takes half as long as compressing it with lz4.
    """
    with contextlib.suppress(OSError, AttributeError):
        set_option = ctypes.CDLL(None).mallopt
        set_option(_M_MMAP_THRESHOLD, LARGEST_KEPT)
        set_option(_M_TRIM_THRESHOLD, MOST_KEPT)
