"""What of a scene follows from areas and distances, worked out on paper where these are unlike."""

import numpy as np
import pytest
from mortar_blocks import pair
from scene_builders import box

from romdam.scene.mortar.interface import mortar_interface
from romdam.scene.mortar.ties import tie_weights


def test_arch_direction_turns_between_joints_by_the_inverse_distance(make):
    """1 m from a joint across x and 4 m from one across y: (1, 1/4), so (4, 1) / sqrt 17; halfway (1, 1)."""
    blocks = {
        "west": box([-1, 0, 0], [1, 4, 1]),
        "dam": box([0, 0, 0], [4, 4, 1]),
        "north": box([0, 4, 0], [4, 1, 1]),
    }
    joints = {
        "x": {"between": ["west", "dam"], "normal_stiffness": "16 GPa/m"},
        "y": {"between": ["dam", "north"], "normal_stiffness": "16 GPa/m"},
    }
    supports = [{"block": name, "face": "zmin"} for name in blocks]
    scene = make(
        {"blocks": blocks, "joints": joints, "supports": supports, "outputs": {"stress": {"blocks": ["dam"]}}}
    )
    for at, direction in (([1, 0, 1], [4, 1, 0]), ([2, 2, 0], [1, 1, 0]), ([2, 3, 1], [1, 2, 0])):
        node = int(np.abs(scene.blocks["dam"].points - at).sum(axis=1).argmin())
        found = scene.stress.blocks["dam"].arch[node]
        np.testing.assert_allclose(found, np.array(direction) / np.linalg.norm(direction), atol=1e-5)
        np.testing.assert_allclose(scene.stress.blocks["dam"].up[node], [0, 0, 1])


def test_area_of_gaps_that_supports_hold_goes_to_the_nearest_that_are_free(make):
    """1 m wide and 3 m high in rows of 1 m; the foot is held, and along the normal the edge x = 0.

    Free are three gaps at x = 1. The lowest has the share of three: 1/2 at its height, 1/4 twice at the foot.
    """
    blocks = {"left": box([0, -2, 0], [1, 2, 3]), "right": box([0, 0, 0], [1, 2, 3])}
    supports = [{"block": name, "face": "zmin"} for name in blocks]
    supports += [{"block": name, "face": "xmin", "fix": ["y"]} for name in blocks]
    joint = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}
    found = make({"blocks": blocks, "supports": supports, "joints": {"j": joint}}).joints["j"]
    order = np.argsort(found.position[:, 2])
    np.testing.assert_allclose(found.position[order], [[1, 0, 1], [1, 0, 2], [1, 0, 3]], atol=1e-12)
    np.testing.assert_allclose(found.area[order], [0.5, 0.5, 0.25])
    np.testing.assert_allclose(found.share[order], [1.0, 0.5, 0.25])
    np.testing.assert_allclose(found.K_n, 16e9 * found.area)


@pytest.mark.parametrize(("element", "area"), [("hex8", 1 / 4), ("hex20", 1 / 20)])
def test_multipliers_of_a_tie_fill_the_face(element, area):
    """Of quadratic facets phi is -1/12 + 2 0.2 / 3 = 1/20 at corners and 0.6 / 3 = 1/5 at middles."""
    interface = mortar_interface(*pair((element, 1), (element, 1)), 1e-3, 0.5, "s.yaml: ties.c")
    found = tie_weights(interface).area
    assert found.sum() == pytest.approx(144.0, rel=1e-9) and found.min() == pytest.approx(area * 144.0)
