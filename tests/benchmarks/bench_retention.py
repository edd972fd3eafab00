"""What a block keeps of joints that see more nodes than they have gaps: error and time by unknowns.

    python tests/benchmarks/bench_retention.py

Two cantilevers in hex20 with gaps at the corners of their faces, against all modes of the mesh. Three bases
of every block, made densely: `nodes` retains what the gaps see (Craig-Bampton), `gaps` the motion of the
gaps alone (fixed-interface modes with B u = 0), `free` has static answers and free modes (free-interface
reduction). The last two have the same unknowns.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh, null_space

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "reduction"))

from small_scenes import DAMPING, march, raw, reduced, scene, shaking

from romdam.core.basis import BlockBasis
from romdam.error.metrics import relative_l2
from romdam.reduction.basis import Dense
from romdam.reduction.interface import joint_interface
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.reductor import BasisFiles, Reductor
from romdam.reduction.substructure import Substructure
from romdam.reduction.synthesis import reduce_scene

STEP = 0.00125
CASES: dict[str, tuple[dict[str, Any], float]] = {
    "normal": ({}, 8.0),
    "rigid, mostly closed": ({"normal_stiffness": "rigid"}, 3.0),
    "friction": ({"friction": [0.5, 0.5]}, 8.0),
    "friction, mostly stuck": ({"friction": [0.8, 0.8]}, 2.0),
}


class DenseMethod(Reductor):
    """A held block's basis by one of the three methods."""

    name = "dense"

    def __init__(self, method: str) -> None:
        self.method = method

    def serves(self, substructure: Substructure, choice: ModeChoice) -> bool:
        return True

    def reduce(
        self, substructure: Substructure, choice: ModeChoice, files: BasisFiles
    ) -> Iterator[dict[str, BlockBasis]]:
        (name,) = substructure.blocks
        operator, fixed = substructure.operator, substructure.scene.fixed[name]
        free = np.flatnonzero(~fixed.ravel())
        K, M = (matrix[free][:, free].toarray() for matrix in substructure.assembly.matrices(name))
        if self.method == "nodes":
            interface = joint_interface(operator, fixed)
            rows = interface.turn[free][:, free].toarray()[interface.retained[free]]
        else:
            _, size, V = np.linalg.svd(operator[:, free].toarray(), full_matrices=False)
            rows = V[size > 1e-10 * size[0]]
        T, last = np.linalg.solve(K, rows.T), [0, (choice.count or 1) - 1]
        if self.method == "free":
            T = np.hstack([T, eigh(K, M, subset_by_index=last)[1]])
        else:
            N = null_space(rows)
            T = np.hstack([T, N @ eigh(N.T @ K @ N, N.T @ M @ N, subset_by_index=last)[1]])
        T /= np.sqrt((T * (M @ T)).sum(axis=0))
        size, U = np.linalg.eigh(T.T @ M @ T)
        T = T @ (U[:, size > 1e-13 * size[-1]] / np.sqrt(size[size > 1e-13 * size[-1]]))
        omega2, V = eigh(T.T @ K @ T, T.T @ M @ T)
        vectors = np.zeros((fixed.size, len(omega2)))
        vectors[free] = T @ V
        participation = vectors.T @ substructure.assembly.inertia(name)
        yield {name: BlockBasis(Dense(vectors), slice(0, len(omega2)), omega2, participation, {})}


def main() -> None:
    """Print a table for every case."""
    for name, (keys, amplitude) in CASES.items():
        config = raw(16.0, gaps="corners", **keys)
        for block in config["blocks"].values():
            block["box"]["element"] = "hex20"
        built, ground = scene(config), shaking(STEP, 2.0, amplitude)

        def jumps(system: Any, ground: Any = ground) -> Any:
            return march(system, STEP, ground, integrator="modal", initial_state="static").jump

        exact = jumps(reduced(built).system)
        print(
            f"{name}: {exact.shape[1]} gaps, {exact.shape[2]} directions, opening {exact[..., 0].max():.2g} m"
        )
        for method in ("nodes", "gaps", "free"):
            for count in (5, 10, 20, 40):
                reductors = (DenseMethod(method),)
                system = reduce_scene(built, ModeChoice(count), DAMPING, reductors=reductors).system
                start = time.process_time()
                error = relative_l2(jumps(system), exact)
                seconds = time.process_time() - start
                size = f"{method:5} {count:3} modes {system.size:4} unknowns"
                print(f"  {size} {100 * error:7.3f} %  {seconds:.2f} s")


if __name__ == "__main__":
    main()
