"""One reader of tables: what a spreadsheet leaves is read, and what shifts or hides a number is refused."""

from pathlib import Path

import numpy as np
import pytest

from romdam.config.parameters import VariedKey
from romdam.config.sections.motions.records import manifest_rows
from romdam.contact.laws.coulomb import Coulomb
from romdam.core.csv_table import plain_number, read_table
from romdam.core.errors import RomdamError
from romdam.error.histories import read_histories
from romdam.geometry.matrices.text import read_nodes
from romdam.records.design.target import _read_table as read_spectrum
from romdam.results.modes import read_measured
from romdam.results.suite.design import _table as read_design
from romdam.results.suite.hazard_table import read_hazard
from romdam.scene.gap_table import table_gap

ORIGIN = np.zeros((1, 3))
FRICTION = VariedKey(
    "joints.a.friction", (("joints", "a", "friction"),), ("a",), ("friction",), "1", Coulomb.parameters[0]
)
# every kind of table: its names, its rows, and its reader
KINDS = {
    "gaps": ("x,y,z,gap", ["0,0,0,0.001", "1.5,0,0,0.002"], lambda p: table_gap(p, ORIGIN, "s: gap")),
    "histories": ("time,opening:0", ["0,0.001", "0.5,0.002"], read_histories),
    "hazard": (
        "intensity [g],annual frequency",
        ["0.1,0.01", "0.2,0.001", "0.3,0.0001"],
        lambda p: read_hazard(p, "m/s^2"),
    ),
    "spectrum": ("period,sa", ["0.1,0.25", "0.2,0.5"], lambda p: read_spectrum(p, 1.0)),
    "modes": ("frequency,name", ["4.25,first", "6.5,second"], lambda p: read_measured(p, 5)),
    "nodes": ("node,x,y,z", ["1,0,0,0.5", "2,0,0,1.5"], lambda p: read_nodes(p, "s: nodes")),
    "manifest": ("file,scale", ["a.txt,1.5", "b.txt,2.5"], manifest_rows),
    "design": ("mu", ["0.25", "0.5"], lambda p: read_design(p, {"mu": FRICTION})),
}


def written(folder: Path, *lines: str, coding: str = "utf-8") -> Path:
    path = folder / "table.csv"
    path.write_bytes("\n".join(lines).encode(coding))
    return path


def plain(value: object) -> str:
    return repr([*vars(value).items()] if hasattr(value, "__dict__") else value)


@pytest.mark.parametrize("kind", KINDS)
def test_what_spreadsheets_leave_is_read(kind, tmp_path):
    head, rows, read = KINDS[kind]
    right = plain(read(written(tmp_path, head, *rows)))
    for lines, coding in (
        ([head, *rows], "utf-8-sig"),
        ([f"{line},," for line in (head, *rows)], "utf-8"),
        ([head, *(f"{row},," for row in rows)], "utf-8"),
        (["# measured, by hand", "", head, "", rows[0], "  # and", *rows[1:], ",,"], "utf-8"),
        ([f"{line}\r" for line in (head, *rows)], "utf-8"),
        ([line.replace(",", " , ") for line in (head, *rows)], "utf-8"),
    ):
        assert plain(read(written(tmp_path, *lines, coding=coding))) == right, lines


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_other_widths_and_names_that_repeat_are_refused(kind, tmp_path):
    head, rows, read = KINDS[kind]
    more = rows[1].replace(".", ",", 1)
    with pytest.raises(
        RomdamError, match=r"table\.csv: line 4: (has \d values for \d columns.*decimal|expected)"
    ):
        read(written(tmp_path, "# first", head, rows[0], more))
    if kind != "spectrum":  # which is read by its order, whatever its heading says
        last = head.rpartition(",")[2]
        with pytest.raises(RomdamError, match=r"table\.csv: line 1: 2 columns are .*, limit 1"):
            read(written(tmp_path, f"{head},{last}", *(f"{row},1" for row in rows)))
        with pytest.raises(RomdamError, match=r"line 1: a column has no name"):
            read(written(tmp_path, f",{head}", *(f",{row}" for row in rows)))
    if "," in head:
        with pytest.raises(RomdamError, match=r"table\.csv: line 3: (has \d values for \d columns|expected)"):
            read(written(tmp_path, head, rows[0], rows[1].rpartition(",")[0]))


NUMBERS = {
    "gaps": 3, "histories": 1, "hazard": 1, "spectrum": 1, "modes": 0, "nodes": 3, "design": 0,
}  # fmt: skip


TEXTS = ["1_000", "nan", "inf", "1e999", "0x10", "١", "1 000", "--1", "1e"]
WITHOUT_PLACE = ("nodes", "nan")  # is read: a node of matrices may have no place


@pytest.mark.parametrize(
    ("kind", "text"), [(k, t) for k in NUMBERS for t in TEXTS if (k, t) != WITHOUT_PLACE]
)
def test_numbers_are_plain(kind, text, tmp_path):
    head, rows, read = KINDS[kind]
    cells = rows[1].split(",")
    cells[NUMBERS[kind]] = text
    with pytest.raises(RomdamError, match=r"table\.csv: line 3"):
        read(written(tmp_path, head, rows[0], ",".join(cells)))


@pytest.mark.parametrize(
    ("text", "number"), [("1", 1.0), ("-1.5e3", -1500.0), (".5", 0.5), ("5.", 5.0), ("+2E-1", 0.2)]
)
def test_plain_numbers(text, number):
    assert plain_number(text) == number


def test_a_quote_in_a_comment_opens_no_cell(tmp_path):
    table = read_table(written(tmp_path, '# 5" gauge, "left', "a,b", "1,2"))
    assert table.rows == [["1", "2"]] and table.lines == [3] and table.at(0).endswith("table.csv: line 3")


def test_semicolons_are_named(tmp_path):
    with pytest.raises(RomdamError, match=r"line 2: has 2 values for 1 columns.*Separate columns by commas"):
        table_gap(written(tmp_path, "x;y;z;gap", "0;0;0;0,5"), ORIGIN, "s: gap")
