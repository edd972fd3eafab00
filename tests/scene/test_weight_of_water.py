"""What still water and water in joints weigh with."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from test_cli import SMALL

from romdam.config import parse_config
from romdam.config.plausible import check_assumptions
from romdam.scene.build import build_scene


@pytest.mark.parametrize(
    ("gravity", "weight"),
    [(None, 9.81), ([0, 0, -9.81], 9.81), ([0, 0, 0], 9.81), ([3, 0, 0], 9.81), ([3, 0, -4], 4)],
)
def test_water_weighs_with_the_vertical_part_of_gravity(gravity, weight):
    """Gravity of zero leaves out the weight of blocks; a reservoir presses all the same."""
    raw = yaml.safe_load(SMALL)
    wet = {"level": 15.0, "faces": [{"block": "right", "face": "xmin"}]}
    raw["loads"] = {"hydrostatic": [wet], "joint_water": [{"joints": ["gap"], "level": 10.0}]}
    raw["loads"] |= {} if gravity is None else {"gravity": gravity}
    config = parse_config(raw, "dam.yaml")
    scene = build_scene(config, Path(), "dam.yaml")
    assert [one.weight for one in scene.loads.water] == [1000.0 * weight]
    raw["loads"]["gravity"] = [0, 0, -9.81]
    reference = build_scene(parse_config(raw, "dam.yaml"), Path(), "dam.yaml")
    water, whole = (one.joints["gap"].water for one in (scene, reference))
    np.testing.assert_allclose(water, weight / 9.81 * whole, rtol=1e-14)
    assert whole.sum() > 0.0
    said = [line for line in check_assumptions(config) if "has no vertical part" in line]
    assert len(said) == (gravity is not None and gravity[2] == 0)
