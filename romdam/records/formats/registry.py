"""Every record format romdam knows: one entry here, and one entry point in pyproject.toml for ObsPy."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, NoAccelerationError, UnknownFormatError
from romdam.records.formats.at2 import is_at2, read_at2, write_at2
from romdam.records.formats.columns import Layout, first_row, is_columns, read_columns
from romdam.records.formats.cosmos import is_cosmos, read_cosmos, write_cosmos
from romdam.records.formats.csmip import is_csmip, read_csmip
from romdam.records.formats.esm import is_esm, read_esm, write_esm
from romdam.records.formats.geonet import is_geonet, read_geonet
from romdam.records.formats.knet import is_knet, read_knet
from romdam.records.formats.smc import is_smc, read_smc, write_smc
from romdam.records.formats.statements import statements, unit_stated
from romdam.records.formats.text import decode, read_bytes

HEAD = 20_000  # bytes; CSMIP announces its data behind three or four thousand bytes of header
READ = (
    "PEER AT2, COSMOS, CSMIP V1 and V2, GeoNet V1A and V2A, SMC, ESM and ITACA (DYNA), K-NET and KiK-net, "
    "miniSEED, SAC and others by ObsPy, plain columns"
)
_FOREIGN_LINES = 24  # lines at the start of a file
# files that are not read: how one of their first lines starts as agencies print it, what they are, the remedy
_FOREIGN: tuple[tuple[str, str, str], ...] = (
    (
        r"response and fourier amplitude spectra",
        "CSMIP V3: response and Fourier spectra",
        "take the corrected accelerogram, V2",
    ),
    (
        r"archivo estandar de aceleracion",
        "a standard acceleration file of UNAM (ASA 2.0)",
        "its last rows are columns in gal: declare `header_lines: 109`, `dt` (1 / VEL. DE MUESTREO), "
        "`unit: cm/s2` and `azimuths` or `components` as the line above the rows names the channels",
    ),
    (
        r"\* vol1ds file",
        "an uncorrected record of BHRC (ISMN, Iran), in g/10",
        "cut the rows of one component out and declare `layout: series`, `dt` (DURATION / NO. OF POINTS) and "
        "`unit: 0.1 g`",
    ),
    (
        r"(corrected accelerogram .*corresponding to|file\s+\d+ of uncorrected accelerogram data of volume)",
        "a Volume I or II file of USC or CIT",
        "take the same record from CESMD or PEER",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Declared:
    """Properties of a file that the configuration states because the file does not.

    Attributes
    ----------
    dt : sampling interval [s] of plain columns
    time_column : column of sample times, from 1
    response : StationXML file with the instrument's response
    unit : of the values of plain columns, which counts where prose in a comment says another
    layout : how the numbers of plain columns stand in the file; None where nothing is said
    """

    dt: float | None = None
    time_column: int | None = None
    response: Path | None = None
    unit: str | None = None
    layout: Layout | None = None


@dataclass(frozen=True)
class Format:
    """One text format: recognised, read and written.

    Attributes
    ----------
    matches : whether the start of a file is of this format
    read : all acceleration channels of a file
    write : channels to a file; None where romdam only reads
    many : whether one file can hold several channels
    """

    matches: Callable[[str], bool]
    read: Callable[[Path], list[Channel]]
    write: Callable[[list[Channel], Path], None] | None = None
    many: bool = False


def _one(write: Callable[[Channel, Path], None]) -> Callable[[list[Channel], Path], None]:
    return lambda channels, path: write(channels[0], path)


def read_channels(path: Path, declared: Declared | None = None) -> list[Channel]:
    """Read all acceleration channels of a record file of any known format.

    Parameters
    ----------
    path : the file
    declared : what only the user knows

    Raises
    ------
    RecordError
        naming the file and, for text, the line.
    """
    declared = declared or Declared()
    head = decode(read_bytes(path, HEAD))
    for known in FORMATS.values():
        if known.matches(head):
            return known.read(path)
    if is_columns(head) or declared.layout is not None:
        return read_columns(path, declared.dt, declared.time_column, declared.unit, declared.layout)
    for line in head.splitlines()[:_FOREIGN_LINES]:
        for pattern, name, remedy in _FOREIGN:
            if re.match(r"\s*" + pattern, line, re.IGNORECASE):
                raise NoAccelerationError(f"{path}: line 1: the file is {name}; {remedy}")
    from romdam.records.obspy_bridge import read_with_obspy  # here: ObsPy is slow to load

    try:
        return read_with_obspy(path, declared.response)
    except UnknownFormatError:
        row = first_row(head)
    says_something = row and any(statements(line) or unit_stated(line)[0] for line in head.splitlines()[:row])
    if row and says_something and (channels := _of_its_header(path, declared, row)):
        return channels
    if row is None:
        raise NoAccelerationError(f"{path}: line 1: not a record of any known format; romdam reads {READ}")
    raise RecordError(
        f"{path}: line 1: not a record of any known format, but rows of numbers begin in line {row + 1}: "
        f"declare `header_lines: {row}` if these are its samples; romdam reads {READ}"
    )


def _of_its_header(path: Path, declared: Declared, row: int) -> list[Channel]:
    """The channels of a text whose header states interval and unit, as AFAD's and CSMNC's do; else none."""
    layout = Layout(header_lines=row)
    try:
        channels = read_columns(path, declared.dt, declared.time_column, declared.unit, layout)
    except NoAccelerationError:
        raise
    except RecordError as error:
        if error.key == "dt" or "layout" in str(error):  # it does not say so much of itself
            return []
        raise
    return channels if channels[0].unit or declared.unit else []


FORMATS: dict[str, Format] = {
    "AT2": Format(is_at2, read_at2, _one(write_at2)),
    "COSMOS": Format(is_cosmos, read_cosmos, write_cosmos, many=True),
    "CSMIP": Format(is_csmip, read_csmip, None, many=True),
    "SMC": Format(is_smc, read_smc, _one(write_smc)),
    "ESM": Format(is_esm, read_esm, _one(write_esm)),
    "GEONET": Format(is_geonet, read_geonet, None, many=True),
    "KNET": Format(is_knet, read_knet),  # ObsPy has a plugin of its own
}
