"""One run of a suite as a row of numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.fingerprint import code_digest
from romdam.core.recorded import GAP_QUANTITIES
from romdam.core.system import ENERGY_TERMS, OPEN, SLIP, History
from romdam.core.version import SOURCE
from romdam.postprocess.sliding import REST, row_seconds
from romdam.postprocess.stress.faces import HEADLINE
from romdam.postprocess.stress.summary import MEASURES as STRESS
from romdam.results.attached import ATTACHED_VARIABLES
from romdam.results.case import Array, Case, Variable
from romdam.results.floor_variables import FLOOR_VARIABLES
from romdam.results.sliding import SLIDING_ROWS
from romdam.results.stress.faces import headline_stress, of_faces
from romdam.results.variables import VARIABLES

RunIndex = tuple[int, int, int]  # numbers of record, scale and sample

_JOINT = ("joint",)
AT_THE_END = ", at the end"  # of the long names of what is the last of a variable over time
_HALF = 0.5  # of a joint's area
DONE, FAILED = 0, 1
_DIGITS = 12  # of the code's SHA-256, in the source of a row


def source_of_rows() -> str:
    """Name the version, and the code, that rows are computed by now."""
    return f"{SOURCE}, code {code_digest()[:_DIGITS]}"


@dataclass(frozen=True)
class Kept:
    """The result file of a run that is kept whole.

    Attributes
    ----------
    file : its name
    sha256 : of its bytes
    labels : of a suite's run, fingerprint of its attributes that name it: they follow the design, not the
        run's content; of any other, what tells it from others
    shared : what it shares with others: attribute -> file name
    """

    file: str
    sha256: str
    labels: str
    shared: dict[str, str]


@dataclass(frozen=True)
class SuiteRow:
    """The numbers that a suite keeps of one run; nothing of its place in the suite, which may change.

    Attributes
    ----------
    key : SHA-256 of everything the run depends on
    message : why it failed; empty where it did not
    values : name -> array, see `ROWS`; empty where it failed
    kept : its result file, where results are kept whole
    lasts : whether it fails again wherever it is made; a row that does not is not kept
    source : the version, and the code, that computed it
    warnings : what is doubtful about the run, a sentence each
    """

    key: str
    message: str = ""
    values: dict[str, Array] = field(default_factory=dict)
    kept: Kept | None = None
    lasts: bool = True
    source: str = field(default_factory=source_of_rows)
    warnings: tuple[str, ...] = ()


def _at_rest(history: History) -> Floats:
    """(ng, d) jumps averaged over the end of the run."""
    kept = history.time >= history.time[-1] - REST
    return np.asarray(history.jump[kept].mean(axis=0))


def _time_in(state: int) -> Callable[[Case], Array]:
    """Time during which any gap of a joint is in a state, by the written rows."""

    def get(case: Case) -> Array:
        h = case.history
        seconds = row_seconds(h.time)
        return case.per_joint((h.state == state).T, lambda part: seconds[part.any(axis=0)].sum())

    return get


def _open_share(case: Case) -> Array:
    """(joints, nt) share of each joint's area whose gaps are open."""
    area = case.of_gaps("whole_area")
    is_open = (case.history.state == OPEN).T * area[:, None]
    return case.per_joint(is_open, lambda part: part.sum(axis=0)) / case.per_joint(area, np.sum)[:, None]


def _at_the_end(name: str) -> Variable:
    """The last value of a variable over time."""
    whole = VARIABLES[name]
    return replace(
        whole,
        dims=(),
        long_name=whole.long_name + AT_THE_END,
        get=lambda case: np.asarray(whole.get(case)[-1]),
    )


def _total(name: str) -> Variable:
    """The sum of a variable over the gaps of each joint, at the end of the run."""
    whole = VARIABLES[name]
    return replace(
        whole,
        dims=_JOINT,
        long_name=f"{whole.long_name}, sum over the joint{AT_THE_END}",
        get=lambda case: case.per_joint(whole.get(case)[-1], np.sum),
    )


def _stat(name: str, units: str, long_name: str) -> Variable:
    return Variable(
        (), units, long_name, lambda c: np.asarray(c.history.stats[name]), lambda c: name in c.history.stats
    )


_WITH_JOINTS, _WITH_SHEAR = VARIABLES["opening"].when, VARIABLES["slip"].when
_PEAKS = (
    "peak_opening", "peak_slip", "peak_mean_compressive_stress", "peak_compression",
    "peak_compressive_stress", "gap_peak_opening",
)  # fmt: skip
# in the order of the summary; what a result holds too is the same variable
ROWS: dict[str, Variable] = {
    **{name: VARIABLES[name] for name in _PEAKS},
    "residual_opening": Variable(
        _JOINT,
        "m",
        f"largest opening of a gap, averaged over the last {REST:g} s",
        lambda c: c.per_joint(_at_rest(c.history)[:, 0], np.max),
        _WITH_JOINTS,
    ),
    "residual_slip": Variable(
        _JOINT,
        "m",
        f"largest tangential displacement of a gap, averaged over the last {REST:g} s",
        lambda c: c.per_joint(np.hypot(*_at_rest(c.history)[:, 1:3].T), np.max),
        _WITH_SHEAR,
    ),
    "any_gap_open_duration": Variable(
        _JOINT, "s", "time in which any one gap is open, by the written rows", _time_in(OPEN), _WITH_JOINTS
    ),
    "half_open_duration": Variable(
        _JOINT,
        "s",
        "time in which more than half of the joint's area is open, by the written rows",
        lambda c: np.asarray((_open_share(c) > _HALF) @ row_seconds(c.history.time)),
        _WITH_JOINTS,
    ),
    "mean_open_share": Variable(
        _JOINT,
        "1",
        "mean over the written rows of the share of the joint's area that is open",
        lambda c: _open_share(c).mean(axis=1),
        _WITH_JOINTS,
    ),
    "any_gap_sliding_duration": Variable(
        _JOINT, "s", "time in which any one gap slides, by the written rows", _time_in(SLIP), _WITH_SHEAR
    ),
    **SLIDING_ROWS,
    "peak_displacement": VARIABLES["peak_displacement"],
    **{name: of for name, of in ATTACHED_VARIABLES.items() if "time" not in of.dims},
    **{
        name: FLOOR_VARIABLES[name]
        for name in ("floor_peak_acceleration", "floor_spectrum", "floor_spectrum_error")
    },
    "peak_stress": Variable(
        ("stress_measure",),
        "Pa",
        "largest stress over all nodes and written times, those in the ring too",
        lambda c: np.array([c.stress_summary.largest[name].max() for name in STRESS]),
        VARIABLES["worst_stress"].when,
    ),
    "face_stress": Variable(
        ("stress_measure",),
        "Pa",
        f"largest stress over time that {HEADLINE:g} % of all faces' area outside the ring do not exceed",
        headline_stress,
        of_faces,
    ),
    **{
        written.name: _total(written.name)
        for of in GAP_QUANTITIES.values()
        for written in of.written
        if written.total
    },
    **{f"energy_{term}": _at_the_end(f"energy_{term}") for term in ENERGY_TERMS},
    "ledger_imbalance": _stat(
        "ledger_imbalance", "1", "largest imbalance of the energy ledger over the largest energy exchanged"
    ),
    "estimated_time_error": _stat("estimated_time_error", "1", "estimated error of the time stepping"),
    "finest_step": _stat("finest_step", "s", "finest step"),
    "steps": _stat("steps", "1", "accepted steps of the finest integration"),
}
# what a run gains besides its history
STATED: dict[str, tuple[str, str]] = {
    "estimated_reduction_error": ("1", "estimated error of the openings in L2 from leaving out modes"),
    "estimated_mesh_error": ("1", "estimated error of the openings in L2 from the mesh"),
    "wall_seconds": ("s", "wall time of the run; its share of the time where runs are integrated together"),
    "cpu_seconds": ("s", "CPU time of the run; its share of the time where runs are integrated together"),
}


def row_values(case: Case, stated: dict[str, float]) -> dict[str, Array]:
    """The numbers of a finished run."""
    values = {n: np.asarray(v.get(case), dtype=float) for n, v in ROWS.items() if v.when(case)}
    values |= {name: np.asarray(value) for name, value in stated.items()}
    # one NaN, of the many that there are: a row that was read again has that of JSON
    return {name: np.where(np.isnan(value), np.nan, value) for name, value in values.items()}


def attributes_of(name: str) -> dict[str, str]:
    """Units and long name of a variable of the rows."""
    units, long_name = STATED[name] if name in STATED else (ROWS[name].units, ROWS[name].long_name)
    return {"units": units, "long_name": long_name}


def dims_of(name: str) -> tuple[str, ...]:
    """Dimensions of a variable of the rows, besides those of the suite."""
    return ROWS[name].dims if name in ROWS else ()
