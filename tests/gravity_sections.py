"""Sections of two published gravity dams with water, as slices in plane stress; for tests and benchmarks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from romdam.config import parse_config
from romdam.config.job import Config
from romdam.core.arrays import Floats
from romdam.core.scene import Material, Scene
from romdam.scene.build import build_scene

FOOT = 0.3048


@dataclass(frozen=True)
class Section:
    """A gravity dam's section: upstream and downstream faces over height [m], and its concrete."""

    heights: Floats
    upstream: Floats
    downstream: Floats
    material: Material


PINE_FLAT = (
    Section(  # tallest monolith, 400 ft high: 32 ft at the crest, 314 ft at the base, upstream 1 in 20
        heights=np.array([0.0, 335.0, 400.0]) * FOOT,
        upstream=np.array([0.0, 16.75, 16.75]) * FOOT,
        downstream=np.array([314.3, 48.75, 48.75]) * FOOT,
        material=Material(22.41e9, 0.2, 2483.0),
    )
)
KOYNA = Section(  # tallest monolith, 103 m high: 14.8 m at the crest, 70 m at the base, upstream vertical
    heights=np.array([0.0, 66.5, 103.0]),
    upstream=np.zeros(3),
    downstream=np.array([70.0, 19.25, 14.8]),
    material=Material(31.027e9, 0.2, 2643.0),
)


def section_scene(
    section: Section, water: dict[str, Any] | None, cells: tuple[int, int], damping: dict[str, Any]
) -> tuple[Scene, Config]:
    """A slice 4 m thick of `cells` hex20 (through, up), free to widen along the axis, base fixed; its crest
    is the probe.

    Parameters
    ----------
    water : `water:` without its faces; None for an empty reservoir
    damping : `damping:` of the configuration
    """
    top = float(section.heights[-1])
    size = [4.0, 40.0 / cells[0], top / cells[1]]
    box = {"origin": [0, 0, 0], "size": [4.0, 40.0, top], "element_size": size, "element": "hex20"}
    raw = {
        "materials": {"c": {"E": "30 GPa", "nu": 0.18, "rho": 2440}},
        "blocks": {"a": {"material": "c", "box": box}},
        "supports": [{"block": "a", "face": "zmin"}],
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 60},
        "damping": damping,
        "transient": {"finest_step": 0.01},
        "outputs": {"nodes": {"crest": {"block": "a", "at": [2, 0, top]}}},
    } | ({"water": water | {"faces": [{"block": "a", "face": "ymin"}]}} if water else {})
    config = parse_config(raw, "s.yaml")
    scene = build_scene(config, Path("."), "s.yaml")
    block, held = scene.blocks["a"], scene.fixed["a"].copy()
    x, y, z = block.points.T
    up, down = (np.interp(z, section.heights, side) for side in (section.upstream, section.downstream))
    held[:, 0] |= x == 2.0
    points = np.stack([x, up + y / 40.0 * (down - up), z], axis=1)
    moved = replace(block, points=points, material=section.material)
    return replace(scene, blocks={"a": moved}, fixed={"a": held}), config
