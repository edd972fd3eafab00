"""Histories of runs, from the rows that the time loop has kept of each."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.system import Coordinates, History, System
from romdam.timestepping.energy import ledger
from romdam.timestepping.equilibrium import with_water
from romdam.timestepping.modal.arrays import HistoryBuffer, ModalModel
from romdam.timestepping.modal.mode_split import ModeSplit
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings

_DENSE = 0.1  # share of entries from which on a dense product is quicker: 15 times with all, 7 with a third
ROWS = tuple(name for name in HistoryBuffer._fields if name != "stride")


def some_rows(buffer: HistoryBuffer, rows: slice) -> HistoryBuffer:
    """Views of some rows."""
    return buffer._replace(**{name: getattr(buffer, name)[rows] for name in ROWS})


def history_of_rows(
    prepared: Prepared,
    arrays: tuple[ModalModel, ModeSplit],
    buffer: HistoryBuffer,
    acc: Floats,
    settings: Settings,
) -> History:
    """The written rows of one run, without peaks and stats.

    Parameters
    ----------
    buffer : its rows
    acc : (loads, nt) what shakes the model in them
    """
    (_, split), system = arrays, prepared.system
    coordinates, energy = None, dict[str, Floats]()
    time = np.arange(len(buffer.q), dtype=np.float64) * settings.steps.interval
    jump = _at_points(prepared, split, buffer)
    if settings.only_jumps:
        buffer, acc = some_rows(buffer, slice(0)), acc[:, :0]
    else:
        coordinates = Coordinates(partial(_whole_motion, system, split, buffer))
        kinetic = 0.5 * (buffer.v**2).sum(axis=1)
        energy = ledger(buffer.energies, kinetic, _strain(system, arrays, buffer))
    seen = _observed(prepared, split, "observe")
    return History(
        time=time,
        jump=jump,
        traction=buffer.force,
        water=buffer.water,
        mean_traction=buffer.impulse / settings.steps.interval,
        state=buffer.state,
        disp=seen.displacement(buffer),
        vel=buffer.v @ seen.states.T,
        acc=_observed_acceleration(system, arrays, buffer, acc),
        coordinates=coordinates,
        energy=energy,
        peaks={},
        stats={},
        integrator=prepared.integrator.name,
    )


class _Observed(NamedTuple):
    """Operators from what the time loop keeps to the motion of all modes, as `_whole_motion` has it.

    Attributes
    ----------
    states : (r, m) per displacement, or velocity, of the dynamic modes
    forces : (N, r) per relaxed joint force
    rest : (r,) under the static load, of the quasi-static modes
    """

    states: Floats | csr_matrix
    forces: Floats
    rest: Floats

    def displacement(self, buffer: HistoryBuffer) -> Floats:
        """(nt, r) in the rows."""
        disp = buffer.q @ self.states.T + self.rest
        if self.forces.any():
            disp += buffer.s @ self.forces
        return np.asarray(disp)


def _observed(prepared: Prepared, split: ModeSplit, name: str) -> _Observed:
    """Operators for what one of the system's own, on all modes, sees; made once."""
    make = partial(_make_observed, prepared.system, split, name)
    return prepared.cache.get_or_compute(("observed", name, *split.key), make)


def _make_observed(system: System, split: ModeSplit, name: str) -> _Observed:
    seen, k = getattr(system, name), system.K.diagonal()
    flexible = seen[:, split.quasi_static].toarray().T / k[split.quasi_static, None]
    forces, states = split.G_quasi @ flexible, seen[:, split.dynamic]
    tapered = np.flatnonzero(split.taper < 1.0)
    if len(tapered):
        left = (1.0 / split.taper[tapered] - split.taper[tapered]) / k[split.dynamic[tapered]]
        forces += (split.G[:, tapered] * left) @ states[:, tapered].toarray().T
    states = states.multiply(split.taper).tocsr()
    if name == "observe" or states.nnz > _DENSE * states.shape[0] * states.shape[1]:  # probes are few
        states = states.toarray()
    return _Observed(states, forces, system.force[split.quasi_static] @ flexible)


def _at_points(prepared: Prepared, split: ModeSplit, buffer: HistoryBuffer) -> Floats:
    """Jumps at the gaps' very positions."""
    if prepared.system.at_point is None:
        return buffer.jump
    more = _observed(prepared, split, "at_point").displacement(buffer)
    return buffer.jump + more.reshape(buffer.jump.shape)


def _whole_motion(
    system: System, split: ModeSplit, buffer: HistoryBuffer, rows: slice
) -> tuple[Floats, Floats]:
    """All modes' displacements and velocities from the dynamic ones and the relaxed joint forces."""
    buffer = some_rows(buffer, rows)
    q, v = np.zeros((len(buffer.q), system.size)), np.zeros((len(buffer.q), system.size))
    q[:, split.dynamic], v[:, split.dynamic] = buffer.q * split.taper, buffer.v * split.taper
    tapered = np.flatnonzero(split.taper < 1.0)
    if len(tapered):
        k = system.K.diagonal()[split.dynamic[tapered]]
        left = (1.0 / split.taper[tapered] - split.taper[tapered]) / k
        q[:, split.dynamic[tapered]] += buffer.s @ (split.G[:, tapered] * left)
    if len(split.quasi_static):
        k = system.K.diagonal()[split.quasi_static]
        q[:, split.quasi_static] = (buffer.s @ split.G_quasi + system.force[split.quasi_static]) / k
    return q, v


def _observed_acceleration(
    system: System, arrays: tuple[ModalModel, ModeSplit], buffer: HistoryBuffer, acc: Floats
) -> Floats:
    """(nt, r) of the dynamic modes alone, from their equations of motion."""
    model, split = arrays
    k, c = system.K.diagonal()[split.dynamic], system.C.diagonal()[split.dynamic]
    seen = system.observe.toarray().T[split.dynamic]
    rate = model.static @ seen + acc.T @ (model.load @ seen)
    force = with_water(buffer.force, buffer.water)
    rate += force.reshape(len(force), len(split.G)) @ (split.G @ seen)
    rate -= buffer.v @ (c[:, None] * seen) + buffer.q @ (k[:, None] * seen)
    return np.asarray(rate)


def _strain(system: System, arrays: tuple[ModalModel, ModeSplit], buffer: HistoryBuffer) -> Floats:
    """(nt,) strain energy of the states and of the relaxed flexibility [J]."""
    model, split = arrays
    strain = 0.5 * (buffer.q**2) @ system.K.diagonal()[split.dynamic]
    if len(model.R):
        strain += 0.5 * np.einsum("ti,ti->t", buffer.s @ model.R, buffer.s)
    return np.asarray(strain)
