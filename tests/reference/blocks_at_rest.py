"""Random blocks and pairs of blocks on rock, and their factors of safety from equilibrium by hand.

Block k stands on rock at y from 0 to L, x from x_k to x_k + b, z from 0 to h; water of level H presses on its
face y = 0, and uplift falls linearly from H at the heel to the tailwater at the toe. Of a crack from the heel
that keeps the diagram of the closed joint (crack: unchanged) nothing depends on the elements: with weight W,
thrust T = g b H^2 / 2 (g the water's weight) and uplift U = g b L (H + H_t) / 2,

    N = W - U,    FS = mu N / T,    x = (W L / 2 + T H / 3 - U (L / 3) (H + 2 H_t) / (H + H_t)) / (N L),

x where the resultant stands from the heel, of the base's length. Blocks side by side share their loads.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

G, DENSITY, WATER = 9.81, 2400.0, 9810.0


@dataclass(frozen=True)
class RestingBlock:
    """One block, and what equilibrium by hand gives."""

    width: float
    length: float
    height: float
    level: float
    tailwater: float
    friction: float

    @property
    def compression(self) -> float:
        weight = DENSITY * G * self.width * self.length * self.height
        return weight - WATER * self.width * self.length * (self.level + self.tailwater) / 2.0

    @property
    def shear(self) -> float:
        return WATER * self.width * self.level**2 / 2.0

    @property
    def factor(self) -> float:
        return self.friction * self.compression / self.shear

    @property
    def resultant(self) -> float:
        L, H, H_t = self.length, self.level, self.tailwater
        weight = DENSITY * G * self.width * L * self.height
        uplift = WATER * self.width * L * (H + H_t) / 2.0
        moment = weight * L / 2.0 + self.shear * H / 3.0 - uplift * L / 3.0 * (H + 2.0 * H_t) / (H + H_t)
        return moment / (self.compression * L)

    @property
    def stands(self) -> bool:
        """Whether there is an equilibrium: it neither slides nor overturns."""
        return self.factor > 1.0 and 0.0 < self.resultant < 1.0 and self.compression > 0.0


def random_blocks(rng: np.random.Generator) -> tuple[list[RestingBlock], dict[str, Any]]:
    """One or two blocks beside each other, and the job of them on rock, without records."""
    count, length, height = int(rng.integers(1, 3)), float(rng.uniform(4, 12)), float(rng.uniform(6, 14))
    level = float(rng.uniform(0.5, 1.0)) * height
    tailwater, friction = float(rng.uniform(0.05, 0.3)) * level, float(rng.uniform(0.06, 0.9))
    widths = rng.uniform(2.0, 5.0, count)
    element = str(rng.choice(["hex8", "hex20", "hex27", "tet10", "tet4"]))
    joint: dict[str, Any] = {"normal_stiffness": 1e11, "shear_stiffness": 5e10, "friction": friction}
    base = dict(joint)
    if rng.random() < 0.3:
        base["spacing"] = float(length / rng.integers(2, 5))
    elif rng.random() < 0.3:
        base["discretization"] = "mortar"
    ends = np.concatenate([[0.0], np.cumsum(widths)])
    sizes = [float(length / rng.integers(3, 6)), float(height / rng.integers(2, 5))]

    def box(k: int, z: float, depth: float) -> dict[str, Any]:
        width = float(widths[k])
        element_size = [width / 2.0, sizes[0], depth / 2.0 if z < 0.0 else sizes[1]]
        shape = {"origin": [float(ends[k]), 0.0, z], "size": [width, length, depth]}
        return {"box": shape | {"element_size": element_size, "element": element}}

    blocks, joints, supports = {}, {}, []
    for k in range(count):
        blocks[f"rock_{k}"] = {"material": "c", "mass": False, "weight": False} | box(k, -4.0, 4.0)
        blocks[f"dam_{k}"] = {"material": "c"} | box(k, 0.0, height)
        supports.append({"block": f"rock_{k}", "face": "zmin"})
        pair = [f"rock_{k}", f"dam_{k}"]
        joints[f"base_{k}"] = base | {"between": pair if rng.random() < 0.5 else pair[::-1]}
    ties = {}
    if count == 2:
        joints["between"] = joint | {"between": ["dam_0", "dam_1"]}
        ties["rock"] = {"between": ["rock_0", "rock_1"]}
    names = list(blocks)
    if rng.random() < 0.5:
        names = names[::-1]
    bases = [f"base_{k}" for k in range(count)]
    job = {
        "materials": {"c": {"E": 30e9, "nu": 0.0, "rho": DENSITY}},
        "blocks": {name: blocks[name] for name in names},
        "supports": supports,
        "joints": joints,
        "loads": {
            "gravity": [0.0, 0.0, -G],
            "hydrostatic": [
                {"level": level, "faces": [{"block": f"dam_{k}", "face": "ymin"} for k in range(count)]}
            ],
            "joint_water": [
                {"joints": bases, "level": level, "downstream": [0, 1, 0], "tailwater": tailwater}
            ],
        },
        "damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}},
        "model": {"modes": int(rng.integers(1, 8))},
        "transient": {"finest_step": 0.002, "duration": 0.02},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False},
    } | ({"ties": ties} if ties else {})
    resting = [RestingBlock(float(width), length, height, level, tailwater, friction) for width in widths]
    return resting, job


@dataclass(frozen=True)
class Footing:
    """What stands on a joint, of length L along the water's push: forces, and their moments about the heel.

    Attributes
    ----------
    joint : name
    weight, thrust, uplift : [N]
    moment : of all of them about the heel, turning towards the toe positive [N m]
    """

    joint: str
    length: float
    friction: float
    weight: float
    thrust: float
    uplift: float
    moment: float

    @property
    def compression(self) -> float:
        return self.weight - self.uplift

    @property
    def factor(self) -> float:
        return self.friction * self.compression / self.thrust if self.thrust > 0.0 else np.inf

    @property
    def resultant(self) -> float:
        return self.moment / (self.compression * self.length)

    @property
    def stands(self) -> bool:
        """Whether it neither slides nor overturns nor floats."""
        return self.compression > 0.0 and self.factor > 1.0 and 0.0 < self.resultant < 1.0


def _uplift(wide: float, heads: list[tuple[float, float]]) -> tuple[float, float]:
    """Force and moment about the heel of heads [m] at distances from it, straight between them [N, N m]."""
    force = moment = 0.0
    for (a, p), (b, q) in itertools.pairwise(heads):
        force += (b - a) * (p + q) / 2.0
        # a rectangle of the pressure p, and a triangle up to q
        moment += p * (b - a) * (a + b) / 2.0 + (q - p) * (b - a) / 2.0 * (a + (b - a) * 2.0 / 3.0)
    return WATER * wide * force, WATER * wide * moment


def random_scene(rng: np.random.Generator) -> tuple[str, list[Footing], dict[str, Any]]:
    """One block on rock, a block on another one, or two unlike ones side by side, and their job.

    Water and its uplift, with drains at times, or a push on the dry face instead; x or y downstream.
    """
    kind = str(rng.choice(["one", "stack", "beside"]))
    along = int(rng.integers(0, 2))  # axis that points downstream
    count = 1 if kind == "one" else 2
    friction = float(rng.uniform(0.2, 1.2))
    wide = rng.uniform(2.0, 5.0, count) if kind == "beside" else np.full(count, rng.uniform(2.0, 6.0))
    length = rng.uniform(2.0, 8.0, count) if kind == "beside" else np.full(count, rng.uniform(2.0, 8.0))
    height = rng.uniform(3.0, 9.0, count)
    foot = np.array([0.0, height[0]])[:count] if kind == "stack" else np.zeros(count)
    top = float((foot + height).max())
    level = float(rng.uniform(0.3, 1.0)) * float((foot + height).min() if kind == "beside" else top)
    tailwater = float(rng.uniform(0.0, 0.4)) * level
    dry, drained = rng.random() < 0.25, rng.random() < 0.3
    push = float(rng.uniform(1e4, 6e4))  # [Pa] on dry faces
    drains_at = float(rng.uniform(0.1, 0.4)) * float(length.min())

    def heads(z: float, toe: float) -> list[tuple[float, float]]:
        up, down = level, max(tailwater, z)
        ends = [(0.0, up), (toe, down)]
        if drained:
            ends.insert(1, (drains_at, down + (up - down) / 3.0))
        return [(s, h - z) for s, h in ends]

    footings = list[Footing]()
    for k in range(count):
        above = [k] if kind != "stack" else list(range(k, count))
        z, L, b = float(foot[k]), float(length[k]), float(wide[k])
        weight = sum(DENSITY * G * wide[j] * length[j] * height[j] for j in above)
        faces = [(float(foot[j]), float(foot[j] + height[j])) for j in above]
        if dry:
            thrust = sum(push * b * (high - low) for low, high in faces)
            moment = sum(push * b * (high - low) * ((high + low) / 2.0 - z) for low, high in faces)
            uplift = of_uplift = 0.0
        else:
            depth = max(level - z, 0.0)
            thrust, moment = WATER * b * depth**2 / 2.0, WATER * b * depth**3 / 6.0
            uplift, of_uplift = _uplift(b, heads(z, L)) if depth > 0.0 else (0.0, 0.0)
        moment += weight * L / 2.0 - of_uplift
        footings.append(Footing(f"base_{k}", L, friction, weight, thrust, uplift, moment))
    return kind, footings, _job_of(rng, kind, along, wide, length, height, foot, friction, {
        "level": level, "tailwater": tailwater, "drains": drains_at if drained else None,
        "push": push if dry else None,
    })  # fmt: skip


def _job_of(
    rng: np.random.Generator, kind: str, along: int, wide: Any, length: Any, height: Any, foot: Any,
    friction: float, loads: dict[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """The job of a scene, its elements, gaps and names at random."""
    element = str(rng.choice(["hex8", "hex20", "hex27", "tet10", "tet4"]))
    joint: dict[str, Any] = {"normal_stiffness": float(10 ** rng.uniform(10, 11.5)), "friction": friction}
    joint["shear_stiffness"] = 0.5 * joint["normal_stiffness"]
    base, gaps = dict(joint), rng.random()
    if gaps < 0.3:
        base["spacing"] = float(length.min() / rng.integers(2, 5))
    elif gaps < 0.5:
        base["discretization"] = "mortar"
    starts = np.array([0.0, wide[0]])[: len(wide)] if kind == "beside" else np.zeros(len(wide))

    def box(k: int, z: float, depth: float, divisions: tuple[int, int, int]) -> dict[str, Any]:
        origin, size = [float(starts[k]), 0.0, z], [float(wide[k]), float(length[k]), depth]
        cells = [s / d for s, d in zip(size, divisions, strict=True)]
        if along == 0:
            origin[:2], size[:2], cells[:2] = origin[1::-1], size[1::-1], cells[1::-1]
        shape = {"origin": origin, "size": size, "element_size": cells, "element": element}
        return {"material": "c", "box": shape}

    face = ["xmin", "ymin"][along]
    divisions = [(int(rng.integers(1, 3)), int(rng.integers(2, 6))) for _ in wide]
    if kind == "stack":
        divisions = divisions[:1] * 2
    blocks, joints, supports, bases = {}, {}, [], list[str]()
    for k in range(len(wide)):
        blocks[f"dam_{k}"] = box(
            k, float(foot[k]), float(height[k]), (*divisions[k], int(rng.integers(1, 4)))
        )
        under = f"dam_{k - 1}" if kind == "stack" and k else f"rock_{k}"
        if under.startswith("rock"):
            blocks[under] = box(k, -3.0, 3.0, (*divisions[k], 1)) | {"mass": False, "weight": False}
            supports.append({"block": under, "face": "zmin"})
        pair = [under, f"dam_{k}"]
        bases.append(f"base_{k}")
        joints[bases[-1]] = base | {"between": pair if rng.random() < 0.5 else pair[::-1]}
    if kind == "beside":
        joints["between"] = joint | {"between": ["dam_0", "dam_1"], "discretization": "mortar"}
    names = [str(name) for name in rng.permutation(list(blocks))]
    wet = [{"block": f"dam_{k}", "face": face} for k in range(len(wide))]
    acting: dict[str, Any] = {"gravity": [0.0, 0.0, -G]}
    if loads["push"] is None:
        acting["hydrostatic"] = [{"level": loads["level"], "faces": wet}]
        drains = {} if loads["drains"] is None else {"drains": {"at": loads["drains"], "rule": "usbr"}}
        # uplift in joints that the reservoir reaches
        reached = [name for name, z in zip(bases, foot, strict=True) if z < loads["level"]]
        downstream = [float(axis == along) for axis in range(3)]
        water = {"joints": reached, "level": loads["level"], "tailwater": loads["tailwater"]}
        acting["joint_water"] = [water | {"downstream": downstream} | drains]
    else:
        acting["pressure"] = [face | {"value": loads["push"]} for face in wet]
    return {
        "materials": {"c": {"E": 30e9, "nu": float(rng.choice([0.0, 0.2])), "rho": DENSITY}},
        "blocks": {name: blocks[name] for name in names},
        "supports": supports,
        "joints": {str(name): joints[name] for name in rng.permutation(list(joints))},
        "loads": acting,
        "damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}},
        "model": {"modes": int(rng.integers(1, 8))},
        "transient": {"finest_step": 0.002, "duration": 0.02},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False},
    }
