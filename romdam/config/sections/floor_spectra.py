"""The `outputs.floor_spectra:` of a configuration: response spectra of places on the structure."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.names import Name
from romdam.config.quantities import Dimensionless, Frequency
from romdam.core.errors import quote

# last frequency [Hz] of each range of table 1 of US NRC Regulatory Guide 1.122 (1978), and its increment [Hz]
_RANGES = (
    (3.0, 0.1), (3.6, 0.15), (5.0, 0.2), (8.0, 0.25), (15.0, 0.5), (18.0, 1.0), (22.0, 2.0), (34.0, 3.0),
)  # fmt: skip
_FIRST = 0.2  # [Hz] of that table


def _guide_frequencies() -> tuple[float, ...]:
    """The 75 frequencies of Regulatory Guide 1.122, table 1 [Hz]."""
    values, last = [_FIRST], _FIRST
    for end, step in _RANGES:
        count = round((end - last) / step)
        values += [round(last + step * k, 6) for k in range(1, count + 1)]
        last = end
    return tuple(values)


GUIDE_FREQUENCIES = _guide_frequencies()


NodeNames = Annotated[tuple[str, ...], Field(min_length=1)]
Places = Annotated[dict[Name, NodeNames], Field(min_length=1)]


class FloorSpectraConfig(Model):
    """In-structure (floor) response spectra: absolute acceleration of oscillators on the structure.

    Each is of every time step of the run, along x, y and z. Without `places` every one of `outputs.nodes` is
    a place.
    """

    places: Places | None = None
    """Places by name, each a list of names of `outputs.nodes`; the largest ordinate of several counts."""
    dampings: Annotated[
        tuple[Annotated[Dimensionless, Field(ge=0.001, lt=1.0)], ...], Field(min_length=1)
    ] = (0.02, 0.05, 0.1)
    """Damping ratios of the oscillators, of critical damping."""
    frequencies: Annotated[tuple[Annotated[Frequency, Field(gt=0.0)], ...], Field(min_length=2)] = (
        GUIDE_FREQUENCIES
    )
    """Frequencies of the oscillators, rising; the 75 of US NRC Regulatory Guide 1.122, 0.2 to 34 Hz, if not
    given."""
    broadening: Annotated[Dimensionless, Field(gt=0.0, le=0.5)] | None = None
    """Share of its frequency by which every peak is broadened to either side too, commonly 15 %."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for key, unit in (("frequencies", " Hz"), ("dampings", "")):
            values = getattr(self, key)
            fall = np.flatnonzero(np.diff(values) <= 0.0)
            if len(fall):
                k = int(fall[0])
                raise ValueError(
                    f"`{key}` must rise, and number {k + 2}, {values[k + 1]:g}{unit}, follows "
                    f"{values[k]:g}{unit}; sort them, each once"
                )
        for name, nodes in (self.places or {}).items():
            double = next((node for node in nodes if nodes.count(node) > 1), None)
            if double is not None:
                raise ValueError(f"`places.{name}` names {quote(double)} twice; name it once")
        return self
