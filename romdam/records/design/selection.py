"""The records of one entry held against its target: chosen, scaled or matched.

References
----------
ASCE/SEI 7-16 (2017), 16.2.3.2 (the mean of the records, 90 % of the target) and C16.2.2 (factors of about
0.25 to 4). EN 1998-1:2004, 3.2.3.1.2(4). PEER (2011), NGA strong-motion database, user's manual: the factor
that makes the mean squared difference of the logarithms least.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.motions.records import RecordConfig, ScaleConfig
from romdam.config.sections.motions.target import NAMED
from romdam.core.errors import RecordError
from romdam.core.motion import GroundMotion
from romdam.records.components import AXES, spectrum
from romdam.records.design.matching import match_motion
from romdam.records.design.target import Target, read_target
from romdam.records.processing.final_motion import said_of_changes, said_of_end

Array = NDArray[np.float64]
USUAL_FACTORS = (0.25, 4.0)  # ASCE/SEI 7-16, C16.2.2


@dataclass(frozen=True)
class Candidate:
    """A record of an entry with a target.

    Attributes
    ----------
    name : of the record
    motion : scaled or matched; None where it is passed over or cannot be used
    factor : that its spectrum needs to be nearest to the target
    misfit : root mean square of ln(record / target) over the target's periods, after what is done to it
    why : it is passed over
    error : for which it cannot be used
    """

    name: str
    motion: GroundMotion | None = None
    factor: float = np.nan
    misfit: float = np.nan
    why: str = ""
    error: RecordError | None = None


@dataclass(frozen=True)
class Fit:
    """A motion beside a target.

    Attributes
    ----------
    motion : as recorded
    psa : (np,) at the target's periods [m/s2]
    factor : applied; 1 where the entry does not scale to its target
    misfit : root mean square of ln(factor psa / target)
    """

    motion: GroundMotion
    psa: Array
    factor: float
    misfit: float


def select_motions(
    entry: RecordConfig, folder: Path, motions: Sequence[GroundMotion], unread: Sequence[str] = ()
) -> list[Candidate]:
    """Choose, scale and match motions as their entry says.

    Parameters
    ----------
    entry : with a `target`
    folder : where the path of the target's table starts
    motions : of the entry, those that can be used
    unread : why others cannot be

    Returns
    -------
    All of them; the chosen ones first where some are chosen, by misfit

    Raises
    ------
    ConfigError, RecordError
        for a target that cannot be read, and fewer records than are to be chosen.
    """
    assert entry.target is not None
    target = read_target(entry.target, folder)
    free = entry.match is not None or (entry.scale is not None and entry.scale.to == "target")
    fits: list[Fit] = []
    others: list[Candidate] = []
    for motion in motions:
        try:
            psa = spectrum(motion.acc, motion.dt, target.periods, target.damping, target.of)
            if not np.all(psa > 0.0):
                raise RecordError("it does not move")
        except RecordError as error:
            others.append(Candidate(motion.name, error=RecordError(f"{motion.name}: target: {error}")))
            continue
        factor = least_squares_factor(psa, target.sa) if free else 1.0
        fit = Fit(motion, psa, factor, misfit(factor * psa, target.sa))
        if text := _out_of_bounds(factor, entry.scale):
            refused = None if entry.select else RecordError(f"{motion.name}: {text}")
            others.append(Candidate(motion.name, None, factor, fit.misfit, text, refused))
        else:
            fits.append(fit)
    if entry.select is not None:  # the nearest to the target; of equal misfits the first name counts
        count = entry.select
        if len(fits) < count:
            why_not = [*(f"{other.name}: {other.error or other.why}" for other in others), *unread]
            rest = "".join(f"\n  {text}" for text in why_not)
            raise RecordError(f"select: {count} records are asked for, {len(fits)} can be used{rest}")
        ranked = sorted(fits, key=lambda fit: (fit.misfit, fit.motion.name))
        why = f"its misfit is above that of the {count} nearest, {ranked[count - 1].misfit:.3g}"
        others = [replace(other, error=None, why=other.why or str(other.error)) for other in others]
        others += [Candidate(fit.motion.name, None, fit.factor, fit.misfit, why) for fit in ranked[count:]]
        fits = ranked[:count]
    common_factor = 1.0  # brings the mean of all records up to `mean_at_least` of the target
    if entry.scale is not None and entry.scale.mean_at_least is not None and fits:
        mean = np.mean([fit.factor * fit.psa for fit in fits], axis=0)
        common_factor = max(1.0, entry.scale.mean_at_least / float(np.min(mean / target.sa)))
    return [_scaled_or_matched(fit, target, common_factor, entry) for fit in fits] + others


def least_squares_factor(psa: Array, target: Array) -> float:
    """Factor that makes the sum of (ln(factor psa / target))^2 least."""
    return float(np.exp(np.mean(np.log(target / psa))))


def misfit(psa: Array, target: Array) -> float:
    """Root mean square of ln(psa / target)."""
    return float(np.sqrt(np.mean(np.log(psa / target) ** 2)))


def _out_of_bounds(factor: float, scale: ScaleConfig | None) -> str:
    if scale is None or scale.factors is None or scale.factors[0] <= factor <= scale.factors[1]:
        return ""
    low, high = scale.factors
    return f"scale.factors: the target needs a factor of {factor:.3g}, the limits are {low:g} and {high:g}"


def _scaled_or_matched(fit: Fit, target: Target, common_factor: float, entry: RecordConfig) -> Candidate:
    """Scale or match a motion, with the warnings and the provenance that follow."""
    motion, factor = fit.motion, common_factor * fit.factor
    if text := _out_of_bounds(factor, entry.scale):  # by what brings the mean up
        return Candidate(motion.name, None, factor, fit.misfit, "", RecordError(f"{motion.name}: {text}"))
    about: dict[str, object] = {
        "of": NAMED[target.of],
        "damping": target.damping,
        "periods_s": target.periods.round(6).tolist(),
        "sa_m_s2": target.sa.round(6).tolist(),
        "factor": factor,
    }
    provenance = dict(motion.provenance)
    try:
        if entry.match is not None:
            acc, added, about["matched"] = match_motion(motion, factor, target, entry.match.tolerance)
            for name, count in zip(("pad_before_s", "pad_after_s"), added, strict=True):
                earlier = provenance.get(name)
                provenance[name] = count * motion.dt + (earlier if isinstance(earlier, int | float) else 0.0)
        else:
            acc = factor * motion.acc
    except RecordError as error:
        return Candidate(motion.name, None, factor, fit.misfit, "", error)
    psa = spectrum(acc, motion.dt, target.periods, target.damping, target.of)
    about["misfit"] = misfit(psa, target.sa)
    warnings = list(motion.warnings)
    low, high = USUAL_FACTORS
    if not low <= factor <= high:
        warnings.append(
            f"the factor to the target is {factor:.3g}, usual are {low:g} to {high:g} (ASCE/SEI 7-16, "
            "C16.2.2)"
        )
    channels = provenance.get("channels")
    stated = [channel.get("lowest_usable_hz") for channel in channels] if isinstance(channels, list) else []
    usable = max((value for value in stated if isinstance(value, float)), default=0.0)
    if usable * target.periods[-1] > 1.0:  # the record has no signal at the longest periods
        warnings.append(
            f"target.periods go to {target.periods[-1]:g} s, the record is usable up to {1.0 / usable:.3g} s"
        )
    if entry.match is not None:
        ends = said_of_end(acc, motion.dt, AXES)
        changes = said_of_changes(factor * motion.acc, acc, motion.dt, AXES, "matching")
        kept = [
            text for text in warnings if not text.startswith(("the velocity ends", "the displacement ends"))
        ]
        warnings = [*kept, *ends, *changes]
    scaled = replace(motion, acc=acc, provenance=provenance | {"target": about}, warnings=tuple(warnings))
    return Candidate(motion.name, scaled, factor, misfit(psa, target.sa))
