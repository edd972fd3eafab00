"""Content of a viewer of a result: the surface of the dam and its fields, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import matplotlib as mpl
import numpy as np
from matplotlib.colors import Colormap

from romdam.core.arrays import Floats, Ints
from romdam.geometry.elements import ELEMENTS
from romdam.geometry.meshes.kinds import kinds_of
from romdam.postprocess.stress.summary import principal_stresses
from romdam.results.fields import Result
from romdam.results.series import Frames, dam_blocks, frame_times
from romdam.visual.field_views import magnification
from romdam.visual.style import directions, range_colours

_SHARE = 0.99  # of the stresses, that the colours reach at either end


@dataclass(frozen=True)
class MovingSurface:
    """Outer facets of one block, straight between its corners.

    Attributes
    ----------
    name : of the block
    points : (n, 3) [m]
    triangles, edges : (nt, 3) and (ne, 2) numbers of points
    """

    name: str
    points: Floats
    triangles: Ints
    edges: Ints


@dataclass(frozen=True)
class Field:
    """A field of all surfaces, one after another.

    Attributes
    ----------
    name, unit : as the colour bar is labelled
    factor : from SI to the unit
    low, high : ends of the colours, in SI; zero is between
    signed : whether the colours are told apart by sign
    axis : (3,) that the displacement is taken along; None for its size
    values : (frames, n) in SI, NaN where not known; None for what follows from the displacement
    """

    name: str
    unit: str
    factor: float
    low: float
    high: float
    signed: bool
    axis: Floats | None = None
    values: Floats | None = None

    @property
    def colours(self) -> Colormap:
        """Of the range: white at zero where the sign matters."""
        return range_colours(self.low, self.high) if self.signed else mpl.colormaps["viridis"]

    def of(self, moved: Floats, frame: int) -> Floats:
        """Values (n,) at a frame, from its displacement (n, 3), in the unit."""
        if self.values is not None:
            return self.factor * self.values[frame]
        return self.factor * (np.linalg.norm(moved, axis=1) if self.axis is None else moved @ self.axis)


@dataclass(frozen=True)
class Moving:
    """A dam in motion.

    Attributes
    ----------
    title, record : of the result
    surfaces : of its blocks
    times : (frames,) [s]
    moved : (frames, n, 3) displacement of all surfaces' points [m]
    fields : that can be shown, displacement first
    scale : that the shape is drawn with at first
    upstream : (3,) unit vector, or None where it is not known
    """

    title: str
    record: str
    surfaces: list[MovingSurface]
    times: Floats
    moved: Floats
    fields: list[Field]
    scale: float
    upstream: Floats | None = field(default=None)

    @property
    def points(self) -> Floats:
        """Points of all surfaces, (n, 3) [m]."""
        return np.concatenate([surface.points for surface in self.surfaces])

    def numbered(self) -> Iterator[tuple[MovingSurface, Ints, Ints]]:
        """Surfaces with their triangles and edges in the numbers of `points`."""
        first = 0
        for surface in self.surfaces:
            yield surface, surface.triangles + first, surface.edges + first
            first += len(surface.points)


def moving(result: Result, frames: Frames) -> Moving:
    """Rebuild the motion of the dam's surface, rock left out.

    Raises
    ------
    ResultError
        for a full-order result, and for a window without written times.
    """
    times = frame_times(result, frames)
    dataset, attrs = result.dataset, result.dataset.attrs
    surfaces, moved, stress = [], [], []
    for name in dam_blocks(result):
        surface, nodes = _surface(result, name)
        surfaces.append(surface)
        moved.append(result.displacement(name, nodes=nodes, times=list(times)).values)
        major = np.full((len(times), len(nodes)), np.nan)
        if "stress_file" in attrs and name in dataset.stress_block.values:
            with_stress = dataset.stress_node_number.values[dataset.stress_block.values == name]
            known = np.intersect1d(nodes, with_stress)
            tensor = result.stress(name, nodes=known, times=list(times)).values
            major[:, np.searchsorted(nodes, known)] = principal_stresses(tensor)[..., 0]
        stress.append(major)
    whole, principal = np.concatenate(moved, axis=1), np.concatenate(stress, axis=1)
    size = float(np.linalg.norm(whole, axis=2).max(initial=0.0))
    fields = [Field("displacement relative to the base", "mm", 1e3, 0.0, size, signed=False)]
    for direction, axis in directions(dataset).items():
        along = whole @ axis
        low, high = min(0.0, float(along.min())), max(0.0, float(along.max()))
        fields.append(Field(f"displacement {direction}", "mm", 1e3, low, high, signed=True, axis=axis))
    finite = principal[np.isfinite(principal)]
    if finite.size:
        low, high = (float(x) for x in np.quantile(finite, (1.0 - _SHARE, _SHARE)))
        ends = min(0.0, low), max(0.0, high)
        fields.append(Field("major principal stress", "MPa", 1e-6, *ends, signed=True, values=principal))
    upstream = np.asarray(attrs["upstream"], dtype=float) if "upstream" in attrs else None
    scale = magnification(result, size)
    return Moving(str(attrs["title"]), str(attrs["record"]), surfaces, times, whole, fields, scale, upstream)


def _surface(result: Result, name: str) -> tuple[MovingSurface, Ints]:
    """A block's outer facets by the corners of its cells, and the nodes that they are."""
    facets = np.concatenate(
        [_corner_facets(kind.name, cells) for kind, _, cells in kinds_of(*result.cells(name))]
    )
    keys = np.sort(facets, axis=1)
    twice = keys[:, 1:] == keys[:, :-1]  # triangles have a corner that stands twice, whichever it is
    keys[:, 1:] = np.where(twice, keys[:, -1:], keys[:, 1:])
    keys.sort(axis=1)
    _, back, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    outer = facets[counts[back.ravel()] == 1]
    nodes, numbered = np.unique(outer, return_inverse=True)
    corners = numbered.reshape(outer.shape)
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[corners[:, 2] != corners[:, 3]][:, [0, 2, 3]]])
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)
    return MovingSurface(name, result.points(name)[nodes], triangles, edges), nodes


def _corner_facets(element: str, cells: Ints) -> Ints:
    """Corners (nf, 4) of every facet of cells; of a triangle the last stands twice."""
    linear = ELEMENTS[ELEMENTS[element].linear]
    table = np.array([(*facet, facet[-1])[:4] for facet in linear.facets])
    return cells[:, : linear.corners][:, table].reshape(-1, 4)
