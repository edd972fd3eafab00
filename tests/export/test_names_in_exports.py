"""Names that mean something to a table, a script or a spreadsheet reach it as names."""

import csv
import io

import pytest
from decks import boxes, built

from romdam.export.abaqus import write_abaqus
from romdam.export.calculix import write_calculix
from romdam.export.code_aster import write_code_aster
from romdam.export.opensees import write_opensees

JOINT = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}
WRITERS = {
    "opensees": write_opensees,
    "calculix": write_calculix,
    "abaqus": write_abaqus,
    "code_aster": write_code_aster,
}


def deck(joint="j,1,2", probe="top, 'left'"):
    nodes = {probe: {"block": "left", "at": [0, 0, 20]}}
    return built(boxes(joints={joint: JOINT}, outputs={"nodes": nodes}))[1]


def test_a_joint_with_commas_has_its_nodes_and_its_stiffness():
    """A gap of joint `j,1,2` once joined nodes 1 and 2 without any stiffness."""
    named, plain = (write_opensees(deck(name))[0]["gaps.csv"] for name in ("j,1,2", "gap"))
    rows, expected = (list(csv.DictReader(io.StringIO(text))) for text in (named, plain))
    assert {row["joint"] for row in rows} == {"j,1,2"}
    assert [{k: v for k, v in row.items() if k != "joint"} for row in rows] == [
        {k: v for k, v in row.items() if k != "joint"} for row in expected
    ]
    assert all(float(row["K_n"]) > 0.0 for row in rows)


@pytest.mark.parametrize("code", WRITERS)
def test_the_head_of_openings_has_a_column_for_each_number(code):
    made = deck()
    files = WRITERS[code](made)[0]
    text = next(text for name, text in files.items() if "HEAD = " in text)
    compile(text, "script", "exec")
    line = next(line for line in text.splitlines() if line.startswith("HEAD = "))
    head = next(csv.reader(io.StringIO(eval(line.removeprefix("HEAD = ")))))
    assert head == [
        "time",
        *(f"opening:{k}" for k in range(len(made.gaps))),
        *(f"displacement:top, 'left':{axis}" for axis in "xyz"),
    ]
    assert "file.write(HEAD)" in text
