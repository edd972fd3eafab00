"""The stated reduction error against all modes of the mesh, on scenes of every way in which blocks meet."""

from dataclasses import replace
from pathlib import Path

import pytest
from estimate_scenes import CASES, scene_job
from estimate_truth import case_of, measure, with_all_modes

import romdam
from romdam.pipelines.error.estimate import (
    can_estimate,
    obstacle,
    reduced_models,
    with_estimates,
)
from romdam.pipelines.simulation import RunModel, prepare, simulate_motion
from romdam.reduction.refinement import parts_without_refinement
from romdam.scene.ties import scene_parts

RECORD = Path(__file__).parents[2] / "data" / "records" / "northridge_mul009_g_dt0.01.txt"

QUICK = [
    ("tied", 4),
    ("tied", 6),
    ("light_rock", 4),
    ("shifted", 4),
    ("two", 4),
    ("keyed", 6),
    ("tied_wet", 10),
]


@pytest.mark.parametrize(("scene", "modes"), QUICK)
def test_the_estimate_is_between_half_and_three_times_the_true_error(scene, modes):
    """A finer model that took only modes up to 1.5 times the highest stated 0 of 6 % for the tied blocks."""
    whole = case_of(scene, scene_job(scene, {"modes": "all"}, 2.5))
    truth = with_all_modes(whole, 0.001)
    row = measure(replace(whole, job=scene_job(scene, {"modes": modes}, 2.5)), truth)[0]
    print(row.true.l2, row.estimated.l2)
    assert row.true.l2 > 0.003
    assert 0.5 * row.true.l2 <= row.estimated.l2 <= 3.0 * row.true.l2


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "base"), CASES)
def test_every_case_is_stated_between_half_and_three_times_the_true_error(scene, base):
    """All of `python tests/reference/estimate_truth.py --scenes`."""
    row = measure(case_of(scene, scene_job(scene, base)))[0]
    assert 0.5 * row.true.l2 <= row.estimated.l2 <= 3.0 * row.true.l2


def test_bonds_are_followed_from_the_start():
    """Begun amid the record, with bonds guessed from its rows, the estimate was 2.6 times the truth."""
    whole = case_of("bonded", scene_job("bonded", {"modes": "all"}, 10.0))
    truth = with_all_modes(whole, 0.001)
    row = measure(replace(whole, job=scene_job("bonded", {"modes": 30}, 10.0)), truth)[0]
    assert row.estimated.l2 == pytest.approx(row.true.l2, rel=0.2)


def test_where_the_finer_model_is_the_runs_the_error_is_unknown():
    job = scene_job("tied", {"modes": 4}, 1.0)
    case = case_of("tied", job)
    reduced, finer = reduced_models(job, case.scene)
    (part,) = scene_parts(case.scene)  # all is tied to one base
    assert parts_without_refinement(case.scene, reduced, reduced) == [part]
    assert not finer.not_finer
    prepared = prepare(job, reduced.system)
    run = simulate_motion(job, prepared, case.motion, 1.0)
    same = replace(finer, prepared=prepared, not_finer=(part,))
    model = RunModel(case.scene, prepared, reduced, same)
    _, statement = with_estimates(job, model, case.motion, run)
    assert statement.errors == {} and "unknown" in statement.attributes["error_estimate"]
    assert part in statement.sentence and "error_estimate_opening_l2" not in statement.attributes
    _, statement = with_estimates(job, replace(model, finer=finer), case.motion, run)
    assert statement.errors["opening"].l2 > 0.0


def test_where_no_estimate_can_be_made_the_result_says_so():
    """Undamped: unknown, in the attributes of the result."""
    job = scene_job("two", {"modes": 4}, 0.5)
    undamped = job.config.damping.model_copy(update={"rayleigh": None})
    job = replace(job, config=job.config.model_copy(update={"damping": undamped}))
    assert not can_estimate(job) and "damping" in obstacle(job)
    (result,) = romdam.run(job).results
    assert "unknown: without damping" in result.dataset.attrs["error_estimate"]


def test_of_blocks_that_rock_on_their_joints_it_is_an_order_of_magnitude():
    """One monolith of Koyna: 1 to 24 % true where 0.6 to 6 % were stated, by the step (docs/sliding.md)."""
    box = {"origin": [0, 0, 0], "size": [2, 4, 8], "element_size": [2, 2, 2]}
    joint = {"between": ["rock", "wall"], "normal_stiffness": 5e9, "shear_stiffness": 3e9, "friction": 1.5}
    job = romdam.load_config(
        {
            "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400}},
            "blocks": {
                "rock": {
                    "material": "concrete",
                    "mass": False,
                    "box": box | {"origin": [0, 0, -2], "size": [2, 4, 2]},
                },
                "wall": {"material": "concrete", "box": box},
            },
            "supports": [{"block": "rock", "face": "zmin"}],
            "joints": {"base": joint},
            "loads": {"gravity": [0, 0, -9.81]},
            "damping": {"rayleigh": {"frequencies": [3.0, 20.0], "ratio": 0.05}},
            "records": [
                {
                    "name": "r",
                    "file": str(RECORD),
                    "unit": "9.81 m/s2",
                    "dt": 0.01,
                    "scale": 2.0,
                    "components": {"y": 1},
                }
            ],
            "model": {"modes": 4},
            "transient": {"finest_step": 2.5e-3, "duration": 6.0},
            "outputs": {"plots": False},
        }
    )
    result = romdam.run(job).results[0].dataset
    assert float(result.opening.max()) > 1e-3  # it rocks
    said = result.attrs["error_estimate"]
    assert said.startswith("Leaving out modes changes the openings by ")
    assert "may be a tenth of the truth, or four times: blocks that joints alone hold rock" in said
    assert "factor of two" not in said
