"""Peaks of jumps at the gaps' positions, from those of the jumps that joint forces see."""

import numpy as np
import pytest

from romdam.timestepping.peaks import peaks_at_points


def test_what_is_reached_between_written_rows_is_added_to_the_written_peaks():
    """Written openings up to 4 mm reach 5 mm between rows; at the positions 3 mm are written: 4 mm.

    Slips of (3, 4) mm reach 7 mm; at the positions (6, 8) mm are written: 12 mm.
    """
    jump, at_points = np.zeros((2, 3, 1, 3))
    jump[1, 0], at_points[2, 0] = (4e-3, 3e-3, 4e-3), (3e-3, 6e-3, 8e-3)
    peaks = {
        "opening": np.array([5e-3]),
        "slip": np.array([7e-3]),
        "opening_time": np.array([0.14]),
        "compression": np.array([1.0]),
    }
    found = peaks_at_points(peaks, jump, at_points, np.array([0.0, 0.1, 0.2]))
    assert found["opening"] == pytest.approx([4e-3], rel=1e-12)
    assert found["slip"] == pytest.approx([12e-3], rel=1e-12)
    assert found["opening_time"] == [0.2] and found["compression"] == [1.0]
