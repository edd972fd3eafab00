"""The compiled product of blocks is SciPy's, in either precision and for any number of columns."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, random_array

from romdam.linalg.blocks import Blocks


@pytest.mark.parametrize("size", [(3, 3), (3, 6), (6, 3), (6, 6)])
@pytest.mark.parametrize("columns", [1, 16, 19, 32])
@pytest.mark.parametrize(("real", "limit"), [(np.float64, 1e-14), (np.float32, 1e-6)])
def test_product_is_that_of_the_dense_matrix(size, columns, real, limit):
    rng = np.random.default_rng(0)
    shape = (20 * size[0], 14 * size[1])
    dense = random_array(shape, density=0.05, rng=rng).toarray()
    dense[: 2 * size[0]] = 0.0  # rows of blocks with nothing in them
    right = rng.standard_normal((shape[1], columns))
    found = Blocks.of(csr_matrix(dense).tobsr(size), real) @ right
    assert found.dtype == real and found.shape == (shape[0], columns)
    known = dense @ right
    assert np.abs(found - known).max() < limit * np.abs(known).max()
    assert not found[: 2 * size[0]].any()
