"""Results of every kind, and edits of them as another program may make them, one at a time."""

from __future__ import annotations

import shutil
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
import yaml

import romdam
from romdam.core.sealed import Opened
from romdam.pipelines.linear import linear
from romdam.pipelines.report import report
from romdam.pipelines.suites.run import SuiteOptions, run_suite

BOX = {"size": [2, 2, 2], "element_size": 1.0}
NODE = {"top": {"block": "block", "at": [2, 2, 2]}}
JOB = {
    "title": "A bonded block",
    "materials": {"concrete": {"E": "3 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
    "blocks": {
        "base": {"material": "concrete", "box": {"origin": [0, 0, -2], **BOX}},
        "block": {"material": "concrete", "box": {"origin": [0, 0, 0], **BOX}},
    },
    "supports": [{"block": "base", "face": "zmin"}],
    "joints": {
        "foot": {
            "between": ["base", "block"],
            "normal_stiffness": "30 GPa/m",
            "shear_stiffness": "10 GPa/m",
            "friction": 0.3,
            "cohesion": "30 kPa",
            "tensile_strength": "20 kPa",
        }
    },
    "loads": {
        "gravity": [0, 0, -9.81],
        "joint_water": [{"joints": ["foot"], "level": "1 m", "downstream": [0, 1, 0], "crack": "redrawn"}],
    },
    "damping": {"rayleigh": {"frequencies": [20.0, 200.0], "ratio": "5 %"}},
    "model": {"modes": 12},
    "transient": {"accuracy": {"openings": "5 %", "slips": "20 %"}},
    "records": [{"name": "pulse", "file": "pulse.txt", "unit": "m/s2", "dt": 0.005, "components": {"y": 1}}],
    "post_earthquake": {"changes": {"joints.foot.friction": 0.25}, "required_factor": 1.2},
    "outputs": {
        "output_interval": "5 ms",
        "mesh_error": "coarser",
        "nodes": NODE,
        "floor_spectra": {"dampings": [0.05]},
        "stress": {
            "faces": [{"block": "block", "face": "xmin"}],
            "nodes": NODE,
            "sections": {"cut": {"blocks": ["block"], "point": [1, 1, 1]}},
            "strength": "2 MPa",
        },
    },
}
FLAT = {"points": [[0.001, "3 m/s2"], [2, "3 m/s2"]]}
WEDGE = {
    "wedges": {
        "slab": {
            "inside": [1.0, 1.0, -3.0],
            "density": 2500.0,
            "thrust": {"joints": ["foot"], "on": "base", "sections": ["cut"]},
            "planes": {"bottom": {"dip": 0, "through": [0, 0, -4], "friction": 0.5, "cohesion": 2e4}},
            "surfaces": {
                "top": {"dip": 0, "through": [0, 0, -2]},
                **{
                    f"{axis}{at}": {"dip": 90, "dip_direction": direction, "through": [at, at, 0]}
                    for axis, direction in (("x", 90), ("y", 0))
                    for at in (0, 2)
                },
            },
        }
    }
}


def pulses() -> np.ndarray:
    """(nt,) two periods of shaking, then rest [m/s2]."""
    time = np.arange(121) * 0.005
    return np.where(time < 0.4, 9.0 * np.sin(2.0 * np.pi * time / 0.2), 0.0)


@dataclass(frozen=True)
class Written:
    """Files of one job: the job, a run and its copy, wedges, the summary of a suite, a spectrum analysis."""

    job: Path
    run: Path
    other: Path
    wedges: Path
    suite: Path
    spectrum: Path


def write_all(folder: Path) -> Written:
    """Run the job in every way that leaves results."""
    np.savetxt(folder / "pulse.txt", pulses())
    job, wedges = folder / "job.yaml", folder / "wedges.yaml"
    job.write_text(yaml.safe_dump(JOB))
    wedges.write_text(yaml.safe_dump(WEDGE))
    (run,) = romdam.run(romdam.load_config(job), folder / "run").paths
    friction = {"mu": {"path": "joints.foot.friction", "values": [0.3, 0.6]}}
    several = {"pipeline": "suite", "suite": {"scales": [0.5, 1.0], "parameters": friction}}
    suite = folder / "suite.yaml"
    kept = {name: section for name, section in JOB.items() if name != "post_earthquake"}
    suite.write_text(yaml.safe_dump(kept | several))
    run_suite(romdam.load_config(suite), folder / "suite", SuiteOptions(workers=1))
    spectrum = folder / "linear.yaml"
    spectrum.write_text(yaml.safe_dump(kept | {"linear_stage": {"spectra": {"y": FLAT}}}))
    linear(romdam.load_config(spectrum), folder / "linear")
    other = shutil.copytree(run.parent, folder / "other") / run.name
    summary = folder / "suite" / "summary.nc"
    report(summary.parent, job=romdam.load_config(suite))  # leaves its data beside the summary
    return Written(job, run, other, wedges, summary, folder / "linear" / "linear" / "pulse-spectrum.nc")


Edit = tuple[str, str, xr.Dataset]  # name of a variable or an attribute, what is done to it, and the outcome


def edits(dataset: xr.Dataset, step: int = 1) -> Iterator[Edit]:
    """Edit each attribute and variable in turn, or one of `step`: none, another kind or shape, odd values."""
    for name in [*dataset.attrs][::step]:
        yield from ((str(name), what, edited) for what, edited in _of_attribute(dataset, str(name)))
    for name in [*dataset.variables][::step]:
        yield from ((str(name), what, edited) for what, edited in _of_variable(dataset, str(name)))


def _of_attribute(dataset: xr.Dataset, name: str) -> Iterator[tuple[str, xr.Dataset]]:
    values = {
        "a text": "x", "an empty text": "", "a number": 1.5, "zero": 0.0, "a negative number": -3.0,
        "no number": np.nan, "a list": '["a"]', "an object": '{"a": 1}', "null": "null",
        "numbers": np.array([1.0, 2.0]),
    }  # fmt: skip
    without = {key: value for key, value in dataset.attrs.items() if key != name}
    for what, attrs in {
        "gone": without,
        **{k: without | {name: value} for k, value in values.items()},
    }.items():
        edited = dataset.copy()
        edited.attrs = attrs
        yield what, edited


def _of_variable(dataset: xr.Dataset, name: str) -> Iterator[tuple[str, xr.Dataset]]:
    old = dataset.variables[name]
    values, rest = np.array(old.values), dataset.drop_vars(name)

    def put(new: np.ndarray, dims: tuple[Hashable, ...] = old.dims, **attrs: str) -> xr.Dataset:
        variable = {name: xr.Variable(dims, new, {**old.attrs, **attrs})}
        return rest.assign_coords(variable) if name in dataset.coords else rest.assign(variable)

    yield "gone", rest
    if values.dtype.kind in "fiu":
        if values.dtype.kind == "f":
            first = values.copy()
            first.flat[:1] = np.nan
            yield "not a number", put(np.full_like(values, np.nan))
            yield "not a number once", put(first)
            yield "infinite", put(np.full_like(values, np.inf))
            yield "whole numbers", put(np.nan_to_num(values).astype(np.int64))
        yield "zero", put(np.zeros_like(values))
        yield "negative", put(-values)
        yield "texts", put(values.astype(str))
        yield "of other units", put(values, units="furlong")
    else:
        yield "other texts", put(np.full(values.shape, "x"))
        yield "empty texts", put(np.full(values.shape, ""))
        yield "numbers", put(np.ones(values.shape))
    if values.ndim:
        yield "reversed", put(values[::-1].copy())
    if values.ndim and name not in dataset.dims:
        yield "too short", put(values[:-1], ("other", *old.dims[1:]))
        yield "one value", put(np.asarray(values.flat[0] if values.size else 0.0), ())


def known_of(dataset: xr.Dataset) -> Opened:
    """What the reading of a file without a digest finds out about its numbers."""
    numbers = {str(n): np.asarray(v.values) for n, v in dataset.variables.items() if v.dtype.kind == "f"}
    undefined = frozenset(name for name, values in numbers.items() if np.isnan(values).any())
    return Opened(False, undefined, frozenset(n for n, values in numbers.items() if np.isinf(values).any()))
