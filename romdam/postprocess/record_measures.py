"""Measures and spectra of ground motions as xarray Datasets with units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from romdam.core.motion import GroundMotion
from romdam.records.measures import fourier_amplitude, measure
from romdam.records.spectra import response_spectra, rotated_psa

Array = np.ndarray
AXES = ["x", "y", "z"]
PERIODS = np.geomspace(0.01, 10.0, 100)
# name -> unit, long name
MEASURES = {
    "pga": ("m s-2", "peak ground acceleration"),
    "pgv": ("m s-1", "peak ground velocity"),
    "pgd": ("m", "peak ground displacement"),
    "arias": ("m s-1", "Arias intensity"),
    "cav": ("m s-1", "cumulative absolute velocity"),
    "d5_75": ("s", "significant duration, 5 to 75 % of Arias intensity"),
    "d5_95": ("s", "significant duration, 5 to 95 % of Arias intensity"),
    "duration": ("s", "time of the last sample, pads included"),
    "dt": ("s", "sampling interval"),
}
SPECTRA = {
    "sd": ("m", "spectral relative displacement"),
    "sv": ("m s-1", "spectral relative velocity"),
    "sa": ("m s-2", "spectral absolute acceleration"),
    "psv": ("m s-1", "pseudo-spectral velocity"),
    "psa": ("m s-2", "pseudo-spectral acceleration"),
}


def measures_dataset(motions: Sequence[GroundMotion]) -> xr.Dataset:
    """Scalar measures of every component of every record: dims record, component."""
    found = [measure(motion.acc, motion.dt) for motion in motions]
    data = {
        name: (("record", "component"), np.array([one[name] for one in found]), _attributes(MEASURES[name]))
        for name in MEASURES
    }
    return xr.Dataset(data, coords={"record": [motion.name for motion in motions], "component": AXES})


def spectra_dataset(
    motion: GroundMotion, periods: Array = PERIODS, dampings: tuple[float, ...] = (0.05,)
) -> xr.Dataset:
    """Response spectra of one record: dims component, damping, period; RotD50 and RotD100 of x and y."""
    spectra = response_spectra(motion.acc, motion.dt, periods, dampings)
    dims = ("component", "damping", "period")
    data: dict[str, Any] = {
        name: (dims, getattr(spectra, name), _attributes(about)) for name, about in SPECTRA.items()
    }
    rotated = np.array([rotated_psa(motion.acc[0], motion.acc[1], motion.dt, periods, xi) for xi in dampings])
    for column, name in enumerate(("rotd50", "rotd100")):
        about = ("m s-2", f"PSa over all horizontal directions, {'median' if column == 0 else 'largest'}")
        data[name] = (("damping", "period"), rotated[:, column], _attributes(about))
    coords = {
        "component": AXES,
        "damping": ("damping", np.array(dampings), {"units": "1", "long_name": "ratio of critical damping"}),
        "period": ("period", np.asarray(periods), {"units": "s", "long_name": "undamped period"}),
    }
    return xr.Dataset(data, coords=coords, attrs={"record": motion.name})


def fourier_dataset(motion: GroundMotion) -> xr.Dataset:
    """Fourier amplitude of acceleration of one record: dims component, frequency."""
    freq, amplitude = fourier_amplitude(motion.acc, motion.dt)
    about = _attributes(("m s-1", "Fourier amplitude of ground acceleration"))
    return xr.Dataset(
        {"fas": (("component", "frequency"), amplitude, about)},
        coords={"component": AXES, "frequency": ("frequency", freq, {"units": "Hz"})},
        attrs={"record": motion.name},
    )


def _attributes(about: tuple[str, str]) -> dict[str, str]:
    return {"units": about[0], "long_name": about[1]}
