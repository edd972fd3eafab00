"""Files that romdam 0.1 wrote (`version_0_1/make.py`) open, are told, reported and drawn."""

import json
import logging
import tarfile
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import romdam
from romdam import cli
from romdam.results.renamed import RENAMED, with_names_of_now
from romdam.results.suite.journal import JOURNAL, read_rows
from romdam.results.suite.rows import source_of_rows

FILES = Path(__file__).with_name("version_0_1") / "files.tar.xz"


@pytest.fixture
def old(tmp_path):
    with tarfile.open(FILES) as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path


@pytest.fixture
def invoke():
    """A command's output, once it has succeeded; messages that it logs are in `caplog`."""

    def call(*arguments):
        done = CliRunner().invoke(cli.app, [str(argument) for argument in arguments])
        assert done.exit_code == 0, done.output
        return done.output

    return call


def test_result_has_the_names_of_now_and_one_warning(old, caplog):
    with romdam.open_result(old / "run" / "r0.nc") as result:
        attrs = result.dataset.attrs
        assert attrs["solver_finest_step"] == 0.005 and attrs["solver_condensed_contacts"] == 0.0
        counts = ("dynamic_modes", "quasi_static_modes", "integrated_gaps")
        assert [attrs[f"solver_{name}"] for name in counts] == [32.0, 0.0, 4.0]
        assert not set(RENAMED) & {*attrs, *result.dataset.variables}
        assert float(result.dataset.peak_opening.max()) > 0.0
        assert result.displacement("left", nodes=0).shape == (30, 1, 3)
        assert result.dataset.reduced_coordinates.units == "m"
        joint = result.dataset.joint.item()
        assert result.dataset.opening.sel(gap_joint=joint).equals(result.dataset.opening)
        assert result.stress("left").sizes["stress_component"] == 6
    (said,) = caplog.messages
    assert str(old / "run" / "r0.nc") in said and "romdam 0.1.0" in said
    assert "solver_held_gaps as solver_condensed_contacts" in said
    assert "solver_marched_gaps as solver_integrated_gaps" in said


def test_result_is_told_and_drawn(old, invoke):
    told = invoke("info", old / "run" / "r0.nc")
    assert "finest step 0.005 s" in told and "by romdam 0.1.0" in told
    invoke("plot", old / "run" / "r0.nc", "--out", old / "figures")
    names = {path.name for path in (old / "figures").iterdir()}
    assert {"r0-joint_opening.png", "r0-maxima.csv"} <= names


def test_suite_opens_and_is_reported_with_its_configuration(old, invoke):
    suite = romdam.open_suite(old / "suite")
    assert suite.peak_opening.shape == (2, 2, 2, 1) and "design" in suite.children
    invoke("report", old / "suite", "--config", old / "suite.yaml")
    assert "Two cantilevers that romdam 0.1 shook" in (old / "suite" / "report.html").read_text()


@pytest.mark.slow
def test_suite_says_why_its_rows_are_made_again(old, caplog):
    before = romdam.open_suite(old / "suite").peak_opening.load()
    outcome = romdam.run_suite(
        romdam.load_config(old / "suite.yaml"), old / "suite", romdam.SuiteOptions(workers=1)
    )
    assert outcome.made == 8
    # blocks have static vectors now, which 0.1 left out: its basis is good to 1e-4 here
    np.testing.assert_allclose(outcome.summary.peak_opening, before, rtol=1e-4)
    (said,) = [text for text in caplog.messages if JOURNAL in text]
    assert "8 rows are of romdam 0.1.0" in said and f"this is romdam {romdam.__version__}" in said
    caplog.clear()
    assert (
        romdam.run_suite(
            romdam.load_config(old / "suite.yaml"), old / "suite", romdam.SuiteOptions(workers=1)
        ).made
        == 0
    )
    sources = [row.source for row in read_rows(old / "suite" / JOURNAL).values()]
    assert sources.count("romdam 0.1.0") == 8 and sources.count(source_of_rows()) == 8


def test_variables_dimensions_and_coordinates_are_renamed_too(old, monkeypatch):
    with romdam.open_result(old / "run" / "r0.nc") as result:
        for former, now in (("opening", "opened"), ("gap", "contact"), ("gap_area", "gap_joint")):
            monkeypatch.setitem(RENAMED, former, now)
        dataset, names = with_names_of_now(result.dataset)
        assert names == {"opening": "opened", "gap": "contact", "gap_area": "gap_joint"}
        assert dataset.opened.dims == ("time", "contact") and "contact" in dataset.coords
        assert dataset.gap_joint.dtype.kind == "U" and "gap_area" not in dataset


def test_what_this_version_writes_needs_no_translation(old, caplog):
    with caplog.at_level(logging.WARNING):
        outcome = romdam.run(romdam.load_config(old / "job.yaml"), old / "now")
        caplog.clear()
        with romdam.open_result(outcome.paths[0]) as result:
            assert json.loads(result.dataset.attrs["versions"]) and not caplog.messages
