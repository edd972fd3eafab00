"""The point law: what it must never do (Hypothesis), and cycles whose energy is known by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_law import LAWS, Gap, Past

from romdam.contact.cone import project_shear
from romdam.core.system import OPEN, SLIP, STICK


def coulomb(jump, anchor, stiffness, mu):
    """(p_n, t_j, t_k, state, new anchor) of a gap with friction only."""
    force, state, past = LAWS["coulomb"](jump, Past(anchor), Gap(*stiffness, mu))
    return *force, state, past.anchor


_LENGTH = st.floats(-1e-2, 1e-2, allow_subnormal=False)
_JUMP = st.tuples(_LENGTH, _LENGTH, _LENGTH)
_ANCHOR = st.tuples(_LENGTH, _LENGTH)
_STIFFNESS = st.tuples(st.floats(1e3, 1e10), st.just(0.0), st.floats(1e3, 1e10))
_MU = st.one_of(
    st.floats(0.0, 2.0).map(lambda m: (m, m)), st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0))
)


_FLAG = st.booleans()


@st.composite
def _gaps(draw):
    """Any consistent set of parameters."""
    K_n, _, K_s = draw(_STIFFNESS)
    mu, more = draw(_MU), draw(st.floats(0.0, 1.0))
    static = (mu[0] + more, mu[1] + more)
    tension = draw(st.floats(0.0, 1e5))
    return Gap(
        K_n,
        0.0,
        K_s,
        mu,
        tension=tension,
        cohesion=(1.0 + draw(st.floats(0.0, 2.0))) * max(static) * tension,
        mu_static=static,
        key=draw(st.floats(1e-6, 1e-2)),
        keyed=draw(st.tuples(_FLAG, _FLAG)),
        viscous=draw(st.floats(0.0, 1e8)),
        velocity=(*mu, draw(st.floats(1e-6, 1e-2))),
        weakening=(*mu, draw(st.floats(1e-6, 1e-2))),
        rough=(draw(st.floats(0.0, 20.0)), draw(st.floats(1e3, 1e8)), mu[0]),
    )


_SLIPPED = st.one_of(st.just(0.0), st.floats(0.0, 1e-2))
_PASTS = st.builds(Past, _ANCHOR, _FLAG, _FLAG, _FLAG, st.floats(-1e-2, 0.0), _SLIPPED, _SLIPPED)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@given(jump=_JUMP, past=_PASTS, gap=_gaps())
@settings(max_examples=200, deadline=None)
def test_laws_are_pure(law, jump, past, gap):
    before = (tuple(jump), tuple(past), tuple(gap))
    first = law(jump, past, gap)
    assert law(jump, past, gap) == first
    assert (jump, tuple(past), tuple(gap)) == before


@pytest.mark.parametrize("name", LAWS)
@given(jump=_JUMP, past=_PASTS, gap=_gaps())
@settings(max_examples=300, deadline=None)
def test_forces_are_admissible(name, jump, past, gap):
    """Tension up to the bond's strength only, shear within Coulomb's limit and what strength adds to it."""
    (p_n, *t), state, _ = LAWS[name](jump, past, gap)
    bonded = name in ("bond", "all")
    assert p_n >= (-gap.tension if bonded and not past.broken else 0.0)
    if state == OPEN:
        assert p_n == 0.0 or name == "all"  # a dashpot may pull at a bond that has not opened yet
        assert jump[0] >= 0.0 or name in ("dashpot", "all")  # and lets go where there is none
    mu = np.array(gap.mu_static if name in ("static_friction", "all") else gap.mu)
    if name in ("velocity_friction", "slip_weakening"):  # between both, whatever the slip
        mu = np.full(2, max(gap.velocity[:2]))
    if name == "barton_bandis":
        mu = np.full(2, max(math.tan(math.radians(70.0)), gap.rough[2]))
    limits = mu * p_n + gap.cohesion if bonded and not past.broken else mu * max(p_n, 0.0)
    limits[limits < 0.0] = 0.0
    if name in ("shear_key", "all") and jump[0] <= gap.key and not past.out:
        limits[list(gap.keyed)] = np.inf
    if name == "frictionless":
        limits[:] = 0.0
    slack = 1.0 + 1e-12
    if limits[0] == limits[1]:
        assert math.hypot(*t) <= limits[0] * slack + 1e-300
    assert (np.abs(t) <= limits * slack + 1e-300).all()


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@given(path=st.lists(_JUMP, min_size=1, max_size=12), gap=_gaps())
@settings(max_examples=100, deadline=None)
def test_a_bond_is_lost_for_good_and_strength_never_grows_within_a_step(law, path, gap):
    past = Past()
    for jump in path:
        _, state, now = law(jump, past, gap)
        assert now.broken >= past.broken
        assert now.sliding == (state == SLIP)
        assert not (now.out and jump[0] <= gap.key)
        past = now


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@given(jump=_JUMP, past=_PASTS, gap=_gaps())
@settings(max_examples=200, deadline=None)
def test_a_jump_that_stays_asks_for_no_more(law, jump, past, gap):
    """Evaluated once more at the same jump, a gap that kept its strength gives the same force.

    But for the dashpot, whose rate is then zero, static friction, lost by a slip that has now ended, and
    friction that changes with the slip.
    """
    gap = gap._replace(viscous=0.0, mu_static=gap.mu, velocity=(gap.velocity[0], *gap.velocity[::2]))
    force, _, now = law(jump, past, gap)
    again, _, then = law(jump, now, gap)
    size = max(map(abs, force)) + gap.K_s * 4e-2
    if now.out == past.out:  # a key that comes back in holds where it is
        assert np.abs(np.subtract(again, force)).max() <= 1e-9 * size
        assert then.broken == now.broken


@given(jump=_JUMP, anchor=_ANCHOR, stiffness=_STIFFNESS, mu=_MU)
@settings(max_examples=300, deadline=None)
def test_committing_a_step_and_evaluating_it_again_changes_nothing(jump, anchor, stiffness, mu):
    p_n, t_j, t_k, _, moved = coulomb(jump, anchor, stiffness, mu)
    again = coulomb(jump, moved, stiffness, mu)
    round_off = 1e-12 * (p_n + stiffness[2] * 2e-2)
    assert np.allclose(again[:3], (p_n, t_j, t_k), rtol=1e-12, atol=round_off)


@given(
    path=st.lists(_JUMP, min_size=2, max_size=30),
    stiffness=_STIFFNESS,
    mu=_MU,
)
@settings(max_examples=200, deadline=None)
def test_closed_loops_dissipate(path, stiffness, mu):
    """Work of the gap's force (implicit: force at the end of each leg) over a closed loop is a loss.

    The loop ends where it began, and is run twice so that the anchor starts the second round settled.
    """
    anchor, work, scale = (path[0][1], path[0][2]), 0.0, 1e-300
    _, _, K_s = stiffness
    stored = [0.0, 0.0]
    for lap in range(2):
        work = 0.0
        for old, new in zip(path, path[1:] + path[:1], strict=True):
            _, t_j, t_k, _, anchor = coulomb(new, anchor, stiffness, mu)
            work -= t_j * (new[1] - old[1]) + t_k * (new[2] - old[2])
            scale = max(scale, abs(t_j) * 1e-2, abs(t_k) * 1e-2)
        stored[lap] = (t_j**2 + t_k**2) / (2.0 * K_s)
        scale = max(scale, stored[lap])
    assert work >= stored[1] - stored[0] - 1e-9 * scale


@given(jump=_JUMP, anchor=_ANCHOR, mu=_MU)
@settings(max_examples=300, deadline=None)
def test_tangent_is_the_finite_difference_off_kinks(jump, anchor, mu):
    """Expected tangents: stick diag(-K_n, -K_s, -K_s), sliding on the resultant -mu K_n e and
    -K_s (limit / trial) (I - e e^T), open zero."""
    K_n, K_s, h = 3e6, 1e6, 1e-8
    trial = -K_s * (np.array(jump[1:]) - np.array(anchor))
    limits = np.array(mu) * K_n * max(-jump[0], 0.0)
    far = 100.0 * h
    margins = [abs(jump[0]) - far]
    if mu[0] == mu[1]:
        margins.append(abs(math.hypot(*trial) - limits[0]) / (K_s + 2 * K_n) - far)
        margins.append(math.hypot(*trial) / K_s - 1e3 * far)
    else:
        margins += list(np.abs(np.abs(trial) - limits) / (K_s + 2 * K_n) - far)
    if min(margins) < 0.0:
        return
    exact = np.zeros((3, 3))
    if jump[0] < 0.0:
        exact[0, 0] = -K_n
        if mu[0] == mu[1]:
            size = math.hypot(*trial)
            if size <= limits[0]:
                exact[1:, 1:] = -K_s * np.eye(2)
            else:
                e = trial / size
                exact[1:, 0] = -mu[0] * K_n * e
                exact[1:, 1:] = -K_s * limits[0] / size * (np.eye(2) - np.outer(e, e))
        else:
            for a in range(2):
                if abs(trial[a]) <= limits[a]:
                    exact[1 + a, 1 + a] = -K_s
                else:
                    exact[1 + a, 0] = -mu[a] * K_n * math.copysign(1.0, trial[a])
    for a in range(3):
        up, down = list(jump), list(jump)
        up[a] += h
        down[a] -= h
        args = (anchor, (K_n, 0.0, K_s), mu)
        slope = np.subtract(coulomb(tuple(up), *args)[:3], coulomb(tuple(down), *args)[:3]) / (2 * h)
        assert np.abs(slope - exact[:, a]).max() < 1e-3 * K_n


def test_equal_coefficients_bound_the_resultant_and_unequal_ones_each_direction():
    # trial shear (-30, -40): 3-4-5 triangle; limit 10
    jump, K = (-1.0, 30.0, 40.0), (10.0, 0.0, 1.0)
    p_n, t_j, t_k, state, moved = coulomb(jump, (0.0, 0.0), K, (1.0, 1.0))
    assert (p_n, state) == (10.0, SLIP)
    assert (t_j, t_k) == pytest.approx((-6.0, -8.0), rel=1e-14)
    assert moved == pytest.approx((24.0, 32.0), rel=1e-14)
    _, t_j, t_k, state, moved = coulomb(jump, (0.0, 0.0), K, (1.0, 0.5))
    assert (t_j, t_k, state) == (-10.0, -5.0, SLIP)
    assert moved == (20.0, 35.0)
    # one direction sticks, the other slides
    _, t_j, t_k, state, moved = coulomb((-1.0, 3.0, 40.0), (0.0, 0.0), K, (1.0, 0.5))
    assert (t_j, t_k, state, moved) == (-3.0, -5.0, SLIP, (0.0, 35.0))
    assert project_shear(3.0, 4.0, 5.0, 5.0) == (3.0, 4.0, False)


def test_tension_stiffness_pulls_an_open_gap_back_and_carries_no_shear():
    for name in ("frictionless", "coulomb"):
        for opening, p_n in ((2e-3, -20.0), (-2e-3, 2000.0)):
            assert LAWS[name]((opening, 0.0, 0.0), Past(), Gap(1e6, 1e4, 0.0))[0] == (p_n, 0.0, 0.0)
    p_n, t_j, t_k, state, moved = coulomb((2e-3, 1e-3, 0.0), (0.0, 0.0), (1e6, 1e4, 1e6), (0.5, 0.5))
    assert (p_n, t_j, t_k, state, moved) == (-20.0, 0.0, 0.0, OPEN, (1e-3, 0.0))


def _walk(path, stiffness, mu, opening=-1.0):
    """States, shear along j and lost work of a walk along j; legs of 1/1000 of the unit of length."""
    anchor, w, work, states, shear = (path[0], 0.0), path[0], 0.0, [], []
    t = coulomb((opening, w, 0.0), anchor, stiffness, mu)[1]
    for target in path[1:]:
        for step in np.linspace(w, target, round(1000 * abs(target - w)) + 1)[1:]:
            _, t_new, _, state, anchor = coulomb((opening, step, 0.0), anchor, stiffness, mu)
            work -= 0.5 * (t + t_new) * (step - w)
            t, w = t_new, step
        states.append(state)
        shear.append(t)
    return states, shear, work


def test_energy_of_a_cycle_by_hand():
    """K_s 1, limit mu p_n = 0.5 * 2 = 1. From 0 to 3, to -3, back to 3.

    The loop +3 -> -3 -> +3 is a parallelogram of height 2 limit and width 6 - 2 limit / K_s = 4: area 8;
    the first loading loses limit * (3 - 1) = 2, and 0.5 is stored at its end.
    """
    stiffness, mu = (2.0, 0.0, 1.0), (0.5, 0.5)
    states, shear, work = _walk([0.0, 3.0, -3.0, 3.0], stiffness, mu)
    assert states == [SLIP, SLIP, SLIP]
    assert shear == pytest.approx([-1.0, 1.0, -1.0], abs=1e-12)
    assert work == pytest.approx(2.0 + 0.5 + 8.0, abs=1e-5)
    # within the stick range after a reversal nothing is lost
    states, shear, work = _walk([0.0, 3.0, 1.5, 3.0], stiffness, mu)
    assert states == [SLIP, STICK, SLIP] or states == [SLIP, STICK, STICK]
    assert shear == pytest.approx([-1.0, 0.5, -1.0], abs=1e-12)
    assert work == pytest.approx(2.5, abs=1e-5)


def test_a_gap_that_opens_forgets_its_anchor_and_sticks_where_it_closes():
    stiffness, mu = (2.0, 0.0, 1.0), (0.5, 0.5)
    _, t, _, state, anchor = coulomb((-1.0, 0.4, 0.0), (0.0, 0.0), stiffness, mu)
    assert (t, state, anchor) == (-0.4, STICK, (0.0, 0.0))
    _, t, _, state, anchor = coulomb((0.1, 0.7, 0.0), anchor, stiffness, mu)
    assert (t, state, anchor) == (0.0, OPEN, (0.7, 0.0))
    _, t, _, state, anchor = coulomb((-1.0, 0.9, 0.0), anchor, stiffness, mu)
    assert (t, state) == (pytest.approx(-0.2), STICK)
    assert anchor == (0.7, 0.0)


def test_on_first_loading_the_memory_agrees_with_the_source():
    """Source: shear K_s w up to mu |F_n|, then constant along the displacement."""
    stiffness, mu = (2.0, 0.0, 1.0), (0.5, 0.5)
    for size in (0.3, 0.99, 1.5, 7.0):
        w = size * np.array([0.6, -0.8])
        _, t_j, t_k, _, _ = coulomb((-1.0, *w), (0.0, 0.0), stiffness, mu)
        assert (t_j, t_k) == pytest.approx(tuple(-min(size, 1.0) * w / size), rel=1e-14)


@given(jump=_JUMP, anchor=_ANCHOR, stiffness=_STIFFNESS, mu=_MU)
@settings(max_examples=100, deadline=None)
def test_reversing_the_slip_reverses_the_shear(jump, anchor, stiffness, mu):
    """Swapping I and J turns i and one tangent: w_n stays, that slip and its shear change their sign."""
    p_n, t_j, t_k, state, moved = coulomb(jump, anchor, stiffness, mu)
    mirrored = coulomb((jump[0], -jump[1], jump[2]), (-anchor[0], anchor[1]), stiffness, mu)
    assert mirrored == (p_n, -t_j, t_k, state, (-moved[0], moved[1]))
