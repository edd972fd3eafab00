"""Record files that lie, each made from an honest one of which the right reading is known."""

from __future__ import annotations

import codecs
import gzip
import io
import itertools
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import obspy
import samples
import vintages

Edit = Callable[[bytes], bytes]
READ, REFUSED, TOLD = "read right", "refused", "refused, or read with a warning"
BINARY = ("SAC", "MSEED")
PLAIN = {"columns": {"unit": "m/s2", "time_column": 1}, "single": {"unit": "m/s2", "dt": samples.DT}}
ENTRIES = {**PLAIN, "SAC": {"unit": "m/s2"}, "MSEED": {"unit": "1e-4 m/s2"}}
MANY = ("COSMOS", "COSMOS-cgs", "CSMIP", "CSMIP-V1", "CSMIP-film", "GEONET-V1A", "GEONET-V2A")  # channels
VINTAGES = ("CSMIP-V1", "CSMIP-film", "GEONET-V1A", "GEONET-V2A", "SMC-film", "ESM-55", "ESM-43")
COUNTED = ("AT2", "AT2-old", "COSMOS", "COSMOS-cgs", "CSMIP", "SMC", "ESM", "KNET", *VINTAGES)


@dataclass(frozen=True)
class Trap:
    """A damaged file; `entry` are its settings, `end` how reading it must end."""

    name: str
    source: str
    edit: Edit
    end: str
    entry: Mapping[str, object] = field(default_factory=dict)


def honest(folder: Path) -> dict[str, bytes]:
    """One honest file of every format."""
    paths = samples.write_all(folder)
    values = samples.motion()
    paths["single"] = folder / "sample.single"
    paths["single"].write_text("\n".join(f"{value:.6f}" for value in values) + "\n")
    counts = np.round(1e4 * values).astype(np.int32)
    for name, data, extra in (
        ("SAC", values.astype(np.float32), {}),
        ("MSEED", counts, {"reclen": 512, "encoding": "STEIM2"}),
    ):
        paths[name] = folder / f"sample.{name}"
        trace = obspy.Trace(data, {"delta": samples.DT, "channel": "HNN", "station": "MUL"})
        trace.write(str(paths[name]), name, **extra)
    times = np.round(samples.DT * np.arange(values.size) + 0.002 * np.sin(np.arange(values.size)), 3)
    times = np.maximum(times, 0.0)
    texts = {
        "CSMIP-V1": vintages.csmip_v1(values),
        "CSMIP-film": vintages.csmip_pairs(times, values),
        "GEONET-V1A": vintages.geonet(values),
        "GEONET-V2A": vintages.geonet(values, corrected=True),
        "SMC-film": vintages.smc_uneven(times, values),
        "ESM-55": vintages.dyna(values, 55),
        "ESM-43": vintages.dyna(values, 43),
    }
    known = {name: path.read_bytes() for name, path in paths.items()}
    return known | {name: text.encode() for name, text in texts.items()}


def text(edit: Callable[[str], str]) -> Edit:
    return lambda data: edit(data.decode("latin-1")).encode("latin-1")


def put(old: str, new: str, count: int = 1) -> Edit:
    """Replace text that must be there."""

    def edit(data: str) -> str:
        assert old in data, old
        return data.replace(old, new, count)

    return text(edit)


def rows(change: Callable[[list[str]], list[str]]) -> Edit:
    return text(lambda data: "\n".join(change(data.rstrip("\n").split("\n"))) + "\n")


def all_traps() -> list[Trap]:
    return [*_dressed(), *_foreign(), *_cut(), *_lies(), *_columns(), *_declared()]


def _dressed() -> Iterator[Trap]:
    """The same text as other machines and editors store it."""
    dresses: dict[str, Edit] = {
        "utf-8 mark": lambda data: codecs.BOM_UTF8 + data,
        "utf-16 little": lambda data: codecs.BOM_UTF16_LE + data.decode("latin-1").encode("utf-16-le"),
        "utf-16 big": lambda data: codecs.BOM_UTF16_BE + data.decode("latin-1").encode("utf-16-be"),
        "CRLF": lambda data: data.replace(b"\n", b"\r\n"),
        "CR": lambda data: data.replace(b"\n", b"\r"),
        "CRCRLF": lambda data: data.replace(b"\n", b"\r\r\n"),
        "Ctrl-Z": lambda data: data + b"\x1a",
        "blank lines": lambda data: data + b"\n\n  \n",
        "no last line end": lambda data: data.rstrip(b"\n"),
        "form feed": lambda data: data.rstrip(b"\n") + b"\x0c\n",
        "minus sign": lambda data: _last_lines(data, "-", "\u2212"),
        "no-break spaces": lambda data: _last_lines(data, " ", "\u00a0"),
    }
    for source in (*COUNTED, *PLAIN):
        for name, edit in dresses.items():
            yield Trap(f"dress: {name}", source, edit, READ)
    for old, new in (("E-", "D-"), ("E+", "D+"), ("E", "e")):
        for source in ("AT2", "COSMOS"):
            yield Trap(f"dress: exponent {new}", source, partial(_last_lines, old=old, new=new), READ)
    yield Trap(
        "dress: touching numbers", "AT2", rows(lambda r: r[:4] + [x.replace(" -", "-") for x in r[4:]]), READ
    )


def _last_lines(data: bytes, old: str, new: str) -> bytes:
    """Replace in the last twenty full rows only, where numbers stand and nothing else."""
    lines = data.decode("latin-1").split("\n")
    end = max(i for i, line in enumerate(lines) if line.strip() and "nd" not in line) - 1
    for i in range(end - 20, end):
        lines[i] = lines[i].replace(old, new)
    return "\n".join(lines).encode("utf-8")


def _foreign() -> Iterator[Trap]:
    """What is no record at all, or a record in a package."""
    packages: dict[str, Edit] = {
        "gzip": gzip.compress,
        "zip": _zipped,
        "bzip2": lambda data: b"BZh91AY" + data,
        "pdf": lambda data: b"%PDF-1.4\n" + data,
        "page": lambda data: b"<!DOCTYPE html><html><body>404 Not Found</body></html>\n",
        "page before": lambda data: b"\n<html>\n" + data,
        "hdf5": lambda data: b"\x89HDF\r\n\x1a\n" + data,
        "office": lambda data: b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + data,
        "empty": lambda data: b"",
        "blank": lambda data: b" \n \n",
        "zeros": lambda data: bytes(len(data)),
        "null inside": lambda data: data[: len(data) // 2] + b"\x00" + data[len(data) // 2 :],
        "stars": lambda data: _inside(data, "*****"),
        "a word": lambda data: _inside(data, "missing"),
        "infinite": lambda data: _inside(data, "inf"),
        "not a number": lambda data: _inside(data, "NaN"),
        "1e999": lambda data: _inside(data, "1e999"),
        "underscores": lambda data: _inside(data, "1_0.0"),
        "many digits": lambda data: _inside(data, 5000 * "9"),
    }
    for source in (*COUNTED, *PLAIN):
        for name, edit in packages.items():
            yield Trap(f"foreign: {name}", source, edit, REFUSED)
        large = source == "KNET" or source.startswith("GEONET")  # counts, mm/s2: some values are 999
        for mark in ("-999", "9999.999", "1e30") if not large else ():
            yield Trap(f"foreign: mark {mark}", source, partial(_inside, word=mark), REFUSED)


def _zipped(data: bytes) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("record", data)
    return target.getvalue()


def _inside(data: bytes, word: str) -> bytes:
    """Another word for a number far inside the samples."""
    lines = data.decode("latin-1").split("\n")
    announced = [
        i
        for i, line in enumerate(lines)
        if re.search(r"acceleration pts|points of accel|Accelerogram points|^Displacement:", line)
    ]
    last = max(i for i, line in enumerate(lines) if line.strip() and "nd" not in line)
    at = announced[0] + 20 if announced else last - 4
    lines[at] = " ".join([*lines[at].replace(",", " ").split()[:-1], word])
    return "\n".join(lines).encode("latin-1")


def _cut(names: tuple[str, ...] = COUNTED) -> Iterator[Trap]:
    """Files of which a part is missing, or that are there twice."""
    changes: dict[str, Callable[[list[str]], list[str]]] = {
        "half": lambda r: r[: len(r) // 2],
        "nine tenths": lambda r: r[: 9 * len(r) // 10],
        "a row": lambda r: r[:-9] + r[-8:],
        "a row twice": lambda r: [*r[:-8], r[-8], *r[-8:]],
        "the first line": lambda r: r[1:],
        "five lines": lambda r: r[5:],
        "joined": lambda r: r + r,
        "a number": lambda r: [*r[:-9], " ".join(r[-9].split()[1:]), *r[-8:]],
        "a number more": lambda r: [*r[:-9], r[-9] + " 0.5", *r[-8:]],
    }
    for source, (name, change) in itertools.product(names, changes.items()):
        if (source, name) not in (("CSMIP", "half"), ("CSMIP-V1", "half"), ("CSMIP-film", "half")) and (
            source not in MANY or name != "joined"
        ):
            yield Trap(f"cut: {name}", source, rows(change), REFUSED)
    for source in BINARY:
        yield Trap("cut: half", source, lambda data: data[: len(data) // 2 + 3], TOLD)
    yield Trap("cut: a column row", "columns", rows(lambda r: r[:200] + r[201:]), REFUSED)
    yield Trap("cut: the start of columns", "columns", rows(lambda r: r[100:]), TOLD)


def _lies() -> Iterator[Trap]:
    """Header fields that say something else than the data, one of each kind and format."""
    fields = [(*one, REFUSED) for one in _contradictions()]
    fields += [("KNET", "(gal)   4.383", "(gal)   4.390", TOLD)]
    rates = (100.0, 400.0, 0.0, 1.7e38, 2e5)
    fields += [("SMC", "  2.0000000E+02", f"{rate:15.7E}", TOLD) for rate in rates]
    for number, (source, before, after, end) in enumerate(fields):
        yield Trap(f"lie {number}: {before[:30]} -> {after[:30]}", source, put(before, after), end)
    for number, factor in enumerate((10.0, 5.0)):
        for source in ("SMC", "ESM", "COSMOS"):
            yield Trap(f"lie: data times {factor:g} ({number})", source, _scaled(source, factor), REFUSED)
    for key, word in (("depmax", 99.0), ("e", 9.0), ("delta", 0.01), ("idep", 7), ("idep", 6)):
        yield Trap(f"lie: SAC {key} {word}", "SAC", _sac(key, word), REFUSED)
    for source in ("CSMIP-V1", "CSMIP-film"):
        peak = text(lambda data: re.sub(r"Max  = *\S+", "Max  = 0.900", data, count=1))
        yield Trap("lie: the peak", source, peak, REFUSED)
    yield Trap("lie: SAC scale", "SAC", _sac("scale", 2.5), TOLD)


_NO_UNITS = (
    "G/10", "CM/S/S/10", "G*1000", "G X 0.1", "CM/S", "CM", "0.1G", "10 G", "COUNTS", "M/S", "KG", "g/10",
)  # fmt: skip
_LIES: dict[tuple[str, str, str], tuple[object, ...]] = {  # format, what it says, with {} what else -> lies
    ("AT2", "UNITS OF G", "UNITS OF {}"): _NO_UNITS,
    ("AT2-old", "UNITS OF G.", "UNITS OF {}."): _NO_UNITS,
    ("ESM", "UNITS: cm/s^2", "UNITS: {}"): (*_NO_UNITS, "g", "m/s^2", "mm/s^2"),
    ("COSMOS", "units=cm/sec2(04)", "units={}"): (*_NO_UNITS, "g", "mg", "g(02)"),
    ("CSMIP", "in cm/sec2.", "in {}."): _NO_UNITS,
    ("AT2", "0.005 SEC,", "0.005 {},"): ("HZ", "MIN", "SEC*2", "SAMPLES/SEC", "/ 10"),
    ("AT2", "DT=     0.005", "DT= {}"): ("0", "-0.005", "5.0", "1e300", "nan", "0,005"),
    ("AT2", "NPTS=    603", "NPTS= {}"): ("602", "604", "0", "-1", "6e2", "1" * 5000, "1e12"),
    ("AT2", "ACCELERATION", "{}"): ("VELOCITY", "DISPLACEMENT"),
    ("AT2-old", " 603 ", " {} "): ("602", "604", "0"),
    ("ESM", "NDATA: 603", "NDATA: {}"): ("602", "6030", "1e3", "9" * 5000),
    ("ESM", "INTERVAL_S: 0.005", "INTERVAL_S: {}"): ("0.01", "5", "0.00501", "-1", "0"),
    ("ESM", "DURATION_S: 3.01", "DURATION_S: {}"): ("3.05", "1.5", "30.1", "0"),
    ("ESM", "PGA_CM/S^2: ", "PGA_CM/S^2: {}"): ("1", "0.", "-9"),
    ("ESM", "DATA_TYPE: ACCELERATION", "DATA_TYPE: {}"): ("VELOCITY", "ACCELERATION RESPONSE SPECTRUM"),
    ("ESM", "EVENT_ID:", "{}:"): ("EVENT_NAME",),
    ("KNET", "Duration Time(s)  59", "Duration Time(s)  {}"): ("60", "118", "30", "0", "-59", "x"),
    ("KNET", "100Hz", "{}"): ("200Hz", "50Hz", "0Hz", "100", "100kHz", "10 0Hz", "-100Hz"),
    ("KNET", "2000(gal)", "{}"): ("3920(gal)", "200(gal)", "0(gal)", "2000(g)", "2000"),
    ("KNET", "/8388608", "/{}"): ("6182761", "838860", "0", "x", "8388608(g)"),
    ("KNET", "(gal)   4.383", "(gal)   {}"): ("43.83", "0.438", "5.0", "x"),
    ("COSMOS", "       5.000000", "{:15.6f}"): (10.0, 2.5, 5.2, 5000.0),
    ("COSMOS", "     603 acceleration", "{:8d} acceleration"): (602, 604, 60, 999999999),
    ("COSMOS", "     603 acceleration", "     603 {}"): ("velocity",),
    ("COSMOS", "Corrected acceleration", "Corrected {}"): ("velocity", "displacement"),
    ("COSMOS", "approx    3", "approx {:4d}"): (30, 6, 0),
    ("COSMOS-cgs", "Sta Chan   1:360 deg", "Sta Chan   1:{} deg"): ("90", "180", "270"),
    ("COSMOS-cgs", "units=cm/sec2(04)", "units={}"): ("g", "counts", "mg(04)"),
    ("CSMIP", "   603 points of accel", "{:6d} points of accel"): (602, 604, 6),
    ("CSMIP", "at  0.005 sec", "at  {} sec"): ("0.050", "0.010", "5.000", "0.000"),
    ("CSMIP", "at  0.005 sec", "at  {}"): ("5.0 msec", "0.005 min"),
    ("CSMIP", "CSMIP\n", "CSMIP\n Peak acceleration = {} at 1.2 sec\n"): ("999.0 cm/sec/sec", "1.5 g"),
    ("CSMIP-V1", "   603 Accelerogram points", "{:6d} Accelerogram points"): (602, 604, 6),
    ("CSMIP-V1", "at 200 pts/sec", "at {} pts/sec"): ("100", "50", "0", "2000"),
    ("CSMIP-V1", "in units of g .", "in units of {} ."): ("g/10", "cm", "counts", "cm/s2"),
    ("CSMIP-V1", "No. of Points =    603", "No. of Points = {:6d}"): (602, 604, 6030),
    ("CSMIP-film", "No. of Points =    603", "No. of Points = {:6d}"): (602, 604, 6030),
    ("CSMIP-film", "SEC AND G/10", "SEC AND {}"): ("CM/S2",),
    ("CSMIP-film", "Length =  3.0", "Length =  {}"): ("6.0", "1.0"),
    ("GEONET-V1A", "intervals of 0.005", "intervals of {}"): ("0.010", "0.001", "5.000"),
    ("GEONET-V1A", "mm/s/s at   1.00", "{} at   1.00"): ("cm/s/s", "g", "mm/s"),
    ("GEONET-V1A", "Number of points  603", "Number of points  {}"): (602, 6030),
    ("GEONET-V1A", "Component N28W", "Component {}"): ("N28E", "S28W", "090"),
    ("GEONET-V2A", "     603     603     603", "{}"): (
        "     602     603     603",
        "     603     603     602",
    ),
    ("SMC-film", "      1206", "{:10d}"): (1204, 1208, 603, 0, -1),
    ("ESM-43", "INTERVAL_S: 0.005", "INTERVAL_S: {}"): ("0.01", "5"),
    ("ESM-43", "UNPROCESSED ACCELERATION", "{}"): ("VELOCITY", "ACCELERATION RESPONSE SPECTRUM"),
    ("ESM-55", "UNITS: cm/s^2", "UNITS: {}"): ("g", "m/s^2", "mm/s^2", "cm/s"),
    ("SMC", "2 CORRECTED", "{}"): ("3 VELOCITY\n",),
    ("SMC", "       603", "{:10d}"): (602, 595, 611, 0, -1),
}


def _contradictions() -> Iterator[tuple[str, str, str]]:
    for (source, before, after), lies in _LIES.items():
        yield from ((source, before, after.format(lie)) for lie in lies)


def _scaled(source: str, factor: float) -> Edit:
    """The samples from the tenth row on times a factor."""
    first, last = {"SMC": (30, None), "ESM": (70, None), "COSMOS": (56, 160)}[source]
    width, form = {"SMC": (10, "{:10.3f}"), "ESM": (40, "{:.6f}"), "COSMOS": (15, "{:15.6E}")}[source]

    def scaled(line: str) -> str:
        words = [line[i : i + width] for i in range(0, len(line), width)]
        return "".join(form.format(factor * float(word)) for word in words)

    def edit(lines: list[str]) -> list[str]:
        return [*lines[:first], *map(scaled, lines[first:last]), *(lines[last:] if last else [])]

    return rows(edit)


def _sac(key: str, value: float) -> Edit:
    """Another value in the binary header: words of four bytes, floats first."""
    from obspy.io.sac import header

    places = {name: i for i, name in enumerate(header.FLOATHDRS)}
    whole = {name: 70 + i for i, name in enumerate(header.INTHDRS)}

    def edit(data: bytes) -> bytes:
        words = np.frombuffer(data[:632], "<f4").copy()
        if key in places:
            words[places[key]] = value
        else:
            words.view("<i4")[whole[key]] = value
        return words.tobytes() + data[632:]

    return edit


def _columns() -> Iterator[Trap]:
    """Plain columns say little; what they say must fit."""
    single, two = "single", "columns"

    def above(line: str) -> Edit:
        return rows(lambda r: [line, *r])

    yield Trap("columns: decimal commas", single, put(".", ",", -1), REFUSED)
    yield Trap("columns: decimal commas and semicolons", two, rows(_semicolons), REFUSED)
    for line in (
        "603",
        "603 0.005",
        "602",
        "6030",
        "603 3.01",
        "0.0a5",
        "O.123",
        "0.1.2",
        "--0.1",
        "*****",
        "dt 0.01 s",
    ):
        yield Trap(f"columns: {line} above", single, above(line), REFUSED)
    yield Trap("columns: dt above", single, above("0.005"), TOLD)
    for line in (
        "# dt = 0.01 s", "# dt: 5.1 ms", "# sampling rate = 100 Hz", "# fs: 20", "# NPTS = 604",
        "# samples: 1000", "# units: g", "% Unit = cm/s2", "# units: cm/s", "# unit: g/10",
        "# time step = 0.02", "# acceleration units: cm/s2",
    ):  # fmt: skip
        yield Trap(f"columns: {line}", single, above(line), REFUSED)
    for line in (
        "# acceleration in g",
        "# accelerations [cm/s2]",
        "# PGA = 9 g",
        "# peak acceleration: 3 gal",
    ):
        yield Trap(f"columns: {line}", single, above(line), TOLD)
    for line in (
        "# dt = 0.005 s",
        "# dt: 5 ms",
        "# fs = 200",
        "# NPTS: 603",
        "# Units: m/s2",
        "# by hand, 3 of 4",
        "# crest, PGA in g: 0.1475",
        "# noise in mg",
        "# range 2 g, recorded in Italy",
    ):
        yield Trap(f"columns: {line}", single, above(line), READ)
    for name in ("acc (g)", "acc [cm/s2]", "acc_g", "vel (cm/s)", "disp [cm]"):
        yield Trap(f"columns: named {name}", single, above(name), REFUSED)
    for name in ("acc (m/s2)", "acceleration", "ch1"):
        yield Trap(f"columns: named {name}", single, above(name), READ)
    yield from _columns_of_times()
    yield from _wide()
    yield from _wraps()
    yield from _headers()
    yield from _odd_columns()


def _wide() -> Iterator[Trap]:
    """Three columns: times, g, and the motion in m/s2, under names that fit or do not."""
    honest_unit = {"unit": None, "components": {"y": 3}}

    def wide(mark: str, names: str) -> Edit:
        def edit(lines: list[str]) -> list[str]:
            pairs = [line.split(", ") for line in lines[1:]]
            return [names, *(f"{t}{mark}{float(a) / 9.80665:.8f}{mark}{a}" for t, a in pairs)]

        return rows(edit)

    named = ("Time (s)", "Raw acc (g)", "Top acc (m/s2)")
    for mark, join in ((",", ","), (";", ";"), ("\t", "\t"), ("   ", "   ")):
        yield Trap(f"names: parted by {mark!r}", "columns", wide(mark, join.join(named)), READ, honest_unit)
        quoted = join.join(f'"{name}"' for name in named)
        yield Trap(f"names: quoted, by {mark!r}", "columns", wide(mark, quoted), READ, honest_unit)
        fewer = join.join(named[:2])
        yield Trap(f"names: two, by {mark!r}", "columns", wide(mark, fewer), REFUSED, honest_unit)
    for names in ("Time (s),Raw, acc (g),Top acc (m/s2)", "Time (s) Raw acc (g) Top acc (m/s2)"):
        yield Trap(f"names: {names}", "columns", wide(",", names), REFUSED, honest_unit)
    said = {"unit": "m/s2", "components": {"y": 3}}
    yield Trap("names: too few, unit declared", "columns", wide(",", "a (g), b (g)"), READ, said)
    for name in ("(g)", "(cm/s2)", "(cm/s)", "(m)"):
        lie = wide(",", f"Time (s),a,b {name}")
        yield Trap(f"names: {name} against the unit", "columns", lie, REFUSED, said)
    yield Trap("names: velocity", "columns", wide(",", "t,acc,vel"), REFUSED, said)
    yield Trap("names: times in hours", "columns", wide(",", "t (h),a,b"), TOLD, said)


def _wraps() -> Iterator[Trap]:
    """One series several values a row: by the key alone, or by a count that says it."""
    base = {"dt": samples.DT, "time_column": None}
    for width, mark in itertools.product((2, 3, 5, 8, 10), (" ", ",", "\t")):

        def wrap(lines: list[str], width: int = width, mark: str = mark) -> list[str]:
            return [mark.join(lines[i : i + width]) for i in range(0, len(lines), width)]

        key, name = base | {"layout": "series"}, f"{width} by {mark!r}"
        if mark == " ":
            yield Trap(f"wrapped: {name}, no key", "single", rows(wrap), REFUSED, base)
        yield Trap(f"wrapped: {name}, key", "single", rows(wrap), READ, key)

        def counted(lines: list[str], wrap: Any = wrap) -> list[str]:
            return ["# NPTS = 603", *wrap(lines)]

        def shortened(lines: list[str], wrap: Any = wrap, mark: str = mark) -> list[str]:
            lines = wrap(lines)
            lines[20] = lines[20].partition(mark)[2]
            return lines

        def lost(lines: list[str], counted: Any = counted) -> list[str]:
            return [line for i, line in enumerate(counted(lines)) if i != 20]

        yield Trap(f"wrapped: {name}, count", "single", rows(counted), TOLD, base)
        yield Trap(f"wrapped: {name}, a number lost", "single", rows(shortened), REFUSED, key)
        yield Trap(f"wrapped: {name}, a row lost", "single", rows(lost), REFUSED, key)


def _headers() -> Iterator[Trap]:
    """Lines of text above the rows, skipped by a key; decimal commas; quoted numbers."""
    head = [
        "SeismoSignal v2023",
        "Time step: 0.005 sec",
        "Acceleration units: m/s2",
        "",
        "t [s]   a [m/s2]",
        "",
    ]

    def headed(*lines: str) -> Edit:
        return rows(lambda r: [*(lines or head), *(x.replace(", ", "   ") for x in r[1:])])

    two, six = "columns", {"header_lines": 6}
    yield Trap("header: not declared", two, headed(), REFUSED, {"unit": None})
    yield Trap("header: declared", two, headed(), READ, six | {"unit": None})
    yield Trap("header: too few declared", two, headed(), REFUSED, {"unit": None, "header_lines": 2})
    yield Trap(
        "header: another step", two, headed(head[0], "dt: 0.01", *head[2:]), REFUSED, {"header_lines": 6}
    )
    yield Trap("header: another unit", two, headed(*head[:2], "units: g", *head[3:]), TOLD, six)
    yield Trap("header: beyond the file", two, headed(), REFUSED, {"header_lines": 9000})
    comma = {"decimal": "comma"}
    yield Trap("decimal: comma declared", two, rows(_semicolons), READ, comma)
    yield Trap("decimal: comma declared, points there", two, lambda d: d, REFUSED, comma)
    yield Trap(
        "decimal: tabs", two, rows(lambda r: [x.replace(";", "\t") for x in _semicolons(r)]), READ, comma
    )
    yield Trap("decimal: alone", "single", put(".", ",", -1), READ, comma)
    quote = rows(lambda r: ['"t","a"', *('"' + x.replace(", ", '","') + '"' for x in r[1:])])
    yield Trap("quoted numbers", two, quote, READ)
    yield Trap("an empty cell", two, rows(lambda r: [*r[:50], r[50].split(",")[0] + ",", *r[51:]]), REFUSED)


def _columns_of_times() -> Iterator[Trap]:
    two = "columns"
    yield Trap("columns: times in ms", two, rows(_times(1e3)), REFUSED)
    yield Trap("columns: times in ms, said so", two, rows(lambda r: ["t(ms), acc", *_times(1e3)(r)]), READ)
    yield Trap("columns: drifting times", two, rows(_times(1.0, lambda t: t + 0.02 * t**2)), REFUSED)
    yield Trap("columns: times with a jump", two, rows(_times(1.0, lambda t: t + 0.05 * (t > 1.5))), REFUSED)
    yield Trap("columns: times backwards", two, rows(_times(-1.0)), REFUSED)
    yield Trap("columns: times as motion", two, lambda d: d, TOLD, {"time_column": None, "dt": samples.DT})
    coarse = rows(lambda r: [f"{float(x.split(',')[0]):.2f},{x.split(',')[1]}" for x in r[1:]])
    motion_only = {"time_column": None, "dt": samples.DT}
    yield Trap("columns: coarse times as motion", two, coarse, TOLD, motion_only)
    yield Trap("columns: coarse times", two, coarse, REFUSED)
    yield Trap(
        "columns: coarse times and another dt", two, coarse, REFUSED, {"time_column": None, "dt": 0.01}
    )
    energy = rows(lambda r: [f"{x},{i * i}" for i, x in enumerate(r[1:])])
    yield Trap("columns: a sum as motion", two, energy, TOLD, {"components": {"y": 3}})
    yield Trap(
        "columns: only times", "single", rows(lambda r: [f"{i * 0.005:.4f}" for i in range(603)]), REFUSED
    )
    yield Trap("columns: times and another dt", two, lambda d: d, REFUSED, {"time_column": None, "dt": 0.01})
    yield Trap("columns: two dts", two, lambda d: d, REFUSED, {"dt": 0.01})
    yield Trap("columns: no such column", two, lambda d: d, REFUSED, {"time_column": 7})


def _odd_columns() -> Iterator[Trap]:
    single = "single"
    comma = {"dt": samples.DT, "time_column": None}
    yield Trap("columns: a series in rows", single, rows(_wrapped), TOLD, comma)
    joined = rows(lambda r: [*r, "# the next", *r])
    yield Trap("columns: two records", single, joined, TOLD)
    yield Trap("columns: a footer", single, rows(lambda r: [*r, "end"]), REFUSED)
    yield Trap("columns: at rest", single, rows(lambda r: ["0.0"] * len(r)), TOLD)
    yield Trap("columns: clipped", single, rows(_clipped), TOLD)
    yield Trap("columns: a gap of zeros", single, rows(lambda r: r[:60] + ["0.0"] * 40 + r[100:]), TOLD)
    yield Trap("columns: a spike", single, rows(lambda r: [*r[:300], "40.0", *r[301:]]), TOLD)
    yield Trap(
        "columns: the same twice",
        single,
        rows(lambda r: [f"{x} {x}" for x in r]),
        TOLD,
        {"components": {"x": "1", "y": "2"}},
    )


def _clipped(lines: list[str]) -> list[str]:
    return [f"{np.clip(float(line), -0.5, 0.5):.6f}" for line in lines]


def _semicolons(lines: list[str]) -> list[str]:
    return [line.replace(", ", ";").replace(".", ",") for line in lines[1:]]


def _times(factor: float, bend: Callable[[float], float] = lambda t: t) -> Callable[[list[str]], list[str]]:
    return lambda r: [f"{factor * bend(float(x.split(',')[0])):.6f},{x.split(',')[1]}" for x in r[1:]]


def _wrapped(lines: list[str]) -> list[str]:
    smooth = np.convolve([float(x) for x in lines[:600]], np.ones(20) / 20, "same")
    return [" ".join(f"{x:.6f}" for x in row) for row in smooth.reshape(-1, 6)]


def _declared() -> Iterator[Trap]:
    """What the configuration says against what the file says."""
    for source in COUNTED:
        for unit in ("kg", "0 g", "-9.81 m/s2", "counts"):
            yield Trap(f"declared: unit {unit}", source, lambda d: d, REFUSED, {"unit": unit})
        end = READ if source.startswith("GEONET") else REFUSED  # which is in mm/s2
        yield Trap("declared: unit mm/s2", source, lambda d: d, end, {"unit": "mm/s2"})
        for dt in ("0.004 s", "10 s", "2.5 ns", 0, -0.005, "5 s"):
            yield Trap(f"declared: dt {dt}", source, lambda d: d, REFUSED, {"dt": dt})
        yield Trap("declared: time_column", source, lambda d: d, REFUSED, {"time_column": 1})
        yield Trap("declared: vertical", source, lambda d: d, TOLD, {"components": {"z": {}}})
        yield Trap("declared: response", source, lambda d: d, REFUSED, {"response": "none.xml"})
    for source in ("AT2", "AT2-old"):
        yield Trap("declared: 9.81", source, lambda d: d, TOLD, {"unit": "9.81 m/s2"})
