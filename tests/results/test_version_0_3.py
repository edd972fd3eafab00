"""What romdam 0.3 wrote (`version_0_3/make.py`) opens: keys, names of joints, results and summaries."""

import json
import logging
import tarfile
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import romdam
from romdam import cli
from romdam.results.renamed import RENAMED

FILES = Path(__file__).with_name("version_0_3") / "files.tar.xz"


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    folder = tmp_path_factory.mktemp("version_0_3")
    with tarfile.open(FILES) as archive:
        archive.extractall(folder, filter="data")
    return folder


@pytest.fixture(scope="module")
def names(old):
    return json.loads((old / "names.json").read_text())


def test_the_archive_is_small():
    assert FILES.stat().st_size < 300_000


@pytest.mark.parametrize("job", ["job", "suite", "gravity"])
def test_keys_are_read_and_joints_have_the_same_names(old, names, job):
    config = romdam.load_config(old / f"{job}.yaml").config
    assert [*config.every_joint] == names[job]
    if job == "gravity":
        assert {"base_1", "lift_2_1", "contraction_1_2_2", "step_2_1"} & set(names[job]) and len(
            names[job]
        ) > 8


def test_result_has_every_variable_and_attribute(old, names):
    """By the names of now, if another version has renamed one."""
    with romdam.open_result(old / "run" / "r0.nc") as result:
        dataset = result.dataset
        assert {RENAMED.get(name, name) for name in names["variables"]} <= set(map(str, dataset.variables))
        assert {RENAMED.get(name, name) for name in names["attributes"]} <= set(map(str, dataset.attrs))
        assert dataset.attrs["source"] == "romdam 0.3.0"
        assert dataset.joint.values.tolist() == names["job"]
        assert (
            float(dataset.anchor_force_largest.max()) > 100e3
        )  # N, of the pretension and what the record adds
        assert result.displacement("left", nodes=0).shape[1:] == (1, 3)
        assert result.stress("left").sizes["stress_component"] == 6


def test_summary_has_every_variable_its_weights_and_frequencies(old, names):
    summary = romdam.open_suite(old / "suite").to_dataset()
    assert {RENAMED.get(name, name) for name in names["summary"]} <= set(map(str, summary.variables))
    np.testing.assert_allclose(summary.weight_of_record, [2 / 3, 1 / 3], rtol=1e-12)
    assert summary.peak_slip.shape == (2, 2, 2, 3) and "annual_frequency" in summary


@pytest.mark.slow
def test_commands_show_what_0_3_wrote_without_a_warning_of_names(old, caplog):
    with caplog.at_level(logging.WARNING):
        for command in (
            ["info", old / "run" / "r0.nc"],
            ["report", old / "run" / "r0.nc"],
            ["report", old / "suite", "--config", old / "suite.yaml"],
        ):
            done = CliRunner().invoke(cli.app, [str(word) for word in command])
            assert done.exit_code == 0, done.output
    assert not [text for text in caplog.messages if " as " in text and "romdam 0.3" in text]
    page = (old / "run" / "r0-report.html").read_text()
    assert "Bases and lifts" in page and "tendon" in page


def test_numbers_are_those_of_0_3(old, tmp_path):
    """A new run of the same job: peaks of openings, slips and anchors, to what libraries leave."""
    outcome = romdam.run(romdam.load_config(old / "job.yaml"), tmp_path)
    with romdam.open_result(outcome.paths[0]) as now, romdam.open_result(old / "run" / "r0.nc") as before:
        for name in ("peak_opening", "peak_slip", "anchor_force_largest", "damper_force_largest"):
            np.testing.assert_allclose(now.dataset[name], before.dataset[name], rtol=1e-4, err_msg=name)
