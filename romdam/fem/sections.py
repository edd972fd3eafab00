"""Force and moment on named sections, from the displacement of the blocks that they cut.

Virtual work with the functions of `romdam.scene.stress.sections`: force = sum_i step_i f_i and moment =
sum_i (step_i y_i + arm_i n) x f_i over all nodes, where y is in the plane, from the centroid, and f = K u -
f_thermal are the internal nodal forces of the cells. Forces of gaps, whose step is not that of the nodes but
whether they are above the plane, add (step of the gap - step at its nodes) f, and so for the moment.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix, vstack

from romdam.core.basis import BlockBasis
from romdam.core.scene import Block, Scene, Section
from romdam.fem.assembly import assemble
from romdam.fem.gaps import gap_axes, gap_operators
from romdam.fem.loads import thermal_force
from romdam.fem.parts import unknowns
from romdam.geometry.elements import Floats
from romdam.scene.stress.sections import gaps_above, stepping_cells

COMPONENTS = 6  # force along the section's normal and its two axes, moment about them


def section_operators(scene: Scene) -> dict[str, csr_matrix]:
    """Share of the blocks with stress in the forces on all sections, (6 sections, 3 n) [N/m], [N].

    Forces are those of the stress on the plane, sigma n, tension positive.
    """
    if scene.stress is None:
        return {}
    operators = {}
    for name in scene.stress.blocks:
        block = scene.blocks[name]
        rows = [csr_matrix((0, 3 * len(block.points)))]
        for section in scene.stress.sections:
            if name in section.step:
                motions = _virtual(block.points, section.step[name], section.arm[name], section)
                rows.append(motions @ assemble(_stepping(block, section))[0])
            else:
                rows.append(csr_matrix((COMPONENTS, 3 * len(block.points))))
        operators[name] = csr_matrix(vstack(rows))
    return operators


def modal_section_forces(scene: Scene, basis: Mapping[str, BlockBasis]) -> dict[str, Floats]:
    """Forces of every basis vector on all sections: block name -> (sections, 6, m)."""
    operators = section_operators(scene)
    modal = {name: basis[name].vectors.under(operator) for name, operator in operators.items()}
    return {
        name: rows.reshape(len(rows) // COMPONENTS, COMPONENTS, rows.shape[1]) for name, rows in modal.items()
    }


def observed_section_forces(scene: Scene) -> csr_matrix:
    """Forces on all sections from the unknowns of the unreduced system, (6 sections, unknowns)."""
    numbered, operators = unknowns(scene), section_operators(scene)
    size = max((part.stop for part in numbered.parts.values()), default=0)
    total = csr_matrix((COMPONENTS * len(scene.stress.sections if scene.stress is not None else ()), size))
    for name, operator in operators.items():
        total = total + operator @ numbered.of_block[name]
    return csr_matrix(total)


def gap_section_operator(scene: Scene, directions: int) -> Floats:
    """Share of joint forces in the forces on all sections, (6 sections, directions * ng) [-], [m]."""
    operators, joints = gap_operators(scene, directions), scene.joints.values()
    rows = [np.zeros((0, directions * sum(len(joint.area) for joint in joints)))]
    for section in scene.stress.sections if scene.stress is not None else ():
        of_joints = []  # virtual motions of the gaps times their forces
        for joint in joints:
            total, axes = np.zeros((COMPONENTS, directions * len(joint.area))), gap_axes(joint, directions)
            step = gaps_above(joint, section, scene.blocks)
            sides = zip((-1, 1), joint.blocks, joint.nodes, joint.weights, strict=True)
            for sign, name, nodes, weights in sides:
                if name in section.step:
                    points = weights @ scene.blocks[name].points[nodes]
                    arm = step * ((points - section.centroid) @ section.axes[0])
                    total += sign * (_virtual(points, step, arm, section) @ axes.T).toarray()
            of_joints.append(total)
        share = np.concatenate(of_joints, axis=1)
        for name in section.step:
            motions = _virtual(scene.blocks[name].points, section.step[name], section.arm[name], section)
            share -= (motions @ operators[name].T).toarray()
        rows.append(share)
    return np.concatenate(rows)


def initial_section_forces(scene: Scene, displacement: Mapping[str, Floats]) -> dict[str, Floats]:
    """Forces on sections that the joints' structure does not make: block name -> (sections, 6) [N], [N m].

    Parameters
    ----------
    displacement : block name -> (n, 3) under weight that acted before the joints were grouted [m]
    """
    sections = scene.stress.sections if scene.stress is not None else ()
    forces = {}
    for name, operator in section_operators(scene).items():
        forces[name] = (operator @ displacement[name].ravel()).reshape(-1, COMPONENTS)
        for k, section in enumerate(sections):
            if name in scene.loads.warmed and name in section.step:
                block = scene.blocks[name]
                held = thermal_force(_stepping(block, section), scene.loads.warmed[name])
                motions = _virtual(block.points, section.step[name], section.arm[name], section)
                forces[name][k] -= motions @ held.ravel()
    return forces


def _stepping(block: Block, section: Section) -> Block:
    """The block's cells that deform in the section's virtual motions, without springs of the rock."""
    cells = block.cells[stepping_cells(block, section.step[block.name])]
    return replace(block, cells=cells, absorbing=())


def _virtual(points: Floats, step: Floats, arm: Floats, section: Section) -> csr_matrix:
    """Rigid motions of what is above the section, (6, 3 n): along its axes, then about them.

    Parameters
    ----------
    points : (n, 3) [m]
    step, arm : (n,), (n,) [m] there
    """
    step, arm, normal = step[:, None], arm[:, None], section.axes[0]
    y = (points - section.centroid) @ section.axes[1:].T @ section.axes[1:]
    turned = np.cross(section.axes[:, None], (step * y + arm * normal)[None])  # (3, n, 3)
    moved = section.axes[:, None] * step
    return csr_matrix(np.concatenate([moved, turned]).reshape(COMPONENTS, -1))
