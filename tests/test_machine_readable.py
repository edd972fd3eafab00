"""What programs read of the command: one JSON object on stdout, exit codes, the log of a run."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from test_cli import DRAWN, SMALL, call, call_alone, config, edited  # noqa: F401
from typer.main import get_command

import romdam
from romdam import cli
from romdam.records.components import measures

COMMANDS = Path(__file__).parents[1] / "docs" / "commands.md"
STAMPED = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]\d{4} ")


def document(*args: object, code: int = 0) -> dict:
    """The one object on stdout; no token of it is NaN or infinite."""
    found, out, err = call(*args, "--json")
    assert found == code, err

    def refuse(token: str) -> None:
        raise AssertionError(f"{token} is no JSON")

    return json.loads(out, parse_constant=refuse)


@pytest.fixture
def result(config, tmp_path) -> Path:  # noqa: F811
    call("run", config, "--out", tmp_path / "r", "--quiet")
    return tmp_path / "r" / "pulse.nc"


def keys_of(value: object) -> set[str]:
    """Every key of an object, but names of blocks, joints and the like, which are the user's."""
    if isinstance(value, list):
        return set().union(*map(keys_of, value)) if value else set()
    if not isinstance(value, dict):
        return set()
    return set(value).union(*map(keys_of, value.values()))


def test_check_says_as_json_what_python_says(config):  # noqa: F811
    from romdam.pipelines.check import check

    said, found = document("check", config), check(romdam.load_config(config))
    assert said["command"] == "check" and said["valid"] is True and said["romdam"] == romdam.__version__
    assert said["unknowns"] == found.unknowns == 2 * (8 + 10 + 3)
    assert said["joints"]["gap"] | {"area_m2": 100.0} == {
        "between": ["left", "right"], "gaps": found.joints["gap"]["gaps"], "area_m2": 100.0, "friction": 0.0,
        "water_N": 0.0,
    }  # fmt: skip
    assert said["joints"]["gap"]["area_m2"] == pytest.approx(5.0 * 20.0, rel=1e-12)
    assert said["records"]["pulse"]["dt_s"] == 0.01 and said["records"]["pulse"]["steps"] == 59
    assert said["records"]["pulse"]["peak_acceleration_m_s2"] == pytest.approx(5.0)
    assert said["frequencies_closed_Hz"] == list(found.closed_frequencies)
    assert said["memory_bytes"] == found.memory and said["results_bytes"] == found.file_size
    assert any("energy ledger" in text for text in said["not_checked"])


def test_info_says_as_json_what_the_file_holds(result):
    said, ds = document("info", result), xr.open_dataset(result)
    joint, of_file = said["joints"]["gap"], ds.sel(joint="gap")
    assert joint["peak_opening_m"] == float(of_file.peak_opening) > 0.0
    assert joint["peak_opening_time_s"] == float(of_file.peak_opening_time)
    assert joint["peak_compressive_stress_Pa"] == float(of_file.peak_compressive_stress) < 0.0
    mean = float(of_file.peak_mean_compressive_stress)
    assert float(of_file.peak_compressive_stress) <= joint["peak_mean_compressive_stress_Pa"] == mean < 0.0
    assert (
        said["record"] == "pulse" and said["record_dt_s"] == 0.01 and said["sizes"]["gap"] == ds.sizes["gap"]
    )
    assert 0.0 <= said["ledger_imbalance"] < 1e-6
    assert said["estimated_time_error"] == ds.attrs["solver_estimated_time_error"] > 0.0
    code, _, err = call("info", result.with_name(ds.attrs["model_file"]), "--json")
    assert code == 2 and "of reduced blocks" in err


def test_what_is_no_number_is_null(result):
    with xr.open_dataset(result) as opened:
        damaged = opened.load()
    damaged.attrs["solver_loop_cpu_seconds"] = float("nan")
    damaged.to_netcdf(result.with_name("other.nc"), engine="h5netcdf")
    said = document("info", result.with_name("other.nc"))
    assert said["time_loop_cpu_s"] is None


def test_numbers_of_any_kind_are_plain(capsys):
    from romdam.terminal.documents import print_document

    print_document("x", {"a": np.inf, "b": np.array([1.5, np.nan]), "c": np.int8(3), "d": Path("e"), "f": ()})
    said = json.loads(capsys.readouterr().out)
    assert said == {
        "romdam": romdam.__version__, "command": "x", "a": None, "b": [1.5, None], "c": 3, "d": "e", "f": [],
    }  # fmt: skip


def test_records_says_as_json_what_python_measures(config):  # noqa: F811
    record = yaml.safe_load(SMALL)["records"][0]
    edited(config, records=[{**record, "scale": 0.5}, {**record, "name": "lost", "file": "nowhere.txt"}])
    said = document("records", config, code=1)
    (one,) = said["records"]
    acc = np.zeros((3, 60))
    acc[1] = 0.5 * np.loadtxt(config.parent / "pulse.txt")
    expected = measures(acc, 0.01, "y")
    for key, name in (("pga_m_s2", "pga"), ("pgv_m_s", "pgv"), ("arias_m_s", "arias"), ("d5_95_s", "d5_95")):
        assert one["components"]["y"][key] == pytest.approx(expected[name], rel=1e-12)
    assert one["scale_factor"] == 0.5 and one["dt_s"] == 0.01 and one["duration_s"] == pytest.approx(0.59)
    assert list(said["failed"]) == ["nowhere"] or list(said["failed"]) == ["lost"]


def test_certify_says_as_json_what_it_writes(result):
    said = document("certify", result, "--full")
    (path,) = said["written"]
    written = json.loads(Path(path).read_text())
    assert said["error"] == written["error"] and said["statement"] == written["statement"]
    assert said["peak_opening_m"] == written["peak_opening"] > 0.0
    assert document("info", result)["certificate"]["error"] == written["error"]


def test_compare_and_cache_say_as_json_what_they_print(result, config, tmp_path):  # noqa: F811
    edited(config, transient={"finest_step": "1 ms"})
    call("run", config, "--out", tmp_path / "fine", "--quiet")
    said = document("compare", result, tmp_path / "fine" / "pulse.nc", "--tolerance", "0.0001 %", code=1)
    both = romdam.compare_results(result, tmp_path / "fine" / "pulse.nc").dataset
    of_gap = (
        said["quantities"]["gap"] if "gap" in said["quantities"] else next(iter(said["quantities"].values()))
    )
    assert of_gap["l2_difference"] in both.l2_difference.values and said["beyond_tolerance"]
    kept = document("cache")
    assert kept["bytes"] == sum(Path(one["path"]).stat().st_size for one in kept["blocks"])
    assert kept["limit_bytes"] == 1e10


def test_every_key_is_in_the_manual(result, config):  # noqa: F811
    text = COMMANDS.read_text()
    said = [document("check", config), document("info", result), document("records", config)]
    said += [
        document("certify", result, "--full"),
        document("cache"),
        document("compare", result, again(result)),
    ]
    names = {"gap", "left", "right", "pulse", "top", "y"} | set(said[1]["sizes"]) | set(said[5]["quantities"])
    missing = {key for one in said for key in keys_of(one)} - names
    missing = {key for key in missing if f"`{key}`" not in text and not key.startswith("cpu_seconds_")}
    assert not missing, f"add to {COMMANDS.name}: {sorted(missing)}"


def again(result: Path) -> Path:
    path = result.with_name("again.nc")
    path.write_bytes(result.read_bytes())
    return path


@pytest.mark.slow
def test_json_leaves_stdout_to_the_object_and_tells_the_rest_on_stderr(result):
    code, out, err = call_alone("certify", result, "--json", "--verbose")
    assert code == 0 and json.loads(out)["command"] == "certify"
    assert "solutions with the mesh's" in err and "reducing the blocks" in err


NOWHERE = [
    ("check", "none.yaml"), ("run", "none.yaml", "-o", "o"), ("modes", "none.yaml"),
    ("linear", "none.yaml", "-o", "o"), ("show", "none.yaml"),
    ("verify", "none.yaml", "-o", "o"), ("study", "none.yaml", "-o", "o"), ("certify", "none.nc"),
    ("info", "none.nc"), ("info", "none.h5"), ("plot", "none.nc"), ("compare", "a.nc", "b.nc"),
    ("view", "none.nc"), ("wedges", "none.yaml"), ("stability", "none.yaml", "none.nc"),
    ("combinations", "none.yaml"),
    ("records", "nowhere"), ("report", "nowhere"), ("report", "none.nc", "--validation"),
    ("clean", "none.yaml", "-o", "o"), ("init", "nothing"),
    ("export", "none.yaml", "-o", "o", "--to", "opensees"), ("cache", "burn"),
    ("schema", "-o", "/dev/null/x"), ("benchmarks", "--only", "none"),
]  # fmt: skip


@pytest.mark.parametrize("args", NOWHERE, ids=lambda args: " ".join(args[:2]))
def test_what_is_not_there_is_bad_input_told_on_stderr(args, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for more in ((), ("--quiet",)):
        code, out, err = call(*args, *more)
        assert (code, out) == (2, "") and err and "Traceback" not in err
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_that_list_has_every_command():
    assert {args[0] for args in NOWHERE} == set(get_command(cli.app).commands)


def test_every_command_can_be_quiet_and_verbose():
    for name, command in get_command(cli.app).commands.items():
        flags = {flag for option in command.params for flag in option.opts}
        assert {"--quiet", "-q", "--verbose", "-v"} <= flags, name
    code, _, err = call("info", "none.nc", "-q", "-v")
    assert code == 2 and "opposite of --quiet" in err


def log_of(out: Path) -> list[str]:
    (path,) = out.glob("*.log")
    return path.read_text().splitlines()


def test_a_run_lists_every_file_and_logs_all_of_it(config, tmp_path):  # noqa: F811
    raw = yaml.safe_load(DRAWN)
    raw["materials"]["concrete"]["rho"] = "24.4 kg/m3"
    edited(config, materials=raw["materials"], outputs=raw["outputs"])
    out = tmp_path / "out"
    code, stdout, _ = call("run", config, "--out", out)
    listed = {line.removeprefix("written: ") for line in stdout.splitlines() if line.startswith("written: ")}
    assert code == 0 and listed == {str(path) for path in out.iterdir()}
    lines = log_of(out)
    assert all(STAMPED.match(line) for line in lines)
    text = "\n".join(lines)
    for part in (
        f"romdam {romdam.__version__}, Python", f"command: romdam run {config} --out {out}", "numpy ",
        str(config), "reducing the blocks: begins", "simulating pulse: ", "WARNING: ", "24.4 kg/m3 is unus",
        f"written: {out / 'pulse.nc'}", "ended with exit code 0",
    ):  # fmt: skip
        assert part in text, part


def test_each_run_has_its_own_log_and_a_second_one_lists_what_it_wrote(config, tmp_path):  # noqa: F811
    edited(config, outputs={"plots": False})
    for _ in range(2):
        stdout = call("run", config, "--out", tmp_path / "out")[1]
        assert f"written: {tmp_path / 'out' / 'pulse.nc'}" in stdout
    assert len(list((tmp_path / "out").glob("small-*.log"))) == 2


def test_the_log_of_a_failed_record_says_why(config, tmp_path):  # noqa: F811
    record = yaml.safe_load(SMALL)["records"][0]
    edited(config, records=[{**record, "name": "lost", "file": "nowhere.txt"}, record])
    code, stdout, stderr = call("run", config, "--out", tmp_path / "out")
    text = "\n".join(log_of(tmp_path / "out"))
    assert code == 1 and "nowhere.txt" in stderr and "nowhere.txt" not in stdout
    assert re.search(r"ERROR: lost: .*nowhere.txt", text) and "ended with exit code 1" in text


def test_the_log_of_a_refused_run_says_why_and_the_library_keeps_none(config, tmp_path):  # noqa: F811
    (tmp_path / "pulse.txt").write_text("1\nnan\n2\n")
    assert call("run", config, "--out", tmp_path / "out")[0] == 2
    text = "\n".join(log_of(tmp_path / "out"))
    assert "ERROR: " in text and "pulse.txt" in text and "ended with exit code 2" in text
    with pytest.raises(romdam.core.errors.RomdamError):
        romdam.run(romdam.load_config(config), out=tmp_path / "library")
    assert not list((tmp_path / "library").glob("*.log"))


KILLED = """
import sys, time
from romdam.cli import main
from romdam.pipelines import run
def simulate(*rest):
    while True:
        time.sleep(0.01)
run.simulate_motion = simulate
main()
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_run_that_is_killed_leaves_its_log_so_far(config, tmp_path, number):  # noqa: F811
    out = tmp_path / "out"
    args = [sys.executable, "-c", KILLED, "run", str(config), "--out", str(out), "--no-cache"]
    job = subprocess.Popen(args, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        for _ in range(1200):
            time.sleep(0.1)
            if any("simulating pulse: begins" in path.read_text() for path in out.glob("*.log")):
                break
    finally:
        os.kill(job.pid, number)
        job.communicate()
    lines = log_of(out)
    assert all(STAMPED.match(line) for line in lines), "no line is half"
    assert "reducing the blocks: " in "\n".join(lines) and "simulating pulse: begins" in "\n".join(lines)
    ended = "ended with exit code 143" in lines[-1]
    assert ended == (number == signal.SIGTERM)


@pytest.mark.slow
def test_bad_records_name_the_key_of_the_configuration(config):  # noqa: F811
    record = yaml.safe_load(SMALL)["records"][0]
    good = {**record, "name": "good"}
    edited(config, records=[good, {**record, "components": {"y": "HNZ"}}])
    key = "records[1].components.y.channel: "
    for command in (("check", config), ("run", config, "--out", config.parent / "o")):
        err = call(*command)[2]
        assert re.search(rf"small\.yaml:\d+: {re.escape(key)}.*no channel 'HNZ'; it has 1", err), err
    at = int(re.search(r"small\.yaml:(\d+)", err)[1])
    assert "HNZ" in config.read_text().splitlines()[at - 1]
    unit = {k: v for k, v in record.items() if k != "unit"}
    assert "records[0].unit: " in call("check", edited(config, records=[unit]))[2]
