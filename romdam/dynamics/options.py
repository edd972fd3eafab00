"""How to integrate."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class TransientOptions:
    """Settings of a time integration.

    Attributes
    ----------
    dt : base step [s]
    stride : base steps per written row
    integrator : a key of `romdam.dynamics.transient.INTEGRATORS`
    rho_inf : spectral radius at infinite frequency (generalized_alpha only)
    tolerance : allowed relative residual of the gap-space problem of a step
    initial_state : "static" (equilibrium under the static loads) or "from_start" (at rest, undeformed)
    halvings : how often a base step may be halved where contact changes (adaptive only)
    impulse : gap velocity that the change of a joint force over a step may stand for before the step
        is halved [m/s] (adaptive only)
    state_cutoff : modes above this frequency answer as a relaxing flexibility [Hz] (adaptive only)
    """

    dt: float
    stride: int = 1
    integrator: str = "modal"
    rho_inf: float = 0.9
    tolerance: float = 1e-8
    initial_state: str = "static"
    halvings: int = 4
    impulse: float = math.inf
    state_cutoff: float = math.inf
    ratio: int = 2
    calm: int = 0
