"""Blocks that mix hexahedra, wedges, pyramids and tetrahedra: patch tests, faces of both kinds, joints.

The meshes are two boxes written by Gmsh, `lower` of a hexahedron and two wedges, `upper` of five pyramids,
two tetrahedra and two wedges; they meet in a quadrilateral and two triangles.
"""

from dataclasses import replace

import numpy as np
import pytest
from test_elements import CONCRETE
from test_mesh_files import DATA, read

from romdam.core.errors import ConfigError, MeshError
from romdam.core.scene import Absorbing
from romdam.fem.absorbing import boundary_dashpots
from romdam.fem.assembly import assemble
from romdam.fem.loads import surface_force, thermal_force
from romdam.fem.stress import stress_operator
from romdam.geometry.facets import area_vectors, boundary_facets, facet_areas, gap_weights, second_moments
from romdam.geometry.meshes.kinds import MIXED, kinds_of
from romdam.results.vtu import mesh_of, write_vtu

LAM, MU = 30e9 * 0.18 / (1.18 * 0.64), 30e9 / 2.36
A = np.random.default_rng(8).standard_normal((3, 3)) * 1e-4
STRESS = LAM * np.trace(A) * np.eye(3) + MU * (A + A.T)


def whole(name, distortion=0.0):
    block = read(f"{name}.msh")
    moved = distortion * np.random.default_rng(7).uniform(-1, 1, block.points.shape)
    return replace(block, points=block.points + moved)


@pytest.mark.parametrize("name", MIXED)
def test_a_block_has_all_its_kinds(name):
    block = read(f"{name}.msh")
    counts = {
        element.name.rstrip("0123456789"): len(cells) for element, _, cells in kinds_of(name, block.cells)
    }
    assert block.element == name and counts == {"hex": 1, "wedge": 4, "pyramid": 5, "tet": 2}
    assert facet_areas(block.points, boundary_facets(block.cells, name)).sum() == pytest.approx(
        28.0, rel=1e-13
    )


@pytest.mark.parametrize("name", MIXED)
def test_constant_strain_and_its_stress_are_exact(name):
    """K u of u = A x is the traction on faces of both kinds; curved edges included."""
    block = whole(name, 0.03)
    K, M = assemble(block)
    u = (block.points @ A.T).ravel()
    traction = np.zeros_like(block.points)
    facets = boundary_facets(block.cells, name)
    np.add.at(traction, facets, area_vectors(block.points, facets) @ STRESS)
    assert np.abs((K @ u).reshape(-1, 3) - traction).max() < 1e-12 * np.abs(K.data).max() * np.abs(u).max()
    stress = (stress_operator(block, np.arange(len(block.points))) @ u).reshape(-1, 6)
    expected = [STRESS[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))]
    assert np.abs(stress - expected).max() < 1e-10 * np.abs(STRESS).max()
    assert np.linalg.eigvalsh(M[::3][:, ::3].toarray()).min() > 0.0


@pytest.mark.parametrize("name", MIXED)
def test_rigid_modes_alone_cost_nothing(name):
    block = whole(name, 0.03)
    K, _ = assemble(block)
    values = np.linalg.eigvalsh(K.toarray())
    assert np.abs(values[:6]).max() < 1e-12 * values[-1] < 1e-6 * values[6]


@pytest.mark.parametrize("name", MIXED)
def test_free_expansion_is_without_stress(name):
    block = replace(whole(name, 0.03), material=replace(CONCRETE, expansion=1e-5))
    K, _ = assemble(block)
    force = thermal_force(block, 20.0).ravel()
    assert np.abs(K @ (2e-4 * block.points).ravel() - force).max() < 1e-12 * np.abs(K.data).max() * 2e-4 * 10


@pytest.mark.parametrize("name", MIXED)
def test_faces_of_both_kinds_have_their_moments_and_dashpots(name):
    block = read(f"{name}.msh", group="lower")
    base = block.faces["base"]
    nodes, area, C = gap_weights(block.points, base)
    assert area.min() > 0.0 and area.sum() == pytest.approx(2.0, rel=1e-13)
    force = np.zeros((len(block.points), 3))
    np.add.at(force, base, area_vectors(block.points, base))
    assert np.abs(C.T @ area + force[nodes, 2]).max() < 1e-13  # the consistent force of uniform pressure
    moments, middle = second_moments(block.points, base)
    assert np.abs(moments - np.diag([2 / 12, 8 / 12, 0])).max() < 1e-13
    assert np.abs(middle - [0.5, 1.0, 0.0]).max() < 1e-13
    dashpots = boundary_dashpots(replace(block, absorbing=(Absorbing(base, np.inf),)))
    for axis, speed in ((2, np.sqrt((LAM + 2 * MU) / 2440)), (0, np.sqrt(MU / 2440))):
        motion = np.tile(np.eye(3)[axis], len(block.points))
        assert motion @ dashpots @ motion == pytest.approx(2440 * speed * 2.0, rel=1e-12)


def scene_of(name, **more):
    """The two boxes with a joint, water in front of x = 0 (quadrilaterals and triangles)."""
    faces = [{"block": b, "face": {"axis": "x", "at": 0.0}} for b in ("lower", "upper")]
    return {
        "blocks": {
            b: {"material": "concrete", "mesh": {"file": f"{name}.msh", "group": b}}
            for b in ("lower", "upper")
        },
        "supports": [{"block": "lower", "face": "base"}],
        "joints": {"c": {"between": ["lower", "upper"], "normal_stiffness": "16 GPa/m"} | more},
        "loads": {
            "hydrostatic": [{"level": 3.0, "faces": faces}],
            "pressure": [{"block": "upper", "face": "crest", "value": 1e5}],
        },
        "water": {"model": "westergaard", "level": 3.0, "faces": faces},
        "outputs": {
            "stress": {
                "faces": faces,
                "sections": {"s": {"blocks": ["lower"], "point": [0, 0, 1.0], "normal": [0, 0, 1]}},
            }
        },
    }


@pytest.mark.parametrize("name", MIXED)
def test_joint_water_and_loads_on_faces_of_both_kinds(name, make):
    scene = make(scene_of(name), DATA)
    assert scene.joints["c"].area.sum() == pytest.approx(2.0, rel=1e-13)
    assert [facets.shape[1] for facets in scene.joints["c"].face.facets].count(4) >= 1
    total = sum(surface_force(scene, block).sum(axis=0) for block in scene.blocks)
    assert np.abs(total - [9810.0 * 9.0 / 2 * 2.0, 0.0, -2e5]).max() < 1e-6
    assert scene.stress.sections[0].area == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("name", MIXED)
def test_mortar_does_not_take_both_kinds(name, make):
    with pytest.raises(ConfigError) as caught:
        make(scene_of(name, discretization="mortar"), DATA)
    assert str(caught.value).startswith("s.yaml: joints.c: the face of block ")
    assert "has triangles and quadrilaterals, which discretization: mortar does not take together" in str(
        caught.value
    )


def test_wedges_are_not_cut(make):
    raw = scene_of("mixed8") | {"joints": {}, "loads": {}, "outputs": {}}
    raw["supports"] = [{"block": "a", "face": "base"}]
    del raw["water"]
    raw["cut"] = {
        "lower": {"along": [{"plane": {"point": [0.25, 0, 0], "normal": [1, 0, 0]}}], "into": ["a", "b"]}
    }
    with pytest.raises((MeshError, ConfigError)) as caught:
        make(raw, DATA)
    assert "s.yaml: cut.lower: block 'lower' has wedges or pyramids (mixed8), which are not cut" in str(
        caught.value
    )


@pytest.mark.parametrize("name", MIXED)
def test_files_and_pictures_have_the_kinds(name, tmp_path):
    block = read(f"{name}.msh")
    written = mesh_of([(block.points, block.element, block.cells)])
    assert sum(len(nodes) for _, nodes in written.cells) == 12 and len(written.cells) == 4
    pyvista = pytest.importorskip("pyvista")
    in_file = pyvista.read(write_vtu(written, ["b"], tmp_path / "b.vtu"))
    assert in_file.n_cells == 12 and in_file.compute_cell_sizes()["Volume"].sum() == pytest.approx(
        8.0, rel=1e-6
    )
    assert in_file.compute_cell_sizes()["Volume"].min() > 0.0
    from romdam.visual.rendering import grid

    drawn = grid(block.element, block.points, block.cells)
    assert drawn.n_cells == 12 and drawn.compute_cell_sizes()["Volume"].sum() == pytest.approx(8.0, rel=1e-6)
