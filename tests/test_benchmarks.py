"""The benchmark set: every number within its tolerance, sources, exit codes, files."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from reference_run import reference
from test_cli import call

from romdam.benchmarks import catalogue, measured
from romdam.benchmarks.case import BenchmarkCase, PublishedValue, run_cases, select_cases
from romdam.benchmarks.catalogue import CASES
from romdam.benchmarks.jobs import modes_of
from romdam.benchmarks.table import shipped_rows
from romdam.core.errors import ConfigError, ConvergenceError

SLOW = {
    "arch-model",
    "bar-impact",
    "newmark-block",
    "nafems-fv52",
    "pine-flat",
    "pine-flat-tests",
    "pacoima",
    "cracked-base",
    "ssnp142f",
    "two-cantilevers",
}
# case: what the source of a number that is known to differ begins with
KNOWN = {"ssnp142f": "GEFDYN", "pacoima": "Alves", "pine-flat-tests": "Rea"}
SOUGHT = "westergaard"  # a case that takes no time


def by_name(name):
    (case,) = [case for case in CASES if case.name == name]
    return case


@pytest.mark.parametrize(
    "name",
    [pytest.param(c.name, marks=[pytest.mark.slow] if c.name in SLOW else []) for c in CASES],
)
def test_every_number_is_within_its_tolerance(name):
    shipped = [row for row in shipped_rows() if row.case == name]
    for row, of_release in zip(run_cases([by_name(name)]), shipped, strict=True):
        assert row.ours == pytest.approx(of_release.ours, rel=1e-3), "romdam/benchmarks/figures.json is old"
        known = name in KNOWN and row.source.startswith(KNOWN[name])
        assert row.verdict == ("known difference" if known else "within"), row


def test_every_number_has_a_source_and_a_tolerance():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names) and set(names) >= SLOW | set(KNOWN)
    for case in CASES:
        assert case.what and case.quantities
        for one in case.quantities:
            assert one.source and one.published != 0.0 and 0.0 < one.tolerance <= 0.75, (case.name, one)
            known = case.name in KNOWN and one.source.startswith(KNOWN[case.name])
            assert bool(one.reason) == known
            assert one.reason or one.tolerance <= 0.05, "a wide tolerance needs a reason"


def verdicts(name, ours):
    return [row.verdict for row in run_cases([replace(by_name(name), compute=lambda: ours)])]


@pytest.mark.slow
@pytest.mark.parametrize("concrete, rock", [(0.5, 0.5), (2.0, 2.0), (1.0, 0.5)])
def test_pacoima_of_a_wrong_modulus_is_outside(concrete, rock):
    """Of both moduli the frequencies go with the root; of softer rock alone they fall by 5 % or more."""
    E = measured.PACOIMA_CONCRETE["E"]
    keys = measured.pacoima(measured.PACOIMA_CONCRETE | {"E": concrete * E}, rock * 13.9e9)
    wrong = np.array(measured.pacoima_frequencies(keys))
    assert verdicts("pacoima", wrong)[0] == "outside"
    right = np.array(by_name("pacoima").compute())
    if concrete == rock:
        assert wrong / right == pytest.approx(rock**0.5, rel=1e-6)
        assert set(verdicts("pacoima", wrong)) == {"outside"}
    else:
        assert (wrong / right < 0.95).all()


@pytest.mark.slow
def test_pine_flat_of_a_wrong_model_is_outside():
    concrete = measured.PINE_FLAT_CONCRETE
    winter, summer, ratio = measured.pine_flat_periods(concrete | {"E": 0.5 * concrete["E"]})
    assert verdicts("pine-flat-tests", (winter, summer, 1.0)) == ["outside"] * 3  # 1.0: no water
    right = by_name("pine-flat-tests").compute()
    assert [winter, summer, ratio] == pytest.approx(
        [right[0] * 2**0.5, right[1] * 2**0.5, right[2]], rel=1e-6
    )


@pytest.mark.slow
def test_the_share_of_water_in_the_laboratorys_arch_is_that_of_its_density():
    """A modulus leaves the ratio as it is; concrete of half the density does not, and is outside."""
    ratios = []
    for E, rho in ((20e9, 2400.0), (10e9, 2400.0), (20e9, 1200.0)):
        modes = modes_of(measured.arch_model({"E": E, "nu": 0.2, "rho": rho}), 1)
        ratios.append(modes.freq[0] / modes.dry_freq[0])
    assert ratios[1] == pytest.approx(ratios[0], rel=1e-6)
    assert verdicts("arch-model", [ratios[0]]) == ["within"]
    assert verdicts("arch-model", [ratios[2]]) == ["outside"]


def test_numbers_of_the_two_cantilevers_are_those_of_the_stored_histories():
    """Of `tests/reference/two_cantilevers`, in which rows are 0.01 s apart: peaks between them are higher."""
    _, top, gap, _ = reference()
    stored = [gap.max(), np.abs(top[:, 1]).max(), np.abs(top[:, 4]).max()]
    opening, _, left, right = (one.published for one in by_name("two-cantilevers").quantities)
    assert [opening, left, right] == pytest.approx(stored, rel=2e-3)


def fake(published=2.0, tolerance=0.01, reason="", ours=2.0):
    quantity = PublishedValue("length", published, "m", tolerance, "Somebody (1999)", "printed", reason)
    return BenchmarkCase("fake", "a rod", (quantity,), lambda: [ours])


def test_verdicts():
    (row,) = run_cases([fake()])
    assert (row.verdict, row.difference, row.note) == ("within", 0.0, "")
    assert run_cases([fake(published=2.1)])[0].verdict == "outside"
    assert run_cases([fake(ours=float("nan"))])[0].verdict == "outside"
    (row,) = run_cases([fake(published=2.1, tolerance=0.1, reason="because")])
    assert (row.verdict, row.note) == ("known difference", "because")
    assert run_cases([fake(published=2.1, reason="because")])[0].verdict == "outside"


def test_a_case_that_fails_leaves_the_others():
    def fails():
        raise ConvergenceError("step 3")

    rows = run_cases([replace(fake(), compute=fails), fake()])
    assert [row.verdict for row in rows] == ["failed", "within"]
    assert np.isnan(rows[0].ours) and rows[0].note == "step 3"


def test_a_number_outside_its_tolerance_gives_exit_code_1(monkeypatch, tmp_path):
    monkeypatch.setattr(catalogue, "CASES", (fake(published=2.1), fake()))
    code, out, err = call("benchmarks", "--out", tmp_path / "t.json")
    assert code == 1
    assert "fake" in out and "outside" in out and "Somebody (1999) (printed)" in out
    assert "fake, length: -4.76 % from Somebody (1999), limit 1 %" in err
    assert "1 of 2 numbers" in err
    rows = json.loads((tmp_path / "t.json").read_text())["rows"]
    assert [row["verdict"] for row in rows] == ["outside", "within"]


def test_unknown_patterns_and_formats_are_refused(tmp_path):
    code, _, err = call("benchmarks", "--only", "kojna")
    assert code == 2 and "none of" in err and "near it are koyna" in err
    code, _, err = call("benchmarks", "--out", tmp_path / "t.xls", "--only", SOUGHT)
    assert code == 2 and ".csv, .json, .md" in err and not list(tmp_path.iterdir())
    with pytest.raises(ConfigError, match="nafems-fv52, nafems-fv32"):
        select_cases(CASES, "nafems")
    assert [case.name for case in select_cases(CASES, "nafems-*")] == ["nafems-fv32", "nafems-fv52"]
    two = [case.name for case in select_cases(CASES, "nafems-fv52", "nafems-fv3?")]
    assert two == ["nafems-fv32", "nafems-fv52"], "in the catalogue's order"
    assert select_cases(CASES) == tuple(CASES)
    code, out, _ = call("benchmarks", "--list", "--only", "nafems-fv32", "--only", "nafems-fv52")
    assert code == 0 and "nafems-fv32" in out and "nafems-fv52" in out


def test_list_computes_nothing(monkeypatch):
    def fails():
        raise AssertionError

    monkeypatch.setattr(catalogue, "CASES", tuple(replace(case, compute=fails) for case in CASES))
    code, out, _ = call("benchmarks", "--list")
    assert code == 0
    for case in CASES:
        assert case.name in out and all(one.source in out for one in case.quantities)


def test_files_hold_the_whole_table(tmp_path):
    for suffix in ("csv", "json", "md"):
        code, out, _ = call("benchmarks", "--only", SOUGHT, "--out", tmp_path / "new" / f"t.{suffix}")
        assert code == 0 and "written" in out
    (row,) = run_cases([by_name(SOUGHT)])
    with (tmp_path / "new" / "t.csv").open(newline="", encoding="utf-8") as file:
        (cells,) = csv.DictReader(file)
    assert float(cells["ours"]) == row.ours and cells["source"] == row.source and cells["verdict"] == "within"
    document = json.loads((tmp_path / "new" / "t.json").read_text())
    assert document["command"] == "benchmarks" and document["rows"][0]["published"] == row.published
    text = (tmp_path / "new" / "t.md").read_text()
    assert f"| {SOUGHT} | {row.quantity} |  | {row.ours:.6g} | {row.published:.6g} |" in text
    assert len(list((tmp_path / "new").iterdir())) == 3


def test_a_failed_case_is_an_empty_number_in_files(monkeypatch, tmp_path):
    def fails():
        raise ConvergenceError("step 3")

    monkeypatch.setattr(catalogue, "CASES", (replace(fake(), compute=fails),))
    for suffix in ("csv", "json"):
        code, _, err = call("benchmarks", "--out", tmp_path / f"t.{suffix}")
        assert code == 1 and "fake, length: step 3" in err
    assert json.loads((tmp_path / "t.json").read_text())["rows"][0]["ours"] is None
    assert "nan" not in (tmp_path / "t.csv").read_text()
