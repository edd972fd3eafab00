"""Two runs side by side: their gaps matched by position and their rows by time, then compared."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.files import check_file
from romdam.error.metrics import RelativeError, from_rest, opening_error

_MOST = 4e9  # bytes of a file that is read whole
_LINE = np.array([0.41, 0.57, 0.71])  # of length below 1, in which few planes of a mesh lie
_SAME_PLACE = 1e-3  # [m]
_UNREADABLE = (
    OSError, KeyError, ValueError, TypeError, IndexError, AttributeError, EOFError, MemoryError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip


@dataclass(frozen=True)
class Openings:
    """Openings of every gap: time (nt,) [s], opening (nt, ng) [m], and the gaps' position (ng, 3) [m]."""

    time: Floats
    opening: Floats
    position: Floats


@dataclass(frozen=True)
class Comparison:
    """Openings of one run against those of another, at the times and gaps that both have.

    Attributes
    ----------
    peak, peak_reference : largest openings [m]
    error : relative to the reference, joint by joint where the joints are known
    seconds : last time compared [s]
    gaps : number of them that are compared
    """

    peak: float
    peak_reference: float
    error: RelativeError
    seconds: float
    gaps: int

    @property
    def plain(self) -> dict[str, object]:
        """Plain values, for JSON."""
        return {
            "peak": self.peak,
            "peak_reference": self.peak_reference,
            "peak_error": self.error.peak,
            "l2_error": self.error.l2,
            "seconds": self.seconds,
        }


def compare_openings(
    computed: Openings,
    reference: Openings,
    names: tuple[str, str],
    joints: Mapping[str, slice] | None = None,
    *,
    same_mesh: bool = True,
) -> Comparison:
    """Compare two runs gap by gap at the times that both have.

    Parameters
    ----------
    names : of the two, for a message
    joints : name -> slice of its gaps in `computed`; of runs on one mesh only
    same_mesh : whether the two have all gaps in common; otherwise those are compared that both have

    Raises
    ------
    ResultError
        where the gaps or the times do not match, or nothing moved in the reference.
    """
    gaps, pair = coinciding(computed.position, reference.position)
    if same_mesh and not len(gaps) == len(computed.position) == len(reference.position):
        raise ResultError(
            f"the {len(computed.position)} gaps of {names[0]} are not at the places of the "
            f"{len(reference.position)} of {names[1]}"
        )
    if not len(gaps):
        raise ResultError(
            f"no gap of {names[0]} is at a gap of {names[1]} within 1 mm, so openings cannot be compared; "
            "compare runs on meshes whose nodes coincide"
        )
    rows, rows_reference = _common_times(computed.time, reference.time, names)
    opening, better = computed.opening[rows][:, gaps], reference.opening[rows_reference][:, pair]
    if not better.any():
        raise ResultError(
            f"{names[1]}: no joint moved, there is nothing to compare with; verify a stronger record"
        )
    return Comparison(
        peak=float(opening.max()),
        peak_reference=float(better.max()),
        error=opening_error(*from_rest(opening, better), joints),
        seconds=float(computed.time[rows[-1]]),
        gaps=len(gaps),
    )


def coinciding(position: Floats, reference: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Gaps of one run and those of another at the same places, within 1 mm.

    Where joints meet, several gaps of a run are at one place; they are told apart only if both runs have all
    gaps in one order.

    Parameters
    ----------
    position, reference : (ng, 3), (nr, 3) [m]

    Returns
    -------
    rows of `position`, rising, and those of `reference`
    """
    if len(position) == len(reference) and np.abs(position - reference).max(initial=0.0) < _SAME_PLACE:
        return np.arange(len(position)), np.arange(len(position))
    # candidates are near along one line; loading scipy.spatial would take longer than this
    along, others = position @ _LINE, reference @ _LINE
    order = np.argsort(others)
    first, last = (np.searchsorted(others[order], along + sign * _SAME_PLACE) for sign in (-1.0, 1.0))
    rows = np.repeat(np.arange(len(position)), last - first)
    pairs = order[np.arange(len(rows)) - np.repeat(np.cumsum(last - first) - last, last - first)]
    near = np.linalg.norm(position[rows] - reference[pairs], axis=1) < _SAME_PLACE
    rows, pairs = rows[near], pairs[near]
    alone = (np.bincount(rows)[rows] == 1) & (np.bincount(pairs)[pairs] == 1)
    return rows[alone], pairs[alone]


def _common_times(
    time: Floats, reference: Floats, names: tuple[str, str]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    keys, keys_reference = np.rint(time * 1e7).astype(np.int64), np.rint(reference * 1e7).astype(np.int64)
    common, rows, rows_reference = np.intersect1d(keys, keys_reference, return_indices=True)
    if len(common) < 2:
        raise ResultError(
            f"{names[0]} and {names[1]} share fewer than two times; set outputs.output_interval to 0.01 s"
        )
    return rows, rows_reference


def read_reference(path: Path) -> Openings:
    """Openings from an .npz with `time`, `gap`, and `position` or a model.npz (points, pairs) beside it.

    Raises
    ------
    ResultError
        where it cannot be read or lacks an array.
    """
    try:
        time, gap, position = _arrays(path)
    except _UNREADABLE as error:
        raise ResultError(
            f"{path}: is no reference ({error}); it needs `time`, `gap`, and `position` or a model.npz"
        ) from error
    openings = Openings(*(np.asarray(array, dtype=float) for array in (time, gap, position)))
    time, gap, position = openings.time, openings.opening, openings.position
    if time.ndim != 1 or position.shape[1:] != (3,) or gap.shape != (len(time), len(position)):
        raise ResultError(
            f"{path}: time {time.shape}, gap {gap.shape} and position {position.shape} do not fit; "
            "(nt,), (nt, gaps) and (gaps, 3) do"
        )
    for name, array in (("time", time), ("gap", gap), ("position", position)):
        if not np.isfinite(array).all():
            raise ResultError(f"{path}: {name} has values that are no numbers")
    return openings


def _arrays(path: Path) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    check_file(path, _MOST, ResultError)
    with np.load(path, allow_pickle=False) as stored:
        time, gap, position = stored["time"], stored["gap"], stored.get("position")
    if position is None:
        with np.load(path.with_name("model.npz"), allow_pickle=False) as model:
            position = model["points"][model["pairs"][:, 0]]
    return time, gap, position
