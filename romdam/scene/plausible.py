"""Remarks on what is odd in a scene and may not be meant: units forgotten, blocks that touch unjoined."""

from __future__ import annotations

from collections.abc import Collection
from itertools import combinations

import numpy as np

from romdam.contact.laws import Fracture
from romdam.contact.laws.catalogue import source_of
from romdam.core.errors import listed
from romdam.core.scene import Block, FreeField, Joint, Material, Reservoir, Scene
from romdam.geometry.facets import boundary_facets, facet_areas
from romdam.geometry.meshes.kinds import frame
from romdam.scene.mortar.segments import segments
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.select import facet_keys

_DENSITY = (800.0, 6000.0)  # [kg/m3]
_MODULUS = (1e8, 5e11)  # [Pa]
_POISSON = (0.05, 0.45)
_EXTENT = (0.05, 10_000.0)  # of all blocks together [m]
_SOFT, _STIFF = 1e-3, 1e4  # K_n over E/length of a block, and over E/size of an element
_SHORT = 1.0  # of the depth: a shorter reservoir is odd
_DEEP = 0.05  # of the depth, by which the floor may lie below the surface that the record is of
_SLENDER = 100.0  # ratio of edges from which on an element is told of
_TOUCH = 1e-3  # distance of faces that lie on each other [m], as of joints
_COVERED = 0.99  # share of a face from which on a joint covers it
_BRIDGED = 1e-3  # [m] between tied faces, from which on it is told
_BENDS = 1.0  # [K] range of the temperature within a block of linear elements, from which on it is told
_EDGE = 1e-3  # share of a facet below which blocks only meet at an edge


def odd_remarks(
    scene: Scene, materials: dict[str, Material], generated: Collection[str] = ()
) -> tuple[str, ...]:
    """Say what of a scene is odd, a sentence for each.

    Parameters
    ----------
    materials : by name, as they stand in the configuration
    generated : joints that the keys of a dam make, which cover what these say
    """
    remarks = []
    for name, material in materials.items():
        remarks += _material(name, material)
    low = np.min([block.points.min(axis=0) for block in scene.blocks.values()], axis=0)
    high = np.max([block.points.max(axis=0) for block in scene.blocks.values()], axis=0)
    extent = float((high - low).max())
    if not _EXTENT[0] <= extent <= _EXTENT[1]:
        remarks.append(
            f"blocks: all together reach over {extent:.4g} m; are their sizes, or `unit` of their meshes, in "
            "mm?"
        )
    for block in scene.blocks.values():
        remarks += _slender(block)
    for joint in scene.joints.values():
        remarks += _stiffness(joint, scene.blocks)
        remarks += _process_zone(joint, scene.blocks)
    for name, joint in scene.joints.items():
        if name not in generated:
            remarks += _partly(joint, scene.blocks)
    remarks += [
        f"ties.{tie.name}: bridges up to {tie.apart:.3g} m between the faces of {' and '.join(tie.blocks)}, "
        "and keeps them at that distance"
        for tie in scene.ties
        if tie.apart > _BRIDGED
    ]
    remarks += _unjoined(scene)
    remarks += _heavy_rock(scene)
    remarks += [
        f"outputs.stress.sections.{section.name}: fewer than three layers of elements are between the plane "
        "and the end of a block, so that its shear and moment are those of loads that are even over the "
        "height; refine the mesh there, or move `point`"
        for section in (() if scene.stress is None else scene.stress.sections)
        if section.coarse
    ]
    rigid = [
        name
        for name, change in scene.loads.warmed.items()
        if np.ptp(change) > _BENDS and not frame(scene.blocks[name].element).quadratic
    ]
    if rigid:
        remarks.append(
            f"loads.temperature: {listed(rigid)} of linear elements, which resist the bending by a "
            "temperature that differs within a block: a pillar bends by 0.92 to 1.1 of what it should where "
            "they are half as long as it is thick, by 0.3 where 2.5 times as long; take quadratic elements"
        )
    if scene.loads.gravity.any() and not scene.loads.staged_weight:
        remarks += [
            f"blocks.{name}: gravity lets the rock sink onto the springs of its viscous faces, the dam with "
            "it, though its weight has acted before there was a dam; give it `weight: false`"
            for name, block in scene.blocks.items()
            if block.absorbing and name not in scene.loads.excluded_from_gravity
        ]
    water = scene.find(Reservoir)
    if water and water.solved and water.mesh is None and water.length < _SHORT * water.depth:
        remarks.append(
            f"water.length = {water.length:.4g} m is {water.length / water.depth:.2g} of the depth of "
            f"{water.depth:.4g} m: water shut in so close before the dam moves with it as a reservoir's does "
            "not; three depths are usual"
        )
    field = scene.find(FreeField)
    if water and water.sound and water.rock and field:
        foot = min(float(scene.blocks[face.block].points[face.facets, 2].min()) for face in water.faces)
        below = float(field.levels[0]) - foot
        if below > _DEEP * water.depth:
            remarks.append(
                f"water.rock: the dam's foot is {below:.4g} m below the level surface that moves as the "
                "record does, and beyond the reservoir's far end the floor moves as that surface, not as "
                "rock deeper down does; let the reservoir reach three depths upstream"
            )
    return (*remarks, *_added_up(scene))


def _heavy_rock(scene: Scene) -> list[str]:
    """Rock with mass on a fixed base, shaken as its surface was."""
    if scene.find(FreeField) is not None or any(block.absorbing for block in scene.blocks.values()):
        return []
    heavy = [
        name
        for name in scene.blocks
        if name in scene.loads.excluded_from_gravity
        and scene.blocks[name].material.rho > 0.0
        and scene.fixed[name].any()
    ]
    if not heavy:
        return []
    return [
        f"blocks: rock {listed(heavy)} has mass on a fixed base, and amplifies a record made at its surface "
        "(2.5 times on an arch dam) and reflects the dam's waves; give it `mass: false`, or viscous faces"
    ]


def _material(name: str, material: Material) -> list[str]:
    remarks = []
    if not _DENSITY[0] <= material.rho <= _DENSITY[1]:
        meant = f"; is `{material.rho:g} t/m3` meant?" if 1.0 <= material.rho < 6.0 else ""
        remarks.append(
            f"materials.{name}.rho = {material.rho:g} kg/m3, concrete and rock have 2000 to 3000{meant}"
        )
    moduli = {"E": material.E}
    if material.E_sustained is not None:
        moduli = {"E": material.E_sustained, "E_dynamic": material.E}
        if material.sustained_ratio > 1.0:
            remarks.append(
                f"materials.{name}.E_dynamic = {material.E:g} Pa is below E = {material.E_sustained:g} Pa, "
                "and concrete and rock creep under loads that last"
            )
    for key, modulus in moduli.items():
        if not _MODULUS[0] <= modulus <= _MODULUS[1]:
            unit = "GPa" if modulus < 1e3 else "MPa"
            meant = f"; is `{modulus:g} {unit}` meant?" if modulus < 1e6 else ""
            remarks.append(f"materials.{name}.{key} = {modulus:g} Pa, concrete has about 30e9{meant}")
    if not _POISSON[0] <= material.nu <= _POISSON[1]:
        remarks.append(f"materials.{name}.nu = {material.nu:g}, concrete has about 0.2, rock 0.2 to 0.3")
    return remarks


def _slender(block: Block) -> list[str]:
    """Elements whose longest edge is many times their shortest."""
    ends = block.points[block.cells[:, np.array(frame(block.element).edges)]]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    aspect = length.max(axis=1) / np.where(length > 0.0, length, np.inf).min(axis=1)  # 0 where collapsed
    if aspect.max() <= _SLENDER:
        return []
    at = ", ".join(f"{x:.6g}" for x in ends[np.argmax(aspect)].mean(axis=(0, 1)))
    return [
        f"blocks.{block.name}: the edges of {int((aspect > _SLENDER).sum())} of its {len(aspect)} elements "
        f"differ by more than {_SLENDER:g} times ({aspect.max():.3g} times around ({at})); stress there is "
        "poor"
    ]


def _stiffness(joint: Joint, blocks: dict[str, Block]) -> list[str]:
    """K_n and K_s far from what the blocks are beside them."""
    remarks = []
    normal = joint.axes[:, 0].mean(axis=0)
    pair = [blocks[name] for name in joint.blocks]
    length = min(float(np.ptp(block.points @ normal)) for block in pair)
    modulus, size = min(block.material.E for block in pair), float(np.sqrt(np.median(joint.area)))
    if_soft = "closed, the joint hardly holds the blocks apart", "sticking, the joint hardly holds the blocks"
    if_stiff = "`rigid` is exact, and quicker", "so much is slow to solve"
    keys = ("normal_stiffness", joint.K_n), ("shear_stiffness", joint.K_s)
    for (key, stiffness), acts, exact in zip(keys, if_soft, if_stiff, strict=True):
        if not np.isfinite(stiffness).all() or not (stiffness > 0.0).all():
            continue
        stiff = float(np.median(stiffness / joint.area))
        if stiff < _SOFT * modulus / length:
            remarks.append(
                f"joints.{joint.name}.{key} = {stiff:.3g} N/m3 is {stiff * length / modulus:.2g} of what the "
                f"softer block has over its length (E/L = {modulus / length:.3g} N/m3): {acts}; is a unit "
                "missing, such as `16 GPa/m`?"
            )
        elif stiff > _STIFF * modulus / size:
            remarks.append(
                f"joints.{joint.name}.{key} = {stiff:.3g} N/m3 is {stiff * size / modulus:.2g} times what an "
                f"element has (E/h = {modulus / size:.3g} N/m3); {exact}"
            )
    return remarks


def _process_zone(joint: Joint, blocks: dict[str, Block]) -> list[str]:
    """Gaps farther apart than the length over which a crack softens, E G_f / f_t^2 (Hillerborg)."""
    rows = next((rows.values for rows in joint.laws if rows.law == source_of(Fracture)), None)
    if rows is None:
        return []
    spacing = float(np.sqrt(np.median(joint.area)))
    modulus = min(blocks[name].material.E for name in joint.blocks)
    length = Fracture.process_zone(rows[0], float(joint.area[0]), modulus)
    if spacing <= length:
        return []
    return [
        f"joints.{joint.name}.fracture: gaps are {spacing:.3g} m apart, farther than E G_f / f_t^2 = "
        f"{length:.3g} m, over which a crack softens: cracks depend on the spacing, and loads at "
        "cracking are too high; take smaller elements or spacing, or lower tensile_strength"
    ]


def _added_up(scene: Scene) -> list[str]:
    """Static loads that two entries put on the same facets or node: their sum acts."""
    remarks = []
    loads: dict[str, list[list[tuple[str, tuple[int, ...]]]]] = {
        "loads.pressure": [facet_keys(load.block, load.facets) for load in scene.loads.pressures],
        "loads.force": [
            [(load.block, (load.node,))] for load in scene.loads.forces if load.load == "loads.force"
        ],
    }
    for key, names in loads.items():
        seen: dict[tuple[str, tuple[int, ...]], int] = {}
        for k, named in enumerate(names):
            again = [name for name in named if seen.setdefault(name, k) != k]
            if again:
                what = f"{len(again)} of its {len(named)} facets" if key == "loads.pressure" else "its node"
                remarks.append(
                    f"{key}[{k}]: {what} of block {again[0][0]!r} are loaded by {key}[{seen[again[0]]}] too; "
                    "their sum acts"
                )
    return remarks


def _partly(joint: Joint, blocks: dict[str, Block]) -> list[str]:
    """A joint that covers only part of the face of either block in its plane."""
    area = float(joint.whole_area.sum())
    normal, at = joint.axes[:, 0].mean(axis=0), joint.position.mean(axis=0)
    if np.abs((joint.position - at) @ normal).max() > _TOUCH:
        return []  # curved: no plane tells the face
    faces = []  # areas of the blocks' facets in the joint's plane [m2]
    for block in (blocks[name] for name in joint.blocks):
        facets = boundary_facets(block.cells, block.element)
        on = (np.abs((block.points[facets] - at) @ normal) <= _TOUCH).all(axis=1)
        faces.append(float(facet_areas(block.points, facets[on]).sum()))
    if area >= _COVERED * min(faces):
        return []
    names = " and ".join(f"{face:.4g} m2 of {name!r}" for name, face in zip(joint.blocks, faces, strict=True))
    return [f"joints.{joint.name}: the faces lie on each other over {area:.4g} m2, of {names} in that plane"]


def _unjoined(scene: Scene) -> list[str]:
    joined = {frozenset(joint.blocks) for joint in scene.joints.values()}
    joined |= {frozenset(tie.blocks) for tie in scene.ties}
    faces = {name: MortarSurface.boundary(block) for name, block in scene.blocks.items()}
    remarks = []
    for pair in combinations(scene.blocks, 2):
        a, b = (scene.blocks[name].points for name in pair)
        low, high = np.maximum(a.min(axis=0), b.min(axis=0)), np.minimum(a.max(axis=0), b.max(axis=0))
        apart = low - high
        if frozenset(pair) in joined or apart.max() > _TOUCH:
            continue
        between = segments(faces[pair[0]], faces[pair[1]], _TOUCH)
        area = float(between.area[np.abs(between.distance) <= _TOUCH].sum())
        if area > _EDGE * min(faces[name].areas.min() for name in pair):
            first, second = sorted(pair)
            remarks.append(
                f"blocks: {first!r} and {second!r} touch over {area:.4g} m2, and neither a joint nor a tie "
                "is between them: they will pass through each other; name one, unless it is meant"
            )
    return remarks
