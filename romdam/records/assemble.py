"""One ground motion from recorded channels: gaps, units, time base, correction, axes, scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.motions.records import RecordConfig, ScaleConfig, unit_in_si
from romdam.config.sections.motions.target import NAMED
from romdam.core.errors import RecordError, quote
from romdam.core.motion import GroundMotion
from romdam.records.channel import Channel, Orientation, check_channel, missing, one_record
from romdam.records.components import AXES, peak, spectrum
from romdam.records.plausible import said_of_axes, said_of_channels, too_strong
from romdam.records.processing.align import align, rotation, said_of_starts
from romdam.records.processing.correction import (
    correct,
    doubt_pads,
    moving_samples,
    refuse_lost_motion,
)
from romdam.records.processing.final_motion import said_of_changes, said_of_end
from romdam.records.processing.offset import doubt_drift, find_offset
from romdam.records.sources import ReadRecord

PEER_USABLE = 1.25  # lowest usable frequency over the high-pass corner (Ancheta et al. 2013)


def build_motion(source: ReadRecord, axes: dict[str, Channel]) -> GroundMotion:
    """Make the ground motion of one record.

    In this order: missing samples are filled; each channel is checked, turned to m/s2 and cut to what all
    have in common; a recorder's offset is subtracted; what was recorded is corrected step by step
    (`correction:`), turned to the model's axes, and scaled. The integration resamples it to its step
    (`processing.resampling`).

    Parameters
    ----------
    source : the record
    axes : channel of each axis; empty to rotate all channels to `x_azimuth`

    Raises
    ------
    RecordError
        naming record and channel.
    """
    with one_record(source.location), np.errstate(over="ignore", invalid="ignore"):
        return _build(source, axes)


def _build(source: ReadRecord, axes: dict[str, Channel]) -> GroundMotion:
    config, location = source.config, source.location
    chosen, left_out = (list(axes.values()), ()) if axes else _pointed(source)
    channels = [_filled(channel, config) for channel in chosen]
    for channel in channels:
        check_channel(channel, location)
        if config.dt is not None and abs(channel.dt - config.dt) > 1e-6 * config.dt:
            raise RecordError(
                f"{location}, channel {channel.code}: the file says dt = {channel.dt:g} s, `dt` "
                f"{config.dt:g} s; remove `dt`",
                "dt",
            )
    factors = np.array([_factor(channel, config, location) for channel in channels])
    recorded = align(channels, config.align, location) * factors[:, None]  # (k, nt) [m/s2]
    dt = channels[0].dt

    warnings = [*left_out, *(text for channel in channels for text in channel.warnings)]
    warnings += [*said_of_axes(axes, config), *said_of_channels(channels), *said_of_starts(channels)]
    sizes = [channel.data.size for channel in channels]
    if max(sizes) != recorded.shape[1]:
        kept_samples = f"`align: {config.align}` keeps {recorded.shape[1]} of them"
        warnings.append(f"the channels have {sizes} samples; {kept_samples}")
    if config.unit is not None:  # the file's unit may be another by the last digits: 9.81 and 9.80665
        declared = unit_in_si(config.unit)
        for unit in dict.fromkeys(channel.unit for channel in channels if channel.unit):
            if abs(unit_in_si(unit) - declared) > 1e-9 * declared:
                said = f"the file says {unit} ({unit_in_si(unit):g} m/s2), `unit` {config.unit} counts"
                warnings.append(said)
    warnings += too_strong(recorded, location)

    offset = find_offset(recorded, dt)
    recorded = recorded - offset[:, None]
    for channel, constant, rest in zip(channels, offset, np.max(np.abs(recorded), axis=-1), strict=True):
        if constant:
            warnings.append(
                f"channel {channel.code}: a constant of {constant:.3g} m/s2 was subtracted, the offset of "
                f"its recorder; the peak of the rest is {rest:.3g} m/s2"
            )
    magnitudes = (channel.meta.get("magnitude") for channel in channels)
    magnitude = next((value for value in magnitudes if isinstance(value, float) and value > 0.0), None)
    try:
        signal = correct(recorded, dt, config.correction, magnitude)
        if config.correction:
            names = [f"channel {channel.code}" for channel in channels]
            refuse_lost_motion(recorded, signal.acc, dt, names)
    except RecordError as error:
        raise RecordError(f"{location}: {error}") from None
    highpass, usable = signal.corners[0], _lowest_usable(channels)
    if highpass is not None and highpass < usable:
        warnings.append(
            f"the high-pass corner of {highpass:g} Hz lies below the record's lowest usable frequency of "
            f"{usable:g} Hz; below that there is no signal to keep"
        )
    warnings += signal.warnings

    matrix = _matrix(axes, channels, config, location)
    acc = matrix @ signal.acc
    kept = moving_samples(acc, signal.dt, signal.before, signal.after)
    pads = max(0, signal.before - kept.start), max(0, kept.stop - acc.shape[1] + signal.after)
    acc = acc[:, kept]
    if drifts := doubt_drift(acc, signal.dt):
        if config.scale_to_measure or config.keep:
            raise RecordError(f"{location}: {drifts}")
        warnings.append(drifts)
    scale, scaled_to = _scale(acc, signal.dt, config.scale, location)
    if not np.all(np.isfinite(scale * acc)):
        raise RecordError(f"{location}: correction and scale make values that are not finite; change them")
    if costs := doubt_pads(acc.shape[1], *pads, signal.dt):
        warnings.append(costs)
    warnings += said_of_end(acc, signal.dt, AXES)
    if config.correction:
        warnings += said_of_changes(matrix @ recorded, acc, signal.dt, AXES, "the correction")
    peaks = np.max(np.abs(scale * acc), axis=-1)
    nobody_says_of = config.scale is not None and "of" not in config.scale.model_fields_set
    if scaled_to and nobody_says_of and peaks[2] > np.max(peaks[:2]) > 0.0:
        warnings.append(
            "scale: of the largest of x, y, z, and z is the largest; say of: larger_horizontal, or largest"
        )
    provenance = _provenance(source, channels, factors, matrix, offset) | {
        "dt_recorded_s": signal.dt,
        "x_azimuth_deg": config.x_azimuth,
        "correction": list(signal.log),
        "pad_before_s": pads[0] * signal.dt,
        "pad_after_s": pads[1] * signal.dt,
        "resampling": config.resampling,
        "scale": scale.item(0) if np.all(scale == scale[0]) else scale.ravel().tolist(),
        "scaled_to": scaled_to,
    }
    return GroundMotion(source.name, scale * acc, signal.dt, provenance, tuple(warnings))


def _lowest_usable(channels: list[Channel]) -> float:
    """Lowest frequency [Hz] that the processing of all channels left, as their files state it; 0 unknown."""
    limits = [0.0]
    for channel in channels:
        stated, corner = channel.meta.get("lowest_usable_hz"), channel.meta.get("hp_corner_hz")
        if isinstance(stated, float):
            limits.append(stated)
        elif isinstance(corner, float) and corner > 0.0:
            limits.append(PEER_USABLE * corner)
    return max(limits)


def _pointed(source: ReadRecord) -> tuple[list[Channel], tuple[str, ...]]:
    """The channels to be rotated, with the azimuths that the entry declares, and what is said of others.

    Raises
    ------
    RecordError
        for an azimuth of a channel that is not there, or whose file says another.
    """
    declared, location = source.config.azimuths, source.location
    if not declared:
        return source.channels, ()
    codes = [channel.code for channel in source.channels]
    if unknown := [code for code in declared if codes.count(code) != 1]:
        raise RecordError(
            f"{location}: `azimuths` names {unknown[0]}, the channels are {', '.join(codes)}", "azimuths"
        )
    channels, left_out = [], []
    for channel in source.channels:
        word, stated = declared.get(channel.code), channel.orientation
        if word is None and stated is None:
            left_out.append(f"channel {channel.code} is left out, it is not among `azimuths`")
            continue
        if word is not None:
            upright = {"up": 1, "down": -1}.get(str(word))
            where = Orientation(float(word) % 360.0) if upright is None else Orientation(None, upright)
            if stated is not None and stated != where:
                raise RecordError(
                    f"{location}, channel {channel.code}: the file says {stated}, `azimuths` {where}; "
                    "remove it from `azimuths`",
                    "azimuths",
                )
            channel = replace(channel, orientation=where)
        channels.append(channel)
    return channels, tuple(left_out)


def _filled(channel: Channel, config: RecordConfig) -> Channel:
    """Fill missing samples as `gaps` says; without a policy `check_channel` refuses them."""
    gone = missing(channel.data)
    if config.gaps == "error" or not gone.any() or gone.all():
        return channel
    index = np.arange(channel.data.size)
    line = np.interp(index, index[~gone], channel.data[~gone]) if config.gaps == "linear" else 0.0
    count = int(gone.sum())
    said = f"channel {channel.code}: {count} of {gone.size} samples are missing; `gaps: {config.gaps}`"
    meta = {**channel.meta, "filled_samples": count, "filled_by": config.gaps}
    return replace(
        channel, data=np.where(gone, line, channel.data), meta=meta, warnings=(*channel.warnings, said)
    )


def _factor(channel: Channel, config: RecordConfig, location: str) -> float:
    """One recorded unit in m/s2."""
    if not channel.unit and config.unit is None:
        raise RecordError(
            f"{location}, channel {channel.code}: the file does not say its unit; "
            'give `unit`, for example "g", "cm/s2" or "9.81 m/s2"',
            "unit",
        )
    try:
        stated = unit_in_si(channel.unit) if channel.unit else None
    except ValueError:
        raise RecordError(
            f"{location}, channel {channel.code}: the file says {quote(channel.unit)}, no unit of "
            "acceleration; take the acceleration"
        ) from None
    if config.unit is None:
        assert stated is not None
        return stated
    declared = unit_in_si(config.unit)
    if stated is not None and abs(stated - declared) > 0.005 * declared:
        raise RecordError(
            f"{location}, channel {channel.code}: the file says {channel.unit}, `unit` {config.unit}; "
            "remove `unit`",
            "unit",
        )
    return declared


def _matrix(
    axes: dict[str, Channel], channels: list[Channel], config: RecordConfig, location: str
) -> NDArray[np.float64]:
    """(3, k) from channels to x, y, z."""
    if not axes:
        where = []
        for channel in channels:
            if channel.orientation is None:
                raise RecordError(
                    f"{location}, channel {channel.code}: the file does not say its azimuth; give it, "
                    f"`azimuths: {{{channel.code}: 90 deg, ...}}`, or name the axes under `components`"
                )
            where.append(channel.orientation)
        return rotation(where, float(config.x_azimuth or 0.0), location)
    matrix = np.zeros((3, len(channels)))
    for column, axis in enumerate(axes):
        component = config.components.get(axis)  # type: ignore[call-overload]
        reverse = component is not None and component.reverse
        matrix[AXES.index(axis), column] = -1.0 if reverse else 1.0
    return matrix


def _scale(
    acc: NDArray[np.float64], dt: float, scale: ScaleConfig | None, location: str
) -> tuple[NDArray[np.float64], str]:
    """Factors of the components, (3, 1), and what they bring the record to."""
    if scale is None:
        return np.ones((3, 1)), ""
    factors = np.array([[scale.x], [scale.y], [scale.z]])
    if scale.pga is None and scale.sa is None:
        return factors * (scale.factor or 1.0), ""
    try:
        if scale.pga is not None:
            name, wanted, has = "PGA", scale.pga, peak(factors * acc, scale.of)
        else:
            periods = np.array([scale.period or 0.0])
            name = f"PSa at {scale.period:g} s, {100.0 * scale.damping:g} % damping,"
            wanted = scale.sa or 0.0
            has = float(spectrum(factors * acc, dt, periods, scale.damping, scale.of)[0])
    except RecordError as error:
        raise RecordError(f"{location}: scale: {error}") from None
    if has <= 0.0:
        raise RecordError(f"{location}: cannot be scaled to {wanted:g} m/s2, it does not move")
    return factors * (wanted / has), f"{name} of the {NAMED[scale.of]} is {wanted:g} m/s2"


def _provenance(
    source: ReadRecord,
    channels: list[Channel],
    factors: NDArray[np.float64],
    matrix: NDArray[np.float64],
    offset: NDArray[np.float64],
) -> dict[str, object]:
    """Where the motion comes from: its files, and what was recorded in each channel."""
    return {
        "place": source.location,
        "files": dict(source.files),
        **{key: value for key, value in source.about.items() if key != "sha256"},
        "channels": [
            {
                "code": channel.code,
                "unit": source.config.unit or channel.unit,
                "unit_m_s2": float(factor),
                "offset_m_s2": float(constant),
                "azimuth": None if channel.orientation is None else channel.orientation.azimuth,
                "vertical": None if channel.orientation is None else channel.orientation.vertical,
                "start": channel.start,
                **channel.meta,
            }
            for channel, factor, constant in zip(channels, factors, offset, strict=True)
        ],
        "to_axes": matrix.tolist(),
    }
