"""Random scenes of a few boxes, drawn from a seed, as jobs that a user would write.

A scene is a row of two to four blocks of unequal size along x or y: on a fixed base, tied to rock, on joints
with rock, or with a block on top of another. Nothing is tuned to what the library does well: numbers of
elements may be odd or one, meshes of neighbours need not match, stiffnesses of joints cover four decades.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

RECORDS = Path(__file__).parents[2] / "data" / "records"
_MOTIONS: dict[str, dict[str, Any]] = {  # name -> entry of `records`, and its peak [m/s2] in the seconds run
    "mul009": {"file": "northridge_mul009_g_dt0.01.txt", "unit": "9.81 m/s2", "dt": 0.01},
    "mul279": {"file": "northridge_mul279_g_dt0.01.txt", "unit": "9.81 m/s2", "dt": 0.01},
    "pulse": {"file": "hard/pulse_1g_2hz.txt", "unit": "m/s2", "dt": 0.01},
    "shaking": {"file": "hard/shaking_0.5g_5hz.txt", "unit": "m/s2", "dt": 0.01},
}
_MATERIALS = {
    "concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0, "expansion": 1e-5},
    "old": {"E": 20e9, "nu": 0.2, "rho": 2350.0, "expansion": 1e-5},
    "rock": {"E": 25e9, "nu": 0.22, "rho": 2650.0},
}
_NORMAL = 2440.0 * 9.81  # [N/m3] of concrete, by which strengths are drawn
_MOST_NODES = 650  # of a job's own mesh


@dataclass
class Scene:
    """A random job.

    Attributes
    ----------
    raw : the configuration, as YAML has it
    words : what it has, for the table
    edge : length of the longest element [m]
    """

    raw: dict[str, Any]
    words: list[str]
    edge: float = 0.0
    tops: dict[str, list[float]] = field(default_factory=dict)


def draw_scene(seed: int, number: int) -> Scene:
    """Draw scene `number` of a seed; the same pair is always the same scene."""
    draw = _Draw(np.random.default_rng([seed, number]))
    scene = draw.row()
    draw.joints(scene)
    draw.loads(scene)
    draw.damping(scene)
    draw.motion(scene)
    draw.model(scene)
    draw.outputs(scene)
    scene.raw["title"] = f"random scene {number} of seed {seed}"
    return scene


@dataclass
class _Draw:
    """Draws of one scene, in the order in which they are made."""

    rng: np.random.Generator

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def pick(self, *choices: Any, weights: list[float] | None = None) -> Any:
        share = None if weights is None else np.array(weights) / sum(weights)
        return choices[int(self.rng.choice(len(choices), p=share))]

    def between(self, low: float, high: float) -> float:
        return float(f"{self.rng.uniform(low, high):.4g}")

    def over(self, low: float, high: float) -> float:
        """A number whose logarithm is even between two."""
        return float(f"{math.exp(self.rng.uniform(math.log(low), math.log(high))):.4g}")

    def row(self) -> Scene:
        """Blocks, supports and ties; the joints of the row and of a base without their laws."""
        while True:
            scene, nodes = self._row()
            if nodes <= _MOST_NODES:
                return scene

    def _row(self) -> tuple[Scene, float]:
        rng, element = self.rng, self.pick("hex8", "hex20", "tet10", "tet4", weights=[50, 32, 14, 4])
        axis, cross = self.pick((0, 1), (1, 0))
        count = self.pick(2, 3, 4, weights=[50, 42, 8])
        stands = self.pick("fixed", "tied", "base joints", "stacked", weights=[62, 14, 14, 10])
        edges = [self.pick(2.0, 2.5, 3.0, 4.0, 5.0) for _ in range(3)]
        deep = int(rng.integers(1, 4)) * edges[2]
        low = 3 if stands == "base joints" else 4
        widths = [int(rng.integers(1, 4)) for _ in range(count)]
        heights = [int(rng.integers(low, 11)) for _ in range(count)]
        apart = element in ("hex8", "hex20") and self.chance(0.12)  # meshes of neighbours do not match
        blocks, joints, tops, at, nodes = (
            dict[str, Any](),
            dict[str, Any](),
            dict[str, list[float]](),
            0.0,
            0.0,
        )
        names = "abcd"[:count]
        for k, name in enumerate(names):
            size, elements = [0.0] * 3, [0.0] * 3
            size[axis], elements[axis] = max(widths[k] * edges[0], 3.0), edges[0]
            size[axis] = math.ceil(size[axis] / edges[0] - 1e-9) * edges[0]
            size[cross], elements[cross] = deep, edges[2]
            size[2] = min(max(heights[k] * edges[1], 8.0), 40.0)
            size[2] = math.ceil(size[2] / edges[1] - 1e-9) * edges[1]
            if stands == "base joints":  # that do not overturn
                size[2] = min(size[2], math.floor(2.2 * min(size[axis], deep) / edges[1] + 1.0) * edges[1])
            elements[2] = edges[1]
            if apart and k % 2:
                elements[2] = size[2] / (round(size[2] / edges[1]) + int(rng.integers(1, 3)))
            origin = [0.0] * 3
            origin[axis] = at
            blocks[name] = _box(self.pick("concrete", "old"), origin, size, elements, element)
            tops[name] = [origin[0], origin[1], size[2]]
            at += size[axis]
            nodes += count_nodes(size, elements, element)
        for one, other in pairwise(names):
            joints[f"{one}{other}"] = {"between": [one, other]}
        raw: dict[str, Any] = {"materials": _MATERIALS, "blocks": blocks, "joints": joints}
        raw["supports"] = [{"block": name, "face": "zmin"} for name in names]
        words = [f"{count} x {element}", stands] + (["meshes apart"] if apart else [])
        if stands == "stacked":
            nodes += self._stack(raw, tops, axis, edges, element)
        elif stands != "fixed":
            nodes += self._rock(raw, at, deep, (axis, cross), edges, element, jointed=stands == "base joints")
        return Scene(raw, words, max(edges), tops), nodes

    def _stack(
        self, raw: dict[str, Any], tops: dict[str, list[float]], axis: int, edges: list[float], element: str
    ) -> float:
        """A block on top of the first one, with a joint; the number of its nodes."""
        below = raw["blocks"]["a"]["box"]
        size = [*below["size"][:2], int(self.rng.integers(2, 4)) * edges[1]]
        origin = [*below["origin"][:2], below["size"][2]]
        raw["blocks"]["e"] = _box("concrete", origin, size, below["element_size"], element)
        raw["joints"]["ae"] = {"between": ["a", "e"]}
        tops["e"] = [origin[0], origin[1], origin[2] + size[2]]
        beside = raw["blocks"]["b"]["box"]["size"][2]
        if beside > origin[2]:  # they touch
            raw["joints"]["eb"] = {"between": ["e", "b"]}
        return count_nodes(size, below["element_size"], element)

    def _rock(
        self,
        raw: dict[str, Any],
        length: float,
        deep: float,
        axes: tuple[int, int],
        edges: list[float],
        element: str,
        *,
        jointed: bool,
    ) -> float:
        """A block of massless rock below all, tied or jointed; the number of its nodes."""
        axis, cross = axes
        size, origin, elements = [0.0] * 3, [0.0] * 3, [0.0] * 3
        size[axis], origin[axis], elements[axis] = length + 2 * edges[0], -edges[0], edges[0]
        size[cross], origin[cross], elements[cross] = deep + 2 * edges[2], -edges[2], edges[2]
        size[2] = 2 * edges[1]
        origin[2], elements[2] = -size[2], edges[1]
        names = list(raw["blocks"])
        raw["blocks"]["rock"] = _box("rock", origin, size, elements, element) | {"mass": False}
        raw["supports"] = [{"block": "rock", "face": "zmin"}]
        for name in names:
            if jointed:
                raw["joints"][f"base_{name}"] = {"between": ["rock", name]}
            else:
                raw.setdefault("ties", {})[f"foot_{name}"] = {"between": [name, "rock"]}
        return count_nodes(size, elements, element)

    def joints(self, scene: Scene) -> None:
        """Stiffness, gap, law and contact points of every joint."""
        for name, joint in scene.raw["joints"].items():
            level = name.startswith("base_") or name == "ae"
            stiffness = self.pick(
                "rigid", "auto", self.over(1e9, 1e13), weights=[5 if not level else 0, 7, 88]
            )
            joint["normal_stiffness"] = stiffness
            if self.chance(0.5) and not level:
                joint["gap"] = self.over(1e-3, 0.1)
            law = self.pick(
                "none", "friction", "bond", "fracture", "friction_static", "shear_key", "velocity_friction",
                "slip_weakening", "barton_bandis", "viscosity", "tension_stiffness",
                weights=[22, 28, 7, 6, 6, 6, 5, 5, 5, 5, 5],
            )  # fmt: skip
            if level:
                law = self.pick("friction", "bond", "friction_static", weights=[60, 30, 10])
            joint |= self._law(law, stiffness, level=level)
            scene.words.append(f"{name}:{law}" + ("" if "gap" not in joint else f" gap {joint['gap']:g}"))
            if not level and self.chance(0.12) and "gap" not in joint:
                joint["spacing"] = float(f"{self.between(1.8, 4.2) * scene.edge:.3g}")
                scene.words.append(f"spacing {joint['spacing']:g}")

    def _law(self, law: str, stiffness: Any, *, level: bool) -> dict[str, Any]:
        """The keys of a law."""
        normal = stiffness if isinstance(stiffness, float) else 1e11
        friction = self.between(0.7, 1.1) if level else self.between(0.3, 1.0)
        shear = {"shear_stiffness": float(f"{self.between(0.15, 1.0) * normal:.4g}")}
        rubs: dict[str, Any] = {"friction": friction} | shear
        if law == "none":
            return {"friction": 0.0} if self.chance(0.5) else {}
        if law == "friction":
            return rubs
        if law == "bond":
            strength = self.over(0.1e6, 2e6)
            return rubs | {"tensile_strength": strength, "cohesion": self.between(1.2, 2.0) * strength}
        if law == "fracture":
            strength = self.over(0.2e6, 2e6)
            least = strength**2 / (2.0 * normal)
            keys = {
                "tensile_strength": strength,
                "energy": max(self.over(60.0, 300.0), 6.0 * least),
                "cohesion": 1.5 * strength,
                "shear_energy": max(
                    self.over(200.0, 900.0), 40.0 * least * normal / shear["shear_stiffness"]
                ),
                "softening": self.pick("linear", "exponential", "bilinear"),
            }
            return rubs | {"fracture": keys}
        if law == "friction_static":
            return rubs | {"friction_static": friction + self.between(0.05, 0.3)}
        if law == "shear_key":
            return rubs | {
                "shear_key": {"depth": self.over(2e-3, 0.1), "directions": self.pick(["j"], ["j", "k"])}
            }
        if law == "velocity_friction":
            keys = {"mu_s": friction, "mu_d": 0.6 * friction, "v_c": self.over(0.01, 0.3)}
            return {"velocity_friction": keys} | shear
        if law == "slip_weakening":
            keys = {"mu_s": friction, "mu_d": 0.6 * friction, "d_c": self.over(1e-3, 0.05)}
            return {"slip_weakening": keys} | shear
        if law == "barton_bandis":
            keys = {
                "JRC": self.between(2.0, 12.0),
                "JCS": self.over(2e7, 1e8),
                "mu_b": self.between(0.4, 0.7),
            }
            return {"barton_bandis": keys} | shear
        if law == "viscosity":
            return (rubs if self.chance(0.5) else {}) | {
                "viscosity": float(f"{normal * self.over(1e-4, 1e-2):.4g}")
            }
        tension = float(f"{normal * self.pick(0.01, 0.1, 1.0):.4g}")
        return {"tension_stiffness": tension} | (shear if self.chance(0.5) else {})

    def loads(self, scene: Scene) -> None:
        """Weight, still and moving water, uplift, grouting, temperature."""
        raw, words = scene.raw, scene.words
        heavy = "rock" in raw["blocks"] or "e" in raw["blocks"] or self.chance(0.5)
        loads: dict[str, Any] = {"initial_state": "static" if heavy else "undeformed"}
        if heavy:
            loads["gravity"] = [0.0, 0.0, -9.81]
            jointed = any(joint["between"][0] == "rock" for joint in raw["joints"].values())
            if self.chance(0.2) and not jointed and "e" not in raw["blocks"]:
                loads["weight"] = "staged"
                words.append("staged weight")
        across = "y" if raw["blocks"]["b"]["box"]["origin"][0] > 0.0 else "x"
        standing = [name for name in raw["blocks"] if name not in ("rock", "e")]
        lowest = min(raw["blocks"][name]["box"]["size"][2] for name in standing)
        if heavy and self.chance(0.3):
            level = float(f"{self.between(0.5, 0.95) * lowest:.3g}")
            faces = [{"block": name, "face": f"{across}min"} for name in standing]
            loads["hydrostatic"] = [{"level": level, "faces": faces}]
            model = self.pick("westergaard", "incompressible", None)
            if model is not None:
                raw["water"] = {"level": level, "faces": faces, "model": model}
            words.append(f"water {model}")
            bases = [name for name in raw["joints"] if name.startswith("base_")]
            if bases:
                downstream = [0.0, 1.0, 0.0] if across == "y" else [1.0, 0.0, 0.0]
                uplift: dict[str, Any] = {"joints": bases, "level": level, "downstream": downstream}
                uplift["crack"] = self.pick("unchanged", "redrawn", weights=[70, 30])
                loads["joint_water"] = [uplift]
                words.append(f"uplift {uplift['crack']}")
            elif self.chance(0.3):
                loads["joint_water"] = [{"joints": ["ab"], "level": level}]
                words.append("water in joint")
        row = [
            joint for name, joint in raw["joints"].items() if not name.startswith("base_") and name != "ae"
        ]
        if heavy and "rock" not in raw["blocks"] and self.chance(0.2):
            row[0]["grouting_pressure"] = self.over(5e4, 5e5)
            row[0].pop("gap", None)
            words.append("grouted")
        if heavy and self.chance(0.12):
            loads["temperature"] = [{"change": -self.between(1.0, 8.0), "blocks": standing}]
            words.append("temperature")
        raw["loads"] = loads

    def damping(self, scene: Scene) -> None:
        """Rayleigh with fits between 1 and 50 Hz, or modal ratios."""
        if self.chance(0.12):
            ratio = self.over(0.01, 0.15)
            scene.raw["damping"] = {"modal": ratio}
            scene.words.append(f"modal {100 * ratio:.2g} %")
            return
        first = self.over(1.0, 8.0)
        second = min(50.0, float(f"{first * self.over(1.8, 10.0):.4g}"))
        ratio = self.over(0.01, 0.2)
        scene.raw["damping"] = {"rayleigh": {"frequencies": [first, second], "ratio": ratio}}
        scene.words.append(f"Rayleigh {100 * ratio:.2g} % at {first:.2g}, {second:.2g} Hz")

    def motion(self, scene: Scene) -> None:
        """One record along the row, across it, or both, scaled."""
        along = "x" if scene.raw["blocks"]["b"]["box"]["origin"][0] > 0.0 else "y"
        across = "y" if along == "x" else "x"
        name = self.pick(*_MOTIONS, weights=[40, 40, 12, 8])
        entry = dict(_MOTIONS[name])
        file, other = str(RECORDS / entry.pop("file")), str(RECORDS / _MOTIONS["mul279"]["file"])
        components: dict[str, Any] = {along: {"file": file}}
        if name == "mul009" and self.chance(0.4):
            components[across] = {"file": other}
        elif self.chance(0.15):
            components[across] = {"file": file}
        scale = {"mul009": (0.4, 2.5), "mul279": (0.4, 2.5), "pulse": (0.2, 0.8), "shaking": (0.3, 2.0)}[name]
        entry |= {"name": name, "components": components, "scale": self.over(*scale)}
        scene.raw["records"] = [entry]
        scene.words.append(f"{name} x{entry['scale']:g} {''.join(components)}")

    def model(self, scene: Scene) -> None:
        """Basis, steps and seconds."""
        raw, words = scene.raw, scene.words
        seconds = self.pick(4.0, 5.0, 6.0, 8.0)
        if raw["records"][0]["name"] in ("pulse", "shaking"):
            seconds = min(seconds, 4.0)
        kind = self.pick("step", "accuracy", "total", weights=[58, 34, 8])
        basis = self.pick("modes", "auto", "cutoff", weights=[60, 27, 13])
        if kind == "step":
            basis = "modes" if basis == "auto" else basis
            transient: dict[str, Any] = {"finest_step": self.pick(2.5e-3, 1.25e-3, 6.25e-4)}
        else:
            transient = {"accuracy": 0.01 if kind == "accuracy" else {"total": 0.05}}
        raw["transient"] = transient | {"duration": seconds}
        raw["model"] = {"modes": int(self.rng.integers(6, 41))} | {"residual_vectors": self.pick(0, 10, 20)}
        if basis == "auto" or kind == "total":
            raw["model"] = {"modes": "auto"}
        elif basis == "cutoff":
            raw["model"] = {"cutoff": self.between(30.0, 120.0), "residual_vectors": self.pick(0, 10)}
        words += [f"{kind} {transient.get('finest_step', transient.get('accuracy'))}", f"{raw['model']}"]

    def outputs(self, scene: Scene) -> None:
        """Motion of the tops; stress of a face and sections in some."""
        raw = scene.raw
        outputs: dict[str, Any] = {"output_interval": 0.01, "plots": False}
        outputs["nodes"] = {f"top_{name}": {"block": name, "at": at} for name, at in scene.tops.items()}
        if self.chance(0.4):
            box = raw["blocks"]["b"]["box"]
            face = "ymin" if box["origin"][0] > 0.0 else "xmin"
            middle = box["element_size"][2] * round(0.5 * box["size"][2] / box["element_size"][2])
            sections = {
                "foot": {"blocks": ["b"], "point": list(box["origin"])},
                "middle": {"blocks": ["b"], "point": [*box["origin"][:2], middle]},
            }
            ring = {"edges": scene.edge}
            outputs["stress"] = {"faces": [{"block": "b", "face": face}], "sections": sections, "ring": ring}
        raw["outputs"] = outputs


def _box(
    material: str, origin: list[float], size: list[float], elements: list[float], element: str
) -> dict[str, Any]:
    box = {"origin": origin, "size": size, "element_size": list(elements), "element": element}
    return {"material": material, "box": box}


def count_nodes(size: list[float], elements: list[float], element: str) -> float:
    """About how many nodes a box has."""
    a, b, c = (round(length / edge) for length, edge in zip(size, elements, strict=True))
    corners = (a + 1) * (b + 1) * (c + 1)
    if element in ("hex8", "tet4"):
        return float(corners)
    on_edges = a * (b + 1) * (c + 1) + (a + 1) * b * (c + 1) + (a + 1) * (b + 1) * c
    inside = a * b * c + a * b * (c + 1) + a * (b + 1) * c + (a + 1) * b * c
    return float(corners + on_edges + (inside if element == "tet10" else 0))
