"""The `combinations:` of a configuration: situations that a dam is judged in, with what each requires."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.names import Name, same_file
from romdam.config.quantities import Dimensionless, Length, Pressure
from romdam.core.errors import listed, quote

Positive = Field(gt=0.0)


class CombinationConfig(Model):
    """A load combination, and what is required in it.

    At `rest` the static loads act. In an `earthquake` the records do, beside them. `after` one, the dam is at
    rest again with what its joints remember. `romdam combinations` runs them and states every margin.
    """

    situation: Literal["rest", "earthquake", "after"] = "rest"
    """Static loads at rest, the earthquakes of `records`, or rest after them."""
    after: str | None = None
    """Combination of the earthquake after which it is; that of the situation `after`."""
    changes: dict[str, Any] = Field(default_factory=dict)
    """Dotted path -> value of what is other than in the job, such as loads.hydrostatic.0.level: 101 m,
    loads.joint_water.0.drains: null, joints.base.friction: 0.7."""
    required_factor: Annotated[Dimensionless, Positive] | None = None
    """Least factor of safety of each joint against sliding; in an earthquake at every written row."""
    largest_slip: Annotated[Length, Positive] | None = None
    """Largest slip that an earthquake may leave at any gap."""
    tension: Annotated[Pressure, Positive] | None = None
    """Major principal stress that 98 % of the area of every face of `outputs.stress` must not exceed."""
    joints: Annotated[tuple[Name, ...], Field(min_length=1)] | None = None
    """Joints that are judged; all that carry shear if not given."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.situation == "after") != (self.after is not None):
            raise ValueError("`after` names the earthquake's combination, and goes with `situation: after`")
        if self.required_factor is None and self.largest_slip is None and self.tension is None:
            raise ValueError(
                "requires nothing; give `required_factor`, `tension`, or in an earthquake `largest_slip`"
            )
        if self.largest_slip is not None and self.situation != "earthquake":
            raise ValueError("`largest_slip` is of what an earthquake leaves; give situation: earthquake")
        return self


def refuse_wrong_combinations(combinations: Mapping[str, CombinationConfig]) -> None:
    """Refuse an `after` of what is no earthquake, and names of one folder.

    Raises
    ------
    ValueError
        with the key.
    """
    first: dict[str, str] = {}
    for name in combinations:
        other = first.setdefault(same_file(name), name)
        if other != name:
            raise ValueError(f"combinations: {quote(name)} and {quote(other)} are one folder; rename one")
    earthquakes = [name for name, one in combinations.items() if one.situation == "earthquake"]
    for name, one in combinations.items():
        if one.after is not None and one.after not in earthquakes:
            known = f"those are {listed(earthquakes)}" if earthquakes else "there is none"
            raise ValueError(
                f"combinations.{name}.after: {quote(one.after)} is no combination of situation: earthquake; "
                f"{known}"
            )
