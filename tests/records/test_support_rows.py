"""Motions of supports against the base, held against piecewise polynomials of scipy's."""

import numpy as np
import pytest
from scipy.interpolate import PPoly

from romdam.core.errors import RecordError
from romdam.core.motion import GroundMotion, SupportMotion
from romdam.records.processing.support_motions import (
    StraightLines,
    add_support_rows,
    begun,
    late_warnings,
    lines_of,
    refuse_drift,
)

DELAYS = (1e-4, 7e-4, 0.0013, 0.0029, 0.005, 0.0071, 0.01, 0.0137, 0.02, 0.0333, 0.051, 0.1, 0.217, 0.5, 1.37)


def record(seed, dt=None):
    """Noise that begins with an acceleration and ends at rest, three components [m/s2]."""
    random = np.random.default_rng(seed)
    dt = dt or random.choice([0.0025, 0.005, 0.01, 0.02])
    time = np.arange(round(random.uniform(8.0, 20.0) / dt)) * dt
    envelope = (0.3 + time / 2.0) * np.exp(-time / 3.0) * np.clip((time[-1] - time) / 2.0, 0.0, 1.0)
    acc = envelope * random.standard_normal((3, len(time))) * random.uniform(0.5, 5.0)
    # what it ends with is taken out by two functions that are zero at its end
    x = time / time[-1]
    shapes = np.array([(1.0 - x) ** 2, x * (1.0 - x) ** 2])
    ends = np.array([[whole[-1] for whole in integrals(row, dt, time)] for row in shapes])
    left = np.array([[whole[-1] for whole in integrals(row, dt, time)] for row in acc])
    return acc - np.linalg.solve(ends.T, left.T).T @ shapes, dt


def integrals(row, dt, time):
    """Velocity and displacement at some times, at rest before the record."""
    lines = PPoly(np.array([np.diff(row) / dt, row[:-1]]), np.arange(len(row)) * dt)
    found = []
    for order in (1, 2):
        whole = lines.antiderivative(order)
        inside = np.clip(time, 0.0, whole.x[-1])
        values = whole(inside)
        if order == 2:
            values = values + lines.antiderivative(1)(whole.x[-1]) * np.maximum(time - whole.x[-1], 0.0)
        found.append(np.where(time > 0.0, values, 0.0))
    return found


@pytest.mark.parametrize("seed", range(15))
def test_late_supports_have_the_displacement_of_the_record_and_come_back(seed):
    """u(t - tau) - u(t) and its rates at steps that hold the samples, and at steps that pass them by."""
    acc, dt = record(seed)
    motion = GroundMotion("noise", acc, dt)
    for number, delay in enumerate(DELAYS):
        step = dt / (1, 2, 8, 9.37)[number % 4]
        count = round((motion.duration + delay) / step) + 3
        time = np.arange(count) * step
        base = lines_of(motion, step)
        at_steps = base.at(time, begun(time, 0.0))[0]
        ground = add_support_rows(at_steps, step, [SupportMotion(0, delay, 1.3)], base)
        _, vel, disp = np.split(ground[3:], 3)
        for k in range(3):
            now, then = (integrals(acc[k], dt, t) for t in (time, time - delay))
            for rows, late, base_row in zip((vel, disp), then, now, strict=True):
                exact = 1.3 * late - base_row
                assert np.abs(rows[k] - exact).max() < 1e-9 * np.abs(exact).max()
            unit = add_support_rows(at_steps, step, [SupportMotion(0, delay)], base)[9 + k]
            assert np.abs(unit[-1]) < 1e-6 * np.abs(unit).max()
            exact = then[1] - now[1]
            assert np.abs(unit).max() == pytest.approx(np.abs(exact).max(), rel=1e-3)


@pytest.mark.parametrize("delay", [0.0, 0.001, 0.004, 0.01, 0.0137, 0.0251])
def test_steps_keep_the_impulse_of_a_late_jump(delay):
    """Straight lines between steps have the integral and the first moment of a jump after it."""
    step = 0.01
    time = np.arange(8) * step
    vel, disp = integrals(begun(time, delay), step, time)
    assert vel[-1] == pytest.approx(time[-1] - delay, rel=1e-12)
    # a hat has the second moment step^2 / 6, which is all that a jump's second integral changes by
    assert disp[-1] == pytest.approx(0.5 * (time[-1] - delay) ** 2, abs=1.001 * step**2 / 6.0)


def test_acceleration_is_that_of_the_late_lines():
    acc, dt = record(3, 0.01)
    delay = 0.0237
    time = np.arange(acc.shape[1] + 10) * dt
    padded = np.pad(acc, ((0, 0), (0, 10)))
    ground = add_support_rows(padded, dt, [SupportMotion(0, delay, (2.0, 1.0, 0.5))], StraightLines(acc, dt))
    late = np.stack([np.interp(time - delay, np.arange(acc.shape[1]) * dt, row, left=0.0) for row in acc])
    exact = np.array([[2.0], [1.0], [0.5]]) * late - padded
    after = time > delay + dt
    before = time < delay - dt
    for rows in (after & (time < acc.shape[1] * dt), before):
        np.testing.assert_allclose(ground[3:6, rows], exact[:, rows], atol=1e-9)


def drifting(share, dt=0.01):
    """A record that ends with a share of its peak velocity."""
    acc, _ = record(5, dt)
    peak = np.abs(StraightLines(acc, dt).vel).max(axis=1, keepdims=True)
    time = np.arange(acc.shape[1]) * dt
    return GroundMotion("drifts", acc + share * peak / time[-1], dt)


def test_what_does_not_end_at_rest_is_refused():
    assert refuse_drift(drifting(0.0), [SupportMotion(1, 0.1, 1.4)], "job") is None
    assert refuse_drift(drifting(0.05), [SupportMotion(1, 0.1)], "job") is None  # both drift alike
    with pytest.raises(RecordError, match=r"supports\[1\] ends with a velocity .* of its peak, limit 1%"):
        refuse_drift(drifting(0.1), [SupportMotion(1, 0.01, 1.4)], "job")
    with pytest.raises(RecordError, match=r"0\.1 s behind the base and ends .* limit 10%: .*a velocity"):
        refuse_drift(drifting(0.25), [SupportMotion(1, 0.1)], "job")
    own = SupportMotion(0, record=drifting(0.05))
    with pytest.raises(RecordError, match="ends with a velocity"):
        refuse_drift(drifting(0.0), [own], "job")


def test_a_distance_that_stays_is_told():
    motion = drifting(0.05)
    (said,) = late_warnings([SupportMotion(1, 0.1)], motion, motion.duration + 1.0)
    assert "supports[1] ends" in said and "of its largest distance" in said
    assert late_warnings([SupportMotion(1, 0.1)], drifting(0.0), motion.duration + 1.0) == []
