"""Two blocks' faces that lie on each other: which is the slave, and how much of it the other covers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.scene import Block
from romdam.geometry.facets import node_normals
from romdam.geometry.meshes.kinds import facets_by_kind
from romdam.scene.mortar.clearance import refuse_clearance
from romdam.scene.mortar.segments import Segments, segments
from romdam.scene.mortar.surface import MortarSurface, local_coordinates
from romdam.scene.pairing import do_not_touch

STEEPEST = 30.0  # angle of facets that face each other [degree]
_TOUCHED = 1e-6  # share of a facet that is covered, below which it only meets the others at an edge
_FEW = 0.1  # of the area where faces meet
_EQUAL = 0.01  # difference of covered shares below which the finer face is the slave
_OUTSIDE = 0.1  # how far outside a facet a node may stand and be opposite to it, in reference coordinates


@dataclass(frozen=True)
class MortarInterface:
    """Facets of two blocks that lie on each other.

    The slave, whose nodes carry the multipliers, is the face that the other covers better, else the finer.

    Attributes
    ----------
    slave, master : their facets that take part
    segments : of the two
    slave_is_J : whether the slave is the second block
    """

    slave: MortarSurface
    master: MortarSurface
    segments: Segments
    slave_is_J: bool

    @property
    def covered(self) -> float:
        """Area of the slave that the master covers, in the segments' planes [m2]."""
        return float(self.segments.area.sum())

    @property
    def apart(self) -> float:
        """The largest distance of the two faces [m]."""
        return float(np.abs(self.segments.distance).max())

    @cached_property
    def nodes(self) -> Ints:
        """Ascending corner nodes of the slave."""
        return np.unique(self.slave.facets[:, : self.slave.element.corners])

    @cached_property
    def normals(self) -> Floats:
        """(nodes of the block, 3) outward normals of the slave at its nodes."""
        return node_normals(self.slave.points, self.slave.facets)

    def opposite(self, nodes: Ints) -> tuple[Ints, Ints, Floats]:
        """The master's facets that stand opposite to nodes of the slave, along their normals.

        Returns
        -------
        which : (n,) rows of `nodes` that have one
        facet : (n,) of the master
        xi : (n, 2) where in it
        """
        row, facet = self._near(nodes)
        at, normal = self.slave.points[nodes[row]], self.normals[nodes[row]]
        # two unit vectors across each normal
        axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
        tangent = np.cross(normal, axis)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        frame = np.stack([tangent, np.cross(normal, tangent)], axis=1)
        shape = self.master.facets[facet][:, : len(self.master.mapping.nodes)]
        flat = np.einsum("nak,ndk->nad", self.master.points[shape] - at[:, None], frame)
        xi = local_coordinates(self.master.mapping, flat, np.zeros((len(row), 1, 2)))[:, 0]
        if self.master.element.box:
            outside = np.maximum(np.abs(xi).max(axis=1) - 1.0, 0.0)
        else:
            outside = np.maximum(np.maximum(-xi.min(axis=1), xi.sum(axis=1) - 1.0), 0.0)
        order = np.lexsort((facet, np.round(outside, 9), row))
        first = order[np.unique(row[order], return_index=True)[1]]
        first = first[outside[first] <= _OUTSIDE]
        return row[first], facet[first], xi[first]

    def _near(self, nodes: Ints) -> tuple[Ints, Ints]:
        """Pairs of a row of `nodes` and a master facet that covers some of a slave facet of that node."""
        rows = np.full(len(self.slave.points), -1)
        rows[nodes] = np.arange(len(nodes))
        row = rows[self.slave.facets[self.segments.slave]]
        facet = np.broadcast_to(self.segments.master[:, None], row.shape)
        pairs = np.unique(np.column_stack([row[row >= 0], facet[row >= 0]]), axis=0)
        return pairs[:, 0], pairs[:, 1]


def mortar_interface(
    block_I: Block, block_J: Block, tolerance: float, overlap: float, location: str
) -> MortarInterface:
    """Find the facets of two blocks that lie on each other, matching or not.

    Parameters
    ----------
    tolerance : distance of the faces [m]; see `segments`
    overlap : least share of either face that the other covers
    location : file and key, for messages

    Raises
    ------
    ConfigError
        where nothing lies on each other, too little, or facets at too large an angle.
    MeshError
        where the faces are apart, or inside each other, by more than the tolerance and their curvature.
    """
    I, J = MortarSurface.boundary(block_I), MortarSurface.boundary(block_J)
    between = _facing(I, J, tolerance, location)
    share_I = np.bincount(between.slave, between.area, len(I.facets)) / I.areas
    share_J = np.bincount(between.master, between.area, len(J.facets)) / J.areas
    touched_I, touched_J = np.flatnonzero(share_I > _TOUCHED), np.flatnonzero(share_J > _TOUCHED)
    if not len(touched_I) or not len(touched_J):
        raise ConfigError(do_not_touch(block_I, block_J, tolerance, location))
    I, J = I.only(touched_I), J.only(touched_J)
    for face in (I, J):
        # dual shape functions are those of one kind of facet
        if len(facets_by_kind(face.facets)) > 1:
            raise ConfigError(
                f"{location}: the face of block {face.block!r} there has triangles and quadrilaterals, which "
                "discretization: mortar does not take together; mesh the face with one kind, or set "
                "discretization: node_to_node where the meshes conform"
            )
    area = float(between.area.sum())
    shares = area / I.areas.sum(), area / J.areas.sum()
    if max(shares) < overlap:
        middle = ", ".join(f"{x:.6g}" for x in I.points[I.facets].mean(axis=(0, 1)))
        area_I, area_J = I.areas.sum(), J.areas.sum()
        raise ConfigError(
            f"{location}: the faces of {I.block!r} and {J.block!r} lie on each other over {area:.6g} m2 "
            f"about ({middle}), {area / area_I:.3g} of {area_I:.6g} m2 and {area / area_J:.3g} of "
            f"{area_J:.6g} m2 of the facets that meet, limit {overlap:g} of one; move a block, mesh along "
            "the common edge, or lower its `overlap`"
        )
    equal = abs(shares[0] - shares[1]) < _EQUAL
    corners_I, corners_J = (len(np.unique(face.facets[:, : face.element.corners])) for face in (I, J))
    # of faces that are equal in this, too, the first by name, in whatever order they stand
    slave_is_J = (corners_J, I.block) > (corners_I, J.block) if equal else shares[1] > shares[0]
    slave, master = (J, I) if slave_is_J else (I, J)
    between = _facing(slave, master, tolerance, location)
    refuse_clearance(slave, master, between, tolerance, location)
    return MortarInterface(slave, master, between, slave_is_J)


def _facing(I: MortarSurface, J: MortarSurface, tolerance: float, location: str) -> Segments:
    """Segments of facets that face each other.

    Beside an edge of the interface facets also come near others at an angle; these are left out while they
    are few.
    """
    between = segments(I, J, tolerance)
    angle = np.degrees(np.arccos(np.clip(-between.cosine, -1.0, 1.0)))
    steep = angle > STEEPEST
    share = between.area[steep].sum() / max(between.area.sum(), np.finfo(float).tiny)
    if share > _FEW:
        worst = int(np.argmax(angle))
        at = ", ".join(f"{x:.6g}" for x in I.points[I.facets[between.slave[worst]]].mean(axis=0))
        raise ConfigError(
            f"{location}: the faces of {I.block!r} and {J.block!r} stand at {angle[worst]:.3g} degrees to "
            f"each other at ({at}), and at more than {STEEPEST:g} over {share:.2g} of the area where they "
            f"meet, limit {_FEW:g}; mesh them so that they lie on each other"
        )
    return between.only(~steep)
