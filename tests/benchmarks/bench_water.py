"""Pine Flat and Koyna with the three models of water: first period and peak response.

    python tests/benchmarks/bench_water.py [--out results/bench_water.json]

Slices of the tallest monoliths in plane stress on a rigid base, 6 x 16 hex20, reservoirs full to 381 of
400 ft and 96.5 of 103 m. First period: that of the largest crest response, 1 % hysteretic damping of the
concrete. Crest: largest displacement and acceleration over 15 s of the record of configs/two_cantilevers.yaml
along the river, 60 modes, generalised-alpha at 2.5 ms, Rayleigh damping of 5 % at 3 and 15 Hz. CPU: of
reduction and run.
Prints a Markdown table and writes JSON; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from gravity_sections import FOOT, KOYNA, PINE_FLAT, Section, section_scene
from simulating import simulated

from romdam.benchmarks.frequency_response import first_period
from romdam.effects.full_order import assemble_full
from romdam.reduction.synthesis import reduce_scene

RECORD = Path(__file__).parents[2] / "data" / "records" / "northridge_mul009_g_dt0.01.txt"
DAMS = {"Pine Flat": (PINE_FLAT, 381 * FOOT), "Koyna": (KOYNA, 96.5)}
WATER: dict[str, dict[str, Any] | None] = {
    "none": None,
    "Westergaard": {"model": "westergaard"},
    "incompressible": {"model": "incompressible"},
    "compressible, rigid bottom": {"model": "compressible"},
    "compressible, 0.9": {"model": "compressible", "bottom_reflection": 0.9},
    "compressible, 0.5": {"model": "compressible", "bottom_reflection": 0.5},
}
STEP, SECONDS = 0.0025, 15.0
DAMPING = {"rayleigh": {"frequencies": [3.0, 15.0], "ratio": 0.05}}


def ground() -> np.ndarray:
    """The record along y at every step, (3, nt) [m/s2]."""
    acc = 9.81 * np.loadtxt(RECORD).ravel()
    t = np.arange(0.0, SECONDS, STEP)
    motion = np.zeros((3, len(t)))
    motion[1] = np.interp(t, 0.01 * np.arange(len(acc)), acc)
    return motion


def case(section: Section, level: float, water: dict[str, Any] | None) -> dict[str, float]:
    """Numbers of one dam with one model of water."""
    keys = None if water is None else {"level": level} | water
    scene, config = section_scene(section, keys, (6, 16), {})
    period = first_period(assemble_full(scene, config.damping), "a", 0.25, 0.5, 2e-4)
    scene, config = section_scene(section, keys, (6, 16), DAMPING)
    start = time.process_time()
    system, motion = reduce_scene(scene, config.model, config.damping).system, ground()
    history = simulated(system, motion, STEP, integrator="generalized_alpha")
    total = history.acc[:, 1] + motion[1]
    return {
        "first_period": period,
        "crest_displacement": float(np.abs(history.disp[:, 1]).max()),
        "crest_acceleration": float(np.abs(total).max()),
        "unknowns": float(system.size),
        "cpu_seconds": time.process_time() - start,
    }


def main() -> None:
    """Run all cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/bench_water.json"))
    out, found = parser.parse_args().out, {}
    print("| dam | water | first period s | crest mm | crest m/s² | unknowns | CPU s |")
    print("|---|---|---|---|---|---|---|")
    for dam, (section, level) in DAMS.items():
        for name, water in WATER.items():
            one = found[f"{dam}, {name}"] = case(section, level, water)
            print(
                f"| {dam} | {name} | {one['first_period']:.3f} | {1e3 * one['crest_displacement']:.1f} "
                f"| {one['crest_acceleration']:.1f} | {one['unknowns']:.0f} | {one['cpu_seconds']:.1f} |",
                flush=True,
            )
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
