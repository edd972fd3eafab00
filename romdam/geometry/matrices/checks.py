"""Checks of matrices before anything costly: definiteness, frames of the unknowns, mass, units."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.arrays import Bools, Floats
from romdam.core.errors import MeshError, ReductionError
from romdam.core.scene import Block
from romdam.geometry.matrices.data import INTERNAL, MatrixUnknowns
from romdam.geometry.matrices.files import FileMatrices
from romdam.geometry.meshes.quality import sound_volume
from romdam.linalg.factor import Factor

log = logging.getLogger(__name__)

_LARGEST = 30_000  # unknowns up to which eigenvalues are counted and found, by a few factors: some seconds
_NEGATIVE = 1e-7  # eigenvalue of a matrix with unit diagonal that text of 10 digits may make of zero
_ZERO = 1e-12  # the same of K, up to which a motion has no strain
_NOISE = 10.0  # times the most negative eigenvalue: those below it are zero but for digits that text left out
_UNSEEN = 1e-9  # displacement of all unknowns in a motion, relative to the largest, up to which it has none
_STRAIN = 1e-7  # energy of a rigid motion, relative to that of its unknowns one by one
_TURNED = 1e-3  # of the largest displacement, by which a motion without strain may miss the rigid ones
_ODD_BODY, _NO_BODY = 0.01, 0.1  # of a body's mass, by which its inertia differs by direction: said, refused
_VISIBLE = 1e-6  # of a motion without strain, in the physical unknowns, from which on they see it
_MASS = 0.1  # of the stated total, by which that of M may differ: what hangs on supports may be left out
_SEARCHED = 12  # motions among which those without strain are sought: six, and some of a mechanism
_SWEEPS = 4  # of inverse iteration; each shrinks what has strain by its energy over _ZERO
_TRIED = 1000  # nodes that are left out one after the other, to name one whose rows are in a local frame
_ODD_MASS, _WRONG_MASS = (0.5, 2.0), (0.01, 100.0)  # over volume times density of the shape
_ODD_STIFFNESS = (1 / 30, 10.0)  # energy of unit strain, over volume times E
_WRONG_STIFFNESS = (1 / 300, 100.0)  # the same, beyond which the matrix is refused


@dataclass(frozen=True)
class Checked:
    """What the checks have found out about matrices that they pass.

    Attributes
    ----------
    translations : (n, 3) displacement of every unknown in unit translations along x, y, z; internal unknowns
        take part where K says how, else they are at rest
    warnings : one sentence each, for the result
    """

    translations: Floats
    warnings: tuple[str, ...]


def check_matrices(
    matrices: FileMatrices,
    location: str,
    total: float | None = None,
    shape: Block | None = None,
    supported: bool = False,
) -> Checked:
    """Refuse matrices that no elastic body can have, or whose unknowns are in another frame or unit.

    Internal unknowns follow the physical ones with the least strain (K_ii is condensed), so that the rigid
    motions of the physical unknowns become motions of all. Every motion without strain must be one of these,
    and the inertia of all six must be that of a rigid body.

    Parameters
    ----------
    location : file and key, for messages
    total : mass that the block should have [kg], or None
    shape : the block's mesh and material, whose volume, density and modulus tell the order of magnitude
    supported : the configuration says that something is held: `supports` of this block, or `inertia`

    Raises
    ------
    MeshError
    """
    condense = "condense unknowns without mass out of both, which changes nothing, or give them one"
    for key, matrix, remedy in (
        ("stiffness", matrices.K, "leave unknowns without stiffness out"),
        ("mass", matrices.M, condense),
    ):
        bad = np.flatnonzero(matrix.diagonal() <= 0.0)
        if len(bad):
            raise MeshError(
                f"{location}.{key}: {len(bad)} of {len(matrices.unknowns)} unknowns have none or less, limit "
                f"above 0; the first is {matrices.unknowns.name(bad[0])} with "
                f"{matrix.diagonal()[bad[0]]:.3g}; {remedy}"
            )
    _refuse_negative(matrices.M, "mass", location)
    if matrices.C is not None and matrices.C.diagonal().min() < 0.0:
        raise MeshError(
            f"{location}.damping: {np.count_nonzero(matrices.C.diagonal() < 0.0)} of "
            f"{len(matrices.unknowns)} entries on its diagonal are negative, down to "
            f"{matrices.C.diagonal().min():.3g}, limit 0; it would feed energy in"
        )
    _refuse_negative(matrices.K, "stiffness", location)
    unknowns, warnings = matrices.unknowns, list[str]()
    both = _followed(matrices.K, unknowns, np.hstack([rigid_motions(unknowns), _strains(unknowns)]))
    motions, strained = both[:, :6], both[:, 6:]
    rigid, seen = _strainless(matrices.K, motions)
    shifts = _strainless(matrices.K, motions[:, :3]) == (3, 3)
    if len(unknowns) > _LARGEST:
        warnings.append(
            f"{location}: {len(unknowns)} unknowns, limit {_LARGEST} for a search of motions without strain; "
            "whether the unknowns are those of the matrix is not checked"
        )
    else:
        _refuse_other_motions(matrices.K, unknowns, motions, (rigid, seen), location)
    internal = (unknowns.motion == INTERNAL)[:, None]
    moved = motions[:, :3] if shifts else np.where(internal, 0.0, motions[:, :3])
    mass = np.einsum("ij,ij->j", moved, matrices.M @ moved)
    if matrices.inertia is None and mass.min() <= 0.0:
        raise MeshError(
            f"{location}.mass: is {_listed(mass)} kg in all along x, y, z, limit above 0; the unknowns must "
            "name the displacements along all three"
        )
    if shifts:
        warnings += _compare_with_body(matrices.M, motions if rigid == 6 else motions[:, :3], location)
    elif matrices.inertia is not None and len(unknowns) <= _LARGEST:  # of what moves in all modes together
        mass = np.einsum("ij,ij->j", matrices.inertia, Factor(matrices.M).solve(matrices.inertia))
    log.info("%s: mass %s kg along x, y, z; %d rigid motions", location, _listed(mass), rigid)
    if rigid < seen:
        text = (
            f"{location}.stiffness: resists {seen - rigid} of {seen} rigid motions of its unknowns: "
            "something holds the block inside its matrices"
        )
        if supported:
            log.info("%s; the inertia that hangs on it is in `inertia` only", text)
        else:
            warnings.append(
                f"{text}, and neither `supports` of this block nor `inertia` say so; the inertia that hangs "
                "on it is not known, and frames of the unknowns cannot be checked in these motions"
            )
    if total is not None:  # what is held inside may have lost any share of it
        ratio, least = mass / total, 1.0 - _MASS if shifts or not internal.any() else _WRONG_MASS[0]
        if ratio.max() > 1.0 + _MASS or ratio.min() < least:
            raise MeshError(
                f"{location}.mass: is {_listed(mass)} kg in all along x, y, z, and total_mass is {total:.4g} "
                f"kg, limit {_MASS:g} of it apart; is `units` right?"
            )
    if shape is not None:
        warnings += _compare_with_shape(matrices, shape, None if total else mass, strained, location)
    return Checked(moved, tuple(warnings))


def rigid_motions(unknowns: MatrixUnknowns) -> Floats:
    """The six rigid motions of the unknowns (n, 6), rotations about their centre, over its radius."""
    moving = unknowns.motion < 6
    arm, radius = _arms(unknowns)
    along = np.eye(3)[unknowns.motion % 3]
    motions = np.zeros((len(unknowns), 6))
    shifted, turned = unknowns.motion < 3, moving & (unknowns.motion > 2)
    motions[shifted] = np.hstack([along, np.cross(arm, along)])[shifted]
    motions[turned, 3:] = along[turned] / radius
    return motions


def _arms(unknowns: MatrixUnknowns) -> tuple[Floats, float]:
    """Position of every unknown from their centre, over the radius (n, 3), or zero; the radius [m]."""
    arm = np.where((unknowns.motion < 6)[:, None], unknowns.position, np.nan)
    low, high = np.nanmin(arm, axis=0), np.nanmax(arm, axis=0)
    radius = max(float(np.linalg.norm(high - low)) / 2, np.finfo(float).tiny)
    return np.nan_to_num((arm - (low + high) / 2) / radius), radius


def _strains(unknowns: MatrixUnknowns) -> Floats:
    """Displacements (n, 6) in unit uniform strains xx, yy, zz, yz, xz, xy, rotations at rest [m]."""
    arm, radius = _arms(unknowns)
    row, direction = np.arange(len(unknowns)), unknowns.motion % 3
    motions = np.zeros((len(unknowns), 6))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        strain = np.zeros((3, 3))
        strain[i, j] += 0.5
        strain[j, i] += 0.5
        motions[:, k] = (radius * arm @ strain)[row, direction]
    motions[unknowns.motion > 2] = 0.0
    return motions


def _followed(K: csr_matrix, unknowns: MatrixUnknowns, motions: Floats) -> Floats:
    """Motions of the physical unknowns, the internal ones following with the least strain."""
    inner = np.flatnonzero(unknowns.motion == INTERNAL)
    if not len(inner):
        return motions
    force = (K @ motions)[inner]
    scale = 1.0 / np.sqrt(K.diagonal()[inner])
    # K_ii may be singular, where internal unknowns alone can move without strain: the force is none there
    scaled = csr_matrix(diags_array(scale) @ K[inner][:, inner] @ diags_array(scale))
    held = _factor(scaled, _ZERO)
    if held.negative():
        held = _factor(scaled, _NEGATIVE)
    right = scale[:, None] * force
    answer = held.solve(right)
    answer += held.solve(right - scaled @ answer)
    motions = motions.copy()
    motions[inner] -= scale[:, None] * answer
    return motions


def _strainless(K: csr_matrix, motions: Floats) -> tuple[int, int]:
    """Number of motions that K has no force for, and of those in which any unknown moves."""
    scale = np.sqrt(K.diagonal())
    U, singular, _ = np.linalg.svd(scale[:, None] * motions, full_matrices=False)
    seen = U[:, singular > _UNSEEN * singular[0]]
    energy = np.linalg.eigvalsh(seen.T @ ((K @ (seen / scale[:, None])) / scale[:, None]))
    return int(np.count_nonzero(energy < _STRAIN)), seen.shape[1]


def _refuse_other_motions(
    K: csr_matrix, unknowns: MatrixUnknowns, motions: Floats, rigid: tuple[int, int], location: str
) -> None:
    """Refuse motions without strain that are no rigid motions of the physical unknowns."""
    # motions without strain (n, k), each unknown times the root of its stiffness, orthonormal
    unit_diagonal = diags_array(1.0 / np.sqrt(K.diagonal()))
    scaled = csr_matrix(unit_diagonal @ K @ unit_diagonal)
    held = _factor(scaled, _ZERO)
    if held.negative():
        held = _factor(scaled, _NEGATIVE)
    size = scaled.shape[0]
    vectors = np.random.default_rng(0).standard_normal((size, min(size, _SEARCHED)))
    for _ in range(_SWEEPS):
        vectors = np.linalg.qr(held.solve(vectors))[0]
    energy, turn = np.linalg.eigh(vectors.T @ (scaled @ vectors))
    free = vectors @ turn[:, energy < max(_ZERO, -_NOISE * float(energy[0]))]

    physical = unknowns.motion != INTERNAL
    nodes, scale = unknowns.node[physical], np.sqrt(K.diagonal())[physical, None]
    length = np.where(unknowns.motion < 3, 1.0, _arms(unknowns)[1])[physical, None]
    left, visible, _ = np.linalg.svd(free[physical], full_matrices=False)
    seen = left[:, visible > _VISIBLE]
    hidden = free.shape[1] - seen.shape[1]  # internal unknowns move alone: rotations that no node sees

    def missed(rows: Bools) -> Floats:
        """Displacement (n,), over the largest, by which they miss the rigid motions that fit some rows."""
        weighed = scale * motions[physical]
        fit = np.linalg.lstsq(weighed[rows], seen[rows], rcond=_UNSEEN)[0]
        off, largest = ((np.abs(values / scale) * length) for values in (seen - weighed @ fit, seen))
        return np.asarray((off / largest.max(axis=0)).max(axis=1))

    off = missed(np.ones(len(nodes), dtype=bool)) if seen.shape[1] else np.zeros(1)
    if hidden <= 6 - rigid[1] and off.max() <= _TURNED:
        return
    wrong = ""
    for node in np.unique(nodes)[:_TRIED] if off.max() > _TURNED else ():
        if (others := nodes != node).any() and missed(others)[others].max() <= _TURNED:
            wrong = f"; all nodes but {node} move rigidly, whose rows may be in a local frame"
            break
    raise MeshError(
        f"{location}.stiffness: {free.shape[1]} motions have no strain, and only {rigid[0]} of the six rigid "
        "motions of its unknowns have none: the unknowns are not those of the matrix, rows are in a local "
        f"frame, coordinates are wrong, or parts hang loose, limit 0 other motions{wrong}; give the file "
        "that was written with the matrix, with all nodes in the axes of this job"
    )


def _compare_with_body(M: csr_matrix, motions: Floats, location: str) -> list[str]:
    """Warn where the inertia in translations, or in all six rigid motions (n, 3 or 6), is no rigid body's.

    A body has one mass in all directions, a centre of mass, and moments of inertia of which none is larger
    than the sum of the others. A little more in one direction is an oscillator's or a plate's of water.
    """
    inertia = motions.T @ (M @ motions)
    mean = float(np.trace(inertia[:3, :3])) / 3.0
    off, what = np.abs(inertia[:3, :3] / mean - np.eye(3)).max(), "differ by direction"
    if motions.shape[1] == 6:
        coupling = inertia[:3, 3:] / mean
        centre = 0.5 * np.array([coupling[i, j] - coupling[j, i] for i, j in ((1, 2), (2, 0), (0, 1))])
        moments = inertia[3:, 3:] - mean * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        least, middle, most = np.linalg.eigvalsh(moments)
        no_centre = np.abs(coupling + coupling.T).max() / 2.0
        too_large = -min(least, least + middle - most) / most
        off, what = max(
            (off, what),
            (no_centre, "have no centre, as rotations move them"),
            (too_large, "have a moment of inertia above the sum of the two others"),
        )
    said = (
        f"{location}.mass: its {_listed(inertia.diagonal()[:3])} kg along x, y, z {what}, by {off:.3g} of "
        "themselves; a free body's do not"
    )
    if off > _NO_BODY:
        raise MeshError(
            f"{said}, limit {_NO_BODY:g}: rows are in a local frame, or water is in it, which is romdam's to "
            "add; give matrices in the axes of this job and of the body alone"
        )
    return [said] if off > _ODD_BODY else []


def _listed(mass: Floats) -> str:
    return ", ".join(f"{m:.4g}" for m in mass)


def _compare_with_shape(
    matrices: FileMatrices, shape: Block, mass: Floats | None, strained: Floats, location: str
) -> list[str]:
    """Warnings where mass or stiffness are far from those of the shape; those of another unit are refused.

    Parameters
    ----------
    mass : along x, y, z (3,) [kg]; None where it is stated, and need not be that of the shape
    strained : (n, 6) the unknowns in unit uniform strains, the internal ones following [m]
    """
    material, volume = shape.material, sound_volume(shape, location)
    radius = _arms(matrices.unknowns)[1]
    energy = float(np.einsum("ij,ij->j", strained, matrices.K @ strained).max())
    reference = material.E * min(volume, (2.0 * radius) ** 3)  # few unknowns strain what is near them alone
    compared = []
    if mass is not None and material.rho > 0.0:
        text = f"its {mass.mean():.4g} kg are {{ratio:.3g}} of volume times density of the block's shape"
        remedy = "`units`, the block's shape or its material's rho, or state `total_mass`"
        compared.append(("mass", mass.mean() / (material.rho * volume), text, remedy, _ODD_MASS, _WRONG_MASS))
    if energy > _STRAIN * reference:
        text = "in uniform strain it has {ratio:.3g} of the energy of its material in the block's shape"
        remedy = "`units`, the block's shape, or its material's E"
        compared.append(("stiffness", energy / reference, text, remedy, _ODD_STIFFNESS, _WRONG_STIFFNESS))
    warnings = []
    for key, ratio, text, remedy, odd, wrong in compared:
        said = f"{location}.{key}: {text.format(ratio=ratio)}"
        if not wrong[0] < ratio < wrong[1]:
            raise MeshError(
                f"{said}, limits {wrong[0]:.2g} and {wrong[1]:g}; are tonnes, kN or mm meant? Correct "
                f"{remedy}"
            )
        if not odd[0] < ratio < odd[1]:
            warnings.append(f"{said}; if that is not meant, correct {remedy}")
    return warnings


def _refuse_negative(matrix: csr_matrix, key: str, location: str) -> None:
    """Refuse negative eigenvalues, where the matrix is not too large."""
    n = matrix.shape[0]
    if n > _LARGEST:
        log.warning(
            "%s.%s: %d unknowns, limit %d for a count of negative eigenvalues; not counted",
            location, key, n, _LARGEST,
        )  # fmt: skip
        return
    scale = diags_array(1.0 / np.sqrt(matrix.diagonal()))
    negative = _factor(csr_matrix(scale @ matrix @ scale), _NEGATIVE).negative()
    if negative:
        raise MeshError(
            f"{location}.{key}: has {negative} negative eigenvalues of {n}, limit 0: no elastic body has "
            "such a matrix; is it another one (geometric stiffness, damping), or one half of it?"
        )


def _factor(scaled: csr_matrix, shift: float) -> Factor:
    """Factors of a matrix with unit diagonal and `shift` more."""
    unit = diags_array(np.ones(scaled.shape[0]))
    try:
        return Factor(scaled + shift * unit)
    except ReductionError:  # a pivot that is zero to the last digit: a little more is none
        return Factor(scaled + 1.01 * shift * unit)
