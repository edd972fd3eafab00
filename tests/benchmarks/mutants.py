"""Which planted faults the tests notice: each is put into a copy of the tree.

    python tests/benchmarks/mutants.py [--list] [--room records] [--only TEXT] [--allowed 5] [--out M.json]

A fault is killed when a test fails, and survives when all pass. The tests are first run without a fault and
must pass. The table is `faults.FAULTS`. `--list` runs nothing: it says whether every text stands in its file
exactly once, which `tests/test_mutants_table.py` asks too. Exits with 1 if more survive than `--allowed`.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from faults import COMPILED, FAULTS, Fault, misplaced

ROOT = Path(__file__).parents[2]
COPIED = ("romdam", "pipelines", "tests", "configs", "data", "pyproject.toml")
LONGEST = 600.0  # s of one fault's tests; what takes longer is killed as a hang


def copy_tree(to: Path) -> None:
    """Copy what tests need; the link in `romdam/` leads into the copy."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            # compiled functions come along: they are kept by the time of their file, which a copy keeps
            written = ("results*",) if name in ("configs", "data") else ()  # else a room and its tests
            ignored = shutil.ignore_patterns("*.pyc", "*.lock", *written)
            shutil.copytree(source, to / name, symlinks=True, ignore=ignored)
        elif source.exists():
            shutil.copy(source, to / name)


def failed(tests: tuple[str, ...], tree: Path, cache: Path | None = None) -> str:
    """Run tests in a tree: the first one that fails, or "".

    Parameters
    ----------
    cache : folder for compiled functions, where a fault must not replace those of the tree
    """
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {} if cache is None else {"NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired:
        return f"longer than {LONGEST:g} s"
    if done.returncode == 0:
        return ""
    lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return lines[0] if lines else (done.stdout + done.stderr)[-300:]


def check_copy(tree: Path) -> None:
    """Raise SystemExit where the tests would import another tree."""
    command = [sys.executable, "-c", "import romdam; print(romdam.__file__)"]
    environment = os.environ | {"PYTHONPATH": str(tree)}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=True)
    if not Path(done.stdout.strip()).is_relative_to(tree):
        raise SystemExit(f"the copy in {tree} is not what is imported, but {done.stdout.strip()}")


def outcome(fault: Fault, tree: Path) -> str:
    """Put a fault into a tree, run its tests and take it out: the first test that fails, or ""."""
    path = tree / fault.file
    text, times = path.read_text(encoding="utf-8"), path.stat()
    path.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
    try:
        if fault.room not in COMPILED:
            return failed(fault.tests, tree)
        with tempfile.TemporaryDirectory(prefix="romdam-compiled-") as cache:
            return failed(fault.tests, tree, Path(cache))
    finally:
        path.write_text(text, encoding="utf-8")
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--room", choices=sorted(FAULTS), action="append", help="all if not given")
    parser.add_argument("--list", action="store_true", help="check the table, run nothing")
    parser.add_argument("--only", default="", help="faults with this in their file or text")
    parser.add_argument("--allowed", type=int, default=5, help="faults that may survive")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    faults = [
        fault
        for room in options.room or sorted(FAULTS)
        for fault in FAULTS[room]
        if options.only in f"{fault.file} {fault.old}"
    ]
    if wrong := misplaced(ROOT, faults):
        raise SystemExit("\n".join(wrong))
    if options.list:
        print("\n".join(f"{fault.file}: {fault.old} -> {fault.new}" for fault in faults))
        print(f"{len(faults)} faults, each text stands once")
        return
    rows, begin = [], time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="romdam-mutants-") as folder:
        tree = Path(folder).resolve()
        copy_tree(tree)
        check_copy(tree)
        for tests in dict.fromkeys(fault.tests for fault in faults):
            if why := failed(tests, tree):
                raise SystemExit(f"without a fault {' '.join(tests)} fails already: {why}")
        for fault in faults:
            start = time.perf_counter()
            why = outcome(fault, tree)
            rows.append({"file": fault.file, "old": fault.old, "new": fault.new, "killed_by": why})
            seconds = time.perf_counter() - start
            print(
                f"{'killed  ' if why else 'SURVIVES'} {seconds:5.0f} s  {fault.file}: {fault.new}", flush=True
            )
    survivors = [row for row in rows if not row["killed_by"]]
    minutes = (time.perf_counter() - begin) / 60.0
    print(f"{len(rows)} faults, {len(survivors)} survive (at most {options.allowed} may), {minutes:.0f} min")
    if options.out is not None:
        options.out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    sys.exit(len(survivors) > options.allowed)


if __name__ == "__main__":
    main()
