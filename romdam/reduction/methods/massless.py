"""Reduction of a part without mass that joints alone connect with the others, such as rock below a dam.

Without inertia K u = f + B^T p at every instant: the part has no states of its own, and all that the joints
and the static loads see of it is in

    u = K^-1 [B^T, f] a,

its answers to a unit force in every gap and to the loads. They are combined so that K is diagonal with one
omega^2 for all; the unknowns of the system that belong to them have no mass (`romdam.core.system.System`), so
that integrators take them as a flexibility, and omega^2 scales the unknowns and nothing else.

References
----------
Monjaraz-Tec, Gross, Krack, Computers & Structures 260 (2022) 106698: massless boundaries are quasi-static.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from romdam.core.basis import BlockBasis
from romdam.core.errors import ConfigError
from romdam.core.scene import Reservoir
from romdam.linalg.solvers import make_solver
from romdam.reduction.methods.merged_part import merge_blocks, sustained_forces
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.reductor import Bases, BasisFiles, Reductor
from romdam.reduction.storage.keys import key_content
from romdam.reduction.storage.model_file import StreamedBasis
from romdam.reduction.substructure import Substructure

log = logging.getLogger(__name__)

OMEGA2 = (2.0 * np.pi * 1e4) ** 2  # [1/s2] any would do
_DEPENDENT = 1e-12  # share of the largest flexibility, below which a direction is round-off
_NODES = 4096  # of a block's basis at a time


class Massless(Reductor):
    """Static responses of a part without mass. They are exact, so that no choice of modes matters."""

    name: ClassVar[str] = "massless"
    out_of_core: ClassVar[bool] = True

    def serves(self, substructure: Substructure, choice: ModeChoice) -> bool:
        """Parts of which no block has mass."""
        return substructure.has_no_mass

    def refuse(self, substructure: Substructure) -> None:
        """Refuse water whose mass is on the part."""
        reservoir = substructure.scene.find(Reservoir)
        if reservoir is None:
            return
        for key, faces in (("faces", reservoir.faces), ("rock", reservoir.rock)):
            wet = {face.block for face in faces} & set(substructure.blocks)
            if wet:
                raise ConfigError(
                    f"water.{key}: block {min(wet)!r} has no mass, and its reduced model no inertia that the "
                    "water's could be added to; leave its faces out, leave out `mass: false`, or set "
                    "model.order: full"
                )

    def key(self, substructure: Substructure, choice: ModeChoice) -> object:
        """Everything in the part; modes do not count."""
        return key_content(substructure, ModeChoice(count=0))

    def reduce(self, substructure: Substructure, choice: ModeChoice, files: BasisFiles) -> Iterator[Bases]:
        """Yield the bases of the part's blocks, of the same coordinates."""
        mesh_part, scene = substructure.mesh_part, substructure.scene
        label = f"part {mesh_part.name}, which has no mass"
        loads = [substructure.operator.T, substructure.static_forces]
        loads.append(sustained_forces(substructure, loads, choice.solving))
        part = merge_blocks(substructure, loads, label)
        substructure.assembly.release(mesh_part.blocks)
        right = part.right
        solver = make_solver(part.K.whole(), part.motions, right.shape[1], choice.solving, label)
        T = files.scratch(len(part.row), right.shape[1])
        T.fill(T.shape[1], lambda a, b: part.over_blocks(solver.solve(right[:, a:b].toarray())))
        log.info("%s: %d static responses", label, T.shape[1])
        # combinations of responses with omega^2 = OMEGA2 each, without directions that are round-off
        flexibility = part.work(T)
        scale = 1.0 / np.sqrt(np.maximum(flexibility.diagonal(), np.finfo(float).tiny))
        size, U = np.linalg.eigh(0.5 * (flexibility + flexibility.T) * scale * scale[:, None])
        keep = size > _DEPENDENT * size.max(initial=0.0)
        mix = scale[:, None] * U[:, keep] * np.sqrt(OMEGA2 / size[keep])
        omega2 = np.full(mix.shape[1], OMEGA2)
        bases, last = dict[str, BlockBasis](), 0
        for name in mesh_part.blocks:
            first, last = last, last + 3 * len(scene.blocks[name].points)
            rows, none = T.pieces([*range(first, last, 3 * _NODES), last]), np.zeros((last - first, 3))
            report = {"retained_dofs": T.shape[1], "fixed_interface_modes": 0, "part": mesh_part.name}
            basis = StreamedBasis(omega2, rows, none, dict(report), mix, massless=len(omega2))
            bases[name] = files.write(scene.blocks[name], basis)
        T.remove()
        yield bases
