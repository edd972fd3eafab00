"""What a gap's springs, laws and strength give, worked out on paper; nothing here compiles a time loop."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from romdam.contact import step, strength
from romdam.contact.cone import project_shear, slides
from romdam.contact.laws.barton_bandis import BartonBandis
from romdam.contact.laws.bond import Bond
from romdam.contact.laws.crack_water import CrackWater
from romdam.contact.laws.law import (
    COHESION_J,
    COHESION_K,
    DT,
    ENTRIES,
    MU_J,
    MU_K,
    NORMAL_FORCE,
    OPENING,
    RATE,
    SLIP_J,
    SLIP_K,
    STEP_ENTRIES,
    TENSION,
    WATER,
)
from romdam.contact.laws.slip_weakening import SlipWeakening
from romdam.contact.laws.static_friction import StaticFriction
from romdam.contact.laws.velocity_friction import VelocityFriction
from romdam.contact.problem import Limits, gap_problem, self_flexibility
from romdam.core.system import GapLaw


def law_of(K_n, K_s):
    """Two gaps."""
    return GapLaw(np.array(K_n), np.zeros(2), np.array(K_s), np.full((2, 2), 0.5), np.zeros(2), {})


def test_flexibility_of_a_gap_in_its_plane_is_that_of_the_softest_direction():
    """[[5, 2], [2, 8]] has 6.5 -+ 2.5: 4 and 9; [[8, 3], [3, 0]] has 4 -+ 5: -1 and 9."""
    block = np.array([[2.0, 7, 7], [7, 5, 2], [7, 2, 8]])
    other = np.array([[3.0, 1, 1], [1, 8, 3], [1, 3, 0]])
    np.testing.assert_allclose(self_flexibility(np.stack([block, other])), [[2, 9, 9], [3, 9, 9]], rtol=1e-14)


def test_theta_of_springs_and_their_compliance():
    """theta = 1/2 + z / (z + 70) / 2 of z = k H is 3/4 at 70, 7/8 at 210 and 11/14 at 280/3."""
    H = np.diag([7e-8, 7e-8, 7e-8, 21e-8, 7e-8, 7e-8])
    problem = gap_problem(H, law_of([1e9, 1e9], [1e9, 4e9 / 3]), 1e-3, 1.0)
    ratio = np.array([1 / 3, 1 / 3, 1 / 3, 1 / 7, 3 / 11, 3 / 11])
    np.testing.assert_allclose(problem.theta_ratio, ratio, rtol=1e-12)
    compliance = np.array([1e-9, 1e-9, 1e-9, 1e-9, 0.75e-9, 0.75e-9]) * (1.0 + ratio)
    np.testing.assert_allclose(problem.compliance, compliance, rtol=1e-12)
    np.testing.assert_allclose(np.diagonal(problem.W), np.diagonal(H) + compliance, rtol=1e-12)
    rigid = gap_problem(H, law_of([np.inf, 1e9], [1e9, 1e9]), 1e-3, 1.0)
    assert rigid.theta_ratio[0] == rigid.compliance[0] == 0.0


def test_shear_follows_its_spring_within_the_step():
    """Springs of 0.03 m/N, r = 1/3: their compliance in the step is 0.04; rigid along the normal, open by 1.

    Jump y + rest - 0.04 t - r e = 0.02 + 0.02 + 0.24 - 0.02 = 0.26 and 0.05 - 0.01 + 0.12 + 0.01 = 0.17;
    force (rest - jump) / 0.03 = (-8, -6), on the disc of 5 (-4, -3), springs (0.12, 0.09); slip 0.26 - 0.12 -
    0.02 = 0.12 and 0.17 - 0.09 + 0.01 = 0.09. Stored 0.03 (16 + 9) / 2 = 0.375. Slid 6 0.12 + 3 0.09 = 0.99,
    but no more than what was taken: 0.06^2 / 0.06 + 6 (0.26 - 0.1) + 0.03^2 / 0.06 + 3 (0.17 - 0.2) = 0.945,
    less what is stored.
    """
    problem = SimpleNamespace(
        gap=np.zeros(1),
        tension=np.zeros(1),
        theta_ratio=np.array([0.0, 1 / 3, 1 / 3]),
        compliance=np.array([0.0, 0.04, 0.04]),
    )
    memory = SimpleNamespace(
        force=np.array([9.0, -6, -3]),
        spring=np.array([0.7, 0.06, -0.03]),
        accumulated_slip=np.array([[0.02, -0.01]]),
        limits=Limits(np.full((1, 2), 5.0), np.zeros((1, 2)), np.zeros(1)),
    )
    y, jump, force = np.array([1.0, 0.02, 0.05]), np.array([[0.0, 0.1, 0.2]]), np.zeros((1, 3))
    dissipated = np.zeros(1)
    gaps = SimpleNamespace(jump=jump, traction=force, state=np.zeros(1, int), dissipated_energy=dissipated)
    held, slid = step._move.py_func(problem, memory, y, gaps)
    np.testing.assert_allclose(jump[0], [1.0, 0.26, 0.17], rtol=1e-12)
    np.testing.assert_allclose(force[0], [9.0, -4, -3], rtol=1e-12)
    np.testing.assert_allclose(memory.spring, [0.0, 0.12, 0.09], rtol=1e-12)
    np.testing.assert_allclose(memory.accumulated_slip, [[0.14, 0.08]], rtol=1e-12)
    assert (held, slid) == (pytest.approx(0.375), pytest.approx(0.945 - 0.375))


@pytest.mark.parametrize(
    ("limits", "shear", "slips"),
    [
        ((2.5, 2.5), (1.5, -2.0), True),  # half of (3, -4) on a disc
        ((6.0, 6.0), (3.0, -4.0), False),
        ((2.0, 5.0), (2.0, -4.0), True),  # a rectangle
        ((3.5, 1.0), (3.0, -1.0), True),
    ],
)
def test_nearest_admissible_shear(limits, shear, slips):
    *found, slid = project_shear.py_func(3.0, -4.0, *limits)
    assert (tuple(found), slid) == (pytest.approx(shear), slips)
    assert slides.py_func(*limits, *found) == slips


def test_strength_without_further_laws_is_friction_under_compression():
    force = np.zeros((2, 2, 3))
    force[:, :, 0] = [[4.0, -2.0], [10.0, 0.0]]
    found, bonded = strength.shear_strength(
        np.array([[0.5, 0.25], [0.6, 0.7]]), None, np.zeros(0), force[..., 0], force
    )
    np.testing.assert_allclose(found, [[[2, 1], [0, 0]], [[5, 2.5], [0, 0]]])
    assert bonded.shape == (2, 2) and not bonded.any()


def test_strength_of_a_bond_is_cohesion_and_friction(monkeypatch):
    """c + mu p: 5 + 0.5 4 and 5 + 0.25 4 at p = 4, 5 - 0.5 and 5 - 0.25 at -1, and at the tension of 2."""

    def put_limit(laws, memory, i, of_step, limit):
        limit[TENSION], limit[COHESION_J], limit[COHESION_K], limit[MU_J], limit[MU_K] = (
            2.0,
            5.0,
            5.0,
            0.5,
            0.25,
        )
        return 0

    monkeypatch.setattr(strength, "put_limit", put_limit)
    found, bonded = np.zeros((3, 1, 2)), np.zeros((3, 1), dtype=bool)
    opening, force = np.zeros((3, 1)), np.array([[4.0], [-1.0], [-2.0]])
    assert strength._fill.py_func(None, np.zeros((3, 1, 1, 1)), opening, force, found, bonded) == 0
    np.testing.assert_allclose(found[:, 0], [[7, 6], [4.5, 4.75], [4, 4.5]])
    assert bonded.all()


@pytest.mark.parametrize(
    ("tension", "along", "has_bond"),
    [(0.0, (0.0, 5.0), True), (0.0, (5.0, 0.0), True), (2.0, (0.0, 0.0), True), (0.0, (0.0, 0.0), False)],
)
def test_cohesion_or_tension_alone_is_a_bond(tension, along, has_bond, monkeypatch):
    """c + 0.5 p and c + 0.25 p at p = 4."""

    def put_limit(laws, memory, i, of_step, limit):
        limit[TENSION], limit[COHESION_J], limit[COHESION_K], limit[MU_J], limit[MU_K] = (
            tension, *along, 0.5, 0.25,
        )  # fmt: skip
        return 0

    monkeypatch.setattr(strength, "put_limit", put_limit)
    found, bonded = np.zeros((1, 1, 2)), np.zeros((1, 1), dtype=bool)
    assert strength._fill.py_func(None, np.zeros((1, 1, 1, 1)), np.zeros((1, 1)), np.array([[4.0]]), found,
                                  bonded) == 0  # fmt: skip
    assert bonded.item() == has_bond
    # of a tension without cohesion the friction begins at the tension
    np.testing.assert_allclose(
        found[0, 0], [max(along[0], 0.5 * tension) + 2.0, max(along[1], 0.25 * tension) + 1.0]
    )


def limit_of(law, parameters, memory, **of_step):
    """Entries of a law's `limit` in a step."""
    names = {"opening": OPENING, "p": NORMAL_FORCE, "j": SLIP_J, "k": SLIP_K, "rate": RATE, "dt": DT}
    entries, limit = np.zeros(STEP_ENTRIES), np.zeros(ENTRIES)
    for name, value in of_step.items():
        entries[names[name]] = value
    law.limit(parameters, memory, entries, limit)
    return limit


def test_friction_that_weakens_with_the_path_of_slip():
    """4 mm before and (3, 4) mm now: 9 mm over 10 mm."""
    found = limit_of(SlipWeakening, (0.8, 0.3, 0.01), np.array([0.004]), j=0.003, k=-0.004)
    assert found[MU_J] == found[MU_K] == pytest.approx(0.3 + 0.5 * math.exp(-0.9), rel=1e-12)
    memory = np.array([0.004])
    SlipWeakening.commit((0.8, 0.3, 0.01), memory, np.array([0, 0, 0.003, -0.004, 0, 0, 0, 0]))
    assert memory[0] == pytest.approx(0.009, rel=1e-12)


def test_friction_that_depends_on_the_rate():
    """Of the step; of the last one where there is no time, as in statics."""
    found = limit_of(VelocityFriction, (0.6, 0.2, 0.05), np.array([0.1]), rate=0.025, dt=0.01)
    assert found[MU_J] == found[MU_K] == pytest.approx(0.2 + 0.4 * math.exp(-0.5), rel=1e-12)
    found = limit_of(VelocityFriction, (0.6, 0.2, 0.05), np.array([0.1]), rate=0.025)
    assert found[MU_J] == pytest.approx(0.2 + 0.4 * math.exp(-2.0), rel=1e-12)


def test_friction_of_a_rough_joint():
    """tan 30 degrees and JRC = 8: 30 + 8 log10(100) = 46 degrees; 30 + 8 log10(1e6) = 78 are 70 at most."""
    parameters = (8.0, 1e6, math.tan(math.radians(30.0)))
    for p, degrees in ((1e4, 46.0), (1.0, 70.0), (2e6, 30.0), (0.0, 70.0)):
        assert limit_of(BartonBandis, parameters, np.zeros(0), p=p)[MU_K] == pytest.approx(
            math.tan(math.radians(degrees)), rel=1e-12
        )


def test_bonds_static_friction_and_water_act_until_they_are_lost():
    whole, broken = np.array([0.0]), np.array([1.0])
    found = limit_of(Bond, (3.0, 7.0), whole)
    assert (found[TENSION], found[COHESION_J], found[COHESION_K]) == (3.0, 7.0, 7.0)
    assert not limit_of(Bond, (3.0, 7.0), broken).any()
    found = limit_of(StaticFriction, (0.8, 0.7, 0.6, 0.5), whole)
    assert (found[MU_J], found[MU_K]) == (0.8, 0.7)
    assert not limit_of(StaticFriction, (0.8, 0.7, 0.6, 0.5), broken).any()
    assert (
        limit_of(CrackWater, (5e4,), broken)[WATER] == 5e4 and not limit_of(CrackWater, (5e4,), whole).any()
    )
