"""Water of the reservoir: force on a rigid wall, Pine Flat's first period."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from romdam.benchmarks.case import BenchmarkCase, PublishedValue
from romdam.benchmarks.frequency_response import first_period, force_on_rigid_wall
from romdam.benchmarks.jobs import Keys, scene_of, slice_of_dam
from romdam.effects.added_mass import added_mass
from romdam.effects.full_order import assemble_full

FOOT = 0.3048  # m
DEPTH, WIDTH, RHO, SOUND = 40.0, 4.0, 1000.0, 1440.0  # of a wall and its water [m], [m], [kg/m3], [m/s]
FREQUENCIES = (0.5, 0.9, 1.5)  # in units of the first of the reservoir, c / 4 d
_TERMS = 10_000  # of the series, which fall with the third power
WESTERGAARD = "Westergaard, Trans. ASCE 98 (1933) 418"
CHOPRA = "Chopra, J. Eng. Mech. Div. ASCE 93 (1967) 205"
FENVES_CHOPRA = "Fenves, Chopra, UCB/EERC-85/10 (1986)"
_STANDARD = 1.4 * 400.0 / 3.25e6**0.5  # of the standard section: 1.4 H / sqrt(E), H in ft, E in psi [s]
PINE_FLAT: Keys = {
    "upstream": [[0, 0], [335 * FOOT, 16.75 * FOOT], [400 * FOOT, 16.75 * FOOT]],
    "downstream": [[0, 314.3 * FOOT], [335 * FOOT, 48.75 * FOOT], [400 * FOOT, 48.75 * FOOT]],
}


def force(ratio: float) -> float:
    """Amplitude of the force on a rigid wall, over rho a H^2 of its width, rigid bottom, endless channel.

    The sum over the channel's modes of 2 / (H mu^2 kappa), where mu = (n - 1/2) pi / H and
    kappa^2 = mu^2 - (omega / c)^2.

    Parameters
    ----------
    ratio : frequency in units of the reservoir's first
    """
    mu = (np.arange(1, _TERMS + 1) - 0.5) * np.pi
    kappa = np.emath.sqrt(mu**2 - (ratio * np.pi / 2.0) ** 2)
    return float(abs((2.0 / (mu**2 * kappa)).sum()))


def _wall(model: str) -> Keys:
    sizes = {"origin": [0, 0, 0], "size": [WIDTH, 4.0, DEPTH], "element_size": [4.0, 4.0, 2.0]}
    return {
        "materials": {"concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0}},
        "blocks": {"wall": {"material": "concrete", "box": sizes}},
        "supports": [{"block": "wall", "face": "zmin"}],
        "water": {"level": DEPTH, "faces": [{"block": "wall", "face": "ymin"}], "model": model},
    }


def _incompressible() -> Sequence[float]:
    scene, _ = scene_of(_wall("incompressible"))
    water = added_mass(scene)
    assert water is not None
    along = np.tile([[0.0], [1.0], [0.0]], (len(scene.blocks["wall"].points), 1))
    moved = water.on({"wall": along})
    return [float((moved.T @ water.times(moved))[0, 0]) / (RHO * WIDTH * DEPTH**2)]


def _compressible() -> Sequence[float]:
    scene, _ = scene_of(_wall("compressible"))
    first = np.pi * SOUND / (2.0 * DEPTH)
    unit = RHO * WIDTH * DEPTH**2
    return [abs(force_on_rigid_wall(scene, ratio * first)) / unit for ratio in FREQUENCIES]


def _pine_flat() -> Sequence[float]:
    concrete: Keys = {"E": 22.41e9, "nu": 0.2, "rho": 2483.0}
    crest = {"crest": {"block": "monolith_1", "at": [0, 16.75 * FOOT, 400 * FOOT]}}
    keys = slice_of_dam(PINE_FLAT, width=2.0, through=6, up=16, material=concrete)
    keys |= {"outputs": {"nodes": crest}}
    wet = [{"block": "monolith_1", "face": "upstream"}]
    full = keys | {"water": {"level": 381 * FOOT, "faces": wet, "model": "compressible"}}
    periods = []
    for each in (keys, full):
        scene, job = scene_of(each)
        periods.append(first_period(assemble_full(scene, job.config.damping), "monolith_1", 0.25, 0.5))
    return [*periods, periods[0]]


CASES = (
    BenchmarkCase(
        "westergaard",
        "rigid wall in incompressible water 40 m deep",
        (PublishedValue("force / rho a H^2", force(0.0), "", 0.005, WESTERGAARD, "closed form"),),
        _incompressible,
    ),
    BenchmarkCase(
        "compressible-water",
        "the same in compressible water above a rigid bottom, harmonic motion",
        tuple(
            PublishedValue(
                f"force / rho a H^2 at {ratio:g} of the first frequency",
                force(ratio),
                "",
                tolerance,
                source,
                "closed form",
            )
            for ratio, tolerance, source in zip(
                FREQUENCIES, (0.005, 0.005, 0.014), (WESTERGAARD, WESTERGAARD, CHOPRA), strict=True
            )
        ),
        _compressible,
    ),
    BenchmarkCase(
        "pine-flat",
        "Pine Flat's tallest monolith in plane stress on a rigid base, water to 381 of 400 ft; 6 by 16 hex20",
        (
            *(
                PublishedValue(f"first period, {reservoir}", period, "s", 0.015, FENVES_CHOPRA, "secondary")
                for reservoir, period in (("empty", 0.317), ("full, compressible water", 0.397))
            ),
            PublishedValue(
                "first period of the standard section, empty",
                _STANDARD,
                "s",
                0.04,
                f"{FENVES_CHOPRA}, 1.4 H / sqrt(E)",
                "secondary",
            ),
        ),
        _pine_flat,
    ),
)
