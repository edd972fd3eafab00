"""A much finer reduced model beside a reduced one: what a certificate compares with.

On the two-cantilever model three times the modes leave 2 to 10 % of the coarser model's error, and almost
nothing of it once the full order's defect is fed back (see `romdam.error.replay`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import Scene
from romdam.fem.assembly import assemble_mass
from romdam.reduction.basis import Augmented
from romdam.reduction.methods.craig_bampton import ModeChoice
from romdam.reduction.methods.massless import has_no_mass
from romdam.reduction.synthesis import ReducedModel
from romdam.reduction.water import on_unknowns
from romdam.scene.ties import scene_parts

_RESIDUAL_VECTORS = 10
_ENOUGH = 60  # modes a block: with them a handful of residual vectors is worth more than further modes


def much_finer(choice: ModeChoice) -> ModeChoice:
    """The finer basis of the certificate, near enough to the mesh for its defect to be small."""
    residual = max(2 * choice.residual_vectors, _RESIDUAL_VECTORS)
    if choice.count is not None:
        return replace(choice, count=max(3 * choice.count, _ENOUGH), residual_vectors=residual, capped=True)
    return replace(choice, cutoff=2.0 * (choice.cutoff or 0.0), residual_vectors=residual)


def embedding(scene: Scene, coarse: ReducedModel, fine: ReducedModel) -> csr_matrix:
    """(fine, coarse) matrix that writes a motion of the coarse model in the fine one's coordinates.

    T_fine^T M T_coarse, M with the water's; exact where the fine basis contains the coarse one, the M-nearest
    motion elsewhere. A part without mass has the same basis in both.
    """
    matrix = np.zeros((fine.system.size, coarse.system.size))
    for name, block in scene.blocks.items():
        a, b = fine.basis[name], coarse.basis[name]
        if isinstance(a.vectors, Augmented) and a.vectors.inner.vectors is b.vectors:
            matrix[a.columns, b.columns] = a.vectors.within
        elif block.material.rho > 0.0:
            matrix[a.columns, b.columns] += a.vectors.project(b.vectors.under(assemble_mass(block)))
    for part in scene_parts(scene).values():
        if has_no_mass(part, scene):
            rows, columns = (model.basis[part.blocks[0]].columns for model in (fine, coarse))
            matrix[rows, columns] = np.eye(rows.stop - rows.start)
    if fine.water is not None:
        onto, of = (on_unknowns(m.system.size, m.basis, fine.water.coupling) for m in (fine, coarse))
        matrix += onto.T @ fine.water.times(of)
    return csr_matrix(matrix)
