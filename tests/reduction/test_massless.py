"""Parts without mass that joints alone connect: rock below blocks that slide on it."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array
from small_scenes import march, reduced, scene, turned

from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.scene import Scene
from romdam.effects.full_order import assemble_full
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.refinement import embedding
from romdam.reduction.synthesis import reduce_scene_twice
from romdam.timestepping.energy import imbalance
from romdam.timestepping.modal.mode_split import split_by_mass

G, MU = 9.81, 0.4
SIDE, HEIGHT, RHO = 4.0, 1.0, 2400.0
WEIGHT = RHO * SIDE**2 * HEIGHT * G
DAMPING = DampingConfig(rayleigh={"alpha": 0.0, "beta": 1e-4})
BOX = {"element_size": [2.0, 2.0, 1.0]}


def raw_block_on_rock(stiff: float = 1e3, **joint: Any) -> dict[str, Any]:
    """A block of 4 x 4 x 1 m on massless rock of 8 x 8 x 2 m."""
    springs = {"normal_stiffness": 200e9, "shear_stiffness": 100e9, "friction": MU}
    return {
        "materials": {
            "stiff": {"E": stiff * 30e9, "nu": 0.2, "rho": RHO},
            "rock": {"E": stiff * 30e9, "nu": 0.25, "rho": 2700.0},
        },
        "blocks": {
            "rock": {
                "material": "rock",
                "mass": False,
                "box": {"origin": [-2, -2, -2], "size": [8, 8, 2]} | BOX,
            },
            "block": {
                "material": "stiff",
                "box": {"origin": [0, 0, 0], "size": [SIDE, SIDE, HEIGHT]} | BOX,
            },
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {"base": {"between": ["rock", "block"]} | springs | joint},
        "loads": {"gravity": [0, 0, -G]},
        "outputs": {"nodes": {"top": {"block": "block", "at": [0, 0, HEIGHT]}}},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"x": 1}}],
        "model": {"modes": 4},
        "transient": {"finest_step": 0.001},
    }


def block_on_rock(slope: float = 0.0, stiff: float = 1e3, **joint: Any) -> Scene:
    """The same, all of it turned about y by a slope [rad]."""
    c, s = np.cos(slope), np.sin(slope)
    lean = turned(
        scene(raw_block_on_rock(stiff, **joint)), np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    )
    return dataclasses.replace(lean, loads=dataclasses.replace(lean.loads, gravity=np.array([0.0, 0.0, -G])))


def pulse(dt: float, acceleration: float, duration: float = 0.4, end: float = 2.5) -> Floats:
    """Ground acceleration along the slope: a pulse from 0.1 s on, linear over a step at its ends."""
    t = np.arange(round(end / dt) + 1) * dt
    return np.where((t > 0.1) & (t < 0.1 + duration - 0.5 * dt), acceleration, 0.0)


def shaken(dt: float, duration: float = 0.6) -> Floats:
    """(3, nt) ground motion that makes the block slide to and fro."""
    t = np.arange(round(duration / dt) + 1) * dt
    return np.outer([8.0, 5.0, 2.0], np.sin(2.0 * np.pi * 4.0 * t) * np.sin(np.pi * t / duration) ** 2)


def test_with_all_modes_the_mesh_answers_alike():
    """The same integrator on the reduced model, whose rock has 27 unknowns, and on the mesh.

    Both start from rest to 1e-9 of their displacement; the springs of the joint make 1e-6 of the force of it.
    """
    built, dt = block_on_rock(stiff=1.0), 0.001
    small, mesh = reduced(built, DAMPING).system, assemble_full(built, DAMPING)
    assert (small.M.diagonal() == 0.0).sum() == 3 * 9
    a, b = (
        march(system, dt, shaken(dt), integrator="generalized_alpha", initial_state="static")
        for system in (small, mesh)
    )
    assert (a.state == 2).any()
    for name in ("jump", "traction", "disp"):
        mine, theirs = getattr(a, name), getattr(b, name)
        assert np.abs(mine - theirs).max() <= 1e-5 * np.abs(theirs).max()


def test_rock_below_has_no_states_and_all_its_flexibility():
    """The exact propagation of the block's modes converges to what the mesh does."""
    built, dt = block_on_rock(stiff=1.0), 0.00025
    mesh = march(
        assemble_full(built, DAMPING), dt, shaken(dt), initial_state="static", integrator="generalized_alpha"
    )
    h = march(reduced(built, DAMPING).system, dt, shaken(dt), initial_state="static", integrator="adaptive")
    assert h.stats["dynamic_modes"] <= 3 * 18
    slip = mesh.jump[:, :, 1:]
    assert np.linalg.norm(h.jump[:, :, 1:] - slip) <= 0.005 * np.linalg.norm(slip)
    assert imbalance(h.energy) <= 1e-9


@pytest.mark.parametrize("stiff", [1.0, 1e3])
@pytest.mark.parametrize("integrator", ["adaptive", "modal", "generalized_alpha"])
def test_at_rest_it_stays(integrator, stiff):
    """Equilibrium on a slope of 10 degrees, friction 0.4: the joint carries the weight, and nothing moves.

    The start counts as at rest where an iteration moves it by less than 1e-6, and generalised-alpha goes on
    from there: it keeps forces to 1.2e-8, the others to 1e-9.
    """
    built = block_on_rock(np.radians(10.0), stiff)
    system = reduced(built, DAMPING, modes=4).system
    h = march(system, 0.002, np.zeros((3, 51)), initial_state="static", integrator=integrator)
    force = np.einsum("gd,gdx->x", h.traction[0], built.joints["base"].axes)
    assert force == pytest.approx([0.0, 0.0, WEIGHT], rel=1e-9, abs=1e-9 * WEIGHT)
    assert np.abs(h.traction - h.traction[0]).max() <= 2e-8 * WEIGHT
    assert np.abs(h.disp - h.disp[0]).max() <= 1e-6 * np.abs(h.disp[0]).max()


def test_a_load_along_the_joint_rests_on_what_has_no_states():
    """A pressure of 6 MPa on the rock's side strains the joint's springs, without a force in all."""
    raw = raw_block_on_rock(stiff=1.0)
    raw["loads"]["pressure"] = [{"block": "rock", "face": "xmin", "value": 6e6}]
    damping = DampingConfig(rayleigh={"alpha": 0.0, "beta": 1e-3})
    system = reduced(scene(raw), damping).system
    split = split_by_mass(system)
    q = system.force[split.quasi_static] / system.K.diagonal()[split.quasi_static]
    strained = (split.G_quasi @ q).reshape(-1, 3)[:, 1:] * system.law.K_s[:, None]
    assert np.abs(strained).max() > 1e-3 * WEIGHT  # as a force of the joint's springs
    h = march(system, 0.002, np.zeros((3, 51)), initial_state="static", integrator="adaptive")
    assert np.abs(h.traction[0, :, 1:].sum(axis=0)).max() <= 1e-6 * 6e6 * 16.0  # of the load
    assert np.abs(h.traction[0, :, 1:]).max() > 1e-3 * WEIGHT
    assert np.abs(h.traction - h.traction[0]).max() <= 2e-8 * np.abs(h.traction[0]).sum()
    assert h.energy["friction"][-1] <= 1e-8 * np.abs(h.energy["strain"][0])


@pytest.mark.parametrize("integrator", ["adaptive", "modal"])
def test_unknowns_without_mass_relax_with_their_own_time(integrator):
    """Rock whose answers relax in 5 to 100 ms, a third of them each, against generalised-alpha."""
    system = reduced(block_on_rock(stiff=1.0, friction=2.0), DAMPING).system
    massless = np.flatnonzero(system.M.diagonal() == 0.0)
    c = system.C.diagonal()
    c[massless] = system.K.diagonal()[massless] * np.resize([5e-3, 2e-2, 0.1], len(massless))
    uneven = dataclasses.replace(system, C=csr_matrix(diags_array(c)))
    split = split_by_mass(uneven)
    assert len(split.quasi_static) == 9 and len(massless) == 27
    dt = 5e-5
    one = march(uneven, dt, shaken(dt, 0.3), initial_state="static", integrator=integrator)
    other = march(uneven, dt, shaken(dt, 0.3), initial_state="static", integrator="generalized_alpha")
    even = march(system, dt, shaken(dt, 0.3), initial_state="static", integrator=integrator)
    moved = np.linalg.norm(other.jump - other.jump[0])
    assert np.linalg.norm(one.jump - other.jump) <= 0.002 * moved
    assert np.linalg.norm(even.jump - other.jump) > 0.02 * moved
    assert imbalance(one.energy) <= 1e-9


def test_without_damping_no_energy_is_lost():
    """A block that falls 1 mm onto its rock, and bounces: input is what falls; impacts take nothing."""
    built = block_on_rock(stiff=1.0, friction=0.0, gap=1e-3)
    system = reduced(built, DampingConfig()).system
    h = march(system, 1e-5, np.zeros((3, 4001)), integrator="conserving")
    kept = np.abs(h.energy["contact"] + h.energy["residual"]).max()
    assert (h.state == 1).any()
    assert kept <= 1e-9 * h.energy["input"].max()
    assert h.stats["quasi_static_modes"] >= 9


def halved() -> Scene:
    """The block on rock of two halves that a tie makes one."""
    raw = raw_block_on_rock()
    rock = raw["blocks"].pop("rock")
    for name, x in (("left", -2), ("right", 2)):
        raw["blocks"][name] = rock | {"box": rock["box"] | {"origin": [x, -2, -2], "size": [4, 8, 2]}}
    raw["ties"] = {"cut": {"between": ["left", "right"]}}
    raw["supports"] = [{"block": name, "face": "zmin"} for name in ("left", "right")]
    base = raw["joints"].pop("base")
    raw["joints"] = {name: base | {"between": [name, "block"]} for name in ("left", "right")}
    return scene(raw)


@pytest.mark.parametrize(("build", "part"), [(block_on_rock, "rock"), (halved, "left+right")])
def test_its_flexibility_at_the_gaps_is_the_mesh_s(build, part):
    """B K^-1 B^T, of rock in one block and in two."""
    built = build()
    small, mesh = reduced(built, DAMPING, modes=4).system, assemble_full(built, DAMPING)
    own, whole = small.parts[part], mesh.parts[part]
    assert not small.M.diagonal()[own].any()
    assert not small.load[own].any()
    B = small.B.toarray()[:, own]
    K, C = mesh.K[whole, whole].toarray(), mesh.B.toarray()[:, whole]
    expected = C @ np.linalg.solve(K, C.T)
    assert (B / small.K.diagonal()[own]) @ B.T == pytest.approx(expected, rel=1e-9, abs=1e-9 * expected.max())


def test_massless_and_held_by_joints_alone_is_refused():
    raw = raw_block_on_rock() | {"supports": [{"block": "block", "face": "zmax"}]}
    with pytest.raises(ConfigError, match=r"block 'rock' has no mass and only joints hold it.*add a support"):
        scene(raw)


def test_water_on_massless_rock_is_refused():
    """Its mass would have no inertia to be added to."""
    raw = raw_block_on_rock()
    raw["water"] = {"level": -0.5, "faces": [{"block": "rock", "face": "xmin"}], "model": "westergaard"}
    with pytest.raises(ConfigError, match=r"water.faces: block 'rock' has no mass.*model.order: full"):
        reduced(scene(raw), DAMPING, modes=4)


def test_a_finer_basis_has_the_motion_of_rock_without_mass():
    """By which a finer model starts from a run's own state: q of one is q of the other, jump by jump."""
    built = block_on_rock(stiff=1.0)
    coarse, fine = reduce_scene_twice(built, ModeChoice(count=4), DAMPING)
    assert fine.system.size > coarse.system.size
    same, into = embedding(built, coarse, coarse).toarray(), embedding(built, coarse, fine)
    assert same == pytest.approx(np.eye(coarse.system.size), abs=1e-9)
    jumps = coarse.system.B.toarray()
    assert (fine.system.B @ into).toarray() == pytest.approx(jumps, abs=1e-9 * np.abs(jumps).max())
