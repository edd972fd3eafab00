"""Cost of a reduction beside what SciPy takes for its floor: one factor, the static columns, the modes.

    python tests/benchmarks/bench_reduction.py [--config configs/two_cantilevers.yaml] [--halved]
                                               [--repeats 5] [--out results/bench_reduction.json]

romdam's figures are of a second start without a kept model: the reduced model with the finer one of the error
estimate, and the former alone. SciPy's are `splu` as it is best for symmetric patterns, its `solve` for all
static columns at once and `eigsh` by shift-invert on the same factor for as many modes, of the same matrices.
They take turns. `--halved` halves the elements of boxes. CPU seconds on one thread, medians over the repeats.
Nothing here passes or fails.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, eigsh, splu

import romdam
from romdam.config.load import Job
from romdam.core.scene import Scene
from romdam.core.threads import one_thread
from romdam.linalg.symmetric import whole
from romdam.pipelines.error.estimate import reduced_models
from romdam.reduction.methods import craig_bampton, free_interface
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

ROOT = Path(__file__).parents[2]


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--config", type=Path, default=ROOT / "configs" / "two_cantilevers.yaml")
    parser.add_argument("--halved", action="store_true")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("results/bench_reduction.json"))
    options = parser.parse_args()
    job = romdam.load_config(options.config)
    job = halved(job) if options.halved else job
    with one_thread():
        report = compared(job, options.repeats)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(report, indent=1))
    print("\n".join(f"{name:24s} {value:.3g}" for name, value in report.items()))


def halved(job: Job) -> Job:
    """The job with elements of half the size in all boxes."""
    raw: Any = job.config.model_dump(mode="json")
    for block in raw["blocks"].values():
        block["box"]["element_size"] = (0.5 * np.array(block["box"]["element_size"])).tolist()
    blocks = {name: type(job.config.blocks[name]).model_validate(one) for name, one in raw["blocks"].items()}
    return replace(job, config=job.config.model_copy(update={"blocks": blocks}))


def compared(job: Job, repeats: int) -> dict[str, float]:
    """CPU seconds of romdam's reduction and of SciPy's stages, which take turns."""
    scene = build_scene(job.config, job.folder, str(job.path))
    with noted() as problems:
        reduced_models(job, scene)
    rows = [turn(job, scene, problems) for _ in range(repeats)]
    row = {name: median(one[name] for one in rows) for name in rows[0]}
    both, floor = row["model_and_finer"], row["scipy_factor"] + row["scipy_columns"] + row["scipy_modes"]
    return row | {
        "unknowns": float(sum(K.shape[0] for K, *_ in problems)),
        "columns": float(sum(right.shape[1] for *_, right, _ in problems)),
        "modes": float(sum(count for *_, count in problems)),
        "estimate_share": 1.0 - row["model"] / both,
        "over_scipy": both / floor,
    }


@contextmanager
def noted() -> Iterator[list[Any]]:
    """A list that fills with (K, M, static columns, modes) of every block that is reduced."""
    problems: list[Any] = []
    by_block, by_part = craig_bampton._ritz_vectors, free_interface._ritz_levels

    def of_block(block: Any, choice: Any) -> Any:
        Psi, modes, solver = by_block(block, choice)
        own = ~block.retained
        K, M = block.K[own], block.M[own]
        count = modes.modes
        problems.append((K[:, own] - block.shift * M[:, own], M[:, own], K[:, ~own].toarray(), count))
        return Psi, modes, solver

    def of_part(merged: Any, choice: Any, files: Any, *, massless: bool) -> Any:
        T, levels = by_part(merged, choice, files, massless=massless)
        K = whole(merged.K) - merged.shift * merged.M
        problems.append((K, merged.M, merged.right.toarray(), levels[0].modes))
        return T, levels

    with (
        patch.object(craig_bampton, "_ritz_vectors", of_block),
        patch.object(free_interface, "_ritz_levels", of_part),
    ):
        yield problems


def turn(job: Job, scene: Scene, problems: list[Any]) -> dict[str, float]:
    """CPU seconds of every stage, once."""
    row = {
        "model_and_finer": seconds(lambda: reduced_models(job, scene))[0],
        "model": seconds(lambda: reduce_scene(scene, job.config.model, job.config.damping))[0],
    }
    stages = np.zeros(3)
    for K, M, right, count in problems:
        stages += by_scipy(csc_matrix(K), csc_matrix(M), right, count)
    return row | dict(zip(("scipy_factor", "scipy_columns", "scipy_modes"), stages.tolist(), strict=True))


def by_scipy(K: csc_matrix, M: csc_matrix, right: Any, count: int) -> tuple[float, float, float]:
    """CPU seconds of the factor, the columns and the modes."""
    options: dict[str, Any] = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
    factor, lu = seconds(lambda: splu(K, diag_pivot_thresh=0.0, **options))
    columns, _ = seconds(lambda: lu.solve(right))
    inverse = LinearOperator(K.shape, matvec=lu.solve, dtype=float)
    modes, _ = seconds(lambda: eigsh(K, k=count, M=M, sigma=0.0, OPinv=inverse))
    return factor, columns, modes


def seconds(task: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of a task, and what it gives."""
    start = time.process_time()
    made = task()
    return time.process_time() - start, made


if __name__ == "__main__":
    main()
