"""Joints grouted under pressure: the gaps' reference is where the pressure has pushed the blocks.

Before every other load the pressure p acts on both sides of the joints that are grouted, which neither pull
nor hold shear yet; the others are as they are. The grout fills what opens, and sets: there the gaps then
carry p A and no shear, in equilibrium with the blocks that it bends. So the jump of that state is taken from
the initial one, along the normal and along both tangents, and p A / K_n with it. Loads that follow add to it
as to any other state. What the other joints lost or slid in it stays lost and slid.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.contact.components import NORMAL
from romdam.contact.problem import gap_memory
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConvergenceError
from romdam.core.system import GapLaw, System, with_parameters
from romdam.timestepping.equilibrium import GapState, static_equilibrium, system_gap_problem

_ROUND_OFF = 1e-12  # of the largest jump: less is no slip


def grouted(system: System, tolerance: float) -> System:
    """The system after the grouting of its joints; itself where none is grouted under pressure.

    Raises
    ------
    ConvergenceError
        where the other joints and the supports cannot hold the blocks against the pressure.
    """
    law, d = system.law, system.law.directions
    if not law.grout.any():
        return system
    stage = with_parameters(system, _before(law), None)
    force = stage.B[:: stage.law.directions].T @ law.grout
    try:
        q, gaps = static_equilibrium(replace(stage, force=np.asarray(force)), tolerance)
    except ConvergenceError as error:
        raise ConvergenceError(
            "joints: grouting_pressure acts before weight and water, and nothing holds the blocks; "
            f"lower it, or give the other joints cohesion or supports ({error})"
        ) from None
    fills = law.grout > 0.0
    filled = np.maximum(gaps.jump[:, NORMAL], 0.0) + law.grout / law.K_n
    after = replace(law, gap=law.gap - np.where(fills, filled, 0.0), grout=np.zeros(0))
    if d == 3:
        after = replace(after, slip=np.where(fills[:, None], -(system.B @ q).reshape(-1, 3)[:, 1:], 0.0))
    return replace(system, law=_with_memory(replace(system, law=after), gaps, fills))


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


def _with_memory(system: System, gaps: GapState, fills: Bools) -> GapLaw:
    """The law of a grouted system with what the joints that are not grouted remember of it.

    Parameters
    ----------
    gaps : at the end of grouting
    fills : (ng,) which gaps are grouted; they start afresh
    """
    law, size = system.law, system.law.directions * len(fills)
    slipped: Floats = np.zeros((0, 2))
    if len(gaps.accumulated_slip):
        slip = np.where(fills[:, None], 0.0, gaps.accumulated_slip)
        slipped = slip if np.abs(slip).max() > _ROUND_OFF * np.abs(gaps.jump).max() else slipped
    memory = gap_memory(system_gap_problem(system, np.zeros((size, size)))).history
    if not memory.size:
        return replace(law, slipped=slipped)
    # without friction at joints that are not grouted the stage has no row for it, which keeps nothing
    rows, start = len(memory) - len(gaps.history), memory.copy()
    memory[rows:, ~fills] = gaps.history[:, ~fills]
    return replace(law, slipped=slipped, memory=np.zeros((0, 0, 0)) if (memory == start).all() else memory)
