"""An arch dam whose cantilevers gmsh meshed one by one, on rock meshed apart, beside the structured one.

    python tests/benchmarks/bench_arch_apart.py [--seconds 10] [--size 7] [--out results/bench_arch_apart]

The dam of configs/arch_dam.yaml without perimeter, on one rock. Apart, every cantilever is tet10 that gmsh
chose in a box and that is mapped onto the dam's shape, and the rock comes from the generator with three
elements along and through each cantilever in place of two: no node of one block is a node of another; joints
and ties are mortar. Writes meshes, both configurations and, by `romdam.run`, results with figures; prints a
Markdown table. Needs `pip install gmsh`; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import yaml

import romdam
from romdam.config import parse_config
from romdam.core.scene import Material
from romdam.error.metrics import relative_l2
from romdam.geometry.arch_dam.generator import arch_dam
from romdam.geometry.arch_dam.shape import ArchShape

CONFIG = Path(__file__).parents[2] / "configs" / "arch_dam.yaml"
MESH = {"along": 2, "through": 2, "up": 8, "rock": 6, "upstream": 4, "downstream": 4, "growth": 1.5}
ROCK = {"material": "fair_rock", "mass": False}
SIDES = (("x", -260.0), ("x", 260.0), ("y", -160.0), ("y", 220.0))
FACES = {
    "u0": "right_side",
    "u1": "left_side",
    "v0": "upstream",
    "v1": "downstream",
    "w0": "foot",
    "w1": "crest",
}


def structured(seconds: float, through: int) -> dict[str, Any]:
    """The configuration of the generator's mesh, with so many elements through the dam."""
    raw = yaml.safe_load(CONFIG.read_text())
    raw["title"] = "Arch dam, one mesh"
    dam = raw["arch_dam"]
    del dam["perimeter"], dam["divisions"]["perimeter"], dam["joints"]["gaps"]
    dam["rock"]["zones"] = {"all": ROCK}
    dam["element"] = "tet10"
    dam["divisions"] |= MESH | {"up": 10, "through": through}
    raw["loads"].pop("temperature")
    raw["outputs"].pop("stress")
    for entry in raw["records"][0]["components"].values():
        entry["file"] = str((CONFIG.parent / entry["file"]).resolve())
    raw["water"]["model"] = "westergaard"  # the figures in the manual are of it
    raw["model"] = {"order": "reduced", "cutoff": 25.0}
    raw["transient"] = {"finest_step": 0.0025, "duration": seconds}
    return raw


def apart(raw: dict[str, Any], size: float, folder: Path) -> dict[str, Any]:
    """The same dam of blocks that were meshed one by one."""
    config = parse_config(raw, CONFIG.name).arch_dam
    assert config is not None
    shape, names = ArchShape(config, "dam"), list(config.cantilever_names)
    for k, name in enumerate(names):
        cantilever(shape, k, size, folder / f"{name}.msh")
    rock(raw, folder / "rock.msh")
    blocks = {
        name: {"material": "concrete", "mesh": {"file": f"{name}.msh", "group": name}} for name in names
    }
    laws = raw["arch_dam"]["joints"]
    pairs = list(pairwise(names))
    return {
        **{key: value for key, value in raw.items() if key != "arch_dam"},
        "title": "Arch dam, blocks meshed apart",
        "blocks": blocks | {"rock": ROCK | {"mesh": {"file": "rock.msh", "group": "rock"}, "weight": False}},
        "supports": [
            {"block": "rock", "face": {"axis": "z", "at": -120.0, "tolerance": 1e-3}},
            *(
                {"block": "rock", "face": {"axis": axis, "at": at, "tolerance": 1e-3}, "fix": [axis]}
                for axis, at in SIDES
            ),
        ],
        "ties": {f"{name}-rock": {"between": [name, "rock"]} for name in names},
        "joints": {f"J{k + 1}": {"between": list(pair)} | laws for k, pair in enumerate(pairs)},
    }


def cantilever(shape: ArchShape, k: int, size: float, path: Path) -> None:
    """Mesh one cantilever: a box of about its size by gmsh, its nodes mapped onto the dam."""
    import gmsh

    config = shape.config
    joints = np.linspace(-shape.end, shape.end, config.cantilevers + 1)
    feet = shape.foot(joints)[k : k + 2]
    at = shape.point(joints[k : k + 2], np.array(0.5), np.full(2, config.crest))
    edges = float(np.linalg.norm(at[1] - at[0])), 12.0, float(config.crest - feet.mean())
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.RandomSeed", k + 1)
    volume = gmsh.model.occ.addBox(0.0, 0.0, 0.0, *edges)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [volume], name=f"C{k + 1}")
    for _, face in gmsh.model.getEntities(2):
        box = np.array(gmsh.model.getBoundingBox(2, face))
        axis = int(np.argmin(box[3:] - box[:3]))
        end = int(box[axis] > 0.5 * edges[axis])
        gmsh.model.addPhysicalGroup(2, [face], name=FACES["uvw"[axis] + str(end)])
    gmsh.option.setNumber("Mesh.MeshSizeMax", size * (1.0 + 0.03 * k))  # no two blocks alike
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    tags, flat, _ = gmsh.model.mesh.getNodes()
    u, v, w = (np.asarray(flat).reshape(-1, 3) / edges).T
    foot = feet[0] + u * (feet[1] - feet[0])
    z = foot + w * (config.crest - foot)
    points = shape.point(joints[k] + u * (joints[k + 1] - joints[k]), v, z)
    for tag, point in zip(tags, points, strict=True):
        gmsh.model.mesh.setNode(int(tag), point, [])
    gmsh.write(str(path))
    gmsh.finalize()


def rock(raw: dict[str, Any], path: Path) -> None:
    """Write the rock of the generator, with other divisions than the dam's."""
    finer = raw["arch_dam"] | {"divisions": raw["arch_dam"]["divisions"] | {"along": 3, "through": 3}}
    config = parse_config(raw | {"arch_dam": finer}, CONFIG.name)
    assert config.arch_dam is not None
    materials = {name: Material(m.E, m.nu, m.rho) for name, m in config.materials.items()}
    block = next(
        each
        for name, each in arch_dam(config.arch_dam, materials, "dam", absorbs=False).blocks.items()
        if "rock" in name
    )
    mesh = meshio.Mesh(
        block.points,
        [("tetra10", block.cells)],
        cell_data={
            key: [np.ones(len(block.cells), dtype=int)] for key in ("gmsh:physical", "gmsh:geometrical")
        },
        field_data={"rock": np.array([1, 3])},
    )
    meshio.write(path, mesh, file_format="gmsh22", binary=False)


def main() -> None:
    """Run both and compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--size", type=float, default=7.0)
    parser.add_argument("--out", type=Path, default=Path("results/bench_arch_apart"))
    asked = parser.parse_args()
    print("| | unknowns | gaps | joint area m2 | crest mm | peak openings J1 to J7 mm | L2 | CPU s |")
    print("|---|---|---|---|---|---|---|---|")
    coarse, fine = structured(asked.seconds, 2), structured(asked.seconds, 4)
    cases: dict[str, Callable[[Path], dict[str, Any]]] = {
        "structured, 4 through": lambda folder: fine,
        "structured, 2 through": lambda folder: coarse,
        f"apart, {asked.size:g} m": lambda folder: apart(coarse, asked.size, folder),
    }
    against = None
    for name, make in cases.items():
        folder = asked.out / name.replace(", ", "_").replace(" ", "_")
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "dam.yaml").write_text(yaml.safe_dump(make(folder), sort_keys=False))
        row, openings = measured(folder)
        against = openings if against is None else against
        off = 100.0 * relative_l2(openings, against)
        print(f"| {name} | {row[0]} | {off:.0f} % | {row[1]:.0f} |", flush=True)


def measured(folder: Path) -> tuple[tuple[str, float], np.ndarray[Any, Any]]:
    """Run a folder's configuration: a row of the table, and the joints' widest openings (nt, joints)."""
    start = time.process_time()
    (path,) = romdam.run(romdam.load_config(folder / "dam.yaml"), folder).paths
    cpu = time.process_time() - start
    data = romdam.open_result(path).dataset
    widest = [
        data.opening.values[:, data.gap_joint.values == joint].max(axis=1) for joint in data.joint.values
    ]
    crest = float(np.abs(data.displacement.isel(node=0)).max()) * 1e3
    peaks = " ".join(f"{peak * 1e3:.1f}" for peak in data.peak_opening.values)
    area = float(data.gap_area.sum())
    row = f"{data.attrs['unknowns']} | {data.sizes['gap']} | {area:.3f} | {crest:.1f} | {peaks}"
    return (row, cpu), np.stack(widest, axis=1)


if __name__ == "__main__":
    main()
