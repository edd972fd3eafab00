"""Record files of old and foreign kinds, made after the agencies' layouts from one motion in m/s2."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import samples

G = 9.80665
Array = np.ndarray


def rows(values: Array, per_row: int, form: str) -> list[str]:
    return ["".join(format(v, form) for v in values[i : i + per_row]) for i in range(0, values.size, per_row)]


def text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def csmip_v1(values: Array) -> str:
    """CSMIP V1 of a digital recorder, two channels, values in g with six decimals."""
    lines: list[str] = []
    for number, name, factor in ((1, "90 Deg", 1.0), (2, "Up", 0.5)):
        data = factor * values / G
        lines += _csmip_header("Uncorrected Accelerogram Data", number, name, data, samples.DT * data.size)
        lines += [f"{data.size:6d} Accelerogram points at 200 pts/sec in units of g .      Format: (8f9.6)"]
        lines += rows(data, 8, "9.6f")
        lines += [f"/&  ----------  End of Data for Channel  {number}  ----------"]
    return text(lines)


def _csmip_header(first: str, number: int, name: str, data: Array, length: float) -> list[str]:
    peak = data[np.argmax(np.abs(data))]
    return [
        first,
        "Record of Mon Feb 13, 2012 13:06:45.0 PST",
        "CSMIP Preliminary Processing",
        "89146-L2500-12044.02                 Start time:  2/13/12, 21:06:45.0 UTC (GPS)",
        "Station No. 89146   40.941N, 123.633W      Etna  s/n 2500  (3 Chns of  3 at Sta)",
        "Willow Creek                              CGS",
        f"Chan  {number}: {name}                                                        ",
        *["Record of Mon Feb 13, 2012"] * 3,
        f"No. of Points = {data.size:6d}  Record Length ={length:7.3f} sec",
        f"Units of uncor data are sec and g .        Max  = {peak:6.3f} g , at   1.000 sec.",
        "RMS calc for complete record =        .",
        *rows(np.zeros(100, dtype=int), 16, "5d"),
        *rows(np.zeros(50), 8, "10.3f"),
    ]


def csmip_pairs(times: Array, values: Array) -> str:
    """CSMIP V1 of film: pairs of a time with three decimals and a value in g/10."""
    lines: list[str] = []
    for number, name in ((1, "90 DEG"), (2, "UP")):
        header = _csmip_header("UNCORRECTED ACCELEROGRAM DATA", number, name, values / G, float(times[-1]))
        header[11] = header[11].replace("data are sec and g .", "ACCEL ARE SEC AND G/10.")
        pairs = np.column_stack([times, 10.0 * values / G]).ravel()
        lines += [*header, *rows(pairs, 10, "7.3f")]
        lines += [f"/&  ----------  END OF DATA FOR CHANNEL  {number}  ----------"]
    return text(lines)


def geonet(values: Array, corrected: bool = False) -> str:
    """GeoNet V1A or V2A: N28W, S62W and up, in mm/s2 with one decimal."""
    word = "Corrected" if corrected else "Uncorrected"
    lines: list[str] = []
    for component, azimuth, factor in (("N28W", 332, 1.0), ("S62W", 242, 0.5), ("Up", 0, 0.25)):
        data = np.round(1e3 * factor * values, 1)
        peak = data[np.argmax(np.abs(data))]
        counts = [data.size] * 3 if corrected else [data.size, 0, 0]
        integers = [2016, 11, 13, 11, 2, 560, 0, 0, 2016, 11, 42, 41, 33, 173, 1, 19, 15, 0, 13, 11]
        integers += [42, 37, 10, 173, 3, 13, 332, azimuth, 198, 9, data.size, 0, 0, *counts, 0, 0, 2, 19715]
        reals = np.zeros(60)
        reals[[20, 23, 24, 25]] = [samples.DT * data.size] * 2 + [samples.DT] * 2
        reals[29] = 9806.6
        every = f"{samples.DT:.3f}"
        lines += [
            f"{word} accelerogram 20161113_110256_WTMC_20 GNS Science",
            "Site WTMC      42 37 10S  173 03 13E     Cusp file:  20161113_110259_WTMC",
            "Te Mara Farm Waiau",
            "Instrument Cusp_1",
            "Resolution: 18-bit   Instr Period: 0.0050 s   Damping: 0.700",
            "Accelerogram 20161113_110256_WTMC_20                  Processed 2016 December 09",
            "5 km south-west of Waiau",
            "2016 November 13         11:02:56 UT",
            "Epicentre  42 41 33S 173 01 19E  Bearing S12W  Dist    9km  Depth   15km Mw 7.82",
            f"Number of points  {data.size}    Duration {samples.DT * data.size:.2f} s",
            f"Instrument corrected data at {every} sec intervals"
            if corrected
            else f"Raw readings in units of 1.00 mm/s/s  at intervals of {every} s",
            "Band-pass filter transition bands are .10-.25 Hz and 24.50-25.50 Hz",
            f"Component {component}  Accelerometer Axis",
            f"Acceleration:  Peak {peak:8.1f} mm/s/s at   1.00 s     RMS    54.28 mm/s/s",
            "Velocity:      peak   -56.68 mm/s   at  66.08 sec     rms    13.55 mm/s",
            "Displacement:  peak  -26.920 mm     at 115.40 sec     rms    6.245 mm",
            *rows(np.array(integers), 10, "8d"),
            *rows(reals, 10, "8.3f"),
        ]
        for scale in (1.0, 0.1, 0.01)[: 3 if corrected else 1]:
            lines += rows(scale * data, 10, "8.1f")
    return text(lines)


def smc_uneven(times: Array, values: Array) -> str:
    """USGS SMC, version 1 of film: pairs of a time and a value in cm/s2, no rate, a stray row at the end."""
    from romdam.records.formats.smc import NULL_INTEGER, NULL_REAL, short_real

    integers, reals = [NULL_INTEGER] * 48, np.full(50, NULL_REAL)
    pairs = np.column_stack([times, 100.0 * values]).ravel()
    integers[12:14], integers[15:17] = [90, 45], [0, pairs.size]
    for place, at in ((28, int(np.argmax(values))), (30, int(np.argmin(values)))):
        reals[place : place + 2] = times[at], 100.0 * values[at]
    lines = ["1 UNCORRECTED ACCELEROGRAM", "*", "SOB", "1989 10 18 Loma Prieta, CA", "Moment Mag=  7.1"]
    lines += ["station = San Francisco, 575 Market component=     45", *["*"] * 5]
    lines += rows(np.array(integers), 8, "10d") + rows(reals, 5, "15.7E")
    lines += ["".join(map(short_real, pairs[i : i + 8])) for i in range(0, pairs.size, 8)]
    return text([*lines, "".join(map(short_real, [49.991, -13.8, 49.992, -13.9]))])


def dyna(values: Array, keys: int) -> str:
    """DYNA of ESM (64 keys), of ITACA 2 (55) or of ITACA 1 (43), which calls the stream a component."""
    from romdam.records.formats.esm import write_esm

    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "esm"
        write_esm(samples.Channel("HNE", values, samples.DT, "m/s2"), target)
        lines = target.read_text().split("\n")
    header, data = lines[:64], lines[64:]
    if keys == 55:
        header = [line for line in header if not line.startswith(("USER5", "DATA_", "ORIGINAL_DATA"))]
        header += ["DATA_TYPE: ACCELERATION"]
        header = [line.replace("DYNA 1.2", "DYNA 1.0") for line in header][:55]
    elif keys == 43:
        kept = (
            "EVENT_",
            "STATION_CODE",
            "SAMPLING",
            "NDATA",
            "DURATION",
            "STREAM",
            "UNITS",
            "PGA",
            "TIME_PGA",
        )
        header = [line for line in header if line.startswith(kept) and "EVENT_ID" not in line]
        header = [line.replace("STREAM: HNE", "COMPONENT: WE") for line in header]
        header += ["DATA_TYPE: UNPROCESSED ACCELERATION"]
    return "\n".join([*header, *data])


def cosmos_v0(values: Array) -> str:
    """COSMOS V0 of USGS: counts, "raw accel.   pts", and comments that begin with a blank."""
    lines = samples.cosmos_cgs(np.round(values), "Raw", ("counts", 50)).split("\n")
    lines = [line.replace("acceleration pts", "raw accel.   pts", 1) for line in lines]
    lines = [" " + line if line.startswith("|") else line for line in lines]
    start = next(i for i, line in enumerate(lines) if "velocity pts" in line)
    end = next(i for i, line in enumerate(lines) if line.startswith("/&"))
    return "\n".join([*lines[:start], *lines[end:]])
