"""Percentiles by area, acceptance of faces and stress at rest against closed forms."""

import dataclasses
import json

import numpy as np
import pytest

from romdam.postprocess.maxima import face_rows, maxima
from romdam.postprocess.stress.faces import LIMITS, MET, area_percentiles, face_demand, verdict
from romdam.postprocess.stress.summary import DCR_LEVELS, StressHistory, summarise
from romdam.results.dataset import Timing, build_dataset
from romdam.results.variables import VARIABLES

from .conftest import make_case

STRENGTH = 2e6


@pytest.mark.parametrize(
    ("percent", "value"), [(5, 1), (10, 1), (20, 2), (30, 3), (31, 4), (98, 4), (100, 4)]
)
def test_percentiles_are_of_the_area(percent, value):
    values, area = np.array([4.0, 2.0, np.nan, 1.0, 3.0]), np.array([7.0, 1.0, 50.0, 1.0, 1.0])
    assert area_percentiles(values, area, np.array([float(percent)])) == [value]


def test_percentiles_of_nothing_are_none():
    assert np.isnan(area_percentiles(np.array([np.nan]), np.ones(1), np.array([98.0, 100.0]))).all()


@pytest.mark.parametrize(("kind", "duration", "area"), [("arch dam", 0.4, 20.0), ("gravity dam", 0.3, 15.0)])
def test_acceptance_is_met_on_its_limits_and_not_beyond(kind, duration, area):
    limits = LIMITS[kind]
    np.testing.assert_allclose(
        limits.duration_at(np.array([1.0, 1.5, 2.0, 3.0])), [duration, 0.5 * duration, 0, 0]
    )
    line = duration * (2.0 - DCR_LEVELS)

    def met(ratio, times, share):
        found = face_demand(
            np.array([ratio, 0.5]), np.stack([times, 0 * times]), np.array([share, 100 - share]), DCR_LEVELS
        )
        return tuple(criterion == MET for criterion in found.judged(DCR_LEVELS, limits))

    assert met(2.0, line * (1 - 1e-12), area) == (True, True, True)
    assert met(2.001, line * (1 - 1e-12), area) == (False, True, True)
    assert met(2.0, line + 1e-6 * (DCR_LEVELS == 1.5), area) == (True, False, True)
    assert met(2.0, line * (1 - 1e-12), area + 0.1) == (True, True, False)
    assert verdict((True, True, True)) == "passes" and verdict((False, True, False)) == "fails: ratio, area"


def test_face_that_the_ring_covers_passes_nothing():
    nothing = face_demand(np.zeros(0), np.zeros((0, len(DCR_LEVELS))), np.zeros(0), DCR_LEVELS)
    judged = nothing.judged(DCR_LEVELS, LIMITS["arch dam"])
    assert verdict(judged) == "not judged: all of it is in the ring"


def swinging(at_rest, swing, ring=()):
    """Five periods of 1 s of uniaxial at_rest + swing sin, in strengths; twice that at nodes `ring`."""
    case, time = make_case(), np.linspace(0.0, 5.0, 5001)
    sites = case.scene.stress
    left = dataclasses.replace(sites.blocks["left"], ring=np.isin(np.arange(8), ring))
    sites = dataclasses.replace(sites, blocks={"left": left}, probes={}, sections=())
    factor = 1.0 + np.isin(np.arange(8), ring)
    stress = np.zeros((len(time), 8, 6))
    stress[..., 2] = STRENGTH * (at_rest + swing * np.sin(2 * np.pi * time))[:, None] * factor
    summary = summarise(sites, StressHistory({}, {"left": stress.reshape(len(time), -1)}), time)
    scene = dataclasses.replace(case.scene, stress=sites)
    return dataclasses.replace(case, scene=scene, stress=summary)


def value(case, name):
    return np.asarray(VARIABLES[name].get(case))


def test_change_is_what_the_shaking_adds():
    """1.2 + 0.5 sin: above 1 where sin > -0.4, (pi + 2 asin 0.4) / 2 pi of the time."""
    case = swinging(1.2, 0.5)
    np.testing.assert_allclose(value(case, "demand_capacity_ratio"), 1.7)
    np.testing.assert_allclose(value(case, "change_demand_capacity_ratio"), 0.5)
    np.testing.assert_allclose(value(case, "start_principal_stress"), 1.2 * STRENGTH)
    share = 0.5 + np.arcsin(0.4) / np.pi
    np.testing.assert_allclose(value(case, "cumulative_inelastic_duration")[:, 0], 5.0 * share, rtol=1e-5)
    np.testing.assert_array_equal(value(case, "change_inelastic_duration"), 0.0)
    np.testing.assert_allclose(value(case, "face_start_overstressed_share"), 100.0)
    np.testing.assert_array_equal(value(case, "acceptance")[0, 0], [[1, 0, 0], [1, 0, 0]])
    np.testing.assert_array_equal(value(case, "acceptance")[0, 1], 1)


def test_ring_is_left_out_of_what_is_said_of_a_face(job):
    """The face is nodes 4 to 7; node 4, a quarter of it, has twice the stress of the others."""
    case = swinging(0.0, 0.9, ring=[4])
    np.testing.assert_allclose(value(case, "ring_share"), 25.0)
    np.testing.assert_allclose(value(case, "face_principal_stress"), 0.9 * STRENGTH)
    np.testing.assert_array_equal(value(case, "acceptance"), 1)
    assert value(case, "max_principal_stress").max() == pytest.approx(1.8 * STRENGTH)
    assert value(swinging(0.0, 0.9), "face_principal_stress") == pytest.approx(0.9 * STRENGTH)
    dataset = build_dataset(case, job, Timing({}, {}), None)
    rows = {name: number for name, number, *_ in maxima(dataset)}
    assert rows["largest principal stress"] == pytest.approx(1.8 * STRENGTH)
    assert rows["largest principal stress outside the ring"] == pytest.approx(0.9 * STRENGTH)
    assert rows["principal stress, 98 % of the area"] == pytest.approx(0.9 * STRENGTH)
    assert rows["demand-capacity ratio"] == rows["demand-capacity ratio of the change"] == pytest.approx(1.8)
    assert rows["demand-capacity ratio outside the ring"] == pytest.approx(0.9)
    assert rows["demand-capacity ratio of the change outside the ring"] == pytest.approx(0.9)
    above = 5.0 * (0.5 - np.arcsin(1 / 1.8) / np.pi)
    for name in ("cumulative inelastic duration", "inelastic duration of the change"):
        assert rows[name] == pytest.approx(above, rel=2e-3) and rows[f"{name} outside the ring"] == 0.0
    assert "left.zmax 1.8 MPa" in dataset.attrs["stress_statement"]
    assert "leaves out 25 % of its area" in dataset.attrs["stress_statement"]
    assert [row[-1] for row in face_rows(dataset)] == ["passes", "passes"]
    assert json.loads(dataset.attrs["configuration"])


def test_nothing_passes_on_a_face_that_is_mostly_ring(job):
    """What it misses outside the ring it misses; 0.9 and 2.1 strengths at node 7, three quarters are ring."""
    case = swinging(0.0, 0.9, ring=[4, 5, 6])
    np.testing.assert_array_equal(value(case, "acceptance"), -1)
    dataset = build_dataset(case, job, Timing({}, {}), None)
    assert [row[-1] for row in face_rows(dataset)] == ["undecided: most of it is in the ring"] * 2
    assert "75 % of its area, so that no acceptance is stated" in dataset.attrs["stress_statement"]
    dataset = build_dataset(swinging(0.0, 2.1, ring=[4, 5, 6]), job, Timing({}, {}), None)
    assert {row[-1] for row in face_rows(dataset)} == {"fails: ratio, duration, area"}
    np.testing.assert_array_equal(value(swinging(0.0, 0.9, ring=[4, 5]), "acceptance"), 1)  # half is not most


def test_stress_above_the_strength_at_rest_is_said(job):
    dataset = build_dataset(swinging(1.2, 0.5), job, Timing({}, {}), None)
    assert "100 % of its area above the strength before the shaking" in dataset.attrs["stress_statement"]


def test_a_node_that_is_more_than_two_percent_of_its_face_is_said(job):
    """Node 7 has the largest stress, and 25 % of the face; with 1.9 % it decides nothing."""
    case, said = swinging(0.0, 0.9), "; one node is more than 2 % of this face; the ring leaves out"
    largest = dict(case.stress.largest)
    largest["principal"] = largest["principal"] + np.arange(8.0)
    case = dataclasses.replace(case, stress=dataclasses.replace(case.stress, largest=largest))
    assert said in build_dataset(case, job, Timing({}, {}), None).attrs["stress_statement"]
    sites = case.scene.stress
    (face,) = sites.faces
    area = face.area.sum() * np.where(face.rows == 7, 0.019, 0.327)
    sites = dataclasses.replace(sites, faces=(dataclasses.replace(face, area=area),))
    finer = dataclasses.replace(case, scene=dataclasses.replace(case.scene, stress=sites))
    assert said not in build_dataset(finer, job, Timing({}, {}), None).attrs["stress_statement"]


def test_worst_instant_is_that_outside_the_ring():
    case = swinging(0.0, 0.9, ring=[4])
    assert value(case, "worst_principal_time") % 1.0 == pytest.approx(0.25)
    np.testing.assert_allclose(value(case, "face_worst_principal_stress"), 0.9 * STRENGTH)
