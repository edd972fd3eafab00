"""A substructure: one part of a scene before its reduction, with its matrices and the loads on it.

Parts meet only in their joints, so that each is reduced alone. A part without ties is a single block. Its
matrices are assembled once (`romdam.fem.assembly.Assembly`) and freed when it is reduced.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, eye_array

from romdam.core.arrays import Bools, Floats
from romdam.core.basis import BlockBasis
from romdam.core.scene import Block, Scene
from romdam.effects.added_mass import AddedMass, WetMass, added_mass
from romdam.effects.construction import construction
from romdam.effects.effect import Effect
from romdam.effects.moving_supports import CarriedInertia
from romdam.effects.static_loads import StaticLoads, static_loads
from romdam.fem.assembly import Assembly
from romdam.fem.parts import gather, part_operator
from romdam.linalg.multigrid import Motions
from romdam.reduction.basis import Dense
from romdam.reduction.interface import Interface, joint_interface
from romdam.scene.supports import has_no_rigid_body_mode, rigid_motions
from romdam.scene.ties import Part

FREE_SHIFT = (2.0 * np.pi * 0.1) ** 2  # -s [1/s2], 0.1 Hz: far below the elastic modes of any block


@dataclass(frozen=True)
class BlockLoads:
    """Gap operators of the blocks, and the loads whose static response their bases contain exactly.

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


def assemble_block_loads(
    blocks: Mapping[str, Block],
    operators: dict[str, csr_matrix],
    directions: int,
    effects: Sequence[Effect],
) -> BlockLoads:
    """Collect the gap operators of blocks and the loads of effects on them."""
    static = next(effect for effect in effects if isinstance(effect, StaticLoads))
    carried = next((effect for effect in effects if isinstance(effect, CarriedInertia)), None)
    moving = None if carried is None else carried.moving
    none = {name: np.zeros((block.points.size, 0)) for name, block in blocks.items()}
    pressed = dict(none)
    for effect in effects:
        loads = {} if effect is carried else effect.static_loads(moving)
        width = max((load.shape[1] for load in loads.values()), default=0)
        for name, before in pressed.items():
            pressed[name] = np.hstack([before, loads.get(name, np.zeros((len(before), width)))])
    return BlockLoads(
        operators=operators,
        forces=static.surface,
        pressed=pressed,
        directions=directions,
        carried=none if carried is None else carried.inertia,
        water=next((effect for effect in effects if isinstance(effect, AddedMass)), None),
    )


def with_loads_of(loads: BlockLoads, scene: Scene) -> BlockLoads:
    """The loads with static loads, stages and pressures of the water of the scene at another level."""
    static, water, stages = static_loads(scene), added_mass(scene), construction(scene)
    pressed, kinds = dict(loads.pressed), static.static_loads(None)
    more = {} if water is None else water.static_loads(None)
    width = max((load.shape[1] for load in more.values()), default=0)
    for name, before in pressed.items():
        pressure = more.get(name, np.zeros((len(before), width)))
        built = np.zeros((len(before), 0)) if stages is None else stages.surface[name]
        forces = np.column_stack([static.surface[name], kinds[name]])
        pressed[name] = np.hstack([before, forces, pressure, built])
    return replace(loads, pressed=pressed)


def has_no_mass(mesh_part: Part, scene: Scene) -> bool:
    """Tell whether no block of a part has mass."""
    return all(scene.blocks[name].material.rho == 0.0 for name in mesh_part.blocks)


@dataclass(frozen=True)
class Substructure:
    """A part of a scene that is to be reduced.

    Attributes
    ----------
    mesh_part : its blocks and how their nodes are numbered
    scene : of the part
    block_loads : of every block of the scene
    assembly : matrices of every block of the scene
    """

    mesh_part: Part
    scene: Scene
    block_loads: BlockLoads
    assembly: Assembly

    @property
    def blocks(self) -> tuple[str, ...]:
        """Names of its blocks."""
        return self.mesh_part.blocks

    @property
    def has_no_mass(self) -> bool:
        """Whether no block has mass."""
        return has_no_mass(self.mesh_part, self.scene)

    @cached_property
    def free(self) -> Bools:
        """(3 nodes,) True for the DOFs of the part that no support holds."""
        return ~self.mesh_part.fixed(self.scene.fixed).ravel()

    @cached_property
    def operator(self) -> csr_matrix:
        """Gap operator over the part's DOFs, (directions * gaps, 3 nodes)."""
        return part_operator(self.mesh_part, self.block_loads.operators)

    @property
    def static_forces(self) -> Floats:
        """Static forces but weight, and those of effects while all moves slowly, (3 nodes, l)."""
        forces = gather(self.mesh_part, self.block_loads.forces)[:, None]
        return np.hstack([forces, gather(self.mesh_part, self.block_loads.pressed)])

    @cached_property
    def wet(self) -> WetMass | None:
        """Added mass of its water over the part's DOFs; None without any."""
        water = self.block_loads.water
        if water is None or not set(water.coupling) & set(self.blocks):
            return None
        return WetMass(part_operator(self.mesh_part, water.coupling), water.flexibility)

    @cached_property
    def interface(self) -> Interface:
        """DOFs that the joints of a single block see, to be retained, and the node frames they stand in."""
        (name,) = self.blocks
        return joint_interface(self.block_loads.operators[name], self.scene.fixed[name])

    @property
    def block_load_directions(self) -> Floats:
        """(3 n, l) directions of the loads on a single block but the inertia of the ground's acceleration.

        Each is of unit length, so that a basis serves whatever their size; without those that are zero.
        """
        (name,) = self.blocks
        loads = self.block_loads
        every = np.hstack([loads.forces[name][:, None], loads.pressed[name], loads.carried[name]])
        length = np.linalg.norm(every, axis=0)
        return np.asarray(every[:, length > 0.0] / length[length > 0.0])

    @property
    def block_wet(self) -> WetMass | None:
        """The water's added mass on the DOFs of a single block."""
        (name,) = self.blocks
        water = self.block_loads.water
        if water is None or name not in water.coupling:
            return None
        return WetMass(water.coupling[name], water.flexibility)

    def free_block(self) -> FreeBlock:
        """Return the matrices and loads of a single block over its free DOFs in turned node frames."""
        (name,) = self.blocks
        block, fixed, interface = self.scene.blocks[name], self.scene.fixed[name], self.interface
        turn, free = interface.turn, ~fixed.ravel()
        stiffness, mass = self.assembly.matrices(name)
        if turn.nnz != turn.shape[0] or (turn.diagonal() != 1.0).any():  # else nothing turns: no copies
            stiffness, mass = (csr_matrix(turn @ matrix @ turn.T) for matrix in (stiffness, mass))
        # Rigid motions that supports and retained DOFs, held, leave to the interior. Retained DOFs in turned
        # frames are not counted: at worst the shift is used where none is needed.
        in_turned = (turn - eye_array(fixed.size)).nonzero()[0] // 3
        held = fixed | interface.retained.reshape(fixed.shape)
        held[in_turned] = fixed[in_turned]
        spread, wet = turn.T[:, free], self.block_wet
        inertia = self.assembly.inertia(name)
        return FreeBlock(
            K=stiffness[free][:, free],
            M=mass[free][:, free],
            retained=interface.retained[free],
            loads=(turn @ np.hstack([inertia, self.block_load_directions]))[free],
            held=has_no_rigid_body_mode(block, held),
            motions=Motions(np.flatnonzero(free), (turn @ rigid_motions(block).reshape(-1, 6))[free]),
            label=f"block {name!r}",
            wet=None if wet is None else wet.over(spread),
            spread=spread,
            inertia=inertia,
        )


@dataclass(frozen=True)
class FreeBlock:
    """A single block over its free DOFs.

    At a node with gaps in one direction only, the axes are rotated so that this direction is one DOF.

    Attributes
    ----------
    K, M : (n, n) sparse stiffness and mass
    retained : (n,) True for retained DOFs
    loads : (n, l) forces whose static response the basis contains exactly, of any magnitude: M r for unit
        translations r along x, y, z in front
    held : whether fixed supports and retained DOFs prevent every rigid motion
    motions : nodes and rigid motions of the free DOFs, for multigrid
    label : name of the block in messages
    wet : added mass of water for the finer basis; None without any
    spread : (3 nodes, n) sparse matrix that takes the DOFs of all nodes in global axes from the free ones
    inertia : (3 nodes, 3) M r over all DOFs [kg]
    """

    K: csr_matrix
    M: csr_matrix
    retained: Bools
    loads: Floats
    held: bool
    motions: Motions
    label: str
    wet: WetMass | None
    spread: csr_matrix
    inertia: Floats

    @property
    def shift(self) -> float:
        """The shift s <= 0 with which K_ii - s M_ii is positive definite [1/s2]."""
        return 0.0 if self.held else -FREE_SHIFT

    def basis(self, omega2: Floats, modes: Floats, report: dict[str, object]) -> BlockBasis:
        """Return a basis of modes over the free DOFs as one over all DOFs in global axes.

        Parameters
        ----------
        omega2 : (m,) ascending [1/s2]
        modes : (n, m) M-orthonormal and diagonal in K
        report : numbers on the reduction, plain values
        """
        vectors = Dense(self.spread @ modes)
        return BlockBasis(vectors, slice(0, len(omega2)), omega2, vectors.project(self.inertia), report)
