"""The report of a suite: one page that holds what the summary says, whatever its texts hold."""

import base64
import hashlib
import html.parser
import json
import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from cf_files import flaws
from summaries import lognormal_curves, suite_page, summary_of
from test_cli import call
from typer.testing import CliRunner

from romdam.cli import app
from romdam.config.load import load_config
from romdam.core.display_units import unit_text
from romdam.core.errors import ConfigError, ResultError
from romdam.core.motion import GroundMotion
from romdam.pipelines.report import ReportOptions, report
from romdam.postprocess.fragility import fragility
from romdam.records.spectra import pseudo_acceleration
from romdam.results.dataset import write_dataset
from romdam.results.suite.report_data import DATA, PERIODS, read_report_data, report_data
from romdam.visual.joint_maps import plane_of
from romdam.visual.report.joint_map import opening_map, outline_of
from romdam.visual.report.page import page
from romdam.visual.report.parts import PageCell, PageSection, PageTable, Pictures, Report, number
from romdam.visual.report.sections import suite_report
from romdam.visual.report.statistics import responses_section
from romdam.visual.report.subject import Subject, Topic
from romdam.visual.suite_plots import logarithmic_ticks

HOSTILE = "<script>alert('x')</script> & \"quoted\""


def suite_summary(records=12, scales=5, samples=1, failed=2):
    """A whole summary with a joint of 10 gaps, of which the runs of the last records failed."""
    rng = np.random.default_rng(1)
    summary, _ = lognormal_curves(rng, 3.0, 0.4, np.geomspace(1.0, 8.0, scales), records)
    opening = 0.01 * np.repeat(summary.peak_opening.values, samples, axis=2)
    gap = np.linspace(0.0, 5e-3, samples)
    opening = opening - 0.2 * gap[:, None]
    opening[records - failed :] = np.nan
    parameters = {"gap": gap} if samples > 1 else {}
    z = np.linspace(0.0, 45.0, 10)
    runs = ("record", "scale", "sample")
    more = {
        "gap_peak_opening": ((*runs, "gap"), opening * (z / 45.0), {"units": "m"}),
        "cpu_seconds": (runs, np.where(np.isfinite(opening[..., 0]), 0.25, np.nan), {"units": "s"}),
        "estimated_time_error": (runs, 0.008 + 0.0 * opening[..., 0], {"units": "1"}),
        "energy_residual": (runs, 1e-6 + 0.0 * opening[..., 0], {"units": "J"}),
        "energy_input": (runs, 1e3 + 0.0 * opening[..., 0], {"units": "J"}),
    }
    summary = summary_of(opening[..., 0], summary.record_sa.values, parameters, **more)
    summary = summary.assign_coords(
        gap_joint=("gap", ["J1"] * 10),
        gap_area=("gap", np.full(10, 2.0), {"units": "m2"}),
        gap_position=(("gap", "component"), np.column_stack([z % 10.0, 0.0 * z, z]), {"units": "m"}),
        component=["x", "y", "z"],
    )
    config = {"model": {"modes": 60}, "transient": {"accuracy": 0.01}}
    summary.attrs |= {
        "source": "romdam",
        "configuration": json.dumps(config),
        "configuration_sha256": "abc",
        "configuration_file": "dam.yaml",
        "date_created": "2026-01-01T00:00:00+00:00",
    }
    return summary


class Page(html.parser.HTMLParser):
    """Tags left open, attributes and text of a page."""

    VOID = ("meta", "img", "input", "!doctype")

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.links, self.ids, self.text = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.links += [value for name, value in attrs if name in ("src", "href")]
        self.ids += [value for name, value in attrs if name == "id"]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def rows_of(text, section):
    """Cells of the tables of a section."""
    part = re.search(rf'<section id="{section}".*?</section>', text, re.S).group()
    rows = re.findall(r"<tr>(.*?)</tr>", part, re.S)
    cells = (re.findall(r"<t[dh].*?>(.*?)</t[dh]>", row) if "<td" in row else [] for row in rows)
    return [[re.sub("<.*?>", "", cell) for cell in row] for row in cells]


def test_page_is_whole_and_asks_for_nothing_from_elsewhere():
    text = suite_page(Subject(suite_summary(samples=9), Topic()))
    page = Page(text)
    assert page.open == []
    assert all(link.startswith(("data:image/", "#")) for link in page.links)
    sections = {name for name in page.ids if not name.endswith("-title")}
    assert {link[1:] for link in page.links if link[0] == "#"} == sections
    wanted = {"scene", "what", "worst", "runs", "records", "responses", "fragility", "correlation"}
    assert wanted | {"sensitivity", "speed", "failures", "reproduce"} == sections
    assert "90 observations of 10 records as independent" in " ".join(page.text)
    policy = re.search('Content-Security-Policy" content="(.*?)"', text)[1]
    for tag in ("style", "script"):  # those of the page's own, and no other
        (own,) = re.findall(f"<{tag}>(.*?)</{tag}>", text, re.S)
        digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
        assert page.tags.count(tag) == 1 and f"{tag}-src &#39;sha256-{digest}&#39;" in policy
    assert policy.startswith("default-src &#39;none&#39;; img-src data:;")
    assert page.tags.count("img") >= 7 and len(text) < 3_000_000
    for link in page.links:
        if link.startswith("data:image/svg"):
            assert base64.b64decode(link.split(",")[1])[-7:] == b"</svg>\n"


def test_numbers_on_the_page_are_those_of_the_summary():
    summary = suite_summary()
    text = suite_page(Subject(summary, Topic(thresholds=(0.02,))))
    peaks = 1e3 * np.sort(summary.peak_opening.values[np.isfinite(summary.peak_opening.values)])
    worst = [row for row in rows_of(text, "worst") if row]
    assert [row[2] for row in worst[:3]] == [number(v) for v in peaks[::-1][:3]]
    opening = next(row for row in rows_of(text, "responses") if row and row[0] == "peak opening")
    assert opening[1:3] == ["J1", "mm"] and opening[-1] == "50"
    assert opening[4] == number(round(float(np.median(peaks)), 2))
    at = np.linspace(0.0, 1.0, len(peaks))  # between sorted values a quantile is straight
    low, high = (float(np.interp(share, at, peaks)) for share in (0.16, 0.84))
    assert [float(opening[k]) for k in (3, 5, 6)] == pytest.approx([low, high, peaks[-1]], rel=6e-3)
    speed = {row[0]: row[1:] for row in rows_of(text, "speed") if row}
    assert speed["CPU time of a run"] == ["s", "0.25", "0.25", "12.5", "50"]
    assert speed["estimated error of the time stepping"][:3] == ["%", "0.8", "0.8"]
    assert speed["imbalance of the energy over the input"][:2] == ["%", "1.00·10⁻⁷"]
    fit = fragility(summary, "peak_opening", 0.02, "sa")
    row = rows_of(text, "fragility")[1]
    assert row[0] == "20" and row[1] == number(float(fit.theta)) and row[3] == number(float(fit.beta))
    assert row[2].split(" to ") == [number(float(value)) for value in fit.theta_bounds.values]
    assert row[1] != row[3]
    assert rows_of(text, "failures")[1] == ["r010, r011", "10", "contact did not converge"]
    assert "10 of 60 runs failed" in text and "50 runs, 10 failed ones left out" in text


def test_the_stated_error_is_the_sum_of_its_unlike_parts():
    """Median and largest of the sums of each run; not of the largest parts, nor sums of medians."""
    summary = suite_summary(records=3, scales=1, failed=0)
    runs = summary.estimated_time_error.dims
    parts = {"mesh": [0.02, 0.05, 0.01], "reduction": [0.03, 0.001, 0.07], "time": [0.004, 0.002, 0.016]}
    for name, values in parts.items():
        summary[f"estimated_{name}_error"] = (runs, np.reshape(values, (3, 1, 1)), {"units": "1"})
    areas = 0.5 + np.arange(10.0)
    text = suite_page(Subject(summary.assign_coords(gap_area=("gap", areas)), Topic()))
    assert ["J1", "10", "50"] in rows_of(text, "what")  # 10 gaps of 0.5, 1.5, ... 9.5 m2
    speed = {row[0]: row[1:] for row in rows_of(text, "speed") if row}
    assert speed["stated error of the openings, L2, at most"] == ["%", "5.4", "9.6", "–", "3"]
    assert speed["estimated error of the mesh, openings in L2"][:3] == ["%", "2", "5"]
    assert speed["estimated error of leaving out modes, openings in L2"][:3] == ["%", "3", "7"]
    assert "The time-stepping error asked for was 1 %; 1 of 3 runs estimate more." in text


@pytest.mark.slow
def test_compressions_and_energies_say_what_they_are():
    """The mean before the instant in both tables; stored energies are those at the end, round-off is 0."""
    summary = suite_summary(failed=0)
    opening = summary.peak_opening
    joint = opening.dims
    for name, size in (("mean_", -1e6), ("", -3e6)):
        about = {"units": "Pa", "long_name": "stress, compression negative"}
        summary[f"peak_{name}compressive_stress"] = (joint, size + 0.0 * opening.values, about)
    stored = np.full((12, 5, 1), 2e-8)
    stored[0] = 5.0
    about = {"units": "J", "long_name": "kinetic energy, at the end"}
    summary["energy_kinetic"] = (opening.dims[:3], stored, about)
    text = suite_page(Subject(summary, Topic()))
    mean, instant = (f"peak compressive stress, {of}" for of in ("mean of a writing interval", "one instant"))
    rows = [row for row in rows_of(text, "responses") if row]
    names = [row[0] for row in rows]
    assert names.index(mean) < names.index(instant)
    kinetic = rows[names.index("energy kinetic, at the end")]
    assert kinetic[3:7] == ["0", "0", "0", "5"]
    heads = re.findall(r"<th[ >].*?</th>", text[text.index('<section id="runs"') :], re.S)
    heads = [" ".join(re.sub("<.*?>", "", one).split()) for one in heads]
    assert heads.index("mean compr.") < heads.index("instant compr.")


def test_texts_of_files_stay_texts():
    summary = suite_summary()
    summary.attrs["title"] = HOSTILE
    summary.attrs["configuration_file"] = HOSTILE
    summary["message"] = summary.message.copy(data=np.full(summary.message.shape, HOSTILE))
    summary = summary.assign_coords(record=[f"{HOSTILE}{i}" for i in range(12)], joint=[HOSTILE])
    text = suite_page(Subject(summary.assign_coords(gap_joint=("gap", [HOSTILE] * 10)), Topic()))
    assert text.count("<script") == 1 and HOSTILE not in text and "alert" in text
    assert Page(text).open == []


@pytest.mark.parametrize("failed", [12, pytest.param(0, marks=pytest.mark.slow)])
def test_suite_where_everything_or_nothing_failed_has_a_page(failed):
    text = suite_page(Subject(suite_summary(failed=failed), Topic()))
    assert Page(text).open == []
    assert f"{60 if failed else 'None'} of 60 runs failed" in text


def test_suite_of_one_run_has_a_page_that_says_what_it_cannot_have():
    text = suite_page(Subject(suite_summary(records=1, scales=1, failed=0), Topic()))
    assert "no record has runs at two intensities" in text
    assert "No correlation: neither response nor measures vary" in text


def test_suite_without_joints_has_a_page():
    summary = suite_summary().drop_dims(["gap", "joint"])
    runs = ("record", "scale", "sample")
    peak = np.random.default_rng(2).uniform(0.01, 0.1, (12, 5, 1))
    text = suite_page(Subject(summary.assign(peak_displacement=(runs, peak, {"units": "m"})), Topic()))
    assert Page(text).open == [] and "peak displacement" in text and 'id="scene"' not in text


def test_names_that_the_suite_does_not_have_are_refused():
    for wanted in (Topic(response="nothing"), Topic(intensity="nothing")):
        with pytest.raises(ResultError, match="nothing: is no"):
            suite_page(Subject(suite_summary(), wanted))


def test_report_data_hold_the_spectra_at_the_middle_scale(tmp_path):
    rng = np.random.default_rng(3)
    summary = suite_summary()
    summary["scale_factor"] = (("record", "scale"), np.broadcast_to(np.arange(1.0, 6.0), (12, 5)))
    motion = GroundMotion("r000", rng.normal(size=(3, 400)), 0.01)
    data = report_data(summary, {"r000": motion}, b"picture")
    write_dataset(data, tmp_path / DATA)
    assert list(flaws(tmp_path / DATA)) == []
    read = read_report_data(summary, tmp_path)
    expected = 3.0 * pseudo_acceleration(motion.acc, 0.01, PERIODS, 0.05).max(axis=0)
    np.testing.assert_allclose(read.psa[0], expected)
    assert np.isnan(read.psa[1:]).all() and read.picture.values.tobytes() == b"picture"
    text = suite_page(Subject(summary, Topic(), read, b"\x89PNG"))
    assert "the largest of x, y, z" in text and "image/png;base64,iVBORw==" in text
    summary.attrs["configuration_sha256"] = "of another suite"
    assert read_report_data(summary, tmp_path) is None
    assert read_report_data(summary, tmp_path / "empty") is None


def test_command_writes_the_page_and_repeats_itself_on_it(tmp_path):
    write_dataset(suite_summary(), tmp_path / "summary.nc")
    asked = ["--response", "peak_opening", "--threshold", "15 mm", "--threshold", "3 cm"]
    done = CliRunner().invoke(app, ["report", str(tmp_path), *asked], catch_exceptions=False)
    assert done.exit_code == 0 and "report.html" in done.stdout
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert [row[0] for row in rows_of(text, "fragility") if row] == ["15", "30"]
    assert "--threshold &#39;15 mm&#39;" in text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "summary.nc"]


@pytest.mark.parametrize("command", ["info", "plot"])
def test_a_summary_is_told_from_the_result_of_a_record(command, tmp_path):
    write_dataset(suite_summary(), tmp_path / "summary.nc")
    done = CliRunner().invoke(app, [command, str(tmp_path / "summary.nc")])
    assert isinstance(done.exception, ResultError)
    told = str(done.exception)
    assert "is the summary of several runs" in told and f"`romdam report {tmp_path}`" in told
    assert f'`romdam.open_suite("{tmp_path}")`' in told


def test_folder_without_a_summary_is_one_message_and_exit_code_2(tmp_path):
    code, stdout, stderr = call("report", tmp_path)
    assert code == 2 and stdout == ""
    assert stderr.count("\n") == 1 and f"{tmp_path}: holds no summary.nc" in stderr
    assert list(tmp_path.iterdir()) == []


def test_files_and_thresholds_that_do_not_fit_are_refused(tmp_path):
    (tmp_path / "summary.nc").write_text("not a file of numbers")
    with pytest.raises(ResultError, match="is not a NetCDF-4 file"):
        report(tmp_path)
    write_dataset(suite_summary()[["record_sa"]], tmp_path / "summary.nc")
    with pytest.raises(ResultError, match="is not the summary of a suite"):
        report(tmp_path)
    write_dataset(suite_summary(), tmp_path / "summary.nc")
    with pytest.raises(ResultError, match="threshold 2 kg: "):
        report(tmp_path, ReportOptions(thresholds=("2 kg",)))
    job, other = (load_config(f"configs/{name}.yaml") for name in ("two_cantilevers", "arch_dam"))
    with pytest.raises(ConfigError, match=r"summary.nc: configuration: materials is missing"):
        report(tmp_path, job=job)
    text = json.dumps(other.config.model_dump(mode="json"))
    write_dataset(suite_summary().assign_attrs(configuration=text), tmp_path / "summary.nc")
    with pytest.raises(ConfigError, match=r"is not the configuration of .*another .*blocks"):
        report(tmp_path, job=job)
    assert not (tmp_path / "report.html").exists()


EXAMPLE = """
import matplotlib.pyplot as plt
import xarray as xr

suite = xr.open_dataset("summary.nc")
peaks = 1e3 * suite.gap_peak_opening.max(("record", "scale", "sample"))
joint = suite.gap_joint == suite.joint[0]
x, _, z = suite.gap_position.values[joint.values].T
plt.tricontourf(x, z, peaks[joint.values], levels=20)
plt.colorbar(label="largest opening [mm]")
plt.savefig("opening.png")
"""


@pytest.mark.slow
def test_ten_lines_open_the_summary_with_xarray_alone_and_draw_the_map(tmp_path):
    summary = suite_summary()
    x, z = np.meshgrid([0.0, 10.0], np.linspace(0.0, 45.0, 5))
    summary["gap_position"] = (("gap", "component"), np.column_stack([x.ravel(), 0.0 * x.ravel(), z.ravel()]))
    write_dataset(summary, tmp_path / "summary.nc")
    code = EXAMPLE + "\nimport sys\nassert not [name for name in sys.modules if name.startswith('romdam')]"
    subprocess.run(
        [sys.executable, "-c", "import matplotlib; matplotlib.use('agg')\n" + code], cwd=tmp_path, check=True
    )
    assert (tmp_path / "opening.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (1234.6, "1230"), (-0.05126, "−0.0513"), (1e-9, "1.00·10⁻⁹"), (2.5e7, "2.50·10⁷"),
        (np.nan, "–"), (np.inf, "∞"), (-np.inf, "−∞"), (3.0, "3"),
    ],
)  # fmt: skip
def test_numbers_are_written_with_three_digits(value, text):
    assert number(value) == text


def test_units_are_written_as_in_print():
    pairs = {"m s-2": "m/s²", "1": "", "m": "m", "s-1": "1/s", "N m": "N m", "kg m-1 s-2": "kg/m s²"}
    assert {units: unit_text(units) for units in pairs} == pairs


def test_tables_escape_text_and_set_numbers_right():
    rows = [["<i>", 1.5, PageCell("–", links=(("nc", "a%3Cb.nc"),))], ["x", 2, PageCell("–")]]
    section = PageSection("one", "One & all", [PageTable(["a<b", "n", "files"], rows), PageTable(["a"], [])])
    made = page(Report("A <b>", "about", [], [section]))
    assert "a&lt;b" in made and "&lt;i&gt;" in made and '<td class="n">1.5</td>' in made
    assert '<a href="a%3Cb.nc">nc</a>' in made and "<td>–</td>" in made and "One &amp; all" in made
    assert made.count("<table>") == 1 and "<script" not in made and Page(made).open == []


def test_plane_of_a_joint_keeps_distances():
    rng = np.random.default_rng(4)
    flat = rng.uniform(0.0, 20.0, (30, 2))
    turn = np.radians(35.0)
    slope = np.radians([[0.0], [40.0]])  # an upright joint, and the base of a cantilever on a bank
    for tilt in slope[:, 0]:
        along, rise = np.cos(tilt) * flat[:, 1], np.sin(tilt) * flat[:, 1]
        position = np.column_stack([
            np.cos(turn) * flat[:, 0] - np.sin(turn) * rise, np.sin(turn) * flat[:, 0] + np.cos(turn) * rise,
            along,
        ])  # fmt: skip
        plane = plane_of(position)
        made = np.hypot(plane.across[:, None] - plane.across, plane.up[:, None] - plane.up)
        np.testing.assert_allclose(made, np.linalg.norm(position[:, None] - position, axis=-1), atol=1e-12)
        assert np.corrcoef(plane.up, position[:, 2])[0, 1] > 1.0 - 1e-12


@pytest.mark.parametrize(
    ("position", "names"),
    [
        ([[0, 0, 5], [30, 0, 5], [0, 70, 5], [30, 70, 5]], ("x", "y")),  # a base in plan
        ([[0, 0, 5], [30, 0, 5]], ("x", "y")),  # of one row of gaps
        ([[0, 0, 5], [30, 0, 6], [0, 70, 5], [30, 70, 6]], ("x", "y")),  # nearly level
        ([[3, 0, 0], [3, 20, 0], [3, 0, 50], [3, 20, 50]], ("y", "z")),
        ([[3, 0, 0], [3, 0, 50]], ("x", "z")),
        ([[3, 1, 2]], ("x", "y")),
    ],
)
def test_level_joints_are_shown_in_plan_and_others_upright(position, names):
    plane = plane_of(np.array(position, dtype=float))
    assert plane.names == names
    columns = ["xyz".index(name) for name in names]
    np.testing.assert_allclose(
        np.column_stack([plane.across, plane.up]), np.array(position, dtype=float)[:, columns], atol=1e-12
    )


def test_maps_of_joints_have_one_scale_of_length_and_colour():
    """A base of 15 by 70 m, a contraction joint of 70 by 103 m and a step of 70 by 2 m."""
    corners = {
        "base_1": [[0, 0, 0], [15, 0, 0], [0, 70, 0], [15, 70, 0]],
        "contraction_1_2": [[15, 0, 0], [15, 70, 0], [15, 0, 103], [15, 15, 103]],
        "step_1_2": [[15, 0, 0], [15, 70, 0], [15, 0, 2], [15, 70, 2]],
    }
    position = np.concatenate([*corners.values()]).astype(float)
    coords = {
        "gap_joint": ("gap", np.repeat([*corners], 4)), "gap_area": ("gap", np.ones(12)),
        "gap_position": (("gap", "component"), position), "joint": [*corners],
    }  # fmt: skip
    opening = np.broadcast_to(1e-3 * np.arange(12.0), (3, 1, 12))
    figure = opening_map(xr.Dataset({"opening": (("fractile", "scale", "gap"), opening)}, coords))
    (wide, high), scales = figure.get_size_inches(), []
    panels = [ax for ax in figure.axes if ax.get_title(loc="left")]
    assert [ax.get_title(loc="left") for ax in panels] == [*corners]
    for ax in panels:
        place = ax.get_position()
        scales += [wide * place.width / np.ptp(ax.get_xlim()), high * place.height / np.ptp(ax.get_ylim())]
        assert (ax.collections[0].norm.vmin, ax.collections[0].norm.vmax) == (0.0, 11.0)
    np.testing.assert_allclose(scales, scales[0], rtol=1e-12)
    assert [ax.get_xlabel() + ax.get_ylabel() for ax in panels] == ["x [m]y [m]", "y [m]z [m]", "y [m]z [m]"]
    shut = xr.Dataset({"opening": (("fractile", "scale", "gap"), 0.0 * opening)}, coords)
    assert opening_map(shut) is None


def test_opening_map_draws_the_gaps_areas_and_nothing_between():
    """An L of gaps of 1 m2: one disc each, of their area, and none in the corner that is left out."""
    y, z = (axis.ravel() for axis in np.meshgrid(np.arange(11.0), np.arange(11.0)))
    inside = (y <= 4.0) | (z <= 3.0)
    y, z = y[inside], z[inside]
    opening = np.broadcast_to(1e-3 * (y + z), (3, 1, len(y)))
    coords = {
        "gap_joint": ("gap", ["J"] * len(y)),
        "gap_position": (("gap", "component"), np.column_stack([0.0 * y, y, z])),
        "gap_area": ("gap", np.ones(len(y))),
        "joint": ["J"],
    }
    figure = opening_map(xr.Dataset({"opening": (("fractile", "scale", "gap"), opening)}, coords))
    (discs,) = figure.axes[0].collections
    np.testing.assert_allclose(np.pi / 4 * np.sum(discs.get_widths() * discs.get_heights()), len(y))
    np.testing.assert_allclose(discs.get_offsets(), np.column_stack([y, z]))
    assert discs.get_clip_path() is not None


def test_map_ends_at_the_joints_rim_and_follows_a_hollow():
    """The same L: its rim encloses its area and no hollow; gaps in a row have no rim."""
    y, z = (axis.ravel() for axis in np.meshgrid(np.arange(11.0), np.arange(11.0)))
    inside = (y <= 4.0) | (z <= 3.0)
    y, z = y[inside], z[inside]
    corners = [(y + a, z + b) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]  # of the cells about each gap
    area = sum(0.25 * ((a > 0) & (b > 0) & (a < 10) & (b < 10) & ((a < 4) | (b < 3))) for a, b in corners)
    assert area.sum() == 58.0
    rim = outline_of(y, z, np.sqrt(area / np.pi))
    (x0, z0), (x1, z1) = rim.vertices[:-1].T, rim.vertices[1:].T
    assert 0.5 * np.sum(x0 * z1 - x1 * z0) == pytest.approx(4.0 * 10.0 + 6.0 * 3.0, abs=1.01)  # a cell
    assert rim.contains_point((2.0, 9.0)) and rim.contains_point((9.0, 2.0))
    assert not rim.contains_point((6.0, 6.0)) and not rim.contains_point((10.3, 1.0))
    assert outline_of(np.arange(4.0), np.zeros(4), np.full(4, 0.5)) is None


def test_the_extreme_of_what_is_negative_throughout_is_its_least():
    """-3, -1, -2 MPa have -3 as their extreme, 2, -1, 5 mm have 5."""
    runs, opening = ("record", "scale", "sample"), np.array([2e-3, -1e-3, 5e-3])[:, None, None]
    stress = -1e6 * np.array([3.0, 1.0, 2.0])[:, None, None]
    population = summary_of(
        opening, np.ones((3, 1)), stress=(runs, stress, {"units": "Pa", "long_name": "stress"})
    )
    (table,) = (
        p for p in responses_section(SimpleNamespace(population=population)).parts if isinstance(p, PageTable)
    )
    extremes = {row[0]: (row[2], row[6]) for row in table.rows}
    assert extremes["stress"] == ("MPa", -3.0) and extremes["peak opening"] == ("mm", 5.0)


LETTER, PAD, ROOM = (
    7.4,
    9.0,
    998.0,
)  # pixels of a letter of 13 px, beside a column, of a table on a page of 1,280


@pytest.mark.parametrize("parameters", [2, 9])
def test_tables_of_runs_fit_a_page_of_1280_pixels(parameters):
    """Every response that a table has, records with long names, few parameters and many."""
    summary = suite_summary(records=4, scales=3, samples=6, failed=0)
    dims, values = summary.peak_opening.dims, summary.peak_opening.values
    answers = {"peak_slip": "m", "residual_opening": "m", "residual_slip": "m",
               "peak_mean_compressive_stress": "Pa", "peak_compressive_stress": "Pa"}  # fmt: skip
    for name, unit in answers.items():
        summary[name] = (dims, values, {"units": unit, "long_name": name})
    varied = np.random.default_rng(2).uniform(0.1, 0.9, (parameters, 6))
    summary = summary.drop_vars("gap").assign_coords(
        {f"parameter_p{k}": ("sample", row) for k, row in enumerate(varied)}
    )
    summary = summary.assign_coords(record=[f"northridge_mulholland_{k}" for k in range(4)])
    sections = {section.name: section for section in suite_report(Subject(summary, Topic())).sections}
    tables = [
        part for name in ("runs", "worst") for part in sections[name].shown if isinstance(part, PageTable)
    ]
    assert len(tables) == (2 if parameters == 2 else 3)
    for table in tables:
        shown = [
            [max(map(len, lines)) for lines in table.lines],
            [*map(len, table.units or [""] * len(table.head))],
        ]
        shown += [[len(cell.text) for cell in row] for row in table.cells]
        letters = np.max(shown, axis=0)
        letters[0] = min(letters[0], 160.0 / LETTER)  # longer names are broken
        assert LETTER * letters.sum() + PAD * len(letters) <= ROOM, table.head
        assert max(map(len, table.lines)) <= 2


def test_three_records_have_no_bars():
    """Neither their runs nor a rank correlation; the numbers stand in tables, and the page says why."""
    summary = suite_summary(records=3, scales=1, failed=0)
    summary["record_sa"] = summary.record_sa.copy(data=[[1.0], [2.0], [3.0]])
    sections = {section.name: section for section in suite_report(Subject(summary, Topic())).sections}
    for name in ("worst", "correlation"):
        assert not any(isinstance(part, Pictures) for part in sections[name].shown)
    assert "3 records are too few; at least 5" in sections["correlation"].shown[0].text


def test_round_off_is_shown_as_0_beside_what_has_its_unit():
    """1e-5 J of 1e6 J, 1e-17 m of 0.03 m and a share of 3e-13."""
    runs, opening = ("record", "scale", "sample"), np.array([0.01, 0.02, 0.03])[:, None, None]
    small = {"energy_residual": (1e-5, "J"), "energy_input": (1e6, "J"), "ledger_imbalance": (3e-13, "1"),
             "residual_slip": (1e-17, "m")}  # fmt: skip
    more = {
        name: (runs, value + 0.0 * opening, {"units": unit, "long_name": name})
        for name, (value, unit) in small.items()
    }
    summary = summary_of(opening, np.ones((3, 1)), **more)
    table = next(
        part for part in responses_section(Subject(summary, Topic())).parts if isinstance(part, PageTable)
    )
    rows = {row[0].text: [cell.text for cell in row[3:7]] for row in table.cells}
    assert rows["peak opening"][1] == "20"
    for name, found in rows.items():
        if name.split(",")[0] in ("energy residual", "ledger imbalance", "residual slip of a gap"):
            assert found == ["0"] * 4, name


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (18.0, 53.0, [20, 30, 50]),
        (2.8e-4, 4e-3, [5e-4, 1e-3, 2e-3]),
        (1.0, 1.3, [1.0, 1.1, 1.2, 1.3]),
        (0.02, 5.0, [0.1, 1.0]),
        (1e-6, 1.0, [1e-6, 1e-4, 1e-2, 1.0]),
    ],
)
def test_logarithmic_axes_have_three_to_six_round_numbers(low, high, ticks):
    found = logarithmic_ticks(low, high)
    assert 3 <= len(found) <= 7 and found.min() >= low and found.max() <= high
    assert all(np.isclose(found, tick, rtol=1e-9).any() for tick in ticks), found
