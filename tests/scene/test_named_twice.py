"""What a list names twice acts twice: it is refused, whatever selects it."""

from pathlib import Path

import numpy as np
import pytest

from romdam.config import parse_config
from romdam.core.errors import ConfigError
from romdam.fem.loads import static_force
from romdam.scene.build import build_scene

UPSTREAM = {"block": "low", "face": "ymin"}
PLANE = {"block": "low", "face": {"axis": "y", "at": 0.0}}
OTHER = {"block": "high", "face": "ymin"}


def built(**sections):
    """Two blocks on each other, wet from the side."""
    boxes = {
        name: {
            "material": "concrete",
            "box": {"origin": [0, 0, z], "size": [2, 2, 4], "element_size": 2.0, "element": "hex8"},
        }
        for name, z in (("low", 0), ("high", 4))
    }
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400, "expansion": 1e-5}},
        "blocks": boxes,
        "supports": [{"block": "low", "face": "zmin"}],
        "ties": {"lift": {"between": ["low", "high"]}},
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": 2},
        "transient": {"finest_step": 0.01},
    }
    return build_scene(parse_config(raw | sections, "dam.yaml"), Path(), "dam.yaml")


def still(*faces, **keys):
    return {"level": 3.5, "faces": list(faces)} | keys


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        (
            {"loads": {"hydrostatic": [still(UPSTREAM, UPSTREAM)]}},
            r"hydrostatic\[0\]\.faces\[1\]: 2 of 2 facets",
        ),
        (
            {"loads": {"hydrostatic": [still(UPSTREAM, OTHER, PLANE)]}},
            r"faces\[2\]: 2 of 2 facets of block 'low'",
        ),
        (
            {"loads": {"hydrostatic": [still(UPSTREAM), still(PLANE)]}},
            r"hydrostatic\[1\]\.faces\[0\]: 2 of 2",
        ),
        ({"water": still(UPSTREAM, OTHER, PLANE, model="westergaard")}, r"water\.faces\[2\]: 2 of 2 facets"),
        (
            {"loads": {"temperature": [{"change": -4.0, "blocks": ["low", "low"]}]}},
            r"temperature\[0\]: the change of block 'low' is named by .*\[0\] already \(-4 K\)",
        ),
        (
            {"loads": {"temperature": [{"change": -4.0}, {"change": -6.0, "blocks": ["high"]}]}},
            r"temperature\[1\]: the change of block 'high' is named by loads\.temperature\[0\]",
        ),
    ],
)
def test_named_twice_is_refused(sections, message):
    with pytest.raises(ConfigError, match=message):
        built(**sections)


def test_faces_that_overlap_in_part_are_refused(tmp_path):
    """One group of a mesh holds a facet of another."""
    scene = built(loads={"hydrostatic": [still(UPSTREAM)]})
    facets = scene.blocks["low"].faces["ymin"]
    from romdam.scene.select import refuse_selected_twice

    seen = {}
    refuse_selected_twice(seen, "low", facets[:1], "faces[0]")
    with pytest.raises(
        ConfigError, match=r"faces\[1\]: 1 of 2 facets of block 'low' are named by faces\[0\]"
    ):
        refuse_selected_twice(seen, "low", facets[:, ::-1], "faces[1]")
    with pytest.raises(ConfigError, match=r"faces\[2\]: 1 of 2 facets of block 'high' stand twice"):
        refuse_selected_twice(seen, "high", facets[[1, 1]], "faces[2]")


def test_fluids_of_two_densities_add_up():
    """Silt as a heavier fluid on the lower half: 1/2 rho g h^2 b each."""
    silt = still(UPSTREAM, density=900.0) | {"level": 3.0}
    scene = built(loads={"hydrostatic": [still(UPSTREAM, OTHER, level=7.0), silt]})
    total = sum(static_force(scene, name).reshape(-1, 3).sum(axis=0) for name in scene.blocks)
    exact = 9.81 * 2.0 * 0.5 * (1000.0 * 7.0**2 + 900.0 * 3.0**2)
    np.testing.assert_allclose(total, [0.0, exact, 0.0], atol=1e-9 * exact)
