"""What `romdam verify --mesh` states of the error of a mesh, beside the true one.

The truth is the same job on quadratic elements of half the size, whose own error is far below the mesh's
(two cantilevers: 0.2 % in L2); boxes whose elements are quadratic are compared with elements of a quarter of
the size, such dams with half of it in every direction. Prints a Markdown table: for every quantity the stated
error, from the finer and from the coarser siblings, over the true one, in L2 and at the peak. Rows of every
face and section follow, where L2 is of all percentiles of a face and the peak is the 98 % value. What the
statement names as not resolved is in brackets.

    python tests/reference/mesh_truth.py [--case TEXT] [--record NAME] [--seconds 8]
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Iterator
from statistics import median
from typing import Any

from memory_truth import RECORDS, record_entry

import romdam
from romdam.config.load import Job
from romdam.config.other_mesh import on_finer_mesh, on_quadratic_elements
from romdam.core.errors import ConfigError
from romdam.core.threads import one_thread
from romdam.error.comparison import OVER_FINER
from romdam.error.discretisation import MeshRun, SiblingRun, discretisation
from romdam.error.statement import ErrorStatement
from romdam.pipelines.error.sibling import sibling_jobs
from romdam.pipelines.error.verify import run_on_mesh
from romdam.pipelines.run import Clock, silent
from romdam.records.record_set import load_motions

_CONCRETE = {"E": 30e9, "nu": 0.18, "rho": 2440.0}


def cantilevers(element: str, size: float, **joint: Any) -> dict[str, Any]:
    """The two cantilevers of configs/two_cantilevers.yaml."""
    stress = {
        "faces": [{"block": "left", "face": "ymin"}, {"block": "right", "face": "ymax"}],
        "sections": {
            "left_foot": {"blocks": ["left"], "point": [0, 0, 0]},
            "right_middle": {"blocks": ["right"], "point": [0, 0, 24]},
        },
    }
    left = {"origin": [0, -10, 0], "size": [10, 10, 50], "element_size": size, "element": element}
    right = left | {"origin": [0, 0, 0], "size": [10, 20, 50]}
    return {
        "blocks": {n: {"material": "concrete", "box": b} for n, b in (("left", left), ("right", right))},
        "supports": [{"block": name, "face": "zmin"} for name in ("left", "right")],
        "joints": {"contraction": {"between": ["left", "right"], "normal_stiffness": 16e9} | joint},
        "loads": {"initial_state": "undeformed"},
        "outputs": {"nodes": {"left_top": {"block": "left", "at": [0, -10, 50]}}, "stress": stress},
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


def gravity_dam(
    along: int,
    through: int,
    up: int,
    element: str = "hex8",
    monoliths: tuple[float, float, float] = (16.0, 16.0, 16.0),
    **joint: Any,
) -> dict[str, Any]:
    """Three monoliths of Koyna's profile with weight and water, held at their bases."""
    faces = [{"block": "monolith_2", "face": face} for face in ("upstream", "downstream")]
    sections = {
        name: {"blocks": ["monolith_2"], "point": [0, 0, height]}
        for name, height in (("foot", 0), ("neck", 66.5))
    }
    wet = [{"block": f"monolith_{k}", "face": "upstream"} for k in (1, 2, 3)]
    return {
        "gravity_dam": {
            "upstream": [[0, 0], [103, 0]],
            "downstream": [[0, 70], [66.5, 19.25], [103, 14.8]],
            "monoliths": list(monoliths),
            "base": [20, 0, 10],
            "material": "concrete",
            "element": element,
            "divisions": {"along": along, "through": through, "up": up},
            "joints": {"base": "tied", "contraction": {"normal_stiffness": 16e9} | joint},
        },
        "loads": {
            "gravity": [0, 0, -9.81],
            "initial_state": "static",
            "hydrostatic": [{"level": 91.7, "faces": wet}],
        },
        "outputs": {
            "nodes": {"crest": {"block": "monolith_2", "at": [monoliths[0], 0, 103]}},
            "stress": {"faces": faces, "sections": sections},
        },
    }


def arch_dam(
    along: int, through: int, up: int, temperature: dict[str, float] | None = None, **keys: Any
) -> dict[str, Any]:
    """Cantilevers without rock, four unless `keys` of the dam say so, and water to 85 % of the height.

    Parameters
    ----------
    temperature : change of every cantilever [K]; 4 K cooler if not given
    """
    dam: dict[str, Any] = {
        "crest": 100,
        "crown": {"upstream": [[0, 0], [40, -9], [100, -2]], "thickness": [[0, 20], [50, 14], [100, 7]]},
        "arcs": {
            "upstream_radius": [[0, 50], [100, 80]],
            "downstream_radius": [[0, 34], [100, 72]],
        },
        "valley": [[0, 14], [40, 30], [100, 52]],
        "abutment_height": 20,
        "cantilevers": 4,
        "material": "concrete",
        "divisions": {"along": along, "through": through, "up": up},
        "joints": {"normal_stiffness": 24e9, "shear_stiffness": 12e9, "friction": 0.6, "gaps": "corners"},
    }
    dam |= keys
    temperature = temperature or {f"C{k + 1}": -4.0 for k in range(dam["cantilevers"])}
    level = 0.85 * dam["crest"]
    wet = [{"block": name, "face": "upstream"} for name in temperature]
    return {
        "arch_dam": dam,
        "loads": {
            "gravity": [0, 0, -9.81],
            "weight": "staged",
            "hydrostatic": [{"level": level, "faces": wet}],
            "temperature": [{"blocks": [name], "change": change} for name, change in temperature.items()],
        },
        "water": {"level": level, "faces": wet, "model": "westergaard"},
        "outputs": {},
    }


_THIN: dict[str, Any] = {  # parabolic arcs
    "crest": 60,
    "crown": {"upstream": [[0, 0], [25, -4], [60, -1]], "thickness": [[0, 10], [30, 7], [60, 4]]},
    "arcs": {
        "shape": "parabolic",
        "upstream_radius": [[0, 30], [60, 60]],
        "downstream_radius": [[0, 24], [60, 57]],
    },
    "valley": [[0, 10], [30, 22], [60, 38]],
    "abutment_height": 12,
}
_WIDE: dict[str, Any] = {
    "crest": 45,
    "crown": {"upstream": [[0, 0], [20, -2], [45, 0]], "thickness": [[0, 14], [45, 6]]},
    "arcs": {"upstream_radius": [[0, 60], [45, 80]], "thickening": 0.2},
    "valley": [[0, 30], [45, 60]],
    "abutment_height": 10,
}
_SLENDER: dict[str, Any] = {
    "crest": 80,
    "crown": {"upstream": [[0, 0], [30, -6], [80, -1]], "thickness": [[0, 10], [80, 4]]},
    "arcs": {"upstream_radius": [[0, 35], [80, 60]]},
    "valley": [[0, 12], [80, 42]],
    "abutment_height": 15,
}
_THICK: dict[str, Any] = {
    "crest": 60,
    "crown": {"thickness": [[0, 36], [60, 8]]},
    "arcs": {"upstream_radius": 90},
    "valley": [[0, 35], [60, 75]],
    "abutment_height": 15,
    "cantilevers": 3,
}
_FRICTION = {"shear_stiffness": 8e9, "friction": 0.6}
CASES: dict[str, dict[str, Any]] = {
    "cantilevers hex8 5 m": cantilevers("hex8", 5.0),
    "cantilevers hex8 2.5 m": cantilevers("hex8", 2.5),
    "cantilevers hex8 5 m, friction": cantilevers("hex8", 5.0, **_FRICTION),
    "cantilevers hex20 10 m": cantilevers("hex20", 10.0),
    "cantilevers hex20 5 m": cantilevers("hex20", 5.0),
    "cantilevers hex20 5 m, friction": cantilevers("hex20", 5.0, **_FRICTION),
    "cantilevers tet10 10 m": cantilevers("tet10", 10.0),
    "cantilevers tet10 5 m": cantilevers("tet10", 5.0),
    "cantilevers tet10 5 m, friction": cantilevers("tet10", 5.0, **_FRICTION),
    "cantilevers hex8 5 m, mortar": cantilevers("hex8", 5.0, discretization="mortar"),
    "cantilevers hex8 2.5 m, mortar": cantilevers("hex8", 2.5, discretization="mortar"),
    "walls hex8 2.5 m": row("hex8", 2.5, (25.0, 40.0, 30.0)),
    "walls hex8 2.5 m, friction": row("hex8", 2.5, (25.0, 40.0, 30.0), **_FRICTION),
    "gravity dam hex8, 4 elements thick": gravity_dam(2, 4, 10),
    "gravity dam hex8, 6 elements thick": gravity_dam(2, 6, 12),
    "gravity dam hex20 (2, 4, 12)": gravity_dam(2, 4, 12, "hex20", gaps="corners"),
    "arch dam (4, 4, 8)": arch_dam(4, 4, 8),
    "arch dam (3, 4, 8)": arch_dam(3, 4, 8),
    "arch dam, thin (4, 4, 8)": arch_dam(4, 4, 8, **_THIN),
    "arch dam, thin (3, 2, 8)": arch_dam(3, 2, 8, **_THIN),
    "arch dam, wide (4, 4, 8)": arch_dam(4, 4, 8, **_WIDE),
    "arch dam, wide (3, 2, 8)": arch_dam(3, 2, 8, **_WIDE),
    "arch dam, slender (2, 2, 8)": arch_dam(2, 2, 8, **_SLENDER),
    "arch dam, thick (4, 4, 6)": arch_dam(4, 4, 6, {"C1": -8.0, "C2": -4.0, "C3": -2.0}, **_THICK),
    "gravity dam hex20, unequal (2, 4, 8)": gravity_dam(2, 4, 8, "hex20", (10.0, 16.0, 22.0), gaps="corners"),
}


def make_job(case: str, record: str, seconds: float) -> Job:
    """A case in a record, shaken across the joints, the gravity dam up- and downstream too."""
    raw = copy.deepcopy(CASES[case])
    along = {"cantilevers": "y", "walls": "x", "gravity": "xy", "arch": "yx"}[case.split()[0]]
    entry = record_entry(record)
    entry["components"] = dict.fromkeys(along, entry["components"]["x"])
    raw |= {
        "materials": {"concrete": _CONCRETE | {"expansion": 1e-5}} | raw.pop("more_materials", {}),
        "damping": {"rayleigh": {"frequencies": [2.2, 20.0], "ratio": 0.05}},
        "records": [entry],
        "model": {"modes": 60, "residual_vectors": 20},
        "transient": {"duration": seconds, "finest_step": 6.25e-4},
    }
    raw["outputs"] = raw["outputs"] | {"output_interval": 0.01, "plots": False, "error_estimate": False}
    return romdam.load_config(raw)


def limit_of(job: Job) -> Job:
    """The job on a mesh whose error is far below its own."""
    finer = on_finer_mesh(job)
    try:
        return on_quadratic_elements(finer)
    except ConfigError:  # they are already
        return on_finer_mesh(finer) if job.config.blocks else finer


@one_thread()
def measure(case: str, record: str, seconds: float) -> Iterator[str]:
    """Rows of the table."""
    job = make_job(case, record, seconds)
    (motion,) = load_motions(job.config.records, job.folder)

    def run(one: Job) -> MeshRun:
        return run_on_mesh(one, motion, seconds, Clock(silent), "run")[0]

    limit = limit_of(job)
    own, truth = run(job), run(limit)
    about = {"record": record, "seconds": seconds}
    true = rows_of(discretisation(own, truth, finer=True, about=about), exact=True)
    statements: list[ErrorStatement | None] = []
    for finer in (True, False):
        try:
            siblings = sibling_jobs(job, finer=finer)
        except ConfigError:  # there is no such mesh
            siblings = []
        if [sibling.job for sibling in siblings] == [limit]:  # the truth itself
            siblings = []
        runs = [SiblingRun(each.direction, each.times, run(each.job)) for each in siblings]
        statements.append(discretisation(own, runs, finer=finer, about=about) if runs else None)
    for name, pair in true.items():
        exact = [value / OVER_FINER for value in pair]
        cells = [ratios(statement, name, exact) for statement in statements]
        numbers = ", ".join(f"{100 * value:.2g}" for value in exact)
        yield f"| {case} | {record} | {name} | {numbers} % | {' | '.join(cells)} |"


def ratios(statement: ErrorStatement | None, name: str, exact: list[float]) -> str:
    """Stated over true in L2 and at the peak; in brackets where the statement names it without a number."""
    if statement is None:
        return ""
    rows, lost = rows_of(statement), statement.details["not_resolved"]
    assert isinstance(lost, list)
    if name not in rows:  # the ring covers the face there
        return ""
    cell = ", ".join(f"{rows[name][k] / max(exact[k], 1e-12):.2f}" for k in range(2))
    return f"({cell})" if name.replace(" ", "_") in lost else cell


def rows_of(statement: ErrorStatement, *, exact: bool = False) -> dict[str, tuple[float, float]]:
    """L2 and peak of every quantity, then of those of every face and section.

    Parameters
    ----------
    exact : peaks of faces are those of the 98 % value, even where that is less than L2
    """
    rows = {name: (error.l2, error.peak) for name, error in statement.errors.items() if "stress" not in name}
    for kind in ("faces", "sections"):
        of_kind: Any = statement.details.get(kind, {})
        for place, quantities in of_kind.items():
            for name, error in quantities.items():
                headline = exact and kind == "faces"
                peak = error["percentiles"]["98"] if headline else error["peak"]
                rows[f"{place} {name}"] = (error["l2"], peak)
    return {name.replace("_", " "): pair for name, pair in rows.items()}


class Counts:
    """How many stated errors are how far from the true ones, per sibling, in L2 and at the peak."""

    def __init__(self) -> None:
        self.ratios: dict[tuple[str, str], list[float]] = {}

    def add(self, line: str) -> None:
        """Count a row of the table; what is in brackets is not counted."""
        for sibling, cell in zip(("finer", "coarser"), line.split("|")[5:-1], strict=False):
            if cell.strip() and "(" not in cell:
                for kind, text in zip(("L2", "peak"), cell.split(","), strict=True):
                    self.ratios.setdefault((sibling, kind), []).append(float(text))

    def __str__(self) -> str:
        rows = []
        for (sibling, kind), values in self.ratios.items():
            below, above = sum(v < 0.5 for v in values), sum(v > 2.0 for v in values)
            rows.append(
                f"{sibling} sibling, {kind}: {len(values)} values, median {median(values):.2f}, "
                f"{below} below half of the truth, {above} above twice"
            )
        return "\n".join(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="", help="only cases whose names hold this")
    parser.add_argument("--record", default="", help="only records whose names hold this")
    parser.add_argument("--seconds", type=float, default=8.0)
    arguments = parser.parse_args()
    print(
        "| case | record | quantity | true: L2, peak | finer sibling over true | coarser sibling over true |"
    )
    print("|---|---|---|---|---|---|")
    counts = Counts()
    for case in CASES:
        for record in RECORDS:
            if arguments.case not in case or arguments.record not in record:
                continue
            for line in measure(case, record, arguments.seconds):
                print(line, flush=True)
                counts.add(line)
    print(counts)


if __name__ == "__main__":
    main()
