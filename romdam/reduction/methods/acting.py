"""Actions on the blocks that are reduced: joints, static forces, moving supports, water."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.scene import Block
from romdam.core.system import PseudoStatic
from romdam.fem.pseudo_static import applied
from romdam.fem.water.added_mass import AddedMass, WetMass
from romdam.fem.water.compressible import Waves
from romdam.linalg.factor import Factor


@dataclass(frozen=True)
class Acting:
    """Gap operators of the blocks, and the loads that their bases answer statically right.

    Attributes
    ----------
    operators : block name -> its gap operator, (directions * gaps, 3 nodes)
    forces : block name -> (3 nodes,) static forces but its weight [N]
    pressed : block name -> (3 nodes, w) forces of the water on its wet faces for unit accelerations of the
        ground and of supports
    directions : of every gap, 1 or 3
    carried : block name -> (3 nodes, m) inertia of what moving supports displace [kg]
    water : whose inertia finer bases answer, or None
    """

    operators: dict[str, csr_matrix]
    forces: dict[str, Floats]
    pressed: dict[str, Floats]
    directions: int
    carried: dict[str, Floats]
    water: AddedMass | None = None

    def wet(self, block: str) -> WetMass | None:
        """The water's added mass on a block's DOFs."""
        if self.water is None or block not in self.water.coupling:
            return None
        return WetMass(self.water.coupling[block], self.water.flexibility)

    def loads(self, block: str) -> Floats:
        """(3 nodes, l) directions of the loads on a block but for the inertia of the ground's acceleration.

        Each is of unit length, so that a basis serves whatever their size; without those that are zero.
        """
        every = np.hstack([self.forces[block][:, None], self.pressed[block], self.carried[block]])
        length = np.linalg.norm(every, axis=0)
        return np.asarray(every[:, length > 0.0] / length[length > 0.0])


def pressed_by(
    water: AddedMass | Waves | None, moving: PseudoStatic | None, blocks: Mapping[str, Block]
) -> dict[str, Floats]:
    """Forces (3 nodes, w) of the water on blocks for unit accelerations of the ground and of supports.

    Compressible water presses so where all moves slowly.
    """
    if water is None:
        return {name: np.zeros((block.points.size, 0)) for name, block in blocks.items()}
    if isinstance(water, AddedMass):
        rows = water.ground
        if moving is not None:
            rows = np.hstack([rows, water.times(applied(water.coupling, moving.shapes))])
    else:
        rows = water.at_dam.T @ Factor(water.K).solve(np.ascontiguousarray(water.load[:, :3]))
    dry = {name: np.zeros((block.points.size, rows.shape[1])) for name, block in blocks.items()}
    return dry | {name: np.asarray(coupling.T @ rows) for name, coupling in water.coupling.items()}
