"""Added mass on a diagonal system: its modes with the joints open and the water in place.

The water couples the modes, of one block and across blocks. With B the water's operator on the modes, the
system (I + B^T F B) q'' + Omega^2 q is a small dense eigenproblem, solved once for each reduction. The
Craig-Bampton basis is left as it is: it holds the joints' static motions exactly, and modes with water are
combinations of those without.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix, diags_array

from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.errors import ReductionError
from romdam.core.system import System
from romdam.fem.damping import modal_coefficients
from romdam.fem.water.added_mass import AddedMass
from romdam.linalg.dense import eigh
from romdam.reduction.basis import Lazy, over_coordinates
from romdam.reduction.methods.craig_bampton import without_roundoff

_MOST = 3000  # modes that take the water; higher ones, which answer as flexibilities, stay dry


@dataclass(frozen=True)
class _Change:
    """New unknowns in place of old ones: old[wet] = V @ new[:len(V)], old[dry] = new[len(V):]."""

    wet: NDArray[np.int64]
    dry: NDArray[np.int64]
    V: Floats

    def columns(self, old: Floats) -> Floats:
        """An operator (rows, m) on the old unknowns as one on the new ones."""
        return np.hstack([old[:, self.wet] @ self.V, old[:, self.dry]])

    def parts(self, old: dict[str, slice]) -> dict[str, slice]:
        """The unknowns of the water, then what is left of each part."""
        found = {"water": slice(0, len(self.wet))}
        for name, part in old.items():
            first, last = np.searchsorted(self.dry, (part.start, part.stop)) + len(self.wet)
            if last > first:
                found[name] = slice(int(first), int(last))
        return found

    def of(self, first: int, last: int) -> tuple[slice, Floats | None]:
        """The new unknowns of old ones from `first` to `last`, and what turns them; None where all are dry.

        Where some are wet: old[first:last] = turn @ new[slice].
        """
        own = np.arange(first, last)
        wet, dry = np.flatnonzero(np.isin(self.wet, own)), np.flatnonzero(np.isin(self.dry, own))
        shift = len(self.wet)
        if not len(wet):
            return slice(shift + int(dry[0]), shift + int(dry[-1]) + 1) if len(dry) else slice(0, 0), None
        columns = slice(0, shift + int(dry[-1]) + 1 if len(dry) else shift)
        turn = np.zeros((len(own), columns.stop))
        turn[self.wet[wet] - first, :shift] = self.V[wet]
        turn[self.dry[dry] - first, shift + dry] = 1.0
        return columns, turn


def with_water(
    system: System, basis: dict[str, BlockBasis], water: AddedMass, damping: DampingConfig
) -> tuple[System, dict[str, BlockBasis]]:
    """Diagonalise a reduced system again with the water's added mass.

    Unknowns that move no wet face stay as they are, behind the new ones.

    Parameters
    ----------
    system : diagonal
    basis : block -> its displacement from the system's unknowns
    damping : its mass-proportional part takes the water's mass too

    Raises
    ------
    ReductionError
        where the eigenproblem fails.
    """
    B = over_coordinates(water.coupling, basis, system.size)
    wet, k = _wet_unknowns(system, B), system.K.diagonal()
    omega2, V = _wet_modes(k[wet], B[:, wet], water)
    change = _Change(wet, np.setdiff1d(np.arange(system.size), wet), V)
    omega2 = np.concatenate([without_roundoff(omega2), k[change.dry]])
    load, more = system.load.copy(), system.at_point
    load[wet] += B[:, wet].T @ water.ground
    turned = replace(
        system,
        M=csr_matrix(diags_array(np.concatenate([np.ones(len(wet)), system.M.diagonal()[change.dry]]))),
        C=csr_matrix(diags_array(modal_coefficients(damping, omega2))),
        K=csr_matrix(diags_array(omega2)),
        B=csr_matrix(change.columns(system.B.toarray())),
        load=change.columns(load.T).T,
        force=change.columns(system.force[None])[0],
        observe=csr_matrix(change.columns(system.observe.toarray())),
        at_point=None if more is None else csr_matrix(change.columns(more.toarray())),
        parts=change.parts(system.parts),
    )
    ends = {name: (part.columns.start, part.columns.stop) for name, part in basis.items()}
    turns = {of: change.of(*of) for of in set(ends.values())}  # blocks of a part share one
    return turned, {name: _changed(part, turns[ends[name]], omega2) for name, part in basis.items()}


def _wet_unknowns(system: System, B: Floats) -> NDArray[np.int64]:
    """The lowest of the unknowns of parts that the water touches."""
    touched = np.zeros(system.size, dtype=bool)
    for part in system.parts.values():
        touched[part] = np.abs(B[:, part]).max(initial=0.0) > 0.0
    found = np.flatnonzero(touched)
    k = system.K.diagonal()[found]
    return np.sort(found[np.argsort(k, kind="stable")[:_MOST]])


def _wet_modes(k: Floats, B: Floats, water: AddedMass) -> tuple[Floats, Floats]:
    M = np.eye(len(k)) + B.T @ water.times(B)
    try:
        omega2, V = eigh(np.diag(k), 0.5 * (M + M.T))
    except LinAlgError as error:
        raise ReductionError(f"water: the modes' mass is not positive definite ({error})") from error
    return np.asarray(omega2), np.asarray(V)


def _changed(part: BlockBasis, turn: tuple[slice, Floats | None], omega2: Floats) -> BlockBasis:
    """A block's displacement from the new unknowns, see `_Change.of`."""
    columns, V = turn
    if V is None:
        return replace(part, columns=columns)
    return replace(
        part,
        vectors=Lazy(part.vectors, V),
        columns=columns,
        omega2=omega2[columns],
        participation=V.T @ part.participation,
    )
