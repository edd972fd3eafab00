"""The size and cost of a job; of its records no more than short parts are integrated."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from romdam.config.load import Job, Source, located, naming_lines
from romdam.config.other_mesh import with_spacing
from romdam.core.errors import ConvergenceError, Faults, RecordError, RomdamError, placed
from romdam.core.motion import GroundMotion, MovingSupports
from romdam.core.scene import Scene
from romdam.core.system import System
from romdam.core.threads import one_thread
from romdam.fem.balance import load_resultants
from romdam.linalg.solvers import without_factors
from romdam.pipelines.automatic_mesh import with_accuracy
from romdam.pipelines.automatic_modes import FIRST, refuse_unjudged, with_modes, with_vectors
from romdam.pipelines.automatic_spacing import automatic_joints
from romdam.pipelines.combinations import combination_jobs
from romdam.pipelines.cost import COSTS, fixed_costs, run_costs
from romdam.pipelines.error.comparison import comparable_variants
from romdam.pipelines.error.sibling import Sibling
from romdam.pipelines.error.study import refuse_study
from romdam.pipelines.job_warnings import job_warnings, with_scene_warnings
from romdam.pipelines.jobs import load_config
from romdam.pipelines.linear import check_linear_stage
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.run import (
    Clock,
    Stage,
    build_model,
    build_sibling,
    reduced_model,
    silent,
    usable_motions,
)
from romdam.pipelines.simulation import RunModel, refuse_large, settings_for, with_odd_values
from romdam.pipelines.sizes import run_bytes
from romdam.pipelines.stability import job_after
from romdam.pipelines.suites.mesh_error import runs_stated
from romdam.pipelines.suites.plan import Plan, make_plan
from romdam.pipelines.suites.sizes import results_bytes, summary_bytes
from romdam.pipelines.summary import refuse_summary
from romdam.records.processing.sequence import members_of, sequence_text
from romdam.records.record_set import load_motions
from romdam.reduction.closed_joints import MOST, closed_frequencies
from romdam.reduction.mode_choice import mode_choice
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.user_cache import open_store
from romdam.scene.found import extents_of_bodies
from romdam.scene.ties import scene_parts
from romdam.timestepping.equilibrium import initial_state
from romdam.timestepping.simulate import refuse_other_start

_CLOSED = 5  # frequencies with closed joints that are told
_SAMPLES = 300  # of a suite that are built; the others are estimated
_LIBRARIES = 250e6  # bytes of memory that they take

# Measured on one core of a 2-core x86-64 machine; good to a factor of three
SECONDS_PER_PRODUCT = 2.5e-10  # one multiply-add of G q, G^T p or H p, memory-bound
SECONDS_PER_FULL_UNKNOWN = 5e-7  # one back-substitution and the residual, per step


@dataclass(frozen=True)
class CheckedJob:
    """Sizes, frequencies and estimates.

    Attributes
    ----------
    blocks : name -> plain numbers (element, nodes, cells, modes, lowest frequencies as reduced, open [Hz])
    joints : name -> plain numbers (gaps, area [m2], friction, resultant of its water [N])
    records : name -> plain numbers (dt [s], duration [s], peak [m/s2], steps, sequence of records)
    unknowns : of the system that would be integrated
    costs : CPU seconds of `romdam run`, see `romdam.pipelines.cost.COSTS`; empty where unknown
    memory, file_size : estimates for all records [bytes]
    warnings : of what keys and records say and hardly can mean
    closed_frequencies : the lowest of the reduced model, every gap closed [Hz]; empty where not computed
    ties : name -> plain numbers (blocks, nodes, discretization, largest distance of the faces [m])
    solvers : sentences on parts that are solved by multigrid, as factors do not fit
    skipped : what a run looks at and this does not
    supports : name of each motion that supports have besides the base's -> plain numbers (where a station is
        [m], delay [s], factor, record)
    bodies : where the blocks are that `mesh.bodies` makes, in words
    loads : kind of load at rest -> components of its resultant on all blocks (x, y, z) [N]
    quick : whether nothing was reduced: `unknowns` are those of the mesh, and memory and file_size NaN
    """

    blocks: dict[str, dict[str, object]]
    joints: dict[str, dict[str, object]]
    records: dict[str, dict[str, object]]
    unknowns: int
    costs: dict[str, float]
    memory: float
    file_size: float
    warnings: tuple[str, ...]
    closed_frequencies: tuple[float, ...]
    ties: dict[str, dict[str, object]]
    solvers: tuple[str, ...]
    skipped: tuple[str, ...]
    supports: dict[str, dict[str, object]] = field(default_factory=dict)
    bodies: tuple[str, ...] = ()
    loads: dict[str, dict[str, float]] = field(default_factory=dict)
    quick: bool = False

    @property
    def seconds(self) -> float:
        """CPU time of `romdam run`; what a check with a cache reduced is found there. NaN where unknown."""
        return sum(self.costs.values()) if self.costs else math.nan


@one_thread()
@naming_lines
def check(job: Source, show: Stage = silent, cache: Path | None = None, *, quick: bool = False) -> CheckedJob:
    """Validate a job as far as can be without integrating it.

    Parameters
    ----------
    job : as `romdam.load_config` takes one
    cache : folder of reduced blocks, as of `romdam.run`, which then finds them
    quick : reduce nothing: keys, records, meshes, joints and loads are checked, and no time is estimated

    Raises
    ------
    RomdamError
        for everything `romdam.run` would refuse before its first step. Of a comparison, as it goes on without
        a variant that fails, that of the reference; those of others are warnings.
    """
    job, clock = load_config(job), Clock(show)
    if "study" in job.config.model_fields_set:
        refuse_study(job)
    if job.config.post_earthquake is not None:
        job_after(job, job.config.post_earthquake, {"loads.initial_state": "static"})
    combination_jobs(job)
    if job.config.pipeline != "comparison":
        return _check(job, clock, open_store(cache), quick=quick)
    asked, variants = comparable_variants(job)
    checks, failed = dict[str, CheckedJob](), list[str]()
    for name, variant in variants.items():
        try:
            checks[name] = _check(variant, clock, open_store(cache), quick=quick)
        except RomdamError as error:
            if name == asked.against:
                raise
            failed.append(f"{name}: {error}")
    each = checks.values()
    known = all(checked_job.costs for checked_job in each)

    def total(name: str) -> float:
        return (max if name == "start" else sum)(checked_job.costs[name] for checked_job in each)

    return replace(
        checks[asked.against],
        costs={name: total(name) for name in COSTS} if known else {},
        memory=max(checked_job.memory for checked_job in each),
        file_size=sum(checked_job.file_size for checked_job in each),
        warnings=tuple(
            dict.fromkeys([*failed, *(text for checked_job in each for text in checked_job.warnings)])
        ),
        skipped=(
            *(text for text in dict.fromkeys(text for checked_job in each for text in checked_job.skipped)),
            f"blocks and joints of other variants than {asked.against!r} are checked and not listed",
        ),
    )


@naming_lines
def _check(job: Job, clock: Clock, store: BlockStore | None, *, quick: bool) -> CheckedJob:
    """A job with one model."""
    asked, plan, sibling = job, None, None
    if job.config.transient.total_accuracy is not None:
        job = with_accuracy(job, job.config.transient.step_accuracy)
    if job.config.model.modes == "auto":
        refuse_unjudged(job)
        job = with_modes(with_vectors(job), FIRST)
    job = with_spacing(job)
    if job.config.pipeline == "suite":
        refuse_summary(job, None)
        plan = make_plan(job, clock, most=1 if quick else _SAMPLES)
        if failed := [f"{record.name}: {record.message}" for record in plan.records if record.message]:
            raise RecordError("\n".join(failed))
        job, scene, motions = plan.job, plan.scene, list(plan.motions.values())
        if quick:
            return _described(job, scene, motions)
        with clock.stage("model", "reducing the blocks"), placed(job.path):
            model = reduced_model(job, plan.scene, store, estimated=True, also=plan.samples.also)
        if plan.mesh_statement is None:
            sibling = build_sibling(job, scene, clock, store)
    else:
        scene, motions = _scene_and_motions(job, clock)
        job = with_scene_warnings(scene, job)
        if quick:
            return _described(job, scene, motions)
        if job.config.linear_stage is not None:
            of_linear = check_linear_stage(job, scene, motions, clock, store)
            job = replace(job, scene_warnings=tuple(dict.fromkeys((*job.scene_warnings, *of_linear))))
        model = build_model(job, clock, store, estimated=True, scene=scene)
        sibling = build_sibling(job, scene, clock, store)
    settings = settings_for(job, model.prepared, motions[0])
    duration, steps = job.config.transient.duration, dict[str, int]()
    for motion in motions:
        seconds = motion.duration if duration is None else duration
        steps[motion.name] = int(seconds / settings.steps.base + 1e-6)
        refuse_large(job, [(model.prepared, motion, settings)], duration)
    with clock.stage("rest", "equilibrium at rest"), placed(job.path):
        model.prepared.integrator.supports(model.system)
        if model.prepared.goes_on_from is not None:
            refuse_other_start(model.prepared.goes_on_from, [model.prepared])
        elif model.reduced is not None:
            try:
                initial_state(model.prepared, settings)
            except ConvergenceError as error:
                raise with_odd_values(job, error) from None
    runs = len(motions) if plan is None else plan.count
    each = max(1, runs // len(motions))
    total, system = sum(steps.values()) * each, model.system
    if model.reduced is None:
        closed: tuple[float, ...] = ()
        costs = {"integration": total * full_order_seconds(system)}
        coordinates, basis = 0, 0
    else:
        closed = tuple(closed_frequencies(system, _CLOSED).tolist())
        with clock.stage("cost", "running short parts for their time"):
            stated = None if plan is None else len(runs_stated(plan)) if isinstance(sibling, Sibling) else 0
            costs = run_costs(job, model, motions, each, sibling, stated)
        coordinates = system.size
        basis = sum(block.vectors.nbytes for block in model.reduced.basis.values())
    # bytes of a written row: jump, force and state of every gap, three motions, coordinates
    row = 8.0 * (2 * system.B.shape[0] + len(system.law) / 8 + 3 * system.observe.shape[0] + coordinates + 12)
    # memory of the longest run, basis, operators, and the libraries
    most, stride = max(steps.values()), settings.steps.stride
    operators = 8.0 * (system.B.nnz * 2 + float(system.B.shape[0]) ** 2 * 2)
    file_size = row * (total // stride + 1)
    memory = _LIBRARIES + run_bytes(system, most, most / stride + 1) + 2.0 * basis + operators
    if plan is not None:
        file_size = results_bytes(job, scene, system, motions, each)
        memory += summary_bytes(scene, runs)
        clock.cpu["samples"] *= runs / len(plan.first)
    if costs:
        costs |= fixed_costs(job, len(motions), runs, len(scene.joints), file_size, clock.cpu)
        if store is None:  # else a run finds the reduced blocks
            costs["reduction"] = clock.cpu["model"] + clock.cpu.get("mesh_model", 0.0)
        costs = {name: costs.get(name, 0.0) for name in COSTS}
    described = _described(job, model.scene, motions, steps)
    return replace(
        described,
        blocks={name: _block(numbers, model, name) for name, numbers in described.blocks.items()},
        unknowns=system.size,
        costs=costs,
        memory=memory,
        file_size=file_size,
        closed_frequencies=closed,
        solvers=tuple(filter(None, _solvers(job, model))),
        skipped=tuple(_skipped(asked, model, plan, bool(closed), bool(costs))),
        quick=False,
    )


def _scene_and_motions(job: Job, clock: Clock) -> tuple[Scene, list[GroundMotion]]:
    """The scene and the records of a job; what is wrong with either is told together.

    Raises
    ------
    RomdamError
    """
    faults, motions = Faults(), list[GroundMotion]()
    with clock.stage("records", "reading records"), faults.gathered():
        try:
            motions = load_motions(job.config.records, job.folder)
        except RecordError as error:
            raise RecordError(located(job, error)) from None
    summarised = len(motions) > 1
    if motions:
        with faults.gathered():
            usable_motions(job, {motion.name: motion for motion in motions}, summarised=summarised)
    if summarised:
        with faults.gathered():
            refuse_summary(job, None)
    with clock.stage("scene", "building the scene"), faults.gathered():
        scene = scene_of(job)
    faults.raise_together()
    return scene, motions


def _described(
    job: Job, scene: Scene, motions: list[GroundMotion], steps: dict[str, int] | None = None
) -> CheckedJob:
    """What is known of a job once its scene is built and its records are read.

    Parameters
    ----------
    steps : record -> steps of its run; None where nothing is reduced
    """
    blocks: dict[str, dict[str, object]] = {
        name: {
            "element": block.element,
            "nodes": len(block.points),
            "cells": len(block.cells),
            "free_dofs": int((~scene.fixed[name]).sum()),
        }
        for name, block in scene.blocks.items()
    }
    moving = scene.find(MovingSupports)
    return CheckedJob(
        blocks=blocks,
        joints={
            name: {
                "between": " - ".join(joint.blocks),
                "gaps": len(joint.area),
                "area": float(joint.whole_area.sum()),
                "friction": float(joint.mu.max(initial=0.0)),
                "water": math.hypot(*joint.water_resultant),
            }
            for name, joint in scene.joints.items()
        },
        records={
            m.name: {
                "dt": m.dt,
                "duration": m.duration,
                "peak_acceleration": m.peak,
                "steps": None if steps is None else steps[m.name],
                "sequence": sequence_text(members_of(m)) or "-",
            }
            for m in motions
        },
        unknowns=sum(int((~fixed).sum()) for fixed in scene.fixed.values()),
        costs={},
        memory=math.nan,
        file_size=math.nan,
        warnings=job_warnings(job, motions),
        closed_frequencies=(),
        ties={
            tie.name: {
                "between": " - ".join(tie.blocks),
                "nodes": len(tie.nodes[0]),
                "discretization": "coincident nodes" if tie.weights is None else "mortar",
                "apart": tie.apart,
            }
            for tie in scene.ties
        },
        solvers=(),
        skipped=("the reduced model, its state at rest, its time and its memory: leave out --quick",),
        supports={
            motion.name: {
                "station": motion.station,
                "delay": motion.delay,
                "factor": motion.factor,
                "record": None if motion.record is None else motion.record.name,
            }
            for motion in (() if moving is None else moving.motions)
        },
        bodies=tuple(extents_of_bodies(job.config, scene.blocks)),
        loads={
            kind: dict(zip("xyz", map(float, force), strict=True))
            for kind, force in load_resultants(scene).items()
        },
        quick=True,
    )


def _skipped(job: Job, model: RunModel, plan: Plan | None, closed: bool, timed: bool) -> Iterator[str]:
    """Tell what a run looks at, and a check does not."""
    yield "whether every time step converges and the energy ledger closes"
    if not timed:
        yield "the time of a run: a short part of the strongest record, from rest, fails; the log says how"
    if job.config.loads.begins == "static" and model.reduced is None:
        yield "static equilibrium before the earthquake"
    if job.config.linear_stage is not None:
        yield "the time histories of the linear stage, and their time, which a few modes take little of"
    if model.finer is not None:
        yield "the error of leaving out modes, which a run estimates"
    if job.config.transient.accuracy is not None:
        slides = model.system.law.directions > 1
        yield (
            "the step that transient.accuracy comes to on the whole record; the time is for that of short "
            "parts, and each halving more up to doubles it; the size is of the coarsest"
            + ("; short parts from rest hardly slide, so the time may be ten times as long" if slides else "")
        )
    if job.config.transient.total_accuracy is not None:
        yield (
            "which mesh transient.accuracy.total takes, and the runs that find it; all above is of the mesh "
            "that is given"
        )
    if job.config.model.modes == "auto":
        yield f"how many modes model.modes: auto takes; {FIRST} are taken here"
    if automatic := automatic_joints(job):
        yield f"how far apart the gaps of spacing: auto are ({', '.join(automatic)}); every node has one here"
    if len(model.system.law) and not closed:
        if model.reduced is None:
            why = "the model is not reduced"
        else:
            why = f"more than {MOST} unknowns" if model.system.size > MOST else "the water has waves"
        yield f"frequencies with closed joints: {why}; `romdam modes --joints bonded`"
    if plan is not None:
        if plan.distinct is not None:
            yield (
                f"the {plan.distinct} samples but for {len(plan.samples.values)}, the least and the largest "
                "value of each parameter among them; the estimates are for all"
            )
        yield "equilibrium at rest of each sample; blocks and joints are those of the file's own values"
    yield "room on the disk"


def _solvers(job: Job, model: RunModel) -> Iterator[str]:
    """Tell which parts are solved by multigrid, as factors do not fit."""
    if model.reduced is None or job.config.model.modes == "all":
        return
    choice = mode_choice(job.config.model)
    for name, part in scene_parts(model.scene).items():
        unknowns = int((~part.fixed(model.scene.fixed)).sum())
        yield without_factors(unknowns, choice.columns, choice.solving, f"part {name}")


def _block(numbers: dict[str, object], model: RunModel, name: str) -> dict[str, object]:
    """The numbers of a block, and those of its reduction."""
    report = model.reduced.report.get(name) if model.reduced else None
    return numbers | (dict(report) if isinstance(report, dict) else {})


def full_order_seconds(system: System) -> float:
    """CPU time of a step of the unreduced mesh [s]."""
    products = 2.0 * system.B.shape[0] * system.size
    return SECONDS_PER_FULL_UNKNOWN * system.size + SECONDS_PER_PRODUCT * products
