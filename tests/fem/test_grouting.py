"""Joints grouted under pressure: what they then carry, and how it goes with the loads that follow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulating import simulated

from romdam.config import parse_config
from romdam.core.errors import ConvergenceError
from romdam.fem.unreduced import assemble_full
from romdam.reduction.synthesis import reduce_scene
from romdam.results.variables import COORDINATES, Case
from romdam.scene.build import build_scene
from romdam.timestepping.equilibrium import static_equilibrium
from romdam.timestepping.grouting import grouted

PRESSURE = 0.4e6


def three_blocks(order, held=("a", "b", "c"), **joint):
    """Cantilevers side by side along x, two joints; `joint` of the first, the second is as stiff."""
    boxes = {
        name: {"origin": [2.0 * k, 0, 0], "size": [2, 2, 6], "element_size": 2.0, "element": "hex8"}
        for k, name in enumerate("abc")
    }
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400}},
        "blocks": {name: {"material": "concrete", "box": box} for name, box in boxes.items()},
        "supports": [{"block": name, "face": "zmin"} for name in held],
        "joints": {
            "J1": {"between": ["a", "b"], "normal_stiffness": 2e10} | joint,
            "J2": {"between": ["b", "c"], "normal_stiffness": 2e10},
        },
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": 6},
        "transient": {"finest_step": 0.01},
    }
    config = parse_config(raw, "dam.yaml")
    scene = build_scene(config, Path(), "dam.yaml")
    if order == "full":
        return scene, assemble_full(scene, config.damping)
    return scene, reduce_scene(scene, config.model, config.damping).system


@pytest.mark.parametrize("stiffness", [2e10, "rigid"])
@pytest.mark.parametrize("order", ["reduced", "full"])
def test_without_other_loads_the_joint_carries_the_pressure(order, stiffness):
    """p A in every gap, and in the other joint what the bent blocks press through it."""
    scene, system = three_blocks(order, normal_stiffness=stiffness, grouting_pressure=PRESSURE, gap=1e-3)
    after = grouted(system, 1e-12)
    q, gaps = static_equilibrium(after, 1e-12)
    first = after.law.joints["J1"]
    force = PRESSURE * scene.joints["J1"].area
    assert gaps.force[first, 0] == pytest.approx(force, rel=1e-9)
    assert gaps.state[after.law.joints["J2"]].any()
    # the blocks stand where the pressure alone, on open joints, has pushed them
    pushed = system.B[: len(force)].T @ force
    other = after.law.joints["J2"]
    pressed = system.B[other.start : other.stop].T @ gaps.force[other, 0]
    assert system.K @ q == pytest.approx(pushed + pressed, abs=1e-9 * np.abs(pushed).max())
    assert grouted(after, 1e-12) is after


def test_pressure_goes_as_the_joint_is_pulled_apart():
    """A load that moves the blocks apart lowers it linearly until the joint opens."""
    scene, system = three_blocks("reduced", grouting_pressure=PRESSURE)
    after = grouted(system, 1e-12)
    pull = -after.B[: len(scene.joints["J1"].area)].T @ (-0.1 * PRESSURE * scene.joints["J1"].area)
    forces = []
    for share in (0.0, 1.0, 2.0, 40.0):
        _, gaps = static_equilibrium(replace(after, force=share * np.asarray(pull)), 1e-12)
        forces.append(gaps.force[after.law.joints["J1"], 0].sum())
    assert forces[0] > forces[1] > forces[2] > forces[3] == 0.0
    assert forces[0] - forces[1] == pytest.approx(forces[1] - forces[2], rel=1e-6)


def test_result_names_the_gap_before_and_after_grouting():
    """Openings count from the one after: opening less the jump of the displacement is it."""
    scene, system = three_blocks("reduced", grouting_pressure=PRESSURE, gap=1e-3)
    after = grouted(system, 1e-12)
    history = simulated(after, np.zeros((3, 3)), 0.01, "modal")
    case = Case(scene, None, history)
    before, then = (COORDINATES[name].get(case) for name in ("initial_gap", "grouted_gap"))
    first = after.law.joints["J1"]
    np.testing.assert_array_equal(before[first], 1e-3)
    assert (then[first] < 0.0).all() and (then[after.law.joints["J2"]] == 0.0).all()
    opening = history.jump[0, :, 0]
    assert opening - system.B @ history.q[0] == pytest.approx(then, abs=1e-15)
    assert not COORDINATES["grouted_gap"].when(Case(three_blocks("reduced")[0], None, history))


def test_blocks_that_nothing_holds_are_told():
    _, system = three_blocks("reduced", held=("a", "b"), normal_stiffness=2e10)
    law = replace(system.law, grout=np.where(np.arange(len(system.law)) < 8, 0.0, 1e4))
    with pytest.raises(ConvergenceError, match=r"joints: grouting_pressure acts before weight and water"):
        grouted(replace(system, law=law), 1e-10)
