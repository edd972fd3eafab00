"""Files that romdam does not read, recognised by their first lines: what they are and what to take instead.

Each pattern stands at the start of a line among the first of the file, as the agencies print it.
"""

from __future__ import annotations

import re

READ = (
    "PEER AT2, COSMOS, CSMIP V1 and V2, GeoNet V1A and V2A, SMC, ESM and ITACA (DYNA), K-NET and KiK-net, "
    "miniSEED, SAC and others by ObsPy, plain columns"
)
_HEAD = 24  # lines
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
    (
        r"strong ground motion records of turk",
        "a text of AFAD (NSMN, Turkey), three columns in gal",
        "declare `header_lines: 18`, `dt` (SAMPLING INTERVAL) and `unit: cm/s2`, with `components: {x: 2, "
        "y: 1, z: 3}` for E-W, N-S and U-D",
    ),
)  # fmt: skip


def recognise(head: str) -> str:
    """What a file is that romdam does not read, and what to take instead; "" for what is not known."""
    for line in head.splitlines()[:_HEAD]:
        for pattern, name, remedy in _FOREIGN:
            if re.match(r"\s*" + pattern, line, re.IGNORECASE):
                return f"the file is {name}; {remedy}"
    return ""
