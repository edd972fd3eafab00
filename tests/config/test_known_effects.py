"""What couples modes is asked whole, and an effect that a list does not know is refused by its name."""

from collections.abc import Callable
from typing import Any

import pytest
from suite_jobs import BASE

from romdam.config import coupling, effects, linear_stage, parse_config
from romdam.config.coupling import couplings
from romdam.config.effects import EFFECTS, EffectEntry
from romdam.core.errors import ConfigError

WATER = {"model": "compressible", "level": 12, "faces": [{"block": "right", "face": "ymax"}]}
BROUGHT = {
    "material": "concrete",
    "box": BASE["blocks"]["left"]["box"],
    "matrices": {"stiffness": "k.mtx", "mass": "m.mtx", "damping": "c.mtx", "nodes": "n.csv"},
}
OVER_THE_RATIO = {"parameters": {"xi": {"path": "damping.rayleigh.ratio", "values": [0.03, 0.06]}}}


def job(**sections: Any) -> dict[str, Any]:
    return {key: value for key, value in BASE.items() if key != "pipeline"} | sections


def test_water_does_not_hide_that_a_block_brings_its_damping():
    raw = job(blocks=BASE["blocks"] | {"left": BROUGHT})
    both = parse_config(raw | {"water": WATER}, "s.yaml")
    assert [one.key for one in couplings(both)] == ["water.model", "blocks.left.matrices.damping"]
    for more in ({}, {"water": WATER}):
        with pytest.raises(ConfigError, match=r"1 of damping varied.*blocks.left.matrices.damping"):
            parse_config(raw | more | {"suite": OVER_THE_RATIO}, "s.yaml")
    parse_config(job(water=WATER, suite=OVER_THE_RATIO), "s.yaml")  # the solids' ratios can be varied


@pytest.fixture
def dashpots(monkeypatch: pytest.MonkeyPatch) -> None:
    """An effect that was registered, and that no list has heard of."""
    acts: Callable[[Any], bool] = lambda config: True  # noqa: E731
    monkeypatch.setitem(effects.EFFECTS, "dashpots", EffectEntry("joints.<name>.dashpots", acts))


def test_an_effect_that_is_not_known_is_refused_by_name(dashpots):
    with pytest.raises(ConfigError, match=r"1 of damping varied.*dashpots.*joints.<name>.dashpots"):
        parse_config(job(suite=OVER_THE_RATIO), "s.yaml")
    with pytest.raises(
        ConfigError, match=r"linear_stage: joints.<name>.dashpots is dashpots, which is not known"
    ):
        parse_config(job(linear_stage={}), "s.yaml")


def test_every_effect_is_of_one_list():
    assert {*EFFECTS} == coupling._KEEP_MODES_APART | coupling._COUPLE
    assert linear_stage._KNOWN | {*linear_stage._WITHOUT} == {*EFFECTS}
    assert not linear_stage._KNOWN & {*linear_stage._WITHOUT}
