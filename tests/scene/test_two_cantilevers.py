"""The verification model of the source: against the arrays of tests/reference, and by its numbers.

1470 nodes, 100 gaps of 6.25 m2, half and a quarter of it on the rim, 1440 Pa on two faces.
"""

import logging
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from romdam.config import load_config
from romdam.fem.assembly import assemble
from romdam.fem.loads import static_force
from romdam.scene.build import build_scene

CONFIG = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"
REFERENCE = Path(__file__).parents[1] / "reference" / "two_cantilevers" / "model.npz"


@pytest.fixture(scope="module")
def scene():
    job = load_config(CONFIG)
    return build_scene(job.config, job.folder, job.path.name)


@pytest.mark.skipif(not REFERENCE.is_file(), reason="reference arrays are not in this tree")
def test_scene_equals_the_reference_arrays(scene):
    reference = np.load(REFERENCE)
    split = int(reference["nleft_nodes"])
    number = {}
    for name, part in (("left", slice(None, split)), ("right", slice(split, None))):
        block = scene.blocks[name]
        distance, number[name] = cKDTree(block.points).query(reference["points"][part])
        assert distance.max() < 1e-9
        assert len(np.unique(number[name])) == len(block.points) == len(distance)
        force = static_force(scene, name)
        assert np.abs(force[number[name]] - reference["force"][part]).max() < 1e-9
        held = np.isin(np.arange(1470)[part], reference["base"])
        assert np.array_equal(scene.fixed[name][number[name]].all(axis=1), held)
    joint, pairs = scene.joints["contraction"], reference["pairs"]
    found = {(i, j): a for i, j, a in zip(*joint.nodes, joint.area, strict=True)}
    wanted = zip(
        number["left"][pairs[:, 0]], number["right"][pairs[:, 1] - split], reference["area"], strict=True
    )
    assert len(found) == len(pairs)
    assert max(abs(found[i, j] - area) for i, j, area in wanted) < 1e-9


def test_nodes_are_the_grid_of_the_source(scene):
    left, right = scene.blocks["left"], scene.blocks["right"]
    assert (len(left.points), len(right.points)) == (525, 945)
    assert (len(left.cells), len(right.cells)) == (320, 640)
    for block, y in ((left, np.arange(-10, 0.1, 2.5)), (right, np.arange(0, 20.1, 2.5))):
        grid = np.array(
            [(a, b, c) for c in np.arange(0, 50.1, 2.5) for b in y for a in np.arange(0, 10.1, 2.5)]
        )
        assert np.abs(block.points - grid).max() < 1e-9


def test_gaps_have_the_tributary_areas_of_the_face(scene):
    joint = scene.joints["contraction"]
    assert len(joint.area) == 100  # 105 nodes, less the 5 held at the base
    assert joint.area.sum() == pytest.approx(10 * 50 - 10 * 1.25, abs=1e-9)
    on_rim = np.isin(joint.position[:, 0], (0, 10)).astype(int) + (joint.position[:, 2] == 50)
    assert np.abs(joint.area - 6.25 / 2**on_rim).max() < 1e-9
    I, J = scene.blocks["left"].points[joint.nodes[0]], scene.blocks["right"].points[joint.nodes[1]]
    assert np.abs(I - J).max() < 1e-9
    assert np.abs(joint.axes - [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]).max() < 1e-12
    assert np.allclose(joint.K_n, 1.6e10 * joint.area, rtol=1e-14)


def test_dropped_gaps_are_logged(caplog):
    job = load_config(CONFIG)
    with caplog.at_level(logging.INFO, logger="romdam"):
        build_scene(job.config, job.folder, job.path.name)
    assert "joints.contraction: 5 of 105 gaps are held by supports on both sides and dropped" in caplog.text


@pytest.mark.parametrize(("name", "sign", "y"), [("left", 1, -10), ("right", -1, 20)])
def test_pressure_force(scene, name, sign, y):
    block = scene.blocks[name]
    force = static_force(scene, name)
    on_face = block.points[:, 1] == y
    rim = np.isin(block.points[:, 0], (0, 10)).astype(int) + np.isin(block.points[:, 2], (0, 50))
    expected = np.where(on_face, sign * 1440 * 6.25 / 2.0**rim, 0.0)
    assert np.abs(force[:, 1] - expected).max() < 1e-9
    assert np.abs(force[:, [0, 2]]).max() < 1e-9


@pytest.mark.parametrize(("name", "volume"), [("left", 5000.0), ("right", 10000.0)])
def test_mass_and_rigid_motion(scene, name, volume):
    block = scene.blocks[name]
    K, M = assemble(block)
    ones = np.tile(np.eye(3), (len(block.points), 1))
    assert np.abs(ones.T @ M @ ones / (2440 * volume) - np.eye(3)).max() < 1e-12
    assert abs(K - K.T).max() == 0.0
    rotation = np.cross(np.eye(3)[:, None], block.points[None]).reshape(3, -1)
    for motion in (*ones.T, *rotation):
        assert abs(motion @ K @ motion) < 1e-12 * abs(K).max() * (motion @ motion)


FREQUENCIES = {  # CalculiX 2.20 C3D8, BENCHMARKS.md
    "left": [2.2454, 2.2454, 10.792, 12.301, 12.301, 17.579, 29.790, 29.790],
    "right": [2.2504, 4.1265, 8.9162, 12.319, 17.589, 17.818],
}


@pytest.mark.parametrize("name", FREQUENCIES)
def test_block_frequencies(scene, name):
    from scipy.sparse.linalg import eigsh

    K, M = assemble(scene.blocks[name])
    free = np.flatnonzero(~scene.fixed[name].ravel())
    wanted = np.array(FREQUENCIES[name])
    omega2 = eigsh(K[free][:, free].tocsc(), len(wanted), M[free][:, free].tocsc(), sigma=0.0)[0]
    freq = np.sqrt(np.sort(omega2)) / (2 * np.pi)
    unit = 10.0 ** (np.floor(np.log10(wanted)) - 4)  # of the last of the five digits given
    assert (np.abs(freq - wanted) <= 0.51 * unit).all()
