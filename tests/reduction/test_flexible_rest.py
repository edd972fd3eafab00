"""Static answers without mass: the flexibility that modes leave of a large interface."""

from types import SimpleNamespace

import numpy as np
import pytest
from scene_builders import box
from simulating import simulated

from romdam.config.sections.job import DampingConfig
from romdam.core.basis import BlockBasis
from romdam.core.scene import FreeField, Reservoir
from romdam.effects.full_order import assemble_full
from romdam.error.metrics import relative_l2
from romdam.fem.assembly import assemble, assemble_mass
from romdam.fem.gaps import gap_operators
from romdam.reduction.methods import flexible_rest
from romdam.reduction.mode_choice import ALL_MODES, ModeChoice
from romdam.reduction.refinement import embedding
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice

DAMPING = DampingConfig.model_validate({"rayleigh": {"frequencies": [5.0, 50.0], "ratio": 0.05}})


def scene_of(make, water=None, **joint):
    """Two unlike pillars with friction between them, and a load on one."""
    return make(
        ({} if water is None else {"water": water})
        | {
            "blocks": {
                "left": box([0, 0, 0], [2, 1, 8], [1.0, 1.0, 2.0]),
                "right": box([0, 1, 0], [2, 2, 8], [1.0, 1.0, 2.0]),
            },
            "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
            "joints": {
                "c": {"between": ["left", "right"], "normal_stiffness": 1e10, "gap": 2e-4}
                | {"friction": 0.6, "shear_stiffness": 5e9}
                | joint
            },
            "loads": {"pressure": [{"block": "right", "face": "ymax", "value": 2e4}]},
        }
    )


@pytest.fixture
def massless(monkeypatch):
    monkeypatch.setattr(flexible_rest, "MANY", 10)


def test_static_answers_to_joint_forces_and_loads_are_those_of_the_mesh(make, massless):
    scene = scene_of(make)
    model = reduce_scene(scene, ModeChoice(count=3), DAMPING)
    system = model.system
    flexible = system.B @ np.linalg.solve(system.K.toarray(), system.B.toarray().T)
    wanted = np.zeros_like(flexible)
    operators = gap_operators(scene, 3)
    for name, block in scene.blocks.items():
        free = ~scene.fixed[name].ravel()
        K = assemble(block)[0].toarray()[np.ix_(free, free)]
        B = operators[name].toarray()[:, free]
        wanted += B @ np.linalg.solve(K, B.T)
        assert model.basis[name].massless > 30 and model.basis[name].report["method"] == "free_interface"
    np.testing.assert_allclose(flexible, wanted, atol=1e-9 * np.abs(wanted).max())
    assert (system.M.diagonal() == 0.0).sum() == sum(b.massless for b in model.basis.values())


def test_fields_follow_the_coordinates(make, massless):
    """Displacement of a block under forces on its gaps, from its basis and from the mesh."""
    scene = scene_of(make)
    basis = reduce_scene(scene, ModeChoice(count=3), DAMPING).basis["right"]
    assert isinstance(basis, BlockBasis)
    block, free = scene.blocks["right"], ~scene.fixed["right"].ravel()
    B = gap_operators(scene, 3)["right"]
    force = np.random.default_rng(4).normal(size=B.shape[0])
    exact = np.zeros(block.points.size)
    K = assemble(block)[0].toarray()[np.ix_(free, free)]
    exact[free] = np.linalg.solve(K, (B.T @ force)[free])
    found = basis.vectors.apply(basis.vectors.project(B.T @ force) / basis.omega2)
    np.testing.assert_allclose(found, exact, atol=1e-9 * np.abs(exact).max())


def histories(make, choice, **joint):
    time = np.arange(0.0, 1.0, 0.001)
    ground = np.zeros((3, len(time)))
    ground[0], ground[1] = 3.0 * np.sin(31.0 * time), 8.0 * np.sin(40.0 * time) * np.sin(np.pi * time)
    system = reduce_scene(scene_of(make, **joint), choice, DAMPING).system
    return simulated(system, ground, 0.001, stride=5, initial_state="static")


@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_a_run_is_that_of_all_modes(make, massless, monkeypatch, friction):
    keys = {} if friction else {"friction": 0.0, "shear_stiffness": 0.0}
    found = histories(make, ModeChoice(count=12), **keys)
    monkeypatch.setattr(flexible_rest, "MANY", 10**6)
    wanted = histories(make, ALL_MODES, **keys)
    assert wanted.jump[..., 0].max() > 3e-4
    assert relative_l2(found.jump[..., 0], wanted.jump[..., 0]) < 0.01
    assert np.abs(found.energy["residual"]).max() < 1e-9 * np.abs(found.energy["input"]).max()


def test_the_finer_basis_contains_the_first_and_has_the_same_static_answers(make, massless):
    coarse, fine = reduce_scene_twice(scene_of(make), ModeChoice(count=4), DAMPING)
    answers = [
        model.system.B @ np.linalg.solve(model.system.K.toarray(), model.system.B.toarray().T)
        for model in (coarse, fine)
    ]
    np.testing.assert_allclose(*answers, atol=1e-8 * np.abs(answers[0]).max())
    for name, basis in coarse.basis.items():
        inner, outer = basis.vectors.rows(), fine.basis[name].vectors.rows()
        massive = [b.vectors.shape[1] - b.massless for b in (basis, fine.basis[name])]
        assert massive[1] > massive[0] and fine.basis[name].massless <= basis.massless
        mix = np.linalg.lstsq(outer, inner, rcond=1e-10)[0]
        np.testing.assert_allclose(outer @ mix, inner, atol=1e-7 * np.abs(inner).max())


def test_contacts_that_move_alike_are_merged_with_static_answers_without_mass(make, massless):
    """Shaken along y the pillars mirror themselves: fewer gaps, the same openings."""
    time = np.arange(0.0, 0.5, 0.001)
    ground = np.zeros((3, len(time)))
    ground[1] = 8.0 * np.sin(40.0 * time)
    system = reduce_scene(scene_of(make), ModeChoice(count=6), DAMPING).system
    merged, every = (
        simulated(system, ground, 0.001, integrator="adaptive", initial_state="static", merge_contacts=merge)
        for merge in (True, False)
    )
    assert merged.stats["integrated_gaps"] < every.stats["integrated_gaps"] == len(system.law)
    np.testing.assert_allclose(merged.jump, every.jump, atol=1e-8 * np.abs(every.jump).max())


@pytest.mark.parametrize("model", ["westergaard", "incompressible"])
def test_a_motion_in_water_is_the_same_in_the_finer_basis(make, massless, model):
    """Jumps of any motion of the first model, and what the water's inertia sees of the massive modes."""
    wet = {"model": model, "level": 7.0, "upstream": [0, 1, 0]}
    wet |= {"faces": [{"block": "right", "face": "ymax"}]}
    scene = scene_of(make, water=wet)
    coarse, fine = reduce_scene_twice(scene, ModeChoice(count=4), DAMPING)
    assert (coarse.system.M.diagonal() == 0.0).any() and coarse.turns
    q = np.random.default_rng(5).normal(size=coarse.system.size) / (1.0 + coarse.system.K.diagonal())
    embedded = embedding(scene, coarse, fine) @ q
    jump = coarse.system.B @ q
    np.testing.assert_allclose(fine.system.B @ embedded, jump, atol=1e-6 * np.abs(jump).max())
    for name, basis in coarse.basis.items():
        u = basis.vectors.apply(q[basis.columns])
        finer = fine.basis[name]
        np.testing.assert_allclose(
            finer.vectors.apply(embedded[finer.columns]), u, atol=1e-6 * np.abs(u).max()
        )


def test_three_times_the_modes_stand_beside_them_and_a_tenth_of_the_unknowns_at_least(make, massless):
    """The left pillar has 72 unknowns."""

    def modes(**choice):
        basis = reduce_scene(scene_of(make), ModeChoice(**choice), DAMPING).basis["left"]
        return len(basis.omega2) - basis.massless, np.sqrt(basis.omega2) / (2.0 * np.pi)

    number, hz = modes(count=4)
    assert number == 12
    cutoff = hz[3] * 1.001
    number, hz = modes(cutoff=cutoff)
    assert number >= 4 and hz[number - 1] <= 3.0 * cutoff < hz[number]
    number, every = modes(count=12)
    assert every[len(hz[hz <= 3.0 * cutoff])] > 3.0 * cutoff
    assert modes(count=1)[0] == 7


@pytest.mark.parametrize(
    "seen",
    [
        {},
        {"free": False},
        {"field": 1},
        {"sound": 1440.0},
        {"absorbing": True},
        {"carried": np.eye(3)},
        {"directions": 10},
    ],
    ids=str,
)
def test_what_sees_accelerations_or_velocities_keeps_the_mass(massless, seen):
    part = SimpleNamespace(stands_free=lambda scene: seen.get("free", True))
    dam = SimpleNamespace(absorbing=seen.get("absorbing", False))
    has = {FreeField: seen.get("field")}
    if "sound" in seen:
        has[Reservoir] = SimpleNamespace(sound=seen["sound"])
    scene = SimpleNamespace(find=has.get, blocks={"dam": dam})
    loads = SimpleNamespace(carried={"dam": seen.get("carried", np.zeros((3, 0)))})
    whole = SimpleNamespace(scene=scene, block_loads=loads, blocks=["dam"], mesh_part=part)
    assert flexible_rest.needs_no_mass(whole, seen.get("directions", 11)) is (not seen)


def test_modes_of_the_finer_basis_are_orthonormal_in_mass_and_stiffness(make, massless):
    scene = scene_of(make)
    _, fine = reduce_scene_twice(scene, ModeChoice(count=4), DAMPING)
    for name, basis in fine.basis.items():
        modes = slice(0, len(basis.omega2) - basis.massless)
        Phi = basis.vectors.rows()[:, modes]
        M, K = assemble_mass(scene.blocks[name]), assemble(scene.blocks[name])[0]
        np.testing.assert_allclose(Phi.T @ M @ Phi, np.eye(modes.stop), atol=1e-7)
        omega = np.sqrt(basis.omega2[modes])
        stiffness = Phi.T @ K @ Phi / omega / omega[:, None]
        np.testing.assert_allclose(stiffness, np.eye(modes.stop), atol=1e-7)


def test_a_stored_basis_knows_what_has_no_mass(make, massless, tmp_path):
    scene, store = scene_of(make), BlockStore(tmp_path)
    made, read = (reduce_scene(scene, ModeChoice(count=4), DAMPING, store) for _ in range(2))
    assert made.basis["left"].massless == read.basis["left"].massless > 0
    np.testing.assert_array_equal(made.system.M.toarray(), read.system.M.toarray())


def test_water_presses_on_what_has_no_mass_and_adds_none(make, massless):
    """Jumps at rest under the inertia of blocks and water, of the mesh and of the basis."""
    wet = {"model": "incompressible", "level": 7.0, "upstream": [0, 1, 0]}
    wet |= {"faces": [{"block": "right", "face": "ymax"}]}
    scene = scene_of(make, water=wet)
    model, full = reduce_scene(scene, ModeChoice(count=4), DAMPING), assemble_full(scene, DAMPING)
    assert (model.system.M.diagonal() == 0.0).sum() == sum(b.massless for b in model.basis.values())
    found, wanted = (
        system.B @ np.linalg.solve(system.K.toarray(), np.asarray(load))
        for system, load in ((model.system, model.system.load), (full, full.load))
    )
    dry = reduce_scene(scene.without(Reservoir), ModeChoice(count=4), DAMPING).system
    without = dry.B @ np.linalg.solve(dry.K.toarray(), np.asarray(dry.load))
    assert np.abs(found - without).max() > 0.1 * np.abs(without).max()
    np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())
