"""What the rows of a suite depend on: every field of a joint is in one of the two keys."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
from small_scenes import raw, scene

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.scene import Joint
from romdam.core.system import GapLaw
from romdam.pipelines.suites.plan import _OF_SAMPLES, _model_key


def test_water_in_a_joint_is_in_the_key_of_the_model():
    """It is a load, and no sample varies it."""
    config = raw()
    job, built = Job(parse_config(config, "s.yaml"), Path("s.yaml")), scene(config)
    (name,), (joint,) = built.joints, built.joints.values()
    wet = replace(built, joints={name: replace(joint, water=np.full(len(joint.area), 1e6))})
    assert _model_key(job, wet) != _model_key(job, built) == _model_key(job, scene(config))


def test_water_in_a_joint_at_another_level_is_a_load_that_the_basis_answers():
    """Suites with other ranges of that level have other bases: their rows are not each other's."""
    config = raw()
    job, built = Job(parse_config(config, "s.yaml"), Path("s.yaml")), scene(config)
    (name,), (joint,) = built.joints, built.joints.values()
    wet = replace(built, joints={name: replace(joint, water=np.full(len(joint.area), 1e6))})
    warm = replace(built, loads=replace(built.loads, warmed=dict.fromkeys(built.blocks, 5.0)))
    keys = {_model_key(job, built, also) for also in ((), (built,), (wet,), (warm,))}
    assert len(keys) == 4


def test_what_the_key_of_the_model_leaves_out_is_in_that_of_the_sample():
    assert {field.name for field in fields(Joint)} >= _OF_SAMPLES
    assert {field.name for field in fields(GapLaw)} >= _OF_SAMPLES
