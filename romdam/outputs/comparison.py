"""How far one computation's joint openings are from another's, and where a reader finds that stated."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from romdam.errors import ResultError
from romdam.files import replacing

Floats = NDArray[np.float64]
STATEMENT_FILE = "verification.json"


@dataclass(frozen=True)
class Openings:
    """Openings of every gap: time (nt,) [s], opening (nt, ng) [m], and the gaps' position (ng, 3) [m]."""

    time: Floats
    opening: Floats
    position: Floats


@dataclass(frozen=True)
class Difference:
    """Peak openings [m], error of the peak (`peak_error`), relative L2 error of all openings, seconds."""

    peak: float
    peak_reference: float
    peak_error: float
    l2_error: float
    seconds: float


def compare_openings(computed: Openings, reference: Openings, names: tuple[str, str]) -> Difference:
    """Compare at the times that both have, gap by gap.

    L2 is sqrt(sum (g - g_ref)^2) / sqrt(sum g_ref^2) over those times and all gaps.

    Raises
    ------
    ResultError
        where the gaps or the times do not match.
    """
    pair = _match(computed.position, reference.position, names)
    rows, rows_reference = _common_times(computed.time, reference.time, names)
    g, g_ref = computed.opening[rows], reference.opening[rows_reference][:, pair]
    scale = float(np.sqrt((g_ref**2).sum()))
    if scale == 0.0:
        raise ResultError(
            f"{names[1]}: no joint moved, there is nothing to compare with; verify a stronger record"
        )
    return Difference(
        peak=float(g.max()),
        peak_reference=float(g_ref.max()),
        peak_error=peak_error(g, g_ref),
        l2_error=float(np.sqrt(((g - g_ref) ** 2).sum())) / scale,
        seconds=float(computed.time[rows[-1]]),
    )


def peak_error(opening: Floats, better: Floats) -> float:
    """Relative error of the largest opening; relative to the largest closure where no gap opens.

    Parameters
    ----------
    opening, better : (nt, ng) [m]
    """
    peak = float(better.max())
    size = peak if peak > 0.0 else float(np.abs(better).max())
    return abs(float(opening.max()) - peak) / size if size > 0.0 else 0.0


def _match(position: Floats, reference: Floats, names: tuple[str, str]) -> NDArray[np.int64]:
    from scipy.spatial import cKDTree

    if len(position) == len(reference):
        distance, pair = cKDTree(reference).query(position)
        if distance.max() < 1e-3 and len(set(pair)) == len(pair):
            return np.asarray(pair)
    raise ResultError(
        f"the {len(position)} gaps of {names[0]} are not at the places of the {len(reference)} of {names[1]}"
    )


def _common_times(
    time: Floats, reference: Floats, names: tuple[str, str]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    keys, keys_reference = np.rint(time * 1e7).astype(np.int64), np.rint(reference * 1e7).astype(np.int64)
    common, rows, rows_reference = np.intersect1d(keys, keys_reference, return_indices=True)
    if len(common) < 2:
        raise ResultError(
            f"{names[0]} and {names[1]} share fewer than two times; set outputs.every to 0.01 s"
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
        with np.load(path, allow_pickle=False) as stored:
            time, gap = stored["time"], stored["gap"]
            position = stored.get("position")
        if position is None:
            with np.load(path.with_name("model.npz"), allow_pickle=False) as model:
                position = model["points"][model["pairs"][:, 0]]
    except (OSError, KeyError, ValueError) as error:
        raise ResultError(
            f"{path}: is no reference ({error}); it needs `time`, `gap`, and `position` or a model.npz"
        ) from error
    return Openings(np.asarray(time), np.asarray(gap), np.asarray(position))


def write_statement(folder: Path, statement: dict[str, object]) -> Path:
    """Write the error statement, and put it into every result here that has the same configuration."""
    path = folder / STATEMENT_FILE
    with replacing(path) as part:
        part.write_text(json.dumps(statement, indent=2) + "\n")
    for result in sorted(folder.glob("*.nc")):
        if _digest(result) == statement["configuration_sha256"]:
            _attach(result, statement_attributes(statement))
    return path


def read_statement(folder: Path, digest: str) -> dict[str, object]:
    """Attributes for a result of the configuration `digest`, from a statement made earlier; else none."""
    try:
        statement = json.loads((folder / STATEMENT_FILE).read_text())
    except (OSError, ValueError):
        return {}
    same = isinstance(statement, dict) and statement.get("configuration_sha256") == digest
    return statement_attributes(statement) if same else {}


def statement_attributes(statement: dict[str, object]) -> dict[str, object]:
    """What a result file says about its error: a sentence, and the numbers as JSON."""
    return {"error_statement": statement["statement"], "verification": json.dumps(statement)}


def _digest(path: Path) -> str:
    try:
        with h5py.File(path, "r") as file:
            return str(file.attrs.get("configuration_sha256", ""))
    except OSError:
        return ""


def _attach(path: Path, attributes: dict[str, object]) -> None:
    with replacing(path) as part:
        shutil.copyfile(path, part)
        with h5py.File(part, "r+") as file:
            file.attrs.update(attributes)
