"""The error of the mesh of a suite: its strongest record on the suite's mesh and on a sibling of it."""

from __future__ import annotations

from dataclasses import replace

from romdam.config.other_mesh import with_compared_stress
from romdam.core.errors import describe_error, recoverable
from romdam.error.statement import ErrorStatement
from romdam.pipelines.error.sibling import NoSibling, unknown_mesh_error, with_stress
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.run import Clock, Stage, build_model, build_sibling
from romdam.pipelines.simulation import simulate_motion
from romdam.pipelines.stresses import stress_of
from romdam.pipelines.suites.plan import Plan
from romdam.pipelines.suites.progress import of_parts
from romdam.pipelines.suites.tasks import Run, scaled
from romdam.reduction.storage.model_file import BlockStore
from romdam.results.case import Case


def runs_stated(plan: Plan) -> list[Run]:
    """The runs that the error of the mesh is stated of: the strongest record at its scales' ends, rising."""
    strongest = max(plan.runs, key=lambda run: run.factor * plan.motions[run.record].peak)
    of_record = [run for run in plan.runs if run.record == strongest.record]
    weakest = min(of_record, key=lambda run: run.factor)
    return [strongest] if weakest.factor == strongest.factor else [weakest, strongest]


def state_mesh_error(plan: Plan, show: Stage, store: BlockStore) -> ErrorStatement | None:
    """State what the mesh changes in the strongest record at its largest scale, and at its smallest one.

    The joints have the values of the file, not those of a sample. A total accuracy has stated the error of
    the mesh as it chose it. None where neither is asked for.

    Raises
    ------
    ConfigError
        where there is no such mesh, or the job does not go with it.
    """
    if plan.mesh_statement is not None:
        return plan.mesh_statement
    clock = Clock(show)
    sibling = build_sibling(plan.job, scene_of(plan.job), clock, store)
    if sibling is None or not plan.runs:
        return None
    if isinstance(sibling, NoSibling):
        return unknown_mesh_error(sibling.why)
    stated_runs = runs_stated(plan)
    strongest = stated_runs[-1]
    model = with_stress(build_model(with_compared_stress(plan.job), clock, store))
    statements = {}
    name, duration = plan.motions[strongest.record].name, plan.job.config.transient.duration
    try:
        with clock.stage("mesh", f"stating the error of the mesh, {name}") as whole:
            progress = of_parts(whole, len(stated_runs) * (1 + len(sibling.others)))
            for run in stated_runs:
                motion = scaled(plan.motions[run.record], run)
                history = simulate_motion(plan.job, model.prepared, motion, duration, progress)
                history, stress = stress_of(model.scene, model.stress, history)
                case = Case(model.scene, motion, history, stress)
                statements[run.factor] = sibling.state(model, case, progress)
    except recoverable() as error:
        return unknown_mesh_error(describe_error(error))
    scales = [
        {"scale_factor": factor, **{name: error.plain for name, error in statement.errors.items()}}
        for factor, statement in statements.items()
    ]
    stated = statements[strongest.factor]
    return replace(stated, details=dict(stated.details) | {"scales": scales})
