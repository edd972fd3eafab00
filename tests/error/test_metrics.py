"""The measures of error on numbers worked by hand, and how a statement of them is written."""

import json

import numpy as np
import pytest
import xarray as xr

from romdam.error.metrics import (
    FLOOR,
    RelativeError,
    energy_error,
    largest_difference,
    magnitude_error,
    opening_error,
    opening_peak,
    opening_peaks,
    peak_bound,
    relative_l2,
)
from romdam.error.statement import ErrorStatement, sentences

BETTER = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, -1.0], [0.0, 4.0, -2.0]])  # norm of the first two gaps 5
JOINTS = {"left": slice(0, 2), "right": slice(2, 3)}


def test_each_joint_is_measured_on_its_own_gaps_and_by_its_own_size():
    opening = BETTER + np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1], [0.0, 0.4, 0.2]])
    error = opening_error(opening, BETTER, JOINTS)
    assert error.joints["left"].l2 == pytest.approx(0.5 / 5.0)
    assert error.joints["left"].peak == pytest.approx(0.4 / 4.0)
    assert error.joints["right"].l2 == pytest.approx(np.hypot(0.1, 0.2) / np.hypot(1.0, 2.0))
    assert error.joints["right"].peak == 0.0, "neither opens: both peaks are the start's zero"
    assert error.l2 == pytest.approx(np.sqrt(0.25 + 0.05) / np.sqrt(30.0))
    assert error.peak == pytest.approx(0.1)
    assert opening_error(opening, BETTER).joints == {}


def test_a_joint_that_hardly_moves_is_measured_by_a_share_of_all():
    """By a hundredth of the mean and of the largest opening over all gaps, not by its own."""
    better = BETTER * (1.0, 1.0, -1e-4)
    opening = better * (1.0, 1.0, 1.5)
    error = opening_error(opening, better, JOINTS).joints["right"]
    mean = np.linalg.norm(better) / np.sqrt(better.size)
    assert error.l2 == pytest.approx(0.5e-4 * np.sqrt(5.0) / (FLOOR * mean * np.sqrt(3.0)))
    assert error.peak == pytest.approx(0.5 * 2e-4 / (FLOOR * 4.0))


def test_sign_counts_in_openings_and_not_in_displacements():
    values, better = np.array([[1.0], [-3.0]]), np.array([[1.0], [-2.0]])
    assert opening_error(values, better).peak == 0.0
    assert magnitude_error(values, better).peak == pytest.approx(0.5)
    assert magnitude_error(values, better).l2 == pytest.approx(1.0 / np.sqrt(5.0))
    assert largest_difference(values, better) == pytest.approx(0.5)


def test_peaks_of_all_places_differ_where_the_largest_agrees_by_chance():
    """Largest openings 3, 4, 0 against 2, 4, 0, in other rows: 1 over sqrt(20), where the largest agrees."""
    better = np.array([[2.0, 0.0, -1.0], [0.0, 4.0, 0.0]])
    values = np.array([[0.0, 4.0, 0.0], [3.0, 0.0, -9.0]])
    assert opening_peak(values, better) == 0.0
    assert opening_peaks(values, better) == pytest.approx(1.0 / np.sqrt(20.0))
    assert opening_peaks(1.5 * values, better) == pytest.approx(np.hypot(2.5, 2.0) / np.sqrt(20.0))
    assert opening_peaks(values, better, 10.0) == pytest.approx(1.0 / np.sqrt(300.0))
    assert magnitude_error(values, better).peak == pytest.approx(5.0 / 4.0)
    assert magnitude_error(values, better, peaks=True).peak == pytest.approx(np.sqrt(65.0) / np.sqrt(21.0))


def test_peaks_that_agree_by_chance_are_bounded_by_what_differs_near_them():
    """Two histories with one peak, at other times and gaps: 10 and 9 stand against 8.5 and 10."""
    better = np.array([[0.0, 1.0], [10.0, 8.5], [3.0, 7.9]])
    values = np.array([[0.0, 4.0], [9.0, 10.0], [3.0, 2.0]])
    assert opening_peak(values, better) == 0.0
    assert peak_bound(values, better) == pytest.approx(0.15), "7.9 is farther than a fifth from the peak"
    assert peak_bound(better, values) == pytest.approx(0.15)
    assert opening_error(values, better, peak="bound").peak == pytest.approx(0.15)
    assert opening_error(values, better).peak == 0.0
    assert peak_bound(values, better, 20.0) == pytest.approx(1.5 / 20.0)


def test_bound_of_a_peak_is_never_less_than_what_it_is_off():
    rng = np.random.default_rng(7)
    for _ in range(200):
        better = rng.normal(size=(30, 4)) - rng.uniform(-1.0, 5.0)
        values = better + rng.uniform(0.0, 0.5) * rng.normal(size=(30, 4))
        assert peak_bound(values, better) >= opening_peak(values, better)


def test_energy_is_compared_in_its_norm():
    error = energy_error(np.array([0.0, 4.0, 5.0]), np.array([0.0, 36.0, 45.0]))
    assert error.l2 == pytest.approx(1.0 / 3.0) and error.peak == pytest.approx(1.0 / 3.0)


def test_nothing_against_nothing_is_no_error():
    still, nowhere = np.zeros((3, 2)), np.zeros((3, 0))
    assert relative_l2(still, still) == largest_difference(still, still) == 0.0
    assert opening_error(still, still) == magnitude_error(nowhere, nowhere) == RelativeError(0.0, 0.0)
    assert energy_error(still[:, 0], still[:, 0]) == RelativeError(0.0, 0.0)


def test_estimate_is_stated_for_each_joint_in_the_order_of_the_result():
    error = RelativeError(0.2, 0.1, {"left": RelativeError(0.4, 0.3), "right": RelativeError(0.6, 0.5)})
    dataset = xr.Dataset(coords={"joint": ["right", "left"]})
    ErrorStatement("estimate", "about 20 %", {"opening": error}, {"cpu_seconds": 1.5}).write_to(dataset)
    assert dataset.estimated_error_l2.values.tolist() == [0.6, 0.4]
    assert dataset.estimated_error_peak.values.tolist() == [0.5, 0.3]
    assert dataset.attrs == {
        "error_estimate": "about 20 %",
        "error_estimate_opening_l2": 0.2,
        "error_estimate_opening_peak": 0.1,
        "error_estimate_cpu_seconds": 1.5,
    }


@pytest.mark.parametrize(
    ("kind", "sentence", "numbers"),
    [
        ("certificate", "certificate_statement", "certificate"),
        ("verification", "error_statement", "verification"),
    ],
)
def test_every_kind_is_written_by_the_same_rule(kind, sentence, numbers):
    statement = ErrorStatement(kind, "far off", {"opening": RelativeError(0.2, 0.1)}, {"record": "a"})
    stated = statement.attributes
    assert stated[sentence] == "far off" and stated[f"{numbers}_opening_l2"] == 0.2
    document = {"statement": "far off", "error": {"opening": {"l2": 0.2, "peak": 0.1}}, "record": "a"}
    assert json.loads(stated[numbers]) == document == statement.document
    assert sentences(stated) == {kind: "far off"}
