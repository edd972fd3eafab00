"""Records one after another: what is joined, what is refused, and a block that slides in both of them."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from rigid_block import rigid_slip

import romdam
from romdam.core.errors import ConfigError, RecordError
from romdam.core.motion import GroundMotion
from romdam.records.listing import list_records
from romdam.records.processing.sequence import in_sequence
from romdam.terminal.documents import info_document
from romdam.terminal.lines import info_lines, suite_warning_lines
from romdam.terminal.tables import check_tables, suite_table
from romdam.visual.report.page import page
from romdam.visual.report.parts import PageTable
from romdam.visual.report.sections import suite_report
from romdam.visual.report.statistics import responses_section
from romdam.visual.report.subject import Subject, Topic

G, MU = 9.81, 0.3
DT = 0.01


def pulse(size, length, seconds, dt=DT):
    """A rectangle after 0.1 s, with zeros at both ends."""
    t = np.arange(round(seconds / dt) + 1) * dt
    return np.where((t > 0.1) & (t < 0.1 + length), size, 0.0)


MAIN, AFTER = pulse(-7.0, 0.3, 1.5), pulse(-4.5, 0.25, 1.5, 0.5 * DT)
WHOLE = np.concatenate(
    [np.interp(np.arange(301) * 0.5 * DT, np.arange(151) * DT, MAIN), np.zeros(399), AFTER]
)  # at the interval of the aftershock; 400 of it are the rest


def job(folder, records=None, **joint):
    """A stiff block on a stiff base without mass; `records` in place of both."""
    np.savetxt(folder / "main.txt", MAIN)
    np.savetxt(folder / "after.txt", AFTER)
    box = {"size": [2, 2, 2], "element_size": 2.0}
    both = [entry("main", DT), entry("after", 0.5 * DT, after="main", rest="2 s")]
    return {
        "materials": {"stiff": {"E": "3000 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
        "blocks": {
            "base": {"material": "stiff", "mass": False, "box": {"origin": [0, 0, -2], **box}},
            "block": {"material": "stiff", "box": {"origin": [0, 0, 0], **box}},
        },
        "supports": [{"block": "base", "face": "zmin"}],
        "joints": {
            "foot": {
                "between": ["base", "block"],
                "normal_stiffness": "300 GPa/m",
                "shear_stiffness": "300 GPa/m",
                "friction": MU,
                **joint,
            }
        },
        "loads": {"gravity": [0, 0, -G]},
        "damping": {"rayleigh": {"frequencies": ["100 Hz", "1000 Hz"], "ratio": "5 %"}},
        "records": both if records is None else records,
        "model": {"modes": 4},
        "transient": {"finest_step": "0.1 ms"},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False},
    }


def entry(stem, dt, **more):
    known = {"file": f"{stem}.txt", "unit": "m/s2", "dt": f"{dt} s", "components": {"y": 1}}
    return known | more


def load(tmp_path, records):
    return romdam.read_motions(romdam.load_config(job(tmp_path, records), folder=tmp_path))


def slips(tmp_path, records=None, **joint):
    done = romdam.run(romdam.load_config(job(tmp_path, records, **joint), folder=tmp_path), tmp_path / "out")
    assert not done.failures
    return [result.dataset.load() for result in done.results]


def along(result):
    """Mean slip along y since the start, without sign [m]."""
    slip = np.linalg.norm(result.slip.values.mean(axis=1) - result.slip.values[0].mean(axis=0), axis=1)
    return slip


def test_a_sequence_is_the_first_record_rest_and_the_second(tmp_path):
    main, both = load(tmp_path, None)
    assert (main.name, both.name) == ("main", "after")
    assert both.dt == 0.5 * DT
    np.testing.assert_allclose(both.acc[1], WHOLE, atol=1e-12)
    members = both.provenance["sequence"]
    assert [(m["record"], m["start"]) for m in members] == [("main", 0.0), ("after", pytest.approx(3.5))]
    assert json.dumps(both.provenance, default=str)
    assert "sequence" not in main.provenance


def test_a_third_record_follows_the_whole_sequence(tmp_path):
    third = entry("main", DT, name="third", after="after", rest="1 s")
    *_, last = load(tmp_path, [entry("main", DT), entry("after", 0.5 * DT, after="main", rest="2 s"), third])
    starts = [float(m["start"]) for m in last.provenance["sequence"]]
    assert starts == pytest.approx([0.0, 3.5, 6.0])
    assert last.duration == pytest.approx(7.5)
    np.testing.assert_allclose(last.acc[1, : len(WHOLE)], WHOLE, atol=1e-12)
    np.testing.assert_allclose(last.acc[1, -301::2], MAIN, atol=1e-12)


def test_warnings_name_the_record_that_they_are_of():
    one, two = (
        GroundMotion(name, np.zeros((3, 20)), DT, {}, (f"of {name}", "of any")) for name in ("one", "two")
    )
    both = in_sequence(one, 1.0, two)
    assert both.warnings == ("one: of one", "one: of any", "of two", "of any")
    three = in_sequence(both, 1.0, replace(one, name="three", warnings=()))
    assert three.warnings == ("two: one: of one", "two: one: of any", "two: of two", "two: of any")


@pytest.mark.parametrize(("rest", "taken"), [(0.0123, 2), (0.001, 1), (0.01, 2), (0.1 + 0.2, 60)])
def test_a_rest_that_is_no_whole_number_of_intervals_is_said(rest, taken):
    one, two = (GroundMotion(name, np.ones((3, 20)), dt, {}) for name, dt in (("one", DT), ("two", 0.5 * DT)))
    both = in_sequence(one, rest, two)
    first = 38  # the last sample of the first record
    assert (both.acc[:, first + 1 : first + taken] == 0.0).all() and (both.acc[:, first + taken] == 1.0).all()
    text = f"rest: {rest:g} s after one is taken as {taken * 0.005:g} s, {taken} intervals of 0.005 s"
    assert both.warnings == (() if rest in (0.01, 0.1 + 0.2) else (text,))


def test_records_of_a_sequence_are_listed_by_themselves(tmp_path):
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(job(tmp_path)))
    listed = list_records([str(tmp_path / "job.yaml")])
    assert [(one.name, one.error) for one in listed] == [("main", ""), ("after", "")]
    assert listed[1].motion.duration == pytest.approx(1.5)


def test_each_factor_is_of_its_own_record(tmp_path):
    _, both = load(
        tmp_path,
        [entry("main", DT, scale=2.0), entry("after", 0.5 * DT, after="main", rest="2 s", scale=0.5)],
    )
    factors = np.where(np.arange(len(WHOLE)) * 0.5 * DT < 3.0, 2.0, 0.5)
    np.testing.assert_allclose(both.acc[1], factors * WHOLE, atol=1e-12)


@pytest.mark.parametrize(
    ("records", "message"),
    [
        ([entry("main", DT), entry("after", 0.005, after="mian", rest="2 s")], "did you mean main"),
        ([entry("after", 0.005, after="main", rest="2 s"), entry("main", DT)], "there is none; put the rec"),
        ([entry("main", 0.008), entry("after", 0.005, after="main", rest="2 s")], "neither a whole multiple"),
        (
            [entry("main", DT), entry("after", 0.005, after="main", rest="2 s", resampling="fourier")],
            "`resampling` is fourier and that of main is linear",
        ),
        ([entry("main", DT), entry("after", 0.005, after="main")], "give `rest` too"),
        ([entry("main", DT), entry("after", 0.005, rest="2 s")], "give `after` too"),
        ([entry("main", DT), entry("after", 0.005, after="main", rest="0 s")], "greater than 0"),
        ([entry("main", DT), entry("after", 0.005, after="main", rest="2 h")], "3600"),
    ],
)
def test_what_is_no_sequence_is_refused_where_it_stands(tmp_path, records, message):
    with pytest.raises((RecordError, ConfigError), match=message) as caught:
        load(tmp_path, records)
    assert "records[" in str(caught.value) or "records.1" in str(caught.value)


def test_a_duration_that_leaves_the_second_record_out_is_refused(tmp_path):
    short = job(tmp_path) | {"transient": {"finest_step": "0.5 ms", "duration": "3 s"}}
    for command in (romdam.run, romdam.check):
        with pytest.raises(
            ConfigError, match=r"transient.duration: 3 s of after end before its record after"
        ):
            command(romdam.load_config(short, folder=tmp_path))


def test_a_block_slides_on_in_the_aftershock(tmp_path):
    """Newmark's block over both records; in the first the run is that of the mainshock alone."""
    main, both = slips(tmp_path)
    exact = np.abs(rigid_slip(WHOLE, 0.5 * DT, 0.0, MU * G))
    slip = along(both)
    assert slip[-1] == pytest.approx(exact[-1], rel=0.005)
    assert np.abs(slip - exact).max() <= 0.005 * exact[-1]
    assert exact[-1] > 1.15 * exact[600] > 0.0
    assert along(main)[-1] == pytest.approx(slip[300], rel=1e-3)  # other base steps, the same event
    assert "still moves" not in both.attrs["run_warnings"]


def test_a_bond_that_the_mainshock_breaks_holds_no_more(tmp_path):
    """The aftershock alone does not break it; after the mainshock the block slides as one without a bond."""
    bond = {"cohesion": "24 kPa", "tensile_strength": "10 kPa"}
    _, both = slips(tmp_path, **bond)
    (alone,) = slips(tmp_path, [entry("after", 0.5 * DT)], **bond)
    assert along(alone).max() < 1e-6
    exact = np.abs(rigid_slip(AFTER, 0.5 * DT, 0.0, MU * G))[-1]
    slip = along(both)
    assert slip[-1] - slip[680] == pytest.approx(exact, rel=0.01)


def test_a_dam_that_still_moves_when_the_aftershock_comes_is_said(tmp_path):
    moving = job(tmp_path, [entry("main", DT), entry("after", 0.5 * DT, after="main", rest="0.01 s")])
    moving["damping"] = {"rayleigh": {"frequencies": ["100 Hz", "1000 Hz"], "ratio": "0.001 %"}}
    np.savetxt(tmp_path / "main.txt", MAIN[:25])  # cut off while it slides
    done = romdam.run(romdam.load_config(moving, folder=tmp_path), tmp_path / "out")
    sequence = "main at 0 s, after at 0.25 s"
    alone, repeated = (result.dataset.load() for result in done.results)
    assert f"sequence       {sequence}" in info_lines(repeated)
    assert not any(line.startswith("sequence") for line in info_lines(alone))
    assert info_document(repeated, tmp_path)["sequence"] == sequence
    assert info_document(alone, tmp_path)["sequence"] is None
    checked = romdam.check(romdam.load_config(moving, folder=tmp_path))
    assert [record["sequence"] for record in checked.records.values()] == ["-", sequence]
    assert list(check_tables(checked)[-1].columns[-1].cells) == ["-", sequence]
    # statistics count the mainshock's motion once
    with romdam.open_suite(tmp_path / "out") as suite:
        summary = suite.to_dataset().load()
    assert summary.within_sequence.values.tolist() == ["after", ""]
    slides, warned, far = json.loads(summary.attrs["run_warnings"])
    assert slides["record"] == "main" and "still slides" in slides["warning"]
    assert far["record"] == "after" and "where they started" in far["warning"]
    assert warned["runs"] == 1 and warned["record"] == "after" and "still moves" in warned["warning"]
    assert f"1 of 2 runs, after first: {warned['warning']}" in suite_warning_lines(summary, None)
    table = suite_table(summary)
    cells = {str(column.header): list(column.cells) for column in table.columns}
    assert cells["runs"] == ["1"]
    assert cells["median [mm]"] == [f"{1e3 * float(repeated.peak_opening[0]):.2f}"]
    assert table.caption == "without the runs of main (in after) alone, which sequences repeat"
    text = page(suite_report(Subject(summary, Topic("peak_slip"))))
    assert "Statistics over records are without the runs of main (in after) alone" in text
    rows = responses_section(Subject(summary, Topic("peak_slip"))).parts
    slip = next(
        row for part in rows if isinstance(part, PageTable) for row in part.rows if row[0] == "peak slip"
    )
    assert slip[4] == pytest.approx(1e3 * float(repeated.peak_slip[0]), rel=1e-3) and slip[-1] == 1
    main, both = (json.loads(dataset.attrs["run_warnings"]) for dataset in (alone, repeated))
    assert any("after starts at 0.25 s, when the dam still moves" in text for text in both)
    assert not any("still moves" in text for text in main)
