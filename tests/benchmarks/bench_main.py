"""Error and time of the main job: reduced model, full order, bare products and friction, in one run.

    python tests/benchmarks/bench_main.py [--seconds 10] [--repeats 3] [--out results/bench_main.json]

Errors are against tests/reference/two_cantilevers/reference.npz (peak opening, and L2 of all openings over
10 s). "modal, 60" is the model without corrections, whose error of 1.2 % lies against that of the time steps.
Times are CPU seconds of the time loop on one core, medians over the repeats. Nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

from reference_run import ROOT, errors, job, march

from romdam.core.integrators import INTEGRATORS
from romdam.core.system import History, System
from romdam.effects.full_order import assemble_full
from romdam.error.metrics import relative_l2
from romdam.reduction.synthesis import reduce_scene
from romdam.timestepping.modal.propagator import modal_propagator
from romdam.timestepping.steps import cut_steps

Floats = NDArray[np.float64]
Row = dict[str, object]

STEPS = (0.01, 0.005, 0.0025, 0.00125, 0.000625, 0.0003125, 0.00015625)
FULL_STEPS = (0.0025, 0.000625)
ROUGH: dict[str, Any] = {"friction": 0.6, "shear_stiffness": 8e9}
REDUCED = ("reduced, adaptive", "reduced, modal", "reduced, modal, 60")
COMPARED = (0.01, 0.004)  # L2 errors at which costs are compared
RECORD_STEP = 0.01  # [s], and the interval of the rows
LIMIT = 0.01 / 128  # [s] step of the run with friction that the others are compared with


def machine() -> Row:
    """What the times were taken on."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        model = platform.processor()
    packages = ("numpy", "scipy", "numba")
    return {
        "cpu": model,
        "cores": os.cpu_count(),
        "system": platform.system(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in packages},
    }


def reduced_system(plain: bool = False, **joint: object) -> tuple[System, float]:
    """The reduced system of the main job, and the CPU seconds its reduction took; `plain`: no corrections."""
    start = time.process_time()
    the_job = job(**joint)
    kept = the_job.config.model
    kept = kept.model_copy(update={"residual_vectors": 0}) if plain else kept
    model = reduce_scene(the_job.scene, kept, the_job.config.damping)
    return model.system, time.process_time() - start


def repeat(repeats: int, system: System, dt: float, seconds: float | None = None, **options: object) -> Row:
    """One row: errors, and the median CPU of the loop; the first run, which may compile, is not counted."""
    stepped = at_finest(dt, **options)
    march(system, duration=0.1, **stepped)
    runs = [march(system, duration=seconds, **stepped) for _ in range(repeats)]
    return row(runs, dt, seconds)


def at_finest(dt: float, **options: object) -> dict[str, Any]:
    """Options of a run whose finest step is dt: the adaptive one starts from the record's or half of it."""
    if options.get("integrator") != "adaptive":
        return {"dt": dt, **options}
    steps = cut_steps(dt, RECORD_STEP, RECORD_STEP)
    return {"dt": steps.base, "cuts": steps.cuts, **options}


def row(runs: list[History], dt: float, seconds: float | None) -> Row:
    """Errors of the last run and median times."""
    h = runs[-1]
    cpu = median(run.stats["loop_cpu_seconds"] for run in runs)
    steps = round(h.time[-1] / dt)
    peak, L2 = errors(job().scene, h)
    return {
        "dt": dt,
        "seconds": seconds or float(h.time[-1]),
        "peak_opening": float(h.peaks["opening"].max()),
        "peak_error": peak,
        "L2_error": L2,
        "cpu_seconds": cpu,
        "cpu_us_per_step": 1e6 * cpu / steps,
        "setup_cpu_seconds": median(run.stats["setup_cpu_seconds"] for run in runs),
        "substeps": h.stats["steps"],
        "iterations_per_step": h.stats["solver_iterations"] / h.stats["steps"],
        "largest_residual": h.stats["largest_residual"],
        "ledger_residual": float(np.abs(h.energy["residual"]).max() / np.abs(h.energy["input"]).max()),
    }


@njit(error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _products(tiles: list[Floats], H: Floats, q: list[Floats], p: Floats, w: Floats, count: int) -> float:
    """G q, G^T p and H p, `count` times, each block of G on its own."""
    total = 0.0
    for _ in range(count):
        w[:] = 0.0
        for t in range(len(tiles)):
            G, part = tiles[t], q[t]
            for r in range(G.shape[0]):
                line, dot = G[r], 0.0
                for j in range(len(part)):
                    dot += line[j] * part[j]
                w[r] += dot
        for t in range(len(tiles)):
            G, part = tiles[t], q[t]
            part[:] = 0.0
            for r in range(G.shape[0]):
                line, force = G[r], p[r]
                for j in range(len(part)):
                    part[j] += line[j] * force
        for r in range(len(p)):
            line, dot = H[r], 0.0
            for j in range(len(p)):
                dot += line[j] * p[j]
            w[r] += dot
        total += w[0] + q[0][0]
    return total


def products(system: System, dt: float, repeats: int, count: int = 3000) -> Row:
    """Microseconds of the three products that no step can do without, in numba and in numpy (BLAS)."""
    from numba.typed import List

    G = system.B.toarray()
    step = modal_propagator(system.K.diagonal(), system.C.diagonal(), dt)
    H = np.ascontiguousarray((G * step.q_p) @ G.T)
    tiles = List(np.ascontiguousarray(G[:, part]) for part in system.parts.values())
    q = List(np.full(tile.shape[1], 1e-3) for tile in tiles)
    p, w = np.full(len(H), 1e-3), np.zeros(len(H))
    _products(tiles, H, q, p, w, 1)
    loops, blas = [], []
    for _ in range(max(repeats, 5)):
        start = time.process_time()
        _products(tiles, H, q, p, w, count)
        loops.append(time.process_time() - start)
        start = time.process_time()
        for _ in range(count):
            for tile, part in zip(tiles, q, strict=True):
                tile @ part
                tile.T @ p
            H @ p
        blas.append(time.process_time() - start)
    return {"numba_us": 1e6 * median(loops) / count, "numpy_us": 1e6 * median(blas) / count}


def measure(seconds: float, repeats: int) -> dict[str, object]:
    """Every row, in one run."""
    smooth, reduction = reduced_system()
    report: dict[str, object] = {"machine": machine(), "unknowns": smooth.size, "reduction_cpu_s": reduction}
    for name in INTEGRATORS:
        if name not in ("generalized_alpha", "conserving"):  # the latter is for scenes without damping
            report[f"reduced, {name}"] = [repeat(repeats, smooth, dt, integrator=name) for dt in STEPS]
    plain, _ = reduced_system(plain=True)
    report["reduced, modal, 60"] = [repeat(repeats, plain, dt, integrator="modal") for dt in STEPS]
    rough, _ = reduced_system(**ROUGH)
    limit = march(rough, LIMIT, 10.0, integrator="adaptive", cuts=())
    report["friction"] = [
        _friction(rough, smooth, limit, (integrator, dt, repeats))
        for integrator in ("modal", "adaptive")
        for dt in (0.0025, 0.00125, 0.000625)
    ]
    report["products"] = products(smooth, 0.0025, repeats)
    full = assemble_full(job().scene, job().config.damping)
    report["full order"] = [_full(full, smooth, dt, seconds) for dt in FULL_STEPS]
    return report


def _friction(rough: System, smooth: System, limit: History, setting: tuple[str, float, int]) -> Row:
    """With friction and without, same integrator and step; errors against the friction's own time limit."""
    integrator, dt, repeats = setting
    with_it, without = (repeat(repeats, s, dt, integrator=integrator) for s in (rough, smooth))
    names = ("cpu_seconds", "cpu_us_per_step", "iterations_per_step", "largest_residual", "ledger_residual")
    stepped = at_finest(dt, integrator=integrator)
    found = march(rough, duration=float(limit.time[-1]), **stepped).jump[..., 0]
    return {
        "integrator": integrator,
        "dt": dt,
        **{name: with_it[name] for name in names},
        "time_error_L2": relative_l2(found, limit.jump[..., 0]),
        "cost_against_frictionless": float(str(with_it["cpu_seconds"])) / float(str(without["cpu_seconds"])),
    }


def _full(full: System, reduced: System, dt: float, seconds: float) -> Row:
    """One full-order run and the reduced one beside it, same record and step."""
    big = repeat(1, full, dt, seconds, integrator="generalized_alpha")
    small = repeat(3, reduced, dt, seconds, integrator="modal")
    ratio = float(str(big["cpu_seconds"])) / float(str(small["cpu_seconds"]))
    return {**big, "reduced_cpu_seconds": small["cpu_seconds"], "times_the_reduced": ratio}


def table(report: dict[str, object]) -> str:
    """The report as text."""
    about = dict(report["machine"])  # type: ignore[call-overload]
    lines = [f"{about['cpu']}, {about['cores']} cores, Python {about['python']}, {about['packages']}"]
    lines += [f"{'':24} {'dt s':>10} {'peak m':>9} {'peak %':>7} {'L2 %':>7} {'CPU s':>8} {'us/step':>9}"]
    for name, rows in report.items():
        if name.startswith("reduced,") or name == "full order":
            lines += [_line(name, dict(row)) for row in rows]  # type: ignore[attr-defined]
    for friction in report["friction"]:  # type: ignore[attr-defined]
        lines.append(
            f"friction mu 0.6, {friction['integrator']}, dt {friction['dt']:g}: "
            f"{friction['cpu_seconds']:.3f} s, "
            f"time error {100 * friction['time_error_L2']:.2f} %, "
            f"{friction['cost_against_frictionless']:.1f} times the frictionless run, "
            f"largest residual {friction['largest_residual']:.1e}"
        )
    lines += [_costs(report, error) for error in COMPARED]
    bare = dict(report["products"])  # type: ignore[call-overload]
    step = next(r for r in report["reduced, modal"] if r["dt"] == 0.0025)  # type: ignore[attr-defined]
    lines.append(
        f"G q, G^T p, H p: {bare['numba_us']:.2f} us in numba, {bare['numpy_us']:.2f} us in numpy; "
        f"the step at 0.0025 s is {step['cpu_us_per_step'] / bare['numba_us']:.2f} times the former"
    )
    for full in report["full order"]:  # type: ignore[attr-defined]
        lines.append(
            f"full order at dt {full['dt']:g}: {full['times_the_reduced']:.0f} times the reduced CPU"
        )
    return "\n".join(lines)


def _costs(report: dict[str, object], error: float) -> str:
    """CPU of every scheme at one L2 error, and with friction relative to without."""
    costs = {}
    for name in (*REDUCED, "friction"):
        rows = [r for r in report[name] if r.get("integrator", "adaptive") == "adaptive"]  # type: ignore
        key = "time_error_L2" if name == "friction" else "L2_error"
        costs[name] = _cost_at(error, [r[key] for r in rows], [r["cpu_seconds"] for r in rows])
    best = costs["reduced, adaptive"]
    found = ", ".join(f"{name} {cost:.3f} s ({cost / best:.2f})" for name, cost in costs.items())
    return f"CPU at an L2 error of {100 * error:g} % (relative to adaptive): {found}"


def _cost_at(error: float, errors: list[float], costs: list[float]) -> float:
    """CPU at an error, between the two rows around it on logarithmic axes; nan outside of them."""
    order = np.argsort(errors)
    x, y = np.log(np.asarray(errors)[order]), np.log(np.asarray(costs)[order])
    return float(np.exp(np.interp(np.log(error), x, y, left=np.nan, right=np.nan)))


def _line(name: str, row: Row) -> str:
    return (
        f"{name:24} {row['dt']:10g} {row['peak_opening']:9.5f} {100 * row['peak_error']:7.2f} "  # type: ignore
        f"{100 * row['L2_error']:7.2f} {row['cpu_seconds']:8.3f} {row['cpu_us_per_step']:9.2f}"  # type: ignore
    )


def main() -> None:
    """Measure, print, and write the JSON."""
    parser = argparse.ArgumentParser(description="Error and time of the main job.")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the full-order runs [s]")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each reduced row")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "bench_main.json")
    options = parser.parse_args()
    report = measure(options.seconds, options.repeats)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(table(report))
    print(f"written to {options.out}")


if __name__ == "__main__":
    main()
