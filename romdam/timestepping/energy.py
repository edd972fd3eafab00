"""The energy ledger: where the input went, in joules, relative to the moving base.

    residual = kinetic + strain + joint_stored + damping + friction + contact + numerical - input - initial

`input` is the work of the inertia forces, the static loads and the water that enters gaps, `contact` what the
implicit joint force takes away at closure and opening (numerical, never negative: the force times the
jump's change is at least the change of the stored energy, see `romdam.contact.problem`), `friction` the work
done in sliding, and `numerical` what a scheme that damps by itself (generalised-alpha) takes from the motion;
others have no such term. The residual is round-off with every scheme.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from romdam.core.arrays import Floats, Record, record_type

ENERGIES = record_type(input=float, damping=float, joint_work=float, friction=float, stored=float)
_EXCHANGED = ("input", "kinetic", "strain", "joint_stored")
_AT_REST = 1e-9  # of the energy that rests in the scene: an exchange below it is round-off
_ITERATED = 1e-4  # the same of schemes that damp by themselves: they iterate, and what rests is found to 1e-8


def ledger(
    works: Record, kinetic: Floats, strain: Floats, numerical: Floats | None = None
) -> dict[str, Floats]:
    """Assemble the ledger.

    Parameters
    ----------
    works : (nt,) works since the start and energy stored in the gaps, see `ENERGIES` [J]
    kinetic, strain : (nt,) energies of the blocks [J]
    numerical : (nt,) taken by the scheme's own damping since the start [J]; None where it has none

    Returns
    -------
    dict of (nt,) arrays with the keys of `romdam.core.system.ENERGY_TERMS`, and "numerical" where it is given
    """
    work_in, damping, joint_work, friction, stored = (works[name] for name in ENERGIES.names or ())
    contact = -joint_work - (stored - stored[0]) - friction
    change = (kinetic - kinetic[0]) + (strain - strain[0])
    of_scheme = {} if numerical is None else {"numerical": numerical}
    taken = damping if numerical is None else damping + numerical
    return {
        "input": work_in,
        "kinetic": kinetic,
        "strain": strain,
        "joint_stored": stored,
        "damping": damping,
        "friction": friction,
        "contact": contact,
        **of_scheme,
        "residual": change + taken - joint_work - work_in,
    }


def exchanged(energy: Mapping[str, Floats]) -> float:
    """Largest energy that was exchanged, of a scene at rest a small part of what rests in it [J]."""
    moved = max(float(np.ptp(energy[name])) for name in _EXCHANGED)
    rests = max(float(np.abs(energy[name]).max()) for name in _EXCHANGED)
    return max(moved, (_ITERATED if "numerical" in energy else _AT_REST) * rests)


def imbalance(energy: Mapping[str, Floats]) -> float:
    """Tell how far a ledger is open: its largest residual over the largest energy that was exchanged."""
    size = exchanged(energy)
    return float(np.abs(energy["residual"]).max()) / size if size > 0.0 else 0.0
