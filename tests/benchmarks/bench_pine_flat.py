"""Pine Flat on rock with mass: first period and amplification of the crest, and a run of a record.

    python tests/benchmarks/bench_pine_flat.py [--out results/bench_pine_flat.json]

The tallest monolith in plane stress, 6 x 16 hex20, on rock in plane strain with the modulus of the concrete
(22.41 GPa, Poisson's ratio 1/3, 2643 kg/m3), viscous at its bottom and its ends, reservoir full to 381 of 400
ft. Harmonic: the largest crest acceleration over that of the free ground along the river, and its period,
with hysteretic damping of loss factor 0.1 in concrete and rock. In time: the record of
configs/two_cantilevers.yaml along the river and, at two thirds, up, in a free field, Rayleigh damping of 5 %
at 2 and 12 Hz, full order and reduced, with the energy that ends in the dashpots of rock and water.
Prints Markdown tables and writes JSON; nothing here passes or fails.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

sys.path.insert(0, str(Path(__file__).parents[1]))

from gravity_sections import FOOT, PINE_FLAT
from reservoir_meshes import box as mesh_box
from reservoir_meshes import written
from simulating import simulated

from romdam.benchmarks.frequency_response import inputs
from romdam.config import parse_config
from romdam.config.job import Config
from romdam.core.scene import Scene
from romdam.core.system import System
from romdam.effects.full_order import assemble_full
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene

RECORD = Path(__file__).parents[2] / "data" / "records" / "northridge_mul009_g_dt0.01.txt"
LEVEL, TOP, THICK = 381 * FOOT, 400 * FOOT, 4.0
LOSS = 0.1  # of concrete and rock
STEP, SECONDS = 0.005, 6.0


def dam_points(points: np.ndarray) -> np.ndarray:
    """Points of a box 40 m thick as those of the monolith."""
    x, y, z = points.T
    heights = PINE_FLAT.heights
    up, down = (np.interp(z, heights, side) for side in (PINE_FLAT.upstream, PINE_FLAT.downstream))
    return np.stack([x, up + y / 40.0 * (down - up), z], axis=1)


def monolith(
    folder: Path,
    rock: dict[str, Any] | None,
    water: dict[str, Any] | None,
    ground: str = "uniform",
    margin: float = 240.0,
    edge: float = 24.0,
) -> tuple[Scene, Config]:
    """The slice; on a rigid base where `rock` is None.

    Parameters
    ----------
    rock : keys of its block, such as `mass: false` on a fixed boundary
    water : keys of `water` but its level and faces
    margin : rock below and behind the dam [m]
    """
    mesh = mesh_box([0, 0, 0], [THICK, 40, TOP], [THICK, 40 / 6, TOP / 16], "hex20", dam_points)
    file = written(folder / "dam.msh", mesh, "ymin", "zmin")
    concrete = PINE_FLAT.material
    raw: dict[str, Any] = {
        "materials": {
            "concrete": {"E": concrete.E, "nu": concrete.nu, "rho": concrete.rho},
            "rock": {"E": concrete.E, "nu": 1.0 / 3.0, "rho": 2643.0},
        },
        "blocks": {"dam": {"material": "concrete", "mesh": {"file": file, "group": "all"}}},
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "damping": {"rayleigh": {"alpha": 0.0, "beta": 0.0}},
        "model": {"modes": 60},
        "transient": {"finest_step": STEP},
        "outputs": {"nodes": {"crest": {"block": "dam", "at": [2, float(PINE_FLAT.upstream[-1]), TOP]}}},
    }
    if rock is None:
        raw["supports"] = [{"block": "dam", "face": "zmin"}]
    else:
        upstream = edge * np.ceil(3.0 * LEVEL / edge)
        long = upstream + edge * np.ceil((96.0 + margin) / edge)
        origin = [0, -float(upstream), -margin]
        box = {"origin": origin, "size": [THICK, float(long), margin], "element": "hex20"}
        box["element_size"] = [THICK, edge, edge]
        raw["blocks"]["rock"] = {"material": "rock", "box": box} | rock
        raw["ties"] = {"foot": {"between": ["dam", "rock"], "discretization": "mortar"}}
        raw["supports"] = [{"block": "rock", "face": face, "fix": ["x"]} for face in ("xmin", "xmax")]
        if rock.get("mass", True):
            raw["ground"] = {
                "input": ground, "viscous": [{"block": "rock", "faces": ["zmin", "ymin", "ymax"]}]
            }  # fmt: skip
        else:
            raw["supports"] += [{"block": "rock", "face": face} for face in ("zmin", "ymin", "ymax")]
    if water is not None:
        raw["water"] = {"level": LEVEL, "faces": [{"block": "dam", "face": "ymin"}]} | water
    config = parse_config(raw, "pine_flat.yaml")
    scene = build_scene(config, folder, "pine_flat.yaml")
    held = scene.fixed["dam"].copy()
    held[:, 0] |= scene.blocks["dam"].points[:, 0] == THICK / 2.0  # plane stress: free to widen
    return replace(scene, fixed=scene.fixed | {"dam": held}), config


def amplification(system: System, omega: float) -> float:
    """Crest acceleration over that of the ground, along the river, of solids with the loss factor."""
    K = system.K.tocoo()
    solid = K.row < system.solids
    factors = np.where(solid, 1.0 + 1j * LOSS, 1.0)
    A = csc_matrix((factors * K.data, (K.row, K.col)), shape=K.shape) - omega**2 * system.M
    u = splu(csc_matrix(A + 1j * omega * system.C)).solve(-np.asarray(system.load @ inputs(system, omega, 1)))
    return float(abs(1.0 - omega**2 * (system.observe @ u)[1]))


def first_peak(system: System) -> tuple[float, float]:
    """Period [s] and size of the first peak, on 0.2 % steps of the period."""
    periods = 0.8 * 1.01 ** -np.arange(140)
    sizes: list[float] = []
    for period in periods:  # from long periods on
        sizes.append(amplification(system, 2.0 * np.pi / period))
        if len(sizes) > 2 and sizes[-1] < sizes[-2] and sizes[-2] > 2.0:
            break
    at = periods[len(sizes) - 2]
    fine = at * np.linspace(0.99, 1.01, 11)
    values = [amplification(system, 2.0 * np.pi / period) for period in fine]
    best = int(np.argmax(values))
    return float(fine[best]), values[best]


MASSLESS, MASSED = {"mass": False}, {"weight": False}
ON_ROCK = [{"block": "rock", "face": "zmax"}]
STILL = {"model": "compressible"}
MOVING = STILL | {"rock": ON_ROCK}
CASES: dict[str, tuple[dict[str, Any] | None, dict[str, Any] | None]] = {
    "rigid base, empty": (None, None),
    "rigid base, full": (None, STILL),
    "rock without mass, empty": (MASSLESS, None),
    "rock without mass, full": (MASSLESS, STILL),
    "rock with mass, empty": (MASSED, None),
    "rock with mass, full, floor as the record": (MASSED, STILL),
    "rock with mass, full, floor on the rock": (MASSED, MOVING),
    "the same, sediments of 0.5": (MASSED, MOVING | {"bottom_reflection": 0.5}),
}


def ground() -> np.ndarray:
    """The record along y and, at two thirds, up, (3, nt) [m/s2]."""
    acc = 9.81 * np.loadtxt(RECORD).ravel()
    t = np.arange(0.0, SECONDS, STEP)
    along = np.interp(t, 0.01 * np.arange(len(acc)), acc)
    return np.stack([0.0 * along, along, np.interp(t, 0.01 * np.arange(len(acc)) + 0.3, acc) / 1.5])


def runs(folder: Path) -> dict[str, Any]:
    """The record in a free field, full order and reduced."""
    found: dict[str, Any] = {}
    for name, water in (("floor as the record", STILL), ("floor on the rock", MOVING)):
        scene, config = monolith(folder, MASSED, water | {"cutoff": 25.0}, "free_field")
        damping = parse_damping(config)
        start = time.process_time()
        full = simulated(assemble_full(scene, damping), ground(), STEP, integrator="generalized_alpha")
        cpu = time.process_time() - start
        for modes in (0, 60, 120):
            history = full
            if modes:
                start = time.process_time()
                system = reduce_scene(scene, ModeChoice(count=modes), damping).system
                history = simulated(system, ground(), STEP, integrator="generalized_alpha")
                cpu = time.process_time() - start
            change = np.linalg.norm(history.disp - full.disp) / np.linalg.norm(full.disp)
            energy = {key: float(values[-1]) for key, values in history.energy.items()}
            found[f"{name}, {modes or 'full order'}"] = one = {
                "crest_mm": 1e3 * float(np.abs(history.disp[:, 1]).max()),
                "from_full_order": float(change),
                "ledger": history.stats["ledger_imbalance"],
                "damped_share": energy["damping"] / energy["input"],
                "cpu_seconds": cpu,
            }
            print(
                f"| {name} | {modes or 'full order'} | {one['crest_mm']:.1f} | {100 * change:.2f} "
                f"| {one['ledger']:.1e} | {cpu:.1f} |",
                flush=True,
            )
    return found


def parse_damping(config: Config) -> Any:
    """5 % at 2 and 12 Hz."""
    keys = {"rayleigh": {"frequencies": [2.0, 12.0], "ratio": 0.05}}
    return type(config.damping).model_validate(keys)


def main() -> None:
    """Run all cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/bench_pine_flat.json"))
    out, found = parser.parse_args().out, dict[str, Any]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print("| case | first period s | amplification |\n|---|---|---|")
        for case, (rock, water) in CASES.items():
            scene, config = monolith(folder, rock, water)
            period, size = first_peak(assemble_full(scene, config.damping))
            found[case] = {"first_period": period, "amplification": size}
            print(f"| {case} | {period:.3f} | {size:.2f} |", flush=True)
        print("\n| water | modes | crest mm | off % | ledger | CPU s |\n|---|---|---|---|---|---|")
        found |= runs(folder)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
