"""One job from a configuration to result files: scene, reduction, integration, output."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path

import xarray as xr

from romdam.config.load import Job, located
from romdam.core.errors import RecordError, RomdamError, placed
from romdam.core.files import prepare_folder
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.core.threads import beside, cpu_time, one_thread
from romdam.error.estimate import FinerModel
from romdam.error.statement import ErrorStatement, read_verification
from romdam.fem.stress import observing_stress
from romdam.fem.unreduced import assemble_full
from romdam.pipelines.automatic_modes import choose_modes
from romdam.pipelines.doubts import tell_doubts
from romdam.pipelines.error.estimate import estimate_run, reduced_models
from romdam.pipelines.moving_supports import refuse_drifting, scene_of
from romdam.pipelines.simulation import prepare, simulate_motion
from romdam.pipelines.sizes import refuse_lengths
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.postprocess.concerns import concerns
from romdam.records.design.account import write_choice
from romdam.records.record_set import Loaded, check_names, load_records
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.user_cache import open_store
from romdam.reduction.synthesis import ReducedModel, reduce_scene
from romdam.results.dataset import Timing, build_dataset, write_dataset
from romdam.results.fields import write_model
from romdam.results.stored_run import FOLDER
from romdam.results.stress.file import StressFields, write_stress
from romdam.results.variables import Case
from romdam.timestepping.prepared import Prepared

log = logging.getLogger(__name__)

Progress = Callable[[int, int], None]
Stage = Callable[[str], AbstractContextManager[Progress]]
_PLOTS = "romdam.visual.plots"


@dataclass(frozen=True)
class Outcome:
    """Files that a run wrote, and the records that failed.

    Attributes
    ----------
    paths : result files, in the order of the records
    failures : record name -> message
    others : result files in the folder that this run did not write
    """

    paths: tuple[Path, ...]
    failures: dict[str, str]
    others: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Model:
    """A scene and its prepared system; no `reduced` at full order, no `finer` without an error estimate.

    `stress` holds, block by block, the stress of the reduced coordinates where it is asked for.
    """

    scene: Scene
    prepared: Prepared
    reduced: ReducedModel | None
    finer: FinerModel | None = None
    stress: dict[str, StressFields] = field(default_factory=dict)

    @property
    def system(self) -> System:
        """The open-joint system."""
        return self.prepared.system


@dataclass
class Clock:
    """Wall and CPU seconds of named stages; `show` tells a watcher which stage is on.

    CPU is that of a stage's thread and of those that work for it: some stages run beside others.
    """

    show: Stage
    wall: dict[str, float] = field(default_factory=dict)
    cpu: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str, text: str) -> Iterator[Progress]:
        """Time the body under `name`; it gets a callable for (steps done, steps in all)."""
        wall, cpu = time.perf_counter(), cpu_time()
        log.debug("%s: begins", text)
        with self.show(text) as progress:
            yield progress
        self.wall[name] = time.perf_counter() - wall
        self.cpu[name] = cpu_time() - cpu
        log.info("%s: %.2f s wall, %.2f s CPU", text, self.wall[name], self.cpu[name])


def silent(text: str) -> AbstractContextManager[Progress]:
    """Show nothing."""
    return nullcontext(lambda done, total: None)


@one_thread()
def run(job: Job, out: str | Path, show: Stage = silent, cache: Path | None = None) -> Outcome:
    """Run every ground motion of a job; each lands as `out`/<record>.nc.

    Parameters
    ----------
    job : from `romdam.load_config`
    out : folder, made if needed
    show : told of every stage and its progress
    cache : folder of reduced blocks, to find them in and to keep them in, `romdam.cache_folder()` for that of
        the command; none is used if not given

    Raises
    ------
    RomdamError
        for bad input, and for a lone record that fails; of several records the others go on.
    """
    folder = prepare_folder(Path(out))
    clock = Clock(show)
    with clock.stage("records", "reading records"):
        motions, failures = read_motions(job, folder)
    refuse_lengths(job, motions)
    refuse_drifting(job, motions)
    tell_doubts(job, motions)
    store = open_store(cache)
    job = with_modes_chosen(job, motions, clock, store)
    model = build_model(job, clock, store, estimated=True)
    paths = []
    with beside(partial(_shared, job, model, folder, clock)) as shared:
        for motion in motions:
            try:
                paths.append(run_motion(job, model, motion, (folder, shared), clock))
            except RomdamError as error:
                shared()  # an error of its own is one of all records
                if len(motions) + len(failures) == 1:
                    raise
                failures[motion.name] = str(error)
    others = tuple(path for path in sorted(folder.glob("*.nc")) if path not in paths)
    return Outcome(tuple(paths), failures, others)


def _shared(job: Job, model: Model, folder: Path, clock: Clock) -> tuple[Model, dict[str, str]]:
    """The model with the stress of its modes, and the files beside all results; what draws is loaded, too.

    None of it is asked for before the first record is integrated.
    """
    with replace(clock, show=silent).stage("stress_fields", "stress of the modes"):
        model = replace(model, stress=stress_fields(model.scene, model.reduced))
    files = write_shared(folder, model)
    if job.config.outputs.plots:
        import_module(_PLOTS)
    return model, files


def write_shared(folder: Path, model: Model) -> dict[str, str]:
    """Write what all results of a model share: attribute of the results -> file name."""
    files = {}
    if model.reduced is not None:
        moving = model.system.pseudo_static
        carried = None if moving is None else moving.shapes
        files["model_file"] = write_model(folder, model.scene, model.reduced.basis, carried)
    if model.stress:
        files["stress_file"] = write_stress(folder, model.stress)
    return files


def with_modes_chosen(
    job: Job, motions: list[GroundMotion], clock: Clock, store: BlockStore | None = None
) -> Job:
    """The job with the number of modes that `model.modes: auto` comes to on these motions."""
    if job.config.model.modes != "auto":
        return job
    with clock.stage("modes", "choosing the number of modes"):
        return choose_modes(job, scene_of(job), motions, store)


def read_motions(job: Job, folder: Path | None = None) -> tuple[list[GroundMotion], dict[str, str]]:
    """Ground motions of a job, and name -> message of those that cannot be read.

    Parameters
    ----------
    folder : of the results, where what was held against a target is written; None writes nothing

    Raises
    ------
    RecordError
        where no record can be read, or two share a name.
    """
    motions: list[GroundMotion] = []
    failures: dict[str, str] = {}
    considered: list[Loaded] = []
    for one in load_records(job.config.records, job.folder, considered.append):
        if one.motion is not None:
            motions.append(one.motion)
        else:
            name = one.name if one.name not in failures else f"{one.name} ({len(failures) + 1})"
            failures[name] = located(job, one.error)
    if not motions:
        raise RecordError("\n".join(failures.values()) or "records: none passes `keep`")
    check_names(motions)
    if folder is not None:
        write_choice(considered, folder)
    return motions, failures


def build_model(job: Job, clock: Clock, store: BlockStore | None = None, *, estimated: bool = False) -> Model:
    """Scene and system, reduced or not as the configuration says.

    Parameters
    ----------
    store : holds blocks reduced before
    estimated : with the finer model that every run's estimate of its error compares with
    """
    with clock.stage("scene", "building the scene"):
        scene = scene_of(job)
    if job.config.model.order == "full":
        with clock.stage("model", "assembling the full model"), placed(job.path):
            full = observing_stress(scene, assemble_full(scene, job.config.damping))
            return Model(scene, prepare(job, full), None)
    with clock.stage("model", "reducing the blocks"), placed(job.path):
        return reduced_model(job, scene, store, estimated=estimated)


def reduced_model(job: Job, scene: Scene, store: BlockStore | None, *, estimated: bool) -> Model:
    """A scene's reduced model; see `build_model`."""
    if estimated:
        reduced, finer = reduced_models(job, scene, store)
    else:
        reduced, finer = reduce_scene(scene, job.config.model, job.config.damping, store), None
    return Model(scene, prepare(job, reduced.system), reduced, finer)


def run_motion(
    job: Job,
    model: Model,
    motion: GroundMotion,
    target: tuple[Path, Callable[[], tuple[Model, dict[str, str]]]],
    clock: Clock,
) -> Path:
    """Integrate one ground motion and write its result; `target` is the folder, and what gives `_shared`."""
    folder, shared = target
    with clock.stage("integration", f"simulating {motion.name}") as progress:
        history = simulate_motion(job, model.prepared, motion, job.config.transient.duration, progress)
    model, files = shared()
    with beside(partial(_estimated, job, model, motion, history, clock)) as estimated:
        with clock.stage("stress", "summing up the stress"):
            history, stress = stress_of(model.scene, model.stress, history)
        estimate = estimated()
    with clock.stage("output", "writing the result"):
        timing = Timing(dict(clock.wall), dict(clock.cpu))
        dataset = build_dataset(
            Case(model.scene, motion, history, stress), job, timing, files.get("model_file")
        )
        dataset.attrs.update(files, unknowns=model.system.size)
        path = folder / f"{motion.name}.nc"
        dataset.attrs.update(read_verification(folder, job.digest))
        if estimate is not None:
            estimate.write_to(dataset)
        dataset.attrs[FOLDER] = os.path.relpath(job.folder, folder)
        write_dataset(dataset, path)
    for concern in concerns(history.stats):
        log.warning("%s: %s", motion.name, concern)
    if job.config.outputs.plots:
        with clock.stage("plots", "drawing figures"):
            draw(dataset, folder, motion.name)
    return path


def _estimated(
    job: Job, model: Model, motion: GroundMotion, history: History, clock: Clock
) -> ErrorStatement | None:
    """The estimate of a run's error, None where the model has no finer one."""
    if model.finer is None:
        return None
    with replace(clock, show=silent).stage("estimate", "estimating the error"):
        return estimate_run(job, model.finer, motion, history)


def draw(dataset: xr.Dataset, folder: Path, stem: str) -> list[Path]:
    """Draw every figure of a result."""
    return list(import_module(_PLOTS).write_plots(dataset, folder, stem))  # it loads matplotlib
