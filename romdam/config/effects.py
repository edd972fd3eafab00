"""The physical effects that a job may ask for, and those that physics does not let act together."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Literal, NamedTuple

from romdam.config.sections.job import Sections
from romdam.core.errors import ConfigError

Computation = Literal["deck", "matrices", "rest", "linear stage", "certificate"]
_WHAT: dict[Computation, str] = {  # what an effect is not, where a computation does not know it
    "deck": "written for other codes",
    "matrices": "written as matrices",
    "rest": "known to a state at rest",
    "linear stage": "known to a linear stage",
    "certificate": "known to a certificate",
}
# beside the runs themselves: what has an effect, or refuses it with a reason and a remedy of its own
_KNOWING: frozenset[Computation] = frozenset({"deck", "matrices", "rest", "certificate"})


class EffectEntry(NamedTuple):
    """An effect as the commands see it. What its entry does not say is refused by its name.

    Attributes
    ----------
    key : that asks for it
    acts : whether a job does
    known_to : the computations that know it
    modes : whether it leaves the modes "apart" or has them "coupled", as dashpots do
    records : dimension over which results have the force of each of its attachments; empty for none
    varies : keys of each entry of its section that samples of a suite may have others of
    """

    key: str
    acts: Callable[[Sections], bool]
    known_to: frozenset[Computation] = frozenset()
    modes: Literal["apart", "coupled", "unknown"] = "unknown"
    records: str = ""
    varies: tuple[str, ...] = ()


def _known(
    key: str,
    acts: Callable[[Sections], bool],
    *,
    coupled: bool = False,
    linear: bool = False,
    written: bool = True,
    records: str = "",
    varies: tuple[str, ...] = (),
) -> EffectEntry:
    """The entry of an effect that all commands know, exports where it is `written`, and a `linear` stage."""
    known_to = _KNOWING if written else _KNOWING - {"deck", "matrices"}
    if linear:
        known_to = known_to | {"linear stage"}
    return EffectEntry(key, acts, known_to, "coupled" if coupled else "apart", records, varies)


def _has_water(model: str) -> Callable[[Sections], bool]:
    return lambda config: config.water is not None and config.water.model == model


def has_viscous_boundary(config: Sections) -> bool:
    """Tell whether rock has faces that take waves up."""
    dam = config.arch_dam
    of_dam = dam is not None and dam.rock is not None and dam.rock.boundary == "viscous"
    return of_dam or bool(config.ground.viscous)


EFFECTS = {
    "moving supports": _known(
        "supports[].motion", lambda config: any(one.motion is not None for one in config.supports)
    ),
    "motion along": _known("ground.along", lambda config: config.ground.along is not None),
    "Westergaard's added mass": _known("water.model: westergaard", _has_water("westergaard"), linear=True),
    "incompressible water": _known("water.model: incompressible", _has_water("incompressible"), linear=True),
    "compressible water": _known("water.model: compressible", _has_water("compressible"), coupled=True),
    "viscous boundary": _known("ground.viscous", has_viscous_boundary, coupled=True),
    "free field": _known(
        "ground.input: free_field", lambda config: config.ground.input == "free_field", coupled=True
    ),
    "inclined waves": _known(
        "ground.incidence", lambda config: config.ground.incidence is not None, coupled=True
    ),
    "staged weight": _known(
        "loads.weight: staged", lambda config: config.loads.weight == "staged", linear=True
    ),
    "staged construction": _known("construction", lambda config: bool(config.construction)),
    "force histories": _known("loads.force_history", lambda config: bool(config.loads.force_history)),
    "moduli by duration": EffectEntry(
        "materials.<name>.E_dynamic",
        lambda config: any(one.E_dynamic not in (None, one.E) for one in config.materials.values()),
        frozenset({"linear stage", "rest"}),
        "apart",
    ),
    "temperature": _known("loads.temperature", lambda config: bool(config.loads.temperature), linear=True),
    "water in joints": _known(
        "loads.joint_water", lambda config: bool(config.loads.joint_water), linear=True
    ),
    "grouting": _known(
        "joints.<name>.grouting_pressure",
        lambda config: any(one.law_keys["grouting_pressure"] for one in config.every_joint.values()),
        linear=True,
    ),
    "anchors": _known(
        "anchors",
        lambda config: bool(config.anchors),
        linear=True,
        written=False,
        records="anchor",
        varies=("pretension", "loss", "stiffness", "area"),
    ),
    "dampers": _known(
        "dampers",
        lambda config: bool(config.dampers),
        coupled=True,
        written=False,
        records="damper",
        varies=("damping",),
    ),
    "masses": _known(
        "masses", lambda config: bool(config.masses), linear=True, written=False, varies=("mass",)
    ),
    "damping by material": _known(
        "materials.<name>.damping",
        lambda config: any(one.damping is not None for one in config.materials.values()),
        coupled=True,  # where materials of unlike damping are tied; parts of one damping stay apart
        linear=True,
    ),
    "modal damping": _known("damping.modal", lambda config: config.damping.modal is not None, linear=True),
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

_ONE_MODULUS_OF_STAGES = (
    "materials.<name>.E_dynamic: concrete hardens while stages of `construction` are built, and no "
    "modulus of theirs is known beside the two; leave E_dynamic out, or the stages"
)

_HELD_ROCK = (
    "ground.along: rock beyond viscous faces moves as the record everywhere; hold the rock at its "
    "boundary (ground.viscous left out, of an arch dam rock.boundary: fixed), or leave `along` out"
)
_LEVEL_WATER = (
    "ground.incidence: floor and banks of a solved reservoir move as one, and waves at an angle reach them "
    "one after another; set water.model: westergaard, or leave `incidence` out"
)
EXCLUDED = {
    frozenset({"damping by material", "modal damping"}): (
        "materials.<name>.damping: is of a material, and damping.modal gives ratios to the modes of all "
        "together; give damping.rayleigh for the other materials, or leave one of the two out"
    ),
    frozenset({"free field", "modal damping"}): FREE_FIELD_WITH_RATIOS,
    frozenset({"inclined waves", "modal damping"}): FREE_FIELD_WITH_RATIOS,
    frozenset({"inclined waves", "motion along"}): _HELD_ROCK,
    frozenset({"inclined waves", "incompressible water"}): _LEVEL_WATER,
    frozenset({"inclined waves", "compressible water"}): _LEVEL_WATER,
    frozenset({"motion along", "moving supports"}): (
        "ground.along: moves all supports by their position, and supports[].motion one of them; give one of "
        "the two (a station may have its own delay, factor or record)"
    ),
    frozenset({"motion along", "free field"}): (
        "ground.along: the waves of ground.input: free_field come straight up, at all places at once; give "
        "ground.input: uniform with rock that is held at its boundary, or leave `along` out"
    ),
    frozenset({"motion along", "viscous boundary"}): _HELD_ROCK,
    frozenset({"staged weight", "staged construction"}): _WEIGHT_OF_STAGES,
    frozenset({"anchors", "staged construction"}): (
        "anchors: would hold blocks in stages of `construction` before they are stressed; leave one of the "
        "two out"
    ),
    frozenset({"moduli by duration", "staged construction"}): _ONE_MODULUS_OF_STAGES,
} | {frozenset(pair): _ONE_RESERVOIR for pair in combinations(_WATERS, 2)}


def acting_effects(config: Sections) -> set[str]:
    """Names of the effects that a job asks for."""
    return {name for name, effect in EFFECTS.items() if effect.acts(config)}


def unknown_effects(config: Sections, to: Computation) -> list[str]:
    """Names of the effects of a job that a computation does not know."""
    return sorted(name for name in acting_effects(config) if to not in EFFECTS[name].known_to)


def refuse_unknown_effects(config: Sections, to: Computation, source: str) -> None:
    """Refuse effects that a computation has never heard of.

    Raises
    ------
    ConfigError
        with the key.
    """
    for name in unknown_effects(config, to):
        raise ConfigError(f"{source}: {EFFECTS[name].key}: {name} is not {_WHAT[to]}; leave it out")


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
