"""What finer rock below an arch dam changes of its openings, beside what is stated of the rock's mesh.

Four cantilevers (2, 2, 6) on a perimeter and rock without mass. Rock of 4 layers below, 3 rows up- and
downstream and a growth of 2 is compared with one of twice as many and with two layers of the perimeter; then
rock of 2, 4, 8 and 16 layers and rows, each of which has the nodes of the one before.

    python tests/reference/rock_truth.py [--record northridge] [--seconds 5]
"""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))  # what tests share

from arch_dams import PERIMETER, ROCK, ROCKS
from mesh_truth import CASES, arch_dam, make_job
from total_truth import timed, true_error, with_keys

from romdam.config.load import Job
from romdam.config.other_mesh import coarser_by_direction
from romdam.core.threads import one_thread
from romdam.error.discretisation import SiblingRun, discretisation
from romdam.records.record_set import load_motions

_GIVEN = {"along": 2, "through": 2, "up": 6, "perimeter": 1, "rock": 4, "upstream": 3, "downstream": 3}


def rock_job(record: str, seconds: float, **divisions: float) -> Job:
    """The dam on rock, with other divisions than those given."""
    rock: dict[str, Any] = dict(ROCK)
    rock["zones"] = {name: zone | {"mass": False} for name, zone in rock["zones"].items()}
    raw = arch_dam(2, 2, 6, perimeter=PERIMETER, rock=rock)
    raw["arch_dam"]["divisions"] = _GIVEN | {"growth": 2.0} | divisions
    raw["more_materials"] = ROCKS
    CASES["arch dam on rock"] = raw
    return with_keys(make_job("arch dam on rock", record, seconds), 100, 0.002, estimated=False)


@one_thread()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--record", default="northridge")
    parser.add_argument("--seconds", type=float, default=5.0)
    asked = parser.parse_args()

    def job(**divisions: float) -> Job:
        return rock_job(asked.record, asked.seconds, **divisions)

    (motion,) = load_motions(job().config.records, job().folder)
    own = timed(job(), motion, asked.seconds)[0]
    twice = {"rock": 8, "upstream": 6, "downstream": 6, "growth": 2.0**0.5}
    for name, divisions in {"rock twice": twice, "perimeter twice": {"perimeter": 2}}.items():
        print(f"{name}: {true_error(own, timed(job(**divisions), motion, asked.seconds)[0]):.2%}", flush=True)
    chain = [
        SiblingRun(one.direction, one.times, timed(one.job, motion, asked.seconds)[0])
        for one in coarser_by_direction(job())
    ]
    stated = discretisation(own, chain, finer=False, about={"record": asked.record, "seconds": asked.seconds})
    print("stated:", stated.details["directions"], flush=True)
    runs = [
        timed(job(rock=n, upstream=n, downstream=n, growth=16.0 ** (1.0 / n)), motion, asked.seconds)[0]
        for n in (2, 4, 8, 16)
    ]
    for coarse, fine in pairwise(runs):
        print(f"{coarse.unknowns} -> {fine.unknowns} unknowns: {true_error(coarse, fine):.2%}", flush=True)


if __name__ == "__main__":
    main()
