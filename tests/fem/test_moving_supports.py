"""Supports of their own motion: against one motion of all, linear fields, absolute coordinates, the mesh."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulating import simulated

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.core.motion import GroundMotion, SupportMotion
from romdam.fem.stress import observing_stress
from romdam.fem.unreduced import assemble_full
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.support_motions import with_supports
from romdam.reduction.methods.craig_bampton import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

DAMPED = DampingConfig(rayleigh=RayleighConfig(frequencies=(3.0, 30.0), ratio=0.03))
MATERIALS = {
    "concrete": {"E": 25e9, "nu": 0.2, "rho": 2400.0},
    "bar": {"E": 20e9, "nu": 0.0, "rho": 2500.0},
}
REST = {
    "materials": MATERIALS,
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}
DT = 0.01


def make(raw):
    return build_scene(parse_config(REST | raw, "s.yaml"), Path(), "s.yaml")


def box(origin, size, edge, material="concrete", element="hex8"):
    return {
        "material": material,
        "box": {"origin": origin, "size": size, "element_size": edge, "element": element},
    }


def valley(left=None, right=None, middle=None, **joints):
    """Three monoliths: two hang on the banks, one stands on the valley's floor; joints between them."""
    motions = {"left": ("xmin", left), "middle": ("zmin", middle), "right": ("xmax", right)}
    law = {"normal_stiffness": "20 GPa/m", "shear_stiffness": "10 GPa/m", "friction": 0.6} | joints
    return {
        "blocks": {
            name: box([10.0 * k, 0, 0], [10, 5, 20], 5.0) for k, name in enumerate(("left", "middle", "right"))
        },
        "supports": [
            {"block": name, "face": face} | ({"motion": motion} if motion else {})
            for name, (face, motion) in motions.items()
        ],
        "joints": {
            f"J{k}": {"between": pair} | law for k, pair in enumerate((["left", "middle"], ["middle", "right"]))
        },
        "loads": {"gravity": [0, 0, -9.81]},
        "outputs": {
            "nodes": {
                "bank": {"block": "left", "at": [0, 0, 20]},
                "crest": {"block": "middle", "at": [15, 0, 20]},
            },
            "stress": {"blocks": ["left"]},
        },
    }


def pulses(seconds=3.0, dt=DT):
    """Along all axes, each ends at rest: velocity and displacement are zero at the end (3, nt) [m/s2]."""
    time = np.arange(round(seconds / dt) + 1) * dt
    found = []
    for peak, freq in ((6.0, 1.7), (9.0, 2.3), (3.0, 3.1)):
        window = np.where(time < 2.0, np.sin(np.pi * time / 2.0) ** 4, 0.0)
        found.append(peak * np.gradient(np.gradient(window * np.sin(2 * np.pi * freq * time), dt), dt) / (2 * np.pi * freq) ** 2)
    return np.stack(found)


def systems(scene, modes=20):
    full = assemble_full(scene, DAMPED)
    return full, reduce_scene(scene, ModeChoice(count=modes), DAMPED).system


def l2(values, reference):
    return np.linalg.norm(values - reference) / np.linalg.norm(reference)


SHIFTED = {"delay": 0.06, "factor": 1.4}


@pytest.mark.parametrize("integrator", ["generalized_alpha", "modal"])
def test_one_motion_of_all_supports_is_that_motion_of_the_base(integrator):
    """Openings, slips and forces are those of the record that the supports follow; displacement is u + d."""
    acc = pulses()
    moving, still = make(valley(SHIFTED, SHIFTED, SHIFTED)), make(valley())
    ground = with_supports(acc, DT, moving.moving.motions)
    k = 0 if integrator == "generalized_alpha" else 1
    own, base = (
        simulated(systems(scene)[k], motion, DT, integrator)
        for scene, motion in ((moving, ground), (still, acc + ground[3:6]))
    )
    assert np.abs(base.jump).max() > 1e-3
    np.testing.assert_allclose(own.jump, base.jump, atol=1e-10 * np.abs(base.jump).max())
    np.testing.assert_allclose(own.traction, base.traction, atol=1e-7 * np.abs(base.traction).max())
    follows = np.tile(ground[9:12].T, 2)
    np.testing.assert_allclose(own.disp, base.disp + follows, atol=1e-10 * np.abs(follows).max())
    assert own.stats["ledger_imbalance"] < 1e-10
