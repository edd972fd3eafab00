"""Residual vectors: static answers of a block's interior to what its lowest open-joint modes leave over.

What a mode of a Craig-Bampton basis leaves is its own inertia less that of the fixed-interface modes in it,
since constraint modes take no force inside; so it comes from inertia alone. K times a low mode is a small
difference of large forces, whose round-off, answered and made as long as a mode, mirrors nothing: with it
mirrored gaps of the main job were alike to 7e-7, and are to 1e-10 without. The answer to the part of the
modes lies in the span of the basis, and could be taken out afterwards; that leaves 3e-6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.linalg.dense import eigh
from romdam.linalg.solvers import Solver

# Residual vectors beside a basis that the estimate of its error compares with: of two cantilevers with 20
# to 231 modes, with and without friction, 20 of them state 0.1 to 1.2 of the truth, 40 0.5 to 1.4, and 60
# 0.6 to 1.5, at the same cost.
FINER_VECTORS = 60
FINER_LEAST = 1e-6  # of a mode's size: much of a residual vector below it is round-off, and mirrors nothing
ROUND_OFF = 1e-7  # the same of a static response beside the modes
_SAME = 1e-5  # relative, of frequencies squared that count as one


@dataclass(frozen=True)
class Interior:
    """The interior's solver, and forces K - s M on it under vectors of a basis.

    Attributes
    ----------
    inner_forces : (n, f) forces under the last f vectors of the first basis
    constraint : how many constraint modes are before those
    steps : (mix, forces) of bases since then: modes made of the one before and of vectors beside it
    """

    solver: Solver
    inner_forces: Floats
    constraint: int
    steps: tuple[tuple[Floats, Floats], ...] = ()

    def after(self, mix: Floats, more: Floats) -> Interior:
        """The same for modes made of this basis and of vectors beside it with such forces."""
        return replace(self, steps=(*self.steps, (mix, more)))

    def forces(self, C: Floats) -> Floats:
        """(n, k) under vectors that are (m, k) in terms of the last basis."""
        forces = np.zeros((len(self.inner_forces), C.shape[1]))
        for mix, more in reversed(self.steps):
            C = mix @ C
            first = len(C) - more.shape[1]
            forces += more @ C[first:]
            C = C[:first]
        return forces + self.inner_forces @ C[self.constraint :]


def lowest_with(added: Floats | None, omega2: Floats, X: Floats, count: int) -> tuple[Floats, Floats]:
    """omega^2 and vectors of the lowest of modes X (n, m), with an added modal mass (m, m) or without."""
    if added is None:
        return omega2[:count], X[:, :count]
    low, C = eigh(np.diag(omega2), np.eye(len(omega2)) + 0.5 * (added + added.T))
    return low[:count], X @ C[:, :count]


def larger(D: Floats, M: csr_matrix, omega2: Floats, least: float) -> Floats:
    """The modes' residual vectors whose M-norm is above a size, of one frequency all or none.

    Where none is, as in a basis that lacks little, those above `ROUND_OFF`: it is they that tell how little.

    Which modes of one frequency there are is round-off, and with it how large each one's vector is.

    Parameters
    ----------
    omega2 : of the modes, ascending; of rigid motions round-off, which may be negative [1/s2]
    """
    together = np.append(0, np.cumsum(np.diff(omega2) > _SAME * omega2[1:]))
    smallest = np.full(len(omega2), np.inf)
    np.minimum.at(smallest, together, np.sqrt((D * (M @ D)).sum(axis=0)))
    if not least:
        return D
    size = smallest[together]
    return np.asarray(D[:, size > (least if (size > least).any() else ROUND_OFF)])
