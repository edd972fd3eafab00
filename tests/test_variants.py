"""`pipeline: comparison` as a person meets it: variants of one job side by side."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from cf_files import flaws
from test_cli import SMALL, call

import romdam
from romdam.config.variants import variant_jobs
from romdam.core.errors import ConfigError

CONFIGS = Path(__file__).parents[1] / "configs"
NODES = {
    "left_top": {"block": "left", "at": [0, 0, 20]},
    "right_top": {"block": "right", "at": [0, 0, 20]},
}
VARIANTS = {
    "full": {"model": {"order": "full"}, "transient.finest_step": 0.0005},
    "all modes": {"model": {"modes": "all"}, "transient.finest_step": 0.0005},
    "gaps": {},
    "contact": {"joints.gap.discretization": "mortar"},
    "other mesh": {"joints.gap.discretization": "mortar", "blocks.right.box.element_size": 2.5},
    "weaker": {"records.0.scale": 0.25},
}


def write(folder, **comparison):
    """A small job with a comparison; keys of `comparison:` in place of the usual ones."""
    time = np.arange(60) * 0.01
    np.savetxt(folder / "pulse.txt", 6.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time))
    raw = yaml.safe_load(SMALL) | {"pipeline": "comparison"}
    raw["outputs"] |= {"nodes": NODES, "plots": False, "error_estimate": False, "mesh_error": False}
    raw["comparison"] = {"variants": VARIANTS, "relative": {"tops": [*NODES]}} | comparison
    path = folder / "compared.yaml"
    path.write_text(yaml.safe_dump(raw, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """The folder that a comparison was written to, and what it printed."""
    folder = tmp_path_factory.mktemp("comparison")
    code, out, err = call("run", write(folder), "--out", folder / "out")
    assert code == 0, err
    return folder / "out", out


@pytest.fixture
def dataset(compared):
    with xr.open_dataset(compared[0] / "comparison.nc", engine="h5netcdf") as opened:
        yield opened


def test_its_file_keeps_to_cf(compared):
    assert list(flaws(compared[0] / "comparison.nc")) == []


def test_every_variant_has_its_run_and_all_are_on_one_page(compared):
    folder, told = compared
    page = (folder / "comparison.html").read_text()
    for name in VARIANTS:
        assert (folder / name / "pulse.nc").is_file()
        assert name in page and name in told
    assert page.count("data:image/png") >= 3 and "Size and cost" in told
    table = (folder / "comparison-cost.csv").read_text().splitlines()
    assert len(table) == 1 + len(VARIANTS) and table[1].startswith("full,full,")


def test_numbers_are_those_of_the_runs(compared, dataset):
    with romdam.open_result(compared[0] / "contact" / "pulse.nc") as result:
        run = result.dataset
        own = dataset.sel(variant="contact")
        disp = run.displacement.sel(component="y")
        across = (disp.sel(node="right_top") - disp.sel(node="left_top")).values
        assert np.array_equal(own.relative_displacement.sel(pair="tops", component="y").values, across)
        assert float(own.peak_relative_component[0]) == across[np.abs(across).argmax()]
        assert float(own.peak_opening[0]) == float(run.peak_opening[0])
        assert int(own.gaps) == run.sizes["gap"] and int(own.unknowns) == run.sizes["mode"]
        assert float(own.cpu_seconds_loop) == run.attrs["solver_loop_cpu_seconds"]
        vector = dataset.peak_displacement.sel(variant="contact", node="left_top").values
        length = np.linalg.norm(run.displacement.sel(node="left_top").values, axis=1)
        assert np.linalg.norm(vector) == pytest.approx(length.max(), rel=1e-14)


def test_mortar_of_matching_linear_faces_is_node_to_node(dataset):
    close = dataset.sel(variant="contact", against="gaps")
    assert float(close.l2_difference.max()) < 1e-9
    assert float(dataset.l2_difference.sel(variant="other mesh", against="gaps").min()) > 1e-4


def test_a_quarter_of_the_record_is_a_quarter_of_the_answer(dataset):
    """Without loads and initial gaps the unilateral joint is positively homogeneous."""
    whole, weaker = (dataset.displacement.sel(variant=name).values for name in ("gaps", "weaker"))
    np.testing.assert_allclose(4.0 * weaker, whole, atol=1e-7 * np.abs(whole).max())


def test_differences_are_of_both_over_the_one_they_are_against(dataset):
    rows = dataset.displacement.sel(node="left_top", component="y")
    own = dataset.sel(quantity="displacement left_top")
    for one, other in (("full", "gaps"), ("gaps", "other mesh")):
        a, b = (rows.sel(variant=name).values for name in (one, other))
        expected = np.linalg.norm(a - b) / np.linalg.norm(b)
        assert float(own.l2_difference.sel(variant=one, against=other)) == pytest.approx(expected, rel=1e-12)
        largest = [np.abs(x).max() for x in (a, b)]
        peak = float(own.peak_difference.sel(variant=one, against=other))
        assert peak == pytest.approx(abs(largest[0] - largest[1]) / largest[1], rel=1e-9)
    assert not own.l2_difference.values.diagonal().any()


def test_all_modes_are_the_full_order(dataset):
    """Another basis of the same space, with another integrator: what is left is the steps'."""
    apart = dataset.l2_difference.sel(variant="all modes", against="full", quantity="displacement left_top")
    assert float(apart) < 0.03


@pytest.mark.slow
def test_a_variant_that_fails_leaves_the_others(tmp_path, monkeypatch):
    from romdam.core.errors import ConvergenceError
    from romdam.pipelines.error import comparison

    real = comparison.run

    def fails(job, out, *rest):
        if out.name == "contact":
            raise ConvergenceError("step 3 of pulse does not converge")
        return real(job, out, *rest)

    monkeypatch.setattr(comparison, "run", fails)
    path = write(tmp_path, variants={"gaps": {}, "contact": VARIANTS["contact"]})
    code, _, err = call("run", path, "--out", tmp_path / "out")
    assert code == 1 and "contact: step 3 of pulse does not converge" in err
    with xr.open_dataset(tmp_path / "out" / "comparison.nc", engine="h5netcdf") as dataset:
        assert dataset.variant.values.tolist() == ["gaps"]
    code, _, err = call(
        "run", write(tmp_path, variants=VARIANTS, reference="contact"), "--out", tmp_path / "again"
    )
    assert code == 1 and not list((tmp_path / "again").rglob("*.nc"))


@pytest.mark.parametrize(
    ("comparison", "told"),
    [
        ({"variants": {"a": {}}}, "comparison.variants"),
        ({"reference": "b"}, "no variant 'b' is defined; defined are"),
        ({"relative": {"tops": ["left_top", "top"]}}, "no 'top' is defined; defined are left_top, right_top"),
        ({"variants": {"a": {}, "A": {}}}, "are one folder"),
        ({"variants": {"a": {}, "b/c": {}}}, "holds '/'"),
        ({"variants": {"a": {}, "b": {"joints.gap.discretisation": "mortar"}}}, "discretisation"),
        ({"variants": {"a": {}, "b": {"joints.gap.discretization": "surface"}}}, "variants.b: joints.gap"),
        ({"variants": {"a": {}, "b": {"supports.2.block": "left"}}}, "a list of 2, counted from 0"),
        ({"variants": {"a": {}, "b": {"model.order.x": 1}}}, "leads nowhere, it would stand in no section"),
        ({"variants": {"a": {}, "b": {"outputs": {}, "joints": {}}}}, "nothing is compared"),
        ({"variants": {"a": {}, "b": {"outputs.nodes": {}}}}, "outputs.nodes lacks left_top, right_top of"),
    ],
)
def test_what_cannot_be_compared_is_refused_before_anything_runs(tmp_path, comparison, told):
    code, _, err = call("run", write(tmp_path, **comparison), "--out", tmp_path / "out")
    assert code == 2 and told in " ".join(err.split()), err
    assert not [path for path in (tmp_path / "out").glob("*") if path.suffix != ".log"]


def test_several_records_are_refused(tmp_path):
    path = write(tmp_path)
    raw = yaml.safe_load(path.read_text())
    raw["records"].append(raw["records"][0] | {"name": "second"})
    path.write_text(yaml.safe_dump(raw))
    code, _, err = call("run", path, "--out", tmp_path / "out")
    assert code == 2 and "is of one record, records are 2" in " ".join(err.split())


def test_a_job_without_a_comparison_is_told_so(tmp_path):
    path = write(tmp_path)
    raw = yaml.safe_load(path.read_text())
    del raw["comparison"]
    path.write_text(yaml.safe_dump(raw))
    with pytest.raises(ConfigError, match="comparison is missing"):
        variant_jobs(romdam.load_config(path))
    assert call("run", path, "--out", tmp_path / "out")[0] == 2


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        pytest.param("gap_against_contact", 1.0, marks=pytest.mark.slow),
        pytest.param("gap_against_contact_dam", 1.0, marks=pytest.mark.slow),
    ],
)
def test_the_configurations_run(tmp_path, monkeypatch, name, seconds):
    monkeypatch.setattr("romdam.visual.field_views.draw_side_by_side", lambda *_: {})
    raw = yaml.safe_load((CONFIGS / f"{name}.yaml").read_text())
    raw["transient"] |= {"duration": seconds, "finest_step": 0.005}
    for changes in raw["comparison"]["variants"].values():
        changes.pop("transient.finest_step", None)
    for one in raw["records"][0].get("components", {}).values():
        if isinstance(one, dict):
            one["file"] = str(CONFIGS / one["file"])
    if "file" in raw["records"][0]:
        raw["records"][0]["file"] = str(CONFIGS / raw["records"][0]["file"])
    path = tmp_path / "short.yaml"
    path.write_text(yaml.safe_dump(raw, sort_keys=False))
    code, _, err = call("run", path, "--out", tmp_path / "out")
    assert code == 0, err
    with xr.open_dataset(tmp_path / "out" / "comparison.nc", engine="h5netcdf") as dataset:
        assert dataset.variant.values.tolist() == [*raw["comparison"]["variants"]]
        assert np.isfinite(dataset.l2_difference.values).all()


def test_accelerations_are_means_of_the_written_intervals(compared, dataset):
    """Mean accelerations keep the impulse of an impact: summed over time they are the velocity."""
    with romdam.open_result(compared[0] / "gaps" / "pulse.nc") as result:
        vel = result.dataset.velocity.sel(component="y")
        across = (vel.sel(node="right_top") - vel.sel(node="left_top")).values
    rows = dataset.sel(variant="gaps", component="y")
    time = dataset.time.values
    gained = np.cumsum(rows.relative_acceleration.sel(pair="tops").values[1:] * np.diff(time))
    np.testing.assert_allclose(gained, across[1:] - across[0], atol=1e-12 * np.abs(across).max())
    largest = np.abs(rows.relative_acceleration.sel(pair="tops").values).max()
    peak = dataset.peak_relative_acceleration_component.sel(variant="gaps", pair="tops")
    assert abs(float(peak)) == largest > 1.0
    assert "acceleration left_top" in dataset["quantity"].values
    page = (compared[0] / "comparison.html").read_text()
    assert "y across\ntops" in page and "m/s²" in page and "Relative acceleration, mean over" in page
