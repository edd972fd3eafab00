"""Every variable of a result file, in one dict; to add one, add one entry.

SI units; displacement, velocity and acceleration are relative to the base; opening is positive, and
compression is negative.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.core.system import STATES
from romdam.results.case import Array, Attributes, Case, Variable
from romdam.results.sliding import SLIDING_VARIABLES
from romdam.results.stress.variables import STRESS_COORDINATES, STRESS_VARIABLES


def _has_joints(case: Case) -> bool:
    return bool(case.scene.joints)


def _has_water(case: Case) -> bool:
    return any(joint.water.any() for joint in case.joints)


def _frictional(case: Case) -> bool:
    return case.frictional


def _has_probes(case: Case) -> bool:
    return bool(case.scene.probes)


def _reduced(case: Case) -> bool:
    return case.history.q is not None


def _has_moving_supports(case: Case) -> bool:
    return case.scene.moving is not None


def _moving_supports(case: Case) -> Array:
    assert case.scene.moving is not None
    return _strings([motion.name for motion in case.scene.moving.motions])


def _probe_position(case: Case) -> Array:
    return np.array([case.scene.blocks[p.block].points[p.node] for p in case.scene.probes])


def _at_probes(name: str) -> Callable[[Case], Array]:
    def get(case: Case) -> Array:
        values: Array = getattr(case.history, name)
        return values.reshape(len(values), -1, 3)

    return get


def _joint_of_gap(case: Case) -> Array:
    return np.concatenate([np.full(len(joint.area), joint.name) for joint in case.joints])


def _strings(values: list[str]) -> Array:
    return np.array(values, dtype=str)


def _peak_opening_time(case: Case) -> Array:
    peaks = case.history.peaks
    stacked = np.stack([peaks["opening"], peaks["opening_time"]], axis=1)
    return case.per_joint(stacked, lambda part: part[part[:, 0].argmax(), 1])


def _peak_stress(case: Case) -> Array:
    return case.per_joint(-case.history.peaks["compression"] / case.of_gaps("area"), np.min)


def _mean_peak_stress(case: Case) -> Array:
    means = case.history.mean_traction[:, :, 0] / case.of_gaps("area")
    return case.per_joint(-means.max(axis=0), np.min)


def _energy(term: str, long_name: str) -> Variable:
    return Variable(("time",), "J", long_name, lambda case: case.history.energy[term])


_FLAGS: Attributes = {
    "flag_values": np.array(list(STATES.values()), dtype=np.int8),
    "flag_meanings": " ".join(STATES),
}

COORDINATES: dict[str, Variable] = {
    "time": Variable(("time",), "s", "time since the start of the record", lambda c: c.history.time),
    "gap": Variable(
        ("gap",), "1", "number of the gap element", lambda c: np.arange(len(c.of_gaps("area"))), _has_joints
    ),
    "joint": Variable(
        ("joint",), "", "name of the joint", lambda c: _strings(list(c.scene.joints)), _has_joints
    ),
    "node": Variable(
        ("node",),
        "",
        "name of the output node",
        lambda c: _strings([p.name for p in c.scene.probes]),
        _has_probes,
    ),
    "component": Variable(("component",), "", "global axis", lambda c: _strings(["x", "y", "z"])),
    "tangent": Variable(
        ("tangent",), "", "local tangential axis of a gap", lambda c: _strings(["j", "k"]), _has_joints
    ),
    "joint_blocks": Variable(
        ("joint", "side"),
        "",
        "names of blocks I and J of the joint",
        lambda c: np.array([joint.blocks for joint in c.joints], dtype=str),
        _has_joints,
    ),
    "gap_joint": Variable(("gap",), "", "joint the gap belongs to", _joint_of_gap, _has_joints),
    "gap_position": Variable(
        ("gap", "component"), "m", "position of the gap", lambda c: c.of_gaps("position"), _has_joints
    ),
    "gap_normal": Variable(
        ("gap", "component"),
        "1",
        "normal from block I to block J",
        lambda c: c.of_gaps("axes")[:, 0],
        _has_joints,
    ),
    "gap_tangent": Variable(
        ("gap", "tangent", "component"),
        "1",
        "local axes j and k",
        lambda c: c.of_gaps("axes")[:, 1:],
        _has_joints,
    ),
    "gap_area": Variable(
        ("gap",),
        "m2",
        "area of the joint that the gap stands for",
        lambda c: c.of_gaps("whole_area"),
        _has_joints,
    ),
    "initial_gap": Variable(
        ("gap",),
        "m",
        "initial gap as configured, before any grouting, open positive",
        lambda c: c.of_gaps("gap"),
        _has_joints,
    ),
    "grouted_gap": Variable(
        ("gap",),
        "m",
        "initial gap after grouting, at which the opening of an unloaded gap starts, open positive",
        lambda c: c.history.gap,
        lambda c: _has_joints(c) and bool(c.of_gaps("grout").any()),
    ),
    "support": Variable(
        ("support",),
        "",
        "first entry of `supports` with the motion",
        _moving_supports,
        _has_moving_supports,
    ),
    "node_block": Variable(
        ("node",),
        "",
        "block of the output node",
        lambda c: _strings([p.block for p in c.scene.probes]),
        _has_probes,
    ),
    "node_position": Variable(
        ("node", "component"), "m", "position of the output node", _probe_position, _has_probes
    ),
    **STRESS_COORDINATES,
}

VARIABLES: dict[str, Variable] = {
    "opening": Variable(
        ("time", "gap"), "m", "joint opening, open positive", lambda c: c.history.jump[:, :, 0], _has_joints
    ),
    "slip": Variable(
        ("time", "gap", "tangent"),
        "m",
        "tangential displacement of block J relative to block I",
        lambda c: c.history.jump[:, :, 1:],
        _frictional,
    ),
    "normal_force": Variable(
        ("time", "gap"),
        "N",
        "normal force of the gap, compression negative; the effective one where there is water",
        lambda c: -c.history.traction[:, :, 0],
        _has_joints,
    ),
    "shear_force": Variable(
        ("time", "gap", "tangent"),
        "N",
        "shear force of the gap on block J",
        lambda c: c.history.traction[:, :, 1:],
        _frictional,
    ),
    "mean_normal_force": Variable(
        ("time", "gap"),
        "N",
        "mean normal force, with crack_water_force, over the writing interval that ends at the time, "
        "compression negative",
        lambda c: -c.history.mean_traction[:, :, 0],
        _has_joints,
    ),
    "mean_shear_force": Variable(
        ("time", "gap", "tangent"),
        "N",
        "mean shear force on block J over the writing interval that ends at the time",
        lambda c: c.history.mean_traction[:, :, 1:],
        _frictional,
    ),
    "water_pressure": Variable(
        ("gap",),
        "Pa",
        "pressure of the water in the joint, mean over the gap's area",
        lambda c: c.of_gaps("water") / c.of_gaps("area"),
        _has_water,
    ),
    "water_force": Variable(
        ("joint", "component"),
        "N",
        "resultant of the water in the joint on block J; block I has the opposite",
        lambda c: np.array([joint.water_resultant for joint in c.joints]),
        _has_water,
    ),
    "crack_water_force": Variable(
        ("time", "gap"),
        "N",
        "force of the water that entered the gap as it opened, besides that of water_pressure",
        lambda c: c.history.water,
        lambda c: bool(c.history.water.any()),
    ),
    "joint_state": Variable(
        ("time", "gap"),
        "1",
        "state of the gap (closed without friction is stick)",
        lambda c: c.history.state.astype(np.int8),
        _has_joints,
        _FLAGS,
    ),
    "displacement": Variable(
        ("time", "node", "component"),
        "m",
        "displacement relative to the base",
        _at_probes("disp"),
        _has_probes,
    ),
    "velocity": Variable(
        ("time", "node", "component"),
        "m s-1",
        "velocity relative to the base",
        _at_probes("vel"),
        _has_probes,
    ),
    "acceleration": Variable(
        ("time", "node", "component"),
        "m s-2",
        "acceleration relative to the base",
        _at_probes("acc"),
        _has_probes,
    ),
    "ground_acceleration": Variable(
        ("time", "component"),
        "m s-2",
        "ground acceleration of the base, as integrated",
        lambda case: case.history.ground,
    ),
    "support_displacement": Variable(
        ("time", "support", "component"),
        "m",
        "displacement of the support relative to the base",
        lambda c: c.history.supports.reshape(len(c.history.time), -1, 3),
        _has_moving_supports,
    ),
    "energy_input": _energy(
        "input", "work of inertia forces, static loads, moving supports and water that enters gaps"
    ),
    "energy_kinetic": _energy(
        "kinetic", "kinetic energy relative to the base and what moving supports carry"
    ),
    "energy_strain": _energy("strain", "strain energy of the blocks"),
    "energy_joint_stored": _energy("joint_stored", "energy stored in the joints' springs"),
    "energy_damping": _energy("damping", "energy dissipated by damping"),
    "energy_friction": _energy("friction", "energy dissipated by sliding"),
    "energy_contact": _energy("contact", "energy taken away numerically at closing and opening"),
    "energy_numerical": Variable(
        ("time",),
        "J",
        "energy taken by the integrator besides energy_contact; only their sum is never negative",
        lambda c: c.history.energy["numerical"],
        lambda c: "numerical" in c.history.energy,
    ),
    "energy_residual": _energy("residual", "imbalance of the energy ledger, round-off when exact"),
    "reduced_coordinates": Variable(
        ("time", "mode"),
        "m",
        "coordinates of the reduced model, modes of 1 kg; with the basis file they give every displacement",
        lambda c: np.asarray(c.history.q),
        _reduced,
    ),
    "peak_opening": Variable(
        ("joint",),
        "m",
        "largest opening over all gaps and steps",
        lambda c: c.per_joint(c.history.peaks["opening"], np.max),
        _has_joints,
    ),
    "peak_opening_time": Variable(
        ("joint",), "s", "time of the largest opening", _peak_opening_time, _has_joints
    ),
    "peak_compression": Variable(
        ("joint",),
        "N",
        "largest compressive force of one gap at one instant, compression negative",
        lambda c: c.per_joint(-c.history.peaks["compression"], np.min),
        _has_joints,
    ),
    "peak_compressive_stress": Variable(
        ("joint",),
        "Pa",
        "largest compressive force of one gap at one instant, over its area, compression negative",
        _peak_stress,
        _has_joints,
    ),
    "peak_mean_compressive_stress": Variable(
        ("joint",),
        "Pa",
        "largest mean compressive force of one gap over a writing interval, over its area, "
        "compression negative",
        _mean_peak_stress,
        _has_joints,
    ),
    "peak_slip": Variable(
        ("joint",),
        "m",
        "largest tangential displacement over all gaps and steps",
        lambda c: c.per_joint(c.history.peaks["slip"], np.max),
        _frictional,
    ),
    "gap_peak_opening": Variable(
        ("gap",),
        "m",
        "largest opening of the gap over all steps",
        lambda c: c.history.peaks["opening"],
        _has_joints,
    ),
    "gap_peak_compression": Variable(
        ("gap",),
        "N",
        "largest compressive force of the gap over all steps, compression negative",
        lambda c: -c.history.peaks["compression"],
        _has_joints,
    ),
    **SLIDING_VARIABLES,
    **STRESS_VARIABLES,
}
