"""Runs that no physics has fail: damping that gives energy, and motion beyond times the model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from simulating import simulated
from suite_jobs import BASE

from romdam.config import parse_config
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.soundness import refuse_active_damping

DT = 0.005
PULSE = np.outer([0.0, 5.0, 0.0], np.sin(2 * np.pi * 4.0 * DT * np.arange(120)))


@pytest.fixture(scope="module")
def system():
    config = parse_config({key: value for key, value in BASE.items() if key != "pipeline"}, "s.yaml")
    return reduce_scene(build_scene(config, Path(), "s.yaml"), config.model, config.damping).system


def test_size_is_that_of_the_mesh(system):
    assert system.extent == 20.0  # two boxes, 5 x 15 x 20 m


def test_negative_and_indefinite_damping_is_refused(system):
    refuse_active_damping(system)
    with pytest.raises(ConfigError, match="coefficient of unknown 3 is -2"):
        C = system.C.diagonal()
        C[3] = -2.0
        refuse_active_damping(replace(system, C=csr_matrix(np.diag(C))))
    C = np.eye(system.size)
    C[0, 1] = C[1, 0] = 1.2  # eigenvalues 1 +- 1.2
    with pytest.raises(ConfigError, match=r"least eigenvalue is -0\.2"):
        refuse_active_damping(replace(system, C=csr_matrix(C), diagonal=False))
    C[0, 1] = C[1, 0] = 1.0  # 0 and 2: semidefinite
    refuse_active_damping(replace(system, C=csr_matrix(C), diagonal=False))
    C[0, 1], C[1, 0] = 5.0, -5.0  # a skew part does no work
    refuse_active_damping(replace(system, C=csr_matrix(C), diagonal=False))


@pytest.mark.parametrize("integrator", ["adaptive", "generalized_alpha"])
def test_a_run_that_damping_feeds_fails(system, integrator):
    simulated(system, PULSE, DT, integrator)
    fed = replace(system, C=-0.5 * system.C)
    with pytest.raises(ConvergenceError, match=r"damping has given [0-9.e+]+ J|times the model"):
        simulated(fed, PULSE, DT, integrator)


def test_a_peak_beyond_the_size_of_the_model_fails(system):
    with pytest.raises(ConvergenceError, match="limit 2e+03 m, 100 times the model".replace("+", "[+]")):
        simulated(system, 1e9 * PULSE, DT, "adaptive")
