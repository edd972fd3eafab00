"""How to integrate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats


@dataclass(frozen=True)
class Start:
    """A state to go on from, as a row of a `History` holds it.

    Attributes
    ----------
    q, v : (n,) unknowns of a diagonal system and their rates
    jump, traction : (ng, d) of the gaps [m], [N]
    weak : (ng, 3) what the gaps have lost, see `romdam.contact.problem.GapMemory`; None where nothing can be
    """

    q: Floats
    v: Floats
    jump: Floats
    traction: Floats
    weak: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class TransientOptions:
    """Settings of a time integration.

    Attributes
    ----------
    dt : base step [s]
    stride : base steps per written row
    integrator : a key of `romdam.timestepping.simulate.INTEGRATORS`
    rho_inf : spectral radius at infinite frequency (generalized_alpha only)
    tolerance : allowed relative residual of the gap-space problem of a step
    initial_state : "static" (equilibrium under the static loads) or "undeformed" (at rest, undeformed)
    cuts : into how many a step is cut at each level below the base step (adaptive only)
    force_change : what the change of a joint force over a step may do before the step is cut, as a gap
        velocity relative to the peak ground velocity (adaptive only)
    midpoint : whether joint forces follow their springs at a point within the step, see
        `romdam.contact.problem` (adaptive and generalized_alpha)
    flexible_ratio : modes damped above this ratio answer a joint force as a relaxing flexibility and are
        no states (adaptive only)
    alike : whether gaps that provably move alike are marched as one (adaptive only)
    start : state to go on from, instead of `initial_state` (diagonal systems)
    shift : (nt, directions * ng) jumps added at every base step, linear in between (diagonal systems) [m]
    coordinates : whether histories carry the coordinates q and v, which take as long to make as a step for
        every row (diagonal systems)
    """

    dt: float
    stride: int = 1
    integrator: str = "modal"
    rho_inf: float = 0.9
    tolerance: float = 1e-8
    initial_state: str = "static"
    cuts: tuple[int, ...] = (4, 4)
    force_change: float = 0.003
    midpoint: bool = True
    flexible_ratio: float = 0.7
    alike: bool = True
    start: Start | None = None
    shift: Floats | None = None
    coordinates: bool = True
