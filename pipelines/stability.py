"""Static stability of a dam after an earthquake, from what the joints of its results remember."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from romdam.config.effects import refuse_unknown_effects
from romdam.config.load import Job, Source, naming_lines
from romdam.config.sections.combinations import CombinationConfig
from romdam.config.sections.post_earthquake import PostEarthquakeConfig
from romdam.config.variants import changed_job
from romdam.core.errors import ConfigError, ConvergenceError, NoEquilibriumError
from romdam.core.files import prepare_folder
from romdam.core.motion import GroundMotion
from romdam.pipelines.jobs import load_config, looked_up
from romdam.pipelines.run import Stage, run, silent
from romdam.postprocess.responses import PARAMETER
from romdam.postprocess.stability import (
    FORCES_HEAD,
    HEAD,
    NO_EQUILIBRIUM,
    NOT_FOUND,
    STABLE,
    JointStability,
    Row,
    force_rows,
    joint_stability,
    stability_row,
)
from romdam.results.fields import open_result
from romdam.results.suite.design import varied_keys
from romdam.results.table import write_csv

_SECTION = "post_earthquake"
_SAMPLES = 3  # of a ground at rest: the state at the first of them is judged
_TOLERANCE = 1e-11  # of the gaps: at 1e-8 a factor of safety is 2e-6 off
_MODES = 4  # of each block: those of its static answers to joint forces and loads come besides
_AT_REST: dict[str, object] = {  # path -> value: what a state at rest needs not
    "outputs.plots": False,
    "outputs.error_estimate": False,
    "outputs.mesh_error": False,
    "outputs.floor_spectra": None,
    "loads.force_history": [],
}


@dataclass(frozen=True)
class Stability:
    """Joints of all records that have an equilibrium, messages of those without, and the files written.

    Attributes
    ----------
    without : records that have no equilibrium, as limit analysis proves; of the other failures none was found
    forces : rows under `romdam.postprocess.stability.FORCES_HEAD`
    """

    joints: list[JointStability]
    failures: dict[str, str]
    paths: tuple[Path, ...]
    without: frozenset[str] = frozenset()
    forces: tuple[Row, ...] = ()

    @property
    def rows(self) -> list[Row]:
        """The table, a row for each joint, and one for each record without equilibrium."""
        rows = [stability_row(joint) for joint in self.joints]
        missing = ("-",) * (len(HEAD) - 3)
        for record in self.failures:
            rows.append((record, "all", NO_EQUILIBRIUM if record in self.without else NOT_FOUND, *missing))
        return rows

    @property
    def is_stable(self) -> bool:
        """Whether every joint of every record reaches the required factor."""
        return not self.failures and all(joint.verdict == STABLE for joint in self.joints)


@naming_lines
def assess_stability(
    job: Source, results: Sequence[str | Path], out: str | Path | None = None, show: Stage = silent
) -> Stability:
    """Judge the dam at rest after each of some results, by the `post_earthquake` of its job.

    Parameters
    ----------
    results : files of runs of the job
    out : folder for <job>-stability.csv and -forces.csv; nothing is written without one

    Raises
    ------
    RomdamError
        for wrong keys, and for results whose joints are not those of the job. A dam without equilibrium is a
        verdict, not an error.
    """
    job = load_config(job)
    asked = post_earthquake_of(job)
    refuse_unknown_effects(job.config, "rest", str(job.path))
    joints, failures = list[JointStability](), dict[str, str]()
    without, forces = set[str](), list[Row]()
    for path in results:
        with open_result(path) as opened:
            attrs = opened.dataset.attrs
        record, dt = str(attrs["record"]), float(attrs["record_dt"])
        at_rest = motion_at_rest(f"{record} after", dt)
        state = {"result": str(Path(path).absolute()), "take": "joints"}
        after = job_after(job, asked, {"loads.initial_state": state}, dt, _sample_of(job, attrs, path))
        try:
            outcome = run(after, None, show, motions=at_rest)
        except ConvergenceError as error:
            failures[record] = str(error)
            if isinstance(error, NoEquilibriumError):
                without.add(record)
            continue
        if outcome.failures:
            failures[record] = next(iter(outcome.failures.values()))
            continue
        dataset = outcome.results[0].dataset
        joints += joint_stability(dataset, record, asked.required_factor, asked.joints)
        forces += force_rows(dataset, record)
    stability = Stability(joints, failures, (), frozenset(without), tuple(forces))
    if out is None:
        return stability
    stem = prepare_folder(Path(out)) / f"{job.stem}-stability"
    written = write_csv(HEAD, stability.rows, stem.with_suffix(".csv"))
    of_forces = write_csv(FORCES_HEAD, forces, stem.with_name(f"{stem.name}-forces.csv"))
    return replace(stability, paths=(written, of_forces))


def motion_at_rest(name: str, dt: float = 0.01) -> GroundMotion:
    """A ground that rests, of the few samples by which a state at rest is judged."""
    return GroundMotion.from_arrays(name, {"x": [0.0] * _SAMPLES}, dt)


def post_earthquake_of(job: Job) -> PostEarthquakeConfig:
    """The section of a job.

    Raises
    ------
    ConfigError
        where it has none.
    """
    if job.config.post_earthquake is None:
        raise ConfigError(
            f"{job.path}: {_SECTION} is missing; give it required_factor, and changes such as less friction"
        )
    return job.config.post_earthquake


def _sample_of(job: Job, attributes: Mapping[str, object], path: str | Path) -> dict[str, object]:
    """Values of the sample that a suite's run is of, by their paths; nothing of any other run.

    Raises
    ------
    ConfigError
        for values of joints that a dam makes, which have no path of their own.
    """
    suite = job.config.suite
    if suite is None or not any(str(name).startswith(PARAMETER) for name in attributes):
        return {}
    values = dict[str, object]()
    for name, key in varied_keys(job, suite).items():
        value = float(str(attributes[PARAMETER + name]))
        for location in key.locations:
            if location[0] == "joints" and str(location[1]) not in job.config.joints:
                raise ConfigError(
                    f"{path}: is of a sample with {key.path} = {value:g}, of a joint that the dam makes; "
                    f"take {name} out of suite.parameters in a copy of the job, and put {value:g} where "
                    "that joint is made"
                )
            values[".".join(map(str, location))] = "rigid" if value == float("inf") else value
    return values


def job_after(
    job: Job,
    asked: PostEarthquakeConfig | CombinationConfig,
    state: dict[str, object],
    step: float = 0.01,
    sample: Mapping[str, object] | None = None,
    stands_at: tuple[str, ...] = (_SECTION, "changes"),
) -> Job:
    """The job at rest after the earthquake, with few modes: static answers are exact with any number.

    Parameters
    ----------
    state : path -> value of what the dam rests from
    sample : values of a suite's sample, by their paths; those that the job's `changes` name are these
    stands_at : keys of the file under which the changes stand

    Raises
    ------
    ConfigError
        for a change that leads nowhere, or that makes no valid job.
    """
    left_out = ("combinations", "comparison", "linear_stage", "pipeline", "study", "suite", _SECTION)
    transient = {"finest_step": step, "tolerance": min(job.config.transient.tolerance, _TOLERANCE)}
    changes: dict[str, object] = _AT_REST | {"transient": transient}
    if job.config.model.order == "reduced":
        changes["model"] = {"modes": _MODES}
    sustained = {  # what the record adds has another modulus, a state at rest has none of it
        f"materials.{name}.E_dynamic": None
        for name, material in job.config.materials.items()
        if material.E_dynamic is not None
    }
    changes |= sustained | dict(sample or {})
    return looked_up(changed_job(job, changes | asked.changes | state, stands_at, left_out=left_out))
