"""A much finer reduced model beside a reduced one: what a certificate compares with.

On the two-cantilever model three times the modes leave 2 to 10 % of the coarser model's error, and almost
nothing of it once the full order's defect is fed back (see `romdam.error.replay`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.basis import Basis, BlockBasis
from romdam.core.scene import Scene
from romdam.fem.assembly import assemble_mass
from romdam.fem.parts import basis_over_unknowns
from romdam.linalg.dense import sparse
from romdam.reduction.basis import Augmented, Scaled
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.substructure import has_no_mass
from romdam.reduction.synthesis import ReducedModel
from romdam.scene.ties import scene_parts

_RESIDUAL_VECTORS = 10  # least number of the certificate's finer model
_HANDFUL = 0.05  # of a mesh's unknowns
_ENOUGH = 60  # modes a block: with them a handful of residual vectors is worth more than further modes


def much_finer(choice: ModeChoice) -> ModeChoice:
    """The finer basis of the certificate, near enough to the mesh for its defect to be small."""
    residual = max(2 * choice.residual_vectors, _RESIDUAL_VECTORS)
    if choice.count is not None:
        return replace(choice, count=max(3 * choice.count, _ENOUGH), residual_vectors=residual)
    return replace(choice, cutoff=2.0 * (choice.cutoff or 0.0), residual_vectors=residual)


def parts_without_refinement(scene: Scene, coarse: ReducedModel, fine: ReducedModel) -> list[str]:
    """Name the parts whose finer basis is the coarse one, although that is not nearly all of the mesh.

    What their basis leaves out shows in no difference of the two models. Parts without mass are exact. A
    basis that lacks a handful of directions is taken for the mesh: in them are its highest modes, which the
    residuals of all others do not reach.
    """
    names = []
    for mesh_part in scene_parts(scene).values():
        size, finer = (model.before[mesh_part.blocks[0]].vectors.shape[1] for model in (coarse, fine))
        free = int((~mesh_part.fixed(scene.fixed)).sum())
        if size == finer < (1.0 - _HANDFUL) * free and not has_no_mass(mesh_part, scene):
            names.append(mesh_part.name)
    return names


def embedding(scene: Scene, coarse: ReducedModel, fine: ReducedModel) -> csr_matrix:
    """(fine, coarse) matrix that writes a motion of the coarse model in the fine one's coordinates.

    Before effects turn the coordinates it is T_fine^T M T_coarse: exact where the fine basis contains the
    coarse one, the M-nearest motion elsewhere. A part without mass has the same basis in both. Then both are
    turned as the effects have turned them, so that it is exact there too.
    """
    size = [sum({one.columns.start: _width(one) for one in model.before.values()}.values())
            for model in (fine, coarse)]  # fmt: skip
    matrix = np.zeros(size)
    for mesh_part in scene_parts(scene).values():
        first = mesh_part.blocks[0]
        rows, columns = (model.before[first].columns for model in (fine, coarse))
        if has_no_mass(mesh_part, scene):
            matrix[rows, columns] = np.eye(rows.stop - rows.start)
            continue
        known = _within(fine.before[first].vectors, coarse.before[first].vectors)
        if known is not None:
            matrix[rows, columns] += known
            continue
        by_mass: Floats = np.zeros(())
        for name in mesh_part.blocks:
            block, (a, b) = scene.blocks[name], (model.before[name].vectors for model in (fine, coarse))
            if block.material.rho > 0.0:
                by_mass = by_mass + a.project(b.under(assemble_mass(block)))
        matrix[rows, columns] += by_mass
    for turn in coarse.turns:
        matrix = turn.rows(matrix)
    for turn in fine.turns:
        matrix = turn.new(matrix)
    if fine.system.size > len(matrix):  # water with waves stands behind
        dry = matrix
        matrix = np.zeros((fine.system.size, coarse.system.size))
        matrix[: len(dry), : dry.shape[1]] = dry
    if fine.reservoir is not None and coarse.reservoir is not None:
        rows, columns = (model.system.parts["reservoir"] for model in (fine, coarse))
        matrix[rows, columns] = np.linalg.lstsq(fine.reservoir, coarse.reservoir, rcond=None)[0]
    return sparse(matrix)


def _width(basis: BlockBasis) -> int:
    return basis.columns.stop - basis.columns.start


def mesh_basis(scene: Scene, model: ReducedModel) -> Floats:
    """The basis over the unknowns of the mesh, (unknowns, size): u = basis @ q, water with waves included."""
    if model.reservoir is None:
        return basis_over_unknowns(scene, model.basis, model.system.size)
    columns = model.system.parts["reservoir"]
    solids = basis_over_unknowns(scene, model.basis, model.system.size)
    water = np.zeros((len(model.reservoir), model.system.size))
    water[:, columns] = model.reservoir
    return np.vstack([solids, water])


def _within(fine: Basis, coarse: Basis) -> Floats | None:
    """T_fine^T M T_coarse of a basis that stands on the coarse one; None of others."""
    if isinstance(fine, Scaled) and isinstance(coarse, Scaled):  # each unit of mass has another size
        inner = _within(fine.left, coarse.left)
        return None if inner is None else inner * coarse.factors / fine.factors[:, None]
    return fine.within if isinstance(fine, Augmented) and fine.inner.vectors is coarse else None
