"""Studies of meshes and contact points: the cheapest setting for each error, and errors that runs confirm."""

import copy
import itertools
import math
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
import yaml
from arch_dams import arch_dam
from test_cli import SMALL, call

import romdam
from romdam.config.other_mesh import on_quadratic_elements
from romdam.config.sections.study import ContactPoints, StudiedMesh
from romdam.config.study_meshes import CONTACT_POINTS, MESHES, reference_meshes, studied_meshes
from romdam.core.errors import ConfigError
from romdam.core.motion import GroundMotion
from romdam.error.study import CaseResult, cheapest_cases, pareto_front, study_dataset, study_table
from romdam.pipelines.error import study as pipeline
from romdam.pipelines.moving_supports import scene_of
from romdam.visual.study_plots import study_figure

TIME = np.arange(100) * 0.01
PULSE = 6.0 * np.sin(2 * np.pi * 5.0 * TIME) * np.exp(-2 * TIME)
STUDY = {
    "meshes": ["as_given", "half", "quadratic"],
    "modes": [20],
    "residual_vectors": [5],
    "integrators": ["adaptive"],
    "finest_steps": ["0.5 ms"],
    "reference_step": "0.25 ms",
    "duration": 0.3,
    "repeats": 1,
}


def raw_job(size=5.0, element="hex8", **study):
    """The small job on elements of a size [m] with a study."""
    raw = yaml.safe_load(SMALL)
    for block in raw["blocks"].values():
        block["box"] |= {"element_size": size, "element": element}
    raw["transient"] = {"finest_step": "0.5 ms", "duration": 0.3}
    raw["model"] |= {"modes": 20, "residual_vectors": 5}
    return raw | {"study": STUDY | study}


def job_on(folder, raw):
    """A job in a folder, with its record."""
    np.savetxt(folder / "pulse.txt", PULSE)
    (folder / "dam.yaml").write_text(yaml.safe_dump(raw))
    return romdam.load_config(folder / "dam.yaml")


def test_cheapest_is_within_the_error_and_the_nearer_and_first_of_equal_costs():
    """Costs 4, 2, 2, 1, 3 and 2 s and one that failed; 0.02 is kept at 2 s by three, two of them at 0.01."""
    cost = np.array([4.0, 2.0, 2.0, 1.0, np.nan, 3.0, 2.0])
    error = np.array([0.001, 0.02, 0.01, 0.3, 0.0, 0.004, 0.01])
    found = cheapest_cases(cost, error, np.array([0.5, 0.1, 0.02, 0.01, 0.004, 0.002, 1e-4]))
    assert found.tolist() == [3, 2, 2, 2, 5, 0, -1]
    assert pareto_front(cost, error).tolist() == [True, False, True, True, False, True, True]


def test_front_and_cheapest_count_the_reduction_and_a_failure_has_no_numbers(tmp_path):
    """The model of the nearest costs 5 s and its loop 0.1 s; the fastest loop alone is not the cheapest."""
    job = job_on(tmp_path, raw_job())
    numbers = {"peak_opening": 1e-3, "peak_error": 0.01, "cpu_spread": 0.0, "steps": 9}
    cases = [
        CaseResult("modal", 0.001, "20 modes", 5, 90, model_cpu_seconds=5.0, cpu_seconds=0.1, l2_error=0.004),
        CaseResult("modal", 0.002, "9 modes", 0, 40, model_cpu_seconds=1.0, cpu_seconds=0.5, l2_error=0.04),
        CaseResult("modal", 0.002, "5 modes", 0, 30, model_cpu_seconds=1.0, cpu_seconds=0.7, l2_error=0.2),
    ]
    cases = [CaseResult(**vars(case) | numbers) for case in cases]
    cases.append(CaseResult("modal", math.nan, "", 0, 0, of_job=True, failure="step 3: did not converge"))
    about = {"compared": "pulse against a run", "record": "pulse", "timed_seconds": 0.3}
    dataset = study_dataset(cases, job, about)
    np.testing.assert_allclose(dataset.total_cpu_seconds[:3], [5.1, 1.5, 1.7])
    assert dataset.on_front.values.tolist() == [1, 1, 0, 0]
    assert dataset.wanted_error.values.tolist() == [0.1, 0.05, 0.02, 0.01, 0.005]
    assert dataset.cheapest_case.values.tolist() == [1, 1, 0, 0, 0]
    table = study_table(dataset)
    assert "| 10 % | mesh as given, 9 modes, modal, 2 ms | 1.5 | 0.5 | 4 % |" in table
    assert "| 0.5 % | mesh as given, 20 modes + 5 vectors, modal, 1 ms | 5.1 | 0.1 | 0.4 % |" in table
    assert "step 3: did not converge" in table
    labels = [text.get_text() for text in study_figure(dataset).axes[0].texts]
    assert labels == [
        "within 5 %: mesh as given\n9 modes, modal, 2 ms",
        "within 0.5 %: mesh as given\n20 modes + 5 vectors, modal, 1 ms",
    ]
    none = study_dataset(cases[2:3], job, about)
    assert none.cheapest_case.values.tolist() == [-1] * 5
    assert "| 10 % | none of these |" in study_table(none)


@pytest.fixture(scope="module")
def studied(tmp_path_factory):
    """A study over three meshes, its terminal and its folder."""
    folder = tmp_path_factory.mktemp("study")
    job_on(folder, raw_job())
    code, out, err = call("study", folder / "dam.yaml", "--out", folder / "out")
    assert code == 0, err
    return SimpleNamespace(folder=folder, out=out, dataset=romdam_dataset(folder))


def romdam_dataset(folder):
    import xarray as xr

    return xr.load_dataset(folder / "out" / "study.nc", engine="h5netcdf")


def opening_on(size, element, modes, vectors, step):
    """Openings of a run: gap's position, rounded to mm -> history."""
    raw = raw_job(size, element)
    del raw["study"]
    raw["outputs"] = {"output_interval": 0.01, "plots": False, "error_estimate": False}
    raw["model"] |= {"modes": modes, "residual_vectors": vectors}
    raw["transient"] = {"finest_step": step, "duration": 0.3}
    del raw["records"]
    motion = GroundMotion("pulse", {"y": PULSE}, 0.01)
    (result,) = romdam.run(raw, motions=motion).results
    position = np.rint(1e3 * result.dataset.gap_position.values).astype(int)
    return {tuple(at): result.dataset.opening.values[:, i] for i, at in enumerate(position)}


def test_errors_fall_with_the_mesh_and_are_those_of_runs_against_a_run(studied):
    truth = opening_on(2.5, "hex20", 100, 20, 2.5e-4)
    found = studied.dataset
    assert found.mesh.values.tolist() == ["as given", "half the size", "quadratic", "as given"]
    for i, (size, element) in enumerate([(5.0, "hex8"), (2.5, "hex8"), (5.0, "hex20")]):
        opening = opening_on(size, element, 20, 5, 5e-4)
        common = sorted(opening.keys() & truth.keys())
        ours, better = (np.stack([run[at] for at in common]) for run in (opening, truth))
        error = np.linalg.norm(ours - better) / np.linalg.norm(better)
        assert found.l2_error.values[i] == pytest.approx(error, rel=1e-3)
        assert found.compared_gaps.values[i] == len(common) and found.gaps.values[i] == len(opening)
        assert found.peak_opening.values[i] == pytest.approx(ours.max(), rel=1e-5)
    error = found.l2_error.values
    assert error[0] > 1.5 * error[1] > 1.5 * error[2] > 0.0
    left = found.attrs["reference_mesh_error"]
    assert 0.0 < left < error[2] and "its mesh leaves about" in found.attrs["compared"]


def test_the_jobs_own_setting_is_a_row_with_the_numbers_of_the_same_setting(studied):
    """The study's first setting is the job's own."""
    found = studied.dataset
    assert found.of_job.values.tolist() == [0, 0, 0, 1]
    for name in ("l2_error", "peak_opening", "gaps", "unknowns", "finest_step", "steps", "modes"):
        assert found[name].values[3] == found[name].values[0], name
    total = found.model_cpu_seconds + found.cpu_seconds
    np.testing.assert_array_equal(found.total_cpu_seconds, total)
    assert (found.model_cpu_seconds > 0.0).all()
    assert "cheapest setting" in studied.out and studied.out.count("| 10 % |") == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"meshes": ["twice"]},
            r"dam.yaml:\d+: study.meshes: twice: .*blocks.left.box: has 1 elements .*out of the list",
        ),
        (
            {"element": "hex20", "meshes": ["quadratic"]},
            r"study.meshes: quadratic: there is no such mesh: all elements have quadratic .*out of the list",
        ),
        (
            {"element": "hex20", "meshes": ["half"]},
            r"study.meshes: half is the mesh of the reference, which cannot show its own error.*`half` out",
        ),
        (
            {"contact_points": ["nodes", "corners"], "meshes": ["as_given"]},
            r"study.contact_points: corners: no mesh that is studied has quadratic .*name nodes instead",
        ),
        (
            {"reference": "full"},
            r"dam.yaml.*study: `reference: full` is a run on the mesh as given.*leave it",
        ),
        ({"meshes": ["thrice"]}, r"dam.yaml.*study.meshes.*as_given.*thrice"),
    ],
)
def test_meshes_that_are_not_there_are_refused_before_anything_runs(changes, message, tmp_path, monkeypatch):
    for name in ("reduce_scene", "scene_of", "assemble_full"):
        monkeypatch.setattr(pipeline, name, lambda *_: pytest.fail("something was run"))
    for does in (lambda job: romdam.study(job, tmp_path / "out"), romdam.check):
        with pytest.raises(ConfigError, match=message):
            does(job_on(tmp_path, raw_job(**changes)))


def test_scene_and_reduction_both_count(tmp_path, monkeypatch):
    """On a clock of one second a look, a scene takes one and a reduction one; the job's own setting too."""
    looks = itertools.count()
    monkeypatch.setattr(pipeline, "cpu_time", lambda: float(next(looks)))
    study = romdam.study(job_on(tmp_path, raw_job(meshes=["as_given"])), tmp_path / "out")
    assert study.dataset.model_cpu_seconds.values.tolist() == [2.0, 2.0]


def test_stiffness_of_a_gap_is_refused_with_other_gaps(tmp_path):
    raw = raw_job(element="hex20", contact_points=["corners"])
    del raw["study"]["meshes"]
    raw["joints"]["gap"]["normal_stiffness"] = {"per_gap": "1 GN/m"}
    with pytest.raises(ConfigError, match="of each gap, so with more or fewer gaps"):
        romdam.study(job_on(tmp_path, raw), tmp_path / "out")


def test_contact_points_are_those_of_every_joint(tmp_path):
    """A face of 1 by 4 quadratic elements: 10 corners and 13 nodes between them."""
    raw = raw_job(5.0, "hex20", contact_points=["as_given", "nodes", "corners", "mortar"])
    raw["study"]["meshes"] = ["as_given"]
    variants = studied_meshes(job_on(tmp_path, raw))
    gaps = {v.contact_points: len(scene_of(v.job).gap_position) for v in variants}
    assert gaps == {"as given": 10, "every node": 10 + 13, "corners": 10, "mortar": 10}
    arch = romdam.load_config("configs/arch_dam.yaml")
    study = arch.config.study.model_copy(update={"contact_points": ("mortar",), "meshes": None})
    arch = romdam.load_config(arch.config.model_copy(update={"study": study}), folder="configs")
    (variant,) = studied_meshes(arch)
    assert {joint.discretization for joint in variant.job.config.every_joint.values()} == {"mortar"}
    assert {joint.gaps for joint in variant.job.config.every_joint.values()} == {"nodes"}


def test_corners_and_nodes_of_linear_elements_are_one(tmp_path):
    raw = raw_job(meshes=["as_given", "quadratic"], contact_points=["nodes", "corners"])
    found = [(v.mesh, v.contact_points) for v in studied_meshes(job_on(tmp_path, raw))]
    assert found == [("as given", "every node"), ("quadratic", "every node"), ("quadratic", "corners")]


def test_every_mesh_that_a_study_may_name_has_a_name_and_the_reference_is_finer(tmp_path):
    assert set(MESHES) == set(get_args(StudiedMesh)) and set(CONTACT_POINTS) == set(get_args(ContactPoints))
    of_dams = [mesh for mesh in MESHES if mesh.startswith("finer_")]
    job = job_on(tmp_path, raw_job(2.5, meshes=[mesh for mesh in MESHES if mesh not in of_dams]))
    boxes = {v.mesh: v.job.config.blocks["left"].box for v in studied_meshes(job)}
    assert {name: (box.element_size, box.element) for name, box in boxes.items()} == {
        "as given": (2.5, "hex8"),
        "twice the size": (5.0, "hex8"),
        "half the size": (1.25, "hex8"),
        "quadratic": (2.5, "hex20"),
        "quadratic of twice the size": (5.0, "hex20"),
    }
    meshes = [each.config.blocks["left"].box for each in reference_meshes(job)]
    assert [(box.element_size, box.element) for box in meshes] == [(1.25, "hex20"), (2.5, "hex20")]
    quadratic = on_quadratic_elements(job)
    meshes = [each.config.blocks["left"].box for each in reference_meshes(quadratic)]
    assert [box.element_size for box in meshes] == [1.25, 2.5]


def test_a_dam_is_studied_finer_in_each_direction(tmp_path):
    """Half again as many, an even number: 4 for 2 along and through, 6 for 4 up and in layers of rock."""
    divisions = {"along": 2, "through": 2, "up": 4, "rock": 4, "upstream": 2, "downstream": 2, "growth": 2.0}
    raw = raw_job(2.5, meshes=["as_given", "finer_up", "finer_through", "finer_along", "finer_rock"])
    dam = arch_dam(element="hex20", divisions=divisions)
    for key in ("blocks", "joints", "supports", "loads"):
        raw.pop(key, None)
    raw["outputs"] = {"plots": False}
    raw |= dam
    counts = {v.mesh: v.job.config.arch_dam.divisions for v in studied_meshes(job_on(tmp_path, raw))}
    assert {name: (d.along, d.through, d.up, d.rock, d.upstream) for name, d in counts.items()} == {
        "as given": (2, 2, 4, 4, 2),
        "finer up": (2, 2, 6, 4, 2),
        "finer through": (2, 4, 4, 4, 2),
        "finer along": (4, 2, 4, 4, 2),
        "finer rock": (2, 2, 4, 6, 4),
    }
    assert counts["finer rock"].growth == pytest.approx(2.0 ** (1.0 / 1.5))
    raw["arch_dam"]["rock"] = raw["arch_dam"]["perimeter"] = None
    with pytest.raises(ConfigError, match="finer_rock: there is no such mesh: arch_dam: there is no rock"):
        studied_meshes(job_on(tmp_path, raw))


@pytest.mark.slow
def test_the_setting_that_a_total_accuracy_chooses_is_marked(tmp_path):
    """Its mesh is named as the choice names it, and its error is against the finer mesh."""
    raw = copy.deepcopy(raw_job(cutoffs=["300 Hz"], finest_steps=["1 ms"]))
    del raw["study"]["meshes"], raw["study"]["modes"]
    raw["model"] = {"modes": "auto"}
    raw["transient"] = {"accuracy": {"total": 0.3}, "duration": 0.3}
    raw["study"]["reference_step"] = "0.5 ms"
    dataset = romdam.study(job_on(tmp_path, raw), tmp_path / "out").dataset
    (own,) = np.flatnonzero(dataset.of_job.values)
    assert "elements" in str(dataset.mesh.values[own]) and str(dataset.modes.values[own]).endswith(" modes")
    assert 0.0 < dataset.l2_error.values[own] < 0.3
    assert dataset.modes.values[0] == "below 300 Hz" and dataset.sizes["case"] == 2
