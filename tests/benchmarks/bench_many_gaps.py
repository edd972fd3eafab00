"""What a step takes where a thousand gaps rub, every gap by itself and those that move alike as one.

    python tests/benchmarks/bench_many_gaps.py [--element 1.25] [--seconds 2] [--batch 40]
    python tests/benchmarks/bench_many_gaps.py [--element 1.25] [--cutoff 60] --spacing 10 5 2.5

Two blocks of 20 x 5 x 80 m and 20 x 10 x 80 m, mu 0.6, modes below 60 Hz, in the main job's record, finest
step 1.25 ms; elements of 1.25 m give 1,088 gaps. Prints CPU of the time loop per step that was tried; with
--batch that of so many FEMA P-695 components, from a second before their peak on, as a suite marches them;
with --spacing that of gaps as far apart, and how far their openings are from those of all gaps.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from bench_batch import grounds

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

from reference_run import CONFIG, march

from romdam.config import parse_config
from romdam.contact.components import NORMAL
from romdam.core.arrays import Floats
from romdam.core.system import History, System
from romdam.error.alignment import coinciding
from romdam.error.metrics import relative_l2
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.integrators.adaptive import Adaptive
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate
from romdam.timestepping.steps import Steps


def reduced(element: float, cutoff: float = 60.0, spacing: float | None = None) -> tuple[System, Floats]:
    """The two blocks, and where their gaps are (n, 3) [m]."""
    raw = yaml.safe_load(CONFIG.read_text())
    size, raw["blocks"] = [element, 2.5, element], {}
    for name, y, depth in (("left", -5, 5), ("right", 0, 10)):
        box = {"origin": [0, y, 0], "size": [20, depth, 80], "element_size": size, "element": "hex8"}
        raw["blocks"][name] = {"material": "concrete", "box": box}
    raw["joints"]["contraction"] |= {"friction": 0.6, "shear_stiffness": 8e9}
    raw["loads"] = {"initial_state": "undeformed"}
    raw["model"] = {"order": "reduced", "cutoff": f"{cutoff} Hz"}
    raw["joints"]["contraction"] |= {} if spacing is None else {"spacing": spacing}
    del raw["outputs"]["nodes"]
    config = parse_config(raw, CONFIG.name)
    scene = build_scene(config, CONFIG.parent, CONFIG.name)
    return reduce_scene(scene, config.model, config.damping).system, scene.gap_position


def compare_spacings(element: float, seconds: float, cutoff: float, spacings: Sequence[float]) -> None:
    """Print cost and openings of gaps as far apart as the spacings, beside those of all gaps."""
    options: dict[str, Any] = {"integrator": "adaptive", "cuts": (4,)}
    histories: list[tuple[History, Floats]] = []
    for spacing in (None, *spacings):
        start = time.process_time()
        system, position = reduced(element, cutoff, spacing)
        reduction = time.process_time() - start
        march(system, 0.005, duration=0.05, **options)
        start = time.process_time()
        histories.append((march(system, 0.005, duration=seconds, **options), position))
        cpu = time.process_time() - start
        (every, wanted), (some, found) = histories[0], histories[-1]
        here, there = coinciding(found, wanted)
        error = relative_l2(some.jump[:, here, NORMAL], every.jump[:, there, NORMAL])
        print(
            f"spacing {spacing}: {len(position)} gaps, reduction {reduction:.1f} CPU-s, "
            f"record {cpu:.2f} CPU-s, openings {100 * error:.2f} % in L2 at {len(here)} gaps",
            flush=True,
        )


def batch(system: System, count: int, seconds: float, merge: bool) -> list[History]:
    """The histories of so many records."""
    settings = Settings(Steps(0.005, 4, (4,)), initial_state="undeformed")
    prepared = Prepared(system, Adaptive(merge_contacts=merge))
    found = simulate(prepared, grounds(count, seconds), settings)
    return [history for history in found if isinstance(history, History)]


def told(histories: Sequence[History]) -> str:
    """CPU of the time loops per step that was tried, and how many gaps were closed."""
    stats = [history.stats for history in histories]
    tried = sum(one["steps"] + one["refused_steps"] for one in stats)
    cpu, closed = (
        sum(one["loop_cpu_seconds"] for one in stats),
        [(h.state > 0).mean(axis=1) for h in histories],
    )
    return (
        f"{1e3 * cpu / tried:.2f} ms for each of {tried:.0f} steps tried, "
        f"{100 * sum(c.mean() for c in closed) / len(closed):.0f} % closed on average, "
        f"{100 * max(c.max() for c in closed):.0f} % at most"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="CPU of a step with many gaps that rub.")
    parser.add_argument("--element", type=float, default=1.25, help="size along the joint [m]")
    parser.add_argument("--seconds", type=float, default=2.0, help="of the record")
    parser.add_argument("--batch", type=int, default=0, help="records of a suite")
    parser.add_argument("--spacing", type=float, nargs="*", help="distances of gaps [m]")
    parser.add_argument("--cutoff", type=float, default=60.0, help="modes below [Hz]")
    given = parser.parse_args()
    if given.spacing:
        compare_spacings(given.element, given.seconds, given.cutoff, given.spacing)
        return
    system, _ = reduced(given.element, given.cutoff)
    for merge in (False, True):
        options = {"merge_contacts": merge, "integrator": "adaptive", "cuts": (4,)}
        march(system, 0.005, duration=0.05, **options)
        history = march(system, 0.005, duration=given.seconds, **options)
        marched = f"{len(system.law)} gaps, {history.stats['integrated_gaps']:.0f} integrated"
        print(f"{marched}: {told([history])}", flush=True)
        if given.batch:
            histories = batch(system, given.batch, given.seconds, merge)
            print(f"  {given.batch} records: {told(histories)}", flush=True)


if __name__ == "__main__":
    main()
