"""Products with the jumps of the modes, block by block, are those with the whole matrix."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

from romdam.timestepping.modal.kernels import gap_jumps, modal_forces
from romdam.timestepping.modal.mode_split import make_split, modal_model

MODES, GAPS = (7, 9, 0, 5), (6, 11, 3)  # of each block, and of each joint


def _system(joined, directions):
    """A system whose joints are each between two of four blocks."""
    columns = np.concatenate([[0], np.cumsum(MODES)])
    rows = np.concatenate([[0], np.cumsum(GAPS)])
    G = np.zeros((directions * rows[-1], columns[-1]))
    random = np.random.default_rng(7)
    for joint, blocks in enumerate(joined):
        own = slice(directions * rows[joint], directions * rows[joint + 1])
        for block in blocks:
            G[own, columns[block] : columns[block + 1]] = random.standard_normal(
                (directions * GAPS[joint], MODES[block])
            )
    n = columns[-1]
    return SimpleNamespace(
        K=sparse.eye(n, format="csc"),
        B=sparse.csr_matrix(G),
        force=np.zeros(n),
        load=np.zeros((n, 3)),
        pseudo_static=None,
        law=SimpleNamespace(
            directions=directions, joints={str(j): slice(rows[j], rows[j + 1]) for j in range(len(GAPS))}
        ),
        parts={str(b): slice(columns[b], columns[b + 1]) for b in range(len(MODES))},
    )


@pytest.mark.parametrize("directions", [1, 3])
@pytest.mark.parametrize(
    ("joined", "blocks"),
    [
        (((0, 1), (1, 3), (0, 3)), 4),  # the last joint's blocks lie apart
        (((0, 1), (0, 1), (0, 1)), 1),
        (((0, 1), (0, 1), (1, 3)), 2),
        (((0, 2), (0, 3), (1, 3)), 3),  # the third block has no modes
    ],
)
def test_blocks_side_by_side_are_one_and_none_is_lost(joined, blocks, directions):
    system = _system(joined, directions)
    modes = np.arange(sum(MODES))
    split = make_split(system, modes, modes[:0], np.ones(len(modes)))
    model, G = modal_model(system, split, np.arange(1), conserving=False), system.B.toarray()
    assert len(model.tiles) == blocks
    random, runs = np.random.default_rng(8), np.array([0, 2])
    q, p = random.standard_normal((3, G.shape[1])), random.standard_normal((3, G.shape[0]))
    w, r = np.ones_like(p), np.ones_like(q)
    gap_jumps(model.tiles, model.values, runs, q, w)
    modal_forces(model.tiles, model.values, runs, p, r)
    np.testing.assert_allclose(w[runs], q[runs] @ G.T, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(r[runs], p[runs] @ G, rtol=1e-13, atol=1e-13)
    assert (w[1] == 1.0).all() and (r[1] == 1.0).all()
