"""Named sections: planes through blocks on which normal force, shear and moment are stated.

A section is a function of the nodes that steps from 0 below its plane to 1 above. With it the internal
nodal forces K u of the blocks add up to the resultant of the stress on the plane: virtual work of a rigid
motion of all that is above, in which only the cells of the step deform. That resultant is in equilibrium
with the loads and inertia of the discrete model, whatever the error of its stresses.

Step and arm, which grows from 0 as the distance above the plane, are linear between up to five levels of the
mesh's nodes, which its elements follow exactly. Their values at the levels in between are such that loads
that are quadratic along the normal do the work that they would on the plane itself. Levels end where the
area has a kink; forces of gaps, which begin and end anywhere, are counted by themselves, see `gaps_above`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from romdam.config.sections.stress import SectionConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Bools, Ints, Joint, Section, Tie
from romdam.geometry.elements import Floats
from romdam.geometry.facets import below
from romdam.geometry.meshes.kinds import frame

_WINDOWS = 4
_APART = 0.5  # of a cell's height, at least, from level to level
_ON = 1e-6  # of the blocks' height: what is on the plane
_ASIDE = 1e-9  # of the blocks' height: how far from nodes on the plane its area is taken
_FEWEST = 3  # windows between levels, below which a kink is passed over
_LEAST = 2  # windows below which the end of a block is passed over: what bears weight has to be right
_NEAR = 1e-3  # of a cell's height: where the area's slope is taken near a level
_KINK = 0.02  # of the area, what its slope changes by over a cell's height
_TETRAHEDRA = {  # that fill a cell, by its number of corners
    4: np.array([(0, 1, 2, 3)]),
    5: np.array([(0, 1, 2, 4), (0, 2, 3, 4)]),
    6: np.array([(0, 1, 2, 5), (0, 1, 5, 4), (0, 4, 5, 3)]),
    8: np.array([(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]),
}
_HALVES = ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3))
_CUTS = {  # corners above the plane, of four from low to high -> triangles of points on edges
    1: (((0, 3), (1, 3), (2, 3)),),
    2: (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))),
    3: (((0, 1), (0, 2), (0, 3)),),
}
_UPRIGHT = 0.99  # cosine beyond which a normal is taken to be along an axis


def build_section(
    name: str, config: SectionConfig, blocks: Mapping[str, Block], ties: Sequence[Tie], location: str
) -> Section:
    """Find the step, the axes and the shape of a section.

    Every block, or several that are tied, has levels of its own: forces of gaps are counted by themselves.

    Raises
    ------
    ConfigError
        for a normal without length, and a plane that does not meet the blocks.
    """
    chosen = {key: blocks[key] for key in (blocks if config.blocks == "all" else config.blocks)}
    if not chosen:
        raise ConfigError(f"{location}.blocks: names no block; name those that the plane cuts, or write all")
    # the first axis in the plane is as near as can be to x, or to y where the normal is x
    length = float(np.linalg.norm(config.normal))
    if length == 0.0:
        raise ConfigError(f"{location}.normal: must have a length, got 0, 0, 0; for example [0, 0, 1]")
    normal = np.array(config.normal) / length
    first = np.eye(3)[1 if abs(normal[0]) > _UPRIGHT else 0]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    axes, point = np.stack([normal, first, np.cross(normal, first)]), np.array(config.point)

    height = {key: (block.points - point) @ axes[0] for key, block in chosen.items()}
    whole = np.concatenate(list(height.values()))
    on = _ON * float(np.ptp(whole))
    if not whole.min() <= on or not whole.max() >= -on:
        raise ConfigError(
            f"{location}: the plane does not meet {', '.join(chosen)}, which reach from "
            f"{whole.min():.6g} to {whole.max():.6g} m along the normal from `point`; move `point`, or name "
            "the blocks that it cuts"
        )
    step, arm, coarse = dict[str, Floats](), dict[str, Floats](), False
    for body in _bodies(list(chosen), ties):
        of_body = {key: height[key] for key in body}
        low, high = min(map(np.min, of_body.values())), max(map(np.max, of_body.values()))
        if high <= on < whole.max() or low > on:  # beside the plane
            step |= {key: np.full(len(heights), float(low > on)) for key, heights in of_body.items()}
            arm |= {key: np.where(heights > on, heights, 0.0) for key, heights in of_body.items()}
            continue
        levels, few = _levels({key: chosen[key] for key in body}, of_body, on)
        step |= {key: _above(heights, levels, 0) for key, heights in of_body.items()}
        arm |= {key: _above(heights, levels, 1) for key, heights in of_body.items()}
        coarse = coarse or few

    # area, centroid (3,) and second moments (3, 3) about it of the plane's triangles
    triangles = _cut(chosen, height, _aside(height))
    area = _areas(triangles)
    centroid = area @ triangles.mean(axis=1) / area.sum()
    y = triangles - centroid
    corners, whole = np.einsum("t,tik,til->kl", area, y, y), y.sum(axis=1)
    second = (corners + np.einsum("t,tk,tl->kl", area, whole, whole)) / 12.0

    # ends through the centroid along either axis in the plane, (4, 3)
    along = (triangles.reshape(-1, 3) - centroid) @ axes[1:].T
    reach = np.stack([along.min(axis=0), along.max(axis=0)], axis=1)  # (axis, end)
    sides = centroid + (reach[:, :, None] * axes[1:, None, :]).reshape(4, 3)
    inertia = axes[1:] @ second @ axes[1:].T
    return Section(name, step, arm, axes, centroid, float(area.sum()), inertia, sides, coarse)


def gaps_above(joint: Joint, section: Section, blocks: Mapping[str, Block]) -> Floats:
    """Part of each gap's force that is above a section (n,).

    Where the plane cuts the facets around a gap, the force is spread over them as pressure that is linear
    between gaps.
    """
    normal = section.axes[0]
    aside = _aside({name: (blocks[name].points - section.centroid) @ normal for name in section.step})
    step = ((joint.position - section.centroid) @ normal > aside).astype(float)
    if joint.face is None:
        return step
    points = blocks[joint.face.block].points
    height = (points - section.centroid) @ normal
    whole, above = np.zeros((2, len(height)))
    cut = np.zeros(len(height), dtype=bool)
    for facets in joint.face.facets:
        # quadrilaterals are halved both ways, so that every half counts half
        halves = _HALVES if facets.shape[1] == 4 else ((0, 1, 2),)
        for half in halves:
            triangles = facets[:, list(half)]
            areas = _areas(points[triangles]) * (2.0 / max(len(halves), 2))
            for corners, size in zip(triangles, areas, strict=True):
                heights = height[corners]
                whole[corners] += size / 3.0
                cut[corners] |= heights.min() <= aside < heights.max()
                if heights.max() > aside:
                    for triangle in below(np.eye(3), aside - heights):  # in barycentric coordinates
                        above[corners] += size * abs(np.linalg.det(triangle)) * triangle.mean(axis=0)
    share = np.where(cut, above / np.maximum(whole, 1e-300), height > aside)
    if joint.patches is not None:
        return joint.of_corners(share)
    is_cut = cut[joint.corner]
    step[is_cut] = share[joint.corner[is_cut]]
    return step


def _aside(height: Mapping[str, Floats]) -> float:
    """Distance that takes what is on the plane below it; above it, at the end of the blocks [m]."""
    whole = np.concatenate(list(height.values()))
    aside = _ASIDE * float(np.ptp(whole))
    return aside if whole.max() > aside else -aside


def _bodies(names: Sequence[str], ties: Sequence[Tie]) -> list[list[str]]:
    """Names of blocks, those together that are tied."""
    body = {name: name for name in names}
    for tie in ties:
        I, J = (body.get(name) for name in tie.blocks)
        if I is not None and J is not None:
            body = {name: I if owner == J else owner for name, owner in body.items()}
    return [[name for name in names if body[name] == owner] for owner in dict.fromkeys(body.values())]


def _levels(blocks: Mapping[str, Block], height: Mapping[str, Floats], on: float) -> tuple[Floats, bool]:
    """Up to five levels of corner nodes around the plane, above it, between kinks of the area [m].

    And whether too few of them are there for a step that is right.
    """
    corners = {key: height[key][b.cells[:, : frame(b.element).corners]] for key, b in blocks.items()}
    bottom, top = (np.concatenate([f(c, axis=1) for c in corners.values()]) for f in (np.min, np.max))
    met = (bottom <= on) & (top >= -on)
    size = _APART * float(np.median((top - bottom)[met]))
    levels = np.unique(np.concatenate([c.ravel() for c in corners.values()]))
    under = _spaced(levels[levels <= on][::-1], size)
    above = _spaced(levels[levels > under[0] + size], size)
    around = np.r_[under[::-1], above]
    # at a kink within the blocks the area of one of them changes its slope, or itself, and loads with it
    (kinks, ends), near = np.zeros((2, len(around)), dtype=bool), _NEAR * size
    for k, level in enumerate(around):
        low_area, area, high_area = (
            np.array(
                [_areas(_cut({key: block}, height, level + aside)).sum() for key, block in blocks.items()]
            )
            for aside in (-near, 0.0, near)
        )
        change = float(np.abs(low_area - 2.0 * area + high_area).sum()) * size
        within = min(low_area.sum(), high_area.sum()) > 0.0
        kinks[k] = within and change > _KINK * area.sum() * near
        ends[k] = within and bool(((low_area > 0.0) != (high_area > 0.0)).any())
    span = (
        _between_kinks(around, kinks, on, _FEWEST)
        or _between_kinks(around, ends, on, _LEAST)
        or (0, len(around) - 1)
    )
    first, last = span
    coarse = bool(ends[first + 1 : last].any()) or last - first < _FEWEST
    under, above = under[under >= around[first]], above[above <= around[last]]
    least = _WINDOWS // 2 + (abs(under[0]) <= on)
    taken = max(least, _WINDOWS + 1 - len(above))
    return np.r_[under[:taken][::-1], above][: _WINDOWS + 1], coarse


def _between_kinks(levels: Floats, kinks: Bools, on: float, fewest: int) -> tuple[int, int] | None:
    """First and last of the levels around the plane between which the area has no kink.

    A plane in a kink goes with what is above it, or else below. None where fewer windows are left than the
    fewest, for a step that is right.
    """
    inner = np.flatnonzero(kinks)
    ends = np.r_[0, inner, len(levels) - 1]
    low, high = ends[levels[ends] <= on].max(initial=0), ends[levels[ends] > on].min(initial=len(levels) - 1)
    if high - low >= fewest:
        return int(low), int(high)
    lower = ends[ends < low].max(initial=0)
    if abs(levels[low]) <= on and low - lower >= fewest:
        return int(lower), int(low)
    return None


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
    hats = np.stack([np.interp(s, levels, hat) for hat in np.eye(len(levels))], axis=1)
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


def _cut(blocks: Mapping[str, Block], height: Mapping[str, Floats], level: float) -> Floats:
    """Triangles (t, 3, 3) that the plane at a level cuts out of blocks [m].

    Cells are filled with tetrahedra of their corners.
    """
    triangles = [np.zeros((0, 3, 3))]
    for key, block in blocks.items():
        above_plane = height[key] - level
        cells = block.cells[:, : frame(block.element).corners]
        sides = above_plane[cells] > 0.0
        cells = cells[sides.any(axis=1) & ~sides.all(axis=1)]
        tets = cells[:, _TETRAHEDRA[cells.shape[1]]].reshape(-1, 4)
        tets = np.take_along_axis(tets, np.argsort(above_plane[tets], axis=1), axis=1)
        above = (above_plane[tets] > 0.0).sum(axis=1)
        for count, edges in _CUTS.items():
            ends = tets[above == count][:, np.array(edges)]  # (tets, triangles, 3, 2)
            low, high = above_plane[ends[..., 0]], above_plane[ends[..., 1]]
            share = (low / (low - high))[..., None]
            points = (1.0 - share) * block.points[ends[..., 0]] + share * block.points[ends[..., 1]]
            triangles.append(points.reshape(-1, 3, 3))
    return np.concatenate(triangles)


def _areas(triangles: Floats) -> Floats:
    a, b, c = np.moveaxis(triangles, 1, 0)
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
