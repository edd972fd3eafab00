"""The report of one run: numbers in both systems of units, and sheets on which nothing is lost or covered."""

import html
import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from pypdf import PdfReader
from typer.testing import CliRunner

import romdam
from romdam.cli import app
from romdam.config.load import load_config
from romdam.config.stated import stated_keys
from romdam.core.display_units import SI, US
from romdam.error.statement import opening_errors, sentences
from romdam.pipelines.report import report_run
from romdam.postprocess.joint_roles import bearing_first
from romdam.visual.plots import FIGURES
from romdam.visual.report.document import A4, LETTER, _column_widths, set_sheets
from romdam.visual.report.one_run import RunSubject, _facts, run_report
from romdam.visual.report.page import page
from romdam.visual.report.parts import Fact, PageCell, PageSection, PageTable, Report, Text

NIST = {  # SP 811, appendix B.8: what one unit is in SI, to its seven digits
    ("m", 25.4e-3): "in", ("m2", 9.290304e-2): "ft²", ("N", 4448.222): "kip", ("Pa", 6894.757): "psi",
    ("kg m-3", 16.01846): "lb/ft³", ("N m", 1355.818): "kip ft", ("m s-2", 0.3048): "ft/s²",
    ("kg", 0.4535924): "lb", ("J", 1355818.0): "10⁶ ft lb", ("N m-1", 14593.90): "kip/ft",
}  # fmt: skip


@pytest.mark.parametrize(("of", "name"), NIST.items(), ids=NIST.values())
def test_customary_units_have_the_sizes_of_nist(of, name):
    units, size = of
    assert US.suited(units, 1.0) == (pytest.approx(size, rel=5e-7), name)


def test_a_change_of_temperature_has_no_offset():
    assert US.suited("K", 1.0) == (pytest.approx(5.0 / 9.0), "°F")


def test_si_takes_a_prefix_where_that_is_usual():
    assert SI.suited("Pa", 3.1e10) == (1e9, "GPa") and SI.suited("N m-3", 2e10) == (1e9, "GPa/m")
    assert SI.suited("Pa", 1e3) == (1e3, "kPa") and SI.suited("Pa", 999.0) == (1.0, "Pa")
    assert SI.suited("m s-2", 1e4) == (1.0, "m/s²") and SI.suited("m", 0.0) == (1.0, "m")


def test_stated_keys_are_those_off_their_defaults_with_units_of_their_numbers():
    job = load_config("configs/koyna.yaml")
    keys = {key.path: key for key in stated_keys(job.config)}
    assert keys["materials.rock.E"].value == 31.027e9 and keys["materials.rock.E"].units == "Pa"
    assert keys["gravity_dam.joints.base.normal_stiffness"].units == "N m-3"
    assert keys["loads.gravity"].units == "m s-2" and keys["damping.rayleigh.frequencies"].units == "Hz"
    assert keys["loads.hydrostatic[0].faces"].value[0] == "monolith_1 upstream"
    assert "Density" in keys["materials.rock.rho"].text
    assert not {"materials.rock.expansion", "gravity_dam.divisions.along", "loads.weight"} & set(keys)
    loads = job.config.loads.model_copy(update={"weight": "staged"})
    changed = job.config.model_copy(update={"loads": loads})
    assert {key.path for key in stated_keys(changed)} == {*keys, "loads.weight"}


def subject_of(dataset, job, system=SI):
    return RunSubject(dataset, job.config, opening_errors(dataset.attrs), sentences(dataset.attrs), system)


def cells(report: Report, head: str) -> dict[str, list[str]]:
    """First cell -> the others, of the table of a report whose first column has a name."""
    tables = [part for section in report.sections for part in section.shown if isinstance(part, PageTable)]
    table = next(table for table in tables if table.caption.startswith(head))
    return {row[0].text: [cell.text for cell in row[1:]] for row in table.cells}


@pytest.mark.parametrize(("system", "length", "stress"), [(SI, 1e-3, 1e6), (US, 0.0254, 6894.757293168)])
def test_peaks_stand_in_the_units_of_the_report(result, job, system, length, stress):
    dataset = result.dataset
    rows = cells(run_report(subject_of(dataset, job, system)), "Peaks")
    assert [*rows] == ["J1", "J2"]
    for name, row in rows.items():
        of_joint = dataset.sel(joint=name)
        expected = float(of_joint.peak_opening) / length, float(of_joint.peak_compressive_stress) / stress
        shown = float(row[0]), float(row[3].replace("−", "-"))
        assert shown == pytest.approx(expected, rel=6e-3)


def test_the_peak_of_the_record_is_in_g(result, job):
    report = run_report(subject_of(result.dataset, job))
    (table,) = (
        part
        for section in report.sections
        for part in section.shown
        if section.title == "Ground motion" and isinstance(part, PageTable) and not part.head
    )
    rows = {row[0].text: row[1].text for row in table.cells}
    peaks = {
        f"peak acceleration {axis}": float(result.dataset.peak_ground_acceleration.sel(component=axis))
        for axis in result.dataset.component.values
    }
    for name, peak in peaks.items():
        if peak > 0.0:
            number, unit = rows[name].split()
            assert unit == "g" and float(number) == pytest.approx(peak / 9.80665, rel=6e-3)
    assert max(peaks.values()) > 0.0


def test_a_check_beyond_its_limit_is_not_met(result, job):
    dataset = result.dataset.assign_attrs(solver_ledger_imbalance=2e-3, solver_accuracy=0.01,
                                          solver_estimated_time_error=0.004)  # fmt: skip
    report = run_report(subject_of(dataset, job))
    tables = [part for section in report.sections for part in section.shown if isinstance(part, PageTable)]
    rows = {
        row[0].text: row[3].text for table in tables if "verdict" in table.head[3:4] for row in table.cells
    }
    assert rows["energy that the ledger lacks, of the exchanged"] == "missed"
    assert rows["error of the openings from the steps, L2"] == "met"
    assert rows["error of the openings from the mesh, L2"] == "not judged"


def test_the_page_and_the_document_are_written_beside_the_result(result):
    paths = report_run(result.path, US, pdf=True)
    assert [path.name for path in paths] == ["quake-report.html", "quake-report.pdf"]
    page = html.unescape(paths[0].read_text(encoding="utf-8"))
    opening = float(result.dataset.peak_opening.max()) / 0.0254
    assert f"{opening:.3g} in" in page and "romdam report quake.nc --units us --pdf" in page
    assert {address[:5] for address in re.findall(r'src="([^"]+)', page)} == {"data:"}
    document = PdfReader(paths[1])
    titles = re.findall(r"<h2.*?>(.*?)</h2>", page)
    assert [mark.title for mark in document.outline] == titles and len(titles) > 5
    for mark in document.outline:  # each leads to the sheet that has its heading
        text = document.pages[document.get_destination_page_number(mark)].extract_text()
        assert mark.title in [line.strip() for line in text.splitlines()]


def test_the_report_leads_with_bases_and_lifts(result, job):
    """J1 as it is, upright; J2 turned to lie level: it stands first in facts, sections and figures."""
    gaps = result.dataset.gap_joint.values == "J2"
    normal, tangent = result.dataset.gap_normal.values.copy(), result.dataset.gap_tangent.values.copy()
    normal[gaps], tangent[gaps] = [0.0, 0.0, 1.0], np.eye(3)[:2]
    dataset = result.dataset.assign_coords(
        gap_normal=result.dataset.gap_normal.copy(data=normal),
        gap_tangent=result.dataset.gap_tangent.copy(data=tangent),
    )
    report = run_report(subject_of(dataset, job))
    assert [section.title for section in report.sections[:2]] == ["Bases and lifts", "The dam"]
    assert report.facts[0].name.endswith("every base and lift")
    tables = {
        section.title: [
            row[0].text for part in section.shown if isinstance(part, PageTable) for row in part.cells
        ]
        for section in report.sections
    }
    assert {*tables["Bases and lifts"]} == {"J2"} and {*tables["Joints"]} == {"J1"}
    assert bearing_first(dataset).joint.values.tolist() == ["J2", "J1"]
    assert run_report(subject_of(result.dataset, job)).sections[0].title == "The dam"


def test_figures_without_anything_to_show_are_not_drawn(result):
    """A run in which nothing moves."""
    dataset = result.dataset.load()
    still = {
        name: values * 0.0
        for name, values in dataset.data_vars.items()
        if values.dtype.kind == "f" and not name.startswith("stress")
    }
    still["sliding_safety_factor"] = dataset.sliding_safety_factor * np.nan
    drawn = {name: draw(dataset.assign(still), SI) for name, draw in FIGURES.items()}
    names = "ground_motion", "top_displacements", "joint_opening", "opening_envelope", "sliding", "energy"
    assert [name for name in (*names, "joint_displacement", "dissipated_energy") if drawn[name]] == []


def test_joints_are_drawn_at_one_scale(result):
    dataset = result.dataset.load().copy(deep=True)
    dataset.opening[:, dataset.gap_joint.values == "J1"] *= 0.01
    limits = {ax.get_ylim() for ax in FIGURES["joint_opening"](dataset, SI).axes}
    assert len(limits) == 1


def test_heads_have_two_lines_at_most_and_units_a_row_of_their_own():
    head = [
        "joint",
        "least factor of safety",
        "largest of a gap [mm]",
        "compression at one instant [MPa]",
        "a [b] c",
    ]
    table = PageTable(head, [["J1", 1.5, 2.0, 3.0, 4.0]])
    assert table.lines == [
        ["joint"], ["least factor", "of safety"], ["largest", "of a gap"], ["compression", "at one instant"],
        ["a [b] c"],
    ]  # fmt: skip
    assert table.units == ["", "", "[mm]", "[MPa]", ""] and PageTable(["joint"], [["J1"]]).units == []
    text = page(Report("t", "", [], [PageSection("s", "S", [table])]))
    rows = re.findall("<tr.*?</tr>", text, re.S)
    assert len(rows) == 3 and rows[1].count("<td") == 5 and "least factor\nof safety" in rows[0]


def unlike(dataset):
    """The dataset with no two values alike of gaps, joints, bodies, stages and faces."""
    stage_opening = np.array([[1e-3, 5e-3, np.nan, np.nan, np.nan], [2e-3, -1e-3, 4e-3, 7e-3, 3e-3]])
    grouted = np.array([[True, False, False, False, False], [False, True, True, True, True]])
    at_rest = 1e6 * np.arange(1.0, 13.0).reshape(2, 6)
    return dataset.assign(
        construction_opening=dataset.construction_opening.copy(data=stage_opening),
        construction_grouted=dataset.construction_grouted.copy(data=grouted),
        joint_water_force=dataset.joint_water_force.copy(
            data=1e6
            * np.tile([[1.0, -2.0, 3.0], [4.0, 5.0, -6.0]], (dataset.joint_water_force.sizes["time"], 1, 1))
        ),
        **{
            f"{kind}_at_rest": dataset[f"{kind}_at_rest"].copy(data=factor * at_rest)
            for kind, factor in (("loads", 1.0), ("joints", -0.25), ("supports", -0.75))
        },
        imbalance_at_rest=dataset.imbalance_at_rest.copy(data=[3e-11, 4e-12]),
    ).assign_coords(gap_area=dataset.gap_area.copy(data=[0.5, 0.7, 0.2, 0.4, 1.1]))


def test_every_table_has_the_figures_of_its_own_rows(result, job):
    """Values that differ from gap to gap, joint to joint, stage to stage and body to body, by hand."""
    report = run_report(subject_of(unlike(result.dataset), job))
    assert {name: row[:3] for name, row in cells(report, "Joints").items()} == {
        "J1": ["left – right", "2", "1.2"],
        "J2": ["left – right", "3", "1.7"],
    }
    assert cells(report, "Largest opening by stage") == {
        "J1": ["5, then grouted in part", "2, then grouted in part"],
        "J2": ["–", "7, then grouted"],
    }
    assert cells(report, "Resultant of the water") == {"J1": ["1", "−2", "3"], "J2": ["4", "5", "−6"]}
    tables = [part for section in report.sections for part in section.shown if isinstance(part, PageTable)]
    balance = next(table for table in tables if table.caption.startswith("Forces at rest"))
    assert [[cell.text for cell in row] for row in balance.cells] == [
        ["whole dam", "loads", "1", "2", "3", "4", "5", "6", "3.0e-11"],
        ["whole dam", "joints", "−0.25", "−0.5", "−0.75", "−1", "−1.25", "−1.5", ""],
        ["whole dam", "supports", "−0.75", "−1.5", "−2.25", "−3", "−3.75", "−4.5", ""],
        ["left", "loads", "7", "8", "9", "10", "11", "12", "4.0e-12"],
        ["left", "joints", "−1.75", "−2", "−2.25", "−2.5", "−2.75", "−3", ""],
        ["left", "supports", "−5.25", "−6", "−6.75", "−7.5", "−8.25", "−9", ""],
    ]


def test_facts_are_the_worst_of_all_joints_and_faces(result, job):
    """Of joints that slide by unlike lengths and factors, and of two faces; all from the histories."""
    dataset = result.dataset
    rows = cells(run_report(subject_of(dataset, job)), "Sliding")
    for number, name in enumerate(rows):
        of_joint = dataset.sel(joint=name)
        moved = dataset.joint_displacement.values[:, number]
        normal = dataset.gap_normal.values[dataset.gap_joint.values == name][0]
        along = moved - np.outer(moved @ normal, normal)
        rest = along[dataset.time.values >= dataset.time.values[-1] - 1.0].mean(axis=0)
        largest = float(of_joint.peak_slip)
        shown = [float(value) for value in (rows[name][2], *rows[name][5:])]
        assert shown[0] == pytest.approx(float(of_joint.sliding_safety_factor.min()), rel=6e-3)
        assert shown[1] == pytest.approx(1e3 * np.linalg.norm(rest), rel=6e-3)
        assert 0.0 < shown[2] <= 1e3 * largest and shown[3] > shown[2]
    second = dataset.face_principal_stress * 0.5
    faces = xr.concat([second, dataset.face_principal_stress], "stress_face")
    two = dataset.drop_dims("stress_face").assign(face_principal_stress=faces)
    facts = {fact.name: fact.value for fact in _facts(subject_of(two, job))}
    worst = float(dataset.face_principal_stress.sel(area_percentile=98.0).max())
    assert float(facts["98 % stress of the worst face"].split()[0]) == pytest.approx(worst / 1e6, rel=6e-3)
    numbers = np.array([[float(row[2]), float(row[5])] for row in rows.values()])
    assert facts["largest residual slip"] == f"{1e3 * numbers[:, 1].max():.0f} µm"
    least = next(value for name, value in facts.items() if name.startswith("least factor of safety"))
    assert float(least.split()[0]) == numbers[:, 0].min()
    assert facts["largest opening"] == f"{1e3 * float(dataset.peak_opening.max()):.3g} mm"
    assert len(rows) == 2 and not np.isclose(*numbers.T, rtol=1e-2).any()


def test_a_sample_of_a_suite_has_its_parameters(result, job):
    dataset = result.dataset.assign_attrs(parameter_friction=0.55)
    assert cells(run_report(subject_of(dataset, job)), "Sample") == {"friction": ["0.55"]}


def test_a_run_of_motions_from_python_has_a_report(tmp_path):
    keys = load_config("configs/two_cantilevers.yaml").to_dict()
    keys["transient"] = {"finest_step": "10 ms"}
    keys["outputs"] = {"plots": False, "error_estimate": False, "mesh_error": False}
    acc = 2.0 * np.sin(20.0 * np.arange(0.0, 1.0, 0.01))
    motion = romdam.GroundMotion.from_arrays("pulse", {"y": acc}, dt=0.01)
    (path,) = romdam.run(keys, tmp_path, motions=motion).paths
    assert "motion given in Python" in report_run(path)[0].read_text(encoding="utf-8")


def boxes(sheet):
    """Text and box [points] of every text of a sheet."""
    canvas = FigureCanvasAgg(sheet)
    sheet.set_dpi(72.0)
    renderer = canvas.get_renderer()
    return [(text.get_text(), text.get_window_extent(renderer)) for text in sheet.texts if text.get_text()]


@pytest.mark.parametrize("paper", [A4, LETTER])
def test_sheets_hold_every_cell_within_their_margins_and_cover_none(paper):
    """A long table of words and numbers, one cell of it longer than a line, one word longer than a column."""
    rng = np.random.default_rng(5)
    words = [f"word{k}" for k in range(400)]
    rows = [
        [words[k], float(rng.normal()), " ".join(words[k : k + k % 30]), 10.0**k if k < 5 else k]
        for k in range(90)
    ]
    rows.append(["a" * 150, 1.0, "$x_1$ and 50 % of \\alpha", 2])
    table = PageTable(["name", "a number with a long name", "text", "last"], rows, "A table")
    report = Report(
        "A title " * 20, "about", [Fact("n", "1")], [PageSection("s", "Section", [Text("$a$ 1"), table])]
    )
    sheets = set_sheets(report, paper).all
    assert len(sheets) > 2
    written = [boxes(sheet) for sheet in sheets]
    for texts in written:
        for k, (_, box) in enumerate(texts):
            assert box.x0 > 40.0 and box.x1 < paper[0] - 40.0 and box.y0 > 20.0 and box.y1 < paper[1] - 40.0
            assert not any(
                other.shrunk(0.98, 0.9).overlaps(box.shrunk(0.98, 0.9)) for _, other in texts[k + 1 :]
            )
        assert sum(text == "text" for text, _ in texts) <= 1
    heads = [any(text == "last" for text, _ in texts) for texts in written]
    assert all(heads), "the head stands on every sheet of the table"
    shown = " ".join(text for texts in written for text, _ in texts)
    for row in table.cells:
        for cell in row:
            assert all(word in shown.replace(" ", "") for word in cell.text[:20].split())


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["quake.nc", "--response", "peak_slip"], "--response"),
        (["quake.nc", "--units", "imperial"], "'si', 'us'"),
        (["quake.nc", "--threshold", "2 mm"], "--threshold"),
        ([".", "--units", "us"], "--units"),
    ],
)
def test_options_of_the_other_kind_of_report_are_refused(result, options, reason):
    path = str(result.path.parent / options[0])
    made = CliRunner().invoke(app, ["report", path, *options[1:]], env={"COLUMNS": "200"})
    assert made.exit_code == 2 and reason in made.output


def test_a_long_path_leaves_room_for_the_texts_beside_it():
    """Of 500 points path and text share what the key leaves; no column gets more than it needs."""
    key, path, text = (PageCell(words) for words in ("records[0].file", "/data/" * 20, "What it is. " * 20))
    widths = _column_widths([[key, path, text]], [False] * 3, 8.0, 500.0)
    whole, path_wide, text_wide = widths
    assert whole == pytest.approx(_column_widths([[key]], [False], 8.0, 500.0)[0])
    assert path_wide >= 150.0 and text_wide == pytest.approx(path_wide, abs=1.0)
    assert widths.sum() == pytest.approx(500.0 - 2 * 7.0, abs=0.1)
    short = _column_widths([[key, PageCell("1"), text]], [False] * 3, 8.0, 500.0)
    assert short[1] < 10.0 and short.sum() == pytest.approx(500.0 - 2 * 7.0, abs=0.1)
