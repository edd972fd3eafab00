"""Record files made for the tests, one of each format, from one synthetic three-component motion."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import obspy

from romdam.records.channel import Channel, Orientation
from romdam.records.formats.registry import FORMATS

DT = 0.005
START = "1994-01-17T12:30:55.250000"
ORIENTATIONS = {"HNE": Orientation(90.0), "HNN": Orientation(0.0), "HNZ": Orientation(None, 1)}
KNET = Path(os.path.dirname(obspy.__file__)) / "io/nied/tests/data/test.knet"


def motion(seed: int = 1, samples: int = 603) -> np.ndarray:
    """Coloured noise under a decaying envelope [m/s2]."""
    rng = np.random.default_rng(seed)
    noise = np.convolve(rng.normal(size=samples), np.ones(4) / 4.0, "same")
    time = np.arange(samples) * DT
    return 3.0 * noise * np.exp(-time) * (1.0 - np.exp(-5.0 * time))


def channel(code: str = "HNE", seed: int = 1) -> Channel:
    meta: dict[str, object] = {
        "station": "MUL",
        "network": "CE",
        "event": "Northridge, 1/17/1994",
        "station_name": "Beverly Hills",
        "magnitude": 6.7,
    }
    return Channel(code, motion(seed), DT, "m/s2", ORIENTATIONS[code], START, meta)


def three() -> list[Channel]:
    return [channel(code, seed) for seed, code in enumerate(ORIENTATIONS, start=1)]


def old_at2(values: np.ndarray) -> str:
    """The header of PEER's database before NGA: bare numbers, then their names."""
    rows = [" ".join(f"{v:.7E}" for v in values[i : i + 5]) for i in range(0, values.size, 5)]
    head = [
        "PEER STRONG MOTION DATABASE RECORD. PROCESSING BY PACIFIC ENGINEERING.",
        "IMPERIAL VALLEY 10/15/79 2319, EL CENTRO ARRAY 6, 230 (USGS STATION 5165)",
        "ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz LP=40.0 Hz",
        f" {values.size}    {DT:.5f}    NPTS, DT",
    ]
    return "\n".join(head + rows) + "\n"


def _rows(values: np.ndarray, per_row: int, form: str) -> list[str]:
    return ["".join(format(v, form) for v in values[i : i + per_row]) for i in range(0, values.size, per_row)]


def cosmos_cgs(values: np.ndarray, level: str = "Corrected", unit: tuple[str, int] = ("cm/sec2", 4)) -> str:
    """CGS's habits: (8F10.3) data, velocity and displacement behind, one channel at 360 degrees."""
    integers, reals = np.full(100, -999), np.full(100, -999.0)
    integers[[0, 1, 2, 10, 53]] = 2 if level == "Corrected" else 1, 1, unit[1], 5, 360
    integers[[39, 41, 42, 43, 44]] = 1994, 1, 17, 12, 30
    reals[[29, 33, 53, 61, 62]] = 55.25, DT, 0.12, 1e3 * DT, values.size * DT
    head = [
        f"{level} acceleration    (Format v01.20 with 13 text lines) Src: 12345",
        "Record of Northridge      Earthquake of Mon Jan 17, 1994 04:31 PST",
        *["Hypocenter: 34.209   -118.541   H= 19km       ML=6.4"] * 2,
        "Statn No: 05-  24389  Code:CE-24389  CGS  Los Angeles - Century City CC North",
        *["Coords: 34.063 -118.418   Site geology: Pleistocene terrace"] * 3,
        "Sta Chan   1:360 deg (Rcrdr Chan  1) Location: ground",
        *["Raw record length =   3.015 sec"] * 3,
        "Values used when parameter or data value is unknown/unspecified:   -999, -999.0",
        " 100 Integer-header values follow on  10 lines, Format= (10I8)",
        *_rows(integers, 10, "8d"),
        " 100 Real-header values follow on  17 lines, Format= (6F13.6)",
        *_rows(reals, 6, "13.6f"),
        '   2 Comment line(s) follow, each starting with a "|":',
        "| first comment",
        "|",
    ]
    lines = list(head)
    for name, factor in (("acceleration", 1.0), ("velocity", 0.1), ("displacement", 0.01)):
        code = f"{unit[0]}({unit[1]:02d})" if name == "acceleration" else "cm/sec(05)"
        lines.append(f"{values.size:8d} {name} pts, approx    3 secs, units={code},Format=(8F10.3)")
        lines += _rows(factor * values, 8, "10.3f")
    return "\n".join([*lines, "/&  ----------  End of data for channel   1  ----------"]) + "\n"


def csmip(values: np.ndarray, count: int | None = None) -> str:
    """CGS's format before COSMOS: two channels, 90 degrees and up."""
    blocks: list[str] = []
    for number, name in ((1, "90 Deg"), (2, "Up")):
        blocks += [
            "Corrected accelerogram 58065  CSMIP",
            f"58065-S2486   Saratoga - Aloha Ave   Chan  {number}: {name}",
        ]
        blocks += ["Accelerogram bandpass filtered with 3 dB pts at   .07 and 40.00 cyc/sec"]
        blocks += [*_rows(np.arange(40), 10, "8d")]
        for kind in ("accel", "veloc", "displ"):
            what = f"points of {kind} data equally spaced at  {DT:.3f} sec, in cm/sec2. (8f10.3)"
            blocks += [f"{count or values.size:6d} {what}", *_rows(number * values, 8, "10.3f")]
        blocks.append(f"/&  ----------  End of data for channel  {number}  ----------")
    return "\n".join(blocks) + "\n"


def write_all(folder: Path) -> dict[str, Path]:
    """One file of every format; the key is the format, or format-habit."""
    cm = 100.0 * motion()
    texts = {
        "AT2-old": old_at2(motion() / 9.80665),
        "COSMOS-cgs": cosmos_cgs(cm),
        "CSMIP": csmip(cm),
        "columns": "# time, acc\n"
        + "\n".join(f"{i * DT:.4f}, {v:.6f}" for i, v in enumerate(motion()))
        + "\n",
        "KNET": KNET.read_text(),
    }
    paths = {}
    for name, known in FORMATS.items():
        if known.write is not None:
            paths[name] = folder / f"sample.{name}"
            known.write(three() if known.many else [channel()], paths[name])
    for name, text in texts.items():
        paths[name] = folder / f"sample.{name}"
        paths[name].write_text(text)
    return paths
