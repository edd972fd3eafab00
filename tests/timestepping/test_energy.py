"""The energy ledger: closed to round-off with every integrator, and how far open where it is not."""

import numpy as np
import pytest
from hand_systems import assert_ledger, gap_law, modal_twin, run, sparse_system

from romdam.core.errors import ConfigError
from romdam.core.system import ENERGY_TERMS
from romdam.timestepping.energy import imbalance


def _pounding(C=2e-4, **law):
    """Two masses on springs of their own (2.8 and 1.6 Hz) that meet; C in seconds times K."""
    K = np.diag([3e4, 5e3])
    return sparse_system(
        np.diag([100.0, 50.0]),
        K,
        [[-1.0, 1.0]],
        gap_law(1, **law),
        C=C * K,
        load=[100.0, 50.0],
        force=[3.0, -1.0],
    )


def _shaking(dt, seconds=4.0):
    time = np.arange(round(seconds / dt) + 1) * dt
    return 3.0 * np.sin(9.0 * time) * np.exp(-0.5 * time)


LAWS = [{"K_n": 1e6}, {"K_n": np.inf}, {"K_n": 1e5, "K_nz": 2e4}]


@pytest.mark.parametrize(
    "rho_inf",
    [pytest.param(0.0, marks=pytest.mark.slow), 0.5, pytest.param(0.9, marks=pytest.mark.slow), 1.0],
)
@pytest.mark.parametrize("law", LAWS, ids=["penalty", "rigid", "tension"])
@pytest.mark.parametrize("reduced", [False, True])
def test_generalized_alpha_closes_its_ledger(rho_inf, law, reduced):
    """With what its own damping takes as a term of it, and nothing makes energy.

    A spring of a joint that acted half of the step before its end, where the blocks' act at the end (rho_inf
    0), made 40 times the input in this very run.
    """
    system = _pounding(**law)
    system = modal_twin(system) if reduced else system
    h = run(system, _shaking(2e-3), 2e-3, integrator="generalized_alpha", rho_inf=rho_inf)
    assert h.peaks["opening"][0] > 0.01
    assert_ledger(h, 1e-12)
    assert h.stats["ledger_imbalance"] <= 1e-12
    exchanged = np.ptp(h.energy["input"])
    taken = h.energy["numerical"] + h.energy["contact"]
    assert taken.min() >= -5e-3 * exchanged
    assert h.energy["kinetic"].max() + h.energy["strain"].max() <= 2.0 * exchanged
    if rho_inf == 1.0:
        assert np.abs(h.energy["numerical"]).max() <= 1e-12 * exchanged
    else:
        without = {"residual": h.energy["residual"] - h.energy["numerical"]}
        assert imbalance(h.energy | without) > 1e-5


@pytest.mark.slow
def test_what_the_scheme_takes_vanishes_with_the_step():
    """To second order for a smooth motion: k dt dv.M da sums up to k dt^2 / 2 times the change of a.M a."""
    taken = [
        run(_pounding(C=0.0, gap=9.0), _shaking(dt), dt, rho_inf=0.5).energy["numerical"][-1]
        for dt in (1e-3, 5e-4, 2.5e-4)
    ]
    slopes = np.log2(np.abs(taken[:-1]) / np.abs(taken[1:]))
    assert slopes == pytest.approx([2.0, 2.0], abs=0.1)


def test_conserving_is_refused_where_something_damps():
    with pytest.raises(ConfigError, match=r"transient\.integrator: conserving is for scenes without damping"):
        run(modal_twin(_pounding(K_n=1e6)), _shaking(1e-3), 1e-3, integrator="conserving")
    h = run(modal_twin(_pounding(C=0.0, K_n=1e6)), _shaking(1e-3), 1e-3, integrator="conserving")
    assert h.stats["ledger_imbalance"] <= 1e-9


def test_imbalance_is_measured_against_what_is_exchanged():
    """Not against what rests in the scene, such as the strain under weight."""
    energy = {name: np.zeros(3) for name in ENERGY_TERMS}
    assert imbalance(energy) == 0.0
    energy |= {"strain": np.array([1e9, 1e9 + 40.0, 1e9]), "input": np.array([0.0, 50.0, 10.0])}
    energy["residual"] = np.array([0.0, 0.0, -2.0])
    assert imbalance(energy) == pytest.approx(2.0 / 50.0)
    energy["input"] = np.array([0.0, 1e-7, 0.0])
    energy["strain"] = np.full(3, 1e9)
    energy["residual"] = np.array([0.0, 1e-7, 0.0])  # round-off of a scene at rest
    assert imbalance(energy) <= 1e-6
