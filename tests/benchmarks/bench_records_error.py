"""Error against cost of the adaptive and the fixed step on other records than the main job's.

    python tests/benchmarks/bench_records_error.py [--limit-step 3.90625e-5] [--friction-limit-step 7.8125e-5]
                                                   [--records ...] [--out results/bench_records_error.json]

Three strong, different components of FEMA P-695 along y on the two cantilevers, with penalty, ten times
softer, a thousand times stiffer, rigid and rough joints. Errors are of the first `--seconds` after shaking
begins to count (5 % of the Arias intensity), in L2 over all openings, in the peak opening and in the
largest compression, against the same reduced model with an even step taken to its limit. "end" is the
adaptive step with joint forces that follow their springs at its end. Times are CPU seconds of the time loop
over those runs on one core. Nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
from functools import cache
from pathlib import Path

import numpy as np
from campaign import CASES, CONFIG, ROOT, Row, case_config, case_system, motions, raw_config

from romdam.config import parse_config
from romdam.core.motion import GroundMotion
from romdam.core.system import History, System
from romdam.error.metrics import relative_l2
from romdam.records.processing.resampling import resample_motion
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.integrators.adaptive import Adaptive
from romdam.timestepping.integrators.modal import Modal
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import cut_steps, fixed_steps

RECORDS = ("nearfield_no_pulse_18_b", "nearfield_pulse_09_a", "farfield_07_a")
STEPS = (0.005, 0.0025, 0.00125, 0.000625, 0.0003125)
SCALED = {"0/penalty / 10": 1.6e9, "0/penalty x 1000": 1.6e13}  # case -> normal stiffness [N/m3]
ALL = (CASES[0], *SCALED, CASES[1], CASES[2])
EVERY = 0.01
WANTED = (0.01, 0.004)  # errors at which the costs are compared


@cache
def system(case: str) -> System:
    """The reduced system of a case."""
    if case not in SCALED:
        return case_system(case)
    raw = case_config(CASES[0], {"finest_step": 0.01})
    joint = raw_config()["joints"]["contraction"] | {"normal_stiffness": SCALED[case]}  # type: ignore[operator]
    raw["joints"] = {"contraction": joint}
    config = parse_config(raw, CONFIG.name)
    return reduce_scene(build_scene(config, ROOT, CONFIG.name), config.model, config.damping).system


def window(motion: GroundMotion, seconds: float) -> float:
    """End of the compared part: `seconds` after 5 % of the Arias intensity, on the rows [s]."""
    energy = np.cumsum(motion.acc[1] ** 2)
    start = float(np.searchsorted(energy, 0.05 * energy[-1])) * motion.dt
    return float(min(np.floor((start + seconds) / EVERY), np.floor(motion.duration / EVERY)) * EVERY)


def march(case: str, motion: GroundMotion, scheme: str, finest: float, end: float) -> History:
    """One run from rest with rows every 0.01 s."""
    coarse = min(motion.dt, EVERY)
    cut = scheme in ("adaptive", "end")
    steps = cut_steps(finest, coarse, EVERY) if cut else fixed_steps(finest, EVERY)
    kind = Modal() if scheme == "modal" else Adaptive(midpoint=scheme != "end")
    ground = resample_motion(motion, steps.base)[:, : round(end / steps.base) + 1]
    return simulate_one(Prepared(system(case), kind), ground, Settings(steps, initial_state="undeformed"))


def compare(case: str, name: str, limit_step: float, seconds: float) -> Row:
    """All steps of every scheme against the limit, for one record and case."""
    motion = motions()[name]
    end = window(motion, seconds)
    limit = march(case, motion, "even", limit_step, end)
    rows = []
    for scheme in ("modal", "end", "adaptive"):
        march(case, motion, scheme, STEPS[-1], 0.1)  # may compile
        for dt in STEPS:
            rows.append(_row(march(case, motion, scheme, dt, end), limit, scheme, dt))
    peak = float(limit.jump[..., 0].max())
    return {
        "record": name,
        "case": case,
        "seconds": end,
        "peak_opening": peak,
        "limit_step": limit_step,
        "rows": rows,
        "cost_ratio": {f"{error:g}": _cost_ratio(rows, error) for error in WANTED},
    }


def _row(h: History, limit: History, scheme: str, dt: float) -> Row:
    found, wanted = h.jump[..., 0], limit.jump[..., 0]
    return {
        "scheme": scheme,
        "dt": dt,
        "L2_error": relative_l2(found, wanted),
        "peak_error": float(h.peaks["opening"].max() / limit.peaks["opening"].max() - 1.0),
        "compression_error": float(h.peaks["compression"].max() / limit.peaks["compression"].max() - 1.0),
        "cpu_seconds": h.stats["loop_cpu_seconds"],
        "steps": h.stats["steps"],
    }


def _cost_ratio(rows: list[Row], error: float) -> float:
    """CPU of the adaptive over that of the fixed step at one L2 error, by a power law through each's rows."""
    costs = []
    for scheme in ("adaptive", "modal"):
        own = [row for row in rows if row["scheme"] == scheme]
        x = np.log([float(str(row["L2_error"])) for row in own])
        y = np.log([float(str(row["cpu_seconds"])) for row in own])
        costs.append(float(np.polyval(np.polyfit(x, y, 1), np.log(error))))
    return float(np.exp(costs[0] - costs[1]))


def table(report: list[Row]) -> str:
    """Errors and times side by side."""
    lines = []
    for part in report:
        title = f"{part['record']}, {part['case']}: {part['seconds']:g} s"
        lines.append(f"{title}, peak opening {part['peak_opening']:.4f} m")
        for row in part["rows"]:  # type: ignore[attr-defined]
            lines.append(
                f"  {row['scheme']:9} {row['dt']:10g} s  L2 {100 * row['L2_error']:7.3f} %  "
                f"peak {100 * row['peak_error']:7.3f} %  "
                f"compression {100 * row['compression_error']:7.2f} %  "
                f"CPU {row['cpu_seconds']:7.3f} s"
            )
        ratios = dict(part["cost_ratio"]).items()  # type: ignore[call-overload]
        text = ", ".join(f"{100 * float(e):g} %: " + f"{r:.2f}" for e, r in ratios)
        lines.append(f"  CPU adaptive / modal at an L2 error of {text}")
    return "\n".join(lines)


def main() -> None:
    """Measure, print, and write the JSON."""
    parser = argparse.ArgumentParser(description="Error against cost on other records.")
    parser.add_argument("--records", nargs="+", default=list(RECORDS))
    parser.add_argument("--cases", nargs="+", default=list(ALL))
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--limit-step", type=float, default=0.01 / 256)
    parser.add_argument("--friction-limit-step", type=float, default=0.01 / 128)
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "bench_records_error.json")
    options = parser.parse_args()
    report = []
    for case in options.cases:
        smooth = case.startswith("0/")
        for name in options.records:
            step = options.limit_step if smooth else options.friction_limit_step
            report.append(compare(case, name, step, options.seconds))
            print(table(report[-1:]), flush=True)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"written to {options.out}")


if __name__ == "__main__":
    main()
