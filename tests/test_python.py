"""romdam from Python: whatever a job is given as and wherever its results go, the numbers are the same."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from test_cli import config

import romdam
from romdam.config.load import located
from romdam.config.variants import variant_jobs
from romdam.config.yaml_text import line_of
from romdam.core.errors import RecordError
from romdam.pipelines import run as pipeline
from romdam.terminal.lines import info_lines

__all__ = ["config"]
CONFIGS = sorted((Path(__file__).parents[1] / "configs").rglob("*.yaml"))
OF_MAKING = ("wall_seconds_", "cpu_seconds_", "date_created", "history", "error_estimate_cpu_")
OF_MAKING += ("solver_loop_cpu", "solver_setup_cpu")
OF_PLACE = ("configuration_file", "configuration_folder")
OF_RECORDS = ("configuration", "configuration_sha256", "record_provenance")
KEY = ("records", 0, "components")
HOSTILE = '<script>alert("1 & 2")</script>'


@pytest.fixture
def raw(config):
    given = yaml.safe_load(config.read_text())
    return given | {
        "title": "two blocks",
        "outputs": given["outputs"] | {"plots": False, "mesh_error": False},
    }


@pytest.fixture
def acc(config):
    """(nt,) what pulse.txt holds [m/s2]."""
    return np.loadtxt(config.parent / "pulse.txt")


def assert_same(one: xr.Dataset, other: xr.Dataset, *but: str) -> None:
    """Variables, coordinates and what they say agree bit by bit, and all attributes but those named."""
    assert list(one.variables) == list(other.variables)
    for name in one.variables:
        first, second = one[name], other[name]
        assert (first.dtype, first.dims, plain(first)) == (second.dtype, second.dims, plain(second)), name
        if first.dtype.kind in "OT":  # texts
            assert first.values.tolist() == second.values.tolist()
        else:
            assert first.values.tobytes() == second.values.tobytes(), name
    assert plain(one, *OF_MAKING, *but) == plain(other, *OF_MAKING, *but)


def plain(one: xr.Dataset | xr.DataArray, *but: str) -> dict[str, object]:
    """Attributes, but those whose names begin with one of those named."""
    return {name: np.asarray(v).tolist() for name, v in one.attrs.items() if not name.startswith(but or "?")}


def test_a_file_a_mapping_a_config_and_a_job_run_alike(config, raw, tmp_path):
    config.write_text(yaml.safe_dump(raw))
    file = romdam.run(config, tmp_path / "out").results[0].dataset
    assert float(file.peak_opening.max()) > 1e-5, "the pulse opens the joint"
    job = romdam.load_config(raw, folder=config.parent)
    for given in (job, romdam.load_config(job.config, config.parent)):
        assert_same(file, romdam.run(given).results[0].dataset, *OF_PLACE)


def test_paths_of_a_mapping_start_from_the_current_folder(config, raw, monkeypatch):
    with pytest.raises(romdam.RecordError, match=r"pulse\.txt"):
        romdam.read_motions(raw)
    monkeypatch.chdir(config.parent)
    assert romdam.read_motions(raw)[0].name == "pulse"


@pytest.mark.parametrize("kind", ["file", "mapping"])
def test_a_job_reads_where_it_was_made(config, raw, acc, tmp_path, monkeypatch, kind):
    raw["comparison"] = {"variants": {"gaps": {}, "stiff": {"joints.gap.normal_stiffness": "rigid"}}}
    for folder, factor in (("here", 1.0), ("there", 3.0)):
        (tmp_path / folder / "jobs").mkdir(parents=True)
        np.savetxt(tmp_path / folder / "jobs" / "pulse.txt", factor * acc)
    monkeypatch.chdir(tmp_path / "here")
    Path("jobs/dam.yaml").write_text(yaml.safe_dump(raw))
    job = romdam.load_config(*{"file": ("jobs/dam.yaml",), "mapping": (raw, "jobs")}[kind])
    before = romdam.read_motions(job)[0]
    assert before.provenance["place"] == "jobs/pulse.txt", "as it was typed"
    monkeypatch.chdir(tmp_path / "there")
    for one in (job, *variant_jobs(job).values()):
        assert romdam.read_motions(one)[0].digest == before.digest
    where = "" if kind == "mapping" else f"jobs/dam.yaml:{line_of(tmp_path / 'here/jobs/dam.yaml', KEY)}: "
    assert located(job, RecordError("lost", key="records[0].components")) == f"{where}lost"


def test_paths_of_a_job_made_here_start_here_whatever_comes(raw, acc, tmp_path, monkeypatch):
    for folder, factor in (("here", 1.0), ("there", 3.0)):
        (tmp_path / folder).mkdir()
        np.savetxt(tmp_path / folder / "pulse.txt", factor * acc)
    monkeypatch.chdir(tmp_path / "here")
    job = romdam.load_config(raw)
    monkeypatch.chdir(tmp_path / "there")
    assert romdam.read_motions(job)[0].peak == pytest.approx(abs(acc).max())


def test_results_in_memory_are_what_the_files_hold(config, raw, tmp_path):
    raw["outputs"] |= {"stress": {"nodes": {"heel": {"block": "right", "at": [0, 0, 0]}}}}
    job = romdam.load_config(raw, config.parent)
    kept, unkept = (romdam.run(job, out).results[0] for out in (tmp_path / "out", None))
    assert_same(kept.dataset.load(), unkept.dataset, "configuration_folder")
    assert unkept.dataset.displacement.variable._in_memory
    for name in ("displacement", "stress"):
        first, second = (getattr(one, name)("right") for one in (kept, unkept))
        xr.testing.assert_identical(first, second)
    assert float(abs(unkept.displacement("right")).max()) > 1e-4
    assert unkept.dataset.attrs["configuration_folder"] == str(config.parent)


def test_results_of_a_folder_that_was_used_again_are_refused(raw, acc, tmp_path):
    job, pulse = dict(raw, records=[]), romdam.GroundMotion.from_arrays("pulse", {"y": acc}, 0.01)
    first = romdam.run(job, tmp_path, motions=pulse)
    again = romdam.run(job, tmp_path, motions=replace(pulse, acc=0.5 * pulse.acc))
    with pytest.raises(romdam.ResultError, match=r"pulse\.nc: holds another run's numbers by now"):
        _ = first.results
    assert np.array_equal(again.results[0].dataset.peak_opening, again.lone.peak_opening)
    several = romdam.run(job, tmp_path, motions=[pulse, replace(pulse, name="other")])
    assert [one.record for one in several.results] == ["pulse", "other"]


def test_results_are_found_from_another_folder_and_with_a_statement_of_their_error(
    config, raw, tmp_path, monkeypatch
):
    monkeypatch.chdir(config.parent)
    outcome, same = (romdam.run(raw, out) for out in ("out", "same"))
    assert romdam.certify(outcome.paths[0])
    (here,) = same.results
    monkeypatch.chdir(Path("/"))
    (found,) = outcome.results
    assert (*outcome.paths, here.path) == (Path("out/pulse.nc"), Path("same/pulse.nc")), "as they were given"
    assert "certificate_statement" in found.dataset.attrs
    for one in (here, found):
        assert one.displacement("right").size and one.blocks == ["left", "right"]


def test_nothing_is_left_of_results_in_memory(config, raw, monkeypatch):
    monkeypatch.chdir(config.parent)
    before = sorted(config.parent.rglob("*"))
    outcome = romdam.run(raw | {"outputs": {"plots": True}})
    folder = outcome.results[0].path.parent
    assert outcome.paths == () and folder.is_dir() and not list(folder.glob("*.png"))
    dataset = outcome.results[0].dataset
    outcome.results[0].close()
    del outcome
    assert not folder.exists() and sorted(config.parent.rglob("*")) == before
    assert float(dataset.peak_opening.max()) > 1e-5, "it is in memory"


def test_several_records_and_one_that_fails_in_memory(config, raw):
    raw["records"] += [{**raw["records"][0], "name": "half", "scale": 0.5}]
    raw["records"] += [{**raw["records"][0], "name": "lost", "file": "nowhere.txt"}]
    outcome = romdam.run(romdam.load_config(raw, config.parent))
    assert [one.record for one in outcome.results] == ["pulse", "half"] and list(outcome.failures) == ["lost"]
    assert "nowhere.txt" in outcome._repr_html_() and "half" in outcome._repr_html_()


def test_motions_run_as_the_records_that_they_are(config, raw, acc, tmp_path):
    job = romdam.load_config(raw, config.parent)
    by_record = romdam.run(job).results[0].dataset
    bare = {key: value for key, value in raw.items() if key != "records"}
    arrays = romdam.GroundMotion.from_arrays("pulse", {"y": acc}, 0.01)
    whole = romdam.GroundMotion.from_arrays("pulse", np.array([np.zeros(60), acc, np.zeros(60)]), 0.01)
    samples = romdam.GroundMotion("pulse", whole.acc, 0.01)
    for source, given in ((bare, romdam.read_motions(job)), (bare, [whole]), (job, samples), (bare, arrays)):
        found = romdam.run(source, motions=given).results[0].dataset
        assert_same(by_record, found, *OF_RECORDS, "record_warnings", "configuration_folder", *OF_PLACE)
    about = json.loads(found.attrs["record_provenance"])
    assert about["given"] == "as arrays in Python, m/s2" and len(about["acceleration_sha256"]) == 64
    assert json.loads(found.attrs["configuration"])["records"] == [], "none of them was run"
    with pytest.raises(romdam.ResultError, match="was given as arrays in Python"):
        romdam.certify(romdam.run(bare, tmp_path / "out", motions=arrays).paths[0])


def test_a_motion_that_was_changed_does_not_pass_for_its_file(config, raw):
    motion = romdam.read_motions(romdam.load_config(raw, config.parent))[0]
    doubled = replace(motion, acc=2.0 * motion.acc)
    found = [romdam.run(raw, motions=one).results[0].dataset.attrs for one in (motion, doubled)]
    about = [json.loads(one["record_provenance"]) for one in found]
    assert about[0]["files"] == about[1]["files"], "where it was read"
    assert about[0]["acceleration_sha256"] != about[1]["acceleration_sha256"]
    assert found[1]["record_peak_acceleration"] == 2.0 * found[0]["record_peak_acceleration"]


WRONG_ARRAYS = {
    "one row": ("a", np.zeros(9), 0.01, r"shape \(9,\), wanted \(3, nt\)"),
    "samples first": ("a", np.zeros((9, 3)), 0.01, r"shape \(9, 3\)"),
    "unknown axis": ("a", {"u": np.zeros(9)}, 0.01, "known are x, y and z"),
    "no axis": ("a", {}, 0.01, "known are x, y and z"),
    "other lengths": ("a", {"x": np.zeros(9), "y": np.zeros(8)}, 0.01, "equally long"),
    "a number": ("a", {"x": 1.0}, 0.01, "equally long"),
    "not finite": ("a", {"y": [0.0, 1.0, np.nan]}, 0.01, "component y is nan at sample 2"),
    "text": ("a", {"y": ["0.1 g", "0"]}, 0.01, "component y: wanted real numbers"),
    "complex": ("a", {"y": np.zeros(9, complex)}, 0.01, "wanted real numbers"),
    "one sample": ("a", {"y": [0.0]}, 0.01, "has 1 samples"),
    "no step": ("a", {"y": np.zeros(9)}, 0.0, "dt must be a time above 0"),
    "step as text": ("a", {"y": np.zeros(9)}, "10 ms", "dt: wanted real numbers"),
    "no name": ("", {"y": np.zeros(9)}, 0.01, "name is text"),
}


@pytest.mark.parametrize("name", WRONG_ARRAYS)
def test_arrays_that_are_no_motion_are_refused(name):
    called, values, dt, message = WRONG_ARRAYS[name]
    with pytest.raises(romdam.RecordError, match=message):
        romdam.GroundMotion.from_arrays(called, values, dt)


def test_motions_that_cannot_be_run_are_refused(raw):
    motion = romdam.GroundMotion.from_arrays("a", {"y": np.sin(np.arange(99.0))}, 0.01)
    for given, message in {
        "none": ([], "there is none"),
        "a path": (["pulse.txt"], r"motions\[0\]: expected a romdam.GroundMotion, got 'pulse.txt'"),
        "one name twice": ([motion, replace(motion, dt=0.02)], "2 records are named 'a'"),
        "no file's name": (replace(motion, name="a/b"), "'/'"),
        "milliseconds": ([motion, replace(motion, name="b", dt=10.0)], r"motions\[1\], b: dt must be from"),
        "no finite": (replace(motion, acc=np.full((3, 9), np.inf)), "is inf at sample 0"),
        "counts": (replace(motion, acc=1e6 * motion.acc), "is the unit right"),
    }.values():
        with pytest.raises(romdam.RecordError, match=message):
            romdam.run(raw, motions=given)


def test_gal_taken_for_metres_are_doubted(raw, acc, caplog):
    romdam.run(raw, motions=romdam.GroundMotion.from_arrays("a", {"y": 100 * acc}, 0.01))
    assert any("more than any record" in line for line in caplog.messages)


def test_components_go_to_their_axes():
    rows = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])
    by_name = romdam.GroundMotion.from_arrays("a", {"z": rows[2], "x": rows[0], "y": rows[1]}, 0.01)
    whole = romdam.GroundMotion.from_arrays("a", rows, 0.01)
    assert by_name.acc.tolist() == whole.acc.tolist() == rows.tolist()
    assert romdam.GroundMotion.from_arrays("a", {"z": rows[2]}, 0.01).acc.tolist()[:2] == [[0.0] * 3] * 2
    assert whole.to_xarray().sel(component="z").values.tolist() == rows[2].tolist()


def test_a_motion_is_copied_and_turns_into_xarray(acc):
    motion = romdam.GroundMotion.from_arrays("a", {"y": acc}, 0.01)
    largest = float(acc.max())
    acc[:] = 0.0
    array = motion.to_xarray()
    assert array.dims == ("component", "time") and array.units == "m s-2" and array.name == "a"
    assert float(array.sel(component="y").max()) == largest > 2.0
    assert array.time.values.tolist() == motion.time.tolist()


def test_wrong_keys_of_a_mapping_name_the_configuration(raw):
    for wrong, message in {
        "unknown key": (
            raw | {"jonts": {}},
            "jonts is not a known key; did you mean 'joints'",
        ),
        "no number": (raw | {"model": {"modes": "many"}}, "model.modes"),
        "wrong unit": (
            raw | {"transient": {"finest_step": "2 mm"}},
            "transient.finest_step",
        ),
        "number as key": (raw | {"joints": {1: {}}}, "a key must be text, got 1"),
        "no records": (
            {k: v for k, v in raw.items() if k != "records"},
            "records is missing",
        ),
        "no mapping": (3, "a job is a path, a mapping of keys, a Config or a Job, got 3"),
    }.values():
        with pytest.raises(romdam.ConfigError) as error:
            romdam.run(wrong)
        assert message in str(error.value) and (wrong == 3 or "the configuration: " in str(error.value))
    endless = dict(raw)
    endless["joints"] = endless
    with pytest.raises(romdam.ConfigError, match="nested deeper than"):
        romdam.run(endless)


def test_errors_of_a_scene_name_the_configuration_too(config, raw):
    raw["blocks"]["left"]["box"]["element_size"] = 3.0
    with pytest.raises(romdam.RomdamError, match=r"^the configuration: "):
        romdam.run(romdam.load_config(raw, config.parent))


def test_a_folder_belongs_to_what_is_no_file(config, raw):
    with pytest.raises(romdam.ConfigError, match="folder: is for a mapping or a Config"):
        romdam.load_config(config, folder=config.parent)


def test_numbers_of_numpy_and_tuples_are_taken(config, raw):
    given = raw | {"transient": {"finest_step": np.float64(0.002)}, "model": {"modes": np.int64(10)}}
    given["records"] = ({**raw["records"][0], "file": Path("pulse.txt")},)
    given["outputs"] = {
        "plots": np.bool_(False),
        "mesh_error": np.bool_(False),
        "nodes": {"top": {"block": "right", "at": np.array([0, 0, 20])}},
    }
    given["outputs"]["output_interval"] = "10 ms"
    assert romdam.load_config(given, config.parent).digest == romdam.load_config(raw, config.parent).digest


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_a_job_survives_mappings_and_yaml(path):
    job = romdam.load_config(path)
    assert romdam.load_config(job.to_dict(), job.folder).digest == job.digest
    assert romdam.load_config(job.config, job.folder).digest == job.digest
    assert romdam.load_config(yaml.safe_load(job.to_yaml()), job.folder).digest == job.digest


def test_text_that_looks_like_a_number_stays_text_in_yaml(raw, tmp_path):
    for title in ("1e3", "no", "0x10", "null", "12:30", "~", "2001-01-01", "a: b", "ü\n#"):
        (tmp_path / "a.yaml").write_text(
            romdam.load_config(raw | {"title": title}).to_yaml(), encoding="utf-8"
        )
        assert romdam.load_config(tmp_path / "a.yaml").config.title == title


def test_variants_of_a_mapping_are_those_of_its_file(config, raw):
    variants = {"gaps": {}, "stiff": {"joints.gap.normal_stiffness": "rigid"}}
    raw["comparison"] = {"reference": "gaps", "variants": variants}
    config.write_text(yaml.safe_dump(raw | {"pipeline": "comparison"}))
    file = variant_jobs(romdam.load_config(config))
    made = variant_jobs(romdam.load_config(raw | {"pipeline": "comparison"}, config.parent))
    assert {name: job.digest for name, job in file.items()} == {
        name: job.digest for name, job in made.items()
    }
    assert {job.folder for job in made.values()} == {config.parent}


def test_a_suite_and_a_check_take_mappings_too(config, raw, tmp_path):
    raw |= {"pipeline": "suite", "suite": {"scales": [0.5, 1]}}
    job = romdam.load_config(raw, config.parent)
    outcome = romdam.run_suite(job, tmp_path / "suite", romdam.SuiteOptions(workers=1))
    assert (outcome.runs, outcome.failures) == (2, {})
    assert "2 (1 records, 2 scales, 1 samples)" in outcome._repr_html_()
    assert romdam.check(job).unknowns > 0


class _Shown(HTMLParser):
    """The tags and the text of a piece of HTML; every tag is closed."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.open, self.text = [], [], ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data + " "


def test_what_a_notebook_shows_is_escaped_and_says_what_was_run(config, raw, acc, tmp_path):
    raw["title"] = HOSTILE
    job = romdam.load_config(raw, config.parent)
    outcome = romdam.run(job, tmp_path / "out")
    failed = replace(outcome, failures={"lost": HOSTILE})
    motion = replace(
        romdam.GroundMotion.from_arrays("a", {"y": acc}, 0.01), name=HOSTILE, warnings=(HOSTILE,)
    )
    for one in (job, outcome, failed, outcome.results[0], motion):
        shown = _Shown(one._repr_html_())
        assert set(shown.tags) <= {"div", "strong", "table", "tr", "th", "td"}
        assert HOSTILE in shown.text and "\n" not in repr(one)
    told = _Shown(outcome.results[0]._repr_html_()).text
    peak = 1e3 * float(outcome.results[0].dataset.peak_opening.max())
    for part in ("record pulse", f"gap {peak:.3g} mm", str(outcome.paths[0]), "0.59 s", "reduced order"):
        assert part in told
    colours = re.findall(r"(?:color|background):([^;\"]*)", outcome.results[0]._repr_html_())
    assert set(colours) == {"inherit", "none"}, "they are the notebook's, light or dark"


def test_jobs_of_every_kind_are_shown(config, raw):
    for model, shown in {
        "reduced, 10 modes": ({"modes": 10}, "10 modes a block"),
        "cut off": ({"cutoff": "50 Hz"}, "cut off at 50 Hz"),
        "full": ({"order": "full"}, "full order"),
    }.values():
        job = romdam.load_config(raw | {"model": model})
        assert shown in job._repr_html_() and "2 blocks, 1 joints" in repr(job)


def test_a_result_without_joints_is_shown(config, raw):
    del raw["joints"]
    shown = romdam.run(romdam.load_config(raw, config.parent)).results[0]._repr_html_()
    assert "no joints" in shown


@pytest.mark.parametrize(("pipeline", "other"), [("suite", "run_suite"), ("comparison", "compare")])
def test_a_job_of_several_runs_is_not_run_as_one(raw, pipeline, other, tmp_path):
    several = {"suite": {"scales": [1, 2]}, "comparison": {"variants": {"a": {}, "b": {}}}}[pipeline]
    with pytest.raises(romdam.ConfigError, match=f"use romdam.{other}"):
        romdam.run({**raw, "pipeline": pipeline, pipeline: several}, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_figures_that_cannot_be_drawn_are_the_failure_of_their_own_record(raw, acc, tmp_path, monkeypatch):
    def fail_on_one(dataset, folder, stem):
        if stem == "one":
            raise romdam.ResultError("no room for figures")
        (folder / f"{stem}.png").touch()

    monkeypatch.setattr(pipeline, "draw", fail_on_one)
    motions = [romdam.GroundMotion.from_arrays(name, {"y": acc}, 0.01) for name in ("one", "two", "three")]
    raw["outputs"]["plots"] = True
    outcome = romdam.run(raw, tmp_path / "out", motions=motions)
    assert outcome.failures == {"one": "no room for figures"}
    assert sorted(path.stem for path in (tmp_path / "out").glob("*.png")) == ["three", "two"]
    assert [path.name for path in outcome.paths] == ["one.nc", "two.nc", "three.nc"] and not outcome.others
    summary = romdam.open_suite(tmp_path / "out")
    assert not summary.status.any() and np.isfinite(summary.peak_opening.values).all(), "the runs are good"


def test_a_record_that_ends_in_a_singular_matrix_leaves_the_others(raw, acc, tmp_path, monkeypatch):
    """Where it is not an error of romdam's own, too."""
    simulate = pipeline.simulate_motion

    def fail_on_one(job, prepared, motion, *rest):
        if motion.name == "one":
            raise np.linalg.LinAlgError("Singular matrix")
        return simulate(job, prepared, motion, *rest)

    monkeypatch.setattr(pipeline, "simulate_motion", fail_on_one)
    motions = [romdam.GroundMotion.from_arrays(name, {"y": acc}, 0.01) for name in ("one", "two")]
    outcome = romdam.run(raw, tmp_path / "out", motions=motions)
    assert outcome.failures == {"one": "LinAlgError: Singular matrix"}
    assert [path.name for path in outcome.paths] == ["two.nc"]


@pytest.mark.parametrize("error", [np.linalg.LinAlgError("singular"), FloatingPointError("overflow")])
def test_an_estimate_that_fails_costs_the_estimate_only_and_says_why(raw, acc, monkeypatch, error):
    def fail(*_):
        raise error

    monkeypatch.setattr("romdam.pipelines.error.estimate.estimate_error", fail)
    motion = romdam.GroundMotion.from_arrays("one", {"y": acc}, 0.01)
    attrs = romdam.run(raw, motions=motion).results[0].dataset.attrs
    (said,) = json.loads(attrs["run_warnings"])
    assert said == f"its error is not estimated: {type(error).__name__}: {error}"
    assert attrs["error_estimate"].startswith("What leaving out modes changes is unknown: ")


def test_a_duration_that_ends_in_the_pad_is_refused_and_a_cut_peak_is_told(raw, acc, caplog):
    """A correction puts zeros before a record; what is run of it is stated beside the whole."""
    motion = romdam.GroundMotion.from_arrays("one", {"y": np.concatenate([np.zeros(500), acc])}, 0.01)
    transient = raw["transient"]
    with pytest.raises(
        romdam.ConfigError, match=r"transient.duration: the first 4 s of one .* nothing but rest"
    ):
        romdam.run({**raw, "transient": transient | {"duration": "4 s"}}, motions=motion)
    steps = int(np.abs(acc).argmax())
    cut = {**raw, "transient": transient | {"duration": f"{5.0 + 0.01 * (steps - 2)} s"}}
    dataset = romdam.run(cut, motions=motion).results[0].dataset
    left = np.abs(acc[: steps - 1]).max()
    assert dataset.attrs["analysed_peak_acceleration"] == left < dataset.attrs["record_peak_acceleration"]
    assert f"a peak of {left:.3g} of {np.abs(acc).max():.3g} m/s2" in caplog.text
    assert any(f"peak {left:.3g} m/s² of what was analysed" in line for line in info_lines(dataset))


def test_a_check_solves_for_frequencies_with_closed_joints_once(config, monkeypatch):
    from romdam.pipelines import check as checking

    solve, calls = checking.closed_frequencies, []
    monkeypatch.setattr(checking, "closed_frequencies", lambda *a: calls.append(a) or solve(*a))
    assert romdam.check(config).closed_frequencies and len(calls) == 1
