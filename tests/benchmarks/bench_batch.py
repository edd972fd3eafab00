"""Runs that march together against the same runs one by one, on one core, at 100, 400 and 1,500 gaps.

    python tests/benchmarks/bench_batch.py [--gaps 100 400 1500] [--runs 8] [--seconds 4] [--friction 0.6]

Two blocks of 10 and 20 m by 10 by 50 m with gaps at the nodes between them, modes below 60 Hz, FEMA P-695
components from their strongest second on, finest step 1.25 ms. No gap stands for another. Prints a Markdown
table: CPU seconds of the time loops (medians of repeats that take turns), and how far the openings are apart.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import math
from pathlib import Path
from statistics import median
from unittest.mock import patch

import numpy as np
import yaml
from numpy.typing import NDArray

from romdam.config import parse_config
from romdam.core.system import History, System
from romdam.pipelines.simulation import ground_at_steps
from romdam.records.record_set import load_motions
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.integrators.adaptive import Adaptive
from romdam.timestepping.modal import integrator
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate
from romdam.timestepping.steps import Steps

CONFIG = Path(__file__).parents[2] / "configs" / "suite_p695.yaml"
DIVISIONS = {100: (4, 20), 400: (9, 40), 1500: (19, 75)}  # of the joint's width and height
STEP, FINEST = 0.005, 0.00125


def reduced(gaps: int, friction: float) -> System:
    """Two blocks with so many gaps between them."""
    across, up = DIVISIONS[gaps]
    raw = yaml.safe_load(CONFIG.read_text())
    for block in raw["blocks"].values():
        block["box"]["element_size"] = [10.0 / across, 5.0, 50.0 / up]
    if friction:
        raw["joints"]["contraction"] |= {"friction": friction, "shear_stiffness": "8 GPa/m"}
    raw["model"] = {"order": "reduced", "cutoff": "60 Hz"}
    raw["loads"] = {"initial_state": "undeformed"}
    del raw["outputs"]["nodes"]
    config = parse_config(raw, CONFIG.name)
    return reduce_scene(build_scene(config, CONFIG.parent, CONFIG.name), config.model, config.damping).system


def grounds(count: int, seconds: float) -> list[NDArray[np.float64]]:
    """Ground motions at the base step, from a second before their peak on."""
    records = parse_config(yaml.safe_load(CONFIG.read_text()), CONFIG.name).records[:1]
    found = []
    for motion in load_motions(records, CONFIG.parent)[:count]:
        acc = ground_at_steps(motion, STEP, None)
        first = max(0, int(np.abs(acc[1]).argmax()) - round(1.0 / STEP))
        found.append(acc[:, first : first + round(seconds / STEP) + 1])
    return found


def march(prepared: Prepared, grounds: list[NDArray[np.float64]]) -> tuple[float, list[History]]:
    """CPU seconds of the loops, and the histories."""
    settings = Settings(Steps(STEP, 4, (round(STEP / FINEST),)), initial_state="undeformed")
    with patch.object(integrator, "_CACHE_BYTES", math.inf):
        found = simulate(prepared, grounds, settings)
    histories = [one for one in found if isinstance(one, History)]
    return sum(one.stats["loop_cpu_seconds"] for one in histories), histories


def compare(gaps: int, given: argparse.Namespace) -> str:
    """One line of the table."""
    system = reduced(gaps, given.friction)
    prepared, motions = Prepared(system, Adaptive(merge_contacts=False)), grounds(given.runs, given.seconds)
    march(prepared, [motions[0][:, :20]])  # compiled, not timed
    one_by_one, together, apart = [], [], 0.0
    for _ in range(given.repeats):
        alone = [march(prepared, [ground]) for ground in motions]
        cpu, histories = march(prepared, motions)
        one_by_one.append(sum(cpu for cpu, _ in alone))
        together.append(cpu)
        apart = max(np.abs(a.jump - b[1][0].jump).max() for a, b in zip(histories, alone, strict=True))
    a, b = median(one_by_one), median(together)
    return f"| {len(system.law):,} | {system.size:,} | {a:.2f} s | {b:.2f} s | {a / b:.2f} | {apart:.0e} m |"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Runs together against one by one.")
    parser.add_argument("--gaps", type=int, nargs="+", choices=DIVISIONS, default=list(DIVISIONS))
    parser.add_argument("--runs", type=int, default=8, help="that march together")
    parser.add_argument("--seconds", type=float, default=4.0, help="of each record")
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    print("| gaps | modes | one by one | together | throughput | openings apart |")
    print("|---" * 6 + "|")
    for gaps in given.gaps:
        print(compare(gaps, given), flush=True)


if __name__ == "__main__":
    main()
