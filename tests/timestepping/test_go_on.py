"""A run that begins where another ended, against one run of both ground motions with rest between them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import romdam
from romdam.core.errors import ConfigError
from romdam.core.system import OPEN, SLIP
from romdam.pipelines.run import Clock, build_model, silent
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate
from romdam.timestepping.steps import Steps

G, DT = 9.81, 0.002
BOX = {"size": [2, 2, 2], "element_size": 1.0}
FRICTION = {"friction": 0.3, "shear_stiffness": "10 GPa/m"}
JOINTS = {
    "friction": FRICTION,
    "opening alone": {},
    "bond": FRICTION | {"cohesion": "30 kPa", "tensile_strength": "20 kPa"},
    "key": {
        "shear_stiffness": "10 GPa/m",
        "shear_key": {"depth": "0.2 mm", "directions": ["j"]},
        "friction": 0.3,
    },
    "static friction": FRICTION | {"friction_static": 0.5},
    "dashpot": FRICTION | {"viscosity": 1e5},
    "water in cracks": FRICTION | {"cohesion": "30 kPa", "tensile_strength": "20 kPa"},
    "cracked base": FRICTION,
}
INTEGRATORS = ["adaptive", "modal", "generalized_alpha"]


def pulses(size, count, seconds, axes=(1,)):
    t = np.arange(round(seconds / DT) + 1) * DT
    wave = np.where((t > 0.05) & (t < 0.05 + count * 0.3), size * np.sin(2.0 * np.pi * (t - 0.05) / 0.3), 0.0)
    acc = np.zeros((3, len(t)))
    acc[list(axes)] = wave
    return acc


def prepared(joint, integrator, order="reduced", damped_at=(20.0, 200.0), **loads):
    base = {"gravity": [0, 0, -G]} | loads
    job = {
        "materials": {"concrete": {"E": "3 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
        "blocks": {
            "base": {"material": "concrete", "box": {"origin": [0, 0, -2], **BOX}},
            "block": {"material": "concrete", "box": {"origin": [0, 0, 0], **BOX}},
        },
        "supports": [{"block": "base", "face": "zmin"}],
        "joints": {"foot": {"between": ["base", "block"], "normal_stiffness": "30 GPa/m", **joint}},
        "loads": base,
        "damping": {"rayleigh": {"frequencies": list(damped_at), "ratio": "5 %"}},
        "records": [{"file": "x", "components": {"y": 1}}],
        "model": {"order": "full"} if order == "full" else {"modes": 12},
        "transient": {"finest_step": "0.5 ms", "integrator": integrator, "tolerance": 1e-11},
        "outputs": {"error_estimate": False, "nodes": {"top": {"block": "block", "at": [2, 2, 2]}}},
    }
    return build_model(romdam.load_config(job), Clock(silent)).prepared


def parts_and_whole(ready, first, second, start=None):
    """The second part that begins in the end of the first, and the same rows of one run of both."""
    cuts = (4,) if ready.integrator.name == "adaptive" else ()
    settings = Settings(Steps(DT, 1, cuts), tolerance=1e-11, start=start)
    one, whole = simulate(ready, [first, np.hstack([first, second[:, 1:]])], settings)
    again = simulate(ready, [second], replace(settings, start=one.final))[0]
    return one, again, whole


def assert_goes_on(one, again, whole, within=1e-9):
    rows = slice(len(one.time) - 1, None)
    for name in ("jump", "traction", "disp", "vel"):
        now, then = getattr(again, name), getattr(whole, name)
        assert np.abs(now - then[rows]).max() <= within * np.abs(then).max() > 0.0, name
    assert (again.state == whole.state[rows]).all()
    assert again.stats["ledger_imbalance"] <= 1e-9


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(
    "joint",
    [
        pytest.param(
            joint,
            marks=[pytest.mark.slow] * (joint not in ("friction", "opening alone", "bond", "cracked base")),
        )
        for joint in JOINTS
    ],
)
def test_a_run_goes_on_where_another_ended(joint, integrator):
    loads = {}
    if joint == "water in cracks":
        water = {"joints": ["foot"], "level": "1 m", "downstream": [0, 1, 0], "crack": "full"}
        loads = {"joint_water": [water]}
    ready = prepared(JOINTS[joint], integrator, **loads)
    if joint == "cracked base":
        water = {"joints": ["foot"], "level": "1 m", "downstream": [0, 1, 0], "crack": "redrawn"}
        pushed = {"block": "block", "at": [2, 2, 2], "force": ["0 kN", "50 kN", "0 kN"]}
        loads = {"joint_water": [water | {"earthquake": "zero"}], "force": [pushed]}
    # without shear it opens where it is lifted by more than g
    first, second = (9.0, -6.0) if JOINTS[joint] else (14.0, -12.0)
    if joint == "water in cracks":  # shaken harder it rocks, which makes more of the solver's tolerance
        second = -4.0
    axes = (1,) if JOINTS[joint] else (2,)
    one, again, whole = parts_and_whole(ready, pulses(first, 2, 1.2, axes), pulses(second, 2, 1.2, axes))
    assert (one.state == OPEN).any() or (one.state == SLIP).any()
    assert_goes_on(one, again, whole)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_run_goes_on_in_the_midst_of_motion(integrator):
    first, second = pulses(9.0, 2, 0.5), pulses(-6.0, 1, 0.5)
    ready = prepared(FRICTION, integrator)
    assert_goes_on(*parts_and_whole(ready, first, second))


def test_merged_contacts_go_on_merged_and_along_another_axis():
    ready = prepared(FRICTION, "adaptive")
    one, again, whole = parts_and_whole(ready, pulses(9.0, 2, 1.2), pulses(-6.0, 2, 1.2))
    assert any(kept is not None for kept in ready.merged.values())
    assert again.stats["integrated_gaps"] < len(ready.system.law)
    assert_goes_on(one, again, whole)
    # the whole is integrated gap by gap from the beginning; shaken harder it rocks, on either of two corners
    assert_goes_on(*parts_and_whole(ready, pulses(9.0, 2, 1.2), pulses(-4.0, 2, 1.2, (0, 1))), within=1e-8)


def test_full_order_goes_on():
    ready = prepared(FRICTION, "generalized_alpha", order="full")
    assert_goes_on(*parts_and_whole(ready, pulses(9.0, 2, 0.8), pulses(-6.0, 1, 0.6)))


def test_a_state_goes_on_twice():
    """Three parts, the second from the first and the third from the second."""
    ready = prepared(FRICTION, "adaptive")
    one, again, _ = parts_and_whole(ready, pulses(9.0, 2, 1.2), pulses(-6.0, 2, 1.2))
    both = np.hstack([pulses(9.0, 2, 1.2), pulses(-6.0, 2, 1.2)[:, 1:]])
    settings = Settings(Steps(DT, 1, (4,)), tolerance=1e-11)
    third = simulate(ready, [pulses(5.0, 2, 1.0)], replace(settings, start=again.final))[0]
    whole = simulate(ready, [np.hstack([both, pulses(5.0, 2, 1.0)[:, 1:]])], settings)[0]
    assert_goes_on(replace(one, time=np.arange(both.shape[1])), third, whole)


def test_several_records_go_on_from_one_state_together():
    ready = prepared(FRICTION, "adaptive")
    settings = Settings(Steps(DT, 1, (4,)), tolerance=1e-11)
    one = simulate(ready, [pulses(9.0, 2, 1.2)], settings)[0]
    seconds = [pulses(-6.0, 2, 1.2), pulses(5.0, 1, 0.8)]
    together = simulate(ready, seconds, replace(settings, start=one.final))
    for second, found in zip(seconds, together, strict=True):
        whole = simulate(ready, [np.hstack([pulses(9.0, 2, 1.2), second[:, 1:]])], settings)[0]
        assert_goes_on(one, found, whole)


@pytest.mark.parametrize(
    ("joint", "integrator", "loads", "message"),
    [
        (
            {**FRICTION, "friction": 0.4},
            "adaptive",
            {},
            r"friction at gap 0 of joint foot is 0.4, and was 0.3",
        ),
        ({**FRICTION, "gap": "1 mm"}, "adaptive", {}, "the gap at gap 0 of joint foot is 0.001, and was 0"),
        (JOINTS["bond"], "adaptive", {}, "law 1"),
        (
            FRICTION,
            "generalized_alpha",
            {},
            "state is of the integrator adaptive, and this run has generalized",
        ),
        (FRICTION, "adaptive", {"gravity": [0, 0, -5.0]}, "the force at unknown"),
    ],
)
def test_a_state_of_another_model_is_refused(joint, integrator, loads, message):
    settings = Settings(Steps(DT, 1, ()))
    one = simulate(prepared(FRICTION, "adaptive"), [pulses(9.0, 1, 0.2)], settings)[0]
    with pytest.raises(ConfigError, match=message):
        simulate(
            prepared(joint, integrator, **loads), [pulses(9.0, 1, 0.2)], replace(settings, start=one.final)
        )


def test_which_steps_are_tried_goes_on():
    """What was refused a hundred times in the first part is tried rarely from the beginning of the second."""
    ready = prepared(FRICTION, "adaptive")
    one, again, whole = parts_and_whole(ready, pulses(9.0, 2, 1.2), pulses(-6.0, 2, 1.2))
    refused = one.final.arrays["clock"][4:].reshape(2, -1)[0]
    assert refused[0] > 16
    assert_array_equal(again.final.arrays["clock"], whole.final.arrays["clock"])
    assert one.stats["refused_steps"] + again.stats["refused_steps"] == whole.stats["refused_steps"]
