"""Lowest eigenpairs of K x = omega^2 M x."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix, spmatrix

from romdam.core.arrays import Floats
from romdam.core.errors import ReductionError
from romdam.linalg.condensed import CondensedSingle
from romdam.linalg.conjugate import WIDTH
from romdam.linalg.dense import eigh
from romdam.linalg.factor import Factor
from romdam.linalg.modes.flexibility import Flexibility
from romdam.linalg.modes.krylov import krylov_modes, narrow_modes, ritz_vectors
from romdam.linalg.modes.lobpcg import Pencil, Wanted, block_modes
from romdam.linalg.multifrontal import Multifrontal
from romdam.linalg.multigrid import Multigrid
from romdam.linalg.solvers import SMALL, Solver
from romdam.linalg.symmetric import Symmetric

_DENSE_SHARE = 0.4  # of all pairs, above which a dense solve is quicker than Lanczos
_DENSE_SIZE = 300  # unknowns, below which it always is
_MASSLESS = 1e-13  # 1/omega2 relative to the lowest mode's, below which it is round-off of none
_SPARE = 2  # modes asked for beyond those counted below a frequency, so that the next one is seen
_DENSE_LIMIT = 12_000  # unknowns of a dense solve: 2.3 GB for the two matrices


def lowest_modes(
    K: spmatrix, M: spmatrix, count: int, solver: Solver, shift: float = 0.0
) -> tuple[Floats, Floats]:
    """Lowest modes: by shift-invert Lanczos on a factorisation that exists, or by LOBPCG under multigrid.

    Up to 5,000 unknowns Lanczos takes four vectors at once, above sixteen.

    Parameters
    ----------
    K, M : (n, n) sparse, symmetric; a zero on the diagonal of M is an unknown without mass
    count : number of modes, at most as many as unknowns with mass
    solver : of K - shift M
    shift : [1/s2]; negative where K is singular

    Returns
    -------
    omega2 : (count,) ascending [1/s2]
    modes : (n, count), M-orthonormal

    Raises
    ------
    ReductionError
        where Lanczos misses a mode, or a dense solve would not fit.
    """
    n = K.shape[0]
    moving = np.flatnonzero(M.diagonal() > 0.0)
    count = min(count, len(moving))
    if count == 0:
        return np.zeros(0), np.zeros((n, 0))
    if n <= _DENSE_SIZE or count > _DENSE_SHARE * len(moving):
        if len(moving) == n:
            omega2, modes = dense_modes(K, M)
            return omega2[:count], modes[:, :count]
        # from the flexibility D of the unknowns with mass, where (K - shift M) u = (omega^2 - shift) M u
        # leaves D M u = u / (omega^2 - shift)
        _refuse_too_many(len(moving))
        M_moving = csr_matrix(M)[moving][:, moving].toarray()
        unit = np.zeros((n, len(moving)))
        unit[moving, np.arange(len(moving))] = 1.0
        D = solver.solve(unit)[moving]
        mu, V = eigh(0.5 * (D + D.T), M_moving, kind=2)
        finite = np.flatnonzero(mu > _MASSLESS * mu[-1])[::-1]
        modes = solver.solve(unit @ (M_moving @ V[:, finite])) / mu[finite]
        return (1.0 / mu[finite] + shift)[:count], modes[:, :count]
    if n > SMALL or isinstance(solver, Multigrid):
        return _large_modes(K, M, Wanted(count), solver, shift)
    return narrow_modes(Flexibility(csr_matrix(M), solver.solve, shift, K), count)


def modes_below(
    K: spmatrix, M: spmatrix, count: int | None, cutoff: float | None, solver: Solver, shift: float = 0.0
) -> tuple[Floats, Floats]:
    """Lowest modes: so many, or all below a frequency [Hz]; see `lowest_modes`.

    Those below a frequency are counted first, as the negative pivots of K - omega^2 M (Sylvester's inertia).
    Above 5,000 unknowns, where that factorisation would cost as much as all the rest, the iteration goes on
    until it is past the frequency, and random vectors look for a mode that it missed.
    """
    if count is not None or K.shape[0] == 0:
        return lowest_modes(K, M, count or 0, solver, shift)
    assert cutoff is not None
    limit = (2.0 * np.pi * cutoff) ** 2
    if K.shape[0] > SMALL or isinstance(solver, Multigrid):
        return _large_modes(K, M, Wanted(None, limit), solver, shift)
    count = min(_SPARE + Factor(K - limit * M).negative(), K.shape[0])
    while True:
        omega2, modes = lowest_modes(K, M, count, solver, shift)
        if len(omega2) < count or omega2[-1] > limit or count == K.shape[0]:
            keep = omega2 <= limit
            return omega2[keep], modes[:, keep]
        count = min(2 * count, K.shape[0])  # round-off in the pivots of a mode at the limit itself


def lowest_modes_by_blocks(
    K: spmatrix, M: spmatrix, count: int, solver: Solver, shift: float = 0.0
) -> tuple[Floats, Floats]:
    """As `lowest_modes`, by several vectors at once on every size: modes of one frequency are all there."""
    if K.shape[0] <= _DENSE_SIZE or count > _DENSE_SHARE * np.count_nonzero(M.diagonal()):
        return lowest_modes(K, M, count, solver, shift)
    return _large_modes(K, M, Wanted(count), solver, shift)


def _large_modes(
    K: spmatrix, M: spmatrix, wanted: Wanted, solver: Solver, shift: float
) -> tuple[Floats, Floats]:
    if isinstance(solver, Multigrid):
        return block_modes(Pencil(K, M, solver.precondition), wanted)
    (count, _), make = krylov_modes(Flexibility(csr_matrix(M), solver.solve, shift, K), wanted)
    modes = np.empty((K.shape[0], count))
    for first in range(0, count, WIDTH):
        modes[:, first : first + WIDTH] = make(first, min(first + WIDTH, count))
    return ritz_vectors(K, M, modes)


def span_of_modes(
    K: spmatrix | Symmetric,
    M: spmatrix,
    count: int | None,
    cutoff: float | None,
    solver: Solver,
    shift: float,
    beyond: float = 1.0,
    further: int = 0,
) -> tuple[tuple[int, int], Callable[[int, int], Floats]]:
    """Vectors that span the modes of `modes_below`, and some beyond, a few at a time.

    A large part's own modes would take as much memory as its stiffness, while the factors are there too.

    Parameters
    ----------
    count : so many modes; None for all below the cutoff
    cutoff : frequency [Hz]
    beyond : up to so many times the highest frequency more vectors are made, of modes or near them
    further : and at least so many, where a gap in the spectrum is there too

    Returns
    -------
    counts : how many modes, and how many vectors with those beyond
    make : make(first, last) gives that many, (n, last - first)
    """
    large = K.shape[0] > SMALL and not isinstance(solver, Multigrid)
    if large and (count is None or count < _DENSE_SHARE * K.shape[0]):
        wanted = Wanted(count, np.inf if cutoff is None else (2.0 * np.pi * cutoff) ** 2)
        if isinstance(solver, CondensedSingle | Multifrontal) and len(solver.outer) < K.shape[0]:
            return _outer_modes(csr_matrix(M), wanted, solver, shift, beyond, further)
        return krylov_modes(Flexibility(csr_matrix(M), solver.solve, shift, K), wanted, beyond, further)
    omega2, modes = modes_below(K, M, count, cutoff, solver, shift)
    first = len(omega2)
    if beyond > 1.0 and first and omega2[-1] > 0.0:
        more = modes_below(K, M, None, beyond * np.sqrt(omega2[-1]) / (2.0 * np.pi), solver, shift)[1]
        modes = np.hstack([modes, more[:, first:]])
    if modes.shape[1] < first + further:
        more = lowest_modes(K, M, first + further, solver, shift)[1]
        modes = np.hstack([modes[:, :first], more[:, first:]])
    return (first, modes.shape[1]), lambda a, b: modes[:, a:b]


def _outer_modes(
    M: csr_matrix,
    wanted: Wanted,
    solver: CondensedSingle | Multifrontal,
    shift: float,
    beyond: float,
    further: int,
) -> tuple[tuple[int, int], Callable[[int, int], Floats]]:
    """`span_of_modes` where all mass is on the solver's outer rows: modes of those, then carried inside."""
    M_outer = csr_matrix(M[solver.outer][:, solver.outer])
    if isinstance(solver, CondensedSingle):
        (count, _), make = krylov_modes(Flexibility(M_outer, solver.near.solve, shift), wanted)
        vectors = make(0, count)
        del make  # it holds the factors that are to go
        if count:
            solver.sharpen(vectors)
        del vectors
    counts, make = krylov_modes(Flexibility(M_outer, solver.near.solve, shift), wanted, beyond, further)

    def over_all(first: int, last: int) -> Floats:
        forces = np.zeros((M.shape[0], last - first))
        forces[solver.outer] = M_outer @ make(first, last)
        return solver.solve(forces)

    return counts, over_all


def _refuse_too_many(size: int) -> None:
    if size > _DENSE_LIMIT:
        raise ReductionError(
            f"all modes of {size} unknowns need a dense solve, limited to {_DENSE_LIMIT} unknowns; "
            "ask for fewer modes"
        )


def dense_modes(K: spmatrix, M: spmatrix) -> tuple[Floats, Floats]:
    """All modes by a dense solve.

    Raises
    ------
    ReductionError
        above 12,000 unknowns, and where some have no mass.
    """
    n = K.shape[0]
    _refuse_too_many(n)
    try:
        omega2, modes = eigh(K.toarray(), M.toarray())
    except LinAlgError as error:
        raise ReductionError(
            f"all modes of {n} unknowns need mass at each, {int((M.diagonal() <= 0.0).sum())} have "
            f"none ({error}); ask for a `cutoff`, or give the rock its mass"
        ) from error
    return omega2, modes
