"""Laws whose limits depend on the step that is solved, inside the package and in a user's file."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from test_law_steps import CLOSED, OneGap

import romdam
from romdam.contact.laws import BartonBandis, SlipWeakening
from romdam.contact.laws.catalogue import find_law, source_of, user_law
from romdam.core.system import SLIP, STICK, GapLaw, LawRows

INSIDE = Path(romdam.__file__).parent / "contact" / "laws" / "slip_weakening.py"
SPRING = 5e5  # shear per free jump of the gap: K_s 1e6 N/m in series with 1e-6 m/N [N/m]


def one_gap(source, row):
    """A gap of K_n 4e6 N/m and K_s 1e6 N/m on 1e-6 m/N with a law."""
    one, values = np.ones(1), np.array([row])
    rows = (LawRows(source, values, np.ones(1, dtype=bool), shear=True),)
    law = GapLaw(4e6 * one, 0 * one, 1e6 * one, np.zeros((1, 2)), 0 * one, {}, laws=rows)
    assert find_law(source).follows_step
    return OneGap(law, 1e-6)


def slip_weakening(where, folder):
    """The law inside, or the same text as a file of a user's with a key of its own."""
    if where == "inside":
        return source_of(SlipWeakening)
    (folder / "weakening.py").write_text(INSIDE.read_text().replace('section = "', 'section = "my_'))
    return user_law("weakening.SlipWeakening", folder / "weakening.py")


@pytest.mark.parametrize("where", ["inside", "user"])
def test_slip_weakening_loses_friction_with_the_path_of_the_slip(tmp_path, where):
    """p = 4000 N; the shear T of a jump u from the rest r: T = p mu(path + |u - r - T / k|), k = 5e5 N/m.

    There and back: the path adds up, the slip does not.
    """
    gap, path, rest = one_gap(slip_weakening(where, tmp_path), [0.6, 0.2, 0.02]), 0.0, 0.0
    force, state = gap.step(CLOSED, 4e-3, 0.0)
    assert force[1] == pytest.approx(-2000.0, rel=1e-9) and state == STICK
    for jump in (7e-3, 12e-3, -4e-3, 9e-3):
        way = np.sign(jump - rest)

        def missing(shear, jump=jump, path=path, rest=rest):
            slip = abs(jump - rest) - shear / SPRING
            return 4000.0 * (0.2 + 0.4 * np.exp(-(path + slip) / 0.02)) - shear

        shear = brentq(missing, 0.0, 2400.0, xtol=1e-12)
        force, state = gap.step(CLOSED, jump, 0.0)
        assert force[0] == pytest.approx(4000.0, rel=1e-9) and state == SLIP
        assert force[1] == pytest.approx(-way * shear, rel=1e-8)
        path += abs(jump - rest) - shear / SPRING
        rest = jump - way * shear / SPRING
        assert gap.memory.history[-1, 0, 0] == pytest.approx(path, rel=1e-8)
    assert path > 0.02 and abs(rest) < path / 2


def test_friction_that_depends_on_the_pressure_of_the_step():
    """T = mu_0 p_0^n p^(1 - n): the compression grows eightfold, the friction by the square root of it."""
    source = user_law("pressure.PressureFriction", Path(__file__).with_name("pressure.py"))
    gap = one_gap(source, [0.5, 2000.0, 0.5])
    for closed, along in ((-2e-3, 8e-3), (-16e-3, 40e-3), (-4e-3, 60e-3)):
        p = -closed / 1.25e-6
        force, state = gap.step(closed, along, 0.0)
        assert force[0] == pytest.approx(p, rel=1e-9) and state == SLIP
        assert force[1] == pytest.approx(-0.5 * np.sqrt(2000.0 * p), rel=1e-8)


@pytest.mark.parametrize(
    ("p", "angle"),
    [(4000.0, 40.0), (40000.0, 30.0), (400000.0, 30.0), (400.0, 50.0), (0.4, 70.0)],
    ids=["a tenth of the strength", "the strength", "beyond it", "a hundredth", "the steepest"],
)
def test_a_rough_joint_of_barton_and_bandis(p, angle):
    """JRC 10, JCS 40 kN of the gap, phi_b 30 degrees: ten degrees more for each tenth of the stress."""
    gap = one_gap(source_of(BartonBandis), [10.0, 4e4, np.tan(np.radians(30.0))])
    gap.step(-2.0 * p * 1.25e-6, 0.0, 0.0)
    force, state = gap.step(-p * 1.25e-6, 0.0, 6.0 * p / SPRING)
    assert force[0] == pytest.approx(p, rel=1e-9) and state == SLIP
    assert force[2] == pytest.approx(-p * np.tan(np.radians(angle)), rel=1e-8)


def test_the_direction_of_the_slip_does_not_matter():
    """The same path turned by 37 degrees in the plane of the gap."""
    c, s = np.cos(np.radians(37.0)), np.sin(np.radians(37.0))
    straight, turned = (one_gap(source_of(SlipWeakening), [0.6, 0.2, 0.02]) for _ in range(2))
    for j, k in ((7e-3, 1e-3), (9e-3, -6e-3), (-8e-3, 2e-3)):
        (_, t_j, t_k), _ = straight.step(CLOSED, j, k)
        (_, o_j, o_k), _ = turned.step(CLOSED, c * j - s * k, s * j + c * k)
        assert (o_j, o_k) == pytest.approx((c * t_j - s * t_k, s * t_j + c * t_k), rel=1e-8)


WATER_LAW = '''
from romdam.contact.laws.law import MU_J, MU_K, OPENING, SLIP_J, WATER, Law, Parameter


class Leak(Law):
    """Water in an open gap, in proportion to its opening."""

    section = "leak"
    parameters = (Parameter("stiffness", "N/m"),)
    follows_step = True

    @staticmethod
    def limit(parameters, memory, step, limit):
        limit[WATER] = parameters[0] * max(step[OPENING], 0.0)


class Unequal(Law):
    """Friction along j that grows with the slip, less than the constant one along k or more."""

    section = "unequal"
    parameters = (Parameter("along_k", ""), Parameter("per_slip", "1/s"))
    shear = True
    follows_step = True

    @staticmethod
    def limit(parameters, memory, step, limit):
        limit[MU_J], limit[MU_K] = 0.3 + parameters[1] * abs(step[SLIP_J]), parameters[0]
'''


def of_file(folder, name, row, K_s, mu):
    (folder / "further.py").write_text(WATER_LAW)
    one, values = np.ones(1), np.array([row])
    rows = (LawRows(user_law(f"further.{name}", folder / "further.py"), values, one > 0.0, shear=K_s > 0.0),)
    return OneGap(GapLaw(4e6 * one, 0 * one, K_s * one, np.full((1, 2), mu), 0 * one, {}, laws=rows), 1e-6)


def test_water_that_follows_the_opening_of_the_step(tmp_path):
    """g = w + h c g: a free opening of 1 mm becomes 1.25 mm where h c = 0.2; and no shear is there at all."""
    gap = of_file(tmp_path, "Leak", [2e5], 0.0, 0.0)
    for w in (1e-3, 3e-3, -2e-3, 0.5e-3):
        gap.step(w)
        assert gap.jump[0, 0] == pytest.approx(w / 0.8 if w > 0.0 else w * 0.2, rel=1e-8)


@pytest.mark.parametrize("along_k", [0.2, 1.5])
def test_of_unequal_limits_each_follows_the_step(tmp_path, along_k):
    """T = p (0.3 + a s), s = u - T / k: T = p (0.3 + a u) / (1 + p a / k), whichever limit is the smaller."""
    gap, a = of_file(tmp_path, "Unequal", [along_k, 20.0], 1e6, 0.0), 20.0
    (_, t_j, _), state = gap.step(CLOSED, 6e-3, 0.0)
    assert t_j == pytest.approx(-4000.0 * (0.3 + a * 6e-3) / (1.0 + 4000.0 * a / SPRING), rel=1e-8)
    assert state == SLIP
