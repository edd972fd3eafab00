"""A joint with tension_stiffness equal to normal_stiffness is elastic, along its tangents too."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulating import simulated

from romdam.config import parse_config
from romdam.config.plausible import check_assumptions
from romdam.contact.laws.shear_stiffness import ElasticShear
from romdam.effects.full_order import assemble_full
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.equilibrium import static_equilibrium

ELASTIC = {"normal_stiffness": 2e10, "tension_stiffness": 2e10, "shear_stiffness": 0.7e10}


def config_of(joint, **sections):
    """Two columns of unlike height and stiffness side by side."""
    blocks = {
        name: {
            "material": name,
            "box": {"origin": [x, 0, 0], "size": [2, 2, h], "element_size": 2.0, "element": "hex8"},
        }
        for name, x, h in (("a", 0, 6), ("b", 2, 8))
    }
    raw = {
        "materials": {n: {"E": E, "nu": 0.2, "rho": 2400} for n, E in (("a", 30e9), ("b", 8e9))},
        "blocks": blocks,
        "supports": [{"block": name, "face": "zmin"} for name in blocks],
        "joints": {"J": {"between": ["a", "b"]} | joint},
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": "all"},
        "transient": {"finest_step": 0.01},
    }
    return parse_config(raw | sections, "dam.yaml")


def system_of(joint, order="reduced"):
    config = config_of(joint)
    scene = build_scene(config, Path(), "dam.yaml")
    if order == "full":
        return assemble_full(scene, config.damping)
    return reduce_scene(scene, config.model, config.damping).system


def bonded(system):
    """K with the joint's springs, by plain sums."""
    law = system.law
    D = np.column_stack([law.K_n, law.K_s, law.K_s]).ravel()
    B = system.B.toarray()
    return system.K.toarray() + B.T @ (D[:, None] * B)


@pytest.mark.parametrize("order", ["reduced", "full"])
@pytest.mark.parametrize("along", [(1.0, 0.0, 0.0), (-1.0, 0.3, 0.0), (0.2, 1.0, -0.5)])
def test_at_rest_it_is_a_linear_spring(order, along):
    """Pulled, pressed and sheared: against a solution of the linear equations."""
    system = system_of(ELASTIC, order)
    force = 1e3 * system.load[:, :3] @ np.array(along)
    force[: system.parts["a"].stop] *= -0.3
    q, gaps = static_equilibrium(replace(system, force=force), 1e-12)
    exact = np.linalg.solve(bonded(system), force)
    jump = (system.B @ exact).reshape(-1, 3)
    springs = -np.column_stack([system.law.K_n, system.law.K_s, system.law.K_s]) * jump
    assert np.abs(q - exact).max() < 1e-9 * np.abs(exact).max()
    assert np.abs(gaps.force - springs).max() < 1e-8 * np.abs(springs).max()
    assert gaps.stored == pytest.approx(0.5 * (jump * -springs).sum(), rel=1e-8)


@pytest.mark.slow
def test_shaken_it_swings_as_the_linear_system():
    """Against the modes of the linear system with the springs, under a half sine along the joint and across.

    A force that is constant over a step damps; at 20 us it takes 0.7 % of the motion.
    """
    system = system_of(ELASTIC)
    dt = 2e-5
    time = dt * np.arange(2501)
    ground = np.zeros((3, len(time)))
    ground[1] = 3.0 * np.sin(np.pi * time / 0.05)
    ground[0] = -0.4 * ground[1]
    history = simulated(system, ground, dt, "modal", stride=25, initial_state="undeformed")
    omega2, V = np.linalg.eigh(bonded(system))
    drive = -(V.T @ system.load[:, :3]) @ ground
    C = V.T @ system.C.toarray() @ V
    assert not system.C.count_nonzero(), C
    x, omega = np.zeros_like(drive), np.sqrt(omega2)
    cos, sin = np.cos(omega * dt), np.sin(omega * dt)
    v = np.zeros(len(omega))
    for k in range(len(time) - 1):  # exact for a load that is constant over the step at its mean
        rest = 0.5 * (drive[:, k] + drive[:, k + 1]) / omega2
        z = x[:, k] - rest
        x[:, k + 1], v = rest + z * cos + v / omega * sin, v * cos - z * omega * sin
    jump = (system.B @ V @ x[:, ::25]).T.reshape(len(history.time), -1, 3)
    assert np.abs(history.jump - jump).max() < 0.02 * np.abs(jump).max()


@pytest.mark.parametrize(
    "joint",
    [
        {"normal_stiffness": 2e10, "shear_stiffness": 1e10},
        {"normal_stiffness": 2e10, "shear_stiffness": 1e10, "tension_stiffness": 1e9},
        {"normal_stiffness": "rigid", "shear_stiffness": {"per_gap": 1e9}},
        {"normal_stiffness": 2e10, "shear_stiffness": 1e10, "viscosity": 1e5},
    ],
)
def test_shear_stiffness_that_nothing_bounds_is_said_to_do_nothing(joint):
    assert any(
        "joints.J.shear_stiffness: does nothing by itself" in line
        for line in check_assumptions(config_of(joint))
    )


@pytest.mark.parametrize(
    "keys",
    [
        {"friction": 0.0},
        {"friction": 0.6},
        {"cohesion": 1e6},
        {"shear_key": {"depth": 0.01}},
        {"tension_stiffness": 2e10},
    ],
)
def test_shear_stiffness_that_something_bounds_passes(keys):
    joint = {"normal_stiffness": 2e10, "shear_stiffness": 1e10} | keys
    config = config_of(joint)
    assert not any("shear_stiffness" in line for line in check_assumptions(config))
    assert (ElasticShear in config.joints["J"].every_law) == ("tension_stiffness" in keys)


def test_shear_stiffness_may_wait_for_a_friction_that_a_suite_varies():
    suite = {"parameters": {"mu": {"path": "joints.*.friction", "values": [0.3, 0.6]}}}
    config = config_of({"normal_stiffness": 2e10, "shear_stiffness": 1e10}, pipeline="suite", suite=suite)
    assert not any("shear_stiffness" in line for line in check_assumptions(config))
