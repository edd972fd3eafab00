"""A block on its own in Craig and Bampton's form: from the store, in memory, or through the disk."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, eye_array

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.scene import Block
from romdam.effects.added_mass import WetMass
from romdam.fem.assembly import assemble, inertia
from romdam.linalg.multigrid import Motions
from romdam.reduction.basis import Augmented, Dense, with_inner
from romdam.reduction.interface import Interface, joint_interface
from romdam.reduction.methods.craig_bampton import FreeBlock, ModeChoice, reduce_block
from romdam.reduction.methods.out_of_core import LargeBlock, is_large, reduce_large, turned
from romdam.reduction.storage.keys import block_key
from romdam.reduction.storage.model_file import BlockStore
from romdam.scene.supports import has_no_rigid_body_mode, rigid_motions

log = logging.getLogger(__name__)


def reduced_block(
    block: Block,
    operator: csr_matrix,
    fixed: NDArray[np.bool_],
    loads: Floats,
    choices: list[ModeChoice],
    store: BlockStore | None,
    wet: WetMass | None = None,
) -> list[BlockBasis]:
    """The bases of one block over all its DOFs in global axes: from the store, or made and kept there.

    Parameters
    ----------
    operator : jumps of its gaps over the displacement of its nodes
    fixed : (n, 3) components held by supports
    loads : (3 n, l) forces besides the ground's inertia that the basis answers statically right
    choices : one, and where there is a second the finer one beside it
    wet : added mass of water, which its finer basis knows of; None without any

    Raises
    ------
    ConfigError
        for more modes than the block has.
    ReductionError
        where a factorisation or an eigenproblem fails, or no solver does it.
    ResultError
        where the folder or the disk refuses a file.
    """
    interface, choice = joint_interface(operator, fixed), choices[0]
    large = is_large(interface, choice)
    if store is None and not large:
        return list(islice(_reduce(block, interface, fixed, loads, choice, wet), len(choices)))
    store = store or BlockStore.passing()
    keys = [block_key(block, fixed, interface, loads, one, wet) for one in choices]
    found = store.read_each(keys)
    if len(found) < len(keys) and large:
        held = _held_interior(block, fixed, interface)
        return reduce_large(LargeBlock(block, fixed, loads, interface, held, wet), choice, store, keys)
    if len(found) < len(keys):
        made = _reduce(block, interface, fixed, loads, choice, wet)
        found = [store.write(keys[0], block, next(made))]
        found += [store.write(key, block, with_inner(next(made), found[0])) for key in keys[1:]]
    return found


def _reduce(
    block: Block,
    interface: Interface,
    fixed: NDArray[np.bool_],
    loads: Floats,
    choice: ModeChoice,
    wet: WetMass | None,
) -> Iterator[BlockBasis]:
    """The basis of one block, then a finer one; see `reduce_block`."""
    log.info("block %s: reducing", block.name)
    stiffness, mass = assemble(block)
    turn, free = interface.turn, ~fixed.ravel()
    K, M = (turned(matrix, turn)[free][:, free] for matrix in (stiffness, mass))
    held = _held_interior(block, fixed, interface)
    motions = Motions(np.flatnonzero(free), (turn @ rigid_motions(block).reshape(-1, 6))[free])
    spread = turn.T[:, free]
    wet = None if wet is None else wet.over(spread)
    carried, first = inertia(block, mass), None
    own = FreeBlock(
        K=K,
        M=M,
        retained=interface.retained[free],
        loads=(turn @ np.hstack([carried, loads]))[free],
        held=held,
        motions=motions,
        place=f"block {block.name!r}",
        wet=wet,
    )
    for sub in reduce_block(own, choice):
        vectors = Augmented(first, spread @ sub.more, sub.mix) if first else Dense(spread @ sub.basis)
        report = sub.report() | choice.report()
        columns, participation = slice(0, len(sub.omega2)), vectors.project(carried)
        made = BlockBasis(vectors, columns, sub.omega2, participation, report)
        first = first or made
        yield made


def _held_interior(block: Block, fixed: NDArray[np.bool_], interface: Interface) -> bool:
    """True where supports and retained DOFs, held, stop every rigid motion.

    Retained DOFs in turned frames are not counted: at worst the shift is used where none is needed.
    """
    in_turned = (interface.turn - eye_array(fixed.size)).nonzero()[0] // 3
    held = fixed | interface.retained.reshape(fixed.shape)
    held[in_turned] = fixed[in_turned]
    return has_no_rigid_body_mode(block, held)
