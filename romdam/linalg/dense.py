"""Dense symmetric eigenproblems, on as many threads as their size pays for, thin factors and products."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.threads import DENSE_EIGENPROBLEM, threads_for

_KEPT = 1e-7  # of a column's length, up to which it may be changed: files keep single precision
DEPENDENT = 1e-8  # eigenvalue of vectors' Gram matrix, relative, below which one is dropped
_RIGID = 1e-13  # of the largest omega^2: what is below it is a rigid motion, and zero
_WORTH = 0.75  # of the columns: a product of more is not cheaper than the matrix
_ABREAST = 512  # columns of a product whose zero rows are left out together
_SPARSE = 0.8  # of all rows, below which that pays


def eigh(K: Floats, M: Floats | None = None, kind: int = 1) -> tuple[Floats, Floats]:
    """All eigenpairs of K x = lambda M x, ascending; of kind 2, of K M x = lambda x.

    Parameters
    ----------
    K, M : (n, n) symmetric, M positive definite; the identity if not given

    Returns
    -------
    values : (n,)
    vectors : (n, n), M-orthonormal

    Raises
    ------
    scipy.linalg.LinAlgError
        where M is not positive definite.
    """
    from scipy import linalg

    with threads_for(len(K), DENSE_EIGENPROBLEM):
        values, vectors = linalg.eigh(K, M, type=kind, driver="evd" if M is None else "gvd")
    return np.asarray(values), np.asarray(vectors)


def soft_and_stiff_modes(K: Floats, M: Floats, rigid: int = 0) -> tuple[Floats, Floats]:
    """All modes of K x = omega^2 M x, ascending, where some may be 1e15 times as stiff as others.

    Of M x = mu (K + s M) x the softest have the largest mu and keep their digits: their omega^2 would be
    round-off of the stiffest ones. Vectors of unit energy keep the flexibility of the stiffest.

    Parameters
    ----------
    K, M : (n, n) symmetric; M positive definite
    rigid : number of motions without strain, whose omega^2 are zero

    Returns
    -------
    omega2 : (n,) [1/s2]
    X : (n, n), X^T M X = 1
    """
    of_each = np.diag(K) / np.diag(M)
    strained = of_each[of_each > 0.0]
    shift = 0.0 if not rigid else float(strained.min()) if len(strained) else 1.0
    mu, X = (part[..., ::-1] for part in eigh(M, K + shift * M))
    mu = np.maximum(mu, np.finfo(float).eps * mu.max(initial=0.0))
    omega2 = np.maximum(1.0 / mu - shift, 0.0)
    omega2[:rigid] = 0.0
    return omega2, X / np.sqrt(mu)


def factors(A: Floats) -> tuple[Floats, Floats]:
    """A (n, m) as left (n, r) @ right (r, m): r of its columns, and each column as a combination of these.

    A Cholesky factorisation of the Gram matrix, with pivoting, picks the columns. Every one is kept to about
    1e-7 of its own length, as numbers of single precision are, however the columns are scaled. Where the rank
    is not far below m, left is A and right the identity.

    The stress of 425 nodes of a cantilever of configs/arch_dam.yaml under 699 coordinates has a rank of 305
    to 372: what happens in other cantilevers reaches it as few motions.
    """
    from scipy.linalg import lapack, solve_triangular

    if not A.size:
        return A, np.eye(A.shape[1])
    length = np.linalg.norm(A, axis=0)
    unit = A / np.where(length > 0.0, length, 1.0)
    R, order, rank, _ = lapack.dpstrf(unit.T @ unit, tol=_KEPT**2)
    if rank > _WORTH * A.shape[1]:
        return A, np.eye(A.shape[1])
    order -= 1
    right = np.empty((rank, A.shape[1]))
    right[:, order[:rank]] = np.eye(rank)
    right[:, order[rank:]] = solve_triangular(R[:rank, :rank], R[:rank, rank:])
    return unit.take(order[:rank], axis=1), right * length


def product(left: Floats, V: Floats) -> Floats:
    """left @ V, less the rows that are zero in many columns: V may be triangular once its rows are sorted."""
    blocks = [slice(k, min(k + _ABREAST, V.shape[1])) for k in range(0, V.shape[1], _ABREAST)]
    used = [np.flatnonzero(V[:, block].any(axis=1)) for block in blocks]
    if sum(map(len, used)) > _SPARSE * len(V) * len(blocks):
        return np.asarray(left @ V)
    result = np.empty((len(left), V.shape[1]))
    for block, rows in zip(blocks, used, strict=True):
        result[:, block] = left[:, rows] @ V[rows, block]
    return result


def sparse(A: Floats) -> csr_matrix:
    """What is not zero of a matrix (n, m), in a tenth of the time and memory that SciPy takes for it."""
    some = A != 0.0
    ends = np.append(0, np.cumsum(np.count_nonzero(some, axis=1)))
    columns = np.broadcast_to(np.arange(A.shape[1], dtype=np.int32), A.shape)
    return csr_matrix((A[some], columns[some], ends), shape=A.shape)


def orthonormalising(gram: Floats, least: float) -> Floats:
    """C (k, r) that makes D C orthonormal where D^T M D = gram (k, k).

    Directions are dropped whose share is below `least` of the largest, of columns of unit length.
    """
    scale = 1.0 / np.sqrt(np.maximum(gram.diagonal(), np.finfo(float).tiny))
    size, U = np.linalg.eigh(gram * scale * scale[:, None])
    keep = size > least * size.max(initial=0.0)
    return np.asarray(scale[:, None] * U[:, keep] / np.sqrt(size[keep]))


def independent(D: Floats, M: csr_matrix) -> Floats:
    """M-orthonormal vectors that span D's, without directions that are round-off."""
    return np.asarray(D @ orthonormalising(D.T @ (M @ D), DEPENDENT))


def without_roundoff(omega2: Floats) -> Floats:
    """Squared frequencies; those of rigid motions come out as round-off of the stiffest mode and are zero."""
    floor = _RIGID * omega2.max(initial=0.0)
    return np.where(omega2 < floor, 0.0, omega2)
