"""The inverse of K - s M on the unknowns that have mass, and the rigid motions that it answers without bound.

Where K is singular a shift s < 0 makes K - s M definite, and its inverse answers a rigid motion a million
times as much as the first mode that strains. Carried on from vector to vector, the round-off of that answer
turns modes towards rigid motions: the flexibility of a floating block of 579 unknowns was 1.6e-7 off, and
omega^2 of one of 5,655 up to 1e-6. Rigid motions are therefore found beforehand, rid by K of what strains in
them, and kept out of all that follows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, spmatrix

from romdam.core.arrays import Floats
from romdam.linalg.dense import orthonormalising
from romdam.linalg.symmetric import Symmetric

Apply = Callable[[Floats], Floats]

_VECTORS = 8  # that look for rigid motions: a body in one piece has six
_MOST = 20  # steps; two or three are usual
_RIGID = 1e-3  # of the shift: a motion whose omega^2 is below it may be rigid
_FOUND = 1e-6  # residual of a rigid motion and part of it that strains, before K rids it of that
_DEPENDENT = 1e-12  # share of the longest of some unit vectors, below which one depends on the others


class Flexibility:
    """D = (K - s M)^-1 on the unknowns that have mass; see the module.

    Parameters
    ----------
    M : (n, n) sparse, symmetric; a zero on the diagonal is an unknown without mass
    inverse : of K - s M, for (n, k)
    shift : s [1/s2], below the lowest omega^2
    K : (n, n) where there may be rigid motions

    Attributes
    ----------
    size, every : m, how many unknowns have mass, and whether all have
    mass : (m, m) of these
    rigid : (n, r) motions that K does not feel, M-orthonormal
    apart : the same over the unknowns with mass, where there are any
    """

    def __init__(
        self, M: csr_matrix, inverse: Apply, shift: float, K: spmatrix | Symmetric | None = None
    ) -> None:
        self.M, self.shift, self._inverse = M, shift, inverse
        self._rows = np.flatnonzero(M.diagonal() > 0.0)
        self.size, self.every = len(self._rows), len(self._rows) == M.shape[0]
        self.mass = M if self.every else csr_matrix(M[self._rows][:, self._rows])
        self.rigid = np.zeros((M.shape[0], 0))
        if K is not None and shift < 0.0 and self.size:
            self.rigid = self._rigid_motions(K)
        self.apart = [np.asfortranarray(self.rigid[self._rows])] if self.rigid.shape[1] else []

    def __matmul__(self, forces: Floats) -> Floats:
        """D times forces."""
        answer = self._lifted(forces)
        return answer if self.every else np.asarray(np.take(answer, self._rows, axis=0))

    def start(self, width: int, seed: int) -> Floats:
        """Random vectors, always the same: one scene gives one basis."""
        return np.random.default_rng(seed).standard_normal((self.size, min(width, self.size)))

    def displacement(self, forces: Floats) -> Floats:
        """Displacement of all unknowns under forces on those with mass, without rigid motion."""
        answer = self._lifted(forces)
        return answer - self.rigid @ (self.rigid.T @ (self.M @ answer)) if self.apart else answer

    def _lifted(self, forces: Floats) -> Floats:
        if self.every:
            return self._inverse(forces)
        right = np.zeros((self.M.shape[0], forces.shape[1]))
        right[self._rows] = forces
        return self._inverse(right)

    def _rigid_motions(self, K: spmatrix | Symmetric) -> Floats:
        """Motions that K does not feel: of the highest 1 / (omega^2 - s), by iteration on some vectors."""
        X = self.start(_VECTORS, 1)
        for _ in range(_MOST):
            X = X @ orthonormalising(X.T @ (self.mass @ X), _DEPENDENT)
            Y = self @ (self.mass @ X)
            H = X.T @ (self.mass @ Y)
            mu, S = eigh(0.5 * (H + H.T))
            rest = Y @ S - X @ (S * mu)
            rigid = 1.0 / mu + self.shift < -_RIGID * self.shift
            left = np.sqrt((rest * (self.mass @ rest)).sum(axis=0)) / mu
            if (left[rigid] <= _FOUND).all() and (mu[~rigid] * (1.0 + left[~rigid]) < mu[-1]).all():
                break
            X = Y
        else:
            return np.zeros((self.M.shape[0], 0))
        R = self._lifted(self.mass @ (X @ S[:, rigid]))
        R = R @ orthonormalising(R.T @ (self.M @ R), _DEPENDENT)
        strains = self._inverse(K @ R)
        slight = (strains * (self.M @ strains)).sum(axis=0) <= _FOUND**2
        R = R[:, slight] - strains[:, slight]
        return np.asarray(R @ orthonormalising(R.T @ (self.M @ R), _DEPENDENT))
