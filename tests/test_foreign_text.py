"""Texts of foreign files and odd names: no terminal, table or spreadsheet obeys them; masks are refused."""

import csv
import logging

import numpy as np
import pytest
import xarray as xr
from test_cli import call, config  # noqa: F401

import romdam
from romdam.core.errors import RecordError
from romdam.core.html.card import card
from romdam.core.printable import one_line, plain_cell, printable
from romdam.results.table import write_csv
from romdam.visual.report.page import page
from romdam.visual.report.parts import Report

EVIL = "\x1b]0;owned\x07\x1b[2Jdam\x9b31m\u202etxt\nerror          0 %"
OBEYED = set("\x1b\x07\x9b\u202e\r\u2028")


def test_controls_are_written_out():
    assert printable(EVIL) == "\\x1b]0;owned\\x07\\x1b[2Jdam\\x9b31m\\u202etxt\nerror          0 %"
    assert one_line("a\nb\tc") == "a\\nb c"
    assert printable("Stra\xdfe \xa0 \u03bc = 0.7 \u6c34") == "Stra\xdfe \xa0 \u03bc = 0.7 \u6c34"


def test_info_prints_no_escape_of_a_foreign_file(config, tmp_path):  # noqa: F811
    romdam.run(config, tmp_path / "o")
    path = tmp_path / "foreign.nc"
    with xr.open_dataset(tmp_path / "o" / "pulse.nc") as dataset:
        foreign = dataset.load()
    foreign.attrs |= {"title": EVIL, "record": EVIL, "source": f"romdam {EVIL}", "configuration_file": EVIL}
    foreign.attrs["run_warnings"] = '["a \\u001b[31m warning"]'
    name = "[red]j\x1b[1A"
    foreign = foreign.assign_coords(joint=[name], gap_joint=("gap", [name] * foreign.sizes["gap"]))
    foreign.to_netcdf(path, engine="h5netcdf")
    for options in ((), ("--json",)):
        code, out, err = call("info", path, *options)
        assert code == 0, err
        assert not OBEYED & set(out + err)
        assert "[red]j" in out
        assert not [line for line in out.splitlines() if line.startswith("error          0 %")]


def test_errors_and_logs_write_controls_out(tmp_path):
    (tmp_path / "bad.yaml").write_text('title: x\n"\\e[2Jkey": 1\n')
    code, _, err = call("check", tmp_path / "bad.yaml")
    assert code == 2 and not OBEYED & set(err) and "\\x1b" in err
    from romdam.terminal.run_log import _Line

    record = logging.LogRecord("romdam", logging.WARNING, "", 0, EVIL, (), None)
    assert not OBEYED & set(_Line().format(record))


def test_pages_and_cards_write_controls_out():
    for text in (page(Report(EVIL, EVIL, (), ())), card(EVIL, EVIL, {EVIL: EVIL})):
        assert "owned" in text and not OBEYED & set(text)


@pytest.mark.parametrize("name", ["=cmd()", "+j", "@SUM(A1)", "-x", "=1+1\n"])
def test_no_cell_is_a_formula(name, tmp_path):
    with write_csv(
        [name, "v"], [(name, -1.5), (name, "-1.5"), ("-", "+2e3")], tmp_path / "t.csv"
    ).open() as file:
        rows = list(csv.reader(file))
    assert all(row[0] == "'" + one_line(name) for row in rows[:3])
    assert [row[1] for row in rows] == ["v", "-1.5", "-1.5", "+2e3"] and rows[3][0] == "-"
    assert plain_cell(3) == 3


@pytest.mark.parametrize("form", ["array", "components", "list"])
def test_masks_of_arrays_are_refused(form):
    acc = np.ma.array(np.ones((3, 10)), mask=False)
    acc[1, 4:6] = np.ma.masked
    given = {"array": acc, "components": {"y": acc[1]}, "list": list(acc)}[form]
    with pytest.raises(RecordError, match=r"2 of \d+ samples are masked, limit 0"):
        romdam.GroundMotion.from_arrays("m", given, 0.01)
    whole = romdam.GroundMotion.from_arrays("m", np.ma.array(np.ones((3, 10)), mask=False), 0.01)
    assert not isinstance(whole.acc, np.ma.MaskedArray)


def test_a_motion_with_a_mask_is_refused_by_run(config, tmp_path):  # noqa: F811
    acc = np.ma.array(np.ones((3, 10)), mask=False)
    acc[0, 3] = np.ma.masked
    with pytest.raises(RecordError, match="1 of 30 samples are masked"):
        romdam.run(config, motions=romdam.GroundMotion("m", acc, 0.01))
