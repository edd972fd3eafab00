"""Make the references of the recorded jobs, and say what has changed.

    python tests/recorded/record.py [JOB ...] [--check]

Each line of what has changed is a job, what it is of, what it was and what it is. `--check` writes nothing
and exits with 1 where something has changed. A change that is meant is explained in the commit that changes
a reference.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path += [str(Path(__file__).parents[1] / room) for room in ("records", "")]

import digest
from jobs import JOBS
from running import REFERENCES, recorded


def read(name: str) -> digest.Digest:
    """The reference of a job; empty where there is none."""
    path = REFERENCES / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write(name: str, found: digest.Digest) -> None:
    """A line for each thing, so that a diff can be read."""
    lines = [
        f"{json.dumps(key, ensure_ascii=False)}: {json.dumps(found[key], ensure_ascii=False)}"
        for key in sorted(found)
    ]
    REFERENCES.mkdir(exist_ok=True)
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    (REFERENCES / f"{name}.json").write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("jobs", nargs="*", help=f"all if not given: {', '.join(JOBS)}")
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--keep", type=Path, help="folder in which what is written stays")
    options = parser.parse_args()
    changed = 0
    with tempfile.TemporaryDirectory(prefix="romdam-recorded-") as scratch:
        os.environ["XDG_CACHE_HOME"] = str(Path(scratch) / "cache")
        for name in options.jobs or JOBS:
            begin, cpu = time.perf_counter(), time.process_time()
            found = recorded(name, (options.keep or Path(scratch)) / name)
            lines = differences_of(name, found)
            changed += len(lines)
            print(
                f"{name}: {len(found)} things, {len(lines)} changed, {time.perf_counter() - begin:.1f} s"
                f" ({time.process_time() - cpu:.1f} s of CPU)",
                flush=True,
            )
            print("".join(f"    {line}\n" for line in lines), end="")
            if not options.check:
                write(name, found)
    sys.exit(options.check and changed > 0)


def differences_of(name: str, found: digest.Digest) -> list[str]:
    """What is other than in the reference, as JSON has it."""
    return digest.differences(read(name), json.loads(json.dumps(found)))


if __name__ == "__main__":
    main()
