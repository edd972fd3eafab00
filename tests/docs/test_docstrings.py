"""Docstrings open with an imperative or a noun, not with a question word."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted([*(ROOT / "romdam").rglob("*.py"), *(ROOT / "pipelines").rglob("*.py")])
QUESTIONS = {"What", "Where", "Whether", "How", "Which", "When", "Who", "Why"}
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_docstring_opens_with_no_question_word(path):
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, DOCUMENTED)]
    texts = [ast.get_docstring(node) or "" for node in nodes]
    asking = [
        text.partition("\n")[0]
        for text in texts
        if text.split(maxsplit=1)[:1] and text.split()[0] in QUESTIONS
    ]
    assert not asking
