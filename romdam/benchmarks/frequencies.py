"""Natural frequencies: a bar and a beam, NAFEMS FV32 and FV52, Koyna."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from romdam.benchmarks.case import BenchmarkCase, PublishedValue
from romdam.benchmarks.jobs import Keys, modes_held, modes_of, slice_of_dam
from romdam.core.arrays import Bools, Floats

STEEL: Keys = {"E": 200e9, "nu": 0.3, "rho": 8000.0}  # of NAFEMS' cases
KOYNA: Keys = {"upstream": [[0, 0], [103, 0]], "downstream": [[0, 70], [66.5, 19.25], [103, 14.8]]}
LENGTH, E, RHO = 40.0, 30e9, 2400.0  # of a bar of 1 m by 1 m [m], [Pa], [kg/m3]
BENDING = 1.8751041**2 / (2 * np.pi * LENGTH**2) * np.sqrt(E / 12.0 / RHO)  # first root of cos x cosh x = -1
R0015 = "NAFEMS R0015 (1987)"
ABAQUS = "Abaqus Example Problems, Seismic analysis of a concrete gravity dam"


def box(size: Sequence[float], element_size: Sequence[float], material: Keys) -> Keys:
    """A box of hex20 that stands on its lowest face."""
    edges = {"size": size, "element_size": element_size, "element": "hex20"}
    return {
        "materials": {"solid": material},
        "blocks": {"solid": {"material": "solid", "box": {"origin": [0, 0, 0]} | edges}},
        "supports": [{"block": "solid", "face": "zmin"}],
    }


def _bar() -> Sequence[float]:
    modes = modes_of(box([1, 1, LENGTH], [1, 1, 2], {"E": E, "nu": 0.0, "rho": RHO}), 14)
    lengthwise = modes.motion[:, 2] > 0.99  # share of the energy; the others bend or twist
    return [modes.freq[lengthwise][0], modes.freq[0]]


def _fv32() -> Sequence[float]:
    """The foot is held in the membrane's plane only: a slice of a dam would hold its thickness too."""
    tapered: Keys = {"upstream": [[0, 0], [10, 2]], "downstream": [[0, 5], [10, 3]]}
    keys = slice_of_dam(tapered, width=0.025, through=8, up=16, material=STEEL)

    def held(points: Floats) -> Bools:
        foot = points[:, 2] == 0.0
        return np.column_stack([points[:, 0] == 0.0, foot, foot])

    return list(modes_held(keys, "monolith_1", held, 6).freq)


def _fv52() -> Sequence[float]:
    """The plate is held upwards along the four lines of its lower rim; three motions in its plane are free.

    On finer meshes a line sinks in without end: the bending modes are compared on NAFEMS' own, the membrane
    modes on a finer one too.
    """

    def held(points: Floats) -> Bools:
        rim = np.isin(points[:, 0], (0, 10)) | np.isin(points[:, 1], (0, 10))
        fixed = np.zeros(points.shape, dtype=bool)
        fixed[:, 2] = rim & (points[:, 2] == 0.0)
        return fixed

    coarse = modes_held(box([10, 10, 1], [2.5, 2.5, 1], STEEL), "solid", held, 10)
    fine = modes_held(box([10, 10, 1], [1.25, 1.25, 0.5], STEEL), "solid", held, 14)
    membrane = fine.freq[fine.motion[:, 2] < 0.01][3:]  # share of the energy across the plate
    return [*coarse.freq[3:], *membrane[:2]]


def _koyna() -> Sequence[float]:
    concrete: Keys = {"E": 31.027e9, "nu": 0.2, "rho": 2643.0}
    omega = 2 * np.pi * modes_of(slice_of_dam(KOYNA, width=0.5, through=8, up=20, material=concrete), 4).freq
    return [*omega, omega[0]]


CASES = (
    BenchmarkCase(
        "bar",
        "cantilever of 40 m by 1 m by 1 m, no lateral strain: first lengthwise and first bending mode",
        (
            PublishedValue(
                "lengthwise mode",
                np.sqrt(E / RHO) / (4.0 * LENGTH),
                "Hz",
                1e-6,
                "sqrt(E / rho) / 4 L",
                "closed form",
            ),
            PublishedValue("bending mode", BENDING, "Hz", 1e-3, "Euler-Bernoulli beam", "closed form"),
        ),
        _bar,
    ),
    BenchmarkCase(
        "nafems-fv32",
        "tapered cantilever membrane, 10 m long, 5 m to 1 m deep; 16 by 8 hex20",
        tuple(
            PublishedValue(f"mode {number}", freq, "Hz", 1e-4, f"{R0015}, FV32", "secondary")
            for number, freq in enumerate([44.623, 130.03, 162.70, 246.05, 379.90, 391.44], start=1)
        ),
        _fv32,
    ),
    BenchmarkCase(
        "nafems-fv52",
        "solid square plate of 10 m by 10 m by 1 m on lines; 4 by 4 by 1 hex20, 8 by 8 by 2 for the membrane",
        (
            *(
                PublishedValue(
                    f"mode {number}", freq, "Hz", 1e-3, f"{R0015}, FV52, finite elements", "secondary"
                )
                for number, freq in enumerate(
                    [44.762, 110.52, 110.52, 169.08, 193.93, 206.64, 206.64], start=4
                )
            ),
            PublishedValue("membrane mode 1", 193.59, "Hz", 5e-4, f"{R0015}, FV52, closed form", "secondary"),
            PublishedValue("membrane mode 2", 206.19, "Hz", 5e-4, f"{R0015}, FV52, closed form", "secondary"),
        ),
        _fv52,
    ),
    BenchmarkCase(
        "koyna",
        "Koyna, empty, in plane stress on a rigid base; 8 by 20 hex20",
        (
            *(
                PublishedValue(f"mode {number}", omega, "rad/s", 0.01, ABAQUS, "secondary")
                for number, omega in enumerate([18.86, 49.97, 68.16, 98.27], start=1)
            ),
            PublishedValue(
                "mode 1",
                19.27,
                "rad/s",
                0.025,
                "Chopra, Chakrabarti, Bull. Seism. Soc. Am. 63 (1973) 381",
                "secondary",
            ),
        ),
        _koyna,
    ),
)
