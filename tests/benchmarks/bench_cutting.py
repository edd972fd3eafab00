"""How long does it take to cut a dam, and what becomes of its elements? And a picture of the blocks.

    python tests/benchmarks/bench_cutting.py [--meshes coarse fine] [--out results/bench_cutting.json]

The dam of configs/arch_dam.yaml without its ground, as one mesh of curved tet10 in a .vtu file, is cut
through its elements by five radial planes that no mesh line follows. Prints a Markdown table, and writes
beside its JSON the mesh, the job and, where pyvista is installed, a picture of the blocks. Nothing passes or
fails.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import yaml

from romdam.config import parse_config
from romdam.core.errors import ResultError
from romdam.core.scene import Block, Scene
from romdam.geometry.cutting.pieces import cut_block
from romdam.geometry.cutting.shapes import quality
from romdam.scene.build import build_scene
from romdam.scene.ties import scene_parts

CONFIG = Path(__file__).parents[2] / "configs" / "arch_dam.yaml"
MESHES = {"coarse": {"along": 2, "through": 2, "up": 8}, "fine": {"along": 8, "through": 4, "up": 34}}
DEGREES = (-31.0, -14.5, 2.0, 16.0, 32.3)
FACES = ("upstream", "downstream", "crest", "contact")
AXIS_Y = 123.0  # of the arcs' common axis [m]


def monolith(divisions: dict[str, int]) -> tuple[Block, Any]:
    """The dam as one block, and the job it was made from."""
    raw: dict[str, Any] = yaml.safe_load(CONFIG.read_text())
    dam = {key: value for key, value in raw["arch_dam"].items() if key not in ("rock", "perimeter")}
    keys = {key: raw[key] for key in ("materials", "records", "model", "transient")}
    job = keys | {"arch_dam": dam | {"joints": "tied", "element": "tet10", "divisions": divisions}}
    scene = build_scene(parse_config(job, "dam.yaml"), CONFIG.parent, "dam.yaml")
    (part,) = scene_parts(scene).values()
    rows = {
        label: np.vstack([part.number[name][block.faces[label]] for name, block in scene.blocks.items()])
        for label in FACES
    }
    whole = part.mesh(scene.blocks)
    return Block("dam", whole.element, whole.points, whole.cells, whole.material, rows), keys


def written(block: Block, folder: Path) -> None:
    """The block as dam.vtu: its cells are group 0, its faces 1 to 4."""
    cells = [("tetra10", block.cells), *(("triangle6", rows) for rows in block.faces.values())]
    groups = [np.full(len(rows), k) for k, (_, rows) in enumerate(cells)]
    meshio.Mesh(block.points, cells, cell_data={"group": groups}).write(folder / "dam.vtu")


def job(keys: dict[str, Any]) -> dict[str, Any]:
    """Six blocks between friction joints, out of the file."""
    turns = [(float(np.cos(t)), float(np.sin(t)), 0.0) for t in np.radians(DEGREES)]
    along = [{"plane": {"point": [0.0, AXIS_Y, 0.0], "normal": list(turn)}} for turn in turns]
    names = [f"M{k + 1}" for k in range(len(DEGREES) + 1)]
    law = {"normal_stiffness": "24 GPa/m", "shear_stiffness": "12 GPa/m", "friction": 0.6}
    return keys | {
        "title": "An arch dam, one mesh of tet10, cut through its elements",
        "blocks": {"dam": {"material": "concrete", "mesh": {"file": "dam.vtu", "group": 0}}},
        "cut": {"dam": {"along": along, "into": names, "through": "elements", "joints": law}},
        "supports": [{"block": name, "face": "4"} for name in names],
    }


def main() -> None:
    """Measure, and draw the coarse one."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--meshes", nargs="+", choices=MESHES, default=list(MESHES))
    parser.add_argument("--out", type=Path, default=Path("results/bench_cutting.json"))
    arguments = parser.parse_args()
    folder = arguments.out.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    print(
        "| mesh | tet10 before | after | least quality before | after | CPU [s] |\n|---|---|---|---|---|---|"
    )
    for name in arguments.meshes:
        block, keys = monolith(MESHES[name])
        config = parse_config(job(keys), "cut.yaml")
        start = time.process_time()
        pieces = cut_block(block, {"dam": config.cut["dam"]}, folder, "cut.yaml")
        seconds = time.process_time() - start
        least = [
            float(min(quality(b.points, b.cells[:, :4]).min() for b in own))
            for own in ([block], pieces.values())
        ]
        after = sum(len(piece.cells) for piece in pieces.values())
        print(f"| {name} | {len(block.cells)} | {after} | {least[0]:.3f} | {least[1]:.3f} | {seconds:.1f} |")
        rows.append(
            {"mesh": name, "cells": len(block.cells), "after": after, "quality": least, "cpu": seconds}
        )
        if name == arguments.meshes[0]:
            drawn(block, keys, folder)
    arguments.out.write_text(json.dumps(rows, indent=2))


def drawn(block: Block, keys: dict[str, Any], folder: Path) -> None:
    """Write mesh and job, build the scene from them as any user would, and draw it."""
    written(block, folder)
    (folder / "cut.yaml").write_text(
        yaml.safe_dump(job(keys), sort_keys=False).replace("../data", str(CONFIG.parents[1] / "data"))
    )
    scene: Scene = build_scene(parse_config(job(keys), "cut.yaml"), folder, "cut.yaml")
    try:
        from romdam.visual.scene_view import draw_scene

        print(f"\nwritten: {draw_scene(scene, folder / 'cut.png', 'Cut through its elements')}")
    except (ImportError, ResultError) as error:
        print(f"\nno picture: {error}")


if __name__ == "__main__":
    main()
