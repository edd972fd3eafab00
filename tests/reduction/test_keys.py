"""Bases that version 0.1.0 stored are found under the keys that it gave them."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix

import romdam
from romdam.config import parse_config
from romdam.fem.gaps import gap_operators
from romdam.reduction.interface import joint_interface
from romdam.reduction.methods.craig_bampton import ModeChoice
from romdam.reduction.storage.keys import block_key, part_keys
from romdam.scene.build import build_scene
from romdam.scene.ties import scene_parts

sys.path.append(str(Path(__file__).parents[1] / "scene"))
from scene_builders import two_boxes

REST = {
    "materials": {"concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0}},
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}


@pytest.fixture(autouse=True)
def version(monkeypatch):
    monkeypatch.setattr(romdam, "__version__", "0.1.0")


def scene(raw):
    return build_scene(parse_config(REST | raw, "s.yaml"), Path(), "s.yaml")


@pytest.mark.parametrize(
    ("residual_vectors", "key"),
    [
        (0, "98b4c82ed7cd41db7977d3b736963153b582a605c9e5324c045851ce6de565ff"),
        (2, "75011bab974289983000699795b459b09d6ce00c638bcf8506e469e1ea93c09f"),
    ],
)
def test_key_of_a_block(residual_vectors, key):
    built = scene(two_boxes())
    interface = joint_interface(gap_operators(built, 1)["left"], built.fixed["left"])
    choice = ModeChoice(5, residual_vectors=residual_vectors)
    assert block_key(built.blocks["left"], built.fixed["left"], interface, choice) == key


def test_keys_of_a_part():
    raw = two_boxes()
    built = scene(
        {k: v for k, v in raw.items() if k != "joints"} | {"ties": {"t": {"between": ["left", "right"]}}}
    )
    (part,) = scene_parts(built).values()
    nothing = csr_matrix((0, 3 * part.nodes)), np.zeros(3 * part.nodes)
    assert part_keys(part, built, *nothing, ModeChoice(cutoff=9.0)) == {
        "left": "273791d83e14e838417fb178e32c02515aa68cb25fac586a4a24a68ffb7f5729",
        "right": "2d33dd61d13ae90633597c5c88b5434410f70abca8a86e8f6d676f7884aefe74",
    }
