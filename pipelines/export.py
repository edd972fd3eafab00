"""The model of a job for other programs."""

from __future__ import annotations

from pathlib import Path

from romdam.config.load import Job
from romdam.core.files import prepare_folder
from romdam.core.threads import one_thread
from romdam.export import matrices
from romdam.pipelines.run import Clock, Stage, build_model, read_motions, silent, with_modes_chosen
from romdam.reduction.storage.user_cache import open_store


@one_thread()
def export_matrices(job: Job, out: Path, show: Stage = silent, cache: Path | None = None) -> list[Path]:
    """Write the matrices of a job's blocks and of its system, reduced or not as its `model.order` says.

    Parameters
    ----------
    out : folder, made if needed
    cache : folder of reduced blocks, as of `romdam.run`

    Raises
    ------
    RomdamError
        for bad input, and where the folder refuses a file.
    """
    clock, store = Clock(show), open_store(cache)
    if job.config.model.modes == "auto":
        job = with_modes_chosen(job, read_motions(job)[0], clock, store)
    model = build_model(job, clock, store)
    with clock.stage("output", "writing matrices"):
        folder = prepare_folder(out)
        return matrices.write(model.scene, (model.system, model.reduced), job.config.damping, folder)
