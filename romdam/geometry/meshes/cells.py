"""Elements of one kind, as a mesh file holds them."""

from __future__ import annotations

from dataclasses import dataclass

from romdam.core.arrays import Ints
from romdam.geometry.elements import CELLS


@dataclass(frozen=True)
class Cells:
    """Elements of one kind.

    Attributes
    ----------
    kind : a key of `romdam.geometry.elements.CELLS`
    nodes : (n, nodes per element) in the VTK order; the file's numbers, or from 0 once they are checked
    ids : (n,) the elements' numbers in the file
    """

    kind: str
    nodes: Ints
    ids: Ints

    @property
    def dim(self) -> int:
        """Dimension of the elements."""
        return CELLS[self.kind].dim
