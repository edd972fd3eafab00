"""Joints grouted under pressure: what they then carry, and how it goes with the loads that follow."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from arch_dams import arch_dam
from simulating import simulated

from romdam.config import parse_config
from romdam.core.errors import ConvergenceError
from romdam.effects.full_order import assemble_full
from romdam.reduction.synthesis import reduce_scene
from romdam.results.variables import COORDINATES, Case
from romdam.scene.build import build_scene
from romdam.timestepping.equilibrium import static_equilibrium
from romdam.timestepping.grouting import _filled_at_points, grouted

PRESSURE = 0.4e6


def three_blocks(order, held=("a", "b", "c"), heights=(6, 6, 6), width=2.0, second=None, **joint):
    """Cantilevers side by side along x, two joints; `joint` of the first, `second` of the other."""
    boxes = {
        name: {
            "origin": [width * k, 0, 0],
            "size": [width, 2, height],
            "element_size": [width, 2, 2],
            "element": "hex8",
        }
        for k, (name, height) in enumerate(zip("abc", heights, strict=True))
    }
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400}},
        "blocks": {name: {"material": "concrete", "box": box} for name, box in boxes.items()},
        "supports": [{"block": name, "face": "zmin"} for name in held],
        "joints": {
            "J1": {"between": ["a", "b"], "normal_stiffness": 2e10} | joint,
            "J2": {"between": ["b", "c"], "normal_stiffness": 2e10} | (second or {}),
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


GROUTED = {"normal_stiffness": 2e10, "shear_stiffness": 1e10, "grouting_pressure": PRESSURE}
SHEAR_LAWS = {
    "friction": {"friction": 0.6},
    "one direction": {"friction": [0.6, 0.2]},
    "static friction": {"friction": 0.5, "friction_static": 0.7},
    "velocity": {"velocity_friction": {"mu_s": 0.7, "mu_d": 0.5, "v_c": 0.01}},
    "weakening": {"slip_weakening": {"mu_s": 0.7, "mu_d": 0.5, "d_c": 0.02}},
    "rough": {"barton_bandis": {"JRC": 8.0, "JCS": 50e6, "mu_b": 0.6}},
    "key": {"shear_key": {"depth": 0.05}},
    "bond": {"friction": 0.3, "cohesion": 1e6, "tensile_strength": 0.5e6},
    "dashpot": {"friction": 0.6, "viscosity": 1e6},
    "tension": {"friction": 0.6, "tension_stiffness": 1e9},
    "initial gap": {"friction": 0.6, "gap": 1e-3},
    "rigid": {"friction": 0.6, "normal_stiffness": "rigid"},
}


def assert_pressure_alone(scene, system, gaps, pressure=PRESSURE):
    """Each gap carries pressure times area and no shear, and its jump counts from there."""
    force = pressure * np.concatenate([joint.area for joint in scene.joints.values()])
    assert gaps.force[:, 0] == pytest.approx(force, rel=1e-9)
    assert np.abs(gaps.force[:, 1:]).max() < 1e-9 * force.min()
    assert gaps.jump[:, 0] == pytest.approx(-force / system.law.K_n, rel=1e-9, abs=1e-15)
    assert np.abs(gaps.jump[:, 1:]).max() < 1e-15


@pytest.mark.parametrize("law", SHEAR_LAWS)
@pytest.mark.parametrize("order", ["reduced", "full"])
def test_grouted_joints_hold_no_shear_at_rest(order, law):
    """Blocks of three heights slide against each other as the pressure bends them: the grout sets after."""
    keys = GROUTED | SHEAR_LAWS[law]
    scene, system = three_blocks(order, heights=(6, 10, 8), width=10.0, second=keys, **keys)
    after = grouted(system, 1e-12)
    assert np.abs(after.law.slip).max() > 1e-6  # what it counts from is not where the blocks stood
    assert_pressure_alone(scene, after, static_equilibrium(after, 1e-12)[1])


def test_a_gap_that_the_other_joint_closes_keeps_what_it_bears():
    """J2 is grouted at ten times the pressure of J1 and closes that: grout and contact add up in its gaps.

    (K + B1^T k B1) q = (B1^T p1 + B2^T p2) A with all gaps of J1 closed, which the solution confirms.
    """
    low, high = 0.1 * PRESSURE, PRESSURE
    scene, system = three_blocks("full", grouting_pressure=low, second={"grouting_pressure": high})
    J1, J2 = (joint.area for joint in scene.joints.values())
    B, k = system.B.toarray(), 2e10 * J1
    B1, B2 = B[: len(J1)], B[len(J1) :]
    q = np.linalg.solve(system.K.toarray() + B1.T @ (k[:, None] * B1), B1.T @ (low * J1) + B2.T @ (high * J2))
    assert (B1 @ q < 0.0).all() and (B2 @ q > 0.0).all()
    after = grouted(system, 1e-12)
    found, gaps = static_equilibrium(after, 1e-12)
    assert found == pytest.approx(q, rel=1e-8, abs=1e-12 * np.abs(q).max())
    assert gaps.force[: len(J1), 0] == pytest.approx(low * J1 - k * (B1 @ q), rel=1e-8)
    assert gaps.force[len(J1) :, 0] == pytest.approx(high * J2, rel=1e-8)


def test_grout_fills_what_is_open_where_the_joint_is_looked_at():
    """[mm]: gaps open by 2, -0.3, 2, and 2 without grout; at their positions by 0.5, 0.5, -3 and 0.5 more.

    Of 2.5, 0.2 and -1 at the position 2.5, 0.2 and 0 are filled, and 2, 0 and 2 are off already.
    """
    more = 1e-3 * np.array([0.5, 0.5, -3.0, 0.5])
    at_rest = 1e-3 * np.array([2.0, -0.3, 2.0, 2.0])
    system = SimpleNamespace(at_point=np.diag(more), law=SimpleNamespace(directions=1))
    fills = np.array([True, True, True, False])
    shift = _filled_at_points(system, np.ones(4), at_rest[:, None], fills)
    assert shift == pytest.approx(1e-3 * np.array([-0.5, -0.2, 2.0, 0.0]), abs=1e-18)


@pytest.mark.parametrize("integrator", ["modal", "adaptive", "generalized_alpha"])
@pytest.mark.parametrize("law", ["friction", "key"])
def test_a_grouted_dam_stays_at_rest(integrator, law):
    keys = GROUTED | SHEAR_LAWS[law]
    scene, system = three_blocks("reduced", heights=(6, 10, 8), width=10.0, second=keys, **keys)
    history = simulated(grouted(system, 1e-12), np.zeros((3, 21)), 0.01, integrator, tolerance=1e-12)
    force = PRESSURE * np.concatenate([joint.area for joint in scene.joints.values()])
    for row in (0, -1):
        assert history.traction[row, :, 0] == pytest.approx(force, rel=1e-8)
        assert np.abs(history.traction[row, :, 1:]).max() < 1e-8 * force.min()


def test_an_arch_dam_with_friction_holds_no_shear_at_rest():
    """Curved joints that taper, mixed cells of rock below, gaps at corners."""
    raw = arch_dam() | {
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"order": "full"},
        "transient": {"finest_step": 0.01},
    }
    raw["arch_dam"]["joints"] = raw["arch_dam"]["joints"] | {"grouting_pressure": PRESSURE}
    config = parse_config(raw, "dam.yaml")
    scene = build_scene(config, Path(), "dam.yaml")
    after = grouted(assemble_full(scene, config.damping), 1e-12)
    assert_pressure_alone(scene, after, static_equilibrium(after, 1e-12)[1])


@pytest.mark.parametrize("order", ["reduced", "full"])
def test_what_other_joints_lost_in_grouting_stays_lost(order):
    """J1's pressure slides J2, whose bond breaks; then a load takes most of the push back (J1 is soft).

    Both at once would leave the bond whole, and it would hold shear.
    """
    bond = {"shear_stiffness": 1e10, "cohesion": 1e5}
    soft = {"normal_stiffness": 1e6, "grouting_pressure": PRESSURE}
    scene, system = three_blocks(order, heights=(6, 8, 4), second=bond, **soft)
    first, second = (system.law.joints[name] for name in ("J1", "J2"))
    push = np.asarray(system.B[::3][first].T @ (PRESSURE * scene.joints["J1"].area))
    after = grouted(system, 1e-12)
    at_once = replace(after.law, memory=np.zeros((0, 0, 0)), slipped=np.zeros((0, 2)))
    for law, holds in ((after.law, False), (at_once, True)):
        _, gaps = static_equilibrium(replace(after, law=law, force=-0.97 * push), 1e-12)
        assert (np.abs(gaps.force[second, 1:]).max() > 1e4) == holds


def test_mirrored_gaps_are_merged_with_what_they_slid_in_grouting():
    """A dam symmetric about a plane across its joints: merged contacts give the same history."""
    keys = GROUTED | {"friction": 0.3}
    _, system = three_blocks("reduced", heights=(6, 8, 6), second=keys, **keys)
    after = grouted(system, 1e-12)
    time = 0.005 * np.arange(121)
    ground = np.stack([0.0 * time, 0.0 * time, 6.0 * np.sin(30.0 * time)])
    ground[0] = 8.0 * np.sin(20.0 * time)
    one, other = (
        simulated(after, ground, 0.005, "adaptive", tolerance=1e-11, merge_contacts=merge)
        for merge in (True, False)
    )
    assert one.stats["integrated_gaps"] < other.stats["integrated_gaps"] == len(system.law)
    for name in ("jump", "traction"):
        values = getattr(other, name)
        assert np.abs(getattr(one, name) - values).max() < 1e-6 * np.abs(values).max()
