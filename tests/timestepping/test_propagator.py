"""The exact step against scipy's matrix exponential and against quadrature of the works."""

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.linalg import expm

from romdam.timestepping.modal.propagator import modal_propagator

MODES = {  # omega [rad/s], damping ratio or None for a coefficient c of its own
    "rigid": (0.0, 0.0),
    "rigid with dashpot": (0.0, ("c", 3.0)),
    "1 Hz undamped": (2 * np.pi, 0.0),
    "2 Hz, 5 %": (4 * np.pi, 0.05),
    "critical": (30.0, 1.0),
    "nearly critical": (30.0, 1.0 - 1e-9),
    "overdamped": (30.0, 40.0),
    "stiff, undamped": (2e5, 0.0),
    "stiff, 90 %": (2e5, 0.9),
    "stiff, overdamped": (2e5, 800.0),
    "slow": (1e-6, 0.05),
}
STEPS = (1e-4, 1e-3, 0.01, 0.05)


def _coefficients(name):
    omega, xi = MODES[name]
    return omega**2, xi[1] if isinstance(xi, tuple) else 2.0 * xi * omega


def _augmented(k, c):
    A = np.zeros((4, 4))
    A[0, 1] = A[1, 2] = A[2, 3] = 1.0
    A[1, :2] = -k, -c
    return A


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("name", MODES)
def test_step_is_the_matrix_exponential(name, dt):
    k, c = _coefficients(name)
    step = modal_propagator(np.array([k]), np.array([c]), dt)
    E = expm(_augmented(k, c) * dt)
    scale = max(np.sqrt(k), 1.0 / dt)  # of a velocity against a displacement
    found = np.array(
        [
            [step.q_q[0], step.q_v[0] * scale, step.q_p[0] * scale**2],
            [step.v_q[0] / scale, step.v_v[0], step.v_p[0] * scale],
        ]
    )
    wanted = np.array(
        [
            [E[0, 0], E[0, 1] * scale, E[0, 2] * scale**2],
            [E[1, 0] / scale, E[1, 1], E[1, 2] * scale],
        ]
    )
    turns = 1.0 + (np.sqrt(k) + c) * dt  # either way round-off grows with the norm
    assert np.abs(found - wanted).max() <= 1e-13 * turns * max(np.abs(wanted).max(), 1.0)
    # a load linear from f_0 to f_1 (columns 2 and 3), and p as a load that does not change
    ramp = np.array([step.q_0[0] - E[0, 2] + E[0, 3] / dt, step.q_1[0] - E[0, 3] / dt]) * scale**2
    assert np.abs(ramp).max() <= 1e-13 * turns
    assert step.q_0[0] + step.q_1[0] == pytest.approx(step.q_p[0], rel=1e-9)
    assert step.v_0[0] + step.v_1[0] == pytest.approx(step.v_p[0], rel=1e-9, abs=1e-13 * turns / scale)


def test_undamped_mode_in_closed_form():
    w, h = 7.0, 0.05
    step = modal_propagator(np.array([w**2]), np.zeros(1), h)
    assert step.q_q[0] == pytest.approx(np.cos(w * h), rel=1e-13)
    assert step.q_v[0] == pytest.approx(np.sin(w * h) / w, rel=1e-13)
    assert step.v_q[0] == pytest.approx(-w * np.sin(w * h), rel=1e-13)
    assert step.q_p[0] == pytest.approx((1 - np.cos(w * h)) / w**2, rel=1e-12)
    assert step.q_1[0] == pytest.approx((1 - np.sin(w * h) / (w * h)) / w**2, rel=1e-11)
    free = modal_propagator(np.zeros(1), np.zeros(1), h)
    values = [getattr(free, name)[0] for name in ("q_q", "q_v", "v_q", "v_v", "q_p", "v_p", "q_0", "q_1")]
    assert values == pytest.approx([1, h, 0, 1, h**2 / 2, h, h**2 / 3, h**2 / 6], rel=1e-14, abs=1e-16)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("name", MODES)
def test_a_held_force_leads_to_its_static_displacement_and_loses_what_it_must(name, dt):
    """Energy identity of one step: change of energy + damping loss = work of the forces."""
    k, c = _coefficients(name)
    step = modal_propagator(np.array([k]), np.array([c]), dt)
    rng = np.random.default_rng(0)
    scale = max(np.sqrt(k), 1.0 / dt)
    for _ in range(20):
        q, v = rng.standard_normal() / scale, rng.standard_normal()
        f_0, f_1, p = rng.standard_normal(3) * scale
        q_1 = step.q_q[0] * q + step.q_v[0] * v + step.q_0[0] * f_0 + step.q_1[0] * f_1 + step.q_p[0] * p
        v_1 = step.v_q[0] * q + step.v_v[0] * v + step.v_0[0] * f_0 + step.v_1[0] * f_1 + step.v_p[0] * p
        z = np.array([q, v, f_0 + p, (f_1 - f_0) / dt])
        work = (f_0 + p) * (q_1 - q) + z[3] * (step.moment[:, 0] @ z)
        loss = np.outer(z, z)[np.triu_indices(4)] @ step.loss[:, 0]
        change = 0.5 * (v_1**2 - v**2 + k * (q_1**2 - q**2))
        size = 0.5 * (v**2 + v_1**2 + k * (q**2 + q_1**2)) + abs(work) + loss
        assert abs(change + loss - work) <= 1e-12 * (1.0 + np.sqrt(k) * dt) * size
        assert loss >= -1e-14 * size


def test_damping_loss_is_the_integral_of_c_v2():
    k, c, dt = 400.0, 3.0, 0.05
    step = modal_propagator(np.array([k]), np.array([c]), dt)
    z = np.array([0.3, -1.0, 20.0, -500.0])
    t = np.linspace(0.0, dt, 401)
    path = np.array([expm(_augmented(k, c) * s) @ z for s in t])
    loss = np.outer(z, z)[np.triu_indices(4)] @ step.loss[:, 0]
    assert loss == pytest.approx(simpson(c * path[:, 1] ** 2, x=t), rel=1e-9)
    assert step.moment[:, 0] @ z == pytest.approx(simpson(t * path[:, 1], x=t), rel=1e-9)


def test_many_small_steps_are_one_large_step():
    k, c = np.array([0.0, 50.0, 1e6, 1e4]), np.array([0.5, 0.1, 100.0, 900.0])
    whole, part = modal_propagator(k, c, 0.05), modal_propagator(k, c, 0.05 / 64)
    q, v = np.ones(4), np.zeros(4)
    for _ in range(64):
        q, v = part.q_q * q + part.q_v * v + part.q_p, part.v_q * q + part.v_v * v + part.v_p
    assert np.abs(q - whole.q_q - whole.q_p).max() <= 1e-11
    assert np.abs(v - whole.v_q - whole.v_p).max() <= 1e-11 * np.sqrt(k.max())


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("tau", [1e-6, 1e-3, 0.05, 10.0])
def test_without_mass_a_force_is_followed_exponentially(tau, dt):
    """c q' + k q = f + p, f from f_0 to f_1: q and v in closed form, works by the energy of the spring."""
    k, c, rng = 3e4, 3e4 * tau, np.random.default_rng(1)
    step = modal_propagator(np.array([k]), np.array([c]), dt, np.array([True]))
    for _ in range(10):
        q, f_0, f_1, p = rng.standard_normal(4)
        rate = (f_1 - f_0) / dt
        left = q - (f_0 + p - rate * tau) / k
        q_1 = left * np.exp(-dt / tau) + (f_1 + p - rate * tau) / k
        v_1 = -left / tau * np.exp(-dt / tau) + rate / k
        assert step.q_v[0] == step.v_v[0] == 0.0
        got = step.q_q[0] * q + step.q_0[0] * f_0 + step.q_1[0] * f_1 + step.q_p[0] * p
        fast = step.v_q[0] * q + step.v_0[0] * f_0 + step.v_1[0] * f_1 + step.v_p[0] * p
        assert got == pytest.approx(q_1, rel=1e-10, abs=1e-10 * (abs(q) + 1.0 / k))
        assert fast == pytest.approx(v_1, rel=1e-9, abs=1e-10 * (abs(left) / tau + abs(rate) / k))
        z = np.array([q, 0.0, f_0 + p, rate])
        work = z[2] * (q_1 - q) + rate * (step.moment[:, 0] @ z)
        loss = np.outer(z, z)[np.triu_indices(4)] @ step.loss[:, 0]
        stored = 0.5 * k * (q_1**2 - q**2)
        assert loss >= 0.0
        assert stored + loss == pytest.approx(work, rel=1e-9, abs=1e-9 * (0.5 * k * q**2 + loss))


def test_no_modes():
    step = modal_propagator(np.zeros(0), np.zeros(0), 0.01)
    assert step.q_q.shape == (0,) and step.loss.shape == (10, 0)
