"""The command as a person meets it: exit codes, one message per mistake, files where they are said to be."""

import io
import os
import re
import subprocess
import sys
import textwrap
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
import typer
import xarray as xr
import yaml
from typer.testing import CliRunner

import romdam
from romdam import cli

SMALL = """
materials:
  concrete: {E: 30 GPa, nu: 0.18, rho: 2440 kg/m3}
blocks:
  left: {material: concrete, box: {origin: [0, -5, 0], size: [5, 5, 20], element_size: 5 m}}
  right: {material: concrete, box: {origin: [0, 0, 0], size: [5, 10, 20], element_size: 5 m}}
supports:
  - {block: left, face: zmin}
  - {block: right, face: zmin}
joints:
  gap: {between: [left, right], normal_stiffness: 16 GPa/m}
damping:
  rayleigh: {frequencies: [5 Hz, 50 Hz], ratio: 5 %}
records:
  - {name: pulse, file: pulse.txt, unit: m/s2, dt: 0.01 s, components: {y: 1}}
model: {order: reduced, modes: 10}
transient: {finest_step: 2 ms}
outputs:
  output_interval: 0.01 s
  nodes: {top: {block: right, at: [0, 0, 20]}}
  plots: false
"""
DRAWN = SMALL.replace("plots: false", "plots: true")  # five figures take most of such a run


@pytest.fixture
def config(tmp_path) -> Path:
    disp = np.sin(np.linspace(0.0, np.pi, 60)) ** 6  # it ends at rest, where it began
    acc = np.gradient(np.gradient(disp, 0.01), 0.01)
    np.savetxt(tmp_path / "pulse.txt", 5.0 * acc / np.abs(acc).max())
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    return path


def call(*args: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of `main`, in this process: the kernels are loaded once."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["romdam", *map(str, args)])
        patch.setenv("COLUMNS", "200")
        for name, value in (("MPLBACKEND", "agg"), ("OPENBLAS_THREAD_TIMEOUT", "18")):
            patch.setenv(name, value)  # as the command does: what these were comes back
        try:
            cli.main()
        except SystemExit as stop:
            return int(stop.code or 0), out.getvalue(), err.getvalue()
    return 0, out.getvalue(), err.getvalue()


def call_alone(*args: object) -> tuple[int, str, str]:
    """The same in a process of its own, as the console script runs it."""
    code = "from romdam.cli import main; main()"
    run = [sys.executable, "-c", code, *map(str, args)]
    done = subprocess.run(run, capture_output=True, text=True, env={**os.environ, "COLUMNS": "200"})
    return done.returncode, done.stdout, done.stderr


def edited(config: Path, **sections: object) -> Path:
    raw = yaml.safe_load(config.read_text())
    raw.update(sections)
    config.write_text(yaml.safe_dump(raw))
    return config


def refuse(config: Path, *parts: str, args: tuple[object, ...] = ()) -> None:
    """The command ends with 2, one message that holds `parts`, no traceback, and no file."""
    out = config.parent / "out"
    code, stdout, stderr = call("run", config, "--out", out, *args)
    assert code == 2, stderr
    assert "Traceback" not in stderr and stdout == ""
    assert stderr.startswith("romdam: ") and stderr.count("romdam: ") == 1
    for part in parts:
        assert part in stderr
    written = [path for path in out.glob("*") if path.suffix != ".log"]
    assert not written, "nothing half-written; a log says why"


def test_run_then_info_then_plot(config, tmp_path):
    out = tmp_path / "results"
    config.write_text(DRAWN)
    code, stdout, stderr = call_alone("run", config, "--out", out)
    assert (code, stderr) == (0, "")
    assert f"written: {out / 'pulse.nc'}" in stdout
    ds = xr.open_dataset(out / "pulse.nc")
    assert f"{1e3 * float(ds.peak_opening.sel(joint='gap')):.2f}" in stdout
    assert float(ds.peak_opening.max()) > 1e-5, "the pulse opens the joint"
    names = {p.name for p in out.iterdir()}
    assert {"pulse.nc", "pulse-joint_opening.png", ds.attrs["model_file"]} <= names
    code, stdout, _ = call("info", out / "pulse.nc")
    assert code == 0
    assert "error          not measured against the mesh, estimated below; `romdam verify" in stdout
    assert "\nestimate       Leaving out modes changes the openings" in stdout and "pulse" in stdout
    assert "time stepping  error about" in stdout and "by a quarter of the step" in stdout
    code, stdout, _ = call("plot", out / "pulse.nc", "--out", tmp_path / "figures")
    assert code == 0 and (tmp_path / "figures" / "pulse-energy.png").is_file()


def test_quiet_prints_nothing_and_verbose_tells_the_stages(config, tmp_path):
    assert call("run", config, "--out", tmp_path / "a", "--quiet") == (0, "", "")
    _, _, stderr = call_alone("run", config, "--out", tmp_path / "a", "--verbose")
    for stage in ("reducing the blocks", "simulating pulse", "writing the result"):
        assert stage in stderr


def test_check_tells_sizes_and_runs_nothing(config, tmp_path):
    before = sorted(tmp_path.iterdir())
    code, stdout, _ = call("check", config)
    assert code == 0
    for part in ("left", "hex8", "59", "unknowns", "is valid"):
        assert part in stdout
    assert sorted(tmp_path.iterdir()) == before


def test_verify_states_the_error_in_the_result(config, tmp_path):
    out = tmp_path / "results"
    call("run", config, "--out", out, "--quiet")
    code, stdout, stderr = call("verify", config, "--out", out, "--duration", "0.4 s")
    assert code == 0, stderr
    assert "in L2" in stdout and (out / "verification.png").is_file()
    assert "in L2" in call("info", out / "pulse.nc")[1]
    with romdam.open_result(out / "pulse.nc") as result:
        assert "in L2" in result.dataset.attrs["error_statement"]
    call("run", config, "--out", out, "--quiet")
    assert "in L2" in call("info", out / "pulse.nc")[1], "a later run keeps the statement"


@pytest.mark.slow
def test_verification_of_a_record_or_a_gap_table_of_before_is_not_stated(config, tmp_path, caplog):
    """The configuration names files; what stands in them is what is run."""
    (tmp_path / "gap.csv").write_text("x,y,z,gap\n0,0,0,0\n5,0,0,0\n0,0,20,0\n")
    joint = {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "gap": {"table": "gap.csv"}}
    edited(config, joints={"gap": joint}, outputs={"plots": False})
    out, record, table = tmp_path / "out", tmp_path / "pulse.txt", tmp_path / "gap.csv"
    assert call("verify", config, "--out", out, "--duration", "0.4 s")[0] == 0
    acc, gaps = record.read_text(), table.read_text()
    changes = {
        "of other samples of that record": (record, "\n".join(reversed(acc.splitlines()))),  # of one peak
        "of another scene": (table, gaps.replace("20,0", "20,0.001")),
    }
    for said, (file, text) in changes.items():
        file.write_text(text)
        caplog.clear()
        assert call("run", config, "--out", out)[0] == 0 and said in caplog.text
        assert "not measured against the mesh" in call("info", out / "pulse.nc")[1]
        code, _, refused = call("certify", out / "pulse.nc")
        assert code == 0, refused  # the run is of what is there now
        record.write_text(acc)
        table.write_text(gaps)
        code, _, refused = call("certify", out / "pulse.nc")
        assert code == 2 and ("its samples have changed" in refused or "another scene" in refused), refused
    assert call("run", config, "--out", out)[0] == 0
    assert "in L2" in call("info", out / "pulse.nc")[1]


def test_verify_takes_the_strongest_part_and_says_so_and_what_it_costs(config, tmp_path, monkeypatch):
    monkeypatch.setattr("romdam.pipelines.error.verify.WINDOW", 0.3)
    code, stdout, stderr = call("verify", config, "--out", tmp_path / "part")
    assert code == 0, stderr
    told = stdout.replace("\n", " ")
    assert "0.3 s of pulse from its 0." in told and "for 0.3 s of pulse" in told
    assert told.index("steps of the mesh's") < told.index("in L2")
    code, stdout, stderr = call("verify", config, "--out", tmp_path / "all", "--full")
    assert code == 0 and "0.59 s of pulse: peak" in stdout.replace("\n", " "), stderr
    assert call("verify", config, "--out", tmp_path, "--full", "--duration", "1 s")[0] == 2
    edited(config, transient={"finest_step": 0.002, "duration": 0.2})
    for asked in ((), ("--full",)):  # nothing that the job does not run
        code, stdout, stderr = call("verify", config, "--out", tmp_path / "short", *asked)
        assert code == 0 and "0.2 s of pulse: peak" in stdout.replace("\n", " "), stderr


def test_five_lines_of_python(config, tmp_path):
    job = romdam.load_config(config)
    outcome = romdam.run(job, out=tmp_path / "results")
    result = romdam.open_result(outcome.paths[0])
    top = result.dataset.displacement.sel(node="top").values
    node = int(np.abs(result.points("right") - [0, 0, 20]).sum(axis=1).argmin())
    whole = result.displacement("right", nodes=node).values[:, 0]
    np.testing.assert_allclose(whole, top, atol=1e-6 * np.abs(top).max())  # the basis is in single precision
    result.close()


def test_basis_is_shared_by_the_records_and_by_a_second_run(config, tmp_path):
    record = yaml.safe_load(SMALL)["records"][0]
    edited(config, records=[record, {**record, "name": "again", "scale": 2}])
    for _ in range(2):
        outcome = romdam.run(romdam.load_config(config), out=tmp_path / "results")
    assert [p.name for p in outcome.paths] == ["pulse.nc", "again.nc"]
    assert len(list((tmp_path / "results").glob("model-*.h5"))) == 1


def test_unknown_key_and_bad_numbers_end_with_two(config):
    refuse(edited(config, outputz={}), "small.yaml", "outputz is not a known key", "'outputs'")


def test_output_folder_that_cannot_be_written_is_refused_before_computing(config, tmp_path):
    (tmp_path / "taken").touch()
    code, _, stderr = call("run", config, "--out", tmp_path / "taken" / "out")
    assert code == 2 and "taken/out: the output folder cannot be made" in stderr
    assert "Traceback" not in stderr


def test_output_interval_that_is_no_multiple_of_the_step(config):
    refuse(
        edited(config, outputs={"output_interval": "0.005 s"}),
        "outputs.output_interval",
        "0.002 s",
        "got 0.005 s",
        "nearest",
    )


def test_scene_mistakes_name_file_and_key(config):
    raw = yaml.safe_load(config.read_text())
    raw["blocks"]["left"]["box"]["element_size"] = "3 m"
    refuse(edited(config, blocks=raw["blocks"]), "blocks.left", "3")


def test_joint_between_blocks_that_do_not_touch(config):
    raw = yaml.safe_load(config.read_text())
    raw["blocks"]["right"]["box"]["origin"] = [0, 1, 0]
    refuse(edited(config, blocks=raw["blocks"]), "joints.gap", "left", "right")


def test_support_that_catches_no_node(config):
    supports = [{"block": "left", "face": {"axis": "z", "at": 7}}, {"block": "right", "face": "zmin"}]
    refuse(edited(config, supports=supports), "supports[0]")


def test_free_block_is_named(config):
    raw = yaml.safe_load(config.read_text())
    far = {"material": "concrete", "box": {"origin": [90, 0, 0], "size": [5, 5, 5], "element_size": 5}}
    refuse(edited(config, blocks={**raw["blocks"], "lonely": far}), "lonely")


def test_more_modes_than_the_block_has(config, tmp_path):
    code, _, err = call("run", edited(config, model={"modes": 5000}), "--out", tmp_path / "out", "--quiet")
    assert code == 0, err


@pytest.mark.parametrize(
    ("content", "part"),
    [("1\nnan\n2\n", "pulse.txt"), ("", "pulse.txt"), ("1\n", "pulse.txt"), (None, "pulse.txt")],
)
def test_unusable_record_is_refused(config, content, part):
    if content is None:
        (config.parent / "pulse.txt").unlink()
    else:
        (config.parent / "pulse.txt").write_text(content)
    refuse(config, part)


def test_wrong_use_ends_with_two(tmp_path):
    assert call("run")[0] == 2
    assert call("run", tmp_path / "none.yaml", "--out", tmp_path / "o")[0] == 2
    assert call("info", tmp_path / "none.nc")[0] == 2
    assert call("verify", tmp_path / "none.yaml", "--out", tmp_path / "o", "--duration", "10 kg")[0] == 2


def test_help_states_exit_codes_and_version_prints():
    shown = CliRunner().invoke(cli.app, ["--help"], env={"COLUMNS": "200"}).output
    assert "Exit codes" in shown and "2 bad input" in shown
    assert CliRunner().invoke(cli.app, ["--version"]).output.startswith(f"romdam {romdam.__version__}")


def commands(of=None, names=()):
    """Names -> every command, with those below it."""
    of = of or typer.main.get_command(cli.app)
    yield names, of
    for name, command in getattr(of, "commands", {}).items():
        yield from commands(command, (*names, name))


def test_help_shows_every_word_of_its_texts():
    """Markup takes what stands in brackets, such as a unit, for a style, and leaves it out."""
    for names, command in commands():
        texts = [command.help or "", *(getattr(one, "help", None) or "" for one in command.params)]
        shown = CliRunner().invoke(cli.app, [*names, "--help"], env={"COLUMNS": "400"}).output
        words = re.findall(r"\S+", re.sub(r"[│\n]", " ", shown))
        for text in texts:
            assert not [word for word in text.split() if word not in words], (names, text)


def test_help_loads_no_numerical_library():
    code = textwrap.dedent("""
        import sys
        sys.argv = ["romdam", "--help"]
        from romdam.cli import main
        try:
            main()
        except SystemExit:
            pass
        print(sorted({"numpy", "scipy", "numba", "xarray", "matplotlib", "obspy", "pint"} & set(sys.modules)))
    """)
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.splitlines()[-1] == "[]"


def test_failure_of_one_record_of_two_leaves_the_other(config, tmp_path, monkeypatch):
    from romdam.core.errors import ConvergenceError
    from romdam.pipelines import run as pipeline

    record = yaml.safe_load(SMALL)["records"][0]
    edited(config, records=[record, {**record, "name": "bad"}])
    real = pipeline.run_motion

    def fail(job, model, motion, *rest):
        if motion.name == "bad":
            raise ConvergenceError("step 3 did not converge")
        return real(job, model, motion, *rest)

    monkeypatch.setattr(pipeline, "run_motion", fail)
    shown = CliRunner().invoke(cli.app, ["run", str(config), "--out", str(tmp_path / "out")])
    assert shown.exit_code == 1
    assert "bad: step 3 did not converge" in shown.output and "1 of 2 records failed" in shown.output
    assert (tmp_path / "out" / "pulse.nc").is_file() and not (tmp_path / "out" / "bad.nc").exists()


def test_unreadable_record_of_two_leaves_the_other(config, tmp_path):
    record = yaml.safe_load(SMALL)["records"][0]
    edited(config, records=[{**record, "name": "lost", "file": "nowhere.txt"}, record])
    code, stdout, stderr = call("run", config, "--out", tmp_path / "out")
    assert code == 1 and "lost: " in stderr and "nowhere.txt" in stderr and "1 of 2 records failed" in stderr
    assert "pulse.nc" in stdout and (tmp_path / "out" / "pulse.nc").is_file()


def test_two_records_of_one_name_are_refused(config):
    record = yaml.safe_load(SMALL)["records"][0]
    refuse(edited(config, records=[record, record]), "2 records are named 'pulse'", "`name`")


def test_records_are_listed_with_their_measures(config):
    code, stdout, _ = call("records", config)
    assert code == 0 and "pulse" in stdout and "1 record\n" in stdout
    (config.parent / "pulse.txt").unlink()
    code, stdout, stderr = call("records", config)
    assert code == 1 and "0 records, 1 failed" in stdout and "pulse.txt" in stderr


def test_a_list_of_nothing_is_bad_input(config):
    code, stdout, stderr = call("records", "nowhere")
    assert (code, stdout) == (2, "") and stderr.startswith("romdam: nowhere: no such file")
    code, stdout, stderr = call("records", config, "nowhere")
    assert code == 1 and "pulse" in stdout and "error: nowhere: no such file" in stderr
    assert "error" not in stdout
    (config.parent / "bad.AT2").write_text("<html>")
    code, stdout, stderr = call("records", config.parent / "bad.AT2")
    assert code == 1 and "bad.AT2: line 1: the file is an HTML" in stderr


def test_what_is_odd_about_a_record_is_told(config, tmp_path, caplog):
    np.savetxt(tmp_path / "pulse.txt", np.sin(np.linspace(0.0, 3.0, 60)))
    assert call("run", config, "--out", tmp_path / "out")[0] == 0
    assert any(line.startswith("pulse: the velocity ends at") for line in caplog.messages)


def test_lone_record_that_does_not_converge_ends_with_one(config, tmp_path, monkeypatch):
    from romdam.core.errors import ConvergenceError
    from romdam.pipelines import run as pipeline

    def fail(*args):
        raise ConvergenceError("step 3 did not converge")

    monkeypatch.setattr(pipeline, "run_motion", fail)
    assert call("run", config, "--out", tmp_path / "o") == (1, "", "romdam: step 3 did not converge\n")


@pytest.mark.slow
def test_show_and_fields_draw_pictures_where_the_machine_can(config, tmp_path):
    pytest.importorskip("pyvista")
    code, out, err = call("show", config, "--out", tmp_path / "seen")
    if code == 2:
        assert "apt-get install" in err
        return
    assert code == 0 and f"written: {tmp_path / 'seen' / 'small-scene.png'}" in out
    assert call("run", config, "--out", tmp_path, "--quiet")[0] == 0
    code, out, _ = call(
        "plot", tmp_path / "pulse.nc", "--fields", "--vtu", "--frames", 2, "--window", 0.1, 0.3
    )
    assert code == 0 and "joint opening" in out
    for name in ("pulse-field_displacement.png", "pulse.pvd", "pulse-0001.vtu", "pulse-maxima.csv"):
        assert (tmp_path / name).is_file()


def test_window_without_times_is_bad_input(config, tmp_path):
    assert call("run", config, "--out", tmp_path, "--quiet")[0] == 0
    code, _, err = call("plot", tmp_path / "pulse.nc", "--vtu", "--window", 5, 6)
    assert code == 2 and "no written time lies between 5 and 6 s" in err


def test_options_of_suites_are_refused_elsewhere(config):
    refuse_use = ("run", config, "--out", config.parent / "out")
    for option, value in (("--workers", 2), ("--scheduler", "tcp://here:1")):
        code, _, stderr = call(*refuse_use, option, value)
        assert code == 2 and option in stderr and "is for suites" in stderr
    edited(config, pipeline="suite")
    code, _, stderr = call(*refuse_use, "--workers", 2, "--scheduler", "tcp://here:1")
    assert code == 2 and "instead of --workers" in stderr
    assert not (config.parent / "out").exists()


@pytest.mark.parametrize(
    ("args", "part"),
    [
        (("--frames", 5), "give --vtu or --animation"),
        (("--window", 1, 2), "give --vtu or --animation"),
        (("--vtu", "--window", 2, 1), "a first to a later second"),
        (("--vtu", "--window", "nan", 1), "a first to a later second"),
        (("--out", ""), "names no folder"),
    ],
)
def test_plot_refuses_options_that_would_do_nothing(tmp_path, args, part):
    code, _, stderr = call("plot", tmp_path / "none.nc", *args)
    assert code == 2 and part in stderr


def test_an_empty_folder_name_is_not_this_folder(config, monkeypatch):
    monkeypatch.chdir(config.parent)
    before = sorted(config.parent.iterdir())
    code, _, stderr = call("run", config, "--out", "")
    assert code == 2 and "names no folder" in stderr and sorted(config.parent.iterdir()) == before


def test_a_folder_or_a_device_is_no_configuration(tmp_path):
    for path in (tmp_path, "/dev/null"):
        code, _, stderr = call("check", path)
        assert code == 2 and "give a file" in stderr and "Traceback" not in stderr
    code, _, stderr = call("verify", tmp_path, "--out", tmp_path / "o", "--duration", "-3 s")
    assert code == 2 and "longer than 0 s" in stderr


def test_what_is_unusual_is_said_by_check_and_by_run_and_kept(config, tmp_path):
    raw = yaml.safe_load(SMALL)
    raw["materials"]["concrete"]["rho"] = "24.4 kg/m3"
    edited(config, materials=raw["materials"], transient={"finest_step": "2 ms", "duration": "0.3 s"})
    said = "materials.concrete.rho: 24.4 kg/m3 is unusual"
    lines = config.read_text().split("\n")
    line = next(k for k, text in enumerate(lines) if "rho:" in text) + 1
    assert f"warning: {config}:{line}: {said}" in call("check", config)[1]
    code, _, stderr = call_alone("run", config, "--out", tmp_path / "o")
    assert (
        code == 0
        and f"{config}:{line}: {said}" in stderr.replace("\n", "")
        and "cuts the record at 0.3 s, it has 0.59 s" in stderr
    )
    attrs = xr.open_dataset(tmp_path / "o" / "pulse.nc").attrs
    assert said in attrs["configuration_doubts"] and "cuts the record at 0.3 s" in attrs["run_warnings"]


@pytest.mark.slow
def test_damping_of_what_slides_is_said_by_check_and_by_run_and_kept(config, tmp_path, caplog):
    raw = yaml.safe_load(SMALL)
    raw["blocks"]["slab"] = {
        "material": "concrete",
        "box": {"origin": [0, 0, 20], "size": [5, 10, 5], "element_size": "5 m"},
    }
    raw["joints"]["bed"] = {"between": ["right", "slab"], "normal_stiffness": "16 GPa/m"}
    said = "damping: acts on what strains slab, and not on their rigid motions"
    changes = {"blocks": raw["blocks"], "loads": {"gravity": [0, 0, -9.81]}}
    edited(config, joints=raw["joints"], **changes)
    assert said not in call("check", config)[1], "without friction it slides whatever is damped"
    raw["joints"]["bed"] |= {"shear_stiffness": "8 GPa/m", "friction": 0.1}
    for damping in ({"modal": "5 %"}, {"rayleigh": {"alpha": 2.86, "beta": "1e-3 s"}}):
        edited(config, joints=raw["joints"], damping=damping, **changes)
        line = config.read_text().split("\n").index("damping:") + 1
        assert f"warning: {config}:{line}: {said}" in call("check", config)[1]
    caplog.clear()
    assert call("run", config, "--out", tmp_path / "o")[0] == 0 and said in caplog.text
    assert said in xr.open_dataset(tmp_path / "o" / "pulse.nc").attrs["configuration_doubts"]


def test_records_whose_files_would_be_one_are_refused(config):
    record = yaml.safe_load(SMALL)["records"][0]
    refuse(edited(config, records=[record, {**record, "name": "PULSE"}]), "'PULSE' and 'pulse'")


def test_a_record_named_by_its_file_needs_a_name_that_files_can_have(config):
    record = yaml.safe_load(SMALL)["records"][0]
    for stem in ("x" * 150, "summary", "-x"):
        (config.parent / f"{stem}.txt").write_text((config.parent / "pulse.txt").read_text())
        unnamed = {**record, "file": f"{stem}.txt"}
        del unnamed["name"]
        refuse(edited(config, records=[unnamed]), f"{stem}.txt", "the record's name", "`name`")


def test_a_step_of_nanoseconds_is_refused_before_the_scene_is_built(config):
    refuse(
        edited(config, transient={"finest_step": "2 ns"}),
        "transient.finest_step: pulse",
        "2.9e+08 steps, limit 1e+08",
    )
