"""Are the numbers still the same, and as quick? Before and after a change that must not alter any.

    python tests/benchmarks/bits.py before.npz
    python tests/benchmarks/bits.py after.npz --against before.npz

The main job with every joint law, the hard pack, and the arch dam of 8,122 unknowns at the whole and a tenth
of its shaking: openings, forces, states and energies, written to a file or compared with one, and CPU of the
time loops. 15 CPU seconds once everything is compiled.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))
sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))

from bench_arch_cutoff import coarse_job
from numpy.typing import NDArray
from reference_run import job, march
from test_hard_configs import LONG, SOUND
from test_hard_configs import march as march_hard

from romdam.core.system import History
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.simulate import simulate_one

ROUGH = {"shear_stiffness": 8e9}
JOINTS: dict[str, dict[str, object]] = {
    "penalty": {},
    "rigid": {"normal_stiffness": "rigid"},
    "tension": {"tension_stiffness": 1.6e8},
    "friction": {"friction": 0.6, **ROUGH},
    "per direction": {"friction": (0.6, 0.4), **ROUGH},
    "bond": {"friction": 0.6, **ROUGH, "tensile_strength": 3e5, "cohesion": 5e5},
    "static friction": {"friction": 0.4, **ROUGH, "friction_static": 0.7},
    "shear key": {"friction": 0.3, **ROUGH, "shear_key": {"depth": 0.02, "directions": ("j",)}},
    "dashpot": {"friction": 0.3, **ROUGH, "viscosity": 1e7},
}
ENERGIES = ("input", "damping", "friction", "contact")


def histories() -> Iterator[tuple[str, History]]:
    """Every case and its history."""
    for name, joint in JOINTS.items():
        one = job.__wrapped__(**joint)
        system = reduce_scene(one.scene, one.config.model, one.config.damping).system
        yield name, march(system, 0.005, 8.0, integrator="adaptive", cuts=(4,))
        if name in ("penalty", "friction"):
            yield f"{name}, modal", march(system, 0.005, 8.0, integrator="modal")
    for name in sorted(set(SOUND) - LONG):
        yield f"hard: {name}", march_hard(name)[1]
    yield from _arch_dam()


def _arch_dam() -> Iterator[tuple[str, History]]:
    one = coarse_job()
    scene = build_scene(one.config, one.folder, str(one.path))
    motion = load_motions(one.config.records, one.folder)[0]
    system = reduce_scene(scene, ModeChoice(cutoff=25.0), one.config.damping).system
    prepared = prepare(one, system)
    steps = prepared.integrator.steps(1.25e-3, motion.dt, 0.01)
    settings = replace(settings_for(one, prepared, motion), steps=steps)
    for scale in (1.0, 0.1):
        ground = scale * ground_at_steps(motion, steps.base, 10.0)
        yield f"arch dam, {scale:g}", simulate_one(prepared, ground, settings)


def numbers(history: History) -> dict[str, np.ndarray]:
    """What is compared."""
    energy = np.array([history.energy[name] for name in ENERGIES])
    return {
        "opening": history.jump,
        "force": history.traction,
        "displacement": history.disp,
        "state": history.state.astype(float),
        "energy": energy,
    }


def differences(found: dict[str, np.ndarray], before: dict[str, np.ndarray]) -> str:
    """Largest difference of every kind, relative to the largest value; empty where the bits are the same."""
    told = []
    for kind, values in found.items():
        change = float(np.abs(values - before[kind]).max(initial=0.0))
        if change > 0.0:
            told.append(f"{kind} {change / max(float(np.abs(before[kind]).max()), 1e-300):.1e}")
    return ", ".join(told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--against", type=Path)
    asked = parser.parse_args()
    before = dict(np.load(asked.against)) if asked.against else {}
    kept: dict[str, NDArray[Any]] = {}
    for name, history in histories():
        found = numbers(history) | {"cpu": np.array(history.stats["loop_cpu_seconds"])}
        kept |= {f"{name}/{kind}": values for kind, values in found.items()}
        line = f"{name:32} {found.pop('cpu'):7.3f} s"
        if before:
            other = {kind: before[f"{name}/{kind}"] for kind in found}
            ratio = kept[f"{name}/cpu"] / before[f"{name}/cpu"]
            line += f", {ratio:5.2f} times; {differences(found, other) or 'the same bits'}"
        print(line, flush=True)
    np.savez(asked.out, **kept)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
