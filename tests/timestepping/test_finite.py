"""No history with a number that is none counts as converged, whatever made it."""

from dataclasses import replace

import numpy as np
import pytest
from hand_systems import gap_law, modal_twin, sparse_system
from simulating import prepared_for, steps_for

from romdam.contact.problem import gap_problem
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate, simulate_one

GROUND = np.zeros((3, 11))
GROUND[0] = np.sin(np.arange(11.0))


def two_masses(**law):
    K = np.diag([1e4, 2e4])
    return sparse_system(np.eye(2), K, np.array([[-1.0, 1.0]]), gap_law(1, **law), load=np.ones(2))


@pytest.mark.parametrize("K_n", [0.0, -1e5, np.nan])
def test_a_stiffness_that_is_none_is_refused(K_n):
    with pytest.raises(ConfigError, match="normal_stiffness must be above 0"):
        gap_problem(np.eye(1), gap_law(1, K_n=K_n))


@pytest.mark.parametrize("integrator", ["modal", "adaptive", "conserving", "generalized_alpha"])
@pytest.mark.parametrize("what", ["load", "observe"])
def test_numbers_that_are_none_are_an_error(integrator, what):
    """A load or a probe that is infinite: the gaps' own checks do not see the second."""
    system = two_masses(K_n=1e5)
    system = system if integrator == "generalized_alpha" else modal_twin(system)
    if integrator == "conserving":
        system = replace(system, C=0.0 * system.C)
    spoiled = getattr(system, what) * np.inf
    prepared = prepared_for(replace(system, **{what: spoiled}), integrator)
    settings = Settings(steps_for(integrator, 0.01), initial_state="undeformed")
    with np.errstate(all="ignore"):
        outcome = simulate(prepared, [GROUND], settings)[0]
        assert isinstance(outcome, ConvergenceError)
        with pytest.raises(ConvergenceError, match=r"t = |first step|residual"):
            simulate_one(prepared, GROUND, settings)
