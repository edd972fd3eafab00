"""The cost and the error of each setting of modes, corrections, integrator and step."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr

from romdam.config.load import Job
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.files import prepare_folder, replacing
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.error.comparison import Openings, compare_openings, read_reference
from romdam.error.study import CaseResult, Setting, case_result, failed_case, study_dataset, study_table
from romdam.fem.unreduced import assemble_full
from romdam.pipelines.doubts import tell_doubts
from romdam.pipelines.run import Clock, Stage, silent
from romdam.pipelines.shaking import choose_integrator, fixed_step, ground_at_steps, transient_options
from romdam.pipelines.sizes import refuse_lengths
from romdam.records.record_set import load_motions
from romdam.reduction.methods.craig_bampton import ALL_MODES, ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.results.dataset import write_dataset
from romdam.scene.build import build_scene
from romdam.timestepping.options import TransientOptions
from romdam.timestepping.simulate import integrate
from romdam.timestepping.step_control import dividing_step, refined_step

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


def study(job: Job, out: str | Path, reference: Path | None = None, show: Stage = silent) -> Study:
    """Run every setting of `study:` on the first record, and set cost against error.

    Parameters
    ----------
    job : a configuration with model.order reduced
    out : folder for study.nc, study.md and study.png
    reference : an .npz to compare with instead of a run, see `romdam.error.comparison.read_reference`
    show : told of every stage and its progress

    Raises
    ------
    RomdamError
        for bad input, a scene without joints, and a reference that does not converge.
    """
    _refuse(job)
    folder, clock = prepare_folder(Path(out)), Clock(show)
    stored = read_reference(reference) if reference else None
    motion = load_motions(job.config.records, job.folder)[0]
    refuse_lengths(job, [motion])
    tell_doubts(job, [motion])
    scene = build_scene(job.config, job.folder, str(job.path))
    steps = job.config.study.dt or tuple(motion.dt / count for count in PARTS)
    setup = _Setup(job, scene, motion, steps, job.config.outputs.every or motion.dt)
    if stored is None:
        stored, name = _reference(setup, clock)
    else:
        name = str(reference)
    cases = [_measure(setup, case, (stored, name), clock) for case in _cases(setup, clock)]
    about = {
        "record": motion.name,
        "compared": f"{motion.name}, {setup.compared:g} s of all openings against {name}",
        "timed_seconds": setup.duration,
        "repeats": job.config.study.repeats,
    }
    return _write(folder, study_dataset(cases, job, about))


def _refuse(job: Job) -> None:
    if job.config.model.order == "full":
        raise ConfigError(
            f"{job.path}: model.order is full, a study is about reduced models; set it to reduced"
        )
    if not job.config.every_joint:
        raise ConfigError(f"{job.path}: joints: there is none, and openings are what is compared; name one")


def _reference(setup: _Setup, clock: Clock) -> tuple[Openings, str]:
    """The run that all are compared with: all modes of the mesh at a small step, or full order."""
    wanted, dt = setup.job.config.study.reference, setup.job.config.study.reference_dt
    step = dividing_step(setup.every, dt or min(setup.steps) / FINER)
    unknowns = sum(int((~fixed).sum()) for fixed in setup.scene.fixed.values())
    dense = wanted == "all_modes" or (wanted == "auto" and unknowns <= MOST_DENSE)
    with clock.stage("reference_model", "building the reference"):
        damping = setup.job.config.damping
        system = (
            reduce_scene(setup.scene, ALL_MODES, damping).system
            if dense
            else assemble_full(setup.scene, damping)
        )
    integrator = choose_integrator(setup.job, system) if dense else "generalized_alpha"
    options = _stepped(setup, system, integrator, step)
    ground = ground_at_steps(setup.motion, options.dt, setup.compared)
    with clock.stage("reference", f"the reference, {ground.shape[1] - 1} steps") as progress:
        history = integrate(system, ground, options, progress)
    name = f"all {system.size} modes" if dense else f"full order ({system.size} unknowns)"
    return Openings(history.time, history.jump[..., 0], setup.scene.gap_position), f"{name} at dt {step:g} s"


@dataclass(frozen=True)
class _Case:
    """A setting, the reduced system it is about, and how that is integrated."""

    setting: Setting
    system: System
    options: TransientOptions


def _cases(setup: _Setup, clock: Clock) -> Iterator[_Case]:
    wanted = setup.job.config.study
    for count, corrections in itertools.product(wanted.modes, wanted.corrections):
        choice = ModeChoice(count=count, corrections=corrections, capped=True)
        with clock.stage("model", f"reducing to {count} modes a block, {corrections} corrections"):
            system = reduce_scene(setup.scene, choice, setup.job.config.damping).system
        for integrator, dt in itertools.product(wanted.integrators, setup.steps):
            options = _stepped(setup, system, integrator, dt)
            finest = options.dt / math.prod(options.cuts)
            setting = Setting(integrator, finest, f"{count} modes", corrections, system.size)
            yield _Case(setting, system, options)


def _stepped(setup: _Setup, system: System, integrator: str, dt: float) -> TransientOptions:
    options, step = transient_options(setup.job, system, setup.motion), dividing_step(setup.every, dt)
    if integrator != "adaptive":
        return fixed_step(options, step, setup.every, integrator)
    base, cuts = refined_step(step, setup.motion.dt, setup.every)
    return replace(options, dt=base, cuts=cuts, stride=round(setup.every / base), integrator=integrator)


def _measure(setup: _Setup, case: _Case, reference: tuple[Openings, str], clock: Clock) -> CaseResult:
    one, options = case.setting, case.options
    ground = ground_at_steps(setup.motion, options.dt, setup.duration)
    text = f"{one.integrator}, {one.modes}, {one.corrections} corrections, finest step {one.finest_step:g} s"
    runs: list[History] = []
    try:
        with clock.stage("case", text) as progress:
            for _ in range(setup.job.config.study.repeats):
                runs.append(integrate(case.system, ground, options, progress))
    except ConvergenceError as error:
        return failed_case(one, str(error))
    history = runs[0]
    rows = history.time <= setup.compared * (1.0 + 1e-9)
    own = Openings(history.time[rows], history.jump[rows, :, 0], setup.scene.gap_position)
    return case_result(one, runs, compare_openings(own, reference[0], ("the study", reference[1])))


def _write(folder: Path, dataset: xr.Dataset) -> Study:
    from romdam.visual.plots import save_figure
    from romdam.visual.study_plots import study_figure

    table = study_table(dataset)
    paths = folder / "study.nc", folder / "study.md"
    write_dataset(dataset, paths[0])
    with replacing(paths[1]) as unfinished:
        unfinished.write_text(table)
    return Study(dataset, table, (*paths, save_figure(study_figure(dataset), folder / "study.png")))
