"""Two blocks pressed together in a tilted plane, by mortar gaps: uniform stress, exact resultants.

Supports are statically determinate, so their reactions vanish and the blocks strain freely.
"""

from pathlib import Path

import numpy as np
import pytest
from mortar_blocks import FACE, SIZE, pair, turn

from romdam.config.sections.job import DampingConfig
from romdam.config.sections.joints import JointConfig
from romdam.core.scene import FacePressure, PointForce, Scene, StaticLoads
from romdam.effects.full_order import assemble_full
from romdam.fem.parts import unknowns
from romdam.fem.stress import stress_operator
from romdam.scene.joints import build_joint
from romdam.timestepping.equilibrium import static_equilibrium

PRESSURE = 2e6
PAIRS = [
    (("hex8", 3), ("hex8", 4)),
    (("hex20", 2), ("hex20", 3)),
    (("tet10", 2), ("tet10", 3)),
    (("hex8", 3), ("tet10", 2)),
    (("hex27", 2), ("tet4", 3)),
    (("wedge6", 3), ("pyramid5", 2)),
    (("wedge15", 2), ("pyramid13", 3)),
]
LAWS = {
    "penalty": {"normal_stiffness": 20e9},
    "rigid": {"normal_stiffness": "rigid"},
    "friction": {"normal_stiffness": 20e9, "shear_stiffness": 8e9, "friction": 0.6},
}
AXIS = turn()[:, 1]


def corners(block, y):
    """Nodes at the corners of a face at y of the cube before it was turned."""
    at = [turn() @ [x, y, z] for x in (0.0, SIZE) for z in (0.0, SIZE)]
    return [int(np.argmin(np.linalg.norm(block.points - x, axis=1))) for x in at]


def pressed(left, right, law, forces=()):
    """The two blocks, held at nodes of their outer faces without more reactions than there must be."""
    blocks = {block.name: block for block in pair(left, right)}
    fixed = {name: np.zeros((len(block.points), 3), dtype=bool) for name, block in blocks.items()}
    a, b, c, _ = corners(blocks["left"], 0.0)
    d, e, *_ = corners(blocks["right"], 2.0 * SIZE)
    fixed["left"][a] = True
    fixed["left"][b, :2] = fixed["left"][c, 1:2] = True
    if "friction" not in law:  # which holds the block by itself
        fixed["right"][d, [0, 2]] = fixed["right"][e, 0] = True
    config = JointConfig(between=("left", "right"), **law)
    joint = build_joint("c", config, blocks, fixed, Path(), "s.yaml")
    loads = (
        ()
        if forces
        else tuple(
            FacePressure(name, blocks[name].faces[face], PRESSURE)
            for name, face in (("left", "ymin"), ("right", "ymax"))
        )
    )
    point = tuple(
        PointForce(name, node, sign * size * AXIS)
        for name, y, sign in (("left", 0.0, 1.0), ("right", 2.0 * SIZE, -1.0))
        for node, size in zip(corners(blocks[name], y), forces, strict=False)
    )
    scene = Scene(blocks, {"c": joint}, fixed, StaticLoads(pressures=loads, forces=point))
    system = assemble_full(scene, DampingConfig())
    q, gaps = static_equilibrium(system, 1e-10)
    return scene, system, q, gaps


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("left", "right"), PAIRS, ids=[f"{a[0]}-{b[0]}" for a, b in PAIRS])
def test_uniform_pressure_gives_uniform_stress(left, right, law):
    scene, _, q, gaps = pressed(left, right, LAWS[law])
    joint, directions = scene.joints["c"], gaps.force.shape[1]
    assert directions == (3 if law == "friction" else 1)
    np.testing.assert_allclose(gaps.force[:, 0] / joint.area, PRESSURE, rtol=1e-9)
    exact = -PRESSURE * np.outer(AXIS, AXIS)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    for name, block in scene.blocks.items():
        u = unknowns(scene).of_block[name] @ q
        stress = (stress_operator(block, np.arange(len(block.points))) @ u).reshape(-1, 6)
        for tensor in stress:
            assert sorted(tensor[:3]) == pytest.approx(sorted(np.diag(exact)), abs=1e-9 * PRESSURE)
        shear = sorted(exact[k, l] for k, l in pairs[3:])
        assert np.abs(np.sort(stress[:, 3:], axis=1) - shear).max() < 1e-9 * PRESSURE


@pytest.mark.parametrize(("left", "right"), PAIRS, ids=[f"{a[0]}-{b[0]}" for a, b in PAIRS])
def test_force_and_moment_pass_exactly(left, right):
    sizes = (3e6, 4e6, 5e6, 4.5e6)
    scene, _, _, gaps = pressed(left, right, LAWS["penalty"], sizes)
    joint, block = scene.joints["c"], scene.blocks["left"]
    nodal = joint.weights[0].T @ (gaps.force[:, :1] * joint.axes[:, 0])
    arms, outer = block.points[joint.nodes[0]], block.points[corners(block, 0.0)]
    applied = np.array(sizes)[:, None] * AXIS
    assert (gaps.force[:, 0] > 0.0).any()
    np.testing.assert_allclose(nodal.sum(axis=0), applied.sum(axis=0), atol=1e-9 * sum(sizes))
    moments = np.cross(arms, nodal).sum(axis=0), np.cross(outer, applied).sum(axis=0)
    np.testing.assert_allclose(*moments, atol=1e-9 * sum(sizes) * SIZE)
    assert pytest.approx(joint.whole_area.sum(), rel=1e-12) == FACE
