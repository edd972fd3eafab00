"""An arch dam of eight cantilevers on rock, up to a million unknowns: from mesh to stored model, and back.

    python tests/benchmarks/bench_large_dam.py OUT [--mesh small middle million] [--solver auto]
                                               [--memory 12e9]

configs/arch_dam.yaml in tet10 without its water (modes below 50 Hz, gaps at the corners of facets) on three
meshes. Every case is a process of its own, and so is the second one, which finds the model in the store and
makes ready to march; seconds and peak resident memory are the operating system's. Writes
OUT/bench_large_dam.json.
"""

from __future__ import annotations

import argparse
import json
import logging
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import yaml

CONFIG = Path(__file__).parents[2] / "configs" / "arch_dam.yaml"
MESHES: dict[str, dict[str, float]] = {
    "small": {"along": 2, "through": 2, "up": 8, "rock": 6, "upstream": 4, "downstream": 4, "growth": 1.5},
    "middle": {"along": 4, "through": 2, "up": 8, "rock": 12, "upstream": 8, "downstream": 8, "growth": 1.22},
    "million": {
        "along": 8,
        "through": 2,
        "up": 8,
        "rock": 15,
        "upstream": 14,
        "downstream": 15,
        "growth": 1.13,
    },
}


def one(mesh: str, solver: str, memory: float, folder: Path) -> dict[str, object]:
    """Build the scene and reduce it into the store of this mesh, or find it there."""
    logging.basicConfig(level=logging.INFO, format="%(relativeCreated)8d ms  %(message)s")
    start, cpu = time.perf_counter(), time.process_time()
    from romdam.config import parse_config
    from romdam.reduction.storage.model_file import BlockStore
    from romdam.reduction.synthesis import reduce_scene
    from romdam.scene.build import build_scene

    raw = yaml.safe_load(CONFIG.read_text())
    raw["arch_dam"]["divisions"] |= MESHES[mesh]
    raw["arch_dam"]["element"] = "tet10"
    del raw["water"]  # it is put on the stored model afterwards
    raw["model"] |= {"solver": solver, "memory": f"{memory / 1e9:g} GB"}
    config = parse_config(raw, CONFIG.name)
    scene = build_scene(config, CONFIG.parent, CONFIG.name)
    meshed, mesh_cpu = time.perf_counter(), time.process_time()
    store = BlockStore(folder / mesh)
    model = reduce_scene(scene, config.model, config.damping, store)
    system, report = model.system, next(iter(model.report.values()))
    assert isinstance(report, dict)
    return {
        "mesh": mesh, "unknowns": 3 * sum(len(b.points) for b in scene.blocks.values()),
        "gaps": sum(len(j.area) for j in scene.joints.values()), "size": system.size,
        "modes": report["fixed_interface_modes"], "residual": report["eigenvalue_residual"],
        "first_hz": float(np.sqrt(system.K.diagonal()[0]) / (2.0 * np.pi)),
        "mesh_s": meshed - start, "model_s": time.perf_counter() - meshed,
        "cpu_s": time.process_time() - cpu, "model_cpu_s": time.process_time() - mesh_cpu,
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        "store_gb": sum(path.stat().st_size for path in store.folder.glob("block-*")) / 1e9,
    }  # fmt: skip


def in_a_process(given: argparse.Namespace, mesh: str) -> dict[str, object]:
    command = [sys.executable, __file__, str(given.out), "--one", mesh, "--solver", given.solver]
    done = subprocess.run(
        [*command, "--memory", str(given.memory)], stdout=subprocess.PIPE, text=True, check=True
    )
    found: dict[str, object] = json.loads(done.stdout.splitlines()[-1])
    print(json.dumps(found, indent=1), flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--mesh", nargs="+", choices=MESHES, default=list(MESHES))
    parser.add_argument("--one", choices=MESHES, help="this mesh, in this process")
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--memory", type=float, default=12e9, help="bytes")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if given.one:
        print(json.dumps(one(given.one, given.solver, given.memory, given.out)))
        return
    rows = [{"made": in_a_process(given, mesh), "found": in_a_process(given, mesh)} for mesh in given.mesh]
    (given.out / "bench_large_dam.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
