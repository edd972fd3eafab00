"""Strongly damped modes are no states of the time loop, and still follow the ground: forces by hand."""

import numpy as np
import pytest

import romdam
from romdam.core.motion import GroundMotion

DT = 0.01
TIME = np.arange(0.0, 3.0, DT)
RHO, SIZE, WATER = 2400.0, (4.0, 6.0, 24.0), 20.0


def results(motion, modes, integrator, **sections):
    """A wall shaken along y and x, under a damping that makes most of its modes quasi-static."""
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


@pytest.mark.parametrize("modes", [6, 20, 60])
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
    assert data.attrs["solver_quasi_static_modes"] >= 2
    assert abs(shear[0]) < 1e-6 * borne
    assert -shear[-20:].mean() == pytest.approx(borne, rel=1e-3)
    assert -shear[100] == pytest.approx(0.5 * borne, rel=1e-2)


@pytest.mark.parametrize("modes", [20])
def test_jumps_and_forces_are_those_of_all_modes_as_states(modes):
    """Two walls of different heights that pound and rub: quasi-static modes change little, and no energy."""
    motion = np.zeros((3, len(TIME)))
    motion[0] = 4.0 * np.sin(np.pi * TIME / 3.0) ** 2 * np.sin(2.0 * np.pi * TIME)
    motion[1] = 0.7 * motion[0]
    low = {"material": "concrete", "box": {"origin": [4, 0, 0], "size": [4, 6, 16], "element_size": 2}}
    joint = {
        "between": ["wall", "low"],
        "normal_stiffness": 20e9,
        "shear_stiffness": 10e9,
        "friction": 0.5,
    }
    changes = {
        "blocks": {"low": low},
        "supports": [{"block": "low", "face": "zmin"}],
        "joints": {"middle": joint},
    }
    split, states = (results(motion, modes, integrator, **changes) for integrator in ("adaptive", "modal"))
    assert split.attrs["solver_quasi_static_modes"] > 5 > states.attrs["solver_quasi_static_modes"] == 0
    for name in ("opening", "slip", "section_force"):
        a, b = split[name].values, states[name].values
        assert np.linalg.norm(a - b) < 0.01 * np.linalg.norm(b), name
    assert split.attrs["solver_ledger_imbalance"] < 1e-9
