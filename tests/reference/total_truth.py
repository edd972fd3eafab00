"""What `transient.accuracy: {total: ...}` comes to, beside the true error of the openings and the cost.

The truth is the same job on quadratic elements of half the size of the mesh that was chosen, with a gap at
every node where gaps may be, 200 modes a block and steps of 0.2 %; of a generated dam half the size of the
finer of both meshes, the chosen and the given, in each direction. The cost is the CPU time of the run on the
chosen setting, without the runs that found it, beside that of runs on given meshes, contact points, modes,
residual vectors and steps (`--sweep`): the cheapest of these whose true error keeps the total is what the
choice is held against. What cannot be cheaper than a setting that keeps it, or than the choice where that
keeps it, is not run. Prints a Markdown table.

    python tests/reference/total_truth.py [--case TEXT] [--record NAME] [--totals 5 2] [--seconds 8] [--sweep]
"""

from __future__ import annotations

import argparse
import itertools
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

from mesh_truth import CASES, RECORDS, make_job

from romdam.config.load import Job
from romdam.config.other_mesh import (
    has_linear_elements_only,
    on_finer_mesh,
    on_quadratic_elements,
    sibling_meshes,
    with_contact_points,
    with_gaps_at_every_node,
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

log = logging.getLogger(__name__)

TOTALS = (5.0, 2.0, 1.0)  # %


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


def limit_of(chosen: Job, plain: Job) -> Job:
    """The job on a mesh whose error is far below that of the mesh that was chosen."""
    job = with_gaps_at_every_node(chosen) or chosen
    with suppress(RomdamError):
        job = on_quadratic_elements(job)
    for key in ("arch_dam", "gravity_dam"):
        if (dam := getattr(job.config, key)) is not None:
            given, own = (one.shared_divisions for one in (getattr(plain.config, key), dam))
            counts = {
                name: tuple(map(max, count, given.counts[name]))  # of intervals
                if isinstance(count, tuple)
                else max(count, given.counts[name])
                for name, count in own.counts.items()
            }
            divisions = own.model_copy(update=counts)
            changed = {key: dam.model_copy(update={"divisions": divisions})}
            job = replace(job, config=job.config.model_copy(update=changed))
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
def measure(case: str, record: str, seconds: float, totals: Sequence[float], *, sweep: bool) -> Iterator[str]:
    """Rows of the table."""
    plain = make_job(case, record, seconds)
    motions = load_motions(plain.config.records, plain.folder)
    truths = dict[str, MeshRun]()

    def truth_of(job: Job) -> MeshRun:
        limit = with_keys(limit_of(job, plain), 200, 0.002, estimated=False)
        if limit.digest not in truths:
            truths[limit.digest] = timed(limit, motions[0], seconds)[0]
        return truths[limit.digest]

    for total in (percent / 100.0 for percent in totals):
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
        keeps = cpu if true <= total else float("inf")
        cheapest = (
            cheapest_setting(chosen, plain, motions[0], seconds, total, truth_of, keeps) if sweep else ""
        )
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
    keeps: float,
) -> str:
    """CPU time and setting of the cheapest run that keeps the total.

    Meshes, contact points (as given, and at corners where elements are quadratic), modes and residual vectors
    are swept, as long as they cost less than the choice does where it keeps the total (`keeps`) [s].
    """
    kinds = {"as given": plain}
    with suppress(RomdamError):
        kinds["quadratic"] = on_quadratic_elements(plain)
    for name, kind in dict(kinds).items():
        at_corners = all(joint.gaps == "corners" for joint in kind.config.every_joint.values())
        if not has_linear_elements_only(kind) and not at_corners:
            kinds[f"{name}, gaps at corners"] = with_contact_points(kind, "corners")
    best = (keeps, "none is cheaper" if keeps < float("inf") else "none")
    for name, kind in kinds.items():
        for size, mesh in from_coarse(kind).items():
            for modes, vectors in itertools.product((20, 45, 102), (20, 0)):
                setting = with_keys(mesh, modes, total / 5.0, estimated=False, vectors=vectors)
                try:
                    own, cpu = timed(setting, motion, seconds)
                except RomdamError:
                    continue
                true = true_error(own, truth_of(chosen))
                log.info("%s, %s, %d modes, %d vectors: %.2g s, %.2g", name, size, modes, vectors, cpu, true)
                if cpu < best[0] and true <= total:
                    best = cpu, f"{name}, {size}, {modes} modes, {vectors} residual vectors"
                if cpu > 1.2 * best[0] or true > 2.0 * total:  # of the mesh, not of its modes
                    break
            if cpu > 1.2 * best[0]:  # finer meshes of its kind cost more
                break
    return f"{best[0]:.2g} s, {best[1]}"


def from_coarse(job: Job) -> dict[str, Job]:
    """The job on meshes from twice to half the size of its elements, the coarsest first."""
    meshes = dict[str, Job]()
    with suppress(RomdamError):
        coarser = [each for each in sibling_meshes(job) if each.times > 1.0]
        meshes = {f"coarser to {each.direction}": each.job for each in reversed(coarser)}
    meshes["the size given"] = job
    with suppress(RomdamError):
        meshes["half"] = on_finer_mesh(job)
    return meshes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", default="", help="only cases whose names hold this")
    parser.add_argument("--record", default="", help="only records whose names hold this")
    parser.add_argument("--totals", type=float, nargs="+", default=TOTALS, help="%%")
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--sweep", action="store_true", help="find the cheapest setting too")
    asked = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    print("| case | record | total | chosen | stated | true | CPU of run, of choosing | cheapest |")
    print("|---|---|---|---|---|---|---|---|")
    for case in CASES:
        for record in RECORDS:
            if asked.case in case and asked.record in record:
                for line in measure(case, record, asked.seconds, asked.totals, sweep=asked.sweep):
                    print(line, flush=True)


if __name__ == "__main__":
    main()
