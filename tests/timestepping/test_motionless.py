"""A record of zeros: what rests keeps still, and nothing that is round-off is told as an error."""

import json

import numpy as np
import pytest

import romdam
from romdam.core.motion import GroundMotion
from romdam.timestepping.step_control import jump_differences


@pytest.mark.parametrize("model", [{"order": "full"}, {"modes": 10}])
@pytest.mark.parametrize("friction", [0.0, 0.8])
@pytest.mark.parametrize("element", ["hex8", pytest.param("hex20", marks=pytest.mark.slow)])
def test_a_block_at_rest_on_a_joint_raises_no_alarm(model, friction, element):
    def block(low, high):
        box = {"origin": [0, 0, low], "size": [4, 4, high - low], "element_size": 2, "element": element}
        return {"material": "concrete", "box": box}

    joint = {"between": ["base", "top"], "normal_stiffness": 20e9}
    if friction:
        joint |= {"shear_stiffness": 10e9, "friction": friction}
    job = {
        "materials": {"concrete": {"E": 25e9, "nu": 0.2, "rho": 2400}},
        "blocks": {"base": block(0, 2), "top": block(2, 10)},
        "supports": [{"block": "base", "face": "zmin"}],
        "joints": {"sole": joint},
        "loads": {"gravity": [0, 0, -9.81]},
        "damping": {"rayleigh": {"frequencies": [5, 40], "ratio": 0.05}},
        "model": model,
        "transient": {"finest_step": 0.0025},
        "outputs": {"plots": False, "mesh_error": False},
    }
    motion = GroundMotion("still", np.zeros((3, 41)), 0.01, {}, ())
    dataset = romdam.run(job, motions=motion).results[0].dataset
    weight = 2400 * 9.81 * 4 * 4 * 8
    assert -dataset.normal_force.sum("gap").values == pytest.approx(weight, rel=1e-6)
    warned = " ".join(json.loads(dataset.attrs["run_warnings"]))
    assert "ledger" not in warned and "steps change" not in warned
    assert dataset.attrs["solver_ledger_imbalance"] < 1e-3
    assert dataset.attrs.get("solver_estimated_time_error", 0.0) < 0.02


def test_motions_that_are_round_off_of_what_rests_are_measured_by_that():
    """1e-9 of jumps of 5 and 12 in each of ten rows: 13 in all gaps, of which 1e-6 counts."""
    fine = np.tile([[5.0, 0.0, 12.0]], (10, 1, 1))
    coarse = fine.copy()
    coarse[1:, 0, 0] += 1e-9
    found = jump_differences(coarse, fine)
    assert found[0] == pytest.approx(1e-9 * 3.0 / (1e-6 * 13.0 * 10.0**0.5), rel=1e-6)
    assert found[1] == pytest.approx(1e-9 / (1e-6 * 12.0), rel=1e-6)
    assert jump_differences(coarse[..., :1], fine[..., :1])[1] == pytest.approx(1e-9 / 5e-6, rel=1e-6)
