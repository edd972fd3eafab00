"""`transient.accuracy` by quantity: what it reads, and what it refuses."""

import pytest
from suite_jobs import write_job

import romdam
from romdam.core.errors import ConfigError

FRICTION = {"friction": 0.6, "shear_stiffness": "8 GPa/m"}


def job_of(folder, accuracy, **keys):
    joints = {"gap": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"} | keys}
    transient = {"accuracy": accuracy}
    return romdam.load_config(write_job(folder, joints=joints, transient=transient)).config.transient


def test_each_quantity_has_its_accuracy(tmp_path):
    found = job_of(tmp_path, {"openings": "1 %", "residual_slips": "5 %"}, **FRICTION)
    assert found.step_accuracy == 0.01 and found.slip_accuracies == {"residual_slips": 0.05}
    found = job_of(tmp_path, {"slips": "2 %", "residual_slips": "5 %"}, **FRICTION)
    assert found.step_accuracy == 0.05 and found.slip_accuracies == {"slips": 0.02, "residual_slips": 0.05}


@pytest.mark.parametrize("name", ["slips", "residual_slips"])
def test_slips_of_a_job_without_shear_are_refused(tmp_path, name):
    with pytest.raises(
        ConfigError, match=rf"\.yaml:\d+: transient\.accuracy\.{name}: no joint .* leave it out"
    ):
        job_of(tmp_path, {name: "2 %"})
