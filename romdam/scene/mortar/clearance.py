"""Tell the distance of two faces that their curvature explains from a clearance.

Facets that stand on one curved surface, meshed twice, are apart by their sagittas kappa h^2 / 8, and on
average by two thirds of that, as parabolas are from chords. The curvature kappa across an edge is the angle
of the normals of the two pieces that share it over the distance of their middles. It is zero on flat faces,
however coarse, and there the tolerance is all that is allowed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import MeshError
from romdam.scene.mortar.segments import Segments
from romdam.scene.mortar.surface import MortarSurface, Pieces

_CREASE = 45.0  # angle of neighbouring pieces from which on their edge is one of the body [degree]
_ROUNDING = 1e-9  # of the tolerance, and of an angle that is none [rad]
_OF_PARABOLA = 2.0 / 3.0  # its mean over its sagitta
_STRAY = 1e-2  # of the area where faces meet, that may be farther apart: at a rim facets also see others


def refuse_clearance(
    slave: MortarSurface, master: MortarSurface, between: Segments, tolerance: float, location: str
) -> None:
    """Raise where two faces are farther apart, or farther inside each other, than meshes of one face are.

    Parameters
    ----------
    between : segments of the two
    tolerance : distance that is allowed beyond the facets' sagittas [m]
    location : file and key, for messages

    Raises
    ------
    MeshError
    """
    curved, least = sagittas(slave, master, between), tolerance * (1.0 + _ROUNDING)
    allowed = least + curved
    area = between.area / between.area.sum()
    mean = float(area @ between.distance)
    over = np.abs(between.distance) > allowed
    if area[over].sum() <= _STRAY and abs(mean) <= least + _OF_PARABOLA * area @ curved:
        return
    worst = int(np.argmax(np.abs(between.distance) - allowed))
    at = ", ".join(f"{x:.6g}" for x in slave.points[slave.facets[between.slave[worst]]].mean(axis=0))
    how = "apart" if mean > 0.0 else "inside each other"
    key = location.split(": ")[-1]
    raise MeshError(
        f"{location}: the faces of {slave.block!r} and {master.block!r} do not lie on each other: they are "
        f"{abs(mean):.4g} m {how} on average and {abs(float(between.distance[worst])):.4g} m at ({at}), "
        f"limit {tolerance:g} m ({key}.tolerance) and {float(allowed[worst]) - tolerance:.3g} m for the "
        "curvature of their facets; move a block, and give a clearance as `gap` of a joint, mesh a curved "
        f"face finer or alike on both sides, or raise {key}.tolerance"
    )


def sagittas(slave: MortarSurface, master: MortarSurface, between: Segments) -> Floats:
    """Distance by which facets of one curved surface can be apart at every segment, (n,) [m].

    A facet without a bend, as the only one of its face, takes the curvature of the other's.
    """
    bends_slave, bends_master = _bends(slave), _bends(master)
    pairs = (
        (bends_slave, between.slave, bends_master, between.master),
        (bends_master, between.master, bends_slave, between.slave),
    )
    total = np.zeros(len(between.area))
    for first, facet, second, opposite in pairs:
        flat = second.curvature[opposite] * first.length[facet] ** 2 / 8.0
        total += np.where(first.curvature[facet] > 0.0, first.sagitta[facet], flat) + first.warp[facet]
    return total


@dataclass(frozen=True)
class _Bends:
    """Bends of facets: the largest of the edges of their pieces.

    Attributes
    ----------
    curvature : (n,) across an edge [1/m]
    sagitta : (n,) of that curvature over the extent across the same edge [m]
    length : (n,) largest extent [m]
    warp : (n,) how far corners lie off the plane [m]
    """

    curvature: Floats
    sagitta: Floats
    length: Floats
    warp: Floats


def _bends(face: MortarSurface) -> _Bends:
    """For every facet the largest values of its pieces."""
    pieces = face.pieces
    first, second, along = _shared_edges(pieces)
    angle = np.arccos(np.clip(np.einsum("nk,nk->n", pieces.normal[first], pieces.normal[second]), -1.0, 1.0))
    smooth = (angle > _ROUNDING) & (angle < np.radians(_CREASE))
    first, second, along, angle = first[smooth], second[smooth], along[smooth], angle[smooth]
    extents = []
    for piece in (first, second):  # across the edge, in the plane of the piece
        across = np.cross(pieces.normal[piece], along)
        extents.append(np.ptp(np.einsum("nck,nk->nc", pieces.corners[piece], across), axis=1))
    bend = 2.0 * angle / (extents[0] + extents[1])
    curvature, sagitta = np.zeros(len(pieces.facet)), np.zeros(len(pieces.facet))
    for piece, extent in zip((first, second), extents, strict=True):
        np.maximum.at(curvature, piece, bend)
        np.maximum.at(sagitta, piece, bend * extent**2 / 8.0)
    offset = np.einsum("nck,nk->nc", pieces.corners - pieces.centre[:, None], pieces.normal)
    largest = []
    for of_pieces in (curvature, sagitta, 2.0 * pieces.radius, np.abs(offset).max(axis=1)):
        of_facets = np.zeros(len(face.facets))
        np.maximum.at(of_facets, pieces.facet, of_pieces)
        largest.append(of_facets)
    return _Bends(*largest)


def _shared_edges(pieces: Pieces) -> tuple[Ints, Ints, Floats]:
    """Pairs of pieces that share an edge, and its direction (n, 3)."""
    ends = pieces.corners, np.roll(pieces.corners, -1, axis=1)
    owner = np.repeat(np.arange(len(pieces.facet)), 4)
    a, b = (ends_of.reshape(-1, 3) for ends_of in ends)
    real = np.flatnonzero((a != b).any(axis=1))
    a, b, owner = a[real], b[real], owner[real]
    number = np.unique(np.concatenate([a, b]), axis=0, return_inverse=True)[1].reshape(2, -1)
    key = np.sort(number, axis=0)
    order = np.lexsort(key)
    same = np.flatnonzero((key[:, order[1:]] == key[:, order[:-1]]).all(axis=0))
    i, j = order[same], order[same + 1]
    along = b[i] - a[i]
    return owner[i], owner[j], along / np.linalg.norm(along, axis=1, keepdims=True)
