"""What a reader can hold: modules, functions and folders of the package stay small."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted([*(ROOT / "romdam").rglob("*.py"), *(ROOT / "pipelines").rglob("*.py")])
FOLDERS = sorted({path.parent for path in MODULES})


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_module_has_at_most_400_lines_and_its_functions_60(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 400
    functions = (
        n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)
    )
    assert not [f.name for f in functions if f.end_lineno - f.lineno + 1 > 60]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_folder_has_at_most_15_files(folder):
    assert len(list(folder.glob("*.py"))) <= 15
