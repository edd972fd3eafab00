"""How often a mesh is refined, and what that makes of numbers of elements."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Self

from pydantic import Field

from romdam.config.base import Model
from romdam.config.quantities import Dimensionless, Whole

MOST_DIVISIONS = 200
Count = Annotated[Whole, Field(ge=1, le=MOST_DIVISIONS)]
Refinements = Annotated[Whole, Field(ge=0, le=3)]
Counts = int | tuple[int, ...]  # elements in a direction, or in each of several intervals one after the other


def every_count(counts: Counts, change: Callable[[int], int]) -> Counts:
    """Change a number of elements, or that of each interval."""
    return tuple(map(change, counts)) if isinstance(counts, tuple) else change(counts)


def in_all(counts: Counts) -> int:
    """Elements of all intervals together."""
    return sum(counts) if isinstance(counts, tuple) else counts


class Divisions(Model):
    """Numbers of elements of a dam, and the growth of layers in its rock."""

    growth: Annotated[Dimensionless, Field(ge=1.0, le=5.0)] = 1.6
    """Ratio of neighbouring sizes in the rock."""
    halved: Annotated[Whole, Field(ge=0, le=MOST_DIVISIONS)] = 0
    """Number of layers, and of rows, of rock next to the dam that are halved; all where there are fewer."""
    refine: Refinements = 0
    """Number of times that all elements are halved along every edge."""

    def refuse_halved(self, *, rock: bool) -> None:
        """Raise for layers of rock that are to be halved and are not there.

        Parameters
        ----------
        rock : whether the dam has some
        """
        if not self.halved:
            return
        if not rock:
            raise ValueError("`divisions.halved` halves layers of `rock`, and there is none; leave it out")
        of_dam = ("along", "through", "up", "perimeter")
        most = max(in_all(counts) for name, counts in self.counts.items() if name not in of_dam)
        if self.halved > most:
            raise ValueError(
                f"`divisions.halved` is {self.halved}, and no layers or rows of rock are more than {most}; "
                f"give at most {most}"
            )

    @property
    def parts(self) -> int:
        """Elements in the place of one, along an edge."""
        return int(2**self.refine)

    @property
    def counts(self) -> dict[str, Counts]:
        """Name -> number of elements before refinement."""
        return self.model_dump(exclude={"growth", "halved", "refine"})

    @property
    def refined(self) -> Self:
        """The same with all numbers as they are after refinement, which layers that grow follow too.

        Layers in the ratio g become twice as many in the ratio of its root, every other at the same place.
        """
        changed: dict[str, object] = {
            name: every_count(count, lambda n: n * self.parts) for name, count in self.counts.items()
        }
        changed |= {"growth": self.growth ** (1.0 / self.parts), "halved": self.halved * self.parts}
        changed["refine"] = 0
        return self.model_copy(update=changed)
