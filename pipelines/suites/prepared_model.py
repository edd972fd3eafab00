"""A job that is reduced once and run with the values that a program asks for, as a suite runs its samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock

import xarray as xr

from romdam.config.load import Job, Source, naming_lines
from romdam.config.parameters import VariedKey
from romdam.config.sections.suite import SuiteConfig
from romdam.core.arrays import Floats
from romdam.core.errors import RomdamError, placed
from romdam.core.fingerprint import fingerprint
from romdam.core.threads import one_thread
from romdam.pipelines.jobs import load_config
from romdam.pipelines.run import Clock, Stage, reduced_model, silent
from romdam.pipelines.simulation import RunModel
from romdam.pipelines.stresses import stress_fields
from romdam.pipelines.suites.plan import Plan, basis_content, make_plan, plan_of_samples, tasks_of
from romdam.pipelines.suites.runs import run_task
from romdam.pipelines.suites.tasks import Suite
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.user_cache import open_store
from romdam.results.suite.design import keys_at, stated_samples
from romdam.results.suite.summary import runs_dataset

Value = float | str

_MOST = 4  # reduced models that are held: the first one, and the latest that samples needed besides


class PreparedModel:
    """A job that is reduced once, to be run with many values, as `romdam.prepare` makes it.

    Threads may share it. Pickled, it takes its reduced models along.
    """

    def __init__(self, plan: Plan, store: BlockStore | None = None, clock: Clock | None = None) -> None:
        self._plan, self._store = plan, store
        self._first = _reduced(plan, store, clock or Clock(silent))
        self._others: dict[str, RunModel] = {}
        self._places: dict[tuple[str, ...], dict[str, VariedKey]] = {}
        self._lock = Lock()

    def __getstate__(self) -> dict[str, object]:
        """All but the lock, which stays in its process."""
        return {name: value for name, value in vars(self).items() if name != "_lock"}

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state, _lock=Lock())

    @property
    def job(self) -> Job:
        """The job, as it is run: `auto` and accuracies have come to numbers of modes and a mesh."""
        return self._plan.job

    @one_thread()
    def run(self, values: Mapping[str, Value | Sequence[Value] | Floats] | None = None) -> xr.Dataset:
        """Run every record of the job, at every scale of its suite, with other values of some keys.

        Parameters
        ----------
        values : path of each key, such as joints.base.friction or joints.*.friction, or the name of a
            parameter of the job's suite -> its value, SI or with a unit; or (samples,) values, those of one
            sample at the same number in each. What is not named stays as in the job

        Returns
        -------
        Dataset with dims record, scale, sample, and joint, node and so on where they apply : responses,
            status and message of each run, as `summary.nc` of a suite with these samples has them, and the
            values as coordinates `parameter_<path>`. Several go together by `xarray.concat(..., "sample")`

        Raises
        ------
        ConfigError
            for a path that a suite cannot vary, and values that their keys do not take or that do not fit
            together.
        RomdamError
            where no run succeeds; of several the others go on, and those that failed are NaN.
        """
        plan = self._plan_of(values or {})
        suite = Suite(plan.job, self._model(plan), plan.samples, Path(), {})
        row_of = {row.key: row for task in tasks_of(suite, plan, {}) for row in run_task(suite, task)}
        rows = {run.index: row_of[run.key] for run in plan.runs}
        if all(row.message for row in rows.values()):
            raise RomdamError(f"{plan.job.path}: {next(iter(rows.values())).message}")
        return runs_dataset(plan.job, plan.scene, plan.design, plan.records, rows)

    def _plan_of(self, values: Mapping[str, Value | Sequence[Value] | Floats]) -> Plan:
        """The plan of some samples."""
        job, names = self._plan.job, tuple(values)
        if names not in self._places:
            stated = job.config.suite.parameters if job.config.suite else {}
            paths = {name: stated[name].paths if name in stated else (name,) for name in names}
            self._places[names] = keys_at(job, paths)
        places = self._places[names]
        columns = stated_samples(places, values, str(job.path))
        return plan_of_samples(self._plan, places, columns)

    def _model(self, plan: Plan) -> RunModel:
        """The reduced model that the runs of samples take: the first one, unless they need another basis."""
        loads, first = plan.samples.also or (), self._plan.samples.also or ()
        if plan.scene is self._plan.scene and [*map(id, loads)] == [*map(id, first)]:
            return self._first
        key = fingerprint(basis_content(plan.scene, loads))
        with self._lock:
            if key not in self._others:
                while len(self._others) > _MOST - 2:
                    del self._others[next(iter(self._others))]
                self._others[key] = _reduced(plan, self._store, Clock(silent))
            return self._others[key]


def _reduced(plan: Plan, store: BlockStore | None, clock: Clock) -> RunModel:
    """The model of a plan's scene, with what other materials and levels are made of."""
    with clock.stage("model", "reducing the blocks"), placed(plan.job.path):
        model = reduced_model(plan.job, plan.scene, store, estimated=True, also=plan.samples.also or ())
    return replace(model, stress=stress_fields(plan.scene, model.reduced_at_rest))


@one_thread()
@naming_lines
def prepare(job: Source, cache: Path | None = None, show: Stage = silent) -> PreparedModel:
    """Read and reduce a job once, to run it with many values: for optimisers, samplers and surrogates.

    A job with a `suite` is run with its records, scales and `keep: peaks`. The basis answers the loads at the
    extremes of its `parameters`: name there the levels of water and temperatures that will vary, and their
    ranges; without, each new level or temperature is reduced anew.

    Parameters
    ----------
    job : as `romdam.load_config` takes one
    cache : folder of reduced blocks, to find them in and to keep them in; none is used if not given
    show : told of every stage and its progress

    Raises
    ------
    RomdamError
        for bad input, as suites refuse it.
    """
    plan = make_plan(load_config(job), Clock(show))
    keeps_nothing = (plan.job.config.suite or SuiteConfig()).model_copy(update={"keep": "peaks"})
    config = plan.job.config.model_copy(update={"suite": keeps_nothing})
    plan = replace(plan, job=replace(plan.job, config=config))
    return PreparedModel(plan, open_store(cache), Clock(show))
