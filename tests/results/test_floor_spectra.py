"""Floor spectra: against an independent oscillator, closed forms of impulses and harmonics."""

import copy
import json

import numpy as np
import pytest
from linear_filter import filtered
from scipy.integrate import cumulative_simpson

import romdam
from romdam.config.sections.floor_spectra import GUIDE_FREQUENCIES
from romdam.core.motion import GroundMotion
from romdam.core.system import StepMotion
from romdam.postprocess.floor_spectra import broadened, floor_spectra
from romdam.postprocess.floor_spectra_of_runs import spectra_over_runs

DT = 1e-3  # [s] of motions that are smooth at their steps
DAMPINGS = [0.02, 0.05, 0.1]
BEAM = {
    "materials": {"concrete": {"E": "30 GPa", "nu": 0.18, "rho": "2440 kg/m3"}},
    "blocks": {
        "left": {
            "material": "concrete",
            "box": {"origin": [0, -5, 0], "size": [5, 5, 30], "element_size": [5, 5, 5]},
        },
        "right": {
            "material": "concrete",
            "box": {"origin": [0, 0, 0], "size": [5, 10, 30], "element_size": [5, 5, 5]},
        },
    },
    "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
    "joints": {"middle": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}},
    "damping": {"rayleigh": {"frequencies": ["3 Hz", "40 Hz"], "ratio": "5 %"}},
    "model": {"modes": 20},
    "transient": {"finest_step": "0.5 ms"},
    "outputs": {
        "plots": False,
        "mesh_error": False,
        "error_estimate": False,
        "nodes": {
            "left_top": {"block": "left", "at": [0, -5, 30]},
            "right_top": {"block": "right", "at": [0, 0, 30]},
        },
        "floor_spectra": {"dampings": DAMPINGS},
    },
}


def with_keys(base=BEAM, **keys):
    """A copy with keys changed; dots in names are written as two underscores, None takes a key out."""
    job = copy.deepcopy(base)
    for path, value in keys.items():
        *sections, last = path.split("__")
        at = job
        for name in sections:
            at = at.setdefault(name, {})
        if value is None:
            at.pop(last, None)
        else:
            at[last] = value
    return job


def pulse(axis=1, dt=DT, seconds=3.0, size=3.0, name="pulse"):
    """Smooth shaking that ends at rest, along one axis, with a little along another."""
    time = dt * np.arange(round(seconds / dt) + 1)
    shape = np.where(time < 1.0, np.sin(np.pi * time) ** 2, 0.0) * np.sin(2.0 * np.pi * 4.0 * time)
    acc = np.zeros((3, len(time)))
    acc[axis], acc[2] = size * shape, 0.3 * size * shape
    return GroundMotion(name, acc, dt)


def result(job, motion=None):
    return romdam.run(job, motions=motion or pulse()).results[0].dataset


@pytest.fixture(scope="module")
def beam():
    """Of the job without a change."""
    return result(BEAM)


def oscillator(acc, dt, frequency, damping):
    """Largest absolute acceleration by exact steps on a grid of 100 points a period, free vibration
    of a period after the end included."""
    omega = 2.0 * np.pi * frequency
    time = np.arange(0.0, dt * (len(acc) - 1) + 1.0 / frequency, min(dt / 4.0, 0.01 / frequency))
    base = np.interp(time, dt * np.arange(len(acc) + 1), np.append(acc, 0.0), right=0.0)
    pole = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
    # absolute acceleration over that of the floor: (2 xi omega s + omega^2) / (s^2 + 2 xi omega s + omega^2)
    zero, gain = -omega / (2.0 * damping), 2.0 * damping * omega
    absolute = filtered([zero], [pole, pole.conjugate()], gain, base, time[1])
    return np.abs(absolute).max()


def test_spectra_are_those_of_an_independent_oscillator_on_the_written_acceleration():
    """0.1 %: without a joint, where the acceleration at every step tells all of the motion."""
    dataset = result(with_keys(joints={}))
    absolute = (dataset.acceleration + dataset.ground_acceleration).transpose("time", "node", "component")
    still = float(dataset.floor_spectrum.max())
    for node in range(2):
        for axis in range(3):
            history = absolute.values[:, node, axis]
            for k in range(0, 75, 9):
                for d, damping in enumerate(DAMPINGS):
                    expected = oscillator(history, DT, GUIDE_FREQUENCIES[k], damping)
                    found = float(dataset.floor_spectrum[node, axis, d, k])
                    assert found == pytest.approx(expected, rel=1e-3, abs=1e-5 * still)
    peaks = np.abs(absolute).max("time").values
    np.testing.assert_allclose(dataset.floor_peak_acceleration, peaks, rtol=1e-3, atol=1e-5 * still)
    assert dataset.floor_place.values.tolist() == ["left_top", "right_top"]


@pytest.mark.parametrize("change", ["rotated", "us units"])
def test_a_turned_model_and_one_in_other_units_have_the_same_spectra(change, beam):
    """Shaken along x with blocks side by side along x; or every number in feet, psi and slugs."""
    if change == "rotated":
        boxes = {
            "left": {"origin": [-5, 0, 0], "size": [5, 5, 30], "element_size": 5.0},
            "right": {"origin": [0, 0, 0], "size": [10, 5, 30], "element_size": 5.0},
        }
        nodes = {
            "left_top": {"block": "left", "at": [-5, 0, 30]},
            "right_top": {"block": "right", "at": [0, 0, 30]},
        }
        motion, axes = pulse(axis=0), [0, 2]
        # x to y, y to -x: the nodes above at x = 0 are at y = 5 here, or their mirror images
        nodes = {name: node | {"at": [node["at"][0], 5, 30]} for name, node in nodes.items()}
    else:
        feet = 1.0 / 0.3048
        boxes = {
            name: {
                key: [f"{value * feet!r} ft" for value in BEAM["blocks"][name]["box"][key]]
                for key in ("origin", "size", "element_size")
            }
            for name in ("left", "right")
        }
        nodes = {
            name: node | {"at": [f"{value * feet!r} ft" for value in node["at"]]}
            for name, node in BEAM["outputs"]["nodes"].items()
        }
        motion, axes = pulse(), [1, 2]
    job = with_keys(
        blocks={name: {"material": "concrete", "box": box} for name, box in boxes.items()},
        outputs__nodes=nodes,
    )
    other = result(job, motion).floor_spectrum.values[:, axes]
    expected = beam.floor_spectrum.values[:, [1, 2]]
    np.testing.assert_allclose(other, expected, rtol=2e-4)


def test_rows_that_are_left_out_change_no_spectrum_and_no_row():
    """Every fifth step is written; means are those of the longer interval."""
    every = result(with_keys(joints__middle__shear_stiffness="8 GPa/m", joints__middle__friction=0.6))
    spaced = result(
        with_keys(
            joints__middle__shear_stiffness="8 GPa/m",
            joints__middle__friction=0.6,
            outputs__output_interval="5 ms",
        )
    )
    np.testing.assert_array_equal(spaced.floor_spectrum, every.floor_spectrum)
    assert spaced.sizes["time"] == (every.sizes["time"] - 1) // 5 + 1
    plain = result(
        with_keys(
            joints__middle__shear_stiffness="8 GPa/m",
            joints__middle__friction=0.6,
            outputs__output_interval="5 ms",
            outputs__floor_spectra=None,
        )
    )
    assert not [name for name in plain.variables if name.startswith("floor")]
    for name, values in plain.data_vars.items():  # the rows of a run that was never thinned
        scale = max(float(np.nanmax(np.abs(values.values))), 1e-30)
        np.testing.assert_allclose(spaced[name].values, values.values, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize(
    ("keys", "rows"),
    [
        ({"model": {"order": "full"}, "transient__finest_step": "1 ms"}, 301),
        ({"damping": {}, "transient__integrator": "conserving"}, 301),
        ({"transient__integrator": "modal"}, 301),
        ({"transient": {"accuracy": "2 %"}}, 301),
    ],
    ids=["full order", "conserving", "modal", "accuracy"],
)
def test_every_integrator_has_the_rows_it_would_have_without_spectra(keys, rows):
    keys = keys | {"outputs__output_interval": "10 ms"}
    dataset = result(with_keys(**keys))
    plain = result(with_keys(**keys, outputs__floor_spectra=None))
    assert dataset.sizes["time"] == rows
    for name, values in plain.data_vars.items():
        scale = max(float(np.abs(values.values).max()), 1e-30)
        np.testing.assert_allclose(dataset[name].values, values.values, rtol=0, atol=1e-12 * scale)
    assert dataset.floor_spectrum.min() > 0.0


def test_full_and_reduced_order_agree():
    """With all modes; steps differ: Newmark's of the full order lag high frequencies."""
    keys = {"joints": {}, "outputs__floor_spectra": {"frequencies": [1, 3, 5, 8, 12, 20]}}
    reduced = result(with_keys(**keys, model={"modes": "all"})).floor_spectrum
    full = result(
        with_keys(**keys, model={"order": "full"}, transient={"finest_step": "0.5 ms", "rho_inf": 1.0})
    ).floor_spectrum
    np.testing.assert_allclose(full.sel(component=["y", "z"]), reduced.sel(component=["y", "z"]), rtol=3e-3)


@pytest.mark.slow
def test_supports_that_all_move_alike_are_the_base_moving():
    """Twice the record's motion at every support is the record doubled: accelerations are absolute."""
    keys = {"outputs__floor_spectra": {"frequencies": [0.5, 2, 5, 10, 20, 30]}}
    moved = with_keys(**keys)
    for support in moved["supports"]:
        support["motion"] = {"factor": 2.0}
    twice = pulse()
    twice = GroundMotion(twice.name, 2.0 * twice.acc, twice.dt)
    expected, found = (result(with_keys(**keys), twice), result(moved))
    along = {"component": ["y", "z"]}
    np.testing.assert_allclose(found.floor_spectrum.sel(along), expected.floor_spectrum.sel(along), rtol=5e-4)


def harmonic(frequency, dt, seconds):
    """Motion of a node that grows to a harmonic of amplitude 1 m/s2 and goes again."""
    time, omega = dt * np.arange(round(seconds / dt) + 1), 2.0 * np.pi * frequency

    def acceleration(t):
        ramp = np.clip(np.minimum(t, seconds - t) * 2.5 / seconds, 0.0, 1.0)
        return ramp**2 * (3.0 - 2.0 * ramp) * np.sin(omega * t)

    fine = np.linspace(0.0, seconds, 64 * (len(time) - 1) + 1)
    velocity = np.append(0.0, cumulative_simpson(acceleration(fine), x=fine))[::64]
    vel, acc = np.zeros((2, len(time), 3))
    vel[:, 0], acc[:, 0] = velocity, acceleration(time)
    return StepMotion(dt, acc, vel, np.zeros((len(time), 3)))


@pytest.mark.parametrize("frequency", [2.0, 10.0, 25.0])
def test_a_harmonic_is_transmitted_as_the_closed_form_says(frequency):
    """25 Hz at steps of 5 ms: eight steps a period, and 0.2 % are left."""
    ratios = np.array([0.2, 0.5, 1.0, 1.5])
    motion = harmonic(frequency, 5e-3, max(40.0, 240.0 / frequency))
    found = floor_spectra(motion, {"a": [0]}, np.array(DAMPINGS), np.sort(frequency / ratios))
    r = frequency / found.frequencies
    for d, xi in enumerate(DAMPINGS):
        exact = np.sqrt((1 + (2 * xi * r) ** 2) / ((1 - r**2) ** 2 + (2 * xi * r) ** 2))
        np.testing.assert_allclose(found.ordinates[0, 0, d], exact, rtol=2e-3)


def test_an_impulse_between_two_steps_counts_whatever_the_samples_say():
    """The velocity jumps by V within a step: the oscillator swings with V omega, in closed form."""
    dt, V = 5e-3, 0.1
    vel, acc, ground = (np.zeros((4001, 3)) for _ in range(3))
    vel[500:, 0] = V
    acc[500, 0] = 500.0  # [m/s2] of a force that has all but gone by then: a sample of it
    frequencies, xi = np.array([0.2, 0.5, 1.0, 3.0, 8.0]), 0.05
    found = floor_spectra(StepMotion(dt, acc, vel, ground), {"a": [0]}, np.array([xi]), frequencies)
    omega = 2.0 * np.pi * frequencies
    wd = omega * np.sqrt(1 - xi**2)
    t = np.linspace(0.0, 1.0, 20001)[:, None] / frequencies
    u = -V / wd * np.exp(-xi * omega * t) * np.sin(wd * t)
    v = -V * np.exp(-xi * omega * t) * (np.cos(wd * t) - xi * omega / wd * np.sin(wd * t))
    exact = np.abs(2 * xi * omega * v + omega**2 * u).max(axis=0)
    np.testing.assert_allclose(found.ordinates[0, 0, 0], exact, rtol=6e-3)


@pytest.mark.parametrize("step", ["2.5 ms", "0.625 ms"])
def test_the_stated_error_of_blocks_that_pound_is_about_the_truth(step):
    """Against a run with a sixteenth of the base step, whose finest step is a quarter or less.

    The accelerations as written are samples of impacts: their spectrum is ten times the true one at 0.5 Hz.
    """
    frequencies = [0.5, 1, 2, 3, 5, 8, 12, 18, 25]
    keys = {
        "outputs__floor_spectra": {"frequencies": frequencies, "dampings": [0.05]},
        "joints__middle__normal_stiffness": "4 GPa/m",
    }
    fine_keys = keys | {"transient": {"finest_step": "0.15625 ms"}, "outputs__output_interval": "0.625 ms"}
    keys |= {"transient": {"finest_step": step}, "outputs__error_estimate": True}
    motion, along = pulse(dt=0.01), {"component": "y"}
    coarse, fine = result(with_keys(**keys), motion), result(with_keys(**fine_keys), motion)
    assert float(coarse.peak_opening.max()) > 1e-3
    truth = np.abs(coarse.floor_spectrum.sel(along) / fine.floor_spectrum.sel(along) - 1.0).values
    stated = coarse.floor_spectrum_error.sel(along).values
    assert 0.5 < np.median(stated) / np.median(truth) < 1.5
    assert truth.max() < 4.0 * stated.max()
    assert np.median(truth) < 0.04
    statement = coarse.attrs["floor_spectrum_statement"]
    assert "Halving the steps and adding modes changes the floor spectra" in statement
    written = (coarse.acceleration + coarse.ground_acceleration).sel(component="y", node="left_top").values
    assert oscillator(written, 0.01, 0.5, 0.05) > 10.0 * float(fine.floor_spectrum[0, 1, 0, 0])


def test_places_of_several_nodes_have_the_largest_ordinate(beam):
    both = {"crest": ["left_top", "right_top"], "hoist": ["right_top"]}
    joined = result(with_keys(outputs__floor_spectra={"dampings": DAMPINGS, "places": both}))
    largest = beam.floor_spectrum.max("floor_place")
    np.testing.assert_array_equal(joined.floor_spectrum.sel(floor_place="crest"), largest)
    np.testing.assert_array_equal(
        joined.floor_spectrum.sel(floor_place="hoist"), beam.floor_spectrum.sel(floor_place="right_top")
    )
    np.testing.assert_array_equal(
        joined.floor_peak_acceleration.sel(floor_place="crest"),
        beam.floor_peak_acceleration.max("floor_place"),
    )


def test_broadening_moves_every_peak_by_the_share_to_either_side():
    """A peak at 5 Hz is a plateau from 4.25 to 5.75 Hz, and its sides are parallel on a logarithmic axis."""
    frequencies = np.geomspace(1.0, 25.0, 401)
    x = np.log(frequencies / 5.0)
    tent = 1.0 + 9.0 * np.clip(1.0 - np.abs(x) / 0.3, 0.0, None)
    wide = broadened(tent[None], frequencies, 0.15)[0]
    shifted = np.where(x < 0, x - np.log(0.85), x - np.log(1.15))
    inside = (x >= np.log(0.85)) & (x <= np.log(1.15))
    shifted[inside] = 0.0
    expected = 1.0 + 9.0 * np.clip(1.0 - np.abs(shifted) / 0.3, 0.0, None)
    step = 9.0 / 0.3 * (x[1] - x[0])  # the tip lies between two frequencies
    np.testing.assert_allclose(wide, expected, atol=step)
    assert (wide >= tent - 1e-12).all()
    dataset = result(with_keys(outputs__floor_spectra={"broadening": "15 %"}))
    by_hand = broadened(dataset.floor_spectrum.values, dataset.floor_frequency.values, 0.15)
    np.testing.assert_array_equal(dataset.floor_spectrum_broadened, by_hand)
    assert (dataset.floor_spectrum_broadened >= dataset.floor_spectrum).all()


def test_default_frequencies_are_those_of_the_guide():
    """Table 1 of RG 1.122: 75, by 0.1 Hz up to 3 Hz and by 3 Hz from 22 Hz on."""
    assert len(GUIDE_FREQUENCIES) == 75
    assert GUIDE_FREQUENCIES[:2] == (0.2, 0.3) and GUIDE_FREQUENCIES[-5:] == (22.0, 25.0, 28.0, 31.0, 34.0)
    assert {3.15, 3.8, 5.25, 8.5, 16.0, 20.0} <= {*GUIDE_FREQUENCIES}


def test_a_structure_that_lacks_modes_is_not_believed_above_them():
    dataset = result(with_keys(model={"modes": 1}, outputs__floor_spectra={"frequencies": [1, 5, 30, 200]}))
    statement = dataset.attrs["floor_spectrum_statement"]
    assert "the highest mode kept of some block, motion of the structure is missing" in statement
    warnings = json.loads(dataset.attrs["run_warnings"])
    assert any(text.startswith("floor spectra:") and "are not reliable" in text for text in warnings)
    whole = result(with_keys(model={"modes": "all"}))
    assert "reliable" not in whole.attrs["floor_spectrum_statement"]


def test_a_floor_that_still_moves_at_the_end_is_a_warning():
    warnings = json.loads(result(with_keys(transient__duration="0.8 s")).attrs["run_warnings"])
    assert any("still moves with" in text and "transient.duration" in text for text in warnings)
    rested = json.loads(result(BEAM, pulse(seconds=6.0)).attrs["run_warnings"])
    assert not any("still moves with" in text for text in rested)


REFUSED = {
    "no node": ({"outputs__nodes": {}}, "spectra are of the motion of `outputs.nodes`, and there is none"),
    "another node": (
        {"outputs__floor_spectra": {"places": {"crest": ["left_tip"]}}},
        "outputs.floor_spectra.places.crest: no 'left_tip' is defined.*did you mean 'left_top'",
    ),
    "a node twice": (
        {"outputs__floor_spectra": {"places": {"crest": ["left_top", "left_top"]}}},
        "`places.crest` names 'left_top' twice",
    ),
    "frequencies that fall": (
        {"outputs__floor_spectra": {"frequencies": [1, 3, 2]}},
        "`frequencies` must rise, and number 3, 2 Hz, follows 3 Hz",
    ),
    "dampings that fall": (
        {"outputs__floor_spectra": {"dampings": [0.05, 0.02]}},
        "`dampings` must rise",
    ),
    "no damping": ({"outputs__floor_spectra": {"dampings": [0.0]}}, "dampings"),
    "a frequency of none": ({"outputs__floor_spectra": {"frequencies": [0.0, 1.0]}}, "frequencies"),
    "a broad share": ({"outputs__floor_spectra": {"broadening": 0.9}}, "broadening"),
    "fast oscillators": (
        {"outputs__floor_spectra": {"frequencies": [1, 600]}},
        "oscillators of 600 Hz on the motion of pulse, which is computed every 0.001 s, limit 500 Hz",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_input_is_refused(case):
    keys, message = REFUSED[case]
    with pytest.raises(romdam.ConfigError, match=message):
        romdam.run(with_keys(**keys), motions=pulse())


def test_a_finer_output_interval_lets_faster_oscillators_stand():
    motion, keys = pulse(dt=0.02), {"outputs__floor_spectra": {"frequencies": [1, 30]}}
    with pytest.raises(romdam.ConfigError, match=r"outputs\.output_interval to 0\.0167 s or less"):
        romdam.run(with_keys(**keys), motions=motion)
    assert result(with_keys(**keys, outputs__output_interval="10 ms"), motion).floor_spectrum.size == 36


def test_several_records_are_combined(tmp_path):
    motions = [pulse(size=size, name=f"r{size}", dt=0.005) for size in (1.0, 2.0, 3.0)]
    job = with_keys(joints={}, outputs__floor_spectra={"broadening": "10 %", "frequencies": [1, 3, 5, 9, 20]})
    romdam.run(job, tmp_path, motions=motions)
    with romdam.open_suite(tmp_path) as suite:
        summary = suite.to_dataset().load()
    page = (tmp_path / "summary.csv").read_text()
    assert "floor_peak_acceleration" in page and "floor_spectrum" not in page
    combined = spectra_over_runs(summary)
    each = summary.floor_spectrum.values[:, 0, 0]
    np.testing.assert_allclose(each[2], 3.0 * each[0], rtol=1e-9)  # without joints all is linear
    expected = {"median": 2.0, "84 %": 2.0 + 0.68, "largest": 3.0}
    for statistic, factor in expected.items():
        values = combined.floor_spectrum.sel(statistic=statistic).values[0]
        np.testing.assert_allclose(values, factor * each[0], rtol=1e-9)
    wide = broadened(combined.floor_spectrum.values, np.array([1.0, 3.0, 5.0, 9.0, 20.0]), 0.1)
    np.testing.assert_array_equal(combined.floor_spectrum_broadened, wide)
    assert combined.attrs["runs"] == 3
