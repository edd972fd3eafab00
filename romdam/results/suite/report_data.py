"""The data of a report besides the summary: spectra of the records, a picture of the scene, one file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from romdam.core.errors import ResultError
from romdam.core.motion import GroundMotion
from romdam.core.version import SOURCE
from romdam.postprocess.record_measures import largest_psa
from romdam.results.dataset import open_dataset

DATA = "report-data.nc"
PERIODS = np.geomspace(0.02, 5.0, 60)  # [s]
DAMPING = 0.05
_PICTURE = {"units": "1", "long_name": "the scene, bytes of a PNG"}
_KEYS = ("configuration_sha256", "runs_sha256")  # attributes of the summary that the data belong to


def report_data(
    summary: xr.Dataset, motions: Mapping[str, GroundMotion], picture: bytes | None
) -> xr.Dataset:
    """Spectra of a suite's records at the middle one of its scales, and a picture.

    Parameters
    ----------
    summary : of the suite
    motions : record -> motion before the suite's scale; records that cannot be used have none
    picture : bytes of a PNG

    Returns
    -------
    Dataset : `psa` (record, period) [m/s2] of the largest component, NaN without a motion; `picture` (byte)
    """
    middle = summary.sizes["scale"] // 2
    scale = float(summary.scale[middle])
    spectra = [largest_psa(motions.get(str(name)), PERIODS, DAMPING) for name in summary.record.values]
    psa = summary.scale_factor.values[:, middle, None] * np.array(spectra)
    scaled = _as_run([motion for motion in motions.values() if motion is not None], scale)
    if summary.scale.attrs.get("units", "1") != "1":
        scaled = f"scaled to {scale:g} m/s²"
    data = {
        "psa": (("record", "period"), psa, {"units": "m s-2", "long_name": "pseudo-spectral acceleration"}),
        "picture": ("byte", np.frombuffer(picture or b"", dtype=np.uint8), _PICTURE),
    }
    attributes = {
        "title": f"Data of the page of {summary.attrs.get('title', 'a suite')}",
        "source": SOURCE,
        "damping": DAMPING,
        "scaled": scaled,
        **{key: str(summary.attrs.get(key, "")) for key in _KEYS},
    }
    coords = {
        "record": ("record", summary.record.values.astype(str), {"long_name": "name of the record"}),
        "period": ("period", PERIODS, {"units": "s", "long_name": "period of the oscillator"}),
    }
    return xr.Dataset(data, coords, attributes)


def _as_run(motions: Sequence[GroundMotion], scale: float) -> str:
    """Say what was done to the size of records: by their entries, and by the suite."""
    moving = [motion.entry_factors[motion.acc.any(axis=1)] for motion in motions]
    factors, treatment = np.concatenate([*moving, np.zeros(0)]), "as recorded"
    if (factors != 1.0).any():
        low, high = factors.min(), factors.max()
        treatment = f"scaled by {low:.3g}" if np.isclose(low, high) else f"scaled by {low:.3g} to {high:.3g}"
    if any(motion.is_matched for motion in motions):
        treatment = "matched to their target"
    return treatment if scale == 1.0 else f"{scale:g} times {treatment}"


def read_report_data(summary: xr.Dataset, folder: Path) -> xr.Dataset | None:
    """The data of this very summary; None where there are none.

    Raises
    ------
    ResultError
        where the file is no result of romdam's.
    """
    if not (folder / DATA).is_file():
        return None
    with open_dataset(folder / DATA) as data:
        if missing := [name for name in ("psa", "picture", "record", "period") if name not in data.variables]:
            raise ResultError(
                f"{folder / DATA}: lacks {', '.join(missing)}; `romdam report --config` writes it again"
            )
        same = all(str(data.attrs.get(key, "")) == str(summary.attrs.get(key, "")) for key in _KEYS)
        same = same and list(data.record.values) == list(summary.record.values)
        return data.load() if same else None
