"""Contacts that have long stuck are condensed: the same forces, fewer sweeps, released where they slide."""

import numpy as np
import pytest
from gap_problems import TOLERANCE, random_case, solve_step

from romdam.contact.problem import gap_memory
from romdam.contact.solvers.condensation import note_sticking, release, release_sliding
from romdam.contact.solvers.state import forget_product
from romdam.contact.step import commit_gaps
from romdam.core.recorded import new_gap_arrays


def _pressed(n, seed, steps):
    """A case, and free jumps of gaps that are pressed and rubbed, more and more until they slide and open."""
    case = random_case(seed, n, mu=(0.6, 0.6), coupling=0.5, floor=0.1)
    rng = np.random.default_rng(seed)
    rest = np.zeros(3 * n)
    rest[::3] = -1e-3 * (0.5 + rng.random(n))
    slow, quick = 1e-3 * rng.standard_normal((2, 3 * n))
    t = np.linspace(0.0, 1.0, steps)[:, None]
    growth = np.where(t < 0.5, 0.2, 2.0)
    return case, rest + growth * np.sin(20 * t) * slow + 0.1 * np.sin(300 * t) * quick


def _steps(case, jumps, condense):
    """(forces and condensed contacts at every step, solver state); else no contact has stuck for long."""
    problem, n = case.problem, len(case.gap)
    memory = gap_memory(problem)
    gaps = new_gap_arrays(n, 3)
    forces, condensed = [], []
    for w_free in jumps:
        if not condense:
            memory.solver.sticking.wait[:] = 10**9
        y, residual = solve_step(problem, memory, w_free)
        assert residual <= TOLERANCE
        commit_gaps(problem, memory, y, gaps)
        forces.append(gaps.traction.copy())
        condensed.append(int(memory.solver.sticking.counts.number))
    return np.array(forces), np.array(condensed), memory.solver


@pytest.mark.parametrize("n", [6, 40])
@pytest.mark.parametrize("seed", range(3))
def test_condensed_contacts_carry_the_same_force(n, seed):
    case, jumps = _pressed(n, seed, 300)
    found, condensed, solver = _steps(case, jumps, condense=True)
    wanted, never, other = _steps(case, jumps, condense=False)
    assert not never.any()
    assert condensed[:100].mean() > 0.5 * n  # they stick from the start
    assert condensed.min() < condensed.max()  # and are released
    assert np.abs(found - wanted).max() <= 10 * TOLERANCE * np.abs(wanted).max()
    assert solver.sweeps.counts.iterations < other.sweeps.counts.iterations
    assert 0 < solver.sticking.counts.total <= condensed.sum()


def test_the_pivot_is_the_principal_one_and_is_undone_contact_by_contact():
    case = random_case(3, 10, mu=(0.6, 0.6), coupling=0.5, floor=0.1)
    problem, memory = case.problem, gap_memory(case.problem)
    W, chosen = problem.W, np.array([0, 2, 3, 7])
    memory.force[0::3] = np.where(np.isin(np.arange(10), chosen), 1.0, 0.0)
    sticking = memory.solver.sticking
    note_sticking(W, memory.limits, memory.solver, memory.force)
    assert list(np.flatnonzero(sticking.condensed)) == list(chosen)
    M = sticking.pivot
    h = np.flatnonzero(np.repeat(sticking.condensed, 3))
    f = np.flatnonzero(~np.repeat(sticking.condensed, 3))
    Z = np.linalg.inv(W[np.ix_(h, h)])
    X = Z @ W[np.ix_(h, f)]
    for found, wanted in (
        (M[np.ix_(h, h)], Z),
        (M[np.ix_(h, f)], -X),
        (M[np.ix_(f, h)], X.T),
        (M[np.ix_(f, f)], W[np.ix_(f, f)] - W[np.ix_(f, h)] @ X),
    ):
        assert np.abs(found - wanted).max() <= 1e-6 * np.abs(wanted).max()
    for some in ([0], [2, 7], [3]):
        release(memory.solver, np.isin(np.arange(10), some))
    assert sticking.counts.number == 0
    assert np.abs(M - W).max() <= 1e-5 * np.abs(W).max()


@pytest.mark.parametrize(("directions", "moves"), [(9, 1.0), (50, 0.0)])
def test_contacts_that_determine_each_other_are_not_condensed(directions, moves):
    """Rigid gaps, four times as many as H has directions, or one direction without any: W has no inverse."""
    case = random_case(1, 12, mu=(0.6, 0.6), K_n=np.inf, K_s=0.0, floor=0.0)
    A = np.random.default_rng(1).standard_normal((36, directions))
    A[1] *= moves
    problem = case.problem._replace(W=1e-9 * (A @ A.T))
    memory = gap_memory(problem)
    memory.force[0::3] = 1.0
    note_sticking(problem.W, memory.limits, memory.solver, memory.force)
    assert memory.solver.sticking.counts.number == 0 and not memory.solver.sticking.condensed.any()


def _eighteen_condensed():
    """(limits, memory) of 24 gaps of which 18 are condensed, one a hundredth below its limit of 0.6 N."""
    case = random_case(3, 24, mu=(0.6, 0.6), coupling=0.5, floor=0.1)
    problem, memory = case.problem, gap_memory(case.problem)
    memory.force[0 : 3 * 18 : 3] = 1.0
    note_sticking(problem.W, memory.limits, memory.solver, memory.force)
    assert list(np.flatnonzero(memory.solver.sticking.condensed)) == list(range(18))
    memory.force[9:12] = 1.0, 0.0, 0.594
    return memory.limits, memory


def test_what_passes_its_limit_is_released_and_nothing_else():
    """Of the condensed contacts one slides and one is pulled."""
    limits, memory = _eighteen_condensed()
    memory.force[3:6] = 1.0, 0.48, 0.48
    memory.force[6:9] = -0.5, 0.1, 0.0
    release_sliding(limits, memory.solver, memory.force)
    sticking = memory.solver.sticking
    assert list(np.flatnonzero(sticking.condensed)) == [0, *range(3, 18)] and sticking.counts.number == 16
    assert memory.force[3:6] == pytest.approx([1.0, 0.6 / np.sqrt(2.0), 0.6 / np.sqrt(2.0)])
    assert not memory.force[6:9].any()
    assert list(memory.force[9:12]) == [1.0, 0.0, 0.594]


def test_where_many_are_released_at_once_all_are():
    limits, memory = _eighteen_condensed()
    memory.force[0:9:3] = -1.0
    release_sliding(limits, memory.solver, memory.force)
    assert not memory.solver.sticking.condensed.any() and memory.solver.sticking.counts.number == 0
    assert not memory.force[0:9].any() and (memory.force[9:54:3] == 1.0).all()


def test_a_forgotten_product_is_not_used():
    """Under large free motions W times the last force would leave its round-off in the next response."""
    case = random_case(5, 10, mu=(0.6, 0.6), coupling=0.5, floor=0.1)
    problem, memory = case.problem, gap_memory(case.problem)
    wanted, _ = solve_step(problem, memory, case.w_free)
    memory.solver.sweeps.product[:] = 1.0
    forget_product(memory.solver)
    found, residual = solve_step(problem, memory, case.w_free)
    assert residual <= TOLERANCE and np.abs(found - wanted).max() <= 1e-6 * np.abs(wanted).max()
