"""The runs of a suite: their keys, which of them are done, and the tasks that make the others.

The division into tasks follows from the configuration and the records alone, not from the number of
workers or from what is done already: runs that march together share their round-off, so a suite that was
stopped and resumed has the same bits as one that was not.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import romdam
from romdam.config.load import Job
from romdam.config.parameters import vary
from romdam.fingerprint import fingerprint
from romdam.outputs.suite import ROWS_FOLDER, SuiteRecord
from romdam.outputs.suite_rows import Row, read_rows, result_key
from romdam.pipelines.suite_runs import Run, Study, Task, sample_key, sample_scene
from romdam.records.motion import GroundMotion
from romdam.scene.model import Scene

LAYOUT = "romdam-suite-1"
TASK_BYTES = 300e6  # of histories in memory, for the runs that march together
MOST_TOGETHER = 32
_COPIES = 3.0  # of a history while it is made, compared and written


def plan_runs(study: Study, records: Sequence[SuiteRecord]) -> list[Run]:
    """Every run of the suite whose record can be used."""
    about = _model_key(study.job, study.model.scene)
    samples = [_sample_key(study, number) for number in range(len(study.samples))]
    runs = []
    for record in records:
        if record.motion is None:
            continue
        motion = record.motion
        own = fingerprint((about, motion.acc, motion.dt, str(motion.provenance.get("resampling"))))
        runs += [
            Run(record.name, k, s, float(factor), fingerprint((own, float(factor), sample)), sample)
            for k, factor in enumerate(record.factors)
            for s, sample in enumerate(samples)
        ]
    return runs


def _model_key(job: Job, scene: Scene) -> str:
    """Of everything but the records and what the samples vary."""
    config, suite = job.config, job.config.suite
    parts = {"nodes", "every", "stress", "error_estimate"}
    asked = {
        "model": config.model.model_dump_json(),
        "transient": config.transient.model_dump_json(),
        "initial": config.loads.initial_state,
        "outputs": config.outputs.model_dump_json(include=parts),
        "keep": "" if suite is None else str(suite.keep),
    }
    joints = {
        name: (j.blocks, j.nodes, j.position, j.area, j.axes, j.weights) for name, j in scene.joints.items()
    }
    rest = {name: value for name, value in vars(scene).items() if name != "joints"}
    return fingerprint((LAYOUT, romdam.__version__, asked, joints, rest))


def _sample_key(study: Study, number: int) -> str:
    job = study.job
    varied = vary(job.config, study.places, study.samples[number], str(job.path))
    return sample_key(sample_scene(job, study.model.scene, varied), varied)


def finished(study: Study, out: Path, runs: Sequence[Run]) -> dict[Run, Row]:
    """Rows of the runs that are done: nothing they depend on has changed, and what they keep is there."""
    known = {row.key: row for row in read_rows(sorted((out / ROWS_FOLDER).glob("*.nc")))}
    done = {run: known[run.key] for run in runs if run.key in known}
    if not study.keeps_results:
        return done
    return {
        run: row
        for run, row in done.items()
        if row.message or result_key(study.folder / f"{run.name}.nc") == run.key
    }


def divide(study: Study, runs: Iterable[Run], motions: dict[str, GroundMotion]) -> list[tuple[Run, ...]]:
    """Runs that march together, the longest first; runs of one task have one time step and like lengths."""
    most = study.suite.batch or MOST_TOGETHER
    groups: list[list[Run]] = []
    room = 0.0

    def order(run: Run) -> tuple[float, int, int, str, int]:
        motion = motions[run.record]
        return (-motion.dt, run.sample, -motion.acc.shape[1], run.record, run.scale)

    for run in sorted(runs, key=order):
        motion = motions[run.record]
        size = history_bytes(study, motion)
        fresh = not groups or motions[groups[-1][0].record].dt != motion.dt
        if fresh or len(groups[-1]) >= most or (study.suite.batch is None and size > room):
            groups.append([])
            room = TASK_BYTES
        groups[-1].append(run)
        room -= size
    cost = {run: motions[run.record].acc.shape[1] for group in groups for run in group}
    groups.sort(key=lambda group: -sum(cost[run] for run in group))
    return [tuple(group) for group in groups]


def tasks_of(
    groups: Iterable[tuple[Run, ...]], done: dict[Run, Row], motions: dict[str, GroundMotion]
) -> list[Task]:
    """The tasks that are still to be made, of each group the runs that are missing."""
    tasks = []
    for group in groups:
        missing = tuple(run for run in group if run not in done)
        if missing:
            name = fingerprint(tuple(run.key for run in missing))[:16]
            tasks.append(Task(name, missing, {run.record: motions[run.record] for run in missing}))
    return tasks


def history_bytes(study: Study, motion: GroundMotion) -> float:
    """Memory of a run while it is made."""
    return _COPIES * written_rows(study.job, motion) * row_bytes(study)


def written_rows(job: Job, motion: GroundMotion) -> int:
    """Rows of a run's result."""
    transient = job.config.transient
    duration = motion.duration if transient.duration is None else transient.duration
    return int(duration / (job.config.outputs.every or transient.dt or motion.dt)) + 1


def row_bytes(study: Study) -> float:
    """Bytes of one written row of a result: gaps, observed nodes, coordinates."""
    system = study.model.system
    jumps = system.B.shape[0]
    return 8.0 * (3 * jumps + len(system.law) / 8 + 3 * system.observe.shape[0] + system.size + 12)
