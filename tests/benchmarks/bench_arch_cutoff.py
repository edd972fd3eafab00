"""What does the reduction of the arch dam leave out, and what does it save?

    python tests/benchmarks/bench_arch_cutoff.py [--cutoffs 8 15 25 50 100] [--seconds 10] [--step 6.25e-4]
                                                 [--out results/bench_arch_cutoff.json]

configs/arch_dam.yaml on the coarse mesh of bench_arch_mesh.py in tet10 (8,122 unknowns, 70 friction gaps,
water, staged weight), reduced with modes below several frequencies, against its own full order
(generalised-alpha) at the same finest step. Times are CPU seconds of the time loop on one core; the full
order takes 180 s at the default step. Prints a Markdown table; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml
from bench_arch_mesh import CONFIG, MESHES

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.effects.full_order import assemble_full
from romdam.error.metrics import relative_l2
from romdam.fem.stress import observing_stress
from romdam.geometry.elements import Floats
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.simulate import simulate_one

EVERY = 0.01
COLUMNS = {
    "cutoff": "modes below [Hz]",
    "states": "vectors",
    "l2": "all openings, L2 [%]",
    "peak": "peak opening, worst joint [%]",
    "stress": "peak principal stress [%]",
    "cpu_reduction": "reduction [s CPU]",
    "cpu": "10 s of the record [s CPU]",
    "ratio": "full order / reduced",
}


@dataclass(frozen=True)
class Outcome:
    """Openings (nt, ng), joints' peaks, envelope of principal stress, CPU of the time loop."""

    opening: Floats
    peaks: Floats
    stress: Floats
    cpu: float


def coarse_job() -> Job:
    raw = yaml.safe_load(CONFIG.read_text())
    raw["arch_dam"]["divisions"] |= MESHES["coarse"]
    raw["arch_dam"]["element"] = "tet10"
    return Job(parse_config(raw, CONFIG.name), CONFIG)


def outcome(scene: Scene, system: System, history: History, fields: dict[str, object]) -> Outcome:
    history, stress = stress_of(scene, fields, history)  # type: ignore[arg-type]
    assert stress is not None
    opening = history.jump[..., 0]
    peaks = np.array([opening[:, own].max() for own in system.law.joints.values()])
    return Outcome(opening, peaks, stress.largest["principal"], history.stats["loop_cpu_seconds"])


def full_order(job: Job, scene: Scene, seconds: float, step: float) -> Outcome:
    motion = load_motions(job.config.records, job.folder)[0]
    system = observing_stress(scene, assemble_full(scene, job.config.damping))
    prepared = prepare(job, system, "generalized_alpha")
    steps = prepared.integrator.steps(step, motion.dt, EVERY)
    settings = replace(settings_for(job, prepared, motion), steps=steps)
    history = simulate_one(prepared, ground_at_steps(motion, step, seconds), settings)
    return outcome(scene, system, history, {})


def reduced(
    job: Job, scene: Scene, cutoff: float, seconds: float, step: float
) -> tuple[Outcome, dict[str, float]]:
    motion = load_motions(job.config.records, job.folder)[0]
    model = reduce_scene(scene, ModeChoice(cutoff=cutoff), job.config.damping)
    prepared = prepare(job, model.system)
    steps = prepared.integrator.steps(step, motion.dt, EVERY)
    settings = replace(settings_for(job, prepared, motion), steps=steps)
    simulate_one(
        prepared, ground_at_steps(motion, steps.base, 20 * steps.base), settings
    )  # compiled, not timed
    history = simulate_one(prepared, ground_at_steps(motion, steps.base, seconds), settings)
    found = outcome(scene, model.system, history, dict(stress_fields(scene, model)))
    cost = float(model.report["cpu_seconds"])  # type: ignore[arg-type]
    return found, {"cutoff": cutoff, "states": model.system.size, "cpu_reduction": cost}


def row(found: Outcome, whole: Outcome) -> dict[str, float]:
    """Errors in percent, and the ratio of times."""
    return {
        "l2": 100 * relative_l2(found.opening, whole.opening),
        "peak": 100 * float(np.abs(found.peaks / whole.peaks - 1).max()),
        "stress": 100 * float(abs(found.stress.max() / whole.stress.max() - 1)),
        "cpu": found.cpu,
        "ratio": whole.cpu / found.cpu,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cutoffs", nargs="+", type=float, default=[8.0, 15.0, 25.0, 50.0, 100.0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--step", type=float, default=6.25e-4)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    job = coarse_job()
    scene = build_scene(job.config, job.folder, str(job.path))
    whole = full_order(job, scene, asked.seconds, asked.step)
    rows = []
    print("| " + " | ".join(COLUMNS.values()) + " |\n" + "|---" * len(COLUMNS) + "|")
    for cutoff in asked.cutoffs:
        found, said = reduced(job, scene, cutoff, asked.seconds, asked.step)
        rows.append(said | row(found, whole))
        print("| " + " | ".join(f"{rows[-1][key]:.3g}" for key in COLUMNS) + " |", flush=True)
    if asked.out is not None:
        asked.out.parent.mkdir(parents=True, exist_ok=True)
        asked.out.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
