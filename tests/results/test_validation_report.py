"""The validation report: numbers by hand, what is not stated with its command, files beside the result."""

import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
import yaml
from test_cli import call, config  # noqa: F401

from romdam.benchmarks.catalogue import CASES
from romdam.benchmarks.table import shipped_rows
from romdam.config.load import load_config, parse_config
from romdam.core.benchmark_row import BenchmarkRow
from romdam.core.display_units import SI
from romdam.error.applicable import applies
from romdam.error.approximations import APPROXIMATIONS, Approximation, not_included
from romdam.error.statement import opening_errors, quantity_errors, sentences
from romdam.pipelines.validation import _applied, _approximations, mesh_parts, next_commands
from romdam.postprocess.stated_errors import percent, total_text
from romdam.results.companions import Companions, companions_of
from romdam.results.dataset import write_dataset
from romdam.timestepping.integrators.registry import integrator_class
from romdam.visual.report.one_run import RunSubject
from romdam.visual.report.page import page
from romdam.visual.report.parts import Code, PageTable, Text
from romdam.visual.report.validation import SECTIONS, ValidationSubject, validation_report

ROW = BenchmarkRow(
    "rod", "a rod of steel", "length", "m", 2.2, 2.0, 0.1, 0.15, "known difference", "Somebody (1999)",
    "printed", False, "it was warm",
)  # fmt: skip
STATED = {  # [1]; the certificate counts for the modes, as it is nearer than the estimate
    "discretisation_opening_l2": 0.03, "discretisation_opening_peak": 0.011,
    "discretisation_joint_force_l2": 0.5, "discretisation_joint_force_peak": 0.25,
    "certificate_opening_l2": 0.004, "certificate_opening_peak": 0.0021,
    "error_estimate_opening_l2": 0.006, "error_estimate_opening_peak": 0.0033,
    "solver_estimated_time_error": 0.005, "solver_estimated_time_error_peaks": 0.0012,
}  # fmt: skip
NAME = "two_cantilevers.yaml"  # of the fixture's configuration
ATTRIBUTES = ("discretisation", "certificate", "error_estimate", "verification", "error_statement")


def subject_of(dataset, job, benchmarks=(), companions=None):
    attrs = dataset.attrs
    run = RunSubject(dataset, job.config, opening_errors(attrs), sentences(attrs), SI)
    return ValidationSubject(
        run, next_commands(run, "quake.nc"), quantity_errors(attrs) | mesh_parts(attrs),
        *_approximations(run), benchmarks, companions or Companions(),
    )  # fmt: skip


def stating(dataset, **stated):
    """The dataset with these statements of error and no other."""
    others = [key for key in dataset.attrs if key.startswith(ATTRIBUTES) or "time_error" in key]
    bare = dataset.copy()
    bare.attrs = {key: value for key, value in dataset.attrs.items() if key not in others} | stated
    return bare


def parts_of(report, kind, section=None):
    return [
        part
        for one in report.sections
        if section in (None, one.name)
        for part in one.shown
        if isinstance(part, kind)
    ]


def rows_of(report, caption):
    table = next(t for t in parts_of(report, PageTable) if t.caption.startswith(caption))
    return [[cell.text for cell in row] for row in table.cells]


def facts_of(report):
    return {fact.name: (fact.value, fact.bad) for fact in report.facts}


def test_headings_are_those_of_the_framework(result, job):
    report = validation_report(subject_of(result.dataset, job, [ROW]))
    assert [section.title for section in report.sections] == [
        "1 Conceptual model", "2 Computational model", "3 Verification of the code",
        "4 Verification of the solution", "5 Validation against measurements", "6 Uncertainty",
        "7 Warnings and limits", "8 How to reproduce",
    ]  # fmt: skip
    assert len(SECTIONS) == 8 and report.title == f"Validation: {result.dataset.attrs['title']}"


def test_errors_stand_by_statement_and_quantity_and_add_up(result, job):
    report = validation_report(subject_of(stating(result.dataset, **STATED), job))
    assert rows_of(report, "Stated errors") == [
        ["mesh and contact points", "opening", "3", "1.1"],
        ["mesh and contact points", "joint force", "50", "25"],
        ["modes, certificate", "opening", "0.4", "0.21"],
        ["modes, estimate", "opening", "0.6", "0.33"],
        ["steps", "opening", "0.5", "0.12"],
        ["all, at most", "opening", "3.9", "–"],  # 3 + 0.4 + 0.5
    ]
    assert facts_of(report)["stated error of the openings, L2, at most"] == ("3.9 %", False)
    commands = "\n".join(part.text for part in parts_of(report, Code, "solution"))
    assert "certify" not in commands and "--mesh finer" not in commands
    assert commands.splitlines() == [f"romdam verify {NAME} --out DIR", f"romdam study {NAME} --out DIR"]
    of_modes = {row[0]: row for row in rows_of(report, "Approximations that stated errors include")}
    assert of_modes["modes that are left out"][2:] == ["estimate, certificate, verification", "0.4"]
    assert of_modes["size of the elements"][2:] == ["discretisation", "3"]
    assert of_modes["finest step"][2:] == ["steps", "0.5"]


def test_parts_of_the_mesh_and_of_the_steps_have_rows_of_their_own(result, job):
    one = {"l2": 0.02, "peak": 0.007}
    details = {
        "elements": {"opening": one, "slip": one},
        "contact_points": {"opening": {"l2": 0.01, "peak": 0.004}},
        "directions": {"up": {"l2": 0.015, "peak": 0.003, "times_gaps_to_halve": 1.5}, "odd": "text"},
    }
    steps = {"solver_estimated_time_error_slips": 0.04, "solver_estimated_time_error_residual_slips": 0.06}
    stated = STATED | steps | {"discretisation": json.dumps(details)}
    report = validation_report(subject_of(stating(result.dataset, **stated), job))
    assert rows_of(report, "Stated errors")[2:] == [
        ["of these, elements", "opening", "2", "0.7"],
        ["of these, contact points", "opening", "1", "0.4"],
        ["of these, up", "opening", "1.5", "0.3"],
        ["modes, certificate", "opening", "0.4", "0.21"],
        ["modes, estimate", "opening", "0.6", "0.33"],
        ["steps", "opening", "0.5", "0.12"],
        ["steps", "slip", "4", "–"],
        ["steps", "residual slip", "6", "–"],
        ["all, at most", "opening", "3.9", "–"],
    ]


def test_a_result_without_estimates_names_the_commands_that_state_them(result, job):
    report = validation_report(subject_of(stating(result.dataset), job))
    assert facts_of(report)["stated error of the openings, L2, at most"] == ("unknown", False)
    assert not any(t.caption.startswith("Stated errors") for t in parts_of(report, PageTable))
    commands = parts_of(report, Code, "solution")[0].text.splitlines()
    assert commands == [
        f"romdam verify {NAME} --mesh finer --out DIR",
        "romdam certify quake.nc",
        f"romdam run STATED.yaml --out DIR   # {NAME} with transient: {{accuracy: 1 %}}",
    ]
    said = [part.text for part in parts_of(report, Text, "solution")]
    assert "Not stated: the error of the mesh and of the modes and of the steps. To state it:" in said
    stated = rows_of(report, "Approximations that stated errors include")
    assert stated and {row[3] for row in stated} == {"–"}
    only_modes = validation_report(subject_of(stating(result.dataset, error_estimate_opening_l2=0.006), job))
    assert rows_of(only_modes, "Stated errors")[-1] == ["all that are stated, at most", "opening", "0.6", "–"]
    assert facts_of(only_modes)["stated error of the openings, L2, at most"][0] == (
        "0.6 %, mesh and steps unknown"
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.1, "110 %"),
        (0.999, "100 %"),
        (12.34, "1200 %"),
        (0.016, "1.6 %"),
        (4.2e-4, "0.042 %"),
        (1e-7, "1e-05 %"),
    ],
)
def test_errors_beyond_a_hundred_per_cent_have_no_exponent(value, text):
    assert percent(value) == text and total_text({"mesh": value}) == f"{text}, modes and steps unknown"


def run_of(config, folder, change):  # noqa: F811
    """Result of the small job with other keys, and the commands that its validation report names."""
    keys = yaml.safe_load(config.read_text())
    change(keys)
    config.write_text(yaml.safe_dump(keys))
    assert call("run", config, "--out", folder, "--quiet")[0] == 0
    assert call("report", folder / "pulse.nc", "--validation", "--quiet")[0] == 0
    written = (folder / "pulse-validation.html").read_text(encoding="utf-8")
    text = html.unescape(written.partition('id="reproduce"')[0])
    named = [
        line for line in text.splitlines() if re.match(r"(<pre.*>)?romdam (verify|certify|study|run)", line)
    ]
    return [re.sub("<[^>]+>", "", line) for line in named], text


def without_estimates(keys):
    keys["outputs"] |= {"error_estimate": False, "mesh_error": False}


def test_commands_that_the_report_names_do_what_it_says(config, tmp_path):  # noqa: F811
    named, _ = run_of(config, tmp_path / "r", without_estimates)
    result = tmp_path / "r" / "pulse.nc"
    assert [name.split()[1] for name in named] == ["verify", "certify", "run", "verify", "study", "run"]
    with xr.open_dataset(result) as dataset:
        assert not opening_errors(dataset.attrs)
    for command in (named[0], named[1]):
        words = [
            {"small.yaml": config, "pulse.nc": result, "DIR": tmp_path / "r"}.get(w, w)
            for w in command.split()[1:]
        ]
        code, _, err = call(*words)
        assert code == 0, err
    with xr.open_dataset(result) as dataset:
        assert {"mesh", "modes"} <= set(opening_errors(dataset.attrs))
    config.write_text(config.read_text().replace("finest_step: 2 ms", "accuracy: 1 %"))
    assert call("run", config, "--out", tmp_path / "stated", "--quiet")[0] == 0
    with xr.open_dataset(tmp_path / "stated" / "pulse.nc") as dataset:
        assert "steps" in opening_errors(dataset.attrs)


@pytest.mark.slow
def test_a_run_of_full_order_names_what_halves_its_step(config, tmp_path):  # noqa: F811
    def full(keys):
        without_estimates(keys)
        keys["model"] = {"order": "full"}

    named, text = run_of(config, tmp_path / "r", full)
    assert [name.split()[1] for name in named] == ["verify", "run", "run"] and "--mesh finer" in named[0]
    assert "small.yaml with finest_step: 1 ms" in named[1]  # half of 2 ms
    assert "romdam compare pulse.nc DIR/pulse.nc" in text
    config.write_text(config.read_text().replace("finest_step: 2 ms", "finest_step: 1 ms"))
    assert call("run", config, "--out", tmp_path / "half", "--quiet")[0] == 0
    assert call("compare", tmp_path / "r" / "pulse.nc", tmp_path / "half" / "pulse.nc")[0] == 0


@pytest.mark.slow
def test_a_job_without_joints_names_no_command_that_would_be_refused(config, tmp_path):  # noqa: F811
    def tied(keys):
        del keys["joints"]
        keys["ties"] = {"one": {"between": ["left", "right"]}}

    named, text = run_of(config, tmp_path / "r", tied)
    assert [name.split()[1] for name in named] == ["run"]  # a suite
    assert "this job has none" in text and "romdam modes" in text
    assert call("verify", config, "--out", tmp_path / "r")[0] == 2


def test_a_study_is_named_only_where_modes_are_apart(result, job):
    run = RunSubject(result.dataset, job.config, {}, {}, SI)
    assert next_commands(run, "quake.nc")["study"] == f"romdam study {NAME} --out DIR"
    water = {"level": 40.0, "faces": [{"block": "left", "face": "ymin"}], "model": "compressible"}
    keys = job.to_dict() | {"water": water}
    coupled = replace(run, config=parse_config(keys, "job", folder=job.folder, si=True))
    commands = next_commands(coupled, "quake.nc")
    assert "study" not in commands and commands["modes"] == "romdam certify quake.nc"
    keys = job.to_dict() | {"transient": {"finest_step": 0.002, "integrator": "generalized_alpha"}}
    other = replace(run, config=parse_config(keys, "job", folder=job.folder, si=True))
    shifts = integrator_class("generalized_alpha").shifts
    assert next_commands(other, "quake.nc")["modes"] == (
        "romdam certify quake.nc" if shifts else f"romdam verify {NAME} --out DIR"
    )


def test_the_ledger_of_the_end_is_in_shares_of_the_largest(result, job):
    dataset = stating(result.dataset)
    last = {"input": 2e6, "kinetic": 4e4, "strain": 1e5, "joint_stored": 0.0, "damping": 1.5e6,
            "friction": 3.4e5, "contact": 1.9e4, "residual": -1e3}  # fmt: skip
    for term, value in last.items():
        history = np.linspace(0.0, value, dataset.sizes["time"])
        dataset[f"energy_{term}"] = ("time", history)
    report = validation_report(subject_of(dataset.drop_vars("energy_numerical", errors="ignore"), job))
    assert rows_of(report, "Energy ledger") == [
        ["supplied by the ground and by forces", "2 MJ", "100"],
        ["kinetic", "40 kJ", "2"],
        ["strain", "100 kJ", "5"],
        ["stored in joints", "0 J", "0"],
        ["dissipated by damping", "1.5 MJ", "75"],
        ["dissipated by friction", "340 kJ", "17"],
        ["lost at contact", "19 kJ", "0.95"],
        ["not accounted for", "−1 kJ", "−0.05"],
    ]


def test_checks_that_are_missed_are_bad_news(result, job):
    dataset = stating(result.dataset, **STATED, solver_ledger_imbalance=2e-3, solver_accuracy=0.004)
    report = validation_report(subject_of(dataset, job))
    facts, checks = facts_of(report), rows_of(report, "Checks of the run")
    missed = [row[0] for row in checks if row[3] == "missed"]
    assert missed == [
        "energy that the ledger lacks, of the exchanged",
        "error of the openings from the steps, L2",
    ]
    assert facts["checks that are missed"] == (f"2 of {len(checks)}", True)
    assert facts["energy not accounted for, of the exchanged"] == ("0.2 %", False)


def test_benchmarks_stand_by_case_and_measured_dams_in_full(result, job):
    small = replace(ROW, quantity="width", ours=1.99, difference=-0.005, verdict="within", note="")
    dam = replace(ROW, case="dam", what="a dam", quantity="first", unit="Hz", ours=3.0, published=3.2,
                  difference=-0.0625, tolerance=0.1, measured=True, source="Test (1971)",
                  note="no plan")  # fmt: skip
    model = replace(dam, quantity="second", ours=5.0, published=5.0, difference=1e-9, measured=False)
    report = validation_report(subject_of(result.dataset, job, [small, ROW, dam, model]))
    assert rows_of(report, "Cases with known answers") == [
        ["rod", "a rod of steel", "2", "10", "within, known difference"]
    ]
    assert rows_of(report, "Measured dams") == [
        ["dam", "first [Hz]", "3", "3.2", "−6.2", "±10"],
        ["dam", "second [Hz]", "5", "5", "0", "±10"],
    ]
    assert [part.text for part in parts_of(report, Code, "code")] == ["romdam benchmarks"]
    assert parts_of(report, Code, "measurements")[0].text == "romdam benchmarks --only dam"
    said = [part.text for part in parts_of(report, Text, "measurements")]
    assert "dam: no plan." in said and any("Test (1971) (printed)" in text for text in said)
    assert "rod: it was warm." in [part.text for part in parts_of(report, Text, "code")]
    name = "benchmarks within their bands, 3 with a known difference"
    assert facts_of(report)[name] == ("4 of 4", False)
    wrong = replace(ROW, verdict="failed", ours=np.nan, difference=np.nan)
    report = validation_report(subject_of(result.dataset, job, [wrong]))
    assert facts_of(report)["benchmarks within their bands, 0 with a known difference"] == ("0 of 1", True)
    assert rows_of(report, "Cases with known answers")[0][3:] == ["–", "failed"]


def test_foreign_text_is_escaped(result, job):
    evil = "<script>alert(1)</script>"
    dataset = result.dataset.assign_attrs(title=evil, run_warnings=json.dumps([evil]), machine=evil)
    modes = xr.Dataset(
        {"measured_frequency": ("measured", [2.0]), "measured_mode": ("measured", [1]),
         "frequency": ("mode", [2.1]), "frequency_difference": ("measured", [0.05])},
        {"measured": [evil], "mode": [1]}, {"joints": evil},
    )  # fmt: skip
    companions = Companions(modes={evil: modes}, passed_over=[evil])
    row = replace(ROW, note=evil, what=evil, source=evil, case=evil)
    text = page(validation_report(subject_of(dataset, job, [row, replace(row, measured=True)], companions)))
    assert evil not in text and text.count("&lt;script&gt;") >= 8


def modes_file(folder, digest, name="dam-modes-tied.nc", measured=(3.6, 4.5)):
    frequency = np.array([3.7, 4.2, 4.4])
    dataset = xr.Dataset(
        {
            "measured_frequency": ("measured", np.array(measured)),
            "measured_mode": ("measured", np.array([1, 3])),
            "frequency": ("mode", frequency),
            "frequency_difference": ("measured", frequency[[0, 2]] / measured - 1.0),
        },
        {"measured": ["first", "second"], "mode": [1, 2, 3]},
        {"joints": "tied", "configuration_sha256": digest, "source": "romdam"},
    )
    write_dataset(dataset, folder / name)


def study_file(folder, digest):
    dataset = xr.Dataset(
        {
            "setting": ("case", np.array(["10 modes", "20 modes", "30 modes"])),
            "l2_error": ("case", [0.02, 0.004, np.nan]),
            "peak_error": ("case", [0.01, 0.001, np.nan]),
            "total_cpu_seconds": ("case", [1.5, 2.5, np.nan]),
            "of_job": ("case", np.array([0, 1, 0], dtype=np.int8)),
            "failure": ("case", np.array(["", "", "no memory"])),
        },
        attrs={
            "configuration_sha256": digest,
            "compared": "quake, 3 s against all modes",
            "source": "romdam",
        },
    )
    write_dataset(dataset, folder / "study.nc")


def test_what_stands_beside_the_result_is_shown_where_it_is_of_the_same_job(result, job, tmp_path):
    modes_file(tmp_path, "abc")
    modes_file(tmp_path, "other", "old-modes-open.nc")
    study_file(tmp_path, "abc")
    companions = companions_of(tmp_path / "quake.nc", "abc")
    assert list(companions.modes) == ["dam-modes-tied.nc"] and companions.summary is None
    assert companions.passed_over == ["old-modes-open.nc: is of another configuration, so it is left out."]
    report = validation_report(subject_of(result.dataset, job, companions=companions))
    assert rows_of(report, "This dam, joints tied: dam-modes-tied.nc") == [
        ["first", "3.6", "1", "3.7", "2.8"],  # 3.7 / 3.6 - 1
        ["second", "4.5", "3", "4.4", "−2.2"],
    ]
    assert rows_of(report, "Study: quake, 3 s against all modes") == [
        ["10 modes", "2", "1", "1.5"],
        ["20 modes (the job's own)", "0.4", "0.1", "2.5"],
        ["30 modes", "–", "–", "–"],
    ]
    assert facts_of(report)["measured frequencies of this dam"] == ("2", False)
    assert rows_of(report, "Files left out") == [[companions.passed_over[0]]]
    commands = "\n".join(part.text for part in parts_of(report, Code))
    assert "romdam study" not in commands and "--measured" not in commands


def test_damaged_files_beside_the_result_are_named(tmp_path):
    (tmp_path / "study.nc").write_bytes(b"no study")
    (tmp_path / "summary.nc").write_bytes(b"")
    modes_file(tmp_path, "abc")
    with xr.open_dataset(tmp_path / "dam-modes-tied.nc") as dataset:
        without = dataset.load().drop_vars("frequency")
    write_dataset(without, tmp_path / "dam-modes-tied.nc")
    companions = companions_of(tmp_path / "quake.nc", "abc")
    assert (companions.study, companions.modes, companions.summary) == (None, {}, None)
    files = [text.partition(":")[0] for text in companions.passed_over]
    assert files == ["study.nc", "dam-modes-tied.nc", "summary.nc"]
    assert "lacks frequency" in companions.passed_over[1]


def test_words_of_the_result_stand_beside_what_they_are_of():
    """Where the result says nothing, nothing is listed; a row that says itself whether it acts needs none."""
    words = Approximation("gaps", ("fem.gaps",), "a `moment`", "said in the result", ("a.b: gaps stay",))
    said = ["The dam is odd.", "In joint J1 gaps stay where they were."]
    found = _applied(words, {}, said)
    assert found is not None and (found.how, found.evidence) == ("said", said[1])
    assert found.changes == "a moment" and _applied(words, {}, said[:1]) is None
    rock = replace(words, by=(), acts=lambda _: True)
    assert _applied(rock, {}, []).how == "not included"
    assert _applied(replace(words, stated="exact"), {}, said) is None
    both = replace(words, stated="varied by", by=("discretisation", "steps"))
    assert _applied(both, {"mesh": 0.02, "steps": 0.01, "modes": 1.0}, said).error == pytest.approx(0.03)


def test_the_command_writes_page_and_pdf_and_refuses_what_is_no_result(config, tmp_path):  # noqa: F811
    assert call("run", config, "--out", tmp_path / "r", "--quiet")[0] == 0
    result = tmp_path / "r" / "pulse.nc"
    code, out, err = call("report", result, "--validation", "--pdf", "--units", "us")
    written = [result.with_name(f"pulse-validation.{kind}") for kind in ("html", "pdf")]
    assert code == 0, err
    assert out.splitlines() == [f"written: {path}" for path in written]
    text = written[0].read_text(encoding="utf-8")
    assert "4 Verification of the solution" in text and "US customary units" in text and "pacoima" in text
    assert "romdam report pulse.nc --validation --units us --pdf" in text
    assert written[1].read_bytes().startswith(b"%PDF")
    for wrong in (tmp_path / "none.nc", config):
        code, out, err = call("report", wrong, "--validation")
        assert (code, out) == (2, "") and str(wrong) in err and "Traceback" not in err
    code, out, err = call("report", tmp_path / "r", "--validation")
    assert (code, out) == (2, "") and "is for the result of one run" in err


@pytest.mark.slow
def test_a_suite_beside_the_result_tells_the_scatter(config, tmp_path):  # noqa: F811
    keys = yaml.safe_load(config.read_text())
    keys["records"].append(keys["records"][0] | {"name": "half", "scale": 0.5})
    config.write_text(yaml.safe_dump(keys))
    assert call("run", config, "--out", tmp_path / "r", "--quiet")[0] == 0
    code, _, err = call("report", tmp_path / "r" / "pulse.nc", "--validation")
    assert code == 0, err
    page_text = (tmp_path / "r" / "pulse-validation.html").read_text(encoding="utf-8")
    assert "Statistics of 2 runs of the same job." in page_text and "SUITE.yaml" not in page_text


def test_the_figures_that_came_with_the_package_are_those_of_the_catalogue():
    """Every number of every case, as it stands there; what was computed is held by test_benchmarks."""
    rows = shipped_rows()
    declared = [(case, quantity) for case in CASES for quantity in case.quantities]
    assert len(rows) == len(declared)
    for row, (case, quantity) in zip(rows, declared, strict=True):
        assert (row.case, row.what, row.quantity, row.unit) == (
            case.name,
            case.what,
            quantity.name,
            quantity.unit,
        )
        assert row.published == pytest.approx(quantity.published, rel=1e-12)
        assert (row.tolerance, row.source, row.kind) == (quantity.tolerance, quantity.source, quantity.kind)
        assert row.measured == quantity.measured and row.note == quantity.reason
        assert row.difference == pytest.approx(row.ours / row.published - 1.0, abs=1e-12)
        assert abs(row.difference) <= row.tolerance
        assert row.verdict == ("known difference" if quantity.reason else "within")


def test_the_jobs_approximations_are_all_that_its_result_names(result, job):
    run = RunSubject(result.dataset, job.config, {}, {}, SI)
    named = {one.name for one in _approximations(run)[0] if one.how == "not included"}
    sentence = not_included(job.config)
    assert named and all(name in sentence for name in named)
    assert len(named) == sentence.count(";") + 1


def test_koynas_report_has_what_its_job_has():
    """Water, rock, uplift and friction, and nothing of arcs, cuts or a free field."""
    koyna = load_config("configs/koyna.yaml").config
    names = {row.name for row in APPROXIMATIONS if applies(row, koyna, "adaptive", {"estimate"})}
    assert {
        "modes that stay dry beside 3,000 with water", "pressure of water in joints between the gaps",
        "how far the rock goes, and what its boundary sends back of waves at an angle", "an estimate itself",
    } <= names  # fmt: skip
    assert not names & {
        "straight edges on arcs of generated dams", "nodes that a cut moves onto its surface",
        "free field of irregular meshes", "far end of incompressible water", "a certificate itself",
        "grouting under pressure", "stages of construction", "the mesh of runs of a suite",
    }  # fmt: skip
