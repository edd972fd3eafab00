"""The cheap estimate of the reduction error that every reduced job makes.

A slightly finer reduced model is started from the run's own state and integrated over the seconds that lead
to the largest opening. What the two have grown apart by then is most of what the run is off.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from scipy.sparse import csr_matrix

from romdam.config.load import Job
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.error.comparison import peak_error
from romdam.error.replay import run_window
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.reduction.refinement import embedding, slightly_finer
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import ReducedModel, mode_choice, reduce_scene
from romdam.results.certificate import Figures, figures
from romdam.timestepping.prepared import Prepared

WINDOW = 3.0  # [s]
SHARE = 0.65  # of the true L2 error, that the window shows: 0.39 to 1.09 on the 30 cases of tests/reference


@dataclass(frozen=True)
class Finer:
    """The finer model of a job, what writes a motion of the job's own in it, and the CPU seconds it took."""

    model: ReducedModel
    prepared: Prepared
    embed: csr_matrix
    cpu: float


@dataclass(frozen=True)
class Estimate:
    """Estimated reduction error.

    Attributes
    ----------
    opening : relative, of all openings in L2 and of the largest one
    window : (first, last) second that it was measured in
    finer_unknowns : of the finer model
    cpu : seconds the estimate took for this record
    """

    opening: Figures
    window: tuple[float, float]
    finer_unknowns: int
    cpu: float

    @property
    def attributes(self) -> dict[str, object]:
        """What the result file says of it."""
        return {
            "error_estimate": "Leaving out modes changes the openings by about "
            f"{100 * self.opening.l2:.2g} % in L2 and the largest one by about "
            f"{100 * self.opening.peak:.2g} %, estimated from {self.window[0]:g} to {self.window[1]:g} s "
            "with a finer model, good to a factor of two; `romdam certify` states it for the whole record.",
            "error_estimate_opening_l2": self.opening.l2,
            "error_estimate_opening_peak": self.opening.peak,
            "error_estimate_cpu_seconds": self.cpu,
        }


def finer_model(
    job: Job, scene: Scene, reduced: ReducedModel | None, store: BlockStore | None = None
) -> Finer | None:
    """The finer model of a job; None where no estimate is asked for, or none can be made.

    There is none at full order, with all modes, without joints, with modes that dashpots couple, and without
    damping: undamped histories part in time whatever the basis, and their peaks are what counts.
    """
    wanted = job.config.outputs.error_estimate and job.config.every_joint and job.config.model.modes != "all"
    if reduced is None or not wanted or not reduced.system.diagonal or not reduced.system.C.diagonal().any():
        return None
    start = time.process_time()
    fine = reduce_scene(scene, slightly_finer(mode_choice(job.config.model)), job.config.damping, store)
    return Finer(
        fine, prepare(job, fine.system), embedding(scene, reduced, fine), time.process_time() - start
    )


def estimate_error(job: Job, finer: Finer, motion: GroundMotion, history: History) -> Estimate:
    """Estimate what leaving out modes has changed in a run.

    Raises
    ------
    ConvergenceError
        where a step of the finer model does not converge.
    """
    start = time.process_time()
    settings = settings_for(job, finer.prepared, motion, history.stats["finest_step"])
    ground = ground_at_steps(motion, settings.steps.base, job.config.transient.duration)
    found = run_window(finer.prepared, finer.embed, history, ground, settings, WINDOW)
    rows = slice(found.first, found.last + 1)
    opening = figures(history.jump[rows, :, 0], found.run.jump[..., 0])
    peak = peak_error(history.jump[rows, :, 0], found.run.jump[..., 0])
    return Estimate(
        Figures(opening.l2 / SHARE, peak / SHARE),
        (float(history.time[found.first]), float(history.time[found.last])),
        finer.model.system.size,
        time.process_time() - start,
    )
