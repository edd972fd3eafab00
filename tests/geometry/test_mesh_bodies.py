"""Bodies that touch in one set of a mesh file, taken apart by number."""

import numpy as np
import pytest
import yaml
from test_cli import call

import romdam
from romdam.core.errors import MeshError
from romdam.geometry.meshes.bodies import number_bodies

SIZE = {"a": (0.0, 2.0), "b": (2.0, 1.0)}  # along x; both 2 m along y and z, elements of 1 m
RECORD = "\n".join(f"{5.0 * np.sin(20.0 * 0.01 * k) * np.exp(-0.01 * k):.6f}" for k in range(100))


def write_deck(path, order=("a", "b"), extra=""):
    """Both bodies in one element set of C3D8, nodes on the joint twice."""
    nodes, elements, number = ["*NODE"], ["*ELEMENT, TYPE=C3D8, ELSET=EALL"], 0
    for name in order:
        start, length = SIZE[name]
        n = int(length)
        first = number + 1
        for x, y, z in np.ndindex(n + 1, 3, 3):
            number += 1
            nodes.append(f"{number}, {start + x:g}, {y:g}, {z:g}")
        at = first + np.arange(number - first + 1).reshape(n + 1, 3, 3)
        for x, y, z in np.ndindex(n, 2, 2):
            low = [at[x, y, z], at[x + 1, y, z], at[x + 1, y + 1, z], at[x, y + 1, z]]
            high = [at[x, y, z + 1], at[x + 1, y, z + 1], at[x + 1, y + 1, z + 1], at[x, y + 1, z + 1]]
            elements.append(", ".join(map(str, [len(elements), *low, *high])))
    path.write_text("\n".join([*nodes, *elements]) + "\n" + extra)
    return path


def job(folder, blocks):
    (folder / "record.txt").write_text(RECORD)
    return {
        "materials": {"c": {"E": "30 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
        "blocks": blocks,
        "joints": {"ab": {"between": ["a", "b"], "normal_stiffness": "20 GPa/m"}},
        "supports": [{"block": name, "face": {"axis": "z", "at": 0}} for name in blocks],
        "damping": {"rayleigh": {"frequencies": [50.0, 300.0], "ratio": 0.05}},
        "records": [{"name": "r", "file": str(folder / "record.txt"), "unit": "m/s2", "dt": "0.01 s",
                     "components": {"x": 1}}],
        "model": {"order": "full"},
        "transient": {"finest_step": "2.5 ms"},
        "outputs": {"plots": False},
    }  # fmt: skip


@pytest.mark.parametrize("order", [pytest.param(("a", "b"), marks=pytest.mark.slow), ("b", "a")])
def test_bodies_of_one_set_are_blocks_like_boxes(tmp_path, order):
    deck = write_deck(tmp_path / "two.inp", order)
    meshes = {
        name: {"material": "c", "mesh": {"file": str(deck), "body": k + 1}} for k, name in enumerate("ab")
    }
    boxes = {
        name: {"material": "c", "box": {"origin": [start, 0, 0], "size": [length, 2, 2], "element_size": 1}}
        for name, (start, length) in SIZE.items()
    }
    of_meshes, of_boxes = (
        romdam.run(job(tmp_path, blocks)).results[0].dataset.load() for blocks in (meshes, boxes)
    )
    assert float(np.abs(of_boxes.opening).max()) > 1e-7
    for name in ("opening", "normal_force"):
        wanted = of_boxes[name].values
        rows = [
            int(np.abs(of_meshes.gap_position.values - place).sum(axis=1).argmin())
            for place in of_boxes.gap_position.values
        ]
        assert of_meshes[name].values[:, rows] == pytest.approx(wanted, abs=1e-9 * np.abs(wanted).max())
    assert "belong to no block" not in str(of_meshes.attrs.get("run_warnings"))


def test_a_body_that_is_not_there_says_how_many_there_are_and_where(tmp_path):
    write_deck(tmp_path / "two.inp", ("b", "a"))
    blocks = {"a": {"material": "c", "mesh": {"file": "two.inp", "body": 3}}}
    raw = job(tmp_path, blocks)
    del raw["joints"]
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("check", tmp_path / "job.yaml")
    assert code == 2
    assert "blocks.a.mesh.body: " in err and "has 2 bodies in this block, no number 3: " in err
    assert "1 (x 0..2, y 0..2, z 0..2), 2 (x 2..3, y 0..2, z 0..2)" in err


def test_bodies_that_touch_in_one_block_are_refused_with_the_key_that_takes_them_apart(tmp_path):
    write_deck(tmp_path / "two.inp")
    raw = job(tmp_path, {"all": {"material": "c", "mesh": {"file": "two.inp"}}})
    del raw["joints"]
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("check", tmp_path / "job.yaml")
    assert code == 2
    assert "make its 2 bodies blocks of their own by `mesh.bodies: auto`, with joints or ties: 1 (x" in err


def test_bodies_are_counted_along_x_then_y_then_z():
    """Four bars of one element; two are level in x but for round-off, two of these in y too."""
    corners = np.array([[1.0, 0.0, 5.0], [1.0 + 1e-9, 0.0, 0.0], [1.0, 3.0, 0.0], [-2.0, 9.0, 9.0]])
    points = (corners[:, None] + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])).reshape(-1, 3)
    numbers, boxes = number_bodies(points, [np.arange(8).reshape(2, 4), np.arange(8, 16).reshape(2, 4)])
    assert [each.tolist() for each in numbers] == [[3, 2], [4, 1]]
    np.testing.assert_allclose(boxes[0], [[-2.0, 9.0, 9.0], [-1.0, 10.0, 10.0]])


def test_a_node_that_the_file_does_not_give_joins_no_bodies():
    points = np.arange(24.0).reshape(8, 3)
    numbers, boxes = number_bodies(points, [np.array([[0, 1, 2, -1], [4, 5, 6, -1]])])
    assert numbers[0].tolist() == [1, 2] and len(boxes) == 2


def test_what_is_wrong_in_another_body_does_not_matter(tmp_path):
    """A tetrahedron that lacks a node; the block of the two others is whole."""
    extra = "*ELEMENT, TYPE=C3D4, ELSET=EALL\n99, 1, 2, 3, 9999\n"
    deck = write_deck(tmp_path / "two.inp", extra=extra)
    block = {"material": "c", "mesh": {"file": str(deck), "body": 2}}
    raw = job(tmp_path, {"b": block})
    del raw["joints"]
    romdam.run(raw)
    with pytest.raises(MeshError):
        romdam.run(raw | {"blocks": {"b": block | {"mesh": {"file": str(deck)}}}})
