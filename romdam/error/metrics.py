"""The measures of error: one L2 and one peak, over all places and joint by joint.

x(t, i) is the history that is judged and y(t, i) the better one, at the same equally spaced times t and the
same places i (gaps, or components of displacement). Both measures are relative to y, without unit:

    L2          sqrt(sum_ti (x - y)^2) / sqrt(sum_ti y^2)
    peak        |max_ti |x| - max_ti |y|| / max_ti |y|
    peak of     |max_ti x - max_ti y| / max_ti y, of openings, since how far a joint opens is what is asked;
    openings    over max_ti |y| where no gap opens
    peaks       the peak's, or if it is larger the root mean square over i of what max_t |x_i| and
                max_t |y_i| (of openings max_t x_i and max_t y_i) differ by, relative to that of the latter:
                two meshes whose largest value agrees by chance have others that do not
    bound of    max |x - y| / max_ti y, over the times and gaps at which x or y is within NEAR of the largest
    the peak    opening: two peaks may agree by chance, or lie at other instants; this is never less

What is compared moves: callers take the values at rest (the first row) from both, so that an initial gap or
the weight's own displacement makes no error small. Each is 0 where y is 0 throughout. A joint's error is
measured on its own gaps alone and relative to its own history; but a joint that hardly moves, by less than
FLOOR of all, is measured by FLOOR of all: in L2 by that share of the root mean square over all joints' gaps,
in its peak by that share of the largest opening of all. So is a component of a node's displacement, by FLOOR
of that node's largest component.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from romdam.core.arrays import Floats

Peak = Literal["largest", "of places", "bound"]  # measures of the peak of openings, see the module
NEAR = 0.2  # of the largest opening: what lies so near to it is looked at where a peak is bounded
_STILL = 1e-6  # of a history's largest value: what moves less is round-off
FLOOR = 0.01  # of what all joints do: a joint that does less is measured by that


@dataclass(frozen=True)
class RelativeError:
    """Error of one quantity relative to a better history of it, see the module.

    Attributes
    ----------
    l2, peak : over all times and places [1]
    joints : name of a joint -> error of its own gaps, or of an output node -> that of its motion; empty
        for what belongs to neither
    """

    l2: float
    peak: float
    joints: Mapping[str, RelativeError] = field(default_factory=dict)

    @property
    def plain(self) -> dict[str, object]:
        """Plain values, for JSON."""
        joints = {name: error.plain for name, error in self.joints.items()}
        return {"l2": self.l2, "peak": self.peak} | ({"joints": joints} if joints else {})


def from_rest(
    values: Floats, better: Floats, rest: Floats | None = None, *, each: bool = False
) -> tuple[Floats, Floats]:
    """Return histories (nt, ...) less their values at rest, so that an error is relative to what moves.

    Where nothing moves but by round-off they stay as they are.

    Parameters
    ----------
    rest : (...) of both; each one's first row if not given
    each : whether every place is looked at by itself, not all together
    """
    start, better_start = (values[0], better[0]) if rest is None else (rest, rest)
    axis = 0 if each else None
    moves = np.abs(better - better_start).max(axis=axis, initial=0.0)
    still = moves <= _STILL * np.abs(better).max(axis=axis, initial=0.0)
    return values - np.where(still, 0.0, start), better - np.where(still, 0.0, better_start)


def relative_l2(values: Floats, better: Floats, least: float = 0.0) -> float:
    """L2 of two histories (nt, ...) of one unit, relative to a root mean square of `least` or more."""
    size = max(float(np.linalg.norm(better)), least * np.sqrt(better.size))
    return float(np.linalg.norm(values - better)) / size if size > 0.0 else 0.0


def opening_peak(opening: Floats, better: Floats, least: float = 0.0) -> float:
    """Peak of openings (nt, ng) [m], relative to `least` or more, see the module."""
    return _over(float(opening.max() - better.max()), max(_largest(better), least))


def peak_bound(opening: Floats, better: Floats, least: float = 0.0) -> float:
    """Bound of what the peak of openings (nt, ng) [m] is off, relative to `least` or more, see the module."""
    largest = _largest(better)
    near = np.maximum(opening, better) >= better.max() - NEAR * largest
    return _over(float(np.abs(opening - better)[near].max()), max(largest, least))


def opening_peaks(opening: Floats, better: Floats, least: float = 0.0) -> float:
    """Peaks of openings (nt, ng) [m], relative to `least` or more, see the module."""
    of_places = relative_l2(opening.max(axis=0), better.max(axis=0), least)
    return max(opening_peak(opening, better, least), of_places)


def largest_difference(values: Floats, better: Floats, *, opens: bool = False) -> float:
    """max |x - y| / max |y|, wherever each is found; over max y where that `opens`."""
    size = _largest(better) if opens and better.size else float(np.abs(better).max(initial=0.0))
    return _over(float(np.abs(values - better).max(initial=0.0)), size)


def opening_error(
    opening: Floats,
    better: Floats,
    joints: Mapping[str, slice] | None = None,
    peak: Peak = "largest",
) -> RelativeError:
    """Compare openings.

    Parameters
    ----------
    opening, better : (nt, ng) [m]
    joints : name -> slice of its gaps
    peak : `opening_peak`, `opening_peaks` "of places", or the `peak_bound`
    """
    measure = {"largest": opening_peak, "of places": opening_peaks, "bound": peak_bound}[peak]
    mean = FLOOR * float(np.linalg.norm(better)) / np.sqrt(max(better.size, 1))
    least = FLOOR * _largest(better)

    def of_gaps(gaps: slice) -> RelativeError:
        pair = opening[:, gaps], better[:, gaps]
        return RelativeError(relative_l2(*pair, mean), measure(*pair, least))

    each = {name: of_gaps(gaps) for name, gaps in (joints or {}).items()}
    return replace(of_gaps(slice(None)), joints=each)


def magnitude_error(
    values: Floats, better: Floats, scale: Floats | None = None, *, peaks: bool = False
) -> RelativeError:
    """Compare histories whose sign says only where to.

    Parameters
    ----------
    values, better : (nt, ...) [m]
    scale : (nt, nc) [m] what the same node does in every direction, if the histories are one of them
    peaks : whether the peak is that of all places, see the module
    """
    largest, peak = (float(np.abs(history).max(initial=0.0)) for history in (values, better))
    mean = least = 0.0
    if scale is not None:
        mean = FLOOR * float(np.linalg.norm(scale, axis=0).max()) / np.sqrt(len(scale))
        least = FLOOR * float(np.abs(scale).max())
    off = _over(largest - peak, max(peak, least))
    if peaks:
        off = max(off, relative_l2(np.abs(values).max(axis=0), np.abs(better).max(axis=0), least))
    return RelativeError(relative_l2(values, better, mean), off)


def combined(errors: Sequence[RelativeError], combine: Callable[[list[float]], float]) -> RelativeError:
    """Several errors of a quantity in one, such as their sum; joint by joint too."""
    names = dict.fromkeys(name for error in errors for name in error.joints)
    joints = {
        name: combined([error.joints[name] for error in errors if name in error.joints], combine)
        for name in names
    }
    l2, peak = (combine([getattr(error, norm) for error in errors]) for norm in ("l2", "peak"))
    return RelativeError(l2, peak, joints)


def scaled(error: RelativeError, factor: float) -> RelativeError:
    """A multiple of an error, that of each joint too."""
    return combined([error], lambda values: factor * values[0])


def energy_error(difference: Floats, better: Floats) -> RelativeError:
    """Error in the norm of an energy.

    Parameters
    ----------
    difference : (nt,) energy of the difference of two motions [J]; `peak` is that of its largest
    better : (nt,) energy of the better motion [J]
    """
    whole, largest = float(better.sum()), float(better.max(initial=0.0))
    if whole == 0.0:
        return RelativeError(0.0, 0.0)
    l2, peak = difference.sum(), difference.max(initial=0.0)
    return RelativeError(float(np.sqrt(l2) / np.sqrt(whole)), float(np.sqrt(peak) / np.sqrt(largest)))


def _largest(opening: Floats) -> float:
    """The largest opening, or the largest jump where no gap opens [m]."""
    peak = float(opening.max())
    return peak if peak > 0.0 else float(np.abs(opening).max())


def _over(difference: float, size: float) -> float:
    return abs(difference) / size if size > 0.0 else 0.0
