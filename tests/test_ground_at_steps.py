"""The ground motion that a run integrates, at its steps."""

import numpy as np
import pytest

from romdam.core.motion import GroundMotion
from romdam.pipelines.simulation import ground_at_steps


@pytest.mark.parametrize(("duration", "steps"), [(0.5, 101), (1.2, 241), (None, 201)])
def test_a_run_ends_at_its_duration(duration, steps):
    """1 s of 7 t at 0.01 s, in steps of 0.005 s: both ends are there; at rest where it goes on."""
    acc = np.zeros((3, 101))
    acc[1] = 7.0 * np.linspace(0.0, 1.0, 101)
    found = ground_at_steps(GroundMotion("ramp", acc, 0.01, {}, ()), 0.005, duration)
    time = 0.005 * np.arange(steps)
    assert found.shape == (3, steps)
    np.testing.assert_allclose(found[1], np.where(time > 1.0 + 1e-9, 0.0, 7.0 * time), atol=1e-9)
