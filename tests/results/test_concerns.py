"""What a run says against itself: an open ledger, an accuracy that was not reached."""

import json
import logging
import math
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import romdam
from romdam.postprocess.run_warnings import far_warnings, run_warnings
from romdam.terminal.lines import info_lines, suite_warning_lines
from romdam.timestepping import step_control as accuracy

GOOD = {"ledger_imbalance": 1e-12, "estimated_time_error": 0.008, "accuracy": 0.01, "finest_step": 1e-3}


def test_a_run_within_its_limits_raises_no_concern():
    assert run_warnings(GOOD) == [] and run_warnings({"finest_step": 1e-3}) == []


@pytest.mark.parametrize("imbalance", [2e-3, math.nan])
def test_an_open_ledger_is_said(imbalance):
    (text,) = run_warnings(GOOD | {"ledger_imbalance": imbalance})
    assert text.startswith("the energy ledger is open by") and "limit 0.1 %" in text


@pytest.mark.parametrize("error", [0.048, math.nan, math.inf])
def test_a_missed_accuracy_is_said(error):
    (text,) = run_warnings(GOOD | {"estimated_time_error": error})
    assert "time-stepping error" in text and "wanted was 1 %" in text


@pytest.mark.parametrize("error", [0.051, math.nan])
def test_rough_steps_that_were_given_are_said(error):
    given = {"estimated_time_error": error, "finest_step": 2.5e-3}
    (text,) = run_warnings(given)
    assert "as other steps show" in text and "than 0.0025 s" in text
    assert run_warnings(given | {"estimated_time_error": 0.049}) == []


def test_modes_that_do_not_follow_the_ground_are_said():
    """A third of the mass, in the mode of a block that was made quasi-static, took 30 % off its peak."""
    (text,) = run_warnings(GOOD | {"quasi_static_mass": 0.63})
    assert "63% of the effective mass" in text and "below 0.001 s" in text
    assert run_warnings(GOOD | {"quasi_static_mass": 0.09}) == []


def test_a_joint_that_moves_far_from_where_it_started_is_said():
    """Of 16 m2 a twentieth of 4 m is 0.2 m; what stands open at the start is no motion."""
    joints = {
        "a": SimpleNamespace(gap=np.array([0.5, 0.0]), whole_area=np.array([4.0, 12.0])),
        "b": SimpleNamespace(gap=np.zeros(1), whole_area=np.array([16.0])),
    }
    scene, jump = SimpleNamespace(joints=joints), np.zeros((3, 3, 3))
    jump[:, 0, 0] = 0.5, 0.6, 0.55  # 0.1 m of opening
    jump[1, 1, 1:] = 0.12, 0.15  # 0.192 m of slip
    assert far_warnings(scene, SimpleNamespace(jump=jump)) == []
    jump[2, 1, 1:] = 0.18, -0.24  # 0.3 m
    (text,) = far_warnings(scene, SimpleNamespace(jump=jump))
    assert text.startswith("joint a moves by up to 0.3 m, 8% of the root of its area, limit 5%")
    assert far_warnings(scene, SimpleNamespace(jump=jump[..., :1])) == []  # without shear the opening alone


def test_both_are_counted_in_a_suite():
    errors = (("record", "scale", "sample"), [[[0.008, 0.02]], [[0.011, 0.009]]])
    ledger = (("record", "scale", "sample"), [[[1e-12, 3e-3]], [[np.nan, 1e-12]]])
    found = xr.Dataset({"estimated_time_error": errors, "ledger_imbalance": ledger})
    first, second = suite_warning_lines(found, 0.01)
    assert first.startswith("1 of 4 runs do not close their energy ledger within 0.1 %")
    assert second.startswith("2 of 4 runs did not reach")


def test_a_single_run_that_misses_its_accuracy_says_so(tmp_path, monkeypatch, caplog):
    """On the terminal, in the file, and in what `romdam info` tells."""
    time = np.arange(60) * 0.01
    np.savetxt(tmp_path / "pulse.txt", 5.0 * np.sin(31.4 * time) * np.exp(-4 * time))
    config = tmp_path / "job.yaml"
    config.write_text(
        """
materials: {concrete: {E: 30 GPa, nu: 0.18, rho: 2440 kg/m3}}
blocks:
  left: {material: concrete, box: {origin: [0, -5, 0], size: [5, 5, 20], element_size: 5 m}}
  right: {material: concrete, box: {origin: [0, 0, 0], size: [5, 10, 20], element_size: 5 m}}
supports: [{block: left, face: zmin}, {block: right, face: zmin}]
joints: {gap: {between: [left, right], normal_stiffness: 16 GPa/m}}
damping: {rayleigh: {frequencies: [5 Hz, 50 Hz], ratio: 5 %}}
records: [{name: pulse, file: pulse.txt, unit: m/s2, dt: 0.01 s, components: {y: 1}}]
model: {order: reduced, modes: 10}
transient: {accuracy: 0.01 %}
outputs: {plots: false, error_estimate: false}
"""
    )
    monkeypatch.setattr(accuracy, "_MOST_HALVINGS", 2)
    with caplog.at_level(logging.WARNING):
        outcome = romdam.run(romdam.load_config(config), tmp_path / "out")
    (said,) = [r.getMessage() for r in caplog.records if "time-stepping error" in r.getMessage()]
    assert said.startswith("pulse: ") and "wanted was 0.01 %" in said
    with romdam.open_result(outcome.paths[0]) as result:
        (written,) = json.loads(result.dataset.attrs["run_warnings"])
        assert f"pulse: {written}" == said
        assert any(line.endswith(written) for line in info_lines(result.dataset))
