"""Remarks on what is odd in a scene and may not be meant: units forgotten, blocks that touch unjoined."""

from __future__ import annotations

import logging
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from romdam.core.scene import Block, Joint, Material, Scene
from romdam.scene.elements import ELEMENTS, Floats
from romdam.scene.facets import boundary_facets, facet_areas, facet_normals

log = logging.getLogger(__name__)

_DENSITY = (800.0, 6000.0)  # [kg/m3]
_MODULUS = (1e8, 5e11)  # [Pa]
_POISSON = (0.05, 0.45)
_EXTENT = (0.05, 10_000.0)  # of all blocks together [m]
_SOFT, _STIFF = 1e-3, 1e4  # K_n over E/length of a block, and over E/size of an element
_SLENDER = 100.0  # ratio of edges from which on an element is told of
_TOUCH = 1e-3  # distance of the centres of two facets that are one [m], as of joints
_COVERED = 0.99  # share of a face from which on a joint covers it
_LOOK_AT = -0.5  # cosine of normals: faces that touch look at each other


def say_odd(scene: Scene, materials: dict[str, Material], source: str) -> None:
    """Log as warnings what of a scene is odd.

    Parameters
    ----------
    materials : by name, as they stand in the configuration
    source : name of the configuration file
    """
    contacts = _contacts(scene.blocks)
    remarks = [
        *(line for name, material in materials.items() for line in _material(name, material)),
        *_extent(scene.blocks),
        *(line for block in scene.blocks.values() for line in _slender(block)),
        *(line for joint in scene.joints.values() for line in _stiffness(joint, scene.blocks)),
        *(line for joint in scene.joints.values() for line in _partly(joint, scene.blocks, contacts)),
        *_unjoined(scene, contacts),
    ]
    for line in remarks:
        log.warning("%s: %s", source, line)


def _material(name: str, material: Material) -> list[str]:
    found = []
    if not _DENSITY[0] <= material.rho <= _DENSITY[1]:
        meant = f"; is `{material.rho:g} t/m3` meant?" if 1.0 <= material.rho < 6.0 else ""
        found.append(
            f"materials.{name}.rho = {material.rho:g} kg/m3, concrete and rock have 2000 to 3000{meant}"
        )
    if not _MODULUS[0] <= material.E <= _MODULUS[1]:
        unit = "GPa" if material.E < 1e3 else "MPa"
        meant = f"; is `{material.E:g} {unit}` meant?" if material.E < 1e6 else ""
        found.append(f"materials.{name}.E = {material.E:g} Pa, concrete has about 30e9{meant}")
    if not _POISSON[0] <= material.nu <= _POISSON[1]:
        found.append(f"materials.{name}.nu = {material.nu:g}, concrete has about 0.2, rock 0.2 to 0.3")
    return found


def _extent(blocks: dict[str, Block]) -> list[str]:
    low = np.min([block.points.min(axis=0) for block in blocks.values()], axis=0)
    high = np.max([block.points.max(axis=0) for block in blocks.values()], axis=0)
    extent = float((high - low).max())
    if _EXTENT[0] <= extent <= _EXTENT[1]:
        return []
    return [
        f"blocks: all together reach over {extent:.4g} m; are their sizes, or `unit` of their meshes, in mm?"
    ]


def _slender(block: Block) -> list[str]:
    """Elements whose longest edge is many times their shortest."""
    ends = block.points[block.cells[:, np.array(ELEMENTS[block.element].edges)]]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    aspect = length.max(axis=1) / length.min(axis=1)
    if aspect.max() <= _SLENDER:
        return []
    at = ", ".join(f"{x:.6g}" for x in ends[np.argmax(aspect)].mean(axis=(0, 1)))
    return [
        f"blocks.{block.name}: the edges of {int((aspect > _SLENDER).sum())} of its {len(aspect)} "
        "elements differ by "
        f"more than {_SLENDER:g} times ({aspect.max():.3g} times around ({at})); stress there is poor"
    ]


def _stiffness(joint: Joint, blocks: dict[str, Block]) -> list[str]:
    """K_n far from what the blocks are beside it."""
    if not np.isfinite(joint.K_n).all():
        return []
    stiff = float(np.median(joint.K_n / joint.area))
    normal = joint.axes[:, 0].mean(axis=0)
    pair = [blocks[name] for name in joint.blocks]
    length = min(float(np.ptp(block.points @ normal)) for block in pair)
    modulus, size = min(block.material.E for block in pair), float(np.sqrt(np.median(joint.area)))
    if stiff < _SOFT * modulus / length:
        return [
            f"joints.{joint.name}.normal_stiffness = {stiff:.3g} N/m3 is {stiff * length / modulus:.2g} "
            "of what the "
            f"softer block has over its length (E/L = {modulus / length:.3g} N/m3): closed, the joint "
            "hardly holds the blocks apart; is a unit missing, such as `16 GPa/m`?"
        ]
    if stiff > _STIFF * modulus / size:
        return [
            f"joints.{joint.name}.normal_stiffness = {stiff:.3g} N/m3 is {stiff * size / modulus:.2g} "
            f"times what an element has (E/h = {modulus / size:.3g} N/m3); `rigid` is exact, and quicker"
        ]
    return []


Contacts = dict[frozenset[str], float]


def _contacts(blocks: dict[str, Block]) -> Contacts:
    """Pairs of blocks -> area of the facets that lie on each other [m2]."""
    sides = {}
    for name, block in blocks.items():
        facets = boundary_facets(block.cells, block.element)
        corners = block.points[facets[:, : 4 if block.element.startswith("hex") else 3]]
        sides[name] = (corners.mean(axis=1), block.points, facets)
    trees = {name: cKDTree(centre) for name, (centre, *_) in sides.items()}
    found: Contacts = {}
    for I, J in combinations(blocks, 2):
        apart = [trees[I].mins - trees[J].maxes, trees[J].mins - trees[I].maxes]
        if np.max(apart) > _TOUCH:
            continue
        distance, other = trees[J].query(sides[I][0], distance_upper_bound=_TOUCH)
        here = np.flatnonzero(np.isfinite(distance))
        if len(here):
            own = sides[I][2][here]
            looks = facet_normals(sides[I][1], own) * facet_normals(sides[J][1], sides[J][2][other[here]])
            area = float(facet_areas(sides[I][1], own[looks.sum(axis=1) < _LOOK_AT]).sum())
            found |= {frozenset((I, J)): area} if area else {}
    return found


def _partly(joint: Joint, blocks: dict[str, Block], contacts: Contacts) -> list[str]:
    """A joint that covers only part of the face of either block in its plane."""
    area = contacts.get(frozenset(joint.blocks), 0.0)
    normal, at = joint.axes[:, 0].mean(axis=0), joint.position.mean(axis=0)
    if np.abs((joint.position - at) @ normal).max() > _TOUCH:
        return []  # curved: no plane tells the face
    faces = [_in_plane(blocks[name], normal, at) for name in joint.blocks]
    if not 0.0 < area < _COVERED * min(faces):
        return []
    names = " and ".join(f"{face:.4g} m2 of {name!r}" for name, face in zip(joint.blocks, faces, strict=True))
    return [f"joints.{joint.name}: the faces lie on each other over {area:.4g} m2, of {names} in that plane"]


def _in_plane(block: Block, normal: Floats, at: Floats) -> float:
    """Area of a block's facets in a plane [m2]."""
    facets = boundary_facets(block.cells, block.element)
    on = (np.abs((block.points[facets] - at) @ normal) <= _TOUCH).all(axis=1)
    return float(facet_areas(block.points, facets[on]).sum())


def _unjoined(scene: Scene, contacts: Contacts) -> list[str]:
    joined = {frozenset(joint.blocks) for joint in scene.joints.values()}
    joined |= {frozenset(tie.blocks) for tie in scene.ties}
    found = []
    for pair, area in contacts.items():
        if pair not in joined:
            a, b = sorted(pair)
            found.append(
                f"blocks {a!r} and {b!r} touch over {area:.4g} m2, and neither a joint nor a tie is "
                "between them: they will pass through each other; name one, unless it is meant"
            )
    return found
