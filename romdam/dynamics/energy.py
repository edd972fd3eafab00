"""The energy ledger: where the input went, in joules, relative to the moving base.

    residual = kinetic + strain + joint_stored + damping + friction + contact - input - initial

`input` is the work of the inertia forces and static loads, `contact` what the implicit joint force
takes away at closure and opening (numerical, never negative: the force times the jump's change is at least
the change of the stored energy, see `romdam.joints.problem`), `friction` the work done in sliding. With the
exact modal scheme the residual is round-off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ACCUMULATED = ("input", "damping", "joint_work", "friction")
TERMS = (
    "input",
    "kinetic",
    "strain",
    "joint_stored",
    "damping",
    "friction",
    "contact",
    "residual",
)


def ledger(accumulated: Floats, kinetic: Floats, strain: Floats, stored: Floats) -> dict[str, Floats]:
    """Assemble the ledger.

    Parameters
    ----------
    accumulated : (nt, 4) works since the start, in the order of `ACCUMULATED` [J]
    kinetic, strain, stored : (nt,) energies of the blocks and of the gaps [J]

    Returns
    -------
    dict of (nt,) arrays with the keys of `TERMS`
    """
    work_in, damping, joint_work, friction = accumulated.T
    contact = -joint_work - (stored - stored[0]) - friction
    change = (kinetic - kinetic[0]) + (strain - strain[0])
    return {
        "input": work_in,
        "kinetic": kinetic,
        "strain": strain,
        "joint_stored": stored,
        "damping": damping,
        "friction": friction,
        "contact": contact,
        "residual": change + damping - joint_work - work_in,
    }
