"""The variables of named sections in a result file: resultants, and stress that is linear over the plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.core.scene import Section
from romdam.postprocess.stress.sections import AXES, SIDES, linearised_stress
from romdam.results.case import Array, Case, Variable

_OVER_TIME = ("time", "section", "section_axis")


def _cut(case: Case) -> bool:
    return case.stress is not None and bool(_sections(case))


def _sections(case: Case) -> tuple[Section, ...]:
    assert case.scene.stress is not None
    return case.scene.stress.sections


def _forces(case: Case) -> Array:
    assert case.stress is not None
    return case.stress.sections


def _each(name: str) -> Callable[[Case], Array]:
    return lambda case: np.array([getattr(section, name) for section in _sections(case)])


def _linearised(case: Case) -> Array:
    forces = _forces(case)
    return np.stack([linearised_stress(s, forces[:, k]) for k, s in enumerate(_sections(case))], axis=1)


SECTION_COORDINATES: dict[str, Variable] = {
    "section": Variable(("section",), "", "name of the section", _each("name"), _cut),
    "section_axis": Variable(
        ("section_axis",), "", "normal, and two axes in the plane", lambda c: np.array(AXES), _cut
    ),
    "section_side": Variable(
        ("section_side",),
        "",
        "end of the section along an axis in its plane",
        lambda c: np.array(SIDES),
        _cut,
    ),
    "section_axes": Variable(
        ("section", "section_axis", "component"), "1", "axes of the section", _each("axes"), _cut
    ),
    "section_centroid": Variable(
        ("section", "component"), "m", "centroid of the section's area", _each("centroid"), _cut
    ),
    "section_area": Variable(("section",), "m2", "area of the section", _each("area"), _cut),
    "section_side_position": Variable(
        ("section", "section_side", "component"),
        "m",
        "ends of the section through its centroid",
        _each("sides"),
        _cut,
    ),
}

SECTION_VARIABLES: dict[str, Variable] = {
    "section_force": Variable(
        _OVER_TIME,
        "N",
        "resultant of the stress on the section: normal force, tension positive, and shear along its axes",
        lambda c: _forces(c)[..., :3],
        _cut,
    ),
    "section_moment": Variable(
        _OVER_TIME,
        "N m",
        "moment of the stress about the section's axes through the centroid; about the normal it is torsion",
        lambda c: _forces(c)[..., 3:],
        _cut,
    ),
    "section_stress": Variable(
        ("time", "section", "section_side"),
        "Pa",
        "linearised normal stress N/A and M y/I at the ends of the section, tension positive",
        _linearised,
        _cut,
    ),
}
