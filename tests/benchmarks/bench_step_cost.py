"""Does the march become dearer on a finer mesh? The same dam, gaps, cut-off and record, 8 times the unknowns.

    python tests/benchmarks/bench_step_cost.py [--seconds 5] [--repeats 3]

configs/arch_dam.yaml on a coarse mesh and on one of half the size in every direction. Gaps stand where the
coarse mesh has its corners, with their areas and stiffness, so that both marches have the same contact to
solve. Prints a Markdown table: CPU time of a step (median of repeats that take turns) and what it depends on.
Takes two minutes.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.scene import Joint, Scene
from romdam.pipelines.simulation import prepare, simulate_motion
from romdam.records.record_set import load_motions
from romdam.reduction.synthesis import ReducedModel, reduce_scene
from romdam.scene.build import build_scene

CONFIG = Path(__file__).parents[2] / "configs" / "arch_dam.yaml"
COARSE = {"along": 1, "through": 1, "up": 4, "perimeter": 1, "rock": 2, "upstream": 2, "downstream": 2}
GROWTH = 2.0


def built(factor: int) -> tuple[Job, Scene]:
    """The dam with `factor` times as many elements along every direction."""
    raw = yaml.safe_load(CONFIG.read_text())
    raw["arch_dam"]["divisions"] = {key: factor * n for key, n in COARSE.items()} | {
        "growth": GROWTH ** (1.0 / factor)
    }
    raw["arch_dam"]["element"] = "tet10"
    del raw["outputs"]["stress"]
    job = Job(parse_config(raw, CONFIG.name), CONFIG)
    return job, build_scene(job.config, job.folder, CONFIG.name)


def with_gaps_of(fine: Joint, coarse: Joint) -> Joint:
    """The fine mesh's joint with the coarse one's gaps alone."""
    apart = np.linalg.norm(fine.position[None] - coarse.position[:, None], axis=2)
    same = apart.argmin(axis=1)
    if apart.min(axis=1).max() > 1e-6:
        raise SystemExit(f"{fine.name}: the meshes' gaps are up to {apart.min(axis=1).max():g} m apart")
    return replace(coarse, nodes=fine.nodes, weights=tuple(side[same] for side in fine.weights))


def table(models: dict[str, tuple[Scene, ReducedModel]], seconds: dict[str, list[float]], steps: int) -> str:
    lines = ["| mesh | unknowns | gaps | modes | states | CPU of a step [ms] |", "|---" * 6 + "|"]
    for name, (scene, model) in models.items():
        points = 3 * sum(len(block.points) for block in scene.blocks.values())
        modes = model.basis["C1"].report["fixed_interface_modes"]
        step = 1e3 * float(np.median(seconds[name])) / steps
        gaps = sum(len(joint.area) for joint in scene.joints.values())
        lines.append(f"| {name} | {points:,} | {gaps} | {modes} | {model.system.size} | {step:.3f} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--repeats", type=int, default=3)
    asked = parser.parse_args()
    job, coarse = built(1)
    _, fine = built(2)
    joints = {name: with_gaps_of(joint, coarse.joints[name]) for name, joint in fine.joints.items()}
    models = {
        name: (scene, reduce_scene(scene, job.config.model, job.config.damping))
        for name, scene in (("coarse", coarse), ("fine", replace(fine, joints=joints)))
    }
    motion = load_motions(job.config.records, job.folder)[0]
    prepared = {name: prepare(job, model.system) for name, (_, model) in models.items()}
    for one in prepared.values():  # compiles, and warms up
        simulate_motion(job, one, motion, 0.1)
    seconds: dict[str, list[float]] = {name: [] for name in models}
    for _ in range(asked.repeats):
        for name, one in prepared.items():
            start = time.process_time()
            simulate_motion(job, one, motion, asked.seconds)
            seconds[name].append(time.process_time() - start)
    dt = job.config.transient.finest_step
    assert dt is not None
    print(table(models, seconds, round(asked.seconds / dt)))
    ratio = np.median(seconds["fine"]) / np.median(seconds["coarse"])
    print(f"\nA step on the fine mesh takes {ratio:.2f} times as long.")


if __name__ == "__main__":
    main()
