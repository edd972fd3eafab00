"""Uplift at rest: what the base carries is the effective force, by hand."""

from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from romdam.config import parse_config
from romdam.effects.full_order import assemble_full
from romdam.postprocess.run_warnings import crack_warnings
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.equilibrium import static_equilibrium

G = 9.81
LENGTH, WIDTH, HEIGHT = 10.0, 2.0, 8.0
WEIGHT = 2400 * G * LENGTH * WIDTH * HEIGHT


def block(at, size, along):
    box = {"origin": at, "size": size, "element": "hex8", "element_size": [size[0], along, size[2]]}
    return {"material": "concrete", "box": box}


def scene_of(water, cells=5, E=3e10, rho=2400, level=None, **joint):
    """A block on a rock slab, heel at y = 0."""
    boxes = {"rock": ([0, 0, -2], [WIDTH, LENGTH, 2]), "dam": ([0, 0, 0], [WIDTH, LENGTH, HEIGHT])}
    raw = {
        "materials": {"concrete": {"E": E, "nu": 0.0, "rho": rho}},
        "blocks": {name: block(at, size, LENGTH / cells) for name, (at, size) in boxes.items()},
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": {"between": ["rock", "dam"], "normal_stiffness": 1e10, "shear_stiffness": 5e9}
            | {"friction": 0.8}
            | joint
        },
        "loads": {"gravity": [0, 0, -G], "joint_water": water},
        "records": [{"name": "r", "unit": "m/s2", "dt": 0.01, "components": {"x": {"file": "r.txt"}}}],
        "model": {"modes": 4},
        "damping": {"rayleigh": {"alpha": 0.5, "beta": 1e-4}},
        "transient": {"finest_step": 0.01},
    }
    if level is not None:
        raw["loads"]["hydrostatic"] = [{"level": level, "faces": [{"block": "dam", "face": "ymin"}]}]
    return build_scene(config := parse_config(raw, "dam.yaml"), Path(), "dam.yaml"), config


def system_of(scene, config, order):
    if order == "full":
        return assemble_full(scene, config.damping)
    return reduce_scene(scene, config.model, config.damping).system


def uplift(**keys):
    return [{"joints": ["base"], "level": 8.0, "downstream": [0, 1, 0], "tailwater": 1.0} | keys]


DRAINS = {"at": 1.3, "rule": "usbr"}
HEADS = [(0.0, 8.0), (1.3, 1.0 + 7.0 / 3.0), (LENGTH, 1.0)]


def trapezia(heads):
    """Resultant and moment about the heel of a piecewise linear head."""
    parts = [(a, b - a, p, q) for (a, p), (b, q) in pairwise(heads)]
    force = sum(d * (p + q) / 2 for _, d, p, q in parts)
    moment = sum(d * (a * (p + q) / 2 + d * (p + 2 * q) / 6) for a, d, p, q in parts)
    return 1000 * G * WIDTH * force, 1000 * G * WIDTH * moment


@pytest.mark.parametrize("order", ["reduced", "full"])
@pytest.mark.parametrize("stiffness", [1e10, "rigid"])
def test_the_base_carries_weight_less_uplift(order, stiffness):
    """Force and moment about the heel; weight, water on the face and uplift in balance with friction."""
    scene, config = scene_of(uplift(drains=DRAINS), level=8.0, normal_stiffness=stiffness)
    _, gaps = static_equilibrium(system_of(scene, config, order), 1e-10)
    (U, U_moment), thrust = trapezia(HEADS), 1000 * G * WIDTH * 8.0**2 / 2
    y = scene.joints["base"].position[:, 1]
    assert gaps.state.all()
    assert gaps.force[:, 0].sum() == pytest.approx(WEIGHT - U, abs=1e-12 * WEIGHT)
    moment = WEIGHT * LENGTH / 2 - U_moment + thrust * 8.0 / 3
    assert gaps.force[:, 0] @ y == pytest.approx(moment, abs=1e-12 * WEIGHT * LENGTH)
    shear = np.einsum("na,nak->k", gaps.force[:, 1:], scene.joints["base"].axes[:, 1:])
    assert shear == pytest.approx([0.0, -thrust, 0.0], abs=1e-12 * WEIGHT)


LIGHT = 1300.0  # density at which the heel opens


def crack_length(full):
    """Of a rigid section: effective stress linear from nothing at the crack's tip, by USACE's and USBR's way.

    Beyond the crack the uplift is the diagram's, from 8 m at the heel to 1 m at the toe; in it too, or 8 m.
    """
    weight, thrust = LIGHT * G * LENGTH * WIDTH * HEIGHT, 1000 * G * WIDTH * 8.0**2 / 2

    def beyond(a):
        """Tip that the effective resultant asks for, less a."""
        tip = 8.0 - 0.7 * a
        heads = [(0, 8.0), (a, 8.0), (a, tip), (LENGTH, 1.0)] if full else [(0, 8.0), (LENGTH, 1.0)]
        force, moment = trapezia(heads)
        from_toe = LENGTH - (weight * LENGTH / 2 + thrust * 8.0 / 3 - moment) / (weight - force)
        return LENGTH - 3.0 * from_toe - a

    return brentq(beyond, 0.1, 8.0), weight, thrust


@pytest.mark.parametrize("crack", ["unchanged", "full"])
def test_the_cracked_base_of_a_rigid_section(crack):
    """The tip is an element off at most, or two where what is missing keeps pressure from following."""
    length, weight, thrust = crack_length(crack == "full")
    off = []
    for cells in (16, 64):
        water = uplift(crack=crack)
        scene, config = scene_of(water, cells=cells, E=3e13, rho=LIGHT, level=8.0, shear_stiffness=1e10)
        _, gaps = static_equilibrium(system_of(scene, config, "reduced"), 1e-10)
        y = scene.joints["base"].position[:, 1]
        tip = 0.5 * (y[gaps.state == 0].max() + y[gaps.state > 0].min())
        off.append(abs(tip - length))
        (said,) = crack_warnings(
            config.loads.joint_water, scene, SimpleNamespace(state=gaps.state[None], jump=gaps.jump[None])
        )
        share = float(said.split("open over ")[1].split("%")[0]) / 100
        assert share == pytest.approx(tip / LENGTH, abs=0.006)
        assert f"crack: {crack}" in said and "unsafe where the crack is long" in said
        assert off[-1] < (2 if crack == "full" else 1) * LENGTH / cells
        total = gaps.acting[:, 0] + scene.joints["base"].water
        assert total.sum() == pytest.approx(weight, abs=1e-9 * weight)
        assert total @ y == pytest.approx(weight * LENGTH / 2 + thrust * 8 / 3, abs=1e-9 * weight * LENGTH)
        if crack == "full":
            open_ = y < tip
            head = (scene.joints["base"].water + gaps.water) / scene.joints["base"].area / 1000 / G
            assert head[open_] == pytest.approx(8.0)
            assert (gaps.water[~open_] == 0.0).all()
    assert off[1] < 0.4 * off[0]
