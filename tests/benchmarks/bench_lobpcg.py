"""Our LOBPCG beside SciPy's, given the same guards, preconditioner and check of residuals, in one run.

    python tests/benchmarks/bench_lobpcg.py OUT [--meshes 3]

The tet10 block of bench_large.py, its foot held: all modes below 60 Hz under one cycle of multigrid. SciPy's
is told how many there are, takes eight vectors more (guards), and is started again from its own vectors every
so many iterations until the wanted modes have a relative residual of 1e-7, as ours have; then the same
random vectors look for a mode that was missed. What it does by itself stands beside it, 60 iterations without
guards. Frequencies are compared with block Lanczos on factors. CPU seconds are of this process, memory is the
most that NumPy's arrays take beside the matrices. Writes OUT/bench_lobpcg.json.
"""

from __future__ import annotations

import argparse
import json
import time
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from bench_large import CUTOFF, MESHES, block_of
from scipy.sparse import spmatrix
from scipy.sparse.linalg import LinearOperator, lobpcg

from romdam.core.arrays import Floats
from romdam.core.errors import ReductionError
from romdam.fem.assembly import assemble
from romdam.linalg.modes.eigen import modes_below
from romdam.linalg.modes.lobpcg import RESIDUAL, Pencil, Wanted, block_modes, missed
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import Solver, Solving, make_solver
from romdam.scene.supports import rigid_motions

GUARDS, MOST = 8, 200  # vectors beside those wanted, and iterations, as ours has them
EVERY = (10, 20, 40)  # iterations after which SciPy's is looked at, and started again
Modes = tuple[Floats, Floats]


class Counted:
    """The preconditioner, and the number of columns that it was given."""

    def __init__(self, solver: Solver) -> None:
        self._apply, self.columns = solver.precondition, 0  # type: ignore[attr-defined]

    def __call__(self, R: Floats) -> Floats:
        self.columns += R.shape[1] if R.ndim > 1 else 1
        return np.asarray(self._apply(R))


def problem(divisions: tuple[int, ...]) -> tuple[spmatrix, spmatrix, Motions]:
    block = block_of(divisions)
    free = np.repeat(block.points[:, 2] > 0.0, 3)
    K, M = assemble(block)
    motions = Motions(np.flatnonzero(free), rigid_motions(block).reshape(-1, 6)[free])
    return K[free][:, free], M[free][:, free], motions


def residuals(K: spmatrix, M: spmatrix, found: Modes) -> Floats:
    """Relative to the forces of the modes' own inertia."""
    omega2, X = found
    MX = M @ X
    return np.asarray(np.linalg.norm(K @ X - MX * omega2, axis=0) / (omega2 * np.linalg.norm(MX, axis=0)))


def of_scipy(K: spmatrix, M: spmatrix, inverse: Counted, count: int, guards: int, every: int) -> Modes:
    """Restarted until the wanted modes are modes, or MOST iterations are spent."""
    operator = LinearOperator(K.shape, matvec=inverse, matmat=inverse, dtype=float)
    X = np.random.default_rng(0).standard_normal((K.shape[0], count + guards))
    for _ in range(0, MOST, every):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that the bare residual is above its tolerance
            omega2, X = lobpcg(K, X, B=M, M=operator, tol=1e-12, maxiter=every, largest=False)
        order = np.argsort(omega2)
        omega2, X = omega2[order], X[:, order]
        if guards == 0 or residuals(K, M, (omega2[:count], X[:, :count])).max() <= RESIDUAL:
            break
    found = omega2[:count], X[:, :count]
    if guards:
        assert missed(Pencil(K, M, inverse), found, Wanted(count)) is None
    return found


def measured(name: str, make: Callable[[Counted], Modes], solver: Solver, true: Modes, KM: Modes) -> dict:  # type: ignore[type-arg]
    inverse, start = Counted(solver), time.process_time()
    tracemalloc.start()
    try:
        found = make(inverse)
    except (ReductionError, np.linalg.LinAlgError, ValueError) as error:
        tracemalloc.stop()
        return {"name": name, "failure": str(error), "cpu_s": time.process_time() - start}
    cpu, peak = time.process_time() - start, tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    count = min(len(found[0]), len(true[0]))
    worst = float(residuals(*KM, found).max())
    off = float(np.abs(np.sqrt(found[0][:count] / true[0][:count]) - 1.0).max())
    row = {
        "name": name, "cpu_s": cpu, "peak_mb": peak, "columns": inverse.columns, "modes": len(found[0]),
        "residual": worst, "converged": worst <= RESIDUAL, "frequency_error": off,
    }  # fmt: skip
    took = f"{cpu:7.1f} CPU-s {peak:6.0f} MB {inverse.columns:6d} columns"
    print(f"  {name:<34}{took}  residual {worst:.1e}  frequencies to {off:.1e}", flush=True)
    return row


def one(divisions: tuple[int, ...]) -> dict:  # type: ignore[type-arg]
    K, M, motions = problem(divisions)
    limit = (2.0 * np.pi * CUTOFF) ** 2
    true = modes_below(K, M, None, CUTOFF, make_solver(K, motions, 10, Solving("multifrontal"), "b"))
    solver = make_solver(K, motions, 10, Solving("multigrid"), "b")
    count = len(true[0])
    print(f"{K.shape[0]} unknowns, {count} modes below {CUTOFF:g} Hz", flush=True)
    makers: dict[str, Callable[[Counted], Modes]] = {
        "ours, up to a frequency": lambda inverse: block_modes(Pencil(K, M, inverse), Wanted(None, limit)),
        "ours, so many": lambda inverse: block_modes(Pencil(K, M, inverse), Wanted(count)),
    }
    for every in EVERY:
        makers[f"SciPy, guards, again after {every}"] = lambda inverse, every=every: of_scipy(  # type: ignore[misc]
            K, M, inverse, count, GUARDS, every
        )
    makers["SciPy, no guards, 60 iterations"] = lambda inverse: of_scipy(K, M, inverse, count, 0, 60)
    rows = [measured(name, make, solver, true, (K, M)) for name, make in makers.items()]
    return {"unknowns": K.shape[0], "modes": count, "rows": rows}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--meshes", type=int, default=3)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    found = []
    for divisions in MESHES[: given.meshes]:
        found.append(one(divisions))
        (given.out / "bench_lobpcg.json").write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
