"""What `transient.accuracy: {total: ...}` comes to, beside the true error of the openings and the cost.

The truth is the same job on quadratic elements of half the size of the mesh that was chosen, with 200 modes a
block and steps of 0.2 %. The cost is the CPU time of the run on the chosen setting, without the runs that
found it, beside that of runs on given meshes, contact points, modes, residual vectors and steps (`--sweep`):
the cheapest of these whose true error keeps the total is what the choice is held against. Prints a Markdown
table.

    python tests/reference/total_truth.py [--case TEXT] [--record NAME] [--seconds 8] [--sweep]
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

from mesh_truth import CASES, RECORDS, make_job

from romdam.config.load import Job
from romdam.config.other_mesh import (
    has_linear_elements_only,
    on_coarser_mesh,
    on_finer_mesh,
    on_quadratic_elements,
    with_contact_points,
)
from romdam.config.sections.transient import TotalAccuracy
from romdam.core.errors import RomdamError
from romdam.core.motion import GroundMotion
from romdam.core.threads import one_thread
from romdam.error.comparison import OVER_FINER
from romdam.error.discretisation import MeshRun, discretisation
from romdam.error.statement import opening_errors
from romdam.pipelines.error.verify import run_on_mesh
from romdam.pipelines.run import Clock, choose_mesh_and_modes, run, silent
from romdam.records.record_set import load_motions

TOTALS = (0.05, 0.02, 0.01)


def with_keys(
    job: Job, modes: object, accuracy: object, *, estimated: bool, vectors: int | None = None
) -> Job:
    """The job with modes, residual vectors, if given, and an accuracy, and without a step."""
    config = job.config
    basis = {"modes": modes} | ({} if vectors is None else {"residual_vectors": vectors})
    changed = {
        "model": config.model.model_copy(update=basis),
        "transient": config.transient.model_copy(update={"finest_step": None, "accuracy": accuracy}),
        "outputs": config.outputs.model_copy(update={"error_estimate": estimated}),
    }
    return replace(job, config=config.model_copy(update=changed))


def limit_of(job: Job) -> Job:
    """The job on a mesh whose error is far below its own."""
    with suppress(RomdamError):
        job = on_quadratic_elements(job)
    return on_finer_mesh(job)


def timed(job: Job, motion: GroundMotion, seconds: float) -> tuple[MeshRun, float]:
    """A run, and its CPU time with reduction."""
    start = time.process_time()
    result = run_on_mesh(job, motion, seconds, Clock(silent), "run")[0]
    return result, time.process_time() - start


def true_error(own: MeshRun, truth: MeshRun) -> float:
    """Error of the openings in L2, relative."""
    return (
        discretisation(own, truth, finer=True, about={"record": "", "seconds": 0.0}).errors["opening"].l2
        / OVER_FINER
    )


@one_thread()
def measure(case: str, record: str, seconds: float, *, sweep: bool) -> Iterator[str]:
    """Rows of the table."""
    plain = make_job(case, record, seconds)
    motions = load_motions(plain.config.records, plain.folder)
    truths = dict[str, MeshRun]()

    def truth_of(job: Job) -> MeshRun:
        limit = with_keys(limit_of(job), 200, 0.002, estimated=False)
        if limit.digest not in truths:
            truths[limit.digest] = timed(limit, motions[0], seconds)[0]
        return truths[limit.digest]

    for total in TOTALS:
        job = with_keys(plain, "auto", TotalAccuracy(total=total), estimated=True)
        start = time.process_time()
        try:
            chosen, choice = choose_mesh_and_modes(job, motions, Clock(silent))
        except RomdamError as error:
            yield f"| {case} | {record} | {100 * total:g} % | refused: {error} | | | | |"
            continue
        assert choice is not None
        choosing = time.process_time() - start
        own, cpu = timed(chosen, motions[0], seconds)
        (result,) = run(chosen, motions=motions).results
        attrs = result.dataset.attrs | choice.statement.attributes
        stated = sum(opening_errors(attrs).values())
        true = true_error(own, truth_of(chosen))
        meshes = choice.statement.details["meshes"]
        assert isinstance(meshes, list)
        name = next(entry["mesh"] for entry in meshes if entry["chosen"])
        cheapest = cheapest_setting(chosen, plain, motions[0], seconds, total, truth_of) if sweep else ""
        yield (
            f"| {case} | {record} | {100 * total:g} % | {name}, {chosen.config.model.modes} modes | "
            f"{100 * stated:.2g} % | {100 * true:.2g} % | {cpu:.2g}, {choosing:.2g} s | {cheapest} |"
        )


def cheapest_setting(
    chosen: Job,
    plain: Job,
    motion: GroundMotion,
    seconds: float,
    total: float,
    truth_of: Callable[[Job], MeshRun],
) -> str:
    """CPU time and setting of the cheapest run that keeps the total.

    Meshes, contact points (as given, and at corners where elements are quadratic), modes and residual vectors
    are swept.
    """
    meshes = {"as given": plain}
    for change, name in (
        (on_coarser_mesh, "twice"),
        (on_finer_mesh, "half"),
        (on_quadratic_elements, "quadratic"),
    ):
        with suppress(RomdamError):
            meshes[name] = change(plain)
    if "quadratic" in meshes:
        with suppress(RomdamError):
            meshes["quadratic, twice"] = on_coarser_mesh(meshes["quadratic"])
    for name, mesh in dict(meshes).items():
        if not has_linear_elements_only(mesh):
            meshes[f"{name}, gaps at corners"] = with_contact_points(mesh, "corners")
    best = (float("inf"), "none")
    for name, mesh in meshes.items():
        for modes, vectors in itertools.product((20, 45, 102), (0, 20)):
            setting = with_keys(mesh, modes, total / 5.0, estimated=False, vectors=vectors)
            try:
                own, cpu = timed(setting, motion, seconds)
            except RomdamError:
                continue
            if cpu < best[0] and true_error(own, truth_of(chosen)) <= total:
                best = cpu, f"{name}, {modes} modes, {vectors} residual vectors"
    return f"{best[0]:.2g} s, {best[1]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="", help="only cases whose names hold this")
    parser.add_argument("--record", default="", help="only records whose names hold this")
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--sweep", action="store_true", help="find the cheapest setting too")
    asked = parser.parse_args()
    print("| case | record | total | chosen | stated | true | CPU of run, of choosing | cheapest |")
    print("|---|---|---|---|---|---|---|---|")
    for case in CASES:
        for record in RECORDS:
            if asked.case in case and asked.record in record:
                for line in measure(case, record, asked.seconds, sweep=asked.sweep):
                    print(line, flush=True)


if __name__ == "__main__":
    main()
