"""Every component of the FEMA P-695 sets on the two cantilevers: nothing fails, no energy is created.

    python tests/benchmarks/campaign.py [--jobs 2] [--friction-step 1.25e-3] [--only 0/penalty,0.6/rigid]
                                        [--records 100] [--out results/campaign.json]

100 components along y x friction {0, 0.6} x normal stiffness {16 GPa/m, rigid}, from the undeformed
state, with the adaptive integrator: frictionless runs at `--accuracy`, those with friction at a fixed
finest step. Nothing passes or fails by time; the exit code is 1 where a run failed or made energy.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import math
import multiprocessing
import sys
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import median

import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))

from soundness import CLOSED, soundness

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RomdamError
from romdam.core.motion import GroundMotion
from romdam.core.system import History, System
from romdam.pipelines.simulation import prepare, simulate_motion
from romdam.records.p695 import SETS
from romdam.records.record_set import load_motions
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "configs" / "two_cantilevers.yaml"
STIFFNESS = {"penalty": 1.6e10, "rigid": "rigid"}
MU = 0.6
CASES = tuple(f"{mu:g}/{stiffness}" for mu in (0.0, MU) for stiffness in STIFFNESS)
Row = dict[str, object]


@dataclass(frozen=True)
class Settings:
    """How a case is stepped."""

    accuracy: float
    friction_step: float


@cache
def motions() -> dict[str, GroundMotion]:
    """All 100 components, each along y, as recorded."""
    entries = [RecordConfig.model_validate({"suite": s, "components": {"y": "each"}}) for s in SETS]
    return {motion.name: motion for motion in load_motions(entries, ROOT)}


@cache
def raw_config() -> dict[str, dict[str, object]]:
    """The configuration of the two cantilevers as it is written."""
    return dict(yaml.safe_load(CONFIG.read_text(encoding="utf-8")))


def case_config(case: str, transient: Row) -> dict[str, object]:
    """The configuration of one case, for one way of stepping."""
    mu, stiffness = case.split("/")
    joint: dict[str, object] = {"between": ["left", "right"], "normal_stiffness": STIFFNESS[stiffness]}
    if float(mu) > 0.0:
        joint |= {"friction": float(mu), "shear_stiffness": 8e9}
    changed = {"joints": {"contraction": joint}, "transient": transient, "outputs": {}}
    return {**raw_config(), **changed}


@cache
def case_system(case: str) -> System:
    """The reduced system of one case."""
    config = parse_config(case_config(case, {"finest_step": 0.01}), CONFIG.name)
    return reduce_scene(build_scene(config, ROOT, CONFIG.name), config.model, config.damping).system


def run_one(task: tuple[str, str, Settings]) -> Row:
    """One component on one case; a failure is a row with its message."""
    name, case, settings = task
    motion, system = motions()[name], case_system(case)
    row: Row = {"record": name, "case": case, "seconds": motion.duration}
    start, cpu = time.perf_counter(), time.process_time()
    try:
        job = Job(parse_config(case_config(case, _stepping(motion, case, settings)), CONFIG.name), CONFIG)
        row |= measures(system, simulate_motion(job, prepare(job, system), motion))
    except RomdamError as error:
        row["failure"] = f"{type(error).__name__}: {error}"
    return row | {"cpu_seconds": time.process_time() - cpu, "wall_seconds": time.perf_counter() - start}


def _stepping(motion: GroundMotion, case: str, settings: Settings) -> Row:
    if case.startswith("0/"):
        return {"accuracy": settings.accuracy}
    parts = 2 ** max(0, math.ceil(math.log2(motion.dt / settings.friction_step) - 1e-9))
    return {"finest_step": motion.dt / parts}


def measures(system: System, h: History) -> Row:
    """What a run has to answer for, and what it took."""
    return soundness(system.law, h) | {
        "steps": h.stats["steps"],
        "refused_steps": h.stats["refused_steps"],
        "finest_step": h.stats["finest_step"],
        "runs": h.stats.get("runs", 1.0),
        "estimated_time_error": h.stats.get("estimated_time_error"),
        "gap_residual": h.stats["largest_residual"],
        "peak_opening": float(h.peaks["opening"].max()),
        "loop_cpu_seconds": h.stats.get("all_runs_cpu_seconds", h.stats["loop_cpu_seconds"]),
    }


def summary(rows: list[Row]) -> Row:
    """The figures of one case, or of all."""
    good = [row for row in rows if "failure" not in row]

    def values(name: str) -> list[float]:
        return [float(str(row[name])) for row in good] or [math.nan]

    worst = max(values("ledger_residual"), key=abs)
    return {
        "runs": len(rows),
        "failures": len(rows) - len(good),
        "not_finite": sum(not row["finite"] for row in good),
        "largest_gap_residual": max(values("gap_residual")),
        "largest_ledger_residual": worst,
        "ledger_above_1e-6": sum(abs(v) > CLOSED for v in values("ledger_residual")),
        "smallest_contact_increment": min(values("contact_increment")),
        "smallest_friction_increment": min(values("friction_increment")),
        "smallest_damping_increment": min(values("damping_increment")),
        "largest_tension": max(values("tension")),
        "largest_shear_above_limit": max(values("shear_above_limit")),
        "largest_penetration_mismatch": max(values("penetration_mismatch")),
        "steps": sum(values("steps")),
        "refused_steps": sum(values("refused_steps")),
        "loop_cpu_seconds": sum(values("loop_cpu_seconds")),
        "median_loop_cpu_seconds": median(values("loop_cpu_seconds")),
    }


def table(report: dict[str, Row]) -> str:
    """The summaries side by side."""
    names = list(report)
    lines = [f"{'':30}" + "".join(f"{name:>14}" for name in names)]
    for key in report[names[0]]:
        cells = (float(str(report[name][key])) for name in names)
        lines.append(f"{key:30}" + "".join(f"{cell:14.4g}" for cell in cells))
    return "\n".join(lines)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="All P-695 components on the two cantilevers.")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--accuracy", type=float, default=0.01, help="of the frictionless runs")
    parser.add_argument("--friction-step", type=float, default=1.25e-3, help="longest finest step [s]")
    parser.add_argument("--only", default=",".join(CASES), help="cases, of " + ", ".join(CASES))
    parser.add_argument("--records", type=int, default=None, help="the first so many components only")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "campaign.json")
    return parser.parse_args()


def main() -> int:
    """Run, print and write; 1 where a run failed or its ledger does not close."""
    options, start = _arguments(), time.perf_counter()
    settings = Settings(options.accuracy, options.friction_step)
    names = list(motions())[: options.records]
    cases = options.only.split(",")
    tasks = [(name, case, settings) for case in cases for name in names]
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        rows = []
        for row in pool.imap_unordered(run_one, tasks, chunksize=5):
            rows.append(row)
            print(f"\r{len(rows)} of {len(tasks)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    by_case = {case: summary([row for row in rows if row["case"] == case]) for case in cases}
    report = by_case | {"all": summary(rows)}
    print(table(report))
    for row in rows:
        if "failure" in row:
            print(f"{row['case']} {row['record']}: {row['failure']}")
    print(f"wall {time.perf_counter() - start:.0f} s with {options.jobs} processes")
    whole = {"settings": vars(settings), "wall_seconds": time.perf_counter() - start, "summary": report}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(whole | {"rows": rows}, indent=1) + "\n", encoding="utf-8")
    print(f"written to {options.out}")
    return int(bool(report["all"]["failures"] or report["all"]["ledger_above_1e-6"]))


if __name__ == "__main__":
    sys.exit(main())
