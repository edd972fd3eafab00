"""Factor a sparse matrix once, solve with it many times."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, spmatrix
from scipy.sparse.linalg import splu

from romdam.core.arrays import Floats
from romdam.core.errors import ReductionError


class Factor:
    """LU factors of a matrix, held once.

    SuperLU with an ordering for symmetric patterns and no pivoting off the diagonal, which fills the factors
    of a stiffness less than SciPy's defaults.

    Parameters
    ----------
    matrix : (n, n) sparse, of symmetric pattern and with a positive definite symmetric part
    less : (n, k) E, where matrix - E E^T is to be solved with, positive definite too: by the formula of
        Sherman, Morrison and Woodbury

    Raises
    ------
    ReductionError
        where the matrix is singular.
    """

    def __init__(self, matrix: spmatrix, less: Floats | None = None) -> None:
        self.size = matrix.shape[0]
        try:
            self._lu = splu(
                csc_matrix(matrix),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise ReductionError(
                f"a stiffness matrix of {self.size} unknowns is singular ({error}); "
                "look for nodes that no element uses and for missing supports"
            ) from error
        self._less = less
        if less is not None:
            self._answer = {wanted: self._lu.solve(np.ascontiguousarray(less), wanted) for wanted in "NT"}
            self._rest = {wanted: np.eye(less.shape[1]) - less.T @ self._answer[wanted] for wanted in "NT"}

    def solve(self, right: Floats, transposed: bool = False) -> Floats:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        wanted = "T" if transposed else "N"
        answer = np.asarray(self._lu.solve(np.ascontiguousarray(right, dtype=float), wanted))
        if self._less is None:
            return answer
        return np.asarray(
            answer + self._answer[wanted] @ np.linalg.solve(self._rest[wanted], self._less.T @ answer)
        )

    def negative(self) -> int:
        """Number of negative eigenvalues of `matrix`: that of the negative pivots, on the diagonal."""
        return int(np.count_nonzero(self._lu.U.diagonal() < 0.0))
