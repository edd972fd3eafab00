"""A stiff block on shaken massless rock against Newmark's rigid one, from event to event: K_n and rigid."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rigid_block import rigid_slip
from small_scenes import march, reduced
from test_massless import DAMPING, MU, G, block_on_rock, pulse

from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats
from romdam.core.system import System
from romdam.timestepping.energy import imbalance

DT, END = 0.001, 4.5
RECORDS = Path(__file__).parents[2] / "data" / "records"
SPRINGS = {"K_n": {}, "rigid": {"normal_stiffness": "rigid"}}
DAMPINGS = {
    "Rayleigh, 3 and 20 Hz": {"rayleigh": {"frequencies": [3.0, 20.0], "ratio": 0.05}},
    "Rayleigh, 20 and 200 Hz": {"rayleigh": {"frequencies": [20.0, 200.0], "ratio": 0.05}},
    "mass term alone": {"rayleigh": {"alpha": 11.4, "beta": 0.0}},
    "modal": {"modal": 0.05},
}
LEVEL, SLOPE = 0.0, np.radians(10.0)


def shaken_by(record: str, factor: float, end: float = 15.0) -> Floats:
    """A record of the project, linear between its samples [m/s2]."""
    acc = 9.81 * factor * np.loadtxt(RECORDS / f"northridge_{record}_g_dt0.01.txt").ravel()
    return np.interp(np.arange(round(end / DT) + 1) * DT, 0.01 * np.arange(len(acc)), acc)


def half_sine(size: float) -> Floats:
    t = np.arange(round(3.0 / DT) + 1) * DT
    return np.where((t > 0.1) & (t < 0.6), size * np.sin(2.0 * np.pi * (t - 0.1)), 0.0)


def several() -> Floats:
    """Pulses up, down and up the slope, the next before and after the block has come to rest."""
    return sum(
        np.roll(pulse(DT, size, length, END), round(start / DT))
        for start, size, length in ((0.0, 7.0, 0.3), (1.2, -9.0, 0.2), (2.4, 5.0, 0.4))
    )


MOTIONS = {
    "rectangle, slides down": lambda: pulse(DT, 6.0),
    "rectangle, slides up": lambda: pulse(DT, -12.0),
    "half sine, slides down": lambda: half_sine(6.0),
    "half sine, slides up": lambda: half_sine(-12.0),
    "several": several,
    "record": lambda: shaken_by("mul009", 1.5),
    "record, other way": lambda: shaken_by("mul279", -1.5),
}


@cache
def block(slope: float, springs: str, **joint: float) -> System:
    return reduced(block_on_rock(slope, **SPRINGS[springs], **joint), DAMPING, modes=4).system


def slip_of(system: System, slope: float, along: Floats) -> tuple[Floats, float]:
    """Mean slip up the slope since the start [m], and how open the energy ledger is."""
    ground = np.outer([np.cos(slope), 0.0, np.sin(slope)], along)
    h = march(system, DT, ground, initial_state="static", integrator="adaptive")
    slip = h.jump[:, :, 1:].mean(axis=1) - h.jump[0, :, 1:].mean(axis=0)
    assert np.abs(slip[:, 0]).max() <= 1e-9 * np.abs(slip).max()
    return slip[:, 1], imbalance(h.energy)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("springs", SPRINGS)
@pytest.mark.parametrize("slope", [LEVEL, SLOPE], ids=["level", "10 degrees"])
def test_a_block_slides_as_newmark_has_it(slope, springs, motion):
    """Within 0.22 % where the acceleration jumps, else 0.09 %; histories too, of their largest."""
    along = MOTIONS[motion]()
    exact = rigid_slip(along, DT, G * np.sin(slope), MU * G * np.cos(slope))
    slip, imbalanced = slip_of(block(slope, springs), slope, along)
    assert slip[-1] == pytest.approx(exact[-1], rel=0.0025)
    assert np.abs(slip - exact).max() <= 0.0025 * np.abs(exact).max()
    assert imbalanced <= 1e-9


@pytest.mark.parametrize("damping", DAMPINGS)
def test_no_damping_brakes_a_slide(damping):
    """A rectangular pulse A of t_0 leaves V^2 / 2 (1 / N - 1 / A), V = A t_0, N = mu g (Newmark 1965).

    alpha of 5 % at 3 and 20 Hz, and at 20 and 200 Hz, would leave 0.72 and 0.30 of that.
    """
    A, t_0, N = 6.0, 0.4, MU * G
    system = reduced(block_on_rock(LEVEL), DampingConfig(**DAMPINGS[damping]), modes=4).system
    slip, _ = slip_of(system, LEVEL, pulse(DT, -A))
    assert slip[-1] == pytest.approx(0.5 * (A * t_0) ** 2 * (1.0 / N - 1.0 / A), rel=0.01)


def test_the_exact_integration_is_newmark_s_formula():
    """A rectangular pulse A for t_0: V^2 / 2 (1 / N - 1 / A) with V = A t_0, N = mu g (Newmark 1965)."""
    dt, A, t_0 = 1e-5, 6.0, 0.4
    along = np.where(np.arange(150_000) < round(t_0 / dt), -A, 0.0)
    N, V = MU * G, A * t_0
    assert rigid_slip(along, dt, 0.0, N)[-1] == pytest.approx(0.5 * V**2 * (1.0 / N - 1.0 / A), rel=1e-4)


def test_what_is_left_is_the_velocity_gained_while_the_shear_spring_loads():
    """The jump A loads the spring, omega^2 = K_s / m, along A (1 - cos); Newmark's block slides at once.

    At the limit N, 1 - cos = N / A, its velocity is A sin / omega in place of (A - N) times the time taken;
    that excess is carried for as long as the block slides. A soft spring, for over a step the jump is a ramp.
    """
    A, N, t_0, K_s = 6.0, MU * G, 0.4, 1e9
    omega = np.sqrt(K_s / 2400.0)
    phase = np.arccos(1.0 - N / A)
    excess = (A * np.sin(phase) - (A - N) * phase) / omega
    slides = t_0 * A / N
    along = pulse(DT, A)
    slip, _ = slip_of(block(LEVEL, "K_n", shear_stiffness=K_s), LEVEL, along)
    exact = rigid_slip(along, DT, 0.0, N)[-1]
    assert exact - slip[-1] == pytest.approx(excess * slides, rel=0.15)
