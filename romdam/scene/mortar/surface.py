"""One face of an interface as mortar coupling takes it: facets, and the flat pieces they are clipped by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.scene import Block
from romdam.geometry.elements import Element, facet_element, facet_frame
from romdam.geometry.facets import boundary_facets, facet_areas
from romdam.geometry.meshes.kinds import facets_by_kind

_STRAIGHT = 1e-8  # distance of a node from where a flat facet with straight edges has it, in facet sizes
_NEWTON = 20


@dataclass(frozen=True)
class Pieces:
    """Flat pieces of facets.

    Attributes
    ----------
    corners : (n, 4, 3), counterclockwise from outside; the last one of a triangle stands twice [m]
    facet : (n,) the facet of each
    centre, normal : (n, 3), the normal of unit length
    radius : (n,) of the corners about the centre [m]
    """

    corners: Floats
    facet: Ints
    centre: Floats
    normal: Floats
    radius: Floats


@dataclass(frozen=True)
class MortarSurface:
    """Facets of one block, outward.

    Attributes
    ----------
    block : its name
    points : (n, 3) of all its nodes [m]
    facets : (nf, nodes per facet)
    """

    block: str
    points: Floats
    facets: Ints

    @classmethod
    def boundary(cls, block: Block) -> MortarSurface:
        """The whole boundary of a block."""
        return cls(block.name, block.points, boundary_facets(block.cells, block.element))

    def only(self, facets: Ints) -> MortarSurface:
        """Some of the facets."""
        kinds = facets_by_kind(self.facets[facets])
        return MortarSurface(self.block, self.points, kinds[0][1] if len(kinds) == 1 else self.facets[facets])

    @cached_property
    def element(self) -> Element:
        """Of the facets."""
        return facet_frame(self.facets)

    @cached_property
    def corner_element(self) -> Element:
        """Of their corners."""
        return facet_frame(self.facets[:, : self.element.corners])

    @cached_property
    def areas(self) -> Floats:
        """Of the facets (nf,) [m2]."""
        return facet_areas(self.points, self.facets)

    @cached_property
    def is_straight(self) -> bool:
        """True where all facets are flat with straight edges, and their nodes in the middle of corners."""
        nodes = self.points[self.facets]
        corners = nodes[:, : self.element.corners]
        straight = self.corner_element.shape(self.element.nodes) @ corners
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        height = np.einsum("fak,fk->fa", corners - corners[:, :1], normal)
        size = np.sqrt(self.areas)[:, None]
        off = np.linalg.norm(nodes - straight, axis=2)
        return bool((off <= _STRAIGHT * size).all() and (np.abs(height) <= _STRAIGHT * size).all())

    @cached_property
    def is_affine(self) -> bool:
        """True for straight triangles and parallelograms: polynomials of the plane stay polynomials."""
        if not self.is_straight:
            return False
        a, b, c, d = (self.points[self.facets[:, k]] for k in (0, 1, 2, self.corner_element.corners - 1))
        skew = np.linalg.norm(a - b + c - d, axis=1)
        return not self.element.box or bool((skew <= _STRAIGHT * np.sqrt(self.areas)).all())

    @cached_property
    def mapping(self) -> Element:
        """The element that gives the facets their shape: of the corners alone where they are straight."""
        return self.corner_element if self.is_straight else self.element

    @cached_property
    def pieces(self) -> Pieces:
        """The facets themselves where they are straight, else the linear facets their nodes cut them into."""
        pieces, owner = [], []
        for rows, facets, _ in facets_by_kind(self.facets):
            element = facet_element(facets)
            corner_lists = (tuple(range(element.corners)),) if self.is_straight else element.pieces
            padded = np.array([(*corners_of, corners_of[-1])[:4] for corners_of in corner_lists])
            pieces.append(self.points[facets[:, padded]].reshape(-1, 4, 3))
            owner.append(np.repeat(rows, len(corner_lists)))
        corners, facet = np.concatenate(pieces), np.concatenate(owner)
        centre = corners.mean(axis=1)
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        return Pieces(corners, facet, centre, normal, radius)


def local_coordinates(element: Element, nodes: Floats, points: Floats) -> Floats:
    """Reference coordinates of points of the plane in facets of the plane, by Newton's method.

    Parameters
    ----------
    nodes : (n, nodes per facet, 2)
    points : (n, q, 2)

    Returns
    -------
    (n, q, 2)
    """
    shape = points.shape
    xi = np.broadcast_to(element.nodes[: element.corners].mean(axis=0), shape).reshape(-1, 2).copy()
    affine = element.corners == len(element.nodes) == 3
    for _ in range(1 if affine else _NEWTON):
        at = np.einsum("nqa,nak->nqk", element.shape(xi).reshape(*shape[:2], -1), nodes, optimize=True)
        slope = element.gradient(xi).reshape(*shape[:2], 2, -1)
        tangents = np.einsum("nqda,nak->nqdk", slope, nodes, optimize=True)
        # solve step @ tangents = points - at, 2 by 2 each
        (a, b), (c, d) = tangents[..., 0, :].transpose(2, 0, 1), tangents[..., 1, :].transpose(2, 0, 1)
        p, q = (points - at).transpose(2, 0, 1)
        step = np.stack([d * p - c * q, a * q - b * p], axis=-1) / (a * d - b * c)[..., None]
        step = step.reshape(-1, 2)
        xi += step
        if np.abs(step).max(initial=0.0) < 1e-13:
            break
    return xi.reshape(shape)
