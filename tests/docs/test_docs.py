"""Every code block of the manual and of README.md runs, in the order in which it stands on its page.

A `python` block is executed, one namespace a page; the lines after `$` of a `console` block are run; a `yaml`
block is loaded as a job, a part of one within configs/two_cantilevers.yaml; a block that begins with
`# configs/NAME` is that file. A `text` block is only read. `<!-- slow: why -->` makes a page slow: CI runs it
after the others; `<!-- needs: A, B -->` names modules without which it is skipped.
"""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest
import yaml
from test_cli import call

from romdam.config import load_config, parse_config
from romdam.config.effects import EFFECTS
from romdam.geometry.elements import ELEMENTS
from romdam.records.formats.registry import FORMATS
from romdam.results.variables import COORDINATES, VARIABLES
from romdam.scene.attachments import BUILDERS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if not {"_build", "generated"} & set(page.parts)]
FENCE = re.compile(r"^(`{3,})\{?([\w-]*)\}?.*?\n(.*?)^\1\s*$", re.M | re.S)
FENCES = {
    "python",
    "console",
    "yaml",
    "text",
    "csv",
    "include",
    "math",
    "toctree",
    "eval-rst",
    "literalinclude",
    "image",
    "figure",
    "index",  # words by which the search finds the page
    "code-cell",  # of a notebook, which test_tutorials.py runs
}
BASE = ROOT / "configs" / "two_cantilevers.yaml"


def _blocks(page):
    """(language, text, line number) of every fenced block of a page."""
    text = page.read_text()
    return [(m[2], m[3], text[: m.start()].count("\n") + 2) for m in FENCE.finditer(text)]


def _is_slow(page):
    return "<!-- slow:" in page.read_text()


def _needs(page):
    """Modules of further packages that a page uses."""
    found = re.search(r"<!-- needs: (.*?) -->", page.read_text())
    return found[1].split(", ") if found else []


def _named(pages):
    return [
        pytest.param(page, id=str(page.relative_to(ROOT)), marks=[pytest.mark.slow] if _is_slow(page) else [])
        for page in pages
    ]


@pytest.mark.parametrize("page", [pytest.param(page, id=str(page.relative_to(ROOT))) for page in PAGES])
def test_every_block_says_what_it_is(page):
    unknown = [f"line {line}: {language!r}" for language, _, line in _blocks(page) if language not in FENCES]
    assert not unknown, f"{page}: {unknown}; say one of {sorted(FENCES)}"


@pytest.fixture(autouse=True)
def registries():
    """What examples add is taken out again."""
    shared = (ELEMENTS, FORMATS, VARIABLES, COORDINATES, EFFECTS, BUILDERS)
    before = [dict(registry) for registry in shared]
    yield
    for registry, entries in zip(shared, before, strict=True):
        registry.clear()
        registry.update(entries)


RUN = [page for page in PAGES if any(kind in ("python", "console", "yaml") for kind, _, _ in _blocks(page))]


@pytest.mark.parametrize("page", _named(RUN))
def test_every_block_runs(page, tmp_path, monkeypatch):
    for module in _needs(page):
        pytest.importorskip(module, reason=f"{page.name} needs {module}")
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    shutil.copytree(ROOT / "data" / "records", tmp_path / "data" / "records")
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")
    names = {"__name__": page.stem}
    for language, text, line in _blocks(page):
        file = Path(text.partition("\n")[0].removeprefix("# ")) if text.startswith("# configs/") else None
        if file is not None:
            file.write_text(text)
        if language == "python" and file is None:
            code = compile("\n" * (line - 1) + text, str(page), "exec")
            exec(code, names)
        elif language == "console":
            _run_console(text, f"{page}: line {line}")
        elif language == "yaml":
            _load(text, line, file)


def _run_console(text, place):
    for line in text.splitlines():
        if line.startswith("$ "):
            words = shlex.split(line[2:], comments=True)
            assert words[0] in ("romdam", "python", "cat", "ls"), f"{place}: {line}"
            if words[0] == "romdam":
                code, out, err = call(*words[1:])
            else:
                command = [sys.executable if words[0] == "python" else words[0], *words[1:]]
                done = subprocess.run(command, capture_output=True, text=True)
                code, out, err = done.returncode, done.stdout, done.stderr
            assert code == 0, f"{place}: {line}\n{out}\n{err}"


def _load(text, line, file):
    if file is not None:
        load_config(file)
        return
    given = yaml.safe_load(text)
    whole = (
        given if {"materials", "records", "model"} <= set(given) else yaml.safe_load(BASE.read_text()) | given
    )
    parse_config(whole, f"line {line}")
