"""Whole suites from the command to summary.nc: the P-695 components, and a thousand samples of the joints.

    python tests/benchmarks/bench_suite.py [--workers 2] [--samples 1000] [--only p695,samples]
                                           [--against CHECKOUT] [--out results/bench_suite.json]

With --against another checkout's code runs every suite too, in turn with this one's; both estimate their
reduction error, the ratio of their CPU is told, and of 100 components how far their largest openings are from
those of a suite to 0.1 %.

Both run with the reduced blocks in a cache that a first command has filled. Wall time and CPU time of all
processes are told twice: when summary.nc is there, and at the command's end, with the report. Memory is the
largest sum of what they had to themselves. The error is each run's own estimate of its time stepping. Nothing
passes or fails by time; 1 where a run failed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import xarray as xr
import yaml

ROOT = Path(__file__).parents[2]
CODE = "from romdam.cli import main; main()"
PARAMETERS = {
    "stiffness": {
        "path": "joints.contraction.normal_stiffness",
        "low": "1.6 GPa/m",
        "high": "160 GPa/m",
        "distribution": "loguniform",
    },
    "gap": {"path": "joints.contraction.gap", "low": "0 mm", "high": "10 mm"},
    "ratio": {"path": "damping.rayleigh.ratio", "low": "3 %", "high": "8 %"},
}
_LOOK = 0.05  # [s] between two looks for the summary
_LOOKS = 20  # looks between two at the memory, each of which takes 15 ms of CPU for every process
Row = dict[str, object]


def p695() -> dict[str, object]:
    """All 100 components, each to 1 %."""
    return _config("suite_p695.yaml")


def samples(count: int) -> dict[str, object]:
    """One record with so many samples of stiffness, initial gap and damping, each to 1 %."""
    config = _config("suite.yaml")
    design = {"latin_hypercube": count, "seed": 1}
    config["suite"] = {"parameters": PARAMETERS, "design": design}
    config["outputs"] = {"output_interval": "0.02 s", "error_estimate": False}
    config["records"][0]["file"] = str(ROOT / "data/records/northridge_mul009_g_dt0.01.txt")  # type: ignore[index]
    return config


def _config(name: str) -> dict[str, object]:
    return dict(yaml.safe_load((ROOT / "configs" / name).read_text(encoding="utf-8")))


def run(config: dict[str, object], folder: Path, cache: Path, workers: int, code: Path = ROOT) -> Row:
    """One command with a checkout's code, and what it took."""
    folder.mkdir()
    path = folder / "suite.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    options = ("--out", folder / "out", "--cache", cache, "--workers", workers, "--quiet")
    start = time.perf_counter()
    command = [sys.executable, "-c", CODE, "run", str(path), *map(str, options)]
    process = subprocess.Popen(command, cwd=folder, env=os.environ | {"PYTHONPATH": str(code)})
    memory, summary_cpu, cpu = _watch(process, folder / "out" / "summary.nc")
    wall = time.perf_counter() - start
    landed = (folder / "out" / "summary.nc").stat().st_mtime - path.stat().st_mtime
    with xr.open_dataset(folder / "out" / "summary.nc", engine="h5netcdf") as found:
        return {
            "runs": int(found.status.size),
            "failed": int((found.status > 0).sum()),
            "wall_seconds_to_summary": landed,
            "cpu_seconds_to_summary": summary_cpu,
            "wall_seconds": wall,
            "cpu_seconds": cpu,
            "cpu_seconds_of_runs": float(found.cpu_seconds.sum()),
            "largest_memory": memory,
            "largest_estimated_time_error": float(found.estimated_time_error.max()),
            "median_estimated_time_error": float(found.estimated_time_error.median()),
            "estimated_time_error_95": float(found.estimated_time_error.quantile(0.95)),
            "steps": float(found.steps.sum()),
            "bytes": sum(file.stat().st_size for file in (folder / "out").rglob("*") if file.is_file()),
        }


def _watch(process: subprocess.Popen[bytes], summary: Path) -> tuple[int, float, float]:
    """Wait for a process.

    Returns
    -------
    (memory, before, cpu) : the largest sum of the memory that it and its children had to themselves [bytes],
        the CPU time of all of them when the summary was there, and at the end [s]
    """
    largest, before, cpu, looks, root = 0, 0.0, 0.0, 0, psutil.Process(process.pid)
    while process.poll() is None:
        try:
            family = (root, *root.children(recursive=True))
            cpu = max(cpu, sum(sum(one.cpu_times()[:4]) for one in family))  # with children that have ended
            if looks % _LOOKS == 0:
                largest = max(largest, sum(one.memory_full_info().uss for one in family))
        except psutil.Error:
            pass  # one has ended between two looks
        if before == 0.0 and summary.exists():
            before = cpu
        looks += 1
        time.sleep(_LOOK)
    return largest, before, cpu


def side_by_side(name: str, config: dict[str, object], scratch: Path, options: argparse.Namespace) -> Row:
    """The same suite by both checkouts in turn; CPU of this one over that of the other, and the errors."""
    config["outputs"] = dict(config["outputs"]) | {"error_estimate": True}  # type: ignore[call-overload]
    rows: dict[str, list[Row]] = {"other": [], "this": []}
    for number in range(options.repeats + 1):  # the first loads and compiles
        for label, code in (("other", options.against.resolve()), ("this", ROOT)):
            folder = scratch / f"{name}_{label}_{number}"
            rows[label].append(run(config, folder, scratch / f"cache_{label}", options.workers, code))
    cpu = {
        label: min(float(str(row["cpu_seconds_to_summary"])) for row in own[1:])
        for label, own in rows.items()
    }
    found: Row = {f"{label} {key}": value for label, own in rows.items() for key, value in own[-1].items()}
    found |= {"failed": rows["this"][-1]["failed"], "ratio of CPU": cpu["this"] / cpu["other"]}
    if name == "p695":
        config["transient"] = {"accuracy": "0.1 %"}
        run(config, scratch / "fine", scratch / "cache_this", options.workers)
        for label in rows:
            found |= _peak_errors(label, scratch / f"{name}_{label}_1", scratch / "fine")
    return found


def _peak_errors(label: str, folder: Path, fine: Path) -> Row:
    """Errors of the largest openings of a suite against those of a finer one."""
    peaks = []
    for one in (folder, fine):
        with xr.open_dataset(one / "out" / "summary.nc", engine="h5netcdf") as found:
            peaks.append(found.peak_opening.values.ravel())
    error = abs(peaks[0] / peaks[1] - 1.0)
    return {f"{label} peak error 95 %": float(np.quantile(error, 0.95)), f"{label} peak error": error.max()}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Whole suites from the command to summary.nc.")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--samples", type=int, default=1000, help="samples of the joints")
    parser.add_argument("--only", default="p695,samples", help="which, of p695 and samples")
    parser.add_argument("--against", type=Path, help="folder of another checkout")
    parser.add_argument("--repeats", type=int, default=2, help="of every suite of two checkouts")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "bench_suite.json")
    return parser.parse_args()


def main() -> int:
    """Run, print and write."""
    options = _arguments()
    made: dict[str, Callable[[], dict[str, object]]] = {
        "p695": p695,
        "samples": lambda: samples(options.samples),
    }
    report: dict[str, Row] = {}
    with tempfile.TemporaryDirectory() as scratch:
        cache = Path(scratch) / "cache"
        run(samples(1), Path(scratch) / "first", cache, 1)
        for name in options.only.split(","):
            if options.against:
                report[name] = side_by_side(name, made[name](), Path(scratch), options)
            else:
                report[name] = run(made[name](), Path(scratch) / name, cache, options.workers)
            print(name, *(f"{k} {v:.4g}" for k, v in report[name].items()), sep="\n  ")
    load = os.getloadavg()[0]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    whole = {"workers": options.workers, "load_at_the_end": load, "cores": os.cpu_count(), "suites": report}
    options.out.write_text(json.dumps(whole, indent=1, default=float) + "\n", encoding="utf-8")
    print(f"load at the end {load:.1f}; written to {options.out}")
    return int(any(row["failed"] for row in report.values()))


if __name__ == "__main__":
    sys.exit(main())
