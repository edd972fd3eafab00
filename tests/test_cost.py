"""The time that `romdam check` states: which parts of a record are run, and how they stand for the whole."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from test_cli import SMALL, config  # noqa: F401

import romdam
from romdam.core.errors import ConvergenceError
from romdam.core.motion import GroundMotion
from romdam.pipelines import cost


def motion(seconds, dt=0.01, shaken=(0.0, 1.0)):
    """A sine along y over a share of the record, nothing along x and z."""
    acc = np.zeros((3, round(seconds / dt) + 1))
    first, last = (round(share * seconds / dt) for share in shaken)
    acc[1, first:last] = np.sin(np.arange(last - first))
    return GroundMotion("m", acc, dt)


def system(directions=1, laws=(), floating=False):
    return SimpleNamespace(law=SimpleNamespace(directions=directions, laws=laws), floating=floating)


def test_parts_are_a_share_of_the_record_at_equal_distances():
    record = motion(20.0)
    record.acc[0] = np.arange(2001)  # the number of the sample
    parts = cost.record_parts(record, 20.0, 0.2)
    assert [part.duration for part in parts] == pytest.approx([1.0] * 4)
    assert [part.acc[0].mean() for part in parts] == pytest.approx([250, 750, 1250, 1750], abs=1)
    assert [len(part.acc[0]) for part in cost.record_parts(record, 20.0, 1.0)] == [2001]
    shortened = cost.record_parts(record, 8.0, 0.5)  # transient.duration
    assert max(part.acc[0].max() for part in shortened) <= 800
    longer = cost.record_parts(record, 40.0, 0.5)  # what follows the record is rest
    assert len(longer) == 4 and max(part.acc[0].max() for part in longer) <= 2000


def test_an_estimate_goes_over_a_window_while_joints_move_or_over_all():
    record = motion(60.0, shaken=(0.25, 0.75))
    assert cost.estimated_share(system(), record, 60.0) == pytest.approx(0.1)  # 6 s of 60
    slides = cost.estimated_share(system(3), record, 60.0)
    assert slides == pytest.approx(0.48, abs=0.005)  # 96 % of half of it
    assert cost.estimated_share(system(3, ("bond",)), record, 60.0) == 1.0
    assert cost.estimated_share(system(), record, 4.0) == 1.0
    assert cost.estimated_share(system(3), motion(60.0, shaken=(0.0, 0.0)), 60.0) == pytest.approx(0.1)


def test_an_estimate_ends_earlier_where_blocks_rock():
    """Of 30 s of shaking its first 80 %, as `romdam.error.estimate` goes; with memory all the same."""
    record = motion(60.0, shaken=(0.25, 0.75))
    assert cost.estimated_share(system(3, floating=True), record, 60.0) == pytest.approx(0.39, abs=0.005)
    assert cost.estimated_share(system(1, floating=True), record, 60.0) == pytest.approx(0.1)
    assert cost.estimated_share(system(3, ("bond",), floating=True), record, 60.0) == 1.0


def test_the_share_of_an_estimate_is_of_what_is_run():
    """A run of 20 s sees 5 of 30 s of shaking: a window; one of 30 s sees 15 of them, 96 % of which count."""
    record = motion(60.0, shaken=(0.25, 0.75))
    assert cost.estimated_share(system(3), record, 20.0) == pytest.approx(6.0 / 20.0)
    assert cost.estimated_share(system(3), record, 30.0) == pytest.approx(0.96 * 15.0 / 30.0, abs=0.005)


def test_what_a_part_takes_whatever_its_length_counts_once():
    """Four parts, each 0.1 s and 2 s times its share of the record: 0.1 + 2 s of the whole."""
    of = {share: {"integration": 4 * 0.1 + 2.0 * share} for share in (0.04, 0.2, 1.0)}
    assert cost.of_whole(0.04, of[0.04], 0.2, of[0.2]) == pytest.approx({"integration": 2.1})
    assert cost.of_whole(0.04, of[0.04], 1.0, {"integration": 2.1}) == {"integration": 2.1}
    fell = cost.of_whole(0.04, {"integration": 3.0}, 0.2, {"integration": 2.0})
    assert fell == pytest.approx({"integration": 0.5})  # nothing grew: that of one part
    grew = cost.of_whole(0.04, {"integration": 0.0}, 0.2, {"integration": 1.0})
    assert grew == pytest.approx({"integration": 5.0})  # no more than in proportion


def test_check_runs_a_part_to_compile_then_all_short_and_longer(config, monkeypatch):  # noqa: F811
    raw = yaml.safe_load(SMALL)
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": False}  # whose runs would be counted too
    config.write_text(yaml.safe_dump(raw))
    run, lengths, estimates = cost.simulate_motion, [], []

    def counted(job, prepared, record, length):
        lengths.append(length)
        return run(job, prepared, record, length)

    def estimated(job, model, record, history):
        estimates.append(job.config.transient.duration)
        return history, None

    monkeypatch.setattr(cost, "simulate_motion", counted)
    monkeypatch.setattr(cost, "with_estimates", estimated)
    for name, value in {"_BUDGET": 0.0, "_START_UP": 0.0, "_LONGER": 2.0}.items():
        monkeypatch.setattr(cost, name, value)
    found = romdam.check(config)
    assert set(found.costs) == set(cost.COSTS) and found.costs["integration"] > 0.0
    assert found.seconds == pytest.approx(sum(found.costs.values()))
    assert found.costs["results"] == pytest.approx(cost._RESULTS + cost._BYTES * found.file_size)
    drawn = cost._FIGURES + cost._JOINT_FIGURES * len(found.joints)
    assert found.costs["figures"] in (0.0, drawn) and found.costs["start"] > cost._START
    assert found.costs["reduction"] > 0.0, "nothing is kept for the run, which reduces again"
    assert lengths == estimates
    assert (
        len(lengths) == 1 + 2 * 4
    )  # 0.05 s each, five written rows, to compile and to begin with; then 0.1 s
    assert lengths[:5] == pytest.approx([0.05] * 5, abs=0.011)
    assert lengths[5:] == pytest.approx([0.1] * 4, abs=0.011)
    lengths.clear()
    monkeypatch.setattr(cost, "_ENOUGH", 0.0)
    assert romdam.check(config).costs["integration"] > 0.0
    assert lengths == pytest.approx([0.05] * 5, abs=0.011), "no longer ones where these take long"
    lengths.clear()
    monkeypatch.setattr(cost, "_START_UP", 0.15)
    assert romdam.check(config).costs["integration"] > 0.0
    assert lengths == pytest.approx([0.59] * 2, abs=0.011)  # four parts of 0.15 s are all of it

    def fails(*_):
        raise ConvergenceError("step 3 does not converge")

    monkeypatch.setattr(cost, "simulate_motion", fails)
    found = romdam.check(config)
    assert found.costs == {} and np.isnan(found.seconds)
    assert any("the time of a run" in text for text in found.skipped)


def test_costs_are_those_of_every_run_of_every_record(monkeypatch):
    """6 s for the strongest record of 30 s; five runs of it and of one of 10 s: 5 40 / 30 times that."""

    @dataclass(frozen=True)
    class Reduced:
        stress: object = None
        scene: object = None
        reduced: object = None
        reduced_at_rest: object = None
        prepared: object = None
        system: object = None

    per_share = {"integration": 6.0, "estimate": 4.5, "stress": 3.0}
    steps = SimpleNamespace(interval=0.01)
    monkeypatch.setattr(cost, "settings_for", lambda *_: SimpleNamespace(steps=steps))
    monkeypatch.setattr(cost, "stress_fields", lambda *_: {})
    monkeypatch.setattr(cost, "estimated_share", lambda *_: 1.0)
    monkeypatch.setattr(
        cost,
        "_run_parts",
        lambda job, model, sibling, motion, share, only_one=False: {
            n: s * share for n, s in per_share.items()
        },
    )
    keys = {"transient": SimpleNamespace(duration=None), "outputs": SimpleNamespace(plots=True)}
    job = SimpleNamespace(config=SimpleNamespace(pipeline="run", **keys))
    motions = [
        GroundMotion(str(seconds), peak * np.ones((3, 100 * seconds + 1)), 0.01, {}, ())
        for seconds, peak in ((10, 1.0), (30, 3.0))
    ]
    found = cost.run_costs(job, Reduced(system=SimpleNamespace(law=None)), motions, runs=5)
    assert found["integration"] == pytest.approx(40.0) and found["estimate"] == pytest.approx(30.0)
    assert found["stress"] == pytest.approx(20.0, abs=0.1)
    fixed = cost.fixed_costs(
        job, records=2, runs=2, joints=5, file_size=1e8, stages={"records": 0.5, "scene": 1.0}
    )
    assert fixed == pytest.approx({"start": 4.5, "results": 3 * 0.7 + 2.3, "figures": 2 * (1.0 + 5 * 0.6)})
