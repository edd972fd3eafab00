"""Draw faults from the source at random, and count those that no test notices.

    python tests/benchmarks/drawn_faults.py [--seed 1] [--number 60] [--list] [--trace REACH.json]
        [--reach REACH.json] [--first 0] [--quick] [--longest 600]
        [--out TABLE.jsonl]

A third of the places are in functions that numba compiles. A fault changes one operator, sign, factor, index,
comparison, argument, term or bound of a line that computes. The tests that import its module are run first,
then the recorded jobs that call its function (`--trace` finds which, once), then the tests of its room; a
fault is noticed when one of them fails. What survives is judged by hand: a fault that cannot change an answer
is no fault.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mutants

ROOT = Path(__file__).parents[2]
ROOMS = {  # that compute: their tests
    "contact": ("contact", "timestepping"),
    "timestepping": ("timestepping", "contact"),
    "linalg": ("linalg", "reduction"),
    "records": ("records",),
    "fem": ("fem", "effects"),
    "effects": ("effects", "fem"),
    "scene": ("scene", "effects"),
    "geometry": ("geometry",),
    "reduction": ("reduction",),
    "error": ("error",),
    "postprocess": ("results",),
    "results": ("results",),
    "export": ("export",),
}
OF_COMPILED = ("laws", "blocks", "ground")  # recorded jobs that run most compiled code
OPERATORS: dict[type, tuple[str, str]] = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"),
}  # fmt: skip
BOUNDS = {"maximum", "minimum", "max", "min", "abs", "clip"}
SAID = (ast.Raise, ast.JoinedStr, ast.Assert, ast.ImportFrom, ast.Import, ast.AnnAssign)


@dataclass(frozen=True)
class Drawn:
    """One change of a file: its characters `begin` to `end` become `new`."""

    file: str
    line: int
    function: str
    compiled: bool
    begin: int
    end: int
    old: str
    new: str


def _changes(node: ast.AST, text: Any) -> Iterator[tuple[ast.AST, str]]:
    """What may stand in place of an expression or statement."""
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        yield node, f"({text(node.left)} {OPERATORS[type(node.op)][1]} {text(node.right)})"
        if isinstance(node.op, (ast.Add, ast.Sub)):
            yield node, f"({text(node.left)})"  # a dropped term
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OPERATORS:
        yield node, f"({text(node.left)} {OPERATORS[type(node.ops[0])][1]} {text(node.comparators[0])})"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield node, f"({text(node.operand)})"
    elif isinstance(node, ast.AugAssign) and type(node.op) in OPERATORS:
        yield node, f"{text(node.target)} {OPERATORS[type(node.op)][1]}= {text(node.value)}"
    elif (
        isinstance(node, ast.Subscript)
        and isinstance(node.slice, ast.Constant)
        and node.slice.value in (0, 1)
    ):
        yield node, f"{text(node.value)}[{1 - node.slice.value}]"
    elif isinstance(node, ast.Constant) and type(node.value) is float and node.value != 0.0:
        yield node, "2.0" if node.value == 1.0 else "1.0" if node.value == 2.0 else f"{1.1 * node.value:.12g}"
    elif isinstance(node, ast.Call) and node.args:
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name in BOUNDS and len(node.args) <= 3:
            yield node, f"({text(node.args[0])})"
        elif len(node.args) == 2 and not any(isinstance(a, (ast.Constant, ast.Starred)) for a in node.args):
            yield node, f"{text(node.func)}({text(node.args[1])}, {text(node.args[0])})"


def places(file: Path) -> Iterator[Drawn]:
    """Every change of a file that is a slip in something computed."""
    source = file.read_text(encoding="utf-8")
    starts = [0]
    for row in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(row.encode()))
    data = source.encode()

    def span(node: Any) -> tuple[int, int]:
        return (
            starts[node.lineno - 1] + node.col_offset,
            starts[node.end_lineno - 1] + node.end_col_offset,
        )

    def text(node: ast.AST) -> str:
        return data[slice(*span(node))].decode()

    def walk(node: ast.AST, function: str, compiled: bool) -> Iterator[Drawn]:
        for name, value in ast.iter_fields(node):
            if name in ("decorator_list", "returns", "annotation", "args") and not isinstance(node, ast.Call):
                continue
            for child in value if isinstance(value, list) else [value]:
                if not isinstance(child, ast.AST) or isinstance(child, SAID):
                    continue
                if isinstance(child, ast.FunctionDef):
                    marks = " ".join(text(mark) for mark in child.decorator_list)
                    yield from walk(child, child.name, compiled or "njit" in marks)
                    continue
                if function:
                    for whole, new in _changes(child, text):
                        begin, end = span(whole)
                        where = (str(file.relative_to(ROOT)), child.lineno, function, compiled)  # type: ignore[attr-defined]
                        yield Drawn(*where, begin, end, text(whole), new)
                yield from walk(child, function, compiled)

    yield from walk(ast.parse(source), "", False)


def draw(seed: int, number: int) -> list[Drawn]:
    """A third of compiled code, at most one of each function and kind of code alike."""
    every = [
        p for room in sorted(ROOMS) for f in sorted((ROOT / "romdam" / room).rglob("*.py")) for p in places(f)
    ]
    shuffled = random.Random(seed)
    drawn: list[Drawn] = []
    for compiled, wanted in ((True, number // 3), (False, number - number // 3)):
        pool = [place for place in every if place.compiled == compiled]
        shuffled.shuffle(pool)
        first = {(place.file, place.function): place for place in reversed(pool)}  # one of each function
        functions = [place for place in pool if first[place.file, place.function] is place]
        drawn += functions[:wanted]
    shuffled.shuffle(drawn)
    return drawn


def trace(out: Path) -> None:
    """Write which functions each recorded job calls."""
    sys.path += [str(ROOT / "tests" / room) for room in ("recorded", "records", "")]
    from jobs import JOBS
    from running import recorded

    reach: dict[str, list[str]] = {}
    for name in JOBS:
        seen: set[str] = set()

        def called(frame: Any, event: str, arg: Any, seen: set[str] = seen) -> None:
            seen.add(f"{frame.f_code.co_filename.removeprefix(f'{ROOT}/')}:{frame.f_code.co_name}")

        with tempfile.TemporaryDirectory() as folder:
            sys.settrace(called)
            threading.settrace(called)
            recorded(name, Path(folder) / name)
            sys.settrace(None)
        reach[name] = sorted(call for call in seen if call.startswith("romdam"))
    out.write_text(json.dumps(reach), encoding="utf-8")


def importing(module: str) -> list[Path]:
    """Files of tests that import a module, those with values by hand first."""
    parent, _, name = module.rpartition(".")
    marks = (f"{module} import", f"import {module}", f"from {parent} import {name}")
    files = [f for f in (ROOT / "tests").rglob("test_*.py") if any(m in f.read_text("utf-8") for m in marks)]
    return sorted(files, key=lambda file: ("by_hand" not in file.name, str(file)))


def noticed_by(fault: Drawn, tree: Path, reach: dict[str, list[str]], quick: bool) -> str:
    """Plant a fault, run what may notice it and take it out: the first test that fails, or ""."""
    path, call = tree / fault.file, f"{fault.file}:{fault.function}"
    whole, times = path.read_bytes(), path.stat()
    jobs = [job for job, calls in reach.items() if call in calls] or [*OF_COMPILED] * fault.compiled
    room, module = fault.file.split("/")[1], fault.file.removesuffix(".py").replace("/", ".")
    tests = [f"tests/{test.relative_to(ROOT / 'tests')}" for test in importing(module)]
    runs = [tuple(tests)] if tests else []
    runs += [("tests/recorded", "-k", " or ".join(f"[{job}]" for job in jobs))] if jobs else []
    runs += [(f"tests/{name}",) for name in ROOMS[room]]
    runs = runs[:1] if quick else runs
    path.write_bytes(whole[: fault.begin] + fault.new.encode() + whole[fault.end :])
    try:
        with tempfile.TemporaryDirectory(prefix="romdam-compiled-") as cache:
            private = Path(cache) if fault.compiled else None
            return next((why for run in runs if (why := mutants.failed(run, tree, private))), "")
    finally:
        path.write_bytes(whole)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="go on with this one")
    parser.add_argument("--list", action="store_true", help="run nothing")
    parser.add_argument("--trace", type=Path, help="write which functions each recorded job calls")
    parser.add_argument("--reach", type=Path, help="what --trace wrote; else all jobs that run compiled code")
    parser.add_argument("--quick", action="store_true", help="only the tests that import the module")
    parser.add_argument("--longest", type=float, default=600.0, help="seconds of one run of tests")
    parser.add_argument("--out", type=Path, help="a line for each fault")
    options = parser.parse_args()
    if options.trace:
        trace(options.trace)
        return
    mutants.LONGEST = options.longest
    faults = draw(options.seed, options.number)
    if options.list:
        for k, fault in enumerate(faults):
            code = " njit" * fault.compiled
            print(f"{k} {fault.file}:{fault.line} {fault.function}{code}: {fault.old} -> {fault.new}")
        return
    reach = json.loads(options.reach.read_text(encoding="utf-8")) if options.reach else {}
    with tempfile.TemporaryDirectory(prefix="romdam-drawn-") as folder:
        tree = Path(folder).resolve()
        mutants.copy_tree(tree)
        mutants.check_copy(tree)
        for k, fault in list(enumerate(faults))[options.first :]:
            begin = time.perf_counter()
            why = noticed_by(fault, tree, reach, options.quick)
            row = asdict(fault) | {"number": k, "noticed_by": why}
            if options.out:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
            said = f"{k} {'noticed ' if why else 'SURVIVES'} {time.perf_counter() - begin:4.0f} s"
            print(f"{said} {fault.file}:{fault.line} {fault.old} -> {fault.new}", flush=True)


if __name__ == "__main__":
    main()
