"""The cost and the error of each setting of modes, residual vectors, integrator and step."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr

from romdam.config.coupling import coupling
from romdam.config.load import Job, Source, load_config
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.files import prepare_folder, replacing
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.core.threads import one_thread
from romdam.effects.full_order import assemble_full
from romdam.error.comparison import Openings, compare_openings, read_reference
from romdam.error.study import CaseResult, Setting, case_result, failed_case, study_dataset, study_table
from romdam.pipelines.job_warnings import log_scene_warnings, log_warnings
from romdam.pipelines.moving_supports import refuse_drifting, scene_of
from romdam.pipelines.run import Clock, Stage, silent
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.pipelines.sizes import refuse_lengths
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ALL_MODES, ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.results.dataset import write_dataset
from romdam.timestepping.integrators.registry import FULL_ORDER
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one

MOST_DENSE = 12_000  # free DOFs up to which all modes of the mesh are the reference
FINER = 16  # the reference's step is this part of the finest one studied
PARTS = (4, 8, 16, 32)  # of the record's step, the steps that are studied unless the configuration says


@dataclass(frozen=True)
class Study:
    """Cost and error of all settings, and the files that hold them: study.nc, study.md and study.png."""

    dataset: xr.Dataset
    table: str
    paths: tuple[Path, ...]


@dataclass(frozen=True)
class _Setup:
    """Shared by all cases; `steps` are those studied, `every` the interval of the compared rows [s]."""

    job: Job
    scene: Scene
    motion: GroundMotion
    steps: tuple[float, ...]
    every: float

    @property
    def duration(self) -> float:
        """Seconds that are timed."""
        return self.job.config.transient.duration or self.motion.duration

    @property
    def compared(self) -> float:
        """Seconds that are compared."""
        return min(self.job.config.study.duration, self.duration)


@one_thread()
def study(job: Source, out: str | Path, reference: Path | None = None, show: Stage = silent) -> Study:
    """Run every setting of `study:` on the first record, and set cost against error.

    Parameters
    ----------
    job : a configuration with model.order reduced, as `romdam.load_config` takes one
    out : folder for study.nc, study.md and study.png
    reference : an .npz to compare with instead of a run, see `romdam.error.comparison.read_reference`
    show : told of every stage and its progress

    Raises
    ------
    RomdamError
        for bad input, a scene without joints, and a reference that does not converge.
    """
    job = load_config(job)
    refuse_study(job)
    folder, clock = prepare_folder(Path(out)), Clock(show)
    stored = read_reference(reference) if reference else None
    motion = load_motions(job.config.records, job.folder)[0]
    refuse_lengths(job, [motion])
    refuse_drifting(job, [motion])
    log_warnings(job, [motion])
    scene = scene_of(job)
    job = log_scene_warnings(scene, job)
    steps = job.config.study.finest_steps or tuple(motion.dt / division for division in PARTS)
    setup = _Setup(job, scene, motion, steps, job.config.outputs.output_interval or motion.dt)
    if stored is None:
        stored, name = _reference(setup, clock)
    else:
        name = str(reference)
    cases = [_measure(setup, case, stored, name, clock) for case in _cases(setup, clock)]
    about = {
        "record": motion.name,
        "compared": f"{motion.name}, {setup.compared:g} s of all openings against {name}",
        "timed_seconds": setup.duration,
        "repeats": job.config.study.repeats,
    }
    return _write(folder, study_dataset(cases, job, about))


def refuse_study(job: Job) -> None:
    """Refuse a job that has nothing to be studied.

    Raises
    ------
    ConfigError
    """
    if job.config.model.order == "full":
        raise ConfigError(
            f"{job.path}: model.order is full, a study is about reduced models; set it to reduced"
        )
    if coupled := coupling(job.config):
        raise ConfigError(
            f"{job.path}: {coupled.key}: a study compares integrators of modes that nothing couples, and "
            f"{coupled.by} couple them; {coupled.remedy}"
        )
    if not job.config.every_joint:
        raise ConfigError(f"{job.path}: joints: there is none, and openings are what is compared; name one")


def _reference(setup: _Setup, clock: Clock) -> tuple[Openings, str]:
    """The run that all are compared with: all modes of the mesh at a small step, or full order."""
    wanted, dt = setup.job.config.study.reference, setup.job.config.study.reference_step
    unknowns = sum(int((~fixed).sum()) for fixed in setup.scene.fixed.values())
    dense = wanted == "all_modes" or (wanted == "auto" and unknowns <= MOST_DENSE)
    with clock.stage("reference_model", "building the reference"):
        damping = setup.job.config.damping
        system = (
            reduce_scene(setup.scene, ALL_MODES, damping).system
            if dense
            else assemble_full(setup.scene, damping)
        )
    prepared = prepare(setup.job, system, None if dense else FULL_ORDER)
    settings = _settings(setup, prepared, dt or min(setup.steps) / FINER)
    ground = ground_at_steps(setup.motion, settings.steps.base, setup.compared, system)
    with clock.stage("reference", f"the reference, {ground.shape[1] - 1} steps") as progress:
        history = simulate_one(prepared, ground, settings, progress)
    name = f"all {system.size} modes" if dense else f"full order ({system.size} unknowns)"
    name = f"{name} at dt {settings.steps.finest:g} s"
    return Openings(history.time, history.jump[..., 0], setup.scene.gap_position), name


@dataclass(frozen=True)
class _Case:
    """A setting, the reduced system it is about, ready for its integrator, and how that is integrated."""

    setting: Setting
    prepared: Prepared
    settings: Settings


def _cases(setup: _Setup, clock: Clock) -> Iterator[_Case]:
    wanted = setup.job.config.study
    for count, residual_vectors in itertools.product(wanted.modes, wanted.residual_vectors):
        choice = ModeChoice(count=count, residual_vectors=residual_vectors, capped=True)
        with clock.stage("model", f"reducing to {count} modes a block, {residual_vectors} residual vectors"):
            system = reduce_scene(setup.scene, choice, setup.job.config.damping).system
        for integrator in wanted.integrators:
            prepared = prepare(setup.job, system, integrator)
            for step in setup.steps:
                settings = _settings(setup, prepared, step)
                finest = settings.steps.finest
                setting = Setting(integrator, finest, f"{count} modes", residual_vectors, system.size)
                yield _Case(setting, prepared, settings)


def _settings(setup: _Setup, prepared: Prepared, step: float) -> Settings:
    """Settings of the job at a finest step up to `step` that divides the compared interval."""
    steps = prepared.integrator.steps(min(step, setup.every), setup.motion.dt, setup.every)
    return replace(settings_for(setup.job, prepared, setup.motion), steps=steps)


def _measure(
    setup: _Setup, case: _Case, reference: Openings, reference_name: str, clock: Clock
) -> CaseResult:
    setting = case.setting
    ground = ground_at_steps(setup.motion, case.settings.steps.base, setup.duration, case.prepared.system)
    model = f"{setting.modes}, {setting.residual_vectors} residual vectors"
    text = f"{setting.integrator}, {model}, finest step {setting.finest_step:g} s"
    runs: list[History] = []
    try:
        with clock.stage("case", text) as progress:
            for _ in range(setup.job.config.study.repeats):
                runs.append(simulate_one(case.prepared, ground, case.settings, progress))
    except ConvergenceError as error:
        return failed_case(setting, str(error))
    history = runs[0]
    rows = history.time <= setup.compared * (1.0 + 1e-9)
    openings = Openings(history.time[rows], history.jump[rows, :, 0], setup.scene.gap_position)
    difference = compare_openings(openings, reference, ("the study", reference_name))
    return case_result(setting, runs, difference)


def _write(folder: Path, dataset: xr.Dataset) -> Study:
    from romdam.visual.plots import save_figure
    from romdam.visual.study_plots import study_figure

    table = study_table(dataset)
    paths = folder / "study.nc", folder / "study.md"
    write_dataset(dataset, paths[0])
    with replacing(paths[1]) as unfinished:
        unfinished.write_text(table)
    return Study(dataset, table, (*paths, save_figure(study_figure(dataset), folder / "study.png")))
