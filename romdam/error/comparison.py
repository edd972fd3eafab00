"""How far one computation's joint openings are from another's, and where a reader finds that stated."""

from __future__ import annotations

import json
import logging
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.files import check_file, replacing
from romdam.core.fingerprint import fingerprint
from romdam.core.sealed import changing, reading, text_of

log = logging.getLogger(__name__)

STATEMENT_FILE = "verification.json"
_SELF = "content_sha256"  # of everything else in that file
_MOST = 4e9  # bytes of a file that is read whole
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
    found = Openings(*(np.asarray(array, dtype=float) for array in (time, gap, position)))
    fitting = found.opening.shape == (*found.time.shape, len(found.position)) and found.position.shape[
        1:
    ] == (3,)
    if not (fitting and found.time.ndim == 1):
        raise ResultError(
            f"{path}: time {found.time.shape}, gap {found.opening.shape} and position {found.position.shape} "
            "do not fit; (nt,), (nt, gaps) and (gaps, 3) do"
        )
    for name, array in (("time", found.time), ("gap", found.opening), ("position", found.position)):
        if not np.isfinite(array).all():
            raise ResultError(f"{path}: {name} has values that are no numbers")
    return found


def _arrays(path: Path) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    check_file(path, _MOST, ResultError)
    with np.load(path, allow_pickle=False) as stored:
        time, gap, position = stored["time"], stored["gap"], stored.get("position")
    if position is None:
        with np.load(path.with_name("model.npz"), allow_pickle=False) as model:
            position = model["points"][model["pairs"][:, 0]]
    return time, gap, position


def write_statement(folder: Path, statement: dict[str, object]) -> Path:
    """Write the error statement, and put it into every result here that has the same configuration."""
    path = folder / STATEMENT_FILE
    stated = statement | {_SELF: fingerprint(json.dumps(statement))}
    with replacing(path) as part:
        part.write_text(json.dumps(stated, indent=2) + "\n", encoding="utf-8")
    for result in sorted(folder.glob("*.nc")):
        if _digest(result) == statement["configuration_sha256"]:
            _attach(result, statement_attributes(statement))
    return path


def read_statement(folder: Path, digest: str) -> dict[str, object]:
    """Attributes for a result of the configuration `digest`, from a statement made earlier; else none."""
    path = folder / STATEMENT_FILE
    if not path.exists():
        return {}
    try:
        check_file(path, _MOST, ResultError)
        statement = json.loads(path.read_text(encoding="utf-8"))
        own = statement.pop(_SELF, None)
    except (OSError, ValueError, RecursionError, AttributeError, TypeError, ResultError) as error:
        log.warning("%s: cannot be read (%s); `romdam verify` writes it again", path, error)
        return {}
    if own != fingerprint(json.dumps(statement)):
        log.warning("%s: is not as it was written; `romdam verify` writes it again", path)
        return {}
    return statement_attributes(statement) if statement.get("configuration_sha256") == digest else {}


def statement_attributes(statement: dict[str, object]) -> dict[str, object]:
    """What a result file says about its error: a sentence, and the numbers as JSON."""
    return {"error_statement": statement["statement"], "verification": json.dumps(statement)}


def _digest(path: Path) -> str:
    """The configuration's digest that a result states; a file that is damaged is left as it is."""
    try:
        with reading(path) as file:
            return text_of(file, "configuration_sha256")
    except ResultError as error:
        log.warning("%s; it gets no statement of its error", error)
        return ""


def _attach(path: Path, attributes: dict[str, object]) -> None:
    with changing(path) as file:
        file.attrs.update(attributes)
