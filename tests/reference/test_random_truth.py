"""The judge of random scenes: what it draws, how it compares, and one small scene."""

import numpy as np
import pytest
from random_scenes import draw_scene
from random_truth import (
    Response,
    Row,
    errors_between,
    interpolation,
    judge,
    judge_scene,
    stated_errors,
    summary,
)

import romdam


@pytest.mark.parametrize("number", range(40))
def test_a_scene_is_a_job_and_the_same_whenever_it_is_drawn(number):
    scene = draw_scene(11, number)
    assert scene.raw == draw_scene(11, number).raw
    assert romdam.load_config(scene.raw).config.joints


def test_scenes_cover_what_jobs_have():
    words = " ".join(" ".join(draw_scene(11, number).words) for number in range(120))
    laws = "none friction bond fracture friction_static shear_key velocity_friction slip_weakening"
    for word in f"{laws} barton_bandis viscosity tension_stiffness hex8 hex20 tet10 spacing gap".split():
        assert word in words
    for word in (
        "base joints",
        "tied",
        "stacked",
        "meshes apart",
        "westergaard",
        "uplift",
        "grouted",
        "modal",
    ):
        assert word in words


def test_openings_are_interpolated_linearly_and_beyond_the_joint_by_the_nearest():
    points = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 3.0], [2.0, 3.0], [1.0, 1.0]])
    wanted = np.array([[0.5, 0.25], [2.0, 3.0], [1.7, 2.2], [2.5, 0.0]])
    weights = interpolation(points, wanted)
    field = points @ [2.0, -1.0] + 4.0
    assert weights @ field == pytest.approx([4.75, 5.0, 5.2, 8.0], abs=1e-12)
    on_a_line = interpolation(points[:2], wanted[:1])
    assert on_a_line @ field[:2] == pytest.approx([4.0])


def _response(opening: list[list[float]]) -> Response:
    values = np.array(opening)
    return Response({}, values - values[0], None, {}, {}, np.arange(float(len(values))))


def test_an_error_is_of_what_a_joint_does_and_not_of_its_gap():
    """Openings of 0.1 m that move by 3 and 4 mm; the judged one misses 1 mm of each: sqrt(2) of 5."""
    better = _response([[0.1, 0.1], [0.103, 0.104]])
    judged = _response([[0.1, 0.1], [0.102, 0.103]])
    error = errors_between(judged, better)["opening"]
    assert error["l2"] == pytest.approx(2.0**0.5 / 5.0)
    assert error["peak"] == pytest.approx(2.0**0.5 / 5.0)  # the largest alone: 1 of 4


def test_what_is_stated_adds_up_and_what_is_not_is_unknown():
    attrs = {
        "discretisation_opening_l2": 0.04,
        "discretisation_section_force_peak": 0.5,
        "discretisation": '{"not_resolved": ["section_force"]}',
        "error_estimate": "Leaving out modes changes the openings by about 2 % in L2.",
        "error_estimate_opening_l2": 0.02,
        "solver_estimated_time_error": 0.01,
    }
    stated, lost = stated_errors(attrs)
    assert stated["modes+steps"] == {"opening": {"l2": pytest.approx(0.03)}}
    assert stated["total"] == {"opening": {"l2": pytest.approx(0.07)}}
    assert stated["mesh"]["section_force"] == {"peak": 0.5}
    assert lost == {"section_force"}
    del attrs["error_estimate"], attrs["error_estimate_opening_l2"]  # with all modes none is stated
    assert stated_errors(attrs)[0]["total"] == {"opening": {"l2": pytest.approx(0.05)}}
    del attrs["solver_estimated_time_error"]
    assert stated_errors(attrs)[0]["modes+steps"] == {}


def test_a_summary_names_what_is_far_too_low():
    rows = [Row("mesh", "opening", "l2", said, 0.1, 0.01) for said in (0.02, 0.09, None)]
    scenes = {
        str(k): {"rows": [vars(row)], "warnings": [], "asked": {}, "refused": "", "notes": []}
        for k, row in enumerate(rows)
    }
    lines = summary(scenes).splitlines()
    assert lines[1].split() == ["mesh", "opening", "l2", "2", "1", "0.55", "1", "1", "0"]
    assert "below a third, scene 0: mesh opening l2" in lines


@pytest.mark.slow
def test_the_openings_of_a_small_scene_are_judged():
    """Two walls one element thick, 1 s of a pulse; its truth is that of the mesh's own matrices."""
    raw = _two_walls()
    scene = judge(raw, mesh=False, cross=True)
    row = next(row for row in scene.rows if (row.of, row.measure) == ("modes+steps", "l2"))
    assert 1e-4 < row.true < 0.2
    assert row.unsure < 0.2 * row.true
    crossed = next(note for note in scene.notes if note.startswith("full order"))
    assert float(crossed.split()[5]) < 20.0 * row.true  # percent: a fifth of the error


def _two_walls():
    scene = draw_scene(11, 0)
    box = {"element_size": [3.0, 3.0, 4.0], "element": "hex8"}
    return scene.raw | {
        "blocks": {
            "a": {"material": "concrete", "box": box | {"origin": [0, 0, 0], "size": [3.0, 3.0, 12.0]}},
            "b": {"material": "old", "box": box | {"origin": [3.0, 0, 0], "size": [6.0, 3.0, 16.0]}},
        },
        "supports": [{"block": name, "face": "zmin"} for name in "ab"],
        "joints": {"ab": {"between": ["a", "b"], "normal_stiffness": 2e10}},
        "ties": {},
        "loads": {"initial_state": "undeformed"},
        "damping": {"rayleigh": {"frequencies": [3.0, 20.0], "ratio": 0.05}},
        "model": {"modes": 4},
        "transient": {"finest_step": 0.00125, "duration": 2.0},
        "outputs": {"output_interval": 0.01, "plots": False},
    }


def test_a_scene_that_is_refused_is_listed_with_its_reason(monkeypatch):
    drawn = draw_scene(11, 0)
    drawn.raw["joints"][next(iter(drawn.raw["joints"]))]["normal_stiffness"] = -1.0
    monkeypatch.setattr("random_truth.draw_scene", lambda seed, number: drawn)
    scene = judge_scene(11, 0, None, mesh=False, cross=False)
    assert "normal_stiffness" in scene["refused"]
    assert "refused, scene 0:" in summary({"0": scene})
