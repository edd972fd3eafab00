"""Mesh files: those written by Gmsh, round trips through meshio and meshlane, and every wrong file."""

import os
import subprocess
import sys
from ast import literal_eval
from pathlib import Path

import meshio
import numpy as np
import pytest
from test_elements import CONCRETE, mesh

from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.core.errors import ConfigError, MeshError
from romdam.fem.assembly import assemble
from romdam.geometry.elements import ELEMENTS, SOLIDS, facet_element
from romdam.geometry.facets import facet_areas, facet_normals
from romdam.geometry.meshes.files import MeshFiles, read_mesh_file
from romdam.geometry.meshes.kinds import MIXED, facets_by_kind, kinds_of

DATA = Path(__file__).parent / "data"
PLACE = "s.yaml: blocks.b.mesh"
VOLUMES = {"lower": 3.0, "upper": 5.0}


def read(file, folder=DATA, group=None, unit="m"):
    config = MeshFileConfig(file=file, group=group, unit=unit)
    return MeshFiles(Path(folder)).block("b", config, CONCRETE, PLACE)


def remarks_of(file, folder=DATA, **keys):
    """What is told of a file that a block is read from."""
    files = MeshFiles(Path(folder))
    files.block("b", MeshFileConfig(file=file, **keys), CONCRETE, PLACE)
    return "\n".join(files.remarks)


def error_of(file, folder, **keys):
    with pytest.raises((MeshError, ConfigError)) as caught:
        read(file, folder, **keys)
    return str(caught.value)


def off_middle(block):
    """Largest distance of a node from the middle of its corners: 0 only in the right order."""
    distance = [0.0]
    for element, _, cells in kinds_of(block.element, block.cells):
        for k, corners in enumerate(element.middles, start=element.corners):
            around = block.points[cells[:, list(corners)]]
            distance.append(float(np.abs(block.points[cells[:, k]] - around.mean(axis=1)).max()))
    return max(distance)


def written_by_gmsh(name, ending):
    """Whether Gmsh has the element in the format; it writes CPYRAM of 13 nodes in its own order."""
    if ending.endswith(".bdf"):
        return name not in ("hex27", "pyramid13", "mixed20")
    return name.startswith(("hex", "tet", "wedge")) and (ending, name) != (".unv", "hex27")


BY_GMSH = [
    (name, ending)
    for name in (*SOLIDS, *MIXED)
    for ending in (
        ".msh",
        "_binary.msh",
        "_22.msh",
        "_22_binary.msh",
        ".bdf",
        "_free.bdf",
        "_large.bdf",
        ".inp",
        ".med",
        ".unv",
    )
    if ending.endswith((".msh", ".med")) or written_by_gmsh(name, ending)
]


MED = ("hex8", "tet10", "wedge6")  # by default; a file of MED takes longer than all others


@pytest.mark.parametrize(
    ("element", "ending"),
    [
        pytest.param(name, ending, marks=[pytest.mark.slow] * (ending == ".med" and name not in MED))
        for name, ending in BY_GMSH
    ],
)
def test_files_written_by_gmsh(element, ending):
    numbers = {"lower": 11, "upper": 12}
    for name, volume in VOLUMES.items():
        block = read(f"{element}{ending}", group=numbers[name] if ending.endswith("bdf") else name)
        _, M = assemble(block)
        assert block.element == element
        assert off_middle(block) < 1e-12
        assert M.sum() / 3 == pytest.approx(CONCRETE.rho * volume, rel=1e-12)
    base = read(f"{element}{ending}", group=numbers["lower"] if ending.endswith("bdf") else "lower").faces
    facets = base["21" if ending.endswith("bdf") else "base"]
    lower = read(f"{element}{ending}", group=11 if ending.endswith("bdf") else "lower")
    assert facet_areas(lower.points, facets).sum() == pytest.approx(2.0, rel=1e-12)
    assert np.abs(facet_normals(lower.points, facets) - [0, 0, -1]).max() < 1e-12
    assert "crest" not in base and "22" not in base


def test_bytes_of_gmsh_end_without_a_new_line(tmp_path):
    """Gmsh reads such files, and other programs write them."""
    data = (DATA / "hex8_22_binary.msh").read_bytes()
    assert data.count(b"\n$End") == 4
    for section in (b"MeshFormat", b"Nodes", b"Elements"):
        data = data.replace(b"\n$End" + section, b"$End" + section)
    (tmp_path / "m.msh").write_bytes(data)
    block, same = read("m.msh", tmp_path), read("hex8_22_binary.msh")
    assert np.array_equal(block.points, same.points) and np.array_equal(block.cells, same.cells)


def test_gmsh_groups_by_number_and_name_are_one():
    by_name, by_number = read("hex8.msh", group="upper"), read("hex8.msh", group=12)
    assert np.array_equal(by_name.cells, by_number.cells)
    assert len(read("hex8.msh").cells) == 2


def test_length_unit():
    metres, millimetres = read("tet10.msh"), read("tet10.msh", unit="mm")
    assert np.allclose(millimetres.points, 1e-3 * metres.points, rtol=1e-15)
    with pytest.raises(ValueError, match="'1 kg' is not a quantity in m"):
        read("tet10.msh", unit="kg")


IN_MESHIO = [name for name in SOLIDS if name not in ("wedge15", "pyramid13")]


def written(tmp_path, element, ending, kind=None, **keys):
    """A distorted box written by meshio with its top face as facets, and the block it came from."""
    block = mesh(element, size=(1.0, 1.0, 1.0))
    rng = np.random.default_rng(6)
    points = (
        1.0 + block.points + 0.02 * rng.uniform(-1, 1, block.points.shape)
    )  # meshio's bdf writer needs > 0
    top = block.faces["zmax"]
    ((_, own, _),) = facets_by_kind(top)
    cells = [(SOLIDS[element].cell.name, block.cells), (facet_element(own).cell.name, own)]
    data = [np.full(len(block.cells), 7), np.full(len(top), 8)]
    meshio.Mesh(points, cells, cell_data={keys.pop("name"): data} if "name" in keys else None, **keys).write(
        tmp_path / f"m{ending}", **({"file_format": kind} if kind else {})
    )
    return points, block, top


@pytest.mark.parametrize("element", IN_MESHIO)
@pytest.mark.parametrize(
    ("ending", "kind", "name"),
    [(".bdf", "nastran", "nastran:ref"), (".nas", "nastran", "nastran:ref"), (".vtu", "vtu", "group")],
)
def test_round_trip(ending, kind, name, element, tmp_path):
    if kind == "nastran" and not SOLIDS[element].cell.nastran:
        pytest.skip("the format has no such element")
    points, block, top = written(tmp_path, element, ending, kind, name=name)
    found = read(f"m{ending}", tmp_path, group=7)
    digits = 1e-10 if kind == "nastran" else 1e-15  # 16-character fields
    same = np.sort if element == "wedge6" else np.asarray  # meshio turns them for VTK
    assert np.array_equal(same(found.cells), same(block.cells))
    assert np.abs(found.points - points).max() < digits
    assert set(map(tuple, found.faces["8"])) == set(map(tuple, top))
    assert set(found.faces) == {"8"}


@pytest.mark.parametrize("kind", ["gmsh22", "gmsh"])
@pytest.mark.parametrize("element", IN_MESHIO)
def test_round_trip_gmsh(kind, element, tmp_path):
    block = mesh(element)
    tags = {
        "gmsh:physical": [np.full(len(block.cells), 3)],
        "gmsh:geometrical": [np.full(len(block.cells), 1)],
    }
    out = meshio.Mesh(block.points, [(SOLIDS[element].cell.name, block.cells)], cell_data=tags)
    out.field_data = {"dam": np.array([3, 3])}
    out.write(tmp_path / "m.msh", file_format=kind)
    found = read("m.msh", tmp_path, group="dam" if kind == "gmsh22" else None)
    assert np.array_equal(found.cells, block.cells)
    assert np.abs(found.points - block.points).max() < 1e-15


@pytest.mark.parametrize("element", ["hex8", "hex20", "tet4", "tet10", "wedge6"])  # that meshio can write
def test_round_trip_abaqus(element, tmp_path):
    block = mesh(element)
    half = np.arange(len(block.cells) // 2)
    out = meshio.Mesh(block.points, [(SOLIDS[element].cell.name, block.cells)], cell_sets={"half": [half]})
    out.point_sets = {"top": np.unique(block.faces["zmax"])}
    out.write(tmp_path / "m.inp")
    found = read("m.inp", tmp_path)
    assert np.array_equal(found.cells, block.cells)
    assert set(map(tuple, found.faces["top"])) == set(map(tuple, block.faces["zmax"]))
    assert len(read("m.inp", tmp_path, group="half").cells) == len(half)


INP = """*HEADING
two cubes
*NODE
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
9,0,0,2
10,1,0,2
11,1,1,2
12,0,1,2
*ELEMENT, TYPE=T3D2
50, 1, 9
*ELEMENT, type=C3D8R, ELSET=low
1, 1,2,3,4,
5,6,7,8
*Element, TYPE=C3D8
2, 5,6,7,8,9,10,11,12
*ELSET, ELSET=high, GENERATE
2, 2, 1
*ELSET, ELSET=both
low, high
*NSET, NSET=foot
1, 2, 3, 4
*SURFACE, NAME=lid, TYPE=ELEMENT
high, S2
*SURFACE, NAME=upstream
1, S3
2, S3
"""


def test_abaqus_sets_and_surfaces(tmp_path):
    (tmp_path / "a.inp").write_text(INP)
    both = read("a.inp", tmp_path, group="both")
    assert len(both.cells) == 2 and len(both.points) == 12
    areas = {name: facet_areas(both.points, f).sum() for name, f in both.faces.items()}
    assert areas == pytest.approx({"foot": 1.0, "lid": 1.0, "upstream": 2.0})
    assert np.abs(facet_normals(both.points, both.faces["upstream"]) - [0, -1, 0]).max() < 1e-12
    low = read("a.inp", tmp_path, group="low")
    assert low.points[:, 2].max() == 1.0 and set(low.faces) == {"foot", "upstream"}
    assert read("a.inp", tmp_path, group="high").points[:, 2].min() == 1.0


@pytest.mark.parametrize("coding", ["utf-8", "utf-8-sig", "latin-1"])
@pytest.mark.parametrize("ending", [".inp", ".cdb", ".unv"])
def test_names_of_groups_are_read_in_utf_8_or_latin_1(coding, ending, tmp_path):
    text = INP.replace("low", "Flügel") if ending == ".inp" else (DATA / f"hex8{ending}").read_text()
    (tmp_path / f"a{ending}").write_text(text.replace("lower", "Flügel"), encoding=coding)
    block = read(f"a{ending}", tmp_path, group="Flügel")
    assert block.points[:, 2].max() < read(f"a{ending}", tmp_path).points[:, 2].max()


def groups_elsewhere(path, **environment):
    """Names of the groups of an Abaqus file as another process reads it."""
    code = (
        "from pathlib import Path; from romdam.geometry.meshes.formats.abaqus import read_abaqus; "
        f"print(ascii([*read_abaqus(Path({str(path)!r}), 'a').groups]))"
    )
    done = subprocess.run([sys.executable, "-c", code], env=os.environ | environment, capture_output=True)
    assert done.stderr == b""
    return literal_eval(done.stdout.decode())


def test_names_of_groups_do_not_follow_the_locale(tmp_path):
    (tmp_path / "a.inp").write_text(INP.replace("low", "Flügel"), encoding="utf-8")
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    assert "Flügel" in groups_elsewhere(tmp_path / "a.inp", **plain)


ASSEMBLY = """*PART, NAME=cube
*NODE
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=all
1, 1,2,3,4,
5,6,7,8
*NSET, NSET=low, GENERATE
1, 4, 1
*SURFACE, NAME=lid
all, S2
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=one, PART=cube
*END INSTANCE
*INSTANCE, NAME=two, PART=Cube
0., 0., 3.
1., 0., 3., 1., 2., 3., 90.
*END INSTANCE
*ELSET, ELSET=second, INSTANCE=two
1,
*NSET, NSET=feet
one.low, two.1
*SURFACE, NAME=roof
two.all, S2
*END ASSEMBLY
"""


def test_abaqus_instances_stand_in_their_places(tmp_path):
    """The second is lifted by 3 m, then turned by 90 degrees about y through (1, 0, 3): x - 1 -> 3 - z."""
    (tmp_path / "a.inp").write_text(ASSEMBLY)
    both = read_mesh_file(tmp_path / "a.inp", PLACE)
    assert any("2 instances: numbers of the second are raised by 10" in remark for remark in both.remarks)
    one, two = (read("a.inp", tmp_path, group=name) for name in ("one", "two"))
    assert (
        np.abs(two.points - (one.points - [1, 0, 0]) @ [[0, 0, -1], [0, 1, 0], [1, 0, 0]] - [1, 0, 3]).max()
        < 1e-15
    )
    assert np.array_equal(read("a.inp", tmp_path, group="second").points, two.points)
    assert set(one.faces) == {"one.low", "one.lid", "feet"}
    assert set(two.faces) == {"two.low", "two.lid", "roof"}
    assert np.abs(facet_normals(two.points, two.faces["roof"]) - [1, 0, 0]).max() < 1e-15  # was z


@pytest.mark.parametrize("seed", ["0", "1"])  # they put ELSET and INSTANCE in either order
def test_abaqus_groups_stand_in_one_order(seed, tmp_path):
    (tmp_path / "a.inp").write_text(ASSEMBLY)
    found = groups_elsewhere(tmp_path / "a.inp", PYTHONHASHSEED=seed)
    assert found[:4] == ["one.all", "one", "two.all", "two"]


def test_abaqus_names_of_a_lone_instance_are_its_parts(tmp_path):
    text = ASSEMBLY.replace("*INSTANCE, NAME=one, PART=cube\n*END INSTANCE\n", "").replace(
        "one.low", "two.low"
    )
    (tmp_path / "a.inp").write_text(text)
    assert set(read("a.inp", tmp_path, group="second").faces) == {"low", "lid", "feet", "roof"}


def test_mesh_blocks_make_a_joint(make):
    """Two groups of one file that share nodes: romdam separates them and finds the joint."""
    raw = {
        "blocks": {
            name: {"material": "concrete", "mesh": {"file": "hex20.msh", "group": name}} for name in VOLUMES
        },
        "supports": [
            {"block": "lower", "face": "base"},
            {"block": "upper", "face": {"axis": "z", "at": 4.0}, "fix": ["z"]},
        ],
        "joints": {"c": {"between": ["lower", "upper"], "normal_stiffness": "rigid"}},
    }
    scene = make(raw, DATA)
    assert scene.joints["c"].area.sum() == pytest.approx(2.0, rel=1e-13)
    assert np.abs(scene.joints["c"].axes[:, 0] - [0, 0, 1]).max() < 1e-12
    assert scene.fixed["lower"].sum() == 24 and scene.fixed["upper"].sum() == 8


NODES = "*NODE\n" + "\n".join(f"{n + 1},{x},{y},{z}" for n, (x, y, z) in enumerate(ELEMENTS["hex8"].nodes))
BAD = {
    "missing.msh": (None, "s.yaml: blocks.b.mesh.file: no mesh file {path}; give its path relative to"),
    "m.obj": (
        "",
        "known endings are .msh, .bdf, .nas, .dat, .inp, .med, .unv, .mail, .cdb, .vtu",
    ),
    "m.msh": ("nonsense", "{path} cannot be read as a gmsh file ("),
    "empty.msh": ("", "{path} cannot be read as a gmsh file ("),
    "m.vtu": ("<VTKFile", "{path} cannot be read as a vtu file ("),
    "m.bdf": ("CHEXA,1,1,1,2,3,4,5,6,+\n+,7,8\n", "{path} has no nodes"),
    "old.vtu": ("# vtk DataFile Version 3.0\nx\nASCII\n", "it is VTK's older format"),
    "cut.bdf": ("GRID,1,,0.,0.,0.\nGRID,2,,0.,1", "it ends in a line without ENDDATA: it was cut"),
    "repeated.bdf": (
        "GRID,1,,0.,0.,0.\nDEFORM,4,1,.05\n=,=,7,=\nCTETRA,1,1,1,2,3,4\n=,*1,=,2,3,4,5\nENDDATA\n",
        "line 5 repeats CTETRA by '=', which is not followed; write every entry out",
    ),
    "stray.bdf": ("+A,7,8\nGRID,1,,0.,0.,0.\nENDDATA\n", "line 1 continues nothing: no entry awaits '+A'"),
    "twice.bdf": ("+A,7,8\n+A,7,8\nGRID,1,,0.,0.,0.\nENDDATA\n", "line 2 and line 1 both continue '+A'"),
    "m.inp": ("*HEADING\n", "{path} cannot be read as an abaqus file (no *NODE block)"),
    "flat.inp": (
        NODES + "\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,8,7\n",
        "{path}: element 0 of block 'b' (hex8, counted from 0, around (0, 0, 0)) has a Jacobian determinant "
        "of -1 m3, limit above 0 (1 such elements here): its nodes are in the wrong order or it is turned "
        "inside out; repair the mesh",
    ),
    "unknown.inp": (
        NODES + "\n*ELEMENT, TYPE=C3D13\n1,1,2,3,5,6,7\n",
        "{path}: has solids that are not read (1 C3D13); repair the file, or name a group without them",
    ),
    "mixed.inp": (
        NODES + "\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n*ELEMENT, TYPE=C3D10\n2,1,2,4,5,1,2,3,4,5,6\n",
        "names a node twice",
    ),
    "hanging.inp": (
        NODES + "\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n*ELEMENT, TYPE=C3D4\n2,1,2,4,5\n",
        "faces of elements of block 'b' have an element across them that does not share them",
    ),
    "twice.inp": (
        NODES + "\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n2,1,2,3,4,5,6,7,8\n",
        "1 of 2 elements of block 'b' occur twice, limit 0; remove duplicates, or select one `group`",
    ),
    "parts.inp": (NODES + "\n" + NODES, "{path} has no solid elements in this block; supported are"),
    "lost.inp": (
        NODES + "\n*ELEMENT, TYPE=C3D4\n1,1,2,4,99\n",
        "{path}: element 1 (tetra) uses node 99, which is not given (1 such elements, limit 0); repair the "
        "file, or name a group without them",
    ),
    "short.inp": (NODES + "\n*ELEMENT, TYPE=C3D4\n1,1,2,4\n", "element 1 has 3 nodes, expected 4"),
    "word.inp": (NODES + "\n*ELEMENT, TYPE=C3D4\n1,1,2,4,x\n", "holds 'x', expected whole numbers"),
    "include.inp": ("*INCLUDE, INPUT=other.inp\n", "there is no such file beside include.inp"),
    "nopart.inp": ("*INSTANCE, NAME=P-1, PART=P\n1., 0., 0.\n", "*INSTANCE P-1 is of part 'P', which is not"),
    "shells.inp": (
        NODES + "\n*ELEMENT, TYPE=S4\n1,1,2,3,4\n2,5,6,7,8\n",
        "has no solid elements in this block",
    ),
    "large.nas": (
        "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n"
        "CTETRA,1,1,1,2,3,4\nCTETRA* 2               1               1               2\n*       3\nENDDATA\n",
        "line 6: CTETRA 2 has 3 nodes, expected 4 or 10; a continuation line is missing",
    ),
    "system.nas": (
        "GRID,1,5,0.,0.,0.\nGRID,2,5,1.,0.,0.\nGRID,3,5,0.,1.,0.\nGRID,4,5,0.,0.,1.\nCTETRA,1,1,1,2,3,4\nENDDATA\n",
        "coordinate system 5 is not given as CORD2R, CORD2C or CORD2S; export with basic coordinates",
    ),
}


@pytest.mark.parametrize("option", ["INPUT", "file"])
def test_abaqus_files_are_included(option, tmp_path):
    (tmp_path / "nodes.txt").write_text(NODES + "\n")
    (tmp_path / "m.inp").write_text(f"*INCLUDE, {option}=nodes.txt\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n")
    (tmp_path / "whole.inp").write_text(NODES + "\n*ELEMENT, TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n")
    block, whole = read("m.inp", tmp_path), read("whole.inp", tmp_path)
    assert np.array_equal(block.points[block.cells], whole.points[whole.cells]) and len(block.cells) == 1


@pytest.mark.parametrize("name", BAD)
def test_wrong_file(name, tmp_path):
    text, message = BAD[name]
    if text is not None:
        (tmp_path / name).write_text(text)
    error = error_of(name, tmp_path)
    assert error.startswith(PLACE)
    assert message.format(path=tmp_path / name) in error


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 0, 2), (1, 2, 0)])
@pytest.mark.parametrize("end", ["ENDDATA\n", ""])
def test_nastran_lines_are_continued_by_markers_wherever_they_stand(order, end, tmp_path):
    """A hexahedron of 20 nodes over three lines, in any order among the grid points."""
    points = mesh("hex20").points[mesh("hex20").cells[0]]
    grids = [f"GRID,{k},,{x:g},{y:g},{z:g}" for k, (x, y, z) in enumerate(points, 1)]
    nodes = np.arange(1, 21)
    nodes[[*range(12, 16), *range(16, 20)]] = nodes[[*range(16, 20), *range(12, 16)]]  # verticals first
    lines = [
        "CHEXA,1,1," + ",".join(map(str, nodes[:6])) + ",+A",
        "+A," + ",".join(map(str, nodes[6:14])) + ",+B",
        "+B," + ",".join(map(str, nodes[14:])),
    ]
    text = "\n".join([lines[order[0]], *grids[:10], lines[order[1]], *grids[10:], lines[order[2]], end])
    (tmp_path / "m.bdf").write_text(text)
    file = read_mesh_file(tmp_path / "m.bdf", PLACE)
    assert np.asarray(file.tags)[file.cells[0].nodes].tolist() == [list(range(1, 21))]
    assert ("no ENDDATA" in " ".join(file.remarks)) == (not end)


def writer(element):
    """The library that has the element: meshio, or meshlane where that does not."""
    return meshio if element in IN_MESHIO else pytest.importorskip("meshlane")


def swaps():
    """(element, two of its nodes) next to each other in the order and of one kind, and of two kinds."""
    for name, element in SOLIDS.items():
        last = element.corners + len(element.edges) - 1
        if element.quadratic:
            yield name, (last - 1, last), 0.5
        for node in range(last + 1, len(element.nodes) - 1):
            yield name, (node, node + 1), 0.25


@pytest.mark.parametrize(("element", "nodes", "limit"), list(swaps()))
def test_node_order_of_another_format(element, nodes, limit, tmp_path):
    """Two nodes swapped, such as the last mid-edge nodes, between Gmsh and VTK for 10-node tetrahedra."""
    block = mesh(element)
    swapped = block.cells.copy()
    swapped[:, nodes] = swapped[:, nodes[::-1]]
    writer(element).Mesh(block.points, [(SOLIDS[element].cell.name, swapped)]).write(tmp_path / "m.vtu")
    error = error_of("m.vtu", tmp_path)
    assert f"of block 'b' ({element}, both counted from 0) is" in error
    assert f"limit {limit:g}: the file's node order is not that of its format; export the mesh anew" in error


def test_nastran_has_no_hexahedron_of_27_nodes(tmp_path):
    grids = [f"GRID,{k + 1},,{x},{y},{z}" for k, (x, y, z) in enumerate(ELEMENTS["hex27"].nodes)]
    words = ["CHEXA", "1", "1", *map(str, range(1, 28))]
    lines = [",".join(words[:9]), *("," + ",".join(words[k : k + 8]) for k in (9, 17, 25))]
    (tmp_path / "m.bdf").write_text("\n".join([*grids, *lines, "ENDDATA", ""]))
    assert "CHEXA 1 has 27 nodes, expected 8 or 20" in error_of("m.bdf", tmp_path)


def test_missing_group():
    assert error_of("hex8.msh", DATA, group="dam") == (
        f"{PLACE}.group: group 'dam' does not exist in {DATA / 'hex8.msh'}; "
        "groups of solid elements are lower, upper"
    )
    assert "group 'base' holds no solid elements" in error_of("hex8.msh", DATA, group="base")


@pytest.mark.parametrize(
    ("element", "types"), [("tet4", (10, 71)), ("tet10", (24, 71)), ("hex8", (12, 72)), ("wedge6", (13, 73))]
)
def test_vtu_of_lagrange_cells(element, types, tmp_path):
    """As FEniCSx writes them; with few nodes they are VTK's other cells (vtkCellType.h, 71 to 73)."""
    block = mesh(element)
    content = meshio.Mesh(block.points, [(SOLIDS[element].cell.name, block.cells)])
    content.write(tmp_path / "m.vtu", file_format="vtu", binary=False)
    text = (tmp_path / "m.vtu").read_text()
    head, mark, tail = text.partition('Name="types"')
    numbers, end, rest = tail.partition("</DataArray>")
    assert numbers.count(str(types[0])) == len(block.cells)
    (tmp_path / "m.vtu").write_text(head + mark + numbers.replace(*map(str, types)) + end + rest)
    same = read("m.vtu", tmp_path)
    assert same.element == element and np.allclose(same.points[same.cells], block.points[block.cells])


def test_vtu_with_several_integer_arrays(tmp_path):
    block = mesh("tet4")
    number = np.arange(len(block.cells))
    data = {"ids": [number], "kind": [7 + number % 2]}
    meshio.Mesh(block.points, [("tetra", block.cells)], cell_data=data).write(tmp_path / "m.vtu")
    file = read_mesh_file(tmp_path / "m.vtu", PLACE)
    assert list(file.groups)[-2:] == ["kind:7", "kind:8"] and len(file.groups) == len(number) + 2
    assert file.groups["kind:8"][0].tolist() == number[1::2].tolist()
    assert file.groups["ids:3"][0].tolist() == [3]
    assert "none of them named group or region or material: groups are called as ids:0" in file.remarks[-1]
    assert "group 7 does not exist" in error_of("m.vtu", tmp_path, group=7)


def test_vtu_array_that_numbers_the_cells_makes_no_groups_beside_others(tmp_path, monkeypatch):
    monkeypatch.setattr("romdam.geometry.meshes.formats.vtu._MOST", 3)
    block = mesh("tet4")
    number = np.arange(len(block.cells))
    data = {"ids": [number], "kind": [7 + number % 2]}
    meshio.Mesh(block.points, [("tetra", block.cells)], cell_data=data).write(tmp_path / "m.vtu")
    file = read_mesh_file(tmp_path / "m.vtu", PLACE)
    assert list(file.groups) == ["kind:7", "kind:8"]
    assert "ids with more than 3 values each make no groups" in file.remarks[-1]


def test_vtu_numbers_may_be_padded(tmp_path):
    block = mesh("tet4")
    meshio.Mesh(block.points, [("tetra", block.cells)]).write(tmp_path / "m.vtu")
    text = (tmp_path / "m.vtu").read_bytes()
    padded = text.replace(b'NumberOfPoints="', b'NumberOfPoints="   ').replace(b'Cells="', b'Cells=" ')
    assert padded != text
    (tmp_path / "padded.vtu").write_bytes(padded)
    plain, other = (read_mesh_file(tmp_path / name, PLACE) for name in ("m.vtu", "padded.vtu"))
    np.testing.assert_array_equal(plain.cells[0].nodes, other.cells[0].nodes)


def test_vtu_group_0_is_a_group(tmp_path):
    block = mesh("tet4")
    group = [np.arange(len(block.cells)) % 2]
    meshio.Mesh(block.points, [("tetra", block.cells)], cell_data={"group": group}).write(tmp_path / "m.vtu")
    assert "groups of solid elements are 0, 1" in error_of("m.vtu", tmp_path, group=2)
    groups = read_mesh_file(tmp_path / "m.vtu", PLACE).groups
    assert [len(groups[g][0]) for g in "01"] == [len(block.cells) // 2] * 2
