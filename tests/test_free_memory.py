"""What a process has freed in pieces goes back to the system when it is asked for."""

import sys
from pathlib import Path

import numpy as np
import pytest

from romdam.core.machine import return_free_memory


def resident() -> int:
    """Bytes of memory that this process has of its own."""
    line = next(
        line for line in Path("/proc/self/smaps_rollup").read_text().splitlines() if "Anonymous:" in line
    )
    return 1024 * int(line.split()[1])


@pytest.mark.skipif(
    not Path("/proc/self/smaps_rollup").exists() or sys.platform != "linux", reason="Linux tells"
)
def test_what_was_freed_under_a_piece_in_use_goes_back():
    pieces = [np.ones(8_000) for _ in range(3_000)]  # 64 kB each, below what is mapped by itself
    last = pieces.pop()  # the heap cannot shrink beyond it
    full = resident()
    del pieces
    return_free_memory()
    assert full - resident() > 0.8 * 3_000 * 64e3 and last.sum() == 8_000
