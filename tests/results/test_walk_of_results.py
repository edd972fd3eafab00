"""Every variable and attribute of results in turn, as another program may leave it: no command dies of it."""

import re
from pathlib import Path

import pytest
import xarray as xr
from edited_files import edits, known_of, write_all
from test_cli import call

from romdam.core.errors import ResultError
from romdam.error import histories
from romdam.results import dataset as files
from romdam.results import response_spectrum
from romdam.results.checking import check_run, check_spectrum, check_summary
from romdam.results.dataset import build_dataset
from romdam.results.suite import report_data, summary

DIGITS = re.compile(r"seconds_|^solver_|^discretisation_.*_(l2|peak)$")  # numbers that are but told


def passing(dataset, check, path, step=1):
    """The edits that are let pass; the others are refused in a line that names file and what is edited."""
    for name, what, edited in edits(dataset, step):
        try:
            check(edited, known_of(edited), path)
        except ResultError as refused:
            message = str(refused)
            assert name in message and path.name in message and "\n" not in message, (name, what, message)
        else:
            yield name, what, edited


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_an_edited_result_is_refused_by_name_or_read(step, case, job, timing):
    """The synthetic case has every kind of variable."""
    dataset = build_dataset(case, job, timing, "model-a.h5")
    check_run(dataset, known_of(dataset), Path("a.nc"))
    passed = {(name, what) for name, what, _ in passing(dataset, check_run, Path("a.nc"), step)}
    assert ("time", "reversed") not in passed and ("gap_area", "zero") not in passed
    assert ("joint_state", "negative") not in passed and ("component", "reversed") not in passed
    # of these one kind alone is let pass: that they are there, or not
    assert {what for name, what in passed if name == "record_warnings"} <= {"gone", "a list"}
    assert {what for name, what in passed if name == "solver_steps"} <= {
        "gone", "a number", "zero", "a negative number", "no number"
    }  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_all(tmp_path_factory.mktemp("results"))


def commands(kind, written, out):
    """Everything that reads a file of a kind."""
    run, suite = written.run, written.suite.parent
    return {
        "run": [
            ("info", run), ("info", run, "--json"), ("report", run), ("report", run, "--units", "us"),
            ("plot", run, "--out", out), ("compare", run, written.other, "--out", out),
            ("compare", written.other, run, "--json"), ("certify", run, "--config", written.job),
            ("stability", written.job, run, "--out", out), ("wedges", written.wedges, run, "--out", out),
            ("view", run, "--html", out / "view.html", "--frames", "2"),
        ],
        "suite": [("report", suite)],
        "data": [("report", suite)],
        "spectrum": [("info", written.spectrum), ("info", written.spectrum, "--json")],
    }[kind]  # fmt: skip


CHECKS = {"run": check_run, "suite": check_summary, "spectrum": check_spectrum}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["run", "suite", "data", "spectrum"])
def test_no_command_dies_of_an_edited_result(kind, written, tmp_path, monkeypatch):
    """In place of each edited file its content is handed to the commands, which takes a tenth of the time."""
    data = written.suite.with_name(report_data.DATA)
    path = {"run": written.run, "suite": written.suite, "data": data, "spectrum": written.spectrum}[kind]
    whole, now = files.open_netcdf, [None]

    def opened(asked, warn=True):
        if now[0] is None or Path(asked) != path:
            return whole(asked, warn)
        edited = now[0].copy()
        indexed = "gap_joint" in edited.coords and edited.gap_joint.ndim == 1
        return (edited.set_xindex("gap_joint") if indexed else edited), known_of(edited)

    for module in (files, histories, response_spectrum, summary):
        monkeypatch.setattr(module, "open_netcdf", opened)
    dataset = xr.load_dataset(path, engine="h5netcdf")
    usual = {command: call(*command)[0] for command in commands(kind, written, tmp_path)}
    assert set(usual.values()) <= {0, 1}  # 1: not stable
    check = CHECKS.get(kind, lambda *_: None)
    for name, what, edited in passing(dataset, check, path):
        if DIGITS.search(name) and what not in ("gone", "no number"):
            continue
        now[0] = edited
        for command, code in usual.items():
            found, _, stderr = call(*command)
            said = f"{command[0]}: {name}, {what}: exit code {found}\n{stderr}"
            assert "Traceback" not in stderr and found in {0, 2, code}, said
            if found == 2:
                (message,) = (line for line in stderr.splitlines() if line.startswith("romdam: "))
                assert name in message and path.name in message, said
