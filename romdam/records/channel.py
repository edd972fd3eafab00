"""One recorded channel, in SI, with what its file says about it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from romdam.errors import RecordError

MIN_SAMPLES = 3  # two steps


@dataclass(frozen=True)
class Channel:
    """One component of one record.

    Attributes
    ----------
    code : channel code ("HNE", "009", "EW", or the column number of plain text)
    data : (nt,) values in `unit`
    dt : sampling interval [s]
    unit : unit of the values, or "" where the file does not say
    azimuth : degrees clockwise from north of positive motion; None where unknown or vertical
    vertical : +1 up, -1 down, 0 horizontal, None unknown
    start : time of the first sample, ISO 8601, "" unknown
    meta : station, network, event, filter corners and the like; plain JSON values
    """

    code: str
    data: NDArray[np.float64]
    dt: float
    unit: str = ""
    azimuth: float | None = None
    vertical: int | None = None
    start: str = ""
    meta: dict[str, object] = field(default_factory=dict)

    def with_data(self, data: NDArray[np.float64], unit: str) -> Channel:
        """Return this channel with other values."""
        return replace(self, data=data, unit=unit)


def check_channel(channel: Channel, where: str) -> None:
    """Refuse a channel that no analysis can use.

    Raises
    ------
    RecordError
        for a dt that is not positive, fewer than three samples, NaN or infinity.
    """
    place = f"{where}, channel {channel.code}"
    if not (np.isfinite(channel.dt) and channel.dt > 0.0):
        raise RecordError(
            f"{place}: dt must be positive and finite, got {channel.dt:g} s; give `dt` in the configuration"
        )
    if channel.data.size < MIN_SAMPLES:
        raise RecordError(
            f"{place}: {channel.data.size} samples, at least {MIN_SAMPLES} (two steps) are needed; "
            "the file is empty or cut short"
        )
    bad = np.flatnonzero(~np.isfinite(channel.data))
    if bad.size:
        raise RecordError(
            f"{place}: {bad.size} of {channel.data.size} samples are not finite, the first at "
            f"t = {bad[0] * channel.dt:g} s; mend the record or set `gaps: linear` or `gaps: zero`"
        )
