"""Keys of what is kept follow the imports of what computes it: a line in any of these modules is seen."""

import ast
import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

import romdam
from romdam.contact.cone import slides
from romdam.contact.laws import outside
from romdam.core import fingerprint
from romdam.core.fingerprint import code_digest, imported_modules
from romdam.core.kept_code import _code_of
from romdam.reduction import stress
from romdam.reduction.storage.keys import CODE
from romdam.reduction.synthesis import REDUCTORS

KERNELS = [name for name, text in fingerprint._CODE.items() if b"from romdam.core.jit import" in text]
# what is kept -> the modules whose imports are in its key
KEPT = {"blocks": (CODE,), "stress": stress._CODE}
# modules that cannot change what is kept
ELSEWHERE = [
    "romdam.visual.plots", "romdam.visual.report.one_run", "romdam.commands.views", "romdam.results.dataset",
    "romdam.pipelines.run", "romdam.postprocess.fragility", "romdam.records.spectra",
    "romdam.export.opensees",
]  # fmt: skip


def imports_of_tree(name: str) -> set[str]:
    """What a module imports, by its syntax tree."""
    names = set()
    for node in ast.walk(ast.parse(fingerprint._CODE[name])):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names & fingerprint._CODE.keys()


def test_statements_are_read_as_python_reads_them():
    for name in fingerprint._CODE:
        read = set(fingerprint._imports(name)) & fingerprint._CODE.keys()
        assert read >= imports_of_tree(name), name


def reached(modules) -> set[str]:
    """What modules import, by syntax trees and the packages that Python runs on the way."""
    found, left = set(), set(modules)
    while left:
        name = left.pop()
        found.add(name)
        left |= {*imports_of_tree(name), name.rpartition(".")[0]} & fingerprint._CODE.keys() - found
    return found


def digest_with(monkeypatch, name: str, kept: str) -> str:
    """Digest of the code of what is kept, with a line more in a module."""
    changed = fingerprint._CODE | ({name: fingerprint._CODE[name] + b"\nchanged = 1\n"} if name else {})
    monkeypatch.setattr(fingerprint, "_CODE", changed)
    return code_digest.__wrapped__(*KEPT[kept])


@pytest.mark.parametrize(
    "kept", [pytest.param(kept, marks=[pytest.mark.slow] * (kept == "stress")) for kept in KEPT]
)
def test_a_line_in_any_module_that_computes_is_another_key(kept, monkeypatch):
    before = digest_with(monkeypatch, "", kept)
    modules = reached(KEPT[kept])
    assert {"romdam.geometry.elements", "romdam.geometry.meshes.quadrature", "romdam.fem.assembly"} <= modules
    assert {type(method).__module__ for method in REDUCTORS} <= modules
    for name in modules:
        with monkeypatch.context() as patch:
            assert digest_with(patch, name, kept) != before, name
    for name in ELSEWHERE:
        with monkeypatch.context() as patch:
            assert digest_with(patch, name, kept) == before, name


def test_stress_has_the_code_of_its_operators():
    assert {"romdam.fem.stress", "romdam.linalg.dense", "romdam.reduction.stress"} <= imported_modules(
        stress._CODE
    )


@pytest.mark.parametrize("module", KERNELS)
def test_compiled_functions_count_for_what_they_call_and_take(module):
    """All that compiled functions name of romdam lies in modules that are in their key."""
    counted = imported_modules([module, "romdam.core.jit"])
    functions = [value for value in vars(import_module(module)).values() if isinstance(value, Dispatcher)]
    for function in functions:
        for name in function.py_func.__code__.co_names:
            taken = getattr(function.py_func.__globals__.get(name), "__module__", "") or ""
            assert not taken.startswith("romdam.") or taken in counted, (function, name)
    assert _code_of(module, Path()) == code_digest(module, "romdam.core.jit")


def test_a_law_counts_for_the_code_of_romdam_that_it_calls(monkeypatch):
    def content(name: str) -> object:
        changed = fingerprint._CODE | ({name: b"changed = 1"} if name else {})
        with monkeypatch.context() as patch:
            patch.setattr(fingerprint, "_CODE", changed)
            patch.setattr(outside, "code_digest", code_digest.__wrapped__)
            return outside.closed(called, "law.py").content

    def called(x):
        return slides(x)

    assert content("") != content("romdam.contact.cone")
    assert content("") == content("romdam.visual.plots")


EDITED = """
from romdam.core.fingerprint import code_digest
print(code_digest("romdam.reduction.synthesis"))
"""


def test_a_weight_of_a_quadrature_is_another_key_in_another_process(tmp_path):
    package = tmp_path / "romdam"
    shutil.copytree(Path(romdam.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))

    def key() -> str:
        environment = os.environ | {"PYTHONPATH": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", EDITED], env=environment, cwd=tmp_path, capture_output=True, text=True,
            check=True,
        )  # fmt: skip
        return done.stdout

    before = key()
    report, elements = package / "visual" / "report" / "one_run.py", package / "geometry" / "elements.py"
    report.write_text(report.read_text() + "\nmore = 1\n")
    assert key() == before
    elements.write_text(elements.read_text() + "\nmore = 1\n")
    assert key() != before
