"""Holding gaps that have long been stuck: CPU of the march with it and without, and how openings part.

    python tests/benchmarks/bench_held_gaps.py [--scales 0.1 0.3 1] [--seconds 10] [--repeats 3] [--cache DIR]

configs/arch_dam.yaml (189 friction gaps, step 2.5 ms) at shares of its shaking; below the whole without the
temperature drop, which opens the joints. Both are timed in turn, medians of CPU seconds of the time loop on
one core. Nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from statistics import median
from unittest.mock import patch

import yaml

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.system import History
from romdam.error.metrics import largest_difference
from romdam.pipelines.shaking import ground_at_steps, transient_options
from romdam.records.record_set import load_motions
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.modal import runs
from romdam.timestepping.simulate import integrate

CONFIG = Path(__file__).parents[2] / "configs" / "arch_dam.yaml"
NEVER = -(10**9)  # solutions for which a gap has been stuck


def scaled(scale: float) -> Job:
    """The arch dam at a share of its shaking."""
    raw = yaml.safe_load(CONFIG.read_text())
    raw["records"][0]["scale"] = scale
    if scale < 1.0:
        del raw["loads"]["temperature"]
    return Job(parse_config(raw, CONFIG.name), CONFIG)


def never_holding(*arguments: object) -> object:
    """Memory of runs in which no gap ever counts as long stuck."""
    memory = run_memory(*arguments)  # type: ignore[arg-type]
    memory.order[:, :, 1] = NEVER
    return memory


run_memory = runs.run_memory


def compare(scale: float, seconds: float, repeats: int, cache: Path) -> str:
    """One line of the report."""
    job = scaled(scale)
    scene = build_scene(job.config, job.folder, CONFIG.name)
    system = reduce_scene(scene, job.config.model, job.config.damping, BlockStore(cache)).system
    motion = load_motions(job.config.records, job.folder)[0]
    options = transient_options(job, system, motion)
    ground = ground_at_steps(motion, options.dt, seconds)
    integrate(system, ground[:, :20], replace(options, stride=1))  # compiled, not timed

    def once(hold: bool) -> History:
        with patch.object(runs, "run_memory", run_memory if hold else never_holding):
            return integrate(system, ground, options)

    found = [(once(True), once(False)) for _ in range(repeats)]
    cpu = [median(pair[k].stats["loop_cpu_seconds"] for pair in found) for k in (0, 1)]
    held, free = found[-1]
    apart = largest_difference(held.jump, free.jump)
    return (
        f"{scale:g} of the shaking: {held.stats['held_gaps']:.0f} gaps held on average, CPU {cpu[0]:.2f} s "
        f"against {cpu[1]:.2f} s ({cpu[0] / cpu[1]:.2f}), openings apart by {apart:.0e} of the largest"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="March with and without holding stuck gaps.")
    parser.add_argument("--scales", type=float, nargs="+", default=[0.1, 0.3, 1.0], help="of the shaking")
    parser.add_argument("--seconds", type=float, default=10.0, help="of the record")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each")
    parser.add_argument("--cache", type=Path, help="folder of reduced blocks")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        for scale in given.scales:
            print(compare(scale, given.seconds, given.repeats, given.cache or Path(scratch)), flush=True)


if __name__ == "__main__":
    main()
