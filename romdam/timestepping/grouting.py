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
from romdam.core.errors import ConvergenceError, NoEquilibriumError
from romdam.core.system import System, with_parameters
from romdam.timestepping.equilibrium import static_equilibrium, system_gap_problem

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
    fills = law.grout > 0.0
    fluid = replace(  # before the grout has set it carries no shear and no tension
        law,
        K_nz=law.K_nz * ~fills,
        mu=law.mu * ~fills[:, None],
        laws=tuple(replace(rows, on=rows.on & ~fills) for rows in law.laws),
        grout=np.zeros(0),
    )
    stage = with_parameters(system, fluid, None)
    force = stage.B[:: stage.law.directions].T @ law.grout
    try:
        q, gaps = static_equilibrium(replace(stage, force=np.asarray(force), load_steps={}), tolerance)
    except NoEquilibriumError as error:
        raise NoEquilibriumError(
            "joints: grouting_pressure acts before weight and water, and nothing holds the blocks; "
            f"lower it, or give the other joints cohesion or supports ({error})"
        ) from None
    except ConvergenceError as error:
        raise ConvergenceError(f"joints: grouting_pressure, before weight and water: {error}") from None
    filled = np.maximum(gaps.jump[:, NORMAL], 0.0) + law.grout / law.K_n
    after = replace(law, gap=law.gap - np.where(fills, filled, 0.0), grout=np.zeros(0))
    if d == 3:
        after = replace(after, slip=np.where(fills[:, None], -(system.B @ q).reshape(-1, 3)[:, 1:], 0.0))
    # what the joints that are not grouted remember of the stage; those that are start afresh
    slipped: Floats = np.zeros((0, 2))
    if len(gaps.accumulated_slip):
        slip = np.where(fills[:, None], 0.0, gaps.accumulated_slip)
        slipped = slip if np.abs(slip).max() > _ROUND_OFF * np.abs(gaps.jump).max() else slipped
    after, size = replace(after, slipped=slipped), d * len(fills)
    problem = system_gap_problem(replace(system, law=after), np.zeros((size, size)))
    memory = gap_memory(problem).history
    if memory.size:
        # without friction at joints that are not grouted the stage has no row for it, which keeps nothing
        rows, start = len(memory) - len(gaps.history), memory.copy()
        memory[rows:, ~fills] = gaps.history[:, ~fills]
        after = replace(after, memory=np.zeros((0, 0, 0)) if (memory == start).all() else memory)
    return replace(system, law=after, point_shift=_filled_at_points(system, q, gaps.jump, fills))


def _filled_at_points(system: System, q: Floats, jump: Floats, fills: Bools) -> Floats | None:
    """What the grout takes off the jumps at the gaps' positions beside those that joint forces see.

    It fills what is open there, too: a gap that has just been grouted is closed wherever it is looked at.

    Parameters
    ----------
    q : (n,) displacement when the grout sets
    jump : (ng, d) of the gaps then, d the directions of the stage
    fills : (ng,) gaps that are grouted
    """
    if system.at_point is None:
        return None
    d = system.law.directions
    more = (system.at_point @ q).reshape(-1, d)
    shift = np.where(fills[:, None], -more, 0.0)
    at_rest = jump[:, NORMAL]
    shift[:, NORMAL] = np.where(
        fills, np.maximum(at_rest, 0.0) - np.maximum(at_rest + more[:, NORMAL], 0.0), 0.0
    )
    return np.asarray(shift.ravel())
