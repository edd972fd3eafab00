"""Random blocks and pairs of blocks on rock, and their factors of safety from equilibrium by hand.

Block k stands on rock at y from 0 to L, x from x_k to x_k + b, z from 0 to h; water of level H presses on its
face y = 0, and uplift falls linearly from H at the heel to the tailwater at the toe. Of a crack from the heel
that keeps the diagram of the closed joint (crack: unchanged) nothing depends on the elements: with weight W,
thrust T = g b H^2 / 2 (g the water's weight) and uplift U = g b L (H + H_t) / 2,

    N = W - U,    FS = mu N / T,    x = (W L / 2 + T H / 3 - U (L / 3) (H + 2 H_t) / (H + H_t)) / (N L),

x where the resultant stands from the heel, of the base's length. Blocks side by side share their loads.
"""

from __future__ import annotations

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
