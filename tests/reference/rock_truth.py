"""What is stated of the mesh below a dam, beside what twice and four times as many layers and rows change.

Arch and gravity dams on rock without mass, of equal and unlike moduli and of few and many layers; the mesh of
the dam stays. All are of the openings in L2. Prints a Markdown table.

    python tests/reference/rock_truth.py [--case TEXT] [--record northridge] [--seconds 5]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))  # what tests share

from arch_dams import PERIMETER, ROCK, ROCKS
from mesh_truth import CASES, arch_dam, gravity_dam, make_job
from total_truth import timed, true_error, with_keys

from romdam.config.load import Job
from romdam.config.other_mesh import sibling_meshes
from romdam.core.threads import one_thread
from romdam.error.discretisation import SiblingRun, discretisation
from romdam.records.record_set import load_motions

_GROWTH = 2.0
_BELOW = {"depth": 90.0, "upstream": 100.0, "downstream": 120.0, "left": 40.0, "right": 40.0, "mass": False}


def _arch(along: int, through: int, up: int, layers: int, rows: int, **keys: Any) -> dict[str, Any]:
    """An arch dam on rock of so many layers below and rows up- and downstream."""
    of_dam = {"along": along, "through": through, "up": up}
    below = {"perimeter": 1, "rock": layers, "upstream": rows, "downstream": rows, "growth": _GROWTH}
    rock: dict[str, Any] = dict(ROCK)
    rock["zones"] = {name: zone | {"mass": False} for name, zone in rock["zones"].items()}
    raw = arch_dam(along, through, up, **({"perimeter": PERIMETER, "rock": rock} | keys))
    raw["arch_dam"]["divisions"] = of_dam | below
    return raw | {"more_materials": ROCKS}


def _gravity(along: int, through: int, layers: int, rows: int, element: str, material: str) -> dict[str, Any]:
    """A gravity dam of unequal monoliths on rock of so many layers below and rows on every side."""
    gaps = {} if element == "hex8" else {"gaps": "corners"}
    raw = gravity_dam(along, through, 12, element, (10.0, 16.0, 22.0), **gaps)
    del raw["outputs"]["stress"]
    raw["gravity_dam"]["rock"] = _BELOW | {"material": material}
    sides = dict.fromkeys(("upstream", "downstream", "banks"), rows)
    raw["gravity_dam"]["divisions"] |= {"depth": layers, "growth": _GROWTH} | sides
    raw["gravity_dam"]["divisions"]["up"] = [2, 2, 4, 4]  # between the elevations where something changes
    return raw | {"more_materials": ROCKS}


_CASES: dict[str, dict[str, Any]] = {
    "arch dam (2, 2, 6), 4 layers, 3 rows": _arch(2, 2, 6, 4, 3),
    "arch dam (2, 2, 6), 4 layers, 4 rows": _arch(2, 2, 6, 4, 4),
    "arch dam (2, 2, 6), 2 layers, 2 rows": _arch(2, 2, 6, 2, 2),
    "arch dam (3, 4, 8), 3 layers, 2 rows": _arch(3, 4, 8, 3, 2),
    "arch dam (2, 2, 6) on a perimeter alone": _arch(2, 2, 6, 2, 2, rock=None),
    "gravity dam hex20 (2, 4, 12), 4 layers, 3 rows": _gravity(2, 4, 4, 3, "hex20", "rock_b"),
    "gravity dam hex20 (2, 4, 12), soft, 2 layers, 1 row": _gravity(2, 4, 2, 1, "hex20", "rock_c"),
    "gravity dam hex8 (2, 4, 12), 3 layers, 3 rows": _gravity(2, 4, 3, 3, "hex8", "rock_a"),
}


def _finer_ground(job: Job, times: int) -> Job:
    """The job with so many times the layers and rows below its dam."""
    for _ in range(times.bit_length() - 1):
        dam = "arch_dam" if job.config.arch_dam is not None else "gravity_dam"
        own = getattr(job.config, dam)
        of_dam = {name: getattr(own.shared_divisions, name) for name in ("along", "through", "up")}
        below = {name: 2 * count for name, count in own.divisions.counts.items() if name not in of_dam}
        growth = own.divisions.growth**0.5
        divisions = own.shared_divisions.model_copy(update=of_dam | below | {"growth": growth})
        changed = {dam: own.model_copy(update={"divisions": divisions})}
        job = replace(job, config=job.config.model_copy(update=changed))
    return job


@one_thread()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="", help="only cases whose names hold this")
    parser.add_argument("--record", default="northridge")
    parser.add_argument("--seconds", type=float, default=5.0)
    asked = parser.parse_args()
    print("| dam | rock, stated | twice | true | stated of the dam |\n|---|---|---|---|---|", flush=True)
    for case, raw in _CASES.items():
        if asked.case not in case:
            continue
        CASES[case] = raw
        job = with_keys(make_job(case, asked.record, asked.seconds), 100, 0.002, estimated=False)
        (motion,) = load_motions(job.config.records, job.folder)
        own, twice, truth = (
            timed(_finer_ground(job, times), motion, asked.seconds)[0] for times in (1, 2, 4)
        )
        chain = [
            SiblingRun(one.direction, one.times, timed(one.job, motion, asked.seconds)[0])
            for one in sibling_meshes(job)
        ]
        about = {"record": asked.record, "seconds": asked.seconds}
        parts: Any = discretisation(own, chain, finer=False, about=about).details["directions"]
        stated = {name: f"{part['l2']:.2%}" for name, part in parts.items()}
        true = " | ".join(f"{true_error(own, finer):.2%}" for finer in (twice, truth))
        print(f"| {case} | {stated.pop('rock')} | {true} | {stated} |", flush=True)


if __name__ == "__main__":
    main()
