"""Compressible water beside a dam on rock with mass, waves coming up: other formulations, and limits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu
from simulating import simulated

from romdam.benchmarks.frequency_response import channel_inputs
from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.motion import Motion
from romdam.core.scene import Reservoir
from romdam.effects.channel import ChannelDrive
from romdam.effects.effect import MeshCoordinates
from romdam.effects.free_field import Deconvolution
from romdam.effects.full_order import assemble_full
from romdam.fem.column import respond
from romdam.fem.parts import unknowns
from romdam.fem.water.own_mesh import water_body
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

SIDES = ["xmin", "xmax", "ymin", "ymax"]
C, RHO, H = 1440.0, 1000.0, 40.0
ON_ROCK = {"rock": [{"block": "rock", "face": "zmax"}]}
FIRST = np.pi * C / (2.0 * H)  # rad/s, first frequency of the reservoir: 9 Hz


def box(origin, size, edge, material):
    return {"material": material, "box": {"origin": origin, "size": size, "element_size": edge}}


def make(kind="free_field", stiffness=10e9, **water):
    """A wall of 40 m on level rock, which is held where the kind is `fixed`, without mass.

    With `rock` the reservoir lies on it to its end, and moves with it.
    """
    keys = {"model": "compressible", "level": H, "faces": [{"block": "dam", "face": "ymin"}], "cutoff": 25.0}
    keys |= {"bottom_reflection": 0.7} if water.get("model", "compressible") == "compressible" else {}
    if water.get("model") == "incompressible":
        del keys["cutoff"]
    upstream = 120 if "rock" in water else 40
    rock = box([-30, -upstream, -40], [80, upstream + 60, 40], 20.0, "rock") | {"mass": kind != "fixed"}
    raw = {
        "materials": {
            "concrete": {"E": 25e9, "nu": 0.2, "rho": 2400.0},
            "rock": {"E": stiffness, "nu": 0.25, "rho": 2500.0},
        },
        "blocks": {"rock": rock, "dam": box([0, 0, 0], [20, 20, 40], [20, 20, 5], "concrete")},
        "ties": {"foot": {"between": ["dam", "rock"]}},
        "water": keys | water,
        "damping": {"rayleigh": {"frequencies": [3.0, 15.0], "ratio": 0.03}},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 60},
        "transient": {"finest_step": 0.01},
        "outputs": {"nodes": {"crest": {"block": "dam", "at": [0, 0, 40]}}},
    }
    if kind == "fixed":
        raw["supports"] = [{"block": "rock", "face": "zmin"}]
    else:
        raw["ground"] = {"input": kind, "viscous": [{"block": "rock", "faces": ["zmin", *SIDES]}]}
    config = parse_config(raw, "s.yaml")
    return build_scene(config, Path(), "s.yaml"), config


def harmonic(system, omega, axis):
    """What the load of a system follows, of unit ground acceleration exp(i omega t) along an axis."""
    rows = {Motion.BASE: np.eye(3)[axis].astype(complex)}
    for drive in system.drives:
        if isinstance(drive, ChannelDrive):
            made = channel_inputs(drive, omega, axis)
            n = len(drive.k)
            rows[Motion.BASE_VELOCITY], rows[Motion.CHANNEL] = made[:3], made[3 : 3 + n]
            rows[Motion.CHANNEL_RATE] = made[3 + n :]
        elif isinstance(drive, Deconvolution):
            rates = np.array([-(omega**2) + 0j]), np.array([1j * omega])
            answer = respond(drive.field, axis, rates, drive.damping)
            motion = np.zeros((answer.motion.shape[1], 3), dtype=complex)
            motion[:, axis] = answer.motion[0]
            rows[Motion.FREE_FIELD] = motion.ravel()
            rows[Motion.FREE_FIELD_RATE] = 1j * omega * motion.ravel()
            rows[Motion.FREE_FIELD_TRACTION] = np.eye(3)[axis] * answer.traction[0]
    return system.followed(rows)


def crest(system, omega, axis):
    """Displacement of the crest (3,) of unit ground acceleration, by one complex solution."""
    A = csc_matrix(system.K - omega**2 * system.M + 1j * omega * system.C)
    return system.observe @ splu(A).solve(-np.asarray(system.load @ harmonic(system, omega, axis)))


def crest_by_pressures(scene, config, omega, axis):
    """The same by another formulation: the dry system, and pressures of the Helmholtz equation.

    Section modes go upstream as exp(-kappa x) with kappa = sqrt(lambda^2 - w^2/c^2 + i w q b), exactly, on
    what the pressure differs from that of a section by itself; no impulse, no network, no drive.
    """
    dry, sound = assemble_full(scene.without(Reservoir), config.damping), scene.find(Reservoir).sound
    q = (1.0 - sound.reflection) / (1.0 + sound.reflection) / C
    body = water_body(scene.find(Reservoir), scene.blocks, C / (10.0 * sound.cutoff))
    numbered = unknowns(scene)
    Q = MeshCoordinates(numbered.of_block, csr_matrix((0, 0))).observe(body.coupling)
    section = body.section
    unit = np.eye(3)[axis]
    floor = q * section.floor + RHO * section.rock
    alone_by = (section.H + 1j * omega * floor - (omega / C) ** 2 * section.G).toarray()
    alone = np.linalg.solve(alone_by, RHO * section.rigid @ unit)
    G = section.G.toarray()
    square, phi = eigh(section.H.toarray(), G)
    damped = phi.T @ floor @ phi
    values, turn = np.linalg.eig(np.diag(square - (omega / C) ** 2) + 1j * omega * damped)
    kappa = np.sqrt(values)
    kappa = np.where(kappa.real < 0.0, -kappa, kappa)
    radiation = G @ phi @ (turn * kappa) @ np.linalg.solve(turn, phi.T @ G)
    A = (body.H + 1j * omega * q * body.floor - (omega / C) ** 2 * body.G).toarray().astype(complex)
    A[np.ix_(body.end, body.end)] += radiation
    right = RHO * (body.rigid @ unit).astype(complex)
    right[body.end] += radiation @ alone
    wet = np.zeros((len(A), len(body.wet)))
    wet[body.wet, np.arange(len(body.wet))] = 1.0
    made = np.linalg.solve(A, np.column_stack([right, RHO * wet]))[body.wet]
    pressure, per_acceleration = made[:, 0], made[:, 1:]
    S = csc_matrix(dry.K - omega**2 * dry.M + 1j * omega * dry.C) - omega**2 * csc_matrix(
        Q.T @ csr_matrix(per_acceleration) @ Q
    )
    force = -np.asarray(dry.load @ harmonic(dry, omega, axis)) - Q.T @ pressure
    return dry.observe @ splu(csc_matrix(S)).solve(force)


@pytest.mark.parametrize("water", [{}, ON_ROCK])
@pytest.mark.parametrize("axis", [1, 2])
def test_frequency_response_is_that_of_pressures_in_a_channel_without_end(axis, water):
    """Crest along the river and up, 0.2 to 1.7 times the first frequency: 0.5 %; below it 0.1 %."""
    scene, config = make(**water)
    system = assemble_full(scene, config.damping)
    for share in (0.2, 0.5, 0.8, 0.95, 1.1, 1.4, 1.7):
        found, exact = (
            f(share * FIRST)
            for f in (lambda w: crest(system, w, axis), lambda w: crest_by_pressures(scene, config, w, axis))
        )
        assert np.abs(found - exact).max() < (1e-3 if share < 1.0 else 5e-3) * np.abs(exact).max(), share


def pulse(seconds=2.0, dt=0.01):
    """(3, nt) ground acceleration that ends at rest [m/s2]."""
    t = dt * np.arange(round(seconds / dt) + 1)
    window = np.where(t < 1.2, np.sin(np.pi * t / 1.2) ** 2, 0.0)
    return np.stack([a * window * np.sin(2 * np.pi * f * t) for a, f in ((1.0, 2.5), (3.0, 3.3), (2.0, 5.0))])


def moved(system, **options):
    return simulated(system, pulse(), 0.01, "generalized_alpha", **options)


def apart(one, other):
    return np.linalg.norm(one - other) / np.linalg.norm(other)


@pytest.mark.parametrize("water", [{}, ON_ROCK])
def test_fast_sound_is_incompressible_water_in_a_free_field(water):
    """Sound at 40 times its speed, no wave below 300 Hz: the added mass's history, at full order and reduced.

    Without mass-proportional damping, which acts on an added mass and not on water with waves. On rock the
    reduced model lacks 1e-3: waves that the moving floor makes, beyond its modes.
    """
    scene, _ = make(bottom_reflection=1.0, **water)
    damping = DampingConfig(rayleigh=RayleighConfig(alpha=0.0, beta=1e-3))
    fast = replace(scene.find(Reservoir), sound=replace(scene.find(Reservoir).sound, speed=40.0 * C))
    still, _ = make(model="incompressible", **water)
    exact = moved(assemble_full(still, damping)).disp
    for system, limit in (
        (assemble_full(scene.with_effects(fast), damping), 1e-4),
        (
            reduce_scene(scene.with_effects(fast), ModeChoice(count=200), damping).system,
            2e-3 if water else 1e-4,
        ),
    ):
        history = moved(system)
        assert apart(history.disp, exact) < limit
        assert history.stats["ledger_imbalance"] < 1e-10
    assert apart(moved(assemble_full(scene, damping)).disp, exact) > 0.05


@pytest.mark.parametrize("water", [{}, ON_ROCK])
def test_stiff_rock_is_a_rigid_base(water):
    """Rock a thousand times as stiff as concrete moves as the record does: rock without mass, held.

    Water has 0.4 % of its impedance, and so damps waves along its floor a little.
    """
    found, exact = (
        moved(assemble_full(scene, config.damping)).disp
        for scene, config in (make(stiffness=5e13, **water), make("fixed", stiffness=5e13))
    )
    assert apart(found, exact) < (2e-3 if water else 5e-4)
    scene, config = make(**water)
    assert apart(moved(assemble_full(scene, config.damping)).disp, exact) > 0.2


@pytest.mark.parametrize("water", [{}, ON_ROCK])
def test_level_rock_is_shaken_as_by_uniform_input(water):
    """Relative to the surface's motion either formulation's forces act on dam and water alone."""
    found, exact = (
        moved(assemble_full(scene, config.damping)).disp
        for scene, config in (make(**water), make("uniform", **water))
    )
    assert apart(found, exact) < 1e-5


@pytest.mark.parametrize("water", [{}, ON_ROCK])
def test_reduced_model_moves_as_the_mesh_does(water):
    """60 modes of dam and rock, 120 where water lies on the rock, waves up to 25 Hz."""
    scene, config = make(**water)
    found = moved(reduce_scene(scene, ModeChoice(count=120 if water else 60), config.damping).system)
    exact = moved(assemble_full(scene, config.damping))
    assert apart(found.disp, exact.disp) < 5e-3
    for history in (found, exact):
        assert history.stats["ledger_imbalance"] < 1e-10
        assert history.energy["damping"][-1] > 0.5 * history.energy["input"].max()


def test_transient_becomes_the_harmonic_answer():
    """Shaken at 0.6 of the reservoir's first frequency until steady: the complex solution, within 0.2 %."""
    scene, config = make()
    system, omega, dt = assemble_full(scene, config.damping), 0.6 * FIRST, 3e-3
    t = dt * np.arange(2400)
    ground = np.zeros((3, len(t)))
    ground[1] = np.sin(omega * t) * np.minimum(t / 4.0, 1.0) ** 2
    history = simulated(system, ground, dt, "generalized_alpha", rho_inf=1.0)
    exact = np.abs(crest(system, omega, 1))[1]
    assert np.abs(history.disp[-300:-40, 1]).max() == pytest.approx(exact, rel=2e-3)
