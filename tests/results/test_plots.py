"""Every figure draws for every kind of result and shows the numbers of the dataset."""

import warnings
from pathlib import Path

import matplotlib as mpl
import matplotlib.style
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from romdam.core.system import SLIP
from romdam.postprocess.maxima import maxima, peak_opening_time
from romdam.results.dataset import build_dataset
from romdam.terminal.documents import info_document
from romdam.terminal.tables import peaks_table
from romdam.visual.plots import FIGURES, opening_comparison, save_figure, within_outline, write_plots
from romdam.visual.stress_plots import stress_damage
from romdam.visual.style import STYLE, scaled, side_name

from .conftest import make_case

CASES = {
    "friction": {},
    "frictionless": {"mu": 0.0},
    "full order": {"reduced": False},
    "no joints": {"joints": False},
}


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind == "full order")) for kind in CASES]
)
def test_figures_are_written_for_what_there_is(kind, job, timing, tmp_path):
    ds = build_dataset(make_case(**CASES[kind]), job, timing, None)
    paths = write_plots(ds, tmp_path, "quake")
    shear = {"joint_displacement", "joint_slip", "sliding"}
    joints = {"joint_opening", "opening_envelope", "dissipated_energy"}
    without = {"no joints": {*joints, *shear}, "frictionless": shear}
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


def texts(ax):
    return [one.get_text() for one in ax.texts]


def test_peaks_of_joints_are_those_over_all_steps(case, job, timing):
    """What the tables tell, where it was reached between written rows."""
    ds = build_dataset(case, job, timing, None)
    ds["joint_state"] = 0 * ds.joint_state + SLIP
    ds["peak_opening"], ds["peak_slip"] = 1.5 * ds.peak_opening, 1.5 * ds.peak_slip
    ds["peak_opening_time"] = ds.peak_opening_time + 0.02
    opening, slip = FIGURES["joint_opening"](ds).axes, FIGURES["joint_slip"](ds).axes
    for k, name in enumerate(ds.joint.values):
        own = ds.sel(joint=name)
        peak, when = 1e3 * float(own.peak_opening), float(own.peak_opening_time)
        assert texts(opening[k]) == [f"{peak:.3g} mm at {when:.2f} s"]
        np.testing.assert_allclose(opening[k].lines[-1].get_xydata(), [[when, peak]], rtol=1e-12)
        assert texts(slip[k])[0].startswith(f"{1e3 * float(own.peak_slip):.3g} mm near ")
        row = slip[k].lines[0].get_xydata()
        np.testing.assert_array_equal(slip[k].lines[-1].get_xydata(), row[row[:, 1].argmax()][None])


@pytest.mark.parametrize(("part", "told"), [(1e-10, False), (1e-6, True), (0.0, False)])
def test_opening_that_does_not_move_has_no_time(part, told, case, job, timing):
    """0.02 mm of a mirrored joint vary by round-off alone: table, maxima, JSON and figure tell no time."""
    ds, still = build_dataset(case, job, timing, None), 2e-5
    ds["opening"] = still + 0.0 * ds.opening
    ds["opening"][7] = still * (1.0 + part)
    ds["peak_opening"] = 0.0 * ds.peak_opening + ds.opening.max()
    ds["peak_opening_time"] = 0.0 * ds.peak_opening + 1.37
    assert peak_opening_time(ds, "J1") == (1.37 if told else None)
    (times,) = [list(c.cells) for c in peaks_table({"quake": ds}).columns if c.header == "at [s]"]
    assert times == (["1.37"] * 2 if told else ["-"] * 2)
    rows = [row for row in maxima(ds) if row.quantity == "joint opening"]
    assert [row.when for row in rows] == (["1.370"] * 2 if told else [""] * 2)
    said = info_document(ds, Path("quake.nc"))["joints"]["J1"]
    assert said["peak_opening_time_s"] == (1.37 if told else None)
    assert [len(ax.texts) for ax in FIGURES["joint_opening"](ds).axes] == [int(told)] * 2


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
        save_figure(FIGURES["opening_envelope"](dataset), tmp_path / "once.png")
        assert len(drawn) == 1
        FIGURES["opening_envelope"](dataset).savefig(tmp_path / "twice.png", dpi=160)
    once, twice = (np.asarray(Image.open(tmp_path / f"{name}.png")) for name in ("once", "twice"))
    np.testing.assert_array_equal(once, twice)


@pytest.mark.slow
def test_figures_are_the_same_whatever_style_the_user_has_set(case, job, timing, tmp_path):
    dataset = build_dataset(case, job, timing, None)
    users = {"axes.facecolor": "black", "text.usetex": True, "lines.linewidth": 5.0, "font.family": ["serif"]}
    plain = [path.read_bytes() for path in write_plots(dataset, tmp_path, "plain")]
    with mpl.rc_context(users):
        styled = [path.read_bytes() for path in write_plots(dataset, tmp_path, "styled")]
        assert all(mpl.rcParams[name] == value for name, value in users.items())
    assert len(plain) > 2 and styled == plain


def test_the_style_sets_all_that_matplotlib_lets_a_style_set():
    with mpl.rc_context(), warnings.catch_warnings():
        warnings.simplefilter("error")
        mpl.style.use(STYLE)
    for name in mpl.rcParamsDefault.keys() - STYLE.keys():
        with pytest.warns(UserWarning, match="not related to style"):
            mpl.style.use({name: mpl.rcParamsDefault[name]})


def numbers_in_view(axis, k):
    low, high = sorted(axis.get_view_interval())
    return [one for one in axis.get_ticklabels() if low <= one.get_position()[k] <= high]


def test_panels_leave_room_for_names_numbers_titles_and_legends(case, job, timing):
    """Nothing that stands around the panels overlaps anything else, or is cut."""
    dataset, seen = build_dataset(case, job, timing, None), 0
    dataset["energy_residual"] = -1.7e4 * dataset.energy_residual / abs(dataset.energy_residual).max()
    for draw in FIGURES.values():
        with mpl.rc_context(STYLE):
            figure = draw(dataset)
            if figure is None or figure.get_layout_engine() is not None:
                continue
            seen, canvas = seen + 1, FigureCanvasAgg(figure)
            canvas.draw()
            last = figure.axes[-1]
            texts = [one for ax in figure.axes for one in (ax.yaxis.label, *numbers_in_view(ax.yaxis, 1))]
            texts += [last.xaxis.label, *numbers_in_view(last.xaxis, 0), *figure.legends]
            texts += [one for ax in figure.axes for one in (ax.title, ax._left_title)]
            boxes = [
                one.get_window_extent() for one in texts if not hasattr(one, "get_text") or one.get_text()
            ]
            whole = figure.bbox
        for k, box in enumerate(boxes):
            assert whole.x0 <= box.x0 and whole.y0 <= box.y0 and box.x1 <= whole.x1 and box.y1 <= whole.y1
            assert not any(box.overlaps(other) for other in boxes[:k])
    assert seen >= 4


def labelled(ax):
    """Label -> what is drawn over time, of lines."""
    return {line.get_label(): np.asarray(line.get_ydata(), dtype=float) for line in ax.lines}


def test_energy_stack_ends_at_the_input_and_what_rested_at_the_start(case, job, timing):
    """The parts of a dam with weight, whose strain energy is there before it is shaken."""
    ds = build_dataset(case, job, timing, None)
    parts = [f"energy_{p}" for p in ("kinetic", "strain", "joint_stored", "damping", "friction", "contact")]
    ds["energy_strain"] = ds.energy_strain + 5.0
    ds["energy_input"] = sum(ds[p] for p in (*parts, "energy_numerical")) - 7.0
    ax = FIGURES["energy"](ds).axes[0]
    lines = labelled(ax)
    top = np.max([poly.get_paths()[0].vertices[:, 1].max() for poly in ax.collections])
    np.testing.assert_allclose(lines["initial strain energy + input"], ds.energy_input + 7.0)
    np.testing.assert_allclose(lines["initial strain energy, 7 J"], 7.0)
    assert top == pytest.approx(float((ds.energy_input + 7.0).max()))
    assert ax.get_legend() is None and len(ax.figure.legends) == 1, "below the panels, not over them"


def test_energy_of_what_starts_at_rest_names_the_input_alone(case, job, timing):
    ds = build_dataset(case, job, timing, None)
    parts = [n for n in ds if n.startswith("energy_") and n not in ("energy_input", "energy_residual")]
    for name in parts:
        ds[name] = ds[name] - ds[name][0]
    ds["energy_input"] = sum(ds[name] for name in parts)
    lines = labelled(FIGURES["energy"](ds).axes[0])
    np.testing.assert_allclose(lines["input"], ds.energy_input, atol=1e-12)
    assert not any("initial" in str(label) for label in lines)


def test_components_are_along_the_stream_where_it_is_known(case, job, timing):
    """Upstream is -x: downstream is x, and the right bank, to the right of who looks downstream, is -y."""
    ds = build_dataset(case, job, timing, None)
    names = [ax.get_ylabel().split("\n")[1] for ax in FIGURES["top_displacements"](ds).axes]
    assert [name.split(" [")[0] for name in names] == ["along x", "along y", "along z"]
    ds.attrs["upstream"] = np.array([-1.0, 0.0, 0.0])
    for figure, values, dim in (
        ("top_displacements", ds.displacement, "node"),
        ("joint_displacement", ds.joint_displacement, "joint"),
    ):
        axes = FIGURES[figure](ds).axes
        for ax, (name, sign, axis) in zip(
            axes, (("downstream", 1, "x"), ("to the right bank", -1, "y"), ("up", 1, "z")), strict=True
        ):
            assert name in ax.get_ylabel()
            shown, _, unit = scaled(sign * values.sel(component=axis), "m")
            assert f"[{unit}]" in ax.get_ylabel()
            for place in values[dim].values:
                np.testing.assert_allclose(labelled(ax)[place], shown.sel({dim: place}), atol=1e-12)


def test_slip_is_drawn_of_joints_that_slide(case, job, timing):
    ds = build_dataset(case, job, timing, None)
    state = ds.joint_state.copy()
    state[:, ds.gap_joint.values == "J1"] = 1
    axes = FIGURES["joint_slip"](ds.assign(joint_state=state)).axes
    assert len(axes) == 1 and axes[0].get_ylabel() == "J2\nslip [mm]"
    slip = 1e3 * np.hypot(ds.slip[:, 2:, 0], ds.slip[:, 2:, 1]).max("gap")
    np.testing.assert_allclose(labelled(axes[0])["largest slip"], slip, rtol=1e-12)
    assert FIGURES["joint_slip"](ds.assign(joint_state=0 * state)) is None, "sticking is no slip"


def test_dissipated_energy_is_drawn_as_each_joint_s_sum(case, job, timing):
    """The joint that dissipates most comes first; J1 has two gaps, J2 three."""
    ds = build_dataset(case, job, timing, None)
    ds["dissipated_energy"] = ds.dissipated_energy * np.array([1e3, 1e3, 1e4, 1e4, 1e4])
    lines = FIGURES["dissipated_energy"](ds).axes[0].lines
    energy, unit = ds.dissipated_energy.values, FIGURES["dissipated_energy"](ds).axes[0].get_ylabel()
    assert "[kJ]" in unit or "[MJ]" in unit
    factor = 1e-3 if "[kJ]" in unit else 1e-6
    for line, gaps in zip(lines, (slice(2, 5), slice(0, 2)), strict=True):
        np.testing.assert_allclose(line.get_ydata(), factor * energy[:, gaps].sum(axis=1), rtol=1e-12)
    assert lines[0].get_label().startswith("J2, ")
    assert FIGURES["dissipated_energy"](ds.assign(dissipated_energy=0.0 * ds.dissipated_energy)) is None


@pytest.mark.parametrize("name", FIGURES)
def test_no_legend_lies_over_a_panel_or_its_title(name, case, job, timing):
    with mpl.rc_context(STYLE):
        figure = FIGURES[name](build_dataset(case, job, timing, None))
        figure.draw_without_rendering()
    covered = [ax.get_tightbbox() for ax in figure.axes]
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert not any(box.overlaps(other) for other in covered), name
        assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1, f"{name}: cut off"


def test_map_of_openings_keeps_to_a_hollow_joint():
    """A wall with a crest: the hull of its gaps closes the hollow at the knee, which is no joint."""
    width = {0.0: 8.0, 2.0: 5.0, 4.0: 2.0, 6.0: 2.0, 8.0: 2.0}
    x, y = (np.array(v) for v in zip(*((s * w, z) for z, w in width.items() for s in (0, 0.25, 0.5, 0.75, 1)),
                                     strict=True))  # fmt: skip
    area = 0.5 * (8 + 2) * 4 + 2.0 * 4
    for given, expected in ((area, area), (1.001 * area, area), (2 * area, None)):
        mesh = within_outline(x, y, given)
        kept = mesh.triangles if mesh.mask is None else mesh.triangles[~mesh.mask]
        a, b, c = (np.stack([x, y], axis=1)[kept[:, k]] for k in range(3))
        total = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()
        assert total == pytest.approx(expected, rel=1e-3) if expected else total > 1.05 * area


@pytest.mark.parametrize(
    ("draw", "label"),
    [
        (stress_damage, "longest cumulative inelastic duration [s],\nlogarithmic above 0.4 s"),
        (FIGURES["sliding"], "J, factor of\nsafety up to 3"),
    ],
)
def test_an_axis_that_changes_its_scale_or_ends_early_says_so(draw, label, job, timing):
    figure = draw(build_dataset(make_case(), job, timing, None))
    ax = figure.axes[0]
    assert ax.get_ylabel() == label
    FigureCanvasAgg(figure).draw()
    box, of_figure = ax.yaxis.label.get_window_extent(), figure.bbox
    assert box.x0 >= of_figure.x0 and box.y0 >= of_figure.y0 and box.y1 <= of_figure.y1, "it is cut"


def test_sides_are_named_by_the_stream_or_by_axes():
    upstream = np.array([0.0, -1.0, 0.0])
    assert side_name(np.array([-0.5, -1.0, 0.4]), upstream) == "from upstream"
    assert side_name(np.array([-0.5, 1.0, 0.4]), upstream) == "from downstream"
    assert side_name(np.array([-0.5, -1.0, 0.4]), None) == "from -y, and -x"
