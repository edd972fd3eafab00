"""Every variable of a result file, in one dict; to add one, add one entry, or declare a quantity.

What a run records of every gap is declared in `romdam.core.recorded`, with the variables that hold it.

SI units; displacement, velocity and acceleration are relative to the base; opening is positive, and
compression is negative.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from romdam.core.motion import MovingSupports, SupportMotion
from romdam.core.recorded import GAP_QUANTITIES, PEAK_QUANTITIES, Quantity, Written
from romdam.core.scene import ForceHistory
from romdam.core.system import ENERGY_TERMS, STATES, BuiltStages, RestBalance
from romdam.results.attached import ATTACHED_COORDINATES, ATTACHED_VARIABLES
from romdam.results.case import Array, Attributes, Case, Variable
from romdam.results.floor_variables import FLOOR_COORDINATES, FLOOR_VARIABLES
from romdam.results.sliding import SLIDING_VARIABLES
from romdam.results.stress.variables import STRESS_COORDINATES, STRESS_VARIABLES


def _motions(case: Case) -> tuple[SupportMotion, ...]:
    moving = case.scene.find(MovingSupports)
    assert moving is not None
    return moving.motions


def _moving_supports(case: Case) -> Array:
    return np.array([motion.name for motion in _motions(case)], dtype=str)


def _of_motions(name: str) -> Callable[[Case], Array]:
    def get(case: Case) -> Array:
        values = [getattr(motion, name) for motion in _motions(case)]
        return np.array([np.nan if value is None else value for value in values], dtype=float)

    return get


def _at_probes(name: str) -> Callable[[Case], Array]:
    def get(case: Case) -> Array:
        values: Array = getattr(case.history, name)
        return values.reshape(len(values), -1, 3)

    return get


def _peak_opening_time(case: Case) -> Array:
    peaks = case.history.peaks
    stacked = np.stack([peaks["opening"], peaks["opening_time"]], axis=1)
    return case.per_joint(stacked, lambda part: part[part[:, 0].argmax(), 1])


def _energy(term: str, long_name: str) -> Variable:
    return Variable(("time",), "J", long_name, lambda case: case.history.energy[term])


_FLAGS: Attributes = {
    "flag_values": np.array(list(STATES.values()), dtype=np.int8),
    "flag_meanings": " ".join(STATES),
}
_PARTS: dict[str, Any] = {"": ..., "normal": (..., 0), "tangential": (..., slice(1, None))}


def _recorded(name: str, of: Quantity, written: Written) -> Variable:
    """Make the variable of a quantity that a history has of every gap."""
    part, when = _PARTS[written.part], written.when

    def get(case: Case) -> Array:
        values: Array = getattr(case.history, name)[part]
        values = values.astype(np.int8) if of.dtype is np.uint8 else values
        return values if written.sign > 0 else -values

    dims = ("time", "gap", "tangent") if written.part == "tangential" else ("time", "gap")
    exists = Case.has_friction if written.part == "tangential" else Case.has_joints
    has = exists if when is None else lambda case: case.has_joints() and when(case.history)
    flags = _FLAGS if of.dtype is np.uint8 else {}
    return Variable(dims, of.unit, written.long_name, get, has, flags)


def _peak(name: str, of: Quantity, written: Written) -> Variable:
    """Make the variable of a peak of every gap over all steps."""
    return Variable(
        ("gap",),
        of.unit,
        written.long_name,
        lambda case: written.sign * case.history.peaks[name],
        Case.has_joints,
    )


def _built(case: Case) -> BuiltStages:
    """The joints in the stages of construction."""
    assert case.history.built is not None  # what `Case.was_built` tells
    return case.history.built


def _balance_of(case: Case) -> RestBalance:
    """The balance of the forces at rest."""
    assert case.history.balance is not None  # what `Case.is_balanced` tells
    return case.history.balance


_BALANCED = {
    "loads": "static loads on the body",
    "joints": "forces of joints on the body, with the water in them",
    "supports": "forces of supports and springs on the body",
}


def _balance(kind: str, text: str) -> Variable:
    return Variable(
        ("body", "resultant"),
        "1",
        f"{text} at rest: resultant [N], and moment about body_middle [N m]",
        lambda case: getattr(_balance_of(case), kind),
        Case.is_balanced,
    )


COORDINATES: dict[str, Variable] = {
    "time": Variable(("time",), "s", "time since the start of the record", lambda c: c.history.time),
    "gap": Variable(
        ("gap",),
        "1",
        "number of the gap element",
        lambda c: np.arange(len(c.of_gaps("area"))),
        Case.has_joints,
    ),
    "joint": Variable(
        ("joint",),
        "",
        "name of the joint",
        lambda c: np.array(list(c.scene.joints), dtype=str),
        Case.has_joints,
    ),
    "node": Variable(
        ("node",),
        "",
        "name of the output node",
        lambda c: np.array([p.name for p in c.scene.probes], dtype=str),
        Case.has_probes,
    ),
    "component": Variable(("component",), "", "global axis", lambda c: np.array(["x", "y", "z"], dtype=str)),
    "tangent": Variable(
        ("tangent",),
        "",
        "local tangential axis of a gap",
        lambda c: np.array(["j", "k"], dtype=str),
        Case.has_joints,
    ),
    "joint_blocks": Variable(
        ("joint", "side"),
        "",
        "names of blocks I and J of the joint",
        lambda c: np.array([joint.blocks for joint in c.joints], dtype=str),
        Case.has_joints,
    ),
    "joint_middle": Variable(
        ("joint", "component"),
        "m",
        "middle of the joint's area",
        lambda c: c.joint_middle,
        lambda c: c.has_joints(),  # results of before 0.3 have none
    ),
    "gap_joint": Variable(
        ("gap",),
        "",
        "joint the gap belongs to",
        lambda c: np.concatenate([np.full(len(joint.area), joint.name) for joint in c.joints]),
        Case.has_joints,
    ),
    "gap_position": Variable(
        ("gap", "component"), "m", "position of the gap", lambda c: c.of_gaps("position"), Case.has_joints
    ),
    "gap_normal": Variable(
        ("gap", "component"),
        "1",
        "normal from block I to block J",
        lambda c: c.of_gaps("axes")[:, 0],
        Case.has_joints,
    ),
    "gap_tangent": Variable(
        ("gap", "tangent", "component"),
        "1",
        "local axes j and k",
        lambda c: c.of_gaps("axes")[:, 1:],
        Case.has_joints,
    ),
    "gap_area": Variable(
        ("gap",),
        "m2",
        "area of the joint that the gap stands for",
        lambda c: c.of_gaps("whole_area"),
        Case.has_joints,
    ),
    "initial_gap": Variable(
        ("gap",),
        "m",
        "initial gap as configured, before any grouting, open positive",
        lambda c: c.of_gaps("gap"),
        Case.has_joints,
    ),
    "grouted_gap": Variable(
        ("gap",),
        "m",
        "initial gap after grouting, at which the opening of an unloaded gap starts, open positive",
        lambda c: c.history.gap,
        lambda c: c.has_joints() and (c.history.built is not None or bool(c.of_gaps("grout").any())),
    ),
    "construction_stage": Variable(
        ("construction_stage",),
        "",
        "stage of construction",
        lambda c: np.array(_built(c).names, dtype=str),
        Case.was_built,
    ),
    "body": Variable(
        ("body",),
        "",
        "body at rest: the dam, then blocks, those that are tied as one",
        lambda c: np.array(_balance_of(c).names, dtype=str),
        Case.is_balanced,
    ),
    "resultant": Variable(
        ("resultant",),
        "",
        "component of a resultant: force and moment",
        lambda c: np.array(["F_x", "F_y", "F_z", "M_x", "M_y", "M_z"], dtype=str),
        Case.is_balanced,
    ),
    "body_middle": Variable(
        ("body", "component"),
        "m",
        "middle of the body, about which its moments are",
        lambda c: _balance_of(c).about,
        Case.is_balanced,
    ),
    "support": Variable(
        ("support",),
        "",
        "first entry of `supports` with the motion, or station of `ground.along`",
        _moving_supports,
        Case.has_moving_supports,
    ),
    "station_coordinate": Variable(
        ("support",),
        "m",
        "coordinate of the station along `ground.along`",
        _of_motions("station"),
        Case.has_stations,
    ),
    "support_delay": Variable(
        ("support",),
        "s",
        "delay of the station behind the record",
        _of_motions("delay"),
        Case.has_stations,
    ),
    "force_history": Variable(
        ("force_history",),
        "",
        "key of the force that varies in time",
        lambda c: np.array([one.signal.name for one in c.scene.every(ForceHistory)], dtype=str),
        Case.has_force_histories,
    ),
    **ATTACHED_COORDINATES,
    "node_block": Variable(
        ("node",),
        "",
        "block of the output node",
        lambda c: np.array([p.block for p in c.scene.probes], dtype=str),
        Case.has_probes,
    ),
    "node_position": Variable(
        ("node", "component"),
        "m",
        "position of the output node",
        lambda c: np.array([c.scene.blocks[p.block].points[p.node] for p in c.scene.probes]),
        Case.has_probes,
    ),
    **FLOOR_COORDINATES,
    **STRESS_COORDINATES,
}

UNDEFINED_MODES = ("mode_frequency", "mode_damping_ratio")  # may be no numbers
VARIABLES: dict[str, Variable] = {
    **{
        written.name: _recorded(name, of, written)
        for name, of in GAP_QUANTITIES.items()
        for written in of.written
    },
    "water_pressure": Variable(
        ("gap",),
        "Pa",
        "pressure of the water in the joint, mean over the gap's area",
        lambda c: c.water_at_rest / c.of_gaps("area"),
        Case.has_water_in_joints,
    ),
    "water_force": Variable(
        ("joint", "component"),
        "N",
        "resultant of the water in the joint on block J; block I has the opposite",
        lambda c: c.joint_sums((c.water_at_rest[:, None] * c.of_gaps("axes")[:, 0])[None])[0],
        Case.has_water_in_joints,
    ),
    "joint_force": Variable(
        ("time", "joint", "component"),
        "N",
        "force that passes through the whole joint to block J: contact, water_force, and the water that "
        "entered its cracks; block I has the opposite",
        lambda c: c.joint_force,
        lambda c: c.has_joints(),  # results of before 0.2 have none
    ),
    "joint_moment": Variable(
        ("time", "joint", "component"),
        "N m",
        "moment of joint_force on block J about joint_middle",
        lambda c: c.joint_moment,
        lambda c: c.has_joints(),  # results of before 0.3 have none
    ),
    "joint_water_force": Variable(
        ("time", "joint", "component"),
        "N",
        "what of joint_force is water in the joint and in its cracks",
        lambda c: c.joint_water_force,
        Case.has_water_force,
    ),
    **{f"{kind}_at_rest": _balance(kind, text) for kind, text in _BALANCED.items()},
    "imbalance_at_rest": Variable(
        ("body",),
        "1",
        "what the forces at rest on the body leave, of the sum of their sizes",
        lambda c: _balance_of(c).left,
        Case.is_balanced,
    ),
    "construction_opening": Variable(
        ("construction_stage", "gap"),
        "m",
        "opening of the gap under the loads of the stage, before its grouting, open positive, since its "
        "blocks were poured or since it was grouted; NaN where a block is not poured yet",
        lambda c: _built(c).opening,
        Case.was_built,
    ),
    "construction_normal_force": Variable(
        ("construction_stage", "gap"),
        "N",
        "normal force of the gap under the loads of the stage, compression negative",
        lambda c: 0.0 - _built(c).force,
        Case.was_built,
    ),
    "construction_grouted": Variable(
        ("construction_stage", "gap"),
        "1",
        "whether the gap is grouted at the end of the stage",
        lambda c: _built(c).grouted.astype(float),
        Case.was_built,
    ),
    "crack_at_rest": Variable(
        ("gap",),
        "m",
        "distance from the heel to the tip of the crack at rest, on the line through the gap, by which its "
        "water_pressure was drawn; 0 where the heel is closed, NaN in joints whose uplift is not redrawn",
        lambda c: np.zeros(0) if c.history.uplift is None else c.history.uplift.crack,
        lambda c: c.history.uplift is not None,
    ),
    "displacement": Variable(
        ("time", "node", "component"),
        "m",
        "displacement relative to the base",
        _at_probes("disp"),
        Case.has_probes,
    ),
    "peak_displacement": Variable(
        ("node", "component"),
        "m",
        "largest displacement relative to the base, either sign, over all base steps",
        lambda c: c.history.node_peaks[0].reshape(-1, 3),
        Case.has_node_peaks,
    ),
    "peak_displacement_time": Variable(
        ("node", "component"),
        "s",
        "time of the largest displacement",
        lambda c: c.history.node_peaks[1].reshape(-1, 3),
        Case.has_node_peaks,
    ),
    "velocity": Variable(
        ("time", "node", "component"),
        "m s-1",
        "velocity relative to the base",
        _at_probes("vel"),
        Case.has_probes,
    ),
    "acceleration": Variable(
        ("time", "node", "component"),
        "m s-2",
        "acceleration relative to the base",
        _at_probes("acc"),
        Case.has_probes,
    ),
    "ground_acceleration": Variable(
        ("time", "component"),
        "m s-2",
        "ground acceleration of the base, as integrated",
        lambda case: case.history.ground,
    ),
    "peak_ground_acceleration": Variable(
        ("component",),
        "m s-2",
        "largest ground acceleration of the base along the axis, either sign, over all steps",
        lambda c: c.history.ground_peak,
        lambda c: c.history.ground_peak.size > 0,
    ),
    "applied_force": Variable(
        ("time", "force_history"),
        "N",
        "force that varies in time, along its direction; of a pressure that times the area, into the block",
        lambda c: c.history.forces,
        Case.has_force_histories,
    ),
    **ATTACHED_VARIABLES,
    "support_displacement": Variable(
        ("time", "support", "component"),
        "m",
        "displacement of the support relative to the base",
        lambda c: c.history.supports.reshape(len(c.history.time), -1, 3),
        Case.has_moving_supports,
    ),
    **{f"energy_{term}": _energy(term, long_name) for term, long_name in ENERGY_TERMS.items()},
    "energy_numerical": Variable(
        ("time",),
        "J",
        "energy taken by the integrator besides energy_contact; only their sum is never negative",
        lambda c: c.history.energy["numerical"],
        lambda c: "numerical" in c.history.energy,
    ),
    "reduced_coordinates": Variable(
        ("time", "mode"),
        "m",
        "coordinates of the reduced model, modes of 1 kg; with the basis file they give every displacement",
        lambda c: np.asarray(c.history.q),
        lambda c: c.history.q is not None,
    ),
    "mode_frequency": Variable(
        ("mode",),
        "Hz",
        "natural frequency of the coordinate, joints open; NaN of what has no mass, and of waves in water",
        lambda c: c.history.modes[0],
        Case.has_effective_ratios,
    ),
    "mode_damping_ratio": Variable(
        ("mode",),
        "1",
        "effective damping ratio phi^T C phi / (2 omega phi^T M phi) of the coordinate, joints open; NaN of "
        "rigid motions, of what has no mass, and of waves in water",
        lambda c: c.history.modes[1],
        Case.has_effective_ratios,
    ),
    "peak_opening": Variable(
        ("joint",),
        "m",
        "largest opening over all gaps and steps",
        lambda c: c.per_joint(c.history.peaks["opening"], np.max),
        Case.has_joints,
    ),
    "peak_opening_time": Variable(
        ("joint",), "s", "time of the largest opening", _peak_opening_time, Case.has_joints
    ),
    "peak_compression": Variable(
        ("joint",),
        "N",
        "largest compressive force of one gap at one instant, compression negative",
        lambda c: c.per_joint(-c.history.peaks["compression"], np.min),
        Case.has_joints,
    ),
    "peak_compressive_stress": Variable(
        ("joint",),
        "Pa",
        "largest compressive force of one gap at one instant, over its area, compression negative",
        lambda c: c.per_joint(-c.history.peaks["compression"] / c.of_gaps("area"), np.min),
        Case.has_joints,
    ),
    "peak_mean_compressive_stress": Variable(
        ("joint",),
        "Pa",
        "largest mean compressive force of one gap over a writing interval, over its area, "
        "compression negative",
        lambda c: c.per_joint(-(c.history.mean_traction[:, :, 0] / c.of_gaps("area")).max(axis=0), np.min),
        Case.has_joints,
    ),
    "peak_slip": Variable(
        ("joint",),
        "m",
        "largest tangential displacement over all gaps and steps",
        lambda c: c.per_joint(c.history.peaks["slip"], np.max),
        Case.has_friction,
    ),
    **{
        written.name: _peak(name, of, written)
        for name, of in PEAK_QUANTITIES.items()
        for written in of.written
    },
    **SLIDING_VARIABLES,
    **FLOOR_VARIABLES,
    **STRESS_VARIABLES,
}
