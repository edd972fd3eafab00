"""Mortar gaps on faces that match and that do not: areas, rigid motion, linear fields, uniform pressure."""

import numpy as np
import pytest
from mortar_blocks import FACE, IDS, PAIRS, SIZE, pair, turn

from romdam.core.scene import Block
from romdam.geometry.facets import area_vectors, facet_areas
from romdam.scene.mortar.gaps import FaceGaps, mortar_gaps
from romdam.scene.mortar.interface import mortar_interface


def gaps_of(blocks: tuple[Block, Block]) -> FaceGaps:
    return mortar_gaps(mortar_interface(*blocks, 1e-3, 0.5, "s.yaml: joints.c"))


def jumps(blocks: tuple[Block, Block], gaps: FaceGaps, field, at_point: bool = False) -> np.ndarray:
    """(n, 3) jumps of a displacement field of space."""
    weights = gaps.at_point if at_point and gaps.at_point is not None else gaps.weights
    I, J = (w @ field(b.points[n]) for w, b, n in zip(weights, blocks, gaps.nodes, strict=True))
    return J - I


@pytest.mark.parametrize(("left", "right"), PAIRS, ids=IDS)
def test_areas_are_positive_and_sum_to_the_face(left, right):
    gaps = gaps_of(pair(left, right))
    assert gaps.area.min() > 0.0
    assert gaps.area.sum() == pytest.approx(FACE, rel=1e-12)


@pytest.mark.parametrize(("left", "right"), PAIRS, ids=IDS)
@pytest.mark.parametrize("at_point", [False, True])
def test_linear_fields_and_rigid_motion_have_no_jump(left, right, at_point):
    blocks = pair(left, right)
    gaps, gradient = gaps_of(blocks), np.random.default_rng(1).normal(size=(3, 3))
    moved = jumps(blocks, gaps, lambda x: x @ gradient + [1.0, -2.0, 3.0], at_point)
    assert np.abs(moved).max() < 1e-12 * 50.0


@pytest.mark.parametrize(("left", "right"), PAIRS, ids=IDS)
def test_uniform_pressure_gives_the_consistent_forces_of_both_faces(left, right):
    blocks = pair(left, right)
    gaps = gaps_of(blocks)
    for side, (block, face) in enumerate(zip(blocks, ("ymax", "ymin"), strict=True)):
        force = np.zeros(len(block.points))
        force[gaps.nodes[side]] = gaps.weights[side].T @ gaps.area
        facets, exact = block.faces[face], np.zeros((len(block.points), 3))
        np.add.at(exact, facets, area_vectors(block.points, facets))
        assert facet_areas(block.points, facets).sum() == pytest.approx(FACE, rel=1e-12)
        np.testing.assert_allclose(
            force,
            np.linalg.norm(exact, axis=1) * np.sign(exact @ turn()[:, 1]) * (1 if side == 0 else -1),
            atol=1e-11 * FACE,
        )


@pytest.mark.parametrize(("left", "right"), PAIRS, ids=IDS)
def test_gaps_stand_on_both_faces_and_their_normals_point_from_I_to_J(left, right):
    gaps = gaps_of(pair(left, right))
    np.testing.assert_allclose(gaps.position @ turn()[:, 1], SIZE, atol=1e-12 * SIZE)
    np.testing.assert_allclose(gaps.opposite, gaps.position, atol=1e-11 * SIZE)
    np.testing.assert_allclose(gaps.normal, np.tile(turn()[:, 1], (len(gaps.area), 1)), atol=1e-12)


def test_matching_linear_faces_have_the_gaps_of_coinciding_nodes():
    gaps = gaps_of(pair(("hex8", 3), ("hex8", 3)))
    assert gaps.at_point is None
    for weights in gaps.weights:
        assert abs(weights.sum(axis=1) - 1.0).max() < 1e-12
        assert weights.nnz == weights.shape[0] == 16
