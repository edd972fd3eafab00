"""Every mesh format against an independent reader or writer: volumes, groups, frequencies; and wrong files.

The boxes of `data` as Gmsh wrote them in every format that it has; as meshlane writes them for ANSYS and MED;
and in code_aster's .mail with the tables of elements of its manual (U3.01.00), written here.
"""

import shutil

import h5py
import numpy as np
import pytest
from scipy.linalg import eigh
from test_elements import CONCRETE
from test_mesh_files import BY_GMSH, DATA, VOLUMES, error_of, off_middle, read, remarks_of

from romdam.core.scene import Block
from romdam.fem.assembly import assemble
from romdam.geometry.cells import COLLAPSED
from romdam.geometry.elements import SOLIDS
from romdam.geometry.facets import facet_areas
from romdam.geometry.meshes.files import read_mesh_file
from romdam.geometry.meshes.kinds import MIXED, mixed_cells

meshlane = pytest.importorskip("meshlane")
PLACE = "s.yaml: blocks.b.mesh.file"
EVERY = [*SOLIDS, *MIXED]
ASTER = {  # edges and faces in whose middle the nodes stand, from 1 on, U3.01.00
    "hexahedron": ("HEXA8", ""),
    "hexahedron20": ("HEXA20", "12 23 34 41 15 26 37 48 56 67 78 85"),
    "hexahedron27": ("HEXA27", "12 23 34 41 15 26 37 48 56 67 78 85 1234 1265 2376 3487 4158 5678 12345678"),
    "tetra": ("TETRA4", ""),
    "tetra10": ("TETRA10", "12 23 31 14 24 34"),
    "wedge": ("PENTA6", ""),
    "wedge15": ("PENTA15", "12 23 31 14 25 36 45 56 64"),
    "pyramid": ("PYRAM5", ""),
    "pyramid13": ("PYRAM13", "12 23 34 41 15 25 35 45"),
    "triangle": ("TRIA3", ""),
    "triangle6": ("TRIA6", "12 23 31"),
    "quad": ("QUAD4", ""),
    "quad8": ("QUAD8", "12 23 34 41"),
    "quad9": ("QUAD9", "12 23 34 41 1234"),
}


def theirs(name):
    """Points, cells by kind and groups as meshlane reads Gmsh's file."""
    mesh = meshlane.read(DATA / f"{name}.msh")
    names = {int(tag): label for label, (tag, _) in mesh.field_data.items()}
    cells, groups = {}, {}
    for block, tags in zip(mesh.cells, mesh.cell_data["gmsh:physical"], strict=True):
        rows = cells.setdefault(block.type, [])
        for row, tag in zip(block.data, tags, strict=True):
            groups.setdefault(names[int(tag)], []).append((block.type, len(rows)))
            rows.append(row)
    return mesh.points, {kind: np.array(rows) for kind, rows in cells.items()}, groups


def native(name):
    """The block made of what meshlane reads."""
    points, cells, _ = theirs(name)
    solid = {kind: rows for kind, rows in cells.items() if kind in {e.cell.name for e in SOLIDS.values()}}
    table = mixed_cells(solid)[1] if name in MIXED else solid[SOLIDS[name].cell.name]
    return Block("b", name, points, table, CONCRETE, {})


def frequencies(block):
    """The ten lowest [Hz], the base held."""
    K, M = (A.toarray() for A in assemble(block))
    free = np.repeat(block.points[:, 2] > 0.0, 3)
    values = eigh(K[free][:, free], M[free][:, free], eigvals_only=True, subset_by_index=[0, 9])
    return np.sqrt(values) / (2 * np.pi)


@pytest.mark.parametrize(("name", "ending"), BY_GMSH)
def test_frequencies_are_those_of_the_native_mesh(name, ending):
    found = frequencies(read(f"{name}{ending}"))
    assert np.abs(found / frequencies(native(name)) - 1.0).max() < 1e-10


def check(path, name):
    for label, volume in VOLUMES.items():
        block = read(path.name, path.parent, group=label)
        assert block.element == name and off_middle(block) < 1e-12
        assert assemble(block)[1].sum() / 3 == pytest.approx(CONCRETE.rho * volume, rel=1e-12)
        face = {"lower": "base", "upper": "crest"}[label]
        assert set(block.faces) == {face}
        assert facet_areas(block.points, block.faces[face]).sum() == pytest.approx(2.0, rel=1e-12)
    found = frequencies(read(path.name, path.parent))
    assert np.abs(found / frequencies(native(name)) - 1.0).max() < 1e-10


@pytest.mark.parametrize("ending", [".cdb", ".med"])
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in ("hex20", "tet10", "wedge6", "mixed8")))
        for name in EVERY
        if name != "hex27"
    ],
)
def test_files_written_by_meshlane(name, ending, tmp_path):
    points, cells, groups = theirs(name)
    sets = {
        label: [np.array([k for kind, k in own if kind == one], dtype=int) for one in cells]
        for label, own in groups.items()
    }
    data = {}
    if ending == ".med":
        tags = {label: -1 - k for k, label in enumerate(sets)}
        data["cell_tags"] = [np.zeros(len(rows), dtype=int) for rows in cells.values()]
        for label, own in sets.items():
            for k, members in enumerate(own):
                data["cell_tags"][k][members] = tags[label]
    mesh = meshlane.Mesh(points, list(cells.items()), cell_data=data, cell_sets=None if data else sets)
    if data:
        mesh.cell_tags = {tag: [label] for label, tag in tags.items()}
    mesh.write(tmp_path / f"m{ending}", file_format="med" if data else "ansysInp")
    check(tmp_path / f"m{ending}", name)


@pytest.mark.parametrize("name", [name for name in EVERY if not name.startswith("hex")])
def test_ansys_has_collapsed_hexahedra(name, tmp_path):
    """Of SOLID185, SOLID186 and SURF154; meshlane, which wrote the file, finds in it what they are."""
    points, cells, groups = theirs(name)
    whole = {kind: key for key, kinds in COLLAPSED.items() for kind in kinds}
    tables = [
        (list(COLLAPSED[whole[kind]])[-1], rows[:, COLLAPSED[whole[kind]][kind]])
        for kind, rows in cells.items()
    ]
    sets = {
        label: [np.array([k for kind, k in own if kind == one], dtype=int) for one in cells]
        for label, own in groups.items()
    }
    meshlane.Mesh(points, tables, cell_sets=sets).write(tmp_path / "m.cdb", file_format="ansysInp")
    again = meshlane.read(tmp_path / "m.cdb", file_format="ansysInp")
    assert {block.type: block.data.tolist() for block in again.cells} == {
        k: v.tolist() for k, v in cells.items()
    }
    check(tmp_path / "m.cdb", name)


def mail(name):
    points, cells, groups = theirs(name)
    lines = ["TITRE", "two boxes % of Gmsh", "FINSF", "COOR_3D"]
    lines += [f"N{k} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(points.tolist())] + ["FINSF"]
    for kind, rows in cells.items():
        keyword, middles = ASTER[kind]
        corners = rows.shape[1] - len(middles.split())
        at = points[rows]
        lines.append(keyword)
        for k, row in enumerate(rows):
            order = list(range(corners))
            for middle in middles.split():
                place = at[k, [int(c) - 1 for c in middle]].mean(axis=0)
                order.append(int(np.argmin(np.linalg.norm(at[k] - place, axis=1))))
            lines.append(" ".join([f"{kind}{k}", *(f"N{row[c]}" for c in order)]))
        lines.append("FINSF")
    for label, own in groups.items():
        lines += [f"GROUP_MA   NOM={label}", *(f"{kind}{k}" for kind, k in own), "FINSF"]
    lines += ["GROUP_NO", "feet", *(f"N{k}" for k in np.flatnonzero(points[:, 2] == 0.0)), "FINSF", "FIN", ""]
    return "\n".join(lines)


@pytest.mark.parametrize("name", EVERY)
def test_mail_of_code_aster(name, tmp_path):
    (tmp_path / "m.mail").write_text(
        mail(name).replace("GROUP_NO\nfeet\n", "GROUP_NO\nnowhere\nFINSF\nGROUP_NO\nfeet\n")
    )
    found = read_mesh_file(tmp_path / "m.mail", PLACE)
    assert (found.points[found.node_sets["feet"], 2] == 0.0).all()
    (tmp_path / "m.mail").write_text(mail(name).replace("GROUP_NO\nfeet\n", "GROUP_NO\nbase\n"))
    check(tmp_path / "m.mail", name)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in ("hex20", "tet10", "wedge15")))
        for name in EVERY
    ],
)
def test_med_of_the_other_byte_order_is_the_same(name, tmp_path):
    """HDF5 tells the order of bytes; what is read has this machine's."""
    shutil.copy(DATA / f"{name}.med", tmp_path / "m.med")
    with h5py.File(tmp_path / "m.med", "r+") as file:
        sets = []
        file.visititems(lambda path, item: sets.append(path) if isinstance(item, h5py.Dataset) else None)
        for path in (p for p in sets if file[p].dtype.kind in "if" and file[p].dtype.shape == ()):
            values, attributes = file[path][:], dict(file[path].attrs)
            del file[path]
            file.create_dataset(path, data=values.astype(values.dtype.newbyteorder(">"))).attrs.update(
                attributes
            )
    check(tmp_path / "m.med", name)


def test_med_elements_that_are_inside_out_are_turned(tmp_path):
    """VTK's order in a MED file, as meshio 5.3 writes it."""
    shutil.copy(DATA / "mixed20.med", tmp_path / "m.med")
    with h5py.File(tmp_path / "m.med", "r+") as file:
        step = next(iter(file["ENS_MAA/mixed20"].values()))
        table = step["MAI/P15/NOD"][:].reshape(15, -1)
        step["MAI/P15/NOD"][:] = table[[0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13]].ravel()
    check(tmp_path / "m.med", "mixed20")
    assert (
        "4 of 4 wedge15 are inside out in the order of nodes that the format has, and have been turned"
        in remarks_of("m.med", tmp_path)
    )


@pytest.mark.parametrize("facets", ["apart", "families apart"])
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in ("hex20", "tet10", "wedge6", "pyramid5")))
        for name in EVERY
    ],
)
def test_med_of_version_2(name, facets, tmp_path):
    """It has no time steps, its families in the mesh, facets apart, and the dimension of space as DIM.

    Of facets the families alone may be apart, in FAC, and their nodes with the solids', in MAI.
    """
    shutil.copy(DATA / f"{name}.med", tmp_path / "m.med")
    with h5py.File(tmp_path / "m.med", "r+") as file:
        ((label, mesh),) = file["ENS_MAA"].items()
        (step,) = mesh
        for part in mesh[step]:
            mesh.move(f"{step}/{part}", part)
        del mesh[step]
        file.move(f"FAS/{label}", f"ENS_MAA/{label}/FAS")
        mesh.create_group("FAC")
        for kind in [kind for kind in mesh["MAI"] if kind.startswith(("TR", "QU"))]:
            mesh.move(f"MAI/{kind}", f"FAC/{kind}")
            if facets == "families apart":
                mesh.move(f"FAC/{kind}/NOD", f"MAI/{kind}/NOD")
        del mesh.attrs["ESP"]
        mesh.attrs["DIM"] = 3
    check(tmp_path / "m.med", name)


def test_med_of_several_meshes_one_of_which_is_of_space(tmp_path):
    shutil.copy(DATA / "hex8.med", tmp_path / "m.med")
    with h5py.File(tmp_path / "m.med", "r+") as file:
        file.copy("ENS_MAA/hex8", "ENS_MAA/plan")
        file["ENS_MAA/plan"].attrs["ESP"] = 2
    check(tmp_path / "m.med", "hex8")
    assert "of its 2 meshes 'hex8' is read" in remarks_of("m.med", tmp_path)


@pytest.mark.slow
def test_med_of_several_meshes_one_of_which_has_solids(tmp_path):
    """The others may be of an interface, in x, y and z, of facets alone."""
    shutil.copy(DATA / "hex8.med", tmp_path / "m.med")
    with h5py.File(tmp_path / "m.med", "r+") as file:
        file.copy("ENS_MAA/hex8", "ENS_MAA/interface")
        file.copy("FAS/hex8", "FAS/interface")
        (step,) = file["ENS_MAA/interface"].values()
        del step["MAI/HE8"]
    check(tmp_path / "m.med", "hex8")
    assert "of its 2 meshes 'hex8' is read" in remarks_of("m.med", tmp_path)


def test_ansys_needs_no_mid_edge_nodes_of_edges_without_extent(tmp_path):
    """SOLID186 as a tetrahedron: K = L = S and M = N = O = P = T ... = X; some write 0 for unused nodes."""
    points, cells, _ = theirs("tet10")
    table = cells["tetra10"][:, COLLAPSED[3, 20]["tetra10"]] + 1
    table[:, [10, 12, 13, 14, 15]] = 0  # S, and those of the edges around the apex
    table[::2, 19] = 0  # AB, which is AA again
    lines = ["ET,1,186", f"NBLOCK,6,SOLID,{len(points)},{len(points)}", "(1i7,2i9,3e21.13)"]
    lines += [f"{k:7d}{0:9d}{0:9d}" + "".join(f"{x:21.13E}" for x in at) for k, at in enumerate(points, 1)]
    lines += ["N,R5.3,LOC,      -1,", f"EBLOCK,19,SOLID,{len(table)},{len(table)}", "(19i8)"]
    for number, nodes in enumerate(table, 1):
        row = [1, 1, 1, 1, 0, 0, 0, 0, 20, 0, number, *nodes]
        lines += ["".join(f"{n:8d}" for n in row[:19]), "".join(f"{n:8d}" for n in row[19:])]
    (tmp_path / "m.cdb").write_text("\n".join([*lines, f"{-1:8d}", ""]))
    block = read("m.cdb", tmp_path)
    assert block.element == "tet10" and off_middle(block) < 1e-12
    assert assemble(block)[1].sum() / 3 == pytest.approx(CONCRETE.rho * sum(VOLUMES.values()), rel=1e-12)
    (tmp_path / "m.cdb").write_text("\n".join(lines[:-2] + lines[-1:]))
    assert "cannot be read as an ANSYS file" in error_of("m.cdb", tmp_path)


def test_what_is_left_out_and_units_are_said(tmp_path):
    text = (DATA / "hex8.unv").read_text()
    units = "    -1\n   164\n         5SI: mm                  2\n  1.0D+03  1.0D+00  1.0D+00\n    -1\n"
    (tmp_path / "m.unv").write_text(units + text + "    -1\n  2420\n         1\n    -1\n")
    told = remarks_of("m.unv", tmp_path, unit="mm")
    assert "left out: 1 dataset 2420" in told
    assert "its dataset 164 says that a metre is 1000 of its lengths; they are read in `unit`" in told
    cdb = "/UNITS,MPA\nET,1,185\nET,2,174\nNBLOCK,6,SOLID,8,8\n(3i9,6e20.13)\n"
    cdb += "".join(
        f"{k + 1:9d}{0:9d}{0:9d}" + "".join(f"{x:20.13E}" for x in at) + "\n"
        for k, at in enumerate(
            [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        )
    )
    cdb += "N,R5.3,LOC,      -1,\nEBLOCK,19,SOLID,2,2\n(19i9)\n"
    for number, (kind, nodes) in enumerate([(1, range(1, 9)), (2, range(1, 5))], 1):
        row = [1, kind, 1, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes]
        cdb += "".join(f"{n:9d}" for n in row) + "\n"
    (tmp_path / "m.cdb").write_text(cdb + f"{-1:9d}\n")
    assert len(read("m.cdb", tmp_path, group=1).cells) == 1
    told = remarks_of("m.cdb", tmp_path, group=1)
    assert "elements that no block is made of are left out (1 of type 174 with 4 nodes)" in told
    assert "it says '/UNITS,MPA'; coordinates are read in `unit`" in told


def changed(path, name, edit):
    """A copy of a file of `data` with its text, or its HDF5, changed."""
    shutil.copy(DATA / name, path)
    if path.suffix == ".med":
        with h5py.File(path, "r+") as file:
            edit(file)
        return
    old, new = edit
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def without_family(file):
    del file["FAS/hex8/ELEME/F_3D_1"]


def of_two_meshes(file):
    file.copy("ENS_MAA/hex8", "ENS_MAA/other")


def of_short_nodes(file):
    step = next(iter(file["ENS_MAA/hex8"].values()))
    values, attributes = step["MAI/HE8/NOD"][:-1], dict(step["MAI/HE8/NOD"].attrs)
    del step["MAI/HE8/NOD"]
    step["MAI/HE8"].create_dataset("NOD", data=values).attrs.update(attributes)


def of_a_lost_node(file):
    next(iter(file["ENS_MAA/hex8"].values()))["MAI/HE8/NOD"][0] = 99


def in_millimetres(file):
    file["ENS_MAA/hex8"].attrs["UNI"] = np.bytes_("mm".ljust(16) * 3)


def without(*keys):
    """Lacks objects or attributes, by their paths below the mesh or its step."""

    def edit(file):
        mesh = file["ENS_MAA/hex8"]
        for key in keys:
            step = next(iter(mesh.values()), None)
            if key in mesh.attrs:
                del mesh.attrs[key]
            else:
                del step[key]

    return edit


def of_a_dimension(file):
    for key in ("DIM", "ESP"):
        file["ENS_MAA/hex8"].attrs[key] = 2


def of_no_mesh(file):
    del file["ENS_MAA/hex8"]


def of_families(file):
    step = next(iter(file["ENS_MAA/hex8"].values()))
    family = step["MAI/HE8/FAM"][:-1]
    del step["MAI/HE8/FAM"]
    step["MAI/HE8/FAM"] = family


def of_polyhedra(file):
    step = next(iter(file["ENS_MAA/hex8"].values()))
    step["MAI"].create_group("POE")["FAM"] = np.array([int(file["FAS/hex8/ELEME/F_3D_1"].attrs["NUM"])])


BROKEN = {
    "no meshes.med": ("hex8.med", of_no_mesh, "it is an HDF5 file without meshes, ENS_MAA"),
    "two dimensions.med": (
        "hex8.med",
        of_a_dimension,
        "it has no unstructured mesh in x, y and z: 'hex8' has 2 dimensions",
    ),
    "no dimension.med": ("hex8.med", without("DIM", "ESP"), "'hex8' does not state its dimension, DIM"),
    "no nodes.med": ("hex8.med", without("NOE"), "its mesh 'hex8' has no nodes, NOE"),
    "no positions.med": ("hex8.med", without("NOE/COO"), "its mesh 'hex8' has no coordinates of nodes, COO"),
    "no elements.med": ("hex8.med", without("MAI"), "its mesh 'hex8' has no elements, MAI"),
    "elements of no nodes.med": (
        "hex8.med",
        without("MAI/HE8/NOD"),
        "its elements of type HE8 name no nodes, NOD",
    ),
    "families.med": ("hex8.med", of_families, "it has 1 families of 2 elements of type HE8, in FAM"),
    "polyhedra.med": ("hex8.med", of_polyhedra, "has solids that are not read, elements of type POE (polyh"),
    "a family without groups.med": ("hex8.med", without_family, "family -3 is used and not given"),
    "two meshes.med": (
        "hex8.med",
        of_two_meshes,
        "it has 2 meshes of solids, hex8, other, limit one",
    ),
    "nodes cut.med": ("hex8.med", of_short_nodes, "has 15 nodes of 2 elements of 8"),
    "node lost.med": ("hex8.med", of_a_lost_node, "uses node 99, which is not given"),
    "no FIN.mail": ("hex8.mail", ("FIN\n", ""), "cannot be read as a .mail file"),
    "cut.mail": (
        "hex8.mail",
        ("FINSF\nGROUP_NO", "GROUP_NO"),
        "GROUP_MA of line 35 has no FINSF: the file was cut",
    ),
    "node twice.mail": ("hex8.mail", ("N1 ", "N0 "), "node 'N0' is given twice"),
    "word.mail": ("hex8.mail", ("HEXA8", "HEXE8"), "'HEXE8' is no section of the format"),
    "count.cdb": (
        "hex8.cdb",
        ("EBLOCK,19,SOLID,4,4", "EBLOCK,19,SOLID,5,5"),
        "EBLOCK holds 4, and says 5: the file was cut",
    ),
    "form.cdb": (
        "hex8.cdb",
        ("EBLOCK,19,SOLID", "EBLOCK,10"),
        "has solids that are not read (4 in a block that is not in the form SOLID)",
    ),
    "type.cdb": (
        "hex8.cdb",
        ("ET,1,", "ET,7,"),
        "has solids that are not read (2 of type 1, which ET does not give",
    ),
    "made.cdb": ("hex8.cdb", ("EBLOCK", "NGEN,2,100\nEBLOCK"), "NGEN makes or moves nodes and elements"),
    "format.cdb": ("hex8.cdb", ("(19i9)", "(19a9)"), "'(19a9)' is no format such as (19i9)"),
    "dataset.unv": ("hex8.unv", ("  2412", "   780"), "is not 8 whole numbers or more"),
    "marks.unv": ("hex8.unv", ("    -1\n", ""), "lines of -1, which open and close datasets: it was cut"),
    "word.unv": (
        "hex8.unv",
        ("1.0000000000000000D+00", "1.000000000x000000D+00"),
        "of the nodes is '1.000000000X000000E+00'",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_are_refused_with_file_and_reason(case, tmp_path):
    name, edit, message = BROKEN[case]
    changed(tmp_path / case, name, edit)
    error = error_of(case, tmp_path, group="upper" if "family" in case else None)
    assert error.startswith(f"{PLACE}: {tmp_path / case}") and "\n" not in error
    assert message in error


@pytest.mark.parametrize("ending", [".med", ".unv", ".mail", ".cdb"])
def test_every_cut_is_refused(ending, tmp_path):
    """No start of a file is read, but that which lacks nothing but what ends it."""
    data = (DATA / f"hex8{ending}").read_bytes()
    for share in (0.0, 0.1, 0.4, 0.7, 0.9, 0.97):
        (tmp_path / f"m{ending}").write_bytes(data[: int(share * len(data))])
        assert error_of(f"m{ending}", tmp_path, group="lower").startswith(f"{PLACE}: {tmp_path}")


def test_groups_that_are_not_there_or_have_no_solids():
    assert error_of("hex8.med", DATA, group="dam") == (
        f"s.yaml: blocks.b.mesh.group: group 'dam' does not exist in {DATA / 'hex8.med'}; groups of solid "
        "elements are lower, upper"
    )
    assert "group 'base' holds no solid elements" in error_of("hex8.unv", DATA, group="base")


def test_med_says_its_unit(tmp_path):
    changed(tmp_path / "m.med", "hex8.med", in_millimetres)
    told = remarks_of("m.med", tmp_path, unit="mm")
    assert "it says that its coordinates are in 'mm'; they are read in `unit`" in told
