"""A study: the cost and the error of each setting of mesh, gaps, modes, residual vectors, integrator and
step.

The settings are all combinations of the values that the configuration lists. Each is run on the same record,
and its openings are compared with those of a reference: the same mesh with all its modes and a much smaller
step, its full order, or a finer mesh. The result is a table and a figure of error over cost, from which a
user chooses the cheapest setting that is accurate enough.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import xarray as xr

from romdam.config.coupling import couplings
from romdam.config.load import Job, Source, naming_lines
from romdam.config.study_meshes import MeshVariant, reference_meshes, studied_meshes
from romdam.core.errors import ConfigError, ConvergenceError, MeshError, ReductionError, placed
from romdam.core.files import prepare_folder, replacing
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.core.threads import cpu_time, one_thread
from romdam.effects.full_order import assemble_full
from romdam.error.comparison import ComparedRun, compare, compared_openings
from romdam.error.histories import read_reference
from romdam.error.study import CaseResult, Setting, case_result, failed_case, study_dataset, study_table
from romdam.pipelines.job_warnings import log_scene_warnings, log_warnings
from romdam.pipelines.jobs import load_config
from romdam.pipelines.moving_supports import refuse_drifting, scene_of
from romdam.pipelines.run import Clock, Stage, choose_mesh_and_modes, silent
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for, simulate_motion, source_step
from romdam.pipelines.sizes import refuse_lengths
from romdam.postprocess.stated_errors import percent
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ALL_MODES, ModeChoice, mode_choice
from romdam.reduction.synthesis import reduce_scene
from romdam.results.dataset import write_dataset
from romdam.timestepping.integrators.registry import FULL_ORDER
from romdam.timestepping.prepared import Prepared, Progress
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one

MOST_DENSE = 12_000  # free DOFs up to which all modes of the mesh are the reference
FINER = 16  # the reference's step is this part of the finest one studied
PARTS = (4, 8, 16, 32)  # of the record's step, the steps that are studied unless the configuration says
LIMIT_MODES = 100  # of a block in the reference on a finer mesh, at least; 60 leave 0.1 % with 20 vectors
LIMIT_VECTORS = 20  # residual vectors of it, at least
LIMIT_ACCURACY = 0.002  # of the steps of it, unless the configuration names the reference's step
MORE_MODES = 2  # times the most modes, or the highest cut-off, studied: what that reference has at least


@dataclass(frozen=True)
class Study:
    """Cost and error of all settings, and the files that hold them: study.nc, study.md and study.png."""

    dataset: xr.Dataset
    table: str
    paths: tuple[Path, ...]


@dataclass(frozen=True)
class _Mesh:
    """A mesh with its contact points, its scene, and the CPU time of building that [s]."""

    variant: MeshVariant
    scene: Scene
    cpu_seconds: float

    @property
    def job(self) -> Job:
        """The job on it."""
        return self.variant.job

    @property
    def unknowns(self) -> int:
        """Three for each node."""
        return sum(block.points.size for block in self.scene.blocks.values())


@dataclass(frozen=True)
class _Setup:
    """What all cases share.

    Attributes
    ----------
    meshes : those studied, the job's own first
    steps : finest steps studied [s]
    every : interval of the compared rows [s]
    """

    job: Job
    meshes: tuple[_Mesh, ...]
    motion: GroundMotion
    steps: tuple[float, ...]
    every: float

    @property
    def duration(self) -> float:
        """Length of the runs that are timed [s]."""
        return self.job.config.transient.duration or self.motion.duration

    @property
    def compared(self) -> float:
        """How much of them is compared with the reference, from the start [s]."""
        return min(self.job.config.study.duration, self.duration)

    @property
    def on_finer_mesh(self) -> bool:
        """Whether the reference is on a finer mesh: where meshes are studied or chosen for an accuracy."""
        study, total = self.job.config.study, self.job.config.transient.total_accuracy
        return study.varies_mesh or (total is not None and study.reference == "auto")


@one_thread()
@naming_lines
def study(job: Source, out: str | Path, reference: Path | None = None, show: Stage = silent) -> Study:
    """Run every setting of `study:` and the job's own on the first record, and set cost against error.

    Parameters
    ----------
    job : a configuration with model.order reduced, as `romdam.load_config` takes one
    out : folder for study.nc, study.md and study.png
    reference : an .npz to compare with instead of a run, see `romdam.error.histories.read_reference`
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
    meshes = tuple(_build_mesh(variant, clock) for variant in studied_meshes(job))
    job = log_scene_warnings(meshes[0].scene, job)
    steps = job.config.study.finest_steps or tuple(motion.dt / division for division in PARTS)
    setup = _Setup(job, meshes, motion, steps, job.config.outputs.output_interval or motion.dt)
    if stored is not None:
        compared, own_error = stored, dict[str, object]()
    else:
        compared, own_error = (_finer_reference if setup.on_finer_mesh else _reference)(setup, clock)
    cases = [_measure(setup, case, compared, clock) for case in _cases(setup, clock)]
    cases.append(_case_of_job(setup, compared, clock))
    about = own_error | {
        "record": motion.name,
        "compared": f"{motion.name}, {setup.compared:g} s of all openings against {compared.name}",
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
    for coupled in couplings(job.config):
        raise ConfigError(
            f"{job.path}: {coupled.key}: a study compares integrators of modes that nothing couples, and "
            f"{coupled.by} couple them; {coupled.remedy}"
        )
    if not job.config.every_joint:
        raise ConfigError(f"{job.path}: joints: there is none, and openings are what is compared; name one")
    studied_meshes(job)


def _build_mesh(variant: MeshVariant, clock: Clock) -> _Mesh:
    start = cpu_time()
    with clock.stage("scene", f"building the scene, mesh {variant.mesh}"):
        return _Mesh(variant, scene_of(variant.job), cpu_time() - start)


def _reference(setup: _Setup, clock: Clock) -> tuple[ComparedRun, dict[str, object]]:
    """The run that all are compared with, on the same mesh: all modes at a small step, or full order.

    Returns
    -------
    the run, and attributes that state its own error: none here, as the mesh is the same
    """
    wanted, dt = setup.job.config.study.reference, setup.job.config.study.reference_step
    scene = setup.meshes[0].scene
    unknowns = sum(int((~fixed).sum()) for fixed in scene.fixed.values())
    dense = wanted == "all_modes" or (wanted == "auto" and unknowns <= MOST_DENSE)
    with clock.stage("reference_model", "building the reference"):
        damping = setup.job.config.damping
        system = reduce_scene(scene, ALL_MODES, damping).system if dense else assemble_full(scene, damping)
    prepared = prepare(setup.job, system, None if dense else FULL_ORDER)
    settings = _settings(setup, prepared, dt or min(setup.steps) / FINER)
    steps = round(setup.compared / settings.steps.base)
    with clock.stage("reference", f"the reference, {steps} steps") as progress:
        history = _simulate(setup, prepared, settings, setup.compared, progress)
    name = f"all {system.size} modes" if dense else f"full order ({system.size} unknowns)"
    name = f"{name} at dt {settings.steps.finest:g} s"
    return replace(compared_openings(scene, history, {}, setup.compared), name=name), {}


def _finer_reference(setup: _Setup, clock: Clock) -> tuple[ComparedRun, dict[str, object]]:
    """The run that all are compared with, on quadratic elements of half the size, where meshes are studied.

    Its own error is that against a run on its coarser sibling.

    Returns
    -------
    the run, and attributes that state its own error
    """
    wanted, runs = setup.job.config.study, list[ComparedRun]()
    vectors = max(LIMIT_VECTORS, *wanted.residual_vectors)
    if wanted.counts:
        choice = ModeChoice(count=max(LIMIT_MODES, MORE_MODES * max(wanted.counts)), residual_vectors=vectors)
        modes = f"{choice.count} modes"
    else:
        choice = ModeChoice(cutoff=MORE_MODES * max(wanted.cutoffs or ()), residual_vectors=vectors)
        modes = f"modes below {choice.cutoff:g} Hz"
    for job, text in zip(reference_meshes(setup.job), ("the reference", "its error"), strict=True):
        with clock.stage("reference_model", f"reducing the mesh of {text}"), placed(job.path):
            scene = scene_of(job)
            system = reduce_scene(scene, choice, job.config.damping).system
        with clock.stage("reference", text) as progress:
            prepared = prepare(job, system, None)
            if wanted.reference_step is None:
                steps = {"accuracy": LIMIT_ACCURACY, "finest_step": None}
                transient = job.config.transient.model_copy(update=steps)
                accurate = replace(job, config=job.config.model_copy(update={"transient": transient}))
                history = simulate_motion(accurate, prepared, setup.motion, setup.compared, progress)
            else:
                settings = _settings(setup, prepared, wanted.reference_step)
                history = _simulate(setup, prepared, settings, setup.compared, progress)
        runs.append(compared_openings(scene, history, {}, setup.compared))
    fine, coarse = runs
    left = compare("reference of a study", coarse, fine).errors["opening"].l2
    about: dict[str, object] = {"reference_mesh_error": left}
    stated = f"its mesh leaves about {percent(left)}"
    if (of_steps := fine.stats.get("estimated_time_error")) is not None:
        about["reference_time_error"] = of_steps
        stated += f", its steps {percent(of_steps)}"
    gaps, step = len(fine.position), fine.stats["finest_step"]
    name = (
        f"a mesh of half the size (quadratic elements unless of a file, {gaps} gaps, {modes} and {vectors} "
        f"residual vectors a block, finest step {step:.3g} s) at the gaps that both have; {stated}"
    )
    return replace(fine, name=name), about


@dataclass(frozen=True)
class _Case:
    """A setting, the scene of its mesh, and a function that runs it once."""

    setting: Setting
    scene: Scene
    run: Callable[[Progress], History]


def _cases(setup: _Setup, clock: Clock) -> Iterator[_Case]:
    """Every combination of what `study:` lists; a mesh is reduced once for all its integrators and steps."""
    wanted = setup.job.config.study
    sizes: list[tuple[int | None, float | None]] = [(count, None) for count in wanted.counts]
    sizes += [(None, cutoff) for cutoff in wanted.cutoffs or ()]
    choices = [
        ModeChoice(*size, vectors) for size, vectors in itertools.product(sizes, wanted.residual_vectors)
    ]
    for mesh, choice in itertools.product(setup.meshes, choices):
        text = f"mesh {mesh.variant.mesh}: reducing to {_words(choice)} a block, {choice.residual_vectors}"
        system, model_cpu = _reduced(mesh, setup.job, choice, f"{text} residual vectors", clock)
        for integrator in wanted.integrators:
            prepared = prepare(mesh.job, system, integrator)
            for step in setup.steps:
                settings = _settings(setup, prepared, step)
                setting = _setting(mesh, prepared, choice, settings.steps.finest, model_cpu)
                run = partial(_simulate, setup, prepared, settings, setup.duration)
                yield _Case(setting, mesh.scene, run)


def _reduced(mesh: _Mesh, job: Job, choice: ModeChoice, text: str, clock: Clock) -> tuple[System, float]:
    """The reduced system of a mesh, and the CPU time of its scene and of reducing it [s]."""
    start = cpu_time()
    with clock.stage("model", text), placed(job.path):
        system = reduce_scene(mesh.scene, choice, job.config.damping).system
    return system, mesh.cpu_seconds + cpu_time() - start


def _words(choice: ModeChoice) -> str:
    if choice.cutoff is not None:
        return f"below {choice.cutoff:g} Hz"
    return "all modes" if choice.keeps_all else f"{choice.count} modes"


def _settings(setup: _Setup, prepared: Prepared, step: float) -> Settings:
    """Settings of the job at a finest step up to `step` that divides the compared interval."""
    dt = source_step(setup.motion, prepared.system)
    steps = prepared.integrator.steps(min(step, setup.every), dt, setup.every)
    return replace(settings_for(setup.job, prepared, setup.motion), steps=steps)


def _case_of_job(setup: _Setup, reference: ComparedRun, clock: Clock) -> CaseResult:
    """What the job's own setting gives, or the one that its accuracy comes to: mesh, modes and steps."""
    setting = Setting("", math.nan, "", 0, 0, of_job=True)
    try:
        job, choice = choose_mesh_and_modes(setup.job, [setup.motion], clock)
        variant = MeshVariant("as given" if choice is None else choice.name, "as given", job)
        studied = (mesh for mesh in setup.meshes if replace(mesh.variant, job=job) == variant)
        mesh = next(studied, None) or _build_mesh(variant, clock)
        modes = mode_choice(job.config.model)
        system, model_cpu = _reduced(mesh, job, modes, "reducing the job's own model", clock)
        prepared = prepare(job, system)
        setting = replace(_setting(mesh, prepared, modes, math.nan, model_cpu), of_job=True)
        finest = settings_for(job, prepared, setup.motion).steps.finest
        setting = replace(setting, finest_step=finest)
        run = partial(simulate_motion, job, prepared, setup.motion, setup.duration)
    except (ConfigError, MeshError, ReductionError, ConvergenceError) as error:
        return failed_case(setting, str(error))
    return _measure(setup, _Case(setting, mesh.scene, run), reference, clock)


def _setting(
    mesh: _Mesh, prepared: Prepared, choice: ModeChoice, finest_step: float, model_cpu: float
) -> Setting:
    return Setting(
        integrator=prepared.integrator.name,
        finest_step=finest_step,
        modes=_words(choice),
        residual_vectors=choice.residual_vectors,
        unknowns=prepared.system.size,
        mesh=mesh.variant.mesh,
        contact_points=mesh.variant.contact_points,
        gaps=len(mesh.scene.gap_position),
        mesh_unknowns=mesh.unknowns,
        model_cpu_seconds=model_cpu,
    )


def _simulate(
    setup: _Setup, prepared: Prepared, settings: Settings, seconds: float, progress: Progress
) -> History:
    ground = ground_at_steps(setup.motion, settings.steps.base, seconds, prepared.system)
    return simulate_one(prepared, ground, settings, progress)


def _measure(setup: _Setup, case: _Case, reference: ComparedRun, clock: Clock) -> CaseResult:
    """Run a case as often as `study.repeats` says, for its time, and compare the first run."""
    setting = case.setting
    model = f"mesh {setting.mesh}, {setting.modes}, {setting.residual_vectors} residual vectors"
    text = f"{setting.integrator}, {model}, finest step {setting.finest_step:g} s"
    runs: list[History] = []
    try:
        with clock.stage("case", text) as progress:
            for _ in range(setup.job.config.study.repeats):
                runs.append(case.run(progress))
    except ConvergenceError as error:
        return failed_case(setting, str(error))
    run = compared_openings(case.scene, runs[0], {}, setup.compared)
    same_mesh = not setup.on_finer_mesh and setting.mesh == setup.meshes[0].variant.mesh
    differences = compare("study" if same_mesh else "study of meshes", run, reference)
    return case_result(setting, runs, differences)


def _write(folder: Path, dataset: xr.Dataset) -> Study:
    from romdam.visual.plots import save_figure
    from romdam.visual.study_plots import study_figure

    table = study_table(dataset)
    paths = folder / "study.nc", folder / "study.md"
    write_dataset(dataset, paths[0])
    with replacing(paths[1]) as unfinished:
        unfinished.write_text(table)
    return Study(dataset, table, (*paths, save_figure(study_figure(dataset), folder / "study.png")))
