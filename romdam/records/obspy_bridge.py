"""From ObsPy's traces to romdam's channels: every format ObsPy reads."""

from __future__ import annotations

import glob
import itertools
import os
import struct
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from romdam.core.errors import RecordError
from romdam.core.files import check_file
from romdam.core.motion import MOST_SAMPLES
from romdam.records.channel import Channel, Orientation, UnknownFormatError, parse_orientation
from romdam.records.clipping import clipping
from romdam.records.formats.text import MAX_BYTES, read_bytes
from romdam.records.processing.align import STAMPS
from romdam.records.processing.response import OUTSIDE, remove_response

if TYPE_CHECKING:
    from obspy import Stream, Trace

# What ObsPy's thirty readers raise on damaged files: none documents it, so every kind that parsing can raise.
PARSING = (
    ValueError,
    TypeError,
    LookupError,
    ArithmeticError,
    AttributeError,
    AssertionError,
    OSError,
    EOFError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    struct.error,
)


SAC_KINDS = {6: "displacement", 7: "velocity", 50: "volts"}  # `idep`
CRASHING = (b"WID2", b"WID1", b"XW01", b"BEGIN")  # GSE1 and GSE2


def read_with_obspy(path: Path, response: Path | None = None) -> list[Channel]:
    """Read a file of any format ObsPy knows, as acceleration channels.

    Parameters
    ----------
    path : the file
    response : StationXML (or another inventory ObsPy reads) to turn counts into m/s2

    Raises
    ------
    RecordError
        for a file ObsPy cannot read, and for gaps or overlaps within a channel.
    """
    stream, said = _obspy_read(path)
    said += _merge(stream, path)
    if response is not None:
        for trace in stream:
            if np.any(np.isnan(trace.data)):
                raise RecordError(
                    f"{path}, channel {trace.id}: a response cannot be removed across missing samples; take "
                    "a file without gaps"
                )
        said += _remove_response(stream, path, response)
    for trace in stream:
        if "sac" in trace.stats:
            _check_sac(trace, path, response is not None)
    if "mseed" in stream[0].stats and path.stat().st_size % stream[0].stats.mseed.record_length:
        said.append("the file ends within a record of miniSEED; it is cut short")
    by_time = sorted(stream, key=lambda trace: trace.stats.starttime)
    for early, late in itertools.pairwise(by_time):
        if abs(late.stats.starttime - early.stats.endtime - early.stats.delta) < 0.5 * early.stats.delta:
            said.append(f"channel {late.id} begins where {early.id} ends: is that one channel?")
    channels = [channel_of(trace, response is not None) for trace in stream]
    if not any(len(channel.code) > 1 and channel.code.isdigit() for channel in channels):
        # recorders count channels from 0, and no other code is an azimuth
        channels = [
            replace(channel, orientation=None) if channel.code == "0" else channel for channel in channels
        ]
    return [replace(channel, warnings=(*channel.warnings, *said)) for channel in channels]


def _merge(stream: Stream, path: Path) -> list[str]:
    """Join the segments of each channel; gaps, and overlaps that differ, become missing samples.

    Raises
    ------
    RecordError
        for segments of different intervals, or off each other's samples by more than a tenth of a step.
    """
    said = []
    for name in dict.fromkeys(trace.id for trace in stream):
        traces = sorted((t for t in stream if t.id == name), key=lambda t: t.stats.starttime)
        if len(traces) == 1:
            continue
        dt, first = float(traces[0].stats.delta), traces[0].stats.starttime
        exact = np.array([(trace.stats.starttime - first) / dt for trace in traces])
        off = float(np.max(np.abs(exact - np.round(exact))))
        if any(abs(float(trace.stats.delta) - dt) > 1e-6 * dt for trace in traces):
            raise RecordError(f"{path}, channel {name}: its segments have different intervals")
        if off > STAMPS:
            raise RecordError(
                f"{path}, channel {name}: its segments are {off:.2g} of a step off each other's samples "
                f"(limit {STAMPS:g}); resample them to one time base"
            )
        length = max(round(x) + t.stats.npts for x, t in zip(exact, traces, strict=True))
        if length > MOST_SAMPLES:
            raise RecordError(
                f"{path}, channel {name}: its segments span {length:.3g} samples (limit {MOST_SAMPLES:g})"
            )
        joined = np.full(length, np.nan)
        differ = np.zeros(length, dtype=bool)
        for x, trace in zip(exact, traces, strict=True):
            samples = slice(round(x), round(x) + trace.stats.npts)
            data = np.ma.filled(np.ma.asarray(trace.data, dtype=np.float64), np.nan)
            differ[samples] |= ~np.isnan(joined[samples]) & (joined[samples] != data)
            joined[samples] = data
        joined[differ] = np.nan
        gaps = int(np.count_nonzero(np.isnan(joined) & ~differ))
        said.append(
            f"channel {name}: {len(traces)} segments are joined, {gaps} samples are missing between them"
            + (f", {np.count_nonzero(differ)} overlap and differ" if differ.any() else "")
        )
        traces[0].data = joined
        for trace in traces[1:]:
            stream.remove(trace)
    return said


def _obspy_read(path: Path) -> tuple[Stream, list[str]]:
    """The traces of a file, and what ObsPy warns of: samples that fail a check, records that were skipped."""
    import obspy

    head = read_bytes(path, 100)
    if b"obspy.core.stream" in head:
        raise RecordError(f"{path}: line 1: a Python pickle, which runs code when read; save it as miniSEED")
    pattern = glob.escape(str(path.resolve()))
    if head.startswith(CRASHING):  # damaged GSE files crash ObsPy's decompressor: try in another process
        command = [sys.executable, "-c", "import sys, obspy; obspy.read(sys.argv[1])", pattern]
        try:
            done = subprocess.run(command, capture_output=True, timeout=60, check=False)
        except subprocess.TimeoutExpired:
            raise RecordError(
                f"{path}: line 1: reading it takes more than 60 s; the file is damaged"
            ) from None
        if done.returncode != 0:
            raise RecordError(f"{path}: line 1: ObsPy cannot read it; the file is damaged, fetch it again")
    # a time window, however wide, makes ObsPy return an empty stream where it else raises a bare Exception
    always = obspy.UTCDateTime(2500, 1, 1)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            stream = obspy.read(pattern, check_compression=False, endtime=always)
    except _obspy_errors() as error:
        if "Unknown format" in str(error):
            raise UnknownFormatError(f"{path}: line 1: not a record of any known format") from None
        reason = str(error).strip().replace(str(path), path.name).splitlines()[:1] or [type(error).__name__]
        raise RecordError(f"{path}: line 1: not a record of any known format ({reason[0][:120]})") from None
    if len(stream) == 0:
        raise RecordError(f"{path}: line 1: no trace in it; the file is cut short")
    said = [str(w.message) for w in caught if issubclass(w.category, UserWarning)]
    return stream, [f"ObsPy: {' '.join(text.split())[:200]}" for text in dict.fromkeys(said)]


def _obspy_errors() -> tuple[type[Exception], ...]:
    """Errors of ObsPy's readers: the usual kinds, and their own that derive from nothing but Exception."""
    from obspy.core.util.obspy_types import ObsPyException
    from obspy.io.ah.xdrlib import Error as AHError
    from obspy.io.gse2.libgse2 import ChksumError, GSEUtiError
    from obspy.io.kinemetrics.evt_base import EvtBaseError
    from obspy.io.nied.knet import KNETException
    from obspy.io.sac.util import SacError
    from obspy.io.seg2.seg2 import SEG2BaseError
    from obspy.io.segy.segy import SEGYError

    return (
        *PARSING,
        ObsPyException,
        AHError,
        ChksumError,
        GSEUtiError,
        EvtBaseError,
        KNETException,
        SacError,
        SEG2BaseError,
        SEGYError,
    )


def _remove_response(stream: Stream, path: Path, response: Path) -> list[str]:
    """Turn counts into m/s2 by an inventory, which also states where each channel points; say what was done.

    Raises
    ------
    RecordError
        for an inventory that cannot be read, lacks the channel at its time, or leaves no band.
    """
    import obspy
    from obspy.core.util.obspy_types import ObsPyException

    check_file(response, MAX_BYTES, RecordError)
    said: list[str] = []
    try:
        inventory = obspy.read_inventory(str(response))
        for trace in stream:
            data = np.asarray(trace.data, dtype=np.float64)
            why = clipping(data) if np.all(np.isfinite(data)) else ""
            gain = inventory.get_response(trace.id, trace.stats.starttime)
            with _quiet_evalresp(said):
                acc, band, outside = remove_response(data, float(trace.stats.delta), _Evalresp(gain))
            trace.data = acc
            about = f"channel {trace.stats.channel}: the response was divided out from {band}"
            if outside > OUTSIDE:
                about += f", and {100.0 * outside:.2g} % of the recorded energy, which is beyond, is left out"
            said.append(about)
            where = inventory.get_orientation(trace.id, trace.stats.starttime)
            trace.stats.romdam = {
                "azimuth": where["azimuth"],
                "dip": where["dip"],
                "clipped": why,
                "band": [band.low, band.high],
            }
    except (*PARSING, ObsPyException, RecordError) as error:
        raise RecordError(
            f"{path}: response of {response.name} cannot be removed ({error}); "
            "give the StationXML of this station and time"
        ) from None
    return list(dict.fromkeys(said))


class _Evalresp:
    """Complex gain of ObsPy's response at frequencies."""

    def __init__(self, response: Any) -> None:
        self._response = response

    def __call__(self, freq: np.ndarray, *, native: bool) -> np.ndarray:
        output = "DEF" if native else "ACC"
        return np.asarray(self._response.get_evalresp_response_for_frequencies(freq, output=output))


@contextmanager
def _quiet_evalresp(said: list[str]) -> Iterator[None]:
    """Take what evalresp prints on stderr, from C, and what ObsPy warns of, into a record's messages."""
    with tempfile.TemporaryFile() as file, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sys.stderr.flush()
        before = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(before, 2)
            os.close(before)
            file.seek(0)
            printed = file.read().decode(errors="replace").splitlines()
            told = [*printed, *(str(warning.message) for warning in caught)]
            said += [f"evalresp: {' '.join(text.split())[:200]}" for text in told if text.strip()]


def _check_sac(trace: Trace, path: Path, in_si: bool) -> None:
    """Hold what a SAC header says against the data: times, extremes, and what the values are."""
    header, count, dt = trace.stats.sac, trace.stats.npts, float(trace.stats.delta)
    location = f"{path}, channel {trace.stats.channel or '1'}"
    if header.get("idep") in SAC_KINDS and not in_si:
        raise RecordError(f"{location}: the header says {SAC_KINDS[header['idep']]}; take the acceleration")
    if "b" in header and "e" in header:
        length = float(header["e"]) - float(header["b"])
        if abs(length - (count - 1) * dt) > 0.5 * dt + 1e-6 * abs(float(header["e"])):
            raise RecordError(
                f"{location}: the header's times span {length:g} s, {count} samples at dt = {dt:g} s "
                f"{(count - 1) * dt:g} s; the file is cut short or altered"
            )
    if in_si or count == 0:
        return
    peak = float(np.max(np.abs(trace.data)))
    for key, value in (("depmin", np.min(trace.data)), ("depmax", np.max(trace.data))):
        stated = float(header.get(key, value))
        if abs(stated - float(value)) > 1e-3 * peak:
            raise RecordError(
                f"{location}: {key} is {stated:g}, the data's {float(value):g}; the file is altered"
            )


def channel_of(trace: Trace, in_si: bool = False) -> Channel:
    """Return a trace as a channel; `in_si` says that its values are m/s2 already."""
    stats = trace.stats
    extra = stats.get("romdam", {})
    meta: dict[str, object] = {
        "format": str(stats.get("_format", "")),
        "network": stats.network,
        "station": stats.station,
    }
    if "band" in extra:
        meta["response_band_hz"] = extra["band"]
    unit, scale = ("m/s2", 1.0) if in_si else (str(extra.get("unit", "")), 1.0)
    if "knet" in stats:
        unit, scale = "m/s2", float(stats.calib)  # ObsPy keeps counts; calib turns them into m/s2
        meta |= {"magnitude": float(stats.knet.mag), "event": str(stats.knet.evot)}
        meta["header_pga_gal"] = float(stats.knet.accmax)
    with np.errstate(invalid="ignore"):  # damaged NaN
        data = np.asarray(trace.data, dtype=np.float64) * scale
    if np.ma.isMaskedArray(trace.data):
        data = np.where(np.ma.getmaskarray(trace.data), np.nan, data)
    code = stats.channel or "1"
    said = []
    if not in_si and "knet" not in stats and float(stats.calib) not in (0.0, 1.0):
        factor = f"the header's factor {float(stats.calib):g} is not applied"
        said.append(f"channel {code}: {factor}, `unit` is that of raw values")
    sac = stats.get("sac", {})
    azimuth, dip = extra.get("azimuth"), extra.get("dip")
    if azimuth is None and "cmpaz" in sac and "cmpinc" in sac:
        azimuth, dip = float(sac["cmpaz"]), float(sac["cmpinc"]) - 90.0  # SAC counts incidence from up
    if azimuth is None or dip is None:
        where = parse_orientation(stats.channel)
    elif abs(dip) > 45.0:
        where = Orientation(None, -1 if dip > 0 else 1)  # SEED's dip is positive downwards
    else:
        where = Orientation(float(azimuth) % 360.0)
    by_code = parse_orientation(code)
    if where and by_code and len(code) == 3 and where != by_code:
        said.append(f"channel {code}: the header says {where}, its code {by_code}; the header counts")
    if extra.get("clipped"):
        said.append(f"channel {code} looks clipped before its response is removed: {extra['clipped']}")
    start = str(stats.starttime)
    return Channel(code, data, float(stats.delta), unit, where, start, meta, tuple(said))
