"""Joints grouted under pressure: the gaps' reference is where the pressure has pushed the blocks.

Before every other load the pressure p acts on both sides of the joints that are grouted, which neither pull
nor hold shear yet; the others are as they are. The grout fills what opens, and sets: there the gaps then
carry p A, in equilibrium with the blocks that it bends. So the opening of that state is taken from the
initial gap, and p A / K_n with it. Loads that follow add to it as to any other state.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.contact.components import NORMAL
from romdam.core.errors import ConvergenceError
from romdam.core.system import GapLaw, System, with_parameters
from romdam.timestepping.equilibrium import static_equilibrium


def grouted(system: System, tolerance: float) -> System:
    """The system after the grouting of its joints; itself where none is grouted under pressure.

    Raises
    ------
    ConvergenceError
        where the other joints and the supports cannot hold the blocks against the pressure.
    """
    law = system.law
    if not law.grout.any():
        return system
    stage = with_parameters(system, _before(law), None)
    force = stage.B[:: stage.law.directions].T @ law.grout
    try:
        _, gaps = static_equilibrium(replace(stage, force=np.asarray(force)), tolerance)
    except ConvergenceError as error:
        raise ConvergenceError(
            "joints: grouting_pressure acts before weight and water, and nothing holds the blocks; "
            f"lower it, or give the other joints cohesion or supports ({error})"
        ) from None
    filled = np.maximum(gaps.jump[:, NORMAL], 0.0) + law.grout / law.K_n
    gap = law.gap - np.where(law.grout > 0.0, filled, 0.0)
    return replace(system, law=replace(law, gap=gap, grout=np.zeros(0)))


def _before(law: GapLaw) -> GapLaw:
    """The gaps before the grout has set."""
    set_before = law.grout == 0.0
    return replace(
        law,
        K_nz=law.K_nz * set_before,
        mu=law.mu * set_before[:, None],
        laws=tuple(replace(rows, on=rows.on & set_before) for rows in law.laws),
        grout=np.zeros(0),
    )
