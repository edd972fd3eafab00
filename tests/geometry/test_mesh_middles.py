"""Middle nodes that elements leave out, as Nastran and ANSYS allow: edges are straight there, and said so."""

import numpy as np
import pytest

from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.core.scene import Material
from romdam.fem.assembly import assemble
from romdam.geometry.meshes.files import MeshFiles, read_mesh_file

CONCRETE = Material(30e9, 0.2, 2400.0)
PLACE = "s.yaml: blocks.b.mesh"
CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float
)
# edges of CHEXA's nodes 9 to 20: bottom, upright, top
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)]


def two_cubes():
    """Positions by number of all nodes of two hex20, one on the other, and both elements' nodes."""
    points, elements = {}, []
    for k in range(2):
        corners = CORNERS + np.array([0.0, 0.0, k])
        every = [*corners, *(corners[list(edge)].mean(axis=0) for edge in EDGES)]
        for at in every:
            points.setdefault(tuple(at), len(points) + 1)
        elements.append([points[tuple(at)] for at in every])
    return points, elements


def nastran(elements, points):
    lines = ["BEGIN BULK", *(f"GRID,{n},,{x:.3f},{y:.3f},{z:.3f}" for (x, y, z), n in points.items())]
    for number, nodes in enumerate(elements, 1):
        words = [str(n or "") for n in nodes]
        lines.append("CHEXA," + ",".join([str(number), "1", *words[:6]]))
        lines += ["," + ",".join(words[k : k + 8]) for k in (6, 14) if any(words[k : k + 8])]
    return "\n".join([*lines, "ENDDATA", ""])


def ansys(elements, points):
    lines = ["ET,1,186", f"NBLOCK,6,SOLID,{len(points)},{len(points)}", "(3i9,6e21.13)"]
    lines += [f"{n:9d}{0:9d}{0:9d}" + "".join(f"{x:21.13E}" for x in at) for at, n in points.items()]
    lines += ["N,R5.3,LOC,      -1,", f"EBLOCK,19,SOLID,{len(elements)},{len(elements)}", "(19i9)"]
    for number, nodes in enumerate(elements, 1):
        # I..P, then the middles of the bottom, the top and the upright edges
        nodes = [*nodes[:12], *nodes[16:], *nodes[12:16]]
        row = [1, 1, 1, 1, 0, 0, 0, 0, 20, 0, number, *nodes]
        lines += ["".join(f"{n:9d}" for n in row[:19]), "".join(f"{n:9d}" for n in row[19:])]
    return "\n".join([*lines, f"{-1:9d}", ""])


WRITERS = {".bdf": nastran, ".cdb": ansys}


def block(folder, ending, elements, points):
    used = {n for nodes in elements for n in nodes}
    text = WRITERS[ending](elements, {at: n for at, n in points.items() if n in used})
    (folder / f"m{ending}").write_text(text)
    files = MeshFiles(folder)
    config = MeshFileConfig.model_validate({"file": f"m{ending}"})
    return files.block("b", config, CONCRETE, PLACE), files


def frequencies(mesh):
    K, M = assemble(mesh)
    import scipy.linalg

    return scipy.linalg.eigh(K.toarray(), M.toarray(), eigvals_only=True)[6:]


@pytest.mark.parametrize("ending", WRITERS)
@pytest.mark.parametrize(
    "left_out", [{0: [], 1: [8, 10, 17]}, {0: [16, 17, 18, 19], 1: [8, 9, 10, 11]}, {1: range(14, 20)},
                 {0: range(9, 20), 1: [11, 13, 15]}, {0: [12], 1: [19]}],
)  # fmt: skip
def test_edges_without_their_middle_node_are_straight(ending, left_out, tmp_path):
    """Elements as those with all nodes, and both conform: 32 nodes with the same frequencies to round-off."""
    points, elements = two_cubes()
    whole = block(tmp_path, ending, elements, points)[0]
    lacking = [
        [0 if j in left_out.get(k, ()) else n for j, n in enumerate(nodes)]
        for k, nodes in enumerate(elements)
    ]
    mesh, files = block(tmp_path, ending, lacking, points)
    assert mesh.element == "hex20" and len(mesh.points) == len(whole.points) == 32
    assert assemble(mesh)[1].sum() / 3 == pytest.approx(2.0 * CONCRETE.rho, rel=1e-12)
    np.testing.assert_allclose(frequencies(mesh), frequencies(whole), rtol=1e-9)
    count = sum(map(len, left_out.values()))
    assert any(
        f"leave out {count} of their middle nodes (the first is element" in text for text in files.remarks
    )


def test_a_line_that_is_awaited_is_not_taken_for_nodes_left_out(tmp_path):
    points, elements = two_cubes()
    lines = nastran(elements[:1], points).split("\n")
    at = next(k for k, line in enumerate(lines) if line.startswith("CHEXA"))
    lines[at + 1] += ",+A"
    del lines[at + 2]
    (tmp_path / "m.bdf").write_text("\n".join(lines))
    file = read_mesh_file(tmp_path / "m.bdf", PLACE)
    assert any(
        "CHEXA 1 has 14 nodes, expected 8 or 20; a continuation line is missing" in r for r in file.remarks
    )
