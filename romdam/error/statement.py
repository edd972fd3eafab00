"""A statement of error, and the one place where it is written and read: result files, JSON, terminal.

Three kinds state how far a reduced run is from the mesh it was reduced from, the fourth how far that mesh is
from finer ones. They share their words and their measures, and differ in what they compare with
(`romdam.error.comparison`):

    estimate      a slightly finer reduced model, in the seconds in which joints move; made with every run
    certificate   the run corrected by the full order's own answer to its joint forces; `romdam certify`
    verification  a run of the full order; `romdam verify`
    discretisation  a run on a mesh of half, or twice, the size of the elements; `romdam verify --mesh`
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from romdam.core.errors import ResultError
from romdam.core.files import check_file, replacing
from romdam.core.fingerprint import fingerprint
from romdam.core.sealed import changing, reading, text_of
from romdam.core.version import SOURCE
from romdam.error.metrics import FLOOR, RelativeError
from romdam.postprocess.checks import MISSED, verdict
from romdam.postprocess.stated_errors import percent, total_error

if TYPE_CHECKING:  # workers write no file
    import xarray as xr

log = logging.getLogger(__name__)

Kind = Literal["estimate", "certificate", "verification", "discretisation"]

_RELATIVE = f"relative to the joint's own history, or to {FLOOR:.0%} of that of all joints where it is less"
FILES: dict[Kind, str] = {"verification": "verification.json", "discretisation": "discretisation.json"}
_SELF = "content_sha256"  # of everything else in that file
_OF_WHAT = ("configuration_sha256", "scene_sha256", "record", "record_sha256")  # attributes of a result
_MOST = 4e9  # bytes of a file that is read whole


class _Names(NamedTuple):
    """Attributes of a result: the sentence, what its numbers begin with, and all of it as JSON."""

    sentence: str
    numbers: str
    document: str | None


_NAMES: dict[Kind, _Names] = {
    "verification": _Names("error_statement", "verification", "verification"),
    "certificate": _Names("certificate_statement", "certificate", "certificate"),
    "estimate": _Names("error_estimate", "error_estimate", None),
    "discretisation": _Names("discretisation_statement", "discretisation", "discretisation"),
}


@dataclass(frozen=True)
class ErrorStatement:
    """Distance of a result from what it stands for.

    Attributes
    ----------
    kind : what it was compared with
    sentence : for a reader
    errors : quantity ("opening", "displacement", "energy") -> its relative error; empty where it is unknown
    details : further plain values, name -> value
    """

    kind: Kind
    sentence: str
    errors: Mapping[str, RelativeError]
    details: Mapping[str, object] = field(default_factory=dict)

    @property
    def document(self) -> dict[str, object]:
        """All of it as plain values, for JSON."""
        errors = {name: error.plain for name, error in self.errors.items()}
        return {"statement": self.sentence, "error": errors, **self.details}

    @property
    def attributes(self) -> dict[str, object]:
        """Attributes of a result file: the sentence, each error as a number, and all of it as JSON."""
        return _attributes(self.kind, self.document)

    def write_to(self, dataset: xr.Dataset) -> None:
        """State it in a dataset with dimension `joint`; an estimate is stated for each joint too."""
        dataset.attrs.update(self.attributes)
        opening = self.errors.get("opening")
        if self.kind != "estimate" or opening is None or not opening.joints:
            return
        joints = opening.joints
        for measure, what in (("l2", "of the openings in L2"), ("peak", "of the largest opening")):
            values = np.array([getattr(joints[str(name)], measure) for name in dataset.joint.values])
            name = f"estimated relative error {what}, from leaving out modes"
            about = {"long_name": name, "units": "1", "comment": _RELATIVE}
            dataset[f"estimated_error_{measure}"] = ("joint", values, about)


def unknown_estimate(why: str) -> ErrorStatement:
    """State that the error of leaving out modes is unknown, and why."""
    sentence = (
        f"What leaving out modes changes is unknown: {why}. `romdam certify` and `romdam verify` state it "
        "where they can."
    )
    return ErrorStatement("estimate", sentence, {})


def sentences(attributes: Mapping[str, object]) -> dict[Kind, str]:
    """The sentences that a result states of its error."""
    return {kind: str(attributes[n.sentence]) for kind, n in _NAMES.items() if n.sentence in attributes}


def opening_errors(attributes: Mapping[str, object], measure: str = "l2") -> dict[str, float]:
    """Errors of the openings that a result states: of its mesh, of its modes and of its steps.

    Those that are not known are left out.

    Parameters
    ----------
    measure : "l2", or "peak" for those of their peaks
    """
    modes = ("verification", "certificate", "error_estimate")
    known = {
        "mesh": f"discretisation_opening_{measure}",
        "modes": next((key for kind in modes if (key := f"{kind}_opening_{measure}") in attributes), ""),
        "steps": "solver_estimated_time_error" + ("_peaks" if measure == "peak" else ""),
    }
    errors = {name: float(str(attributes[key])) for name, key in known.items() if key in attributes}
    if attributes["model_order"] == "full":
        errors["modes"] = 0.0
    return errors


def quantity_errors(attributes: Mapping[str, object]) -> dict[Kind, dict[str, tuple[float, float]]]:
    """Every error that a result states: kind of the statement -> quantity -> (in L2, of the peak)."""
    stated: dict[Kind, dict[str, tuple[float, float]]] = {}
    for kind, names in _NAMES.items():
        start, end = f"{names.numbers}_", "_l2"
        quantities = [
            key[len(start) : -len(end)] for key in attributes if key.startswith(start) and key.endswith(end)
        ]
        both = {name: tuple(f"{start}{name}_{norm}" for norm in ("l2", "peak")) for name in quantities}
        stated[kind] = {
            name: (float(str(attributes[l2])), float(str(attributes.get(peak, "nan"))))
            for name, (l2, peak) in both.items()
        }
    return {kind: errors for kind, errors in stated.items() if errors}


def row_errors(attributes: Mapping[str, object]) -> dict[str, float]:
    """Those of `opening_errors` that a row of a summary has besides that of the steps, by their names."""
    errors = opening_errors(attributes)
    names = {"estimated_reduction_error": "modes", "estimated_mesh_error": "mesh"}
    return {name: errors[part] for name, part in names.items() if part in errors}


def accuracy_warnings(
    attributes: Mapping[str, object], accuracy: float | None, total: float | None
) -> list[str]:
    """Say where a run's own statements are beyond the accuracy that its job asks for.

    Parameters
    ----------
    attributes : of the result
    accuracy : of steps and modes each, if one is asked for; the steps have a warning of their own
    total : of mesh, modes and steps together, if one is asked for
    """
    errors = opening_errors(attributes)
    if total is not None:
        reached, unknown = total_error(errors)
        if unknown:
            return [
                f"whether the total accuracy of {percent(total)} is kept is not known: the error of the "
                f"{' and of the '.join(unknown)} is not"
            ]
        if verdict(reached, total) == MISSED:
            parts = ", ".join(f"{name} {percent(value)}" for name, value in errors.items())
            return [
                f"the total accuracy of {percent(total)} is NOT kept: {percent(reached)} are stated ({parts})"
                + ("; model.modes: auto chooses the modes for it" if errors["modes"] > total / 5.0 else "")
            ]
        return []
    if accuracy is not None and verdict(errors.get("modes"), accuracy) == MISSED:
        return [
            f"leaving out modes changes the openings by about {percent(errors['modes'])}, wanted was an "
            f"accuracy of {percent(accuracy)}: take more modes, or model.modes: auto, which chooses them"
        ]
    return []


def write_certificate(path: Path, statement: ErrorStatement) -> Path:
    """Write <result>.certificate.json beside a result, and put the statement into the result itself.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    target = path.with_suffix(".certificate.json")
    _write_json(target, statement.document)
    _attach(path, statement.attributes)
    return target


def write_verification(folder: Path, statement: ErrorStatement) -> Path:
    """Write the file of a statement of its kind, and put that into every result there that it is true of.

    That is of the same configuration and the same scene, and if of the same record, then of the same samples.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    path, document = folder / FILES[statement.kind], statement.document
    _write_json(path, document | {_SELF: fingerprint(json.dumps(document))})
    for result in sorted(folder.glob("*.nc")):
        try:
            with reading(result) as file:
                labels = {name: text_of(file, name) for name in _OF_WHAT}
        except ResultError as error:  # a file that is damaged is left as it is
            log.warning("%s; it gets no statement of its error", error)
            continue
        same = labels["configuration_sha256"] == document["configuration_sha256"]
        if same and not _other(document, labels):
            _attach(result, statement.attributes)
    return path


def read_verification(folder: Path, labels: Mapping[str, object]) -> dict[str, object]:
    """Attributes for a result from what was stated earlier, where that is true of it; else none.

    Parameters
    ----------
    labels : the result's attributes: SHA-256 of its configuration, its scene and its record, whose name too

    Warns where the configuration is the same and what it is of is not.
    """
    attributes: dict[str, object] = {}
    for kind, name in FILES.items():
        path = folder / name
        if not path.exists():
            continue
        try:
            check_file(path, _MOST, ResultError)
            document = json.loads(path.read_text(encoding="utf-8"))
            digest = document.pop(_SELF, None)
        except (OSError, ValueError, RecursionError, AttributeError, TypeError, ResultError) as error:
            log.warning("%s: cannot be read (%s); `romdam verify` writes it again", path, error)
            continue
        if digest != fingerprint(json.dumps(document)):
            log.warning("%s: is not as it was written; `romdam verify` writes it again", path)
        elif document.get("configuration_sha256") != labels["configuration_sha256"]:
            continue
        elif other := _other(document, labels):
            log.warning(
                "%s: is not stated in the result of %s: %s; `romdam verify` states what is true of it",
                path, labels["record"], other,
            )  # fmt: skip
        else:
            attributes |= _attributes(kind, document)
    return attributes


def _other(document: Mapping[str, object], labels: Mapping[str, object]) -> str:
    """Say what a verification is of that a result of its configuration is not; empty where both agree."""
    if "scene_sha256" not in document or "record_sha256" not in document:
        return "it does not say of which mesh and which samples it is"
    if document["scene_sha256"] != labels["scene_sha256"]:
        return "it is of another scene, a mesh, matrices or gaps have changed since, or the code"
    same_record = document.get("record") == labels["record"]
    if same_record and document["record_sha256"] != labels["record_sha256"]:
        return "it is of other samples of that record"
    return ""


def _attributes(kind: Kind, document: dict[str, object]) -> dict[str, object]:
    names, errors = _NAMES[kind], document.get("error", {})
    stated: dict[str, object] = {names.sentence: document["statement"]}
    if isinstance(errors, dict):
        for quantity, error in errors.items():
            stated |= {f"{names.numbers}_{quantity}_{norm}": error[norm] for norm in ("l2", "peak")}
    if names.document is not None:
        return stated | {names.document: json.dumps(document)}
    rest = {name: value for name, value in document.items() if name not in ("statement", "error")}
    return stated | {f"{names.numbers}_{name}": value for name, value in rest.items()}


def _write_json(path: Path, document: Mapping[str, object]) -> None:
    with replacing(path) as unfinished:
        unfinished.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def _attach(path: Path, attributes: dict[str, object]) -> None:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    with changing(path) as file:
        line = f"{now}: error stated by {SOURCE}"
        file.attrs.update(attributes, history=f"{text_of(file, 'history')}\n{line}".strip())
