"""Every figure draws for every kind of result and shows the numbers of the dataset."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from romdam.results.dataset import build_dataset
from romdam.visual.plots import FIGURES, opening_comparison, save_figure, write_plots
from romdam.visual.style import STYLE, scaled

from .conftest import make_case

CASES = {
    "friction": {},
    "frictionless": {"mu": 0.0},
    "full order": {"reduced": False},
    "no joints": {"joints": False},
}


@pytest.mark.parametrize("kind", CASES)
def test_figures_are_written_for_what_there_is(kind, job, timing, tmp_path):
    ds = build_dataset(make_case(**CASES[kind]), job, timing, None)
    paths = write_plots(ds, tmp_path, "quake")
    without = {"no joints": {"joint_opening", "opening_envelope", "sliding"}, "frictionless": {"sliding"}}
    assert {p.name for p in paths} == {f"quake-{n}.png" for n in FIGURES if n not in without.get(kind, set())}
    for path in paths:
        pixels = np.asarray(Image.open(path).convert("L"))
        assert min(pixels.shape) > 300 and pixels.std() > 5, f"{path.name} is blank"


def test_line_of_the_widest_gap_is_the_dataset_in_millimetres(case, job, timing):
    ds = build_dataset(case, job, timing, None)
    axes = FIGURES["joint_opening"](ds).axes
    assert "J1" in axes[0].get_ylabel() and "[mm]" in axes[0].get_ylabel()
    line = axes[1].lines[0].get_ydata()
    np.testing.assert_allclose(line, 1e3 * ds.opening[:, 2:].max("gap"), rtol=1e-12)


def test_comparison_shows_both_histories():
    time, opening = np.arange(3.0), np.array([[0.0, 0.001], [0.002, 0.001], [0.0, 0.0]])
    figure = opening_comparison({"reduced": (time, opening), "full": (time, 2 * opening)}, "title")
    shown = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}
    np.testing.assert_allclose(shown["reduced"], [1.0, 2.0, 0.0])
    np.testing.assert_allclose(shown["full"], [2.0, 4.0, 0.0])


@pytest.mark.parametrize(
    ("value", "shown", "unit"), [(0.056, 56.0, "mm"), (8e6, 8.0, "MJ"), (0.0, 0.0, "J"), (2.0, 2.0, "m")]
)
def test_prefix_suits_the_largest_value(value, shown, unit):
    import xarray as xr

    values, factor, name = scaled(xr.DataArray([0.0, -value]), unit[-1])
    assert name == unit
    np.testing.assert_allclose(values[1], -shown)
    assert factor * value == pytest.approx(shown)


def test_figure_is_drawn_once_and_is_that_of_savefig(case, job, timing, tmp_path, monkeypatch):
    dataset, drawn, draw = build_dataset(case, job, timing, None), [], Figure.draw
    monkeypatch.setattr(Figure, "draw", lambda *given: (drawn.append(given[0]), draw(*given)))
    with mpl.rc_context(STYLE):
        save_figure(FIGURES["energy"](dataset), tmp_path / "once.png")
        assert len(drawn) == 1
        FIGURES["energy"](dataset).savefig(tmp_path / "twice.png", dpi=160)
        assert len(drawn) == 3
    once, twice = (np.asarray(Image.open(tmp_path / f"{name}.png")) for name in ("once", "twice"))
    np.testing.assert_array_equal(once, twice)
