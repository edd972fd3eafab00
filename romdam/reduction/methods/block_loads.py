"""Loads on the blocks that are reduced: joints, static forces, moving supports, water."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.scene import Block
from romdam.effects.added_mass import AddedMass, WetMass
from romdam.effects.effect import Effect
from romdam.effects.moving_supports import CarriedInertia
from romdam.effects.static_loads import StaticLoads


@dataclass(frozen=True)
class BlockLoads:
    """Gap operators of the blocks, and the loads that their bases answer statically right.

    Attributes
    ----------
    operators : block name -> its gap operator, (directions * gaps, 3 nodes)
    forces : block name -> (3 nodes,) static forces but its weight [N]
    pressed : block name -> (3 nodes, w) forces of the effects while all moves slowly, such as those of water
        on wet faces for unit accelerations of base and supports; without those that supports displace
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


def assemble_block_loads(
    blocks: Mapping[str, Block],
    operators: dict[str, csr_matrix],
    directions: int,
    effects: Sequence[Effect],
) -> BlockLoads:
    """Collect the gap operators of blocks and the loads of effects on them."""
    static = next(effect for effect in effects if isinstance(effect, StaticLoads))
    carried = next((effect for effect in effects if isinstance(effect, CarriedInertia)), None)
    moving, none = (
        None if carried is None else carried.moving,
        {n: np.zeros((b.points.size, 0)) for n, b in blocks.items()},
    )
    pressed = dict(none)
    for effect in effects:
        loads = {} if effect is static or effect is carried else effect.static_loads(moving)
        width = max((load.shape[1] for load in loads.values()), default=0)
        for name, before in pressed.items():
            pressed[name] = np.hstack([before, loads.get(name, np.zeros((len(before), width)))])
    water = next((effect for effect in effects if isinstance(effect, AddedMass)), None)
    return BlockLoads(
        operators,
        dict(static.surface),
        pressed,
        directions,
        none if carried is None else carried.inertia,
        water,
    )
