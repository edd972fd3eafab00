"""Steps, rows and bytes of a run are known before it is made, and refused beyond what can be meant."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import romdam
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion
from romdam.linalg.solvers import Solving
from romdam.pipelines.run import Clock, build_model, silent
from romdam.pipelines.simulation import ground_at_steps, refuse_large, settings_for, simulate_motion
from romdam.pipelines.sizes import refuse_lengths, run_bytes

EXAMPLE = Path(__file__).parents[1] / "configs" / "two_cantilevers.yaml"
MOTION = GroundMotion("northridge", np.sin(np.arange(9000.0)).reshape(3, 3000), 0.01)


def job(transient=None, **outputs):
    made = romdam.load_config(EXAMPLE)
    config = made.config
    config = config.model_copy(
        update={
            "transient": config.transient.model_copy(update=transient or {}),
            "outputs": config.outputs.model_copy(update=outputs),
        }
    )
    return replace(made, config=config)


@pytest.mark.parametrize(
    ("transient", "outputs", "parts"),
    [
        (
            {"finest_step": 2.5e-9},
            {},
            ["transient.finest_step", "2.5e-09 s", "1.2e+10 steps, limit 1e+08", "1 to 5 ms"],
        ),
        ({"duration": 1e7}, {}, ["transient.finest_step", "4e+09 steps"]),
        (
            {"finest_step": None, "accuracy": 0.01, "duration": 1e7},
            {},
            ["transient.duration", "steps, limit 1e+08"],
        ),
        (
            {"finest_step": None, "accuracy": 0.01},
            {"output_interval": 1e-8},
            ["transient", "steps, limit 1e+08"],
        ),
        (
            {"finest_step": 0.01, "duration": 1e-3},
            {"output_interval": None},
            ["shorter than one step of 0.01 s"],
        ),
        (
            {"finest_step": 40.0, "duration": 100.0},
            {"output_interval": None},
            ["29.99 s are shorter than one step of 40 s"],
        ),
        (
            {},
            {"output_interval": 100.0},
            ["outputs.output_interval", "29.99 s at intervals of 100 s", "0.01 s suits"],
        ),
    ],
)
def test_lengths_that_cannot_be_meant_are_refused(transient, outputs, parts):
    with pytest.raises(ConfigError) as caught:
        refuse_lengths(job(transient, **outputs), [MOTION])
    message = str(caught.value)
    assert message.startswith(str(EXAMPLE)) and "northridge" in message
    assert all(part in message for part in parts), message


@pytest.mark.parametrize(
    "transient", [{"finest_step": 1e-4, "duration": 300.0}, {"finest_step": 1e-5}, {"finest_step": 0.05}]
)
def test_long_and_fine_runs_are_made(transient):
    refuse_lengths(job(transient, output_interval=None), [MOTION])


def test_no_ground_motion_is_resampled_to_a_billion_steps():
    with pytest.raises(ConfigError, match=r"northridge: .* steps, limit 1e\+08"):
        ground_at_steps(MOTION, 1e-9, None)


def test_a_run_that_does_not_fit_in_memory_is_refused_before_it_is_made(monkeypatch):
    one = job({"finest_step": 1e-3}, output_interval=None)
    model = build_model(one, Clock(silent))
    settings = settings_for(one, model.prepared, MOTION)
    steps = MOTION.duration / settings.steps.base
    need = run_bytes(model.system, steps, steps / settings.steps.stride)
    monkeypatch.setattr(Solving, "limit", 1.01 * need)
    refuse_large(one, [(model.prepared, MOTION, settings)], None)
    monkeypatch.setattr(Solving, "limit", 0.99 * need)
    with pytest.raises(ConfigError, match=r"northridge: .* written rows would take .* GB of memory, limit"):
        simulate_motion(one, model.prepared, MOTION)


def test_memory_grows_with_rows_nodes_and_gaps():
    model = build_model(job(), Clock(silent))
    least = run_bytes(model.system, 1000, 1000)
    history = (
        1000 * 8 * (3 * model.system.B.shape[0] + 2 * model.system.size + 3 * model.system.observe.shape[0])
    )
    assert least > history, "a run holds at least its history"
    assert run_bytes(model.system, 1000, 2000) > 1.8 * least
