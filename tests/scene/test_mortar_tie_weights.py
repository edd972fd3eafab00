"""Mortar ties: what the slave's nodes follow, and the forces that they hand on."""

import numpy as np
import pytest
from mortar_blocks import FACE, IDS, PAIRS, pair, turn

from romdam.geometry.elements import ELEMENTS
from romdam.geometry.facets import area_vectors
from romdam.scene.mortar.interface import mortar_interface
from romdam.scene.mortar.ties import tie_weights


def tie_of(left, right):
    blocks = pair(left, right)
    interface = mortar_interface(*blocks, 1e-3, 0.5, "s.yaml: ties.c")
    order = (1, 0) if interface.slave_is_J else (0, 1)
    tie = tie_weights(interface)
    return blocks[order[0]], blocks[order[1]], tie.slave, tie.master, tie.weights


@pytest.mark.parametrize(("left", "right"), PAIRS, ids=IDS)
def test_every_node_of_the_slave_follows_polynomials_of_the_elements(left, right):
    one, other, slave, master, weights = tie_of(left, right)
    face = one.faces["ymax" if one.name == "left" else "ymin"]
    assert np.array_equal(slave, np.unique(face))
    quadratic = all(ELEMENTS[block.element].quadratic for block in (one, other))

    def field(x):
        linear = x @ [1.0, -2.0, 0.5] + 3.0
        return linear + (x[:, 0] * x[:, 2] - 0.3 * x[:, 1] ** 2 if quadratic else 0.0)

    exact, followed = field(one.points[slave]), weights @ field(other.points[master])
    np.testing.assert_allclose(followed, exact, atol=1e-11 * np.abs(exact).max())


@pytest.mark.parametrize(("left", "right"), PAIRS, ids=IDS)
def test_uniform_traction_of_the_slave_is_the_masters(left, right):
    one, other, slave, master, weights = tie_of(left, right)
    own, theirs = (np.zeros(len(block.points)) for block in (one, other))
    for total, block in ((own, one), (theirs, other)):
        facets = block.faces["ymax" if block.name == "left" else "ymin"]
        np.add.at(total, facets, area_vectors(block.points, facets) @ turn()[:, 1])
    np.testing.assert_allclose(weights.T @ own[slave], -theirs[master], atol=1e-11 * FACE)
