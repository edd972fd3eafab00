"""How to integrate."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TransientOptions:
    """Settings of a time integration.

    Attributes
    ----------
    dt : step [s]
    stride : steps per written row
    integrator : a key of `romdam.dynamics.transient.INTEGRATORS`
    rho_inf : spectral radius at infinite frequency (generalized_alpha only)
    tolerance : allowed relative residual of the gap-space problem of a step
    initial_state : "static" (equilibrium under the static loads) or "from_start" (at rest, undeformed)
    """

    dt: float
    stride: int = 1
    integrator: str = "modal"
    rho_inf: float = 0.9
    tolerance: float = 1e-8
    initial_state: str = "static"
