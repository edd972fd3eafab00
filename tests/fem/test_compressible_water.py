"""Compressible water: closed forms on a rigid wall, the ledger, the reduction, two published dams."""

from pathlib import Path

import numpy as np
import pytest
from gravity_sections import FOOT, KOYNA, PINE_FLAT, section_scene
from hand_systems import gap_law, sparse_system
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu
from simulating import simulated
from test_water import SERIES, job, rigid_mass, section_system, wall

from romdam.benchmarks.frequency_response import channel_inputs, first_period, inputs
from romdam.config import parse_config
from romdam.core.errors import ConfigError
from romdam.core.motion import Motion
from romdam.core.scene import Reservoir
from romdam.core.system import Histories
from romdam.effects.channel import ChannelDrive, impedance_network
from romdam.effects.compressible_water import Waves, _behind, reduced_waves, reservoir_waves
from romdam.effects.full_order import assemble_full
from romdam.fem.stress import observing_stress
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

H, C, RHO, WIDTH = 40.0, 1440.0, 1000.0, 4.0
FIRST = np.pi * C / (2.0 * H)  # rad/s, first frequency of the reservoir
BELOW = (0.05, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95)
ABOVE = (1.05, 1.1, 1.2, 1.5, 2.0, 2.5, 2.9)


def force(scene, waves, omega, axis=1):
    """Force along y on a rigid wall, (frequencies,) complex, of unit ground acceleration."""
    rigid = {name: np.tile(np.eye(3), (len(b.points), 1)) for name, b in scene.blocks.items()}
    swept = sum(waves.coupling[name] @ rigid[name] for name in rigid)[:, 1]
    found = []
    for o in omega:
        A = csc_matrix(waves.K - o**2 * waves.M + 1j * o * waves.C)
        x = splu(A).solve(waves.load @ channel_inputs(waves.drive, o, axis))
        found.append(1j * o * swept @ (waves.at_dam.T @ x))
    return np.array(found)


def closed_form(omega, reflection=1.0, modes=300):
    """Force on a rigid wall, 2-D, by modes sin(mu (H - z)) of the channel, -mu cos mu H = i q w sin mu H.

    Westergaard, Trans. ASCE 98 (1933) 418 and, above the first frequency, Chopra, J. Eng. Mech. Div. ASCE 93
    (1967) 205, where q = 0; Fenves, Chopra, UCB/EERC-84/10 (1984) for an absorptive bottom.
    """
    found = []
    for o in omega:
        q = (1.0 - reflection) / (1.0 + reflection) / C
        mu = (np.arange(1, modes + 1) - 0.5) * np.pi / H + 0j
        for _ in range(40):  # Newton
            s, c = np.sin(mu * H), np.cos(mu * H)
            mu = mu - (mu * c + 1j * o * q * s) / (c - mu * H * s + 1j * o * q * H * c)
        total, size = (1 - np.cos(mu * H)) / mu, H / 2 - np.sin(2 * mu * H) / (4 * mu)
        kappa = np.sqrt(mu**2 - o**2 / C**2)
        upstream = (kappa.real < -1e-12) | ((np.abs(kappa.real) <= 1e-12) & (kappa.imag < 0))
        found.append((total**2 / (size * np.where(upstream, -kappa, kappa))).sum())
    return RHO * WIDTH * np.array(found)


def rigid_wall(**keys):
    scene, _ = wall("compressible", **keys)
    return scene, reservoir_waves(scene)


def test_rigid_wall_below_and_above_the_first_frequency_is_westergaards_and_chopras():
    """Complex force within 1.4 % from 0.05 to 2.9 times the first frequency, 5 % on either side of it too."""
    omega = FIRST * np.array(BELOW + ABOVE)
    error = np.abs(force(*rigid_wall(), omega) / closed_form(omega) - 1)
    assert error[: len(BELOW)].max() < 0.005
    assert error.max() < 0.014


def test_westergaards_force_at_low_frequency():
    """The static limit is the series of incompressible water, 0.543 rho a H^2, in phase."""
    low = force(*rigid_wall(), [0.01 * FIRST])[0] / (RHO * WIDTH * H**2)
    assert low == pytest.approx(SERIES, rel=0.005) and abs(low.imag) < 1e-4


@pytest.mark.parametrize("length", [20.0, 40.0, 80.0])
def test_far_end_may_be_near(length):
    """Half a depth from the dam the channel goes on as well as three depths from it, within 2 %."""
    omega = FIRST * np.array([0.3, 0.7, 0.9, 0.95, 1.05, 1.1, 1.2, 1.5, 2.0])
    found = force(*rigid_wall(length=length), omega)
    assert np.abs(found / closed_form(omega) - 1).max() < 0.02


@pytest.mark.parametrize("reflection", [0.9, 0.75, 0.5, 0.0])
def test_bottom_absorption_is_that_of_fenves_and_chopra(reflection):
    """Within 1.7 %, at the first frequency itself too, where absorption makes the response finite."""
    omega = FIRST * np.array([*BELOW, 1.0, *ABOVE])
    found = force(*rigid_wall(bottom_reflection=reflection), omega)
    assert np.abs(found / closed_form(omega, reflection) - 1).max() < 0.017


@pytest.mark.parametrize("reflection", [1.0, 0.75, 0.5])
def test_vertical_motion_is_that_of_a_column(reflection):
    """p(z) = rho a sin(k (H - z)) / (k cos k H + i w q sin k H) all along the channel: within 1.4 %."""
    omega = FIRST * np.array([0.05, 0.5, 0.9, 0.95, 1.05, 1.1, 1.5, 2.0, 2.5])
    k, q = omega / C, (1.0 - reflection) / (1.0 + reflection) / C
    amplitude = RHO / (k * np.cos(k * H) + 1j * omega * q * np.sin(k * H))
    exact = -WIDTH * amplitude * (1 - np.cos(k * H)) / k  # the wet face's normal is -y
    found = force(*rigid_wall(bottom_reflection=reflection), omega, axis=2)
    assert np.abs(found / exact - 1).max() < 0.014


def test_network_has_the_impedance_of_a_channel_without_end():
    """Z(s) = sqrt(1 + s^2) within 0.7 %, but for 1 % beside the cut-off; passive; exact statically."""
    M, D, K = impedance_network()
    omega = np.concatenate([np.linspace(0.01, 0.99, 500), np.geomspace(1.01, 100.0, 2000)])
    for o in omega:
        S = K - o**2 * M + 1j * o * D
        found = S[0, 0] - S[0, 1:] @ np.linalg.solve(S[1:, 1:], S[1:, 0])
        exact = np.sqrt(1 - o**2) if o < 1 else 1j * np.sqrt(o**2 - 1)
        assert abs(found / exact - 1) < 0.007
    assert np.linalg.eigvalsh(K).min() > 0 and np.linalg.eigvalsh(D).min() > -1e-12
    assert 1 / np.linalg.inv(K)[0, 0] == pytest.approx(1.0, abs=1e-12)


def test_waves_of_a_section_are_exact_for_linear_acceleration():
    """An oscillator under constant acceleration from rest: v_g = t, y = (t - sin(w t)/w) drive/w^2."""
    w, dt = 7.0, 0.05
    drive = ChannelDrive(np.zeros((1, 1)), np.array([w**2]), np.array([[0.0, 3.0, 0.0]]))
    ground = np.zeros((3, 41))
    ground[1] = 1.0
    t = dt * np.arange(41)
    rows = drive.drive(Histories({Motion.BASE: ground}), dt, lambda angle: (angle, angle)).rows
    np.testing.assert_allclose(rows[Motion.BASE_VELOCITY][1], t, atol=1e-13)
    np.testing.assert_allclose(rows[Motion.CHANNEL][0], 3.0 * (t - np.sin(w * t) / w) / w**2, atol=1e-13)
    np.testing.assert_allclose(rows[Motion.CHANNEL_RATE][0], 3.0 * (1 - np.cos(w * t)) / w**2, atol=1e-13)


def test_fast_sound_is_incompressible_water():
    """At 5000 m/s no wave is below the cut-off: a static answer that is the added mass, to round-off."""
    scene, _ = wall("compressible", sound_speed=5e3, cutoff=10.0)
    reduced = reduced_waves(reservoir_waves(scene), 10.0)
    rigid = {name: np.tile(np.eye(3), (len(b.points), 1)) for name, b in scene.blocks.items()}
    waves = reduced.waves
    B = sum(waves.coupling[name] @ rigid[name] for name in rigid)
    statically = waves.at_dam.T @ (waves.at_dam / waves.K.diagonal()[:, None])
    mass = B.T @ (reduced.rest + statically) @ B / (RHO * WIDTH * H**2)
    assert mass[1, 1] == pytest.approx(rigid_mass(wall("incompressible")[0])[0][1, 1], rel=1e-9)


def blocks(names=("a", "b"), **water):
    """Blocks side by side in heavy, slow water, whose waves are as quick as the dam."""
    faces = [{"block": name, "face": "ymin"} for name in names]
    boxes = {name: ([2.0 * k, 0, 0], [2, 2, 8], 2.0) for k, name in enumerate(names)}
    slow = {"sound_speed": 300.0, "bottom_reflection": 0.7, "cutoff": 60.0, "density": 3000.0}
    keys = {"level": 8.0, "faces": faces, "model": "compressible"} | slow | water
    return job(keys, boxes, outputs={"nodes": {"top": {"block": "a", "at": [0, 0, 8]}}})


def shaken(system, **options):
    t = np.arange(0.0, 0.5, 1e-3)
    ground = np.stack([3 * np.sin(60 * t), 5 * np.sin(40 * t), 2 * np.sin(90 * t)])
    return simulated(system, ground, 1e-3, integrator="generalized_alpha", **options)


def agree(scene, config, share, damped):
    """Reduced and full order within 1 % in L2, ledgers closed; `damped` is the least part of the input."""
    reduced = reduce_scene(scene, config.model, config.damping).system
    full = assemble_full(scene, config.damping)
    count = {name: part.stop - part.start for name, part in full.parts.items()}
    own = reduced.parts["reservoir"]
    assert own.stop - own.start < share * count["reservoir"] and not reduced.diagonal
    found, expected = (shaken(s, initial_state="undeformed") for s in (reduced, full))
    for name in ("disp", "jump"):
        a, b = getattr(found, name), getattr(expected, name)
        assert np.linalg.norm(a - b) < 0.01 * np.linalg.norm(b)
    for history in (found, expected):
        energy = history.energy
        assert np.abs(energy["residual"]).max() < 1e-12 * energy["input"].max()
        assert energy["damping"][-1] > damped * energy["input"].max()  # absorption and radiation


def test_reduced_and_full_order_agree_and_their_ledgers_close():
    """All modes of the dam, the reservoir's to 60 Hz and its rest as added mass: within 1 % in L2."""
    agree(*blocks(), share=0.2, damped=0.2)


def test_transient_becomes_the_harmonic_answer():
    """Shaken at 0.6 of the first frequency from rest until steady: the frequency's answer, within 0.5 %."""
    scene, config = blocks(names=("a",))
    system = assemble_full(scene, config.damping)
    omega, dt = 0.6 * np.pi * 300.0 / 16.0, 2e-3
    t = dt * np.arange(1200)
    ground = np.zeros((3, len(t)))
    ground[1] = np.sin(omega * t) * np.minimum(t / 1.2, 1.0)
    history = simulated(system, ground, dt, integrator="generalized_alpha", rho_inf=1.0)
    x = inputs(system, omega, 1)
    A = csc_matrix(system.K - omega**2 * system.M + 1j * omega * system.C)
    exact = np.abs(system.observe @ splu(A).solve(-system.load @ x))[1]
    assert np.abs(history.disp[-250:, 1]).max() == pytest.approx(exact, rel=5e-3)


def compressible(section, level):
    water = {"level": level, "model": "compressible", "cutoff": 30.0}
    scene, config = section_scene(section, water, (4, 12), {})
    return assemble_full(scene, config.damping)


def test_pine_flat_full_has_the_published_period():
    """0.397 s with compressible water at 381 of 400 ft, rigid base, E = 22.4 GPa, within 1.5 %.

    Fenves & Chopra, UCB/EERC-85/10 (1986), as handed down, see `test_water`: incompressible it is 5 % short.
    """
    assert first_period(compressible(PINE_FLAT, 381 * FOOT), "a", 0.36, 0.43) == pytest.approx(
        0.397, rel=0.015
    )


def test_koyna_full_is_the_closed_form():
    """A vertical face that moves with its first mode phi: w^2 (1 + m(w)) = w_1^2, with the added mass m(w) =
    2 rho/H sum I_n^2/sqrt(lambda_n^2 - w^2/c^2) of compressible water (Chopra 1967); within 0.5 %.
    """
    level = 96.5
    omega_1, z, phi = section_system(KOYNA)
    t = np.linspace(0.0, level, 4001)
    n = (np.arange(1, 80) - 0.5) * np.pi / level
    integral = np.trapezoid(np.interp(t, z, phi) * np.cos(n[:, None] * t), t, axis=1)
    omega = omega_1
    for _ in range(100):
        mass = 8.0 * RHO / level * (integral**2 / np.sqrt(n**2 - (omega / C) ** 2)).sum()
        omega = 0.5 * (omega + omega_1 / np.sqrt(1.0 + mass))
    period = 2.0 * np.pi / omega
    assert first_period(compressible(KOYNA, level), "a", 0.95 * period, 1.05 * period) == pytest.approx(
        period, rel=5e-3
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"transient": {"finest_step": 0.01, "integrator": "modal"}}, "integrator: modal needs modes"),
        ({"water.bottom_reflection": 1.2}, "water.bottom_reflection"),
        ({"water.sound_speed": 0}, "water.sound_speed"),
        ({"water.cutoff": -1}, "water.cutoff"),
    ],
)
def test_what_waves_do_not_go_with_is_refused(change, says):
    _, config = blocks()
    raw = config.model_dump(mode="json", exclude_unset=True)
    for key, value in change.items():
        section, _, inner = key.partition(".")
        if inner:
            raw[section][inner] = value
        else:
            raw[section] = value
    with pytest.raises(ConfigError) as caught:
        parse_config(raw, "s.yaml")
    assert says in str(caught.value)


def test_stress_at_full_order_is_the_blocks_whatever_the_water():
    """The water's unknowns stand behind the blocks', and no stress or section sees them."""
    scene, config = blocks()
    raw = config.model_dump(mode="json", exclude_unset=True)
    section = {"blocks": "all", "point": [0, 0, 0]}
    raw["outputs"]["stress"] = {"blocks": ["a"], "sections": {"foot": section}}
    scene = build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")
    system = observing_stress(scene, assemble_full(scene, config.damping))
    own = np.random.default_rng(1).normal(size=system.size)
    moved = own.copy()
    moved[system.parts["reservoir"]] += 1.0
    np.testing.assert_array_equal(system.observe @ moved, system.observe @ own)
    bare = scene.without(Reservoir)
    dry = observing_stress(bare, assemble_full(bare, config.damping))
    np.testing.assert_array_equal(system.observe @ own, dry.observe @ own[: dry.size])


def test_supports_drive_the_water_as_the_displacement_that_they_make():
    """Waves see u' + u_s d': with one wet node of two the load of d' is what the column of u' says, C u_s.

    at_dam (2, -3), B (4, 5), u_s of two motions (1, 2) and (-6, 0.5): B u_s is 14 and -21.5, so that the
    loads on the waves, on the left, are -2 and 3 times these.
    """
    waves = Waves(
        *(csr_matrix(np.diag(values)) for values in ([2.0, 5.0], [0.1, 0.2], [3.0, 7.0])),
        at_dam=csr_matrix([[2.0], [-3.0]]),
        coupling={},
        load=np.array([[11.0, 13, 17], [19, 23, 29]]),
        drive=ChannelDrive(np.zeros((0, 0)), np.zeros(0), np.zeros((0, 3))),
    )
    dam = sparse_system(np.diag([10.0, 20.0]), np.eye(2), [[1.0, -1.0]], gap_law(1))
    shapes = np.array([[1.0, -6.0], [2.0, 0.5]])
    B = csr_matrix([[4.0, 5.0]])
    wet = _behind(dam, waves, B, B @ shapes)
    column = {motion: wet.load[:, columns] for motion, columns in wet.motions.items()}
    np.testing.assert_allclose(column[Motion.SUPPORTS_VELOCITY], [[0, 0], [0, 0], [-28, 43], [42, -64.5]])
    np.testing.assert_allclose(wet.C.toarray()[2:, :2] @ shapes, [[-28, 43], [42, -64.5]])
    np.testing.assert_allclose(column[Motion.BASE_VELOCITY][2:], -waves.load[:, :3])
