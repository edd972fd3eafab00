"""A small suite on disk: two cantilevers with eight gaps, a few short records."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import yaml

import romdam
from romdam.config.load import Job
from romdam.pipelines.suites.run import SuiteOptions, SuiteOutcome, run_suite

CODE = "from romdam.cli import main; main()"

BASE: dict[str, Any] = {
    "materials": {"concrete": {"E": "30 GPa", "nu": 0.18, "rho": "2440 kg/m3"}},
    "blocks": {
        "left": {
            "material": "concrete",
            "box": {"origin": [0, -5, 0], "size": [5, 5, 20], "element_size": "5 m"},
        },
        "right": {
            "material": "concrete",
            "box": {"origin": [0, 0, 0], "size": [5, 10, 20], "element_size": "5 m"},
        },
    },
    "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
    "joints": {
        "gap": {
            "between": ["left", "right"],
            "normal_stiffness": "16 GPa/m",
            "shear_stiffness": "8 GPa/m",
        }
    },
    "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": "5 %"}},
    "records": [{"files": "records/*.txt", "unit": "m/s2", "dt": "0.01 s", "components": {"y": 1}}],
    "model": {"order": "reduced", "modes": 8},
    "transient": {"finest_step": "5 ms"},
    "outputs": {
        "output_interval": "0.02 s",
        "error_estimate": False,
        "mesh_error": False,
        "nodes": {"top": {"block": "right", "at": [0, 0, 20]}},
    },
    "pipeline": "suite",
}
MU = {"mu": {"path": "joints.gap.friction", "values": [0.2, 0.6]}}


def pulse(number: int) -> np.ndarray:
    """(nt,) decaying sine, longer and slower with its number [m/s2]."""
    time = np.arange(60 + 10 * number) * 0.01
    return 5.0 * np.sin(2 * np.pi * (3 + number) * time) * np.exp(-3 * time)


def write_job(folder: Path, records: int = 3, suite: dict[str, Any] | None = None, **sections: Any) -> Path:
    """Write the records and the configuration; its path."""
    (folder / "records").mkdir(parents=True, exist_ok=True)
    for number in range(records):
        np.savetxt(folder / "records" / f"r{number}.txt", pulse(number))
    path = folder / "suite.yaml"
    path.write_text(yaml.safe_dump({**BASE, "suite": suite or {}, **sections}))
    return path


def made(config: Path, out: Path, **options: Any) -> SuiteOutcome:
    """Run a suite in this process's own workers."""
    return run_suite(romdam.load_config(config), out, SuiteOptions(workers=1, **options))


def edited(config: Path, **suite: Any) -> Job:
    """Change keys of a configuration's `suite:`."""
    raw = yaml.safe_load(config.read_text())
    raw["suite"] |= suite
    config.write_text(yaml.safe_dump(raw))
    return romdam.load_config(config)


def named_records(config: Path, **files: int) -> None:
    """Let a configuration have these records: name -> number of the file."""
    raw = yaml.safe_load(config.read_text())
    entry = {k: v for k, v in BASE["records"][0].items() if k != "files"}
    raw["records"] = [{**entry, "name": name, "file": f"records/r{i}.txt"} for name, i in files.items()]
    config.write_text(yaml.safe_dump(raw))


def command(config: Path, out: Path, *options: object) -> list[str]:
    """The command line of a suite, in a process of its own."""
    return [sys.executable, "-c", CODE, "run", str(config), "--out", str(out), *map(str, options), "--quiet"]


def summary(out: Path) -> xr.Dataset:
    """The summary of a suite."""
    return xr.load_dataset(out / "summary.nc", engine="h5netcdf")


def differing(a: xr.Dataset, b: xr.Dataset) -> list[str]:
    """Variables that are not the same bit for bit; seconds are left out, they are those of the clock."""
    assert set(a.variables) == set(b.variables)
    names = [name for name in a.variables if not str(name).endswith("_seconds")]
    return [str(name) for name in names if not _same(a[name].values, b[name].values)]


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    return (a == b).all() if a.dtype.kind in "OUS" else a.tobytes() == b.tobytes()
