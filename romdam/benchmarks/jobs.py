"""Jobs of the benchmark cases: what every configuration needs, and what is read from a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from romdam.config.load import Job
from romdam.core.arrays import Bools, Floats
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.pipelines.jobs import load_config
from romdam.pipelines.run import run
from romdam.reduction.natural_modes import NaturalModes, natural_modes
from romdam.scene.build import build_scene

Keys = dict[str, Any]

# what a scene without a run does not use
UNUSED: Keys = {
    "records": [{"name": "none", "file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "transient": {"finest_step": 0.01},
}
UNDAMPED: Keys = {"rayleigh": {"alpha": 0.0, "beta": 0.0}}
GRAVITY = 9.81  # m/s2, in all cases that have weight


def scene_of(keys: Mapping[str, Any]) -> tuple[Scene, Job]:
    """The scene of a configuration that is not run."""
    job = load_config(UNUSED | {"damping": UNDAMPED, "model": {"order": "full"}} | dict(keys))
    return build_scene(job.config, job.folder, str(job.path)), job


def slice_of_dam(profile: Keys, *, width: float, through: int, up: int, material: Keys) -> Keys:
    """A slice of a gravity dam in plane stress on a rigid base, held along its axis at one side, of hex20."""
    return {
        "materials": {"concrete": material},
        "gravity_dam": profile
        | {
            "monoliths": [width],
            "base": 0,
            "material": "concrete",
            "element": "hex20",
            "divisions": {"along": 1, "through": through, "up": up},
            "joints": {"base": "tied"},
        },
        "supports": [{"block": "monolith_1", "face": "left", "fix": ["x"]}],
    }


def modes_of(keys: Mapping[str, Any], count: int) -> NaturalModes:
    """Lowest natural modes of the whole mesh, without joints."""
    scene, job = scene_of(keys)
    return natural_modes(scene, job.config.damping, count)


def modes_held(
    keys: Mapping[str, Any], block: str, held: Callable[[Floats], Bools], count: int
) -> NaturalModes:
    """The same of one block with other supports than faces.

    Parameters
    ----------
    held : points (n, 3) [m] -> (n, 3) components that are held
    """
    scene, job = scene_of(keys)
    fixed = scene.fixed | {block: held(scene.blocks[block].points)}
    return natural_modes(replace(scene, fixed=fixed), job.config.damping, count)


def run_of(keys: Mapping[str, Any], acc: Mapping[str, Floats], dt: float) -> xr.Dataset:
    """Result of a configuration under a ground motion.

    Parameters
    ----------
    acc : axis -> (nt,) ground acceleration, linear between samples [m/s2]
    dt : step of its samples [s]
    """
    motion = GroundMotion.from_arrays("motion", acc, dt)
    outputs = {"plots": False, "error_estimate": False, "mesh_error": False} | keys.get("outputs", {})
    outcome = run(dict(keys) | {"outputs": outputs}, motions=motion)
    return outcome.results[0].dataset


def at_rest(keys: Mapping[str, Any]) -> xr.Dataset:
    """Static state of a configuration: the first row of a run without ground motion."""
    dt = 0.01  # of the one step, which is not read [s]
    steps = {"finest_step": dt, "integrator": "generalized_alpha"}
    still = dict(keys) | {"damping": UNDAMPED, "transient": steps}
    return run_of(still, {"y": np.zeros(2)}, dt).isel(time=0)
