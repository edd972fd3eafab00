"""Meshes of half the size: cut in memory, and of the same keys with twice as many elements."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arch_dams import arch_dam
from gravity_dams import FOUNDATION, JOINT, gravity_dam
from scipy.spatial import cKDTree

import romdam
from romdam.config.load import Job, parse_config
from romdam.config.other_mesh import (
    finer_in_direction,
    on_coarser_mesh,
    on_finer_mesh,
    sibling_meshes,
    with_even_divisions,
)
from romdam.config.sections.job import BoxConfig
from romdam.core.errors import ConfigError, MeshError
from romdam.core.scene import Block, Material
from romdam.geometry.boxes import box_block
from romdam.geometry.elements import SOLIDS, jacobians
from romdam.geometry.facets import boundary_facets, facet_areas
from romdam.geometry.meshes.kinds import kinds_of
from romdam.geometry.meshes.refinement import refine
from romdam.scene.build import build_scene

CONCRETE = Material(3e10, 0.2, 2400.0)
REST = {
    "records": [{"name": "r", "file": "r.txt", "unit": "g", "dt": 0.01, "components": {"x": 1}}],
    "model": {"modes": 4},
    "transient": {"finest_step": 1e-3},
}
CUT = [name for name, element in SOLIDS.items() if element.linear != "pyramid5"]


def box(element, size):
    keys = BoxConfig(origin=(0, 0, 0), size=(4, 6, 2), element_size=size, element=element)
    return box_block("wall", keys, CONCRETE, "box")


def bent(block):
    """The same with curved edges, where it has any."""
    x, y, _ = block.points.T
    return replace(block, points=block.points + 0.05 * np.c_[0.1 * y**2, np.sin(x), 0.1 * x * y])


def volumes(block):
    return np.concatenate(
        [
            np.linalg.det(jacobians(block.points, cells, kind, kind.rule[0])) @ kind.rule[1]
            for kind, _, cells in kinds_of(block.element, block.cells)
        ]
    )


@pytest.mark.parametrize("element", CUT)
def test_a_refined_box_is_the_box_of_half_the_size(element):
    refined, meshed = refine(box(element, 2.0), "box"), box(element, 1.0)
    assert len(refined.points) == len(meshed.points) and len(refined.cells) == len(meshed.cells)
    distance, _ = cKDTree(meshed.points).query(refined.points)
    assert distance.max() < 1e-12
    for name, facets in meshed.faces.items():
        assert len(refined.faces[name]) == len(facets)


@pytest.mark.parametrize("element", CUT)
def test_refinement_keeps_nodes_volume_and_faces_of_curved_blocks(element):
    coarse = bent(box(element, 2.0))
    fine = refine(coarse, "box")
    assert (fine.points[: len(coarse.points)] == coarse.points).all()
    assert volumes(fine).min() > 0.0
    assert volumes(fine).sum() == pytest.approx(volumes(coarse).sum(), rel=1e-12)
    assert len(boundary_facets(fine.cells, element)) == 4 * len(boundary_facets(coarse.cells, element))
    for name, facets in coarse.faces.items():
        area = facet_areas(coarse.points, facets).sum()
        assert facet_areas(fine.points, fine.faces[name]).sum() == pytest.approx(area, rel=1e-4)


def test_a_hexahedron_and_a_wedge_are_cut_alike_on_their_common_face():
    plan = [(0, 0), (1, 0), (1, 1), (0, 1)]
    points = np.array([(x, y, z) for z in (0, 1) for x, y in plan] + [(2, 0, 0), (2, 0, 1)], dtype=float)
    cells = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [1, 8, 2, 2, 5, 9, 6, 6]])
    block = Block("mixed", "mixed8", points, cells, CONCRETE, {})
    block = replace(block, faces={"all": boundary_facets(cells, "mixed8")})
    fine = refine(block, "mixed")
    assert len(fine.cells) == 16 and len(fine.points) == 27 + 18 - 9
    assert volumes(fine).sum() == pytest.approx(1.5, rel=1e-12)
    assert facet_areas(fine.points, fine.faces["all"]).sum() == pytest.approx(
        facet_areas(points, block.faces["all"]).sum(), rel=1e-12
    )
    assert len(boundary_facets(fine.cells, "mixed8")) == 4 * len(block.faces["all"])


def test_pyramids_are_refused():
    with pytest.raises(MeshError, match=r"mesh: 36 of 36 cells are pyramid5, which refinement cannot cut"):
        refine(box("pyramid5", 2.0), "mesh")


def test_a_mesh_file_is_refined_as_often_as_asked(tmp_path):
    import meshio

    coarse = box("hex8", 2.0)
    meshio.write(tmp_path / "wall.vtu", meshio.Mesh(coarse.points, [("hexahedron", coarse.cells)]))
    raw = {
        "materials": {"concrete": {"E": 3e10, "nu": 0.2, "rho": 2400}},
        "blocks": {"wall": {"material": "concrete", "mesh": {"file": "wall.vtu", "refine": 1}}},
        "supports": [{"block": "wall", "face": {"axis": "z", "at": 0.0}}],
        "records": [{"name": "r", "file": "r.txt", "unit": "g", "dt": 0.01, "components": {"x": 1}}],
        "model": {"modes": 4},
        "transient": {"finest_step": 1e-3},
        "outputs": {"mesh_error": False},
    }
    config = parse_config(raw, "job")
    scene = build_scene(config, tmp_path, "job")
    assert len(scene.blocks["wall"].cells) == 48 and len(scene.blocks["wall"].points) == 105
    finer = on_finer_mesh(Job(config, tmp_path / "job.yaml"))
    assert finer.config.blocks["wall"].mesh.refine == 2
    assert on_coarser_mesh(finer).config == config


@pytest.mark.parametrize("raw", [arch_dam(cantilevers=2), gravity_dam()], ids=["arch", "gravity"])
def test_the_finer_mesh_of_a_dam_has_the_nodes_of_its_own(raw, tmp_path):
    raw = raw | REST | {"outputs": {"mesh_error": False}}
    job = Job(parse_config(raw, "job"), tmp_path / "job.yaml")
    own, finer = (build_scene(one.config, tmp_path, "job") for one in (job, on_finer_mesh(job)))
    arch = "C1" in own.blocks  # whose rock follows the contact and whose zones take whole cells
    for name, block in own.blocks.items():
        if not arch or name.startswith("C"):
            distance, _ = cKDTree(finer.blocks[name].points).query(block.points)
            assert distance.max() < 1e-6, name
            assert len(finer.blocks[name].cells) == 8 * len(block.cells)
    cells = [sum(len(block.cells) for block in one.blocks.values()) for one in (own, finer)]
    assert cells[1] == 8 * cells[0]
    assert on_coarser_mesh(on_finer_mesh(job)).config == job.config


GALLERY = {"floor": 12.0, "height": 3.0, "upstream": 5.0, "width": 2.5}


def steps_job(divisions, **keys):
    """Three monoliths on steps at 20, 0 and 10 m without rock."""
    keys = {"rock": None, "joints": {"base": "tied", "contraction": JOINT}, "element": "hex20"} | keys
    raw = gravity_dam(divisions={"along": 2} | divisions, **keys) | REST | {"outputs": {"mesh_error": False}}
    return Job(parse_config(raw, "job"), Path("job.yaml"))


@pytest.mark.parametrize(
    ("divisions", "times", "rows", "columns"),
    [
        ({"up": [2, 2, 6, 4], "through": 4}, 2.0, (1, 1, 3, 2), (2,)),
        ({"up": [3, 3, 9, 6], "through": 2}, 1.5, (2, 2, 6, 4), (1,)),
        ({"up": 8, "through": 2, "refine": 1}, 2.0, (1, 1, 4, 3), (2,)),
        ({"up": [2, 4, 2, 2, 8, 6], "through": [2, 2, 4]}, 2.0, (1, 2, 1, 1, 4, 3), (1, 1, 2)),
    ],
)
def test_a_coarser_gravity_dam_is_coarser_in_every_interval(divisions, times, rows, columns, tmp_path):
    """An error in an interval that both meshes share would not show in their difference."""
    job = steps_job(divisions, **({"gallery": GALLERY} if len(columns) > 1 else {}))
    chain = sibling_meshes(job)
    assert [(each.direction, each.times) for each in chain] == [
        ("up", times),
        ("through", 2.0),
        ("along", 2.0),
    ]
    coarsest = chain[-1].job
    assert (coarsest.config.gravity_dam.rows, coarsest.config.gravity_dam.columns) == (rows, columns)
    if times == 1.5:
        return
    every = on_coarser_mesh(job).config.gravity_dam
    assert (every.rows, every.columns) == (rows, columns)
    own, coarser = (build_scene(one.config, tmp_path, "job").blocks for one in (job, coarsest))
    for name, block in coarser.items():
        assert cKDTree(own[name].points).query(block.points)[0].max() < 1e-6
        assert len(own[name].cells) == 8 * len(block.cells)


def test_rows_that_are_shared_out_have_no_coarser_mesh_until_they_are_even():
    job = steps_job({"up": 8, "through": 4})
    said = (
        r"gravity_dam.divisions.up: is 8, shared out as \[1, 1, 4, 3\] between elevations 0, 10, 20, 66.5, "
        r"103 m, of which neither half nor two thirds are whole; make it \[2, 2, 4, 4\], or compare with"
    )
    with pytest.raises(ConfigError, match=said):
        sibling_meshes(job)
    with pytest.raises(ConfigError, match=r"which cannot be halved; make it \[2, 2, 4, 4\]"):
        on_coarser_mesh(job)
    even = with_even_divisions(job)
    assert even.config.gravity_dam.rows == (2, 2, 4, 4) and len(sibling_meshes(even)) == 3
    assert with_even_divisions(even) is even
    finer = finer_in_direction(even, "up").config.gravity_dam
    assert (finer.rows, finer.columns) == ((4, 4, 6, 6), (4,))


def test_numbers_of_intervals_are_those_of_the_elevations_where_something_changes():
    assert steps_job({"up": 8}).config.gravity_dam.rows == (1, 1, 4, 3)
    with pytest.raises(
        ConfigError,
        match=r"`divisions.up` has 3 numbers, of intervals between elevations .* m there are 4; give",
    ):
        steps_job({"up": [2, 2, 4]})
    with pytest.raises(
        ConfigError, match=r"3 numbers, of intervals between the faces there is 1; give one number"
    ):
        steps_job({"through": [1, 1, 1]})
    with pytest.raises(ConfigError, match=r"`divisions.up` are 203 elements, limit 200; give fewer"):
        steps_job({"up": [1, 1, 200, 1]})


def test_what_cannot_be_coarser_says_which_number():
    job = romdam.load_config(
        {
            "materials": {"concrete": {"E": 3e10, "nu": 0.2, "rho": 2400}},
            "blocks": {
                "wall": {
                    "material": "concrete",
                    "box": {"origin": [0, 0, 0], "size": [4, 6, 2], "element_size": 2},
                }
            },
            "supports": [{"block": "wall", "face": "zmin"}],
            "records": [{"name": "r", "file": "r.txt", "unit": "g", "dt": 0.01, "components": {"x": 1}}],
            "model": {"modes": 4},
            "transient": {"finest_step": 1e-3},
        }
    )
    with pytest.raises(ConfigError, match=r"blocks\.wall\.box: has 3 elements along y, which cannot be"):
        on_coarser_mesh(job)


@pytest.mark.parametrize("element", ["hex8", "hex20"])
@pytest.mark.parametrize("kind", ["arch_dam", "gravity_dam"])
def test_halved_layers_of_rock_are_those_of_twice_as_many(kind, element, tmp_path):
    """All halved they are twice as many that grow by the root; one halved has nodes of both meshes."""
    below, dam, of_dam = {
        "arch_dam": ("rock", arch_dam, {"along": 1, "through": 2, "up": 2, "perimeter": 1}),
        "gravity_dam": ("depth", gravity_dam, {"along": 1, "through": 2, "up": 4, "banks": 2}),
    }[kind]

    def corners(layers, rows, growth, halved=0):
        divisions = of_dam | {below: layers, "upstream": rows, "downstream": rows} | {"growth": growth}
        if "banks" in divisions:
            divisions["banks"] = rows
        raw = dam(element=element, divisions=divisions | {"halved": halved}) | REST
        blocks = build_scene(parse_config(raw, "job"), tmp_path, "job").blocks.values()
        return np.unique(
            np.concatenate([block.points[np.unique(block.cells[:, :8])] for block in blocks]).round(6), axis=0
        )

    given, twice, every = corners(3, 2, 2.25), corners(6, 4, 1.5), corners(3, 2, 2.25, halved=3)
    assert every.shape == twice.shape and cKDTree(twice).query(every)[0].max() < 2e-6
    first = corners(3, 2, 2.25, halved=1)
    assert len(given) < len(first) < len(twice)
    assert cKDTree(first).query(given)[0].max() < 2e-6 > cKDTree(twice).query(first)[0].max()


def test_rows_of_rock_stand_where_they_are_counted(tmp_path):
    """Upstream 100 m in the ratio 1 : 2, the first halved as 1 : sqrt 2; downstream 130 m in 1 : 2 : 4."""
    rows = {"along": 1, "through": 2, "up": 4, "depth": 2, "upstream": 2, "downstream": 3, "banks": 1}
    raw = gravity_dam(divisions=rows | {"growth": 2.0, "halved": 1}, base=0) | REST
    rock = build_scene(parse_config(raw, "job"), tmp_path, "job").blocks["rock_2"].points
    y = np.unique(rock[rock[:, 2] > -1e-6, 1].round(6))
    up, down = 100.0 / 3.0, 130.0 / 7.0
    half = 1.0 / (1.0 + 2.0**0.5)
    expected = [-100.0, -up, -half * up, 0.0, 35.0, 70.0, *(70.0 + down * np.array([half, 1.0, 3.0, 7.0]))]
    assert y == pytest.approx(expected, abs=1e-5)


def test_halved_layers_stay_halved_on_other_meshes():
    """Halved once more they are twice as many of twice as many, in which those that were halved are too."""
    divisions = {"up": [2, 2, 4, 4], "through": 2, "depth": 3, "halved": 1, "growth": 2.25}
    job = steps_job(divisions, rock=FOUNDATION)

    def below(one):
        divisions = one.config.gravity_dam.shared_divisions
        return divisions.depth, divisions.upstream, divisions.halved, divisions.growth

    assert below(job) == (3, 3, 1, 2.25)
    whole = steps_job(divisions | {"halved": 0}, rock=FOUNDATION)
    assert below(sibling_meshes(whole)[-1].job) == (3, 3, 2, 2.25)  # the inner half of three is two
    assert below(on_finer_mesh(job)) == (6, 6, 2, 1.5) == below(sibling_meshes(job)[-1].job)
    assert below(on_coarser_mesh(job)) == (2, 2, 1, 2.25**2)
    depth, upstream, halved, growth = below(finer_in_direction(job, "rock"))
    assert (depth, upstream, halved) == (6, 6, 2) and growth == pytest.approx(2.25 ** (2 / 3))


def test_a_perimeter_without_rock_is_refined():
    keys = {"element": "hex20", "divisions": {"along": 2, "through": 2, "up": 2, "perimeter": 1}}
    job, bare = (
        Job(parse_config(raw | REST, "job"), Path("job.yaml"))
        for raw in (arch_dam(rock=None, **keys), arch_dam(ground=False, **keys))
    )
    assert sibling_meshes(job)[-1].job.config.arch_dam.divisions.perimeter == 2
    assert finer_in_direction(job, "rock").config.arch_dam.divisions.perimeter == 2
    assert [each.direction for each in sibling_meshes(bare)] == ["up", "through", "along"]
    with pytest.raises(ConfigError, match="there is no rock to refine"):
        finer_in_direction(bare, "rock")


@pytest.mark.parametrize(
    ("dam", "divisions", "rock", "said"),
    [
        (
            arch_dam,
            {"halved": 1},
            {"rock": None},
            "`divisions.halved` halves layers of `rock`, and",
        ),
        (
            arch_dam,
            {"rock": 4, "halved": 5},
            {},
            "`divisions.halved` is 5, and no .* than 4; give at most 4",
        ),
        (gravity_dam, {"depth": 2, "banks": 3, "halved": 4}, {}, "is 4, and no .* than 3; give at most 3"),
        (arch_dam, {"rock": 7, "halved": 1, "growth": 4.0}, {}, "nearer to 1, or leave `halved` out"),
    ],
)
def test_layers_that_cannot_be_halved_are_refused(dam, divisions, rock, said, tmp_path):
    raw = dam(divisions={"along": 1, "through": 2, "up": 4} | divisions, **rock)
    with pytest.raises(ConfigError, match=said):
        build_scene(parse_config(raw | REST, "job"), tmp_path, "job")
