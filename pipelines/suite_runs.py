"""What a worker does for a suite: march the runs of one task and make their rows.

The study (scene, reduced model, samples) travels to every worker once; a task brings its ground motions.
A worker writes nothing but the results that are kept whole, into the suite's own folder.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from romdam.config.load import Job
from romdam.config.parameters import Place, Varied, vary
from romdam.config.suite import KeepConfig, SuiteConfig
from romdam.dynamics.batch import with_parameters
from romdam.dynamics.system import History
from romdam.errors import ConfigError, RomdamError
from romdam.fem.damping import modal_coefficients
from romdam.fem.gaps import gap_law
from romdam.fingerprint import fingerprint
from romdam.outputs.certificate import FOLDER
from romdam.outputs.dataset import Timing, build_dataset, single_precision, write_dataset
from romdam.outputs.suite_rows import RUN_KEY, Row, row_values
from romdam.outputs.variables import Case
from romdam.pipelines.estimate import estimate_error
from romdam.pipelines.run import Model
from romdam.pipelines.shaking import shake_together
from romdam.pipelines.stresses import stress_of
from romdam.records.motion import GroundMotion
from romdam.reduction.synthesis import ReducedModel
from romdam.scene.joints import with_properties
from romdam.scene.model import Scene

# what a run can meet that is its own misfortune: it becomes a row with a message, and the others go on
MISFORTUNES = (RomdamError, ArithmeticError, np.linalg.LinAlgError, MemoryError)


@dataclass(frozen=True)
class Study:
    """What every task of a suite needs.

    Attributes
    ----------
    job : the configuration
    model : scene, reduced once for all samples, with the joints of one sample
    places : name of each parameter -> where it stands
    samples : name of each parameter -> its value, for each sample
    folder : where results that are kept whole land
    files : what they share: attribute -> file name
    """

    job: Job
    model: Model
    places: dict[str, Place]
    samples: tuple[dict[str, float], ...]
    folder: Path
    files: dict[str, str]

    @property
    def suite(self) -> SuiteConfig:
        """The `suite:` part of the configuration."""
        assert self.job.config.suite is not None
        return self.job.config.suite

    @property
    def keeps_results(self) -> bool:
        """Whether every run lands as a result file of its own."""
        return self.suite.keep != "peaks"


@dataclass(frozen=True)
class Run:
    """One record at one scale with one sample.

    Attributes
    ----------
    record : name
    scale, sample : numbers
    factor : what the record is multiplied by
    key : SHA-256 of everything the run depends on
    sample_key : SHA-256 of the joints and the damping of its sample
    """

    record: str
    scale: int
    sample: int
    factor: float
    key: str
    sample_key: str

    @property
    def name(self) -> str:
        """Stem of the run's file."""
        return f"{self.record}__{self.scale}__{self.sample}"


@dataclass(frozen=True)
class Task:
    """Runs that march together, and the motions of their records; `name` is that of the file of its rows."""

    name: str
    runs: tuple[Run, ...]
    motions: dict[str, GroundMotion]


def sample_model(study: Study, number: int, key: str) -> Model:
    """The model with the joints and the damping of one sample; nothing is reduced.

    Raises
    ------
    ConfigError
        for values that do not fit together, and joints that are not those of `key`.
    """
    if not study.places:
        return study.model
    job, model = study.job, study.model
    varied = vary(job.config, study.places, study.samples[number], str(job.path))
    scene = sample_scene(job, model.scene, varied)
    if sample_key(scene, varied) != key:
        raise ConfigError(
            f"{job.path}: joints: their gap tables have changed since the suite was started, or are others "
            f"on a worker; leave those in {job.folder} as they are, and run the same command again"
        )
    assert model.reduced is not None
    reduced, finer = _with_sample(model.reduced, scene, varied), model.finer
    if finer is not None:
        finer = replace(finer, model=_with_sample(finer.model, scene, varied))
    return replace(model, scene=scene, system=reduced.system, reduced=reduced, finer=finer)


def sample_scene(job: Job, scene: Scene, varied: Varied) -> Scene:
    """The scene with the joints of one sample."""
    joints = {
        name: with_properties(joint, varied.joints[name], job.folder, str(job.path))
        for name, joint in scene.joints.items()
    }
    return replace(scene, joints=joints)


def sample_key(scene: Scene, varied: Varied) -> str:
    """SHA-256 of the joints and the damping of one sample."""
    return fingerprint((gap_law(scene), varied.damping.model_dump_json()))


def _with_sample(reduced: ReducedModel, scene: Scene, varied: Varied) -> ReducedModel:
    damping = modal_coefficients(varied.damping, reduced.system.K.diagonal())
    return replace(reduced, system=with_parameters(reduced.system, gap_law(scene), damping))


def run_task(study: Study, task: Task) -> list[Row]:
    """March the runs of a task together; their rows in its order, those that failed with a message."""
    wall, cpu = time.perf_counter(), time.process_time()
    samples = {run.sample: run.sample_key for run in task.runs}
    with threadpool_limits(limits=1):  # the bits of a result must not depend on the number of cores
        models = {number: sample_model(study, number, key) for number, key in samples.items()}
        motions = [scaled(task.motions[run.record], run) for run in task.runs]
        outcomes = march(study.job, [models[run.sample] for run in task.runs], motions)
    spent = (time.perf_counter() - wall, time.process_time() - cpu)
    rows = []
    for run, motion, outcome, share in zip(task.runs, motions, outcomes, _shares(outcomes), strict=True):
        if isinstance(outcome, Exception):
            message = (
                str(outcome) if isinstance(outcome, RomdamError) else f"{type(outcome).__name__}: {outcome}"
            )
            rows.append(Row(run.record, run.scale, run.sample, run.key, message))
        else:
            clock = (share * spent[0], share * spent[1])
            rows.append(_row(study, models[run.sample], run, (motion, outcome), clock))
    return rows


def march(
    job: Job, models: Sequence[Model], motions: Sequence[GroundMotion]
) -> Sequence[History | Exception]:
    """The one place where a suite integrates: every history, or why there is none."""
    try:
        return shake_together(job, [model.system for model in models], motions)
    except MISFORTUNES as error:
        if len(motions) == 1:
            return [error]
    return [march(job, [one], [motion])[0] for one, motion in zip(models, motions, strict=True)]


def _shares(outcomes: Sequence[History | Exception]) -> list[float]:
    """Of the time of a task, by what each run's own steps took."""
    cpu = [
        0.0 if isinstance(one, Exception)
        else one.stats.get("all_runs_cpu_seconds", one.stats["loop_cpu_seconds"])
        for one in outcomes
    ]  # fmt: skip
    total = sum(cpu)
    return [one / total if total > 0.0 else 1.0 / len(cpu) for one in cpu]


def scaled(motion: GroundMotion, run: Run) -> GroundMotion:
    """A record at the scale of a run, under the name of the run."""
    about = motion.provenance | {"suite_scale": run.factor, "suite_record": run.record}
    return replace(motion, name=run.name, acc=run.factor * motion.acc, provenance=about)


def _row(
    study: Study, model: Model, run: Run, made: tuple[GroundMotion, History], clock: tuple[float, float]
) -> Row:
    """The numbers of a run that took `clock` seconds so far; its result is written if it is kept."""
    wall, cpu = time.perf_counter() - clock[0], time.process_time() - clock[1]
    (motion, history), stated = made, dict[str, float]()
    attributes: dict[str, object] = {}
    if model.finer is not None and model.reduced is not None:
        estimate = estimate_error(study.job, model.finer, model.reduced, motion, history)
        stated["estimated_reduction_error"] = estimate.opening.l2
        attributes = estimate.attributes
    history, stress = stress_of(model.scene, model.stress, history)
    case = Case(model.scene, motion, history, stress)
    stated["wall_seconds"] = time.perf_counter() - wall
    stated["cpu_seconds"] = time.process_time() - cpu
    row = Row(run.record, run.scale, run.sample, run.key, "", row_values(case, stated))
    if study.keeps_results:
        _write(study, run, case, attributes | {f"suite_{k}": v for k, v in study.samples[run.sample].items()})
    return row


def _write(study: Study, run: Run, case: Case, attributes: dict[str, object]) -> None:
    dataset = build_dataset(case, study.job, Timing({}, {}), study.files.get("model_file"))
    dataset.attrs.update(attributes | study.files | {RUN_KEY: run.key})
    dataset.attrs[FOLDER] = os.path.relpath(study.job.folder, study.folder)
    keep = study.suite.keep
    if isinstance(keep, KeepConfig) and keep.precision == "single":
        dataset = single_precision(dataset)
    write_dataset(dataset, study.folder / f"{run.name}.nc")
