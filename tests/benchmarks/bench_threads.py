"""Wall and CPU of a job with 1 thread, 2 and no setting, and what a second one does for large work.

    python tests/benchmarks/bench_threads.py [--config configs/two_cantilevers.yaml] [--repeats 3]
                                             [--out results/bench_threads.json]

A job is a process of its own, with kernels that are compiled already: reduced model, finer model and time
loop, medians over the repeats. "no policy" takes romdam's own limit away (`romdam.core.threads`). Beside each
stands how far its openings are from those of one thread, over the largest. Nothing here passes or fails.
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
from contextlib import nullcontext
from pathlib import Path
from statistics import median

import numpy as np
from scipy import linalg, sparse
from threadpoolctl import threadpool_limits

import romdam
from romdam.core import threads
from romdam.core.errors import ReductionError
from romdam.linalg.pardiso import PardisoFactor
from romdam.pipelines import run as pipeline
from romdam.pipelines.input_motions import records_of, usable

ROOT = Path(__file__).parents[2]
SETTINGS: dict[str, tuple[str | None, str]] = {
    "1": ("1", "policy"),
    "2": ("2", "policy"),
    "nothing set": (None, "policy"),
    "2, no policy": ("2", "free"),
    "nothing set, no policy": (None, "free"),
}
SIZES = (200, 400, 800, 1600, 3000)  # unknowns of dense eigenproblems
CUBES = (12, 18, 24, 30)  # nodes along the edge of a cube, three unknowns each
Row = dict[str, float]


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--config", type=Path, default=ROOT / "configs" / "two_cantilevers.yaml")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("results/bench_threads.json"))
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        _child(options.config, *options.child)
        return
    report = {"cores": os.cpu_count(), "jobs": jobs(options.config, options.repeats), "work": work()}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(report, indent=1))
    for name, row in {**report["jobs"], **report["work"]}.items():  # type: ignore[dict-item]
        print(f"{name:34s}", "  ".join(f"{key} {value:.3g}" for key, value in row.items()))


def jobs(config: Path, repeats: int) -> dict[str, Row]:
    """A row for each setting; they take turns, so that a busy machine is busy for all."""
    made: dict[str, list[Row]] = {name: [] for name in SETTINGS}
    with tempfile.TemporaryDirectory() as scratch:
        _in_process(config, "1", Path(scratch), "1")  # compiles
        for _ in range(repeats):
            for name, (count, policy) in SETTINGS.items():
                made[name].append(_in_process(config, count, Path(scratch), policy))
        first = np.load(Path(scratch) / "1-policy.npy")
        rows = {
            name: {key: median(row[key] for row in rows) for key in rows[0]} for name, rows in made.items()
        }
        for name, (count, policy) in SETTINGS.items():
            other = np.load(Path(scratch) / f"{count}-{policy}.npy")
            rows[name]["opening_difference"] = float(np.abs(other - first).max() / first.max())
    return rows


def _in_process(config: Path, count: str | None, scratch: Path, policy: str) -> Row:
    environment = {name: value for name, value in os.environ.items() if name not in threads.VARIABLES}
    if count:
        environment |= {"OMP_NUM_THREADS": count, "OPENBLAS_NUM_THREADS": count, "MKL_NUM_THREADS": count}
    command = [sys.executable, __file__, "--config", str(config), "--child", str(scratch), policy]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    row: Row = json.loads(done.stdout.splitlines()[-1])
    (scratch / "openings.npy").rename(scratch / f"{count}-{policy}.npy")
    return row


def _child(config: Path, scratch: str, policy: str) -> None:
    """Run the job, and leave its openings."""
    job, clock = romdam.load_config(config), pipeline.Clock(pipeline.silent)
    with threads.one_thread() if policy != "free" else nullcontext():
        motions = usable(records_of(job))
        model = pipeline.build_model(job, clock, estimated=True)
        with clock.stage("integration", "the time loop"):
            history = pipeline.simulate_motion(job, model.prepared, motions[0])
    np.save(Path(scratch) / "openings.npy", history.jump[..., 0])
    stages = ("model", "integration")
    print(json.dumps({f"{s}_{k}": getattr(clock, k)[s] for s in stages for k in ("wall", "cpu")}))


def work() -> dict[str, Row]:
    """A row for each size of dense eigenproblem, and of PARDISO's factors with 64 solutions."""
    random, rows = np.random.default_rng(0), {}
    for n in SIZES:
        A = random.standard_normal((n, n))
        K, M = A @ A.T + n * np.eye(n), 2.0 * np.eye(n) + 1e-3 * (A + A.T)
        rows[f"eigenproblem, {n}"] = _one_and_two(lambda K=K, M=M: linalg.eigh(K, M))  # type: ignore[misc]
    for edge in CUBES:
        line = sparse.diags_array([np.ones(edge - 1), np.ones(edge), np.ones(edge - 1)], offsets=[-1, 0, 1])
        near = sparse.kron(sparse.kron(line, line), sparse.kron(line, -np.eye(3)))
        matrix = sparse.csr_matrix(near + sparse.diags_array(np.full(near.shape[0], 28.0)))
        right = random.standard_normal((matrix.shape[0], 64))
        try:
            rows[f"PARDISO, {matrix.shape[0]}"] = _one_and_two(
                lambda A=matrix, b=right: PardisoFactor(A).solve(b)  # type: ignore[misc]
            )
        except ReductionError as error:
            print(error)
            break
    return rows


def _one_and_two(task: Callable[[], object]) -> Row:
    row = {}
    for count in (1, 2):
        times = []
        with threadpool_limits(count):
            for _ in range(3):
                start = time.perf_counter(), time.process_time()
                task()
                times.append((time.perf_counter() - start[0], time.process_time() - start[1]))
        row[f"wall_{count}"], row[f"cpu_{count}"] = (median(some) for some in zip(*times, strict=True))
    return row


if __name__ == "__main__":
    main()
