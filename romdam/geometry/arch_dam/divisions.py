"""Divisions that leave elements of an arch dam inside out or too slender are refused before meshing."""

from __future__ import annotations

from itertools import product

import numpy as np

from romdam.config.sections.geometry.arch_dam import CANTILEVER, ArchDamConfig
from romdam.core.errors import ConfigError
from romdam.geometry.elements import ELEMENTS, Floats, jacobians

_SLENDER = 100.0  # longest over shortest edge: stiffness over the short one drowns that over the long one
_AXES = ("along", "through", "up")
_HEXAHEDRON = ELEMENTS["hex27"]
_EDGES = np.array(_HEXAHEDRON.edges)
_AXIS_OF = np.argmax(np.abs(np.diff(_HEXAHEDRON.nodes[_EDGES], axis=1)[:, 0]), axis=1)  # of every edge
_SAMPLES = np.array(list(product(np.linspace(-1.0, 1.0, 5), repeat=3)))


def refuse_divisions(config: ArchDamConfig, halves: Floats, location: str) -> None:
    """Raise for elements of the cantilevers that are inside out on the arc, or too slender.

    Parameters
    ----------
    config : with divisions as they are after refinement
    halves : (2 na + 1, 2 nb + 1, 2 nc + 1, 3) corners of the hexahedra and what lies halfway between them [m]
    location : file and key, for messages

    Raises
    ------
    ConfigError
        naming the block, the place and the division to change.
    """
    shape = tuple((n - 1) // 2 for n in halves.shape[:3])
    number = np.arange(halves[..., 0].size).reshape(halves.shape[:3])
    points = halves.reshape(-1, 3)
    steps = [tuple(round(float(x)) + 1 for x in node) for node in _HEXAHEDRON.nodes]
    cells = np.stack(
        [number[i : i + 2 * shape[0] : 2, j : j + 2 * shape[1] : 2, k : k + 2 * shape[2] : 2].ravel()
         for i, j, k in steps], axis=1
    )  # fmt: skip
    ends = points[cells[:, _EDGES]]
    edge = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    lengths = np.stack([edge[:, k == _AXIS_OF].mean(axis=1) for k in range(3)], axis=1)

    def where(cell: int) -> str:
        a, _, _ = np.unravel_index(cell, shape)
        at = ", ".join(f"{x:.4g}" for x in points[cells[cell]].mean(axis=0))
        return f"block {CANTILEVER}{int(a) // config.divisions.along + 1} around ({at}) m"

    def division(axis: int) -> str:
        stated = getattr(config.divisions, _AXES[axis])
        return f"{location}.divisions.{_AXES[axis]} = {stated}"

    if ELEMENTS[config.element].quadratic:
        determinant = np.linalg.det(jacobians(points, cells, _HEXAHEDRON, _SAMPLES)).min(axis=1)
        if determinant.min() <= 0.0:
            worst = int(np.argmin(determinant))
            axis = int(np.argmax(_bulges(points[cells[worst]]) / lengths[worst]))
            raise ConfigError(
                f"{division(axis)}: the {config.element} elements follow the dam's faces, and "
                f"{np.count_nonzero(determinant <= 0.0)} of {len(cells)} turn inside out, the worst in "
                f"{where(worst)} with a Jacobian determinant of {determinant[worst]:.4g} m3, limit above 0; "
                f"raise divisions.{_AXES[axis]}"
            )
    ratio = lengths.max(axis=1) / lengths.min(axis=1)
    if ratio.max() > _SLENDER:
        worst = int(np.argmax(ratio))
        long, short = int(np.argmax(lengths[worst])), int(np.argmin(lengths[worst]))
        raise ConfigError(
            f"{division(short)}: elements are too slender: in {where(worst)} one has "
            f"{lengths[worst, short]:.3g} m {_AXES[short]} by {lengths[worst, long]:.3g} m {_AXES[long]}, "
            f"{ratio[worst]:.4g} times, limit {_SLENDER:g}; lower divisions.{_AXES[short]}, or raise "
            f"divisions.{_AXES[long]} ({getattr(config.divisions, _AXES[long])})"
        )


def _bulges(nodes: Floats) -> Floats:
    """How far the middles of a hex27's edges (27, 3) lie off their chords, by axis (3,) [m]."""
    middles = nodes[_HEXAHEDRON.corners : _HEXAHEDRON.corners + len(_EDGES)]
    off = np.linalg.norm(middles - nodes[_EDGES].mean(axis=1), axis=1)
    return np.array([off[k == _AXIS_OF].max() for k in range(3)])
