"""Condensation of sticking contacts: CPU of the time loop with it and without, and how openings part.

    python tests/benchmarks/bench_condensation.py [--scales 0.1 0.3 1] [--seconds 10] [--repeats 3]

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
from typing import Any
from unittest.mock import patch

import yaml

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.contact.solvers.state import FrictionalState, SolverState
from romdam.core.system import History
from romdam.error.metrics import largest_difference
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.records.record_set import load_motions
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.modal import runs
from romdam.timestepping.simulate import simulate_one

CONFIG = Path(__file__).parents[2] / "configs" / "arch_dam.yaml"
MESH = {"along": 2, "through": 2, "up": 8, "rock": 6, "upstream": 4, "downstream": 4, "growth": 1.5}
NEVER = 10**9  # solutions for which a contact has to stick


def scaled(scale: float) -> Job:
    """The arch dam at a share of its shaking."""
    raw = yaml.safe_load(CONFIG.read_text())
    raw["arch_dam"]["divisions"] |= MESH
    raw["arch_dam"]["element"] = "tet10"
    raw["records"][0]["scale"] = scale
    if scale < 1.0:
        del raw["loads"]["temperature"]
    return Job(parse_config(raw, CONFIG.name), CONFIG)


def never_condensing(*arguments: Any) -> SolverState:
    """Solver state of runs in which no contact ever counts as long stuck."""
    solver = solver_state(*arguments)
    assert isinstance(solver, FrictionalState)
    solver.sticking.wait[:] = NEVER
    return solver


solver_state = runs.solver_state


def compare(scale: float, seconds: float, repeats: int, cache: Path) -> str:
    """One line of the report."""
    job = scaled(scale)
    scene = build_scene(job.config, job.folder, CONFIG.name)
    system = reduce_scene(scene, job.config.model, job.config.damping, BlockStore(cache)).system
    motion = load_motions(job.config.records, job.folder)[0]
    prepared = prepare(job, system)
    settings = settings_for(job, prepared, motion)
    ground = ground_at_steps(motion, settings.steps.base, seconds)
    every = replace(settings, steps=replace(settings.steps, stride=1))
    simulate_one(prepared, ground[:, :20], every)  # compiled, not timed

    def once(condense: bool) -> History:
        with patch.object(runs, "solver_state", solver_state if condense else never_condensing):
            return simulate_one(prepared, ground, settings)

    found = [(once(True), once(False)) for _ in range(repeats)]
    cpu = [median(pair[k].stats["loop_cpu_seconds"] for pair in found) for k in (0, 1)]
    condensed, free = found[-1]
    apart = largest_difference(condensed.jump, free.jump)
    return (
        f"{scale:g} of the shaking: {condensed.stats['condensed_contacts']:.0f} contacts condensed, "
        f"CPU {cpu[0]:.2f} s against {cpu[1]:.2f} s ({cpu[0] / cpu[1]:.2f}), "
        f"openings apart by {apart:.0e} of the largest"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Integrate with and without condensation.")
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
