"""Strongly damped modes: forces by hand, and openings by an integration that knows no modes."""

import numpy as np
import pytest
from scipy.linalg import lu_factor, lu_solve
from small_scenes import march, reduced, scene

import romdam
from romdam.config.sections.job import DampingConfig
from romdam.core.motion import GroundMotion
from romdam.core.system import System
from romdam.effects.full_order import assemble_full

DT = 0.01
TIME = np.arange(0.0, 3.0, DT)
RHO, SIZE, WATER = 2400.0, (4.0, 6.0, 24.0), 20.0


def results(motion, modes, integrator, **sections):
    """A wall shaken along y and x, under a damping that makes most of its modes overdamped."""
    job = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": RHO}},
        "blocks": {
            "wall": {
                "material": "concrete",
                "box": {"origin": [0, 0, 0], "size": list(SIZE), "element_size": 2},
            }
        },
        "supports": [{"block": "wall", "face": "zmin"}],
        "damping": {"rayleigh": {"frequencies": [3, 10], "ratio": 0.1}},
        "model": {"modes": modes},
        "transient": {"finest_step": 0.00125, "integrator": integrator},
        "outputs": {
            "output_interval": DT,
            "plots": False,
            "error_estimate": False,
            "stress": {
                "blocks": ["wall"],
                "sections": {"foot": {"blocks": ["wall"], "point": [2, 3, 0]}},
            },
        },
    }
    job |= {key: job.get(key, {}) | value for key, value in sections.items() if isinstance(value, dict)}
    job |= {key: job[key] + value for key, value in sections.items() if isinstance(value, list)}
    return romdam.run(job, motions=GroundMotion("slow", motion, DT, {}, ())).results[0].dataset


@pytest.mark.parametrize(
    "modes", [pytest.param(6, marks=pytest.mark.slow), 20, pytest.param(60, marks=pytest.mark.slow)]
)
def test_the_foot_bears_the_inertia_of_the_whole_wall(modes):
    """The ground's acceleration rises to 1 m/s2 and stays: V is the mass, and 7/12 rho d^2 b of the water."""
    motion = np.zeros((3, len(TIME)))
    motion[1] = 0.5 * (1.0 - np.cos(np.pi * np.clip(TIME / 2.0, 0.0, 1.0)))
    water = {
        "level": f"{WATER} m",
        "model": "westergaard",
        "faces": [{"block": "wall", "face": "ymin"}],
    }
    data = results(motion, modes, "adaptive", water=water)
    shear = data.section_force.values.reshape(len(TIME), 3)[:, 2]
    borne = RHO * np.prod(SIZE) + 7.0 / 12.0 * 1000.0 * WATER**2 * SIZE[0]
    assert abs(shear[0]) < 1e-6 * borne
    assert -shear[-20:].mean() == pytest.approx(borne, rel=1e-3)
    assert -shear[100] == pytest.approx(0.5 * borne, rel=1e-2)


def central_differences(system: System, acc: np.ndarray, dt: float) -> np.ndarray:
    """Openings (nt, gaps) of the mesh by (u_1 - 2 u_0 + u_-1) / dt^2, with contact by penalty at u_0."""
    M, C, K = (matrix.toarray() for matrix in (system.M, system.C, system.K))
    B, K_n = system.B.toarray(), system.law.K_n
    load = np.asarray(system.load)
    factor = lu_factor(M / dt**2 + C / (2.0 * dt))
    u_0, u_1 = np.zeros((2, len(M)))
    openings = np.zeros((acc.shape[1], len(K_n)))
    for i in range(acc.shape[1]):
        openings[i] = B @ u_1
        contact = K_n * np.maximum(-openings[i], 0.0)
        force = B.T @ contact - load @ acc[:, i] - K @ u_1 + M @ (2.0 * u_1 - u_0) / dt**2
        u_0, u_1 = u_1, lu_solve(factor, force + C @ u_0 / (2.0 * dt))
    return openings


@pytest.mark.parametrize(
    "ratio, high",
    [
        pytest.param(0.05, 10.0, marks=pytest.mark.slow),
        pytest.param(0.07, 10.0, marks=pytest.mark.slow),
        pytest.param(0.1, 4.0, marks=pytest.mark.slow),
        (0.02, 50.0),
    ],
)
def test_openings_of_strongly_damped_blocks_are_those_of_the_mesh(ratio, high):
    """Two stiff blocks that pound each other; at 10 Hz and below most modes have a ratio above 0.7."""
    concrete = {"E": 30e9, "nu": 0.18, "rho": 2440.0}
    box = {"element_size": 5.0, "origin": [0, -5, 0], "size": [5, 5, 20]}
    raw = {
        "materials": {"concrete": concrete},
        "blocks": {
            "left": {"material": "concrete", "box": box},
            "right": {"material": "concrete", "box": box | {"origin": [0, 0, 0], "size": [5, 10, 20]}},
        },
        "supports": [{"block": name, "face": "zmin"} for name in ("left", "right")],
        "joints": {"gap": {"between": ["left", "right"], "normal_stiffness": 16e9}},
        "outputs": {"nodes": {"top": {"block": "right", "at": [0, 0, 20]}}},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": "all"},
        "transient": {"finest_step": 1e-3},
    }
    built = scene(raw)
    damping = DampingConfig(rayleigh={"frequencies": [2.0, high], "ratio": ratio})
    fine, dt, end = 2e-5, 1e-4, 1.0

    def shaken(step):
        t = np.arange(round(end / step) + 1) * step
        acc = np.zeros((3, len(t)))
        acc[1] = 12.0 * np.sin(np.pi * t / end) ** 2 * np.sin(2.0 * np.pi * 5.0 * t)
        return acc

    truth = central_differences(assemble_full(built, damping), shaken(fine), fine)[:: round(dt / fine)]
    system = reduced(built, damping).system
    opening = march(system, dt, shaken(dt), integrator="adaptive").jump[..., 0]
    xi = system.C.diagonal() / (2.0 * np.sqrt(system.K.diagonal()))
    assert (xi > 0.7).sum() > 20 or high > 10.0
    assert truth.max() > 1e-3
    assert np.linalg.norm(opening - truth) < 1.5e-3 * np.linalg.norm(truth)
