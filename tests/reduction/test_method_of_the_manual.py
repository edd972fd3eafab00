"""The method of docs/extending/reduction.md: exact at rest, frequencies from above."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

import romdam
from romdam.effects.full_order import assemble_full
from romdam.linalg.factor import Factor
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.synthesis import REDUCTORS, reduce_scene_twice
from romdam.scene.build import build_scene

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "extending" / "reduction.md"
COUNT = 6  # lowest frequencies that are compared


@pytest.fixture(scope="module")
def models():
    """The mesh of two cantilevers, and its coarse and finer model by the class of the page."""
    names = {"__name__": PAGE.stem}
    for code in re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.M | re.S):
        exec(compile(code, str(PAGE), "exec"), names)
    config = romdam.load_config(ROOT / "configs" / "two_cantilevers.yaml").config
    scene = build_scene(config, ROOT / "configs", "two_cantilevers.yaml")
    coarse, fine = reduce_scene_twice(
        scene, ModeChoice(count=0), config.damping, reductors=(names["Guyan"](), *REDUCTORS)
    )
    return assemble_full(scene, config.damping), coarse, fine


def test_the_method_of_the_page_reduces_the_blocks(models):
    _, coarse, _ = models
    assert {block.report["method"] for block in coarse.basis.values()} == {"guyan"}


def test_the_model_has_the_displacement_of_the_mesh_at_rest(models):
    mesh, *reduced = models
    rest = mesh.observe @ Factor(mesh.K).solve(mesh.force)
    for system in (model.system for model in reduced):
        at_rest = system.observe @ (system.force / system.K.diagonal())
        assert np.abs(at_rest - rest).max() < 1e-10 * np.abs(rest).max()


def test_frequencies_are_bounds_from_above(models):
    mesh, coarse, fine = models
    omega2 = np.sort(eigsh(mesh.K, COUNT, mesh.M, sigma=0.0, return_eigenvectors=False))
    errors = [np.sqrt(np.sort(model.system.K.diagonal())[:COUNT] / omega2) - 1.0 for model in (coarse, fine)]
    assert min(error.min() for error in errors) > -1e-9
    assert errors[0][0] < 1.5e-4 and errors[0].max() < 0.095 and errors[1].max() < 2.5e-5, errors
