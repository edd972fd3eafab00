"""What the contact solvers remember from step to step.

Successive steps have nearly the same closed gaps and forces. So each solver keeps what it has computed (an
inverse on the closed gaps, a gathered matrix, the last force and its response) and begins the next step with
it. Every solver has a NamedTuple of arrays for this, which it changes in place; zeros are a valid beginning.
The arrays may have leading axes (runs, step sizes), of which `romdam.core.arrays.at` takes views. Scratch
arrays are written and read within one call.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints, Record, Singles, record_type

CLOSED_SET, OPEN_SET = 0, 1  # the active sets of the two ways to solve without friction
SET_FORCE, SET_RIGHT, SOLUTION = 0, 1, 2  # rows of the pivoting's scratch
SWEPT, START, PUT_BACK = 0, 1, 2  # rows of the sweeps' scratch

PIVOTING = record_type(number=int, updates=int, iterations=int, most_iterations=int, largest=float)
SWEEPS = record_type(
    gathered=int, known=bool, hasty=bool, newton_steps=int, iterations=int, most_iterations=int
)
CONDENSED = record_type(number=int, total=int)


class PivotingState(NamedTuple):
    """The inverse of W (or Z) on an active set of gaps, see `romdam.contact.solvers.pivoting`.

    In a memory there are two, one after the other: the closed gaps with W, the open ones with Z.

    Attributes
    ----------
    active, wanted : (n,) whether a gap is in the set, and whether it is to be
    inverse : (n, n) the inverse on the set in its leading rows
    order : (n,) the gaps of the set in the order of those rows
    counts : `PIVOTING`: gaps in the set, its changes since the inverse was made anew, in all, most in a step;
        the largest entry on the diagonal of W (or Z), zero before it is known
    scratch : (3, n) forces on the set, a right-hand side, forces and openings of all gaps
    """

    active: Bools
    wanted: Bools
    inverse: Floats
    order: Ints
    counts: Record
    scratch: Floats


class GaussSeidelState(NamedTuple):
    """W on the gaps that may carry force, and the last solution, see `romdam.contact.solvers.gauss_seidel`.

    Attributes
    ----------
    gathered : (n,) whether a gap is in the block
    order : (n,) the gathered gaps in the order of the block's rows
    block : (N, N) W, or its pivot on the condensed contacts, on the gathered gaps in its leading rows
    force, product : (N,) force of the last solution, and W times it [N], [m]
    counts : `SWEEPS`: gathered gaps, whether `product` is known, whether to give up where Newton does not
        converge, steps that needed Newton, sweeps and iterations in all and the most in a step
    scratch : (3, N) forces of the sweeps, where these began, response with the condensed contacts put back
    """

    gathered: Bools
    order: Ints
    block: Singles
    force: Floats
    product: Floats
    counts: Record
    scratch: Floats


class CondensedState(NamedTuple):
    """Sticking contacts that are eliminated, see `romdam.contact.solvers.condensation`.

    Attributes
    ----------
    condensed : (n,) whether a contact is
    wait : (n,) for how many more solutions a contact has to stick before it is worth condensing
    pivot : (N, N) the principal pivot of W on the condensed contacts
    counts : `CONDENSED`: condensed contacts now, and their sum over the solutions
    """

    condensed: Bools
    wait: Ints
    pivot: Singles
    counts: Record


class FrictionalState(NamedTuple):
    """State of the solver with friction."""

    sweeps: GaussSeidelState
    sticking: CondensedState


SolverState = PivotingState | FrictionalState


def solver_state(n: int, frictional: bool, lead: tuple[int, ...] = ()) -> SolverState:
    """Make a fresh state for n gaps.

    Parameters
    ----------
    frictional : whether the gaps have shear
    lead : leading axes of every array
    """
    N = 3 * n
    if not frictional:
        sets = (*lead, 2)
        return PivotingState(
            active=np.zeros((*sets, n), dtype=np.bool_),
            wanted=np.zeros((*sets, n), dtype=np.bool_),
            inverse=np.zeros((*sets, n, n)),
            order=np.zeros((*sets, n), dtype=np.int64),
            counts=np.zeros(sets, PIVOTING),
            scratch=np.zeros((*sets, 3, n)),
        )
    sweeps = GaussSeidelState(
        gathered=np.zeros((*lead, n), dtype=np.bool_),
        order=np.zeros((*lead, n), dtype=np.int64),
        block=np.zeros((*lead, N, N), dtype=np.float32),
        force=np.zeros((*lead, N)),
        product=np.zeros((*lead, N)),
        counts=np.zeros(lead, SWEEPS)[()],
        scratch=np.zeros((*lead, 3, N)),
    )
    sticking = CondensedState(
        condensed=np.zeros((*lead, n), dtype=np.bool_),
        wait=np.zeros((*lead, n), dtype=np.int64),  # what sticks at first is taken for long stuck
        pivot=np.zeros((*lead, N, N), dtype=np.float32),
        counts=np.zeros(lead, CONDENSED)[()],
    )
    return FrictionalState(sweeps, sticking)


def forget_product(solver: SolverState) -> None:
    """Take W times the last solution for unknown: under large free motions it would leave its round-off."""
    if isinstance(solver, FrictionalState):
        solver.sweeps.counts.known = False


def make_hasty(solver: SolverState, hasty: bool) -> None:
    """Let the solver give up where Newton does not converge, or try what is slower still."""
    if isinstance(solver, FrictionalState):
        solver.sweeps.counts.hasty = hasty


def iterations(solver: SolverState) -> tuple[float, float]:
    """Iterations of all steps (changes of side without friction), and the most in a step."""
    counts = solver.sweeps.counts if isinstance(solver, FrictionalState) else solver.counts
    return float(np.sum(counts["iterations"])), float(np.max(counts["most_iterations"], initial=0))


def condensed_contacts(solver: SolverState) -> float:
    """Condensed contacts, summed over the solutions."""
    return float(np.sum(solver.sticking.counts["total"])) if isinstance(solver, FrictionalState) else 0.0
