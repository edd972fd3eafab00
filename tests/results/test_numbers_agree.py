"""Numbers that people read, parsed from everything that prints them, against the result's own file.

Terminal, JSON, page, PDF, tables, figures and summary of a job print one set of peaks, factors, verdicts and
errors: each printed number is that of the NetCDF file to its last digit.
"""

import csv
import json
import re
import zlib
from dataclasses import dataclass
from html.parser import HTMLParser

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
import yaml
from test_cli import call

import romdam
from romdam.postprocess.checks import MET, MISSED, NOT_JUDGED
from romdam.visual.plots import FIGURES
from romdam.visual.style import STYLE

JOB = """
title: Two blocks on rock
materials:
  concrete: {E: 20 GPa, nu: 0.2, rho: 2400 kg/m3}
blocks:
  rock:
    material: concrete
    mass: false
    weight: false
    box: {origin: [0, 0, -4], size: [8, 8, 4], element_size: 4 m}
  left: {material: concrete, box: {origin: [0, 0, 0], size: [4, 8, 12], element_size: 4 m}}
  right: {material: concrete, box: {origin: [4, 0, 0], size: [4, 8, 8], element_size: 4 m}}
supports: [{block: rock, face: zmin}]
joints:
  a_contraction: {between: [left, right], normal_stiffness: 10 GPa/m, shear_stiffness: 5 GPa/m, friction: 0.2}
  base_left: {between: [rock, left], normal_stiffness: 10 GPa/m, shear_stiffness: 5 GPa/m, friction: 0.8}
  base_right: {between: [right, rock], normal_stiffness: 10 GPa/m, shear_stiffness: 5 GPa/m, friction: 0.8}
loads:
  gravity: [0, 0, -9.81]
  hydrostatic: [{level: 6 m, faces: [{block: left, face: ymin}, {block: right, face: ymin}]}]
damping: {rayleigh: {frequencies: [5 Hz, 50 Hz], ratio: 5 %}}
records: [{name: pulse, file: pulse.txt, unit: m/s2, dt: 0.01 s, components: {y: 1}}]
model: {modes: 6}
transient: {accuracy: 2 %}
outputs:
  output_interval: 0.01 s
  nodes: {top: {block: left, at: [0, 0, 12]}, low: {block: right, at: [8, 0, 8]}}
"""
G, INCH, PSI, FOOT = 9.80665, 0.0254, 6894.757293168361, 0.3048
UNITS = {  # as they are printed -> SI
    "m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "in": INCH, "ft": FOOT, "Pa": 1.0, "kPa": 1e3, "MPa": 1e6,
    "GPa": 1e9, "psi": PSI, "ksi": 1e3 * PSI, "m/s²": 1.0, "m s-2": 1.0, "ft/s²": FOOT, "g": G, "s": 1.0,
    "%": 0.01, "": 1.0, "1": 1.0,
}  # fmt: skip


def changed(raw, **sections):
    return {**raw, **sections}


def jobs():
    """Jobs by what is unlike the others in each."""
    raw = yaml.safe_load(JOB)
    record = raw["records"][0]
    face = {"stress": {"strength": "1 MPa", "faces": [{"block": "left", "face": "ymin"}]}}
    smooth = {name: {k: v for k, v in joint.items() if "s" not in k[:1] and k != "friction"}
              for name, joint in raw["joints"].items()}  # fmt: skip
    held = [{"block": block, "face": "zmin"} for block in ("left", "right")]
    return {
        "everything in the ring": changed(
            raw, outputs=raw["outputs"] | face | {"stress": face["stress"] | {"ring": {"edges": "9 m"}}}
        ),
        "without friction": changed(
            raw,
            blocks={name: raw["blocks"][name] for name in ("left", "right")},
            joints={"a_contraction": smooth["a_contraction"]},
            supports=held,
        ),
        "a sequence": changed(
            raw, records=[record, record | {"name": "after", "after": "pulse", "rest": "0.5 s"}]
        ),
        "a suite": changed(
            raw,
            pipeline="suite",
            records=[record, record | {"name": "twice", "scale": 2}],
            suite={
                "keep": "full",
                "parameters": {"mu": {"path": "joints.base_left.friction", "values": [0.8, 0.9]}},
            },
        ),
        "written coarsely, in US units": changed(
            raw, outputs=raw["outputs"] | face | {"output_interval": "0.1 s"}
        ),
    }


class Tables(HTMLParser):
    """Rows of cells, and facts, of a page."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.cell, self.texts, self.units = [], None, [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag == "tr":
            self.rows.append([])
            self.units = ("class", "units") in attrs
        if tag in ("td", "th"):
            self.cell = ""

    def handle_endtag(self, tag):
        if tag in ("td", "th") and self.cell is not None:
            self.rows[-1].append(" ".join(self.cell.split()))
            self.cell = None
        if tag == "tr" and self.units:  # a row of its own below the head
            *self.rows, head, units = self.rows
            self.rows.append([f"{name} {unit}".strip() for name, unit in zip(head, units, strict=True)])

    def handle_data(self, data):
        if self.cell is not None:
            self.cell += data
        self.texts.append(data)

    def table(self, *head):
        """Rows under a head that begins so, by their first cell, and the head."""
        return next(self.tables(*head), ([], []))

    def tables(self, *head):
        """The same of every table whose head begins so."""
        for k, row in enumerate(self.rows):
            if [name.partition(" [")[0] for name in row[: len(head)]] == list(head):
                under = []
                for cells in self.rows[k + 1 :]:
                    if len(cells) != len(row) or cells[0] == row[0]:
                        break
                    under.append(cells)
                yield row, under


def rows_of_pdf(data):
    """Texts of every line of a PDF of matplotlib's, from left to right."""
    lines = []
    for stream in re.finditer(rb"stream\r?\n(.*?)endstream", data, re.DOTALL):
        try:
            content = zlib.decompress(stream[1])
        except zlib.error:
            continue
        row = {}
        for x, y, shown in re.findall(rb"1 0 -?0 1 ([\d.]+) ([\d.]+) cm\s+BT(.*?)\sET\s", content, re.DOTALL):
            pieces = re.findall(rb"\(((?:\\.|[^\\()])*)\)", shown, re.DOTALL)
            text = b"".join(re.sub(rb"\\(.)", _unescaped, piece, flags=re.DOTALL) for piece in pieces)
            row.setdefault(float(y), []).append((float(x), text.decode("utf-16-be")))
        lines += [[text for _, text in sorted(row[y])] for y in sorted(row, reverse=True)]
    return lines


def _unescaped(match):
    return {b"n": b"\n", b"r": b"\r", b"t": b"\t", b"b": b"\b", b"f": b"\f"}.get(match[1], match[1])


@dataclass
class Printed:
    """A printed number in SI, and half of what its last digit stands for."""

    value: float
    half: float

    @classmethod
    def of(cls, text, unit="", digits=3):
        number = text.strip().replace("−", "-")
        number = re.sub(
            r"·10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)",
            lambda m: "e" + m[1].translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")),
            number,
        )
        mantissa, _, power = number.partition("e")
        whole, _, decimals = mantissa.partition(".")
        # of a whole number the digits beyond those that are shown are zeros, 123000 of 122654
        beyond = max(len(whole.lstrip("-")) - digits, 0) if not decimals else 0
        scale = UNITS[unit] * 10.0 ** int(power or 0)
        return cls(float(number) * UNITS[unit], 0.5 * 10.0 ** (beyond - len(decimals)) * scale)


def unit_of(head):
    found = re.search(r"\[([^\]]*)\]$", head)
    return found[1] if found else ""


def agree(text, exact, unit, of, digits=3):
    """The printed text is the number, to its last digit."""
    shown = Printed.of(text, unit, digits)
    assert abs(shown.value - exact) <= 1.001 * shown.half + 1e-9 * abs(exact), (
        f"{of}: {text} {unit} for {exact}"
    )


def table_of_terminal(text, title):
    """Rows of a table on stdout, by the columns of its head."""
    lines = text.splitlines()
    start = next((k for k, line in enumerate(lines) if line.strip().startswith(title)), None)
    if start is None:
        return []
    head = lines[start + 1]
    names = re.split(r"\s{2,}", head.strip())
    rows = []
    for line in lines[start + 2 :]:
        cells = re.split(r"\s{2,}", line.strip())
        if len(cells) not in (len(names), len(names) - 1):  # the last may be empty
            break
        rows.append(dict(zip(names, cells, strict=False)))
    return rows


def check_peaks(dataset, page, stdout, document, record):
    """Peaks of joints: page, terminal and JSON."""
    tables = [
        (head, row) for head, rows in page.tables("joint", "largest opening") for row in rows
    ]  # of bases, and of the others
    rows = [row for _, row in tables]
    names = [str(name) for name in dataset.joint.values]
    assert [row[0] for row in rows] == sorted(names, key=lambda name: not name.startswith("base"))
    variables = {
        "largest opening": "peak_opening", "compression, mean of an interval": "peak_mean_compressive_stress",
        "compression at one instant": "peak_compressive_stress", "largest slip": "peak_slip",
    }  # fmt: skip
    terminal = {row["joint"]: row for row in table_of_terminal(stdout, "Peaks") if row["record"] == record}
    columns = {
        "peak_opening": ("opening [mm]", "mm"), "peak_slip": ("slip [mm]", "mm"),
        "peak_mean_compressive_stress": ("compression, mean of a writing interval [MPa]", "MPa"),
        "peak_compressive_stress": ("at one instant [MPa]", "MPa"),
    }  # fmt: skip
    keys = {
        "peak_opening": "_m",
        "peak_slip": "_m",
        "peak_mean_compressive_stress": "_Pa",
        "peak_compressive_stress": "_Pa",
    }
    compared = 0
    for head, row in tables:
        of_joint = dataset.sel(joint=row[0])
        for title, cell in zip(head, row, strict=True):
            name = variables.get(title.partition(" [")[0])
            if name is None:
                continue
            exact = float(of_joint[name])
            agree(cell, exact, unit_of(title), f"page, {name} of {row[0]}")
            column, unit = columns[name]
            agree(terminal[row[0]][column], exact, unit, f"terminal, {name} of {row[0]}")
            assert document["joints"][row[0]][name + keys[name]] == pytest.approx(exact, rel=1e-12, abs=1e-12)
            compared += 1
        at = row[head.index("at [s]")]
        assert at.replace("–", "-") == terminal[row[0]]["at [s]"]
    assert compared >= 3 * len(rows) - 1


def check_maxima(dataset, page, stdout, table):
    """Largest values: page, table on stdout and as a file."""
    head, rows = page.table("quantity", "value", "unit", "where")
    assert rows and head[:4] == ["quantity", "value", "unit", "where"]
    written = {(row["quantity"], row["where"] if row["where"] else ""): row for row in table}
    seen = 0
    for quantity, value, unit, where, *_ in rows:
        entry = next(
            row
            for (name, _), row in written.items()
            if name == quantity and (row["where"] == where or "(" in where or not where)
        )
        if value in ("–", "-"):
            assert entry["value"] == "nan"
            continue
        exact = float(entry["value"])  # six digits
        agree(value, exact, unit, f"page, {quantity}")
        seen += 1
    for axis in "xyz":
        entry = next((row for (name, _), row in written.items() if name == f"displacement {axis}"), None)
        if entry is not None and float(entry["value"]) > 0.0:
            exact = float(dataset.peak_displacement.sel(component=axis).max())
            assert float(entry["value"]) == pytest.approx(exact, rel=1e-5)
            assert exact >= float(abs(dataset.displacement.sel(component=axis)).max()) * (1 - 1e-9)
    terminal = table_of_terminal(stdout, "Maxima")
    assert terminal and seen
    for row in terminal:
        entry = next(
            e
            for (name, _), e in written.items()
            if name == row["quantity"]
            and e["where"].replace("", "") in (row["where"], "", row["where"].replace("-", ""))
        )
        if row["value"] != "-":
            agree(row["value"], float(entry["value"]), "", f"terminal, {row['quantity']}")


def check_sliding(dataset, page, stdout, table, record):
    """Factors, residual slips and verdicts: page, terminal and file; bases first, and the headline."""
    pairs = [(head, row) for head, rows in page.tables("joint", "block", "verdict") for row in rows]
    rows = [row for _, row in pairs]
    terminal = {r["joint"]: r for r in table_of_terminal(stdout, "Sliding") if r["record"] == record}
    if "sliding_safety_factor" not in dataset:
        assert not rows and not terminal
        return
    assert [row[0] for row in rows] == ["base_left", "base_right", "a_contraction"] == list(terminal)
    assert [row["joint"] for row in table] == list(terminal)
    least = np.nanmin(dataset.sliding_safety_factor.values, axis=0)
    factors = dict(zip(map(str, dataset.joint.values), least, strict=True))
    for (head, row), entry in zip(pairs, table, strict=True):
        name = row[0]
        agree(row[head.index("least factor of safety")], factors[name], "", f"page, factor of {name}")
        agree(terminal[name]["least factor of safety"], factors[name], "", f"terminal, factor of {name}")
        agree(entry["least factor of safety"], factors[name], "", f"table, factor of {name}")
        assert row[2] == terminal[name]["verdict"] == entry["verdict"]
        column = next(k for k, title in enumerate(head) if title.startswith("residual slip"))
        exact = float(terminal[name]["residual slip [mm]"]) * 1e-3  # four digits
        agree(row[column], exact, unit_of(head[column]), f"page, residual slip of {name}")
        assert entry["residual slip [mm]"] == terminal[name]["residual slip [mm]"]
    at = page.texts.index("least factor of safety against sliding, every base and lift")
    bases = min(factors["base_left"], factors["base_right"])
    shown = next(text for text in page.texts[at - 4 : at + 5] if re.match(r"[\d.]+ \(base_", text))
    agree(shown.split()[0], bases, "", "headline factor")
    assert factors["a_contraction"] <= bases


def check_errors(dataset, page, stdout, information, document):
    """Errors and their total: terminal, page and JSON; verdicts of accuracies."""
    attrs = dataset.attrs
    exact = {
        "steps": attrs.get("solver_estimated_time_error"),
        "modes": attrs.get("error_estimate_opening_l2"),
        "mesh": attrs.get("discretisation_opening_l2"),
    }
    _, rows = page.table("check", "value", "limit", "verdict")
    checks = {row[0]: row[1:] for row in rows}
    (first, *_) = [row for row in table_of_terminal(stdout, "Estimated error of the openings")
                   if row["record"] == str(attrs["record"])]  # fmt: skip
    for part, value in exact.items():
        shown, _, verdict = checks[f"error of the openings from the {part}, L2"]
        if value is None:
            assert shown == "unknown" and verdict == NOT_JUDGED
            continue
        agree(shown.split()[0], value, "%", f"page, error of the {part}", 2)
        if part != "modes":
            agree(first[f"{part}, all joints, L2 [%]"], value, "%", f"terminal, error of the {part}", 2)
        if part == "steps":
            assert verdict == (MET if value <= attrs["solver_accuracy"] else MISSED)
            assert ("NOT reached" in information) == (verdict == MISSED)
            assert document["estimated_time_error"] == value
        else:
            assert verdict == NOT_JUDGED
    together = sum(value for value in exact.values() if value is not None)
    total = checks["error of the openings together, L2, at most"][0]
    assert total == first["total, all joints, at most, L2"] and total in information
    agree(total.partition(" ")[0], together, "%", "total", 2)
    assert any(text == total for text in page.texts[:40])


def check_motion(dataset, page, document):
    """Peak of the record: page, JSON and figure, over all steps."""
    peak = float(dataset.peak_ground_acceleration.sel(component="y"))
    (shown,) = [row[1] for row in page.rows if row and row[0] == "peak acceleration y"]
    agree(shown.split()[0], peak, "g", "page, peak ground acceleration")
    assert document["record_peak_acceleration_m_s2"] == pytest.approx(peak, rel=1e-9)
    with mpl.rc_context(STYLE):
        figure = FIGURES["ground_motion"](dataset, romdam.core.display_units.SI)
    (mark,) = [text.get_text() for ax in figure.axes for text in ax.texts]
    agree(mark.split()[0], peak, mark.split()[1], "figure, peak ground acceleration")


def check_figures(dataset):
    """Peaks that figures print."""
    si = romdam.core.display_units.SI
    with mpl.rc_context(STYLE):
        opening = FIGURES["joint_opening"](dataset, si)
        envelope = FIGURES["opening_envelope"](dataset, si)
    for ax in opening.axes:
        name = ax.get_ylabel().split("\n")[0]
        for text in ax.texts:
            value, unit, *_ = text.get_text().split()
            agree(value, float(dataset.peak_opening.sel(joint=name)), unit, f"figure, opening of {name}")
    for ax in envelope.axes if envelope is not None else ():
        if title := ax.get_title(loc="left"):
            name, _, peak = title.partition("\n")
            value, unit = peak.split()
            agree(value, float(dataset.peak_opening.sel(joint=name)), unit, f"map of {name}")


def check_summary(summary, dataset, at):
    """Responses of the row of a run are those of its own result."""
    row = summary.isel(scale=0).sel(record=at[0]).isel(sample=at[1])
    for name in (
        "peak_opening",
        "peak_slip",
        "peak_compressive_stress",
        "peak_mean_compressive_stress",
        "peak_displacement",
    ):
        np.testing.assert_allclose(row[name].values, dataset[name].values, rtol=1e-12, err_msg=name)
    least = np.nanmin(dataset.sliding_safety_factor.values, axis=0)
    np.testing.assert_allclose(1.0 / row.sliding_demand_ratio.values, least, rtol=1e-9)
    assert float(row.estimated_time_error) == dataset.attrs["solver_estimated_time_error"]
    if "error_estimate_opening_l2" in dataset.attrs:
        assert float(row.estimated_reduction_error) == dataset.attrs["error_estimate_opening_l2"]


def check_page_of_runs(page, dataset, name, mu):
    """The table of all runs has the peaks of each."""
    head, rows = page.table("record")
    at = {column: k for k, column in enumerate(head)}
    chosen = [row for row in rows if row[0] == name and (mu is None or float(row[at["mu"]]) == mu)]
    for words, variable in {
        "peak opening": "peak_opening",
        "peak slip": "peak_slip",
        "largest displ.": "peak_displacement",
    }.items():
        title = next(title for title in head if title.startswith(f"{words} ["))
        exact = float(dataset[variable].max())
        agree(chosen[0][at[title]], exact, unit_of(title), f"page of runs, {variable} of {name}")


def check_document(page, lines):
    """Every row of the page's tables of numbers is a line of the PDF, wherever its long texts break."""
    printed, compared = [[_plain(cell) for cell in line] for line in lines], 0
    for row in page.rows:
        head = next((known for known in HEADS if all(map(str.startswith, row, known))), None)
        _, under = page.table(*(name.partition(" [")[0] for name in row)) if head is not None else ([], [])
        for cells in under:
            numbers = [_plain(cell) for cell in cells[1:] if re.fullmatch(r"[−\d.]+( %)?", cell)]
            first = _plain(cells[0])
            lines_of_row = [line for line in printed if line and first.startswith(line[0])]
            assert any(set(numbers) <= set(line) for line in lines_of_row), cells
            compared += len(numbers)
    assert compared > 10


HEADS = (
    ["joint", "largest opening"],
    ["joint", "block", "verdict"],
    ["quantity", "value"],
    ["check", "value"],
)


def _plain(text):
    """Letters that every font of a PDF has at their own place: no signs beyond ASCII, no ligatures."""
    return re.sub(r"[^!-~]|ff|fi|fl|ffi", "", text)


def write_record(folder):
    disp = np.sin(np.linspace(0.0, np.pi, 120)) ** 6 * np.sin(np.linspace(0.0, 21.0, 120))  # it ends at rest
    acc = np.gradient(np.gradient(disp, 0.01), 0.01)
    np.savetxt(folder / "pulse.txt", 6.0 * acc / np.abs(acc).max())


LONG = ("without friction", "a suite", "a sequence", "written coarsely, in US units")


@pytest.mark.parametrize("kind", [pytest.param(k, marks=[pytest.mark.slow] * (k in LONG)) for k in jobs()])
def test_all_that_is_printed_of_a_job_is_one_set_of_numbers(kind, tmp_path, request):
    if kind != "without friction":  # one job has its pictures drawn
        request.getfixturevalue("unrendered")
    write_record(tmp_path)
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(jobs()[kind]))
    out, us = tmp_path / "out", kind == "written coarsely, in US units"
    code, stdout, err = call(
        "run", tmp_path / "job.yaml", "--out", out, *(["--workers", 1] if kind == "a suite" else [])
    )
    assert code == 0 and "RuntimeWarning" not in err, err
    results = sorted(
        path for path in out.rglob("*.nc") if path.name not in ("summary.nc", "design.nc", "report-data.nc")
    )
    results = [path for path in results if "record" in xr.open_dataset(path, engine="h5netcdf").attrs]
    assert len(results) == {"a sequence": 2, "a suite": 4}.get(kind, 1)
    for path in results[::3] if kind == "a suite" else results:  # each record and each value once
        code, _, err = call("report", path, "--pdf", *(["--units", "us"] if us else []))
        assert code == 0, err
        code, information, err = call("info", path)
        code_of_json, document, _ = call("info", path, "--json")
        code_of_plot, plotted, _ = call("plot", path)
        assert (code, code_of_json, code_of_plot) == (0, 0, 0), err
        text = path.with_name(f"{path.stem}-report.html").read_text(encoding="utf-8")
        page, document = Tables(text), json.loads(document)
        with romdam.open_result(path) as opened:
            dataset = opened.dataset.load()
        record = str(dataset.attrs["record"])
        assert float(dataset.imbalance_at_rest.max()) <= 1e-6, "in suites too"
        tables = {}
        for name in ("maxima", "sliding"):
            file = path.with_name(f"{path.stem}-{name}.csv")
            tables[name] = list(csv.DictReader(file.open(encoding="utf-8"))) if file.exists() else []
        check_peaks(dataset, page, information, document, record)
        if kind != "a suite":
            check_peaks(dataset, page, stdout, document, record)
            check_errors(dataset, page, stdout, information, document)
        check_maxima(dataset, page, plotted, tables["maxima"])
        check_sliding(dataset, page, information, tables["sliding"], record)
        check_motion(dataset, page, document)
        check_figures(dataset)
        check_document(page, rows_of_pdf(path.with_name(f"{path.stem}-report.pdf").read_bytes()))
        if kind == "everything in the ring":
            words = {"".join(row) for row in page.rows if row and row[0] == "left.ymin"}
            assert any("not judged" in word for word in words) and not any("fails" in word for word in words)
            assert "not judged" in stdout and "fails" not in stdout
            assert (dataset.acceptance == -2).all()
        if len(results) > 1:
            name, *indices = record.split("__")  # of a suite with the numbers of scale and sample
            with xr.open_dataset(out / "summary.nc", engine="h5netcdf") as summary:
                check_summary(summary.load(), dataset, (name, int(indices[1]) if indices else 0))
            of_runs = Tables((out / "report.html").read_text(encoding="utf-8"))
            check_page_of_runs(of_runs, dataset, name, dataset.attrs.get("parameter_mu"))
    assert not us or "psi" in text
