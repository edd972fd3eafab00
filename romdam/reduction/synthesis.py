"""Blocks -> reduced blocks -> one diagonal system with the joints open.

Parts meet only in their joints, so each is diagonalised alone and the system is the list of their open-joint
modes. With rigid rock every block is a part; blocks with a merged interface are one.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.config.sections.job import DampingConfig, ModelConfig
from romdam.core.arrays import Floats
from romdam.core.basis import Basis, BlockBasis
from romdam.core.errors import ReductionError
from romdam.core.final_state import InitialState
from romdam.core.scene import Scene
from romdam.core.system import System
from romdam.effects.effect import Effect, EffectCoordinates, ModalCoordinates
from romdam.effects.scene_effects import scene_effects
from romdam.fem.assembly import Assembly
from romdam.fem.gaps import gap_law, gap_operators, point_operators
from romdam.linalg.dense import sparse
from romdam.linalg.solvers import candidates
from romdam.reduction.basis import Scaled, Turn, over_coordinates
from romdam.reduction.methods.craig_bampton import CraigBampton
from romdam.reduction.methods.free_interface import FreeInterface
from romdam.reduction.methods.massless import Massless
from romdam.reduction.methods.out_of_core import CraigBamptonOutOfCore
from romdam.reduction.mode_choice import ModeChoice, mode_choice
from romdam.reduction.reductor import (
    Reductor,
    basis_keys,
    is_kept,
    reduce_substructure,
    select_reductor,
)
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.substructure import Substructure, assemble_block_loads, with_loads_of
from romdam.scene.ties import scene_parts

# a part is reduced by the first that serves it
REDUCTORS: tuple[Reductor, ...] = (Massless(), CraigBamptonOutOfCore(), CraigBampton(), FreeInterface())


@dataclass(frozen=True)
class ReducedModel:
    """A reduced scene.

    Attributes
    ----------
    system : diagonal, see `System`
    basis : block name -> BlockBasis
    report : block name -> numbers on its reduction, and "cpu_seconds" of the whole
    reservoir : (n, m) basis of the unknowns that compressible water has on the mesh; None without
    dry : the same before effects act, from which other materials and levels are made; None where none is kept
    before : block name -> its basis before effects turned the coordinates, one after another as `turns` say
    """

    system: System
    basis: dict[str, BlockBasis]
    report: dict[str, object]
    before: dict[str, BlockBasis]
    turns: tuple[Turn, ...] = ()
    reservoir: Floats | None = None
    dry: DryModel | None = None


@dataclass(frozen=True)
class DryModel:
    """Reduced parts before effects act: their open-joint modes side by side.

    Attributes
    ----------
    system : of the blocks alone, without damping, static loads and water
    basis, report : see `ReducedModel`
    choice : of its modes
    """

    system: System
    basis: dict[str, BlockBasis]
    report: dict[str, object]
    choice: ModeChoice

    def scaled(self, factors: Mapping[str, tuple[float, float]]) -> DryModel:
        """The parts with other moduli and densities, each as a whole: their modes keep their shapes.

        Parameters
        ----------
        factors : block name -> factors on the stiffness and the mass of its part; 1 where it is not named
        """
        system, omega2 = self.system, self.system.K.diagonal()
        size, load = np.ones(system.size), np.array(system.load)
        turned, basis = set[int](), dict(self.basis)
        for name, (stiffness, mass) in factors.items():
            block = self.basis[name]
            columns = block.columns
            dynamic = slice(columns.start, columns.stop - block.massless)
            if columns.start not in turned:
                turned.add(columns.start)
                omega2[columns] *= stiffness
                omega2[dynamic] /= mass
                size[dynamic] = mass**-0.5
                load[columns] *= mass * size[columns, None]
            basis[name] = replace(block, omega2=omega2[columns])
            if mass != 1.0:
                basis[name] = replace(
                    basis[name],
                    vectors=Scaled(block.vectors, size[columns]),
                    participation=block.participation * (mass * size[columns, None]),
                )
        K = csr_matrix(diags_array(omega2))
        if (size == 1.0).all():
            return replace(self, system=replace(system, K=K), basis=basis)
        each = diags_array(size)
        more = system.at_point
        system = replace(
            system,
            K=K,
            B=csr_matrix(system.B @ each),
            load=load,
            observe=csr_matrix(system.observe @ each),
            at_point=None if more is None else csr_matrix(more @ each),
        )
        return replace(self, system=system, basis=basis)

    def with_effects(self, effects: Sequence[Effect]) -> ReducedModel:
        """The reduced model, once all effects act."""
        system = self.system
        coordinates: EffectCoordinates = ModalCoordinates(self.basis, system.size, self.choice.finer)
        for effect in effects:
            system, coordinates = effect.add(system, coordinates)
        assert isinstance(coordinates, ModalCoordinates)
        return ReducedModel(
            system,
            coordinates.basis,
            dict(self.report),
            self.basis,
            coordinates.turns,
            coordinates.reservoir,
            self,
        )


def reduce_scene(
    scene: Scene,
    model: ModelConfig | ModeChoice,
    damping: DampingConfig,
    store: BlockStore | None = None,
    reductors: Sequence[Reductor] = REDUCTORS,
    also: Sequence[Scene] | None = None,
) -> ReducedModel:
    """Reduce every part with the modes of a configuration, or a choice of them, and put them together.

    See `reduce_scene_twice`.
    """
    choice = model if isinstance(model, ModeChoice) else mode_choice(model)
    return _reduced_scene(scene, damping, [choice], store, reductors, also)[0]


def reduce_scene_twice(
    scene: Scene,
    model: ModelConfig | ModeChoice,
    damping: DampingConfig,
    store: BlockStore | None = None,
    reductors: Sequence[Reductor] = REDUCTORS,
    also: Sequence[Scene] | None = None,
) -> tuple[ReducedModel, ReducedModel]:
    """Reduce every part, and once more with a finer basis that contains the first.

    The finer one costs a few solutions with factors that are there.

    Parameters
    ----------
    store : where blocks that were reduced before are found, and new ones kept
    reductors : methods; a part is reduced by the first that serves it
    also : the scene with other loads and levels of water, whose static answers the bases hold too, where the
        models are to take other materials and levels; then they keep what that needs

    Raises
    ------
    ConfigError
        for more modes than a block has, and for water on a part without mass.
    ReductionError
        where a block cannot be reduced.
    """
    choice = model if isinstance(model, ModeChoice) else mode_choice(model)
    choices = [choice, replace(choice, finer=True)]
    coarse, fine = _reduced_scene(scene, damping, choices, store, reductors, also)
    return coarse, fine


def _reduced_scene(
    scene: Scene,
    damping: DampingConfig,
    choices: list[ModeChoice],
    store: BlockStore | None,
    reductors: Sequence[Reductor],
    also: Sequence[Scene] | None,
) -> list[ReducedModel]:
    """Return a model for each choice: one, and where there is a second the finer one."""
    start = time.process_time()
    law, assembly = gap_law(scene), Assembly(scene.blocks)
    effects = scene_effects(scene, damping, law.directions, assembly, choices[0].solving)
    operators = gap_operators(scene, law.directions)
    block_loads = assemble_block_loads(scene.blocks, operators, law.directions, effects)
    for other in also or ():
        block_loads = with_loads_of(block_loads, other)
    substructures = {
        name: Substructure(mesh_part, scene, block_loads, assembly)
        for name, mesh_part in scene_parts(scene).items()
    }
    selected = {
        name: select_reductor(substructure, choices[0], reductors)
        for name, substructure in substructures.items()
    }
    for name, substructure in substructures.items():
        selected[name].refuse(substructure)
        for choice in choices:
            _refuse_large(selected[name], substructure, choice, store)
    reduced = {
        name: reduce_substructure(selected[name], substructure, choices, store)
        for name, substructure in substructures.items()
    }
    models, jumps = [], dict[str, tuple[Basis, Floats]]()
    for level, choice in enumerate(choices):
        basis, columns = dict[str, BlockBasis](), dict[str, slice]()
        size = 0  # the coordinates of the parts one after another, in the scene's order
        for name, levels in reduced.items():
            bases = levels[level]
            columns[name] = slice(size, size + len(next(iter(bases.values())).omega2))
            size = columns[name].stop
            basis |= {block: replace(of_block, columns=columns[name]) for block, of_block in bases.items()}
        basis = {name: basis[name] for name in scene.blocks}
        omega2, load, mass = np.zeros(size), np.zeros((size, 3)), np.ones(size)
        for name, block in basis.items():
            omega2[block.columns] = block.omega2
            if name not in scene.radiating:
                load[block.columns] += block.participation
        for block in basis.values():
            mass[block.columns.stop - block.massless : block.columns.stop] = 0.0
        observe = np.zeros((3 * len(scene.probes), size))
        for k, probe in enumerate(scene.probes):
            block, rows = basis[probe.block], slice(3 * probe.node, 3 * probe.node + 3)
            observe[3 * k : 3 * k + 3, block.columns] = block.vectors.rows(rows)
        more = point_operators(scene, law.directions)
        system = System(
            M=csr_matrix(diags_array(mass)),
            C=csr_matrix((size, size)),
            K=csr_matrix(diags_array(omega2)),
            B=sparse(over_coordinates(operators, basis, size, jumps)),
            load=load,
            force=np.zeros(size),
            observe=csr_matrix(observe),
            law=law,
            parts=columns,
            diagonal=True,
            floating=bool((omega2 == 0.0).any()),
            reduced=True,
            at_point=None if more is None else sparse(over_coordinates(more, basis, size)),
            initial=scene.find(InitialState),
            extent=scene.extent,
        )
        report: dict[str, object] = {name: block.report for name, block in basis.items()}
        model = DryModel(system, basis, report, choice).with_effects(effects)
        model.report["cpu_seconds"] = time.process_time() - start
        models.append(replace(model, dry=None) if also is None else model)
    return models


def _refuse_large(
    reductor: Reductor, substructure: Substructure, choice: ModeChoice, store: BlockStore | None
) -> None:
    """Raise before anything is computed if a part is not in the store and fits in memory with no solver."""
    if choice.keeps_all:
        return
    try:
        name = substructure.mesh_part.name
        candidates(int(substructure.free.sum()), choice.columns, choice.solving, name)
    except ReductionError:
        keys = basis_keys(reductor, substructure, choice)
        if store is None or not is_kept(reductor):
            raise
        if not all(store.path(key).is_file() for key in keys.values()):
            raise
