"""The protocol of a joint law: one class, whose functions answer for one gap.

A law declares the keys that it adds to a joint, with units and bounds. From these derive what a configuration
may say, what a suite may vary, how both are checked and what the manual lists. What it does in a step stands
in plain functions of one gap, compiled when a scene needs them; they touch the numbers they are handed and
nothing else:

limit       puts what bounds the gap's force;
release     looks at the solution and gives up what the gap cannot hold; the step is then solved again;
commit      moves the memory, once the step is accepted.

All of them see the gap in the step: its opening, normal force, slip and rate of slip, and the length of the
step. A law whose bounds depend on these says so (`follows_step`): the step is then solved until the bounds
are those of its own solution.

The shear of a closed gap is bounded by |t| <= c + mu p with p the compression, along j and k each, or on the
resultant where both bounds are equal; a bond of the strength T lets p go down to -T. Water pushes the sides
apart by a force of its own, which is no part of p. Laws come one after
another, in the order of `romdam.contact.laws.LAWS` with a user's own at the end, and each sees what those
before it have put.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from romdam.core.arrays import Floats

# what bounds the force of a gap: the entries of `limit` [N], [1]
TENSION, COHESION_J, COHESION_K, MU_J, MU_K, WATER = range(ENTRIES := 6)
# a gap in a step: the entries of `step`
OPENING, NORMAL_FORCE, SLIP_J, SLIP_K, RATE, DT, PULLED, SLIDING = range(STEP_ENTRIES := 8)
AXES = ("j", "k")
ENERGY = STORED, DISSIPATED = ("stored", "dissipated")  # names in a memory that the energy ledger reads

Row = Sequence[float] | Floats


@dataclass(frozen=True)
class Parameter:
    """One key of a law.

    Attributes
    ----------
    name : the key
    unit : SI unit of its value in pint's spelling, such as "Pa" or ""; "axes" for a choice among j and k
    least, most : bounds of the value, itself allowed unless `above`
    above : whether the value must exceed `least`
    both : whether it may be one value for both tangential directions or a list of two, j and k
    per_area : whether the gap's value is this times its tributary area
    per_gap : SI unit of the gap's own value, where it may be given as {per_gap: value}
    rigid : whether it may be the word "rigid", which is infinite
    auto : whether it may be the word "auto": the scene puts a number from the elements beside the joint
    default : what a joint has that does not say; None where it then has not got the law
    choices : words that the value may be; its entry is their number
    required : whether every joint must say; of a section all that has no default must be there with it
    meaning : a sentence, for the manual and for editors; the law's own if empty
    """

    name: str
    unit: str
    least: float = 0.0
    most: float | None = None
    above: bool = False
    both: bool = False
    per_area: bool = False
    per_gap: str = ""
    rigid: bool = False
    auto: bool = False
    default: Any = None
    choices: tuple[str, ...] = ()
    required: bool = False
    meaning: str = ""

    def entries(self, value: Any, area: float) -> tuple[float, ...]:
        """Its entries for a gap of this tributary area [m2]."""
        if self.unit == "axes":
            return tuple(float(axis in value) for axis in AXES)
        if self.choices:
            return (float(self.choices.index(value)),)
        if self.both:
            return tuple(value)
        if isinstance(value, Mapping):
            return (float(value["per_gap"]),)
        if value == "rigid":
            return (math.inf,)
        return (float(value) * area if self.per_area else float(value),)


class Law:
    """A joint law; subclass it, in romdam or in a file of one's own.

    Attributes
    ----------
    section : key that holds the parameters as a mapping; empty where they stand among the joint's own keys
    parameters : what the law adds to a joint
    memory : names of what a gap keeps from step to step
    shear : whether it lets a gap carry shear, so that the tangential directions are needed
    strength : whether what `release` gives up is strength, whose energy is lost with it
    follows_step : whether `limit` reads `step`
    array : the array of `romdam.core.system.GapLaw` that its one parameter is, where it has one of its own

    The functions of one gap take arrays: `parameters` as `row` makes them, `memory` in the order above, and
    `step`, the gap in the present solution of the step:

    OPENING : at its end, with the initial gap [m]
    NORMAL_FORCE : compression positive, below zero what a bond holds [N]
    SLIP_J, SLIP_K : what the gap slides in the step [m]
    RATE : the size of that over the length of the step; 0 at rest [m/s]
    DT : the length of the step; 0 at rest, and where the bounds of a stored state are asked for, which has
        neither slip nor rate: `memory` has to answer then [s]
    PULLED, SLIDING : 1 where the gap opens against all its tension, and where it is on its shear limit

    limit(parameters, memory, step, limit) : put entries TENSION, COHESION_J, COHESION_K, MU_J, MU_K, WATER of
        `limit`; bounds below zero count as zero
    release(parameters, memory, step) : whether something was given up, noted in `memory` (a step that gives
        up more often than the memory has entries does not converge)
    commit(parameters, memory, step) : move the memory. Without it what `release` noted stays.

    Of the memory two names mean something to the energy ledger: "stored", what the gap can give back besides
    its springs, and "dissipated", what its normal force has lost since the start [J].
    """

    section: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    memory: ClassVar[tuple[str, ...]] = ()
    shear: ClassVar[bool] = False
    strength: ClassVar[bool] = True
    follows_step: ClassVar[bool] = False
    array: ClassVar[str] = ""

    limit: ClassVar[Callable[..., None] | None] = None
    release: ClassVar[Callable[..., bool] | None] = None
    commit: ClassVar[Callable[..., None] | None] = None

    @classmethod
    def key_names(cls) -> tuple[str, ...]:
        """Keys that the law adds to a joint."""
        return (cls.section,) if cls.section else tuple(parameter.name for parameter in cls.parameters)

    @classmethod
    def values(cls, joint: Mapping[str, Any]) -> Mapping[str, Any]:
        """Its parameters by name, out of a joint's keys; empty where the joint has no such section."""
        if cls.section:
            return joint[cls.section] or {}
        return {parameter.name: joint[parameter.name] for parameter in cls.parameters}

    @classmethod
    def is_on(cls, joint: Mapping[str, Any]) -> bool:
        """Tell whether a joint has the law: its section is there, or one of its keys is not zero."""
        values = cls.values(joint)
        if cls.section:
            return bool(values)
        return any(any(v) if isinstance(v, tuple | list) else v not in (None, 0.0) for v in values.values())

    @classmethod
    def needs_shear(cls, joint: Mapping[str, Any]) -> bool:
        """Tell whether a joint that has the law needs the tangential directions."""
        return cls.shear

    @classmethod
    def wrong(cls, joint: Mapping[str, Any]) -> str | None:
        """Say what does not fit together in a joint that has the law, and the remedy; None if all does.

        Parameters
        ----------
        joint : every key of every law, a section as a mapping [SI]
        """
        return None

    @classmethod
    def row(cls, joint: Mapping[str, Any], area: float) -> tuple[float, ...]:
        """Row that the functions get as `parameters`, for a gap of this tributary area [m2]."""
        values = cls.values(joint)
        return tuple(entry for p in cls.parameters for entry in p.entries(values[p.name], area))

    @classmethod
    def initial(cls, parameters: Row, gap: float) -> tuple[float, ...]:
        """Memory of an unloaded gap with an initial gap [m]: zeros unless a law says otherwise."""
        return (0.0,) * len(cls.memory)

    @classmethod
    def resumed(cls, parameters: Row, past: Past) -> tuple[float, ...]:
        """Memory of a gap that goes on from a stored state; as at the start unless a law says otherwise."""
        return cls.initial(parameters, past.gap)


class Past(NamedTuple):
    """A gap where a run goes on from a stored row, as far as the row knows it.

    Attributes
    ----------
    gap, opening : initial gap, and opening with it now [m]
    sliding : whether it slides now
    has_moved : whether a row so far, the unloaded start aside, shows it open or sliding
    rate : speed of its slip [m/s]
    widest : largest opening of a row so far [m]
    path : length of all slip so far, as the rows show it [m]
    """

    gap: float
    opening: float
    sliding: bool
    has_moved: bool
    rate: float
    widest: float = 0.0
    path: float = 0.0
