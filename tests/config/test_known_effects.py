"""What couples modes is asked whole, and an effect that a list does not know is refused by its name."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from suite_jobs import BASE, pulse

import romdam
from romdam.config import effects, linear_stage, parse_config
from romdam.config.coupling import couplings
from romdam.config.effects import EFFECTS, EffectEntry
from romdam.core.errors import ConfigError
from romdam.core.known import contents, refuse_unknown
from romdam.core.scene import (
    Block,
    ConstructionStage,
    FreeField,
    Joint,
    Material,
    Reservoir,
    Scene,
    StaticLoads,
)
from romdam.core.scene_effect import SceneEffect
from romdam.core.system import GapLaw, System
from romdam.effects.full_order import assemble_full
from romdam.export import build, matrices
from romdam.export.deck import DeckMotion
from romdam.geometry.matrices import block as of_matrices
from romdam.pipelines.error.certify import begins_at_rows, certify
from romdam.pipelines.export import ExportOptions, export_deck, export_matrices
from romdam.pipelines.stability import assess_stability
from romdam.scene.build import build_scene

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


def test_an_effect_that_says_nothing_of_itself_is_known_to_no_command():
    silent = EffectEntry("key", lambda config: True)
    assert not silent.known_to and silent.modes == "unknown"


def test_what_the_linear_stage_does_not_know_it_refuses_with_a_reason():
    known = {name for name, effect in EFFECTS.items() if "linear stage" in effect.known_to}
    assert known and not known & {*linear_stage._WITHOUT}
    assert known | {*linear_stage._WITHOUT} == {*EFFECTS}


@pytest.mark.parametrize(
    ("sections", "begins"),
    [
        ({}, True),
        ({"ground": {"along": {"axis": "y", "velocity": 900.0}}}, False),
        ({"supports": [*BASE["supports"][:-1], BASE["supports"][-1] | {"motion": {"delay": 0.05}}]}, False),
    ],
    ids=["base alone", "along", "delay"],
)
def test_what_moves_by_itself_is_certified_over_the_whole_record(sections, begins):
    config = parse_config(job(**sections), "s.yaml")
    system = assemble_full(build_scene(config, Path(), "s.yaml"), config.damping)
    assert begins_at_rows(system) is begins


def test_known_fields_are_fields():
    lists = [
        (Scene, build._OF_SCENE), (Block, build._OF_BLOCK), (Material, build._OF_MATERIAL),
        (Reservoir, build._OF_RESERVOIR), (Joint, build._OF_JOINT), (GapLaw, build._OF_GAPS),
        (System, matrices._OF_SYSTEM), (Block, matrices._OF_BLOCK), (GapLaw, matrices._OF_GAPS),
        (Scene, of_matrices._OF_SCENE), (Block, of_matrices._OF_BLOCK),
    ]  # fmt: skip
    for kind, known in lists:
        assert known <= {one.name for one in fields(kind)}, kind


@pytest.mark.slow
def test_a_result_is_certified_and_a_job_exported_without_the_effect_only(tmp_path, monkeypatch):
    """The whole way, by the commands' functions: with the effect each refuses, and leaves no file."""
    np.savetxt(tmp_path / "r.txt", pulse(0))
    records = [{"file": "r.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}]
    later = {"required_factor": 1.2}
    path = tmp_path / "job.yaml"
    path.write_text(yaml.safe_dump(job(records=records, post_earthquake=later)))
    loaded = romdam.load_config(path)
    result = romdam.run(loaded, tmp_path / "out").results[0].path
    every = lambda config: True  # noqa: E731
    monkeypatch.setitem(effects.EFFECTS, "dashpots", EffectEntry("joints.<name>.dashpots", every))
    wanted = r"job.yaml.*: joints.<name>.dashpots: dashpots is not .*; leave it out"
    attempts: list[Callable[[], Any]] = [
        lambda: export_deck(loaded, tmp_path / "deck", ExportOptions("opensees")),
        lambda: export_matrices(loaded, tmp_path / "matrices"),
        lambda: assess_stability(loaded, [result], tmp_path / "stability"),
        lambda: certify(result),
    ]
    for attempt in attempts:
        with pytest.raises(ConfigError, match=wanted):
            attempt()
    assert not any((tmp_path / name).exists() for name in ("deck", "matrices", "stability"))
    monkeypatch.undo()
    export_deck(loaded, tmp_path / "deck", ExportOptions("opensees"))
    assert list((tmp_path / "deck").iterdir())


@dataclass(frozen=True)
class IcyScene(Scene):
    ice: tuple[str, ...] = ()


@dataclass(frozen=True)
class SnowyLoads(StaticLoads):
    snow: float = 0.0


@dataclass(frozen=True)
class Moss(SceneEffect):
    """An effect that no computation knows."""


@dataclass(frozen=True)
class BoltedJoint(Joint):
    bolts: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class CreepingBlock(Block):
    creep: float = 0.0


@dataclass(frozen=True)
class WarmSystem(System):
    warmth: float = 0.0


def held_by(kind: type, of: Any, **more: Any) -> Any:
    """The same as another type, whose further fields hold something."""
    return kind(**{one.name: getattr(of, one.name) for one in fields(of)}, **more)


def small_scene() -> tuple[Any, Scene]:
    config = parse_config(job(), "s.yaml")
    return config, build_scene(config, Path(), "s.yaml")


def with_entry(scene: Scene, section: str, name: str, value: Any) -> Scene:
    return replace(scene, **{section: getattr(scene, section) | {name: value}})


def test_a_field_that_a_deck_does_not_know_is_refused():
    config, scene = small_scene()
    motion = DeckMotion("none", np.zeros((3, 5)), 0.01, 1)

    def deck(of: Scene) -> object:
        return build.build_deck(of, config.damping, motion, title="", static=False)

    deck(held_by(IcyScene, scene))  # which holds nothing
    bolted = held_by(BoltedJoint, scene.joints["gap"], bolts=np.array([0.0, 1.0]))
    creeping = held_by(CreepingBlock, scene.blocks["left"], creep=1e-9)
    for name, of in {
        "IcyScene.ice": held_by(IcyScene, scene, ice=("left",)),
        "BoltedJoint.bolts": with_entry(scene, "joints", "gap", bolted),
        "CreepingBlock.creep": with_entry(scene, "blocks", "left", creeping),
        "SnowyLoads.snow": replace(scene, loads=held_by(SnowyLoads, scene.loads, snow=2.0)),
        "Moss": scene.with_effects(Moss()),
    }.items():
        with pytest.raises(ConfigError, match=f"{name} is not written for other codes; leave out the key"):
            deck(of)


def test_a_field_that_matrices_do_not_know_is_refused(tmp_path):
    config, scene = small_scene()
    system = assemble_full(scene, config.damping)
    with pytest.raises(ConfigError, match=r"WarmSystem.warmth is not written as matrices"):
        matrices.write(scene, held_by(WarmSystem, system, warmth=1.0), None, config.damping, tmp_path)
    followed = system.loaded({"tides": np.ones((system.size, 1))})  # type: ignore[dict-item]
    with pytest.raises(ConfigError, match="a load that follows the tides is not written as matrices"):
        matrices.write(scene, followed, None, config.damping, tmp_path)
    assert not [*tmp_path.iterdir()]


def test_what_acts_on_a_block_of_matrices_is_known_or_refused():
    """Its temperature in a stage, waves of the free field in it, and what nothing here knows."""
    _, scene = small_scene()
    absent = np.zeros((len(scene.blocks["left"].points), 3), dtype=bool)
    block = replace(scene.blocks["left"], matrices=SimpleNamespace(absent=absent))
    scene = with_entry(scene, "blocks", "left", block)
    supported = {name: np.zeros((len(one.points), 3), dtype=bool) for name, one in scene.blocks.items()}
    of_matrices.refuse_unreached(scene, supported, "s.yaml")
    stages = [
        ConstructionStage("cold", frozenset(scene.blocks), None, {"left": change}, np.zeros(8, dtype=bool))
        for change in (0.0, -4.0)
    ]
    of_matrices.refuse_unreached(scene.with_effects(stages[0]), supported, "s.yaml")
    waves = FreeField(np.array([0.0, -5.0]), (block.material,), 1, frozenset({"left"}))
    elsewhere = replace(waves, blocks=frozenset({"right"}))
    of_matrices.refuse_unreached(scene.with_effects(elsewhere), supported, "s.yaml")
    for wanted, of in {
        r"loads.temperature: the change of block 'left' is not known": scene.with_effects(*stages),
        r"ground.input: the waves of free_field in rock 'left'.*uniform": scene.with_effects(waves),
        r"IcyScene.ice is not known of block 'left'": held_by(IcyScene, scene, ice=("left",)),
        r"SnowyLoads.snow is not known of block 'left'": replace(
            scene, loads=held_by(SnowyLoads, scene.loads, snow=2.0)
        ),
        r"Moss is not known of block 'left'": scene.with_effects(Moss()),
    }.items():
        with pytest.raises(ConfigError, match=wanted):
            of_matrices.refuse_unreached(of, supported, "s.yaml")


def test_what_a_field_holds():
    @dataclass
    class Case:
        number: float = 2.0
        flags: np.ndarray = field(default_factory=lambda: np.zeros(2, dtype=bool))
        table: dict[str, int] = field(default_factory=dict)
        other: object = None
        usual: bool = True

    assert contents(Case()) == ()
    assert contents(Case(usual=False)) == ("usual",)
    assert contents(Case(3.0, np.array([False, True]), {"a": 0}, object())) == (
        "number", "flags", "table", "other",
    )  # fmt: skip
    refuse_unknown(Case(3.0), {"number"}, "known")
    with pytest.raises(ConfigError, match=r"^cases.table is not known; empty it$"):
        refuse_unknown(Case(table={"a": 1}), {"number"}, "known", {"table": ("cases.table", "empty it")})
