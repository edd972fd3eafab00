"""Progress appears only on a terminal and only for stages that take a while."""

import io
import re
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from romdam import terminal
from romdam.core.errors import ConfigError
from romdam.pipelines.check import CheckedJob
from romdam.terminal import tables
from romdam.terminal.lines import info_lines, mesh_lines


def console(is_terminal: bool) -> Console:
    return Console(file=io.StringIO(), force_terminal=is_terminal, width=120)


def shown(where: Console, quiet: bool, seconds: float) -> str:
    with terminal.Stages(where, quiet)("shaking") as progress:
        progress(1, 4)
        time.sleep(seconds)
        progress(4, 4)
    return where.file.getvalue()


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(terminal, "DELAY", 0.1)


def test_long_stage_shows_its_name_the_time_it_took_and_the_time_left():
    text = shown(console(True), quiet=False, seconds=0.6)
    assert "shaking" in text and "0:00:00 elapsed, 0:00:0" in text and " left" in text


def test_both_times_stand_whole_in_a_terminal_of_eighty_columns():
    where = Console(file=io.StringIO(), force_terminal=True, width=80)
    with terminal.Stages(where, quiet=False)("simulating a_record_of_a_long_name_horizontal") as stage:
        stage(1, 4)
        time.sleep(0.6)
    assert re.search(r"0:00:0\d elapsed, 0:00:0\d left", where.file.getvalue())


def test_elapsed_and_left_are_told_apart():
    """Nothing is said to be left before a stage has told how far it is; what is left becomes less."""
    assert terminal.times(57.0, 0, 0) == "0:00:57 elapsed"
    assert terminal.times(57.0, 1, 1000) == "0:00:57 elapsed"
    assert terminal.times(60.0, 25, 100) == "0:01:00 elapsed, 0:03:00 left"
    assert terminal.times(3660.0, 75, 100) == "1:01:00 elapsed, 0:20:20 left"


@pytest.mark.parametrize(
    ("is_terminal", "quiet", "seconds"), [(True, False, 0.0), (True, True, 0.4), (False, False, 0.4)]
)
def test_short_quiet_or_piped_stage_shows_nothing(is_terminal, quiet, seconds):
    assert shown(console(is_terminal), quiet, seconds) == ""


def test_a_long_stage_that_is_piped_writes_whole_lines(monkeypatch):
    monkeypatch.setattr(terminal, "EVERY", 0.2)
    where = console(False)
    with terminal.Stages(where, quiet=False)("replaying"):
        time.sleep(0.3)  # nothing is known yet
    with terminal.Stages(where, quiet=False)("shaking") as progress:
        progress(1, 4)
        time.sleep(0.5)
    lines = where.file.getvalue().splitlines()
    for line in lines:  # each with the time that it was written at
        time.strptime(line[:19], terminal.STAMP)
    first, *others = (line[20:] for line in lines)
    assert first == "replaying: 0:00:00 elapsed"
    assert others and all(
        line.startswith("shaking: 25 %, 0:00:0") and line.endswith(" left") for line in others
    )
    assert terminal.times(30.0, 1, 4) == "0:00:30 elapsed, 0:01:30 left"
    assert shown(console(False), quiet=True, seconds=0.3) == ""


def test_the_log_that_is_piped_is_whole_lines_with_the_time():
    code = (
        "import logging; from romdam.terminal import open_terminal; open_terminal();"
        "logging.getLogger('romdam.a').warning('word ' * 60); logging.getLogger('romdam.a').info('no')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    (line,) = done.stderr.splitlines()
    time.strptime(line[:19], terminal.STAMP)
    assert line[20:] == f"WARNING {'word ' * 60}"


def test_more_and_less_are_not_wanted_at_once():
    with pytest.raises(ConfigError, match="opposite of --quiet"):
        terminal.open_terminal(quiet=True, verbose=True)


def test_stage_that_fails_takes_its_bar_away():
    where = console(True)
    with pytest.raises(ValueError, match="inside"), terminal.Stages(where, quiet=False)("shaking"):
        time.sleep(0.3)
        raise ValueError("inside")
    assert where.file.getvalue().rstrip().endswith(("\x1b[2K", "\x1b[?25h")), (
        "the bar is erased, the cursor is back"
    )


def test_a_table_that_is_piped_has_columns_and_no_boxes(capsys):
    _, say = terminal.open_terminal()
    table = tables._table("Peaks", ("joint",), ("opening [mm]",))
    table.add_row("J1", "5.67")
    say(table)
    assert capsys.readouterr().out.splitlines()[-2:] == ["joint  opening [mm]", "J1             5.67"]


@pytest.mark.parametrize(
    ("units", "values", "heading", "shown"),
    [("1", [0.5, 2.0], "scale factor", ["0.5", "2"]), ("m s-2", [1.96133], "scaled to [g]", ["0.2"])],
)
def test_a_scale_has_a_name_that_says_factor_or_a_unit(units, values, heading, shown):
    peaks = np.full((1, len(values), 1, 1), 2e-3)
    summary = xr.Dataset(
        {
            "peak_opening": (("record", "scale", "sample", "joint"), peaks),
            "status": (("record", "scale", "sample"), np.zeros((1, len(values), 1))),
        },
        coords={"scale": ("scale", values, {"units": units}), "joint": ["J1"]},
    )
    table = tables.suite_table(summary)
    assert [column.header for column in table.columns][:2] == ["joint", heading]
    assert list(table.columns[1].cells) == shown and list(table.columns[3].cells) == ["2.00"] * len(values)


def test_every_column_of_numbers_has_a_unit_or_counts():
    """Of the tables of a check and of records: a bare number is a count."""
    from romdam.records.listing import HEADINGS, TARGET_HEADINGS

    counts = {"nodes", "cells", "free DOFs", "retained DOFs", "modes", "gaps", "steps", "discretization"}
    found = CheckedJob({}, {}, {}, 1, 1.0, 1.0, 1.0, (), (), {"t": {}}, (), ())
    heads = [str(column.header) for table in tables.check_tables(found) for column in table.columns]
    texts = {"block", "element", "joint", "between", "tie", "record", "component", "channel", "target"}
    heads += [*HEADINGS, *TARGET_HEADINGS]
    assert not [head for head in heads if head not in counts | texts | {"scale factor"} and head[-1] != "]"]


SENTENCE = {
    "estimate": "error_estimate",
    "certificate": "certificate_statement",
    "verification": "error_statement",
}


@pytest.mark.parametrize(
    ("kinds", "order", "error"),
    [
        ((), "reduced", "not measured against the mesh; `romdam verify"),
        (("estimate",), "reduced", "not measured against the mesh, estimated below; `romdam verify"),
        (("certificate", "estimate"), "reduced", "against the mesh, certified and estimated below;"),
        (("estimate", "verification"), "reduced", "it is verification"),
        ((), "full", "none of a reduction, this is the mesh itself"),
    ],
)
def test_every_statement_of_error_has_its_label(dataset_of, kinds, order, error):
    stated = {SENTENCE[kind]: f"it is {kind}" for kind in kinds}
    lines = lines_of(dataset_of(model_order=order, **stated))
    assert error in lines["error"]
    assert all(lines[kind] == f"it is {kind}" for kind in kinds if kind != "verification")


@pytest.mark.parametrize(
    ("contact", "numerical", "told"),
    [
        (163.0, None, "time stepping took 16 % of the energy put in"),
        (300.0, -279.0, "time stepping took 2.1 % of the energy put in"),
        (9.0, None, None),
    ],
)
def test_what_time_stepping_took_of_the_energy_is_told_above_one_percent(
    dataset_of, contact, numerical, told
):
    terms = {"input": 1000.0, "contact": contact} | ({} if numerical is None else {"numerical": numerical})
    energies = {f"energy_{name}": ("time", [0.0, value]) for name, value in terms.items()}
    line = lines_of(dataset_of().assign(energies))["not in `check`"]
    assert line.startswith("every step converged, residual at most 1e-11; energy ledger closed within 1e-13")
    assert line.endswith(told) if told else "took" not in line


def lines_of(dataset) -> dict[str, str]:
    """Label -> what stands beside it."""
    lines = info_lines(dataset)[1:]
    return {line[:14].strip(): line[15:] for line in lines}


@pytest.fixture
def dataset_of():
    """A result with nothing in it but what is told of every result, and further attributes."""

    def made(**attrs):
        told = {
            "title": "dam", "record": "r1", "record_dt": 0.01, "record_peak_acceleration": 1.0,
            "configuration_file": "dam.yaml", "configuration_sha256": "0" * 64, "model_order": "reduced",
            "solver_finest_step": 1e-3, "date_created": "2024-01-01", "source": "romdam",
            "solver_largest_residual": 1e-11, "solver_ledger_imbalance": 1e-13,
        }  # fmt: skip
        return xr.Dataset(attrs=told | attrs)

    return made


def test_errors_of_a_mesh_above_a_hundred_per_cent_have_no_exponent():
    """170 %, not 1.7e+02 %; columns stay in place."""
    error = {"acceleration": {"l2": 1.7, "peak": 0.69}, "opening": {"l2": 0.073, "peak": 0.0221}}
    lines = mesh_lines({"statement": "s", "error": error, "not_resolved": ["acceleration"]})
    assert lines[2].startswith("acceleration           170 %     69 %") and "not resolved" in lines[2]
    assert lines[3].startswith("opening                7.3 %    2.2 %")
