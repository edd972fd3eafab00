"""Memory and disk that a suite takes, before its samples are built."""

from __future__ import annotations

from collections.abc import Iterable

from romdam.config.load import Job
from romdam.config.sections.suite import KeepConfig, SuiteConfig
from romdam.core.errors import ConfigError
from romdam.core.machine import memory_limit, shown_size
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import System

# bytes of a run beside its numbers
_OBJECTS = 12e3  # in memory: run, row, and what the summary and its tables are made of
_TEXTS = 1.5e3  # on disk: names, keys and warnings
_COPIES = 3.0  # of a history while it is made, compared and written
_NUMBERS = 20.0  # of a row, beside those of its joints and nodes
_OF_JOINT, _OF_NODE = 8.0, 3.0


def written_rows(job: Job, motion: GroundMotion) -> int:
    """Rows of a run's result."""
    transient = job.config.transient
    duration = motion.duration if transient.duration is None else transient.duration
    return int(duration / (job.config.outputs.output_interval or transient.finest_step or motion.dt)) + 1


def row_bytes(system: System) -> float:
    """Bytes of one written row of a result: gaps, observed nodes, coordinates."""
    jumps = system.B.shape[0]
    return 8.0 * (3 * jumps + len(system.law) / 8 + 3 * system.observe.shape[0] + system.size + 12)


def history_bytes(job: Job, system: System, motion: GroundMotion) -> float:
    """Memory of a run while it is made."""
    return _COPIES * written_rows(job, motion) * row_bytes(system)


def summary_bytes(scene: Scene, runs: float) -> float:
    """Memory of so many runs, their rows and the summary of all."""
    return runs * (_OBJECTS + 20.0 * _gaps(scene) + 2.0 * _peaks_bytes(scene))


def results_bytes(
    job: Job, scene: Scene, system: System, motions: Iterable[GroundMotion], each: float
) -> float:
    """Disk that the journal, the summary and what is kept of the runs take at most.

    Parameters
    ----------
    each : runs of every motion
    """
    keep = (job.config.suite or SuiteConfig()).keep
    single = isinstance(keep, KeepConfig) and keep.precision == "single"
    size = 0.0
    for motion in motions:
        size += each * (_TEXTS + 32.0 * _gaps(scene) + 6.0 * _peaks_bytes(scene))
        if keep != "peaks":
            size += each * written_rows(job, motion) * row_bytes(system) * (0.5 if single else 1.0)
    return size


def refuse_many(job: Job, scene: Scene, runs: float) -> None:
    """Refuse so many runs that their summary does not fit in memory, before the samples are built.

    Raises
    ------
    ConfigError
        with the memory and the limit.
    """
    need, limit = summary_bytes(scene, runs), memory_limit(None)
    if need > limit:
        raise ConfigError(
            f"{job.path}: suite: {runs:.6g} runs with {_gaps(scene)} gaps take about {shown_size(need)} of "
            f"memory for their summary, "
            f"limit {shown_size(limit)} (four fifths of this machine's); "
            f"make {runs * limit / need:.2g} runs at most: fewer samples (suite.design or suite.parameters), "
            "scales or records, or several suites"
        )


def _gaps(scene: Scene) -> int:
    return sum(len(joint.area) for joint in scene.joints.values())


def _peaks_bytes(scene: Scene) -> float:
    """Bytes of the numbers of a row."""
    return 8.0 * (_NUMBERS + _OF_JOINT * len(scene.joints) + _OF_NODE * len(scene.probes))
