"""Read of a result file what a certificate needs, and write what the certificate says."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.files import replacing
from romdam.core.sealed import changing
from romdam.results.dataset import open_run

FOLDER = "configuration_folder"  # attribute: from the result's folder to the configuration's


@dataclass(frozen=True)
class StoredRun:
    """A reduced run as its file holds it; rows are the written times, d directions per gap.

    Attributes
    ----------
    path : the file
    attributes : of the file
    time : (nt,) [s]
    jump, traction, mean : (nt, ng, d) jump, joint force and its mean since the row before, on side J [m], [N]
    q : (nt, m) reduced coordinates
    disp : (nt, 3 * probes) [m]
    strain : (nt,) strain energy [J]
    position : (ng, 3) of the gaps [m]
    """

    path: Path
    attributes: dict[str, object]
    time: Floats
    jump: Floats
    traction: Floats
    mean: Floats
    q: Floats
    disp: Floats
    strain: Floats
    position: Floats


def read_run(path: Path) -> StoredRun:
    """Read what a replay needs.

    Raises
    ------
    ResultError
        where the file is no romdam result, is of full order, or holds no joint forces.
    """
    with open_run(path) as dataset:
        _refuse(dataset, path)
        disp = dataset.displacement.values if "displacement" in dataset else np.zeros((dataset.time.size, 0))
        return StoredRun(
            path=path,
            attributes=dict(dataset.attrs),
            time=dataset.time.values,
            jump=_gap_vector(dataset, "opening", "slip", 1.0),
            traction=_gap_vector(dataset, "normal_force", "shear_force", -1.0),
            mean=_gap_vector(dataset, "mean_normal_force", "mean_shear_force", -1.0),
            q=dataset.reduced_coordinates.values,
            disp=disp.reshape(len(disp), -1),
            strain=dataset.energy_strain.values,
            position=dataset.gap_position.values,
        )


def _refuse(dataset: xr.Dataset, path: Path) -> None:
    if dataset.attrs.get("model_order") != "reduced":
        raise ResultError(
            f"{path}: is a full-order result; a certificate is about the error of a reduced one"
        )
    if "opening" not in dataset:
        raise ResultError(f"{path}: has no joints; what a linear model leaves out is told by its frequencies")
    missing = [name for name in ("mean_normal_force", "normal_force") if name not in dataset]
    if missing:
        raise ResultError(
            f"{path}: holds no joint forces ({', '.join(missing)}); run the configuration again"
        )
    if dataset.time.size < 2:
        raise ResultError(f"{path}: has {dataset.time.size} written times, a replay needs two or more")


def _gap_vector(dataset: xr.Dataset, normal: str, tangential: str, sign: float) -> Floats:
    parts = [sign * dataset[normal].values[:, :, None]]
    if tangential in dataset:
        parts.append(dataset[tangential].values)
    return np.concatenate(parts, axis=2)


@dataclass(frozen=True)
class Figures:
    """Relative difference of two histories: in L2 over all times and places, and of their peaks."""

    l2: float
    peak: float


def figures(values: Floats, better: Floats) -> Figures:
    """Compare a history with a better one of the same shape; zero where the better one is zero."""
    size, peak = float(np.linalg.norm(better)), float(np.abs(better).max(initial=0.0))
    if size == 0.0:
        return Figures(0.0, 0.0)
    largest = float(np.abs(values).max(initial=0.0))
    return Figures(float(np.linalg.norm(values - better)) / size, abs(largest - peak) / peak)


def write_certificate(path: Path, statement: dict[str, object]) -> Path:
    """Write <result>.certificate.json beside a result, and put the statement into the result itself.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    target = path.with_suffix(".certificate.json")
    with replacing(target) as part:
        part.write_text(json.dumps(statement, indent=2) + "\n")
    with changing(path) as file:
        file.attrs["certificate"] = json.dumps(statement)
        file.attrs["certificate_statement"] = statement["statement"]
    return target


def as_plain(named: dict[str, Figures]) -> dict[str, dict[str, float]]:
    """Figures as plain numbers."""
    return {name: asdict(value) for name, value in named.items()}
