"""Box blocks: volumes, conformity from box to box, and element sizes that do not fit."""

import numpy as np
import pytest
from scene_builders import box, two_boxes
from test_elements import mesh

from romdam.core.errors import ConfigError
from romdam.geometry.elements import ELEMENTS, SOLIDS, jacobians
from romdam.geometry.facets import boundary_facets


@pytest.mark.parametrize("name", SOLIDS)
def test_cells_fill_the_box(name):
    block = mesh(name, size=(1.0, 1.5, 2.0))
    element = ELEMENTS[name]
    xi, weight = element.rule
    determinant = np.linalg.det(jacobians(block.points, block.cells, element, xi))
    assert determinant.min() > 0
    assert (determinant @ weight).sum() == pytest.approx(3.0, rel=1e-13)
    assert len(np.unique(block.cells)) == len(block.points) == len(np.unique(block.points.round(9), axis=0))


@pytest.mark.parametrize("name", SOLIDS)
def test_boxes_on_one_grid_conform_on_every_side(name, make):
    raw = {
        "blocks": {
            "core": box([0, 0, 0], [2, 2, 2], element=name),
            "px": box([2, 0, 0], [1, 2, 2], element=name),
            "py": box([0, 2, 0], [2, 1, 2], element=name),
            "pz": box([0, 0, 2], [2, 2, 1], element=name),
        },
        "supports": [{"block": b, "face": "zmin"} for b in ("core", "px", "py")],
        "joints": {
            f"to_{b}": {"between": ["core", b], "normal_stiffness": "rigid"} for b in ("px", "py", "pz")
        },
    }
    scene = make(raw)
    assert scene.joints["to_pz"].area.sum() == pytest.approx(4.0, rel=1e-12)
    assert np.abs(scene.joints["to_px"].axes[:, 0] - [1, 0, 0]).max() < 1e-12
    assert np.isinf(scene.joints["to_py"].K_n).all()


def test_element_size_per_direction_and_thirds(make):
    raw = two_boxes()
    raw["blocks"]["left"]["box"]["element_size"] = [0.333333333, "50 cm", 1.0]
    raw["blocks"]["right"]["box"]["element_size"] = [0.333333333, 2.0, 1.0]
    scene = make(raw)
    assert len(scene.blocks["left"].cells) == 6 * 4 * 2
    assert len(scene.joints["c"].area) == 7 * 2


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (
            0.6,
            "s.yaml: blocks.left.box.element_size = 0.6 m does not divide the box, 2 m along x "
            "(3.333 elements); the nearest sizes that do are 0.5 or 0.666667 m",
        ),
        (
            [1.0, 1.0, 5.0],
            "s.yaml: blocks.left.box.element_size = 5 m does not divide the box, 2 m along z "
            "(0.4 elements); the nearest sizes that do are 1 or 2 m",
        ),
    ],
)
def test_element_size_that_does_not_divide_is_refused(size, message, make):
    raw = two_boxes()
    raw["blocks"]["left"]["box"]["element_size"] = size
    with pytest.raises(ConfigError) as caught:
        make(raw)
    assert str(caught.value) == message


def test_facet_count_of_tets():
    """Kuhn's subdivision: six tetrahedra and twelve boundary triangles per cube."""
    block = mesh("tet4", element_size=1.0)
    assert (len(block.cells), len(boundary_facets(block.cells, "tet4"))) == (6, 12)
