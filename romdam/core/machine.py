"""Memory of the machine, and how much of it a model may take."""

from __future__ import annotations

import ctypes
import os
import sys

_SHARE = 0.8  # of the machine's memory, where no limit is given


def memory_limit(limit: float | None) -> float:
    """Bytes that may be taken: the limit, or four fifths of the machine's."""
    return _SHARE * machine_memory() if limit is None else limit


def machine_memory() -> float:
    """Bytes of memory of the machine; inf where it does not tell."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return float("inf")


def return_free_memory() -> None:
    """Return to the system the memory that this process has freed, much of which the heap of glibc keeps.

    Other C libraries return it themselves; there nothing is done.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def shown_size(count: float) -> str:
    """Bytes as a message shows them."""
    if count >= 1e14:
        return f"{count / 1e9:.2g} GB"
    return f"{count / 1e9:.1f} GB" if count >= 1e8 else f"{count / 1e6:.0f} MB"
