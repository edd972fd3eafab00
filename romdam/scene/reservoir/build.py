"""The reservoir of a scene: its wet faces, depth and direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.config.sections.water import WaterConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Bools, Joint, Reservoir, Sound, Tie, WetFace
from romdam.geometry.elements import Floats
from romdam.geometry.facets import area_vectors, facet_normals
from romdam.geometry.meshes.files import MeshFiles
from romdam.scene.mortar.segments import segments
from romdam.scene.mortar.surface import MortarSurface
from romdam.scene.reservoir.reservoir_mesh import reservoir_mesh
from romdam.scene.reservoir.walls import TOUCH, refuse_prism_beside_rock
from romdam.scene.select import refuse_selected_twice, select_facets

_LEAST_DEPTHS = 0.05  # of the depth, below which water upstream is a slit
_MOST_WAVES = 2e4  # modes of the water below the cutoff
_DEPTHS = 3.0  # length of the reservoir; the pressure decays as exp(-pi/2 length/depth): to 1 %
_LEVEL = 1e-6  # horizontal part of the mean normal below which it gives no direction


def build_reservoir(
    config: WaterConfig | None,
    blocks: dict[str, Block],
    contacts: tuple[Joint | Tie, ...],
    fixed: dict[str, Bools],
    files: MeshFiles,
    source: str,
) -> Reservoir | None:
    """Find the wet faces and check that water can stand on them.

    Parameters
    ----------
    contacts : joints and ties, whose faces are never wet
    fixed : block -> (n, 3) components that supports hold
    files : of the scene, which may have the water's own mesh
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError
        for a level above the faces, faces that are not wet, and a direction that leads into the dam; for rock
        that does not cover floor and banks, and what `reservoir_mesh` refuses.
    """
    if config is None:
        return None
    location = f"{source}: water"
    faces = [
        WetFace(face.block, select_facets(blocks[face.block], face.face, f"{location}.faces[{k}].face"))
        for k, face in enumerate(config.faces)
    ]
    rock = [
        WetFace(face.block, select_facets(blocks[face.block], face.face, f"{location}.rock[{k}].face"))
        for k, face in enumerate(config.rock)
    ]
    seen = dict[tuple[str, tuple[int, ...]], str]()
    for k, face in enumerate(faces):
        refuse_selected_twice(seen, face.block, face.facets, f"{location}.faces[{k}]")
    for k, face in enumerate(rock):
        refuse_selected_twice(seen, face.block, face.facets, f"{location}.rock[{k}]")
    heights = [blocks[face.block].points[face.facets, 2] for face in faces]
    refuse_level(config.level, heights, location)
    for k, (face, height) in enumerate(zip(faces, heights, strict=True)):
        face_key = f"{location}.faces[{k}]"
        if height.min() >= config.level:
            raise ConfigError(
                f"{face_key}: the face is not wet: it begins at {height.min():g} m, above the level of "
                f"{config.level:g} m; leave it out"
            )
        _refuse_contact(face, contacts, blocks, face_key)
        if fixed[face.block][face.facets].all():
            raise ConfigError(
                f"{face_key}: the face is not wet: supports hold all {len(face.facets)} of its facets, so "
                "that nothing moves the water; name the upstream face"
            )
    if config.bottom is not None and config.bottom >= config.level:
        raise ConfigError(
            f"{location}.bottom: the floor at {config.bottom:g} m must be below the level of "
            f"{config.level:g} m; lower it, or leave the key out"
        )
    bottom = min(float(height.min()) for height in heights)
    upstream = _upstream(config, blocks, faces, location)
    solved = config.model != "westergaard"
    if solved and config.mesh is None:  # a prismatic reservoir starts at faces that look upstream
        for k, face in enumerate(faces):
            looks = facet_normals(blocks[face.block].points, face.facets) @ upstream
            if looks.min() <= 0.0:
                angle = np.degrees(np.arccos(looks.min()))
                raise ConfigError(
                    f"{location}.faces[{k}]: {int((looks <= 0.0).sum())} of its {len(looks)} facets are not "
                    f"wet, they look away from the reservoir ({angle:.0f} degrees off "
                    f"{upstream.round(3).tolist()}, limit 90); name the upstream face only, or correct "
                    "`upstream`"
                )
    sound = None
    if config.model == "compressible":
        sound = Sound(config.sound_speed, config.bottom_reflection, config.cutoff)
    water = Reservoir(
        faces=tuple(faces),
        level=config.level,
        depth=0.0,
        density=config.density,
        solved=solved,
        upstream=upstream,
        length=0.0,
        sound=sound,
        rock=tuple(rock),
    )
    water = at_level(water, config, bottom)
    if config.mesh is not None:
        return replace(water, mesh=reservoir_mesh(config.mesh, water, blocks, files, f"{location}.mesh"))
    if water.solved and water.length < _LEAST_DEPTHS * water.depth:
        raise ConfigError(
            f"{location}.length: {water.length:.4g} m is {water.length / water.depth:.2g} of the depth of "
            f"{water.depth:.4g} m, limit {_LEAST_DEPTHS:g}: a slit of water is no reservoir; leave it out "
            f"for {_DEPTHS:g} depths, or is the unit right?"
        )
    _refuse_many_waves(water, blocks, location)
    refuse_prism_beside_rock(water, blocks, location)
    return water


def at_level(water: Reservoir, config: WaterConfig, foot: float) -> Reservoir:
    """A reservoir without a mesh of its own at the level of a configuration.

    Parameters
    ----------
    foot : elevation of the lowest wet point [m]
    """
    return replace(
        water,
        level=config.level,
        depth=config.level - (foot if config.bottom is None else config.bottom),
        length=config.length or _DEPTHS * (config.level - foot),
    )


def _refuse_many_waves(water: Reservoir, blocks: dict[str, Block], location: str) -> None:
    """Refuse a reservoir of more modes below the cutoff than anybody waits for: V omega^3 / (6 pi^2 c^3)."""
    if water.sound is None:
        return
    area = sum(
        float(np.abs(area_vectors(blocks[f.block].points, f.facets).sum(axis=1) @ water.upstream).sum())
        for f in water.faces
    )
    waves = 2.0 * np.pi * water.sound.cutoff / water.sound.speed
    count = area * water.length * waves**3 / (6.0 * np.pi**2)
    if count > _MOST_WAVES:
        raise ConfigError(
            f"{location}.sound_speed: at {water.sound.speed:g} m/s the water has about {count:.2g} modes "
            f"below {water.sound.cutoff:g} Hz, limit {_MOST_WAVES:g}; is the unit right? Else lower "
            "water.cutoff or water.length"
        )


def refuse_level(level: float, heights: list[Floats], location: str, load: str = "the water") -> None:
    """Refuse what stands above its faces, such as water, or not above their foot.

    Raises
    ------
    ConfigError
        with the level and what the faces span.
    """
    top, bottom = (float(f(np.concatenate([h.ravel() for h in heights]))) for f in (np.max, np.min))
    if not bottom < level <= top + 1e-9 * abs(top):
        what = "above the top of its faces" if level > top else "not above the foot of its faces"
        remedy = "lower it" if level > top else "raise it, or leave the load out"
        raise ConfigError(
            f"{location}.level: {load} is {what}: {level:g} m, and they reach from {bottom:g} to {top:g} "
            f"m; {remedy}"
        )


def _refuse_contact(
    face: WetFace, contacts: tuple[Joint | Tie, ...], blocks: dict[str, Block], location: str
) -> None:
    """Refuse facets that lie on the neighbour of a contact with most of their area."""
    wet_face = MortarSurface(face.block, blocks[face.block].points, face.facets)
    for contact in contacts:
        for block, neighbour in zip(contact.blocks, reversed(contact.blocks), strict=True):
            if block != face.block:
                continue
            between = segments(wet_face, MortarSurface.boundary(blocks[neighbour]), TOUCH)
            area = np.where(np.abs(between.distance) <= TOUCH, between.area, 0.0)
            covered = np.bincount(between.slave, area, len(face.facets))
            inside = int((covered > 0.5 * wet_face.areas).sum())
            if inside:
                raise ConfigError(
                    f"{location}: the face is not wet: {inside} of its {len(face.facets)} facets lie in the "
                    f"contact {contact.name!r} with a neighbour; name the upstream face"
                )


def _upstream(config: WaterConfig, blocks: dict[str, Block], faces: list[WetFace], location: str) -> Floats:
    if config.upstream is not None:
        upstream = np.array(config.upstream) * [1.0, 1.0, 0.0]
    else:
        vectors = [area_vectors(blocks[face.block].points, face.facets).sum(axis=(0, 1)) for face in faces]
        total = np.sum(vectors, axis=0)
        area = np.sum([np.linalg.norm(v) for v in vectors])
        upstream = total / area * [1.0, 1.0, 0.0]
    size = float(np.linalg.norm(upstream))
    if size <= _LEVEL:
        raise ConfigError(
            f"{location}.upstream: {'it' if config.upstream else 'the mean normal of the faces'} has no "
            f"horizontal part (length {size:.2g}, limit {_LEVEL:g}); give a direction such as [0, -1, 0]"
        )
    return np.asarray(upstream / size)
