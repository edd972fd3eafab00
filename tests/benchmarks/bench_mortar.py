"""Mortar joints: convergence on meshes that do not match, pairing time, and the cost of a step.

    python tests/benchmarks/bench_mortar.py [convergence] [pairing] [step] [--seconds 10]
                                            [--out results/bench_mortar.json]

The two cantilevers of configs/two_cantilevers.yaml. `convergence`: openings at both edges every 10 m against
those of hex20 of 2.5 m that match, L2 over the time and these points, with `accuracy: 0.2 %` and 60 modes;
tet10 meshed by gmsh (`pip install gmsh`) have divided edges, and faces and insides of its own choice.
`pairing`: faces of 5,000 facets on 5,000. `step`: CPU of the time loop by mortar and node to node, medians of
five, side by side, with friction and without. Prints Markdown tables; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from romdam.config.load import Job, parse_config
from romdam.config.sections.job import BoxConfig
from romdam.core.arrays import Floats
from romdam.core.scene import Material
from romdam.error.metrics import relative_l2
from romdam.geometry.boxes import box_block
from romdam.pipelines.run import Clock, build_model, silent
from romdam.pipelines.simulation import simulate_motion
from romdam.records.record_set import load_motions
from romdam.scene.mortar.gaps import mortar_gaps
from romdam.scene.mortar.interface import mortar_interface

CONFIG = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"
BOXES = {"left": ((0.0, -10.0, 0.0), (10.0, 10.0, 50.0)), "right": ((0.0, 0.0, 0.0), (10.0, 20.0, 50.0))}
AT = np.array([[x, 0.0, z] for x in (0.0, 10.0) for z in (10.0, 20.0, 30.0, 40.0, 50.0)])
LIMIT = ("hex20", 2.5), ("hex20", 2.5)
MESHES: list[tuple[tuple[str, float], tuple[str, float]]] = [
    (("hex8", 2.5), ("hex8", 2.5)),
    (("hex8", 2.5), ("hex8", 2.0)),
    (("hex20", 10.0), ("hex20", 5.0)),
    (("hex20", 5.0), ("hex20", 10.0 / 3.0)),
    (("hex20", 2.5), ("hex20", 2.0)),
    (("tet10", 5.0), ("hex20", 10.0 / 3.0)),
    (("gmsh", 10.0), ("gmsh", 5.0)),
    (("gmsh", 5.0), ("gmsh", 10.0 / 3.0)),
    (("gmsh", 10.0 / 3.0), ("gmsh", 2.5)),
]
STEP = {"frictionless": {}, "friction": {"shear_stiffness": 8e9, "friction": 0.6}}


def block(name: str, element: str, size: float, folder: Path) -> dict[str, Any]:
    """One cantilever of the configuration, a box or a mesh of tetrahedra."""
    origin, edges = BOXES[name]
    if element != "gmsh":
        box = {"origin": origin, "size": edges, "element_size": size, "element": element}
        return {"material": "concrete", "box": box}
    return {"material": "concrete", "mesh": {"file": str(unstructured(name, size, folder)), "group": name}}


def unstructured(name: str, size: float, folder: Path) -> Path:
    """Mesh a cantilever in tet10 by gmsh, its edges divided evenly."""
    import gmsh

    origin, edges = BOXES[name]
    path = folder / f"{name}_{size:.3g}.msh"
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    volume = gmsh.model.occ.addBox(*origin, *edges)
    gmsh.model.occ.synchronize()
    for _, curve in gmsh.model.getEntities(1):
        low = np.array(gmsh.model.getBoundingBox(1, curve))
        length = float(np.max(low[3:] - low[:3]))
        gmsh.model.mesh.setTransfiniteCurve(curve, round(length / size) + 1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.addPhysicalGroup(3, [volume], name=name)
    for _, face in gmsh.model.getEntities(2):
        box = np.array(gmsh.model.getBoundingBox(2, face))
        axis = int(np.argmin(box[3:] - box[:3]))
        end = "min" if abs(box[axis] - origin[axis]) < 1e-3 else "max"
        gmsh.model.addPhysicalGroup(2, [face], name=f"{name}_{'xyz'[axis]}{end}")
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.write(str(path))
    gmsh.finalize()
    return path


def job(
    meshes: tuple[tuple[str, float], tuple[str, float]], folder: Path, seconds: float, **joint: Any
) -> Job:
    """The configuration on other meshes, without figures."""
    raw = yaml.safe_load(CONFIG.read_text())
    for name, (element, size) in zip(BOXES, meshes, strict=True):
        raw["blocks"][name] = block(name, element, size, folder)
        if element == "gmsh":
            for entry in (*raw["supports"], *raw["loads"]["pressure"]):
                entry["face"] = f"{name}_{entry['face']}" if entry["block"] == name else entry["face"]
    raw["joints"]["contraction"] |= joint
    raw["transient"] = {"accuracy": "0.2 %", "duration": seconds}
    raw["outputs"] = {"plots": False, "output_interval": 0.01}
    return Job(parse_config(raw, CONFIG.name), CONFIG)


def openings(one: Job) -> tuple[Floats, dict[str, Any]]:
    """(nt, points) openings at AT, and numbers of the run."""
    start = time.process_time()
    model = build_model(one, Clock(silent))
    motion = load_motions(one.config.records, one.folder)[0]
    history = simulate_motion(one, model.prepared, motion, one.config.transient.duration)
    position = model.scene.gap_position
    nearest = [int(np.linalg.norm(position - x, axis=1).argmin()) for x in AT]
    assert np.linalg.norm(position[nearest] - AT, axis=1).max() < 1e-6
    numbers = {
        "unknowns": sum(3 * len(each.points) for each in model.scene.blocks.values()),
        "gaps": len(position),
        "peak": float(history.peaks["opening"].max()),
        "loop": history.stats["loop_cpu_seconds"],
        "cpu": time.process_time() - start,
    }
    return history.jump[:, nearest, 0], numbers


def convergence(seconds: float, folder: Path) -> list[dict[str, Any]]:
    """Openings of every pair of meshes against those of the finest that match."""
    limit, own = openings(job(LIMIT, folder, seconds, discretization="node_to_node"))
    rows: list[dict[str, Any]] = [
        {"left": LIMIT[0], "right": LIMIT[1], "joint": "node to node", "l2": 0.0} | own
    ]
    for meshes in [LIMIT, *MESHES]:
        values, own = openings(job(meshes, folder, seconds, discretization="mortar"))
        rows.append(
            {"left": meshes[0], "right": meshes[1], "joint": "mortar", "l2": relative_l2(values, limit)} | own
        )
    for row in rows:
        row["off"] = row["peak"] / rows[0]["peak"] - 1.0
    return rows


def pairing() -> list[dict[str, Any]]:
    """CPU of finding and integrating the segments of large faces."""
    concrete, rows = Material(30e9, 0.18, 2440.0), []
    for element, m, n in (("hex8", 71, 75), ("hex20", 71, 75), ("tet4", 50, 51), ("tet10", 50, 51)):
        blocks = [
            box_block(
                name,
                BoxConfig.model_validate(
                    {
                        "origin": (0.0, y, 0.0),
                        "size": (60.0, 10.0, 60.0),
                        "element_size": (60.0 / k, 10.0, 60.0 / k),
                        "element": element,
                    }
                ),
                concrete,
                "",
            )
            for name, y, k in (("left", 0.0, m), ("right", 10.0, n))
        ]
        start = time.process_time()
        interface = mortar_interface(blocks[0], blocks[1], 1e-3, 0.5, "")
        gaps = mortar_gaps(interface)
        cpu = time.process_time() - start
        rows.append(
            {
                "element": element,
                "facets": [len(interface.slave.facets), len(interface.master.facets)],
                "segments": len(interface.segments.area),
                "gaps": len(gaps.area),
                "cpu": cpu,
            }
        )
    return rows


def step(seconds: float, folder: Path) -> list[dict[str, Any]]:
    """CPU of the loop, hex20 of 2.5 m at the same gaps and steps: corners node to node, and mortar."""
    rows = []
    for name, law in STEP.items():
        times: dict[str, list[float]] = {"mortar": [], "node_to_node": []}
        for _ in range(5):
            for kind, seen in times.items():
                own = {"gaps": "corners"} if kind == "node_to_node" else {}
                one = job(
                    (("hex20", 2.5), ("hex20", 2.5)), folder, seconds, discretization=kind, **own, **law
                )
                raw = one.config.model_copy(
                    update={"transient": one.config.transient.model_copy(
                        update={"accuracy": None, "finest_step": 1.25e-3})}
                )  # fmt: skip
                seen.append(openings(Job(raw, CONFIG))[1]["loop"])
        mortar, node = (statistics.median(times[kind]) for kind in times)
        rows.append({"law": name, "mortar": mortar, "node_to_node": node, "ratio": mortar / node})
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Rows as Markdown."""

    def text(value: object) -> str:
        if isinstance(value, tuple):
            return f"{value[0]} {value[1]:.3g} m"
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    lines = ["| " + " | ".join(rows[0]) + " |", "|" + "---|" * len(rows[0])]
    return "\n".join([*lines, *("| " + " | ".join(text(v) for v in row.values()) + " |" for row in rows)])


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", nargs="*", default=["convergence", "pairing", "step"])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--out", type=Path, default=Path("results/bench_mortar.json"))
    asked, found = parser.parse_args(), {}
    with tempfile.TemporaryDirectory() as name:
        for what in asked.what:
            if what == "pairing":
                found[what] = pairing()
            else:
                found[what] = {"convergence": convergence, "step": step}[what](asked.seconds, Path(name))
            print(f"\n{what}\n\n{table(found[what])}", flush=True)
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
