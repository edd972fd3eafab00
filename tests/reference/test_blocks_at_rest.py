"""Random blocks on rock at rest, against equilibrium by hand."""

import json

import numpy as np
import pytest
from blocks_at_rest import random_blocks, random_scene

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


# a few of the kinds, and 40 more
SCENES = [0, 3, 7, 13]
MORE = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(200, 240)]


@pytest.mark.parametrize("seed", [*SCENES, *MORE])
def test_blocks_stacks_and_unlike_pairs_have_the_factors_of_equilibrium_by_hand(seed):
    """Each joint of a stack by itself; unlike blocks beside each other as the group that shares the load."""
    kind, footings, job = random_scene(np.random.default_rng(seed))
    total = [sum(getattr(one, name) for one in footings) for name in ("compression", "thrust")]
    try:
        dataset = romdam.run(job, motions=STILL).results[0].dataset
    except NoEquilibriumError:
        # blocks beside each other can hold each other, but not where both slide or overturn
        assert not all(one.stands for one in footings)
        return
    judged = {joint.joint: joint for joint in joint_stability(dataset, "still", 1.0, None)}
    if kind == "beside":
        (group,) = (joint for name, joint in judged.items() if " + " in name)
        assert group.compression == pytest.approx(total[0], rel=1e-6)
        assert group.shear == pytest.approx(total[1], rel=1e-6)
        assert group.factor == pytest.approx(footings[0].friction * total[0] / total[1], rel=1e-6)
    else:
        assert all(one.stands for one in footings)
        for one in footings:
            joint = judged[one.joint]
            assert joint.compression == pytest.approx(one.compression, rel=1e-6)
            if one.thrust == 0.0:  # a lift above the water
                assert np.isnan(joint.factor)
                continue
            assert joint.factor == pytest.approx(one.factor, rel=1e-6)
            assert joint.resultant == pytest.approx(one.resultant, rel=1e-6)
    assert dataset.imbalance_at_rest.max() <= 1e-8
