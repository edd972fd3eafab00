"""A product whose rows are made as they are asked for, against the one that is formed."""

import numpy as np
from scipy.sparse import random_array

from romdam.linalg.lazy_product import Product

rng = np.random.default_rng(0)
LEFT, RIGHT = rng.standard_normal((30, 7)), rng.standard_normal((7, 5))
WHOLE = LEFT @ RIGHT


def test_rows_and_products_are_those_of_the_formed_one():
    made = Product(LEFT, RIGHT)
    assert made.shape == WHOLE.shape and made.nbytes == WHOLE.nbytes
    sparse, dense = random_array((4, 30), density=0.3, format="csr", rng=rng), rng.standard_normal((4, 30))
    some = np.array([3, 0, 17])
    pairs = [
        (made[5:9], WHOLE[5:9]),
        (made[some], WHOLE[some]),
        (made[:], WHOLE),
        (made @ np.ones(5), WHOLE @ np.ones(5)),
        (sparse @ made, sparse @ WHOLE),
        (dense @ made, dense @ WHOLE),
        (made.T @ np.ones(30), WHOLE.T @ np.ones(30)),
        (made.T @ WHOLE, WHOLE.T @ WHOLE),
    ]
    for found, known in pairs:
        assert type(found) is np.ndarray and np.abs(found - known).max() < 1e-13 * np.abs(known).max()
