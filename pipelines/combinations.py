"""The load combinations of a job: each is run, and every margin stands in one table and on one page."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from romdam.config.effects import refuse_unknown_effects
from romdam.config.load import Job, Source, naming_lines
from romdam.config.sections.combinations import CombinationConfig
from romdam.config.variants import changed_job
from romdam.core.errors import ConfigError, ConvergenceError, NoEquilibriumError
from romdam.core.files import prepare_folder
from romdam.error.statement import opening_errors
from romdam.pipelines.jobs import load_config, looked_up
from romdam.pipelines.run import Stage, run, silent
from romdam.pipelines.stability import job_after, motion_at_rest
from romdam.postprocess.combinations import HEAD, SATISFIED, Margin, Requirement
from romdam.postprocess.stability import NO_EQUILIBRIUM, NOT_FOUND
from romdam.postprocess.stated_errors import total_text
from romdam.results.fields import open_result
from romdam.results.table import write_csv
from romdam.visual.report.combinations import write_combinations

_NO_MOTION = "static loads"  # in place of a record's name
_OWN = ("combinations", "comparison", "pipeline", "study", "suite", "post_earthquake")


@dataclass(frozen=True)
class Combined:
    """Margins of all combinations, why runs failed, and the files written.

    Attributes
    ----------
    margins : in the order of the file
    failures : combination, and record -> message
    statements : combination, record and what a result says of itself: its stated error, and each warning
    """

    margins: tuple[Margin, ...]
    failures: dict[str, str]
    statements: tuple[tuple[str, str, str], ...]
    paths: tuple[Path, ...]

    @property
    def satisfied(self) -> bool:
        """Whether everything that is required is met."""
        return not self.failures and all(margin.verdict == SATISFIED for margin in self.margins)


@naming_lines
def assess_combinations(
    job: Source, out: str | Path, show: Stage = silent, cache: Path | None = None
) -> Combined:
    """Run every load combination of a job, and judge what it requires.

    Parameters
    ----------
    job : as `romdam.load_config` takes one, with `combinations`
    out : folder, made if needed: results of earthquakes in `out`/<combination>, and <job>-combinations.csv
        and .html
    show : told of every stage
    cache : folder of reduced blocks

    Raises
    ------
    RomdamError
        for wrong keys, in any combination before the first is run. A dam without equilibrium is a verdict,
        not an error.
    """
    job = load_config(job)
    asked = job.config.combinations
    if not asked:
        raise ConfigError(
            f"{job.path}: combinations is missing; name them, such as usual: {{required_factor: 3}}"
        )
    if any(one.after is not None for one in asked.values()):  # the others are runs, which know every effect
        refuse_unknown_effects(job.config, "rest", str(job.path))
    jobs = combination_jobs(job)
    folder = prepare_folder(Path(out))
    margins, failures = dict[str, list[Margin]](), dict[str, str]()
    results, statements = dict[str, list[Path]](), list[tuple[str, str, str]]()
    # earthquakes first: what they leave is where others begin
    for name in sorted(asked, key=lambda one: asked[one].situation != "earthquake"):
        one, required = asked[name], _requirement(name, asked[name])
        if one.situation == "earthquake":
            results[name], failed = _shaken(jobs[name], folder / name, show, cache)
            failures |= {f"{name}, {record}": text for record, text in failed.items()}
            margins[name] = _of_records(results[name], failed, required)
            statements += [line for path in results[name] for line in _statements(name, path)]
        elif one.after is None:
            margins[name] = _at_rest(jobs[name], _NO_MOTION, required, show, failures)
        else:
            margins[name] = [] if results[one.after] else [required.without_value(one.after, NOT_FOUND)]
            for path in results[one.after]:
                with open_result(path) as opened:
                    attrs = opened.dataset.attrs
                record, dt = str(attrs["record"]), float(attrs["record_dt"])
                state = {"result": str(path.absolute()), "take": "joints"}
                of_record = _rest_job(job, name, one, {"loads.initial_state": state}, dt)
                margins[name] += _at_rest(of_record, record, required, show, failures, dt)
    every = tuple(margin for name in asked for margin in margins[name])
    stem = folder / f"{job.stem}-combinations"
    table = write_csv(HEAD, [margin.row for margin in every], stem.with_suffix(".csv"))
    changes = {name: one.changes for name, one in asked.items()}
    page = write_combinations(
        job.config.title or job.stem, every, changes, failures, statements, stem.with_suffix(".html")
    )
    return Combined(every, failures, tuple(statements), (table, page))


def combination_jobs(job: Job) -> dict[str, Job]:
    """The job that each combination of a job runs.

    Raises
    ------
    ConfigError
        for changes that lead nowhere or make no valid job, and a tension without `outputs.stress`.
    """
    return {name: _job_of(job, name, one) for name, one in job.config.combinations.items()}


def _requirement(name: str, one: CombinationConfig) -> Requirement:
    return Requirement(name, one.situation, one.required_factor, one.largest_slip, one.tension, one.joints)


def _job_of(job: Job, name: str, one: CombinationConfig) -> Job:
    """The job that a combination runs, by which its changes are found sound.

    Raises
    ------
    ConfigError
        for changes that lead nowhere or make no valid job, and a tension without `outputs.stress`.
    """
    stands_at = ("combinations", name, "changes")
    if one.situation == "earthquake":
        changed = looked_up(changed_job(job, one.changes, stands_at, left_out=_OWN))
    else:
        changed = _rest_job(job, name, one, {"loads.initial_state": "static"})
    stress = changed.config.outputs.stress
    if one.tension is not None and (stress is None or not stress.faces):
        raise ConfigError(
            f"{job.path}: combinations.{name}.tension is of the faces of outputs.stress, and there are none; "
            "name some, such as outputs.stress.faces: [{block: dam, face: upstream}], or leave it out"
        )
    return changed


def _rest_job(
    job: Job, name: str, one: CombinationConfig, state: dict[str, object], step: float = 0.01
) -> Job:
    return job_after(job, one, state, step, stands_at=("combinations", name, "changes"))


def _at_rest(
    job: Job,
    record: str,
    required: Requirement,
    show: Stage,
    failures: dict[str, str],
    dt: float = 0.01,
) -> list[Margin]:
    """Margins at rest; of a dam without equilibrium that this is so."""
    key = f"{required.combination}, {record}"
    try:
        outcome = run(job, None, show, motions=motion_at_rest(f"{required.combination} {record}", dt))
    except ConvergenceError as error:
        failures[key] = str(error)
        proved = isinstance(error, NoEquilibriumError)
        return [required.without_value(record, NO_EQUILIBRIUM if proved else NOT_FOUND)]
    if outcome.failures:
        failures[key] = next(iter(outcome.failures.values()))
        return [required.without_value(record, NOT_FOUND)]
    return required.at_rest(outcome.results[0].dataset, record)


def _shaken(job: Job, folder: Path, show: Stage, cache: Path | None) -> tuple[list[Path], dict[str, str]]:
    """Results of the records of a job, and why others have none."""
    try:
        outcome = run(job, folder, show, cache)
    except ConvergenceError as error:  # of a lone record
        return [], {"all records": str(error)}
    return list(outcome.paths), dict(outcome.failures)


def _statements(combination: str, path: Path) -> list[tuple[str, str, str]]:
    """The stated error of the openings of a result, and its warnings."""
    with open_result(path) as opened:
        attrs = opened.dataset.attrs
    error = total_text(opening_errors(attrs))
    said = [f"stated error of the openings in L2, at most: {error}", *json.loads(attrs["run_warnings"])]
    return [(combination, str(attrs["record"]), text) for text in said]


def _of_records(paths: Sequence[Path], failed: Collection[str], required: Requirement) -> list[Margin]:
    margins = [required.without_value(record, NOT_FOUND) for record in failed]
    for path in paths:
        with open_result(path) as opened:
            margins += required.shaken(opened.dataset, str(opened.dataset.attrs["record"]))
    return margins
