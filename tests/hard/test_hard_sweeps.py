"""Stiffness, friction, step and initial gap far outside what dams have, on two coarse cantilevers.

Every run has to end with a closed ledger, no energy made, |t| <= mu p_n, p_n = K_n times the penetration and
finite numbers. What cannot be run is refused before it starts.
"""

import dataclasses
from functools import cache

import numpy as np
import pytest
from hand_systems import gap_law, ground, modal_twin, run, sparse_system, still
from simulating import simulated
from soundness import assert_sound, soundness
from test_hard_configs import FOLDER

import romdam
from romdam.core.errors import ConfigError
from romdam.core.integrators import INTEGRATORS
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

BLOCK = 3e9  # stiffness of a block per area of the joint, E / depth [N/m3]
MODAL = [name for name in INTEGRATORS if name not in ("generalized_alpha", "conserving")]
SIZES = (1e-3, 1.0, 1e3, 1e6)


@cache
def _cantilevers(rough, damped=True):
    """The system of configs/hard/friction_2.yaml, with or without tangential directions and damping."""
    job = romdam.load_config(FOLDER / ("friction_2.yaml" if rough else "normal_stiffness_1e6.yaml"))
    scene = build_scene(job.config, job.folder, str(job.path))
    damping = job.config.damping if damped else type(job.config.damping)()
    areas = scene.joints["contraction"].K_s if rough else scene.joints["contraction"].K_n
    return reduce_scene(scene, job.config.model, damping).system, areas / (8e9 if rough else 3e15)


def _system(K_n=5.0, K_s=2.5, mu=0.0, gap=0.0, damped=True):
    """The cantilevers with K_n and K_s in multiples of the block's stiffness."""
    system, area = _cantilevers(bool(np.max(mu) > 0.0), damped)
    coefficients = np.broadcast_to(np.asarray(mu, dtype=float), (len(area), 2)).copy()
    law = dataclasses.replace(
        system.law,
        K_n=K_n * BLOCK * area,
        K_s=K_s * BLOCK * area,
        mu=coefficients,
        gap=np.full(len(area), gap),
    )
    return dataclasses.replace(system, law=law)


def _shake(system, dt=0.0025, seconds=1.5, g=1.0, **options):
    """A pulse of two half sines at 2 Hz along y, two thirds of it along x."""
    t = np.arange(round(seconds / dt) + 1) * dt
    acc = 9.81 * g * np.sin(4.0 * np.pi * t) * (t < 0.5)
    options = {"initial_state": "undeformed", "integrator": "adaptive", "cuts": (4,)} | options
    return simulated(system, np.stack([acc / 1.5, acc, 0 * acc]), dt, **options)


@pytest.mark.parametrize("mu", [0.0, 0.3, 1.0, 2.0])
@pytest.mark.parametrize("K_n", [*SIZES, np.inf])
def test_normal_stiffness_and_friction(K_n, mu):
    system = _system(K_n=K_n, K_s=2.5 if np.isinf(K_n) else 0.5 * K_n, mu=mu)
    h = _shake(system)
    assert_sound(system.law, h)
    assert h.peaks["opening"].max() > 0.05
    assert h.peaks["compression"].max() > 1e6


@pytest.mark.parametrize("mu", [0.3, 2.0, (0.3, 1.0)], ids=str)
@pytest.mark.parametrize("K_n", [5.0, np.inf], ids=["penalty", "rigid"])
@pytest.mark.parametrize("K_s", SIZES)
def test_shear_stiffness(K_s, K_n, mu):
    system = _system(K_n=K_n, K_s=K_s, mu=mu)
    found = assert_sound(system.law, _shake(system))
    if K_s >= 1.0:  # a softer spring hardly reaches the limit
        assert found["friction_share"] > 1e-4


@pytest.mark.parametrize("integrator", MODAL)
@pytest.mark.parametrize("mu", [0.0, 1.0])
@pytest.mark.parametrize("dt", [1e-4, 1e-3, 0.01, 0.05])
def test_steps_from_a_tenth_to_fifty_milliseconds(dt, mu, integrator):
    system = _system(mu=mu)
    h = _shake(system, dt, integrator=integrator)
    assert_sound(system.law, h)
    if dt <= 1e-3:
        fine = _shake(system, 2.5e-4, integrator="modal")
        assert h.peaks["opening"].max() == pytest.approx(fine.peaks["opening"].max(), rel=0.02)


@pytest.mark.parametrize("g", [1e-6, 10.0, 100.0])
@pytest.mark.parametrize("mu", [0.0, 0.6])
def test_from_a_tremor_to_a_hundred_g(g, mu):
    system = _system(K_n=np.inf, mu=mu)
    assert_sound(system.law, _shake(system, g=g))


@pytest.mark.parametrize("initial_state", ["static", "undeformed"])
@pytest.mark.parametrize("mu", [0.0, 0.6])
@pytest.mark.parametrize("K_n", [5.0, np.inf], ids=["penalty", "rigid"])
@pytest.mark.parametrize("gap", [0.05, 1e-3, -1e-3, -0.02])
def test_initial_gap_and_penetration(gap, K_n, mu, initial_state):
    if gap < 0.0 and np.isinf(K_n) and initial_state == "undeformed":
        pytest.skip("test_a_rigid_joint_cannot_start_pressed_in")
    system = _system(K_n=K_n, mu=mu, gap=gap)
    assert_sound(system.law, _shake(system, initial_state=initial_state))


@pytest.mark.parametrize("mu", [0.0, 0.6])
def test_a_rigid_joint_cannot_start_pressed_in(mu):
    """An undeformed start with a rigid joint 1 mm deep holds no finite energy: no answer exists."""
    with pytest.raises(ConfigError, match=r"pressed in, got an initial gap of -0\.001 m at gap 0"):
        _shake(_system(K_n=np.inf, mu=mu, gap=-1e-3), seconds=0.1)


@pytest.mark.parametrize("K_n", [*SIZES, np.inf])
@pytest.mark.parametrize("dt", [0.005, 0.00125])
def test_without_damping_or_friction_energy_stays(K_n, dt):
    """What contact takes or gives stays below 1e-6 of what the pulse and the pressure put in."""
    system = _system(K_n=K_n, damped=False)
    h = _shake(system, dt, integrator="conserving", seconds=3.0)
    assert_sound(system.law, h)
    assert np.ptp(h.energy["contact"]) <= 1e-6 * np.abs(h.energy["input"]).max()
    assert (np.diff((h.state > 0).any(axis=1).astype(int)) != 0).sum() >= 2


@pytest.mark.parametrize("mu", [0.3, 1.0, (0.3, 1.0)], ids=str)
@pytest.mark.parametrize("dt", [0.005, 0.000625])
def test_without_damping_only_sliding_takes_energy(mu, dt):
    """Impacts and sticking take nothing, sliding never gives: to round-off, in every step."""
    system = _system(mu=mu, damped=False)
    h = _shake(system, dt, integrator="conserving")
    found = soundness(system.law, h)
    size = np.abs(h.energy["input"]).max()
    assert found["finite"] and abs(found["ledger_residual"]) <= 1e-9
    assert np.abs(h.energy["contact"]).max() <= 1e-9 * size
    assert np.diff(h.energy["friction"]).min() >= -1e-9 * size
    assert h.energy["friction"][-1] > 0.01 * size


def _ball(**law):
    """A mass of 100 kg under gravity, 50 mm above a table, with a lightly damped spring inside."""
    m, k = 50.0, 1e7
    return modal_twin(
        sparse_system(
            np.diag([m, m]),
            k * np.array([[1.0, -1.0], [-1.0, 1.0]]),
            [[1.0, 0.0]],
            gap_law(1, gap=0.05, **law),
            C=2e-5 * k * np.array([[1.0, -1.0], [-1.0, 1.0]]),
            force=[-9.81 * m, -9.81 * m],
            load=[m, m],
            floating=True,
        )
    )


@pytest.mark.parametrize("integrator", MODAL)
@pytest.mark.parametrize("K_n", [1e6, 1e12, np.inf])
@pytest.mark.parametrize("dt", [1e-4, 0.01])
def test_one_gap_chatters_to_rest(K_n, dt, integrator):
    """A dropped body hops ever lower and ends on the table, carrying its weight."""
    law = {"K_n": K_n}
    h = run(_ball(**law), still(20.0, dt), dt, integrator=integrator, stride=round(0.05 / dt))
    found = assert_sound(gap_law(1, gap=0.05, **law), h)
    assert found["contact_increment"] >= -1e-12
    assert h.mean_traction[-100:, 0, 0].mean() == pytest.approx(100.0 * 9.81, rel=0.05)  # of many hops
    assert h.disp[:, 0].max() <= 1e-9
    held = h.energy["kinetic"] + h.energy["strain"] + h.energy["joint_stored"] - h.energy["input"]
    assert held.max() <= 1e-9 * 50.0


def test_one_rigid_mass_cannot_conserve_and_says_so():
    """A lone mass on a rigid gap has no flexibility to store its energy in: refused, with the remedy."""
    system = modal_twin(
        sparse_system([[1.0]], [[0.0]], [[1.0]], gap_law(1, gap=0.1), force=[-9.81], floating=True)
    )
    with pytest.raises(ConfigError, match="finite normal_stiffness, or damping"):
        run(system, still(1.0, 0.01), 0.01, integrator="conserving")


def test_a_spring_under_a_mass_conserves():
    """The same mass on a gap of finite stiffness hops for ever to the same height."""
    law = gap_law(1, K_n=1e5, gap=0.1)
    system = modal_twin(sparse_system([[1.0]], [[0.0]], [[1.0]], law, force=[-9.81], floating=True))
    h = run(system, still(10.0, 1e-3), 1e-3, integrator="conserving")
    assert_sound(law, h)
    tops = h.disp[1:-1, 0][(h.disp[1:-1, 0] > h.disp[:-2, 0]) & (h.disp[1:-1, 0] >= h.disp[2:, 0])]
    assert len(tops) > 20
    assert np.abs(tops).max() <= 1e-3 * 0.1


@pytest.mark.parametrize("integrator", [name for name in INTEGRATORS if name != "generalized_alpha"])
@pytest.mark.parametrize("samples", [1, 2])
def test_one_and_two_samples(samples, integrator):
    """Too short a ground motion for the loop: nothing happens, or one step does."""
    system = _system(damped=integrator != "conserving")
    h = simulated(system, ground(np.ones(samples)), 0.0025, integrator=integrator)
    assert len(h.time) == samples
    assert np.isfinite(h.disp).all()


@pytest.mark.parametrize("K_n", [5.0, np.inf], ids=["penalty", "rigid"])
@pytest.mark.parametrize("dt", [0.0025, 0.000625])
def test_grazing_contact(K_n, dt):
    """A gap that free blocks would just close, by 1e-3 to 1e-9 of their motion."""
    free = _shake(_system(gap=1.0), dt)
    reach = 1.0 - free.jump[..., 0].min()
    for share in (1e-3, 1e-6, 1e-9):
        system = _system(K_n=K_n, gap=reach * (1.0 - share))
        h = _shake(system, dt)
        assert_sound(system.law, h)
        assert h.peaks["compression"].max() > 0.0
        assert (h.state > 0).any(axis=1).sum() <= 0.05 / dt


def _floating(blocks, K_n, modes=12):
    """Bodies of 1 kg on a gap each, with stiff modes above 4 kHz that their gaps see too."""
    n = blocks * (1 + modes)
    K, B = np.zeros(n), np.zeros((blocks, n))
    for b in range(blocks):
        K[blocks + b * modes : blocks + (b + 1) * modes] = (2.0 * np.pi * 4e3 * np.arange(1, modes + 1)) ** 2
        B[b, b] = B[b, blocks + b * modes : blocks + (b + 1) * modes] = 1.0
    law = gap_law(blocks, K_n=K_n, gap=0.01)
    force = np.where(np.arange(n) < blocks, -9.81, 0.0)
    return modal_twin(sparse_system(np.eye(n), np.diag(K), B, law, force=force, floating=True))


@pytest.mark.parametrize("blocks", [1, 3, 20])
def test_bodies_on_gaps_softer_than_they_are_conserve(blocks):
    """Each hops for ever to the height it fell from, however many there are and few the modes."""
    system = _floating(blocks, 1e5, modes=1 if blocks == 20 else 12)
    h = run(system, still(2.0, 1e-3), 1e-3, integrator="conserving")
    assert np.ptp(h.energy["contact"]) <= 1e-6 * np.abs(h.energy["input"]).max()
    tops = h.disp[1:-1, :blocks][
        (h.disp[1:-1, :blocks] > h.disp[:-2, :blocks]) & (h.disp[1:-1, :blocks] >= h.disp[2:, :blocks])
    ]
    assert len(tops) >= 4 * blocks and np.abs(tops).max() <= 1e-3 * 0.01


def test_a_step_too_long_to_conserve_is_told_with_one_that_is_not():
    """1 kg on 1e5 N/m swings with 316 rad/s: 12.65 ms are 4 rad."""
    system = _floating(1, 1e5)
    with pytest.raises(
        ConfigError, match=r"finest_step: 0\.05 s is too long .* 316\.2 rad/s .* take 0\.0125 s"
    ):
        run(system, still(1.0, 0.05), 0.05, integrator="conserving")
    run(system, still(1.0, 0.0125), 0.0125, integrator="conserving")
