"""How far the state at rest depends on the order in which the loads came.

Friction and cracks leave a range of equilibria, of which the order of the loads selects one. The same loads
in the reversed order select another, so the difference of the two says how wide the range is at least.
"""

from __future__ import annotations

import numpy as np

from romdam.contact.components import NORMAL
from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError
from romdam.core.system import System
from romdam.timestepping.equilibrium import (
    GapState,
    ProximalStep,
    initial_state,
    load_path,
    static_equilibrium,
)
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings

_MN = 1e-6  # [1/N]
_WIDE = 0.02  # of the largest force of a joint, from which on the range is stated


def order_warnings(prepared: Prepared, settings: Settings) -> tuple[str, ...]:
    """Say how wide the range of states at rest is, a sentence where it is wide; made once for all runs.

    The first call finds the state at rest too, so that both orders share what they factor.
    """
    system, tolerance = prepared.system, settings.tolerance
    if (
        not prepared.compares_orders
        or settings.initial_state != "static"
        or settings.start is not None
        or len(load_path(system)) == 1
    ):
        return ()
    return prepared.cache.get_or_compute(
        ("order of loads", tolerance),
        lambda: _compared(prepared, settings),
    )


def _compared(prepared: Prepared, settings: Settings) -> tuple[str, ...]:
    system, steps = prepared.system, dict[float, ProximalStep]()
    try:
        _, gaps = initial_state(prepared, settings, steps)
        _, reversed_gaps = static_equilibrium(system, settings.tolerance, steps, reverse=True)
    except ConvergenceError:
        return ()  # loads that hold each other in one order alone; without a state the run says why
    names = list(system.law.joints)
    there, back = (_resultants(system, state) for state in (gaps, reversed_gaps))
    apart, size = np.linalg.norm(there - back, axis=1), np.linalg.norm(there, axis=1).max(initial=0.0)
    if not names or not apart.max() > _WIDE * size:
        return ()
    k = int(np.argmax(apart))
    (n, t), (n_back, t_back) = ((force[k, NORMAL], np.linalg.norm(force[k, 1:])) for force in (there, back))
    order = list(system.load_steps)
    return (
        f"the state at rest depends on the order of the loads: joint {names[k]} carries {_MN * n:.4g} MN of "
        f"compression and {_MN * t:.4g} MN of shear where {', '.join(order)} follow each other "
        f"(loads.order), and {_MN * n_back:.4g} and {_MN * t_back:.4g} MN in the reversed order, "
        f"{100.0 * apart[k] / size:.2g} % of the largest force of a joint; give the order in which they came",
    )


def _resultants(system: System, gaps: GapState) -> Floats:
    """Forces of the joints along the axes of their gaps, (joints, d) [N]."""
    return np.array([gaps.force[of].sum(axis=0) for of in system.law.joints.values()])
