"""Craig-Bampton: with all modes it is the full order, and nothing but the mesh decides the answer."""

import numpy as np
import pytest
from scipy.linalg import eigh, subspace_angles
from scipy.sparse import csr_matrix
from scipy.spatial.transform import Rotation
from small_scenes import (
    DAMPING,
    dense,
    full,
    march,
    raw,
    reduced,
    renumbered,
    scaled,
    scene,
    shaking,
    swapped,
    turned,
)

from romdam.config.sections.job import DampingConfig
from romdam.reduction.methods.residual_vectors import larger

LAWS = {
    "penalty": {},
    "rigid": {"normal_stiffness": "rigid"},
    "tension": {"tension_stiffness": 3e8, "gap": 1e-5},
    "friction": {"friction": 0.6},
    "rigid friction": {"normal_stiffness": "rigid", "friction": 0.6},
    "unequal friction": {"friction": [0.3, 0.8]},
}


def _same(a, b, relative, forces=None):
    """Jumps, forces, motion and energies of two histories agree relative to their peaks."""
    for name in ("jump", "disp", "vel"):
        x, y = getattr(a, name), getattr(b, name)
        assert np.abs(x - y).max() <= relative * np.abs(y).max(), name
    assert np.abs(a.traction - b.traction).max() <= (forces or relative) * np.abs(b.traction).max()


@pytest.mark.parametrize("law", LAWS)
def test_all_modes_are_the_full_order(law):
    """Same integrator on both, 2 s, opening and closing: 1e-8 of the peak."""
    built = scene(raw(**LAWS[law]))
    a = march(reduced(built).system, integrator="generalized_alpha", tolerance=1e-12)
    b = march(full(built), integrator="generalized_alpha", tolerance=1e-12)
    contact = b.traction[:, :, 0] > 0.0
    assert 0.03 < contact.mean() < 0.97
    _same(a, b, 1e-8, 1e-6)
    assert (a.state != b.state).mean() <= 1e-3
    for name in ("input", "kinetic", "strain", "damping", "friction"):
        peak = np.abs(b.energy["input"]).max()
        assert np.abs(a.energy[name] - b.energy[name]).max() <= 1e-7 * peak, name


@pytest.mark.parametrize("law", ["penalty", "friction"])
def test_all_modes_from_the_static_state_are_the_full_order(law):
    built = scene(raw(**LAWS[law]))
    options = {"integrator": "generalized_alpha", "initial_state": "static", "tolerance": 1e-12}
    ground = shaking(0.0025, 0.5)
    a, b = (march(s, ground=ground, **options) for s in (reduced(built).system, full(built)))
    assert b.traction[0].max() > 0.0
    _same(a, b, 1e-8, 1e-6)


def test_all_modes_span_the_whole_space():
    built = scene(raw(friction=0.6))
    for name, whole in full(built).parts.items():
        basis = reduced(built).basis[name]
        assert basis.vectors.shape[1] == whole.stop - whole.start
        assert np.linalg.matrix_rank(basis.vectors.rows()) == basis.vectors.shape[1]


@pytest.mark.parametrize("friction", [0.0, 0.6])
@pytest.mark.parametrize("model", [{"modes": 12}, {"cutoff": 300.0}, {"modes": 0}])
def test_modes_are_orthonormal_and_satisfy_their_equations(friction, model):
    built = scene(raw(friction=friction))
    small, big = reduced(built, **model), full(built)
    M, _, K, B = dense(big)
    T = np.zeros((big.size, small.system.size))
    for name, basis in small.basis.items():
        free = ~built.fixed[name].ravel()
        assert np.abs(basis.vectors.rows()[~free]).max() == 0.0
        T[big.parts[name], basis.columns] = basis.vectors.rows()[free]
    omega2 = small.system.K.diagonal()
    assert np.abs(T.T @ M @ T - np.eye(len(omega2))).max() <= 1e-9
    assert np.abs(T.T @ K @ T - np.diag(omega2)).max() <= 1e-9 * omega2.max()
    assert np.abs(B @ T - small.system.B.toarray()).max() <= 1e-12 * np.abs(T).max()
    assert np.abs(T.T @ big.load - small.system.load).max() <= 1e-9 * np.abs(small.system.load).max()
    assert np.abs(T.T @ big.force - small.system.force).max() <= 1e-9 * np.abs(small.system.force).max()
    assert np.abs(big.observe @ T - small.system.observe.toarray()).max() <= 1e-14
    # Rayleigh damping stays what it was, 5 % at 5 and 60 Hz: xi = a / 2 w + b w / 2
    w1, w2 = 2 * np.pi * 5.0, 2 * np.pi * 60.0
    alpha, beta = 2 * 0.05 * w1 * w2 / (w1 + w2), 2 * 0.05 / (w1 + w2)
    assert small.system.C.diagonal() == pytest.approx(alpha + beta * omega2, rel=1e-12)
    for report in (small.report["left"], small.report["right"]):
        assert report["orthonormality_error"] <= 1e-10
        assert report["eigenvalue_residual"] <= 1e-7


def test_a_static_joint_force_is_answered_exactly_by_any_basis():
    """Constraint modes: G K^-1 G^T is that of the mesh, whatever the number of modes kept."""
    for friction in (0.0, 0.6):
        built = scene(raw(friction=friction))
        _, _, K, B = dense(full(built))
        exact = B @ np.linalg.solve(K, B.T)
        for modes in (0, 5):
            small = reduced(built, modes=modes).system
            G = small.B.toarray()
            found = (G / small.K.diagonal()) @ G.T
            assert np.abs(found - exact).max() <= 1e-9 * np.abs(exact).max()


def test_only_normals_are_retained_without_friction():
    smooth, rough = (reduced(scene(raw(friction=f)), modes=8) for f in (0.0, 0.6))
    gaps = 3 * 4  # 3 x 5 nodes on the face, 3 of them held
    for block in ("left", "right"):
        assert smooth.report[block]["retained_dofs"] == gaps
        assert rough.report[block]["retained_dofs"] == 3 * gaps
        assert smooth.report[block]["fixed_interface_modes"] == 8
        assert smooth.report[block]["static_vectors"] == 4  # inertia along three axes, and the load
    assert smooth.system.size == 2 * (gaps + 8 + 4)
    assert smooth.system.B.shape == (gaps, smooth.system.size)
    assert rough.system.B.shape == (3 * gaps, rough.system.size)


def test_cutoff_keeps_exactly_the_modes_below_it():
    built = scene(raw())
    many = reduced(built, modes=40)
    for cutoff in (200.0, 450.0):
        by_frequency = reduced(built, cutoff=cutoff)
        for block in ("left", "right"):
            count = by_frequency.report[block]["fixed_interface_modes"]
            assert by_frequency.report[block]["highest_fixed_interface_hz"] <= cutoff
            one_more = reduced(built, modes=count + 1)
            assert one_more.report[block]["highest_fixed_interface_hz"] > cutoff
            assert count < many.report[block]["fixed_interface_modes"]
            same = reduced(built, modes=count).basis[block].vectors.rows()
            angle = subspace_angles(same, by_frequency.basis[block].vectors.rows()).max()
            assert angle <= 1e-6


def test_frequencies_fall_towards_the_mesh_as_modes_are_added():
    """Ritz values lie above the mesh's own, and never rise with more modes."""
    built = scene(raw())
    M, _, K, _ = dense(full(built))
    exact = eigh(K, M, eigvals_only=True)[:10]
    before = np.full(10, np.inf)
    for modes in (0, 4, 12, 40):
        now = np.sort(reduced(built, modes=modes).system.K.diagonal())[:10]
        assert (now >= exact * (1.0 - 1e-9)).all()
        assert (now <= before * (1.0 + 1e-9)).all()
        before = now
    assert before == pytest.approx(exact, rel=2e-3)


def test_a_block_of_retained_nodes_alone_takes_any_number_of_modes():
    """One element wide, and all its nodes in joints or held: there are no modes to choose."""
    config = raw(friction=0.5)
    config["blocks"]["middle"] = config["blocks"]["left"] | {
        "box": {"origin": [0, -2, 0], "size": [4, 2, 8], "element_size": 2}
    }
    config["blocks"]["left"]["box"]["origin"] = [0, -6, 0]
    config["supports"].append({"block": "middle", "face": "zmin"})
    joint = config["joints"].pop("c")
    config["joints"] = {n: joint | {"between": [n, "middle"]} for n in ("left", "right")}
    config["outputs"] = {}
    built = scene(config)
    few, every = (reduced(built, modes=m).system for m in (40, "all"))
    own = few.parts["middle"]
    assert own.stop - own.start == 3 * 3 * 2 * 4
    assert few.K.diagonal()[own] == pytest.approx(every.K.diagonal()[every.parts["middle"]], rel=1e-9)


def test_a_block_with_fewer_modes_than_are_asked_for_takes_all():
    """So that one number serves a large block beside a small one."""
    built = scene(raw())
    interior = 3 * 3 * 3 * 4 - 12
    every = reduced(built, modes="all")
    for count in (interior, interior + 1, 10 * interior):
        some = reduced(built, modes=count)
        assert some.report["left"]["fixed_interface_modes"] == interior
        left = [model.system.K.diagonal()[model.system.parts["left"]] for model in (some, every)]
        assert left[0] == pytest.approx(left[1], rel=1e-9)


MODELS = [{"modes": "all"}, {"modes": 10}]


@pytest.mark.parametrize("law", ["penalty", "friction"])
@pytest.mark.parametrize("model", MODELS, ids=["all", "10"])
@pytest.mark.parametrize("axis", ["z", "skew"])
def test_turning_the_scene_turns_the_answer(law, model, axis):
    """30 degrees about z, and about a skew axis: nothing of the mesh or the joint is along an axis any more.

    Ten modes too: the retained DOF of a smooth joint is the normal one, whatever its direction.
    """
    direction = np.array([0.0, 0.0, 1.0]) if axis == "z" else np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    R = Rotation.from_rotvec(np.deg2rad(30.0) * direction).as_matrix()
    straight = scene(raw(**LAWS[law]))
    inclined = turned(straight, R)
    a, b = reduced(straight, **model), reduced(inclined, **model)
    assert a.report["left"]["retained_dofs"] == b.report["left"]["retained_dofs"]
    acc = shaking(0.0025, 1.0)
    x = march(a.system, ground=acc, tolerance=1e-12)
    y = march(b.system, ground=R @ acc, tolerance=1e-12)
    y_disp = y.disp.reshape(len(y.disp), -1, 3) @ R  # back into the straight scene's axes
    assert np.abs(y_disp.reshape(x.disp.shape) - x.disp).max() <= 1e-7 * np.abs(x.disp).max()
    assert np.abs(y.jump - x.jump).max() <= 1e-7 * np.abs(x.jump).max()
    assert np.abs(y.traction - x.traction).max() <= 1e-5 * np.abs(x.traction).max()


@pytest.mark.parametrize("law", ["penalty", "rigid friction"])
@pytest.mark.parametrize("model", MODELS, ids=["all", "10"])
def test_renumbering_the_nodes_changes_nothing(law, model):
    built = scene(raw(**LAWS[law]))
    acc = shaking(0.0025, 1.0)
    a, b = (
        march(reduced(s, **model).system, ground=acc, tolerance=1e-12) for s in (built, renumbered(built))
    )
    _same(b, a, 1e-7, 1e-5)


@pytest.mark.parametrize("law", ["penalty", "tension", "friction", "unequal friction"])
def test_swapping_the_sides_mirrors_the_answer(law):
    built = scene(raw(**LAWS[law]))
    acc = shaking(0.0025, 1.0)
    a, b = (march(reduced(s, modes=10).system, ground=acc, tolerance=1e-12) for s in (built, swapped(built)))
    assert np.abs(a.disp - b.disp).max() <= 1e-8 * np.abs(a.disp).max()
    mirror = np.array([1.0, 1.0, -1.0])[: a.jump.shape[2]]  # u_J - u_I and i, j change sign; k does not
    assert np.abs(a.jump - b.jump * mirror).max() <= 1e-8 * np.abs(a.jump).max()
    assert np.abs(a.traction - b.traction * mirror).max() <= 1e-6 * np.abs(a.traction).max()


@pytest.mark.parametrize("law", ["penalty", "tension", "rigid friction"])
@pytest.mark.parametrize("factor", [1e-6, 1e3])
def test_scaling_stiffness_mass_and_load_changes_no_displacement(law, factor):
    built = scene(raw(**LAWS[law]))
    acc = shaking(0.0025, 1.0)
    a, b = (
        march(reduced(s, modes=10).system, ground=acc, tolerance=1e-12)
        for s in (built, scaled(built, factor))
    )
    assert np.abs(a.disp - b.disp).max() <= 1e-7 * np.abs(a.disp).max()
    assert np.abs(a.jump - b.jump).max() <= 1e-7 * np.abs(a.jump).max()
    assert np.abs(a.traction - b.traction / factor).max() <= 1e-5 * np.abs(a.traction).max()
    assert b.energy["input"] == pytest.approx(factor * a.energy["input"], rel=1e-5, abs=1e-9 * factor)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("damping", [DAMPING, DampingConfig()], ids=["damped", "undamped"])
def test_every_law_is_admissible_and_its_ledger_closes(law, damping):
    built = scene(raw(**LAWS[law]))
    h = march(reduced(built, modes=10, damping=damping).system, dt=0.0025)
    energy, joint = h.energy, built.joints["c"]
    size = np.abs(energy["input"]).max()
    assert np.abs(energy["residual"]).max() <= 1e-9 * size
    for name in ("contact", "friction", "damping"):
        assert np.diff(energy[name]).min() >= -1e-9 * size, name
    p_n, compression = h.traction[:, :, 0], np.maximum(h.traction[:, :, 0], 0.0)
    if joint.K_nz.max() == 0.0:
        assert p_n.min() >= 0.0
    else:
        assert p_n.min() < 0.0
    if joint.mu.any():
        t, slack = h.traction[:, :, 1:], 1e-7 * p_n.max()
        if (joint.mu[:, 0] == joint.mu[:, 1]).all():
            assert (np.linalg.norm(t, axis=2) <= 0.6 * compression + slack).all()
        else:
            assert (np.abs(t) <= joint.mu[None] * compression[:, :, None] + slack).all()
        assert (h.state == 2).any() and energy["friction"][-1] > 0.0


def _floating(**joint):
    """A block on top of a held one, on nothing but the joint between them."""
    config = raw(**joint)
    boxes = {"low": ([0, 0, 0], [4, 4, 4]), "high": ([0, 0, 4], [4, 4, 2])}
    config["blocks"] = {
        name: {"material": "concrete", "box": {"origin": at, "size": extent, "element_size": 1.0}}
        for name, (at, extent) in boxes.items()
    }
    config["supports"] = [{"block": "low", "face": "zmin"}]
    config["joints"]["c"]["between"] = ["low", "high"]
    config["loads"] = {"gravity": [0, 0, -9.81]}
    config["outputs"] = {"nodes": {"top": {"block": "high", "at": [4, 4, 6]}}}
    return scene(config)


FLOATING = {"smooth": {}, "rough": {"friction": 0.6}, "rigid": {"normal_stiffness": "rigid", "friction": 0.6}}


@pytest.mark.parametrize("model", [{"modes": "all"}, {"modes": 20}, {"cutoff": 400.0}], ids=str)
@pytest.mark.parametrize("law", FLOATING)
def test_a_block_held_by_its_joint_alone_has_six_rigid_modes(law, model):
    small = reduced(_floating(**FLOATING[law]), **model)
    columns = small.basis["high"].columns
    omega2 = small.system.K.diagonal()
    assert small.system.floating
    assert (omega2[columns] == 0.0).sum() == 6
    assert (omega2 >= 0.0).all()
    rigid = small.basis["high"].vectors.rows()[:, :6]
    weight = small.system.force[columns][:6]
    mass = 2400.0 * 4 * 4 * 2
    assert np.linalg.norm(weight) == pytest.approx(mass * 9.81 / np.sqrt(mass), rel=1e-6)
    assert np.isfinite(rigid).all()


@pytest.mark.parametrize("law", FLOATING)
@pytest.mark.parametrize(
    "initial_state",
    [
        "static",
        "undeformed",
    ],
)
def test_a_block_held_by_its_joint_alone_rests_and_shakes(law, initial_state):
    built = _floating(**FLOATING[law])
    small = reduced(built, modes=20).system
    ground = shaking(0.0025, 1.0, amplitude=3.0)
    if law == "smooth":
        ground[:2] = 0.0
    h = march(small, ground=ground, initial_state=initial_state)
    weight = 2400.0 * 4 * 4 * 2 * 9.81
    if initial_state == "static":
        assert h.traction[0, :, 0].sum() == pytest.approx(weight, rel=1e-6)
        if law != "smooth":
            assert np.abs(h.traction[0, :, 1:].sum(axis=0)).max() <= 1e-6 * weight
    assert np.abs(h.energy["residual"]).max() <= 1e-9 * np.abs(h.energy["input"]).max()
    assert np.isfinite(h.disp).all()
    # on average the joint carries the weight, and the block stays where it was put
    assert h.traction[:, :, 0].sum(axis=1).mean() == pytest.approx(weight, rel=0.1)
    assert np.abs(h.disp).max() < 0.1


def test_a_floating_block_with_all_modes_is_the_full_order():
    built = _floating(friction=0.6)
    ground = shaking(0.0025, 1.0, amplitude=3.0)
    options = {"integrator": "generalized_alpha", "tolerance": 1e-12, "ground": ground}
    a, b = march(reduced(built).system, **options), march(full(built), **options)
    _same(a, b, 1e-8, 1e-6)


def test_a_block_without_interior_takes_a_cutoff():
    """One element high and wide, friction on top: every free DOF is retained."""
    config = raw(friction=0.6)
    config["blocks"] = {
        name: {"material": "concrete", "box": {"origin": [0, 0, z], "size": [2, 2, 2], "element_size": 2.0}}
        for name, z in (("low", 0), ("high", 2))
    }
    config["supports"] = [{"block": "low", "face": "zmin"}, {"block": "high", "face": "zmax"}]
    config["joints"]["c"]["between"] = ["low", "high"]
    config["loads"], config["outputs"] = {}, {}
    small = reduced(scene(config), cutoff=100.0)
    assert small.report["low"]["fixed_interface_modes"] == 0
    assert small.system.size == 2 * 12


def test_small_residual_vectors_are_left_out_with_those_of_their_frequency():
    """Two rigid motions whose omega^2 is round-off, a mode of its own, and two pairs."""
    omega2 = np.array([-3e-9, 2e-10, 5.0, 9.0, 9.0 + 1e-8, 20.0, 20.01])
    D = np.diag([1e-12, 1e-11, 2e-7, 3e-7, 1e-9, 3e-7, 1e-9])
    assert np.flatnonzero(larger(D, csr_matrix(np.eye(7)), omega2, 1e-7).any(axis=1)).tolist() == [2, 5]
    assert larger(D, csr_matrix(np.eye(7)), omega2, 0.0) is D
    heavy = csr_matrix(1e6 * np.eye(7))  # sizes are in the norm of the mass
    assert np.flatnonzero(larger(D, heavy, omega2, 1e-7).any(axis=1)).tolist() == [2, 3, 4, 5, 6]
