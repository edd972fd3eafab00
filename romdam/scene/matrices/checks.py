"""Checks of matrices before anything costly: definiteness, mass, motions without strain."""

from __future__ import annotations

import logging

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.arrays import Floats
from romdam.core.errors import MeshError, ReductionError
from romdam.linalg.factor import Factor
from romdam.scene.matrices.data import INTERNAL, Unknowns
from romdam.scene.matrices.files import FileMatrices

log = logging.getLogger(__name__)

_LARGEST = 30_000  # unknowns up to which signs of eigenvalues are counted, by three factors: some seconds
_NEGATIVE = 1e-7  # eigenvalue of a matrix with unit diagonal that text of 10 digits may make of zero
_ZERO = 1e-12  # the same of K, up to which a motion has no strain
_UNSEEN = 1e-9  # displacement of all unknowns in a motion, relative to the largest, up to which it has none
_STRAIN = 1e-7  # energy of a rigid motion, relative to that of its unknowns one by one
_MASS = 0.1  # of the stated total, by which that of M may differ: what hangs on supports may be left out


def check_matrices(own: FileMatrices, total: float | None, place: str) -> None:
    """Refuse matrices that no elastic body can have, and say what they are of.

    Parameters
    ----------
    total : mass that the block should have [kg], or None
    place : file and key, for messages

    Raises
    ------
    MeshError
    """
    _refuse_empty(own, place)
    mass = _refuse_wrong_mass(own, total, place)
    _refuse_negative(own.M, "mass", place)
    if own.C is not None and own.C.diagonal().min() < 0.0:
        raise MeshError(
            f"{place}.damping: {np.count_nonzero(own.C.diagonal() < 0.0)} of {len(own.unknowns)} entries on "
            f"its diagonal are negative, down to {own.C.diagonal().min():.3g}, limit 0; it would feed "
            "energy in"
        )
    rigid = _strainless(own.K, rigid_motions(own.unknowns))
    free = _refuse_negative(own.K, "stiffness", place)
    if free is not None and free > rigid and not (own.unknowns.motion == INTERNAL).any():
        raise MeshError(
            f"{place}.stiffness: {free} motions have no strain, and only {rigid} of the six rigid motions "
            "of its unknowns have none: the unknowns are not those of the matrix, their coordinates are "
            "wrong, or parts hang loose, limit 0 other motions; give the file that was written with the "
            "matrix"
        )
    if rigid < 6:
        log.info(
            "%s: %d of 6 rigid motions are free of force: the others were held when the matrices were "
            "made, and the inertia that hangs on those supports is not in them", place, rigid,
        )  # fmt: skip
    log.info("%s: mass %.6g, %.6g, %.6g kg along x, y, z; %d rigid motions", place, *mass, rigid)


def rigid_motions(unknowns: Unknowns) -> Floats:
    """The six rigid motions of the unknowns (n, 6), rotations about their centre, over its radius."""
    moving = unknowns.motion < 6
    arm = np.where(moving[:, None], unknowns.position, np.nan)
    low, high = np.nanmin(arm, axis=0), np.nanmax(arm, axis=0)
    radius = max(float(np.linalg.norm(high - low)) / 2, np.finfo(float).tiny)
    arm = np.nan_to_num((arm - (low + high) / 2) / radius)
    along = np.eye(3)[unknowns.motion % 3]
    own = np.zeros((len(unknowns), 6))
    shifted, turned = unknowns.motion < 3, moving & (unknowns.motion > 2)
    own[shifted] = np.hstack([along, np.cross(arm, along)])[shifted]
    own[turned, 3:] = along[turned] / radius
    return own


def _strainless(K: csr_matrix, motions: Floats) -> int:
    """Number of rigid motions that K has no force for."""
    scale = np.sqrt(K.diagonal())
    U, singular, _ = np.linalg.svd(scale[:, None] * motions, full_matrices=False)
    seen = U[:, singular > _UNSEEN * singular[0]]
    energy = np.linalg.eigvalsh(seen.T @ ((K @ (seen / scale[:, None])) / scale[:, None]))
    return int(np.count_nonzero(energy < _STRAIN))


def _refuse_empty(own: FileMatrices, place: str) -> None:
    condense = "condense unknowns without mass out of both, which changes nothing, or give them one"
    for key, matrix, remedy in (
        ("stiffness", own.K, "leave unknowns without stiffness out"),
        ("mass", own.M, condense),
    ):
        bad = np.flatnonzero(matrix.diagonal() <= 0.0)
        if len(bad):
            raise MeshError(
                f"{place}.{key}: {len(bad)} of {len(own.unknowns)} unknowns have none or less, limit above "
                f"0; the first is {own.unknowns.name(bad[0])} with {matrix.diagonal()[bad[0]]:.3g}; {remedy}"
            )


def _refuse_wrong_mass(own: FileMatrices, total: float | None, place: str) -> Floats:
    """Mass along x, y, z (3,); refused where it is not that which is stated."""
    along = np.equal.outer(own.unknowns.motion, np.arange(3)).astype(float)
    mass = np.asarray((along * (own.M @ along)).sum(axis=0))
    if own.inertia is None and mass.min() <= 0.0:
        raise MeshError(
            f"{place}.mass: is {', '.join(f'{m:.4g}' for m in mass)} kg in all along x, y, z, limit above "
            "0; the unknowns must name the displacements along all three"
        )
    if total is not None and np.abs(mass / total - 1.0).max() > _MASS:
        raise MeshError(
            f"{place}.mass: is {', '.join(f'{m:.4g}' for m in mass)} kg in all along x, y, z, and "
            f"total_mass is {total:.4g} kg, limit {_MASS:g} of it apart; is `units` right?"
        )
    return mass


def _refuse_negative(matrix: csr_matrix, key: str, place: str) -> int | None:
    """Refuse negative eigenvalues; the number of those that are zero, None where the matrix is too large."""
    n = matrix.shape[0]
    if n > _LARGEST:
        log.warning(
            "%s.%s: %d unknowns, limit %d for a count of negative eigenvalues; not counted",
            place, key, n, _LARGEST,
        )  # fmt: skip
        return None
    scale = diags_array(1.0 / np.sqrt(matrix.diagonal()))
    scaled = csr_matrix(scale @ matrix @ scale)
    negative = _negative(scaled, _NEGATIVE)
    if negative:
        raise MeshError(
            f"{place}.{key}: has {negative} negative eigenvalues of {n}, limit 0: no elastic body has such "
            "a matrix; is it another one (geometric stiffness, damping), or one half of it?"
        )
    return _negative(scaled, -_ZERO) if key == "stiffness" else 0


def _negative(scaled: csr_matrix, shift: float) -> int:
    """Number of eigenvalues of a matrix with unit diagonal below -shift."""
    try:
        return Factor(scaled + shift * diags_array(np.ones(scaled.shape[0]))).negative()
    except ReductionError:  # a pivot that is zero to the last digit: a little beside it is none
        return Factor(scaled + 1.01 * shift * diags_array(np.ones(scaled.shape[0]))).negative()
