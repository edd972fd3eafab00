"""One mesh cut into blocks: volumes, areas, nodes, faces, against closed forms and meshes made in parts."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from arch_dams import arch_dam
from scene_builders import box

from romdam.config.sections.geometry.cut import CutConfig
from romdam.config.sections.job import BoxConfig
from romdam.config.sections.places import GridElement
from romdam.core.scene import Material
from romdam.geometry.boxes import box_block
from romdam.geometry.cutting.pieces import cut_block
from romdam.geometry.cutting.shapes import SLIVER, quality
from romdam.geometry.cutting.triangulated import Triangulated
from romdam.geometry.elements import ELEMENTS, jacobians
from romdam.geometry.facets import boundary_facets, facet_areas
from romdam.scene.pairing import coincident_facets
from romdam.scene.ties import scene_parts

DATA = Path(__file__).parent / "data"
CONCRETE = Material(E=30e9, nu=0.18, rho=2440.0)
TETRAHEDRA = ["tet4", "tet10"]


def a_box(element, size=(4.0, 6.0, 4.0), edge=1.0):
    sizes = BoxConfig(origin=(0, 0, 0), size=size, element_size=edge, element=element)
    return box_block("b", sizes, CONCRETE, "s.yaml: blocks.b.box")


def plane(point, normal):
    return {"plane": {"point": point, "normal": normal}}


def cut(block, *along, folder=".", **keys):
    """Pieces A, B, C, ... of a block."""
    config = CutConfig(along=along, into=tuple("ABCDEFGH"[: len(along) + 1]), **keys)
    return cut_block(block, {block.name: config}, Path(folder), "s.yaml")


def volume(block):
    """By quadrature; every cell is positive at every point of it."""
    xi, weight = ELEMENTS[block.element].rule
    determinant = np.linalg.det(jacobians(block.points, block.cells, ELEMENTS[block.element], xi))
    assert determinant.min() > 0.0
    return float((determinant @ weight).sum())


def joint(one, other):
    """Facets of the joint of two pieces; their nodes are the same bit for bit."""
    facets, partner = coincident_facets(one, other, 1e-9, "s.yaml: joints.j")
    nodes = np.unique(facets)
    assert np.array_equal(one.points[nodes], other.points[partner[nodes]])
    return facets


def off(block, facets, height):
    """Largest distance of facets, by their quadrature points, from a surface."""
    element = ELEMENTS[ELEMENTS[block.element].facet]
    at = np.einsum("qa,fak->fqk", element.shape(element.rule[0]), block.points[facets])
    return float(np.abs(height(at.reshape(-1, 3))).max())


@pytest.mark.parametrize("element", get_args(GridElement))
def test_along_faces_the_pieces_are_the_boxes_meshed_apart(element):
    pieces = cut(a_box(element), plane((0, 2, 0), (0, 3, 0)))
    for name, (origin, size) in {"A": ((0, 0, 0), (4, 2, 4)), "B": ((0, 2, 0), (4, 4, 4))}.items():
        sizes = BoxConfig(origin=origin, size=size, element_size=1.0, element=element)
        apart, piece = box_block(name, sizes, CONCRETE, "s"), pieces[name]
        key = [np.lexsort(np.round(b.points, 9).T) for b in (apart, piece)]
        assert np.abs(apart.points[key[0]] - piece.points[key[1]]).max() < 1e-14
        hidden = "ymax" if name == "A" else "ymin"
        for label, facets in apart.faces.items():
            if label == hidden:
                assert label not in piece.faces
                continue
            assert facet_areas(piece.points, piece.faces[label]).sum() == pytest.approx(
                facet_areas(apart.points, facets).sum(), rel=1e-13
            )
            outward = set(map(tuple, boundary_facets(piece.cells, element)))
            assert set(map(tuple, piece.faces[label])) <= outward
    assert facet_areas(pieces["A"].points, joint(pieces["A"], pieces["B"])).sum() == pytest.approx(16.0)


@pytest.mark.parametrize("element", TETRAHEDRA)
@pytest.mark.parametrize("normal", [(0, 1, 0), (0.2, 1, 0), (0.1, 1, -0.3), (-0.25, 1, 0.15)])
def test_a_plane_through_tetrahedra(element, normal):
    """Volumes on both sides and the section's area are those of the prism; nothing is inverted or thin."""
    block, point = a_box(element), np.array([2.0, 3.13, 2.0])
    pieces = cut(block, plane(tuple(point), normal), through="elements")
    slope = np.linalg.norm(normal) / normal[1]
    assert volume(pieces["A"]) == pytest.approx(16.0 * point[1], rel=1e-12)
    assert volume(pieces["A"]) + volume(pieces["B"]) == pytest.approx(volume(block), rel=1e-12)
    facets = joint(pieces["A"], pieces["B"])
    assert facet_areas(pieces["A"].points, facets).sum() == pytest.approx(16.0 * slope, rel=1e-12)
    away = np.array(normal) / np.linalg.norm(normal)
    assert off(pieces["A"], facets, lambda p: (p - point) @ away) < 1e-12
    assert min(quality(p.points, p.cells[:, :4]).min() for p in pieces.values()) > 0.05
    for label, facets in block.faces.items():
        areas = [facet_areas(p.points, p.faces[label]).sum() for p in pieces.values() if label in p.faces]
        assert sum(areas) == pytest.approx(facet_areas(block.points, facets).sum(), rel=1e-12)


@pytest.mark.parametrize("element", TETRAHEDRA)
def test_pieces_of_tetrahedra_are_closed_bodies(element):
    """Their boundary is the joint and the faces that they were left, by area."""
    block = a_box(element)
    pieces = cut(block, plane((2, 3.13, 2), (0.1, 1, -0.3)), through="elements")
    facets = joint(pieces["A"], pieces["B"])
    for piece in pieces.values():
        whole = facet_areas(piece.points, boundary_facets(piece.cells, element)).sum()
        named = sum(facet_areas(piece.points, rows).sum() for rows in piece.faces.values())
        assert whole == pytest.approx(named + facet_areas(pieces["A"].points, facets).sum(), rel=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_any_plane_through_an_irregular_mesh(seed):
    """Jittered nodes: volume and area stay exact, and no sliver is left."""
    rng = np.random.default_rng(seed)
    block = a_box("tet4", (4, 8, 4))
    shift = rng.uniform(-0.2, 0.2, block.points.shape)
    shift[(block.points == 0) | (block.points == [4, 8, 4])] = 0.0
    block.points[:] += shift
    normal, y = (*rng.uniform(-0.3, 0.3, 1), 1.0, *rng.uniform(-0.3, 0.3, 1)), rng.uniform(3, 5)
    pieces = cut(block, plane((2, y, 2), normal), through="elements")
    assert volume(pieces["A"]) == pytest.approx(16.0 * y, rel=1e-12)
    assert volume(pieces["A"]) + volume(pieces["B"]) == pytest.approx(128.0, rel=1e-12)
    assert min(quality(p.points, p.cells).min() for p in pieces.values()) > SLIVER
    area = facet_areas(pieces["A"].points, joint(pieces["A"], pieces["B"])).sum()
    assert area == pytest.approx(16.0 * np.linalg.norm(normal), rel=1e-12)


@pytest.mark.parametrize("element", TETRAHEDRA)
def test_a_cylinder_through_tetrahedra(element):
    """Area and volume converge to the sector's, with the square of the edge; quadratic joints are curved."""
    errors = []
    for edge in (1.0, 0.5):
        pieces = cut(
            a_box(element, (4, 4, 2), edge),
            {"cylinder": {"point": (-3, 2, 0), "radius": 5.13}},
            through="elements",
        )
        assert volume(pieces["A"]) + volume(pieces["B"]) == pytest.approx(32.0, rel=1e-12)
        facets = joint(pieces["A"], pieces["B"])
        angle = 2 * np.arcsin(2 / 5.13)
        section = 2 * 5.13**2 * (angle + np.sin(angle)) / 2 - 2 * 4 * 3
        errors.append(
            [
                abs(facet_areas(pieces["A"].points, facets).sum() / (2 * 5.13 * angle) - 1),
                abs(volume(pieces["A"]) / section - 1),
                off(pieces["A"], facets, lambda p: np.hypot(p[:, 0] + 3, p[:, 1] - 2) - 5.13),
            ]
        )
    limits = {"tet4": (2e-3, 5e-3, 2e-2), "tet10": (1e-5, 1e-5, 2e-3)}[element]
    assert (np.array(errors[1]) < limits).all()
    assert errors[1][2] < errors[0][2] / 3.0


def test_hexahedra_cut_through_one_family_of_edges():
    block = a_box("hex8")
    pieces = cut(block, plane((2, 3.5, 2), (0.1, 1, -0.1)), through="elements")
    assert [len(p.cells) for p in pieces.values()] == [64, 48]
    assert volume(pieces["A"]) == pytest.approx(16.0 * 3.5, rel=1e-13)
    area = facet_areas(pieces["A"].points, joint(pieces["A"], pieces["B"])).sum()
    assert area == pytest.approx(16.0 * np.sqrt(1.02), rel=1e-13)
    assert facet_areas(pieces["B"].points, pieces["B"].faces["zmax"]).sum() == pytest.approx(4 * (2.5 - 0.2))


def test_a_plane_beside_a_layer_of_nodes_moves_them():
    """No slice is cut off: nodes within 0.3 of an edge go onto the plane, on faces of the box along these."""
    for element in ("hex8", "tet10"):
        pieces = cut(a_box(element), plane((0, 3.1, 0), (0, 1, 0)), through="elements")
        assert sum(len(p.cells) for p in pieces.values()) == len(a_box(element).cells)
        assert volume(pieces["A"]) == pytest.approx(16 * 3.1, rel=1e-13)


@pytest.mark.parametrize("through", ["faces", "elements"])
def test_names_follow_the_surfaces_and_blocks_can_be_cut_again(make, through):
    """A base and three cantilevers on it: all nodes pair, also where four blocks meet."""
    raw = {
        "blocks": {"dam": box([0, 0, 0], [6, 2, 6], element="tet4")},
        "cut": {
            "dam": {"along": [plane([0, 0, 2], [0, 0, 1])], "into": ["base", "top"], "through": through},
            "top": {
                "along": [plane([2, 0, 0], [1, 0, 0]), plane([4, 0, 0], [1, 0, 0])],
                "into": ["M1", "M2", "M3"],
                "through": through,
                "joints": {"normal_stiffness": 1e9},
            },
        },
        "supports": [{"block": "base", "face": "zmin"}],
        "ties": {f"t{k}": {"between": ["base", f"M{k}"]} for k in (1, 2, 3)},
        "outputs": {"nodes": {"crest": {"block": "M3", "at": [6, 0, 6]}}},
    }
    scene = make(raw)
    assert list(scene.blocks) == ["base", "M1", "M2", "M3"]
    assert [scene.blocks[k].points[:, 0].min() for k in ("M1", "M2", "M3")] == [0.0, 2.0, 4.0]
    assert list(scene.joints) == ["M1-M2", "M2-M3"]
    for name, between in scene.joints.items():
        one, other = (scene.blocks[b] for b in between.blocks)
        assert facet_areas(one.points, joint(one, other)).sum() == pytest.approx(8.0), name
        assert np.abs(between.axes[:, 0] - [1, 0, 0]).max() < 1e-12


def test_mass_weight_and_material_are_those_of_the_block(make):
    raw = {
        "blocks": {"dam": box([0, 0, 0], [2, 4, 2]) | {"mass": False, "weight": False}},
        "cut": {"dam": {"along": [plane([0, 2, 0], [0, 1, 0])], "into": ["left", "right"]}},
        "supports": [{"block": name, "face": "zmin"} for name in ("left", "right")],
        "joints": {"c": {"between": ["left", "right"], "normal_stiffness": 1e9}},
    }
    scene = make(raw)
    assert scene.loads.excluded_from_gravity == {"left", "right"}
    assert {b.material.rho for b in scene.blocks.values()} == {0.0}


@pytest.mark.parametrize("element", get_args(GridElement))
def test_groups_that_share_nodes_are_what_a_cut_makes(element, make):
    """Two volume groups of a conforming file, no node twice, against the whole file cut along their plane."""
    file = {"file": f"{element}.msh"}
    groups = {name: {"material": "concrete", "mesh": file | {"group": name}} for name in ("lower", "upper")}
    whole = {"dam": {"material": "concrete", "mesh": file}}
    rest = {
        "supports": [
            {"block": "lower", "face": {"axis": "z", "at": 0}},
            {"block": "upper", "face": {"axis": "z", "at": 4}},
        ],
        "joints": {"c": {"between": ["lower", "upper"], "normal_stiffness": 1e9}},
    }
    apart = make({"blocks": groups} | rest, DATA)
    middle = apart.joints["c"].position[:, 2].mean()
    surface = {"along": [plane([0, 0, middle], [0, 0, 1])], "into": ["lower", "upper"]}
    parted = make({"blocks": whole, "cut": {"dam": surface}} | rest, DATA)
    for name in ("lower", "upper"):
        one, other = apart.blocks[name], parted.blocks[name]
        assert np.array_equal(one.points, other.points)
        assert set(map(tuple, one.cells)) == set(map(tuple, other.cells))
        assert set(one.faces) - set(other.faces) <= {"joint"}
    assert np.array_equal(apart.joints["c"].area, parted.joints["c"].area)
    assert np.array_equal(apart.joints["c"].nodes, parted.joints["c"].nodes)


@pytest.fixture
def arch(make):
    """element -> the arch dam as one mesh, its faces, and the eight cantilevers that it was made of."""

    def monolith(element):
        divisions = {"along": 2, "through": 2, "up": 8}
        raw = arch_dam(False, cantilevers=8, element=element, joints="tied", divisions=divisions)
        scene = make(raw)
        (part,) = scene_parts(scene).values()
        whole = part.mesh(scene.blocks)
        for name, block in scene.blocks.items():
            for label in ("upstream", "downstream", "crest", "contact"):
                own = part.number[name][block.faces[label]]
                whole.faces[label] = np.vstack([whole.faces[label], own]) if label in whole.faces else own
        return whole, scene

    return monolith


def radial(degrees, y):
    """Vertical planes through the axis of the arcs, their positive side to the right bank."""
    return [plane((0, y, 0), (np.cos(t), np.sin(t), 0.0)) for t in np.radians(degrees)]


@pytest.mark.parametrize("element", ["hex8", "hex20", "tet10"])
def test_an_arch_dam_cut_along_its_columns_is_the_dam_made_in_cantilevers(arch, element):
    whole, scene = arch(element)
    along = []
    for tie in scene.ties:
        points = scene.blocks[tie.blocks[0]].points[tie.nodes[0]]
        normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
        along.append(plane(tuple(points.mean(axis=0)), tuple(normal * np.sign(normal[0]))))
    pieces = cut(whole, *along)
    for piece, block in zip(pieces.values(), scene.blocks.values(), strict=True):
        key = [np.lexsort(np.round(b.points, 6).T) for b in (piece, block)]
        assert np.array_equal(piece.points[key[0]], block.points[key[1]])
        assert all(len(rows) == len(block.faces[label]) for label, rows in piece.faces.items())


@pytest.mark.parametrize("element", TETRAHEDRA)
def test_an_arch_dam_cut_through_its_elements(arch, element):
    """Radial planes: flat joints; areas and volume kept, but for nodes that move on curved faces."""
    whole, _ = arch(element)
    y = 123.0
    pieces = list(cut(whole, *radial([-31, -14.5, 2, 16, 32.3], y), through="elements").values())
    assert sum(map(volume, pieces)) == pytest.approx(volume(whole), rel=2e-5)
    for k, angle in enumerate(np.radians([-31, -14.5, 2, 16, 32.3])):
        facets = joint(pieces[k], pieces[k + 1])
        normal = np.array([np.cos(angle), np.sin(angle), 0.0])
        assert off(pieces[k], facets, lambda p, n=normal: (p - [0, y, 0]) @ n) < 1e-9
    for label, rows in whole.faces.items():
        areas = sum(facet_areas(p.points, p.faces[label]).sum() for p in pieces if label in p.faces)
        assert areas == pytest.approx(facet_areas(whole.points, rows).sum(), rel=2e-4)
    assert min(quality(p.points, p.cells[:, :4]).min() for p in pieces) > 0.05


def wavy(folder, kind, turned=False, last=4.5):
    """y = 3.1 + 0.2 sin x over a box of 4 x 6 x 4 m and beyond, as a file."""
    import meshio

    x, z = np.linspace(-0.5, last, 41), np.linspace(-0.5, 4.5, 11)
    X, Z = np.meshgrid(x, z, indexing="ij")
    points = np.c_[X.ravel(), 3.1 + 0.2 * np.sin(X.ravel()), Z.ravel()]
    n = np.arange(len(points)).reshape(X.shape)
    quads = np.stack([n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]], axis=-1).reshape(-1, 4)
    quads = quads[:, ::-1] if turned else quads
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    cells = [("quad", quads)] if kind in (".vtu", ".inp") else [("triangle", triangles)]
    form = {".msh": "gmsh", ".stl": "stl"}.get(kind)
    meshio.Mesh(points, cells).write(
        folder / f"s{kind}", **({"file_format": form, "binary": False} if form else {})
    )


@pytest.mark.parametrize("kind", [".stl", ".vtu", ".inp", ".msh"])
def test_a_surface_of_a_file(kind, tmp_path):
    wavy(tmp_path, kind)
    surface = {"surface": {"file": f"s{kind}"}}
    pieces = cut(a_box("tet10", edge=0.5), surface, folder=tmp_path, through="elements")
    exact = 4 * (3.1 * 4 + 0.2 * (1 - np.cos(4)))
    assert volume(pieces["A"]) == pytest.approx(exact, rel=2e-4)
    assert volume(pieces["A"]) + volume(pieces["B"]) == pytest.approx(96.0, rel=1e-12)
    facets = joint(pieces["A"], pieces["B"])
    assert off(pieces["A"], facets, lambda p: p[:, 1] - 3.1 - 0.2 * np.sin(p[:, 0])) < 5e-3


def test_binary_stl_is_text_stl(tmp_path):
    import meshio

    wavy(tmp_path, ".stl")
    meshio.read(tmp_path / "s.stl").write(tmp_path / "b.stl", file_format="stl", binary=True)
    one, other = (
        cut(a_box("tet4"), {"surface": {"file": name}}, folder=tmp_path, through="elements")["A"]
        for name in ("s.stl", "b.stl")
    )
    assert np.abs(one.points - other.points).max() < 1e-6


def test_the_side_of_a_surface_is_that_of_its_triangles(tmp_path):
    wavy(tmp_path, ".vtu", turned=True)
    pieces = cut(a_box("tet4"), {"surface": {"file": "s.vtu"}}, folder=tmp_path, through="elements")
    assert pieces["A"].points[:, 1].max() == 6.0


def test_groups_of_one_file_are_surfaces_of_their_own(tmp_path):
    import meshio

    corners = np.array([[-1, 0, -1], [-1, 0, 9], [9, 0, 9], [9, 0, -1]], dtype=float)
    points = np.vstack([corners + np.array([0, y, 0]) for y in (2, 4)])
    cells = [("quad", np.array([[0, 1, 2, 3], [4, 5, 6, 7]]))]
    meshio.Mesh(points, cells, cell_data={"group": [np.array([7, 8])]}).write(tmp_path / "s.vtu")
    surfaces = [{"surface": {"file": "s.vtu", "group": group}} for group in (7, 8)]
    pieces = cut(a_box("hex8"), *surfaces, folder=tmp_path)
    assert [p.points[:, 1].max() for p in pieces.values()] == [2.0, 4.0, 6.0]


def test_the_normal_at_a_corner_does_not_depend_on_the_triangles():
    """Of three sides of a cube one is cut through the corner: (1, 1, 1) / sqrt(3) all the same."""
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]], dtype=float
    )
    triangles = np.array([[0, 1, 4], [0, 4, 2], [0, 2, 3], [2, 6, 3], [0, 3, 1], [3, 5, 1]])
    surface = Triangulated.of(points, triangles, "s.yaml")
    at_corner = surface.normals[0, 0]
    assert at_corner == pytest.approx(np.ones(3) / np.sqrt(3.0), abs=1e-12)


def test_the_side_beyond_an_apex_is_that_of_the_apex():
    """A flat pyramid over unlike corners: each point beyond its ridges and apex has the nearest feature.

    Points straight above the apex lie above whatever triangle is taken; those nearest to a corner of the base
    have that corner's normal.
    """
    points = np.array(
        [[0.3, 0.2, 1.0], [2.0, -1.0, 0.0], [1.0, 3.0, 0.2], [-2.0, 1.0, -0.3], [-1.0, -2.0, 0.1]]
    )
    triangles = np.array([[0, 1, 2], [3, 0, 2], [3, 4, 0], [1, 0, 4]])
    surface = Triangulated.of(points, triangles, "s.yaml")

    def at_vertex(number):
        """Mean of the faces there by their angles."""
        total = np.zeros(3)
        for a, b, c in triangles:
            while number in (a, b, c) and a != number:
                a, b, c = b, c, a
            if a != number:
                continue
            u, v = points[b] - points[a], points[c] - points[a]
            face = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
            total += np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)) * face
        return total / np.linalg.norm(total)

    for number in range(5):
        outward = points[number] - np.array([0.0, 0.0, -2.0]) if number == 0 else points[number] - points[0]
        outside = points[number] + 0.5 * outward
        assert np.linalg.norm(surface._nearest(outside[None]).point - points[number]) < 1e-12
        np.testing.assert_allclose(surface.normal(outside[None])[0], at_vertex(number), atol=1e-12)
