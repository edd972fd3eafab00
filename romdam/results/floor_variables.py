"""The variables of a result file that hold floor spectra."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.results.case import Array, Case, Variable


def _of(name: str) -> Callable[[Case], Array]:
    return lambda case: np.asarray(getattr(case.floor_spectra, name))


def _place_names(case: Case) -> Array:
    return np.array(case.floor_spectra.places, dtype=str)


FLOOR_COORDINATES: dict[str, Variable] = {
    "floor_place": Variable(
        ("floor_place",), "", "name of the place of floor spectra", _place_names, Case.has_floors
    ),
    "floor_damping": Variable(
        ("floor_damping",), "1", "damping ratio of the oscillators", _of("dampings"), Case.has_floors
    ),
    "floor_frequency": Variable(
        ("floor_frequency",), "Hz", "frequency of the oscillators", _of("frequencies"), Case.has_floors
    ),
}
_DIMS = ("floor_place", "component", "floor_damping", "floor_frequency")
FLOOR_VARIABLES: dict[str, Variable] = {
    "floor_spectrum": Variable(
        _DIMS,
        "m s-2",
        "largest absolute acceleration of an oscillator that stands on the place",
        _of("ordinates"),
        Case.has_floors,
    ),
    "floor_spectrum_broadened": Variable(
        _DIMS,
        "m s-2",
        "floor spectrum with peaks broadened by outputs.floor_spectra.broadening",
        _of("broadened"),
        Case.has_broadened_floors,
    ),
    "floor_peak_acceleration": Variable(
        ("floor_place", "component"),
        "m s-2",
        "largest absolute acceleration of the place",
        _of("peak"),
        Case.has_floors,
    ),
    "floor_spectrum_error": Variable(
        _DIMS,
        "1",
        "relative difference to the floor spectrum of a run with half the steps, and more modes if any",
        _of("error"),
        Case.has_floor_error,
    ),
}
