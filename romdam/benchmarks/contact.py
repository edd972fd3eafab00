"""Contact and friction in time: a bar against a wall, Newmark's block, code_aster's masses on springs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.benchmarks.case import BenchmarkCase, PublishedValue
from romdam.benchmarks.jobs import GRAVITY, Keys, run_of
from romdam.core.arrays import Floats
from romdam.core.system import GapLaw, History, System
from romdam.timestepping.integrators.registry import integrator_class
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.steps import Steps

FRICTION = 0.4  # of Newmark's block
PULSE, LASTS = 6.0, 0.4  # rectangular, of the ground below it [m/s2], [s]
YIELD = FRICTION * GRAVITY  # acceleration at which it slides [m/s2]
BAR: Keys = {"E": 900.0, "nu": 0.0, "rho": 1.0}  # 10 m long, waves of 30 m/s
SPEED, CLEARANCE = 2.0, 0.5  # of the bar, and its way to the wall [m/s], [m]
SDND100 = "code_aster validation manual V5.01, SDND100"
SDND101 = "code_aster validation manual V5.01, SDND101"
SDND104 = "code_aster validation manual V5.01, SDND104"


def _newmark() -> Sequence[float]:
    dt = 0.001
    stiff: Keys = {"E": 3e13, "nu": 0.2, "rho": 2400.0}  # a thousand times concrete
    boxes = {"rock": ([-2, -2, -2], [8, 8, 2]), "block": ([0, 0, 0], [4, 4, 1])}
    keys: Keys = {
        "materials": {"stiff": stiff},
        "blocks": {
            name: {
                "material": "stiff",
                "mass": name == "block",
                "box": {"origin": origin, "size": size, "element_size": [2, 2, 1]},
            }
            for name, (origin, size) in boxes.items()
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": {
                "between": ["rock", "block"],
                "normal_stiffness": 200e9,
                "shear_stiffness": 100e9,
                "friction": FRICTION,
            }
        },
        "loads": {"gravity": [0, 0, -GRAVITY]},
        "damping": {"rayleigh": {"alpha": 0.0, "beta": 1e-4}},
        "model": {"modes": 4},
        "transient": {"finest_step": dt},
    }
    t = np.arange(2501) * dt
    acc = np.where((t > 0.1) & (t < 0.1 + LASTS - 0.5 * dt), -PULSE, 0.0)
    slip = run_of(keys, {"x": acc}, dt).slip.mean("gap").values
    return [float(np.abs(slip[-1] - slip[0]).max())]


def _bar() -> Sequence[float]:
    """The ground's pulse leaves with -2 m/s, so that the bar moves to the wall with 2 m/s; section 1 m2."""
    dt = 2e-4
    sides = [(side, axis) for axis in "xz" for side in (f"{axis}min", f"{axis}max")]
    boxes = {"bar": ([0, 0, 0], [1, 10, 1], 0.1), "wall": ([0, 10, 0], [1, 1, 1], 1.0)}
    keys: Keys = {
        "materials": {"bar": BAR, "stiff": BAR | {"E": 9e9}},
        "blocks": {
            name: {
                "material": "bar" if name == "bar" else "stiff",
                "mass": name == "bar",
                "box": {"origin": origin, "size": size, "element_size": [1, length, 1]},
            }
            for name, (origin, size, length) in boxes.items()
        },
        "supports": [
            *({"block": name, "face": side, "fix": [axis]} for name in boxes for side, axis in sides),
            {"block": "wall", "face": "ymax"},
        ],
        "joints": {
            "end": {"between": ["bar", "wall"], "normal_stiffness": 1e5, "gap": CLEARANCE},
        },
        "loads": {"initial_state": "undeformed"},
        "damping": {"rayleigh": {"alpha": 0.0, "beta": 0.0}},
        "model": {"modes": "all"},
        "transient": {"finest_step": dt, "integrator": "modal"},
        "outputs": {"output_interval": dt},
    }
    begins, half = 0.01, 50  # steps of half the pulse
    acc = np.zeros(round(1.2 / dt) + 1)
    acc[: 2 * half + 1] = half - np.abs(np.arange(2 * half + 1) - half)
    result = run_of(keys, {"y": -SPEED * acc / (half**2 * dt)}, dt)
    force = np.abs(result.mean_normal_force.sum("gap").values)
    time, reached = result.time.values, begins + CLEARANCE / SPEED
    loaded = time[force > 0.05 * _bar_force()]
    middle = (time > reached + 0.1) & (time < reached + 0.6)  # the force jumps at both ends
    return [loaded[-1] - loaded[0], force[middle].mean(), force.sum() * dt]


def _bar_force() -> float:
    """Force rho c v of the bar's section [N]."""
    return float(np.sqrt(BAR["E"] * BAR["rho"]) * SPEED)


def _few_masses(
    mass: Sequence[float],
    stiffness: Sequence[float],
    gap: Sequence[Sequence[float]],
    law: GapLaw,
    *,
    force: Sequence[float],
    shaken: Sequence[float],
) -> System:
    """Masses on springs with one gap; the unknowns are scaled to 1 kg.

    Parameters
    ----------
    mass, stiffness : (n,) [kg], [N/m]
    gap : opening and slip of unit displacements of each mass, (directions, n)
    force : (n,) constant [N]
    shaken : (n,) 1 where the mass follows the ground's acceleration along x
    """
    root = np.sqrt(np.asarray(mass, dtype=float))
    n = len(root)
    load = np.zeros((n, 3))
    load[:, 0] = root * shaken
    return System(
        M=csr_matrix(np.eye(n)),
        C=csr_matrix((n, n)),
        K=csr_matrix(diags_array(np.asarray(stiffness) / root**2)),
        B=csr_matrix(np.asarray(gap, dtype=float) / root),
        load=load,
        force=np.asarray(force) / root,
        observe=csr_matrix(np.diag(1.0 / root)),
        law=law,
        parts={"all": slice(0, n)},
        diagonal=True,
        floating=bool(np.any(np.asarray(stiffness) == 0.0)),
    )


def _march(system: System, acc: Floats, dt: float, stride: int = 1) -> History:
    """From the undeformed state by the modal integrator; acc (nt,) along x [m/s2]."""
    chosen: Any = integrator_class("modal")
    ground = np.stack([acc, 0.0 * acc, 0.0 * acc])
    return simulate_one(
        Prepared(system, chosen()), ground, Settings(Steps(dt, stride), initial_state="undeformed")
    )


def _wall_law(K_n: float, friction: float, opening: float) -> GapLaw:
    one = np.ones(1)
    gaps = {"wall": slice(0, 1)}
    return GapLaw(K_n * one, 0.0 * one, np.inf * one, np.full((1, 2), friction), opening * one, gaps)


# unknowns along x, y, z of a mass on a table: the gap opens with z and slips with x and y
_TABLE = ((0, 0, 1), (1, 0, 0), (0, 1, 0))


def _dry_friction() -> Sequence[float]:
    half, start = 400, 8.5e-4  # steps of half a period; distance from the spring's rest [m]
    dt = np.pi / 100 / half
    system = _few_masses(
        [1, 1, 1],
        [1e4, 0, 0],
        _TABLE,
        _wall_law(np.inf, 0.1, 0.0),
        force=[1e4 * start, 0, -10],
        shaken=[0, 0, 0],
    )
    u = _march(system, np.zeros(round(5.5 * half) + 1), dt).disp[:, 0] - start
    return [u[half * number] for number in (1, 2, 3, 4)]


def _spring_impact() -> Sequence[float]:
    """Started at rest 0.1 m from the spring's rest, where the stop is, the mass meets it with 1 m/s."""
    dt, reached = 1e-5, np.pi / 20
    system = _few_masses([100], [1e4], [[-1]], _wall_law(1e6, 0.0, 0.1), force=[1e3], shaken=[0])
    history = _march(system, np.zeros(round(0.55 / dt) + 1), dt)
    force, time = history.traction[:, 0, 0], history.time
    first = time < reached + 0.1
    second = np.argmax(np.where(first, 0.0, force))
    return [
        (force[first] > 0.0).sum() * dt,
        force[first].max(),
        force[first].sum() * dt,
        time[second] - reached,
    ]


def _shaken_base() -> Sequence[float]:
    dt, stride, powers = 2e-4, 5, []
    t = np.arange(round(12.0 / dt) + 1) * dt
    for size in (15.0, 1.5):
        system = _few_masses(
            [1, 1, 1],
            [0, 0, 0],
            _TABLE,
            _wall_law(np.inf, 0.1, 0.0),
            force=[0, 0, -10],
            shaken=[1, 0, 0],
        )
        history = _march(system, size * np.sin(2 * np.pi * t), dt, stride)
        late = history.time >= 4.0 - 1e-9
        power = 10.0 * np.abs(history.vel[late, 0])
        powers.append(float(np.trapezoid(power, history.time[late])) / 8.0)
    return powers


CASES = (
    BenchmarkCase(
        "bar-impact",
        "bar of 10 m (rho c = 30 kg/m2/s) that meets a wall with 2 m/s; 100 hex8",
        (
            PublishedValue("contact lasts", 2 * 10.0 / 30.0, "s", 0.02, "2 L / c", "closed form"),
            PublishedValue("force", _bar_force(), "N", 0.01, "rho c v A", "closed form"),
            PublishedValue("impulse", 2 * 10.0 * SPEED, "N s", 0.03, "2 m v", "closed form"),
        ),
        _bar,
    ),
    BenchmarkCase(
        "newmark-block",
        "stiff block on massless rock, friction 0.4, under a rectangular pulse of 6 m/s2 and 0.4 s",
        (
            PublishedValue(
                "residual slip",
                0.5 * (PULSE * LASTS) ** 2 * (1.0 / YIELD - 1.0 / PULSE),
                "m",
                0.01,
                "V^2 / 2 (1 / N - 1 / A), Newmark, Geotechnique 15 (1965) 139",
                "closed form",
            ),
        ),
        _newmark,
    ),
    BenchmarkCase(
        "sdnd100",
        "mass of 1 kg on a spring of 1e4 N/m and a table with friction of 1 N, released 8.5e-4 m from rest",
        tuple(
            PublishedValue(f"extremum {number}", u, "m", 0.01, SDND100, "printed")
            for number, u in enumerate([6.5e-4, -4.5e-4, 2.5e-4, -0.5e-4], start=1)
        ),
        _dry_friction,
    ),
    BenchmarkCase(
        "sdnd101",
        "mass of 100 kg on a spring of 1e4 N/m that meets a stop of 1e6 N/m with 1 m/s",
        (
            PublishedValue("contact lasts", 0.03126, "s", 1e-3, SDND101, "printed"),
            PublishedValue("peak force", 9950.4, "N", 1e-3, SDND101, "printed"),
            PublishedValue("impulse", 198.02, "N s", 1e-3, SDND101, "printed"),
            PublishedValue("time between peaks", 0.36105, "s", 1e-3, SDND101, "printed"),
        ),
        _spring_impact,
    ),
    BenchmarkCase(
        "sdnd104",
        "block of 1 kg that slides on a base shaken with A sin(2 pi t), mu g = 1 m/s2, from 4 to 12 s",
        tuple(
            PublishedValue(f"mean friction power, A = {size:g} m/s2", power, "W", 0.01, SDND104, "printed")
            for size, power in ((15.0, 15.2672), (1.5, 0.409062))
        ),
        _shaken_base,
    ),
)
