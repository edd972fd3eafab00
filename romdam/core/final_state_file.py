"""The group of a result file that holds the state in which its run ended."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.final_state import FinalState
from romdam.core.sealed import reading, text_of

GROUP, MODEL = "final_state", "model"  # in the file, and in the group
# dimensions, unit and name of each array of a state, see `romdam.core.final_state.STATE_QUANTITIES`
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "q": (("unknown",), "m", "unknowns that are integrated"),
    "v": (("unknown",), "m s-1", "their rates"),
    "a": (("unknown",), "m s-2", "their accelerations"),
    "jump": (("gap", "direction"), "m", "opening and slip that joint forces see"),
    "traction": (("gap", "direction"), "N", "joint force on side J, compression positive"),
    "unilateral": (("gap", "direction"), "N", "force of the solver"),
    "relaxed": (("gap", "direction"), "N", "force on modes that follow"),
    "mean": (("gap", "direction"), "N", "mean force over the last step"),
    "spring": (("gap", "direction"), "m", "deformation of the springs"),
    "accumulated_slip": (("gap", "tangent"), "m", "slip of the friction"),
    "slip_rate": (("gap", "tangent"), "m s-1", "mean rate of slip over the last step"),
    "contact": (("gap",), "1", "state of the gap: open, stick or slip"),
    "closed": (("gap",), "1", "whether the gap was closed"),
    "memory": (("law", "gap", "memory_entry"), "1", "memory of the joint laws"),
    "last_step": (("gap", "step_entry"), "1", "last step as the joint laws read it"),
    "water": (("gap",), "N", "force of the water that entered"),
    "stored": (("one",), "J", "energy stored in the gaps"),
    "clock": (("clock_entry",), "1", "next level, whether laws evolve, last and finest step, refusals"),
    "ground_velocity": (("velocity_entry",), "m s-1", "velocity of the ground, and its largest size"),
}


@dataclass(frozen=True, eq=False)
class StoredState:
    """A final state and what its result says of the gaps and of the motion.

    Attributes
    ----------
    final : the state
    joints : name -> number of gaps, in their order
    position : (ng, 3) of the gaps [m]
    axes : (ng, 3, 3) their normal and local axes j and k
    kinetic : energy at the end, and the largest of the run [J]
    """

    final: FinalState
    joints: dict[str, int]
    position: Floats
    axes: Floats
    kinetic: tuple[float, float]


def read_final_state(path: Path, source: str) -> StoredState:
    """Read the final state of a result file.

    Parameters
    ----------
    source : what messages about the state begin with

    Raises
    ------
    ResultError
        where there is no such file, it is damaged, or it has no final state.
    """
    with reading(path) as file:
        if GROUP not in file or "energy_kinetic" not in file:
            written = text_of(file, "source") or "another program"
            raise ResultError(
                f"{path}: has no final state: it is the summary of a suite, or was written by {written}; "
                "give the result of a record, and run that job again if an earlier version has written it"
            )
        group = file[GROUP]
        notes = {name: json.loads(text_of(group, name)) for name in ("joints", "laws", "empty")}
        arrays: dict[str, NDArray[Any]] = {name: np.zeros(shape) for name, shape in notes["empty"].items()}
        arrays |= {name: group[name][()] for name in VARIABLES if name in group}
        on = group["law_on"][()].astype(bool) if notes["laws"] else []
        final = FinalState(
            arrays=arrays,
            integrator=text_of(group, "integrator"),
            model={name: of[()] for name, of in group[MODEL].items() if not of.is_scale},
            laws=dict(zip(notes["laws"], on, strict=True)),
            source=source,
        )
        kinetic, ng = file["energy_kinetic"][()], sum(notes["joints"].values())
        position, axes = np.zeros((0, 3)), np.zeros((0, 3, 3))
        if ng:
            position = file["gap_position"][()]
            axes = np.concatenate([file["gap_normal"][()][:, None], file["gap_tangent"][()]], axis=1)
    return StoredState(final, notes["joints"], position, axes, (float(kinetic[-1]), float(kinetic.max())))
