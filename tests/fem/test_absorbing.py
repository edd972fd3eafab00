"""Viscous faces: a column of rock lets a wave out, static stiffness of a cavity, the same reduced and not."""

from dataclasses import replace

import numpy as np
import pytest
from simulating import simulated

from romdam.config.sections.job import BoxConfig, DampingConfig
from romdam.core.scene import Absorbing, Material, Probe, Scene
from romdam.effects.full_order import assemble_full
from romdam.fem.absorbing import boundary_dashpots, boundary_springs
from romdam.fem.assembly import assemble
from romdam.geometry.boxes import box_block
from romdam.geometry.elements import SOLIDS
from romdam.reduction.mode_choice import ALL_MODES, ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.supports import has_no_rigid_body_mode

ROCK = Material(E=24e9, nu=0.2, rho=2500.0)
HEIGHT = 100.0
G = ROCK.E / 2.4
SPEED = {"x": np.sqrt(G / ROCK.rho), "z": np.sqrt((2.0 * G + ROCK.E * 0.2 / 0.72) / ROCK.rho)}


def column(element, axis, absorbing=True):
    """A column 100 m high for plane waves up and down, shaken along `axis`; its base takes them up."""
    config = BoxConfig(
        origin=(0, 0, 0), size=(5.0, 5.0, HEIGHT), element_size=(5.0, 5.0, 2.5), element=element
    )
    block = box_block("rock", config, ROCK, "s.yaml: blocks.rock.box")
    block = replace(block, absorbing=(Absorbing(block.faces["zmin"], np.inf),) if absorbing else ())
    fixed = np.ones((len(block.points), 3), dtype=bool)
    fixed[:, "xyz".index(axis)] = False
    if not absorbing:
        fixed[block.points[:, 2] == 0.0] = True
    tops = [int(np.argmin(np.linalg.norm(block.points - [0, 0, z], axis=1))) for z in (HEIGHT, HEIGHT / 2)]
    probes = tuple(Probe(f"p{k}", "rock", node) for k, node in enumerate(tops))
    return Scene({"rock": block}, {}, {"rock": fixed}, probes=probes)


def pulse(axis, dt, duration=0.4):
    """Ground displacement u_g, a smooth bump 0.08 s long, and its acceleration (3, nt)."""
    t = np.arange(round(duration / dt) + 1) * dt
    s = np.clip(t / 0.08, 0.0, 1.0)
    u = 0.01 * (s * (1 - s)) ** 4 * 256
    acc = np.zeros((3, len(t)))
    acc["xyz".index(axis), 1:-1] = np.diff(u, 2) / dt**2
    return t, u, acc


def shaken(system, axis, dt=2.5e-4):
    t, u, acc = pulse(axis, dt)
    history = simulated(system, acc, dt, integrator="generalized_alpha", initial_state="undeformed")
    own = history.disp.reshape(len(t), -1, 3)[..., "xyz".index(axis)]
    return t, u, own + u[:, None]


@pytest.mark.parametrize("axis", ["x", "z"])
@pytest.mark.parametrize(
    "element",
    [
        "hex8",
        "hex20",
        pytest.param("hex27", marks=pytest.mark.slow),
        pytest.param("tet10", marks=pytest.mark.slow),
    ],
)
def test_wave_leaves_through_the_base(element, axis):
    """At the top the outcrop's motion arrives H/c later, and nothing comes back: reflection below 1 %."""
    t, u, moved = shaken(assemble_full(column(element, axis), DampingConfig()), axis)
    late = np.interp(t - HEIGHT / SPEED[axis], t, u)
    assert np.abs(moved[:, 0] - late).max() < 0.02 * u.max()
    gone = t > 0.08 + 2.1 * HEIGHT / SPEED[axis]
    assert np.abs(moved[gone]).max() < 0.01 * u.max()
    _, _, kept = shaken(assemble_full(column(element, axis, absorbing=False), DampingConfig()), axis)
    assert np.abs(kept[gone]).max() > 0.5 * u.max()


@pytest.mark.parametrize("choice", [ALL_MODES, ModeChoice(cutoff=150.0)])
def test_reduced_column_is_the_meshs(choice):
    """The dashpots couple the modes, and the reduced system keeps that."""
    scene = column("hex8", "x")
    system = reduce_scene(scene, choice, DampingConfig()).system
    assert system.reduced and not system.diagonal
    C = system.C.toarray()
    assert np.abs(C - np.diag(C.diagonal())).max() > 0.5 * C.diagonal().max()
    mesh, own = (shaken(s, "x")[2] for s in (assemble_full(scene, DampingConfig()), system))
    assert np.abs(own - mesh).max() < (1e-9 if choice is ALL_MODES else 0.02) * np.abs(mesh).max()


@pytest.mark.parametrize("element", SOLIDS)
def test_face_of_a_rigid_motion(element):
    """Totals: rho c_p A and 4/3 G/R A along the normal, rho c_s A and 2/3 G/R A across it."""
    config = BoxConfig(origin=(0, 0, 0), size=(4.0, 6.0, 2.0), element_size=2.0, element=element)
    block = box_block("rock", config, ROCK, "s.yaml: blocks.rock.box")
    block = replace(block, absorbing=(Absorbing(block.faces["xmax"], 50.0),))
    rigid = np.tile(np.eye(3), (len(block.points), 1))
    area, c_s, c_p = 12.0, SPEED["x"], SPEED["z"]
    expected = ROCK.rho * area * np.diag([c_p, c_s, c_s])
    np.testing.assert_allclose(rigid.T @ (boundary_dashpots(block) @ rigid), expected, atol=1e-3)
    expected = G * area / 50.0 * np.diag([4 / 3, 2 / 3, 2 / 3])
    np.testing.assert_allclose(rigid.T @ (boundary_springs(block) @ rigid), expected, atol=1e-2)
    np.testing.assert_allclose(rigid.T @ (assemble(block)[0] @ rigid), expected, atol=1.0)
    assert has_no_rigid_body_mode(block, np.zeros((len(block.points), 3), dtype=bool))
    for matrix in (boundary_dashpots(block), boundary_springs(block)):
        assert np.linalg.eigvalsh(matrix.toarray()).min() > -1e-9 * abs(matrix).max()
