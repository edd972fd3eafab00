"""Blocks -> reduced blocks -> one diagonal system with the joints open.

Parts meet only in their joints, so each is diagonalised alone and the system is the list of their open-joint
modes. With rigid rock every block is a part; blocks with a merged interface are one.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.config.sections.job import DampingConfig, ModelConfig
from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.errors import ReductionError
from romdam.core.scene import Scene
from romdam.core.system import GapLaw, System
from romdam.effects.added_mass import AddedMass
from romdam.effects.effect import Coordinates, ModalCoordinates
from romdam.effects.scene_effects import scene_effects
from romdam.fem.gaps import gap_law, gap_operators, point_operators
from romdam.geometry.meshes.quality import refuse_loose_nodes
from romdam.linalg.solvers import Solving, candidates
from romdam.reduction.basis import over_coordinates
from romdam.reduction.interface import joint_interface, sees_more_nodes_than_gaps
from romdam.reduction.methods.block_loads import BlockLoads, assemble_block_loads
from romdam.reduction.methods.craig_bampton import ALL_MODES, ModeChoice
from romdam.reduction.methods.free_interface import merged_bases, merged_keys
from romdam.reduction.methods.massless import has_no_mass, massless_bases, massless_keys, refuse_wet
from romdam.reduction.single_block import reduced_block
from romdam.reduction.storage.keys import block_key
from romdam.reduction.storage.model_file import BlockStore
from romdam.scene.ties import Part, scene_parts


@dataclass(frozen=True)
class ReducedModel:
    """A reduced scene.

    Attributes
    ----------
    system : diagonal, see `System`
    basis : block name -> BlockBasis
    report : block name -> numbers on its reduction, and "cpu_seconds" of the whole
    water : the added mass that the system has, or None
    reservoir : (n, m) basis of the unknowns that compressible water has on the mesh; None without
    """

    system: System
    basis: dict[str, BlockBasis]
    report: dict[str, object]
    water: AddedMass | None = None
    reservoir: Floats | None = None


def reduce_scene(
    scene: Scene,
    model: ModelConfig | ModeChoice,
    damping: DampingConfig,
    store: BlockStore | None = None,
) -> ReducedModel:
    """Reduce every part with the modes of a configuration, or a choice of them, and put them together.

    See `reduce_scene_twice`.
    """
    return _reduced_scene((scene, damping), [_choice_of(model)], store)[0]


def reduce_scene_twice(
    scene: Scene,
    model: ModelConfig | ModeChoice,
    damping: DampingConfig,
    store: BlockStore | None = None,
) -> tuple[ReducedModel, ReducedModel]:
    """Reduce every part, and beside it once more with a finer basis that contains the first.

    The finer one costs a few solutions with factors that are there.

    Parameters
    ----------
    store : where blocks that were reduced before are found, and new ones kept

    Raises
    ------
    ConfigError
        for more modes than a block has.
    ReductionError
        where a block cannot be reduced.
    """
    choice = _choice_of(model)
    coarse, fine = _reduced_scene((scene, damping), [choice, replace(choice, finer=True)], store)
    return coarse, fine


def _choice_of(model: ModelConfig | ModeChoice) -> ModeChoice:
    return model if isinstance(model, ModeChoice) else mode_choice(model)


def _reduced_scene(
    of: tuple[Scene, DampingConfig], choices: list[ModeChoice], store: BlockStore | None
) -> list[ReducedModel]:
    """A model for each choice: one, and where there is a second the finer one beside it."""
    start, (scene, damping) = time.process_time(), of
    refuse_wet(scene)
    law = gap_law(scene)
    effects = scene_effects(scene, damping, law.directions, choices[0].solving)
    operators, models = gap_operators(scene, law.directions), []
    block_loads = assemble_block_loads(scene.blocks, operators, law.directions, effects)
    for choice in choices:
        _refuse_large(scene, block_loads, choice, store)
    parts = [_reduced_part(part, scene, block_loads, choices, store) for part in scene_parts(scene).values()]
    for choice, bases in zip(choices, zip(*parts, strict=True), strict=True):
        basis, columns = _side_by_side(scene, bases)
        report: dict[str, object] = {name: block.report for name, block in basis.items()}
        system = _system(scene, basis, block_loads, law, columns)
        coordinates: Coordinates = ModalCoordinates(basis, system.size, choice.finer)
        for effect in effects:
            system, coordinates = effect.add(system, coordinates)
        assert isinstance(coordinates, ModalCoordinates)
        report["cpu_seconds"] = time.process_time() - start
        models.append(
            ReducedModel(system, coordinates.basis, report, block_loads.water, coordinates.reservoir)
        )
    return models


def _side_by_side(
    scene: Scene, bases: Iterable[dict[str, BlockBasis]]
) -> tuple[dict[str, BlockBasis], dict[str, slice]]:
    """The blocks' bases with the columns of their part, in the scene's order, and those of the parts."""
    columns, found, first = dict[str, slice](), dict[str, BlockBasis](), 0
    for part, own in zip(scene_parts(scene).values(), bases, strict=True):
        last = first + len(own[part.blocks[0]].omega2)
        columns[part.name] = slice(first, last)
        found |= {name: replace(block, columns=slice(first, last)) for name, block in own.items()}
        first = last
    return {name: found[name] for name in scene.blocks}, columns


def _system(
    scene: Scene,
    basis: dict[str, BlockBasis],
    block_loads: BlockLoads,
    law: GapLaw,
    parts: dict[str, slice],
) -> System:
    """The parts side by side, with their joints open."""
    size = max(part.stop for part in parts.values())
    omega2, load, B = _reduced_matrices(scene, basis, block_loads, size)
    more = point_operators(scene, law.directions)
    mass = np.ones(size)
    for name, part in scene_parts(scene).items():
        mass[parts[name]] = 0.0 if has_no_mass(part, scene) else 1.0
    return System(
        M=csr_matrix(diags_array(mass)),
        C=csr_matrix((size, size)),
        K=csr_matrix(diags_array(omega2)),
        B=csr_matrix(B),
        load=load,
        force=np.zeros(size),
        observe=_observe(scene, basis, size),
        law=law,
        parts=parts,
        diagonal=True,
        floating=bool((omega2 == 0.0).any()),
        reduced=True,
        at_point=None if more is None else csr_matrix(over_coordinates(more, basis, size)),
    )


def _refuse_large(
    scene: Scene, block_loads: BlockLoads, choice: ModeChoice, store: BlockStore | None
) -> None:
    """Raise before anything is computed if a part is not in the store and fits in memory with no solver."""
    if choice.keeps_all:
        return
    for part in scene_parts(scene).values():
        unknowns = int((~part.fixed(scene.fixed)).sum())
        try:
            candidates(unknowns, choice.columns, choice.solving, part.name)
        except ReductionError:
            keys = _keys(part, scene, block_loads, choice)
            if store is None or not all(store.path(key).is_file() for key in keys.values()):
                raise


def _keys(part: Part, scene: Scene, block_loads: BlockLoads, choice: ModeChoice) -> dict[str, str]:
    """Block name -> what its basis is stored under."""
    if has_no_mass(part, scene):
        return massless_keys(part, scene, block_loads)
    free = _by_free_modes(part, scene, block_loads, [choice])
    if free:
        return merged_keys(part, scene, block_loads, *free)
    (name,) = part.blocks
    interface = joint_interface(block_loads.operators[name], scene.fixed[name])
    block, fixed, loads = scene.blocks[name], scene.fixed[name], block_loads.loads(name)
    return {name: block_key(block, fixed, interface, loads, choice, block_loads.wet(name))}


def _by_free_modes(
    part: Part, scene: Scene, block_loads: BlockLoads, choices: list[ModeChoice]
) -> list[ModeChoice]:
    """The free-interface modes to keep of a part; none where Craig and Bampton's way serves it.

    It does not where the part has a viscous boundary, whose forces are to be answered statically right.

    Free modes leave nothing to residual vectors: as many more modes are kept instead, at least half as
    many again, so that a finer choice is finer in this form too.
    """
    if len(part.blocks) == 1:
        (name,) = part.blocks
        interface = joint_interface(block_loads.operators[name], scene.fixed[name])
        by_springs = bool(scene.blocks[name].absorbing) and part.stands_free(scene)
        if not by_springs and not sees_more_nodes_than_gaps(
            block_loads.operators[name], interface, block_loads.directions
        ):
            return []
    return [_with_more_modes(choice) for choice in choices]


def _with_more_modes(choice: ModeChoice) -> ModeChoice:
    if choice.count is None or choice.keeps_all or not choice.residual_vectors:
        return choice
    more = max(choice.residual_vectors, choice.count // 2)
    return replace(choice, count=choice.count + more, residual_vectors=0)


def _reduced_part(
    part: Part,
    scene: Scene,
    block_loads: BlockLoads,
    choices: list[ModeChoice],
    store: BlockStore | None,
) -> list[dict[str, BlockBasis]]:
    """The bases of a part's blocks, of the same coordinates, for each choice."""
    for name in part.blocks:
        refuse_loose_nodes(scene.blocks[name], "reduction")
    if has_no_mass(part, scene):
        return [massless_bases(part, scene, block_loads, choices[0], store)] * len(choices)
    free = _by_free_modes(part, scene, block_loads, choices)
    if free:
        return merged_bases(part, scene, block_loads, free, store)
    (name,) = part.blocks
    asked = scene.blocks[name], block_loads.operators[name], scene.fixed[name], block_loads.loads(name)
    bases = reduced_block(*asked, choices, store, block_loads.wet(name))
    return [{name: basis} for basis in bases]


def _reduced_matrices(
    scene: Scene, basis: dict[str, BlockBasis], block_loads: BlockLoads, size: int
) -> tuple[Floats, Floats, Floats]:
    """omega^2, load and gap operator over the coordinates; blocks of a part add to the same ones."""
    omega2, load = np.zeros(size), np.zeros((size, 3))
    for name, block in basis.items():
        omega2[block.columns] = block.omega2
        if name not in scene.radiating:
            load[block.columns] += block.participation
    return omega2, load, over_coordinates(block_loads.operators, basis, size)


def mode_choice(model: ModelConfig) -> ModeChoice:
    """The modes that a configuration asks for."""
    if model.modes == "all":
        return ALL_MODES
    if model.modes == "auto":
        raise ReductionError("model.modes is auto, and none has been chosen yet; give a number or all")
    solving = Solving(model.solver, model.memory)
    return ModeChoice(model.modes, model.cutoff, model.residual_vectors, solving=solving)


def _observe(scene: Scene, basis: dict[str, BlockBasis], size: int) -> csr_matrix:
    rows = np.zeros((3 * len(scene.probes), size))
    for k, probe in enumerate(scene.probes):
        part = basis[probe.block]
        rows[3 * k : 3 * k + 3, part.columns] = part.vectors.rows(slice(3 * probe.node, 3 * probe.node + 3))
    return csr_matrix(rows)
