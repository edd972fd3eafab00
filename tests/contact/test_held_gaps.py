"""Gaps that are long stuck are eliminated: the same forces, fewer sweeps, and let go once they are not."""

import numpy as np
import pytest
from gap_problems import TOLERANCE, random_case, solve_step

from romdam.contact.problem import gap_memory
from romdam.contact.solvers.condensation import let_go, let_go_where_not_stuck, note_stuck, tableau
from romdam.contact.step import commit_gaps


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


def _march(case, jumps, hold):
    """(forces at every step, held gaps at every step, memory); without `hold` no gap is stuck for long."""
    problem, n = case.problem, len(case.gap)
    memory = gap_memory(problem)
    jump, force, state = np.empty((n, 3)), np.empty((n, 3)), np.empty(n, dtype=np.uint8)
    forces, held = [], []
    for w_free in jumps:
        if not hold:
            memory.order[1] = -(10**9)
        y, residual = solve_step(problem, memory, w_free)
        assert residual <= TOLERANCE
        commit_gaps(problem, memory, y, jump, force, state)
        forces.append(force.copy())
        held.append(int(memory.counts[1, 0]))
    return np.array(forces), np.array(held), memory


@pytest.mark.parametrize("n", [6, 40])
@pytest.mark.parametrize("seed", range(3))
def test_held_gaps_carry_the_same_force(n, seed):
    case, jumps = _pressed(n, seed, 300)
    found, held, memory = _march(case, jumps, hold=True)
    wanted, never, other = _march(case, jumps, hold=False)
    assert not never.any()
    assert held[:100].mean() > 0.5 * n  # stuck from the start
    assert held.min() < held.max()  # and let go
    assert np.abs(found - wanted).max() <= 10 * TOLERANCE * np.abs(wanted).max()
    assert memory.counts[0, 2] < other.counts[0, 2]  # sweeps
    assert 0 < memory.counts[1, 1] <= held.sum()


def test_the_tableau_is_the_principal_pivot_and_is_undone_gap_by_gap():
    case = random_case(3, 10, mu=(0.6, 0.6), coupling=0.5, floor=0.1)
    problem, memory = case.problem, gap_memory(case.problem)
    W, held = problem.W, np.array([0, 2, 3, 7])
    memory.force[0::3] = np.where(np.isin(np.arange(10), held), 1.0, 0.0)
    note_stuck(W, memory.limits, memory)
    assert list(np.flatnonzero(memory.active[1])) == list(held)
    M = tableau(memory)[:, :30]
    h = np.flatnonzero(np.repeat(memory.active[1], 3))
    f = np.flatnonzero(~np.repeat(memory.active[1], 3))
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
        let_go(memory, 30, np.isin(np.arange(10), some))
    assert memory.counts[1, 0] == 0
    assert np.abs(M - W).max() <= 1e-5 * np.abs(W).max()


@pytest.mark.parametrize(("directions", "moves"), [(9, 1.0), (50, 0.0)])
def test_gaps_that_determine_each_other_are_not_held(directions, moves):
    """Rigid gaps, four times as many as H has directions, or one direction without any: W has no inverse."""
    case = random_case(1, 12, mu=(0.6, 0.6), K_n=np.inf, K_s=0.0, floor=0.0)
    A = np.random.default_rng(1).standard_normal((36, directions))
    A[1] *= moves
    problem = case.problem._replace(W=1e-9 * (A @ A.T))
    memory = gap_memory(problem)
    memory.force[0::3] = 1.0
    note_stuck(problem.W, memory.limits, memory)
    assert memory.counts[1, 0] == 0 and not memory.active[1].any()


def _eighteen_held():
    """(limits, memory) of 24 gaps of which 18 are held, one a hundredth below its limit of 0.6 N."""
    case = random_case(3, 24, mu=(0.6, 0.6), coupling=0.5, floor=0.1)
    problem, memory = case.problem, gap_memory(case.problem)
    memory.force[0 : 3 * 18 : 3] = 1.0
    note_stuck(problem.W, memory.limits, memory)
    assert list(np.flatnonzero(memory.active[1])) == list(range(18))
    memory.force[9:12] = 1.0, 0.0, 0.594
    return memory.limits, memory


def test_what_passes_its_limit_is_let_go_and_nothing_else():
    """Of the held gaps one slides and one is pulled."""
    limits, memory = _eighteen_held()
    memory.force[3:6] = 1.0, 0.48, 0.48
    memory.force[6:9] = -0.5, 0.1, 0.0
    let_go_where_not_stuck(limits, memory)
    assert list(np.flatnonzero(memory.active[1])) == [0, *range(3, 18)] and memory.counts[1, 0] == 16
    assert memory.force[3:6] == pytest.approx([1.0, 0.6 / np.sqrt(2.0), 0.6 / np.sqrt(2.0)])
    assert not memory.force[6:9].any()
    assert list(memory.force[9:12]) == [1.0, 0.0, 0.594]


def test_where_many_go_at_once_none_stays_held():
    limits, memory = _eighteen_held()
    memory.force[0:9:3] = -1.0
    let_go_where_not_stuck(limits, memory)
    assert not memory.active[1].any() and memory.counts[1, 0] == 0
    assert not memory.force[0:9].any() and (memory.force[9:54:3] == 1.0).all()
