"""What a step takes where a thousand gaps rub, every gap by itself and those that move alike as one.

    python tests/benchmarks/bench_many_gaps.py [--element 1.25] [--seconds 2]

Two blocks of 20 x 5 x 80 m and 20 x 10 x 80 m, mu 0.6, modes below 60 Hz, in the main job's record, finest
step 1.25 ms; elements of 1.25 m give 1,088 gaps. Prints CPU of the time loop per step that was tried.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from pathlib import Path

import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

from reference_run import CONFIG, march

from romdam.config import parse_config
from romdam.dynamics.system import System
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene


def reduced(element: float) -> System:
    """The two blocks."""
    raw = yaml.safe_load(CONFIG.read_text())
    size, raw["blocks"] = [element, 2.5, element], {}
    for name, y, depth in (("left", -5, 5), ("right", 0, 10)):
        box = {"origin": [0, y, 0], "size": [20, depth, 80], "element_size": size, "element": "hex8"}
        raw["blocks"][name] = {"material": "concrete", "box": box}
    raw["joints"]["contraction"] |= {"friction": 0.6, "shear_stiffness": 8e9}
    raw["loads"] = {"initial_state": "from_start"}
    raw["model"] = {"order": "reduced", "cutoff": "60 Hz"}
    del raw["outputs"]["nodes"]
    config = parse_config(raw, CONFIG.name)
    return reduce_scene(build_scene(config, CONFIG.parent, CONFIG.name), config.model, config.damping).system


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="CPU of a step with many gaps that rub.")
    parser.add_argument("--element", type=float, default=1.25, help="size along the joint [m]")
    parser.add_argument("--seconds", type=float, default=2.0, help="of the record")
    given = parser.parse_args()
    system = reduced(given.element)
    for alike in (False, True):
        options = {"alike": alike, "integrator": "adaptive", "cuts": (4,)}
        march(system, 0.005, duration=0.05, **options)
        history = march(system, 0.005, duration=given.seconds, **options)
        stats, closed = history.stats, (history.state > 0).mean(axis=1)
        tried = stats["steps"] + stats["refused_steps"]
        print(
            f"{len(system.law)} gaps, {stats['marched_gaps']:.0f} marched: "
            f"{1e3 * stats['loop_cpu_seconds'] / tried:.2f} ms for each of {tried:.0f} steps tried, "
            f"{100 * closed.mean():.0f} % closed on average, {100 * closed.max():.0f} % at most"
        )


if __name__ == "__main__":
    main()
