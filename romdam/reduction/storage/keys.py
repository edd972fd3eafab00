"""Keys of stored bases: the SHA-256 of everything that a basis depends on.

Mesh, element, material, supports, what the joints retain, the loads that the basis answers statically, the
choice of modes, the layout, and the code that reduces with the libraries that multiply and factor for it:
what is found is what would be made, to the bit. Stiffness and friction of joints, gaps, damping, weight and
records are not part of it; water is, where a finer basis answers its inertia.
"""

from __future__ import annotations

from scipy.sparse import csr_matrix

from romdam.core.arrays import Bools, Floats
from romdam.core.fingerprint import code_digest, fingerprint
from romdam.core.scene import Block, Scene
from romdam.effects.added_mass import WetMass
from romdam.reduction.interface import Interface
from romdam.reduction.methods.craig_bampton import ModeChoice
from romdam.scene.ties import Part

LAYOUT = "romdam-block-2"
ROOMS = ("core", "effects", "fem", "linalg", "reduction", "scene")  # whose code makes a basis


def block_key(
    block: Block,
    fixed: Bools,
    interface: Interface,
    loads: Floats,
    choice: ModeChoice,
    wet: WetMass | None = None,
) -> str:
    """Key of the Craig-Bampton basis of a block, which answers loads (3 n, l) statically right."""
    elastic = (block.material.E, block.material.nu, block.material.rho)
    mesh = (block.element, block.points, block.cells, elastic)
    outside = (mesh, fixed, block.absorbing) if block.absorbing else (mesh, fixed)
    own = () if block.matrices is None else (block.matrices,)
    return _key(*outside, *own, interface, loads, choice.stored, *_water(choice, wet))


def part_keys(
    part: Part,
    scene: Scene,
    operator: csr_matrix,
    static: Floats,
    choice: ModeChoice,
    wet: WetMass | None = None,
) -> dict[str, str]:
    """Block name -> key of its free-interface basis, which depends on everything in the part."""
    of_blocks = [
        (name, scene.blocks[name].element, scene.blocks[name].material, scene.blocks[name].points,
         scene.blocks[name].cells, part.number[name], scene.fixed[name], scene.blocks[name].absorbing)
        for name in part.blocks
    ]  # fmt: skip
    kinds = [sorted(names & set(part.blocks)) for names in (scene.excluded_from_gravity, scene.radiating)]
    slaves = () if part.slaves is None else (part.slaves,)
    waves = () if scene.free_field is None else (scene.free_field,)
    moved = [] if scene.moving is None else [scene.moving.components[name] for name in part.blocks]
    carried = (moved,) if any((number >= 0).any() for number in moved) else ()
    own = [m for name in part.blocks if (m := scene.blocks[name].matrices) is not None]
    outside = (*slaves, *waves, *carried, *own, kinds, operator, static)
    whole = _key(of_blocks, *outside, choice.stored, *_water(choice, wet))
    return {name: fingerprint((whole, name)) for name in part.blocks}


def _water(choice: ModeChoice, wet: WetMass | None) -> tuple[WetMass, ...]:
    """The water that a basis knows of."""
    return (wet,) if choice.finer and wet is not None else ()


def _key(*what: object) -> str:
    return fingerprint((LAYOUT, code_digest(*ROOMS), *what))
