"""Elements of zero thickness between solids, which are other programs' joints: no solids, and in no count."""

import numpy as np
import pytest
from test_mesh_bodies import job, write_deck

import romdam
from romdam.geometry.meshes.bodies import find_bodies
from romdam.geometry.meshes.files import read_mesh_file

FOOT = {"axis": "z", "at": 0}
# nodes of a (1..27, three planes of nine) and b (28..45) on x = 2 in `write_deck`, y then z
SIDE_A, SIDE_B = np.arange(19, 28).reshape(3, 3), np.arange(28, 37).reshape(3, 3)


def quads(side):
    """Nodes of the four facets of a side."""
    return [[side[y, z], side[y + 1, z], side[y + 1, z + 1], side[y, z + 1]] for y, z in np.ndindex(2, 2)]


def row(number, *nodes):
    return ", ".join(map(str, [number, *nodes]))


PAIRS = list(zip(quads(SIDE_A), quads(SIDE_B), strict=True))
EXTRA = {
    "cohesive": [
        "*ELEMENT, TYPE=COH3D8, ELSET=JOINT", *(row(100 + k, *a, *b) for k, (a, b) in enumerate(PAIRS))],
    "cohesive in the set": [
        "*ELEMENT, TYPE=COH3D8, ELSET=EALL", *(row(100 + k, *a, *b) for k, (a, b) in enumerate(PAIRS))],
    "wedges": ["*ELEMENT, TYPE=COH3D6, ELSET=EALL", row(100, *PAIRS[0][0][:3], *PAIRS[0][1][:3])],
    "gaps": ["*ELEMENT, TYPE=GAPUNI, ELSET=GAPS", *(row(100 + k, a, b) for k, (a, b) in enumerate(
        zip(SIDE_A.ravel(), SIDE_B.ravel(), strict=True)))],
    "solids by name": [
        "*ELEMENT, TYPE=C3D8, ELSET=EALL", *(row(100 + k, *a, *b) for k, (a, b) in enumerate(PAIRS))],
    "turned": [
        "*ELEMENT, TYPE=C3D8, ELSET=EALL",
        *(row(100 + k, b[0], a[0], a[1], b[1], b[3], a[3], a[2], b[2]) for k, (a, b) in enumerate(PAIRS))],
}  # fmt: skip


@pytest.mark.parametrize("extra", EXTRA)
def test_elements_of_zero_thickness_join_no_bodies(extra, tmp_path):
    """8 and 4 elements of 1 m3 each, and the joint's 4 m2 between."""
    deck = write_deck(tmp_path / "two.inp", extra="\n".join(EXTRA[extra]) + "\n")
    raw = job(
        tmp_path, {"m": {"material": "c", "mesh": {"file": str(deck), "group": "EALL", "bodies": "auto"}}}
    )
    raw |= {
        "joints": {"touching": {"normal_stiffness": "20 GPa/m"}},
        "supports": [{"block": "m.*", "face": FOOT}],
    }
    checked = romdam.check(raw)
    assert {name: block["cells"] for name, block in checked.blocks.items()} == {"m.1": 8, "m.2": 4}
    assert checked.joints["m.1-m.2"]["area"] == pytest.approx(4.0, rel=1e-12)
    assert "left out" in " ".join(checked.warnings)


def test_what_is_left_out_is_said_with_its_number_and_no_other_element_is_lost(tmp_path):
    deck = write_deck(tmp_path / "two.inp", extra="\n".join(EXTRA["solids by name"]) + "\n")
    file = read_mesh_file(deck, "job.yaml: blocks.m.mesh.file")
    assert sum(len(cells.ids) for cells in file.cells) == 12
    assert sum(len(members) for members in file.groups["EALL"]) == 12
    assert any("4 solids have no thickness" in r and "the first is element 100" in r for r in file.remarks)
    assert len(find_bodies(file, file.groups["EALL"]).boxes) == 2


def test_nastran_gaps_and_flat_hexahedra(tmp_path):
    """Two cubes of 1 m with CGAPs, or with a CHEXA between, and a thin one of 1 mm that is a solid."""
    x = [0.0, 1.0, 1.0, 2.0]
    points = [(a, b, c) for a in x for b, c in ((0, 0), (1, 0), (1, 1), (0, 1))]
    grids = [f"GRID,{k},,{p[0]:.4f},{p[1]:.1f},{p[2]:.1f}" for k, p in enumerate(points, 1)]

    def hexa(number, first):
        nodes = list(range(first, first + 8))
        return ["CHEXA," + ",".join(map(str, [number, 1, *nodes[:6]])), "," + ",".join(map(str, nodes[6:]))]

    solids = [*hexa(1, 1), *hexa(2, 9)]
    gaps = [f"CGAP,{10 + k},2,{5 + k},{9 + k},1.0,0.0,0.0" for k in range(4)]
    for extra in (gaps, hexa(3, 5)):
        (tmp_path / "a.bdf").write_text("\n".join(["BEGIN BULK", *grids, *solids, *extra, "ENDDATA"]))
        file = read_mesh_file(tmp_path / "a.bdf", "job.yaml: blocks.m.mesh.file")
        everything = [np.arange(len(cells.ids)) for cells in file.cells]
        assert sum(len(cells.ids) for cells in file.cells if cells.dim == 3) == 2
        np.testing.assert_allclose(
            find_bodies(file, everything).boxes[:, :, 0], [[0.0, 1.0], [1.0, 2.0]], atol=1e-12
        )
    thin = [g.replace("1.0000", "1.0010") if k >= 8 else g for k, g in enumerate(grids)]
    (tmp_path / "b.bdf").write_text("\n".join(["BEGIN BULK", *thin, *solids, *hexa(3, 5), "ENDDATA"]))
    file = read_mesh_file(tmp_path / "b.bdf", "job.yaml: blocks.m.mesh.file")
    assert sum(len(cells.ids) for cells in file.cells if cells.dim == 3) == 3
