"""Named sections: planes through blocks on which normal force, shear and moment are stated.

A section is a function of the nodes that steps from 0 below its plane to 1 above. With it the internal
nodal forces K u of the blocks add up to the resultant of the stress on the plane: virtual work of a rigid
motion of all that is above, in which only the cells of the step deform. That resultant is in equilibrium
with the loads and inertia of the discrete model, whatever the error of its stresses.

Step and arm, which grows from 0 as the distance above the plane, are linear between up to five levels of the
mesh's nodes, which its elements follow exactly. Their values at the levels in between are such that loads
that are quadratic along the normal do the work that they would on the plane itself.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from romdam.config.sections.stress import SectionConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Ints, Section
from romdam.scene.elements import ELEMENTS, Floats

_WINDOWS = 4
_APART = 0.5  # of a cell's height, at least, from level to level
_ON = 1e-6  # of the blocks' height: what is on the plane
_ASIDE = 1e-9  # of the blocks' height: how far from nodes on the plane its area is taken
_TETRAHEDRA = np.array([(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)])
_CUTS = {  # corners above the plane, of four from low to high -> triangles of points on edges
    1: (((0, 3), (1, 3), (2, 3)),),
    2: (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))),
    3: (((0, 1), (0, 2), (0, 3)),),
}
_UPRIGHT = 0.99  # cosine beyond which a normal is taken to be along an axis


def build_section(name: str, config: SectionConfig, blocks: Mapping[str, Block], place: str) -> Section:
    """Find the step, the axes and the shape of a section.

    Raises
    ------
    ConfigError
        for a normal without length, and a plane that does not meet the blocks.
    """
    chosen = {key: blocks[key] for key in (blocks if config.blocks == "all" else config.blocks)}
    if not chosen:
        raise ConfigError(f"{place}.blocks: names no block; name those that the plane cuts, or write all")
    axes, point = _axes(np.array(config.normal), place), np.array(config.point)
    height = {key: (block.points - point) @ axes[0] for key, block in chosen.items()}
    levels = _levels(chosen, height, place)
    step, arm = ({key: _above(own, levels, degree) for key, own in height.items()} for degree in (0, 1))
    whole = np.concatenate(list(height.values()))
    aside = _ASIDE * np.ptp(whole)
    aside *= 1.0 if whole.max() > aside else -1.0  # below the blocks' own end
    triangles = np.concatenate([_triangles(block, height[key] - aside) for key, block in chosen.items()])
    area, centroid, second = _shape(triangles)
    sides = _sides(triangles.reshape(-1, 3), axes, centroid)
    return Section(name, step, arm, axes, centroid, area, axes[1:] @ second @ axes[1:].T, sides)


def _axes(normal: Floats, place: str) -> Floats:
    """Normal, and two axes in the plane: the first as near as can be to x, or to y where the normal is x."""
    length = float(np.linalg.norm(normal))
    if length == 0.0:
        raise ConfigError(f"{place}.normal: must have a length, got 0, 0, 0; for example [0, 0, 1]")
    normal = normal / length
    first = np.eye(3)[1 if abs(normal[0]) > _UPRIGHT else 0]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([normal, first, np.cross(normal, first)])


def _levels(blocks: Mapping[str, Block], height: Mapping[str, Floats], place: str) -> Floats:
    """Up to five levels of corner nodes around the plane, above it [m]."""
    corners = {key: height[key][b.cells[:, : ELEMENTS[b.element].corners]] for key, b in blocks.items()}
    low, high = min(c.min() for c in corners.values()), max(c.max() for c in corners.values())
    on = _ON * (high - low)
    bottom, top = (np.concatenate([f(c, axis=1) for c in corners.values()]) for f in (np.min, np.max))
    met = (bottom <= on) & (top >= -on)
    if not met.any():
        raise ConfigError(
            f"{place}: the plane does not meet {', '.join(blocks)}, which reach from {low:.6g} to {high:.6g} "
            "m along the normal from `point`; move `point`, or name the blocks that it cuts"
        )
    size = _APART * float(np.median((top - bottom)[met]))
    levels = np.unique(np.concatenate([c.ravel() for c in corners.values()]))
    below = _spaced(levels[levels <= on][::-1], size)
    above = _spaced(levels[levels > below[0] + size], size)
    least = _WINDOWS // 2 + (abs(below[0]) <= on)
    taken = max(least, _WINDOWS + 1 - len(above))
    return np.r_[below[:taken][::-1], above][: _WINDOWS + 1]


def _spaced(levels: Floats, size: float) -> Floats:
    """The first level, and each that is farther than `size` from the one taken before it."""
    taken = list(levels[:1])
    for level in levels[1:]:
        if abs(level - taken[-1]) > size:
            taken.append(level)
        if len(taken) > _WINDOWS:
            break
    return np.array(taken)


def _above(height: Floats, levels: Floats, degree: int) -> Floats:
    """Values (n,) of the function that stands for height^degree above the plane, and for 0 below.

    It is linear between the levels, and has the integrals of that function times 1, s, s^2 between them.
    """
    xi, weight = np.polynomial.legendre.leggauss(_WINDOWS)
    half = 0.5 * np.diff(levels)[:, None]
    s, w = (half * xi + levels[:-1, None] + half).ravel(), (half * weight).ravel()
    hats = np.stack([np.interp(s, levels, one) for one in np.eye(len(levels))], axis=1)
    top = levels[-1]
    values = np.zeros(len(levels))
    values[-1] = top**degree
    power = np.arange(len(levels) - 2)
    wanted = top ** (power + degree + 1) / (power + degree + 1)
    moments = (s[:, None] ** power * w[:, None]).T @ hats
    values[1:-1] = np.linalg.solve(moments[:, 1:-1], wanted - moments[:, -1] * values[-1])
    return np.where(height > top, height**degree, np.interp(height, levels, values, left=0.0))


def stepping_cells(block: Block, step: Floats) -> Ints:
    """The cells in which the step is not constant."""
    return np.flatnonzero(np.ptp(step[block.cells], axis=1) > 0.0)


def _triangles(block: Block, height: Floats) -> Floats:
    """Triangles (t, 3, 3) that the plane cuts out of a block's cells, as tetrahedra of their corners [m]."""
    cells = block.cells[:, : ELEMENTS[block.element].corners]
    tets = cells if cells.shape[1] == 4 else cells[:, _TETRAHEDRA].reshape(-1, 4)
    tets = np.take_along_axis(tets, np.argsort(height[tets], axis=1), axis=1)
    above = (height[tets] > 0.0).sum(axis=1)
    found = [np.zeros((0, 3, 3))]
    for count, edges in _CUTS.items():
        ends = tets[above == count][:, np.array(edges)]  # (tets, triangles, 3, 2)
        low, high = height[ends[..., 0]], height[ends[..., 1]]
        share = (low / (low - high))[..., None]
        points = (1.0 - share) * block.points[ends[..., 0]] + share * block.points[ends[..., 1]]
        found.append(points.reshape(-1, 3, 3))
    return np.concatenate(found)


def _shape(triangles: Floats) -> tuple[float, Floats, Floats]:
    """Area, centroid (3,) and second moments (3, 3) about it of triangles (t, 3, 3)."""
    area = 0.5 * np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    centroid = area @ triangles.mean(axis=1) / area.sum()
    y = triangles - centroid
    corners, whole = np.einsum("t,tik,til->kl", area, y, y), y.sum(axis=1)
    return float(area.sum()), centroid, (corners + np.einsum("t,tk,tl->kl", area, whole, whole)) / 12.0


def _sides(points: Floats, axes: Floats, centroid: Floats) -> Floats:
    """The section's ends through its centroid along either axis, (4, 3) [m]."""
    along = (points - centroid) @ axes[1:].T
    reach = np.stack([along.min(axis=0), along.max(axis=0)], axis=1)  # (axis, end)
    return centroid + (reach[:, :, None] * axes[1:, None, :]).reshape(4, 3)
