"""Natural modes: rods and springs with closed forms, and meshes made one by hand."""

from pathlib import Path

import numpy as np
import pytest
from arch_dams import arch_dam
from scipy.linalg import eigh
from scipy.sparse import coo_array
from scipy.sparse.linalg import eigsh

from romdam.config import load_config, parse_config
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import Reservoir
from romdam.core.threads import one_thread
from romdam.effects.full_order import assemble_full
from romdam.fem.assembly import assemble
from romdam.reduction.natural_modes import natural_modes
from romdam.scene.build import build_scene
from romdam.scene.ties import tie_joints

ROOT = Path(__file__).parents[2]
NONE = DampingConfig()
REST = {
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}
C, RHO, L = 4000.0, 2500.0, 40.0  # speed of a rod's waves [m/s], density, length [m]


@pytest.fixture(autouse=True)
def one():
    """As the command does: BLAS shares the cores with nobody."""
    with one_thread():
        yield


def built(raw, joints="open"):
    """A scene with its joints tied or as they are."""
    config = parse_config(REST | raw, "s.yaml")
    scene = build_scene(config, Path(), "s.yaml")
    return scene if joints == "open" else tie_joints(scene, scene.joints, config.every_joint, "s.yaml")


def rods(ends=("left",), sizes=(2.0, 2.0), side=2.0, **joint):
    """A rod along y of two boxes of hex20 without Poisson's ratio, their outer ends held."""
    stops = {"left": "ymin", "right": "ymax"}
    boxes = {"left": 0.0, "right": L / 2}
    blocks = {
        name: {
            "material": "m",
            "box": {
                "origin": [0, y, 0],
                "size": [side, L / 2, side],
                "element_size": size,
                "element": "hex20",
            },
        }
        for (name, y), size in zip(boxes.items(), sizes, strict=True)
    }
    joint = {"normal_stiffness": 1e9, "shear_stiffness": 1e9} | joint
    return {
        "materials": {"m": {"E": RHO * C**2, "nu": 0.0, "rho": RHO}},
        "blocks": blocks,
        "supports": [{"block": name, "face": stops[name]} for name in ends],
        "joints": {"c": {"between": ["left", "right"]} | joint},
    }


def axial(modes):
    """Frequencies and effective masses, over the total, of the modes that move along the rod alone."""
    along = modes.motion[:, 1] > 0.999
    return modes.freq[along], (modes.effective_mass / modes.total_mass)[along, 1]


@pytest.mark.parametrize("sizes", [(2.0, 2.0), (2.0, 1.0)])
def test_tied_halves_are_one_rod(sizes):
    """Fixed and free ends: f = (2 n - 1) c / 4 L, effective mass 8 / ((2 n - 1) pi)^2; mortar ties too."""
    modes = natural_modes(built(rods(sizes=sizes), "tied"), NONE, 30)
    freq, mass = axial(modes)
    odd = np.array([1, 3])
    assert freq[:2] == pytest.approx(odd * C / 4 / L, rel=3e-6)  # of the mesh
    assert mass[:2] == pytest.approx(8 / (odd * np.pi) ** 2, rel=1e-5)
    assert modes.total_mass == pytest.approx(RHO * L * 4, rel=1e-12)


def test_open_joint_frees_a_rod():
    """The right half is held by the joint alone: six rigid motions, then f = n c / L of both ends free."""
    modes = natural_modes(built(rods()), DampingConfig(rayleigh=RayleighConfig(alpha=1.0, beta=1e-3)), 40)
    assert (modes.freq[:6] == 0.0).all() and modes.freq[6] > 1.0
    assert np.isnan(modes.damping_ratio[:6]).all()
    omega = 2 * np.pi * modes.freq[6:]
    assert modes.damping_ratio[6:] == pytest.approx((1.0 / omega + 1e-3 * omega) / 2)
    assert np.abs(axial(modes)[0] / (C / L) - 1).min() < 1e-5  # the first of the free half
    assert np.abs(axial(modes)[0] / (C / 2 / L) - 1).min() < 1e-5  # the first of the held half


def test_all_effective_masses_sum_to_what_supports_leave():
    scene = built(rods(sizes=(10.0, 10.0), side=10.0))
    system = assemble_full(scene, NONE)
    modes = natural_modes(scene, NONE, system.size)
    exact = np.einsum("nk,nk->k", system.load, np.linalg.solve(system.M.toarray(), system.load))
    assert modes.effective_mass.sum(axis=0) == pytest.approx(exact, rel=1e-9)
    assert (exact < modes.total_mass).all()


def test_bonded_stiff_block_on_its_springs():
    """Six frequencies of a rigid body on the springs of its joint, K and M by hand."""
    raw = rods(ends=("left",), sizes=(2.0, 2.0), normal_stiffness=2e6, shear_stiffness=1e6)
    raw["materials"]["m"]["E"] = 1e14
    scene = built(raw)
    joint = scene.joints["c"]
    arm = joint.position - np.array([1.0, 0.75 * L, 1.0])
    springs = np.einsum("nak,na,nal->nkl", joint.axes, np.c_[joint.K_n, joint.K_s, joint.K_s], joint.axes)
    motion = np.zeros((len(arm), 3, 6))
    motion[:, :, :3] = np.eye(3)
    motion[:, :, 3:] = np.cross(np.eye(3)[None], arm[:, None]).transpose(0, 2, 1)
    K = np.einsum("nka,nkl,nlb->ab", motion, springs, motion)
    mass, a, b = RHO * 4 * L / 2, 2.0, L / 2
    M = np.diag([mass] * 3 + [mass / 12 * s for s in (a**2 + b**2, 2 * a**2, a**2 + b**2)])
    exact = np.sqrt(eigh(K, M, eigvals_only=True)) / 2 / np.pi
    assert natural_modes(scene, NONE, 6, bonded=True).freq == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize("towards", ["tied", "open"])
def test_bonded_tends_to_tied_and_to_open(towards):
    """The error falls with 1/K, and with K: ten times nearer for ten times the stiffness, or a tenth."""
    ends = ("left", "right")
    raw = rods(ends, side=4.0, sizes=(4.0, 4.0), discretization="node_to_node")
    limit = natural_modes(built(raw, towards), NONE, 4).freq
    stiffness = (1e14, 1e15) if towards == "tied" else (1e5, 1e4)
    off = []
    for k in stiffness:
        raw["joints"]["c"] |= {"normal_stiffness": k, "shear_stiffness": k}
        off.append(natural_modes(built(raw), NONE, 4, bonded=True).freq / limit - 1.0)
    assert (np.sign(off) == (-1.0 if towards == "tied" else 1.0)).all()
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.01)


def test_rigid_joints_are_not_bonded_by_springs():
    scene = built(rods(normal_stiffness="rigid", shear_stiffness=0.0))
    with pytest.raises(ConfigError, match="gaps are rigid and no springs bond them"):
        natural_modes(scene, NONE, 2, bonded=True)


def test_a_scene_without_mass_has_no_modes():
    raw = rods(("left", "right"), sizes=(10.0, 10.0), side=10.0)
    for block in raw["blocks"].values():
        block["mass"] = False
    with pytest.raises(ConfigError, match="nothing that moves has mass"):
        natural_modes(built(raw, "tied"), NONE, 2)


def test_modes_of_one_frequency_are_all_there():
    """Two square rods alike, apart in the middle: each bending frequency four times."""
    raw = rods(("left", "right"), gap=0.0)
    freq = natural_modes(built(raw), NONE, 12).freq.reshape(3, 4)
    assert np.ptp(freq[:2], axis=1).max() < 1e-8 * freq[0, 0]


def test_water_is_that_of_the_dense_problem():
    raw = rods(sizes=(5.0, 5.0), side=5.0)
    raw["supports"] = [{"block": "left", "face": "ymin"}, {"block": "right", "face": "ymax"}]
    for model in ("westergaard", "incompressible"):
        faces = [{"block": name, "face": "xmin"} for name in ("left", "right")]
        raw["water"] = {"level": 5.0, "faces": faces, "model": model}
        scene = built(raw, "tied")
        found = natural_modes(scene, NONE, 8)
        for freq, one in ((found.freq, scene), (found.dry_freq, scene.without(Reservoir))):
            system = assemble_full(one, NONE)
            exact = eigh(system.K.toarray(), system.M.toarray(), eigvals_only=True)[:8]
            assert freq == pytest.approx(np.sqrt(exact) / 2 / np.pi, rel=1e-9)
        assert (found.freq < found.dry_freq * (1 + 1e-12)).all()
        assert found.total_mass[0] > found.total_mass[1] * 1.01


def test_all_effective_masses_with_water_sum_to_less_than_the_total():
    """By M r, to r M M^-1 M r of what is free: the water's share is that of the wet faces' motion."""
    raw = rods(sizes=(10.0, 10.0), side=10.0)
    faces = [{"block": name, "face": "xmin"} for name in ("left", "right")]
    raw["water"] = {"level": 10.0, "faces": faces, "model": "incompressible"}
    scene = built(raw, "tied")
    system = assemble_full(scene, NONE)
    modes = natural_modes(scene, NONE, system.size)
    dry = natural_modes(scene.without(Reservoir), NONE, system.size)
    assert (modes.effective_mass.sum(axis=0) < modes.total_mass).all()
    assert modes.total_mass[1:] == pytest.approx(dry.total_mass[1:], rel=1e-9)
    assert modes.total_mass[0] > modes.effective_mass.sum(axis=0)[0] > dry.total_mass[0]


def by_hand(scene, count):
    """Frequencies of all blocks on nodes that are one where they coincide, none of romdam's ties."""
    points = np.concatenate([block.points for block in scene.blocks.values()])
    number = np.unique(points.round(6) + 0.0, axis=0, return_inverse=True)[1].ravel()
    first, K, M, held = 0, 0.0, 0.0, []
    for name, block in scene.blocks.items():
        own = (3 * number[first : first + len(block.points), None] + np.arange(3)).ravel()
        first += len(block.points)
        entries = (np.ones(len(own)), (np.arange(len(own)), own))
        spread = coo_array(entries, shape=(len(own), 3 * (number.max() + 1))).tocsr()
        stiffness, mass = assemble(block)
        K, M = K + spread.T @ stiffness @ spread, M + spread.T @ mass @ spread
        held.append(own[scene.fixed[name].ravel()])
    free = np.setdiff1d(np.arange(K.shape[0]), np.concatenate(held))
    K, M = (matrix.tocsr()[free][:, free].tocsc() for matrix in (K, M))
    return np.sqrt(np.sort(eigsh(K, count, M, sigma=0.0, v0=np.ones(len(free)))[0])) / 2 / np.pi


@pytest.mark.parametrize("element", ["hex8", "tet10"])
def test_tied_arch_dam_is_one_mesh(element):
    raw = arch_dam(element=element)
    exact = by_hand(built(raw), 10)
    assert natural_modes(built(raw, "tied"), NONE, 10).freq == pytest.approx(exact, rel=1e-9)


@pytest.mark.slow
def test_tied_arch_dam_of_the_configuration_is_one_mesh():
    job = load_config(ROOT / "configs" / "arch_dam.yaml")
    scene = build_scene(job.config, job.folder, "arch_dam.yaml").without(Reservoir)
    tied = tie_joints(scene, scene.joints, job.config.every_joint, "arch_dam.yaml")
    assert natural_modes(tied, NONE, 10).freq == pytest.approx(by_hand(scene, 10), rel=1e-6)
