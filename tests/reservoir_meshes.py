"""Reservoirs and dams as mesh files: boxes of any element, bent as wanted, and with named faces."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.job import BoxConfig
from romdam.core.scene import Block, Material
from romdam.geometry.boxes import box_block
from romdam.geometry.elements import ELEMENTS, facet_element

Floats = NDArray[np.float64]


def box(
    origin: Iterable[float],
    size: Iterable[float],
    edges: float | Iterable[float],
    element: str = "hex8",
    bend: Callable[[Floats], Floats] = np.asarray,
) -> Block:
    """A box whose points (n, 3) are moved by `bend`."""
    keys = {"origin": origin, "size": size, "element_size": edges, "element": element}
    block = box_block("box", BoxConfig.model_validate(keys), Material(0.0, 0.0, 0.0), "")
    return replace(block, points=bend(block.points))


def written(path: Path, block: Block, *faces: str) -> str:
    """Write a block, in a .msh with faces by name; returns the path."""
    numbers = {name: k for k, name in enumerate(faces, start=2)}
    parts = [(ELEMENTS[block.element].cell.name, block.cells, 1)]
    parts += [(facet_element(block.faces[f]).cell.name, block.faces[f], k) for f, k in numbers.items()]
    tags = [np.full(len(cells), number) for _, cells, number in parts]
    mesh = meshio.Mesh(
        block.points,
        [(kind, cells) for kind, cells, _ in parts],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"all": np.array([1, 3])} | {name: np.array([k, 2]) for name, k in numbers.items()},
    )
    mesh.write(path, **({"file_format": "gmsh22", "binary": False} if path.suffix == ".msh" else {}))
    return str(path)


def plane(axis: str, at: float) -> dict[str, Any]:
    """A face by its plane."""
    return {"axis": axis, "at": at}
