"""A step of gaps with further laws, and the laws' memory, in Python and by hand."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from romdam.contact import softening, step
from romdam.contact.cone import slides
from romdam.contact.laws.barton_bandis import BartonBandis
from romdam.contact.laws.bond import Bond
from romdam.contact.laws.crack_water import CrackWater
from romdam.contact.laws.fracture import BILINEAR, EXPONENTIAL, LINEAR, Fracture, energy_share, strength_share
from romdam.contact.laws.law import (
    COHESION_J,
    COHESION_K,
    DT,
    ENTRIES,
    MU_J,
    MU_K,
    NORMAL_FORCE,
    OPENING,
    PULLED,
    RATE,
    SLIDING,
    SLIP_J,
    SLIP_K,
    STEP_ENTRIES,
    TENSION,
    Past,
)
from romdam.contact.laws.shear_key import ShearKey
from romdam.contact.laws.static_friction import StaticFriction
from romdam.contact.laws.velocity_friction import VelocityFriction
from romdam.contact.problem import Limits
from romdam.contact.solvers.single_contact import solve_gap
from romdam.core.system import OPEN, SLIP, STICK


def state(**entries):
    names = {"opening": OPENING, "p": NORMAL_FORCE, "j": SLIP_J, "k": SLIP_K, "rate": RATE, "dt": DT}
    names |= {"pulled": PULLED, "sliding": SLIDING}
    values = np.zeros(STEP_ENTRIES)
    for name, value in entries.items():
        values[names[name]] = value
    return values


def limit_of(law, parameters, memory, before=(), **entries):
    limit = np.zeros(ENTRIES)
    for entry, value in before:
        limit[entry] = value
    law.limit(parameters, np.array(memory, dtype=float), state(**entries), limit)
    return limit


@pytest.mark.parametrize(
    ("limits", "shear", "is_at"),
    [
        ((5.0, 2.0), (1.0, -2.0), True),  # along k alone
        ((5.0, 2.0), (2.5, 1.0), False),
        ((5.0, 2.0), (-5.0, 0.0), True),
        ((0.0, 2.0), (0.0, 1.0), False),  # without a limit along j nothing slides there
        ((2.5, 2.5), (1.5, 2.0), True),
        ((2.5, 2.5), (1.5, 1.9), False),
        ((0.0, 0.0), (0.0, 0.0), False),
    ],
)
def test_what_is_on_a_limit(limits, shear, is_at):
    assert slides.py_func(*limits, *shear) == is_at


def test_energy_of_springs_and_what_a_dashpot_has_of_them():
    """Closed by 0.2 with p_c = 6 on a spring of 1 / 0.03; beside a dashpot the spring's alone."""
    problem = SimpleNamespace(tension=np.array([0.0, 0.0, 50.0]), compliance=np.full(9, 0.03))
    problem.compliance[[4, 5]] = 0.05, 0.07
    jump = np.array([[-0.2, 0, 0], [-0.2, 0, 0], [0.4, 0, 0]], dtype=float)
    force = np.array([[6.0, 0, 0], [6.0, 2.0, -3.0], [-20.0, 0, 0]])
    found = step._energies.py_func(problem, np.array([0.0, 0.25, 0.0]), jump, force)
    of_shear = 0.5 * 0.05 * 4.0 + 0.5 * 0.07 * 9.0
    assert found == pytest.approx([0.5 * 0.03 * 36.0, 0.5 * 0.75 / 0.03 * 0.04 + of_shear, 0.5 * 50.0 * 0.16])


def test_shear_in_tension_has_the_bonds_limit(monkeypatch):
    """A bond of 4 N that is pulled with 3: friction acts on the 1 N that is left, 0.5 and 0.25 of it."""
    problem = SimpleNamespace(
        gap=np.zeros(1), tension=np.zeros(1), theta_ratio=np.zeros(3), compliance=np.array([0.01, 0.01, 0.01])
    )
    memory = SimpleNamespace(
        force=np.array([-3.0, 2.5, 0.0]),
        spring=np.zeros(3),
        accumulated_slip=np.zeros((1, 2)),
        limits=Limits(np.full((1, 2), 2.0), np.array([[0.5, 0.25]]), np.array([4.0])),
    )
    gaps = SimpleNamespace(
        jump=np.zeros((1, 3)),
        traction=np.zeros((1, 3)),
        state=np.zeros(1, int),
        dissipated_energy=np.zeros(1),
    )
    stored, slid = step._move.py_func(problem, memory, np.array([0.02, -0.3, 0.0]), gaps)
    assert gaps.state[0] == SLIP and gaps.jump[0] == pytest.approx([0.05, -0.325, 0.0])
    assert slid == pytest.approx(2.5 * 0.3) == gaps.dissipated_energy[0]
    assert stored == pytest.approx(0.5 * 0.01 * (9.0 + 6.25))


@pytest.mark.parametrize(("shear", "found"), [(2.5, SLIP), (2.4, STICK)])
def test_friction_acts_on_the_lesser_of_the_force_and_its_spring(shear, found):
    """The spring at the end has (0.05 + 0.04 5 - 0.1 / 3) / 0.03 = 7.22 N, the step 5 N: half of these."""
    problem = SimpleNamespace(
        gap=np.zeros(1),
        tension=np.zeros(1),
        theta_ratio=np.array([1 / 3, 0, 0]),
        compliance=np.array([0.04, 0.01, 0.01]),
    )
    memory = SimpleNamespace(
        force=np.array([5.0, shear, 0.0]),
        spring=np.array([-0.1, 0.0, 0.0]),
        accumulated_slip=np.zeros((1, 2)),
        limits=Limits(np.zeros((1, 2)), np.array([[0.5, 0.25]]), np.zeros(1)),
    )
    gaps = SimpleNamespace(
        jump=np.zeros((1, 3)),
        traction=np.zeros((1, 3)),
        state=np.zeros(1, int),
        dissipated_energy=np.zeros(1),
    )
    step._move.py_func(problem, memory, np.array([-0.05, 0.0, 0.0]), gaps)
    closed = 0.05 + 0.2 - 0.1 / 3.0
    assert gaps.jump[0, 0] == pytest.approx(-closed) and memory.spring[0] == pytest.approx(-closed)
    assert gaps.traction[0, 0] == pytest.approx(closed / 0.03) and gaps.state[0] == found


def test_what_laws_take_in_a_step(monkeypatch):
    """A bond breaks at gap 0, water of 5 N widens gap 1 from 0.1 to 0.4 m; the laws' energies count."""
    jump, force = np.array([[0.0], [0.1]]), np.array([[-6.0], [0.0]])
    gaps = SimpleNamespace(
        jump=jump,
        traction=force,
        state=np.array([STICK, OPEN]),
        dissipated_energy=np.zeros(2),
        water=np.zeros(2),
    )
    problem = SimpleNamespace(gap=np.zeros(2), tension=np.zeros(2), compliance=np.full(2, 0.02))
    memory = SimpleNamespace(
        force=np.zeros(2),
        spring=np.zeros(2),
        water=np.array([0.0, 5.0]),
        limits=SimpleNamespace(tension=np.zeros(2)),
    )

    def move(problem, memory, y, gaps):
        gaps.jump[:, 0], gaps.traction[:, 0] = (0.3, 0.4), 0.0
        return 0.0, 0.0

    energies = iter([(2.0, 1.0), (0.5, 4.0), (0.0, 0.0), (0.0, 0.25)])  # gap 0 before and after, then gap 1
    monkeypatch.setattr(step, "_move", move)
    monkeypatch.setattr(step, "law_energies", lambda *_: next(energies))
    monkeypatch.setattr(step, "commit_laws", lambda laws, memory, i, *_: i == 0)
    laws = SimpleNamespace(dashpot_share=np.zeros(2))
    monkeypatch.setattr(step, "_energies", step._energies.py_func)
    stored, lost, fed = step._commit_with_laws.py_func(laws, problem, memory, np.zeros(2), gaps)
    of_bond = 0.5 * 0.02 * 36.0 + (2.0 - 0.5)  # springs of 6 N and what the law stored; no work was done
    assert stored == pytest.approx(0.5) and fed == pytest.approx(5.0 * 0.3)
    assert gaps.dissipated_energy == pytest.approx([of_bond, 0.25]) and lost == pytest.approx(of_bond + 0.25)
    assert gaps.water == pytest.approx([0.0, 5.0])


def test_what_a_dashpot_takes_in_a_step_is_work_that_no_spring_stores(monkeypatch):
    """K 100 N/m with a dashpot of 300 N/m over the step, pressed from 0.1 to 0.2 m: 50 N, 5 J of work.

    The spring stores 0.5 J and then 2 J: 3.5 J are gone, though nothing is lost of any strength.
    """
    jump, force = np.array([[-0.1]]), np.array([[10.0]])
    gaps = SimpleNamespace(
        jump=jump, traction=force, state=np.array([STICK]), dissipated_energy=np.zeros(1), water=np.zeros(1)
    )
    problem = SimpleNamespace(gap=np.zeros(1), tension=np.zeros(1), compliance=np.array([0.25 / 100.0]))
    limits = SimpleNamespace(tension=np.zeros(1))
    memory = SimpleNamespace(
        force=np.full(1, 50.0), spring=np.full(1, -0.1), water=np.zeros(1), limits=limits
    )

    def move(problem, memory, y, gaps):
        assert y[0] == pytest.approx(0.75 * -0.1)
        gaps.jump[0, 0], gaps.traction[0, 0] = -0.2, 50.0
        return 0.0, 0.0

    monkeypatch.setattr(step, "_move", move)
    monkeypatch.setattr(step, "law_energies", lambda *_: (0.0, 0.0))
    monkeypatch.setattr(step, "commit_laws", lambda *_: False)
    monkeypatch.setattr(step, "_energies", step._energies.py_func)
    laws = SimpleNamespace(dashpot_share=np.array([0.75]))
    stored, lost, fed = step._commit_with_laws.py_func(laws, problem, memory, np.zeros(1), gaps)
    assert (stored, lost, fed) == pytest.approx((2.0, 3.5, 0.0))
    assert gaps.dissipated_energy == pytest.approx([3.5])


def one_gap(**more):
    return SimpleNamespace(
        force=np.array([3.0, 1.0, -2.0]),
        water=np.array([7.0]),
        spring=np.array([-0.1, 0.0, 0.0]),
        step=np.zeros((1, STEP_ENTRIES)),
        limits=Limits(np.full((1, 2), 9.0), np.zeros((1, 2)), np.array([5.0])),
    )


def test_bonds_and_water_shift_the_free_jumps(monkeypatch):
    """p_c + 5 is the unknown: W 5 comes off; water of 7 moves the gap by W 7, its spring not at all."""
    monkeypatch.setattr(softening, "add_row", lambda row, size, y: np.add(y, size * row, out=y))
    W = np.array([[0.3, 0.1, 0.2], [0.1, 0.5, 0.0], [0.2, 0.0, 0.6]])
    problem = SimpleNamespace(gap=np.zeros(1), W=W, compliance=np.array([0.04, 0.02, 0.02]))
    memory, y = one_gap(), np.array([1.0, 2.0, 3.0])
    softening.bond_forces.py_func(SimpleNamespace(), problem, memory, y, 1.0)
    assert memory.force[0] == 8.0
    assert y == pytest.approx(np.array([1.0, 2.0, 3.0]) + (7.0 - 5.0) * W[0] - [0.28, 0.0, 0.0])
    softening.bond_forces.py_func(SimpleNamespace(), problem, memory, y, -1.0)
    assert memory.force[0] == 3.0 and y == pytest.approx([1.0, 2.0, 3.0])


def test_laws_see_the_gap_as_the_solution_has_it(monkeypatch):
    """Opening 0.2 - 0.04 (-6) - 0.25 0.1; a force of -6 with a bond of 5: pulled, by what opens beyond it."""
    problem = SimpleNamespace(gap=np.zeros(1), compliance=np.full(3, 0.04), whole=np.array([1.5]))
    laws = SimpleNamespace(dashpot_share=np.array([0.25]), per_second=np.array(10.0))
    memory = one_gap()
    memory.force[:] = -6.0, 9.0, 0.0
    y = np.array([0.2, 0.03, -0.04])
    monkeypatch.setattr(softening, "shear_limits", lambda limits, i, p: (9.0, 9.0))
    softening.observe_step.py_func(laws, problem, memory, y)
    (seen,) = memory.step
    assert seen[OPENING] == pytest.approx(0.2 + 0.24 - 0.025) and seen[NORMAL_FORCE] == -9.0
    assert (seen[SLIP_J], seen[SLIP_K], seen[SLIDING], seen[PULLED]) == (0.03, -0.04, 1.0, 1.0)
    assert seen[RATE] == pytest.approx(0.5)
    memory.force[:] = -6.0, 1.0, 0.0
    softening.observe_step.py_func(laws, problem, memory, np.array([-0.2, 0.03, -0.04]))
    assert not memory.step[0, [SLIP_J, SLIP_K, SLIDING, PULLED, RATE]].any()


@pytest.mark.parametrize("shape", [LINEAR, EXPONENTIAL, BILINEAR])
def test_energy_left_is_the_integral_of_the_strength(shape):
    for end in (0.1, 0.8 / 3.6, 0.4, 0.9, 1.0, 1.7):
        kinks = np.unique(np.clip([0.0, 0.8 / 3.6, 1.0, end], 0.0, end))
        x, w = np.polynomial.legendre.leggauss(20)
        whole = sum(
            0.5 * (b - a) * w @ [strength_share.py_func(shape, 0.5 * ((b - a) * s + a + b)) for s in x]
            for a, b in pairwise(kinks)
        )
        assert energy_share.py_func(shape, end) == pytest.approx(whole, rel=1e-10)


# strength 6 N, opens over 0.2 m, cohesion 3 N, slips over 0.4 m, linear; compliance 0.01 m/N
FRACTURE = np.array([0.01, 6.0, 0.2, 3.0, 0.4, LINEAR])


def test_a_crack_unloads_and_reloads_along_its_secant():
    """Widest 0.1 m at a damage of 0.5, so 3 N there: at a crack of 0.04 m it holds 1.2 N."""
    memory = (0.5, 0.1, 0.1, 0.0, 0.0)
    for dt in (0.0, 0.01):
        found = limit_of(Fracture, FRACTURE, memory, opening=0.052, p=-1.2, dt=dt)
        assert found[TENSION] == pytest.approx(3.0 * 0.04 / 0.1)
    # slip of 0.06 at rest adds 0.15 of damage: 0.35 is left of the cohesion, and a crack's secant stays
    found = limit_of(Fracture, FRACTURE, memory, opening=0.052, p=-1.2, k=0.06)
    assert found[TENSION] == pytest.approx(1.2)
    assert (found[COHESION_J], found[COHESION_K]) == pytest.approx((1.05, 1.05))


def test_a_crack_that_widens_within_a_step():
    """From 0.04 over the secant to 0.1 (3 N) and on to 0.14: a mean of (0.5 + 0.3) / 2 of 6 N there.

    Friction acts under compression alone.
    """
    found = limit_of(
        Fracture,
        FRACTURE,
        (0.5, 0.1, 0.04, 0.0, 0.0),
        ((MU_J, 0.7), (MU_K, 0.6)),
        opening=0.164,
        p=-2.4,
        dt=0.01,
    )
    assert found[TENSION] == pytest.approx((6.0 * 0.4 * 0.04 + 3.0 * 0.06) / 0.1)
    assert found[MU_J] == found[MU_K] == 0.0
    assert (
        limit_of(Fracture, FRACTURE, (0.5, 0.1, 0.04, 0, 0), ((MU_J, 0.7),), opening=0.164, p=2.4)[MU_J]
        == 0.7
    )


def test_energies_of_a_crack():
    """From 0.1 to 0.14: what the old secant had, and the curve since, less what the new one stores."""
    memory = np.array([0.5, 0.1, 0.1, 0.15, 0.2])
    Fracture.commit(FRACTURE, memory, state(opening=0.164, p=-2.4, dt=0.01))
    stored = 0.5 * 6.0 * 0.3 * 0.14
    lost = 0.2 + 0.5 * 3.0 * 0.1 + 6.0 * 0.4 * 0.04 - stored
    assert memory == pytest.approx([0.7, 0.14, 0.14, stored, lost])
    Fracture.commit(FRACTURE, memory, state(opening=0.062, p=-0.8, dt=0.01))  # back to 0.054
    back = 0.5 * 6.0 * 0.3 * 0.054**2 / 0.14
    assert memory == pytest.approx([0.7, 0.14, 0.054, back, lost + 0.5 * 1.8 * 0.054**2 / 0.14 - back])


def test_a_crack_goes_on_from_a_row():
    """Opened by 0.1 of 0.2 and slipped 0.12 of 0.4: damage 0.8; at 0.04 it stores 0.5 1.2 0.04^2 / 0.1."""
    past = Past(gap=0.0, opening=0.04, sliding=True, has_moved=True, rate=0.3, widest=0.1, path=0.12)
    stored = 0.5 * 6.0 * 0.2 * 0.04**2 / 0.1
    assert Fracture.resumed(FRACTURE, past) == pytest.approx((0.8, 0.1, 0.04, stored, 0.0))
    assert Fracture.resumed(FRACTURE, past._replace(has_moved=False)) == (0.0,) * 5
    assert Fracture.resumed(FRACTURE, past._replace(gap=0.01))[0] > 1.0


PAST = Past(gap=0.0, opening=0.004, sliding=False, has_moved=True, rate=0.3, widest=0.02, path=0.12)


def test_laws_go_on_from_a_row():
    assert VelocityFriction.resumed((0.6, 0.2, 0.05), PAST) == (0.0,)
    assert VelocityFriction.resumed((0.6, 0.2, 0.05), PAST._replace(sliding=True)) == (0.3,)
    assert StaticFriction.resumed((0.8, 0.7, 0.6, 0.5), PAST) == (0.0,)
    assert StaticFriction.resumed((0.8, 0.7, 0.6, 0.5), PAST._replace(sliding=True)) == (1.0,)
    assert ShearKey.resumed((0.01, 1.0, 0.0), PAST) == (0.0,)  # it was out, and came in again
    assert ShearKey.resumed((0.003, 1.0, 0.0), PAST) == (1.0,)
    assert Bond.resumed((3.0, 7.0), PAST) == (1.0,) and Bond.resumed(
        (3.0, 7.0), PAST._replace(has_moved=False)
    ) == (0.0,)
    assert CrackWater.resumed((5e4,), PAST) == (1.0,)
    assert CrackWater.resumed((5e4,), PAST._replace(opening=0.0)) == (0.0,)
    assert CrackWater.resumed((5e4,), PAST._replace(has_moved=False)) == (0.0,)
    assert CrackWater.resumed((5e4,), PAST._replace(has_moved=False, gap=0.001)) == (1.0,)


def test_laws_give_up_and_take_back():
    memory = np.zeros(1)
    assert not StaticFriction.release((0.6, 0.7, 0.6, 0.5), memory, state())
    assert (
        StaticFriction.release((0.6, 0.7, 0.6, 0.5), memory, state(sliding=1.0)) and memory[0] == 1.0
    )  # by k
    assert not StaticFriction.release((0.6, 0.5, 0.6, 0.5), np.zeros(1), state(sliding=1.0))
    StaticFriction.commit((0.6, 0.7, 0.6, 0.5), memory, state())
    assert memory[0] == 0.0
    key = np.zeros(1)
    assert not ShearKey.release((0.01, 1.0, 0.0), key, state(opening=0.01))
    assert ShearKey.release((0.01, 1.0, 0.0), key, state(opening=0.011)) and key[0] == 1.0
    found = limit_of(ShearKey, (0.01, 0.0, 1.0), (0.0,))
    assert found[COHESION_J] == 0.0 and found[COHESION_K] == math.inf
    ShearKey.commit((0.01, 1.0, 0.0), key, state(opening=0.01))
    assert key[0] == 0.0
    rate = np.zeros(1)
    VelocityFriction.commit((0.6, 0.2, 0.05), rate, state(rate=0.3))
    assert rate[0] == 0.3
    found = limit_of(StaticFriction, (0.8, 0.4, 0.6, 0.5), (0.0,), ((MU_J, 0.6), (MU_K, 0.5)))
    assert (found[MU_J], found[MU_K]) == (0.8, 0.5)


@pytest.mark.parametrize(
    ("excess", "opening", "p", "open_"),
    [
        (-5e4, 0.0, 4e4, 1.0),  # lost water is back when the closed gap can carry it
        (-5e4, 0.0, 5e4, 0.0),
        (5e4, -1e-4, 0.0, 0.0),
        (5e4, 1e-4, 0.0, 1.0),
    ],
)
def test_water_of_a_crack_goes_as_it_closes(excess, opening, p, open_):
    memory = np.ones(1)
    CrackWater.commit((excess,), memory, state(opening=opening, p=p))
    assert memory[0] == open_


def test_a_joint_whose_basic_angle_is_steep_keeps_it():
    """atan 2.9 is 71 degrees, above the limit of 70 at low stress, which the roughness alone may not pass."""
    for p in (0.0, 1.0, 2e6):
        assert limit_of(BartonBandis, (8.0, 1e6, 2.9), (), p=p)[MU_J] == pytest.approx(2.9, rel=1e-12)


def test_a_single_contact_keeps_its_laws():
    """Coupled flexibilities, cohesion and friction, on a disc and in a rectangle."""
    random = np.random.default_rng(5)
    kinds = set()
    for case in range(60):
        L = random.normal(size=(3, 3))
        A, b = L @ L.T + 0.4 * np.eye(3), random.normal(size=3) * (1.0, 2.0, 2.0)
        c, mu = random.uniform(0.0, 0.3, 2), random.uniform(0.1, 0.6, 2)
        if case % 2:
            c[1], mu[1] = c[0], mu[0]
        p = np.zeros(3)
        assert solve_gap(A, b, c, mu, p)
        y, limit = A @ p + b, c + mu * p[0]
        assert p[0] >= -1e-12 and y[0] >= -1e-9 and abs(p[0] * y[0]) < 1e-9
        shear, moved = p[1:], y[1:]
        if case % 2:
            assert np.hypot(*shear) <= limit[0] * (1 + 1e-9)
            slid = np.hypot(*moved) > 1e-9
            if slid and limit[0] > 0.0:
                assert shear == pytest.approx(-limit[0] * moved / np.hypot(*moved), abs=1e-8)
        else:
            assert (np.abs(shear) <= limit * (1 + 1e-9)).all()
            for a in np.flatnonzero(np.abs(moved) > 1e-9):
                assert shear[a] == pytest.approx(-np.sign(moved[a]) * limit[a], abs=1e-8)
        kinds.add((case % 2, bool(p[0] > 1e-12), bool((np.abs(moved) > 1e-9).any())))
    assert len(kinds) >= 6


def test_jumps_of_an_opening_gap_that_closed_ones_hold_back():
    """W = [[4, 2, 1], [2, 8, 0], [1, 0, 5]]: pulled with 1 gap 0 moves by 4, less 4/8 where gap 1 is closed.

    Gap 2 is open and holds nothing back.
    """
    W = np.array([[4.0, 2.0, 1.0], [2.0, 8.0, 0.0], [1.0, 0.0, 5.0]])
    memory = SimpleNamespace(
        force=np.array([-1.0, 3.0, 0.0]), limits=SimpleNamespace(tension=np.zeros(3)), step=np.zeros((3, 8))
    )
    corrected, A = np.array([[True], [False], [False]]), np.array([[4.0]])
    softening._answer_of_others.py_func(W, memory, 1, np.array([0]), np.array([[-1.0]]), corrected, A)
    assert A.item() == pytest.approx(3.5, rel=1e-9)
