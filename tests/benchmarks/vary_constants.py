"""How much the results depend on the tuning constants: each is varied alone, the others stay as they are.

    python tests/benchmarks/vary_constants.py [--only NAME ...] [--out results/vary_constants.json]

For what sets the step or the scheme: L2 error of all openings of the first 10 s against the same reduced
model at a finest step of 0.039 ms, and that of the largest compression, rms of two Northridge records, with
penalty, ten times softer, a hundred times stiffer and rough joints. For what only chooses how the gap-space
problem is solved: how far openings move, over the largest. CPU is that of the time loop, and noisy on a
shared machine; steps and sweeps are not. Constants of compiled functions are compiled in: each value takes a
process and a cache of its own, and a minute. The manual quotes this (`docs/extending/constants.md`).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

from bench_arch_cutoff import coarse_job
from reference_run import ROOT, job

from romdam.core.system import History, System
from romdam.pipelines.simulation import ground_at_steps
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.integrators.adaptive import Adaptive
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import Steps, cut_steps

FINEST, LIMIT, EVERY, SECONDS = 1.25e-3, 3.90625e-5, 0.01, 10.0
JOINTS: dict[str, dict[str, object]] = {
    "penalty": {},
    "soft": {"normal_stiffness": 1.6e9},
    "stiff": {"normal_stiffness": 1.6e12},
    "friction": {"friction": 0.6, "shear_stiffness": 8e9},
}
GAUSS_SEIDEL = "romdam.contact.solvers.gauss_seidel"
CONDENSATION = "romdam.contact.solvers.condensation"
VARIED: dict[str, tuple[object, ...]] = {
    "force_change": (0.001, 0.003, 0.01, 0.03),
    "cuts": ((2, 2, 2), (4, 2), (8,)),
    "tolerance": (1e-6, 1e-8, 1e-10),
    "romdam.contact.problem:_HALF_WAY": (20.0, 40.0, 70.0, 150.0, 1e9),
    "romdam.timestepping.modal.loop:_CALM": (0, 2, 4),
    f"{GAUSS_SEIDEL}:_GAIN": (0.1, 0.6),
    f"{GAUSS_SEIDEL}:_SINGLE": (1e-5, 1e-3),
    f"{GAUSS_SEIDEL}:_IDLE": (0.05, 1.0),
    f"{GAUSS_SEIDEL}:_FEW": (0.0, 1.0),
    f"{GAUSS_SEIDEL}:_TIGHTER": (0.01, 1.0),
    f"{CONDENSATION}:_WORTH": (4, 16),
}
COMPILED = ("loop", "gauss_seidel", "condensation")


@cache
def system(joints: str) -> System:
    """The reduced two cantilevers, or the arch dam of 8,122 unknowns."""
    if joints == "arch dam":
        dam = coarse_job()
        scene = build_scene(dam.config, dam.folder, str(dam.path))
        return reduce_scene(scene, ModeChoice(cutoff=25.0), dam.config.damping).system
    one = job.__wrapped__(**JOINTS[joints])
    return reduce_scene(one.scene, one.config.model, one.config.damping).system


@cache
def ground(record: str, dt: float, scale: float = 1.0) -> np.ndarray:
    """Base acceleration of a record along y, or the arch dam's."""
    if record == "arch dam":
        one = coarse_job()
        motion = load_motions(one.config.records, one.folder)[0]
        return scale * ground_at_steps(motion, dt, SECONDS)
    acc = 9.81 * np.loadtxt(ROOT / "data" / "records" / record)
    time = np.arange(round(SECONDS / dt) + 1) * dt
    results = np.zeros((3, len(time)))
    results[1] = np.interp(time, 0.01 * np.arange(len(acc)), acc)
    return results


RECORDS = ("northridge_mul009_g_dt0.01.txt", "northridge_mul279_g_dt0.01.txt")


def one_run(joints: str, record: str, finest: float, **changes: object) -> History:
    """One run with rows every 0.01 s."""
    steps, is_dam = cut_steps(finest, 0.01, EVERY), joints == "arch dam"
    if "cuts" in changes:
        cuts: Any = changes.pop("cuts")
        steps = Steps(base := finest * float(np.prod(cuts)), round(EVERY / base), cuts)
    tolerance: Any = changes.pop("tolerance", 1e-8)
    options: Any = changes
    settings = Settings(steps, tolerance, "static" if is_dam else "undeformed")
    motion = ground(record, steps.base, 0.1 if is_dam else 1.0)
    return simulate_one(Prepared(system(joints), Adaptive(**options)), motion, settings)


def scheme(changes: Mapping[str, object], limits: Mapping[str, History]) -> dict[str, dict[str, float]]:
    """Errors [%], steps and CPU seconds for every kind of joint."""
    results = {}
    for joints in JOINTS:
        errors: list[tuple[float, float]] = []
        steps, cpu = 0, 0.0
        for record in RECORDS:
            history, limit = one_run(joints, record, FINEST, **changes), limits[f"{joints}/{record}"]
            opening, wanted = history.jump[..., 0], limit.jump[..., 0]
            largest = [float(one.peaks["compression"].max()) for one in (history, limit)]
            errors.append(
                (
                    float(np.linalg.norm(opening - wanted) / np.linalg.norm(wanted)),
                    largest[0] / largest[1] - 1.0,
                )
            )
            steps += int(history.stats["steps"])
            cpu += history.stats["loop_cpu_seconds"]
        opening, force = 100.0 * np.sqrt(np.mean(np.square(errors), axis=0))
        results[joints] = {"opening": float(opening), "compression": float(force), "steps": steps, "cpu": cpu}
    return results


def solver(before: Path | None) -> dict[str, dict[str, float]]:
    """Move of the openings against a file, or write it; counts and CPU."""
    results, kept = {}, {}
    old = None if before is None or not before.exists() else np.load(before)
    for name, joints, record in (("friction", "friction", RECORDS[0]), ("arch dam", "arch dam", "arch dam")):
        one_run(joints, record, 0.01)  # compiled, not timed
        history = one_run(joints, record, FINEST)
        kept[name] = history.jump
        counts = {key: float(value) for key, value in history.stats.items()}
        moved = 0.0 if old is None else np.abs(history.jump - old[name]).max() / np.abs(old[name]).max()
        results[name] = counts | {"moved": float(moved)}
    if before is not None and old is None:
        np.savez(before, allow_pickle=False, **kept)
    return results


def child(name: str, value: object, before: Path) -> dict[str, dict[str, float]]:
    """The same in a process and a cache of its own."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, "--child", name, json.dumps(value), str(before)]
        done = subprocess.run(
            command, env={**os.environ, "NUMBA_CACHE_DIR": folder}, capture_output=True, text=True, check=True
        )
    return json.loads(done.stdout.splitlines()[-1])


def set_constant(name: str, value: object) -> object:
    """Set a module's constant; its value before."""
    module, constant = name.split(":")
    before = getattr(import_module(module), constant)
    setattr(import_module(module), constant, value)
    return before


def main() -> None:
    """Vary all, or those asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="+", default=list(VARIED))
    parser.add_argument("--out", type=Path, default=Path("results/vary_constants.json"))
    parser.add_argument("--child", nargs=3)
    asked = parser.parse_args()
    if asked.child:
        name, value, before = asked.child
        if name != "none":
            set_constant(name, json.loads(value))
        print(json.dumps(solver(Path(before))))
        return
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    results = json.loads(asked.out.read_text()) if asked.out.exists() else {}
    limits = {}
    if any(name.split(":")[0].split(".")[-1] not in COMPILED for name in asked.only):
        limits = {f"{j}/{r}": one_run(j, r, LIMIT) for j in JOINTS for r in RECORDS}
    before = asked.out.with_suffix(".npz")
    for name in asked.only:
        compiled = name.split(":")[0].split(".")[-1] in COMPILED
        if compiled and "none" not in results:
            results["none"] = child("none", 0, before)
            print("none", results["none"], flush=True)
        for value in VARIED[name]:
            if compiled:
                one: object = child(name, value, before)
            elif ":" in name:
                old = set_constant(name, value)
                system.cache_clear()
                one = scheme({}, limits)
                set_constant(name, old)
            else:
                one = scheme({name: value}, limits)
            results[f"{name}={value}"] = one
            print(name, value, one, flush=True)
            asked.out.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
