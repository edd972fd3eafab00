"""Jobs that begin with the state in which another run ended."""

import h5py
import numpy as np
import pytest

import romdam
from romdam.core.errors import ConfigError
from romdam.core.sealed import changing
from romdam.error.metrics import relative_l2
from romdam.pipelines.error.certify import certify
from romdam.pipelines.export import ExportOptions, export_deck, export_matrices
from romdam.pipelines.suites.run import SuiteOptions

G, DT = 9.81, 0.002
BOX = {"size": [2, 2, 2], "element_size": 1.0}
FRICTION = {"friction": 0.3, "shear_stiffness": "10 GPa/m"}
BOND = FRICTION | {"cohesion": "30 kPa", "tensile_strength": "20 kPa"}
WATER = {"joint_water": [{"joints": ["foot"], "level": "1 m", "downstream": [0, 1, 0], "crack": "full"}]}


UPLIFT = {
    "joint_water": [
        {
            "joints": ["foot"],
            "level": "1 m",
            "downstream": [0, 1, 0],
            "crack": "redrawn",
            "earthquake": "full",
        }
    ],
    # without its bond the heel opens under it
    "force": [{"block": "block", "at": [x, 1, 2], "force": [0, "10 kN", 0]} for x in (0, 0.0, 2, 2.0)],
}


def job(joint=FRICTION, order="reduced", modes=12, transient=(), outputs=(), **loads):
    """A block of 2 m on another that is held; a further joint, grouted, beside them with `grouting`."""
    return {
        "materials": {"concrete": {"E": "3 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
        "blocks": {
            "base": {"material": "concrete", "box": {"origin": [0, 0, -2], **BOX}},
            "block": {"material": "concrete", "box": {"origin": [0, 0, 0], **BOX}},
        },
        "supports": [{"block": "base", "face": "zmin"}],
        "joints": {"foot": {"between": ["base", "block"], "normal_stiffness": "30 GPa/m", **joint}},
        "loads": {"gravity": [0, 0, -G]} | loads,
        "damping": {"rayleigh": {"frequencies": [20.0, 200.0], "ratio": "5 %"}},
        "model": {"order": "full"} if order == "full" else {"modes": modes},
        "transient": {"finest_step": "0.5 ms", "tolerance": 1e-11} | dict(transient),
        "outputs": {"error_estimate": False, "plots": False, "mesh_error": False}
        | {"nodes": {"top": {"block": "block", "at": [2, 2, 2]}}}
        | dict(outputs),
    }


def pulses(size, count, seconds, axis=1):
    t = np.arange(round(seconds / DT) + 1) * DT
    acc = np.zeros((3, len(t)))
    during = (t > 0.05) & (t < 0.05 + count * 0.3)
    acc[axis] = np.where(during, size * np.sin(2.0 * np.pi * (t - 0.05) / 0.3), 0.0)
    return acc


def motion(name, acc):
    return romdam.GroundMotion.from_arrays(name, acc, DT)


def run(configuration, folder, *motions):
    return romdam.run(configuration, out=folder, motions=list(motions))


def after(configuration, result, take="all", **changes):
    """The job that begins with the state of a result."""
    loads = configuration["loads"] | {"initial_state": {"result": str(result), "take": take}}
    return configuration | {"loads": loads} | changes


def assert_goes_on(again, whole, first, within=1e-9):
    rows = slice(first.sizes["time"] - 1, None)
    names = [name for name in ("opening", "slip", "displacement", "normal_force") if name in whole]
    assert len(names) >= 3
    for name in names:
        now, then = again[name].values, whole[name].values
        assert np.abs(now - then[rows]).max() <= within * np.abs(then).max() > 0.0, name


def grouted(**more):
    """The same beside a pillar, the joint between them grouted."""
    configuration = job(BOND | {"cohesion": "0.1 MPa", "tensile_strength": "0.1 MPa"} | more)
    pillar = {"material": "concrete", "box": {"origin": [0, 2, -2], "size": [2, 2, 4], "element_size": 1.0}}
    side = {"between": ["block", "pillar"], "normal_stiffness": "30 GPa/m"}
    side |= FRICTION | {"grouting_pressure": "20 kPa"} | more
    return configuration | {
        "blocks": configuration["blocks"] | {"pillar": pillar},
        "supports": [*configuration["supports"], {"block": "pillar", "face": "zmin"}],
        "joints": configuration["joints"] | {"side": side},
    }


CASES = {
    "friction": (job(), 9.0, -6.0),
    "bond": (job(BOND), 9.0, -6.0),
    "bond with water in the crack": (job(BOND, **WATER), 9.0, -4.0),
    "redrawn uplift": (job(BOND, transient={"tolerance": 1e-13}, **UPLIFT), 6.0, -2.5),
    "generalised alpha": (job(transient={"integrator": "generalized_alpha"}), 9.0, -6.0),
    "full order": (job(order="full"), 9.0, -6.0),
    "spacing": (job(FRICTION | {"spacing": "1.5 m"}), 9.0, -6.0),
    "grouted": (grouted(), 12.0, -9.0),
    "US units": (
        job(
            {
                "friction": 0.3,
                "shear_stiffness": "37000 lbf/in^3",
                "normal_stiffness": "110000 lbf/in^3",
                "cohesion": "4 psi",
            }
        ),
        9.0,
        -6.0,
    ),
}


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            case,
            marks=[pytest.mark.slow]
            * (case in ("generalised alpha", "bond with water in the crack", "full order", "redrawn uplift")),
        )
        for case in CASES
    ],
)
def test_both_records_as_one(tmp_path, case):
    """The second record begins where the first ended, as where both are one record."""
    configuration, first, second = CASES[case]
    one, two = pulses(first, 2, 1.2), pulses(second, 2, 1.2)
    result = run(configuration, tmp_path / "one", motion("main", one))
    whole = run(configuration, tmp_path / "whole", motion("whole", np.hstack([one, two[:, 1:]])))
    again = run(after(configuration, result.paths[0]), tmp_path / "two", motion("after", two))
    main, begun = result.results[0].dataset, again.results[0].dataset
    assert (main["joint_state"] != 1).any()  # it slid or opened
    assert_goes_on(begun, whole.results[0].dataset, main)
    assert begun.attrs["scene_sha256"] != main.attrs["scene_sha256"]


@pytest.mark.slow
def test_a_chain_of_three_and_several_records(tmp_path):
    """The third record begins with a state that itself began with one; two records begin with the same."""
    parts = [pulses(9.0, 2, 1.2), pulses(-6.0, 2, 1.2), pulses(5.0, 2, 1.0)]
    one = run(job(BOND), tmp_path / "1", motion("a", parts[0]))
    two = run(after(job(BOND), one.paths[0]), tmp_path / "2", motion("b", parts[1]), motion("c", parts[2]))
    last = run(after(job(BOND), two.paths[0]), tmp_path / "3", motion("c", parts[2]))
    for name, chain, result in (
        ("ab", parts[:2], two.results[0]),
        ("ac", [parts[0], parts[2]], two.results[1]),
        ("abc", parts, last.results[0]),
    ):
        record = np.hstack([parts[0], *(part[:, 1:] for part in chain[1:])])
        whole = run(job(BOND), tmp_path / name, motion(name, record)).results[0].dataset
        before = whole.isel(time=slice(whole.sizes["time"] - result.dataset.sizes["time"] + 1))
        assert_goes_on(result.dataset, whole, before)


DAMPED = {"viscosity": 1e7}  # else a block goes on bouncing on its joint
AT_REST = {
    "bond": job(BOND | DAMPED),
    "water in the crack": job(BOND | DAMPED, **WATER),
    "static friction": job(FRICTION | DAMPED | {"friction_static": 0.4}),
    "shear key": job(FRICTION | DAMPED | {"shear_key": {"depth": "0.2 mm", "directions": ["j"]}}),
    "grouted": grouted(**DAMPED),
}


@pytest.mark.parametrize("take", [pytest.param("all", marks=pytest.mark.slow), "joints"])
@pytest.mark.parametrize("case", AT_REST)
def test_a_state_at_rest_stays_at_rest(tmp_path, case, take):
    """After a slide, without further shaking, slip and forces stay what they were, gap by gap."""
    shaken = np.pad(pulses(14.0 if case == "grouted" else 9.0, 2, 1.0), ((0, 0), (0, 2500)))
    one = run(AT_REST[case], tmp_path / "1", motion("a", shaken))
    other = AT_REST[case]
    if take == "joints":  # whose order does not count
        other = other | {"joints": dict(reversed(other["joints"].items()))}
    still = run(after(other, one.paths[0], take), tmp_path / "2", motion("b", pulses(0.0, 0, 0.4)))
    main, rest = one.results[0].dataset, still.results[0].dataset
    locked = main["shear_force"].isel(time=-1) - main["shear_force"].isel(time=0)
    assert float(abs(locked).max()) > 500.0  # the slide left other forces than there were
    for name, most in (("slip", 1e-6), ("opening", 1e-6), ("normal_force", 250.0), ("shear_force", 250.0)):
        last = main[name].isel(time=slice(-200, None))
        moves = float((last.max("time") - last.min("time")).max())  # it still rocks by that
        for joint in other["joints"]:
            now, then = rest[name].sel(gap_joint=joint), main[name].isel(time=-1).sel(gap_joint=joint)
            assert np.abs(now.values - then.values).max() <= moves + 1e-6 * most <= most, name
    if "bonded_area" in main:
        left = float(main["bonded_area"].isel(time=-1).sum())
        now = float(rest["bonded_area"].isel(time=0).sum()) if "bonded_area" in rest else 0.0
        assert now == left == (pytest.approx(4.0) if case == "shear key" else 0.0)


@pytest.mark.slow
def test_lost_bonds_stay_lost_under_other_strength(tmp_path):
    """A lost bond does not hold in a job of less friction either: its slips are those of no bond at all."""
    shaken, second = np.pad(pulses(9.0, 2, 1.0), ((0, 0), (0, 2500))), pulses(-4.0, 2, 1.2)
    one = run(job(BOND), tmp_path / "1", motion("a", shaken))
    weaker = job(BOND | {"friction": 0.25})
    told = run(after(weaker, one.paths[0], "joints"), tmp_path / "2", motion("b", second)).results[0].dataset
    bare = run(job(FRICTION | {"friction": 0.25}), tmp_path / "3", motion("b", second)).results[0].dataset
    whole = run(weaker, tmp_path / "4", motion("b", second)).results[0].dataset
    begun = told["slip"] - told["slip"].isel(time=0)
    assert float(abs(whole["slip"]).max()) < 1e-4  # the bond is strong enough, where it is not lost
    assert float(abs(bare["slip"]).max()) > 5e-3
    # shear locked in the springs by the first slide moves the second by mu g / omega times a pulse at most
    locked = 0.25 * G * np.sqrt(2.0**3 * 2400.0 / (4.0 * 10e9)) * 0.3
    assert float(abs(begun - (bare["slip"] - bare["slip"].isel(time=0))).max()) < locked < 0.15 * 5e-3


@pytest.mark.slow
def test_uplift_follows_the_crack_that_an_earthquake_left(tmp_path):
    """Without its bonds the heel opens at rest, and the uplift is that of the crack, as of no bond at all."""
    shaken, still = np.pad(pulses(6.0, 2, 1.0), ((0, 0), (0, 2500))), motion("b", pulses(0.0, 0, 0.2))
    one = run(job(BOND, **UPLIFT), tmp_path / "1", motion("a", shaken))
    assert float(one.results[0].dataset["crack_at_rest"].max()) == 0.0
    after_it = run(after(job(BOND, **UPLIFT), one.paths[0], "joints"), tmp_path / "2", still)
    bare = run(job(FRICTION, **UPLIFT), tmp_path / "3", still)
    crack, expected = (each.results[0].dataset["crack_at_rest"] for each in (after_it, bare))
    assert float(expected.min()) > 0.05
    assert float(abs(crack - expected).max()) < 1e-3 * float(expected.max())


def test_a_block_that_slid_far_is_found_where_it_is(tmp_path):
    """A block held by friction alone, which slid by 0.4 m, starts there and not where the mesh has it."""
    record = np.zeros((3, 3000))
    record[1, 50:200], record[1, 200:800] = 8.0, -2.0  # it comes to rest on the decelerating ground
    one = run(job(), tmp_path / "1", motion("a", record))
    other = after(job(FRICTION | {"friction": 0.05}), one.paths[0], "joints")
    rest = run(other, tmp_path / "2", motion("still", pulses(0.0, 0, 0.2))).results[0].dataset
    slid = one.results[0].dataset["slip"].isel(time=-1, tangent=0)
    assert float(abs(slid).min()) > 0.4
    assert float(abs(rest["slip"].isel(tangent=0) - slid).max()) < 1e-5  # of springs that give


@pytest.mark.parametrize("still", [pytest.param(0, marks=pytest.mark.slow), 2500])
def test_estimates_of_a_run_that_goes_on(tmp_path, still):
    """The error of modes is stated as it is, from rest and in the midst of motion."""
    shaken, second = np.pad(pulses(9.0, 2, 1.0), ((0, 0), (0, still))), pulses(-6.0, 2, 1.2)
    truth = {}
    for modes in (3, "all"):
        one = run(job(modes=modes), tmp_path / f"{modes}1", motion("a", shaken))
        again = after(job(modes=modes, outputs={"error_estimate": True}), one.paths[0])
        truth[modes] = run(again, tmp_path / f"{modes}2", motion("b", second)).results[0].dataset
    true = relative_l2(truth[3]["opening"].values, truth["all"]["opening"].values)
    stated = truth[3].attrs["error_estimate_opening_l2"]
    print(f"stated {stated:.4f}, true {true:.4f}")
    assert 0.9 * true < stated < 1.1 * true


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return run(job(), tmp_path_factory.mktemp("state"), motion("a", pulses(9.0, 2, 1.2))).paths[0]


def box(**changes):
    """The job with another box of the block."""
    configuration = job()
    block = {"material": "concrete", "box": {"origin": [0, 0, 0], **BOX} | changes}
    return configuration | {"blocks": configuration["blocks"] | {"block": block}}


def reversed_joint():
    configuration = job()
    foot = configuration["joints"]["foot"] | {"between": ["block", "base"]}
    return configuration | {"joints": {"foot": foot}}


def renamed_joint():
    configuration = job()
    return configuration | {"joints": {"sole": configuration["joints"]["foot"]}}


WRONG = {
    "friction": (
        job(FRICTION | {"friction": 0.4}),
        "all",
        r"friction at gap 0 of joint foot is 0.4, and was 0.3",
    ),
    "stiffness": (
        job(FRICTION | {"shear_stiffness": "9 GPa/m"}),
        "all",
        r"shear_stiffness at gap 0 of joint foot",
    ),
    "bond": (job(BOND), "all", r"the law 1, Bond of the state's model has \(0,\) values"),
    "load": (job(gravity=[0, 0, -9.0]), "all", r"the force at unknown \d+ is .* and was"),
    "modes": (job(modes=14), "all", r"the stiffness of the state's model has"),
    "integrator": (
        job(transient={"integrator": "generalized_alpha"}),
        "all",
        "is of the integrator adaptive, and this run has generalized_alpha",
    ),
    "automatic modes": (job(modes="auto") | {"transient": {"accuracy": "1 %"}}, "all", "model.modes: auto"),
    "reversed": (reversed_joint(), "joints", r"gap 0 of joint 'foot' is 2 of its unit axes turned"),
    "renamed": (renamed_joint(), "joints", "has the joints foot, and this job sole"),
    "spacing": (
        job(FRICTION | {"spacing": "1.5 m"}),
        "joints",
        r"joint 'foot' has 9 gaps, and \d in this job",
    ),
}


@pytest.mark.parametrize("check", [False, True])
@pytest.mark.parametrize("case", WRONG)
def test_state_of_another_model_is_refused(result, tmp_path, case, check):
    configuration, take, message = WRONG[case]
    with pytest.raises(ConfigError, match=message):
        wrong = after(configuration, result, take)
        if not check:
            run(wrong, tmp_path, motion("b", pulses(1.0, 1, 0.4)))
        else:
            np.savetxt(tmp_path / "b.txt", pulses(1.0, 1, 0.4)[1])
            record = {"file": str(tmp_path / "b.txt"), "dt": DT, "unit": "m/s2", "components": {"y": 1}}
            romdam.check(wrong | {"records": [record]})
    assert not [path for path in tmp_path.iterdir() if path.suffix != ".txt"]


@pytest.mark.parametrize("content", ["nothing", "text", "other", "no state"])
def test_file_that_holds_no_state_is_refused(result, tmp_path, content):
    path, message = tmp_path / "state.nc", "has no final state.*was written by romdam"
    if content == "nothing":
        message = "no such file|does not exist"
    elif content == "text":
        path.write_text("slip,1\n" * 100)
        message = "is not a NetCDF-4 file"
    elif content == "other":
        with h5py.File(path, "w") as file:
            file["x"] = [1.0]
        message = "has no final state.*was written by another program"
    else:
        with changing(result, path) as file:
            del file["final_state"]
    with pytest.raises(ConfigError, match=message) as raised:
        run(after(job(), path), tmp_path / "out", motion("b", pulses(1.0, 1, 0.4)))
    assert "loads.initial_state.result: " in str(raised.value)
    assert not list(tmp_path.glob("out/*.nc"))


@pytest.mark.slow
def test_suites_begin_with_a_state(result, tmp_path):
    """Every run of a suite begins as a lone one, and its kept result serves another job."""
    second = pulses(-6.0, 2, 1.2)
    np.savetxt(tmp_path / "b.txt", second[1])
    record = {"file": "b.txt", "dt": DT, "unit": "m/s2", "components": {"y": 1}}
    vary = {"mu": {"path": "joints.foot.friction", "values": [0.3, 0.2]}}
    for take, suite, runs in (
        ("all", {"scales": [1.0, 0.5]}, [(1.0, 0.3), (0.5, 0.3)]),
        ("joints", {"parameters": vary}, [(1.0, 0.3), (1.0, 0.2)]),
    ):
        asked = {"records": [record], "pipeline": "suite", "suite": suite | {"keep": "full"}}
        configuration = after(job(), result, take, **asked)
        loaded, folder = romdam.load_config(configuration, tmp_path), tmp_path / take
        done = romdam.run_suite(loaded, folder, SuiteOptions(workers=1))
        assert not done.failures
        kept = sorted(folder.glob("runs/*.nc"))
        assert len(kept) == 2
        for path, (scale, friction) in zip(kept, runs, strict=True):
            lone = after(job(FRICTION | {"friction": friction}), result, take)
            alone = run(lone, tmp_path / "lone", motion("b", scale * second)).results[0].dataset
            with romdam.open_result(path) as found:
                assert float(abs(found.dataset["slip"] - alone["slip"]).max()) < 1e-11
                third = (
                    run(after(lone, path, take), tmp_path / "third", motion("c", second)).results[0].dataset
                )
                begun = third["slip"].isel(time=0) - found.dataset["slip"].isel(time=-1)
                assert float(abs(begun).max()) < (1e-12 if take == "all" else 1e-5)
    varied = after(job(), result, "all", **asked) | {"suite": {"parameters": vary}}
    with pytest.raises(ConfigError, match=r"suite.parameters vary it; set take: joints"):
        romdam.load_config(varied, tmp_path)
    automatic = job(FRICTION | {"spacing": "auto"}) | {"transient": {"accuracy": "1 %"}}
    with pytest.raises(ConfigError, match=r"spacing: auto tries other gaps"):
        run(after(automatic, result), tmp_path, motion("b", second))


@pytest.mark.parametrize("code", ["matrices", "opensees"])
def test_decks_do_not_say_a_state(result, tmp_path, code):
    np.savetxt(tmp_path / "b.txt", pulses(1.0, 1, 0.4)[1])
    record = {"file": "b.txt", "dt": DT, "unit": "m/s2", "components": {"y": 1}}
    loaded = romdam.load_config(after(job(), result, records=[record]), tmp_path)
    with pytest.raises(ConfigError, match=r"loads.initial_state.result"):
        if code == "matrices":
            export_matrices(loaded, tmp_path / "out")
        else:
            export_deck(loaded, tmp_path / "out", ExportOptions(code))
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_a_certificate_of_a_run_that_goes_on_is_refused(tmp_path):
    """A replay begins at rest: of a run that goes on from motion it would state another error."""
    names = ("first", "second")
    for name, size in zip(names, (9.0, -6.0), strict=True):
        np.savetxt(tmp_path / f"{name}.txt", pulses(size, 1, 0.4)[1])
    records = [
        {"name": name, "unit": "m/s2", "dt": DT, "components": {"y": {"file": str(tmp_path / f"{name}.txt")}}}
        for name in names
    ]
    first = romdam.run(job() | {"records": records[:1]}, out=tmp_path / "1").paths[0]
    again = after(job(), first, records=records[1:])
    second = romdam.run(again, out=tmp_path / "2").paths[0]
    with pytest.raises(ConfigError, match=r"initial_state\.result: the run goes on .* records\[\]\.after"):
        certify(second)
    with pytest.raises(ConfigError, match="the run goes on from the motion"):
        certify(second, passes=1)
    # what the joints remember begins at rest, and is certified
    rests = romdam.run(after(job(), first, take="joints", records=records[1:]), out=tmp_path / "3").paths[0]
    assert certify(rests, passes=1).statement.errors["opening"].l2 >= 0.0
