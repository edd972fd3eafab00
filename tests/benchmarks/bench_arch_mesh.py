"""Do crest displacement, joint opening and stress of the arch dam settle as its mesh is refined?

    python tests/benchmarks/bench_arch_mesh.py [--meshes coarse middle fine] [--seconds 10]
                                               [--out results/bench_arch_mesh.json]

configs/arch_dam.yaml on three meshes with all else alike; `fine` is the one of the file. Gaps stand at the
corners of the joints' facets, so there are more of them on a finer mesh, each for a smaller area; opening is
therefore taken between the two nodes of the crest's upstream edge at every joint, which all meshes have, and
stress in the middle of the crown's upstream face, away from the re-entrant corners where it has no limit.
Prints a Markdown table; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.scene import Probe, Scene
from romdam.fem.parts import unknowns
from romdam.geometry.elements import Floats
from romdam.pipelines.simulation import prepare, simulate_motion
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.records.record_set import load_motions
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

CONFIG = Path(__file__).parents[2] / "configs" / "arch_dam.yaml"
MESHES: dict[str, dict[str, float]] = {
    "coarse": {"along": 1, "through": 1, "up": 4, "rock": 2, "upstream": 2, "downstream": 2, "growth": 2.0},
    "middle": {"along": 2, "through": 1, "up": 6, "rock": 4, "upstream": 3, "downstream": 3, "growth": 1.7},
    "fine": {},
}
MIDDLE = {"block": "C4", "at": [0.0, -7.8, 50.0], "tolerance": 3.0}
COLUMNS = {
    "unknowns": "unknowns",
    "gaps": "gaps",
    "first_frequency": "first frequency, joints open [Hz]",
    "crest": "crest displacement, downstream [mm]",
    "opening": "peak opening at the crest [mm]",
    "opening_joints": "mean of the seven joints [mm]",
    "compression": "vertical compression, crown [MPa]",
    "cpu_seconds": "CPU [s]",
}


def job(mesh: str) -> Job:
    """The job of the file on another mesh, without stress fields."""
    raw = yaml.safe_load(CONFIG.read_text())
    raw["arch_dam"]["divisions"] |= MESHES[mesh]
    raw["outputs"]["stress"] = {"nodes": {"middle": MIDDLE}}
    return Job(parse_config(raw, CONFIG.name), CONFIG)


def at_the_crest(scene: Scene) -> tuple[tuple[Probe, ...], Floats]:
    """Nodes on both sides of every joint at the crest's upstream edge, (2 joints), and the normals there."""
    probes, normals = [], []
    for name, joint in scene.joints.items():
        top = np.lexsort((joint.position[:, 1], -joint.position[:, 2]))[0]
        for block in joint.blocks:
            points = scene.blocks[block].points
            node = int(np.linalg.norm(points - joint.position[top], axis=1).argmin())
            assert np.linalg.norm(points[node] - joint.position[top]) < 1e-6
            probes.append(Probe(f"{name}.{block}", block, node))
        normals.append(joint.axes[top, 0])
    return tuple(probes), np.array(normals)


def measure(mesh: str, seconds: float) -> dict[str, float]:
    """What the table says of one mesh."""
    start, asked = time.process_time(), job(mesh)
    motion = load_motions(asked.config.records, asked.folder)[0]
    scene = build_scene(asked.config, asked.folder, str(asked.path))
    crest, normals = at_the_crest(scene)
    scene = replace(scene, probes=(*scene.probes, *crest))
    model = reduce_scene(scene, asked.config.model, asked.config.damping)
    history = simulate_motion(asked, prepare(asked, model.system), motion, seconds)
    history, stress = stress_of(scene, stress_fields(scene, model), history)
    assert stress is not None
    crown, *sides = np.moveaxis(history.disp.reshape(len(history.time), -1, 3), 1, 0)
    opening = [float(((J - I) @ n).max()) for I, J, n in zip(sides[::2], sides[1::2], normals, strict=True)]
    return {
        "unknowns": sum(int(free.sum()) for free in unknowns(scene).free.values()),
        "gaps": len(model.system.law),
        "first_frequency": float(np.sqrt(model.system.K.diagonal().min()) / 2.0 / np.pi),
        "crest": 1e3 * float(crown[:, 1].max()),
        "opening": 1e3 * max(opening),
        "opening_joints": 1e3 * float(np.mean(opening)),
        "compression": -1e-6 * float(stress.probes[:, 0, 2].min()),
        "cpu_seconds": time.process_time() - start,
    }


def table(rows: dict[str, dict[str, float]]) -> str:
    """Rows as Markdown."""
    lines = ["| mesh | " + " | ".join(COLUMNS.values()) + " |", "|---" * (1 + len(COLUMNS)) + "|"]
    for mesh, row in rows.items():
        values = [f"{row[key]:,.0f}" if row[key] > 1000 else f"{row[key]:.3g}" for key in COLUMNS]
        lines.append(f"| {mesh} | " + " | ".join(values) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--meshes", nargs="+", choices=list(MESHES), default=list(MESHES))
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    rows = {mesh: measure(mesh, asked.seconds) for mesh in asked.meshes}
    print(table(rows))
    if asked.out is not None:
        asked.out.parent.mkdir(parents=True, exist_ok=True)
        asked.out.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
