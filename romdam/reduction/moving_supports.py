"""Moving supports on a reduced system: what they carry along is a load, and no coordinate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.system import PseudoStatic, System
from romdam.fem.pseudo_static import applied
from romdam.fem.water.added_mass import AddedMass
from romdam.reduction.basis import over_coordinates


def with_supports(
    system: System,
    basis: dict[str, BlockBasis],
    moving: PseudoStatic | None,
    inertia: dict[str, Floats],
    water: AddedMass | None,
) -> System:
    """Give a system the load of its moving supports: the inertia of what they displace, water's too.

    Parameters
    ----------
    inertia : block name -> M u_s, (3 nodes, m) [kg]
    """
    if moving is None:
        return system
    load = np.zeros((system.size, len(moving.stiffness)))
    for name, block in basis.items():
        load[block.columns] += block.vectors.project(inertia[name])
    if water is not None:
        wet = over_coordinates(water.coupling, basis, system.size)
        load += wet.T @ water.times(applied(water.coupling, moving.shapes))
    return replace(system, load=np.hstack([system.load, load]), pseudo_static=moving)
