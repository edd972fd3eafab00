"""Normals, moments and generated dams, worked out on paper."""

import numpy as np
import pytest
from arch_dams import arch_dam
from gravity_dams import FOUNDATION, gravity_dam

from romdam.config import parse_config
from romdam.config.quantities import to_si
from romdam.config.sections.joint_water import DrainsConfig
from romdam.geometry.arch_dam.shape import ArchShape
from romdam.geometry.facets import facet_areas, node_normals, second_moments

# 2 x 3 m in the plane z = 0, and 2 x 1 m standing on its far edge
POINTS = np.array([[0.0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0], [2, 3, 1], [0, 3, 1]])
FACETS = np.array([[0, 1, 2, 3], [3, 2, 4, 5]])


def test_normals_at_nodes_are_weighted_by_area():
    """6 m2 up and 2 m2 along -y: (0, -2, 6) / sqrt 40 where both meet."""
    expected = np.zeros((6, 3))
    expected[:2, 2], expected[4:, 1] = 1.0, -1.0
    expected[2:4] = np.array([0, -2, 6]) / 40**0.5
    np.testing.assert_allclose(node_normals(POINTS, FACETS), expected, atol=1e-14)
    np.testing.assert_allclose(facet_areas(POINTS, FACETS), [6, 2])


def test_second_moments_of_two_rectangles():
    """Middle at y = (6 1.5 + 2 3) / 8, z = 2 0.5 / 8; about it 6 3^2 / 12 + 6 0.375^2 + 2 1.125^2 of y."""
    moments, middle = second_moments(POINTS, FACETS)
    np.testing.assert_allclose(middle, [1, 1.875, 0.125])
    yy = 6 * 9 / 12 + 6 * 0.375**2 + 2 * 1.125**2
    zz = 6 * 0.125**2 + 2 * 1 / 12 + 2 * 0.375**2
    yz = 6 * 0.375 * 0.125 + 2 * 1.125 * 0.375
    np.testing.assert_allclose(moments, [[8 * 4 / 12, 0, 0], [0, yy, yz], [0, yz, zz]], atol=1e-12)


def test_rock_ends_in_planes_in_front_of_and_behind_a_dam(make):
    """Though the downstream face leans: 130 m behind its toe at y = 70, 100 m before its heel at 0."""
    blocks = make(gravity_dam()).blocks
    for name in ("rock_1", "rock_2", "rock_left"):
        for face, y in (("side_downstream", 200.0), ("side_upstream", -100.0)):
            nodes = np.unique(blocks[name].faces[face])
            np.testing.assert_allclose(blocks[name].points[nodes, 1], y, rtol=1e-12)
            assert len(np.unique(blocks[name].points[nodes, 2])) > 2


def test_walls_and_banks_of_a_gravity_dam():
    """At 40 m the downstream face is at 70 - 40 50.75 / 66.5. Banks are as high as the bases near them."""
    gallery = {"floor": 12.0, "height": 3.0, "upstream": 5.0, "width": 2.5}
    raw = gravity_dam(gallery=gallery, rock=FOUNDATION | {"left": 60, "right": 60})
    dam = parse_config(raw | SHORT, "s.yaml").gravity_dam
    assert dam.walls(40.0) == pytest.approx((0.0, 5.0, 7.5, 70 - 40 * 50.75 / 66.5))
    assert dam.slices == {"left": 20.0, "1": 20.0, "2": 0.0, "3": 10.0, "right": 10.0}
    assert dam.lowest == 0.0 and dam.crest == 103.0


SHORT = {
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "transient": {"finest_step": 0.01},
    "model": {"order": "full"},
}


@pytest.mark.parametrize(("share", "more"), [(0.0, 1.0), (0.5, 1.0375), (1.0, 1.15)])
def test_arches_thicken_with_the_square_of_the_angle(share, more):
    """At the crest the faces are arcs of 125 m about the axis and of 116 m about 2 m before it."""
    shape = ArchShape(parse_config(arch_dam() | SHORT, "s.yaml").arch_dam, "s.yaml")
    theta = share * shape.end
    outer, inner = (shape.point(np.array(theta), np.array(side), np.array(100.0)) for side in (0.0, 1.0))
    assert np.hypot(outer[0], outer[1] - 123.0) == pytest.approx(125.0)
    thin = 2.0 * np.cos(theta) + (116.0**2 - (2.0 * np.sin(theta)) ** 2) ** 0.5
    assert np.hypot(inner[0], inner[1] - 123.0) == pytest.approx(125.0 - more * (125.0 - thin))


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.3 g", "m/s^2", 0.3 * 9.80665),
        ("20 GPa/m", "N/m^3", 20e9),
        ("5 %", "", 0.05),
        ("2.4 t/m3", "kg/m^3", 2400.0),
        ("1.5 min", "s", 90.0),
        ("30 mm", "m", 0.03),
    ],
)
def test_units(text, unit, value):
    assert to_si(text, unit) == pytest.approx(value, rel=1e-12)


def test_drains_leave_what_they_do_not_take():
    """67 % by the USBR's rule where nothing is said; 1 - 0.4."""
    assert DrainsConfig(at=3.0, rule="usbr").share_left == pytest.approx(1 / 3, abs=0.01)
    assert DrainsConfig(at=3.0, rule="usace", effectiveness=0.4).share_left == pytest.approx(0.6)
