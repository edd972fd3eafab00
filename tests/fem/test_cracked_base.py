"""Uplift of a cracked base, redrawn until it agrees with the stresses, against rigid sections by hand."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from romdam.config import parse_config
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.scene import PointForce
from romdam.effects.full_order import assemble_full
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.scene.joint_water import cracked_base
from romdam.scene.joint_water.build import with_water
from romdam.timestepping.equilibrium import static_equilibrium
from romdam.timestepping.uplift import with_uplift_at_rest

G = 9.81
LENGTH, WIDTH, HEIGHT, LEVEL, TAIL = 10.0, 2.0, 8.0, 8.0, 1.0
GAMMA = 1000.0 * G
LIGHT = 1300.0  # density at which the heel opens
TOLERANCE = 1e-10


def scene_of(water, cells=64, rho=LIGHT, along=1, **joint):
    """A rigid block on a rigid slab with springs between, heel at y = 0 [SI]."""
    boxes = {"rock": ([0, 0, -2], [WIDTH, LENGTH, 2]), "dam": ([0, 0, 0], [WIDTH, LENGTH, HEIGHT])}
    raw = {
        "materials": {"concrete": {"E": 1e14, "nu": 0.0, "rho": rho}},
        "blocks": {
            name: {
                "material": "concrete",
                "box": {
                    "origin": at,
                    "size": size,
                    "element": "hex8",
                    "element_size": [size[0] / along, LENGTH / cells, size[2]],
                },
            }
            for name, (at, size) in boxes.items()
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": {"between": ["rock", "dam"], "normal_stiffness": 1e10, "shear_stiffness": 1e10}
            | {"friction": 0.9}
            | joint
        },
        "loads": {
            "gravity": [0, 0, -G],
            "hydrostatic": [{"level": LEVEL, "faces": [{"block": "dam", "face": "ymin"}]}],
            "joint_water": [
                {"joints": ["base"], "level": LEVEL, "downstream": [0, 1, 0], "tailwater": TAIL} | water
            ],
        },
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": 4},
        "damping": {"rayleigh": {"alpha": 0.5, "beta": 1e-4}},
        "transient": {"finest_step": 0.01},
    }
    config = parse_config(raw, "dam.yaml")
    return build_scene(config, Path(), "dam.yaml"), config


def at_rest(scene, config, order="reduced"):
    """The system with its uplift, and its gaps in equilibrium."""
    if order == "full":
        system = assemble_full(scene, config.damping)
    else:
        system = reduce_scene(scene, config.model, config.damping).system
    system = with_uplift_at_rest(system, TOLERANCE)
    return system, static_equilibrium(system, TOLERANCE)[1]


def crack_by_hand(rho):
    """Without drains the crack follows from a linear equation, whatever the tailwater.

    The effective stress is linear from nothing at the tip to the toe, b = L - a long, so with all forces
    by the unit weight of water and width: (V - U) b / 3 = M - M_U about the toe. With
    U = H1 L - (H1 - H2) b / 2 and M_U = H1 L^2 / 2 - (H1 - H2) b^2 / 6 the squares cancel, and
    b = 3 (M - H1 L^2 / 2) / (V - H1 L).
    """
    weight = rho / 1000.0 * LENGTH * HEIGHT
    moment = weight * LENGTH / 2 - LEVEL**3 / 6
    return LENGTH - 3.0 * (moment - LEVEL * LENGTH**2 / 2) / (weight - LEVEL * LENGTH)


def trapezia(heads):
    """Area and moment about the heel of a piecewise linear head."""
    parts = [(a, b - a, p, q) for (a, p), (b, q) in pairwise(heads)]
    area = sum(d * (p + q) / 2 for _, d, p, q in parts)
    return area, sum(d * (a * (p + q) / 2 + d * (p + 2 * q) / 6) for a, d, p, q in parts)


def heads_of(a, drains):
    """Head at distances from the heel, for a crack of length a."""
    if drains is None or a >= drains["at"]:
        return [(0.0, LEVEL), (a, LEVEL), (LENGTH, TAIL)]
    at, left = drains["at"], 1.0 - drains["effectiveness"]
    if drains["rule"] == "usace":
        left *= (LENGTH - at) / (LENGTH - a)
    return [(0.0, LEVEL), (a, LEVEL), (at, TAIL + left * (LEVEL - TAIL)), (LENGTH, TAIL)]


def crack_with_drains(rho, drains):
    """The crack between the heel and the drains."""
    weight = rho / 1000.0 * LENGTH * HEIGHT

    def beyond(a):
        uplift, moment = trapezia(heads_of(a, drains))
        from_toe = LENGTH - (weight * LENGTH / 2 + LEVEL**3 / 6 - moment) / (weight - uplift)
        return LENGTH - 3.0 * from_toe - a

    return brentq(beyond, 1e-3, drains["at"] - 1e-3)


def row_force(width, y, k, a):
    """Force on the k-th row of gaps for a tip at a, by Simpson's rule over pieces that the tip cuts [N]."""
    force = 0.0
    for other in y[[max(k - 1, 0), min(k + 1, len(y) - 1)]]:
        if other == y[k]:
            continue
        ends = sorted((y[k], other))
        cuts = [ends[0], *([a] if ends[0] < a < ends[1] else []), ends[1]]
        for begin, end in pairwise(cuts):
            at = np.array([begin, 0.5 * (begin + end), end])
            head = np.interp(at, [0.0, a, LENGTH], [LEVEL, LEVEL, TAIL])
            force += (end - begin) / 6 * (head * (at - other) / (y[k] - other)) @ [1.0, 4.0, 1.0]
    return GAMMA * width * force


def tip_of(system):
    tips = system.uplift.crack
    assert np.ptp(tips) < 1e-8 * LENGTH
    return float(tips.mean())


@pytest.mark.parametrize("order", ["reduced", "full"])
def test_the_crack_of_a_rigid_section(order):
    """Twice the crack of the unchanged diagram, and of the second order in the gaps' distance."""
    exact, off = crack_by_hand(LIGHT), []
    assert exact == pytest.approx(17.0 / 3.0, rel=1e-12)
    for cells in (16, 64):
        system, gaps = at_rest(*scene_of({"crack": "redrawn"}, cells=cells), order)
        off.append(abs(tip_of(system) - exact) / exact)
    assert off[0] < 0.021 and off[1] < 1.1e-3, off
    assert system.uplift.iterations < 60 and not system.uplift.warnings
    weight = LIGHT * G * LENGTH * WIDTH * HEIGHT
    uplift = GAMMA * WIDTH * trapezia(heads_of(tip_of(system), None))[0]
    assert gaps.force[:, 0].sum() == pytest.approx(weight - uplift, rel=1e-9)


DRAINS = {"at": 4.0, "rule": "usbr", "effectiveness": 0.5}


@pytest.mark.parametrize("rule", ["usbr", "usace"])
def test_drains_before_the_tip_still_work(rule):
    drains = DRAINS | {"rule": rule}
    system, _ = at_rest(*scene_of({"crack": "redrawn", "drains": drains}))
    exact = crack_with_drains(LIGHT, drains)
    assert exact == pytest.approx({"usbr": 3.33, "usace": 3.04}[rule], abs=0.01)
    assert tip_of(system) == pytest.approx(exact, rel=2e-3)


def test_drains_that_the_crack_has_passed_are_lost():
    """With drains of a quarter no crack agrees before them; beyond there are none."""
    drains = DRAINS | {"at": 1.0, "effectiveness": 0.25}
    system, _ = at_rest(*scene_of({"crack": "redrawn", "drains": drains}))
    assert tip_of(system) == pytest.approx(crack_by_hand(LIGHT), rel=1.1e-3)


def test_the_uplift_is_that_of_the_crack_in_the_result():
    """A fixed point: the crack read from the gaps is the crack that the uplift was drawn for."""
    scene, config = scene_of({"crack": "redrawn"}, along=3)
    system, gaps = at_rest(scene, config)
    joint = scene.joints["base"]
    y, water = joint.position[:, 1], joint.water + system.uplift.added
    a = tip_of(system)
    opening, line = gaps.jump[:, 0], np.isclose(joint.position[:, 0], 0.0)
    order = np.argsort(y[line])
    read = np.interp(0.0, -opening[line][order], y[line][order])  # where the jump is zero
    assert read == pytest.approx(a, abs=1e-8 * LENGTH)
    nodes = np.unique(y)
    for k, node in enumerate(nodes):
        assert water[y == node].sum() == pytest.approx(row_force(WIDTH, nodes, k, a), rel=1e-9)


def test_a_crack_that_finds_no_rest_is_refused():
    with pytest.raises(
        ConvergenceError, match=r"when joint base is cracked over .* m of 10 m there is no equilibrium"
    ):
        at_rest(*scene_of({"crack": "redrawn"}, rho=1150.0, cohesion=1e6))


def test_a_suite_draws_every_sample_anew():
    """What is drawn for one law is taken off before another is drawn: no trace of the first stays."""
    scene, config = scene_of({"crack": "redrawn"})
    system = reduce_scene(scene, config.model, config.damping).system
    first = with_uplift_at_rest(system, TOLERANCE)
    again = with_uplift_at_rest(replace(first, law=system.law), TOLERANCE)
    assert again.uplift.crack == pytest.approx(first.uplift.crack, rel=1e-7)
    assert again.force == pytest.approx(first.force, rel=1e-7, abs=1e-9 * np.abs(first.force).max())


def test_a_tip_that_differs_across_the_dam():
    """A weight at one side: tips line by line, and the pressure between them, by many points."""
    scene, config = scene_of({"crack": "redrawn"}, cells=32, along=4)
    corner = int(np.argmin(np.linalg.norm(scene.blocks["dam"].points - [WIDTH, 0.0, HEIGHT], axis=1)))
    push = PointForce("dam", corner, np.array([0.0, 0.0, -4e4]))
    scene = replace(scene, loads=replace(scene.loads, forces=(push,)))
    system, gaps = at_rest(scene, config)
    joint = scene.joints["base"]
    x, y = joint.position[:, 0], joint.position[:, 1]
    lines, tips = np.unique(x), []
    for line in lines:
        on = np.flatnonzero(x == line)
        on = on[np.argsort(y[on])]
        tips.append(np.interp(0.0, -gaps.jump[on, 0], y[on]))
        assert system.uplift.crack[on] == pytest.approx(tips[-1], abs=1e-8 * LENGTH)
    assert tips[0] - tips[-1] > 0.5 and (np.diff(tips) < 0.0).all()
    # midpoints of fine cells, with bilinear shape functions of the gaps
    n, rows = 400, np.unique(y)
    at_x = (np.arange(n) + 0.5) / n * WIDTH
    at_y = (np.arange(8 * n) + 0.5) / (8 * n) * LENGTH
    a = np.interp(at_x, lines, tips)[:, None]
    head = np.where(at_y < a, LEVEL, LEVEL + (TAIL - LEVEL) * (at_y - a) / (LENGTH - a))
    hats_x, hats_y = (
        np.array([np.interp(at, knots, unit) for unit in np.eye(len(knots))])
        for at, knots in ((at_x, lines), (at_y, rows))
    )
    force = GAMMA * (hats_x @ head @ hats_y.T) * WIDTH * LENGTH / (8 * n * n)
    water = joint.water + system.uplift.added
    numeric = force[np.searchsorted(lines, x), np.searchsorted(rows, y)]
    assert water == pytest.approx(numeric, rel=1e-5)


def test_lines_of_an_irregular_face_are_strips():
    """Gaps anywhere on a face of 20 m by 10 m: 19 strips two gaps wide, whose tips are those of the crack."""
    rng = np.random.default_rng(3)
    across, distance = rng.uniform(0.0, 20.0, 800), rng.uniform(0.0, 10.0, 800)
    line = cracked_base._lines(across, np.full(800, 200.0 / 800))
    assert line.max() + 1 == 19 and np.bincount(line).min() > 20
    assert (np.diff(line[np.argsort(across)]) >= 0).all()
    base = SimpleNamespace(line=line, distance=distance, length=np.full(19, 10.0))
    opening = 4.0 + 0.1 * across - distance  # the tip at 4 m to 6 m
    tips = cracked_base.CrackedBase.tips(base, opening, opening > 0.0, np.zeros(800, dtype=bool))
    middle = np.bincount(line, across) / np.bincount(line)
    assert np.abs(tips - (4.0 + 0.1 * middle)).max() < 0.5  # gaps of a strip are 0.25 m apart


def test_the_tip_between_two_gaps():
    """Where the jump is zero; in the middle of rigid gaps; at the next gap where a bond holds it."""
    one = SimpleNamespace(line=np.zeros(4, dtype=int), distance=np.arange(4.0), length=np.array([3.0]))

    def tip(opening, rigid=False):
        opening = np.array(opening)
        is_open = opening > 1e-9
        return cracked_base.CrackedBase.tips(one, opening, is_open, np.full(4, rigid))[0]

    assert tip([3.0, 1.0, -3.0, -7.0]) == pytest.approx(1.25)
    assert tip([3.0, 1.0, 0.0, 0.0], rigid=True) == 1.5
    assert tip([3.0, 1.0, 0.0, 0.0], rigid=[False, False, True, True]) == 1.5  # ahead of the last open gap
    assert tip([3.0, 1.0, 1e-10, -1.0]) == 2.0
    assert tip([-1.0, 1.0, 1.0, 1.0]) == 0.0 and tip([1.0, -1.0, 2.0, 2.0]) == 0.5
    assert tip([1.0, 1.0, 1.0, 1.0]) == 3.0


@pytest.mark.parametrize("axis", [[1, 0, 0], [-1, 0, 0], [0, -1, 0], [0.6, 0.8, 0]])
def test_a_turned_model_has_the_same_crack(axis):
    """Turned about the vertical, downstream with it: crack and forces stay."""
    scene, config = scene_of({"crack": "redrawn"}, cells=16)
    downstream = np.array(axis, dtype=float)
    turn = np.column_stack([np.cross(downstream, [0, 0, 1]), downstream, [0, 0, 1]])
    with_blocks = {name: replace(block, points=block.points @ turn.T) for name, block in scene.blocks.items()}
    water = config.loads.joint_water[0].model_copy(update={"downstream": tuple(axis)})
    joint = scene.joints["base"]
    bare = replace(joint, uplift=None, position=joint.position @ turn.T, axes=joint.axes @ turn.T)
    turned = with_water(bare, water, with_blocks, G, "turned")
    closed = np.zeros(2)
    assert turned.water == pytest.approx(joint.water, rel=1e-9)
    assert turned.uplift.length == pytest.approx([LENGTH, LENGTH], rel=1e-12)
    assert turned.uplift.force(closed) == pytest.approx(joint.water, rel=1e-9)
    order = 1 if np.isclose(turned.uplift.across @ [-1, 1], joint.uplift.across @ [-1, 1]) else -1
    tips = np.array([2.3, 4.7])
    assert turned.uplift.force(tips[::order]) == pytest.approx(joint.uplift.force(tips), rel=1e-9)


def test_gaps_that_are_open_apart_from_the_heel_keep_the_diagram():
    """A force on the crest, upstream, opens the toe: no water of the reservoir gets there."""
    scene, config = scene_of({"crack": "redrawn"})
    points = scene.blocks["dam"].points
    crest = np.flatnonzero((points[:, 1] == 0.0) & (points[:, 2] == HEIGHT))
    forces = tuple(PointForce("dam", int(node), np.array([0.0, -3.5e5, 0.0])) for node in crest)
    system, gaps = at_rest(replace(scene, loads=replace(scene.loads, forces=forces)), config)
    y, opened = scene.joints["base"].position[:, 1], gaps.state == 0
    assert opened.any() and y[opened].min() > 5.0
    assert (system.uplift.crack == 0.0).all() and (system.uplift.added == 0.0).all()
    (said,) = system.uplift.warnings
    assert f"open at rest at {opened.sum()} gaps that no crack joins to its heel" in said


def test_a_base_that_is_cracked_through():
    """Held by a bearing at its toe, the block stands on nothing: the level's pressure everywhere."""
    scene, config = scene_of({"crack": "redrawn"}, rho=100.0)
    held = scene.fixed["dam"].copy()
    held[scene.blocks["dam"].points[:, 1] == LENGTH] = True
    system, gaps = at_rest(replace(scene, fixed=scene.fixed | {"dam": held}), config)
    joint = scene.joints["base"]
    assert (system.uplift.crack == LENGTH).all() and (gaps.state == 0).all()
    assert joint.water + system.uplift.added == pytest.approx(GAMMA * LEVEL * joint.area, rel=1e-9)
    assert "joint base is cracked through at rest: the whole base there" in system.uplift.warnings[0]


def test_a_direction_across_the_sides_of_the_joint_is_refused():
    with pytest.raises(
        ConfigError, match=r"joint_water\[0\].downstream: lines .* begin at its side, not at its heel"
    ):
        scene_of({"crack": "redrawn", "downstream": [0.1, 1, 0]})
