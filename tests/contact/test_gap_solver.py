"""The gap-space problem of all gaps: its solution against the laws, and what the solver carries along."""

import dataclasses

import numpy as np
import pytest
from further_laws import lost
from gap_problems import TOLERANCE, Case, check, random_case, solve, solve_step
from hypothesis import example, given, settings
from hypothesis import strategies as st
from point_law import LAWS, Past

from romdam.contact.cone import project_shear
from romdam.contact.problem import gap_memory, gap_problem
from romdam.contact.solvers import continuation
from romdam.contact.solvers import gauss_seidel as frictional
from romdam.contact.solvers.newton import natural_residuals, worst_gap
from romdam.contact.solvers.single_contact import solve_gap
from romdam.contact.step import commit_gaps, solve_gaps
from romdam.core.errors import ConfigError
from romdam.core.recorded import new_gap_arrays
from romdam.core.system import OPEN, SLIP, STICK, GapLaw

_SEED, _GAPS = st.integers(0, 2**31), st.integers(1, 60)
# of the case's flexibility 1e-9 m/N: a thousandth to ten times its inverse, and rigid
_NORMAL = st.one_of(st.floats(6.0, 10.0).map(lambda x: 10.0**x), st.just(np.inf))


@given(seed=_SEED, n=_GAPS, K_n=_NORMAL, share=st.one_of(st.just(0.0), st.floats(1e-6, 0.9)))
@settings(max_examples=150, deadline=None)
def test_frictionless_solution_satisfies_the_law(seed, n, K_n, share):
    K_nz = share * (1e9 if np.isinf(K_n) else K_n)
    case = random_case(seed, n, K_n=K_n, K_nz=K_nz)
    jump, force, state, _, stored, friction = solve(case)
    check(case, jump, force, state)
    assert friction == 0.0
    by_hand = 0.5 * K_nz * np.maximum(jump[:, 0], 0.0) ** 2
    if np.isfinite(K_n):
        by_hand += 0.5 * K_n * np.minimum(jump[:, 0], 0.0) ** 2
    assert stored == pytest.approx(by_hand.sum(), rel=1e-6, abs=1e-12)
    if K_nz == 0.0:
        assert (force >= 0.0).all()


@given(
    seed=_SEED,
    n=st.integers(1, 20),
    mu=st.sampled_from([(0.3, 0.3), (0.6, 0.6), (0.3, 0.8), (0.0, 0.6)]),
    K_n=_NORMAL,
    share=st.sampled_from([0.0, 1e-3, 0.3]),
)
@settings(max_examples=150, deadline=None)
def test_frictional_solution_satisfies_the_law(seed, n, mu, K_n, share):
    K = 1e9 if np.isinf(K_n) else K_n
    case = random_case(seed, n, mu, K_n=K_n, K_nz=share * K, K_s=0.5 * K)
    jump, force, state, memory, stored, friction = solve(case)
    check(case, jump, force, state)
    K_s = case.stiffness[2]
    moved = memory.accumulated_slip - case.anchor
    work = -(force[:, 1:] * moved).sum()
    assert friction == pytest.approx(work, rel=1e-9, abs=1e-12)
    assert friction >= -1e-7 * np.abs(force).max() * 1e-3
    by_hand = (force[:, 1:] ** 2 / (2.0 * K_s[:, None])).sum() + 0.5 * share * K * (
        np.maximum(jump[:, 0], 0.0) ** 2
    ).sum()
    if np.isfinite(K_n):
        by_hand += 0.5 * K_n * (np.minimum(jump[:, 0], 0.0) ** 2).sum()
    assert stored == pytest.approx(by_hand, rel=1e-6, abs=1e-12)


_FURTHER = {  # law -> its parameters for n gaps, of forces about 1e6 N and jumps about 1 mm
    "bond": lambda n, mu: {
        "tensile_strength": np.linspace(0.0, 1e5, n),
        "cohesion": np.linspace(0.0, 1e5, n) * (max(mu) + 0.5) + 1e4,
    },
    "static_friction": lambda n, mu: {"friction_static": np.tile(np.array(mu) + 0.4, (n, 1))},
    "shear_key": lambda n, mu: {"shear_key": np.tile([3e-4, 1.0, 0.0], (n, 1))},
    "dashpot": lambda n, mu: {"viscosity": np.linspace(0.0, 1e6, n)},
    "velocity_friction": lambda n, mu: {"velocity": np.tile([0.1, max(mu) + 0.1, 0.3], (n, 1))},
    "slip_weakening": lambda n, mu: {"weakening": np.tile([0.1, max(mu) + 0.1, 1e-3], (n, 1))},
    "barton_bandis": lambda n, mu: {"rough": np.tile([10.0, 1e7, 0.5], (n, 1))},
}
_FURTHER["all"] = lambda n, mu: {
    **_FURTHER["static_friction"](n, mu),
    **_FURTHER["shear_key"](n, mu),
    **_FURTHER["dashpot"](n, mu),
    "tensile_strength": np.linspace(0.0, 1e5, n),
    "cohesion": np.linspace(0.0, 1e5, n) * (max(mu) + 0.4) + 1e4,
}


def test_every_law_is_solved_for():
    assert {*_FURTHER, "frictionless", "coulomb"} == set(LAWS)


@pytest.mark.parametrize("law", _FURTHER)
@given(seed=_SEED, n=st.integers(1, 12), mu=st.sampled_from([(0.0, 0.0), (0.6, 0.6), (0.3, 0.8)]))
@settings(max_examples=60, deadline=None)
def test_the_solution_satisfies_every_law(law, seed, n, mu):
    """Each gap against the point laws with what it has left, of which the step asks for no more."""
    plain = random_case(seed, n, mu if max(mu) > 0.0 or law == "dashpot" else (1e-9, 1e-9), coupling=0.3)
    case = dataclasses.replace(plain, laws=_FURTHER[law](n, mu))
    memory, rng = gap_memory(case.problem), np.random.default_rng(seed)
    memory.accumulated_slip[:] = case.anchor
    overlap = -1e-4 * rng.random(n)
    memory.spring[:: len(memory.spring) // n] = overlap
    first = lost(case.law, memory.history)
    jump, force, state, memory, _, _ = solve(case, memory)
    now = lost(case.law, memory.trial)
    assert (now >= first).all()
    left = [Past((0.0, 0.0), *map(bool, now[i]), overlap[i]) for i in range(n)]
    check(case, jump, force, state, left)


@pytest.mark.parametrize("mu", [(0.0, 0.0), (0.6, 0.6), (0.3, 0.8)], ids=str)
@pytest.mark.parametrize("K_n", [1e7, 1e9, 1e12, np.inf])
def test_within_the_step_no_gap_gives_more_than_it_took(K_n, mu):
    """Work done on the gaps in every step: at least what they store more, and what sliding takes."""
    for seed in range(20):
        case, rng = random_case(seed, 6, mu, K_n=K_n, K_s=min(K_n, 1e9) / 2), np.random.default_rng(seed)
        gap = np.abs(case.gap)
        problem = gap_problem(case.H, dataclasses.replace(case.law, gap=gap), 1e-3, 1.0)
        assert (problem.theta_ratio[:: len(problem.theta_ratio) // 6] > 0.0).all() == np.isfinite(K_n)
        memory, d = gap_memory(problem), len(case.w_free) // 6
        old, before = np.zeros((6, d)), 0.0
        old[:, 0] = gap
        gaps = new_gap_arrays(6, d)
        gaps.jump[:] = old
        jump, force = gaps.jump, gaps.traction
        for _ in range(30):
            y, residual = solve_step(problem, memory, 1e-3 * rng.standard_normal(6 * d))
            assert residual <= TOLERANCE
            stored, slid, _ = commit_gaps(problem, memory, y, gaps)
            taken = -(memory.force * (jump - old).ravel()).sum()
            size = np.abs(memory.force).max() * np.abs(jump - old).max() + stored
            assert slid >= -1e-7 * size
            assert taken - (stored - before) - slid >= -1e-7 * size
            springs = np.minimum(jump[:, 0], 0.0)
            if np.isfinite(K_n):
                assert np.abs(force[:, 0] + K_n * springs).max() <= 1e-9 * max(force[:, 0].max(), 1.0)
            if d == 3:
                check_limits(case.mu, force)
            old[:], before = jump, stored


def check_limits(mu, force):
    """No shear beyond friction: of the resultant where it is the same along both directions."""
    limit = mu * force[:, :1]
    shear = np.abs(force[:, 1:])
    if (mu[:, 0] == mu[:, 1]).all():
        shear = np.hypot(force[:, 1], force[:, 2])[:, None]
    assert (shear <= limit + 1e-9 * np.abs(force).max()).all()


@pytest.mark.parametrize("mu", [(1.0, 1.0), (2.0, 2.0), (0.3, 2.0)])
def test_large_friction_on_compliant_gaps(mu):
    for seed in range(40):
        case = random_case(seed, 1 + seed % 25, mu)
        check(case, *solve(case)[:3])


STIFF = [  # (seed, gaps, mu, K_n, K_s); found by trying 3,000 seeds each
    (1184, 1, (0.6, 0.6), 1e13, 1e13),
    (1796, 5, (0.6, 0.6), 1e13, 1e13),
    (106, 3, (1.0, 1.0), np.inf, 5e8),
    (504, 1, (1.0, 1.0), np.inf, 5e8),
    (403, 4, (2.0, 2.0), np.inf, 5e8),
    (553, 2, (2.0, 2.0), np.inf, 5e8),
    (129, 2, (0.3, 0.8), 1e13, 1e13),
    (175, 12, (0.8, 2.0), 1e13, 1e13),
]


@pytest.mark.parametrize(("seed", "n", "mu", "K_n", "K_s"), STIFF)
def test_stiff_gaps_with_strong_coupling_converge(seed, n, mu, K_n, K_s):
    """W is positive definite, so every one of these has a solution (Cadoux 2011; Acary, Cadoux, Lemarechal,
    Malick, ZAMM 91 (2011) 155)."""
    case = random_case(seed, n, mu, K_n=K_n, K_s=K_s)
    check(case, *solve(case)[:3])


@example(seed=25, n=21, K_n=1e14)  # round-off of a force turned its sign for ever
@example(seed=47, n=26, K_n=1e14)
@given(seed=_SEED, n=st.integers(2, 60), K_n=st.sampled_from([1e10, 1e14]))
@settings(max_examples=60, deadline=None)
def test_nearly_dependent_gaps(seed, n, K_n):
    """Neighbouring gaps of a smooth flexibility: H is singular to round-off (condition above 1e16)."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.random(n))
    H = 1e-9 * np.exp(-(((x[:, None] - x) / 0.3) ** 2))
    loaded = rng.random(n) < 0.5
    force, opening = np.where(loaded, 1e6 * rng.random(n), 0.0), np.where(loaded, 0.0, 1e-3 * rng.random(n))
    zero = np.zeros(n)
    case = Case(
        H=0.5 * (H + H.T),
        stiffness=(np.full(n, K_n), zero, zero),
        mu=np.zeros((n, 2)),
        gap=zero,
        anchor=np.zeros((0, 2)),
        w_free=opening - H @ force,
    )
    jump, found, _, _, _, _ = solve(case)
    assert (found >= 0.0).all()
    # the law, and the whole response, which is well determined even where the single forces are not
    assert np.abs(found[:, 0] - K_n * np.maximum(-jump[:, 0], 0.0)).max() <= 1e-6 * found.max() + K_n * 1e-13
    assert np.abs(case.w_free + H @ found[:, 0] - jump[:, 0]).max() <= 1e-9


# Found by search: all-at-once exchange from the open state comes back to a set it has seen. Every sign that
# it goes by has at least 0.15 of the largest value beside it, so that no rounding can turn one.
CYCLING = [
    ([[33, 29, -18], [29, 26, -17], [-18, -17, 14]], [-1, -4, 4]),
    ([[29, 31, -21], [31, 34, -21], [-21, -21, 18]], [7, 2, -8]),
    ([[33, 21, -8], [21, 14, -6], [-8, -6, 4]], [2, 9, -8]),
    ([[10, -9, -12], [-9, 10, 14], [-12, 14, 20]], [7, -6, -3]),
    ([[19, 18, -10], [18, 18, -9], [-10, -9, 6]], [-6, -1, 4]),
]


def _block_exchange_cycles(W, y):
    closed, seen = np.zeros(len(y), dtype=bool), set()
    while closed.tobytes() not in seen:
        seen.add(closed.tobytes())
        p = np.zeros(len(y))
        p[closed] = -np.linalg.solve(W[np.ix_(closed, closed)], y[closed])
        wrong = np.where(closed, p < 0.0, W @ p + y < 0.0)
        if not wrong.any():
            return False
        closed ^= wrong
    return True


@pytest.mark.parametrize(("H", "w_free"), CYCLING)
def test_rigid_gaps_where_exchanging_all_at_once_cycles(H, w_free):
    """The single exchanges must take over."""
    H, w_free = np.array(H, dtype=float), np.array(w_free, dtype=float)
    assert _block_exchange_cycles(H, w_free)
    zero = np.zeros(3)
    case = Case(H, (np.full(3, np.inf), zero, zero), np.zeros((3, 2)), zero, np.zeros((0, 2)), w_free)
    jump, force, state, _, _, _ = solve(case)
    check(case, jump, force, state)


def _free_response(case):
    """y_free of a case without tension stiffness."""
    y_free = case.w_free.copy()
    y_free[0::3] += case.gap
    y_free[1::3] -= case.anchor[:, 0]
    y_free[2::3] -= case.anchor[:, 1]
    return y_free


@pytest.mark.parametrize("mu", [(0.6, 0.6), (0.3, 0.8)])
def test_a_solution_is_a_fixed_point_of_the_gauss_seidel_sweep(mu):
    for seed in range(5):
        case = random_case(seed, 8, mu, coupling=0.3)
        problem = case.problem
        force = solve(case, problem=problem)[1].ravel()
        swept, limits, moved = force.copy(), gap_memory(problem).limits, np.zeros(24, dtype=np.float32)
        y = problem.W @ force + _free_response(case)
        frictional._sweep(problem.W.astype(np.float32), limits, np.arange(8), force, y, swept, moved)
        assert np.abs(swept - force).max() <= 1e-6 * force.max()


@pytest.mark.parametrize("seed", range(5))
def test_solution_is_followed_from_no_friction_where_all_else_fails(seed, monkeypatch):
    """Newton and the exact sweeps made to fail at the whole friction until half of it is solved."""
    case = random_case(seed, 8, (0.6, 0.6), coupling=0.3)
    y_free, wanted, memory = _free_response(case), solve(case)[1].ravel(), gap_memory(case.problem)
    shares = []

    def failing(real):
        def search(W, limits, *rest):
            share = limits.mu.max() / 0.6
            if share > 0.5 and max(shares, default=0.0) < 0.4:
                return np.inf
            shares.append(share)
            return real(W, limits, *rest)

        return search

    monkeypatch.setattr(continuation, "newton", failing(continuation.newton))
    monkeypatch.setattr(continuation, "exact_sweeps", failing(continuation.exact_sweeps))
    monkeypatch.setattr(continuation, "newton_and_sweeps", continuation.newton_and_sweeps.py_func)
    search = continuation.continue_from_no_friction.py_func
    residual = search(case.problem.W, memory.limits, memory, y_free, y_free.copy(), TOLERANCE)
    assert shares[0] == pytest.approx(0.1) and shares[-1] == 1.0 and residual <= TOLERANCE
    assert np.abs(memory.force - wanted).max() <= 1e-6 * wanted.max()


# Three gaps of the 300 of five monoliths of Koyna, at 8.41 s, where the run stopped, the forces of the others
# as they were: two gaps of a base and one of the contraction joint. W, y_free, the force before.
MONOLITHS = (
    [
        [0.8538, 2.502e-2, 7.435e-2, -7.583e-2, 2.501e-2, -0.5196, 0.3233, 1.448e-5, -1.489e-3],
        [2.502e-2, 0.9554, 2.653e-3, -2.648e-3, 0.6149, -2.501e-2, 1.448e-5, 0.3166, 5.688e-6],
        [7.435e-2, 2.653e-3, 0.8872, -0.5620, 2.648e-3, -7.583e-2, -1.489e-3, 5.688e-6, 0.3013],
        [-7.583e-2, -2.648e-3, -0.5620, 1.164, 0.0, 0.0, -7.583e-2, -2.648e-3, 0.5620],
        [2.501e-2, 0.6149, 2.648e-3, 0.0, 1.317, -5.001e-2, -2.501e-2, -0.6149, 2.648e-3],
        [-0.5196, -2.501e-2, -7.583e-2, 0.0, -5.001e-2, 1.126, 0.5196, 2.501e-2, -7.583e-2],
        [0.3233, 1.448e-5, -1.489e-3, -7.583e-2, -2.501e-2, 0.5196, 0.8538, 2.502e-2, -7.732e-2],
        [1.448e-5, 0.3166, 5.688e-6, -2.648e-3, -0.6149, 2.501e-2, 2.502e-2, 0.9554, -2.642e-3],
        [-1.489e-3, 5.688e-6, 0.3013, 0.5620, 2.648e-3, -7.583e-2, -7.732e-2, -2.642e-3, 0.8872],
    ],
    [-0.7284, -0.9709, 0.1408, -0.2075, -0.2395, 0.3567, -0.3663, -0.7046, -0.05864],
    [1.0, 0.9979, -0.06539, 0.2444, -0.1255, -0.01348, 0.3823, 0.3812, -0.02913],
)
OF_BASE_AND_CONTRACTION = np.array([[1.0, 1.0], [0.6, 0.6], [1.0, 1.0]])


def test_newton_goes_on_from_where_exact_sweeps_lead():
    """Newton goes round among a few states; 200 sweeps alone are not enough, and both by turns solve it."""
    W, y_free, force = (np.array(values) for values in MONOLITHS)
    rigid, zero = np.full(3, np.inf), np.zeros(3)
    law = (rigid, zero, np.full(3, 1e300))  # whose compliance W holds
    case = Case(W, law, OF_BASE_AND_CONTRACTION, zero, np.zeros((3, 2)), y_free)
    memory = gap_memory(case.problem)

    def reached(way):
        memory.force[:] = force
        return way(W, memory.limits, memory, y_free, W @ force + y_free, TOLERANCE)

    assert reached(continuation.newton) > 1e4 * TOLERANCE
    swept = [reached(continuation.exact_sweeps)]
    for _ in range(200 // continuation._EXACT_SWEEPS):
        y = W @ memory.force + y_free
        swept.append(continuation.exact_sweeps(W, memory.limits, memory, y_free, y, TOLERANCE))
    assert min(swept) > 10.0 * TOLERANCE
    assert reached(continuation.newton_and_sweeps) <= TOLERANCE
    memory.force[:] = force
    check(case, *solve(case, memory)[:3])


@pytest.mark.parametrize("signs", [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)])
@pytest.mark.parametrize("mu", [(0.3, 0.8), (0.7, 0.2)])
def test_one_iteration_of_newton_solves_what_slides_on(mu, signs):
    """Of a gap that goes on sliding along both axes the equation is linear: y_n = 0, shears c + mu p_n."""
    W = 1e-8 * np.array([[9.0, 0.4, -0.3], [0.4, 12.0, 1.0], [-0.3, 1.0, 10.0]])
    cohesion, way = 300.0, np.array(signs)

    def force_of(p_n):
        return np.array([p_n, *(way * (cohesion + np.array(mu) * p_n))])

    slip = -way * np.array([2e-4, 3e-4])
    y_free = np.array([0.0, *slip]) - W @ force_of(5000.0)
    law = GapLaw(np.array([np.inf]), np.zeros(1), np.zeros(1), np.array([mu]), np.zeros(1), {})
    memory = gap_memory(gap_problem(W, law))
    memory.limits.cohesion[:] = cohesion
    memory.force[:] = force_of(4500.0)
    y = W @ memory.force + y_free
    assert continuation.newton(W, memory.limits, memory, y_free, y, TOLERANCE) <= TOLERANCE
    np.testing.assert_allclose(memory.force, force_of(5000.0), rtol=1e-9)
    assert memory.solver.sweeps.counts.iterations == 1


def test_a_force_is_off_relative_to_what_would_close_a_gap():
    """10 N are to gain 1: a tenth of the largest force, 1/5000 of the 5 kN that close a gap of 1 mm."""
    law = GapLaw(np.full(2, np.inf), np.zeros(2), np.zeros(2), np.full((2, 2), 0.5), np.zeros(2), {})
    problem = gap_problem(2e-7 * np.eye(6), law)
    p, y = np.zeros(6), np.zeros(6)
    p[0], y[0], y[3] = 10.0, -2e-7, 1e-3
    found = natural_residuals(problem.W, gap_memory(problem).limits, p, y)
    assert found == pytest.approx((1 / 5000, 1 / 10), rel=1e-12)


def test_the_gap_that_is_named_is_the_one_farthest_from_its_law():
    """Unpressed gaps that overlap by 1, 5 and 2 um are to gain 10, 50 and 20 N at 1e-7 m/N."""
    law = GapLaw(np.full(3, np.inf), np.zeros(3), np.zeros(3), np.full((3, 2), 0.5), np.zeros(3), {})
    problem = gap_problem(1e-7 * np.eye(9), law)
    y = np.zeros(9)
    for overlaps in ([1e-6, 5e-6, 2e-6], [5e-6, 1e-6, 2e-6], [1e-6, 2e-6, 5e-6]):
        y[::3] = np.negative(overlaps)
        assert worst_gap(problem.W, gap_memory(problem).limits, np.zeros(9), y) == np.argmax(overlaps)


def bodies_on_many_gaps(seed, bodies, each, K_n):
    """Rigid bodies in a row on `each` gaps below them, and on as many against the next: a singular H.

    The flexibility of the step is that of the bodies' inertia alone, of six motions each.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for body in range(bodies):
        points = {"base": (body, rng.uniform([0, 0, 0], [1, 4, 0], (each, 3)), np.eye(3)[[2, 0, 1]])}
        if body + 1 < bodies:
            points["side"] = (body, rng.uniform([1, 0, 0], [1, 4, 6], (each, 3)), np.eye(3)[[0, 1, 2]])
        for kind, (_, at, axes) in points.items():
            for point in at:
                jump = np.zeros((3, 6 * bodies))
                for sign, one in ((1.0, body),) if kind == "base" else ((-1.0, body), (1.0, body + 1)):
                    arm = point - np.array([0.5 if one == body else 1.5, 2.0, 3.0])
                    motion = np.hstack([np.eye(3), np.cross(np.eye(3), arm).T])
                    jump[:, 6 * one : 6 * one + 6] += sign * axes @ motion
                rows.append((jump, 1.0 if kind == "base" else 0.6))
    B = np.vstack([jump for jump, _ in rows])
    mass = np.tile([1.0, 1.0, 1.0, 4.3, 3.1, 1.4], bodies)
    H = 1e-9 * B / mass @ B.T
    n, push = len(rows), 1e-3 * rng.standard_normal(6 * bodies)
    push[2::6] -= 2e-3  # weight
    push[3::6] *= 0.2
    push[4::6] *= 0.2
    push[5::6] *= 0.2
    return Case(
        H=H,
        stiffness=(np.full(n, K_n), np.zeros(n), np.full(n, 5e9 if np.isinf(K_n) else 0.5 * K_n)),
        mu=np.array([[mu, mu] for _, mu in rows]),
        gap=1e-5 * rng.random(n),
        anchor=1e-5 * rng.standard_normal((n, 2)),
        w_free=B @ push,
    )


@pytest.mark.parametrize("K_n", [1e9, 1e11], ids="{:.0e}".format)
@pytest.mark.parametrize("seed", range(8))
def test_bodies_on_more_gaps_than_they_have_motions(seed, K_n):
    """63 gaps with friction of four bodies with 24 motions, K_n times H 1 and 100.

    Newton, and then 200 sweeps, solved one of the eight stiff cases.
    """
    case = bodies_on_many_gaps(seed, bodies=4, each=9, K_n=K_n)
    assert np.linalg.matrix_rank(case.H) == 24 and len(case.gap) == 63
    check(case, *solve(case)[:3])


@pytest.mark.parametrize("way", ["sweeps", "newton", "exact"])
@pytest.mark.parametrize("seed", range(5))
def test_every_way_alone_finds_the_same_force(way, seed):
    case = random_case(seed, 8, (0.6, 0.6), coupling=0.3)
    W, y_free, y = case.problem.W, _free_response(case), _free_response(case)
    wanted, memory = solve(case)[1].ravel(), gap_memory(case.problem)
    if way == "sweeps":
        kept = np.zeros(0, dtype=bool)
        residual = frictional._sweeps(W, memory.limits, memory, y_free, y, TOLERANCE, kept)
    else:
        find = {"newton": continuation.newton, "exact": continuation.exact_sweeps}[way]
        residual = find(W, memory.limits, memory, y_free, y, TOLERANCE)
    assert residual <= TOLERANCE
    assert np.abs(memory.force - wanted).max() <= 1e-6 * wanted.max()


def _gap_residual(A, b, cohesion, mu, p):
    """How far one gap's forces are from the fixed point of their natural map."""
    y = A @ p + b
    x = p - y / np.array([A[0, 0], *[max(A[1, 1], A[2, 2])] * 2])
    n = max(x[0], 0.0)
    return np.abs(np.array([n, *project_shear(x[1], x[2], *(cohesion + mu * n))[:2]]) - p).max()


@given(
    seed=_SEED,
    mu=st.sampled_from([(0.3, 0.3), (2.0, 2.0), (0.3, 2.0), (0.0, 0.6)]),
    c=st.sampled_from([(0.0, 0.0), (0.5, 0.5), (0.2, 1.0), (np.inf, np.inf), (np.inf, 0.0)]),
)
@example(seed=105, mu=(0.3, 0.3), c=(0.5, 0.5))
@example(seed=877, mu=(0.3, 0.3), c=(0.0, 0.0))
@example(seed=10603, mu=(2.0, 2.0), c=(0.5, 0.5))  # closed alone where the normal stiffness is negative
@example(seed=6271, mu=(2.0, 2.0), c=(0.0, 0.0))  # two sliding directions within two degrees
@settings(max_examples=300, deadline=None)
def test_one_gap_is_solved_exactly(seed, mu, c):
    """Any positive definite coupling of normal and tangent, stiff against soft by up to 1e4."""
    if mu[0] != mu[1] and c == (0.5, 0.5):
        return  # a disc where the gap opens and a rectangle elsewhere: no joint is like that
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((3, 3)) * 10.0 ** rng.uniform(-1.0, 1.0, 3)
    A, b, mu, c = B @ B.T + 1e-4 * np.eye(3), rng.standard_normal(3), np.array(mu), np.array(c)
    p = np.zeros(3)
    assert solve_gap(A, b, c, mu, p)
    assert _gap_residual(A, b, c, mu, p) <= 1e-6 * max(np.abs(p).max(), 1.0 / A[0, 0])


def test_a_change_of_contact_that_must_not_be_ends_the_search():
    case = random_case(3, 12, (0.6, 0.6), coupling=0.3)
    problem = case.problem
    closed = solve(case, problem=problem)[1][:, 0] > 0.0
    for kept, ends in ((closed, False), (~closed, True)):
        memory, y = gap_memory(problem), np.empty(36)
        memory.accumulated_slip[:] = case.anchor
        residual = solve_gaps(problem, memory, kept, case.w_free.copy(), y, TOLERANCE, True)
        assert (residual == np.inf) == ends


def _march(case, problem, memory, rng, steps):
    """Random free jumps, correlated from step to step as in a march; the last case and solution."""
    w = case.w_free.copy()
    for _ in range(steps):
        w = 0.9 * w + 0.4e-3 * rng.standard_normal(len(w))
        now = dataclasses.replace(case, w_free=w)
        anchor = memory.accumulated_slip.copy()
        solution = solve(now, memory, problem)
    return dataclasses.replace(now, anchor=anchor), solution


@pytest.mark.parametrize("K_n", [1e9, 1e13, np.inf])
def test_ten_thousand_steps_leave_no_drift_and_no_trace(K_n):
    """The carried factors stay those of the present closed set: the solution equals a cold one."""
    for seed, n in ((0, 6), (1, 25)):
        case = random_case(seed, n, K_n=K_n)
        problem, rng = case.problem, np.random.default_rng(seed)
        memory = gap_memory(problem)
        for _ in range(10):
            now, (jump, force, state, _, _, _) = _march(case, problem, memory, rng, 500)
            cold_jump, cold_force, cold_state, _, _, _ = solve(now, problem=problem)
            assert np.abs(force - cold_force).max() <= 1e-9 * max(np.abs(cold_force).max(), 1.0)
            assert np.abs(jump - cold_jump).max() <= 1e-12
            assert (state == cold_state).all()
            check(now, jump, force, state)


def test_frictional_march_follows_the_law_step_by_step():
    for K_n in (1e9, np.inf):
        case = random_case(2, 10, (0.6, 0.6), K_n=K_n)
        problem = case.problem
        memory = gap_memory(problem)
        memory.accumulated_slip[:] = case.anchor
        rng = np.random.default_rng(5)
        for _ in range(100):
            now, (jump, force, state, _, _, friction) = _march(case, problem, memory, rng, 3)
            check(now, jump, force, state)
            assert friction >= -TOLERANCE * 1e-3 * force[:, 0].max()  # slips are of the order of 1 mm


@pytest.mark.parametrize("mu", [(0.0, 0.0), (0.6, 0.6), (0.3, 0.8)])
def test_solving_does_not_move_the_history(mu):
    """Two solutions with different free jumps, then the first again: as if only it had been asked for."""
    case = random_case(4, 12, mu)
    other = random_case(5, 12, mu)
    problem = case.problem
    memory = gap_memory(problem)
    memory.accumulated_slip[:] = case.anchor
    anchor = memory.accumulated_slip.copy()
    for w in (case.w_free, other.w_free, -other.w_free):
        assert solve_step(problem, memory, w)[1] <= TOLERANCE
        assert (memory.accumulated_slip == anchor).all()
    late, fresh = solve(case, memory, problem), solve(case, problem=problem)
    assert np.abs(late[1] - fresh[1]).max() <= 1e-6 * np.abs(fresh[1]).max()
    assert (late[2] == fresh[2]).all()


def _solve_with(cohesion, memory, y_free):
    """One gap of unlike flexibilities, mu 0.5 and 0.25, whose cohesion is given: (y, residual)."""
    H = 1e-8 * np.array([[9.0, 2.0, -1.0], [2.0, 12.0, 3.0], [-1.0, 3.0, 10.0]])
    law = GapLaw(np.array([np.inf]), np.zeros(1), np.zeros(1), np.array([[0.5, 0.25]]), np.zeros(1), {})
    problem, y = gap_problem(H, law), np.zeros(3)
    memory = gap_memory(problem) if memory is None else memory
    memory.limits.cohesion[0] = cohesion
    closed = memory.force[:1] > 0.0
    residual = frictional.solve_frictional(problem, memory, closed, y_free, y, TOLERANCE, False)
    return memory, y, residual


@pytest.mark.parametrize("along", [1, 2])
def test_an_open_gap_sticks_along_its_cohesion_and_lets_go_without(along):
    """Open by 1 mm, moved by (0.2, -0.3) mm: sweeps alone find t = -y_free / W along the bond, 0 across it.

    A key along j carries -2e-4 / 12e-8 N, along k 3e-4 / 10e-8 N. When it is lost the force is zero at once,
    without an iteration of Newton's method.
    """
    y_free = np.array([1e-3, 2e-4, -3e-4])
    W = 1e-8 * np.array([[9.0, 2.0, -1.0], [2.0, 12.0, 3.0], [-1.0, 3.0, 10.0]])
    bond = np.zeros(2)
    bond[along - 1] = 1e4
    memory, y, residual = _solve_with(bond, None, y_free.copy())
    force = np.zeros(3)
    force[along] = -y_free[along] / W[along, along]
    assert residual <= TOLERANCE and memory.solver.sweeps.counts.newton_steps == 0
    np.testing.assert_allclose(memory.force, force, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(y, y_free + W[:, along] * force[along], rtol=1e-7, atol=1e-12)
    _, y, residual = _solve_with((0.0, 0.0), memory, y_free.copy())
    assert residual <= TOLERANCE and memory.solver.sweeps.counts.newton_steps == 0
    assert not memory.force.any()
    np.testing.assert_allclose(y, y_free, rtol=1e-12)


def test_one_gap_by_hand():
    """H 1e-6 m/N in every direction, K_n 4e6, K_s 1e6 N/m, mu 0.5; free jump (-5, 3, 4) mm.

    Normal: p = 5e-3 / (1e-6 + 0.25e-6) = 4000 N, opening -1 mm. Shear: stuck it would be
    5e-3 / (1e-6 + 1e-6) = 2500 N along -(0.6, 0.8), above mu p = 2000 N, so it slides by
    5e-3 - 2000 * 2e-6 = 1 mm; shear displacement 5 - 2 = 3 mm; loss 2000 N * 1 mm = 2 J.
    """
    case = Case(
        H=1e-6 * np.eye(3),
        stiffness=(np.array([4e6]), np.zeros(1), np.array([1e6])),
        mu=np.array([[0.5, 0.5]]),
        gap=np.zeros(1),
        anchor=np.zeros((1, 2)),
        w_free=1e-3 * np.array([-5.0, 3.0, 4.0]),
    )
    jump, force, state, memory, stored, friction = solve(case)
    assert force[0] == pytest.approx([4000.0, -1200.0, -1600.0], rel=1e-8)
    assert jump[0] == pytest.approx([-1e-3, 1.8e-3, 2.4e-3], rel=1e-8)
    assert state[0] == SLIP
    assert memory.accumulated_slip[0] == pytest.approx([0.6e-3, 0.8e-3], rel=1e-7)
    assert friction == pytest.approx(2.0, rel=1e-7)
    assert stored == pytest.approx(0.5 * 4e6 * 1e-6 + 0.5 * 2000.0**2 / 1e6, rel=1e-7)
    stuck = solve(dataclasses.replace(case, w_free=1e-3 * np.array([-5.0, 1.5, 2.0])))
    assert (stuck[2][0], stuck[5]) == (STICK, pytest.approx(0.0, abs=1e-12))
    assert stuck[1][0] == pytest.approx([4000.0, -750.0, -1000.0], rel=1e-8)
    opened = solve(dataclasses.replace(case, w_free=1e-3 * np.array([0.1, 1.5, 2.0])))
    assert opened[2][0] == OPEN
    assert (opened[1] == 0.0).all()
    assert opened[3].accumulated_slip[0] == pytest.approx([1.5e-3, 2.0e-3])
    # an initial gap of 1 mm takes 1 mm off the approach; an initial penetration adds it
    for gap, p_n in ((1e-3, 3200.0), (-1e-3, 4800.0), (6e-3, 0.0)):
        force = solve(dataclasses.replace(case, gap=np.array([gap])))[1]
        assert force[0, 0] == pytest.approx(p_n, rel=1e-8)


def test_rigid_gap_is_the_limit_of_a_stiff_one():
    case = random_case(11, 30)
    full = np.ones(30)
    rigid = solve(dataclasses.replace(case, stiffness=(np.inf * full, 0.0 * full, full)))[1]
    for K_n, distance in ((1e12, 1e-1), (1e14, 1e-3), (1e16, 1e-5)):
        stiff = solve(dataclasses.replace(case, stiffness=(K_n * full, 0.0 * full, full)))[1]
        assert np.abs(stiff - rigid).max() <= distance * rigid.max()


@pytest.mark.parametrize("d", [1, 3])
def test_no_gaps(d):
    nothing = np.zeros(0)
    problem = gap_problem(np.zeros((0, 0)), GapLaw(nothing, nothing, nothing, np.zeros((0, 2)), nothing, {}))
    memory = gap_memory(problem)
    y, residual = solve_step(problem, memory, np.zeros(0))
    assert residual <= TOLERANCE
    assert commit_gaps(problem, memory, y, new_gap_arrays(0, d)) == (0.0, 0.0, 0.0)


def test_all_gaps_open_after_all_were_closed():
    for mu in ((0.0, 0.0), (0.6, 0.6)):
        case = random_case(6, 9, mu, coupling=0.3)
        d = len(case.w_free) // 9
        shut = case.w_free.copy()
        shut[0::d] = -5e-3
        problem = case.problem
        memory = gap_memory(problem)
        assert (solve(dataclasses.replace(case, w_free=shut), memory, problem)[2] != OPEN).any()
        _, force, state, _, stored, _ = solve(dataclasses.replace(case, w_free=-shut), memory, problem)
        assert (state == OPEN).all() and (force == 0.0).all() and stored == 0.0


@pytest.mark.parametrize("mu", [(0.0, 0.0), (0.6, 0.6)])
def test_not_a_number_is_never_accepted(mu):
    case = random_case(6, 4, mu)
    w = case.w_free.copy()
    w[0] = np.nan
    problem = case.problem
    try:
        residual = solve_step(problem, gap_memory(problem), w)[1]
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return
    assert not residual <= TOLERANCE


@pytest.mark.parametrize(("K_nz", "mu"), [(2e6, 0.0), (1e6, 0.3)])
def test_tension_stiffer_than_compression_is_refused(K_nz, mu):
    full = np.ones(2)
    with pytest.raises(ConfigError, match=r"tension_stiffness must be below normal_stiffness.*at gap 0"):
        law = GapLaw(1e6 * full, K_nz * full, full, np.full((2, 2), mu), 0 * full, {})
        gap_problem(1e-9 * np.eye(6 if mu else 2), law)


def test_a_spring_in_both_senses():
    """K_nz = K_n without friction: a linear spring, p = -K w_free / (1 + K H)."""
    case = dataclasses.replace(random_case(8, 1, K_n=1e9, K_nz=1e9), gap=np.zeros(1))
    for w in (1e-3, -1e-3):
        force = solve(dataclasses.replace(case, w_free=np.array([w])))[1]
        assert force[0, 0] == pytest.approx(-1e9 * w / (1.0 + 1e9 * case.H[0, 0]), rel=1e-8)


def test_hard_problems_converge_and_few_need_newton():
    """600 random problems: stiffness ratios 1e-3 to 1e6 and rigid, mu to 2, H singular to 1e-8."""
    rng, newton = np.random.default_rng(1), 0
    for seed in range(600):
        n, m = int(rng.integers(1, 25)), (0.3, 0.6, 1.0, 2.0)[rng.integers(4)]
        mu = (m, m) if rng.random() < 0.6 else (m, 0.4 * m + 0.1)
        K_n = 1e9 * 10 ** rng.uniform(-3, 6) if rng.random() < 0.7 else np.inf
        K_s, floor = 1e9 * 10 ** rng.uniform(-3, 6), 10 ** rng.uniform(-8, -1)
        case = random_case(
            seed, n, mu, K_n=K_n, K_s=K_s, coupling=(0.05, 0.3, 1.0)[rng.integers(3)], floor=floor
        )
        memory = gap_memory(case.problem)
        memory.accumulated_slip[:] = case.anchor
        assert solve_step(case.problem, memory, case.w_free)[1] <= TOLERANCE
        newton += memory.solver.sweeps.counts.newton_steps > 0
    assert newton <= 0.15 * 600


@pytest.mark.parametrize("seed", range(3))
def test_few_closed_gaps_among_many_open_ones(seed):
    """Four in forty rub for 60 steps: each is solved by sweeps, which look at all gaps at their end alone."""
    case, steps = random_case(seed, 40, mu=(0.6, 0.6), coupling=0.3, floor=0.1), np.arange(60)
    gap = np.where(np.arange(40) % 10 == seed, 0.0, 5e-3)
    case = dataclasses.replace(case, gap=gap, anchor=np.zeros((40, 2)))
    move, memory = 1e-3 * np.random.default_rng(seed).standard_normal(120), gap_memory(case.problem)
    for step in steps:
        before = memory.accumulated_slip.copy()
        w_free = case.w_free + np.sin(0.1 * step) * move
        now = dataclasses.replace(case, w_free=w_free, anchor=before)
        jump, force, state, *_ = solve(now, memory, case.problem)
        check(now, jump, force, state)
        assert np.count_nonzero(state) <= 5
    assert memory.solver.sweeps.counts.newton_steps == 0  # Newton never helps
    assert memory.solver.sweeps.counts.iterations <= 8 * len(steps)  # sweeps


@pytest.mark.parametrize("dual", [False, True])
def test_an_inverse_that_round_off_has_spoiled_is_made_anew(dual):
    """What the closed gaps' forces leave of their openings tells, also where no gap changes sides."""
    rng, n = np.random.default_rng(8), 12
    shape = rng.standard_normal((n, n))
    law = GapLaw(np.full(n, np.inf), np.zeros(n), np.zeros(n), np.zeros((n, 2)), np.zeros(n), {})
    problem = gap_problem(1e-9 * (shape @ shape.T / n + np.eye(n)), law)
    memory, y = gap_memory(problem), np.zeros(n)
    w_free = np.where(np.arange(n) < (9 if dual else 3), -1e-3, 5e-3)
    solve_gaps(problem, memory, np.zeros(n, dtype=bool), w_free.copy(), y, TOLERANCE, False)
    force, closed = memory.force.copy(), memory.force > 0.0
    solve_gaps(problem, memory, closed, w_free.copy(), y, TOLERANCE, False)
    assert (2 * closed.sum() > n) == dual
    memory.solver.inverse[:] *= 1.0 + 1e-4
    residual = solve_gaps(problem, memory, closed, w_free.copy(), y, TOLERANCE, False)
    assert residual <= TOLERANCE
    np.testing.assert_allclose(memory.force, force, rtol=1e-9)
