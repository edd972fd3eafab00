"""Dense symmetric eigenproblems, on as many threads as their size pays for."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.threads import DENSE_EIGENPROBLEM, threads_for


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
