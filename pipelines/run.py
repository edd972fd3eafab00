"""One job from a configuration to result files: scene, reduction, integration, output."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import xarray as xr

from romdam.config.load import Job, Source, naming_lines
from romdam.config.other_mesh import with_compared_stress, with_mesh_of
from romdam.config.sections.transient import MESH_SHARE, MOST_ACCURACY
from romdam.core.errors import (
    ConfigError,
    ResultError,
    describe_error,
    placed,
    recoverable,
)
from romdam.core.files import Unkept, prepare_folder
from romdam.core.html.card import card
from romdam.core.motion import GroundMotion
from romdam.core.printable import one_line
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.core.threads import cpu_time, in_background, one_thread
from romdam.effects.full_order import assemble_full
from romdam.error.approximations import not_included
from romdam.error.statement import ErrorStatement, accuracy_warnings, read_verification
from romdam.fem.stress import observing_stress
from romdam.pipelines.automatic_mesh import MeshChoice, Trial, choose_mesh, with_accuracy
from romdam.pipelines.automatic_modes import choose_modes, with_modes
from romdam.pipelines.automatic_spacing import automatic_joints, choose_spacing
from romdam.pipelines.balance import with_balance
from romdam.pipelines.error.estimate import can_estimate, variable_models, with_estimates
from romdam.pipelines.error.sibling import NoSibling, Sibling, find_sibling, run_with_stress, with_stress
from romdam.pipelines.floor_spectra import floors_of, refuse_fast_oscillators
from romdam.pipelines.input_motions import Read, job_and_motions, records_of, usable
from romdam.pipelines.job_warnings import log_scene_warnings, log_warnings, step_warnings
from romdam.pipelines.moving_supports import refuse_drifting, scene_of
from romdam.pipelines.simulation import RunModel, prepare, simulate_motion
from romdam.pipelines.sizes import refuse_lengths
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.pipelines.summary import (
    FinishedRun,
    records_summary,
    refuse_summary,
    refuse_unmeasured,
    write_summary_files,
)
from romdam.postprocess.variant_tables import VariantTable
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.user_cache import open_store
from romdam.reduction.synthesis import reduce_scene
from romdam.results.case import rock_blocks
from romdam.results.dataset import Timing, build_dataset, run_identity, write_dataset
from romdam.results.fields import Result, open_result, write_model
from romdam.results.stored_run import FOLDER, folder_from
from romdam.results.stress.file import write_stress
from romdam.results.suite.report_data import DATA
from romdam.results.suite.rows import SuiteRow
from romdam.results.variables import Case
from romdam.timestepping.simulate import refuse_other_start

if TYPE_CHECKING:
    from romdam.pipelines.linear import LinearStage

log = logging.getLogger(__name__)

Progress = Callable[[int, int], None]
Stage = Callable[[str], AbstractContextManager[Progress]]
_PLOTS = "romdam.visual.plots"
_OTHERS = {"suite": "run_suite", "comparison": "compare"}  # what runs a pipeline of several runs


_SHOWN = 8  # results and failures that the repr of an outcome names


@dataclass(frozen=True, repr=False)
class Outcome:
    """Files that a run wrote, and the records that failed.

    Attributes
    ----------
    paths : result files, in the order of the records
    failures : record name -> message
    others : result files in the folder that this run did not write
    summary : of several records, the files of all in one: summary.nc, then its tables; nothing of a lone one
    unkept : results of a run without a folder
    lone : what stands in the file of a lone record, in memory; None of several records
    written : whole path of each file, and what tells its run from others
    stages : of each record a table of its linear stage beside the run; empty without `linear_stage`
    """

    paths: tuple[Path, ...]
    failures: dict[str, str]
    others: tuple[Path, ...] = ()
    summary: tuple[Path, ...] = ()
    unkept: tuple[Result, ...] = field(default=(), repr=False)
    lone: xr.Dataset | None = field(default=None, repr=False)
    written: tuple[tuple[Path, str], ...] = field(default=(), repr=False)
    stages: tuple[VariantTable, ...] = field(default=(), repr=False)

    @cached_property
    def results(self) -> tuple[Result, ...]:
        """The results in the order of the records, opened when they are first asked for.

        Raises
        ------
        ResultError
            where a file is damaged, is gone, or is of another run by then.
        """
        return self.unkept or tuple(
            _open_as_written(path, *written) for path, written in zip(self.paths, self.written, strict=True)
        )

    def __repr__(self) -> str:
        shown = [f"{result.record} (peak opening: {result.opening_text})" for result in self.unkept]
        shown += [str(path) for path in self.paths]
        shown += [f"{name} failed: {message}" for name, message in self.failures.items()]
        more = f"; and {len(shown) - _SHOWN} more" if len(shown) > _SHOWN else ""
        return one_line(f"Outcome({'; '.join(shown[:_SHOWN])}{more})")

    def _repr_html_(self) -> str:
        records = {result.record: result.opening_text for result in self.results}
        kind = f"Outcome, {len(self.results)} results, {len(self.failures)} records failed"
        title = self.results[0].dataset.attrs["title"] if self.results else "nothing was run"
        return card(str(title), kind, records | self.failures)


def _open_as_written(path: Path, whole: Path, identity: str) -> Result:
    """Open a file as it was named, by its whole path where the current folder is another by now."""
    result = open_result(path if path.absolute() == whole else whole)
    if run_identity(result.dataset.attrs) != identity:
        result.close()
        raise ResultError(
            f"{path}: holds another run's numbers by now: its folder was used again before this run's "
            "results were first asked for; give each run a folder of its own"
        )
    return result


class Goal(NamedTuple):
    """The folder of results, and what is made in it beside them."""

    folder: Path
    figures: bool
    summary: bool
    rock: bool


MeshErrorSource = Sibling | NoSibling | MeshChoice  # they state the error of the mesh in a run
Target = tuple[Goal, Callable[[], tuple[RunModel, dict[str, str]]]]


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
@naming_lines
def run(
    job: Source,
    out: str | Path | None = None,
    show: Stage = silent,
    cache: Path | None = None,
    motions: GroundMotion | Sequence[GroundMotion] | None = None,
) -> Outcome:
    """Run every ground motion of a job; each lands as `out`/<record>.nc, several in `out`/summary.nc too.

    Parameters
    ----------
    job : as `romdam.load_config` takes one; with `motions` a mapping needs no `records`
    out : folder, made if needed; without one nothing is kept but the results in memory, without figures
    show : told of every stage and its progress
    cache : folder of reduced blocks, to find them in and to keep them in, `romdam.cache_folder()` for that of
        the command; none is used if not given
    motions : in place of the job's records

    Raises
    ------
    RomdamError
        for bad input, and for a lone record that fails; of several records the others go on.
    """
    job, motions_given = job_and_motions(job, motions)
    if (other := _OTHERS.get(job.config.pipeline)) is not None:
        raise ConfigError(
            f"{job.path}: pipeline: {job.config.pipeline}: romdam.run would run its records once each, and "
            f"nothing else of it; use romdam.{other}, or leave `pipeline` out"
        )
    clock = Clock(show)
    if out is None and job.config.linear_stage is not None:
        raise ConfigError(
            f"{job.path}: linear_stage: its results are files, and a run without `out` keeps none; "
            "give a folder"
        )
    if out is not None:
        outputs = job.config.outputs
        goal = Goal(prepare_folder(Path(out)), outputs.plots, summary=True, rock=outputs.rock)
        return _run(job, motions_given, goal, clock, cache)
    folder = Unkept()
    done = _run(job, motions_given, Goal(folder.path, figures=False, summary=False, rock=True), clock, cache)
    results = tuple(Result(path, folder) for path in done.paths)
    for result in results:
        result.dataset.attrs[FOLDER] = str(job.folder.absolute())
    return Outcome((), done.failures, unkept=results)


def _run(
    job: Job, motions_given: list[GroundMotion] | None, goal: Goal, clock: Clock, cache: Path | None
) -> Outcome:
    """Run given motions, or those of a job."""
    read: Read = {motion.name: motion for motion in motions_given or ()}
    if motions_given is None:
        with clock.stage("records", "reading records"):
            read = records_of(job, goal.folder)
    summarised = goal.summary and len(read) > 1
    if summarised:
        refuse_summary(job, goal.folder)
    motions = usable_motions(job, read, summarised=summarised)
    log_warnings(job, motions)
    store = open_store(cache)
    job, choice = choose_mesh_and_modes(job, motions, clock, store)
    with clock.stage("scene", "building the scene"):
        scene = scene_of(job)
    job = log_scene_warnings(scene, job)
    linear = linear_stages_of(job, scene, motions, goal.folder, clock, store)
    model = build_model(job, clock, store, estimated=True, scene=scene)
    if model.prepared.goes_on_from is not None:
        with placed(job.path):
            refuse_other_start(model.prepared.goes_on_from, [model.prepared])
    of_mesh = choice or build_sibling(job, scene, clock, store)
    with in_background(partial(_shared, model, goal, clock), model.mesh_unknowns) as shared:
        rows, last, undrawn = _run_all(
            job, model, motions, (goal, shared), clock, of_mesh, lone=len(read) == 1
        )
    failures = {name: message for name, message in read.items() if isinstance(message, str)}
    failures |= {name: row.message for name, row in rows.items() if row.message} | undrawn
    kept = [row.kept for row in rows.values() if row.kept is not None]
    paths = tuple(goal.folder / run_kept.file for run_kept in kept)
    files: tuple[Path, ...] = ()
    if summarised:
        with clock.stage("summary", "writing the summary"):
            files = write_summary_files(records_summary(job, model.scene, read, rows), job, goal.folder)
    written_now = {*paths, *files, *([goal.folder / DATA] if files else [])}
    others = tuple(path for path in sorted(goal.folder.glob("*.nc")) if path not in written_now)
    lone = last.dataset if last and len(read) == 1 else None
    stages: tuple[VariantTable, ...] = ()
    if linear:
        from romdam.pipelines.linear import write_stages  # it imports this module

        results = {lone.attrs["record"]: lone} if lone is not None else {}
        for path in paths if lone is None else ():
            with open_result(path) as result:
                results[path.stem] = result.dataset.load()
        stages = tuple(write_stages(linear, results, goal.folder)[0])
    written = tuple((path.absolute(), run_kept.labels) for path, run_kept in zip(paths, kept, strict=True))
    return Outcome(paths, failures, others, files, lone=lone, written=written, stages=stages)


def linear_stages_of(
    job: Job,
    scene: Scene,
    motions: list[GroundMotion],
    folder: Path,
    clock: Clock,
    store: BlockStore | None,
) -> Mapping[str, LinearStage]:
    """The linear stage of every record, where a job has one."""
    if job.config.linear_stage is None:
        return {}
    from romdam.pipelines.linear import build_linear_model, linear_stages  # it imports this module

    model = build_linear_model(job, scene, clock, store)
    return linear_stages(model, motions, folder, clock, said=job.scene_warnings)


def usable_motions(job: Job, read: Read, *, summarised: bool) -> list[GroundMotion]:
    """The motions among records that were read, once nothing is wrong with what they are to give.

    Parameters
    ----------
    summarised : their peaks are set side by side with measures of the records

    Raises
    ------
    RomdamError
    """
    motions = usable(read)
    if summarised:
        refuse_unmeasured(job, read)
    refuse_lengths(job, motions)
    refuse_drifting(job, motions)
    refuse_fast_oscillators(job, motions)
    return motions


def build_sibling(
    job: Job, scene: Scene, clock: Clock, store: BlockStore | None
) -> Sibling | NoSibling | None:
    """What states the error of the mesh of a scene, where it is to be stated; see `find_sibling`."""
    asked = job.config.outputs.mesh_error
    if not asked or (asked == "auto" and not job.config.every_joint):
        return None
    with clock.stage("mesh_model", "reducing the blocks of another mesh, for the error of this one"):
        return find_sibling(job, scene, store)


def _run_all(
    job: Job,
    model: RunModel,
    motions: Sequence[GroundMotion],
    target: Target,
    clock: Clock,
    of_mesh: MeshErrorSource | None,
    *,
    lone: bool,
) -> tuple[dict[str, SuiteRow], FinishedRun | None, dict[str, str]]:
    """Run the records of a job, the figures of each drawn before the next or beside it; a failure is a row.

    Returns
    -------
    the rows of all; the last run, None where that failed; and record -> why its figures could not be drawn

    Raises
    ------
    RomdamError
        for a lone record that fails or whose figures do, and where what all records share cannot be made.
    """
    rows, last, unseen = dict[str, SuiteRow](), None, replace(clock, show=silent)
    undrawn = dict[str, str]()
    for motion in motions:
        with in_background(partial(_drawn, last, target[0], unseen), model.mesh_unknowns) as drawn:
            try:
                last = run_motion(job, model, motion, target, clock, of_mesh)
                rows[motion.name] = SuiteRow("", kept=last.kept) if lone else last.row(job)
            except recoverable() as error:
                target[1]()  # an error of its own is one of all records
                if lone:
                    raise
                last, rows[motion.name] = None, SuiteRow("", describe_error(error))
            undrawn |= drawn()
    return rows, last, undrawn | _drawn(last, target[0], clock, lone=lone)


def _drawn(finished: FinishedRun | None, goal: Goal, clock: Clock, *, lone: bool = False) -> dict[str, str]:
    """Draw the figures of a run, if it is to have some; of several records, its name -> why that failed."""
    if finished is None or not goal.figures:
        return {}
    try:
        with clock.stage("plots", "drawing figures"):
            draw(finished.dataset, goal.folder, finished.path.stem)
    except recoverable() as error:
        if lone:
            raise
        return {finished.path.stem: describe_error(error)}
    return {}


def _shared(model: RunModel, goal: Goal, clock: Clock) -> tuple[RunModel, dict[str, str]]:
    """The model with the stress of its modes, and the files beside all results; what draws is loaded, too.

    None of it is asked for before the first record is integrated.
    """
    with replace(clock, show=silent).stage("stress_fields", "stress of the modes"):
        model = replace(model, stress=stress_fields(model.scene, model.reduced_at_rest, goal.folder))
    files = write_shared(goal.folder, model, rock=goal.rock)
    if goal.figures:
        import_module(_PLOTS)
    return model, files


def write_shared(folder: Path, model: RunModel, *, rock: bool) -> dict[str, str]:
    """Write what all results of a model share: attribute of the results -> file name.

    Parameters
    ----------
    rock : whether the displacement of rock is kept too
    """
    files = {}
    if model.reduced is not None:
        moving = model.system.pseudo_static
        carried = None if moving is None else moving.shapes
        left_out = () if rock else rock_blocks(model.scene)
        files["model_file"] = write_model(folder, model.scene, model.reduced.basis, carried, left_out)
    if model.stress:
        files["stress_file"] = write_stress(folder, model.stress)
    return files


def choose_mesh_and_modes(
    job: Job, motions: list[GroundMotion], clock: Clock, store: BlockStore | None = None
) -> tuple[Job, MeshChoice | None]:
    """The job with the mesh of `transient.accuracy.total`, `spacing` and `model.modes` of `auto`.

    They are chosen on the motion of the largest acceleration. The job that is returned asks for the accuracy
    of steps and modes that is left.

    Raises
    ------
    ConfigError
        where no mesh that can be run keeps the accuracy.
    """
    total, choice, share = job.config.transient.total_accuracy, None, None
    if total is not None:
        job = with_accuracy(job, job.config.transient.step_accuracy)
        motion = max(motions, key=lambda m: m.peak)
        wall, cpu = time.perf_counter(), cpu_time()
        seconds = job.config.transient.duration
        trial_job = with_compared_stress(with_modes_chosen(job, [motion], clock, store))

        automatic = job.config.model.modes == "auto"

        def run_mesh(on_mesh: Job, name: str) -> Trial:
            start = cpu_time()
            if automatic and on_mesh.config.model.modes == "all":  # of a small mesh; of a finer one too many
                on_mesh = with_modes_chosen(with_modes(on_mesh, "auto"), [motion], Clock(silent), store)
            log.debug("%s: begins", name)
            with clock.show(f"choosing the mesh: {name}") as progress:
                model = with_stress(build_model(on_mesh, Clock(silent), store))
                history = simulate_motion(on_mesh, model.prepared, motion, seconds, progress)
            log.info("%s: tried in %.1f s of CPU", name, cpu_time() - start)
            return Trial(run_with_stress(model, history), cpu_time() - start)

        about = {"record": motion.name, "seconds": seconds or motion.duration}
        choice = choose_mesh(trial_job, total, run_mesh, about)
        clock.wall["mesh_choice"] = time.perf_counter() - wall
        clock.cpu["mesh_choice"] = cpu_time() - cpu
        log.info("%s", choice.statement.sentence)
        share = max(total - choice.statement.errors["opening"].l2, (1.0 - MESH_SHARE) * total)
        job = with_accuracy(with_mesh_of(job, choice.job), min(share / 2.0, MOST_ACCURACY))
    job = with_spacing_chosen(job, motions, clock, store)
    return with_modes_chosen(job, motions, clock, store, share), choice


def with_spacing_chosen(
    job: Job, motions: list[GroundMotion], clock: Clock, store: BlockStore | None = None
) -> Job:
    """The job with the distance of the gaps that `spacing: auto` comes to on these motions."""
    if not automatic_joints(job):
        return job
    with clock.stage("spacing", "choosing the spacing of the gaps"):
        return choose_spacing(job, motions, store)


def with_modes_chosen(
    job: Job,
    motions: list[GroundMotion],
    clock: Clock,
    store: BlockStore | None = None,
    share: float | None = None,
) -> Job:
    """The job with the number of modes that `model.modes: auto` comes to on these motions.

    Parameters
    ----------
    share : see `choose_modes`
    """
    if job.config.model.modes != "auto":
        return job
    with clock.stage("modes", "choosing the number of modes"):
        return choose_modes(job, scene_of(job), motions, store, share)


def build_model(
    job: Job,
    clock: Clock,
    store: BlockStore | None = None,
    *,
    estimated: bool = False,
    scene: Scene | None = None,
) -> RunModel:
    """Scene and system, reduced or not as the configuration says.

    Parameters
    ----------
    store : holds blocks reduced before
    estimated : with the finer model that every run's estimate of its error compares with
    scene : of the job; None where it is not built yet
    """
    if scene is None:
        with clock.stage("scene", "building the scene"):
            scene = scene_of(job)
    if job.config.model.order == "full":
        with clock.stage("model", "assembling the full model"), placed(job.path):
            full = observing_stress(scene, assemble_full(scene, job.config.damping))
            return RunModel(scene, prepare(job, full), None)
    with clock.stage("model", "reducing the blocks"), placed(job.path):
        return reduced_model(job, scene, store, estimated=estimated)


def reduced_model(
    job: Job,
    scene: Scene,
    store: BlockStore | None,
    *,
    estimated: bool,
    also: Sequence[Scene] | None = None,
) -> RunModel:
    """A scene's reduced model; see `build_model`, and `romdam.reduction.synthesis.reduce_scene_twice`."""
    if estimated:
        reduced, finer, finer_dry = variable_models(job, scene, store, also)
        return RunModel(scene, prepare(job, reduced.system), reduced, finer, finer_dry=finer_dry)
    reduced = reduce_scene(scene, job.config.model, job.config.damping, store, also=also)
    return RunModel(scene, prepare(job, reduced.system), reduced)


def run_motion(
    job: Job,
    model: RunModel,
    motion: GroundMotion,
    target: Target,
    clock: Clock,
    of_mesh: MeshErrorSource | None = None,
) -> FinishedRun:
    """Integrate one ground motion and write its result.

    Parameters
    ----------
    target : where, and what gives `_shared`
    of_mesh : what states the error of the mesh
    """
    folder, shared = target[0].folder, target[1]
    wall, cpu = time.perf_counter(), cpu_time()
    with clock.stage("integration", f"simulating {motion.name}") as progress:
        history = simulate_motion(job, model.prepared, motion, job.config.transient.duration, progress)
    history = with_balance(job, model, history)
    model, files = shared()
    history, estimate = _estimated(job, model, motion, history, clock)
    floors = None
    if history.every_step is not None:
        with clock.stage("floor_spectra", "floor spectra and their error"):
            history, floors = floors_of(job, model, motion, history)
    with clock.stage("stress", "summing up the stress"):
        history, stress = stress_of(model.scene, model.stress, history)
    case, mesh_error = Case(model.scene, motion, history, stress, floors), None
    if of_mesh is not None:
        with clock.stage("mesh", "stating the error of the mesh") as progress:
            mesh_error = of_mesh.state(model, case, progress)
    with clock.stage("output", "writing the result"):
        timing = Timing(dict(clock.wall), dict(clock.cpu))
        dataset = build_dataset(case, job, timing, files.get("model_file"))
        dataset.attrs.update(files, unknowns=model.system.size)
        path = folder / f"{motion.name}.nc"
        verified = read_verification(folder, dataset.attrs)
        dataset.attrs.update(verified)
        if job.config.outputs.mesh_error == "auto" and "discretisation_statement" in verified:
            mesh_error = None  # `romdam verify --mesh` has stated it, from the mesh that was asked for
        for statement in (estimate, mesh_error):
            if statement is not None:
                statement.write_to(dataset)
        dataset.attrs["error_not_included"] = not_included(job.config)
        total = of_mesh.total if isinstance(of_mesh, MeshChoice) else None
        accuracy = job.config.transient.step_accuracy
        concerns = json.loads(dataset.attrs["run_warnings"])
        concerns += accuracy_warnings(dataset.attrs, accuracy, total)
        # those of the steps are logged before all runs
        dataset.attrs["run_warnings"] = json.dumps([*concerns, *step_warnings(job, motion)])
        dataset.attrs[FOLDER] = folder_from(folder, job.folder)
        write_dataset(dataset, path, history.final)
    for concern in concerns:
        log.warning("%s: %s", motion.name, concern)
    return FinishedRun(path, dataset, case, (time.perf_counter() - wall, cpu_time() - cpu))


def _estimated(
    job: Job, model: RunModel, motion: GroundMotion, history: History, clock: Clock
) -> tuple[History, ErrorStatement | None]:
    """Estimate a run's error, see `with_estimates`; nothing is timed where none is made."""
    if model.reduced is None or not can_estimate(job):
        return with_estimates(job, model, motion, history)
    with clock.stage("estimate", "estimating the error"):
        return with_estimates(job, model, motion, history)


def draw(dataset: xr.Dataset, folder: Path, stem: str) -> list[Path]:
    """Draw every figure of a result."""
    return list(import_module(_PLOTS).write_plots(dataset, folder, stem))  # it loads matplotlib
