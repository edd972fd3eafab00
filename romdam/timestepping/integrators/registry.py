"""Integrators by name, and the one that suits a system."""

from __future__ import annotations

from importlib import import_module

from romdam.core.errors import ConfigError
from romdam.core.integrators import INTEGRATORS
from romdam.core.system import System
from romdam.timestepping.prepared import Integrator

FULL_ORDER = "generalized_alpha"  # suits any system, and the unreduced mesh


def integrator_class(name: str) -> type[Integrator]:
    """Load an integrator.

    Raises
    ------
    ConfigError
        for a name that is not registered.
    """
    if name not in INTEGRATORS:
        raise ConfigError(f"no integrator {name!r}; there are {', '.join(INTEGRATORS)}")
    module, _, kind = INTEGRATORS[name].source.partition(":")
    integrator: type[Integrator] = getattr(import_module(module), kind)
    return integrator


def suitable_integrator(system: System) -> str:
    """Name the integrator for a system.

    Uncoupled modes with plain joints but no damping at all get the scheme that conserves energy, any other
    uncoupled modes the one that cuts its steps where contact changes; the unreduced mesh, and modes that the
    dashpots of absorbing faces or compressible water couple, generalised-alpha.
    """
    if not system.diagonal:
        return FULL_ORDER
    plain = len(system.law) > 0 and not system.law.has_memory
    return "conserving" if plain and not system.C.diagonal().any() else "adaptive"
