"""A reduced run read back from its file, with what a replay of its joint forces needs."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.results.dataset import open_run

FOLDER = "configuration_folder"  # attribute: from the result's folder to the configuration's


def folder_from(results: Path, configuration: Path) -> str:
    """The way from the folder of results to that of the configuration; its whole path on another drive."""
    try:
        return os.path.relpath(configuration, results)
    except ValueError:
        return str(configuration.absolute())


@dataclass(frozen=True)
class StoredRun:
    """A reduced run as its file holds it; rows are the written times, d directions per gap.

    Attributes
    ----------
    path : the file
    attributes : of the file
    time : (nt,) [s]
    jump, traction, mean : (nt, ng, d) jump, joint force with that of water that entered, and its mean since
        the row before, on side J [m], [N]
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

    @property
    def interval(self) -> float:
        """Time between two rows [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def steps(self) -> tuple[float, float]:
        """Finest and base step [s].

        Raises
        ------
        ResultError
            where the attributes that tell them are no steps, or the file is of before they were all told.
        """
        stated = {name: self.attributes.get(name) for name in ("solver_finest_step", "solver_base_step")}
        for name, value in stated.items():
            if not (isinstance(value, float) and 0.0 < value < math.inf):
                raise ResultError(
                    f"{self.path}: its attribute {name} must be a step in seconds, got "
                    f"{'none' if value is None else value}; run the configuration again"
                )
        finest, base = (float(str(value)) for value in stated.values())
        return finest, base

    def refuse_other(self, position: Floats, unknowns: int) -> None:
        """Refuse a scene or a model that is not the one of this run.

        Parameters
        ----------
        position : (ng, 3) of the scene's gaps [m]
        unknowns : of the reduced model

        Raises
        ------
        ResultError
            with both sizes.
        """
        same = self.q.shape[1] == unknowns and self.position.shape == position.shape
        if not (same and np.allclose(self.position, position, atol=1e-9)):
            raise ResultError(
                f"{self.path}: its {len(self.position)} gaps and {self.q.shape[1]} reduced coordinates are "
                f"not the {len(position)} and {unknowns} of the scene as it is now; run it again"
            )


def read_run(path: Path) -> StoredRun:
    """Read what a replay needs.

    Raises
    ------
    ResultError
        where the file is no romdam result, is of full order, or holds no joint forces.
    """
    with open_run(path) as dataset:
        if dataset.attrs.get("model_order") != "reduced":
            raise ResultError(
                f"{path}: is a full-order result; a certificate is about the error of a reduced one"
            )
        if "opening" not in dataset:
            raise ResultError(
                f"{path}: has no joints; what a linear model leaves out is told by its frequencies"
            )
        kinds = ("normal", "shear") if "slip" in dataset else ("normal",)
        forces = [f"{prefix}{kind}_force" for kind in kinds for prefix in ("mean_", "")]
        missing = [name for name in forces if name not in dataset]
        if missing:
            raise ResultError(
                f"{path}: holds no joint forces ({', '.join(missing)}); run the configuration again"
            )
        if "reduced_coordinates" not in dataset:
            raise ResultError(f"{path}: holds no reduced_coordinates; run the configuration again")
        if dataset.time.size < 2:
            raise ResultError(f"{path}: has {dataset.time.size} written times, a replay needs two or more")
        traction = _gap_vector(dataset, "normal_force", "shear_force", -1.0)
        if "crack_water_force" in dataset:
            traction[..., 0] += dataset.crack_water_force.values
        disp = dataset.displacement.values if "displacement" in dataset else np.zeros((dataset.time.size, 0))
        return StoredRun(
            path=path,
            attributes=dict(dataset.attrs),
            time=dataset.time.values,
            jump=_gap_vector(dataset, "opening", "slip", 1.0),
            traction=traction,
            mean=_gap_vector(dataset, "mean_normal_force", "mean_shear_force", -1.0),
            q=dataset.reduced_coordinates.values.astype(np.float64),
            disp=disp.reshape(len(disp), -1),
            strain=dataset.energy_strain.values,
            position=dataset.gap_position.values,
        )


def _gap_vector(dataset: xr.Dataset, normal: str, tangential: str, sign: float) -> Floats:
    """Join the normal component of a quantity, times `sign`, with its tangential ones, (nt, ng, d)."""
    components = [sign * dataset[normal].values[:, :, None]]
    if tangential in dataset:
        components.append(dataset[tangential].values)
    return np.concatenate(components, axis=2)
