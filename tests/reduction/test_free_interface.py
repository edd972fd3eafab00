"""Parts of blocks that have grown together: the mesh's own frequencies, exact static answers, one basis."""

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest
from arch_dams import DIVISIONS, JOINTS, ROCK, arch_dam
from scipy.linalg import eigh
from scipy.sparse import csr_matrix
from small_scenes import DAMPING, full, march, reduced, shaking

from romdam.config import parse_config
from romdam.error.metrics import relative_l2
from romdam.fem.assembly import assemble
from romdam.fem.parts import basis_over_unknowns
from romdam.linalg.condensed import CondensedSingle
from romdam.linalg.factor import Factor
from romdam.linalg.modes import eigen
from romdam.linalg.multifrontal import Multifrontal
from romdam.linalg.solvers import Solving
from romdam.linalg.symmetric import Symmetric
from romdam.reduction.basis import Dense
from romdam.reduction.methods import attachment_modes, free_interface
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.refinement import embedding
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice
from romdam.scene.build import build_scene
from romdam.scene.ties import scene_parts
from romdam.timestepping.equilibrium import static_equilibrium

REST = {
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
    "loads": {"gravity": [0, 0, -9.81]},
    "outputs": {"nodes": {"crest": {"block": "C2", "at": [0, -2, 100]}}},
}
COARSE = DIVISIONS | {"up": 2, "rock": 1}


def dam(**keys):
    """A small dam on rock: about 900 unknowns."""
    raw = arch_dam(**({"divisions": COARSE} | keys)) | REST
    return build_scene(parse_config(raw, "s.yaml"), Path(), "s.yaml")


def monolithic(scene):
    """K and M of one mesh made by merging nodes at equal positions, each cell with its own material."""
    points = np.vstack([block.points for block in scene.blocks.values()])
    _, first, number = np.unique(points.round(6), axis=0, return_index=True, return_inverse=True)
    K = M = csr_matrix((3 * len(first), 3 * len(first)))
    held, start = np.zeros((len(first), 3), dtype=bool), 0
    for name, block in scene.blocks.items():
        own = number.ravel()[start : start + len(block.points)]
        k, m = assemble(dataclasses.replace(block, points=points[first], cells=own[block.cells]))
        K, M = K + k, M + m
        np.logical_or.at(held, own, scene.fixed[name])
        start += len(own)
    free = np.flatnonzero(~held.ravel())
    return K[free][:, free].toarray(), M[free][:, free].toarray()


def test_tied_joints_and_all_modes_are_the_monolithic_dam():
    scene = dam(joints="tied")
    model = reduced(scene)
    exact = eigh(*monolithic(scene), eigvals_only=True)
    assert len(exact) == model.system.size
    assert np.abs(np.sqrt(model.system.K.diagonal() / exact) - 1).max() < 1e-8


def test_lowest_modes_are_those_of_the_mesh():
    scene = dam()
    whole, some = reduced(scene), reduced(scene, cutoff=6.0)
    exact = np.sort(whole.system.K.diagonal())
    report = some.report["C1"]
    count = report["fixed_interface_modes"]
    assert count == (exact < (2 * np.pi * 6.0) ** 2).sum() > 5
    assert np.abs(some.system.K.diagonal()[:count] / exact[:count] - 1).max() < 1e-9
    assert np.sort(some.system.K.diagonal())[count] > exact[count] * (1 - 1e-9)


def test_open_cantilevers_on_rigid_rock_are_their_own_blocks():
    scene = dam(ground=False)
    assert [part.blocks for part in scene_parts(scene).values()] == [(name,) for name in scene.blocks]
    system = reduced(scene).system
    for name, block in scene.blocks.items():
        K, M = assemble(block)
        free = np.flatnonzero(~scene.fixed[name].ravel())
        own = eigh(K[free][:, free].toarray(), M[free][:, free].toarray(), eigvals_only=True)
        assert np.abs(np.sqrt(system.K.diagonal()[system.parts[name]] / own) - 1).max() < 1e-8


@pytest.mark.parametrize("finer", [False, True])
def test_basis_is_orthonormal_and_statically_exact(finer):
    scene = dam()
    model, mesh = reduce_scene_twice(scene, ModeChoice(cutoff=4.0), DAMPING)[finer], full(scene)
    T = basis_over_unknowns(scene, model.basis, model.system.size)
    assert np.abs(T.T @ (mesh.M @ T) - np.eye(model.system.size)).max() < 1e-8
    k = model.system.K.diagonal()
    assert np.abs((T.T @ (mesh.K @ T) - np.diag(k)) / np.sqrt(np.outer(k, k))).max() < 1e-8
    X = Factor(mesh.K).solve(mesh.B.T.toarray())
    H, own = mesh.B @ X, (model.system.B / k) @ model.system.B.T
    assert np.abs(own - H).max() < 1e-8 * np.abs(H).max()
    weight = Factor(mesh.K).solve(mesh.force)
    assert np.abs(T @ (model.system.force / k) - weight).max() < 1e-8 * np.abs(weight).max()


def test_static_equilibrium_is_that_of_the_mesh():
    scene = dam()
    gaps = [
        static_equilibrium(system, 1e-10)[1] for system in (full(scene), reduced(scene, cutoff=4.0).system)
    ]
    assert gaps[0].force.max() > 0.0
    assert np.abs(gaps[1].jump - gaps[0].jump).max() < 1e-7 * np.abs(gaps[0].jump).max()


def test_all_modes_march_as_the_full_order_does():
    """With every mode the reduced dam is the mesh; the schemes differ by their steps only."""
    scene = dam(joints=JOINTS | {"friction": 0.0, "shear_stiffness": 0.0})
    dt = 0.000625
    ground = shaking(dt, duration=0.5, amplitude=3.0)
    mesh = march(full(scene), dt, ground, integrator="generalized_alpha", rho_inf=0.9, initial_state="static")
    own = march(reduced(scene).system, dt, ground, integrator="modal", initial_state="static")
    error = relative_l2(own.jump, mesh.jump)
    assert mesh.jump[..., 0].max() > 1e-3
    assert error < 0.02


def massless(**keys):
    """The small dam on rock without mass."""
    zones = {name: zone | {"mass": False} for name, zone in ROCK["zones"].items()}
    joints = JOINTS | {"friction": 0.0, "shear_stiffness": 0.0}
    return dam(rock=ROCK | {"zones": zones}, joints=joints, **keys)


def test_rock_without_mass_marches_as_the_full_order_does():
    scene, dt = massless(), 0.000625
    mesh, model = full(scene), reduced(scene, cutoff=80.0)
    assert (mesh.M.diagonal() == 0.0).any()
    ground = shaking(dt, duration=0.5, amplitude=6.0)
    whole = march(mesh, dt, ground, integrator="generalized_alpha", rho_inf=0.9, initial_state="static")
    own = march(model.system, dt, ground, integrator="modal", initial_state="static")
    assert np.abs(own.jump[0] - whole.jump[0]).max() < 1e-7 * np.abs(whole.jump[0]).max()
    assert np.linalg.norm(own.jump - whole.jump) < 0.03 * np.linalg.norm(whole.jump)


@pytest.mark.parametrize(("model", "limit"), [({"modes": "all"}, 1e-6), ({"cutoff": 60.0}, 0.03)])
def test_viscous_rock_marches_as_the_full_order_does(model, limit):
    """The dashpots couple the modes; generalised-alpha takes the coupled modes as it takes the mesh."""
    scene = dam(
        rock=ROCK | {"boundary": "viscous"}, joints=JOINTS | {"friction": 0.0, "shear_stiffness": 0.0}
    )
    mesh, own = full(scene), reduced(scene, **model).system
    assert not own.diagonal and not own.floating
    shaken = sum(assemble(scene.blocks[name])[1].sum() for name in scene.blocks if name[:4] != "rock")
    assert mesh.load.sum() == pytest.approx(shaken, rel=1e-9)  # the rock moves with the ground's own waves
    dt, options = 0.00125, {"integrator": "generalized_alpha", "rho_inf": 0.9, "initial_state": "static"}
    ground = shaking(dt, duration=0.5, amplitude=6.0)
    whole, some = march(mesh, dt, ground, **options), march(own, dt, ground, **options)
    assert whole.jump[..., 0].max() > 1e-3
    assert np.abs(some.jump[0] - whole.jump[0]).max() < 1e-7 * np.abs(whole.jump[0]).max()
    assert np.linalg.norm(some.jump - whole.jump) < limit * np.linalg.norm(whole.jump)
    assert some.q.shape == (len(some.time), own.size)


def test_all_modes_on_rock_without_mass_are_those_of_the_condensed_mesh():
    scene = massless()
    mesh, model = full(scene), reduced(scene)
    K, M = mesh.K.toarray(), mesh.M.toarray()
    light = mesh.M.diagonal() == 0.0
    K_sm = np.linalg.solve(K[np.ix_(light, light)], K[np.ix_(light, ~light)])
    condensed = K[np.ix_(~light, ~light)] - K[np.ix_(~light, light)] @ K_sm
    exact = eigh(condensed, M[np.ix_(~light, ~light)], eigvals_only=True)
    found = model.system.K.diagonal()
    assert np.abs(np.sqrt(found[: len(exact)] / exact) - 1).max() < 1e-8
    assert (found[len(exact) :] > exact[-1]).all()  # what is left of the joints' flexibility has no mass
    few = reduced(scene, cutoff=0.99 * np.sqrt(exact[40]) / 2 / np.pi).system.K.diagonal()
    assert np.abs(np.sqrt(few[:40] / exact[:40]) - 1).max() < 1e-8


def test_rock_without_mass_is_eliminated_before_modes_are_looked_for(monkeypatch):
    """On the dam alone, by fronts; omega^2 and flexibility of the gaps are those of SuperLU on the whole."""
    monkeypatch.setattr("romdam.linalg.modes.eigen.SMALL", 0)
    made = []

    class Noted(Multifrontal):
        def __init__(self, *of):
            super().__init__(*of)
            made.append((self.size, len(self.outer)))

    monkeypatch.setattr("romdam.linalg.solvers.Multifrontal", Noted)
    scene = massless(divisions=COARSE | {"rock": 3, "upstream": 3})
    mine, known = (
        reduce_scene(scene, ModeChoice(cutoff=30.0, solving=Solving(name)), DAMPING)
        for name in ("multifrontal", "superlu")
    )
    ((size, outer),) = made
    assert size - outer > 500
    modes = known.report["C1"]["fixed_interface_modes"]
    assert modes == mine.report["C1"]["fixed_interface_modes"] > 10
    squared, exact = (model.system.K.diagonal()[:modes] for model in (mine, known))
    assert np.abs(squared / exact - 1.0).max() < 1e-9
    flexible, exact = (
        model.system.B @ (model.system.B.T.toarray() / model.system.K.diagonal()[:, None])
        for model in (mine, known)
    )
    assert np.abs(flexible - exact).max() < 1e-9 * np.abs(exact).max()


def test_rock_without_mass_is_condensed_to_the_same_model(monkeypatch):
    """Single precision below the dam; omega^2, flexibility of the gaps and motion are those of SuperLU."""
    pytest.importorskip("pypardiso")
    made = []

    class Noted(CondensedSingle):
        def __init__(self, matrix, inner, memory):
            made.append(int(inner.sum()))
            super().__init__(matrix, inner, memory)

    monkeypatch.setattr("romdam.linalg.solvers.CondensedSingle", Noted)
    monkeypatch.setattr("romdam.linalg.modes.eigen.SMALL", 0)
    monkeypatch.setattr("romdam.linalg.modes.eigen.CondensedSingle", Noted)
    scene = massless(divisions=COARSE | {"rock": 3, "upstream": 3})
    mine, known = (
        reduce_scene(scene, ModeChoice(cutoff=30.0, solving=Solving(name)), DAMPING)
        for name in ("pardiso_single", "superlu")
    )
    assert len(made) == 1 and made[0] > 500
    modes = known.report["C1"]["fixed_interface_modes"]
    assert modes == mine.report["C1"]["fixed_interface_modes"] > 10
    squared, exact = (model.system.K.diagonal()[:modes] for model in (mine, known))
    assert np.abs(squared / exact - 1.0).max() < 1e-9
    flexible, exact = (
        model.system.B @ (model.system.B.T.toarray() / model.system.K.diagonal()[:, None])
        for model in (mine, known)
    )
    assert np.abs(flexible - exact).max() < 1e-7 * np.abs(exact).max()
    for name in ("C1", "rock_centre"):
        static, whole = (
            model.basis[name].vectors.rows()
            @ (model.system.B.T.toarray() / model.system.K.diagonal()[:, None])
            for model in (mine, known)
        )
        assert np.abs(static - whole).max() < 1e-7 * np.abs(whole).max()


def test_bases_of_a_part_are_kept_and_found(tmp_path):
    scene, store = dam(), BlockStore(tmp_path)
    made = reduce_scene(scene, ModeChoice(cutoff=4.0), DAMPING, store)
    files = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert len(files) == len(scene.blocks)
    found = reduce_scene(scene, ModeChoice(cutoff=4.0), DAMPING, store)
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == files
    assert np.array_equal(made.system.B.toarray(), found.system.B.toarray())
    other = dataclasses.replace(scene, loads=dataclasses.replace(scene.loads, gravity=np.zeros(3)))
    reduce_scene(other, ModeChoice(cutoff=4.0), DAMPING, store)
    assert len(list(tmp_path.iterdir())) == len(files)  # weight is in the span of the basis


def test_blocks_of_one_part_that_two_reductions_left_are_made_again(tmp_path, caplog):
    """Of one the frequencies differ in their last bit, as another machine's do, and a mode's sign."""
    scene, store = dam(), BlockStore(tmp_path)
    made = reduce_scene(scene, ModeChoice(cutoff=4.0), DAMPING, store)
    own = next(iter(made.basis.values()))
    signs = np.where(np.arange(len(own.omega2)) == 2, -1.0, 1.0)
    other = dataclasses.replace(
        own,
        vectors=Dense(own.vectors.rows() * signs),
        omega2=np.nextafter(own.omega2, np.inf),
        participation=own.participation * signs[:, None],
    )
    paths = [path for path in tmp_path.glob("block-*.h5") if same_block(path, own)]
    assert len(paths) == 1
    with h5py.File(paths[0]) as file:
        key = file.attrs["key"]
    store.write(key, next(iter(scene.blocks.values())), other)
    found = reduce_scene(scene, ModeChoice(cutoff=4.0), DAMPING, store)
    assert "blocks of one part are of different reductions; reducing again" in caplog.text
    assert np.array_equal(made.system.B.toarray(), found.system.B.toarray())
    assert np.array_equal(made.system.load, found.system.load)


def same_block(path, own):
    with h5py.File(path) as file:
        return np.array_equal(file["participation"], own.participation)


@pytest.mark.parametrize("small", [True, False])
def test_finer_basis_of_further_modes_contains_the_coarse_one(small, monkeypatch, tmp_path):
    """Also where the further vectors are what block Lanczos has come to of modes."""
    if not small:
        monkeypatch.setattr(eigen, "SMALL", 100)
        monkeypatch.setattr(free_interface, "BEYOND", 6.0)  # so that some are far from modes
    scene, choice = dam(), ModeChoice(cutoff=20.0)
    alone = reduce_scene(scene, choice, DAMPING)
    coarse, fine = reduce_scene_twice(scene, choice, DAMPING, BlockStore(tmp_path))
    assert np.array_equal(alone.system.K.diagonal(), coarse.system.K.diagonal())
    assert np.array_equal(alone.system.B.toarray(), coarse.system.B.toarray())
    assert fine.system.size > coarse.system.size + 5
    assert np.abs(1.0 - (embedding(scene, coarse, fine).toarray() ** 2).sum(axis=0)).max() < 1e-7
    found = reduce_scene_twice(scene, choice, DAMPING, BlockStore(tmp_path))
    for one, other in zip((coarse, fine), found, strict=True):
        assert np.array_equal(one.system.B.toarray(), other.system.B.toarray())
    flexible, known = (
        m.system.B @ (m.system.B.T.toarray() / m.system.K.diagonal()[:, None]) for m in (fine, coarse)
    )
    assert np.abs(flexible - known).max() < 1e-7 * np.abs(known).max()
    modes = [model.basis["C1"].report["fixed_interface_modes"] for model in (coarse, fine)]
    exact = reduced(scene).system.K.diagonal()[: modes[1]]
    off = fine.system.K.diagonal()[: modes[1]] / exact - 1.0
    assert np.abs(off[: modes[0]]).max() < 1e-6 and np.abs(off[: modes[0] + 3]).max() < 0.05


@pytest.mark.parametrize("on", [dam, massless])
def test_of_all_modes_the_finer_basis_is_the_same(on, tmp_path):
    scene, choice = on(), ModeChoice(count=100_000)
    for _ in range(2):  # made, and read
        coarse, fine = reduce_scene_twice(scene, choice, DAMPING, BlockStore(tmp_path))
        assert np.array_equal(fine.system.K.diagonal(), coarse.system.K.diagonal())
        assert np.abs(fine.system.B.toarray() - coarse.system.B.toarray()).max() == 0.0
        assert np.abs(embedding(scene, coarse, fine).toarray() - np.eye(fine.system.size)).max() < 1e-14


def test_further_vectors_that_a_basis_knows_leave_no_direction(tmp_path):
    """Of two, one is a mode and a static answer; what is left is the Ritz basis of all of them."""
    rng = np.random.default_rng(1)
    shape = rng.standard_normal((12, 12))
    K, M = shape @ shape.T + np.eye(12), np.diag(rng.uniform(1.0, 2.0, 12))
    exact, Phi = eigh(K, M)
    right = rng.standard_normal((12, 3))
    A = np.linalg.solve(K, right)
    values = np.hstack([A, Phi[:, :4], Phi[:, :1] + A[:, 1:2], Phi[:, 5:6] + 0.1 * Phi[:, 8:9]])
    T = OutOfCoreMatrix(tmp_path / "T", "key", values.shape)
    T.fill(9, lambda first, last: values[:, first:last])
    pencil = attachment_modes.StaticPencil(Symmetric(csr_matrix(K)), csr_matrix(M), 0.0, np.arange(12))
    work, some = right.T @ values, T.narrowed(7)
    known = attachment_modes.diagonalised(some, 4, pencil, work[:, :7])
    omega2, mix = attachment_modes.with_more(T, 2, pencil, work, *known)
    X = np.hstack([values[:, :7] @ known[1], values[:, 7:]]) @ mix
    span = np.linalg.qr(np.delete(values, 7, axis=1))[0]
    np.testing.assert_allclose(omega2, eigh(span.T @ K @ span, span.T @ M @ span)[0], rtol=1e-10)
    np.testing.assert_allclose(X.T @ M @ X, np.eye(8), atol=1e-10)
    np.testing.assert_allclose(X.T @ K @ X, np.diag(omega2), atol=1e-10 * omega2[-1])
    np.testing.assert_allclose(omega2[:4], exact[:4], rtol=1e-10)


@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_change_of_units_changes_nothing(unit):
    """Stiffness and mass times a factor leave the frequencies."""
    scene = dam()
    blocks = {
        name: dataclasses.replace(
            block,
            material=dataclasses.replace(
                block.material, E=block.material.E * unit, rho=block.material.rho * unit
            ),
        )
        for name, block in scene.blocks.items()
    }
    one, two = (reduced(s, cutoff=4.0).system for s in (scene, dataclasses.replace(scene, blocks=blocks)))
    low = slice(0, int((one.K.diagonal() < (2 * np.pi * 30.0) ** 2).sum()))
    assert np.allclose(np.sort(one.K.diagonal())[low], np.sort(two.K.diagonal())[low], rtol=1e-8)


def test_what_the_modes_know_of_a_static_answer_leaves_no_direction_of_round_off():
    """An answer that modes make nearly whole has few digits left; its rest is no vector of the basis."""
    rng = np.random.default_rng(3)
    shape = rng.standard_normal((6, 4))
    flexibility, whole = shape @ shape.T, 2e6  # four directions of six
    noise = rng.standard_normal((6, 6)) * np.finfo(float).eps * whole
    mix, slow = attachment_modes._directions(
        flexibility + 0.5 * (noise + noise.T), np.eye(6), np.ones(1), np.full(6, whole)
    )
    assert mix.shape == (6, 4)
    assert slow.shape == (4,)
    exact, _ = attachment_modes._directions(flexibility, np.eye(6), np.ones(1), flexibility.diagonal())
    angle = np.linalg.svd(np.linalg.qr(mix)[0].T @ np.linalg.qr(exact)[0], compute_uv=False)
    np.testing.assert_allclose(angle, 1.0, atol=1e-12)
