"""Actions on the blocks that are reduced: joints, static forces, moving supports, water."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.fem.water.added_mass import AddedMass, WetMass


@dataclass(frozen=True)
class Acting:
    """Gap operators and static forces of the blocks.

    Attributes
    ----------
    operators : block name -> its gap operator, (directions * gaps, 3 nodes)
    forces : block name -> (3 nodes,) static forces but its weight [N]
    directions : of every gap, 1 or 3
    carried : block name -> (3 nodes, m) inertia of what moving supports displace [kg]
    water : whose inertia finer bases answer, or None
    """

    operators: dict[str, csr_matrix]
    forces: dict[str, Floats]
    directions: int
    carried: dict[str, Floats]
    water: AddedMass | None = None

    def wet(self, block: str) -> WetMass | None:
        """The water's added mass on a block's DOFs."""
        if self.water is None or block not in self.water.coupling:
            return None
        return WetMass(self.water.coupling[block], self.water.flexibility)
