"""Parts of a block that the configuration names: faces, planes, the node nearest to a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.places import FaceRef, PlaneRef
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Ints
from romdam.geometry.facets import boundary_facets, facets_in_plane


def select_facets(block: Block, face: FaceRef, location: str) -> Ints:
    """Facets of a named face, or all boundary facets in a plane, (nf, nodes per facet).

    Raises
    ------
    ConfigError
        for an unknown face, and when nothing lies on the face or plane.
    """
    if isinstance(face, PlaneRef):
        boundary = boundary_facets(block.cells, block.element)
        axis = "xyz".index(face.axis)
        facets = facets_in_plane(block.points, boundary, axis, face.at, face.tolerance)
        if not len(facets):
            along = block.points[boundary, axis]
            off = np.abs(along - face.at).max(axis=1)
            raise ConfigError(
                f"{location}: the plane {face.axis} = {face.at:g} m catches no node of block {block.name!r}, "
                f"which spans {face.axis} = {along.min():g} to {along.max():g} m; its nearest facet is "
                f"{off.min():.4g} m off, tolerance {face.tolerance:g} m; correct `at`, or raise `tolerance`"
            )
        return facets
    if face in block.unsound_faces:
        raise ConfigError(
            f"{location}: face {face!r} of block {block.name!r} is not sound in its mesh file: "
            f"{block.unsound_faces[face]}; repair the file, or name another face"
        )
    if face not in block.faces:
        known = ", ".join(sorted(block.faces)) or (
            "none (those of a mesh file are its groups of facets); select by plane: {axis: z, at: 0}"
        )
        raise ConfigError(f"{location}: block {block.name!r} has no face {face!r}; its faces are {known}")
    if not len(block.faces[face]):
        raise ConfigError(
            f"{location}: face {face!r} of block {block.name!r} has no facets, so it catches no node"
        )
    return block.faces[face]


def facet_keys(block: str, facets: Ints) -> list[tuple[str, tuple[int, ...]]]:
    """Names of facets by their nodes, whatever selects them and in whatever order."""
    return [(block, tuple(facet)) for facet in np.sort(facets, axis=1).tolist()]


def refuse_selected_twice(
    seen: dict[tuple[str, tuple[int, ...]], str], block: str, facets: Ints, location: str
) -> None:
    """Refuse a facet that a list names already: what acts on it would act twice.

    Parameters
    ----------
    seen : facet -> where it was named, of the entries before; gains those at hand

    Raises
    ------
    ConfigError
    """
    keys = facet_keys(block, facets)
    again = [key for key in keys if key in seen]
    if again:
        raise ConfigError(
            f"{location}: {len(again)} of {len(keys)} facets of block {block!r} are named by "
            f"{seen[again[0]]} already, limit 0: what acts there would act twice; name each facet once"
        )
    seen |= dict.fromkeys(keys, location)
    if len(set(keys)) < len(keys):
        raise ConfigError(
            f"{location}: {len(keys) - len(set(keys))} of {len(keys)} facets of block {block!r} stand twice "
            "in that face, limit 0; name each facet of the mesh's group once"
        )


def nearest_node(block: Block, at: tuple[float, float, float], tolerance: float, location: str) -> int:
    """Number of the node nearest to a point.

    Raises
    ------
    ConfigError
        when it is further away than the tolerance [m].
    """
    distance: NDArray[np.float64] = np.linalg.norm(block.points - np.array(at), axis=1)
    if block.matrices is not None:
        distance[block.matrices.absent.any(axis=1)] = np.inf
        distance[(block.matrices.motion > 2).any(axis=1)] = np.inf
    node = int(np.argmin(distance))
    if distance[node] > tolerance:
        nearest, wanted = (", ".join(f"{x:.6g}" for x in p) for p in (block.points[node], at))
        raise ConfigError(
            f"{location}: no node of block {block.name!r} within {tolerance:g} m of ({wanted}); the nearest "
            f"is ({nearest}), {distance[node]:.4g} m away; use its position, or raise `tolerance`"
        )
    return node
