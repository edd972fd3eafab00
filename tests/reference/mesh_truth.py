"""What `romdam verify --mesh` states of the error of a mesh, beside the true one.

The truth is the same job on quadratic elements of half the size, whose own error is far below the mesh's
(two cantilevers: 0.2 % in L2); cases whose elements are quadratic are compared with elements of a quarter of
the size. Prints a Markdown table: for every quantity the stated error, from the finer and from the coarser
sibling, over the true one, in L2 and at the peak.

    python tests/reference/mesh_truth.py [--case TEXT] [--seconds 8]
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Iterator
from typing import Any

from memory_truth import RECORDS, record_entry

import romdam
from romdam.config.load import Job
from romdam.config.other_mesh import on_coarser_mesh, on_finer_mesh
from romdam.core.errors import RomdamError
from romdam.core.threads import one_thread
from romdam.error.discretisation import MeshRun, discretisation
from romdam.error.metrics import RelativeError
from romdam.pipelines.error.mesh import run_on_mesh
from romdam.pipelines.run import Clock, silent
from romdam.records.record_set import load_motions

QUADRATIC = {"hex8": "hex20", "tet4": "tet10"}
_CONCRETE = {"E": 30e9, "nu": 0.18, "rho": 2440.0}


def cantilevers(element: str, size: float, **joint: Any) -> dict[str, Any]:
    """The two cantilevers of configs/two_cantilevers.yaml."""
    left = {"origin": [0, -10, 0], "size": [10, 10, 50], "element_size": size, "element": element}
    right = left | {"origin": [0, 0, 0], "size": [10, 20, 50]}
    return {
        "blocks": {n: {"material": "concrete", "box": b} for n, b in (("left", left), ("right", right))},
        "supports": [{"block": name, "face": "zmin"} for name in ("left", "right")],
        "joints": {"contraction": {"between": ["left", "right"], "normal_stiffness": 16e9} | joint},
        "loads": {"initial_state": "undeformed"},
        "outputs": {"nodes": {"left_top": {"block": "left", "at": [0, -10, 50]}}},
    }


def row(element: str, size: float, heights: tuple[float, float, float], **joint: Any) -> dict[str, Any]:
    """Three walls side by side, with weight."""
    blocks = {}
    for i, (name, height) in enumerate(zip("abc", heights, strict=True)):
        box = {"origin": [10.0 * i, 0, 0], "size": [10.0, 5.0, height], "element_size": size}
        blocks[name] = {"material": "concrete", "box": box | {"element": element}}
    law = {"normal_stiffness": 16e9} | joint
    return {
        "blocks": blocks,
        "supports": [{"block": name, "face": "zmin"} for name in "abc"],
        "joints": {"j": {"between": ["a", "b"]} | law, "k": {"between": ["b", "c"]} | law},
        "loads": {"gravity": [0, 0, -9.81], "initial_state": "static"},
        "outputs": {"nodes": {"top": {"block": "b", "at": [10, 0, heights[1]]}}},
    }


_FRICTION = {"shear_stiffness": 8e9, "friction": 0.6}
CASES: dict[str, dict[str, Any]] = {
    "cantilevers hex8 5 m": cantilevers("hex8", 5.0),
    "cantilevers hex8 2.5 m": cantilevers("hex8", 2.5),
    "cantilevers hex8 5 m, friction": cantilevers("hex8", 5.0, **_FRICTION),
    "cantilevers hex20 5 m": cantilevers("hex20", 5.0),
    "cantilevers tet10 5 m": cantilevers("tet10", 5.0),
    "cantilevers hex8 5 m, mortar": cantilevers("hex8", 5.0, discretization="mortar"),
    "walls hex8 2.5 m": row("hex8", 2.5, (25.0, 40.0, 30.0)),
    "walls hex8 2.5 m, friction": row("hex8", 2.5, (25.0, 40.0, 30.0), **_FRICTION),
}


def make_job(case: str, record: str, seconds: float) -> Job:
    """A case in a record, shaken across the joints."""
    raw = copy.deepcopy(CASES[case])
    along = "y" if case.startswith("cantilevers") else "x"
    entry = record_entry(record)
    entry["components"] = {along: entry["components"]["x"]}
    raw |= {
        "materials": {"concrete": _CONCRETE},
        "damping": {"rayleigh": {"frequencies": [2.2, 20.0], "ratio": 0.05}},
        "records": [entry],
        "model": {"modes": 60, "residual_vectors": 20},
        "transient": {"duration": seconds, "finest_step": 6.25e-4},
    }
    raw["outputs"] = raw["outputs"] | {"output_interval": 0.01, "plots": False, "error_estimate": False}
    return romdam.load_config(raw)


def with_elements(job: Job, element: str) -> Job:
    """The job with boxes of another element."""
    blocks = {
        name: block.model_copy(update={"box": block.box.model_copy(update={"element": element})})
        for name, block in job.config.blocks.items()
        if block.box is not None
    }
    return Job(job.config.model_copy(update={"blocks": blocks}), job.path)


def limit_of(job: Job) -> Job:
    """The job on a mesh whose error is far below its own."""
    (element,) = {block.box.element for block in job.config.blocks.values() if block.box is not None}
    finer = on_finer_mesh(job)
    return with_elements(finer, QUADRATIC[element]) if element in QUADRATIC else on_finer_mesh(finer)


@one_thread()
def measure(case: str, record: str, seconds: float) -> Iterator[str]:
    """Rows of the table."""
    job = make_job(case, record, seconds)
    (motion,) = load_motions(job.config.records, job.folder)

    def run(one: Job) -> MeshRun:
        return run_on_mesh(one, motion, seconds, Clock(silent), "run")[0]

    own, truth = run(job), run(limit_of(job))
    about = {"record": record, "seconds": seconds}
    true = discretisation(own, truth, finer=True, about=about)
    stated = {"finer": discretisation(own, run(on_finer_mesh(job)), finer=True, about=about).errors}
    try:
        stated["coarser"] = discretisation(own, run(on_coarser_mesh(job)), finer=False, about=about).errors
    except RomdamError:
        stated["coarser"] = {}
    for name, error in true.errors.items():
        exact = RelativeError(error.l2 / 1.5, error.peak / 1.5)
        ratios = [
            f"{sibling[name].l2 / exact.l2:.2f}, {sibling[name].peak / max(exact.peak, 1e-12):.2f}"
            if name in sibling
            else ""
            for sibling in stated.values()
        ]
        numbers = f"{100 * exact.l2:.2g}, {100 * exact.peak:.2g} %"
        yield f"| {case} | {record} | {name.replace('_', ' ')} | {numbers} | {' | '.join(ratios)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="", help="only cases whose names hold this")
    parser.add_argument("--seconds", type=float, default=8.0)
    arguments = parser.parse_args()
    print(
        "| case | record | quantity | true: L2, peak | finer sibling over true | coarser sibling over true |"
    )
    print("|---|---|---|---|---|---|")
    for case in CASES:
        for record in RECORDS if arguments.case in case else ():
            for line in measure(case, record, arguments.seconds):
                print(line, flush=True)


if __name__ == "__main__":
    main()
