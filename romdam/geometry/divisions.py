"""Divisions of a generated dam that leave elements inside out or too slender are refused.

The message has divisions with which all elements are sound, found by one change after the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.geometry.refinement import (
    MOST_DIVISIONS,
    Counts,
    Divisions,
    every_count,
    in_all,
)
from romdam.core.errors import ConfigError, RomdamError
from romdam.core.scene import Ints
from romdam.geometry.elements import ELEMENTS, Floats, jacobians

_SLENDER = 100.0  # longest over shortest edge of concrete: stiffness over the short one drowns the long one's
_SLENDER_ROCK = 1000.0  # of rock, whose layers grow outwards and which no joint parts
_STEPS = 8  # changes one after the other that are tried for a remedy
_MOST_ELEMENTS = 100_000  # of a mesh that is tried for a remedy
_CHUNK = 4096  # cells whose Jacobians are held at once
_BETWEEN = np.array(list(product(np.linspace(-1.0, 1.0, 5), repeat=3)))  # of a hexahedron, its nodes too
_HEXAHEDRON = ELEMENTS["hex8"]
_EDGES = np.array(_HEXAHEDRON.edges)
_AXIS_OF = np.argmax(np.abs(np.diff(_HEXAHEDRON.nodes[_EDGES], axis=1)[:, 0]), axis=1)  # of every edge

DivisionsOfAxes = NDArray[np.str_]


@dataclass(frozen=True)
class GridElements:
    """Elements of a dam, and the hexahedra of the grid that they are, or are split from.

    Attributes
    ----------
    points : (n, 3) [m]
    cells : (nc, nodes of the element), those of one hexahedron after another
    element : name
    corners : (nh, 8) nodes of the hexahedra
    owner : (nh,) number of the block of every hexahedron
    axes : (nh, 3) name of the division that counts hexahedra along each of its axes
    """

    points: Floats
    cells: Ints
    element: str
    corners: Ints
    owner: Ints
    axes: DivisionsOfAxes


@dataclass(frozen=True)
class _Fault:
    """The worst element: what is wrong with it, and values of divisions each of which may mend it.

    Attributes
    ----------
    shape : what of the shape would mend it where divisions do not
    """

    what: str
    block: int
    place: str
    changes: dict[str, Counts | float]
    shape: str = "change the shape there"


def refuse_divisions(
    stated: Divisions,
    mesh: GridElements,
    mesh_of: Callable[[Divisions], GridElements],
    blocks: tuple[str, ...],
    location: str,
) -> None:
    """Raise for elements that are inside out, or too slender.

    Parameters
    ----------
    stated : divisions as they are in the configuration
    mesh : with these
    mesh_of : makes it with others, to find ones that are sound
    blocks : names
    location : file and key of the dam, for messages

    Raises
    ------
    ConfigError
        naming the block, the place, and the division to change, to a value with which all elements are sound.
    """
    rocks = np.array([name.startswith("rock") for name in blocks])
    fault = _worst(mesh, rocks, stated)
    if fault is None:
        return

    def mended(first: str) -> dict[str, Counts | float]:
        """Changes that begin with one division and make all elements sound; empty if none were found."""
        divisions, left, changed = stated, fault, dict[str, Counts | float]()
        for step in range(_STEPS):
            name = first if step == 0 else next(iter(left.changes))
            changed[name] = left.changes[name]
            divisions = divisions.model_copy(update={name: left.changes[name]})
            larger = math.prod(
                max(_elements_in_all(v) / _elements_in_all(getattr(stated, key)), 1.0)
                for key, v in changed.items()
            )
            if len(mesh.owner) * larger > _MOST_ELEMENTS:
                return {}
            try:
                tried = _worst(mesh_of(divisions), rocks, divisions)
            except RomdamError:
                return {}
            if tried is None:
                return changed
            if not tried.changes:
                return {}
            left = tried
        return {}

    ways = dict[str, dict[str, Counts | float]]()
    for name in fault.changes:
        if (changes := mended(name)) and changes not in ways.values():
            ways[name] = changes
    least = min(map(len, ways.values()), default=0)
    ways = {name: changes for name, changes in ways.items() if len(changes) == least}
    remedy = ", or ".join(
        " and ".join(_change_in_words(name, getattr(stated, name), value) for name, value in changes.items())
        for changes in ways.values()
    )
    first = next(iter(ways or fault.changes), next(iter(type(stated).model_fields)))
    is_now = _division_in_words(getattr(stated, first))
    raise ConfigError(
        f"{location}.divisions.{first} = {is_now}: in block {blocks[fault.block]} around {fault.place} m "
        f"{fault.what}; "
        f"{remedy or f'no divisions were found with which all elements are sound: {fault.shape}'}"
    )


def _worst(mesh: GridElements, rocks: NDArray[np.bool_], stated: Divisions) -> _Fault | None:
    """The worst element, None where all are sound."""
    nodes = mesh.points[mesh.corners]
    ends = nodes[:, _EDGES]
    edge = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    of_axis = [edge[:, k == _AXIS_OF] for k in range(3)]
    least, most = (np.stack([f(e, axis=1) for e in of_axis], axis=1) for f in (np.min, np.max))

    def middle_of(hexahedron: int) -> str:
        return "(" + ", ".join(f"{x:.4g}" for x in nodes[hexahedron].mean(axis=0)) + ")"

    determinant = _least_determinants(mesh)
    if determinant.min() <= 0.0:
        worst = int(np.argmin(determinant))
        hexahedron = worst // (len(mesh.cells) // len(mesh.corners))
        names = mesh.axes[hexahedron][np.argsort(-most[hexahedron])]
        return _Fault(
            f"a curved or skew {mesh.element} is inside out, with a Jacobian determinant of "
            f"{determinant[worst]:.4g} m3, limit above 0 ({np.count_nonzero(determinant <= 0.0)} of "
            f"{len(determinant)} are)",
            int(mesh.owner[hexahedron]),
            middle_of(hexahedron),
            {
                str(name): every_count(getattr(stated, name), lambda n: 2 * n)
                for name in names
                if 2 * in_all(getattr(stated, name)) <= MOST_DIVISIONS
            },
        )
    ratio = most.max(axis=1) / least.min(axis=1)
    limit = np.where(rocks[mesh.owner], _SLENDER_ROCK, _SLENDER)
    worst = int(np.argmax(ratio / limit))
    over = ratio[worst] / limit[worst]
    if over <= 1.0:
        return None
    k_short, k_long = int(np.argmin(least[worst])), int(np.argmax(most[worst]))
    short, long = (str(mesh.axes[worst, k]) for k in (k_short, k_long))
    changes: dict[str, Counts | float] = {}
    if rocks[mesh.owner[worst]] and stated.growth > 1.01:  # layers of rock are thin where they grow fast
        changes["growth"] = 1.0 + 0.8 * (stated.growth - 1.0)
    if rocks[mesh.owner[worst]] and stated.halved:
        changes["halved"] = 0
    fewer = every_count(getattr(stated, short), lambda n: max(1, int(n / over)))
    if in_all(getattr(stated, short)) >= over and fewer != getattr(stated, short):
        changes[short] = fewer
    more = every_count(getattr(stated, long), lambda n: math.ceil(n * over))
    if in_all(more) <= MOST_DIVISIONS:
        changes[long] = more
    return _Fault(
        f"an element is too slender, {least[worst, k_short]:.3g} m {short} by {most[worst, k_long]:.3g} m "
        f"{long}, {ratio[worst]:.4g} times, limit {limit[worst]:g}",
        int(mesh.owner[worst]),
        middle_of(worst),
        changes,
        *([f"make perimeter.thickness {math.ceil(over)} times what it is"] if short == "perimeter" else []),
    )


def _least_determinants(mesh: GridElements) -> Floats:
    """The least Jacobian determinant of every cell (nc,) [m3], at nodes, quadrature points and between."""
    element = ELEMENTS[mesh.element]
    xi = np.vstack([element.rule[0], element.nodes])
    if element.box and element.quadratic:
        xi = np.vstack([element.rule[0], _BETWEEN])
    return np.concatenate(
        [
            np.linalg.det(jacobians(mesh.points, mesh.cells[k : k + _CHUNK], element, xi)).min(axis=1)
            for k in range(0, len(mesh.cells), _CHUNK)
        ]
    )


def _change_in_words(name: str, former: Counts | float, value: Counts | float) -> str:
    verb = "raise" if _elements_in_all(value) > _elements_in_all(former) else "lower"
    return f"{verb} divisions.{name} to {_division_in_words(value)}"


def _elements_in_all(division: Counts | float) -> float:
    """A division as one number, to compare two of them."""
    return float(sum(division)) if isinstance(division, tuple) else division


def _division_in_words(division: Counts | float) -> str:
    """A division as it stands in a configuration."""
    return str(list(division)) if isinstance(division, tuple) else f"{division:.4g}"
