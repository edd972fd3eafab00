"""Water in a base joint: equilibrium by hand, cracked base of a rigid section, code_aster SSNP142F."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from romdam.benchmarks.case import BenchmarkCase, PublishedValue
from romdam.benchmarks.jobs import GRAVITY, Keys, at_rest

LENGTH, WIDTH, HEIGHT, LEVEL = 10.0, 2.0, 8.0, 8.0  # of a block on rock, heel at y = 0, and its water [m]
GAMMA = 1000.0 * GRAVITY  # unit weight of water [N/m3]
HEAVY, LIGHT = 2400.0, 1300.0  # densities: the base stays closed, the heel opens [kg/m3]
THRUST = GAMMA * WIDTH * LEVEL**2 / 2  # on the upstream face [N]
DRAINED = ((0.0, 8.0), (1.3, 1.0 + 7.0 / 3.0), (LENGTH, 1.0))  # distance from the heel, head [m]
USBR = "USBR, Engineering Monograph 19 (1977)"
CRACKED_BASE = "cracked-base analysis, USACE EM 1110-2-2200 (1995), USBR EM 19 (1977)"
FULL_IN_CRACK = "ICOLD (1986): full pressure in the crack, beyond it the diagram of the closed joint"
SSNP142 = "code_aster, validation manual V6.03.142, SSNP142F"
GEFDYN = f"GEFDYN, quoted by {SSNP142}"
COARSE = "GEFDYN's mesh is coarse and its residuals are large, as code_aster's test says"


def resultant(heads: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Force [N] and moment about the heel [N m] of a head that is linear between points."""
    parts = [(a, b - a, p, q) for (a, p), (b, q) in pairwise(heads)]
    force = sum(d * (p + q) / 2 for _, d, p, q in parts)
    moment = sum(d * (a * (p + q) / 2 + d * (p + 2 * q) / 6) for a, d, p, q in parts)
    return GAMMA * WIDTH * force, GAMMA * WIDTH * moment


def crack_length(crack: str) -> float:
    """Crack of a rigid section: the effective stress is linear, and nothing at the crack's tip [m].

    Parameters
    ----------
    crack : of `loads.joint_water`, which says what uplift there is for a crack
    """
    weight = LIGHT * GRAVITY * LENGTH * WIDTH * HEIGHT

    def excess(a: float) -> float:
        tip = LEVEL - (LEVEL - 1.0) / LENGTH * a  # head of the closed joint there
        heads = {
            "unchanged": [(0.0, LEVEL), (LENGTH, 1.0)],
            "redrawn": [(0.0, LEVEL), (a, LEVEL), (LENGTH, 1.0)],
            "full": [(0.0, LEVEL), (a, LEVEL), (a, tip), (LENGTH, 1.0)],
        }[crack]
        force, moment = resultant(heads)
        from_toe = LENGTH - (weight * LENGTH / 2 + THRUST * LEVEL / 3 - moment) / (weight - force)
        return LENGTH - 3.0 * from_toe - a

    return float(brentq(excess, 0.1, 8.0))


def _block(density: float, E: float, cells: int, water: Keys) -> xr.Dataset:
    """State at rest of a block with water on its upstream face and in its base joint."""
    boxes = {"rock": ([0, 0, -2], [WIDTH, LENGTH, 2]), "dam": ([0, 0, 0], [WIDTH, LENGTH, HEIGHT])}
    joint = {"normal_stiffness": 1e10, "shear_stiffness": 1e10, "friction": 0.9}
    level = {"level": LEVEL, "tailwater": 1.0, "downstream": [0, 1, 0]}
    return at_rest(
        {
            "materials": {"concrete": {"E": E, "nu": 0.0, "rho": density}},
            "blocks": {
                name: {
                    "material": "concrete",
                    "box": {"origin": at, "size": size, "element_size": [size[0], LENGTH / cells, size[2]]},
                }
                for name, (at, size) in boxes.items()
            },
            "supports": [{"block": "rock", "face": "zmin"}],
            "joints": {"base": {"between": ["rock", "dam"]} | joint},
            "loads": {
                "gravity": [0, 0, -GRAVITY],
                "hydrostatic": [{"level": LEVEL, "faces": [{"block": "dam", "face": "ymin"}]}],
                "joint_water": [{"joints": ["base"]} | level | water],
            },
            "model": {"order": "full"},
        }
    )


def _drained() -> Sequence[float]:
    state = _block(HEAVY, 3e10, 5, {"drains": {"at": 1.3, "rule": "usbr"}})
    y, normal = state.gap_position.sel(component="y").values, np.abs(state.normal_force.values)
    return [normal.sum(), normal @ y / normal.sum()]


def _cracked() -> Sequence[float]:
    lengths = []
    for crack in ("unchanged", "redrawn", "full"):
        state = _block(LIGHT, 3e13, 64, {"crack": crack})
        y, closed = state.gap_position.sel(component="y").values, state.normal_force.values != 0.0
        tip = 0.5 * (y[~closed].max() + y[closed].min())
        lengths.append(float(state.crack_at_rest.max()) if crack == "redrawn" else tip)
    return lengths


def _ssnp142f() -> Sequence[float]:
    """State of the joint: opening, pressure and total stress; only the dam's upstream face bears water."""
    water = {"joints": ["base_1"], "level": 9.0, "downstream": [0, 1, 0], "crack": "redrawn"}
    sizes = {"along": 1, "through": 200, "up": 40, "depth": 28, "upstream": 28, "downstream": 28}
    joint = {"normal_stiffness": 1e12, "shear_stiffness": 1e12, "friction": 1.0}
    state = at_rest(
        {
            "materials": {"concrete": {"E": 3.0e12, "nu": 0.25, "rho": 2400.0}},
            "gravity_dam": {
                "upstream": [[0, 0], [10, 0]],
                "downstream": [[0, 5], [10, 1.5]],
                "monoliths": [0.1],
                "base": 0,
                "material": "concrete",
                "element": "hex8",
                "divisions": sizes | {"growth": 1.12},
                "rock": {"material": "concrete", "mass": False, "depth": 5, "upstream": 5, "downstream": 5},
                "joints": {"base": joint | {"tensile_strength": 100.0, "cohesion": 100e6}},
            },
            "supports": [{"block": "monolith_1", "face": face, "fix": ["x"]} for face in ("left", "right")],
            "loads": {
                "gravity": [0, 0, -GRAVITY],
                "hydrostatic": [{"level": 9.0, "faces": [{"block": "monolith_1", "face": "upstream"}]}],
                "joint_water": [water],
            },
            "model": {"modes": 6},
        }
    )
    state = state.sortby(state.gap_position.sel(component="y"))
    y, opening = state.gap_position.sel(component="y").values, state.opening.values
    pressure = state.water_pressure.values
    stress = state.normal_force.values / state.gap_area.values - pressure
    heel, toe = float(opening[0]), float(stress[-1])
    inside = [float(np.interp(x, y, opening)) for x in (1.3, 3.2, 4.6)]
    loaded = [float(np.interp(4.4, y, pressure)), float(np.interp(4.6, y, stress))]
    return [heel, heel, *inside, float(opening[-1]), *loaded, toe, toe]


CASES = (
    BenchmarkCase(
        "uplift",
        "block of 10 m by 8 m, water 8 m and 1 m deep, drains: effective normal force of the base",
        (
            PublishedValue(
                "effective force",
                HEAVY * GRAVITY * LENGTH * WIDTH * HEIGHT - resultant(DRAINED)[0],
                "N",
                1e-9,
                f"weight less uplift; diagram of {USBR}",
                "closed form",
            ),
            PublishedValue(
                "its distance from the heel",
                (
                    HEAVY * GRAVITY * LENGTH**2 * WIDTH * HEIGHT / 2
                    + THRUST * LEVEL / 3
                    - resultant(DRAINED)[1]
                )
                / (HEAVY * GRAVITY * LENGTH * WIDTH * HEIGHT - resultant(DRAINED)[0]),
                "m",
                1e-9,
                f"moments about the heel; diagram of {USBR}",
                "closed form",
            ),
        ),
        _drained,
    ),
    BenchmarkCase(
        "cracked-base",
        "the same of 1300 kg/m3 without drains: length of the crack; 64 elements along the base",
        tuple(
            PublishedValue(f"length, crack: {crack}", crack_length(crack), "m", within, source, "closed form")
            for crack, within, source in (
                ("unchanged", 0.05, "effective stress linear from the tip; uplift of the closed joint"),
                ("redrawn", 2e-3, CRACKED_BASE),
                ("full", 0.05, FULL_IN_CRACK),
            )
        ),
        _cracked,
    ),
    BenchmarkCase(
        "ssnp142f",
        "gravity dam of 10 m, base joint of 1e12 Pa/m and 100 Pa strength, 9 m of water: state of the base",
        (
            PublishedValue("opening at the heel", 1.41381559e-6, "m", 0.01, SSNP142, "printed"),
            PublishedValue("opening at the heel", 1.52e-6, "m", 0.08, GEFDYN, "secondary", COARSE),
            PublishedValue("opening at 1.3 m", 8.46439704e-7, "m", 0.01, SSNP142, "printed"),
            PublishedValue("opening at 3.2 m", 5.73893179e-8, "m", 0.02, SSNP142, "printed"),
            PublishedValue("closing at 4.6 m", -3.61851193e-7, "m", 0.01, SSNP142, "printed"),
            PublishedValue("closing at the toe", -5.83070285e-7, "m", 0.01, SSNP142, "printed"),
            PublishedValue("pressure at 4.4 m", 32287.226, "Pa", 0.01, SSNP142, "printed"),
            PublishedValue("total stress at 4.6 m", -383376.01, "Pa", 0.01, SSNP142, "printed"),
            PublishedValue("total stress at the toe", -583070.29, "Pa", 0.01, SSNP142, "printed"),
            PublishedValue("total stress at the toe", -5.23e5, "Pa", 0.12, GEFDYN, "secondary", COARSE),
        ),
        _ssnp142f,
    ),
)
