"""Monoliths on massless rock, with friction in bases and contraction joints: balance at rest, cost, ledger.

    python tests/benchmarks/bench_monoliths.py [--monoliths 3] [--along 1] [--out FILE.json]

configs/koyna.yaml with fewer monoliths, without its stress: weight, water and uplift, 30 s of the record.
Balance is of all forces on the monoliths at the first time, in parts of weight and thrust together. Seconds
are of CPU on one core; set-up is records, scene, reduction, state at rest and kernels; the march is the loop.
Prints a Markdown table and writes JSON; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.fem.gaps import water_force
from romdam.fem.loads import static_force
from romdam.pipelines.run import Clock, build_model, silent
from romdam.pipelines.simulation import simulate_motion
from romdam.records.record_set import load_motions

CONFIG = Path(__file__).parents[2] / "configs" / "koyna.yaml"


def job_of(monoliths: int, along: int) -> Job:
    """The example with the first and the last of its bases, and so many monoliths."""
    raw: dict[str, Any] = yaml.safe_load(CONFIG.read_text())
    dam, loads = raw["gravity_dam"], raw["loads"]
    middle = (len(dam["base"]) - monoliths) // 2 + 1
    dam["base"] = [dam["base"][0], *dam["base"][middle : middle + monoliths - 2], dam["base"][-1]]
    dam["monoliths"] = dam["monoliths"][:monoliths]
    dam["divisions"]["along"] = along
    del loads["hydrostatic"][0]["faces"][monoliths:], loads["joint_water"][0]["joints"][monoliths:]
    raw["water"]["faces"] = loads["hydrostatic"][0]["faces"]
    middle_one = f"monolith_{(monoliths + 1) // 2}"
    raw["outputs"] = {
        "output_interval": 0.01,
        "nodes": {"crest": {"block": middle_one, "at": [15.24 * monoliths / 2, 0, 103], "tolerance": 10.0}},
    }
    return Job(parse_config(raw, CONFIG.name), CONFIG)


def balance(scene: Scene, history: History) -> float:
    """Sum of all forces on the monoliths at the first time, in parts of weight and thrust together."""
    dam = [name for name in scene.blocks if name.startswith("monolith")]
    loads = sum(static_force(scene, name).sum(axis=0) for name in dam)
    acting = history.traction[0].copy()
    acting[:, 0] += water_force(scene) + (history.water[0] if history.water.size else 0.0)
    total, first = loads.copy(), 0
    for joint in scene.joints.values():
        own = acting[first : (first := first + len(joint.area))]
        sides = [block in dam for block in joint.blocks]
        total += (float(sides[1]) - float(sides[0])) * np.einsum("nk,nkl->l", own, joint.axes)
    return float(np.linalg.norm(total) / np.linalg.norm(loads))


def measure(monoliths: int, along: int) -> dict[str, float]:
    """Build, rest, march."""
    job, start = job_of(monoliths, along), time.process_time()
    (motion,) = load_motions(job.config.records, job.folder)
    model = build_model(job, Clock(silent))
    simulate_motion(job, model.prepared, replace(motion, acc=motion.acc[:, :20]), None)
    ready = time.process_time()
    history = simulate_motion(job, model.prepared, motion, job.config.transient.duration)
    mesh = sum(int((~fixed).sum()) for fixed in model.scene.fixed.values())
    return {
        "monoliths": monoliths, "unknowns of the mesh": mesh, "unknowns": model.system.size,
        "gaps": len(model.system.law), "seconds of record": float(history.time[-1]),
        "set-up CPU-s": ready - start, "march CPU-s": time.process_time() - ready,
        "balance at rest": balance(model.scene, history), "ledger": history.stats["ledger_imbalance"],
        "largest opening [mm]": 1e3 * float(history.jump[..., 0].max()),
    }  # fmt: skip


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--monoliths", type=int, default=3, choices=(2, 3, 4, 5))
    parser.add_argument("--along", type=int, default=1, help="elements along the axis in each monolith")
    parser.add_argument("--out", type=Path, default=Path("results/bench_monoliths.json"))
    chosen = parser.parse_args()
    row = measure(chosen.monoliths, chosen.along)
    print("| what | value |\n|---|---|")
    for name, value in row.items():
        print(f"| {name} | {value:.4g} |")
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(json.dumps(row, indent=1))


if __name__ == "__main__":
    main()
