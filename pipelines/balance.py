"""The balance of the forces at rest in every run, whoever integrates it."""

from __future__ import annotations

from dataclasses import replace

from romdam.config.load import Job
from romdam.core.system import History, RestBalance
from romdam.fem.balance import balance_at_rest, refuse_unbalanced
from romdam.pipelines.simulation import RunModel
from romdam.results.case import rock_blocks, water_at_rest


def with_balance(job: Job, model: RunModel, history: History) -> History:
    """The history with the balance of its forces at rest, where it begins there.

    Runs of one model begin in one state, whose balance is formed once.

    Raises
    ------
    ConvergenceError
        where they do not balance.
    """
    if job.config.loads.begins != "static" or model.prepared.goes_on_from is not None:
        return history

    def formed() -> RestBalance:
        scene, water = model.scene, water_at_rest(model.scene, history)
        if history.water.size:
            water = water + history.water[0]
        dam = [name for name in scene.blocks if name not in rock_blocks(scene)]
        attached = history.attached[:1].sum(axis=0)
        return balance_at_rest(scene, history.traction[0], water, dam, attached)

    balance = model.prepared.cache.get_or_compute(("balance",), formed)
    refuse_unbalanced(balance)
    return replace(history, balance=balance)
