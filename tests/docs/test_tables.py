"""The reference pages hold everything that the code has, with unit and meaning."""

import importlib.util
import re
from pathlib import Path
from string import ascii_lowercase

import pytest

from romdam.config.effects import EFFECTS, EXCLUDED
from romdam.results.suite.rows import ROWS
from romdam.results.variables import COORDINATES, VARIABLES

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def tables():
    spec = importlib.util.spec_from_file_location("tables", DOCS / "tables.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_key_of_the_schema_has_a_row_with_its_meaning(tables):
    rows = [line.split(" | ") for line in tables.configuration().splitlines() if line.startswith("| `")]
    assert len(rows) == sum(len(mapping["properties"]) for mapping, _ in tables.mappings()) > 350
    for _, kind, default, told in rows:
        assert kind and default and re.search(r"[A-Za-z|]{2}", told), told


def test_every_section_stands_on_the_page_of_one_subject(tables):
    pages = [tables.configuration(subject) for subject in tables.SUBJECTS]
    headings = [line for page in pages for line in page.splitlines() if line.startswith("## ")]
    whole = [line for line in tables.configuration().splitlines() if line.startswith("## ")]
    assert sorted(headings) == sorted(whole) and all(pages)


def test_units_and_limits_come_from_the_schema(tables):
    text = tables.configuration()
    assert "| `rho` | number [kg/m3] | **required** | above 0; Density of the material. |" in text
    what = "Damping ratio, of critical damping, at the two frequencies."
    assert f"| `ratio` | number | none | at least 0, below 1; {what} |" in text
    assert "| `plots` | true or false | `true` |" in text


@pytest.mark.parametrize("registry", [COORDINATES, VARIABLES, ROWS])
def test_every_variable_has_a_row_with_unit_and_meaning(tables, registry):
    text = tables.variables(registry)
    for name, variable in registry.items():
        assert variable.long_name and f"| `{name}` | " in text
        assert f"| {variable.units or 'text'} | {variable.long_name} |" in text


def test_the_pages_are_in_the_contents():
    pages = {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")}
    pages = {page for page in pages if not page.startswith(("_build", "generated"))}
    for contents in ("index.md", "configuration.md", "extending/index.md", "tutorials/index.md"):
        words = (DOCS / contents).read_text().split()
        folder = contents.rpartition("/")[0] + "/" * ("/" in contents)
        pages -= {f"{folder}{word}.md" for word in words} | {contents}
    assert not pages, f"in no table of contents: {sorted(pages)}"


def test_every_pair_of_effects_has_a_cell_and_every_refusal_its_reason(tables):
    rows = [line.split(" | ") for line in tables.effects().splitlines() if line.startswith("| ")][1:]
    marks = [[cell.strip(" |") for cell in row[2:]] for row in rows]
    assert len(marks) == len(EFFECTS) and all(len(row) == len(EFFECTS) for row in marks)
    letters = [mark for row in marks for mark in row if mark not in ("", "yes")]
    assert len(letters) == 2 * len(EXCLUDED) and marks == [
        list(column) for column in zip(*marks, strict=True)
    ]
    for letter, reason in zip(ascii_lowercase, dict.fromkeys(EXCLUDED.values()), strict=False):
        assert f"- {letter}: {reason}" in tables.effects() and letter in letters
