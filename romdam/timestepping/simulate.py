"""Simulate a prepared system with gaps under ground acceleration, at given steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from romdam.contact.problem import every_law
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.final_state import FinalState
from romdam.core.integrators import INTEGRATORS
from romdam.core.model_signature import law_key, model_signature
from romdam.core.system import History
from romdam.timestepping.attached import with_attached_forces
from romdam.timestepping.energy import imbalance
from romdam.timestepping.every_step import thinned
from romdam.timestepping.integrators.registry import integrator_class
from romdam.timestepping.load_order import order_warnings
from romdam.timestepping.peaks import node_peaks
from romdam.timestepping.prepared import Outcome, Prepared, Progress, Simulation
from romdam.timestepping.settings import Settings
from romdam.timestepping.soundness import sound
from romdam.timestepping.support_motion import add_support_motion

_SAME = 1e-6  # of the largest value: round-off of another reduction is below 1e-9


def simulate(
    prepared: Prepared | Sequence[Prepared],
    grounds: Sequence[Floats],
    settings: Settings,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Integrate ground motions from the initial state to their ends.

    Parameters
    ----------
    prepared : one for all, or one for each; they may differ in damping and in the joints' parameters, and
        have equal integrators
    grounds : (3, nt) ground acceleration at every base step [m/s2], followed by what moving supports do, see
        `romdam.core.system.PseudoStatic.motion`; they may differ in length
    settings : the same for all
    progress : called with (base steps done, base steps in all)

    Returns
    -------
    list, in the order of the motions: the history, or why there is none

    Raises
    ------
    ConfigError
        where the integrator does not suit a system, or the settings do not.
    """
    each = [prepared] * len(grounds) if isinstance(prepared, Prepared) else prepared
    simulations = [Simulation(*pair) for pair in zip(each, grounds, strict=True)]
    if not simulations:
        return []
    integrator = simulations[0].prepared.integrator
    for one in dict.fromkeys(each):
        assert one.integrator == integrator
        integrator.supports(one.system)
    if isinstance(settings.start, FinalState):
        refuse_other_start(settings.start, each)
    for name, honoured in (("start", "resumes"), ("shift", "shifts")):  # settings that would be ignored
        if isinstance(getattr(settings, name), FinalState):
            continue
        if getattr(settings, name) is not None and not getattr(integrator, honoured):
            able = ", ".join(one for one in INTEGRATORS if getattr(integrator_class(one), honoured))
            cannot = "go on from a written row" if name == "start" else "take added jumps"
            raise ConfigError(
                f"transient.integrator: {integrator.name} cannot {cannot}, and Settings.{name} is given, as "
                f"statements of error need it; take one of {able}, or leave it out"
            )
    stride = settings.steps.stride
    every_step = settings.every_step and not settings.only_jumps
    if every_step:
        settings = replace(settings, steps=replace(settings.steps, stride=1))
    on_path = {
        one: () if settings.only_jumps else order_warnings(one, settings) for one in dict.fromkeys(each)
    }
    outcomes = integrator.advance(simulations, settings, progress or (lambda done, total: None))
    for i, (simulation, history) in enumerate(zip(simulations, outcomes, strict=True)):
        if not isinstance(history, History):
            continue
        if not settings.only_jumps:  # what moving supports add, the ground, the initial gap, the open ledger
            system, written = simulation.prepared.system, settings.steps.stride
            history = add_support_motion(history, system, simulation.ground, written)
            stats = history.stats | {"ledger_imbalance": imbalance(history.energy)}
            stats["base_step"] = settings.steps.base
            ground = simulation.ground[:3, ::written].T  # below it stands what moving supports do
            final = history.final
            if final is not None:
                laws = {law_key(rows.law): rows.on for rows in every_law(system.law)}
                final = replace(final, model=model_signature(system), laws=laws)
            forces = system.forces(simulation.ground)[:, ::written].T
            ground_peak = np.abs(simulation.ground[:3]).max(axis=1, initial=0.0)
            history = with_attached_forces(history, system)
            if len(history.base_disp):
                of_nodes = node_peaks(history.base_disp, settings.steps.base)
            else:
                of_nodes = node_peaks(history.disp, settings.steps.interval)
            history = replace(
                history,
                base_disp=history.base_disp[:0],
                node_peaks=of_nodes,
                stats=stats,
                gap=system.law.gap,
                ground=ground,
                ground_peak=ground_peak,
                forces=forces,
                final=final,
            )
            if system.uplift is not None:
                stats["uplift_iterations"] = float(system.uplift.iterations)
                warnings = (*history.warnings, *system.uplift.warnings)
                history = replace(history, stats=stats, uplift=system.uplift, warnings=warnings)
            history = replace(history, warnings=(*history.warnings, *on_path[simulation.prepared]))
            if system.sustained is not None and system.sustained.rest is not None:
                history = replace(history, rest=system.sustained.rest)
            if system.reduced:
                history = replace(history, modes=system.effective_ratios)
            if system.built is not None:
                history = replace(history, built=system.built)
            if every_step:
                history = thinned(history, settings.steps.base, stride)
        outcomes[i] = sound(history, simulation.prepared.system)
    return outcomes


def refuse_other_start(start: FinalState, each: Sequence[Prepared]) -> None:
    """Refuse a state of another model or integrator, and systems that a state does not tell all of.

    Raises
    ------
    ConfigError
        with what differs, and where.
    """
    begins = start.source
    for prepared in dict.fromkeys(each):
        system, name = prepared.system, prepared.integrator.name
        if system.needs_whole_record or system.pseudo_static is not None or system.signals:
            what = "a free field" if system.needs_whole_record else "moving supports"
            what = "a force history" if system.signals else what
            raise ConfigError(
                f"{begins}: what {what} did before is not in the state of a run, so no run begins from it; "
                "run the records one after another with records[].after"
            )
        if name != start.integrator:
            raise ConfigError(
                f"{begins}: the state is of the integrator {start.integrator}, and this run has {name}; "
                f"set transient.integrator: {start.integrator}"
            )
        for quantity, now in model_signature(system).items():
            then = start.model.get(quantity, np.zeros(0))
            size = max(float(np.abs(now).max(initial=0.0)), float(np.abs(then).max(initial=0.0)))
            if then.shape != now.shape:
                raise ConfigError(
                    f"{begins}: the {quantity} of the state's model has {then.shape} values, and of this one "
                    f"{now.shape}; a state goes on in the model that it is of: same mesh, joints and modes"
                )
            off = np.abs(now - then) > _SAME * size
            if off.any():
                i = tuple(int(k) for k in np.argwhere(off)[0])
                at = system.law.gap_name(i[0]) if len(now) == len(system.law) else f"unknown {i[0]}"
                raise ConfigError(
                    f"{begins}: the {quantity} at {at} is {now[i]:.6g}, and was {then[i]:.6g} in the run of "
                    "the state; a state goes on in the model that it is of: same mesh, joints, loads, "
                    "damping and modes"
                )


def simulate_one(
    prepared: Prepared, ground: Floats, settings: Settings, progress: Progress | None = None
) -> History:
    """Integrate one ground motion, as `simulate`.

    Raises
    ------
    ConfigError
        where the integrator does not suit the system, or the settings do not.
    ConvergenceError
        where the initial state or a step does not converge; it names time, gap, residual and remedy.
    """
    return history_of(simulate(prepared, [ground], settings, progress)[0])


def history_of(outcome: Outcome) -> History:
    """Give the history, or raise why there is none."""
    if isinstance(outcome, ConvergenceError):
        raise outcome
    return outcome
