"""Share of supports of their own motion in a run: jumps while it goes, and the rest to its history.

The integrators have the displacement u that supports do not carry (`romdam.core.system.PseudoStatic`). Joint
forces do work on jumps that are carried along too, which the supports supply: the ledger's input has it, and
the work that strains the blocks. Its kinetic energy is that of u.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.system import History, PseudoStatic, System


@dataclass(frozen=True)
class Carried:
    """Jumps that moving supports make at one instant.

    Attributes
    ----------
    by : what moves; None where nothing does
    jump : (N,) that joint forces see, with those that a statement of error adds [m]
    more : (N,) what jumps at the gaps' positions are more [m]
    """

    by: PseudoStatic | None
    jump: Floats
    more: Floats

    @classmethod
    def at_rest(cls, system: System) -> Self:
        """None yet."""
        zero = np.zeros(system.B.shape[0])
        return cls(system.pseudo_static, zero, zero)

    def after(self, disp: Floats, added: Floats | None) -> Self:
        """The jumps where supports have moved by `disp` (m,), with `added` ones (N,) or without."""
        if self.by is None:
            return self if added is None else replace(self, jump=added)
        more = self.more if self.by.at_point is None else self.by.at_point @ disp
        jump = self.by.jump @ disp
        return replace(self, jump=jump if added is None else jump + added, more=more)


def add_carried_jumps(history: History, system: System, ground: Floats, stride: int) -> History:
    """Add to jumps that joint forces see what moving supports make of them at the gaps' positions.

    Parameters
    ----------
    ground, stride : see `add_support_motion`
    """
    by = system.pseudo_static
    if by is None or by.at_point is None:
        return history
    more = (by.at_point @ by.motion(ground)[2][:, ::stride]).T
    return replace(history, jump=history.jump + more.reshape(history.jump.shape))


def add_support_motion(history: History, system: System, ground: Floats, stride: int) -> History:
    """Add what moving supports do to the written rows, but for the jumps, and to nodes between them.

    Parameters
    ----------
    ground : of the run, at every base step, see `PseudoStatic.motion`
    stride : base steps a row
    """
    by = system.pseudo_static
    if by is None:
        return history
    acc, vel, every_disp = by.motion(ground)
    acc, vel, disp = (rows[:, ::stride].T for rows in (acc, vel, every_disp))
    between = history.base_disp
    if len(between):
        between = between + every_disp.T @ by.observe.T
    strain = 0.5 * np.einsum("ti,ij,tj->t", disp, by.stiffness, disp, optimize=True)
    energy = history.energy | {
        "strain": history.energy["strain"] + strain,
        "input": history.energy["input"] + strain - strain[:1],
    }
    return replace(
        history,
        disp=history.disp + disp @ by.observe.T,
        base_disp=between,
        vel=history.vel + vel @ by.observe.T,
        acc=history.acc + acc @ by.observe.T,
        energy=energy,
        supports=disp,
    )
