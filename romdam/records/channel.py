"""One recorded channel with what its file says about it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.motions.records import LONGEST_DT, SHORTEST_DT
from romdam.core.errors import RecordError

MIN_SAMPLES = 3  # two steps
SENTINELS = (  # of missing values
    999.0, 999.9, 999.99, 999.999, 9999.0, 9999.9, 9999.99, 9999.999, 99999.0, 99999.9, 999999.0,
    12345.0, 32768.0,
)  # fmt: skip
BREAKING = (  # what arithmetic and parsing raise on damaged data
    ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RecursionError, TypeError, ValueError,
)  # fmt: skip
# N, E, S, W, their words and PEER's abbreviations in names of files: ANLCSOU.AT2 has the component SOUTH,
# PBFEAS.AT2 has EAST. Each names where positive motion points.
_DIRECTIONS = {
    "N": 0.0, "NORTH": 0.0, "NOR": 0.0, "E": 90.0, "EAST": 90.0, "EAS": 90.0,
    "S": 180.0, "SOUTH": 180.0, "SOU": 180.0, "W": 270.0, "WEST": 270.0, "WES": 270.0,
}  # fmt: skip
# A pair of letters names an axis whose positive sense is north or east, in whichever order it is written.
# NIED, "About K-NET ASCII format": N-S is positive to the north, E-W to the east. ITACA and ISESD have NS and
# WE; INGV's converter of their files (`obspy_dyna`) turns these into HNN and HNE. PEER has both (GCN-WE.AT2).
_PAIRS = {"NS": 0.0, "SN": 0.0, "EW": 90.0, "WE": 90.0}
_UP = {"UP", "UD", "U", "Z", "V", "VERT", "VERTICAL", "VRT", "VER"}
_DOWN = {"DOWN", "DWN", "DN", "D"}
# SEED manual 2.4, appendix A: a band, an instrument of ground motion, then N, E or Z. W is an axis of a
# Galperin triple there, not west; 1, 2 and 3 are orthogonal axes of any azimuth.
_SEED = re.compile(r"[FGDCESHBMLV][HLGMNP]([NEZ])")
# A bare number is an azimuth from two digits on, as agencies print it (90, 090, 360), and 0; 1 to 9 count
# channels.
_AZIMUTH = re.compile(r"0|\d{2,3}(\.\d+)?")


class NoAccelerationError(RecordError):
    """A file is no record of acceleration: a text, a picture, a velocity, a displacement, a spectrum."""


class UnknownFormatError(RecordError):
    """No reader knows the format of a file."""


@dataclass(frozen=True)
class Orientation:
    """Direction of positive motion.

    Attributes
    ----------
    azimuth : degrees clockwise from north; None for a vertical channel
    vertical : +1 up, -1 down, 0 horizontal
    """

    azimuth: float | None
    vertical: int = 0

    def __str__(self) -> str:
        """As messages name it."""
        upright = "up" if self.vertical > 0 else "down"
        return upright if self.azimuth is None else f"{self.azimuth:g} degrees"


@dataclass(frozen=True)
class Channel:
    """One component of one record.

    Attributes
    ----------
    code : channel code ("HNE", "009", "EW", or the column number of plain text)
    data : (nt,) acceleration in `unit`
    dt : sampling interval [s]
    unit : unit of the values, "" where the file does not say
    orientation : None where the file does not say
    start : time of the first sample, ISO 8601 UTC, "" unknown
    meta : format, station, network, event, filter corners and the like; plain JSON values
    warnings : what was odd in its file, one sentence each
    """

    code: str
    data: NDArray[np.float64]
    dt: float
    unit: str = ""
    orientation: Orientation | None = None
    start: str = ""
    meta: dict[str, object] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def parse_orientation(text: str) -> Orientation | None:
    """Read an orientation from a component code: "090", "90 deg", "N35E", "WE", "NORTH", "HNZ", "UP".

    A three-letter SEED code counts by its last letter; 1, 2, 3, L, R and T say nothing.
    """
    word = re.sub(r"[\s-]|°", "", text.strip().upper())
    if word in _UP or word in _DOWN:
        return Orientation(None, 1 if word in _UP else -1)
    if match := re.fullmatch(r"(\d{1,3}(?:\.\d+)?)DEG(?:REES?)?", word):
        return Orientation(float(match[1]) % 360.0) if float(match[1]) <= 360.0 else None
    if _AZIMUTH.fullmatch(word) and float(word) <= 360.0:
        return Orientation(float(word) % 360.0)
    if match := re.fullmatch(r"([NS])(\d{1,2}(?:\.\d+)?)([EW])", word):
        origin, angle = (0.0 if match[1] == "N" else 180.0), float(match[2])
        clockwise = (match[1] == "N") == (match[3] == "E")
        return Orientation((origin + (angle if clockwise else -angle)) % 360.0) if angle <= 90.0 else None
    stem = re.sub(r"[12]$", "", word)  # KiK-net: EW1 down the hole, EW2 at the surface
    if stem in _PAIRS:
        return Orientation(_PAIRS[stem])
    if stem == "UD":
        return Orientation(None, 1)
    if word in _DIRECTIONS:
        return Orientation(_DIRECTIONS[word])
    if match := _SEED.fullmatch(word):
        return Orientation(None, 1) if match[1] == "Z" else Orientation(_DIRECTIONS[match[1]])
    return None


def check_channel(channel: Channel, where: str) -> None:
    """Refuse a channel that no analysis can use.

    Raises
    ------
    RecordError
        for a dt that is not positive, fewer than three samples, NaN or infinity.
    """
    location = f"{where}, channel {channel.code}"
    if not SHORTEST_DT <= channel.dt <= LONGEST_DT:
        raise RecordError(
            f"{location}: dt must lie in [{SHORTEST_DT:g}, {LONGEST_DT:g}] s, got {channel.dt:g} s; is it in "
            "milliseconds, or the file damaged?"
        )
    if channel.data.size < MIN_SAMPLES:
        raise RecordError(
            f"{location}: {channel.data.size} samples, at least {MIN_SAMPLES} (two steps) are needed; "
            "the file is empty or cut short"
        )
    bad = np.flatnonzero(missing(channel.data))
    if bad.size:
        value = channel.data[bad[0]]
        what = f"{value:g}, as where a value is missing" if np.isfinite(value) else "not finite"
        raise RecordError(
            f"{location}: {bad.size} of {channel.data.size} samples are {what}, the first at "
            f"t = {bad[0] * channel.dt:g} s; mend the record or set `gaps: linear` or `gaps: zero`"
        )


def missing(data: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find samples that are NaN, infinite, or a mark of no value (-999, 9999.999) far above all others."""
    mask = ~np.isfinite(data)
    marks = np.isin(np.abs(data), SENTINELS) | (np.abs(np.where(mask, 0.0, data)) >= 1e20)
    if marks.any():
        rest = np.abs(data[~mask & ~marks])
        if rest.size == 0 or np.max(rest) < 0.5 * np.min(np.abs(data[marks])):
            mask |= marks
    return mask


@contextmanager
def one_record(location: str) -> Iterator[None]:
    """Make what damaged data raise anywhere within an error of this record.

    Raises
    ------
    RecordError
    """
    try:
        yield
    except BREAKING as error:
        reason = " ".join(str(error).split())[:200]
        raise RecordError(
            f"{location}: cannot be used ({type(error).__name__}: {reason}); the file is damaged"
        ) from error
