"""Two cantilevers that pound each other in an earthquake: `configs/two_cantilevers.yaml`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from romdam import examples
from romdam.benchmarks.case import BenchmarkCase, PublishedValue
from romdam.pipelines.jobs import load_config
from romdam.pipelines.run import run

PROGRAM = "independent program: all 4,200 modes, joint force implicit, step of 3.9e-5 s"
OPENSEES = "OpenSees 3.7 (stdBrick, ENT), step of 2.5 ms"


def _cantilevers() -> Sequence[float]:
    with TemporaryDirectory() as folder:
        path, *_ = examples.write("two_cantilevers", Path(folder))
        keys = load_config(path).to_dict()
        keys["records"][0]["file"] = str(path.parent / keys["records"][0]["file"])
        keys["outputs"] |= {"plots": False, "error_estimate": False, "mesh_error": False}
        result = run(keys).results[0].dataset
    top = np.abs(result.displacement.sel(component="y")).max("time")
    opening = float(result.peak_opening.max())
    return [opening, opening, float(top.sel(node="left_top")), float(top.sel(node="right_top"))]


CASES = (
    BenchmarkCase(
        "two-cantilevers",
        "two concrete cantilevers of 50 m under Northridge 1994; 60 modes of each, steps of 2.5 ms",
        (
            PublishedValue("peak opening", 0.05609, "m", 0.005, PROGRAM, "another code"),
            PublishedValue("peak opening", 0.0563, "m", 0.01, OPENSEES, "another code"),
            PublishedValue("peak displacement, left", 0.05242, "m", 0.01, PROGRAM, "another code"),
            PublishedValue("peak displacement, right", 0.02060, "m", 0.01, PROGRAM, "another code"),
        ),
        _cantilevers,
    ),
)
