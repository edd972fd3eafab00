"""The pressure of the water in a joint: piecewise linear heads along the lines from heel to toe.

Its mean around the nodes of a face is integrated section by section.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from romdam.config.sections.joint_water import JointWaterConfig
from romdam.core.arrays import Floats
from romdam.core.scene import JointFace
from romdam.geometry.elements import Element, facet_element, simplex_rule
from romdam.geometry.facets import area_elements, below
from romdam.scene.mortar.surface import local_coordinates

_NEAR = 1e-9  # of the outline's extent: the same line
_SHORT = 1e-9  # [m] a line that only touches a corner
_AT_ONCE = 2_000_000  # points times edges
_DEGREE = 5  # of the rules: pressure, shape function and area of a facet that no kink cuts
_POINTS = 3  # Gauss points along each direction of a quadrilateral, to the same degree
_CUT = 1e-9  # of the values at a facet's corners, by which a kink must pass through it


@dataclass(frozen=True)
class PressureOutline:
    """The outline of a joint's face, by which heel and toe of every line are told.

    Attributes
    ----------
    ends : (n, 2, 3) of its edges [m]
    downstream, across : (3,) unit vectors
    """

    ends: Floats
    downstream: Floats
    across: Floats

    @classmethod
    def of(cls, points: Floats, face: JointFace, downstream: Floats, across: Floats) -> PressureOutline:
        """The edges that one facet alone has."""
        pairs = [np.stack([f, np.roll(f, -1, axis=1)], axis=2).reshape(-1, 2) for f in face.facets]
        edges, count = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0, return_counts=True)
        return cls(points[edges[count == 1]], downstream, across)

    def lines(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Begin and end of the lines through points (m, 3) along `downstream`; the toe's height [m]."""
        size = max(1, _AT_ONCE // len(self.ends))
        chunks = [self._lines(points[i : i + size]) for i in range(0, max(1, len(points)), size)]
        heel, toe, height = (np.concatenate(column) for column in zip(*chunks, strict=True))
        return heel, toe, height

    def _lines(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        s, (s_0, s_1) = points @ self.across, (self.ends @ self.across).T
        near = _NEAR * float(np.ptp(self.ends.reshape(-1, 3), axis=0).max())
        slanted = np.abs(s_1 - s_0) > near  # its neighbours know the ends of one along the lines
        ends, s_0, s_1 = self.ends[slanted], s_0[slanted], s_1[slanted]
        share = (s[:, None] - s_0) / (s_1 - s_0)
        on = (s[:, None] - np.minimum(s_0, s_1) >= -near) & (s[:, None] - np.maximum(s_0, s_1) <= near)
        along, up = ends @ self.downstream, ends[:, :, 2]
        x = along[:, 0] + share * (along[:, 1] - along[:, 0])
        z = up[:, 0] + share * (up[:, 1] - up[:, 0])
        last = np.where(on, x, -np.inf).argmax(axis=1)
        row = np.arange(len(points))
        return np.where(on, x, np.inf).min(axis=1), x[row, last], z[row, last]


@dataclass(frozen=True)
class Diagram:
    """Pressure of the water in a joint.

    Attributes
    ----------
    water : the configuration's
    weight : of the water per volume [N/m3]
    outline : where the head depends on the distance from the heel
    tips : (lines, 2) of a crack from the heel: where lines stand across the joint, in order, and the distance
        of each one's tip from its heel, linear between them; None without a crack [m]
    """

    water: JointWaterConfig
    weight: float
    outline: PressureOutline | None
    tips: Floats | None = None

    def pressure(self, points: Floats) -> Floats:
        """Pressure at points (m, 3) of the joint [Pa]."""
        x, starts, heads = self._sections(points)
        section = (x[:, None] >= starts[:, 1:]).sum(axis=1)
        return self.weight * np.maximum(heads[np.arange(len(points)), section] - points[:, 2], 0.0)

    def kinks(self, points: Floats) -> Floats:
        """Functions (m, k) between whose zeros the pressure is linear [m]."""
        x, starts, heads = self._sections(points)
        return np.column_stack([x[:, None] - starts[:, 1:], heads - points[:, 2:]])

    def _sections(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Distance from the heel (m,); where sections start and the head that each has, (m, k) [m]."""
        water, z = self.water, points[:, 2]
        level = np.full(len(points), water.level)
        if self.outline is None:
            return np.zeros(len(points)), np.zeros((len(points), 1)), level[:, None]
        heel, toe, height = self.outline.lines(points)
        x, length = points @ self.outline.downstream - heel, toe - heel
        tail = np.full(len(points), -np.inf) if water.tailwater is None else np.full_like(z, water.tailwater)
        if water.waterstop is not None:
            starts, heads = [np.zeros_like(x), np.full_like(x, water.waterstop)], [level, np.maximum(tail, z)]
            return x, np.column_stack(starts), np.column_stack(heads)
        low = np.minimum(np.maximum(tail, height), level)
        tip = np.zeros_like(x)
        if self.tips is not None:
            tip = np.minimum(np.interp(points @ self.outline.across, *self.tips.T), length)
        rest = length - tip
        share = np.divide(x - tip, rest, out=np.zeros_like(x), where=rest > _SHORT)
        straight = level + (low - level) * share
        if water.drains is None and self.tips is None:
            return x, np.zeros((len(x), 1)), straight[:, None]
        if water.drains is None:
            return x, np.column_stack([np.zeros_like(x), tip]), np.column_stack([level, straight])
        at, drained = water.drains.at, self._drained(low, length, tip)
        works = tip < at  # drains that the crack has passed are lost
        fall = (drained - level) * (x - tip)
        before = level + np.divide(fall, at - tip, out=np.zeros_like(x), where=works)
        behind = drained + (low - drained) * (x - at) / (length - at)
        starts = [np.zeros_like(x), tip, np.where(works, at, tip)]
        heads = [level, np.where(works, before, straight), np.where(works, behind, straight)]
        if self.tips is None:
            starts, heads = starts[1:], heads[1:]
        return x, np.column_stack(starts), np.column_stack(heads)

    def _drained(self, low: Floats, length: Floats, tip: Floats) -> Floats:
        """Head at the drains [m]; `low` is that at the toe, `tip` the end of the crack before them."""
        drains, level = self.water.drains, self.water.level
        assert drains is not None
        least = low if drains.gallery is None else np.maximum(low, drains.gallery)
        left: Floats | float = 1.0
        if drains.rule == "usace":
            works = tip < drains.at
            passed = np.divide(drains.at - tip, length - tip, out=np.zeros_like(low), where=works)
            left = 1.0 - passed
        return least + drains.share_left * (level - least) * left


def mean_pressure(points: Floats, face: JointFace, diagram: Diagram) -> Floats:
    """int p N dA / int N dA at the corners of the face, (nodes of the block,) [Pa]; NaN elsewhere.

    Resultant and moment of the pressure over flat facets are those of its diagram.
    """
    force, area = np.zeros(len(points)), np.zeros(len(points))
    for facets in face.facets:
        element = facet_element(facets)
        kinks = diagram.kinks(points[facets].reshape(-1, 3)).reshape(*facets.shape, -1)
        least = _CUT * np.abs(kinks).max(axis=(0, 1))
        cut = ((kinks.min(axis=1) < -least) & (kinks.max(axis=1) > least)).any(axis=1)
        xi, weight = element.rule_of(_POINTS if element.box else _DEGREE)
        shape, dA = element.shape(xi), np.linalg.norm(area_elements(points, facets, xi), axis=2) * weight
        np.add.at(area, facets, dA @ shape)
        at = np.einsum("qa,fak->fqk", shape, points[facets[~cut]])
        p = diagram.pressure(at.reshape(-1, 3)).reshape(at.shape[:2])
        np.add.at(force, facets[~cut], (p * dA[~cut]) @ shape)
        for facet in facets[cut]:
            force[facet] += _cut_force(points[facet], element, diagram)
    with np.errstate(invalid="ignore"):
        return np.asarray(force / area)


def _cut_force(corners: Floats, element: Element, diagram: Diagram) -> Floats:
    """int p N dA of one facet, in pieces none of which has a kink within, (corners,) [N]."""
    xi, weight = simplex_rule(_DEGREE, 2)
    fan = [corners[[0, k, k + 1]] for k in range(1, len(corners) - 1)]
    for k in range(diagram.kinks(corners).shape[1]):
        values = diagram.kinks(np.concatenate(fan))[:, k].reshape(-1, 3)
        halved = []
        for piece, value in zip(fan, values, strict=True):
            if (value >= 0.0).all() or (value <= 0.0).all():
                halved.append(piece)
            else:
                halved += below(piece, value) + below(piece, -value)
        fan = halved
    pieces = np.array(fan)
    sides = pieces[:, 1:] - pieces[:, :1]
    at = (pieces[:, :1] + xi @ sides).reshape(-1, 3)
    dA = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)[:, None] * weight
    plane = np.linalg.svd(corners - corners.mean(axis=0))[2][:2].T
    within = local_coordinates(element, (corners @ plane)[None], (at @ plane)[None])[0]
    return np.asarray((diagram.pressure(at) * dA.ravel()) @ element.shape(within))
