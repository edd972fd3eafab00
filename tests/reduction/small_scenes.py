"""Small scenes of two cantilevers, turned, renumbered or scaled, with all their matrices."""

import dataclasses
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from simulating import simulated

from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig, ModelConfig, RayleighConfig
from romdam.core.arrays import Floats
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.effects.full_order import assemble_full
from romdam.reduction.synthesis import ReducedModel, reduce_scene
from romdam.scene.build import build_scene

E = 30e9
DAMPING = DampingConfig(rayleigh=RayleighConfig(frequencies=(5.0, 60.0), ratio=0.05))


def raw(height: float = 8.0, size: float = 2.0, **joint: Any) -> dict[str, Any]:
    """Two cantilevers of 4 x 4 and 4 x 6 m, `height` high, pressed together by 0.1 MPa, shaken in x, y, z."""
    joint = {"normal_stiffness": E, "shear_stiffness": 0.5 * E} | joint
    return {
        "materials": {"concrete": {"E": E, "nu": 0.2, "rho": 2400.0}},
        "blocks": {
            name: {"material": "concrete", "box": {"origin": at, "size": extent, "element_size": size}}
            for name, at, extent in (
                ("left", [0, -4, 0], [4, 4, height]),
                ("right", [0, 0, 0], [4, 6, height]),
            )
        },
        "supports": [{"block": name, "face": "zmin"} for name in ("left", "right")],
        "joints": {"c": {"between": ["left", "right"]} | joint},
        "loads": {
            "pressure": [
                {"block": "left", "face": "ymin", "value": 1e5},
                {"block": "right", "face": "ymax", "value": 1e5},
            ]
        },
        "outputs": {
            "nodes": {
                "a": {"block": "left", "at": [4, 0, height]},
                "b": {"block": "right", "at": [4, 0, height]},
            }
        },
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"order": "full"},
        "transient": {"finest_step": 0.01},
    }


def scene(config: dict[str, Any]) -> Scene:
    """Build without touching the disk."""
    from pathlib import Path

    return build_scene(parse_config(config, "s.yaml"), Path(), "s.yaml")


def shaking(dt: float, duration: float = 2.0, amplitude: float = 8.0) -> Floats:
    """(3, nt) broad-band ground motion, linear between corners every 0.01 s."""
    corners = amplitude * np.random.default_rng(7).standard_normal((3, round(duration / 0.01) + 1))
    corners *= np.array([[0.4], [1.0], [0.3]])
    t = np.arange(round(duration / dt) + 1) * dt
    return np.array([np.interp(t, 0.01 * np.arange(corners.shape[1]), row) for row in corners])


def reduced(built: Scene, damping: DampingConfig = DAMPING, **model: Any) -> ReducedModel:
    """The reduced model; all modes unless asked otherwise."""
    return reduce_scene(built, ModelConfig(**(model or {"modes": "all"})), damping)


def march(system: System, dt: float = 0.0025, ground: Floats | None = None, **options: Any) -> History:
    """Integrate, from the undeformed state unless asked otherwise."""
    ground = shaking(dt) if ground is None else ground
    return simulated(system, ground, dt, **({"initial_state": "undeformed"} | options))


def full(built: Scene, damping: DampingConfig = DAMPING) -> System:
    """The unreduced system."""
    return assemble_full(built, damping)


def turned(built: Scene, R: Floats) -> Scene:
    """The same scene with everything turned by R (3, 3)."""
    blocks = {n: dataclasses.replace(b, points=b.points @ R.T) for n, b in built.blocks.items()}
    joints = {
        n: dataclasses.replace(j, position=j.position @ R.T, axes=j.axes @ R.T)
        for n, j in built.joints.items()
    }
    loads = dataclasses.replace(built.loads, gravity=R @ built.loads.gravity)
    return dataclasses.replace(built, blocks=blocks, joints=joints, loads=loads)


def renumbered(built: Scene, seed: int = 0) -> Scene:
    """The same scene with the nodes of every block in another order."""
    rng = np.random.default_rng(seed)
    new = {n: rng.permutation(len(b.points)) for n, b in built.blocks.items()}
    blocks, fixed = {}, {}
    for n, b in built.blocks.items():
        points = np.empty_like(b.points)
        points[new[n]] = b.points
        fixed[n] = np.empty_like(built.fixed[n])
        fixed[n][new[n]] = built.fixed[n]
        faces = {name: new[n][facets] for name, facets in b.faces.items()}
        blocks[n] = dataclasses.replace(b, points=points, cells=new[n][b.cells], faces=faces)
    joints = {
        n: dataclasses.replace(j, nodes=(new[j.blocks[0]][j.nodes[0]], new[j.blocks[1]][j.nodes[1]]))
        for n, j in built.joints.items()
    }
    return dataclasses.replace(
        built,
        blocks=blocks,
        fixed=fixed,
        joints=joints,
        loads=dataclasses.replace(
            built.loads,
            pressures=tuple(
                dataclasses.replace(p, facets=new[p.block][p.facets]) for p in built.loads.pressures
            ),
        ),
        probes=tuple(dataclasses.replace(p, node=new[p.block][p.node]) for p in built.probes),
    )


def swapped(built: Scene) -> Scene:
    """I and J exchanged: normal and one tangent reversed, weights as they were."""
    joints = {
        n: dataclasses.replace(
            j,
            blocks=j.blocks[::-1],
            nodes=j.nodes[::-1],
            axes=j.axes * np.array([-1.0, -1.0, 1.0])[None, :, None],
        )
        for n, j in built.joints.items()
    }
    return dataclasses.replace(built, joints=joints)


def scaled(built: Scene, factor: float) -> Scene:
    """Stiffness, mass, load and gap stiffness times a factor."""
    blocks = {
        n: dataclasses.replace(
            b, material=dataclasses.replace(b.material, E=b.material.E * factor, rho=b.material.rho * factor)
        )
        for n, b in built.blocks.items()
    }
    joints = {
        n: dataclasses.replace(j, K_n=j.K_n * factor, K_nz=j.K_nz * factor, K_s=j.K_s * factor)
        for n, j in built.joints.items()
    }
    pressures = tuple(dataclasses.replace(p, value=p.value * factor) for p in built.loads.pressures)
    loads = dataclasses.replace(built.loads, pressures=pressures)
    return dataclasses.replace(built, blocks=blocks, joints=joints, loads=loads)


def dense(system: System) -> tuple[Floats, ...]:
    """M, C, K, B as arrays."""
    return tuple(csr_matrix(part).toarray() for part in (system.M, system.C, system.K, system.B))
