"""The certificate from a sample of the record: the mesh is solved in windows, all else throughout.

With x the run, z that of the finer model and y the one corrected by the full order (`romdam.error.replay`),

    | |x - y| - |x - z| |  <=  |z - y| .

x - z costs no solution with the mesh and is taken over the whole record. What the finer model itself lacks,
z - y, is a few per cent of it, and is sampled: in the window that leads to the largest opening and in one
drawn from the rest of the record, always the same one. In both the mesh, the finer model and the corrected
run start from z's own state, so that z - y grows from nothing; as with the estimate, which does so too, that
shows z - y to a factor of two. The interval has that factor, and what certificates of whole records are off.
A peak's share is the largest difference anywhere, which bounds that of two peaks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.system import History
from romdam.error.estimate import WINDOW, start_at
from romdam.error.metrics import RelativeError, magnitude_error, opening_error, relative_l2
from romdam.error.replay import Forces, Replayed, corrected_run, measure_defect
from romdam.error.statement import ErrorStatement
from romdam.postprocess.stated_errors import percent
from romdam.results.stored_run import StoredRun
from romdam.timestepping.prepared import Prepared, Progress
from romdam.timestepping.settings import Settings, Start

SHORTEST = 2.0 * WINDOW  # [s] of a record of which a sample is taken; a shorter one is solved throughout
_DOUBT = 2.0  # of what a window shows, from nothing at its start
_OWN = 0.03  # relative, of a certificate: the largest error of 30 against the truth


@dataclass(frozen=True)
class Quantities:
    """Histories that are compared.

    Attributes
    ----------
    opening, disp, strain : (nt, ng) [m], (nt, 3 * probes) [m], empty without output nodes, (nt,) [J]
    """

    opening: Floats
    disp: Floats
    strain: Floats

    def against(self, better: Quantities, joints: dict[str, slice]) -> dict[str, RelativeError]:
        """Errors of every quantity that there is; joints are name -> slice of its gaps."""
        errors = {"opening": opening_error(self.opening, better.opening, joints)}
        if self.disp.size:
            errors["displacement"] = magnitude_error(self.disp, better.disp)
        return errors | {"energy": magnitude_error(self.strain, better.strain)}


def joined(parts: list[Quantities]) -> Quantities:
    """One after another."""
    names = ("opening", "disp", "strain")
    return Quantities(
        *(np.concatenate([getattr(quantities, name) for quantities in parts]) for name in names)
    )


def sample_windows(history: History, seconds: float = WINDOW) -> list[slice]:
    """Rows of the window that leads to the largest opening, and of one from the rest, if there is room.

    Parameters
    ----------
    seconds : of each; a twelfth of the first lies after the peak
    """
    rows, length = len(history.time), round(seconds / float(history.time[1]))
    peak = int(history.jump[:, :, 0].max(axis=1).argmax())
    last = min(max(peak + length // 12, length), rows - 1)
    apart = np.concatenate([np.arange(last - 2 * length + 1), np.arange(last, rows - length)])
    firsts = [last - length]
    if len(apart):
        firsts.append(int(apart[np.random.default_rng(0).integers(len(apart))]))
    return [slice(first, first + length + 1) for first in firsts]


@dataclass(frozen=True)
class Sampling:
    """Inputs of a window.

    Attributes
    ----------
    finer, history : the finer model and its run over the whole record, with its coordinates
    full, basis : the mesh, and the finer model's basis (unknowns, n)
    forces : see `Forces`, of that run over the whole record
    ground, settings : (3, nt) at every base step [m/s2], and those of the run
    """

    finer: Prepared
    history: History
    full: Replayed
    basis: Floats
    forces: Forces
    ground: Floats
    settings: Settings

    def corrected(self, rows: slice, progress: Progress) -> tuple[Quantities, Quantities]:
        """The finer model's run in a window, and the same corrected by the mesh."""
        first, last, history = rows.start, rows.stop - 1, self.history
        start = self._start(first)
        fine = Replayed(self.finer.system, start.q, self.basis, start.v)
        full = replace(self.full, start=self.basis @ start.q, rate=self.basis @ start.v)
        defect = measure_defect((full, fine, fine), self._forces(first, last), progress)
        stride = self.settings.steps.stride
        ground = self.ground[:, first * stride : last * stride + 1]
        settings = replace(self.settings, start=start)
        better = corrected_run(self.finer, ground, settings, defect.jump_fine)
        directions = history.jump.shape[2]
        coarse = Quantities(history.jump[rows, :, 0], history.disp[rows], history.energy["strain"][rows])
        opening = better.jump[..., 0] + defect.point_fine[:, ::directions]
        return coarse, Quantities(opening, better.disp + defect.disp_fine, better.energy["strain"])

    def _start(self, row: int) -> Start:
        """The finer run's state in a row, its jumps those that joint forces see."""
        history, system = self.history, self.finer.system
        assert history.q is not None
        jump = history.jump[row]
        if system.at_point is not None:
            jump = jump - system.more_at_points(history.q[row]).reshape(jump.shape)
        static = self.settings.initial_state == "static"
        return start_at(history, self.finer.system.law, row, jump, static)

    def _forces(self, first: int, last: int) -> Forces:
        n = self.forces.substeps
        ground = self.forces.ground[:, first * n : last * n + 1]
        return replace(self.forces, ground=ground, mean=self.forces.mean[first : last + 1])


def sampled_certificate(
    run: StoredRun, sampling: Sampling, joints: dict[str, slice], progress: Progress
) -> ErrorStatement:
    """State the error of a run from a sample of the mesh's answers.

    Parameters
    ----------
    joints : name -> slice of its gaps
    progress : called with (rows done, rows in all) of the windows
    """
    history = sampling.history
    windows = sample_windows(history)
    pairs = [sampling.corrected(rows, _after(progress, n, len(windows))) for n, rows in enumerate(windows)]
    coarse, better = (joined([pair[k] for pair in pairs]) for k in (0, 1))
    fine = Quantities(history.jump[..., 0], history.disp, history.energy["strain"])
    errors = Quantities(run.jump[..., 0], run.disp, run.strain).against(fine, joints)
    histories = {"opening": "opening", "displacement": "disp", "energy": "strain"}
    windowed = {
        name: [getattr(quantities, histories[name]) for quantities in (coarse, better)] for name in errors
    }
    within = {
        name: {
            "l2": _interval(error.l2, relative_l2(*windowed[name])),
            "peak": _interval(error.peak, _largest(*windowed[name])),
        }
        for name, error in errors.items()
    }
    times = [[float(run.time[rows.start]), float(run.time[rows.stop - 1])] for rows in windows]
    share = sum(end - start for start, end in times) / float(run.time[-1])
    details = {
        "record": run.attributes["record"],
        "result": run.path.name,
        "within": within,
        "windows": times,
        "sampled_share": share,
        "peak_opening": float(run.jump[..., 0].max()),
        "configuration_sha256": run.attributes["configuration_sha256"],
    }
    return ErrorStatement("certificate", _sentence(run, within, share), errors, details)


def _after(progress: Progress, before: int, windows: int) -> Progress:
    """Progress of one of several windows of one length."""
    return lambda done, total: progress(before * total + done, windows * total)


def _largest(coarse: Floats, better: Floats) -> float:
    """Largest difference over the largest value, as a peak's error is relative to it."""
    size = float(better.max(initial=0.0)) or float(np.abs(better).max(initial=0.0))
    return float(np.abs(coarse - better).max(initial=0.0)) / size if size > 0.0 else 0.0


def _interval(error: float, rest: float) -> list[float]:
    doubt = _DOUBT * rest + _OWN * error
    return [max(0.0, error - doubt), error + doubt]


def _sentence(run: StoredRun, within: dict[str, dict[str, list[float]]], share: float) -> str:
    def between(name: str, measure: str) -> str:
        return " to ".join(percent(value) for value in within[name][measure])

    moved = f"displacements by {between('displacement', 'l2')}, " if "displacement" in within else ""
    return (
        f"Certificate from a sample, {run.time[-1]:g} s of {run.attributes['record']}: leaving out modes "
        f"changes the openings by {between('opening', 'l2')} in L2 and {between('opening', 'peak')} at the "
        f"peak, {moved}strain energy by "
        f"{between('energy', 'l2')}; the mesh was solved in {percent(share)} of the record, "
        "`romdam certify --full` solves it in all. The step's own error is not in it."
    )
