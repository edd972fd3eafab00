"""Scenes from small dictionaries."""

from pathlib import Path

import pytest

from romdam.config import parse_config
from romdam.scene.build import build_scene

_REST = {
    "materials": {"concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0}},
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"order": "full"},
    "transient": {"finest_step": 0.01},
}


@pytest.fixture
def make():
    """raw scene keys -> Scene; messages name the file `s.yaml`."""

    def build(raw, folder=Path()):
        return build_scene(parse_config(_REST | raw, "s.yaml"), Path(folder), "s.yaml")

    return build
