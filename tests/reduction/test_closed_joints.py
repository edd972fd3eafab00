"""Frequencies with closed joints that `romdam check` tells, against those of the mesh; what it skips."""

from dataclasses import replace

import numpy as np
import pytest
from test_cli import config, edited  # noqa: F401

import romdam
from romdam.pipelines.check import check
from romdam.pipelines.modes import ModesOptions, modes
from romdam.pipelines.run import Clock, build_model, silent
from romdam.reduction import closed_joints
from romdam.reduction.closed_joints import closed_frequencies


@pytest.fixture
def system(config):  # noqa: F811
    return build_model(romdam.load_config(config), Clock(silent)).system


def test_they_are_those_of_the_bonded_mesh(config, tmp_path):  # noqa: F811
    """The nodes of the gaps are kept, so the lowest are the mesh's, but for what modes leave out."""
    job = romdam.load_config(config)
    found = check(job).closed_frequencies
    mesh = modes(job, tmp_path / "m", ModesOptions("bonded", 5)).dataset.frequency.values
    np.testing.assert_allclose(found, mesh, rtol=2e-3)
    open_ = np.sort([f for block in check(job).blocks.values() for f in block["frequencies_hz"]])
    assert found[0] > open_[0], "springs stiffen"


def test_rigid_joints_are_the_limit_of_stiff_ones(system):
    n = len(system.law)
    stiff = closed_frequencies(replace(system, law=replace(system.law, K_n=np.full(n, 1e16))), 5)
    rigid = closed_frequencies(replace(system, law=replace(system.law, K_n=np.full(n, np.inf))), 5)
    np.testing.assert_allclose(rigid, stiff, rtol=1e-5)
    none = closed_frequencies(replace(system, law=replace(system.law, K_n=np.zeros(n))), 5)
    blocks = np.sort(np.sqrt(system.K.diagonal()))[:5] / (2.0 * np.pi)
    np.testing.assert_allclose(none, blocks, rtol=1e-9)
    assert (rigid >= none * (1.0 - 1e-9)).all()


def test_a_large_model_has_none_and_check_says_so(config, monkeypatch):  # noqa: F811
    monkeypatch.setattr(closed_joints, "MOST", 3)
    found = check(romdam.load_config(config))
    assert found.closed_frequencies == ()
    assert any(text.startswith("frequencies with closed joints") for text in found.skipped)


def test_check_says_what_it_skips_and_what_fits_no_factors(config, monkeypatch):  # noqa: F811
    from romdam.linalg import solvers
    from romdam.linalg.solvers import Estimate, Solving, without_factors

    both = [Estimate("multifrontal", 500.0, 90e9), Estimate("multigrid", 900.0, 12e9)]
    monkeypatch.setattr(solvers, "estimates", lambda unknowns, columns: both)
    told = without_factors(2_000_000, 60, Solving(memory=20e9), "part rock")
    assert told.startswith("part rock: multigrid for 2000000 unknowns, factors do not fit in 20.0 GB")
    assert "multifrontal 90.0 GB" in told
    assert without_factors(2_000_000, 60, Solving(memory=100e9), "part rock") == ""
    edited(config, pipeline="suite", suite={"scales": [1, 2]}, transient={"accuracy": "1 %"}, outputs={})
    skipped = " ".join(check(romdam.load_config(config)).skipped)
    assert "equilibrium at rest of each sample" in skipped and "transient.accuracy" in skipped
