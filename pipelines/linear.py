"""The linear stage of a job: response spectra and linear time histories with all joints tied."""

from __future__ import annotations

import json
import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import xarray as xr

from romdam.config.linear_stage import hysteretic_ratios, refuse_linear_stage
from romdam.config.load import Job, Source, naming_lines, with_lines
from romdam.config.other_mesh import with_spacing
from romdam.config.sections.job import DampingConfig, RayleighConfig
from romdam.config.sections.linear_stage import LinearStageConfig
from romdam.core.errors import ConfigError, placed
from romdam.core.files import prepare_folder
from romdam.core.motion import GroundMotion
from romdam.core.scene import Block, Scene
from romdam.core.threads import one_thread
from romdam.core.version import SOURCE
from romdam.effects.added_mass import added_mass
from romdam.fem.damping import damping_coupling
from romdam.fem.stress import stress_operators
from romdam.pipelines.input_motions import records_of
from romdam.pipelines.job_warnings import log_warnings, with_scene_warnings
from romdam.pipelines.jobs import load_config
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.run import Clock, Goal, Stage, draw, run_motion, silent, usable_motions, write_shared
from romdam.pipelines.simulation import RunModel, as_run, prepare
from romdam.pipelines.stresses import stress_fields
from romdam.postprocess.response_spectrum import (
    Spectrum,
    modal_peaks,
    periods_of,
    spectrum_given,
    spectrum_of_motion,
)
from romdam.postprocess.stages import STAGES, stage_table
from romdam.postprocess.variant_tables import VariantTable
from romdam.records.design.target import evaluate
from romdam.reduction.natural_modes import total_mass
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.staging import initial_forces, initial_stress
from romdam.reduction.storage.user_cache import open_store
from romdam.reduction.synthesis import reduce_scene
from romdam.results.dataset import job_labels, library_versions, record_labels, write_dataset
from romdam.results.joint_traction import joint_sites
from romdam.results.response_spectrum import SpectrumModel, spectrum_dataset, structure_of, tension_over_time
from romdam.results.stress.file import StressFields
from romdam.results.table import write_csv
from romdam.scene.ties import tie_joints
from romdam.scene.varied import block_materials

log = logging.getLogger(__name__)

FOLDER = "linear"  # of the results, beside those of the nonlinear runs


@dataclass(frozen=True)
class LinearModel:
    """A job with all joints tied.

    Attributes
    ----------
    job : with the basis, the outputs and the warnings of the linear stage
    stage : its keys, or their defaults
    scene : with its joints
    model : with the joints tied, and the stress of its modes
    structure : what responses are computed from
    """

    job: Job
    stage: LinearStageConfig
    scene: Scene
    model: RunModel
    structure: SpectrumModel


@dataclass(frozen=True)
class LinearStage:
    """The linear stage of one record.

    Attributes
    ----------
    spectrum : of the response-spectrum analysis
    history : result of the linear time history
    paths : files that were written
    """

    spectrum: xr.Dataset
    history: xr.Dataset
    paths: tuple[Path, ...]


@dataclass(frozen=True)
class LinearOutcome:
    """The linear stages of all records, their tables, the files, and record -> why it could not be read."""

    stages: dict[str, LinearStage]
    tables: tuple[VariantTable, ...]
    paths: tuple[Path, ...]
    failures: dict[str, str]


@one_thread()
@naming_lines
def linear(job: Source, out: str | Path, show: Stage = silent, cache: Path | None = None) -> LinearOutcome:
    """Make the linear stage of a job without its nonlinear runs; all lands in `out`/linear.

    Parameters
    ----------
    job : as `romdam.load_config` takes one; without `linear_stage` its defaults count
    out : folder, made if needed
    show : told of every stage
    cache : folder of reduced blocks

    Raises
    ------
    RomdamError
        for bad input, and for what a linear stage cannot be made of.
    """
    job, clock, store = load_config(job), Clock(show), open_store(cache)
    refuse_unfit(job)
    folder = prepare_folder(Path(out))
    with clock.stage("records", "reading records"):
        read = records_of(job, folder)
    motions = usable_motions(job, read, summarised=False)
    log_warnings(job, motions)
    job = with_spacing(job)
    with clock.stage("scene", "building the scene"):
        scene = scene_of(job)
    model = build_linear_model(job, scene, clock, store)
    stages = linear_stages(model, motions, folder, clock, said=())
    tables, paths = write_stages(stages, {}, folder)
    every = [path for stage in stages.values() for path in stage.paths]
    failures = {name: message for name, message in read.items() if isinstance(message, str)}
    return LinearOutcome(stages, tuple(tables), (*every, *paths), failures)


def linear_stages(
    model: LinearModel, motions: Sequence[GroundMotion], folder: Path, clock: Clock, said: Collection[str]
) -> dict[str, LinearStage]:
    """Make the linear stage of every record, by its name.

    Parameters
    ----------
    said : warnings about the scene that the caller has logged; the others are logged here
    """
    for line in with_lines(model.job, (text for text in model.job.scene_warnings if text not in said)):
        log.warning("%s", line)
    return {motion.name: linear_stage(model, motion, folder, clock) for motion in motions}


def check_linear_stage(
    job: Job, scene: Scene, motions: Sequence[GroundMotion], clock: Clock, store: BlockStore | None
) -> tuple[str, ...]:
    """Refuse what the linear stage of a run would, short of its time histories; return its warnings.

    Parameters
    ----------
    scene : of the job

    Raises
    ------
    RomdamError
    """
    model = build_linear_model(job, scene, clock, store)
    for motion in motions[:1] if model.stage.spectra is not None else motions:
        spectrum_at_modes(model, motion)
    return model.job.scene_warnings


def refuse_unfit(job: Job) -> None:
    """Refuse a job of which no linear stage can be made.

    Raises
    ------
    ConfigError
    """
    try:
        refuse_linear_stage(job.config)
    except ValueError as error:
        raise ConfigError(f"{job.path}: {error}") from None


def build_linear_model(job: Job, scene: Scene, clock: Clock, store: BlockStore | None) -> LinearModel:
    """Tie the joints of a job and reduce what is then one structure, with all modes below the cut-off.

    Parameters
    ----------
    scene : of the job, with its joints

    Raises
    ------
    RomdamError
        where joints cannot be tied, and where the structure moves as a rigid body or its modes are coupled.
    """
    stage = job.config.linear_stage or LinearStageConfig()
    with clock.stage("linear_scene", "tying the joints"), placed(job.path):
        tied = tie_joints(scene, list(scene.joints), job.config.every_joint, str(job.path))
    remarks = _remarks(job, scene)
    job = with_scene_warnings(tied, _linear_job(job, stage))
    job = replace(job, scene_warnings=(*remarks, *job.scene_warnings))
    with clock.stage("linear_model", "reducing the dam with tied joints"), placed(job.path):
        hysteretic = stage.damping == "hysteretic"
        damped, damping = _as_hysteretic(tied, job) if hysteretic else (tied, job.config.damping)
        reduced = reduce_scene(damped, job.config.model, damping, store)
        system = reduced.system
        if not system.K.diagonal().min() > 0.0:
            raise ConfigError(
                f"{job.path}: linear_stage: the structure with tied joints moves as a rigid body, and a "
                "response spectrum needs modes with a frequency each; hold it by supports"
            )
        if not system.diagonal:
            share = damping_coupling(system.C.toarray())
            coupled = (
                f"linear_stage: damping couples modes, by up to {share:.2g} of their own: the time "
                "history has all of it, and the response spectrum the effective ratios phi^T C phi / "
                "(2 omega phi^T M phi)"
            )
            job = replace(job, scene_warnings=(*job.scene_warnings, coupled))
        prepared = prepare(job, system.as_hysteretic if hysteretic else system)
    with clock.stage("linear_stress", "stress of the modes, joints tied"):
        model = RunModel(tied, prepared, reduced)
        fields = _stress(scene, model)
        model = replace(model, stress=fields)
        at_joints = None
        if scene.joints:
            sites = joint_sites(scene)
            at_joints = _stress(
                replace(scene, stress=sites), RunModel(replace(tied, stress=sites), prepared, reduced)
            )
        structure = structure_of(scene, prepared.system, fields, at_joints, job.config.loads.begins)
    return LinearModel(job, stage, scene, model, structure)


def _as_hysteretic(scene: Scene, job: Job) -> tuple[Scene, DampingConfig]:
    """The scene and its damping whose matrix C is K_h = sum_b 2 xi_b K_b, for the ratios of a job."""
    every, of_materials = hysteretic_ratios(job.config)
    materials, blocks = block_materials(job.config), dict[str, Block]()
    for name, block in scene.blocks.items():
        ratio = of_materials.get(materials[name])
        blocks[name] = replace(
            block, material=replace(block.material, damping=None if ratio is None else (0.0, 2.0 * ratio))
        )
    return replace(scene, blocks=blocks), DampingConfig(rayleigh=RayleighConfig(alpha=0.0, beta=2.0 * every))


def _stress(scene: Scene, model: RunModel) -> dict[str, StressFields]:
    """Stress of the modes; what acted before the joints were grouted acted on the blocks of `scene` alone."""
    fields = stress_fields(model.scene, model.reduced_at_rest)
    if not scene.loads.staged_weight:
        return fields
    if scene.sustained_ratios:
        raise ConfigError(
            "linear_stage: with materials.<name>.E_dynamic no stress of loads.weight: staged is known to it; "
            "leave out one of the three"
        )
    stress, forces = initial_stress(scene, stress_operators(scene)), initial_forces(scene)
    return {
        name: replace(one, offset=stress[name], section_offset=forces[name]) for name, one in fields.items()
    }


def _linear_job(job: Job, stage: LinearStageConfig) -> Job:
    """The job with the basis of its linear stage, and without what states errors of joints."""
    model = job.config.model.model_copy(update={"modes": None, "cutoff": stage.cutoff, "residual_vectors": 0})
    outputs = job.config.outputs.model_copy(
        update={"error_estimate": False, "mesh_error": False, "floor_spectra": None}
    )
    title = f"{job.config.title or job.stem}, linear, joints tied"
    changed = {"model": model, "outputs": outputs, "title": title}
    return replace(job, config=job.config.model_copy(update=changed))


def _remarks(job: Job, scene: Scene) -> list[str]:
    """What tied joints leave out of a job."""
    remarks, joints = [], scene.joints.values()
    if (wide := max((float(joint.gap.max()) for joint in joints), default=0.0)) > 0.0:
        remarks.append(
            f"linear_stage: initial gaps of up to {1e3 * wide:.3g} mm are taken as closed and glued"
        )
    if any(joint.water.any() or joint.uplift is not None for joint in joints):
        remarks.append(
            "loads.joint_water: presses both faces of a tied joint alike, so that it does nothing in the "
            "linear stage; its stress is total, that of pores not taken off"
        )
    if any(joint.grout.any() for joint in joints):
        remarks.append("linear_stage: the pressure of grouting is left out, as tied joints have no gaps")
    if isinstance(job.config.damping.modal, tuple):
        remarks.append(
            "damping.modal: its ratios are those of the modes with tied joints in the linear stage, in order"
        )
    return remarks


def spectrum_at_modes(linear: LinearModel, motion: GroundMotion) -> tuple[Spectrum, list[str]]:
    """The spectrum at the modes below the cut-off, and what is doubtful about it.

    Raises
    ------
    ConfigError
        for a spectrum that does not reach over the modes, and for modes that are damped critically.
    """
    system, stage, job = linear.model.system, linear.stage, linear.job
    with placed(job.path):
        if stage.spectra is None:
            return spectrum_of_motion(system, as_run(job, motion), stage.cutoff), []
        periods, ordinates = periods_of(system, stage.cutoff), {}
        for axis, one in stage.spectra.by_axis.items():
            ordinates[axis] = evaluate(
                one,
                periods,
                stage.spectra.damping,
                job.folder,
                f"linear_stage.spectra.{axis}",
                "the modes and linear_stage.cutoff",
                "give the spectrum over all of these, or lower linear_stage.cutoff",
            )
        return spectrum_given(system, stage.cutoff, ordinates, stage.spectra.damping)


def linear_stage(linear: LinearModel, motion: GroundMotion, folder: Path, clock: Clock) -> LinearStage:
    """Make the response-spectrum analysis and the linear time history of one record.

    Parameters
    ----------
    folder : of the results; all lands in `FOLDER` in it
    """
    place, job = prepare_folder(folder / FOLDER), linear.job
    goal = Goal(place, job.config.outputs.plots, summary=False, rock=job.config.outputs.rock)
    files = write_shared(place, linear.model, rock=goal.rock)
    finished = run_motion(job, linear.model, motion, (goal, lambda: (linear.model, files)), clock)
    with clock.stage("response_spectrum", f"response spectrum of {motion.name}"):
        spectrum, warnings = spectrum_at_modes(linear, motion)
        load, stiffness = linear.model.system.load, linear.model.system.K.diagonal()
        rules = linear.stage.combination, linear.stage.directions
        peaks = modal_peaks(load, stiffness, spectrum, *rules)
        tied = linear.model.scene
        dataset = spectrum_dataset(linear.structure, spectrum, peaks, total_mass(tied, added_mass(tied)))
        assert finished.case.history.q is not None
        of_history = tension_over_time(linear.structure, finished.case.history.q)
        dataset = dataset.merge(of_history, combine_attrs="drop_conflicts")
        dataset.attrs |= job_labels(job) | record_labels(motion)
        dataset.attrs |= {
            "source": SOURCE,
            "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
            "versions": library_versions(),
            "joints": "tied",
            "combination": linear.stage.combination,
            "directions": linear.stage.directions,
            "cutoff_hz": linear.stage.cutoff,
            "damping": linear.stage.damping,
            "spectrum": "of the record at each mode's damping" if linear.stage.spectra is None else "given",
            "run_warnings": json.dumps(warnings),
        }
        path = place / f"{motion.name}-spectrum.nc"
        write_dataset(dataset, path)
    for warning in warnings:
        log.warning("%s: %s", motion.name, warning)
    if goal.figures:
        with clock.stage("plots", "drawing figures"):
            draw(finished.dataset, place, finished.path.stem)
    return LinearStage(dataset, finished.dataset, (finished.path, path))


def write_stages(
    stages: Mapping[str, LinearStage], nonlinear: Mapping[str, xr.Dataset], folder: Path
) -> tuple[list[VariantTable], list[Path]]:
    """Write a table for each record: the response spectrum, the linear history, and the nonlinear run."""
    tables, paths = [], []
    for record, stage in stages.items():
        table = stage_table(record, stage.spectrum, stage.history, nonlinear.get(record))
        tables.append(table)
        paths.append(write_csv(table.head, table.rows, folder / FOLDER / f"{record}-{STAGES}.csv"))
    return tables, paths
