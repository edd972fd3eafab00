"""One run by an integrator's name; used by the tests of several rooms and by the benchmarks."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from romdam.core.arrays import Floats
from romdam.core.system import History, System
from romdam.timestepping.integrators.registry import integrator_class
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import Steps

CUTS = (4, 4)  # of the integrator that cuts its steps


def prepared_for(system: System, integrator: str = "modal", **options: Any) -> Prepared:
    """A system with an integrator; `options` are the integrator's own."""
    return Prepared(system, integrator_class(integrator)(**options))


def steps_for(integrator: str, dt: float, stride: int = 1, cuts: Sequence[int] = CUTS) -> Steps:
    """A base step, cut by the integrator that cuts."""
    return Steps(dt, stride, tuple(cuts) if integrator == "adaptive" else ())


def simulated(
    system: System,
    ground: Floats,
    dt: float,
    integrator: str = "modal",
    stride: int = 1,
    cuts: Sequence[int] = CUTS,
    **options: Any,
) -> History:
    """One history; `options` are the integrator's own, and those of `Settings`."""
    chosen: Any = integrator_class(integrator)  # a frozen dataclass
    names = {field.name for field in fields(chosen)}
    own = {name: value for name, value in options.items() if name in names}
    others = {name: value for name, value in options.items() if name not in names}
    settings = Settings(steps_for(integrator, dt, stride, cuts), **others)
    return simulate_one(prepared_for(system, integrator, **own), ground, settings)
