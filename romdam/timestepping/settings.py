"""Settings of a run that every integrator knows; what is one integrator's own stands in its file."""

from __future__ import annotations

from dataclasses import dataclass

from romdam.core.arrays import Floats
from romdam.core.final_state import FinalState
from romdam.timestepping.steps import Steps


@dataclass(frozen=True)
class Start:
    """A state to go on from, as a row of a `History` holds it.

    Attributes
    ----------
    q, v : (n,) unknowns of a diagonal system and their rates
    jump, traction : (ng, d) of the gaps [m], [N]
    memory : (L, ng, s) what the further laws keep, see `romdam.contact.problem.GapMemory`; None without any
    """

    q: Floats
    v: Floats
    jump: Floats
    traction: Floats
    memory: Floats | None = None


@dataclass(frozen=True)
class Settings:
    """Settings of a run.

    Attributes
    ----------
    steps : base step, cuts and written rows; an integrator's `steps` makes those that suit it
    tolerance : allowed relative residual of the gap-space problem of a step
    initial_state : "static" (equilibrium under the static loads) or "undeformed" (at rest)
    start : state to go on from, instead of `initial_state`; a row of a history of integrators that resume,
        or the state in which a run of the same system and integrator ended, of any
    shift : (nt, directions * ng) jumps added at every base step, linear in between; of those that
        resume [m]
    to_accuracy : whether an accuracy chose the steps, and not a job
    shear_share : of the change of a shear that an integrator lets pass within a step, the share that is let
        pass; finer runs, by which others are judged, let less
    only_jumps : whether histories may have rows of the jumps alone, which is all a comparison reads
    every_step : whether histories have the motion of the output nodes at every base step besides the rows
    """

    steps: Steps
    tolerance: float = 1e-8
    initial_state: str = "static"
    start: Start | FinalState | None = None
    shift: Floats | None = None
    to_accuracy: bool = False
    shear_share: float = 1.0
    only_jumps: bool = False
    every_step: bool = False


def not_converged(step: int, settings: Settings, residual: float, place: str) -> str:
    """Message for a step whose gap-space problem did not converge."""
    asked = settings.to_accuracy
    remedy = "give transient.finest_step in place of accuracy" if asked else "halve transient.finest_step"
    return (
        f"step {step}, t = {step * settings.steps.base:.6g} s: the gap-space problem stopped at a relative "
        f"residual of {residual:.2g}, limit {settings.tolerance:.2g}, farthest at {place}; "
        f"{remedy}, or lower the friction"
    )
