"""CPU of the whole command, stage by stage: nothing reduced before, and from kept blocks.

    python tests/benchmarks/bench_command.py [--config configs/two_cantilevers.yaml] [--against CHECKOUT]
                                             [--repeats 5] [--kept-only] [--out results/bench_command.json]

`romdam run CONFIG` in processes of their own, kernels compiled and bytecode written before: "first" with an
empty folder of reduced blocks, "second" with what an earlier one has left. The stages are those of the
command's own log; "start" is all else: the interpreter, imports, the configuration, the tables at the end.
PYTHONDONTWRITEBYTECODE is taken out of the environment: with it a checkout without bytecode compiles all its
modules at each start, 0.6 CPU-s that who installs a wheel, or by `make`, does not spend.
Some of it is measured alone. With `--against`, another checkout of romdam runs in turn with this one, under
this Python and its libraries. Medians over the repeats, CPU seconds of all threads; sizes of the files in MB.
Nothing here passes or fails.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[2]
STAGE = re.compile(r"(?:.*INFO +)?(\w[\w ]*): [\d.]+ s wall, ([\d.]+) s CPU")
ALONE = {
    "python alone": "pass",
    "import romdam alone": "import romdam",
    "load_config alone": "import romdam, sys; romdam.load_config(sys.argv[1])",
    "imports of a run alone": "import romdam.pipelines.run",
    "imports of figures alone": "import romdam.visual.plots",
}
Row = dict[str, float]


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description="CPU of the whole command, stage by stage.")
    parser.add_argument("--config", default="configs/two_cantilevers.yaml", help="in each of the checkouts")
    parser.add_argument("--against", type=Path, help="another checkout of romdam")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--kept-only", action="store_true", help="first runs are not measured")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "bench_command.json")
    options = parser.parse_args()
    before = {"before": options.against.resolve()} if options.against else {}
    report = measure(before | {"now": ROOT}, options.config, options.repeats, options.kept_only)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    print(table(report))


def measure(checkouts: dict[str, Path], config: str, repeats: int, kept_only: bool) -> dict[str, Row]:
    """Medians of every checkout's first and second runs, taken in turn."""
    rows: dict[str, list[Row]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for which, checkout in checkouts.items():  # what compiles and writes bytecode is not counted
            run(checkout, config, folder / which)
        for repeat in range(repeats):
            for which, checkout in checkouts.items():
                if not kept_only:
                    cold = folder / f"{which} {repeat}"
                    rows.setdefault(f"first, {which}", []).append(run(checkout, config, cold))
                rows.setdefault(f"second, {which}", []).append(run(checkout, config, folder / which))
                rows[f"second, {which}"][-1] |= alone(checkout, config)
    return {name: medians(of) for name, of in rows.items()}


def run(checkout: Path, config: str, cache: Path) -> Row:
    """CPU of one command and its stages; `cache` is the folder of the user's caches."""
    with tempfile.TemporaryDirectory() as out:
        arguments = ("-m", "romdam", "run", config, "--out", out, "--verbose")
        whole, log = python(checkout, arguments, cache)
        files = [(path.suffix, path.stat().st_size / 1e6) for path in Path(out).iterdir()]
    row = {name.strip(): float(cpu) for name, cpu in STAGE.findall(log)}
    row = {"whole command": whole, "start": whole - sum(row.values())} | row
    return row | {f"MB of {kind}": sum(s for k, s in files if k == kind) for kind in (".nc", ".h5", ".png")}


def alone(checkout: Path, config: str) -> Row:
    """CPU of parts of the start, each in a process of its own."""
    return {name: python(checkout, ("-c", code, config))[0] for name, code in ALONE.items()}


def python(checkout: Path, arguments: tuple[str, ...], cache: Path | None = None) -> tuple[float, str]:
    """CPU seconds of a Python that imports from a checkout, and what it said on stderr."""
    surroundings = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    surroundings |= {"PYTHONPATH": str(checkout), "COLUMNS": "500"}  # lines of the log are not broken
    if cache is not None:
        surroundings["XDG_CACHE_HOME"] = str(cache)
    start = spent()
    done = subprocess.run(
        [sys.executable, *arguments], cwd=checkout, env=surroundings, capture_output=True, text=True
    )
    if done.returncode:
        raise SystemExit(f"{checkout}: {arguments} ended with {done.returncode}\n{done.stderr}")
    return spent() - start, done.stderr


def spent() -> float:
    """CPU seconds of all children that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def medians(rows: list[Row]) -> Row:
    """Median of each quantity."""
    return {name: median(row[name] for row in rows) for name in rows[0]}


def table(report: dict[str, Row]) -> str:
    """One line for each quantity, one column for each checkout and kind of run."""
    names = dict.fromkeys(name for row in report.values() for name in row)
    lines = [f"{'':36}" + "".join(f"{column:>16}" for column in report)]
    for name in names:
        cells = (f"{row[name]:16.2f}" if name in row else f"{'':16}" for row in report.values())
        lines.append(f"{name:36}" + "".join(cells))
    return "\n".join(lines)


if __name__ == "__main__":
    main()
