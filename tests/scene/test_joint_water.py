"""Water in joints: its diagrams against integrals by hand, and what cannot be meant."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scene_builders import box

from romdam.config import parse_config
from romdam.config.sections.joint_water import JointWaterConfig
from romdam.config.sections.joints import JointConfig
from romdam.core.errors import ConfigError
from romdam.scene.build import build_scene
from romdam.scene.joint_water.diagram import Diagram, PressureOutline
from romdam.scene.joints import with_properties

RHO_G = 1000.0 * 9.81
LENGTH, WIDTH, HEEL, BASE = 12.0, 3.0, 2.0, 4.0  # of the dam's base; y of its heel, its height
LEVEL, TAIL = 24.0, 6.0


def water(**keys):
    return {"joints": ["base"], "level": LEVEL, "downstream": [0, 1, 0]} | keys


def build(entry, element="hex8", size=1.5, **joint):
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400}},
        "blocks": {
            "rock": box([0, 0, 0], [WIDTH, LENGTH + HEEL, BASE], [size, 2.0, BASE], element),
            "dam": box([0, HEEL, BASE], [WIDTH, LENGTH, 10], [size, 2.0, 5.0], element),
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {"base": {"between": ["rock", "dam"], "normal_stiffness": 1e11} | joint},
        "loads": {"joint_water": [entry]},
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": 4},
        "transient": {"finest_step": 0.01},
    }
    return build_scene(parse_config(raw, "dam.yaml"), Path(), "dam.yaml").joints["base"]


def trapezia(corners):
    """Resultant and moment about the heel of a piecewise linear head over the base, (distance, head) each."""
    force = moment = 0.0
    for (a, p), (b, q) in pairwise(corners):
        force += (b - a) * (p + q) / 2
        moment += (b - a) * (a * (p + q) / 2 + (b - a) * (p + 2 * q) / 6)
    return RHO_G * WIDTH * force, RHO_G * WIDTH * moment


H1, H2 = LEVEL - BASE, TAIL - BASE
AT = 2.7  # of the drains: within an element
DIAGRAMS = {
    "full": ({"downstream": None}, [(0, H1), (LENGTH, H1)]),
    "to the toe": ({}, [(0, H1), (LENGTH, 0)]),
    "linear": ({"tailwater": TAIL}, [(0, H1), (LENGTH, H2)]),
    "dry toe": ({"tailwater": BASE - 1}, [(0, H1), (LENGTH, 0)]),
    "usace": (
        {"tailwater": TAIL, "drains": {"at": AT, "rule": "usace", "effectiveness": 0.4}},
        [(0, H1), (AT, H2 + 0.6 * (H1 - H2) * (LENGTH - AT) / LENGTH), (LENGTH, H2)],
    ),
    "usace, gallery": (
        {"tailwater": TAIL, "drains": {"at": AT, "rule": "usace", "effectiveness": 0.4, "gallery": 10}},
        [(0, H1), (AT, 6 + 0.6 * (H1 - 6) * (LENGTH - AT) / LENGTH), (LENGTH, H2)],
    ),
    "usbr": (
        {"tailwater": TAIL, "drains": {"at": AT, "rule": "usbr"}},
        [(0, H1), (AT, H2 + (H1 - H2) / 3), (LENGTH, H2)],
    ),
    "another share": (
        {"drains": {"at": AT, "rule": "usbr", "effectiveness": "75 %"}},
        [(0, H1), (AT, H1 / 4), (LENGTH, 0)],
    ),
    "waterstop": ({"waterstop": AT}, [(0, H1), (AT, H1)]),
    "waterstop, tailwater": (
        {"waterstop": AT, "tailwater": TAIL},
        [(0, H1), (AT, H1), (AT, H2), (LENGTH, H2)],
    ),
}
MESHES = {
    "hex8": {},
    "tet4": {"element": "tet4"},
    "hex20 node to node": {"element": "hex20", "discretization": "node_to_node"},
    "tet10 corners": {"element": "tet10", "gaps": "corners", "discretization": "node_to_node"},
    "hex20 mortar": {"element": "hex20", "discretization": "mortar"},
}


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("diagram", DIAGRAMS)
def test_resultant_and_moment_are_those_of_the_diagram(diagram, mesh):
    """On any mesh and wherever the drains are: the pressure is integrated up to its kinks."""
    keys, corners = DIAGRAMS[diagram]
    joint = build(water(**keys), **MESHES[mesh])
    force, moment = trapezia(corners)
    assert joint.water_resultant == pytest.approx([0.0, 0.0, force], rel=1e-12, abs=1e-6)
    arm = joint.position[:, 1] - HEEL
    assert joint.water @ arm == pytest.approx(moment, rel=1e-12)


def test_a_crack_before_the_drains_lets_in_the_reservoir():
    """EM 1110-2-2200: H1 in the crack of length T, H2 + (1 - E) (H1 - H2) (L - X) / (L - T) at the drains."""
    tip, drained = 1.1, H2 + 0.6 * (H1 - H2) * (LENGTH - AT) / (LENGTH - 1.1)
    corners = [[0, HEEL], [WIDTH, HEEL], [WIDTH, HEEL + LENGTH], [0, HEEL + LENGTH]]
    ring = np.array([[x, y, BASE] for x, y in corners], dtype=float)
    outline = PressureOutline(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1), *np.eye(3)[[1, 0]])
    drains = {"at": AT, "rule": "usace", "effectiveness": 0.4}
    config = JointWaterConfig.model_validate(water(tailwater=TAIL, drains=drains), context={"si": True})
    diagram = Diagram(config, RHO_G, outline, np.array([[0.0, tip], [WIDTH, tip]]))
    x = np.array([0.3, tip, 1.9, AT, 7.0, LENGTH - 1e-9])
    points = np.column_stack([np.full_like(x, 1.0), HEEL + x, np.full_like(x, BASE)])
    expected = np.interp(x, [0.0, tip, AT, LENGTH], [H1, H1, drained, H2])
    assert diagram.pressure(points) == pytest.approx(RHO_G * expected, rel=1e-8)


def test_a_slanted_direction_counts_along_itself():
    """Downstream at 45 degrees: the head falls along each line from its own heel to its own toe."""
    joint = build(water(downstream=[1, 1, 0]))
    x, y = joint.position[:, 0], joint.position[:, 1] - HEEL
    middle = np.flatnonzero((x == 1.5) & (y == 6.0))[0]
    # its line enters at (0, 4.5) and leaves at (3, 7.5): half way
    assert joint.water[middle] / joint.area[middle] == pytest.approx(RHO_G * H1 / 2, rel=0.02)


def test_water_in_a_vertical_joint_stands_up_to_its_level():
    """rho g width depth^2 / 2 at a third of the depth, cut by the level within an element."""
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400}},
        "blocks": {"a": box([0, 0, 0], [4, 6, 9], 3.0), "b": box([4, 0, 0], [4, 6, 9], 3.0)},
        "supports": [{"block": name, "face": "zmin"} for name in "ab"],
        "joints": {"J": {"between": ["a", "b"], "normal_stiffness": 1e11}},
        "loads": {
            "joint_water": [{"joints": ["J"], "level": 7.3, "downstream": [0, 1, 0], "waterstop": 1.1}]
        },
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": 4},
        "transient": {"finest_step": 0.01},
    }
    raw["blocks"]["a"]["box"]["element_size"] = raw["blocks"]["b"]["box"]["element_size"] = [4, 2, 2.25]
    joint = build_scene(parse_config(raw, "dam.yaml"), Path(), "dam.yaml").joints["J"]
    force = RHO_G * 1.1 * 7.3**2 / 2
    # 5 of the corners' nodes are held on both sides: what they would bear moves nothing
    held = force - joint.water_resultant[0]
    assert 0.0 < held < 0.5 * force
    assert joint.water @ joint.position[:, 2] == pytest.approx(force * 7.3 / 3, rel=1e-12)


def test_a_sample_of_a_suite_keeps_the_water():
    """Joint laws change, what the water does in the gaps stays."""
    joint = build(water(crack="full"))
    sample = JointConfig(between=("rock", "dam"), normal_stiffness=2e10, tensile_strength=1e6, cohesion=2e6,
                         friction=0.5, shear_stiffness=1e10)  # fmt: skip
    varied = with_properties(joint, sample, Path(), "dam.yaml")
    assert np.array_equal(varied.water, joint.water)
    assert [rows.law.name for rows in varied.laws] == ["Bond", "CrackWater"]
    # full pressure in all gaps together, less what is there already
    whole = RHO_G * H1 * WIDTH * LENGTH
    assert varied.laws[1].values.sum() == pytest.approx(whole - joint.water.sum(), rel=1e-12)


WRONG = [
    (water(joints=["bas"]), "no 'bas' is defined; defined are base"),
    (water(joints=["base", "base"]), "stands in joint_water[0] already; name it once"),
    (
        water(level=3.9),
        "the water is not above the foot of joint 'base': 3.9 m, and it begins at 4 m; raise it",
    ),
    (water(tailwater=25.0), "`tailwater` at 25 m is above `level`, 24 m; lower it"),
    (water(downstream=None, tailwater=TAIL), "`tailwater` needs `downstream`, such as [0, 1, 0]"),
    (water(downstream=[0, 0, 0]), "`downstream` must have a length above 0"),
    (water(downstream=[0, 0, 1]), "is normal to joint 'base'"),
    (
        water(drains={"at": 12.0, "rule": "usbr"}),
        "12 m from the heel is outside joint 'base', which is 12 m long",
    ),
    (water(waterstop=13.0), "waterstop: 13 m from the heel is outside"),
    (
        water(drains={"at": 2.0, "rule": "usace"}),
        "`effectiveness` is missing; EM 1110-2-2200 has 0.25 to 0.5",
    ),
    (water(drains={"at": 2.0, "rule": "usbr", "gallery": 30.0}), "`drains.gallery` at 30 m is above `level`"),
    (water(crack="full", waterstop=1.0), "`crack: full` lets in the reservoir's pressure, and a waterstop"),
    (water(crack="full", downstream=None), "and without `downstream` it is there; leave it out"),
    (water(drains={"at": 2.0, "rule": "usbr"}, waterstop=1.0), "`drains` and `waterstop` exclude each other"),
]


@pytest.mark.parametrize(("entry", "message"), WRONG, ids=[message[:30] for _, message in WRONG])
def test_what_cannot_be_meant_is_refused(entry, message):
    with pytest.raises(ConfigError, match="joint_water") as caught:
        build(entry)
    assert message in str(caught.value)
