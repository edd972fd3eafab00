"""`romdam compare A B`: what two results share, on one clock, and how far it is apart."""

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from romdam.cli import app
from romdam.core.errors import ResultError
from romdam.error.histories import read_histories
from romdam.error.two_results import phase
from romdam.pipelines.error.two_results import compare_results

TIME = np.arange(2001) * 1e-3
POSITION = np.array([[0.0, 0.0, z] for z in range(4)])
LATE = 0.0123


def openings(time, scale=1.0, late=0.0):
    """Four gaps that open in turn, smooth enough to be interpolated linearly within 1e-5."""
    return scale * 0.01 * np.sin(2.0 * np.pi * np.outer(time - late, [1.0, 1.5, 2.0, 0.5])) ** 2


def netcdf(path, time=TIME, values=None, order=slice(None)):
    values = openings(time) if values is None else values
    xr.Dataset(
        {
            "opening": (("time", "gap"), values[:, order], {"units": "m"}),
            "gap_joint": (("gap",), np.array(["J1", "J1", "J2", "J2"])[order]),
            "gap_position": (("gap", "component"), POSITION[order]),
        },
        {"time": time},
    ).to_netcdf(path, engine="h5netcdf")
    return path


def rows(first, second):
    dataset = compare_results(first, second).dataset
    return {str(name): dataset.sel(quantity=name) for name in dataset["quantity"].values}


def test_known_scale_and_lateness(tmp_path):
    """2 % more and 12.3 ms late, the gaps in another order and on another clock."""
    coarse = np.arange(0.1, 1.9, 5e-3)
    better = netcdf(tmp_path / "b.nc", coarse, openings(coarse), [2, 0, 3, 1])
    more = rows(netcdf(tmp_path / "a.nc", values=openings(TIME, scale=1.02)), better)
    assert set(more) == {"opening of J1", "opening of J2"}
    for one in more.values():
        assert float(one.l2_difference) == pytest.approx(0.02, rel=1e-3)
        assert float(one.peak_difference) == pytest.approx(0.02, rel=1e-3)
        assert float(one.phase) == pytest.approx(0.0, abs=1e-5)
        assert int(one.places) == 2
    late = rows(netcdf(tmp_path / "late.nc", values=openings(TIME, late=LATE)), better)
    assert float(late["opening of J1"].phase) == pytest.approx(LATE, rel=0.03)
    early = rows(better, tmp_path / "late.nc")
    assert float(early["opening of J1"].phase) == pytest.approx(-LATE, rel=0.03)


def test_phase_between_samples():
    """A pulse that is late by a part of a sample; one at rest has no phase."""
    pulse = [np.exp(-(((TIME - at) / 0.05) ** 2))[:, None] for at in (1.0004, 1.0)]
    assert phase(*pulse, 1e-3) == pytest.approx(4e-4, rel=1e-3)
    assert np.isnan(phase(pulse[0], np.ones_like(pulse[0]), 1e-3))


def test_round_off_of_a_component_is_no_difference(tmp_path):
    """Noise of 1e-11 m beside 10 mm of the same node is within 1e-6 and has no phase; 0.1 mm has one."""
    noise = 1e-11 * np.random.default_rng(7).standard_normal((2, len(TIME)))
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for path, other in zip(paths, noise, strict=True):
        motion = openings(TIME)[:, 0]
        table = np.column_stack([TIME, other, motion, 0.01 * motion + other])
        head = "time,displacement:crest:x,displacement:crest:y,displacement:crest:z"
        np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.12g")
    got = rows(*paths)
    still = got["displacement x of crest"]
    assert float(still.l2_difference) < 1e-6 and float(still.peak_difference) < 1e-6
    assert np.isnan(still.phase)
    assert float(got["displacement z of crest"].phase) == pytest.approx(0.0, abs=1e-6)
    assert compare_results(*paths).beyond(1e-5) == []
    shown = CliRunner().invoke(app, ["compare", *map(str, paths), "--tolerance", "0.1 %"])
    assert shown.exit_code == 0
    (row,) = [line for line in shown.output.splitlines() if line.startswith("displacement x")]
    assert row.split()[-1] == "–"


def test_table_of_another_code_in_its_own_units(tmp_path, caplog):
    """Gaps by number, the widest of a joint, displacements; a column of another meaning is told."""
    own, values = tmp_path / "own.nc", openings(TIME)
    netcdf(own)
    with xr.load_dataset(own, engine="h5netcdf") as dataset:
        dataset["displacement"] = (("time", "node", "component"), np.stack([values[:, :3]], axis=1))
        dataset.assign_coords(node=["crest"]).to_netcdf(tmp_path / "all.nc", engine="h5netcdf")
    table = np.column_stack([1e3 * TIME, 1e3 * values[:, 1], values[:, 2:].max(axis=1), values[:, 1], TIME])
    head = "time [ms],opening:1 [mm],opening:J2,displacement:crest:y,moment"
    np.savetxt(tmp_path / "other.csv", table, delimiter=",", header=head, comments="", fmt="%.12g")
    got = rows(tmp_path / "all.nc", tmp_path / "other.csv")
    assert list(got) == ["opening of J1", "widest opening of J2", "displacement y of crest"]
    assert all(float(one.l2_difference) < 1e-10 for one in got.values())
    assert "column 'moment' is not compared" in caplog.text


def test_gaps_that_only_one_has_are_told(tmp_path, caplog):
    np.savez(tmp_path / "b.npz", time=TIME, gap=openings(TIME)[:, :3], position=POSITION[:3])
    got = rows(netcdf(tmp_path / "a.nc"), tmp_path / "b.npz")
    assert [int(one.places) for one in got.values()] == [2, 1]
    assert "3 gaps are at one place, of 4 and 3" in caplog.text


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "t,opening:1\n0,1\n1,2\n", "no column is named time"),
        ("a.csv", "time,opening:1\n0,1\n1,one\n", "line 3: opening:1 must be a finite number"),
        ("a.csv", "time,opening:1\n0,1\n1\n", "line 3: has 1 values for 2 columns"),
        ("a.csv", "time,opening:1\n1,1\n0,2\n", "time must rise"),
        ("a.csv", "time,opening:1\n0,1\n1,nan\n", "line 3: opening:1 must be a finite number"),
        ("a.csv", "time,opening:1 [kg]\n0,1\n1,2\n", "column 'opening:1 .kg.'"),
        ("a.csv", "time,opening:1,opening:1\n0,1,1\n1,2,2\n", "2 columns are"),
        ("a.csv", "time,moment\n0,1\n1,2\n", "neither openings nor displacements"),
        ("a.csv", "", "no column is named time"),
        ("a.csv", "time,displacement:base:x\n0,1\n1,2\n", "no gap, joint or node in common"),
        ("a.csv", "time,opening:1\n7,1\n8,2\n", "must be common"),
        ("a.txt", "", "are compared, not"),
        ("a.nc", "", "a.nc"),
    ],
)
def test_what_cannot_be_compared_is_refused(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(ResultError, match=message):
        compare_results(netcdf(tmp_path / "b.nc"), tmp_path / name)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.opening.attrs.update(units="mm"), "opening is in mm, must be in m"),
        (lambda d: d.update({"opening": d.opening.rename(gap="place")}), "over time, place"),
        (lambda d: d.update({"gap_position": (("gap", "component"), POSITION.astype("U4"))}), "of numbers"),
    ],
)
def test_wrong_netcdf_of_another_code_is_refused(tmp_path, change, message):
    with xr.load_dataset(netcdf(tmp_path / "a.nc"), engine="h5netcdf") as dataset:
        change(dataset)
        dataset.to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match=message):
        read_histories(tmp_path / "b.nc")


def test_command_says_by_its_code_whether_they_agree(tmp_path):
    a, b = netcdf(tmp_path / "a.nc", values=openings(TIME, 1.02)), netcdf(tmp_path / "b.nc")
    run = CliRunner()
    assert run.invoke(app, ["compare", str(a), str(b), "--tolerance", "3 %"]).exit_code == 0
    worse = run.invoke(app, ["compare", str(a), str(b), "--tolerance", "1 %", "-o", str(tmp_path / "out")])
    assert worse.exit_code == 1
    assert "more than 1 % apart: opening of J1, opening of J2" in worse.output
    assert (tmp_path / "out" / "compare.png").stat().st_size > 10_000
    head, row, _ = (tmp_path / "out" / "compare.csv").read_text().splitlines()
    assert head.startswith("quantity,of,first [mm],second [mm],L2 [%]")
    assert row.split(",")[4] == "2"
    assert run.invoke(app, ["compare", str(a), str(a)]).exit_code != 0
