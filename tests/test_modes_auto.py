"""`model.modes: auto`: as many modes as the accuracy needs, and refused where none can be judged."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

import romdam
from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.errors import ConfigError
from romdam.error.metrics import RelativeError, relative_l2
from romdam.error.statement import ErrorStatement
from romdam.pipelines import automatic_modes
from romdam.pipelines.automatic_modes import FIRST, VECTORS, choose_modes
from romdam.pipelines.input_motions import records_of, usable
from romdam.scene.build import build_scene

EXAMPLE = Path(__file__).parents[1] / "configs" / "two_cantilevers.yaml"


def job(accuracy, **changes):
    """The example on a mesh of 5 m, 8 s of it, with modes: auto."""
    raw = yaml.safe_load(EXAMPLE.read_text())
    for block in raw["blocks"].values():
        block["box"]["element_size"] = "5 m"
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": False}
    raw |= {"model": {"modes": "auto"}, "transient": {"accuracy": accuracy, "duration": 8.0}}
    return Job(parse_config(raw | changes, EXAMPLE.name), EXAMPLE)


def scene_of(one):
    return build_scene(one.config, one.folder, str(one.path))


def chosen_modes(one):
    return choose_modes(one, scene_of(one), usable(records_of(one))).config.model.modes


def test_a_smaller_error_asks_for_more_modes():
    rough, fine = chosen_modes(job("20 %")), chosen_modes(job("0.1 %"))
    assert rough == FIRST
    assert fine == "all" or fine > rough


def test_residual_vectors_that_the_job_names_are_kept():
    def vectors(one):
        return choose_modes(one, scene_of(one), usable(records_of(one))).config.model.residual_vectors

    assert vectors(job("20 %")) == VECTORS
    assert vectors(job("20 %", model={"modes": "auto", "residual_vectors": 5})) == 5


def test_the_result_says_how_many_and_states_an_error_below_the_accuracy(tmp_path):
    one = job("20 %")
    path = romdam.run(one, tmp_path).paths[0]
    with romdam.open_result(path) as result:
        attrs = result.dataset.attrs
    assert json.loads(attrs["configuration"])["model"]["modes"] == FIRST
    assert 0.0 < attrs["error_estimate_opening_l2"] <= 0.2


@pytest.mark.slow
def test_modes_and_steps_together_keep_the_accuracy():
    """Against all modes at a tenth of the error; with modes that may leave all of it, it was 0.43 %."""
    kept, closely = (
        romdam.run(job(accuracy)).results[0].dataset["opening"].values for accuracy in ("0.3 %", "0.1 %")
    )
    truth = romdam.run(job("0.03 %", model={"modes": "all"})).results[0].dataset["opening"].values
    assert relative_l2(kept, truth) < 0.003
    assert relative_l2(closely, truth) < 0.001


@pytest.mark.parametrize(
    ("of_steps", "modes"),
    [
        (0.001, 30),  # leaves 0.9 %, a half more than 0.55 % is 0.83 %
        (0.004, 45),  # leaves 0.6 %
        (0.009, 45),  # leaves 0.1 %, and half of 1 % at least
    ],
)
def test_modes_may_leave_what_the_steps_leave_with_a_margin(monkeypatch, of_steps, modes):
    """1 % is asked; 20, 30 and 45 modes are estimated at 0.7, 0.55 and 0.33 %."""
    estimated = {20: 0.007, 30: 0.0055, 45: 0.0033, 68: 0.0}
    monkeypatch.setattr(
        automatic_modes, "reduced_models", lambda job, *_: (SimpleNamespace(system=None), job)
    )
    monkeypatch.setattr(automatic_modes, "prepare", lambda *_: None)
    history = SimpleNamespace(stats={"estimated_time_error": of_steps})
    monkeypatch.setattr(automatic_modes, "simulate_motion", lambda *_: history)

    def estimate(job, *_):
        error = RelativeError(estimated[job.config.model.modes], 0.0)
        return ErrorStatement("estimate", "", {"opening": error})

    monkeypatch.setattr(automatic_modes, "estimate_run", estimate)
    assert chosen_modes(job("1 %")) == modes


def test_without_damping_no_error_is_estimated_and_none_can_be_met():
    with pytest.raises(ConfigError, match=r"modes: auto needs joints, damping.*60 is a good start"):
        chosen_modes(job("2 %", damping={}))


def test_a_step_alone_gives_no_measure_for_the_modes():
    raw = yaml.safe_load(EXAMPLE.read_text())
    raw["model"] = {"modes": "auto"}
    with pytest.raises(ConfigError, match=r"model.modes: auto needs transient.accuracy"):
        parse_config(raw, "dam.yaml")
