"""Scene -> Deck.

Nodes that ties make one are one point. Slave nodes of mortar ties follow others, and where a gap sees a mean
of several nodes it has a point of its own that follows these.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.sparse import block_diag, csr_matrix, diags_array, eye_array, kron, vstack

from romdam.config.sections.job import DampingConfig
from romdam.contact.laws.catalogue import find_law, further_keys
from romdam.contact.laws.shear_stiffness import ElasticShear
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.final_state import InitialState
from romdam.core.known import refuse_unknown, refuse_unknown_kinds
from romdam.core.motion import MovingSupports
from romdam.core.scene import ConstructionStage, ForceHistory, FreeField, Reservoir, Scene
from romdam.core.system import GapLaw
from romdam.effects.added_mass import added_mass
from romdam.export.deck import Deck, DeckMotion, Gaps, Solid, elastic
from romdam.fem.damping import joints_alone_hold, material_coefficients, rayleigh_coefficients
from romdam.fem.gaps import gap_law, gap_operators, water_force
from romdam.fem.loads import static_force, surface_forces, weight_acts
from romdam.geometry.meshes.quality import sound_volume
from romdam.scene.ties import scene_parts

_GIVE = 0.01  # [m] of its blocks' material whose stiffness E / length a rigid gap has, where nothing is rigid
_ROUNDING = 1e-12  # of a gap's weights, whose sum is 1

_WRITTEN = "written for other codes"
# fields that a deck has all of, or states that it leaves out (`_stated`)
_OF_SCENE = {"blocks", "joints", "fixed", "loads", "probes", "stress", "ties", "effects", "remarks"}
_OF_LOADS = {
    "gravity", "pressures", "forces", "water", "warmed", "excluded_from_gravity", "staged_weight", "order",
}  # fmt: skip
_OF_BLOCK = {"name", "element", "points", "cells", "material", "faces", "unsound_faces"}
_OF_MATERIAL = {"E", "nu", "rho", "expansion", "damping"}
_OF_RESERVOIR = {"faces", "level", "depth", "density", "upstream", "length", "rock"}
_OF_JOINT = {
    "name", "blocks", "nodes", "position", "area", "share", "axes", "weights", "gap", "K_n", "K_nz", "K_s",
    "mu", "viscosity", "grout", "water", "laws", "at_point", "face", "corner", "patches", "uplift",
    "element_stiffness",
}  # fmt: skip
_OF_GAPS = {
    "K_n", "K_nz", "K_s", "mu", "gap", "slip", "joints", "laws", "viscosity", "grout", "slipped", "memory",
    "uplift",
}  # fmt: skip
_REMEDIES = {
    "matrices": ("blocks.<name>.matrices", "mesh the block, or write the job with --to matrices"),
    "absorbing": (
        "ground.viscous or a viscous rock boundary",
        "let the rock be massless (mass: false) and hold its outer faces",
    ),
}
_REMEDIES_OF_KINDS: dict[type, tuple[str, str]] = {
    FreeField: ("ground.input: free_field", "leave it out"),
    ForceHistory: ("loads.force_history", "leave it out"),
    ConstructionStage: ("construction", "leave it out"),
    InitialState: ("loads.initial_state.result", "let the run start from rest: static"),
    MovingSupports: ("supports[].motion, or ground.along", "let all supports move as the base does"),
}
_SOLVED = (
    "water.model: compressible or incompressible",
    "set water.model: westergaard, whose mass stands at single nodes",
)


def build_deck(
    scene: Scene,
    damping: DampingConfig,
    motion: DeckMotion,
    *,
    title: str,
    static: bool,
    grouted: GapLaw | None = None,
) -> Deck:
    """Describe a scene and a record.

    Parameters
    ----------
    static : whether equilibrium under the static loads comes first
    grouted : the gaps after the joints' grouting; those of the scene if not given

    Raises
    ------
    ConfigError
        for modal damping, and for what no nodal mass, force or linear constraint stands for.
    """
    law = gap_law(scene) if grouted is None else grouted
    _refuse(scene, damping, law)
    # numbers of every block's nodes, and what slave nodes follow, (3 n, 3 n)
    number, of_parts, first = dict[str, Ints](), [], 0
    for part in scene_parts(scene).values():
        number |= {name: first + numbers for name, numbers in part.number.items()}
        first += part.every_node
        rows = csr_matrix((3 * part.nodes, 3 * part.nodes))
        of_parts.append(_square(rows if part.slaves is None else vstack([rows, part.slaves])))
    follows = csr_matrix(block_diag(of_parts))
    gaps, position, means = _gaps(scene, number, follows, law)
    count = follows.shape[0] // 3
    shape = (count + len(position), 3)
    points, fixed = np.zeros(shape), np.zeros(shape, dtype=bool)
    force, mass = np.zeros(shape), np.zeros((*shape, 3))
    points[count:] = position
    water, press, wet = added_mass(scene), gap_operators(scene, 1), water_force(scene)
    for name, block in scene.blocks.items():
        at = number[name]
        points[at] = block.points
        np.logical_or.at(fixed, at, scene.fixed[name])
        np.add.at(force, at, static_force(scene, name) + (press[name].T @ wet).reshape(-1, 3))
        if water is not None and name in water.coupling:
            np.add.at(mass, at, (water.coupling[name].T @ water.ground).reshape(-1, 3, 3))
    alpha, beta = rayleigh_coefficients(damping.rayleigh)
    return Deck(
        title=title,
        points=points,
        solids=tuple(
            Solid(n, b.element, number[n][b.cells], b.material, material_coefficients(b, damping.rayleigh))
            for n, b in scene.blocks.items()
        ),
        fixed=fixed,
        follows=_square(vstack([follows, means])),
        mass=sum(b.material.rho * sound_volume(b, title) for b in scene.blocks.values()),
        added_mass=mass,
        force=force,
        gaps=gaps,
        alpha=alpha,
        beta=beta,
        static=static,
        motion=motion,
        probes={probe.name: int(number[probe.block][probe.node]) for probe in scene.probes},
        stated=tuple(_stated(scene, damping, static)),
        averaged=_averaged(scene),
    )


def _averaged(scene: Scene) -> dict[str, str]:
    """Key of every joint and tie whose points follow several nodes -> why they do."""
    why = {f"ties.{tie.name}": "is by mortar" for tie in scene.ties if tie.weights is not None}
    for name, joint in scene.joints.items():
        rows = [abs(csr_matrix(side)) > _ROUNDING for side in joint.weights]
        if joint.patches is not None:
            why[f"joints.{name}.spacing"] = "has gaps that are means over several nodes"
        elif any((side.sum(axis=1) > 1).any() for side in rows):
            why[f"joints.{name}"] = "is by mortar, or has gaps on quadratic faces"
    return why


def _refuse(scene: Scene, damping: DampingConfig, law: GapLaw) -> None:
    """Refuse what other codes have no plain words for.

    Among it are gaps with friction whose shear counts from another position than that of the mesh.
    """
    for block in scene.blocks.values():
        refuse_unknown(block, _OF_BLOCK, _WRITTEN, _REMEDIES)
        refuse_unknown(block.material, _OF_MATERIAL, _WRITTEN)
    for joint in scene.joints.values():
        refuse_unknown(joint, _OF_JOINT, _WRITTEN)
    if (water := scene.find(Reservoir)) is not None:
        refuse_unknown(water, _OF_RESERVOIR, _WRITTEN, dict.fromkeys(("solved", "sound"), _SOLVED))
    refuse_unknown(scene, _OF_SCENE, _WRITTEN, _REMEDIES)
    refuse_unknown(scene.loads, _OF_LOADS, _WRITTEN)
    refuse_unknown_kinds(scene.effects, (Reservoir,), _WRITTEN, _REMEDIES_OF_KINDS)
    refuse_unknown(law, _OF_GAPS, _WRITTEN)
    if damping.modal is not None:
        raise ConfigError(f"damping.modal is not {_WRITTEN}; give damping.rayleigh")
    sticks = ((law.mu.min(axis=1, initial=np.inf) > 0.0) | elastic(law)) & (law.K_s > 0.0)
    for slip in (law.slip, law.slipped):
        if len(slip) and slip[sticks].any():
            raise ConfigError(
                "joints.<name>.grouting_pressure with shear is not written for other codes: shear counts "
                "from where the blocks stand after grouting, "
                f"{1e3 * np.abs(slip[sticks]).max():.3g} mm from where the mesh has them, which their "
                "springs do not know; leave out friction, shear_stiffness or grouting_pressure"
            )


def _square(rows: csr_matrix) -> csr_matrix:
    """The same rows with as many columns, those behind the others empty."""
    matrix = csr_matrix(rows)
    matrix.resize(matrix.shape[0], matrix.shape[0])
    return matrix


def _gaps(
    scene: Scene, number: dict[str, Ints], follows: csr_matrix, law: GapLaw
) -> tuple[Gaps, Floats, csr_matrix]:
    """The gaps, the positions of points of their own (m, 3), and what these follow (3 m, 3 n)."""
    size = follows.shape[0]
    leads = csr_matrix(follows + diags_array((np.diff(follows.indptr) == 0).astype(float)))
    points, position, means = [np.zeros((0, 2), dtype=np.int64)], [np.zeros((0, 3))], [csr_matrix((0, size))]
    count = size // 3
    for joint in scene.joints.values():
        both = np.zeros((len(joint.gap), 2), dtype=np.int64)
        for side, block in enumerate(joint.blocks):
            nodes, weights = number[block][joint.nodes[side]], csr_matrix(joint.weights[side], copy=True)
            weights.data[abs(weights.data) < _ROUNDING] = 0.0
            weights.eliminate_zeros()
            several = np.flatnonzero(np.diff(weights.indptr) > 1)
            both[:, side] = nodes[weights.indices[weights.indptr[:-1]]]
            both[several, side] = count + np.arange(len(several))
            seen = (3 * nodes[:, None] + np.arange(3)).ravel()
            means.append(csr_matrix(kron(weights[several], eye_array(3)) @ leads[seen]))
            position.append(joint.position[several])
            count += len(several)
        points.append(both)
    names = tuple(name for name, joint in scene.joints.items() for _ in joint.gap)
    axes = np.concatenate([np.zeros((0, 3, 3)), *(joint.axes for joint in scene.joints.values())])
    # rigid gaps have the stiffness of a layer of their block
    layer = [scene.blocks[j.blocks[0]].material.E * j.area / _GIVE for j in scene.joints.values()]
    stiff = np.concatenate([np.zeros(0), *layer])
    stiff_law = replace(law, K_n=np.where(np.isinf(law.K_n), stiff, law.K_n))
    gaps = Gaps(names, np.concatenate(points), axes, stiff_law)
    return gaps, np.concatenate(position), csr_matrix(vstack(means))


def _stated(scene: Scene, damping: DampingConfig, static: bool) -> Iterator[str]:
    """State what no code has as romdam has it."""
    law = gap_law(scene)
    loose, alpha = list[str](), 0.0
    for part in scene_parts(scene).values():
        most = max(material_coefficients(scene.blocks[n], damping.rayleigh)[0] for n in part.blocks)
        if most > 0.0 and joints_alone_hold(part, scene):
            loose, alpha = [*loose, part.name], max(alpha, most)
    if loose:
        yield (
            f"The mass term of Rayleigh damping, alpha = {alpha:.3g} 1/s, brakes the rigid motion of what "
            f"joints alone hold ({', '.join(loose)}); in romdam it does not, and slips are larger."
        )
    rigid = int(np.isinf(law.K_n).sum())
    if rigid:
        yield (
            f"{rigid} rigid gaps have the normal stiffness of {1e3 * _GIVE:g} mm of their block's material, "
            "E / length."
        )
    springs = elastic(law)
    bounded = [
        rows for rows in law.laws if not (find_law(rows.law) is ElasticShear and springs[rows.on].all())
    ]
    keys = further_keys(replace(law, laws=tuple(bounded)))
    if keys:
        yield f"Left out of the joints: {', '.join(keys)}."
    if (law.mu[:, 0] != law.mu[:, 1]).any():
        yield "Friction is the smaller of that along j and k."
    kinds = {kind for name in scene.blocks for kind in surface_forces(scene, name)}
    kinds |= (
        {"weight"}
        if scene.loads.gravity.any() and any(weight_acts(scene, name) for name in scene.blocks)
        else set()
    )
    if static and law.mu.any() and len(kinds) > 1:
        order = ", then ".join(kind for kind in scene.loads.order if kind in kinds)
        yield (
            f"Static loads come at once; romdam applies {order} (loads.order), which with friction may leave "
            "other shear at rest."
        )
    if any(joint.at_point is not None for joint in scene.joints.values()):
        yield "Openings are means around the gaps, conjugate to forces; romdam writes them at points."
    if scene.find(Reservoir) is not None:
        yield "The water's added mass is lumped at the wet nodes; romdam's is consistent."
