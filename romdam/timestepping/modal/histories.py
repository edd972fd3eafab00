"""Make the history of a run from the rows that the time loop has kept of it.

The loop keeps the dynamic modes, the relaxed joint force and the gaps. A history also has the motion of the
modes that are no states of the loop. Their displacement is a static answer to the joint force, to the ground
and to the constant loads, so it is computed here, once for all rows and only for the points that are asked
for.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, at
from romdam.core.recorded import gap_fields
from romdam.core.system import Coordinates, History, System
from romdam.timestepping.energy import ledger
from romdam.timestepping.equilibrium import with_water
from romdam.timestepping.modal.arrays import ModalModel, Recorded
from romdam.timestepping.modal.mode_split import ModeSplit
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings

_DENSE = 0.1  # share of entries from which on a dense product is quicker: 15 times with all, 7 with a third


def history_of_rows(
    prepared: Prepared,
    model: ModalModel,
    split: ModeSplit,
    rows: Recorded,
    acc: Floats,
    settings: Settings,
) -> History:
    """The written rows of one run, without peaks and stats.

    Parameters
    ----------
    rows : of this run
    acc : (loads, nt) what shakes the model in them
    """
    system, dynamic = prepared.system, split.dynamic
    k, c = system.K.diagonal()[dynamic], system.C.diagonal()[dynamic]
    coordinates, energy = None, dict[str, Floats]()
    time = np.arange(len(rows.q), dtype=np.float64) * settings.steps.interval
    follows = acc.T.copy()
    follows[:1] = 0.0  # the first row is the state that the run begins in
    jump = rows.gaps.jump
    if system.at_point is not None:
        at_points = Observed.of(prepared, split, "at_point").displacement(rows, follows)
        if system.point_shift is not None:
            at_points = at_points + system.point_shift
        jump = jump + at_points.reshape(jump.shape)
    if settings.only_jumps:
        rows, acc, follows = at(rows, slice(0)), acc[:, :0], follows[:0]
    else:
        coordinates = Coordinates(partial(_whole_motion, system, split, rows, follows))
        kinetic, strain = 0.5 * (rows.v**2) @ system.M.diagonal()[dynamic], 0.5 * (rows.q**2) @ k
        if len(model.R):  # the relaxed flexibility
            strain = strain + 0.5 * np.einsum("ti,ti->t", rows.s @ model.R, rows.s)
        energy = ledger(rows.energies, kinetic, np.asarray(strain))
    observed = Observed.of(prepared, split, "observe")
    # acceleration of the dynamic modes alone, from their equations of motion
    seen = system.observe.toarray().T[dynamic]
    observed_acc = model.static @ seen - acc.T @ (system.load[dynamic].T @ seen)
    force = with_water(rows.gaps.traction, rows.gaps.water)
    observed_acc += force.reshape(len(force), len(split.G)) @ (split.G @ seen)
    observed_acc -= rows.v @ (c[:, None] * seen) + rows.q @ (k[:, None] * seen)
    return History(
        **gap_fields(rows.gaps) | {"jump": jump},
        time=time,
        disp=observed.displacement(rows, follows),
        vel=rows.v @ observed.states.T,
        acc=np.asarray(observed_acc),
        coordinates=coordinates,
        energy=energy,
        peaks={},
        stats={},
        integrator=prepared.integrator.name,
    )


class Observed(NamedTuple):
    """Operators from what the time loop keeps to the motion of all modes, as `_whole_motion` has it.

    Attributes
    ----------
    states : (r, m) per displacement, or velocity, of the dynamic modes
    forces : (N, r) per relaxed joint force
    rest : (r,) under the static load, of the quasi-static modes
    ground : (loads, r) per ground acceleration, of the quasi-static modes
    """

    states: Floats | csr_matrix
    forces: Floats
    rest: Floats
    ground: Floats

    @classmethod
    def of(cls, prepared: Prepared, split: ModeSplit, name: str) -> Self:
        """Operators of what the system's operator of that name, on all modes, sees; made once."""
        key = ("observed", name, *split.key)
        return prepared.cache.get_or_compute(key, lambda: cls.computed(prepared.system, split, name))

    @classmethod
    def computed(cls, system: System, split: ModeSplit, name: str) -> Self:
        """See `of`."""
        seen, k = getattr(system, name), system.K.diagonal()
        quasi_static = seen[:, split.quasi_static].toarray().T
        flexible = quasi_static / k[split.quasi_static, None]
        forces, states = split.G_quasi @ flexible, seen[:, split.dynamic]
        tapered = np.flatnonzero(split.taper < 1.0)
        if len(tapered):
            left = (1.0 / split.taper[tapered] - split.taper[tapered]) / k[split.dynamic[tapered]]
            forces += (split.G[:, tapered] * left) @ states[:, tapered].toarray().T
        states = states.multiply(split.taper).tocsr()
        if name == "observe" or states.nnz > _DENSE * states.shape[0] * states.shape[1]:  # probes are few
            states = states.toarray()
        ground = split.ground_answer(system).T @ quasi_static
        return cls(states, forces, system.force[split.quasi_static] @ flexible, ground)

    def displacement(self, rows: Recorded, acc: Floats) -> Floats:
        """(nt, r) in the rows, the ground's acceleration in them (nt, loads)."""
        disp = rows.q @ self.states.T + self.rest
        if self.forces.any():
            disp += rows.s @ self.forces
        if self.ground.any():
            disp += acc @ self.ground
        return np.asarray(disp)

    def more(self, acc: Floats) -> Floats:
        """(nt, r) what neither states nor joint forces make of it, at the ground's acceleration."""
        return np.asarray(acc @ self.ground + self.rest)


def _whole_motion(
    system: System, split: ModeSplit, all_rows: Recorded, acc: Floats, chosen: slice
) -> tuple[Floats, Floats]:
    """All modes' displacements and velocities; quasi-static ones answer joint forces and the ground.

    Parameters
    ----------
    acc : (nt, loads) ground acceleration in every row
    """
    rows = at(all_rows, chosen)
    q, v = np.zeros((len(rows.q), system.size)), np.zeros((len(rows.q), system.size))
    q[:, split.dynamic], v[:, split.dynamic] = rows.q * split.taper, rows.v * split.taper
    tapered = np.flatnonzero(split.taper < 1.0)
    if len(tapered):
        k = system.K.diagonal()[split.dynamic[tapered]]
        left = (1.0 / split.taper[tapered] - split.taper[tapered]) / k
        q[:, split.dynamic[tapered]] += rows.s @ (split.G[:, tapered] * left)
    if len(split.quasi_static):
        k = system.K.diagonal()[split.quasi_static]
        q[:, split.quasi_static] = (rows.s @ split.G_quasi + system.force[split.quasi_static]) / k
        q[:, split.quasi_static] += acc[chosen] @ split.ground_answer(system).T
    return q, v
