"""A block and its cuts -> blocks that joints can join."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from romdam.config.quantities import to_si
from romdam.config.sections.geometry.cut import CutConfig
from romdam.core.arrays import Bools, Ints
from romdam.core.errors import MeshError
from romdam.core.scene import Block
from romdam.geometry.cutting.hexahedra import cut_hexahedra
from romdam.geometry.cutting.mesh import Facets, Mesh
from romdam.geometry.cutting.moving import on_surface, snapped
from romdam.geometry.cutting.shapes import refuse_slivers
from romdam.geometry.cutting.surfaces import CuttingSurface, Cylinder, Plane, unit
from romdam.geometry.cutting.teeth import Step, joint_facets, refuse_teeth, smoothed
from romdam.geometry.cutting.tetrahedra import cut_tetrahedra
from romdam.geometry.elements import ELEMENTS
from romdam.geometry.facets import row_numbers
from romdam.geometry.meshes.kinds import refuse_wedges
from romdam.geometry.meshes.quality import sound_volume

log = logging.getLogger(__name__)

Cuts = dict[str, CutConfig]
Steps = dict[str, list[Step]]  # block that is cut -> its surfaces


def cut_block(block: Block, cuts: Cuts, folder: Path, source: str) -> dict[str, Block]:
    """Cut a block into those that its cuts, and the cuts of what these make, name.

    Every surface cuts the whole mesh, so that it conforms everywhere; names are given afterwards. Blocks are
    parts of one mesh whose nodes are doubled on the joints: they pair there to the last bit.

    Parameters
    ----------
    cuts : of the scene, by the block that they cut
    folder : where relative paths start
    source : name of the configuration file, for messages

    Raises
    ------
    MeshError
        for surfaces that miss, end in the block, leave saw-toothed joints or slivers, and elements that
        cannot be cut in two.
    """
    location = f"{source}: cut.{block.name}"
    refuse_wedges(block, "are not cut", location)
    steps = _steps(block.name, cuts, folder, source)
    every = [step for block_steps in steps.values() for step in block_steps]
    mesh = whole = Mesh.of(block)
    for step in every:
        mesh = _parted(mesh, step)
    names, labels = _labels(block.name, cuts, steps, mesh)
    mesh = _with_smooth_joints(mesh, labels, every)
    refuse_slivers(mesh, whole, [(step.surface, step.location) for step in every])
    pieces = _pieces(block, mesh, names, labels)
    volume = sum(sound_volume(piece, location) for piece in pieces.values())
    log.info("%s: volume changes by %.2g of itself", location, volume / sound_volume(block, location) - 1.0)

    # a surface may cross the block more than once, and leave blocks in parts that share no face
    facets = Facets.of(mesh.element, mesh.cells)
    a, b = facets.cell[facets.pairs].T
    same = labels[a] == labels[b]
    links = coo_array((np.ones(same.sum()), (a[same], b[same])), shape=(len(labels), len(labels)))
    component = connected_components(links, directed=False)[1]
    for k, name in enumerate(names):
        if (count := len(np.unique(component[labels == k]))) > 1:
            log.warning(
                "%s: block %r is in %d parts that share no face; cut them apart, or check the surfaces",
                location, name, count,
            )  # fmt: skip
    return pieces


def _steps(name: str, cuts: Cuts, folder: Path, source: str) -> Steps:
    """The surfaces of a block and of what its cuts make, from the block on."""
    if name not in cuts:
        return {}
    cut, steps = cuts[name], []
    for k, config in enumerate(cut.along):
        location = f"{source}: cut.{name}.along[{k}]"
        surface: CuttingSurface
        if config.plane is not None:
            surface = Plane(np.array(config.plane.point), unit(np.array(config.plane.normal)))
        elif config.cylinder is not None:
            c = config.cylinder
            surface = Cylinder(np.array(c.point), unit(np.array(c.axis)), c.radius)
        else:
            assert config.surface is not None
            from romdam.geometry.cutting.triangulated import read_surface  # here, not above: it compiles

            file = config.surface
            scale = to_si(f"1 {file.unit}", "m")
            surface = read_surface(folder / file.file, file.group, scale, f"{location}.surface")
        steps.append(Step(surface, cut.through == "elements", cut.teeth, location))
    steps_of = {name: steps}
    for piece in cut.into:
        steps_of |= _steps(piece, cuts, folder, source)
    return steps_of


def _parted(mesh: Mesh, step: Step) -> Mesh:
    """The mesh with the sides of one more surface, its elements cut where that is asked for."""
    if not step.through_elements:
        centre = mesh.points[mesh.corners].mean(axis=1)
        return mesh.with_side(np.where(step.surface.distance(centre) < 0.0, -1, 1))
    facets = Facets.of(mesh.element, mesh.cells)
    parted = (np.diff(mesh.sides[facets.cell[facets.pairs]], axis=1) != 0).any(axis=(1, 2))
    kept = facets.rows[np.concatenate([facets.boundary, facets.pairs[parted, 0]])]
    moved, level = snapped(mesh, step.surface, kept)
    if not mesh.element.startswith("hex"):
        _say_moves(mesh, moved, step)
        return cut_tetrahedra(moved, level, step.surface)
    if mesh.element != "hex8":
        raise MeshError(
            f"{step.location}: elements of the kind {mesh.element} are not cut in two, only tet4, tet10 and "
            "hex8; mesh with element faces along the surface and `through: faces`, or with tet10"
        )
    # hexahedra: nodes are moved only where no element is left to be cut then
    if (level[moved.cells].min(axis=1) * level[moved.cells].max(axis=1) < 0.0).any():
        level = step.surface.distance(mesh.points)  # a cell with some nodes on the surface would be a wedge
        moved, level = mesh, np.where(on_surface(level, mesh.points), 0.0, level)
    _say_moves(mesh, moved, step)
    return cut_hexahedra(moved, level, step.surface, step.location)


def _labels(name: str, cuts: Cuts, steps: Steps, mesh: Mesh) -> tuple[list[str], Ints]:
    """Names of the blocks, and which of them every cell is of (nc,).

    Raises
    ------
    MeshError
        where a surface leaves what is left of a block on one side.
    """
    counts = [len(block_steps) for block_steps in steps.values()]
    first = dict(zip(steps, np.cumsum([0, *counts])[:-1], strict=True))
    names: list[str] = []
    labels = np.full(len(mesh.cells), -1)

    def assign(name: str, among: Bools) -> None:
        if name not in cuts:
            labels[among] = len(names)
            names.append(name)
            return
        into = cuts[name].into
        for k, step in enumerate(steps[name]):
            below = among & (mesh.sides[:, first[name] + k] < 0)
            if not below.any() or below[among].all():
                distance = step.surface.distance(mesh.points[np.unique(mesh.corners[among])])
                ends = mesh.points[mesh.corners[:, np.array(ELEMENTS[mesh.element].edges)]]
                mean_edge = float(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).mean())
                empty = f"block {into[k]!r} gets no element"
                if below.any():
                    empty = "no element is left for the others"
                raise MeshError(
                    f"{step.location}: the surface misses what is to become {', '.join(into[k:])}: {empty}; "
                    f"its nodes are {distance.min():.4g} to {distance.max():.4g} m from the surface (above 0 "
                    f"on its positive side), elements have edges of about {mean_edge:.3g} m; move the "
                    "surface, turn its normal, or change the order of `into`"
                )
            assign(into[k], below)
            among = among & ~below
        assign(into[-1], among)

    assign(name, np.ones(len(mesh.cells), dtype=bool))
    return names, labels


def _with_smooth_joints(mesh: Mesh, labels: Ints, steps: list[Step]) -> Mesh:
    """Joints on their surfaces, once no tooth is too large."""
    facets = Facets.of(mesh.element, mesh.cells)
    joints = joint_facets(mesh, facets, labels, steps)
    for joint, step in zip(joints, steps, strict=True):
        if len(joint):
            refuse_teeth(mesh, facets.rows[joint], step)
    for k, (joint, step) in enumerate(zip(joints, steps, strict=True)):
        if len(joint):
            kept = facets.rows[np.concatenate([facets.boundary, *joints[:k], *joints[k + 1 :]])]
            moved = smoothed(mesh, facets.rows[joint], kept, step)
            _say_moves(mesh, moved, step)
            mesh = moved
    return mesh


def _say_moves(before: Mesh, after: Mesh, step: Step) -> None:
    far = np.linalg.norm(after.points - before.points, axis=1)
    if far.any():
        log.info(
            "%s: %d of %d nodes moved onto the surface, or with those, by up to %.3g m",
            step.location, np.count_nonzero(far), len(far), far.max(),
        )  # fmt: skip


def _pieces(block: Block, mesh: Mesh, names: list[str], labels: Ints) -> dict[str, Block]:
    """The cells of every block, with the nodes they use and what they have of the named faces."""
    # numbers of the facets of named faces among those of all cells of the uncut block
    facets = Facets.of(block.element, block.cells)
    boundary = np.sort(facets.rows[facets.boundary][:, : facets.corners], axis=1)
    numbers = {}
    for label, rows in block.faces.items():
        number = row_numbers(np.concatenate([boundary, np.sort(rows[:, : facets.corners], axis=1)]))
        numbers[label] = facets.boundary[np.isin(number[: len(boundary)], number[len(boundary) :])]

    pieces = {}
    for k, name in enumerate(names):
        chosen = labels == k
        used, cells = np.unique(mesh.cells[chosen], return_inverse=True)
        cells = cells.reshape(-1, mesh.cells.shape[1])
        every_facet = Facets.of(block.element, cells).rows
        origin, faces = mesh.origin[chosen].ravel(), {}
        for label, of_face in numbers.items():
            rows = every_facet[np.isin(origin, of_face)]
            if len(rows):
                faces[label] = rows
        pieces[name] = replace(block, name=name, points=mesh.points[used], cells=cells, faces=faces)
    return pieces
