"""Systems that are shaken about a state at rest of other moduli, see `System.sustained`."""

from __future__ import annotations

from dataclasses import replace

from romdam.core.system import System
from romdam.timestepping.equilibrium import static_equilibrium


def before_rest(system: System) -> System:
    """The system before its state at rest is known; itself where moduli do not go by duration."""
    if system.sustained is None or system.sustained.rest is None:
        return system
    return replace(
        system, force=system.force - system.sustained.force, sustained=replace(system.sustained, rest=None)
    )


def rested(system: System, tolerance: float) -> System:
    """The system with the state at rest that what the record adds begins at; itself where moduli are one.

    Raises
    ------
    ConvergenceError
        where no equilibrium is found.
    """
    if system.sustained is None:
        return system
    return system.rested(static_equilibrium(system, tolerance)[0])
