"""Choice of a matrix's solver: estimates beforehand, a choice that is logged, the next one where it fails.

All solvers have one interface, made once and solved with many times:

| name | what it is | from |
|---|---|---|
| superlu | LU with an ordering for symmetric patterns | SciPy |
| multifrontal | L L^T of dense fronts, nested dissection (see `multifrontal.py`) | LAPACK |
| pardiso | L D L^T of the Intel MKL | pypardiso (extra `large`) |
| pardiso_single | L L^T in single precision under conjugate gradients in double: half the memory | the same |
| | where most rows have neither mass nor load, of those alone (see `condensed.py`) | |
| multigrid | conjugate gradients under smoothed aggregation, no factors | pyamg |

MUMPS is left out: the one wheel of python-mumps (0.0.2) needs NumPy 1, and needs a compiler otherwise.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Protocol

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ReductionError
from romdam.core.machine import memory_limit, shown_size
from romdam.linalg.condensed import CondensedSingle, is_condensable
from romdam.linalg.factor import Factor
from romdam.linalg.multifrontal import Multifrontal
from romdam.linalg.multigrid import Motions, Multigrid
from romdam.linalg.pardiso import PardisoFactor, PardisoSingle
from romdam.linalg.symmetric import Symmetric, upper, whole

log = logging.getLogger(__name__)


SMALL = 5_000  # unknowns up to which SuperLU is quicker than dense fronts
_OWN = 20_000  # up to which one of these two is taken, so that a small job gives the same with any extra
_WRONG = 1e-3  # error of a trial solve, relative to the answer: a matrix that spans 13 decades or more
_MODULE = {
    "superlu": "scipy",
    "multifrontal": "scipy",
    "pardiso": "pypardiso",
    "pardiso_single": "pypardiso",
    "multigrid": "pyamg",
}


class Solver(Protocol):
    """Solves with one matrix as often as asked."""

    size: int

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        ...


@dataclass(frozen=True)
class Solving:
    """A solver, and the bytes it may take: None for four fifths of the machine's."""

    solver: str = "auto"
    memory: float | None = None

    @property
    def limit(self) -> float:
        """Bytes that may be taken."""
        return memory_limit(self.memory)


AUTO = Solving()


@dataclass(frozen=True)
class Estimate:
    """Cost of a reduction with a solver: seconds on one core, bytes with the matrices and modes."""

    solver: str
    seconds: float
    memory: float


@dataclass(frozen=True)
class _Growth:
    """Fitted on tet10 cubes, cantilevers and an arch dam: value = at_million * (unknowns / 1e6)^exponent."""

    at_million: float
    exponent: float

    def __call__(self, unknowns: int) -> float:
        return self.at_million * (unknowns / 1e6) ** self.exponent


# name -> seconds to make, seconds for a column, bytes
_FITS = {
    "superlu": (_Growth(18000.0, 2.2), _Growth(5.0, 1.5), _Growth(80e9, 1.5)),
    "multifrontal": (_Growth(830.0, 2.0), _Growth(0.33, 1.33), _Growth(40e9, 1.33)),
    "pardiso": (_Growth(620.0, 1.5), _Growth(0.7, 0.95), _Growth(22e9, 1.2)),
    "pardiso_single": (_Growth(370.0, 1.35), _Growth(1.5, 1.0), _Growth(11.7e9, 0.95)),
    "multigrid": (_Growth(40.0, 1.0), _Growth(3.5, 1.0), _Growth(6e9, 0.9)),
}


def estimates(unknowns: int, columns: int) -> list[Estimate]:
    """Cost of so many right-hand sides with every solver that is installed, the quickest first.

    Good to a factor of two for solid elements: the fits are of tet10 blocks on this package's benchmark.
    """
    costs = [
        Estimate(name, make(unknowns) + columns * column(unknowns), memory(unknowns))
        for name, (make, column, memory) in _FITS.items()
        if find_spec(_MODULE[name]) is not None
    ]
    direct = ("superlu" if unknowns <= SMALL else "multifrontal") if unknowns <= _OWN else None
    return sorted(costs, key=lambda e: (e.solver != direct, e.seconds))


def candidates(unknowns: int, columns: int, solving: Solving, location: str) -> list[Estimate]:
    """The solvers that fit in memory, the one to be tried first in front.

    Raises
    ------
    ReductionError
        where none fits, or the one that is asked for is not installed or does not fit.
    """
    costs = estimates(unknowns, columns)
    wanted = [e for e in costs if solving.solver in ("auto", e.solver)]
    if not wanted:
        raise ReductionError(
            f"{location}: model.solver: {solving.solver} needs {_MODULE[solving.solver]}, which is not "
            "installed; pip install 'romdam[large]', or set model.solver: auto"
        )
    fit = [e for e in wanted if e.memory <= solving.limit]
    if not fit:
        limit = shown_size(solving.limit)
        named = "model.memory" if solving.memory is not None else "four fifths of this machine's memory"
        needs = ", ".join(f"{e.solver} {shown_size(e.memory)}" for e in wanted)
        least = min(costs, key=lambda e: e.memory)
        bytes_of = [_FITS[e.solver][2] for e in wanted]
        most = max(
            1e6 * (solving.limit / bytes_.at_million) ** (1.0 / bytes_.exponent) for bytes_ in bytes_of
        )
        scale = 10 ** max(int(np.log10(max(most, 1.0))) - 1, 0)
        other = (
            ""
            if least in wanted
            else f"model.solver: {least.solver}, which needs {shown_size(least.memory)}; "
        )
        raise ReductionError(
            f"{location}: {unknowns} unknowns need more than {named} = {limit} (estimated: {needs}); "
            f"{other}give at least {shown_size(1.05 * least.memory)}, or a mesh of at most about "
            f"{int(most / scale) * scale} unknowns"
        )
    others = [e for e in costs if e.memory <= solving.limit and e not in fit]
    return fit + others


def without_factors(unknowns: int, columns: int, solving: Solving, location: str) -> str:
    """Say that a matrix is solved by multigrid because no factors fit in memory; empty where they do.

    Raises
    ------
    ReductionError
        as `candidates` does.
    """
    chosen = candidates(unknowns, columns, solving, location)[0]
    factors = [e for e in estimates(unknowns, columns) if e.solver != "multigrid"]
    if chosen.solver != "multigrid" or any(e.memory <= solving.limit for e in factors):
        return ""
    needs = ", ".join(f"{e.solver} {shown_size(e.memory)}" for e in factors)
    return (
        f"{location}: multigrid for {unknowns} unknowns, factors do not fit in {shown_size(solving.limit)} "
        f"(estimated: {needs}); about {chosen.seconds:.0f} s"
    )


def make_solver(
    matrix: csr_matrix | Symmetric,
    motions: Motions,
    columns: int,
    solving: Solving,
    location: str,
    inner: Bools | None = None,
) -> Solver:
    """Make the best solver for a symmetric positive definite matrix and so many right-hand sides.

    Parameters
    ----------
    motions : of the matrix' rows
    location : what to call the matrix in messages
    inner : rows without mass and load, if any

    Raises
    ------
    ReductionError
        where none fits, or all fail; the message is the last one's.
    """
    if not matrix.shape[0]:
        return Factor(whole(matrix))
    makers: dict[str, Callable[[], Solver]] = {
        "superlu": lambda: Factor(whole(matrix)),
        "multifrontal": lambda: Multifrontal(whole(matrix), motions.row // 3, inner),
        "pardiso": lambda: PardisoFactor(upper(matrix), solving.limit),
        "pardiso_single": lambda: (
            PardisoSingle(matrix, solving.limit)
            if inner is None or not is_condensable(matrix, inner)
            else CondensedSingle(matrix, inner, solving.limit)
        ),
        "multigrid": lambda: Multigrid(whole(matrix), motions),
    }
    tried = candidates(matrix.shape[0], columns, solving, location)
    for k, estimate in enumerate(tried):
        log.info(
            "%s: %s for %d unknowns and %d right-hand sides (estimated %.0f s, %s%s)",
            location, estimate.solver, matrix.shape[0], columns, estimate.seconds,
            shown_size(estimate.memory),
            "".join(f"; {e.solver}: {e.seconds:.0f} s, {shown_size(e.memory)}" for e in tried[k + 1 :]),
        )  # fmt: skip
        try:
            solver = makers[estimate.solver]()
            known = np.random.default_rng(0).standard_normal(solver.size)
            off = float(np.linalg.norm(solver.solve(matrix @ known) - known) / np.linalg.norm(known))
            if off < _WRONG:
                return solver
            raise ReductionError(
                f"a stiffness matrix of {solver.size} unknowns is singular or nearly so (a trial solve is "
                f"{off:.2g} of the answer off, limit {_WRONG:g}); look for nodes that no element uses, for "
                "missing supports and for elements that hang loose"
            )
        except (ReductionError, MemoryError) as error:
            if k == len(tried) - 1:
                raise ReductionError(f"{location}: {error or 'out of memory'}") from error
            log.warning("%s: %s gives way to %s: %s", location, estimate.solver, tried[k + 1].solver, error)
    raise AssertionError("unreachable")
