"""The quantities that a run records: each is declared here, once.

From a field of `GapQuantities` follow the array of the time loops' state (`GapArrays`), the rows of the
histories, the field of `History`, how merged gaps are expanded to all gaps, the variables of a result file
and the columns of a suite's summary. The values are those of a step: `romdam.contact.step.commit_gaps` moves
a state's `GapArrays`.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Bools, Floats

# how the value of a gap follows from that of the merged gap that stands for it, and for others like it
Expansion = Literal["equal", "jump", "force", "share"]


@dataclass(frozen=True)
class Written:
    """A variable of a result file that holds a quantity, or a component of it.

    Attributes
    ----------
    name : of the variable
    long_name : what it is, with its sign
    part : component of a jump or a force; "" for all of the quantity
    sign : factor of the values, 1 or -1
    when : whether a history has it; None for wherever its components exist
    total : whether a suite's summary has its sum over the gaps of each joint at the end of the run
    """

    name: str
    long_name: str
    part: Literal["", "normal", "tangential"] = ""
    sign: int = 1
    when: Callable[[Any], bool] | None = None
    total: bool = False


@dataclass(frozen=True)
class Quantity:
    """A quantity that is recorded of every gap.

    Attributes
    ----------
    title : what it is, in messages
    unit : SI unit, as UDUNITS writes it
    expansion : of merged gaps. "equal": the same at every gap; "jump": with the sign of each direction;
        "force": that, and an equal share of what all of them carry; "share": such a share of a number
    axis : "direction" for a component along each of the gap's directions (i, or i, j, k), "tangent" for one
        along j and k each, "" for one number
    written : the variables of a result file
    dtype : of its values
    moved : whether steps move it; else it follows from the rows, after the run
    adds_up : whether steps add to it, so that it is zero where a run begins
    """

    title: str
    unit: str
    expansion: Expansion
    axis: Literal["", "direction", "tangent"] = ""
    written: tuple[Written, ...] = ()
    dtype: type = float
    moved: bool = True
    adds_up: bool = False


def _dissipates(history: Any) -> bool:
    energy = history.dissipated_energy
    return energy.size > 0 and bool(energy.any() or history.jump.shape[-1] > 1)


@dataclass(frozen=True, kw_only=True)
class GapQuantities:
    """Every quantity that is recorded of the gaps, (nt, ng, ...); empty where an integrator has it not.

    Attributes
    ----------
    jump : (nt, ng, d) opening (with the initial gap) and slip of every gap, at its very position [m]
    traction : (nt, ng, d) joint force on side J, compression positive, shear along j and k [N]
    mean_traction : (nt, ng, d) its mean, with that of `water`, over the interval that ends at each time;
        zero at the first [N]
    water : (nt, ng) force of the water that entered gaps as they opened [N]
    state : (nt, ng) OPEN, STICK or SLIP of `romdam.core.system` (a frictionless closed gap is STICK)
    dissipated_energy : (nt, ng) energy that the gap has taken since the start: work of friction, and all that
        the force of a gap with a dashpot, or of one that loses strength, does not give back [J]
    strength : (nt, ng, 2) shear along j and k that the laws let the gaps carry now, inf where nothing bounds
        it [N]; empty without shear
    bonded : (nt, ng) whether a gap has any of it without compression; empty without shear
    """

    jump: Annotated[
        Floats,
        Quantity(
            "jump",
            "m",
            "jump",
            "direction",
            (
                Written("opening", "joint opening, open positive", "normal"),
                Written("slip", "tangential displacement of block J relative to block I", "tangential"),
            ),
        ),
    ]
    traction: Annotated[
        Floats,
        Quantity(
            "joint force",
            "N",
            "force",
            "direction",
            (
                Written(
                    "normal_force",
                    "normal force of the gap, compression negative; the effective one where there is water",
                    "normal",
                    sign=-1,
                ),
                Written("shear_force", "shear force of the gap on block J", "tangential"),
            ),
        ),
    ]
    mean_traction: Annotated[
        Floats,
        Quantity(
            "mean joint force",
            "N",
            "force",
            "direction",
            (
                Written(
                    "mean_normal_force",
                    "mean normal force, with crack_water_force, over the writing interval that ends at the "
                    "time, compression negative",
                    "normal",
                    sign=-1,
                ),
                Written(
                    "mean_shear_force",
                    "mean shear force on block J over the writing interval that ends at the time",
                    "tangential",
                ),
            ),
            adds_up=True,
        ),
    ]
    water: Annotated[
        Floats,
        Quantity(
            "force of the water",
            "N",
            "share",
            written=(
                Written(
                    "crack_water_force",
                    "force of the water that entered the gap as it opened, or was lost (negative), besides "
                    "that of water_pressure",
                    when=lambda history: bool(history.water.any()),
                ),
            ),
        ),
    ] = field(default_factory=lambda: np.zeros((0, 0)))
    state: Annotated[
        NDArray[np.uint8],
        Quantity(
            "state",
            "1",
            "equal",
            written=(Written("joint_state", "state of the gap (closed without friction is stick)"),),
            dtype=np.uint8,
        ),
    ]
    dissipated_energy: Annotated[
        Floats,
        Quantity(
            "dissipated energy",
            "J",
            "share",
            written=(
                Written(
                    "dissipated_energy",
                    "energy dissipated in the gap since the start: by sliding, dashpots and lost strength",
                    when=_dissipates,
                    total=True,
                ),
            ),
            adds_up=True,
        ),
    ] = field(default_factory=lambda: np.zeros((0, 0)))
    strength: Annotated[Floats, Quantity("shear strength", "N", "share", "tangent", moved=False)] = field(
        default_factory=lambda: np.zeros((0, 0, 2))
    )
    bonded: Annotated[Bools, Quantity("bond", "1", "equal", dtype=np.bool_, moved=False)] = field(
        default_factory=lambda: np.zeros((0, 0), dtype=np.bool_)
    )


GAP_QUANTITIES: dict[str, Quantity] = {
    name: hint.__metadata__[0] for name, hint in get_type_hints(GapQuantities, include_extras=True).items()
}

if TYPE_CHECKING:

    class GapArrays(GapQuantities):
        """The quantities that the time loops move, as arrays that kernels can take: (..., ng, ...)."""

else:
    GapArrays = namedtuple("GapArrays", [name for name, of in GAP_QUANTITIES.items() if of.moved])


def new_gap_arrays(n: int, d: int) -> GapArrays:
    """Zeros for n gaps of d directions."""
    shapes = {"": (n,), "direction": (n, d), "tangent": (n, 2)}
    arrays: dict[str, Any] = {
        name: np.zeros(shapes[of.axis], of.dtype) for name, of in GAP_QUANTITIES.items() if of.moved
    }
    return GapArrays(**arrays)


def gap_fields(arrays: GapArrays) -> dict[str, Any]:
    """Its arrays by name: fields of `GapQuantities`."""
    return {name: getattr(arrays, name) for name, of in GAP_QUANTITIES.items() if of.moved}


# largest values of every gap over every step, not only the written ones
PEAK_QUANTITIES: dict[str, Quantity] = {
    "opening": Quantity(
        "opening",
        "m",
        "equal",
        written=(Written("gap_peak_opening", "largest opening of the gap over all steps"),),
    ),
    "opening_time": Quantity("time of the largest opening", "s", "equal"),
    "compression": Quantity(
        "compression",
        "N",
        "share",
        written=(
            Written(
                "gap_peak_compression",
                "largest compressive force of the gap over all steps, compression negative",
                sign=-1,
            ),
        ),
    ),
    "slip": Quantity("slip", "m", "equal"),
}
