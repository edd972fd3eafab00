"""Keys of reduced blocks: they change with what is reduced, and with the code that reduces it."""

from pathlib import Path

import pytest
from scene_builders import two_boxes

import romdam
from romdam.config import parse_config
from romdam.config.sections.job import DampingConfig
from romdam.effects.scene_effects import scene_effects
from romdam.fem.assembly import Assembly
from romdam.fem.gaps import gap_operators
from romdam.reduction import reductor
from romdam.reduction.methods.craig_bampton import CraigBampton
from romdam.reduction.methods.free_interface import FreeInterface
from romdam.reduction.methods.out_of_core import CraigBamptonOutOfCore
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.reductor import basis_keys
from romdam.reduction.substructure import Substructure, assemble_block_loads
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
    monkeypatch.setattr(reductor, "code_digest", lambda *rooms: "code")


def scene(raw):
    return build_scene(parse_config(REST | raw, "s.yaml"), Path(), "s.yaml")


def substructure(built, part):
    assembly = Assembly(built.blocks)
    effects = scene_effects(built, DampingConfig(), 1, assembly)
    loads = assemble_block_loads(built.blocks, gap_operators(built, 1), 1, effects)
    return Substructure(scene_parts(built)[part], built, loads, assembly)


@pytest.mark.parametrize(
    ("residual_vectors", "key"),
    [
        (0, "8c70898266c210c6d7b95351598344b800c6ef1a034611422bdb316fa5522e01"),
        (2, "bd82d571148b3b122f054346a1ddf732241b8c30a59a78ca9df6c6a065277419"),
    ],
)
def test_key_of_a_block(residual_vectors, key):
    raw, choice = two_boxes(), ModeChoice(5, residual_vectors=residual_vectors)
    block = substructure(scene(raw), "left")
    assert basis_keys(CraigBampton(), block, choice) == {"left": key}
    for other in (CraigBamptonOutOfCore(), FreeInterface()):
        assert basis_keys(other, block, choice) != {"left": key}, "another method"
    assert basis_keys(CraigBampton(), block, ModeChoice(6, residual_vectors=residual_vectors)) != {
        "left": key
    }
    pressed = raw | {"loads": {"pressure": [{"block": "left", "face": "xmin", "value": 1e5}]}}
    assert basis_keys(CraigBampton(), substructure(scene(pressed), "left"), choice) != {"left": key}


def test_keys_of_a_part():
    raw = two_boxes()
    built = scene(
        {k: v for k, v in raw.items() if k != "joints"} | {"ties": {"t": {"between": ["left", "right"]}}}
    )
    keys = basis_keys(FreeInterface(), substructure(built, "left+right"), ModeChoice(cutoff=9.0))
    assert keys == {
        "left": "90018ddae473a774f789b8745ad96c81aa25868c48c21dab96c797379d04b201",
        "right": "9e7a7dcaa2bc463424db567f42e99f3006ded1b58f8f74d42c9c84080d3adca3",
    }
