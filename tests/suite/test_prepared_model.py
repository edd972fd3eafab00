"""A job that is reduced once and run with values of a program's own: the rows of a suite, to the bit."""

import pickle
import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import xarray as xr
from suite_jobs import BASE, made, write_job
from test_uncertain import HEAVY, RUBS
from test_values_written_in import JOBS, candidates, outcome

import romdam
from romdam.config.parameters import _structure_places, find_varied_key, varied_paths, vary
from romdam.contact.laws import LAWS
from romdam.pipelines.suites import prepared_model
from romdam.postprocess.responses import response_of
from romdam.results.suite.rows import FAILED

OF_MAKING = ("wall_seconds", "cpu_seconds")  # no two runs have them alike
ONE = romdam.SuiteOptions(workers=1)
FRICTION = "joints.gap.friction"
SHORT = {"finest_step": "5 ms", "duration": "0.2 s"}
LEVELS = {"parameters": {"level": {"path": "loads.hydrostatic.0.level", "low": 14, "high": 18, "count": 3}}}


def assert_rows_of(summary, dataset, **at):
    """All that a run answers is that of a suite's summary, bit by bit, with its units."""
    rows = [name for name in summary.data_vars if summary[name].dims[:3] == ("record", "scale", "sample")]
    rows = [name for name in rows if name not in (*OF_MAKING, "file")]
    assert {*dataset.data_vars} - {*OF_MAKING} == {*rows} and "peak_opening" in rows
    for name in rows:
        wanted, found = summary[name].isel(**at), dataset[name]
        assert (wanted.dims, wanted.dtype, str(wanted.attrs)) == (found.dims, found.dtype, str(found.attrs))
        assert np.array_equal(wanted.values, found.values, equal_nan=found.dtype.kind == "f"), name
        for coordinate in wanted.coords:
            if not str(coordinate).startswith(("parameter_", "sample")):
                assert wanted[coordinate].equals(found[coordinate]), (name, coordinate)


def without_place(message):
    """A message without the file, and without the name of the parameter or sample."""
    return re.sub(r"^.*?suite\.yaml:(\d+:)? |^the configuration: |parameters\.[\w.*]+|\(suite.*", "", message)


QUICK = ("Penalty", "Coulomb", "Grouting")
EVERY = ["loads", "water", "coefficients", "modal", *(law.__name__ for law in LAWS)]


@pytest.mark.parametrize(
    ("name", "each"),
    [
        pytest.param("loads", False, id="loads, a path of a section"),
        *(
            pytest.param(name, True, id=name, marks=[pytest.mark.slow] * (name not in QUICK))
            for name in EVERY
        ),
    ],
)
def test_every_path_gives_the_row_of_a_suite_with_that_sample(tmp_path, name, each):
    """Of every path, or of the first one of each section that counts."""
    sections = {key: value for key, value in JOBS[name].items() if key in BASE or key in ("loads", "water")}
    sections |= {
        "transient": SHORT,
        "outputs": {**BASE["outputs"], "error_estimate": True, "mesh_error": False},
    }
    sections.pop("pipeline", None)
    job = romdam.load_config(
        write_job(tmp_path, 1, **{key: sections[key] for key in sections if key != "records"})
    )
    model, compared, numbers = romdam.prepare(job), 0, _structure_places(job.config)
    tried = set[str]()
    of_law = {p.name for law in LAWS if law.__name__ == name for p in law.parameters}
    for path in varied_paths(job.config):
        if of_law and not of_law & {*path.split(".")}:
            continue  # of the laws that other jobs have
        section = path.rpartition(".")[0]
        if not each and section in tried:
            continue
        key = outcome(lambda path=path: find_varied_key(job.config, path, "x", str(job.path)))
        if key is None:
            continue
        value = 1.03 * numbers[key.locations[0]] if key.structure else candidates(key, job.config)[0]
        if outcome(lambda key=key, v=value: vary(job.config, {"x": key}, {"x": v}, "")) is None:
            continue
        suite = {"parameters": {"x": {"path": path, "values": [value]}}}
        with_suite = romdam.load_config(job.to_dict() | {"pipeline": "suite", "suite": suite}, tmp_path)
        try:
            summary = romdam.run_suite(with_suite, tmp_path / str(compared), ONE).summary
        except romdam.ConfigError as error:
            with pytest.raises(romdam.ConfigError) as refused:
                model.run({path: value})
            assert without_place(str(refused.value)) == without_place(str(error))
            continue
        if summary.status.item() == FAILED:
            with pytest.raises(romdam.RomdamError, match=re.escape(str(summary.message.item()))):
                model.run({path: value})
            continue
        assert_rows_of(summary, model.run({path: value}))
        tried.add(section)
        compared += 1
    assert compared >= 1
    assert compared >= 2 or of_law


def test_a_model_keeps_what_it_has_reduced(tmp_path, monkeypatch):
    """Neither values of joints, damping and materials nor levels within a suite's range reduce anything."""
    config = write_job(tmp_path, 1, suite=LEVELS, transient=SHORT, **RUBS, **HEAVY)
    reduced, before = list[object](), prepared_model.reduced_model
    monkeypatch.setattr(
        prepared_model, "reduced_model", lambda *a, **k: (reduced.append(a), before(*a, **k))[1]
    )
    model = romdam.prepare(config)
    for values in (
        {"joints.gap.friction": 0.7},
        {"damping.rayleigh.ratio": 0.03},
        {"materials.concrete.E": "25 GPa", "joints.gap.normal_stiffness": "rigid"},
        {"level": "15 m"},
        {"loads.hydrostatic.0.level": 17.0, "joints.*.friction": np.float32(0.5)},
    ):
        model.run(values)
    assert len(reduced) == 1
    model.run({"level": 19.0})  # beyond the suite's range: as the suite whose only sample this is
    model.run({"level": 19.0})
    assert len(reduced) == 2
    for level in (18.1, 18.2, 18.3, 18.4, 19.0):
        model.run({"level": level})
    assert len(model._others) == 3


def test_friction_where_the_job_has_none_takes_a_basis_of_its_own(tmp_path):
    """As the suite does: openings differ from those of a basis without the tangential directions."""
    plain = romdam.load_config(write_job(tmp_path, 1, transient=SHORT))
    suite = {"parameters": {"mu": {"path": "joints.gap.friction", "values": [0.4]}}}
    summary = made(write_job(tmp_path, 1, suite, transient=SHORT), tmp_path / "out").summary
    model = romdam.prepare(plain)
    assert "peak_slip" not in model.run()
    found = model.run({"joints.gap.friction": 0.4})
    assert_rows_of(summary, found)
    assert float(found.peak_slip.max()) > 0.0


def test_samples_of_a_suite_in_one_call_are_its_summary(tmp_path):
    suite = {
        "scales": [0.5, 2.0],
        "design": {"latin_hypercube": 6, "seed": 3},
        "parameters": {
            "mu": {"path": "joints.gap.friction", "low": 0.2, "high": 0.8},
            "E": {"path": "materials.concrete.E", "low": "20 GPa", "high": "40 GPa"},
        },
    }
    config = write_job(tmp_path, 2, suite, transient=SHORT)
    summary = made(config, tmp_path / "out").summary
    model, values = romdam.prepare(config), {n: summary[f"parameter_{n}"].values for n in ("mu", "E")}
    together = model.run(values)
    assert_rows_of(summary, together)
    for name in values:
        one, other = (each[f"parameter_{name}"] for each in (together, summary))
        assert np.array_equal(one.values, other.values) and one.attrs == other.attrs
    alone = [model.run({name: column[k] for name, column in values.items()}) for k in range(6)]
    for k, one in enumerate(alone):
        assert_rows_of(summary, one, sample=[k])
    joined = response_of(xr.concat(alone, "sample"), "peak_opening")
    assert np.array_equal(joined.values, response_of(summary, "peak_opening").values)


@pytest.mark.parametrize("processes", [pytest.param(False, marks=pytest.mark.slow), True])
def test_threads_and_pickles_give_the_same_bits(tmp_path, processes):
    model = romdam.prepare(write_job(tmp_path, 1, transient=SHORT, **RUBS))
    if processes:
        model = pickle.loads(pickle.dumps(model))
    values = [{"joints.gap.friction": 0.1 * k, "joints.gap.gap": 1e-4 * (k % 3)} for k in range(1, 13)]
    wanted = [model.run(each) for each in values]
    fresh = romdam.prepare(model.job)
    with ThreadPoolExecutor(6) as threads:
        for one, other in zip(wanted, threads.map(fresh.run, values), strict=True):
            assert_rows_of(one, other)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"joints.gop.friction": 0.7}, "no joint is 'gop'; defined are gap; did you mean 'joints.gap'?"),
        ({"joints.gap.frictoin": 0.7}, "cannot be varied; in joints can .* did you mean 'friction'?"),
        ({"blocks.left.box": 0.7}, "'blocks.left.box' is not of the joints or the damping"),
        ({"joints.gap.friction": "0.7 kg"}, "joints.gap.friction: .*, got '0.7 kg'"),
        ({"joints.gap.friction": -0.1}, "joints.gap.friction: .*greater than or equal to 0, got -0.1"),
        ({"joints.gap.friction": None}, "joints.gap.friction: .*, got None"),
        ({"joints.gap.friction": []}, "at least one; got 0 of joints.gap.friction"),
        ({"joints.gap.friction": [0.1, 0.2], "joints.gap.gap": [0.0]}, "got 2 of joints.gap.friction, 1 of"),
        ({"joints.gap.friction": 0.1, "joints.*.friction": 0.2}, "varies what parameter .* does; remove one"),
    ],
)
def test_what_a_suite_refuses_is_refused_with_its_words(tmp_path, values, says):
    model = romdam.prepare(write_job(tmp_path, 1, transient=SHORT, **RUBS))
    with pytest.raises(romdam.ConfigError, match=says) as refused:
        model.run(values)
    assert "suite.yaml" in str(refused.value) and "\n" not in str(refused.value)


def test_a_job_at_full_order_is_refused(tmp_path):
    config = write_job(tmp_path, 1, model={"order": "full"})
    with pytest.raises(romdam.ConfigError, match="needs a reduced model, got full"):
        romdam.prepare(config)


def test_moduli_by_duration_with_stress_are_those_of_a_run(tmp_path):
    """The stress at rest is of the sustained modulus, whoever makes the model: a suite's row to the bit."""
    concrete = BASE["materials"]["concrete"] | {"E_dynamic": "37 GPa"}
    sections = {
        "materials": {"concrete": concrete},
        "loads": {"gravity": [0, 0, -9.81]},
        "outputs": {**BASE["outputs"], "stress": {"blocks": ["left"]}},
        "transient": SHORT,
    }
    path = write_job(tmp_path, 1, {"parameters": {"mu": {"path": FRICTION, "values": [0.4]}}}, **sections)
    made(path, tmp_path / "out")
    summary = xr.load_dataset(tmp_path / "out" / "summary.nc")
    dataset = romdam.prepare(romdam.load_config(path)).run({FRICTION: 0.4})
    assert np.array_equal(dataset.peak_stress.values, summary.peak_stress.values)
    assert float(dataset.peak_stress.max()) > 0.0
