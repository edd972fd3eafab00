"""The physical effects that a job may ask for, and those that physics does not let act together."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import combinations
from typing import NamedTuple

from romdam.config.sections.job import Sections
from romdam.core.errors import ConfigError


class EffectEntry(NamedTuple):
    """The key that asks for an effect, and whether a job does."""

    key: str
    acts: Callable[[Sections], bool]


def _has_water(model: str) -> Callable[[Sections], bool]:
    return lambda config: config.water is not None and config.water.model == model


def has_viscous_boundary(config: Sections) -> bool:
    """Tell whether rock has faces that take waves up."""
    dam = config.arch_dam
    of_dam = dam is not None and dam.rock is not None and dam.rock.boundary == "viscous"
    return of_dam or bool(config.ground.viscous)


EFFECTS = {
    "moving supports": EffectEntry(
        "supports[].motion", lambda config: any(one.motion is not None for one in config.supports)
    ),
    "motion along": EffectEntry("ground.along", lambda config: config.ground.along is not None),
    "Westergaard's added mass": EffectEntry("water.model: westergaard", _has_water("westergaard")),
    "incompressible water": EffectEntry("water.model: incompressible", _has_water("incompressible")),
    "compressible water": EffectEntry("water.model: compressible", _has_water("compressible")),
    "viscous boundary": EffectEntry("ground.viscous", has_viscous_boundary),
    "free field": EffectEntry("ground.input: free_field", lambda config: config.ground.input == "free_field"),
    "staged weight": EffectEntry("loads.weight: staged", lambda config: config.loads.weight == "staged"),
    "staged construction": EffectEntry("construction", lambda config: bool(config.construction)),
    "force histories": EffectEntry("loads.force_history", lambda config: bool(config.loads.force_history)),
    "temperature": EffectEntry("loads.temperature", lambda config: bool(config.loads.temperature)),
    "water in joints": EffectEntry("loads.joint_water", lambda config: bool(config.loads.joint_water)),
    "grouting": EffectEntry(
        "joints.<name>.grouting_pressure",
        lambda config: any(one.law_keys["grouting_pressure"] for one in config.every_joint.values()),
    ),
    "modal damping": EffectEntry("damping.modal", lambda config: config.damping.modal is not None),
}

FREE_FIELD_WITH_RATIOS = (
    "damping.modal: the free field is found for `rayleigh` damping of the rock only (modal ratios are those "
    "of rock and dam together); give damping.rayleigh, or ground.input: uniform"
)
_ONE_RESERVOIR = "water.model: a scene has one reservoir, whose water has one model; choose one of the three"
_WATERS = "Westergaard's added mass", "incompressible water", "compressible water"

_WEIGHT_OF_STAGES = (
    "loads.weight: staged: the stages of `construction` say when weight acts; leave it out, and pour the "
    "blocks in a stage before their joints are grouted"
)

EXCLUDED = {
    frozenset({"free field", "modal damping"}): FREE_FIELD_WITH_RATIOS,
    frozenset({"motion along", "moving supports"}): (
        "ground.along: moves all supports by their position, and supports[].motion one of them; give one of "
        "the two (a station may have its own delay, factor or record)"
    ),
    frozenset({"motion along", "free field"}): (
        "ground.along: the waves of ground.input: free_field come straight up, at all places at once; give "
        "ground.input: uniform with rock that is held at its boundary, or leave `along` out"
    ),
    frozenset({"motion along", "viscous boundary"}): (
        "ground.along: rock beyond viscous faces moves as the record everywhere; hold the rock at its "
        "boundary (ground.viscous left out, of an arch dam rock.boundary: fixed), or leave `along` out"
    ),
    frozenset({"staged weight", "staged construction"}): _WEIGHT_OF_STAGES,
} | {frozenset(pair): _ONE_RESERVOIR for pair in combinations(_WATERS, 2)}


def acting_effects(config: Sections) -> set[str]:
    """Names of the effects that a job asks for."""
    return {name for name, effect in EFFECTS.items() if effect.acts(config)}


def refuse_unknown_effects(config: Sections, known: Collection[str], source: str, what: str) -> None:
    """Refuse effects that a computation has never heard of.

    Parameters
    ----------
    known : names in `EFFECTS` that the computation has, or refuses with a reason of its own
    what : of the computation, such as "written for other codes"

    Raises
    ------
    ConfigError
        with the key.
    """
    for name in sorted(acting_effects(config) - set(known)):
        raise ConfigError(f"{source}: {EFFECTS[name].key}: {name} is not {what}; leave it out")


def refuse_excluded(config: Sections) -> None:
    """Refuse effects that physics does not let act together.

    Raises
    ------
    ValueError
        with the key, the physics and the remedy.
    """
    acting = acting_effects(config)
    for pair in combinations([name for name in EFFECTS if name in acting], 2):
        if message := EXCLUDED.get(frozenset(pair)):
            raise ValueError(message)
