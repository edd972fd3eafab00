"""Random blocks on rock at rest, against equilibrium by hand."""

import json

import numpy as np
import pytest
from blocks_at_rest import random_blocks

import romdam
from romdam.core.errors import NoEquilibriumError
from romdam.core.motion import GroundMotion
from romdam.postprocess.stability import joint_stability

STILL = GroundMotion.from_arrays("still", {"y": [0.0] * 5}, 0.01)


@pytest.mark.parametrize("seed", range(6))
def test_factors_are_those_of_equilibrium_by_hand(seed):
    resting, job = random_blocks(np.random.default_rng(seed))
    if not resting[0].stands:
        with pytest.raises(NoEquilibriumError, match="no static equilibrium can be"):
            romdam.run(job, motions=STILL)
        return
    dataset = romdam.run(job, motions=STILL).results[0].dataset
    judged = {joint.joint: joint for joint in joint_stability(dataset, "still", 1.0, None)}
    # blocks beside each other share what they carry, each of them as much for a metre
    shear = sum(judged[f"base_{k}"].shear for k in range(len(resting)))
    compression = sum(judged[f"base_{k}"].compression for k in range(len(resting)))
    assert compression == pytest.approx(sum(block.compression for block in resting), rel=1e-6)
    assert shear == pytest.approx(sum(block.shear for block in resting), rel=1e-4)
    if len(resting) == 1:
        joint = judged["base_0"]
        assert joint.factor == pytest.approx(resting[0].factor, rel=1e-6)
        assert joint.resultant == pytest.approx(resting[0].resultant, rel=5e-3)
    else:
        group = judged["base_0 + base_1"]
        assert group.factor == pytest.approx(resting[0].factor, rel=1e-3)
    assert dataset.imbalance_at_rest.max() <= 1e-9
    assert not [text for text in json.loads(dataset.attrs["run_warnings"]) if "balance" in text]
