"""The laws of `romdam.contact.laws`, step by step at one gap: closed forms, the point laws, what none may do.

The gap is as flexible in every direction: w = w_free + h p.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from further_laws import with_laws
from gap_problems import STEP
from point_law import Gap, Past, strong
from scipy.optimize import brentq

from romdam.contact.laws import (
    LAWS,
    BartonBandis,
    Bond,
    Coulomb,
    Dashpot,
    Fracture,
    Grouting,
    Penalty,
    ShearKey,
    ShearStiffness,
    SlipWeakening,
    StaticFriction,
    TensionStiffness,
    VelocityFriction,
)
from romdam.contact.laws import law as protocol
from romdam.contact.laws.catalogue import source_of
from romdam.contact.problem import gap_memory, gap_problem, law_memory
from romdam.contact.step import commit_gaps, solve_gaps
from romdam.contact.strength import shear_strength
from romdam.core.recorded import new_gap_arrays
from romdam.core.system import OPEN, SLIP, STICK, GapLaw, LawRows

EXACT = 1e-13  # the solver's tolerance here


@dataclass
class OneGap:
    """A gap that is led from step to step by free jumps."""

    law: GapLaw
    flexibility: float

    def __post_init__(self):
        d = self.law.directions
        self.problem = gap_problem(self.flexibility * np.eye(d), self.law, STEP)
        self.memory = gap_memory(self.problem)
        self.gaps = new_gap_arrays(1, d)
        self.jump, self.force, self.state = self.gaps.jump, self.gaps.traction, self.gaps.state
        self.jump[0, 0] = self.law.gap[0]
        self.stored = 0.0

    def solved(self, *free):
        """Residual displacements y (d,) of a step that is not accepted; memory.force is its force."""
        y, closed = np.empty(len(self.memory.force)), self.memory.force[:1] > 0.0
        free = np.array(free[: len(y)])
        assert solve_gaps(self.problem, self.memory, closed, free, y, EXACT, False) <= EXACT
        return y

    def step(self, *free):
        """(force, state) of an accepted step; force is (p_n, t_j, t_k) or (p_n,)."""
        self.stored, self.taken, _ = commit_gaps(self.problem, self.memory, self.solved(*free), self.gaps)
        return tuple(self.force[0]), int(self.state[0])


def by_hand(gap=0.0, mu=0.0, **laws):
    """K_n 4e6, K_s 1e6 N/m, h 1e-6 m/N: -5 mm of free approach press with 4000 N; shear is (w - s) / 2e-6."""
    one = np.ones(1)
    law = GapLaw(4e6 * one, 0.0 * one, 1e6 * one, np.full((1, 2), mu), gap * one, {})
    return OneGap(with_laws(law, **laws), 1e-6)


CLOSED = -5e-3
ABOUT = {"rel": 1e-9, "abs": 1e-6}  # N


def led(gap, *path):
    """Check (normal, j) free jumps [m] against (t_j, state)."""
    for n, j, shear, state in path:
        force, found = gap.step(n, j, 0.0)
        assert force[1:] == pytest.approx((shear, 0.0), **ABOUT) and found == state, (n, j)


def test_static_friction_is_regained_by_sticking_and_lost_again_at_its_own_limit():
    """p 4000 N: mu p is 2000 N, mu_s p 3000 N. A slip leaves w - s at 2e-6 * 2000 N = 4 mm."""
    led(
        by_hand(mu=0.5, friction_static=[[0.75, 0.75]]),
        (CLOSED, 5e-3, -2500.0, STICK),
        (CLOSED, 7e-3, -2000.0, SLIP),  # 3500 N wanted; s 3 mm
        (CLOSED, 8e-3, -2000.0, SLIP),  # 2500 N wanted of a gap that slides; s 4 mm
        (CLOSED, 7e-3, -1500.0, STICK),
        (CLOSED, 9e-3, -2500.0, STICK),  # more than mu p
        (CLOSED, 10.5e-3, -2000.0, SLIP),  # 3250 N wanted; s 6.5 mm
        (CLOSED, 12e-3, -2000.0, SLIP),
    )


def test_a_key_comes_out_above_its_depth_and_holds_where_it_comes_in_again():
    """Depth 1 mm, along j only, no friction."""
    gap = by_hand(shear_key=[[1e-3, 1.0, 0.0]])
    led(
        gap,
        (CLOSED, 2e-3, -1000.0, STICK),
        (0.5e-3, 2e-3, -1000.0, OPEN),  # open below its depth
        (2e-3, 3e-3, 0.0, OPEN),  # out; s 3 mm
        (CLOSED, 4e-3, 0.0, STICK),  # in again at the end of the step; s 4 mm
        (CLOSED, 5e-3, -500.0, STICK),
        (0.5e-3, 5e-3, -500.0, OPEN),
        (2e-3, 5e-3, 0.0, OPEN),
    )
    assert gap.step(CLOSED, 5e-3, 1e-3)[0][2] == 0.0


def test_a_key_of_a_gap_that_is_wider_than_its_depth_is_out_at_first():
    led(
        by_hand(gap=2e-3, shear_key=[[1e-3, 1.0, 1.0]]),
        (-1.5e-3, 2e-3, 0.0, OPEN),  # opening 0.5 mm: in from the end of the step on; s 2 mm
        (-1.5e-3, 3e-3, -500.0, OPEN),
    )


def test_a_bond_pulls_up_to_its_strength_and_an_initial_gap_has_none():
    """-3 mm against a gap of 1 mm press with 2e-3 / 1.25e-6 N; opening by 0.1 mm a bond pulls with 80 N."""
    bonded, apart = (by_hand(gap, tensile_strength=[500.0]) for gap in (0.0, 1e-3))
    for gap, w in ((bonded, -2e-3), (apart, -3e-3)):
        assert gap.step(w)[0] == pytest.approx((1600.0,), **ABOUT)
    assert bonded.step(0.1e-3)[0] == pytest.approx((-80.0,), **ABOUT)
    assert apart.step(-0.9e-3) == ((0.0,), OPEN)
    assert bonded.step(1e-3) == ((0.0,), OPEN)  # 800 N wanted: lost
    assert bonded.step(0.1e-3) == ((0.0,), OPEN)


def test_friction_follows_the_speed_of_the_step():
    """mu = 0.6 - 0.4 exp(-v / v_c): the slip of a step leaves the shear that it makes."""
    gap, before = by_hand(velocity=[0.2, 0.6, 6.8]), 0.0
    for jump in (5e-3, 8.4e-3):

        def missing(shear, jump=jump, before=before):
            slip = jump - shear / 5e5 - before
            return 4000.0 * (0.6 - 0.4 * math.exp(-slip / (6.8 * STEP))) - shear

        shear = brentq(missing, 0.0, 3000.0, xtol=1e-12)
        led(gap, (CLOSED, jump, -shear, SLIP))
        slip, before = jump - shear / 5e5 - before, jump - shear / 5e5
        assert gap.memory.history[-1, 0, 0] == pytest.approx(slip / STEP, rel=1e-8)
    past = protocol.Past(0.0, float(gap.jump[0, 0]), True, True, 3.4)
    for sliding in (True, False):
        row = law_memory(gap.law, lambda each, row, i, s=sliding: each.resumed(row, past._replace(sliding=s)))
        assert row[-1, 0, 0] == (3.4 if sliding else 0.0)


# What a parameter is in the tests below, by its unit and by its name; p is about 1e6 N, a jump about 1 mm.
BY_UNIT = {
    "": 0.6, "Pa": 1e5, "m": 3e-4, "m/s": 0.3, "N/m^3": 1e9, "N*s/m^3": 1e6, "axes": ("j",),
    "s": 1e-2, "N": 1e5, "N/m": 1e9, "1/s": 10.0, "Hz": 10.0,
}  # fmt: skip
BY_NAME = {
    "friction": (0.4, 0.4), "mu_d": 0.9, "JRC": 10.0, "JCS": 1e7, "mu_b": 0.5,
    "tension_stiffness": 3e8, "shear_stiffness": 5e8, "energy": 100.0, "shear_energy": 2e3,
}  # fmt: skip
ALWAYS = ("normal_stiffness", "shear_stiffness", "friction")

# Laws that the point laws do not have, and why
EXEMPT = {
    Grouting: "acts before the first step, on the initial gap (tests/timestepping/test_static_state.py)"
}
ORACLE = {
    Penalty, TensionStiffness, ShearStiffness, Dashpot, Coulomb, StaticFriction, VelocityFriction,
    SlipWeakening, BartonBandis, Bond, Fracture, ShearKey,
}  # fmt: skip
TOGETHER = (Dashpot, Coulomb, StaticFriction, Bond, ShearKey)


def _value(parameter):
    if parameter.choices:
        return parameter.default
    value = BY_NAME.get(parameter.name, BY_UNIT[parameter.unit])
    return (value, value) if parameter.both and not isinstance(value, tuple) else value


def keys_of(laws):
    """Every key of a joint with these laws, and with stiffness and friction unless they forbid it."""
    keys = {}
    for law in LAWS:
        values = {p.name: _value(p) if law in laws or p.name in ALWAYS else p.default for p in law.parameters}
        keys |= {law.section: values if law in laws else None} if law.section else values
    if any(law.wrong(keys) for law in laws):
        keys["friction"] = (0.0, 0.0)
    assert [law.wrong(keys) for law in laws] == [None] * len(laws)
    return keys


def law_of(laws, gap=0.0):
    """One gap of 1 m2 with these laws, as `romdam.scene.joints` makes it."""
    keys = keys_of(laws)
    own = {law.array: np.array(law.row(keys, 1.0)) for law in LAWS if law.array and law is not Coulomb}
    rows = tuple(
        LawRows(source_of(law), np.array([law.row(keys, 1.0)]), np.ones(1, dtype=bool), law.needs_shear(keys))
        for law in LAWS
        if law in laws and not law.array
    )
    return GapLaw(**own, mu=np.array([keys["friction"]]), gap=np.array([gap]), joints={}, laws=rows)


def point_gap(laws):
    """The same for the point laws."""
    keys = keys_of(laws)
    key = keys["shear_key"] or {"depth": 0.0, "directions": ()}
    velocity = keys["velocity_friction"] or {"mu_s": 0.0, "mu_d": 0.0, "v_c": 0.0}
    weakening = keys["slip_weakening"] or {"mu_s": 0.0, "mu_d": 0.0, "d_c": 0.0}
    rough = keys["barton_bandis"] or {"JRC": 0.0, "JCS": 0.0, "mu_b": 0.0}
    soft = keys["fracture"] or dict.fromkeys(("tensile_strength", "energy", "cohesion", "shear_energy"), 0.0)
    return Gap(
        keys["normal_stiffness"],
        keys["tension_stiffness"],
        keys["shear_stiffness"],
        keys["friction"],
        tension=keys["tensile_strength"],
        cohesion=keys["cohesion"],
        mu_static=keys["friction_static"] or (0.0, 0.0),
        key=key["depth"],
        keyed=("j" in key["directions"], "k" in key["directions"]),
        viscous=keys["viscosity"] / STEP,
        velocity=(velocity["mu_s"], velocity["mu_d"], velocity["v_c"] * STEP),
        weakening=(weakening["mu_s"], weakening["mu_d"], weakening["d_c"]),
        rough=(rough["JRC"], rough["JCS"], rough["mu_b"]),
        fracture=(soft["tensile_strength"], soft["energy"], soft["cohesion"], soft["shear_energy"]),
    )


def free_jumps(seed, steps):
    """Jumps about 1 mm, closed more often than open, long steps and short ones."""
    rng = np.random.default_rng(seed)
    w = np.array([-1e-3, 0.0, 0.0])
    for _ in range(steps):
        w = np.array([-3e-4, 0.0, 0.0]) + 0.8 * w + 10.0 ** rng.uniform(-4.5, -2.7) * rng.standard_normal(3)
        yield w


def kept(gap):
    """What the laws keep of the gap, by the names of the point laws' `Past`."""
    named = {"broken": "broken", "slides": "sliding", "out": "out", "rate": "slipped", "path": "path"}
    named |= {name: name for name in ("damage", "widest", "crack", "stored")}
    found = {}
    for k, rows in enumerate(gap.law.laws, start=len(gap.memory.history) - len(gap.law.laws)):
        (law,) = (each for each in LAWS if source_of(each) == rows.law)
        found |= {
            named[name]: gap.memory.history[k, 0, e] for e, name in enumerate(law.memory) if name in named
        }
    return found


def test_every_law_is_held_against_the_point_laws_or_exempt():
    assert set(LAWS) == ORACLE | set(EXEMPT) and not ORACLE & set(EXEMPT)


@dataclass
class Seen:
    """What a march has shown."""

    states: set = field(default_factory=set)
    changes: dict = field(default_factory=dict)


def held_against_the_point_laws(laws, initial_gap, seed, seen):
    gap, point = OneGap(law_of(laws, initial_gap), 1e-9), point_gap(laws)
    past = Past(broken=initial_gap > 0.0, out=any(point.keyed) and initial_gap > point.key)
    past = past._replace(damage=1e3 if point.fracture[0] > 0.0 and initial_gap > 0.0 else 0.0)
    for w in free_jumps(seed, 60):
        force, state = gap.step(*w)
        wanted, expected, past = strong(tuple(gap.jump[0]), past, point)
        assert force == pytest.approx(wanted, rel=1e-9, abs=1e-9 * 1e6)
        assert state == expected
        assert gap.memory.accumulated_slip[0] == pytest.approx(past.anchor, rel=1e-9, abs=1e-14)
        for name, value in kept(gap).items():
            assert value * (STEP if name == "slipped" else 1.0) == pytest.approx(
                float(getattr(past, name)), rel=1e-7, abs=1e-14
            ), name
            seen.changes.setdefault(name, set()).add(value > 0.0)
        seen.states.add(state)


@pytest.mark.parametrize(
    "laws",
    [(law,) for law in LAWS if law not in EXEMPT] + [TOGETHER],
    ids=lambda laws: "together" if laws is TOGETHER else laws[0].__name__,
)
def test_sixty_random_steps_follow_the_point_law(laws):
    """Force, state, accumulated slip and all that the laws keep, from step to step."""
    seen = Seen()
    for seed in range(6):
        held_against_the_point_laws(laws, 0.0 if seed % 2 == 0 else 5e-4, seed, seen)
    assert seen.states == {OPEN, STICK, SLIP}
    assert all(values == {False, True} for values in seen.changes.values()), "nothing was lost, or regained"


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_a_law_makes_no_energy_keeps_its_limits_and_is_pure(law):
    """On random paths: what is taken from the blocks is stored or lost, |t| <= c + mu p, p >= 0 without
    tension, and solutions that are not accepted leave no trace."""
    for seed in range(4):
        gap = OneGap(law_of((law,)), 1e-9)
        pulls = gap.law.K_nz.any() or law in (Bond, Fracture)
        for w in free_jumps(seed, 40):
            before = gap.memory.history.copy(), gap.memory.accumulated_slip.copy()
            first = gap.solved(*w), gap.memory.force.copy()
            gap.solved(*-w)
            again = gap.solved(*w), gap.memory.force.copy()
            assert (gap.memory.history == before[0]).all()
            assert (gap.memory.accumulated_slip == before[1]).all()
            assert np.abs(first[0] - again[0]).max() <= 1e-12 * 1e-3
            assert np.abs(first[1] - again[1]).max() <= 1e-9 * 1e6
            jump, stored, rows = gap.jump.copy(), gap.stored, gap.memory.history[None].copy()
            force, _ = gap.step(*w)
            work = -(gap.force * (gap.jump - jump)).sum()
            assert gap.taken >= -1e-6 and work - (gap.stored - stored) - gap.taken >= -1e-6  # of about 1 kJ
            assert pulls or force[0] >= 0.0
            damage = rows[0, -1, 0, 0] if law is Fracture else 0.0
            rows = gap.memory.history[None].copy() if law.follows_step else rows
            opening = gap.jump[None, :, 0]
            strength, _ = shear_strength(gap.law.mu, gap.problem.laws, rows, opening, gap.force[None])
            limit = strength[0, 0]
            if law is Fracture:  # the force of a step that softens is the mean, above what is left
                limit = 1e5 * max(1.0 - damage, 0.0) + 0.4 * max(force[0], 0.0) * np.ones(2)
            size = math.hypot(*force[1:]) if limit[0] == limit[1] else np.abs(force[1:])
            assert (size <= limit * (1.0 + 1e-9) + 1e-3).all()
