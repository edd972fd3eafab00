"""The case that the variables of a result file are made from, and a variable itself."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.config.job import Config
from romdam.core.arrays import Floats
from romdam.core.errors import listed
from romdam.core.motion import GroundMotion, MovingSupports
from romdam.core.scene import ForceHistory, Joint, Reservoir, Scene, StressSites
from romdam.core.system import History
from romdam.postprocess.floor_spectra import FloorSpectra
from romdam.postprocess.stress.summary import StressSummary

Array = NDArray[Any]
Attributes = dict[str, object]

_OF_DAMS = np.array([0.0, -1.0, 0.0])  # `arch_dam` and `gravity_dam` have y downstream


def rock_blocks(scene: Scene) -> list[str]:
    """Blocks that no joint touches, that have no mass or whose weight has acted before, beside others."""
    dam = {name for joint in scene.joints.values() for name in joint.blocks}
    dam -= scene.loads.excluded_from_gravity
    dam -= {name for name, block in scene.blocks.items() if block.material.rho == 0.0}
    return [name for name in scene.blocks if name not in dam] if dam else []


def upstream_of(config: Config, scene: Scene) -> Floats | None:
    """Horizontal unit vector to the water's side, (3,); None where neither water nor a dam's keys tell it."""
    water = scene.find(Reservoir)
    if water is not None:
        return water.upstream
    return None if config.dam is None else _OF_DAMS


def water_at_rest(scene: Scene, history: History) -> Floats:
    """(ng,) force of the water in the gaps at rest [N]."""
    force = np.concatenate([np.zeros(0), *(joint.water for joint in scene.joints.values())])
    return np.asarray(force if history.uplift is None else force + history.uplift.added)


@dataclass(frozen=True)
class Case:
    """One computed ground motion, from which every variable follows.

    `stress` is None without stress, `floors` without floor spectra.
    """

    scene: Scene
    motion: GroundMotion
    history: History
    stress: StressSummary | None = None
    floors: FloorSpectra | None = None

    @property
    def joints(self) -> list[Joint]:
        """The joints in the order of their gaps."""
        return list(self.scene.joints.values())

    @property
    def sites(self) -> StressSites:
        """Where stress is computed; only of a case with `stress`."""
        assert self.scene.stress is not None
        return self.scene.stress

    @property
    def stress_summary(self) -> StressSummary:
        """`stress` of a case that has it."""
        assert self.stress is not None
        return self.stress

    @property
    def floor_spectra(self) -> FloorSpectra:
        """`floors` of a case that has them."""
        assert self.floors is not None
        return self.floors

    # The conditions below are values of `Variable.when`. Variables with the very same condition are in a file
    # together or not at all, see `romdam.results.checking`.

    def has_joints(self) -> bool:
        """Tell whether the scene has joints."""
        return bool(self.scene.joints)

    def has_friction(self) -> bool:
        """Tell whether slip and shear force exist."""
        return self.history.jump.shape[2] == 3

    def carries_shear(self) -> bool:
        """Tell whether the laws of the joints state a shear strength."""
        return self.history.strength.size > 0

    def has_water_in_joints(self) -> bool:
        """Tell whether water presses in some joint."""
        return any(joint.water.any() for joint in self.joints)

    def has_water_force(self) -> bool:
        """Tell whether water presses in some joint, or enters cracks."""
        return self.has_joints() and (self.has_water_in_joints() or bool(self.history.water.any()))

    def has_probes(self) -> bool:
        """Tell whether there are output nodes."""
        return bool(self.scene.probes)

    def has_node_peaks(self) -> bool:
        """Tell whether there are output nodes whose motion over all steps is known."""
        return self.history.node_peaks.size > 0

    def has_effective_ratios(self) -> bool:
        """Tell whether the damping ratio of every coordinate of a reduced model is known."""
        return self.history.modes.size > 0

    def is_balanced(self) -> bool:
        """Tell whether the run begins at rest, where the forces balance."""
        return self.history.balance is not None

    def has_moving_supports(self) -> bool:
        """Tell whether supports move differently from the base."""
        return self.scene.find(MovingSupports) is not None

    def has_stations(self) -> bool:
        """Tell whether supports move by their position."""
        moving = self.scene.find(MovingSupports)
        return moving is not None and bool(moving.shares)

    def has_force_histories(self) -> bool:
        """Tell whether forces vary in time."""
        return bool(self.scene.every(ForceHistory))

    def has_stress(self) -> bool:
        """Tell whether stress was computed."""
        return self.stress is not None

    def has_floors(self) -> bool:
        """Tell whether floor spectra were computed."""
        return self.floors is not None

    def has_floor_error(self) -> bool:
        """Tell whether a better run states the error of the floor spectra."""
        return self.floors is not None and self.floors.error is not None

    def has_broadened_floors(self) -> bool:
        """Tell whether floor spectra were broadened."""
        return self.floors is not None and self.floors.broadened is not None

    def has_stress_duration(self) -> bool:
        """Tell whether durations above the tensile strength were computed."""
        return self.stress is not None and self.stress.duration is not None

    def has_stress_faces(self) -> bool:
        """Tell whether stress was computed on whole faces."""
        return self.stress is not None and bool(self.sites.faces)

    def has_stress_probes(self) -> bool:
        """Tell whether there are nodes with histories of stress."""
        return self.stress is not None and bool(self.sites.probes)

    def was_built(self) -> bool:
        """Tell whether there were stages of construction."""
        return self.history.built is not None

    def has_sections(self) -> bool:
        """Tell whether forces on named sections were computed."""
        return self.stress is not None and bool(self.sites.sections)

    def of_gaps(self, name: str) -> Array:
        """An attribute of `Joint` for all gaps, joint after joint."""
        return np.concatenate([getattr(joint, name) for joint in self.joints])

    @property
    def water_at_rest(self) -> Array:
        """(ng,) force of the water in the gaps at rest [N]."""
        return water_at_rest(self.scene, self.history)

    @property
    def joint_middle(self) -> Array:
        """(joints, 3) middle of the area of each joint [m]."""
        return np.array([joint.whole_area @ joint.position / joint.whole_area.sum() for joint in self.joints])

    @property
    def joint_force(self) -> Array:
        """(nt, joints, 3) contact and water that press on block J of each joint, along x, y, z [N]."""
        axes = self.of_gaps("axes")[:, : self.history.traction.shape[2]]
        return self._sums(self.history.traction, axes) + self.joint_water_force

    @property
    def joint_moment(self) -> Array:
        """(nt, joints, 3) moment of `joint_force` about `joint_middle` [N m]."""
        axes = self.of_gaps("axes")[:, : self.history.traction.shape[2]]
        counts = [len(joint.area) for joint in self.joints]
        arm = self.of_gaps("position") - np.repeat(self.joint_middle, counts, axis=0)
        moments = np.cross(arm[:, None], axes)
        return self._sums(self.history.traction, moments) + self._sums(self._water, moments[:, :1])

    @property
    def joint_water_force(self) -> Array:
        """(nt, joints, 3) what of `joint_force` is water in the joint and in its cracks [N]."""
        return self._sums(self._water, self.of_gaps("axes")[:, :1])

    @property
    def _water(self) -> Array:
        """(nt, ng, 1) force of the water in the gaps and in their cracks [N]."""
        water = np.zeros((len(self.history.time), len(self.water_at_rest))) + self.water_at_rest
        return (water + self.history.water if self.history.water.size else water)[..., None]

    def _sums(self, force: Array, vectors: Array) -> Array:
        """Sums (nt, joints, 3) over the gaps of each joint of forces (nt, ng, d) along vectors (ng, d, 3)."""
        stops = np.cumsum([0, *(len(joint.area) for joint in self.joints)])
        spans = [slice(first, last) for first, last in itertools.pairwise(stops)]
        sums = [force[:, s].reshape(len(force), -1) @ vectors[s].reshape(-1, 3) for s in spans]
        return np.stack(sums, axis=1)

    def per_joint(self, of_gaps: Array, reduce: Callable[[Array], object]) -> Array:
        """`reduce` applied to the gaps of each joint."""
        stops = np.cumsum([len(joint.area) for joint in self.joints])[:-1]
        return np.array([reduce(gaps) for gaps in np.split(of_gaps, stops)])

    def joint_sums(self, of_gaps: Array) -> Array:
        """Sums (nt, joints, ...) of (nt, gaps, ...) over the gaps of each joint."""
        stops = np.cumsum([len(joint.area) for joint in self.joints])
        return np.add.reduceat(of_gaps, np.append(0, stops[:-1]), axis=1)


@dataclass(frozen=True)
class Variable:
    """One variable of a result file.

    Attributes
    ----------
    dims : names of its dimensions
    units : UDUNITS text, "1" for numbers and "" for text
    long_name : what it is, with its sign
    get : Case -> array of that shape
    when : whether the case has it
    attributes : further CF attributes
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    get: Callable[[Case], Array]
    when: Callable[[Case], bool] = lambda case: True
    attributes: Attributes = field(default_factory=dict)

    @property
    def about(self) -> Attributes:
        """Its attributes in a file."""
        units: Attributes = {"units": self.units} if self.units else {}
        return {"long_name": self.long_name, **self.attributes, **units}


def damping_statement(scene: Scene) -> str:
    """Say which blocks have damping of their materials' own; empty where none has."""
    blocks = dict[tuple[float, float], list[str]]()
    for name, block in scene.blocks.items():
        if block.material.damping is not None:
            blocks.setdefault(block.material.damping, []).append(name)
    return "; ".join(
        f"{listed(names)}: alpha = {alpha:.4g} 1/s, beta = {beta:.4g} s of their own M and K"
        for (alpha, beta), names in blocks.items()
    )


def moduli_statement(scene: Scene) -> str:
    """Say which modulus each block has for what; empty where all have one."""
    blocks = dict[tuple[float, float], list[str]]()
    for name, block in scene.blocks.items():
        material = block.material
        if material.E_sustained is not None:
            blocks.setdefault((material.E_sustained, material.E), []).append(name)
    return "; ".join(
        f"{listed(names)}: E = {sustained / 1e9:.4g} GPa at rest (weight, water, temperature, grouting), "
        f"E_dynamic = {dynamic / 1e9:.4g} GPa of what the record adds, of modes and damping"
        for (sustained, dynamic), names in blocks.items()
    )
