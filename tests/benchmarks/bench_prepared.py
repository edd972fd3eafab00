"""CPU time of `model.run` on the two cantilevers: beside its time loops, and beside a row of a suite.

python tests/benchmarks/bench_prepared.py [RUNS]
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import romdam
from romdam.timestepping.modal import runs

ROOT = Path(__file__).parents[2]
KEY = "joints.contraction.normal_stiffness"
loops = [0.0]
compiled = runs.integrate


def timed(*arguments: Any) -> Any:
    """The compiled time loop, its CPU time added up."""
    start = time.thread_time()
    done = compiled(*arguments)
    loops[0] += time.thread_time() - start
    return done


def main(count: int) -> None:
    """Print what a run takes, alone, in one call of all and in a suite."""
    runs.integrate = timed
    job = romdam.load_config(ROOT / "configs" / "two_cantilevers.yaml")
    values = [4e9 + 3.6e10 * k / count for k in range(count)]
    start = time.process_time()
    model = romdam.prepare(job)
    print(f"prepare {time.process_time() - start:.2f} s of CPU")
    model.run({KEY: 5e9})  # compiles
    for name, calls in (("one by one", values), ("in one call", [values])):
        loops[0], start = 0.0, time.process_time()
        for value in calls:
            model.run({KEY: value})
        spent = time.process_time() - start
        print(
            f"{name}: {1e3 * spent / count:.1f} ms of CPU a run, "
            f"its time loops {1e3 * loops[0] / count:.1f} ms, "
            f"ratio {spent / loops[0]:.2f}"
        )
    suite = {"parameters": {"k": {"path": KEY, "values": values}}}
    keys = job.to_dict() | {"pipeline": "suite", "suite": suite}
    whole = romdam.load_config(keys, job.folder)
    with tempfile.TemporaryDirectory() as folder:
        summary = romdam.run_suite(whole, folder, romdam.SuiteOptions(workers=1)).summary
    print(f"suite: {1e3 * float(summary.cpu_seconds.mean()):.1f} ms of CPU a row")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
