"""Openings of joints: when one is widest, where it moves at all."""

from __future__ import annotations

import xarray as xr

_MOVES = 1e-8  # of the widest opening, below which what it varies by is round-off


def peak_opening_time(dataset: xr.Dataset, joint: str) -> float | None:
    """Time of a joint's largest opening [s]; None where its widest opening does not move over the run.

    Blocks that mirror each other at a joint and shake along it keep the opening of the start: when the
    largest comes is then round-off.
    """
    own = dataset.sel(joint=joint)
    peak = float(own.peak_opening)
    if "opening" in dataset:
        widest = dataset.opening.values[:, dataset.gap_joint.values == joint].max(axis=1)
        if peak - widest.min() <= _MOVES * max(abs(peak), abs(float(widest.min()))):
            return None
    return float(own.peak_opening_time)
