"""No array of the contact solvers and the time loop has entries that mean different things by a bare number.

A number in a subscript says nothing of what it picks: `clock[2]` was a level, `counts[1, 1]` a sum. Fields of
records and NamedTuples have names; where an index must stay (the components of a gap, the coefficients of a
quadratic form, the rows of a scratch array) it is a constant with one.

Exempt are
- `x[0]` and `x[-1]`, the first and the last of things alike, unless another number on the same name shows
  that these are not alike;
- `shape[...]` and the items of what a call returns, whose order is numpy's;
- `_dot_rows`, which takes four rows that are alike at a time.
"""

import ast
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from romdam.core.arrays import Floats, Record, at, put, record, record_type, rows_like, stacked
from romdam.core.jit import VIEWS, njit

ROOT = Path(__file__).parents[1] / "romdam"
MODULES = [path for room in ("contact", "timestepping") for path in sorted((ROOT / room).rglob("*.py"))]
UNROLLED = {"_dot_rows"}


def _number(node):
    """The integer of an index, or None."""
    sign = -1 if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) else 1
    node = node.operand if isinstance(node, ast.UnaryOp) else node
    value = node.value if isinstance(node, ast.Constant) else None
    return sign * value if type(value) is int else None


def _exempt(array):
    is_shape = isinstance(array, ast.Attribute) and array.attr == "shape"
    return is_shape or isinstance(array, ast.Call)


def bare_numbers(source):
    """(line, expression) of every subscript that picks by a bare number."""
    whole, ends = [], defaultdict(list)
    tree = ast.parse(source)
    unrolled = {
        id(node) for f in ast.walk(tree) if getattr(f, "name", "") in UNROLLED for node in ast.walk(f)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.Subscript) or _exempt(node.value) or id(node) in unrolled:
            continue
        told = node.lineno, ast.unparse(node)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        numbers = [number for number in map(_number, indices) if number is not None]
        if len(indices) == 1 and numbers in ([0], [-1]):
            ends[ast.unparse(node.value)].append(told)
        elif numbers:
            whole.append(told)
            ends[ast.unparse(node.value)].append(None)
    unlike = [told for uses in ends.values() if None in uses for told in uses if told is not None]
    return sorted(whole + unlike)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_entry_is_picked_by_a_bare_number(path):
    found = bare_numbers(path.read_text())
    assert not found, "\n".join(f"{path.name}:{line}: {expression}" for line, expression in found)


@pytest.mark.parametrize(
    "line",
    [
        "total += memory.counts[1, 1]",
        "clock[2] -= 1",
        "held = memory.order[1]",
        "block = memory.inverse[0].view(np.float32); pivot = memory.inverse[1].view(np.float32)",
        "state.works[3] += friction",
        "peaks[0, i] = jump[i, 0]",
        "tolerance, steady = control[0], control[1]",
        "opening = history.jump[:, :, 0]",
        "last = rows[:, -1]",
    ],
)
def test_what_was_coded_by_index_would_be_found(line):
    assert bare_numbers(line)


@pytest.mark.parametrize(
    "line",
    [
        "first, last = systems[0], order[-1]",
        "d = force.shape[1]",
        "groups = np.unique(gaps, return_inverse=True)[1]",
        "level = runs.clock[run].level",
        "t_j = force[i, SHEAR_J]",
        "row = W[3 * i + NORMAL]",
        "for value in values[1:]: pass",
    ],
)
def test_names_and_first_and_last_of_things_alike_pass(line):
    assert not bare_numbers(line)


def test_every_room_is_looked_at():
    assert {"gauss_seidel.py", "loop.py", "step.py", "generalized_alpha.py"} <= {
        path.name for path in MODULES
    }


COUNTS = record_type(steps=int, largest=float, known=bool)


class _Inner(NamedTuple):
    values: Floats
    counts: Record


class _Outer(NamedTuple):
    values: Floats
    scale: Floats
    inner: _Inner
    absent: None


def _one(n):
    return _Outer(np.arange(float(n)), 2.0, _Inner(np.zeros(n), record(COUNTS)), None)


def _change(many, first, second):
    one = at(many, (first, second))
    one.values[0] = one.scale
    one.inner.values[1] += 1.0
    one.inner.counts.steps += 1
    one.inner.counts.largest = max(one.inner.counts.largest, 0.5)
    one.inner.counts.known = True
    return one.inner.counts.steps


@pytest.mark.parametrize(
    "change", [_change, njit(**VIEWS | {"cache": False})(_change)], ids=["plain", "compiled"]
)
def test_a_view_of_one_of_many_has_every_field_and_is_written_through(change):
    """Compiled code must not take what is written to a view for dead."""
    many = stacked([stacked([_one(3) for _ in range(4)]) for _ in range(2)])
    assert many.inner.counts.shape == (2, 4) and many.scale.shape == (2, 4) and many.absent is None
    assert change(many, 1, 2) == 1
    assert change(many, 1, 2) == 2
    one = at(many, (1, 2))
    assert list(one.values) == [2.0, 1.0, 2.0] and list(one.inner.values) == [0.0, 2.0, 0.0]
    assert (one.inner.counts.steps, one.inner.counts.largest, one.inner.counts.known) == (2, 0.5, True)
    assert many.inner.counts["steps"].sum() == 2 and many.inner.values.sum() == 2.0


class _Row(NamedTuple):
    table: Floats
    flags: Floats
    inner: _Inner


def _write(rows, number, state):
    put(rows, number, state)
    state.table[:] = -1.0


@pytest.mark.parametrize(
    "write", [_write, njit(**VIEWS | {"cache": False})(_write)], ids=["plain", "compiled"]
)
def test_a_row_takes_a_copy_of_every_field_and_no_other_row_changes(write):
    table = np.arange(6.0).reshape(3, 2)
    states = stacked(
        [
            _Row(k + table, np.array([k, 1], np.uint8), _Inner(np.full(4, 0.5 * k), record(COUNTS)))
            for k in range(3)
        ]
    )
    states.inner.counts["steps"] = [5, 6, 7]
    rows = rows_like(at(states, 0), 4)
    assert rows.table.shape == (4, 3, 2) and rows.flags.dtype == np.uint8
    assert rows.inner.counts.shape == (4,) and rows.inner.counts.dtype == COUNTS
    write(rows, 2, at(states, 1))
    assert np.array_equal(rows.table[2], 1.0 + table), "a copy, not a view"
    assert list(rows.flags[2]) == [1, 1] and (rows.inner.values[2] == 0.5).all()
    assert rows.inner.counts[2].steps == 6
    others = [0, 1, 3]
    assert (
        not rows.table[others].any() and not rows.flags[others].any() and not rows.inner.values[others].any()
    )
    assert (states.table[1] == -1.0).all() and (states.table[[0, 2]] >= 0.0).all()
    put(rows, np.array([0, 3]), at(states, slice(0, 3, 2)))
    assert list(rows.inner.counts["steps"]) == [5, 0, 6, 7]
