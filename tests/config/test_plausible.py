"""What is legal and unusual is said with key, value and what is usual; the shipped jobs give no cause."""

from pathlib import Path

import pytest
from test_messages import example

from romdam.config import load_config, parse_config
from romdam.config.plausible import _USUAL, check_assumptions

CONFIGS = Path(__file__).parents[2] / "configs"


def put(*changes):
    raw = example()
    for key, value in changes:
        place = raw
        for part in key[:-1]:
            place = place.setdefault(part, {}) if isinstance(place, dict) else place[part]
        place[key[-1]] = value
    return parse_config(raw, "dam.yaml")


@pytest.mark.parametrize(
    ("key", "value", "parts"),
    [
        (("materials", "concrete", "E"), 30, ["materials.concrete.E: 30 Pa", "30 GPa"]),
        (("materials", "concrete", "rho"), 2.4, ["materials.concrete.rho: 2.4 kg/m3", "2400 kg/m3"]),
        (("damping", "rayleigh", "ratio"), 0.5, ["damping.rayleigh.ratio: 0.5", "2 % to 10 %"]),
        (("damping",), {"modal": [0.05, 0.6]}, ["damping.modal[1]: 0.6"]),
        (("joints", "contraction", "gap"), "10 m", ["joints.contraction.gap: 10 m", "millimetres"]),
        (("loads", "gravity"), [0, 0, 9.81], ["loads.gravity: [0.0, 0.0, 9.81]", "does not point down"]),
        (("loads", "gravity"), [0, 0, -1], ["its size is 1 m/s2", "9.81"]),
        (("records", 0, "unit"), "1 km/s2", ["records[0].unit: one unit is 1000 m/s2"]),
        (("transient", "finest_step"), "0.5 s", ["transient.finest_step: 0.5 s"]),
        (("model", "memory"), 8, ["model.memory: 8 bytes", "8 GB"]),
        (("suite",), {"scales": [50]}, ["suite.scales[0]: 50"]),
        (
            ("ground",),
            {"along": {"axis": "x", "velocity": "1e-9 m/s"}},
            ["ground.along.velocity: 1e-09 m/s is unusual", "1000 to 5000 m/s"],
        ),
        (
            ("ground",),
            {"along": {"axis": "x", "incoherence": {"shear_velocity": "2 km/h"}}},
            ["ground.along.incoherence.shear_velocity: 0.555556 m/s is unusual"],
        ),
        (("loads", "weight"), "staged", ["loads.weight: staged does nothing"]),
        (("model", "order"), "full", ["model.modes: does nothing at full order"]),
    ],
)
def test_what_is_unusual_is_said(key, value, parts):
    found = check_assumptions(
        put((key, value), (("outputs", "output_interval"), None))
    )  # which would have to fit
    assert any(all(part in line for part in parts) for line in found), found


@pytest.mark.parametrize(("mu_s", "mu_d", "said"), [(0.6, 0.4, 1), (0.4, 0.6, 0), (0.5, 0.5, 0)])
def test_friction_that_falls_with_the_speed_is_said_to_stick_and_slide(mu_s, mu_d, said):
    law = {"mu_s": mu_s, "mu_d": mu_d, "v_c": "0.1 m/s"}
    joint = ("joints", "contraction")
    found = check_assumptions(put(((*joint, "velocity_friction"), law), ((*joint, "shear_stiffness"), 8e9)))
    assert sum("stick and slide by turns" in line for line in found) == said


def test_one_number_for_both_directions_is_told_once():
    joint = ("joints", "contraction")
    found = check_assumptions(put(((*joint, "friction"), 1.9), ((*joint, "shear_stiffness"), 8e9)))
    assert [line.split(":")[0] for line in found] == ["joints.contraction.friction"]


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda p: p.stem)
def test_the_shipped_jobs_are_usual(path):
    assert check_assumptions(load_config(path).config) == ()


def test_every_range_is_of_a_key_that_exists():
    for model, ranges in _USUAL.items():
        assert set(ranges) <= set(model.model_fields)
