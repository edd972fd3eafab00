"""`normal_stiffness: auto`, `shear_stiffness: auto`: ten times that of the elements beside the joint."""

from pathlib import Path

import numpy as np
import pytest
from scene_builders import box

from romdam.config.sections.joints import JointConfig
from romdam.core.errors import ConfigError
from romdam.scene.joints import with_properties

CONCRETE, ROCK = (30e9, 0.18), (10e9, 0.25)
AXES = {"x": [0, 1, 2], "y": [1, 2, 0], "z": [2, 0, 1]}


def stiffness(left: float, right: float, *, shear: bool = False) -> float:
    """Ten times two layers one behind the other; heights in m."""

    def modulus(E, nu):
        return E / (2 * (1 + nu)) if shear else E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))

    return 10.0 / (left / modulus(*CONCRETE) + right / modulus(*ROCK))


def pair(along="y", left="hex8", right="hex8", heights=(1.0, 2.0), across=1.0, joint=()):
    """Boxes of 2 x 4 x 2 m that touch, the second of rock; `along` is the joint's normal."""
    turn = AXES[along]

    def turned(values):
        """Along the normal first."""
        placed = [0.0, 0.0, 0.0]
        for axis, value in zip(turn, values, strict=True):
            placed[axis] = value
        return placed

    blocks = {
        "left": box([0, 0, 0], turned([4, 2, 2]), turned([heights[0], 1, 1]), left),
        "right": box(turned([4, 0, 0]), turned([4, 2, 2]), turned([heights[1], across, across]), right),
    }
    blocks["right"]["material"] = "rock"
    lowest, highest = f"{along}min", f"{along}max"
    return {
        "materials": {
            "concrete": {"E": CONCRETE[0], "nu": CONCRETE[1], "rho": 2400},
            "rock": {"E": ROCK[0], "nu": ROCK[1], "rho": 2600},
        },
        "blocks": blocks,
        "supports": [{"block": "left", "face": lowest}, {"block": "right", "face": highest}],
        "joints": {
            "c": {"between": ["left", "right"], "normal_stiffness": "auto", "shear_stiffness": "auto"}
            | {"friction": 0.5}
            | dict(joint)
        },
    }


CASES = {
    "bricks along y": pair(),
    "bricks along x": pair("x"),
    "bricks along z": pair("z"),
    "quadratic bricks, mortar": pair(left="hex20", right="hex20"),
    "meshes that do not match": pair(across=0.5),
    "gaps farther apart than the nodes": pair(joint={"spacing": 2.0}),
}


@pytest.mark.parametrize("raw", CASES.values(), ids=CASES)
def test_a_joint_is_ten_times_as_stiff_as_the_elements_beside_it(make, raw):
    scene = make(raw)
    joint = scene.joints["c"]
    assert joint.K_n / joint.area == pytest.approx(stiffness(1.0, 2.0), rel=1e-12)
    assert joint.K_s / joint.area == pytest.approx(stiffness(1.0, 2.0, shear=True), rel=1e-12)
    told = [text for text in scene.remarks if "auto" in text]
    assert told == [
        f"joints: normal_stiffness: auto is {stiffness(1.0, 2.0) / 1e9:.4g} GPa/m in c, 10 times that of the "
        "elements beside the joint",
        f"joints: shear_stiffness: auto is {stiffness(1.0, 2.0, shear=True) / 1e9:.4g} GPa/m in c, 10 times "
        "that of the elements beside the joint",
    ]


def test_tetrahedra_count_by_their_height(make):
    """Tetrahedra within cubes of 1 m, those with a facet on the joint: all are as high as the cube."""
    joint = make(pair(left="tet4", heights=(1.0, 1.0))).joints["c"]
    assert joint.K_n / joint.area == pytest.approx(stiffness(1.0, 1.0), rel=1e-12)


def test_one_key_alone_and_a_finer_mesh(make):
    """Half the height is twice the stiffness: the joint tends to a rigid one with the mesh."""
    alone = make(pair(joint={"shear_stiffness": 5e9})).joints["c"]
    assert alone.K_s / alone.area == pytest.approx(5e9)
    assert alone.K_n / alone.area == pytest.approx(stiffness(1.0, 2.0), rel=1e-12)
    finer = make(pair(heights=(0.5, 1.0))).joints["c"]
    assert finer.K_n / finer.area == pytest.approx(2.0 * stiffness(1.0, 2.0), rel=1e-12)


def test_a_sample_of_a_suite_keeps_the_stiffness(make):
    joint = make(pair()).joints["c"]
    sample = JointConfig(
        between=("left", "right"), normal_stiffness="auto", shear_stiffness="auto", friction=0.9
    )
    varied = with_properties(joint, sample, Path(), "s.yaml")
    assert np.array_equal(varied.K_n, joint.K_n) and np.array_equal(varied.K_s, joint.K_s)
    assert (varied.mu == 0.9).all()


def test_other_words_are_refused_with_those_that_can_stand_there(make):
    with pytest.raises(ConfigError, match=r'c\.normal_stiffness: expected a stiffness .*"rigid" or "auto"'):
        make(pair(joint={"normal_stiffness": [1.0]}))
    with pytest.raises(ConfigError, match=r'c\.shear_stiffness: expected a stiffness .*or "auto"'):
        make(pair(joint={"shear_stiffness": [1.0]}))
