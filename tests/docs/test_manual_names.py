"""What the manual names is there: files, benchmarks, commands, and members of classes of the code."""

import ast
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [page for page in PAGES if not {"_build", "generated"} & set(page.parts)]
PAGES += [ROOT / name for name in ("ARCHITECTURE.md", "CONTRIBUTING.md", "README.md")]
OF_USERS = {"dam.yaml", "entry.yaml", "my_laws.py"}  # files that a reader writes
IN_TICKS = re.compile(r"`([^`\n]+)`")
FILE = re.compile(r"[\w/.-]+\.(?:py|md|yaml|npz|toml)")
MEMBER = re.compile(r"([A-Z]\w+)\.(\w+)")
REGISTRY = re.compile(r"((?:[a-z_]+\.)+)(_?[A-Z][A-Z_]+)")  # `contact.laws.LAWS`


def _files():
    """Paths of the files of the repository, or of the folder where there is none (a source distribution)."""
    try:
        done = subprocess.run(
            ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        )  # fmt: skip
        paths = done.stdout.split()
    except (OSError, subprocess.CalledProcessError):
        paths = []
    return paths or [str(path.relative_to(ROOT)) for path in ROOT.rglob("*") if path.is_file()]


FILES = [path for path in _files() if (ROOT / path).is_file()]
NAMES = {f"/{path}" for path in FILES}


def _is_there(name):
    return any(path.endswith(f"/{name}") for path in NAMES)


@cache
def _members():
    """Class -> names that it, or what it is derived from, declares or sets; of all classes of that name."""
    own, bases = {}, {}
    for path in FILES:
        if path.startswith(("romdam/", "pipelines/")) and path.endswith(".py"):
            tree = ast.parse((ROOT / path).read_text())
            for node in (one for one in ast.walk(tree) if isinstance(one, ast.ClassDef)):
                own.setdefault(node.name, set()).update(_declared(node))
                bases.setdefault(node.name, set()).update(
                    re.findall(r"\w+", " ".join(map(ast.unparse, node.bases)))
                )
    for _ in range(4):  # bases of bases
        for name, names in bases.items():
            own[name] = own[name].union(*(own.get(one, set()) for one in names))
    return own


def _declared(node):
    for one in ast.walk(node):
        if isinstance(one, ast.AnnAssign | ast.Assign):
            targets = one.targets if isinstance(one, ast.Assign) else [one.target]
            yield from (getattr(target, "id", getattr(target, "attr", "")) for target in targets)
        elif isinstance(one, ast.FunctionDef):
            yield one.name


def _ticked(page):
    """(line, text) of everything in backticks."""
    for number, line in enumerate(page.read_text().splitlines(), 1):
        for match in IN_TICKS.finditer(line):
            yield number, match[1]


@pytest.mark.parametrize("page", [pytest.param(page, id=str(page.relative_to(ROOT))) for page in PAGES])
def test_every_file_that_a_page_names_is_there(page):
    named = [(line, text) for line, text in _ticked(page) if FILE.fullmatch(text) and text not in OF_USERS]
    for number, line in enumerate(page.read_text().splitlines(), 1):
        named += [(number, name) for name in re.findall(r"python (tests/[\w/]+\.py)", line)]
        named += [(number, name) for name in re.findall(r"\bbench_\w+\.py", line)]
    gone = sorted({f"line {line}: {name}" for line, name in named if not _is_there(name)})
    assert not gone, f"{page.name}: {gone}"


@pytest.mark.parametrize("page", [pytest.param(page, id=str(page.relative_to(ROOT))) for page in PAGES])
def test_every_member_of_a_class_that_a_page_names_is_there(page):
    members, gone, last = _members(), [], ""
    for line, text in _ticked(page):
        if (short := re.fullmatch(r"\.(\w+)", text)) and last:
            text = f"{last}.{short[1]}"  # `System.M`, `.C`
        if member := MEMBER.fullmatch(text):
            last, name = member.groups()
            if last in members and name not in members[last]:
                gone.append(f"line {line}: {text}")
    assert not gone, f"{page.name}: {gone}"


@pytest.mark.parametrize("page", [pytest.param(page, id=str(page.relative_to(ROOT))) for page in PAGES])
def test_every_registry_that_a_page_names_is_there(page):
    named = [(line, match) for line, text in _ticked(page) if (match := REGISTRY.fullmatch(text))]
    gone = [f"line {line}: {match[0]}" for line, match in named if not _has(match[1], match[2])]
    assert not gone, f"{page.name}: {gone}"


def _has(module, name):
    """Tell whether a module of the package, `romdam.` left out or not, has the name."""
    stem = module.removeprefix("romdam.").strip(".").replace(".", "/")
    paths = [ROOT / "romdam" / end for end in (f"{stem}.py", f"{stem}/__init__.py")]
    return any(re.search(rf"\b{name}\b", path.read_text()) for path in paths if path.is_file())
