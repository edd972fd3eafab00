"""The one comparison of two runs, and the table of those that are made.

Every statement of error says how far a run is from a better one. A row of `COMPARISONS` says which two runs
these are, on what they are compared, how their gaps and times are aligned, in which norm, and what multiple
of the difference is the error. `compare` goes through the quantities of a row. What a statement does with the
errors, and what it states besides, is in the module that states it.

The steps of a run are judged while it is integrated, by `romdam.timestepping.step_control`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from romdam.contact.components import NORMAL, SHEAR_J
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ResultError
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.error.alignment import coinciding, coinciding_of_joints, common_rows
from romdam.error.metrics import Peak, RelativeError, from_rest, magnitude_error, opening_error, scaled

Rows = Ints | slice
_ALL = slice(None)


@dataclass(frozen=True)
class ComparedRun:
    """A run as it is compared with another one.

    Attributes
    ----------
    time : (nt,) of the rows [s]
    jump : (nt, ng, d) opening of every gap, and its slips where joints carry shear [m]
    position : (ng, 3) of the gaps [m]; empty where both runs have the same
    joints : name -> slice of its gaps
    nodes : names of the output nodes
    histories : other quantity -> (nt, ...), see `QUANTITIES`
    stats : counts and CPU seconds of the run
    name : what messages call it, where it is not as the table does
    rest : (ng, d) jumps at rest, where the first row is not [m]
    """

    time: Floats
    jump: Floats
    position: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    joints: Mapping[str, slice] = field(default_factory=dict)
    nodes: tuple[str, ...] = ()
    histories: Mapping[str, Floats] = field(default_factory=dict)
    stats: Mapping[str, float] = field(default_factory=dict)
    name: str = ""
    rest: Floats | None = None

    @property
    def opening(self) -> Floats:
        """(nt, ng) [m]."""
        return self.jump[..., NORMAL]


def compared_openings(
    scene: Scene, history: History, joints: Mapping[str, slice], until: float = np.inf
) -> ComparedRun:
    """A run of a scene, as its openings are compared, up to a time [s]."""
    rows = history.time <= until * (1.0 + 1e-9)
    return ComparedRun(
        history.time[rows], history.jump[rows, :, :1], scene.gap_position, joints, stats=history.stats
    )


class Quantity(NamedTuple):
    """Where the histories of a quantity stand, and how they are measured.

    `moves` tells whether its values at rest are taken from it, where a row says so; `peaks` whether its peak
    may be that of all places.
    """

    at: Literal["gaps", "joints", "nodes", "model"]
    moves: bool = True
    peaks: bool = True


QUANTITIES = {
    "opening": Quantity("gaps"),
    "slip": Quantity("gaps"),
    "joint_force": Quantity("joints"),
    "joint_pressure": Quantity("joints"),
    "displacement": Quantity("nodes"),
    "acceleration": Quantity("nodes", moves=False),
    "response_spectrum": Quantity("model", moves=False, peaks=False),  # (3 nodes, periods)
    "energy": Quantity("model", moves=False, peaks=False),
}


@dataclass(frozen=True)
class Comparison:
    """A row of the table.

    Attributes
    ----------
    judged, better : the two runs, as messages call them where they have no names of their own
    quantities : on what; a quantity that one of them lacks is left out
    gaps : "same" in number and order; "matched" by position, where all must match; "common" to both by
        position; or these joint by joint
    times : "same" rows, or those "common" to both
    from_rest : whether values at rest are taken from both, see `romdam.error.metrics`
    peak : which measure of the peak
    moving : whether the better run must move
    factor : of the error over the difference; None where the statement has a rule of its own
    """

    judged: str
    better: str
    quantities: tuple[str, ...]
    gaps: Literal["same", "matched", "common", "common of joints"] = "same"
    times: Literal["same", "common"] = "same"
    from_rest: bool = True
    peak: Peak = "largest"
    moving: bool = False
    factor: float | None = 1.0


OVER_FINER, OVER_COARSER = 1.5, 0.5  # error over the difference to a sibling mesh, see `discretisation`
_OF_MESHES = (
    "opening", "slip", "joint_force", "joint_pressure", "displacement", "acceleration", "response_spectrum",
)  # fmt: skip
_FULL = Comparison("the reduced model", "the full order", ("opening",), "matched", "common", moving=True)
_MESH = Comparison("the one mesh", "the other", _OF_MESHES, "common of joints", peak="of places", factor=None)
COMPARISONS = {
    "estimate": Comparison("the run", "a finer model while joints move", ("opening",), peak="bound"),
    "certificate": Comparison(
        "the result", "its correction", ("opening", "displacement", "energy"), from_rest=False
    ),
    "verification": _FULL,
    "stored": replace(_FULL, better="the file"),
    "discretisation": _MESH,
    "contact points": replace(_MESH, better="a gap at every node", factor=1.0),
    "study": replace(_FULL, judged="the study", better="the reference"),
    "study of meshes": replace(_FULL, judged="the study", better="the reference", gaps="common"),
    "reference of a study": replace(
        _FULL, judged="the coarser mesh of the reference", better="the reference", gaps="common",
        factor=OVER_COARSER,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Differences:
    """What a run differs by from a better one.

    Attributes
    ----------
    errors : quantity -> its relative error, with that of each joint or output node
    gaps : number of those that are compared
    not_compared : joints without such a gap
    seconds : last time compared [s]
    peak, peak_reference : largest openings at the gaps and times compared [m]
    """

    errors: dict[str, RelativeError]
    gaps: int
    not_compared: list[str]
    seconds: float
    peak: float
    peak_reference: float

    @property
    def plain(self) -> dict[str, object]:
        """Plain values of the openings, for JSON."""
        opening = self.errors["opening"]
        return {
            "peak": self.peak,
            "peak_reference": self.peak_reference,
            "peak_error": opening.peak,
            "l2_error": opening.l2,
            "seconds": self.seconds,
        }


def compare(kind: str, judged: ComparedRun, better: ComparedRun) -> Differences:
    """Compare two runs as a row of `COMPARISONS` says, quantity by quantity.

    Raises
    ------
    ResultError
        where the gaps or the times do not match, or nothing moved in the better run where it must.
    """
    row = COMPARISONS[kind]
    names = judged.name or row.judged, better.name or row.better
    gaps, pair, joints = _common_gaps(row, judged, better, names)
    rows, others = _common_times(row, judged.time, better.time, names)
    directions = _ALL if "slip" in row.quantities else slice(1)
    jump, wanted = judged.jump[rows][:, gaps, directions], better.jump[others][:, pair, directions]
    opening, opening_wanted = jump[..., NORMAL], wanted[..., NORMAL]
    if row.moving and not opening_wanted.any():
        raise ResultError(
            f"{names[1]}: no joint moved, there is nothing to compare with; verify a stronger record"
        )
    moved = from_rest(jump, wanted, judged.rest) if row.from_rest else (jump, wanted)
    pairs = {"opening": (moved[0][..., NORMAL], moved[1][..., NORMAL])}
    if jump.shape[2] > 1:
        pairs["slip"] = moved[0][..., SHEAR_J:], moved[1][..., SHEAR_J:]
    parts: dict[str, Mapping[str, slice]] = {
        "gaps": joints,
        "joints": {name: slice(k, k + 1) for k, name in enumerate(judged.joints)},
        "nodes": {name: slice(k, k + 1) for k, name in enumerate(judged.nodes)},
        "model": {},
    }
    for name in row.quantities:
        if name in judged.histories and name in better.histories:
            pairs[name] = judged.histories[name], better.histories[name]
            if row.from_rest and QUANTITIES[name].moves:
                pairs[name] = from_rest(*pairs[name], each=QUANTITIES[name].at == "joints")
    errors = {
        name: _error(row, name, pairs[name], parts[QUANTITIES[name].at])
        for name in row.quantities
        if name in pairs
    }
    return Differences(
        errors=errors,
        gaps=opening.shape[1],
        not_compared=[name for name in judged.joints if name not in joints],
        seconds=float(judged.time[rows][-1]),
        peak=float(opening.max()),
        peak_reference=float(opening_wanted.max()),
    )


def _error(
    row: Comparison, name: str, pair: tuple[Floats, Floats], parts: Mapping[str, slice]
) -> RelativeError:
    """Error of a quantity at all its places, and of each part of them: a joint, or an output node."""
    if name == "opening":
        error = opening_error(*pair, parts, row.peak)
    else:
        quantity = QUANTITIES[name]
        peaks = row.peak == "of places" and quantity.peaks
        scale = pair[1] if quantity.at == "joints" else None
        each = {
            part: magnitude_error(pair[0][:, places], pair[1][:, places], scale, peaks=peaks)
            for part, places in parts.items()
        }
        error = replace(magnitude_error(*pair, peaks=peaks), joints=each)
    return error if row.factor is None else scaled(error, row.factor)


def _common_gaps(
    row: Comparison, judged: ComparedRun, better: ComparedRun, names: tuple[str, str]
) -> tuple[Rows, Rows, Mapping[str, slice]]:
    """Gaps of both runs that are compared, and the slice of these that each joint has."""
    if row.gaps == "same":
        return _ALL, _ALL, judged.joints
    joints: Mapping[str, slice] = {}
    if row.gaps == "common of joints":
        gaps, pair, joints = coinciding_of_joints(
            judged.position, judged.joints, better.position, better.joints
        )
    else:
        gaps, pair = coinciding(judged.position, better.position)
    if row.gaps == "matched":
        joints = judged.joints
        if not len(gaps) == len(judged.position) == len(better.position):
            raise ResultError(
                f"the {len(judged.position)} gaps of {names[0]} are not at the places of the "
                f"{len(better.position)} of {names[1]}"
            )
    if not len(gaps):
        raise ResultError(
            f"no gap of {names[0]} is at a gap of {names[1]} within 1 mm, so openings cannot be compared; "
            "compare runs on meshes whose nodes coincide"
        )
    return gaps, pair, joints


def _common_times(
    row: Comparison, judged: Floats, better: Floats, names: tuple[str, str]
) -> tuple[Rows, Rows]:
    """Rows of both runs that are compared."""
    if row.times == "common":
        rows, others = common_rows(judged, better)
        if len(rows) < 2:
            raise ResultError(
                f"{names[0]} and {names[1]} share fewer than two times; set outputs.output_interval to 0.01 s"
            )
        return rows, others
    if len(judged) != len(better):
        raise ResultError(
            f"the runs on both meshes have {len(judged)} and {len(better)} rows; set outputs.output_interval"
        )
    return _ALL, _ALL
