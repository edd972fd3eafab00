"""Other unknowns of a reduced system, in which it is diagonal again once an effect has coupled its modes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.arrays import Floats, Ints
from romdam.core.basis import BlockBasis
from romdam.core.system import System
from romdam.effects.effect import ModalCoordinates
from romdam.linalg.dense import sparse
from romdam.reduction.basis import Lazy, Turn


@dataclass(frozen=True)
class NewUnknowns:
    """New unknowns in place of some old ones: old[mixed] = V @ new[:m]; the others stay, behind the new.

    Attributes
    ----------
    part : their name among the parts of the system
    mixed : (m,) ascending numbers of the old ones
    V : (m, m) the old ones of the new
    stiffness, mass : (m,) of the new ones [1/s2], 1 or 0
    """

    part: str
    mixed: Ints
    V: Floats
    stiffness: Floats
    mass: Floats

    def kept(self, size: int) -> Ints:
        """Numbers of the old unknowns, of so many, that stay as they are."""
        return np.setdiff1d(np.arange(size), self.mixed)


@dataclass(frozen=True)
class _Change:
    """The change of all unknowns of a system: `kept` old ones stand behind the new ones."""

    new: NewUnknowns
    kept: Ints

    @cached_property
    def whole(self) -> Turn:
        """The change of all unknowns."""
        mixed = self.new.mixed
        places = len(mixed) + np.arange(len(self.kept))
        return Turn(mixed, self.new.V, self.kept, places, len(mixed) + len(self.kept))

    def parts(self, old: dict[str, slice]) -> dict[str, slice]:
        """The new unknowns, then what is left of each part."""
        shift = len(self.new.mixed)
        parts = {self.new.part: slice(0, shift)}
        for name, part in old.items():
            first, last = np.searchsorted(self.kept, (part.start, part.stop)) + shift
            if last > first:
                parts[name] = slice(int(first), int(last))
        return parts

    def of(self, first: int, last: int) -> tuple[slice, Turn | None]:
        """The new unknowns of old ones from `first` to `last`, and what turns them; None where all are kept.

        The new unknowns are those of the slice.
        """
        old, every = np.arange(first, last), self.new.mixed
        mixed, kept = np.flatnonzero(np.isin(every, old)), np.flatnonzero(np.isin(self.kept, old))
        shift = len(every)
        if not len(mixed):
            return slice(shift + int(kept[0]), shift + int(kept[-1]) + 1) if len(kept) else slice(0, 0), None
        columns = slice(0, shift + int(kept[-1]) + 1 if len(kept) else shift)
        old_kept = self.kept[kept] - first
        return columns, Turn(every[mixed] - first, self.new.V[mixed], old_kept, shift + kept, columns.stop)


def turned(
    system: System, coordinates: ModalCoordinates, new: NewUnknowns
) -> tuple[System, ModalCoordinates]:
    """The diagonal system in new unknowns, and their coordinates."""
    change = _Change(new, new.kept(system.size))
    rows, kept, more = change.whole.rows, change.kept, system.at_point
    sustained = system.sustained
    if sustained is not None:
        stiffness = rows(rows(sustained.more.toarray()).T)
        sustained = replace(sustained, more=csr_matrix(0.5 * (stiffness + stiffness.T)))
    omega2 = np.concatenate([new.stiffness, system.K.diagonal()[kept]])
    mass = np.concatenate([new.mass, system.M.diagonal()[kept]])
    other = replace(
        system,
        M=csr_matrix(diags_array(mass)),
        K=csr_matrix(diags_array(omega2)),
        B=sparse(rows(system.B.toarray())),
        load=rows(np.asarray(system.load).T).T,
        force=rows(system.force[None])[0],
        load_steps={kind: rows(force[None])[0] for kind, force in system.load_steps.items()},
        observe=csr_matrix(rows(system.observe.toarray())),
        at_point=None if more is None else sparse(rows(more.toarray())),
        parts=change.parts(system.parts),
        sustained=sustained,
    )
    basis = coordinates.basis
    ends = {name: (part.columns.start, part.columns.stop) for name, part in basis.items()}
    turns = {of: change.of(*of) for of in set(ends.values())}  # blocks of a part share one
    changed: dict[str, BlockBasis] = {}
    for name, part in basis.items():
        columns, turn = turns[ends[name]]
        changed[name] = replace(part, columns=columns)
        if turn is not None:
            changed[name] = replace(
                changed[name],
                vectors=Lazy(part.vectors, turn),
                omega2=omega2[columns],
                participation=turn.rows(part.participation.T).T,
            )
    return other, replace(coordinates, basis=changed, turns=(*coordinates.turns, change.whole))
