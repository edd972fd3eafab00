"""romdam's record formats as ObsPy waveform plugins; pyproject.toml names these functions."""

from __future__ import annotations

import functools
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from romdam.core.errors import RecordError
from romdam.records.channel import Channel
from romdam.records.formats.registry import FORMATS, HEAD
from romdam.records.formats.text import decode
from romdam.records.obspy_bridge import channel_of

if TYPE_CHECKING:
    from obspy import Stream, Trace


def trace_of(channel: Channel) -> Trace:
    """Return a channel as a trace; unit, orientation and event in `trace.stats.romdam`."""
    from obspy import Trace, UTCDateTime

    header: dict[str, Any] = {
        "network": str(channel.meta.get("network", ""))[:2],
        "station": str(channel.meta.get("station", ""))[:8],
        "channel": channel.code[:8],
        "delta": channel.dt,
    }
    if channel.start:
        header["starttime"] = UTCDateTime(channel.start)
    trace = Trace(channel.data.copy(), header)
    where = channel.orientation
    trace.stats.romdam = {
        **channel.meta,
        "unit": channel.unit,
        "azimuth": None if where is None else where.azimuth or 0.0,
        "dip": None if where is None else -90.0 * where.vertical,
    }
    return trace


def _is_format(name: str, filename: Any) -> bool:
    if hasattr(filename, "read"):
        return FORMATS[name].matches(decode(filename.read(HEAD)))
    try:
        with open(filename, "rb") as file:
            return FORMATS[name].matches(decode(file.read(HEAD)))
    except OSError:
        return False


def _read_format(name: str, filename: Any, **_: Any) -> Stream:
    from obspy import Stream

    if not hasattr(filename, "read"):
        return Stream([trace_of(channel) for channel in FORMATS[name].read(Path(filename))])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record"
        path.write_bytes(filename.read())
        return Stream([trace_of(channel) for channel in FORMATS[name].read(path)])


def _write_format(name: str, stream: Stream, filename: Any, **_: Any) -> None:
    write = FORMATS[name].write
    if write is None or (len(stream) > 1 and not FORMATS[name].many):
        raise RecordError(f"{filename}: {name} holds one channel a file, got {len(stream)}")
    channels = []
    for trace in stream:
        channel = channel_of(trace)
        if not channel.unit:
            raise RecordError(
                f"trace {trace.id}: unit unknown; set trace.stats.romdam = {{'unit': 'm/s2'}} before writing"
            )
        start = "" if trace.stats.starttime == 0 else str(trace.stats.starttime.datetime.isoformat())
        stated = dict(trace.stats.get("romdam", {}))
        about = {key: value for key, value in stated.items() if key not in ("unit", "azimuth", "dip")}
        channels.append(replace(channel, start=start, meta=channel.meta | about, warnings=()))
    write(channels, Path(filename))


def _plugin(name: str) -> tuple[Any, Any, Any]:
    functions = (_is_format, _read_format, _write_format)
    is_format, read_format, write_format = (functools.partial(function, name) for function in functions)
    return is_format, read_format, write_format


is_at2, read_at2, write_at2 = _plugin("AT2")
is_cosmos, read_cosmos, write_cosmos = _plugin("COSMOS")
is_csmip, read_csmip, _ = _plugin("CSMIP")
is_smc, read_smc, write_smc = _plugin("SMC")
is_esm, read_esm, write_esm = _plugin("ESM")
