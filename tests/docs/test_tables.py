"""The reference pages hold everything that the code has, with unit and meaning."""

import importlib.util
from pathlib import Path

import pytest

from romdam.results.suite.rows import ROWS
from romdam.results.variables import COORDINATES, VARIABLES

DOCS = Path(__file__).parents[2] / "docs"
BY_NAME = {  # keys whose name and type say what they are
    "element", "normal", "tolerance", "between", "depth", "directions", "per_gap", "table", "mu_s", "mu_d",
    "v_c", "name", "sha256", "file", "values", "initial_state",
    "cutoff", "finest_step", "reference", "output_interval", "dt",
}  # fmt: skip


@pytest.fixture(scope="module")
def tables():
    spec = importlib.util.spec_from_file_location("tables", DOCS / "tables.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_key_has_a_row_with_its_meaning(tables):
    text = tables.configuration()
    for model in tables.models():
        assert all(f"| `{name}` |" in text for name in model.model_fields)
    assert not {key for key in tables.unexplained() if key.rpartition(".")[2] not in BY_NAME}


def test_units_and_limits_come_from_the_models(tables):
    text = tables.configuration()
    assert "| `rho` | number [kg/m3] | **required** | above 0; Density. |" in text
    assert "| `ratio` | number | none | at least 0, below 1; Of critical damping. |" in text
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
    for contents in ("index.md", "extending/index.md"):
        words = (DOCS / contents).read_text().split()
        folder = contents.removesuffix("index.md")
        pages -= {f"{folder}{word}.md" for word in words} | {contents}
    assert not pages, f"in no table of contents: {sorted(pages)}"
