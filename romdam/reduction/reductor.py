"""The protocol of a reduction method, and how a substructure is reduced with it.

A method says which substructures it serves, what its basis depends on, and computes the basis. The methods of
romdam stand in `romdam.reduction.synthesis.REDUCTORS`; a part is reduced by the first that serves it. Bases
are kept in a store under the SHA-256 of all that they depend on (`reduce_substructure`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import ClassVar, Protocol

from romdam.core.basis import BlockBasis
from romdam.core.errors import ReductionError
from romdam.core.fingerprint import code_digest, fingerprint
from romdam.core.scene import Block
from romdam.geometry.meshes.quality import refuse_loose_nodes
from romdam.reduction.basis import Augmented
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.storage.keys import CODE, key_content
from romdam.reduction.storage.model_file import LAYOUT, BlockStore, StreamedBasis
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.reduction.substructure import Substructure

Bases = dict[str, BlockBasis]  # block name -> its basis; those of one part have the same coordinates


@dataclass(frozen=True)
class BasisFiles:
    """Files for the bases of a substructure, for methods that work out of core.

    Attributes
    ----------
    store : the folder; None for a method that works in memory
    keys : for the basis, and for a finer one if it is asked for: block name -> key
    method : name of the reductor, for the report
    """

    store: BlockStore | None
    keys: list[dict[str, str]]
    method: str

    @property
    def finer(self) -> bool:
        """Whether a finer basis is asked for."""
        return len(self.keys) > 1

    def scratch(self, rows: int, columns: int) -> OutOfCoreMatrix:
        """Return a matrix (rows, columns) on disk, which continues that of a run that was stopped."""
        assert self.store is not None
        key = next(iter(self.keys[-1].values()))
        return OutOfCoreMatrix(self.store.scratch(key), key, (rows, columns))

    def write(self, block: Block, streamed: StreamedBasis, level: int = 0) -> BlockBasis:
        """Write the basis of a block as its rows come, see `BlockStore.write_streamed`.

        Parameters
        ----------
        level : 0 for the basis, 1 for the finer one
        """
        assert self.store is not None
        streamed = replace(streamed, report=streamed.report | {"method": self.method})
        return self.store.write_streamed(self.keys[level][block.name], block, streamed)


class Reductor(Protocol):
    """A reduction method. Derive from it: only `name`, `serves` and `reduce` have to be written.

    Attributes
    ----------
    name : unique; stands in reports and in the keys of stored bases
    out_of_core : whether `reduce` writes its bases into files itself
    """

    name: ClassVar[str]
    out_of_core: ClassVar[bool] = False

    def serves(self, substructure: Substructure, choice: ModeChoice) -> bool:
        """Tell whether the method can reduce a part. The first reductor that serves is used."""
        ...

    def refuse(self, substructure: Substructure) -> None:
        """Raise a ConfigError for a part that no model of this method is right for, before any is reduced."""
        return

    def key(self, substructure: Substructure, choice: ModeChoice) -> object:
        """Return everything that the basis depends on, as `fingerprint` takes it; here all that is known."""
        return key_content(substructure, choice)

    def reduce(self, substructure: Substructure, choice: ModeChoice, files: BasisFiles) -> Iterator[Bases]:
        """Yield the basis of every block, then a finer one, which is taken if an error is to be estimated.

        A method without a finer basis yields one. The finer basis should contain the other.

        Parameters
        ----------
        choice : number of modes
        files : for methods that work out of core

        Raises
        ------
        ConfigError
            for more modes than there are.
        ReductionError
            where a factorisation or an eigenproblem fails.
        """
        ...


def select_reductor(
    substructure: Substructure, choice: ModeChoice, reductors: Sequence[Reductor]
) -> Reductor:
    """Return the first reductor that serves a part.

    Raises
    ------
    ReductionError
        where none does.
    """
    for reductor in reductors:
        if reductor.serves(substructure, choice):
            return reductor
    names = ", ".join(reductor.name for reductor in reductors)
    raise ReductionError(
        f"part {substructure.mesh_part.name!r}: none of {len(reductors)} reduction methods serves it "
        f"({names}); add romdam.reduction.synthesis.REDUCTORS behind them"
    )


def basis_keys(reductor: Reductor, substructure: Substructure, choice: ModeChoice) -> dict[str, str]:
    """Return block name -> SHA-256 of all that its basis depends on, with the code that reduces."""
    content = reductor.name, reductor.key(substructure, choice)
    key = fingerprint((LAYOUT, code_digest(CODE), *content))
    if len(substructure.blocks) == 1:
        return {substructure.blocks[0]: key}
    return {name: fingerprint((key, name)) for name in substructure.blocks}


def is_kept(reductor: Reductor) -> bool:
    """Tell whether bases of a method may be stored: only if its code enters the keys, as romdam's does."""
    return type(reductor).__module__.startswith("romdam.")


def reduce_substructure(
    reductor: Reductor, substructure: Substructure, choices: list[ModeChoice], store: BlockStore | None
) -> list[Bases]:
    """Return the basis of a part for each choice: from the store, or computed and kept there.

    Parameters
    ----------
    choices : one, and where there is a second the finer one of the error estimate
    store : where blocks that were reduced before are found, and new ones kept; None for nowhere

    Raises
    ------
    ConfigError
        for more modes than there are.
    ReductionError
        where a factorisation or an eigenproblem fails, or no solver does it.
    ResultError
        where the folder or the disk refuses a file.
    """
    blocks = substructure.scene.blocks
    for name in substructure.blocks:
        refuse_loose_nodes(blocks[name], "reduction")
    store = store if is_kept(reductor) else None
    if store is None and reductor.out_of_core:
        store = BlockStore.passing()
    keys = [basis_keys(reductor, substructure, choice) for choice in choices]
    if keys[0] == keys[-1]:  # the method has no finer basis
        keys = keys[:1]
    bases = [] if store is None else store.read_part(keys)
    if len(bases) < len(keys):
        bases = []
        reduced = reductor.reduce(substructure, choices[0], BasisFiles(store, keys, reductor.name))
        # a method that works out of core removes its scratch file when all are taken
        levels = list(reduced) if reductor.out_of_core else islice(reduced, len(keys))
        for of_level, level in zip(keys, levels, strict=False):
            if not reductor.out_of_core:
                level = {
                    name: replace(basis, report=basis.report | {"method": reductor.name})
                    for name, basis in level.items()
                }
            if store is not None and not reductor.out_of_core:
                for name, basis in level.items():
                    if isinstance(basis.vectors, Augmented):  # over the basis in its file by now
                        basis = replace(basis, vectors=replace(basis.vectors, inner=bases[0][name]))
                    level[name] = store.write(of_level[name], blocks[name], basis)
            bases.append(level)
    substructure.assembly.release(substructure.blocks)
    return bases + bases[-1:] * (len(choices) - len(bases))
