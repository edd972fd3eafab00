"""Every pair of effects that an OpenSees deck can hold runs there, and opens as romdam's full order does."""

import numpy as np
import pytest
from decks import OPENSEES, full_order
from pairs import EFFECTS, LIMIT, PAIRS, SECONDS, differences, ground, job
from scipy.sparse import diags_array
from scipy.sparse.linalg import spsolve

from romdam.timestepping.equilibrium import initial_state
from romdam.timestepping.integrators.generalized_alpha import GeneralizedAlpha
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings


def test_pairs_are_of_every_effect():
    assert len(EFFECTS) == 17 and len(PAIRS) == 132
    assert ground(1e-4, 3).shape == (3, round(SECONDS / 1e-4) + 1)


def test_an_elastic_joint_with_an_initial_gap_is_pulled_shut_at_rest():
    """Linear springs from where the joint closes: (K + B^T D B) u = -B^T D g, with gaps of 0.02 mm."""
    raw, _ = job(("elastic joint", "initial gap"))
    system = full_order(raw)
    D = np.stack([system.law.K_n, system.law.K_s, system.law.K_s], axis=1)
    gap = np.stack([system.law.gap, 0.0 * system.law.gap, 0.0 * system.law.gap], axis=1)
    stiffness = system.K + system.B.T @ diags_array(D.ravel()) @ system.B
    u = spsolve(stiffness.tocsc(), -system.B.T @ (D * gap).ravel())
    prepared = Prepared(system, GeneralizedAlpha(0.9))
    settings = Settings(prepared.integrator.steps(1e-4, 1e-3, 1e-3), initial_state="static")
    _, gaps = initial_state(prepared, settings)
    assert np.abs(gaps.jump[:, 0] - 2e-5).max() > 1e-5
    assert gaps.jump == pytest.approx((system.B @ u).reshape(-1, 3) + gap, abs=1e-12)
    assert gaps.force.reshape(-1, 3) == pytest.approx(-D * gaps.jump, rel=1e-6, abs=1e-3)


@pytest.mark.slow
@pytest.mark.skipif(OPENSEES is None, reason="openseespy is not installed")
@pytest.mark.parametrize("pair", PAIRS, ids=" + ".join)
def test_opensees_and_romdam_agree(pair, tmp_path):
    assert max(differences(pair, tmp_path)) < LIMIT
