"""A dam in a valley, shaken by a free field: how large a box of rock has to be.

    python tests/benchmarks/bench_valley.py

A valley 40 m wide and deep runs through the box, which reaches by a margin to its sides and below its floor;
two blocks and their joint fill 40 m of it. The record is low-passed at 8 Hz, elements of rock are 20 m.
"""

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

sys.path.append(str(Path(__file__).parents[1]))
from simulating import simulated

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.scene import Scene
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

RECORD = Path(__file__).parents[2] / "data" / "records" / "northridge_mul009_g_dt0.01.txt"
MARGINS, DT = (60.0, 120.0, 200.0), 0.01
DAMPING = DampingConfig(rayleigh=RayleighConfig(frequencies=(2.0, 15.0), ratio=0.05))


def _box(origin: list[float], size: list[float], element: float, material: str) -> dict[str, Any]:
    return {"material": material, "box": {"origin": origin, "size": size, "element_size": element}}


def valley(margin: float, kind: str) -> Scene:
    """The scene with rock of a margin around it, under a kind of input."""
    m, blocks = margin, {}
    blocks["floor"] = _box([-20 - m, -m, -40 - m], [40 + 2 * m, 2 * m, m], 20.0, "rock")
    for name, x in (("left", -20 - m), ("right", 20.0)):
        blocks[name] = _box([x, -m, -40], [m, 2 * m, 40], 20.0, "rock")
    for name, x in (("a", -20.0), ("b", 0.0)):
        blocks[name] = _box([x, -20, -40], [20, 40, 40], 10.0, "concrete")
    ties = [("floor", name) for name in ("left", "right", "a", "b")] + [("left", "a"), ("right", "b")]
    faces = {"floor": ["zmin", "xmin", "xmax"], "left": ["xmin"], "right": ["xmax"]}
    raw = {
        "materials": {
            "rock": {"E": 15e9, "nu": 0.25, "rho": 2600.0},
            "concrete": {"E": 28e9, "nu": 0.2, "rho": 2400.0},
        },
        "blocks": blocks,
        "ties": {f"t{k}": {"between": pair} for k, pair in enumerate(ties)},
        "joints": {"joint": {"between": ["a", "b"], "normal_stiffness": 20e9}},
        "ground": {
            "input": kind,
            "viscous": [{"block": name, "faces": [*own, "ymin", "ymax"]} for name, own in faces.items()],
        },
        "outputs": {"nodes": {"crest": {"block": "a", "at": [0, -20, 0]}}},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": DT, "components": {"y": 1}}],
        "model": {"modes": 80},
        "transient": {"finest_step": DT},
    }
    return build_scene(parse_config(raw, "valley.yaml"), Path(), "valley.yaml")


def main() -> None:
    """Print unknowns, largest opening and displacement of the crest for each margin, and CPU seconds."""
    record = np.loadtxt(RECORD).ravel() * 9.81
    acc = np.stack([0.6 * record[::-1], record, 0.5 * record])[:, :900]
    acc = sosfiltfilt(butter(4, 8.0, fs=1.0 / DT, output="sos"), acc)
    for kind in ("uniform", "free_field"):
        for margin in MARGINS:
            start = time.process_time()
            system = reduce_scene(valley(margin, kind), ModeChoice(count=80), DAMPING).system
            run = simulated(system, acc, DT, integrator="generalized_alpha", initial_state="undeformed")
            crest = 1e3 * np.abs(run.disp).max(axis=0)
            print(
                f"{kind:10} {margin:4g} m  {system.size} unknowns  opening {1e3 * run.jump.max():.3f} mm  "
                f"crest {crest.round(3)} mm  {time.process_time() - start:.1f} s"
            )


if __name__ == "__main__":
    main()
