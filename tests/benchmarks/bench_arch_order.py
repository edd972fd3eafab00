"""With which order do openings of an arch dam converge along its arcs?

    python tests/benchmarks/bench_arch_order.py [--seconds 6] [--case TEXT]

Slices of `tests/reference/mesh_truth.py` with 2, 4 and 8 curved hex20 elements along a cantilever, all else
alike, so that gaps stand at the same places. The order is the binary logarithm of the difference of the first
two meshes over that of the last two, of all openings in L2 and of all peaks. Nothing here passes or fails.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import copy
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

from mesh_truth import CASES

import romdam
from romdam.core.threads import one_thread
from romdam.error.comparison import OVER_FINER
from romdam.error.discretisation import MeshRun, discretisation
from romdam.pipelines.error.verify import run_on_mesh
from romdam.pipelines.run import Clock, silent
from romdam.records.record_set import load_motions

RECORDS = Path(__file__).parents[2] / "data" / "records"
AXES = (("y", "009"), ("x", "279"))
ALONG = (2, 4, 8)


def run(case: str, along: int, seconds: float) -> MeshRun:
    """A case with a number of elements along a cantilever, in Northridge's two components."""
    raw = copy.deepcopy(CASES[case])
    raw["arch_dam"]["divisions"]["along"] = along
    components = {axis: {"file": str(RECORDS / f"northridge_mul{name}_g_dt0.01.txt")} for axis, name in AXES}
    raw |= {
        "materials": {"concrete": {"E": 28e9, "nu": 0.2, "rho": 2400.0, "expansion": 1e-5}},
        "damping": {"rayleigh": {"frequencies": [2.0, 15.0], "ratio": 0.05}},
        "records": [{"name": "northridge", "unit": "9.81 m/s2", "dt": 0.01, "components": components}],
        "model": {"cutoff": 60.0, "residual_vectors": 20},
        "transient": {"duration": seconds, "finest_step": 1.25e-3},
        "outputs": {"output_interval": 0.01, "plots": False, "error_estimate": False},
    }
    job = romdam.load_config(raw)
    (motion,) = load_motions(job.config.records, job.folder)
    return run_on_mesh(job, motion, seconds, Clock(silent), "run")[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--case", default="(4, 4, 8)", help="only cases whose names hold this")
    asked = parser.parse_args()
    print("| dam | 2 against 4: L2, peak | 4 against 8 | order |\n|---|---|---|---|")
    for case in CASES:
        if not case.startswith("arch dam") or asked.case not in case:
            continue
        with one_thread():
            runs = [run(case, along, asked.seconds) for along in ALONG]
        pairs = []
        for coarse, fine in pairwise(runs):
            about = {"record": "northridge", "seconds": asked.seconds}
            error = discretisation(coarse, fine, finer=True, about=about).errors["opening"]
            pairs.append(np.array([error.l2, error.peak]) / OVER_FINER)
        order = np.log2(pairs[0] / pairs[1])
        first, second = (f"{100 * pair[0]:.2g} %, {100 * pair[1]:.2g} %" for pair in pairs)
        print(f"| {case} | {first} | {second} | {order[0]:.2f}, {order[1]:.2f} |", flush=True)


if __name__ == "__main__":
    main()
