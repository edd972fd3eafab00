"""Stress of the modes of a block as that of the few combinations of them that it knows apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints
from romdam.core.basis import BlockBasis
from romdam.core.fingerprint import code_digest, fingerprint
from romdam.linalg.dense import factors
from romdam.reduction.storage.keys import CODE

_CODE = (CODE, "romdam.fem.stress", __name__)  # what makes a basis, its stress, and the factors of that


def stress_factors(fields: Mapping[str, Floats]) -> dict[str, tuple[Floats, Floats]]:
    """Block name -> (k, 6, r) and (r, m) whose product its fields (k, 6, m) are; see `factors`.

    Both are numbers of single precision, as files keep them, so that a run has the same stress from these.
    """
    products = {}
    for name, field in fields.items():
        left, right = factors(field.reshape(-1, field.shape[2]))
        left, right = (factor.astype(np.float32).astype(np.float64) for factor in (left, right))
        products[name] = left.reshape(len(field), 6, left.shape[1]), right
    return products


def digest_of_stress(
    operator: csr_matrix,
    basis: BlockBasis,
    name: str,
    nodes: Ints,
    offset: Floats,
    carried: Floats | None,
) -> str:
    """SHA-256 that differs where a block's fields do: of the stress of a random motion, and of the code.

    Parameters
    ----------
    operator : stress of the block's displacement, see `romdam.fem.stress.stress_operator`
    name : of the block
    nodes : its stress nodes
    offset : stress at rest, see `initial_stress` [Pa]
    carried : stress that moving supports make, if any do
    """
    q = np.random.default_rng(0).standard_normal(basis.vectors.shape[1])
    columns = basis.columns.start, basis.columns.stop
    motion = operator @ basis.vectors.apply(q)
    return fingerprint((code_digest(*_CODE), columns, motion, (name, nodes, offset, carried)))
