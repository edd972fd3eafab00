"""Settings that couple the modes of a reduced model, and those that then cannot be had."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from romdam.config.effects import EFFECTS, acting_effects, has_viscous_boundary
from romdam.config.sections.job import Sections
from romdam.core.integrators import INTEGRATORS

# effects with remedies of their own in `couplings`; a free field has a viscous boundary
_ABOVE = {"viscous boundary", "free field", "compressible water"}


class Coupling(NamedTuple):
    """A key that makes modes coupled, what couples them, what to write in place of it.

    `of_solids` tells whether it is part of the damping of the solids.
    """

    key: str
    by: str
    remedy: str
    of_solids: bool = True


def couplings(config: Sections) -> tuple[Coupling, ...]:
    """Everything that couples the modes of a job."""
    every = list[Coupling]()
    if has_viscous_boundary(config):
        key = "ground.viscous" if config.ground.viscous else "arch_dam.rock.boundary"
        remedy = "hold the rock by supports (`boundary: fixed`) and give it `mass: false`"
        every.append(Coupling(key, "dashpots of viscous faces", remedy))
    if config.water is not None and config.water.has_waves:
        every.append(Coupling("water.model", "compressible water", "set water.model: incompressible", False))
    for name, block in config.blocks.items():
        if block.matrices is not None and block.matrices.damping is not None:
            remedy = "leave it out: damping.rayleigh then damps this block too"
            every.append(Coupling(f"blocks.{name}.matrices.damping", "a damping matrix", remedy))
    for name in sorted(acting_effects(config) - _ABOVE):
        if EFFECTS[name].modes == "coupled":
            every.append(Coupling(EFFECTS[name].key, name, f"leave `{EFFECTS[name].key}` out"))
        elif EFFECTS[name].modes == "unknown":
            by = f"{name}, which nothing here is known of,"
            every.append(Coupling(EFFECTS[name].key, by, "leave it out"))
    return tuple(every)


def refuse_coupled(every: Sequence[Coupling], integrator: str | None, varied: Collection[str]) -> None:
    """Refuse what needs modes that nothing couples.

    Parameters
    ----------
    every : what couples them
    integrator : that is asked for, if any
    varied : paths of what samples of a suite vary

    Raises
    ------
    ValueError
        with the key and the remedy.
    """
    ratios = [path for path in varied if path.startswith("damping.")]
    for coupled in every if ratios else ():
        if not coupled.of_solids:
            continue
        raise ValueError(
            f"suite.parameters: {len(ratios)} of damping varied, limit 0 with {coupled.by} "
            f"({coupled.key}): they are "
            f"in the modes' damping too; vary joints, or {coupled.remedy}"
        )
    for coupled in every if integrator is not None and INTEGRATORS[integrator].uncoupled else ():
        raise ValueError(
            f"transient.integrator: {integrator} needs modes that nothing couples, and {coupled.by} "
            f"({coupled.key}) "
            f"couple them; leave the integrator out, or {coupled.remedy}"
        )
