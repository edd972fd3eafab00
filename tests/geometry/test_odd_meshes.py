"""What a job names of a mesh file must be sound; what nothing names may be odd, and is told.

Every file of `data/odd` holds one hexahedron of 1,000 m3 and one thing that its own program reads and that
the job does not need, by hand from the manuals of the formats.
"""

from pathlib import Path

import numpy as np
import pytest
from test_mesh_files import CONCRETE, PLACE, error_of, read

from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.core.errors import ConfigError
from romdam.fem.assembly import assemble
from romdam.geometry.meshes.files import MeshFiles
from romdam.scene.select import select_facets

ODD = Path(__file__).parent / "data" / "odd"
TOLD = {  # file -> what is told, once; empty where it is the language's own
    "nas_star_in_column_8.bdf": "",
    "nas_marker_first_column.bdf": "",
    "nas_dvgrid.bdf": "",
    "nas_trailing_comma.bdf": "",
    "nas_after_enddata.bdf": "1 entries after ENDDATA are left out",
    "nas_grid_blank_xyz.bdf": "1 grid points leave a coordinate blank, which is read as 0",
    "nas_bars.bdf": "elements that are neither solids nor shells are left out (8 CBAR)",
    "nas_shell_across.bdf": "group '2': element 2 (quad) is no face of a solid element, whose corners it has",
    "cdb_etblock.cdb": "",
    "cdb_nblock_1i9_2i9.cdb": "",
    "cdb_cmblock_kp.cdb": "component _KPNT of KP is left out",
    "cdb_loose.cdb": "belongs to no element and is left out (6 such nodes of 14)",
    "inp_elset_of_bars.inp": "elements that no block is made of are left out (1 T3D2)",
    "inp_generate_holes.inp": "ranges of GENERATE hold numbers that are not given (NSET NALL 12)",
    "inp_surface_s2_of_shell.inp": "1 sides of surface 'US' are of no solid and are left out",
    "inp_type_CIN3D8.inp": "elements that no block is made of are left out (1 CIN3D8)",
    "inp_type_DCOUP3D.inp": "elements that no block is made of are left out (1 DCOUP3D)",
    "mail_nom_blank.mail": "",
    "mail_fin_without_finsf.mail": "",
    "mail_seg4.mail": "elements that no block is made of are left out (1 SEG4)",
    "mail_inside_out.mail": "1 of 1 hexahedron are inside out in the order of nodes that the format has",
    "mail_equals.mail": "",
    "unv_2417_seven.unv": "",
    "unv_empty_group.unv": "",
}


def block_and_remarks(name, folder=ODD, group=None):
    files = MeshFiles(folder)
    block = files.block("b", MeshFileConfig(file=name, group=group), CONCRETE, PLACE)
    return block, files.remarks


def test_every_file_is_tried():
    assert set(TOLD) == {path.name for path in ODD.iterdir()}


@pytest.mark.parametrize("name", TOLD)
def test_what_no_block_needs_is_told_and_left_out(name):
    block, remarks = block_and_remarks(name)
    assert assemble(block)[1].sum() / 3 == pytest.approx(1000.0 * CONCRETE.rho, rel=1e-12)
    told = [remark for remark in remarks if TOLD[name] in remark]
    assert len(told) == 1 if TOLD[name] else not remarks
    assert all(remark.startswith(f"{ODD / name}: ") and "\n" not in remark for remark in remarks)


@pytest.mark.parametrize(
    ("name", "group", "others"),
    [
        ("inp_elset_of_bars.inp", "ALL", "1 T3D2"),
        ("inp_elset_of_bars.inp", "DAM", ""),
        ("inp_surface_s2_of_shell.inp", "DAM", ""),
        ("cdb_cmblock_kp.cdb", "DAM", ""),
        ("mail_fin_without_finsf.mail", "DAM", ""),
        ("unv_2417_seven.unv", "DAM", ""),
        ("nas_bars.bdf", 1, ""),
    ],
)
def test_groups_of_solids_beside_what_is_left_out(name, group, others):
    block, remarks = block_and_remarks(name, group=group)
    assert len(block.cells) == 1
    assert others == "" or f"{ODD / name}: group {group!r} holds {others} too, left out" in remarks


def test_groups_of_what_is_left_out_are_no_blocks():
    assert "group 'X' holds no solid elements" in error_of("inp_type_CIN3D8.inp", ODD, group="X")
    assert "group 'ANCHORS' holds no solid elements" in error_of(
        "inp_elset_of_bars.inp", ODD, group="ANCHORS"
    )


def test_a_shell_across_an_element_is_no_face():
    block = read("nas_shell_across.bdf", ODD)
    with pytest.raises(ConfigError) as caught:
        select_facets(block, "2", "s.yaml: supports[0].face")
    assert str(caught.value) == (
        "s.yaml: supports[0].face: face '2' of block 'b' is not sound in its mesh file: element 2 (quad) is "
        "no face of a solid element, whose corners it has (1 such elements, limit 0); repair the file, or "
        "name another face"
    )


LOST = {  # file, what is put where, the group that has lost a member
    "a.mail": (
        "mail_seg4.mail",
        ("FIN\n", "GROUP_MA NOM=G\nM1 M9\nFINSF\nFIN\n"),
        "names 'M9', which is not given",
    ),
    "a.unv": (
        "unv_2417_seven.unv",
        ("         1\nDAM\n         8         1", "         2\nG\n         8         1         8         9"),
        "has element 9, which is not given",
    ),
    "a.inp": (
        "inp_elset_of_bars.inp",
        ("*ELSET, ELSET=ALL\n", "*ELSET, ELSET=G\n1, 9\n*ELSET, ELSET=ALL\n"),
        "has element 9, which is not given",
    ),
    "a.cdb": (
        "cdb_cmblock_kp.cdb",
        (
            "CMBLOCK,DAM,ELEM,       1\n(8i10)\n         1",
            "CMBLOCK,G,ELEM,       2\n(8i10)\n         1         9",
        ),
        "has element 9, which is not given",
    ),
}


@pytest.mark.parametrize("name", LOST)
def test_a_group_that_has_lost_a_member_must_not_be_named(name, tmp_path):
    """It is told where nothing names it, and refused as a block and as a face."""
    original, (old, new), reason = LOST[name]
    text = (ODD / original).read_text()
    assert text.count(old) == 1
    (tmp_path / name).write_text(text.replace(old, new))
    block, remarks = block_and_remarks(name, tmp_path)
    assert len(block.cells) == 1 and any("'G'" in remark and reason in remark for remark in remarks)
    error = error_of(name, tmp_path, group="G")
    assert error.startswith(f"{PLACE}.file: {tmp_path / name}: group 'G': ") and reason in error
    with pytest.raises(ConfigError, match="face 'G' of block 'b' is not sound in its mesh file"):
        select_facets(block, "G", "s.yaml: supports[0].face")


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("1, 1,2,3,4,5,6,7,8", "1, 1,2,3,4,5,6,7,99", "uses node 99, which is not given"),
        ("8, 0, 10, 10", "8, 0, nan, 10", "uses node 8, expected finite coordinates up to 1e+12"),
        ("8, 0, 10, 10", "8, 0, 10, 10\n8, 0, 10, 11", "uses node 8, which is given twice, at two positions"),
        ("1, 1,2,3,4,5,6,7,8", "1, 1,2,3,4,5,6,7,7", "names a node twice"),
        ("1, 1,2,3,4,5,6,7,8", "1, 1,2,3,4,5,6,7,8\n1, 1,2,3,4,5,6,7,8", "has a number that is given twice"),
    ],
)
def test_elements_that_are_not_sound_matter_where_a_block_takes_them(old, new, reason, tmp_path):
    """A second hexahedron, sound and on nodes of its own, is a block beside them."""
    text = (ODD / "inp_elset_of_bars.inp").read_text().replace(old, new)
    points = [line.split(",")[1:] for line in text.split("\n")[1:9]]
    sound = [
        (0, 0, 0),
        (10, 0, 0),
        (10, 10, 0),
        (0, 10, 0),
        (0, 0, 10),
        (10, 0, 10),
        (10, 10, 10),
        (0, 10, 10),
    ]
    assert len(points) == 8
    more = "*NODE\n" + "\n".join(f"{k + 21}, {x + 50}, {y}, {z}" for k, (x, y, z) in enumerate(sound))
    more += "\n*ELEMENT, TYPE=C3D8, ELSET=SOUND\n3, " + ",".join(map(str, range(21, 29))) + "\n"
    (tmp_path / "a.inp").write_text(text + more)
    block, remarks = block_and_remarks("a.inp", tmp_path, "SOUND")
    assert np.ptp(block.points, axis=0).tolist() == [10.0, 10.0, 10.0] and block.points[:, 0].min() == 50.0
    assert any(reason in remark and "no block can take it" in remark for remark in remarks)
    for group in ("DAM", None):
        assert reason in error_of("a.inp", tmp_path, group=group)


def test_a_range_of_abaqus_goes_by_its_step(tmp_path):
    """1, 8, 3 are nodes 1, 4 and 7: with 5 and 8 besides they hold the face at x = 0 alone, 1 5 8 4."""
    text = (ODD / "inp_generate_holes.inp").read_text().replace("1, 20", "1, 8, 3\n5, 8, 3")
    (tmp_path / "a.inp").write_text(text)
    block, remarks = block_and_remarks("a.inp", tmp_path)
    (facet,) = select_facets(block, "NALL", "s.yaml: supports[0].face")
    assert sorted(map(tuple, block.points[facet].tolist())) == [
        (0, 0, 0),
        (0, 0, 10),
        (0, 10, 0),
        (0, 10, 10),
    ]
    assert not remarks


@pytest.mark.parametrize(("kind", "told"), [("C3D8R", "1 C3D8R"), ("C3D8", ""), ("C3D8I", "")])
def test_elements_of_reduced_integration_are_told(kind, told, tmp_path):
    text = (ODD / "inp_elset_of_bars.inp").read_text().replace("TYPE=C3D8,", f"TYPE={kind},")
    (tmp_path / "a.inp").write_text(text)
    remarks = [
        remark for remark in block_and_remarks("a.inp", tmp_path)[1] if "reduced integration" in remark
    ]
    assert len(remarks) == bool(told) and told in "".join(remarks)


def test_dataset_780_groups_by_its_fourth_number(tmp_path):
    """Its heads are number, type, table and number of the property, those of the material, colour, nodes."""
    text = (ODD / "unv_2417_seven.unv").read_text()
    head = "         1       115         1         1         7         8\n"
    old = "".join(f"{word:10d}" for word in (1, 115, 9, 4, 9, 5, 7, 8)) + "\n"
    assert text.count(head) == 1
    text = text.replace("  2412\n", "   780\n").replace(head, old)
    (tmp_path / "a.unv").write_text(text[: text.index("    -1\n  2417")])
    assert len(block_and_remarks("a.unv", tmp_path, 4)[0].cells) == 1
    assert "groups of solid elements are 4" in error_of("a.unv", tmp_path, group=9)
