"""Nodes that a configuration asks for, and whether they fit in memory, before anything is meshed."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

from romdam.config.job import Config
from romdam.config.sections.geometry.arch_dam import ArchDamConfig
from romdam.config.sections.geometry.gravity_dam import GravityDamConfig
from romdam.config.sections.job import BoxConfig
from romdam.core.errors import ConfigError
from romdam.core.machine import memory_limit, shown_size
from romdam.geometry.elements import ELEMENTS

_MOST = 1e12  # elements along an edge that are told apart
_ROOM = 1.05  # coarser than would just fit


def refuse_large(config: Config, source: str) -> None:
    """Raise if the blocks that are meshed here need more memory than `model.memory`, or the machine, has.

    Parameters
    ----------
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError
        naming the block that needs most, its nodes, and how coarse it must be to fit.
    """
    limit = memory_limit(config.model.memory)
    needs = {}
    for name, block in config.blocks.items():
        if block.box is not None:
            nodes = grid_nodes(_counts(block.box), block.box.element)
            needs[f"blocks.{name}.box.element_size"] = (nodes, block.box.element)
    if config.arch_dam is not None:
        needs["arch_dam.divisions"] = (_arch_nodes(config.arch_dam), config.arch_dam.element)
    if config.gravity_dam is not None:
        needs["gravity_dam.divisions"] = (_gravity_nodes(config.gravity_dam), config.gravity_dam.element)
    total = sum(nodes * ELEMENTS[element].bytes_per_node for nodes, element in needs.values())
    if total <= limit:
        return
    key, (nodes, element) = max(
        needs.items(), key=lambda item: item[1][0] * ELEMENTS[item[1][1]].bytes_per_node
    )
    coarser = _ROOM * (total / limit) ** (1 / 3)
    if key.endswith("dam.divisions"):
        remedy = f"divide by {coarser:.2g} in every direction"
    else:
        box = config.blocks[key.split(".")[1]].box
        assert box is not None
        edges = [coarser * length / n for length, n in zip(box.size, _counts(box), strict=True)]
        lengths = " or ".join(dict.fromkeys(f"{edge:.2g} m" for edge in edges))
        remedy = f"the smallest elements that fit have about {lengths}"
    named = "model.memory" if config.model.memory is not None else "four fifths of this machine's memory"
    raise ConfigError(
        f"{source}: {key}: about {nodes:.3g} nodes ({3.0 * nodes:.3g} unknowns, {element}), and the blocks "
        f"together need about {shown_size(total)} only to be assembled, limit {named} = {shown_size(limit)}; "
        f"{remedy}"
    )


def _counts(box: BoxConfig) -> list[float]:
    """Elements along each axis, at most as many as can be counted."""
    wanted = box.element_size
    sizes = (wanted,) * 3 if isinstance(wanted, float) else wanted
    return [min(max(length / size, 1.0), _MOST) for length, size in zip(box.size, sizes, strict=True)]


def _arch_nodes(dam: ArchDamConfig) -> float:
    """Of the dam and, around the path of its contact, the ground."""
    d = dam.divisions.refined
    along = dam.cantilevers * d.along
    nodes = grid_nodes([along, d.through, d.up], dam.element)
    layers = (d.perimeter if dam.perimeter else 0) + (d.rock if dam.rock else 0)
    rows = d.through + (d.upstream + d.downstream if dam.rock else 0)
    return nodes + (grid_nodes([along + 2 * d.up, rows, layers], dam.element) if layers else 0.0)


def _gravity_nodes(dam: GravityDamConfig) -> float:
    """Of the dam's grid and, as wide as the dam and its banks, of the rock's below."""
    d = dam.divisions.refined
    wide, through, up = len(dam.monoliths) * d.along, sum(dam.columns), sum(dam.rows)
    nodes = grid_nodes([wide, through, up], dam.element)
    if dam.rock is None:
        return nodes
    wide += sum(d.banks for side in (dam.rock.left, dam.rock.right) if side)
    rise = (max(dam.slices.values()) - dam.lowest) / (dam.crest - dam.lowest)
    rows = through + d.upstream + d.downstream
    return nodes + grid_nodes([wide, rows, d.depth + up * rise], dam.element)


def grid_nodes(counts: Sequence[float], element: str) -> float:
    """Nodes of a grid of so many hexahedra along each axis, each one element or cut as boxes are."""
    corners, kind = prod(n + 1.0 for n in counts), ELEMENTS[element]
    tips = prod(counts) if kind.linear == "pyramid5" else 0.0
    if not kind.quadratic:
        return corners + tips
    if kind.linear in ("tet4", "hex8") and not (kind.box and kind.on_edges):
        return prod(2.0 * n + 1.0 for n in counts)
    diagonals = corners * prod(n / (n + 1.0) for n in counts[:2]) if kind.linear == "wedge6" else 8.0 * tips
    return corners + tips + sum(corners * n / (n + 1.0) for n in counts) + diagonals
