"""Several records of a plain job: one summary, its tables, and a page whose table is sorted and filtered."""

import csv
import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
import xarray as xr
import yaml
from suite_jobs import BASE, made, write_job
from summaries import suite_page
from test_report import Page, rows_of, suite_summary
from typer.testing import CliRunner

import romdam
from romdam.cli import app
from romdam.core.errors import ConfigError, RecordError
from romdam.postprocess.dependence import correlation
from romdam.postprocess.fragility import none_exceeds
from romdam.postprocess.run_columns import run_columns
from romdam.results import table
from romdam.results.suite.report_data import DATA
from romdam.results.table import write_tables
from romdam.visual.report import runs
from romdam.visual.report.subject import Subject, Topic
from romdam.visual.suite_plots import correlation_figure, scatter_figure


def plain(folder, **sections):
    """The configuration of a plain job with the records in a folder; its path."""
    config = write_job(folder, **sections)
    raw = yaml.safe_load(config.read_text()) | {"pipeline": "run"}
    del raw["suite"]
    config.write_text(yaml.safe_dump(raw))
    return config


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Three records, of which the second cannot be read, with figures and a spreadsheet; folder, command."""
    folder = tmp_path_factory.mktemp("records")
    outputs = BASE["outputs"] | {"xlsx": True}
    config = plain(folder, transient={"finest_step": "5 ms", "duration": "0.5 s"}, outputs=outputs)
    (folder / "records" / "r1.txt").write_text("no record")
    done = CliRunner().invoke(app, ["run", str(config), "--out", str(folder / "out")], catch_exceptions=False)
    return folder / "out", done


def test_several_records_end_with_a_summary_tables_and_a_page(run):
    out, done = run
    assert done.exit_code == 1 and "1 of 3 records failed" in done.output
    for name in ("summary.nc", "summary.csv", "summary.xlsx", "report.html"):
        assert f"{out / name}" in done.output and (out / name).is_file()
    assert "not of this run" not in done.output
    with romdam.open_suite(out) as suite:
        assert list(suite.record.values) == ["r0", "r1", "r2"] and suite.attrs["results_folder"] == "."
        assert suite.status.values.ravel().tolist() == [0, 1, 0]
        assert "r1.txt" in str(suite.message[1, 0, 0].values)
        single = suite["runs/r2__0__0"]
        assert float(single.peak_opening[0]) == float(suite.peak_opening.sel(record="r2")[0, 0, 0])
        assert np.isnan(suite.peak_opening.sel(record="r1")).all()
        assert float(suite.record_duration[0, 0]) == 0.5 < float(suite.recorded_duration[0, 0])
        assert (suite.wall_seconds.sel(record=["r0", "r2"]) > 0.0).all()


@pytest.mark.usefixtures("unrendered")
def test_what_entries_do_to_the_size_of_records_is_written_and_said(tmp_path):
    config = plain(tmp_path, records=2)
    raw = yaml.safe_load(config.read_text())
    (entry,) = raw["records"]
    raw["records"] = [
        entry | {"name": "a", "files": None, "file": "records/r0.txt", "scale": {"factor": 1.6, "z": 0.5}},
        entry | {"name": "b", "files": None, "file": "records/r1.txt", "scale": {"pga": "2 m/s2"}},
    ]
    config.write_text(yaml.safe_dump(raw))
    words = ["run", str(config), "--out", str(tmp_path / "out")]
    assert CliRunner().invoke(app, words, catch_exceptions=False).exit_code == 0
    to_pga = 2.0 / np.abs(np.loadtxt(tmp_path / "records" / "r1.txt")).max()
    factors = [[1.6, 1.6, 0.8], [to_pga] * 3]
    with xr.open_dataset(tmp_path / "out" / "summary.nc", engine="h5netcdf") as summary:
        np.testing.assert_allclose(summary.entry_factor.sel(record=["a", "b"]), factors, rtol=1e-12)
        assert not summary.matched.any() and (summary.scale_factor == 1.0).all()
    with (tmp_path / "out" / "summary.csv").open(newline="", encoding="utf-8") as file:
        row = next(one for one in csv.DictReader(file) if one["record"] == "b")
    assert float(row["entry_factor.y"]) == pytest.approx(to_pga, rel=1e-12) and row["matched"] == "0"
    with romdam.open_result(tmp_path / "out" / "a.nc") as result:
        attrs = result.dataset.attrs
        assert [attrs[f"entry_factor_{axis}"] for axis in "xyz"] == pytest.approx(factors[0])
        assert attrs["record_matched"] == 0
    with xr.open_dataset(tmp_path / "out" / DATA, engine="h5netcdf") as data:
        low, high = sorted([1.6, to_pga])
        assert data.attrs["scaled"] == f"scaled by {low:.3g} to {high:.3g}"


def test_one_quantity_has_one_sign_on_a_page():
    summary = suite_summary(failed=0)
    about = {"units": "Pa", "long_name": "stress, compression negative"}
    values = -1e6 - 1e8 * summary.peak_opening.values
    summary["peak_compressive_stress"] = (summary.peak_opening.dims, values, about)
    text = suite_page(Subject(summary, Topic()))
    (row,) = [one for one in rows_of(text, "responses") if one and "compressive" in one[0]]
    largest = float(np.abs(values).max()) / 1e6
    assert float(row[6]) == pytest.approx(largest, rel=1e-3) and all(float(one) > 0.0 for one in row[3:7])
    head = next(k for k, name in enumerate(_heads(text, "runs")) if name == "instant compr.")
    found = [float(one[head]) for one in rows_of(text, "runs") if one]
    assert max(found) == pytest.approx(largest, rel=1e-2) and min(found) > 0.0


def _heads(text, section):
    """The heads of the table of a section."""
    own = text[text.index(f'<section id="{section}"') :]
    return [
        " ".join(re.sub("<.*?>", "", one).split())
        for one in re.findall(r"<th[ >].*?</th>", own[: own.index("</table>")], re.S)
    ]


def test_the_summary_has_the_numbers_of_a_suite(run, tmp_path):
    transient = {"finest_step": "5 ms", "duration": "0.5 s"}
    suite = made(write_job(tmp_path, transient=transient), tmp_path / "suite").summary.sel(
        record=["r0", "r2"]
    )
    with xr.open_dataset(run[0] / "summary.nc", engine="h5netcdf") as own:
        own = own.sel(record=["r0", "r2"])
        stated = {"estimated_mesh_error"}  # of every run; a suite states it once
        assert set(own.variables) - stated == set(suite.variables) - stated
        for name in (n for n in suite.data_vars if suite[n].dtype.kind == "f" and "seconds" not in n):
            np.testing.assert_array_equal(own[name], suite[name], str(name))


def test_csv_and_spreadsheet_say_what_the_summary_does(run):
    out, _ = run
    with (out / "summary.csv").open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    with xr.open_dataset(out / "summary.nc", engine="h5netcdf") as summary:
        columns = run_columns(summary)
        assert head == [column.title for column in columns] and len(rows) == summary.status.size
        assert {"peak_opening.gap [m]", "peak_displacement.top.y [m]", "record_pga [m s-2]"} <= set(head)
        for k, column in enumerate(columns):
            for row, value in zip(rows, column.values.tolist(), strict=True):
                if isinstance(value, float):
                    assert row[k] == "" if np.isnan(value) else float(row[k]) == value
                elif column.name == "status":
                    assert row[k] == ("failed" if value else "done")
                else:
                    assert row[k] == str(value)
    with zipfile.ZipFile(out / "summary.xlsx") as book:
        sheet = book.read("xl/worksheets/sheet1.xml").decode()
        numbers = re.findall(r'<c r="[A-Z]+2"><v>(.*?)</v>', sheet)
        wanted = [float(one) for one, name in zip(rows[0], head, strict=True) if _is_number(one) and one]
        np.testing.assert_allclose(np.array(numbers, dtype=float), wanted, rtol=1e-15)


def _is_number(text):
    try:
        return text != "" and np.isfinite(float(text))
    except ValueError:
        return False


def test_page_links_to_what_is_there(run):
    out, _ = run
    text = (out / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    links = [unquote(link) for link in page.links if not link.startswith(("#", "data:"))]
    assert {"r0.nc", "r2.nc", "r0-energy.png"} <= set(links)
    assert all((out / link).is_file() and "/" not in link for link in links)
    rows = {row[0]: row for row in rows_of(text, "runs") if row}
    assert list(rows)[-1] == "r1" and "failed: " in " ".join(rows["r1"]) and "r1.txt" in " ".join(rows["r1"])
    assert "0.59" in rows["r0"]  # recorded; all are analysed for as long
    assert "analysed" not in _heads(text, "runs")
    assert "Analysed: 0.5 s of records of 0.59 to 0.79 s" in text
    assert "None of 2 records exceeds" in text and "at most 1 - 0.05^(1/2) = 77.6 % would" in text


def test_one_record_has_no_summary_and_no_page(tmp_path):
    config = plain(tmp_path, records=1, outputs=BASE["outputs"] | {"plots": False})
    outcome = romdam.run(romdam.load_config(config), tmp_path / "out")
    assert outcome.summary == ()
    assert [path.name for path in (tmp_path / "out").iterdir() if not path.name.startswith("model-")] == [
        "r0.nc"
    ]


def test_a_summary_as_parquet_and_zarr_is_the_one_in_netcdf(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    pytest.importorskip("zarr", reason="zarr is not installed")
    config = plain(tmp_path, outputs=BASE["outputs"] | {"parquet": True, "zarr": True, "plots": False})
    out, job = tmp_path / "out", romdam.load_config(config)
    for _ in range(2):  # the second takes the place of the first
        outcome = romdam.run(job, out)
    assert {"summary.nc", "summary.parquet", "summary.zarr"} <= {path.name for path in outcome.summary}
    with xr.open_dataset(out / "summary.nc") as wanted, xr.open_zarr(out / "summary.zarr") as found:
        assert {*found.variables} == {*wanted.variables} and found.attrs == wanted.attrs
        for name in wanted.variables:
            if wanted[name].dtype.kind == "f":
                assert found[name].values.tobytes() == wanted[name].values.tobytes(), name
            else:
                assert found[name].values.tolist() == wanted[name].values.tolist(), name
            assert found[name].attrs.get("units") == wanted[name].attrs.get("units")
    rows = parquet.read_table(out / "summary.parquet")
    with (out / "summary.csv").open(newline="") as file:
        head, *lines = csv.reader(file)
    assert rows.column_names == head and rows.num_rows == len(lines)
    for k, name in enumerate(head):
        for one, text in zip(rows.column(name).to_pylist(), (line[k] for line in lines), strict=True):
            same = float(text or "nan") if isinstance(one, int | float) else text
            assert one == same or (one != one and same != same), name
    opening = next(field for field in rows.schema if field.name.startswith("peak_opening"))
    assert opening.metadata[b"units"] == b"m" and b"opening" in opening.metadata[b"long_name"]


@pytest.mark.parametrize(("key", "package"), [("parquet", "pyarrow"), ("zarr", "zarr")])
def test_parquet_and_zarr_without_their_packages_are_refused_before_the_first_run(
    tmp_path, monkeypatch, key, package
):
    config = plain(tmp_path, outputs=BASE["outputs"] | {key: True, "plots": False})
    monkeypatch.setattr(table, "find_spec", lambda name: None)
    said = rf"outputs.{key}: needs the package {package}; .* extra `arrays`, or leave the key out"
    with pytest.raises(ConfigError, match=said):
        romdam.run(romdam.load_config(config), tmp_path / "out")


def test_what_the_end_would_refuse_is_refused_before_the_first_run(tmp_path, monkeypatch):
    config = plain(tmp_path, outputs=BASE["outputs"] | {"xlsx": True, "plots": False})
    monkeypatch.setattr(table, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"outputs.xlsx: needs the package XlsxWriter; .* extra `xlsx`"):
        romdam.run(romdam.load_config(config), tmp_path / "out")
    monkeypatch.undo()
    config = plain(tmp_path)
    raw = yaml.safe_load(config.read_text()) | {"suite": {"of": "rotd50"}}
    config.write_text(yaml.safe_dump(raw))
    with pytest.raises(RecordError, match=r"r0: suite.*rotd50"):
        romdam.run(romdam.load_config(config), tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_runs_are_told_by_the_values_of_their_parameters():
    summary = with_unit(suite_summary(samples=3))
    text = suite_page(Subject(summary, Topic()))
    rows = [row for row in rows_of(text, "runs") if row]
    assert len(rows) == summary.status.size and "no. 2" not in text
    assert {row[2] for row in rows} == {"0", "2.5", "5"} and "gap" in _heads(text, "runs")
    assert [float(row[3]) for row in rows[:3]] == pytest.approx(peaks_of(summary)[:3], rel=5e-3)
    assert rows[-1][0] == "r011" and rows[-1][-1].startswith("failed: contact did not converge")
    worst = [row for row in rows_of(text, "worst") if row]
    assert worst == rows[:10]


def test_a_long_table_has_the_largest_and_says_where_the_others_are(monkeypatch):
    monkeypatch.setattr(runs, "MOST_ROWS", 7)
    text = suite_page(Subject(suite_summary(), Topic()))
    assert len([row for row in rows_of(text, "runs") if row]) == 7
    assert "The 7 runs of the largest peak opening, of 60; all are in summary.csv." in text


def with_unit(summary):
    """The summary with its parameter in metres."""
    summary.gap.attrs["units"] = "m"
    return summary


def peaks_of(summary):
    """Openings of the runs, the largest first [mm]."""
    values = 1e3 * summary.peak_opening.values.ravel()
    return np.sort(values[np.isfinite(values)])[::-1]


def test_upper_bound_where_none_exceeds():
    # a fair coin shows no head in n throws with 0.5^n; the bound is the p for which that is 5 %
    found = [none_exceeds(n) for n in (1, 3, 5, 20)]
    assert found == pytest.approx([0.95, 0.63160, 0.45072, 0.13911], abs=1e-5)
    summary = suite_summary()
    text = suite_page(Subject(summary, Topic(thresholds=(10.0,))))
    assert "at most 25.9 %" in rows_of(text, "fragility")[1][5]  # ten records of twelve ran
    assert "None of 10 records exceeds" in text and "at most 1 - 0.05^(1/10) = 25.9 % would" in text
    # the bound of the largest of n: it holds in 95 % of many samples, whatever the distribution
    largest = np.random.default_rng(5).uniform(size=(4000, 20)).max(axis=1)
    assert np.mean(1.0 - largest <= none_exceeds(20)) == pytest.approx(0.95, abs=0.01)


def test_correlation_is_drawn_within_a_scale_with_its_n():
    summary = suite_summary(records=9, failed=1)
    rng = np.random.default_rng(3)
    summary["record_pga"] = summary.record_pga * rng.uniform(0.5, 2.0, (9, 1))
    found = correlation(summary, "peak_opening")
    (ax,) = correlation_figure(found).axes
    assert len(ax.patches) == 0 and len(ax.lines) == 5 + 1  # dots a scale, the axis; no bars
    assert ax.get_title("left") == "n = 8 records at each scale"
    panels = scatter_figure(summary, "peak_opening", "pga").axes
    assert [ax.get_title("left") for ax in panels] == [f"× {k}, n = 8 records" for k in (1, 2, 4, 5)]
    shown = panels[1].collections[0].get_offsets()[:, 0]
    np.testing.assert_allclose(shown, summary.record_pga.values[:8, 1])


DRIVER = """
const said = [], box = document.querySelector(".runs"), rows = () => [...box.querySelectorAll("tbody tr")];
const column = (k) => rows().filter((row) => !row.hidden).map((row) => row.cells[k].textContent).join(" ");
const input = box.querySelector("input"), buttons = box.querySelectorAll("thead th button");
const head = (k) => buttons[k].parentElement.getAttribute("aria-sort");
said.push(box.querySelector("output").textContent, input.labels[0].textContent.trim(), head(2));
buttons[2].click(); said.push(head(2), column(2));
buttons[0].click(); said.push(head(0), head(2), column(0));
input.value = "R001 2.5"; input.dispatchEvent(new Event("input"));
said.push(box.querySelector("output").textContent, column(0));
document.title = said.join("|");
"""


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_script_sorts_and_filters_in_a_browser(tmp_path):
    summary = with_unit(suite_summary(records=3, scales=1, samples=3, failed=1))
    text = suite_page(Subject(summary, Topic()))
    text = re.sub("<meta http-equiv=.*?>", "", text)  # lets no other script run
    (tmp_path / "page.html").write_text(text.replace("</body>", f"<script>{DRIVER}</script></body>"))
    flags = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    command = ["chromium", *flags, "--dump-dom", f"file://{tmp_path / 'page.html'}"]
    shown = subprocess.run(command, capture_output=True, timeout=120)
    said = re.search("<title>(.*?)</title>", shown.stdout.decode())[1].split("|")
    peaks = [f"{float(one):.3g}" for one in peaks_of(summary)[::-1]]
    assert said[:4] == ["9 of 9 rows", "Filter", "descending", "ascending"]
    assert [float(one) for one in said[4].split()[:6]] == [float(one) for one in peaks]
    assert said[4].split()[6:] == ["–"] * 3  # runs that failed stay last
    assert said[5:7] == ["ascending", ""] and said[7].split() == sorted(said[7].split())
    assert said[8:] == ["1 of 9 rows", "r001"]


def test_written_tables_take_hostile_texts_and_infinite_numbers(tmp_path):
    summary = suite_summary(records=2, scales=1, samples=2, failed=0)
    summary = summary.assign_coords(record=["=1+1", 'a,"b"'], gap=("sample", [0.0, np.inf]))
    paths = write_tables(summary, tmp_path, xlsx=True)
    assert [path.name for path in paths] == ["summary.csv", "summary.xlsx"]
    with Path(paths[0]).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    # an apostrophe keeps a spreadsheet from taking the text for a formula
    assert rows[0]["record"] == "'=1+1" and rows[3]["record"] == 'a,"b"'
    with zipfile.ZipFile(paths[1]) as book:
        assert b"<f>" not in book.read("xl/worksheets/sheet1.xml")  # no formula
