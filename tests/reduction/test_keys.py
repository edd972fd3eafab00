"""Keys of reduced blocks: they change with what is reduced, and with the code that reduces it."""

from pathlib import Path

import numpy as np
import pytest
from scene_builders import two_boxes
from scipy.sparse import csr_matrix

import romdam
from romdam.config import parse_config
from romdam.fem.gaps import gap_operators
from romdam.reduction.interface import joint_interface
from romdam.reduction.methods.craig_bampton import ModeChoice
from romdam.reduction.storage import keys
from romdam.reduction.storage.keys import block_key, part_keys
from romdam.scene.build import build_scene
from romdam.scene.ties import scene_parts

REST = {
    "materials": {"concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0}},
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}


@pytest.fixture(autouse=True)
def version(monkeypatch):
    monkeypatch.setattr(romdam, "__version__", "0.1.0")
    monkeypatch.setattr(keys, "code_digest", lambda *rooms: "code")


def scene(raw):
    return build_scene(parse_config(REST | raw, "s.yaml"), Path(), "s.yaml")


@pytest.mark.parametrize(
    ("residual_vectors", "key"),
    [
        (0, "497b9e6b08b34453ff8bee6af73773de8a8a91699e3800e0726ae294f6d99feb"),
        (2, "79eacf4b39cbf126af05218bb663e4623958077bd5571172be20f5c9c6184cd6"),
    ],
)
def test_key_of_a_block(residual_vectors, key):
    built = scene(two_boxes())
    interface = joint_interface(gap_operators(built, 1)["left"], built.fixed["left"])
    choice = ModeChoice(5, residual_vectors=residual_vectors)
    loads = np.zeros((built.blocks["left"].points.size, 0))
    assert block_key(built.blocks["left"], built.fixed["left"], interface, loads, choice) == key
    loads = np.ones((built.blocks["left"].points.size, 1))
    assert block_key(built.blocks["left"], built.fixed["left"], interface, loads, choice) != key


def test_keys_of_a_part():
    raw = two_boxes()
    built = scene(
        {k: v for k, v in raw.items() if k != "joints"} | {"ties": {"t": {"between": ["left", "right"]}}}
    )
    (part,) = scene_parts(built).values()
    nothing = csr_matrix((0, 3 * part.nodes)), np.zeros(3 * part.nodes)
    assert part_keys(part, built, *nothing, ModeChoice(cutoff=9.0)) == {
        "left": "0ff71a784ffe48c8043f9d936ada7aca7a8149fb97546a8895a5e9c2832d02b5",
        "right": "6cc1ab63548632caf6bee05a6a6b5f053fe34d13d8c028230ade14c3473bca54",
    }
