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

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.system import History
from romdam.error.certificate import compared_correction, compared_whole
from romdam.error.comparison import ComparedRun, compare
from romdam.error.estimate import WINDOW, jump_of_forces, start_at
from romdam.error.metrics import largest_difference, relative_l2
from romdam.error.replay import Forces, Replayed, corrected_run, measure_defect
from romdam.error.statement import ErrorStatement
from romdam.postprocess.stated_errors import percent
from romdam.results.stored_run import StoredRun
from romdam.timestepping.prepared import Prepared, Progress
from romdam.timestepping.settings import Settings

SHORTEST = 2.0 * WINDOW  # [s] of a record of which a sample is taken; a shorter one is solved throughout
_DOUBT = 2.0  # of what a window shows, from nothing at its start
_OWN = 0.03  # relative, of a certificate: the largest error of 30 against the truth


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

    def corrected(
        self, rows: slice, joints: Mapping[str, slice], progress: Progress
    ) -> tuple[ComparedRun, ComparedRun]:
        """The finer model's run in a window, and the same corrected by the mesh."""
        first, last, system = rows.start, rows.stop - 1, self.finer.system
        history, stride, n = self.history, self.settings.steps.stride, self.forces.substeps
        assert history.q is not None
        jump = jump_of_forces(history, system, history.q[first], first)
        start = start_at(history, system.law, first, jump, self.settings.initial_state == "static")
        fine = Replayed(system, start.q, self.basis, start.v)
        full = replace(self.full, start=self.basis @ start.q, rate=self.basis @ start.v)
        forces = replace(
            self.forces,
            ground=self.forces.ground[:, first * n : last * n + 1],
            mean=self.forces.mean[first : last + 1],
        )
        defect = measure_defect((full, fine, fine), forces, progress)
        ground = self.ground[:, first * stride : last * stride + 1]
        better = corrected_run(self.finer, ground, replace(self.settings, start=start), defect.jump_fine)
        return self.compared(rows, joints), compared_correction(better, defect, joints)

    def compared(self, rows: slice, joints: Mapping[str, slice]) -> ComparedRun:
        """The finer model's run in some rows."""
        run, strain = self.history, self.history.energy["strain"]
        return compared_whole(run.time[rows], run.jump[rows, :, 0], run.disp[rows], strain[rows], joints)


def sampled_certificate(
    run: StoredRun, sampling: Sampling, joints: dict[str, slice], progress: Progress
) -> ErrorStatement:
    """State the error of a run from a sample of the mesh's answers.

    Parameters
    ----------
    joints : name -> slice of its gaps
    progress : called with (rows done, rows in all) of the windows
    """
    windows = sample_windows(sampling.history)

    def after(windows_done: int) -> Progress:
        return lambda done, total: progress(windows_done * total + done, len(windows) * total)

    pairs = [sampling.corrected(rows, joints, after(n)) for n, rows in enumerate(windows)]
    judged = compared_whole(run.time, run.jump[..., 0], run.disp, run.strain, joints)
    errors = compare("certificate", judged, sampling.compared(slice(None), joints)).errors
    within = {}
    for name, error in errors.items():
        coarse, better = (
            np.concatenate([each.opening if name == "opening" else each.histories[name] for each in runs])
            for runs in zip(*pairs, strict=True)
        )
        # a peak's share is relative to the largest value, as its error is
        rests = {"l2": relative_l2(coarse, better), "peak": largest_difference(coarse, better, opens=True)}
        within[name] = dict[str, list[float]]()
        for norm, rest in rests.items():
            value = float(getattr(error, norm))
            doubt = _DOUBT * rest + _OWN * value
            within[name][norm] = [max(0.0, value - doubt), value + doubt]
    times = [[float(run.time[rows.start]), float(run.time[rows.stop - 1])] for rows in windows]
    share = sum(end - start for start, end in times) / float(run.time[-1])
    details = {
        "record": run.attributes["record"],
        "result": run.path.name,
        "within": within,
        "windows": times,
        "sampled_share": share,
        "peak_opening": float(judged.opening.max()),
        "configuration_sha256": run.attributes["configuration_sha256"],
    }
    return ErrorStatement("certificate", _sentence(run, within, share), errors, details)


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
