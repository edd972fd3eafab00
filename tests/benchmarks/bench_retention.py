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
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh, null_space

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "reduction"))

from small_scenes import DAMPING, march, raw, reduced, scene, shaking

from romdam.core.basis import BlockBasis
from romdam.error.metrics import relative_l2
from romdam.fem.assembly import assemble
from romdam.reduction import synthesis
from romdam.reduction.basis import Dense
from romdam.reduction.interface import joint_interface
from romdam.reduction.methods.craig_bampton import ModeChoice

STEP = 0.00125
CASES: dict[str, tuple[dict[str, Any], float]] = {
    "normal": ({}, 8.0),
    "rigid, mostly closed": ({"normal_stiffness": "rigid"}, 3.0),
    "friction": ({"friction": [0.5, 0.5]}, 8.0),
    "friction, mostly stuck": ({"friction": [0.8, 0.8]}, 2.0),
}


def basis(
    method: str, block: Any, operator: Any, fixed: Any, choices: list[ModeChoice], store: Any
) -> list[BlockBasis]:
    """A held block's basis by one of the three methods, in place of the library's."""
    (choice,) = choices
    free = np.flatnonzero(~fixed.ravel())
    whole_K, whole_M = assemble(block)
    K, M = (matrix[free][:, free].toarray() for matrix in (whole_K, whole_M))
    if method == "nodes":
        interface = joint_interface(operator, fixed)
        rows = interface.turn[free][:, free].toarray()[interface.retained[free]]
    else:
        _, size, V = np.linalg.svd(operator[:, free].toarray(), full_matrices=False)
        rows = V[size > 1e-10 * size[0]]
    T, last = np.linalg.solve(K, rows.T), [0, (choice.count or 1) - 1]
    if method == "free":
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
    inertia = whole_M @ np.tile(np.eye(3), (len(block.points), 1))
    return [BlockBasis(Dense(vectors), slice(0, len(omega2)), omega2, vectors.T @ inertia, {})]


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
        synthesis._by_free_modes = lambda *_: []
        for method in ("nodes", "gaps", "free"):
            synthesis.reduced_block = partial(basis, method)
            for count in (5, 10, 20, 40):
                system = synthesis.reduce_scene(built, ModeChoice(count), DAMPING).system
                start = time.process_time()
                error = relative_l2(jumps(system), exact)
                seconds = time.process_time() - start
                size = f"{method:5} {count:3} modes {system.size:4} unknowns"
                print(f"  {size} {100 * error:7.3f} %  {seconds:.2f} s")
        synthesis.reduced_block, synthesis._by_free_modes = KEPT


KEPT = synthesis.reduced_block, synthesis._by_free_modes

if __name__ == "__main__":
    main()
