"""The `records:` part of a configuration: where ground motions come from and what is done to them.

One entry of the list describes one record or a whole family of them (a folder, a glob, a manifest, a
P-695 set); what follows the source (axes, correction, scaling, ...) applies to every record it finds.
"""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, field_validator, model_validator

from romdam.config.base import Model
from romdam.config.explain import explain
from romdam.config.names import OfFile
from romdam.config.quantities import (
    Degrees,
    Dimensionless,
    GroundAcceleration,
    NumberOrText,
    Time,
    Whole,
    refuse_bare,
    to_si,
)
from romdam.config.sections.motions.correction import Correction
from romdam.config.sections.motions.target import MatchConfig, Of, TargetConfig
from romdam.config.yaml_text import read_yaml
from romdam.core.csv_table import read_table
from romdam.core.errors import ConfigError, listed, quote

Axis = Literal["x", "y", "z"]
_SIGNS = {",": "comma", ";": "semicolon", "\t": "tab", " ": "blank", ".": "point"}


def _word_of_sign(value: object) -> object:
    return _SIGNS.get(value, value) if isinstance(value, str) else value


Delimiter = Annotated[
    Literal["blank", "comma", "semicolon", "tab"],
    BeforeValidator(_word_of_sign, Literal["blank", "comma", "semicolon", "tab", " ", ",", ";", "\t"]),
]
Decimal = Annotated[
    Literal["point", "comma"], BeforeValidator(_word_of_sign, Literal["point", "comma", ".", ","])
]
MEASURES = {  # what records can be filtered by, and the unit of each
    "pga": "m/s^2",
    "pgv": "m/s",
    "pgd": "m",
    "arias": "m/s",
    "cav": "m/s",
    "d5_75": "s",
    "d5_95": "s",
    "duration": "s",
    "dt": "s",
}
_OFTEN_NOT_SI = ("pga", "pgv", "pgd", "cav")  # a limit of these needs its unit
_BARE_UNIT = re.compile(r"^\s*[A-Za-z]")
SHORTEST_DT, LONGEST_DT = 1e-5, 0.9  # s; milliseconds taken for seconds are 1 or more
LONGEST_REST = 3600.0  # s between two records; dams come to rest within a minute


def unit_in_si(unit: str) -> float:
    """One `unit` of acceleration in m/s2; "g" is 9.80665, a declared "9.81 m/s2" is itself.

    Raises
    ------
    ValueError
        for what is no acceleration above zero.
    """
    aliases = {"gal": "Gal", "cm/s/s": "cm/s^2", "cm/sec2": "cm/s^2", "cm/sec/sec": "cm/s^2"}
    text = aliases.get(unit.strip().lower(), unit.strip())
    if text.lower() in ("count", "counts"):
        raise ValueError('counts are no acceleration; give what one count is, such as "4.7e-6 m/s2"')
    factor = to_si(f"1 {text}" if _BARE_UNIT.match(text) else text, "m/s^2")
    if factor <= 0.0:
        raise ValueError(f"one unit must be greater than 0, got {unit!r}; `reverse: true` turns a component")
    return factor


class ComponentConfig(Model):
    """The channel that shakes one axis: a column number from 1, a channel code, or another file.

    The channel "each" makes one ground motion of every channel found, all on this one axis.
    """

    channel: Whole | str | None = None
    """Column (from 1) or code of the channel, or the word each: one motion of every channel."""
    file: Path | None = None
    """File of this channel, if not the entry's."""
    reverse: bool = False
    """The samples change their sign."""

    short_form: ClassVar[dict[str, object] | None] = {"type": ["integer", "string"]}

    @model_validator(mode="before")
    @classmethod
    def _bare_channel(cls, value: object) -> object:
        return {"channel": value} if isinstance(value, int | str) and not isinstance(value, bool) else value


class ScaleConfig(Model):
    """Multiply by a factor, or to reach a peak, a spectral acceleration or a target spectrum.

    `x`, `y` and `z` are factors of single components, applied first; all else is one factor of the record.
    """

    factor: Annotated[Dimensionless, Field(gt=0.0)] | None = None
    """Factor on the samples of all components."""
    x: Annotated[Dimensionless, Field(gt=0.0)] = 1.0
    """Factor on the x component alone, applied first."""
    y: Annotated[Dimensionless, Field(gt=0.0)] = 1.0
    """Factor on the y component alone, applied first."""
    z: Annotated[Dimensionless, Field(gt=0.0)] = 1.0
    """Factor on the z component alone, applied first."""
    pga: Annotated[GroundAcceleration, Field(gt=0.0)] | None = None
    """Peak ground acceleration to scale to."""
    sa: Annotated[GroundAcceleration, Field(gt=0.0)] | None = None
    """Spectral acceleration at `period` to scale to."""
    period: Annotated[Time, Field(gt=0.0)] | None = None
    """Period of the wanted spectral acceleration."""
    damping: Annotated[Dimensionless, Field(ge=0.0, lt=1.0)] = 0.05
    """Damping of the wanted spectral acceleration."""
    of: Of = "largest"
    """Combination of the components that reaches `pga` or `sa`."""
    to: Literal["target"] | None = None
    """Aim of one factor, by least squares of the logarithm: the entry's `target`."""
    factors: (
        tuple[Annotated[Dimensionless, Field(gt=0.0)], Annotated[Dimensionless, Field(gt=0.0)]] | None
    ) = None
    """Least and largest factor to the target; a record that needs another is refused, or not selected."""
    mean_at_least: Annotated[Dimensionless, Field(gt=0.0, le=2.0)] | None = None
    """Share of the target that the mean of the entry's records reaches at every period of its range."""

    short_form: ClassVar[dict[str, object] | None] = {"type": ["number", "string"]}

    @model_validator(mode="before")
    @classmethod
    def _bare_factor(cls, value: object) -> object:
        if value == "target":
            return {"to": "target"}
        return {"factor": value} if isinstance(value, int | float | str) else value

    @model_validator(mode="after")
    def _one_target(self) -> Self:
        set_keys, wanted = self.model_fields_set, [self.factor, self.pga, self.sa, self.to]
        if wanted.count(None) != 3 and (wanted.count(None) != 4 or not set_keys & {"x", "y", "z"}):
            raise ValueError("give exactly one of `factor`, `pga`, `sa` and `to: target`, or `x`, `y`, `z`")
        if (self.sa is None) != (self.period is None):
            raise ValueError("`sa` and `period` belong together")
        if self.of != "largest" and self.pga is None and self.sa is None:
            raise ValueError("`of` belongs to `pga` and `sa`; a target has its own")
        if self.to is None and (self.factors or self.mean_at_least):
            raise ValueError("`factors` and `mean_at_least` belong to `to: target`")
        if self.factors and not self.factors[0] < self.factors[1]:
            raise ValueError(f"factors: must rise, got {self.factors[0]:g} and {self.factors[1]:g}")
        return self


class RangeConfig(Model):
    """Keep a record whose measure lies in [min, max]; PGA, PGV, PGD and CAV with their unit."""

    min: NumberOrText | None = None
    """Least value."""
    max: NumberOrText | None = None
    """Largest value."""

    def in_unit(self, unit: str) -> tuple[float, float]:
        """The two limits as numbers; minus and plus infinity where there is none."""
        low = float("-inf") if self.min is None else to_si(self.min, unit)
        return low, float("inf") if self.max is None else to_si(self.max, unit)


class RecordConfig(Model):
    """One entry of `records:`.

    Give one source: `file`, `files` (folder or glob), `manifest` (CSV or YAML), `suite` (P-695), or a
    `file` under each component. Then say where the channels go: `components` (axis -> channel), or
    `x_azimuth`, the azimuth of the model's x, to rotate them there by the azimuths in their files.
    `group: station` joins files of one station and event (one file per component) to one record; the three
    files of K-NET and KiK-net are one record anyway. `select` takes so many of the entry's records, those
    nearest to its `target`, `only` those of some names.
    """

    file: Path | None = None
    """Path of a record file."""
    files: str | None = None
    """A folder of record files, or a pattern such as records/*.AT2."""
    manifest: Path | None = None
    """A table of records (CSV or YAML), a row for each."""
    suite: Literal["farfield", "nearfield_pulse", "nearfield_no_pulse"] | None = None
    """A set of FEMA P-695, from the extra `suites`."""
    name: Annotated[str, Field(pattern=r"^[\w.+-]+$"), OfFile] | None = None
    """Name of the result; the file's if not given. Of several records it stands before the name of each."""
    unit: str | None = None
    """Unit of the values, such as g or cm/s2, where the file does not say it."""
    dt: Annotated[Time, Field(gt=0.0, ge=SHORTEST_DT, le=LONGEST_DT)] | None = None
    """Interval of the samples, where the file does not say it."""
    time_column: Annotated[Whole, Field(ge=1, le=10_000)] | None = None
    """Column of sample times, from 1."""
    layout: Literal["columns", "series"] | None = None
    """Meaning of several numbers in a row of plain text: a column each, or one series that runs on."""
    header_lines: Annotated[Whole, Field(ge=0, le=10_000)] = 0
    """Lines of text above the first row of numbers of plain text."""
    delimiter: Delimiter | None = None
    """Character between the numbers of plain text, where their first row does not show it."""
    decimal: Decimal = "point"
    """Decimal sign of plain text."""
    response: Path | None = None
    """StationXML file with the instrument's response."""
    components: dict[Axis, ComponentConfig] = Field(default_factory=dict)
    x_azimuth: Degrees | None = None
    """Azimuth of the model's x, from north to east; channels are rotated there by the azimuths in their
    files."""
    azimuths: dict[str, Degrees | Literal["up", "down"]] = Field(default_factory=dict)
    """Channels whose files do not say where they point, such as {HN1: 35 deg, HN2: 125 deg, HNZ: up}, from
    north to east; for `x_azimuth`."""
    group: Literal["file", "station"] = "file"
    """Files that make one record: each file alone, or those of one station and event."""
    gaps: Literal["error", "zero", "linear"] = "error"
    """Treatment of missing samples: refused, zeros, or lines between their neighbours."""
    align: Literal["error", "overlap"] = "overlap"
    """Treatment of channels that do not start and end together: refused, or cut to what they share."""
    correction: Correction = ()
    """A chain by its name, or steps that are applied in order; none if not given."""
    resampling: Literal["linear", "fourier"] = "linear"
    """Interpolation between the record's own samples."""
    scale: ScaleConfig | None = None
    target: TargetConfig | None = None
    select: Annotated[Whole, Field(ge=1, le=10_000)] | None = None
    """Number of the entry's records that are taken, those nearest to its `target`."""
    match: MatchConfig | None = None
    keep: dict[str, RangeConfig] = Field(default_factory=dict)
    only: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Names of the records that are taken of a folder, a manifest or a set, or patterns such as NORTHR*."""
    after: Annotated[str, Field(min_length=1)] | None = None
    """Name of a record of an entry above, which shakes the model first: of the mainshock of an aftershock."""
    rest: Annotated[Time, Field(gt=0.0, le=LONGEST_REST)] | None = None
    """Time without shaking between the end of the record named by `after` and the start of this one."""

    @property
    def scale_to_measure(self) -> bool:
        """Whether the factor follows from a measure of the motion."""
        scale = self.scale
        return self.target is not None or (scale is not None and (scale.pga or scale.sa) is not None)

    @field_validator("unit")
    @classmethod
    def _unit_of_acceleration(cls, value: str | None) -> str | None:
        if value is not None and unit_in_si(value) <= 0.0:
            raise ValueError(
                f"one unit must be more than 0 m/s2, got {quote(value)}; `reverse: true` turns an axis"
            )
        return value

    @field_validator("azimuths", mode="before")
    @classmethod
    def _codes(cls, value: object) -> object:
        """Codes of channels are words, also where YAML reads a number."""
        return {str(key): azimuth for key, azimuth in value.items()} if isinstance(value, dict) else value

    @field_validator("keep")
    @classmethod
    def _known_measures(cls, value: dict[str, RangeConfig], info: ValidationInfo) -> dict[str, RangeConfig]:
        unknown = sorted(set(value) - set(MEASURES))
        if unknown:
            raise ValueError(f"no such measure {listed(unknown)}; known: {', '.join(MEASURES)}")
        for name, limits in value.items():
            low, high = limits.in_unit(MEASURES[name])
            for key, limit in limits.model_dump(exclude_none=True).items():
                if name in _OFTEN_NOT_SI and not (info.context or {}).get("si"):
                    try:
                        refuse_bare(limit, MEASURES[name])
                    except ValueError as error:
                        raise ValueError(f"{name}: {key}: {error}") from None
            if low > high:
                raise ValueError(f"{name}: min {low:g} is above max {high:g}, no record has that; swap them")
        return value

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.after is None) != (self.rest is None):
            given, missing_key = ("after", "rest") if self.rest is None else ("rest", "after")
            raise ValueError(
                f"`after` and `rest` belong together, and `{given}` stands alone; give `{missing_key}` too, "
                "such as {after: mainshock, rest: 30 s}"
            )
        by_component = any(c.file for c in self.components.values())
        missing = [self.file, self.files, self.manifest, self.suite].count(None)
        if missing != (4 if by_component else 3):
            raise ValueError(
                "give exactly one source: `file`, `files`, `manifest`, `suite`, or a `file` per component"
            )
        if self.only is not None and (self.file or by_component):
            raise ValueError("`only` is for `files`, `manifest` and `suite`, and one file is one record")
        if self.layout == "series" and self.time_column is not None:
            raise ValueError("`layout: series` has no `time_column`; give `dt`")
        if self.azimuths and self.x_azimuth is None:
            raise ValueError("`azimuths` are for the rotation to `x_azimuth`; give that, or take them out")
        if self.components and self.x_azimuth is not None:
            raise ValueError(
                "give `components` or `x_azimuth`, not both: either name the axes or rotate to them"
            )
        if by_component and not all(c.file for c in self.components.values()):
            raise ValueError("when one component has a `file`, every component needs its own")
        return self

    @model_validator(mode="after")
    def _aims(self) -> Self:
        scales = self.scale is not None and self.scale.to == "target"
        if self.target is None and (scales or self.select or self.match):
            raise ValueError("`scale: target`, `select` and `match` need a `target`")
        if self.target is None:
            return self
        if not (scales or self.select or self.match):
            raise ValueError("`target` does nothing alone; add `scale: target`, `match` or `select`")
        if self.match and self.scale:
            raise ValueError("`match` scales to the target itself; leave out `scale`")
        if self.match and self.target.of.startswith("rotd"):
            raise ValueError(
                f"`match` works on components, target.of is {self.target.of}; set of: geometric_mean"
            )
        if self.target.spectrum.unit is not None:
            unit_in_si(self.target.spectrum.unit)
        return self


def read_entry(settings: dict[str, object], source: str) -> RecordConfig:
    """An entry of `records:` that stands in no job.

    Parameters
    ----------
    source : names it in errors

    Raises
    ------
    ConfigError
    """
    try:
        return RecordConfig.model_validate(settings)
    except ValidationError as error:
        raise ConfigError(explain(error, source, RecordConfig)) from None


def read_row(
    path: Path, common: RecordConfig, number: int, row: object
) -> tuple[RecordConfig, dict[str, object]]:
    """One row of a manifest, numbered from 1, and what else it says (event, station, sha256, ...).

    Parameters
    ----------
    path : the manifest, CSV or YAML; files in it start at its folder
    common : the entry that named it, whose settings hold where a row does not say its own
    row : needs `file`, the rest as in `records:`

    Raises
    ------
    ConfigError
        naming manifest and row.
    """
    base = common.model_dump(exclude_unset=True, exclude={"manifest", "name", "only"})
    if not isinstance(row, dict) or not row.get("file"):
        raise ConfigError(f"{path}: record {number}: expected keys with a `file`, got {quote(row)}")
    _refuse_misplaced(path, number, row)
    keys = {key: value for key, value in row.items() if key in _ROW_KEYS and value not in (None, "")}
    other = {
        key: str(value) for key, value in row.items() if key not in _ROW_KEYS and value not in (None, "")
    }
    try:
        return RecordConfig.model_validate(base | keys), dict[str, object](other)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(word) for word in first["loc"])
        message = first["msg"].removeprefix("Value error, ")
        raise ConfigError(f"{path}: record {number} ({row['file']}): {where}: {message}") from None


def _refuse_misplaced(path: Path, number: int, row: dict[object, object]) -> None:
    """A setting that a row cannot have, or is misspelt, would be taken for a remark."""
    for key in row:
        if not isinstance(key, str):
            raise ConfigError(f"{path}: record {number}: more values than the heading has columns")
        word = key.strip().lower()
        if key in _ROW_KEYS or not (row[key] not in (None, "") and word):
            continue
        if word in RecordConfig.model_fields and word not in _ROW_KEYS:
            raise ConfigError(
                f"{path}: record {number}: {key} belongs to the entry of `records:` that names the manifest"
            )
        near = [known for known in ("unit", "dt", "scale", "time_column") if word.startswith(known)]
        near += difflib.get_close_matches(word, _ROW_KEYS, 1, 0.85)
        if near and word != "component":  # which is a remark, "MUL009"
            raise ConfigError(f"{path}: record {number}: no such key {key!r}; did you mean {near[0]}?")


MOST_BYTES = 20e6  # of a manifest in CSV
_ROW_KEYS = {
    "file", "name", "unit", "dt", "time_column", "layout", "header_lines", "delimiter", "decimal", "response",
    "components", "scale",
}  # fmt: skip


def is_manifest(path: Path) -> bool:
    """Tell a file that lists records from a job's YAML file, which is a mapping of keys."""
    if path.suffix.lower() == ".csv":
        return True
    try:
        return isinstance(read_yaml(path), list)
    except ConfigError:
        return False  # the reader of job files says what is wrong


def manifest_rows(path: Path) -> list[object]:
    """The rows of a CSV or YAML manifest as they stand there.

    Raises
    ------
    ConfigError
        for what is no list of records.
    """
    rows = _csv_rows(path) if path.suffix.lower() == ".csv" else read_yaml(path)
    if not isinstance(rows, list) or not rows:
        raise ConfigError(f"{path}: expected a list of records, each with a `file`")
    return rows


def _csv_rows(path: Path) -> list[object]:
    table = read_table(path, most=MOST_BYTES)
    return [dict(zip(table.names, row, strict=True)) for row in table.rows]
