"""The commands without what POSIX alone has, as Windows is without it; Windows itself is not tried here."""

import subprocess
import sys

import pytest
import xarray as xr

WITHOUT = """
import multiprocessing.connection, os, signal, subprocess, sys
import pint  # libraries are those of this system, and may have what is its own
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
for name in ("fork", "register_at_fork", "getuid", "geteuid", "sysconf", "sched_getaffinity", "pread"):
    delattr(os, name)
del os.O_NOFOLLOW
for name in ("SIGHUP", "pthread_sigmask"):
    delattr(signal, name)
from romdam.cli import main
sys.argv[0] = "romdam"
main()
"""
SMALL = """
materials: {concrete: {E: 25 GPa, nu: 0.2, rho: 2400}}
blocks:
  left: {material: concrete, box: {origin: [0, 0, 0], size: [4, 4, 8], element_size: 4}}
  right: {material: concrete, box: {origin: [4, 0, 0], size: [4, 4, 8], element_size: 4}}
supports: [{block: left, face: zmin}, {block: right, face: zmin}]
joints: {middle: {between: [left, right], normal_stiffness: 20 GPa/m}}
damping: {rayleigh: {frequencies: [5, 30], ratio: 0.05}}
records: [{name: shake, file: northridge_mul009_g_dt0.01.txt, unit: 9.81 m/s2, dt: 0.01, components: {x: 1}}]
model: {modes: 5}
transient: {finest_step: 0.01, duration: 3}
outputs: {plots: false, error_estimate: false, mesh_error: false}
"""
SUITE = "pipeline: suite\nsuite: {scales: [0.5, 1]}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("elsewhere")
    command(folder, "init", "two_cantilevers")
    (folder / "small.yaml").write_text(SMALL)
    (folder / "suite.yaml").write_text(SUITE + SMALL)
    return folder


def command(folder, *words):
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, *words], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_record_is_checked_and_run(folder):
    assert "middle" in command(folder, "check", "small.yaml")
    assert "middle" in command(folder, "run", "small.yaml")
    assert (folder / "results" / "shake.nc").exists()


@pytest.mark.slow
def test_a_suite_runs_in_one_process(folder):
    command(folder, "run", "suite.yaml", "--out", "suite", "--workers", "2")
    with xr.open_dataset(folder / "suite" / "summary.nc") as summary:
        assert summary.sizes["scale"] == 2 and bool((summary.peak_opening > 0.0).all())
