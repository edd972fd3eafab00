"""Constants: each says in the code what it is, and the manual has today's values of those that count."""

import ast
import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
UNNAMED = {  # numbers below LEAST_NAMED in the midst of code; more of them get a name
    ("conserving.py", 1e-9), ("conserving.py", 1e-10), ("step_control.py", 1e-9), ("steps.py", 1e-6),
    ("steps.py", 1e-9),
}  # fmt: skip
LEAST_NAMED, NO_NUMBER = (
    0.02,
    1e-290,
)  # between them lie tolerances; what is smaller only keeps from dividing by zero
ENTRY = re.compile(r"^`(?P<file>[\w/.]+\.py)`$|^- `(?P<name>_?[A-Z]\w*)` (?P<value>[^:]+)", re.M)


@pytest.fixture(scope="module")
def tables():
    """The module that makes the manual's tables."""
    spec = importlib.util.spec_from_file_location("tables", ROOT / "docs" / "tables.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def in_manual():
    """(file, name) -> numbers of the page: a line of a file, entries "- `name` value: meaning"."""
    text = (ROOT / "docs" / "extending" / "constants.md").read_text()
    constants, file = {}, ""
    for entry in ENTRY.finditer(text):
        if entry["file"]:
            file = entry["file"]
        else:
            key = (file, entry["name"])
            assert key not in constants, f"{key} stands twice in docs/extending/constants.md"
            numbers = re.findall(r"-?\d[\d.]*(?:e[+-]?\d+)?", entry["value"])
            constants[key] = tuple(float(word) for word in numbers)
    return constants


def test_every_constant_says_in_the_code_what_it_is(tables):
    code = tables.constants_of_code()
    assert len(code) > 200
    silent = [f"{file}: {name}" for (file, name), one in code.items() if not one.meaning]
    assert not silent, f"write a comment behind them: {silent}"
    assert "- `FLOOR` 0.01: of what all joints do" in tables.constants()


def test_the_manual_has_the_values_of_the_code(tables):
    code, manual = tables.constants_of_code(), in_manual()
    assert len(manual) >= 4
    gone = sorted(manual.keys() - code.keys())
    assert not gone, f"remove from docs/extending/constants.md: {gone}"
    other = {key: (value, code[key].numbers) for key, value in manual.items() if not _alike(value, code[key])}
    assert not other, f"docs/extending/constants.md has other values than the code: {other}"


def _alike(value, constant):
    return np.allclose(value, constant.numbers, 1e-4, 0)


def test_no_number_that_decides_something_is_without_a_name(tables):
    """Round-off, tolerances and shares are module constants, so that the manual's list holds them."""
    unnamed = {
        (path.name, number): f"{path.relative_to(ROOT)}:{line}: {number:g}"
        for room in tables.ROOMS[:4]
        for path in sorted((ROOT / "romdam" / room).rglob("*.py"))
        for line, number in _unnamed(ast.parse(path.read_text()))
    }
    new = [place for key, place in unnamed.items() if key not in UNNAMED]
    assert not new, f"make them constants of the module: {new}"


def _unnamed(tree):
    """(line, number) of small numbers outside of constants of the module and defaults of settings."""
    kinds = (ast.Assign, ast.AnnAssign)
    named = {id(one) for node in tree.body if isinstance(node, kinds) for one in ast.walk(node)}
    for node in (one for one in ast.walk(tree) if isinstance(one, ast.ClassDef)):
        named |= {id(one) for field in node.body if isinstance(field, kinds) for one in ast.walk(field)}
    floats = (one for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, float))
    for one in floats:
        if id(one) not in named and NO_NUMBER < abs(one.value) <= LEAST_NAMED:
            yield one.lineno, one.value
