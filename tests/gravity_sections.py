"""Sections of two published gravity dams with water, as slices in plane stress; for tests and benchmarks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from romdam.config import parse_config
from romdam.config.sections.job import Config
from romdam.core.arrays import Floats
from romdam.core.scene import Material, Scene
from romdam.core.system import System
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


def inputs(system: System, omega: float, axis: int) -> Floats:
    """What the load of a system multiplies, of unit ground acceleration exp(i omega t)."""
    unit = np.eye(3)[axis]
    return np.concatenate([unit, *(channel_inputs(drive, omega, axis) for drive in system.drives)])


def channel_inputs(drive: Any, omega: float, axis: int) -> Floats:
    """Velocity, waves of the sections and their rates, of unit ground acceleration exp(i omega t)."""
    velocity = np.eye(3)[axis] / (1j * omega)
    matrix = np.diag(drive.k - omega**2) + 1j * omega * drive.c
    y = np.linalg.solve(matrix, drive.velocity @ velocity)
    return np.concatenate([velocity, y, 1j * omega * y])


def crest_response(system: System, omega: float, ratio: float = 0.01) -> float:
    """Acceleration of the crest over that of the base, along y, with hysteretic damping of the dam."""
    K = system.K.tocoo()
    dam = (K.row < system.parts["a"].stop) & (K.col < system.parts["a"].stop)
    factors = np.where(dam, 1.0 + 2j * ratio, 1.0)
    hysteretic = csc_matrix((factors * K.data, (K.row, K.col)), shape=K.shape)
    A = csc_matrix(hysteretic - omega**2 * system.M + 1j * omega * system.C)
    u = splu(A).solve(-(system.load @ inputs(system, omega, 1)).astype(complex))
    return float(abs(1.0 - omega**2 * (system.observe @ u)[1]))


def first_period(system: System, low: float, high: float, tolerance: float = 1e-3) -> float:
    """Period of the largest crest response between two, by golden sections [s]."""
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    while high / low > 1.0 + tolerance:
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        below = crest_response(system, 2 * np.pi / left) > crest_response(system, 2 * np.pi / right)
        low, high = (low, right) if below else (left, high)
    return 0.5 * (low + high)
