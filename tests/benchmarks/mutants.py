"""Which planted faults the tests notice: each is put into a copy of the tree.

    python tests/benchmarks/mutants.py [--room records] [--only TEXT] [--allowed 2] [--out mutants.json]

A fault is killed when a test fails, and survives when all pass. The tests are first run without a fault and
must pass. The table is `FAULTS`: a room is a key, its faults are pairs of texts of one file, and the tests
are those of the room unless a fault names others. Exits with 1 if more survive than `--allowed`.
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
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
COPIED = ("romdam", "pipelines", "tests", "configs", "data", "pyproject.toml")
LONGEST = 600.0  # s of one fault's tests; what takes longer is killed as a hang


@dataclass(frozen=True)
class Fault:
    """One text of a file in place of another.

    Attributes
    ----------
    file : path from the root of the tree
    old : text that stands there exactly once
    new : what is put in its place
    tests : what is run, as pytest takes it
    """

    file: str
    old: str
    new: str
    tests: tuple[str, ...]


def _of(file: str, tests: tuple[str, ...], *pairs: tuple[str, str]) -> list[Fault]:
    return [Fault(file, old, new, tests) for old, new in pairs]


RECORDS = "romdam/records/"
SLOW = "not peer_record and not pyrotd and not eqsig and not p695"  # of these files, and not needed here
BY_HAND = ("tests/records/test_values_by_hand.py",)
CHANGES = ("tests/records/test_record_changes.py", "-k", SLOW)
SPECTRA = (*BY_HAND, "tests/records/test_record_measures.py", "-k", SLOW)
FAULTS: dict[str, list[Fault]] = {
    "records": [
        *_of(
            f"{RECORDS}processing/correction_steps.py",
            BY_HAND,
            ("@ coefficients[1:] / ((n - 1) * dt)", "@ coefficients[1:] / (n * dt)"),
            ("np.mean(acc[..., :samples], axis", "np.mean(acc[..., :], axis"),
            ("@ fit / ((n - 1) * dt) ** 2", "@ fit / (n * dt) ** 2"),
            ("np.arange(last)[::-1] / last", "np.arange(last)[::-1] / (last - 1)"),
            ("gain = 1.0 / np.sqrt(1.0 +", "gain = 1.0 / (1.0 +"),
            ("np.ceil(1.5 * order / corner / dt)", "np.ceil(order / corner / dt)"),
            ("return int(k[np.argmin(aic)])", "return int(k[np.argmin(aic)]) + 1"),
            ("slope = (time[:, None] >= starts)", "slope = (time[:, None] > starts)"),
        ),
        *_of(
            f"{RECORDS}processing/integrate.py",
            BY_HAND,
            (
                "dt**2 / 6.0 * (2.0 * acc[..., :-1] + acc[..., 1:])",
                "dt**2 / 4.0 * (acc[..., :-1] + acc[..., 1:])",
            ),
        ),
        *_of(
            f"{RECORDS}processing/resampling.py",
            BY_HAND,
            ("spectrum[..., -1] *= 0.5", "spectrum[..., -1] *= 1.0"),
            ("(freq / nyquist - 0.8) / 0.2", "(freq / nyquist - 0.9) / 0.1"),
            ("np.floor(duration / dt_new + 1e-9)) + 1", "np.floor(duration / dt_new - 1e-9)) + 1"),
        ),
        *_of(
            f"{RECORDS}processing/corners.py",
            (*BY_HAND, *CHANGES),
            ("freq[below[-1] + 1] if", "freq[below[-1] - 6] if"),
            ("10.0 ** (1.5 * magnitude + 16.05)", "10.0 ** (1.5 * magnitude + 16.1)"),
            ("NEEDED_TO = 5.0", "NEEDED_TO = 1.0"),
        ),
        *_of(
            f"{RECORDS}measures.py",
            BY_HAND,
            ("GRAVITY = 9.80665", "GRAVITY = 9.81"),
            ("_running(np.abs(acc), dt)[..., -1]", "np.sum(np.abs(acc), axis=-1) * dt"),
            ("significant_duration(rows, dt, 0.05, 0.75)", "significant_duration(rows, dt, 0.05, 0.7)"),
            ("- (row[after] - level) / rise", "- 0.0 * (row[after] - level) / rise"),
            (
                "np.searchsorted(below, share * below[-1])) + 1)",
                "np.searchsorted(below, share * below[-1])))",
            ),
        ),
        *_of(
            f"{RECORDS}spectra.py",
            SPECTRA,
            ("NEAR_PEAK = 0.9 ", "NEAR_PEAK = 0.9999 "),
            ("SUBSTEPS = 8.0 ", "SUBSTEPS = 2.0 "),
            (
                "undecayed = x * np.cos(omega_d * t) + (rate + xi * omega * x)",
                "undecayed = x * np.cos(omega_d * t) + (rate)",
            ),
        ),
        *_of(
            f"{RECORDS}components.py",
            BY_HAND,
            ("return np.sqrt(combined[0] * combined[1])", "return 0.5 * (combined[0] + combined[1])"),
        ),
        *_of(
            f"{RECORDS}processing/offset.py",
            CHANGES,
            ("OFFSET_SHARE * rest, mean, 0.0)", "OFFSET_SHARE * rest, 0.9 * mean, 0.0)"),
            (
                "half = acc.shape[-1], max(1, round(0.5 * WINDOW / dt))",
                "half = acc.shape[-1], max(1, round(WINDOW / dt))",
            ),
        ),
        *_of(
            f"{RECORDS}processing/correction.py",
            CHANGES,
            ("SAID = 0.1 ", "SAID = 0.3 "),
            ("LEFT = 0.5 ", "LEFT = 0.01 "),
        ),
        *_of(
            f"{RECORDS}clipping.py",
            ("tests/records/test_clipping.py", "-k", SLOW),
            ("TOP * np.max(around)) |", "TOP * np.max(around)) &"),
            ("JUMP = 0.8 ", "JUMP = 2.0 "),
        ),
    ],
}


def copy_tree(to: Path) -> None:
    """Copy what tests need; the link in `romdam/` leads into the copy."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "results*")
            shutil.copytree(source, to / name, symlinks=True, ignore=ignored)
        elif source.exists():
            shutil.copy(source, to / name)


def failed(tests: tuple[str, ...], tree: Path) -> str:
    """Run tests in a tree: the first one that fails, or ""."""
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
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


def plant(fault: Fault, tree: Path) -> str:
    """Put a fault into a tree; the text of the file before."""
    path = tree / fault.file
    text = path.read_text(encoding="utf-8")
    if text.count(fault.old) != 1:
        raise SystemExit(
            f"{fault.file}: {fault.old!r} stands there {text.count(fault.old)} times, wanted once"
        )
    path.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--room", choices=sorted(FAULTS), action="append", help="all if not given")
    parser.add_argument("--only", default="", help="faults with this in their file or text")
    parser.add_argument("--allowed", type=int, default=2, help="faults that may survive")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    faults = [
        fault
        for room in options.room or sorted(FAULTS)
        for fault in FAULTS[room]
        if options.only in f"{fault.file} {fault.old}"
    ]
    rows = []
    with tempfile.TemporaryDirectory(prefix="romdam-mutants-") as folder:
        tree = Path(folder).resolve()
        copy_tree(tree)
        check_copy(tree)
        for tests in dict.fromkeys(fault.tests for fault in faults):
            if why := failed(tests, tree):
                raise SystemExit(f"without a fault {' '.join(tests)} fails already: {why}")
        for fault in faults:
            before, start = plant(fault, tree), time.perf_counter()
            why = failed(fault.tests, tree)
            (tree / fault.file).write_text(before, encoding="utf-8")
            rows.append({"file": fault.file, "old": fault.old, "new": fault.new, "killed_by": why})
            seconds = time.perf_counter() - start
            print(
                f"{'killed  ' if why else 'SURVIVES'} {seconds:5.0f} s  {fault.file}: {fault.new}", flush=True
            )
    survivors = [row for row in rows if not row["killed_by"]]
    print(f"{len(rows)} faults, {len(survivors)} survive (at most {options.allowed} may)")
    if options.out is not None:
        options.out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    sys.exit(len(survivors) > options.allowed)


if __name__ == "__main__":
    main()
