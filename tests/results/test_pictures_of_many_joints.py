"""Pictures of dams with many joints: a panel for each kind, one unit, no shut joint, no round-off."""

import json

import numpy as np
import pytest

from romdam.core.round_off import without_round_off
from romdam.postprocess.sliding import sliding_rows
from romdam.results.dataset import build_dataset
from romdam.visual.joint_plots import joints_of_kinds
from romdam.visual.plots import FIGURES


@pytest.fixture
def dataset(case, job, timing):
    return build_dataset(case, job, timing, None)


def test_joints_are_of_a_kind_by_their_names():
    names = ["base_1", "contraction_1_2", "base_2", "J1", "J2", "middle", "left-right", "lift_1_1"]
    kinds = joints_of_kinds(names)
    assert kinds["base"] == ["base_1", "base_2"] and kinds["J"] == ["J1", "J2"]
    assert [*kinds] == ["base", "contraction", "J", "middle", "left-right", "lift"]


def test_sliding_has_panels_for_each_kind(dataset):
    assert len(FIGURES["sliding"](dataset).axes) == 2  # J1 and J2
    first, second = dataset.joint.values
    names = {first: "base_1", second: "contraction_1_2"}
    renamed = dataset.assign_coords(joint=[names[name] for name in dataset.joint.values])
    renamed["gap_joint"] = ("gap", [names[name] for name in dataset.gap_joint.values])
    axes = FIGURES["sliding"](renamed).axes
    assert [ax.get_ylabel().split("\n")[0].split(",")[0] for ax in axes] == [
        "base",
        "base",
        "contraction",
        "contraction",
    ]
    assert all("[mm]" in ax.get_ylabel() for ax in axes[1::2])
    assert all(ax.get_ylim()[1] <= 20.0 for ax in axes[::2])


def test_panels_of_openings_have_one_unit_and_the_envelope_leaves_out_what_never_opens(dataset):
    shut = dataset.joint.values[1]
    dataset = dataset.copy(deep=True)
    gaps = dataset.gap_joint.values == shut
    dataset.opening[:, gaps] = 1e-19
    dataset.gap_peak_opening[gaps] = 1e-19
    dataset.peak_opening.loc[shut] = 1e-19
    opening = FIGURES["joint_opening"](dataset).axes
    assert {ax.get_ylabel().split("[")[1] for ax in opening} == {"mm]"}
    envelope = FIGURES["opening_envelope"](dataset)
    titles = [ax.get_title(loc="left") for ax in envelope.axes if ax.get_title(loc="left")]
    assert len(titles) == 1 and not titles[0].startswith(str(shut))
    assert f"never open: {shut}" in envelope.get_suptitle()
    dataset.peak_opening[:] = 0.0
    assert FIGURES["opening_envelope"](dataset) is None


def test_round_off_is_shown_as_0(dataset):
    shown = without_round_off([2.351e-31, -5.0e6, 3.0, 0.01, np.nan])
    np.testing.assert_array_equal(shown, [0.0, -5.0e6, 3.0, 0.0, np.nan])
    assert without_round_off([1e-13]) == [0.0] and without_round_off([1e-9]) == [1e-9]
    still = dataset.copy(deep=True)
    still["slip"], still["opening"] = still.slip * 0.0 + 1e-31, still.opening * 0.0 + 1e-30
    still["joint_displacement"] = still.joint_displacement * 0.0 + 1e-30
    for row in sliding_rows(still):
        assert not any("e-2" in cell or "e-3" in cell for cell in row), row
    still["energy_residual"] = still.energy_residual * 0.0 + 1e-13
    imbalance = FIGURES["energy"](still).axes[1]
    assert not imbalance.lines[0].get_ydata().any() and imbalance.get_ylim() == (-1.0, 1.0)


@pytest.mark.parametrize("kind", ["arch", "gravity"])
def test_limits_are_those_of_the_dam_at_hand(kind, dataset):
    """Of a result that says neither both are drawn: `tests/results/test_plots.py`."""
    from romdam.postprocess.maxima import limits_of
    from romdam.postprocess.stress.faces import LIMITS

    dataset.attrs["configuration"] = json.dumps({f"{kind}_dam": {"base": 0}, "blocks": {}})
    assert limits_of(dataset) == {f"{kind} dam": LIMITS[f"{kind} dam"]}
    dataset.attrs["configuration"] = json.dumps({"blocks": {"left": 1}})
    assert limits_of(dataset) == LIMITS
