"""Results of runs that a suite keeps whole: named by place and content, relabelled where the design moves.

`runs/<record>__<scale>__<sample>-<key>.nc`: the first part says where the run stands in the design, the
second what it is of, so a run that moves never takes the name of another. A file is believed where its bytes
are those that its row says. Of two runs of one content the first in the design has the file.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from multiprocessing import parent_process

from romdam.config.sections.suite import KeepConfig
from romdam.core.errors import ResultError
from romdam.core.files import check_file
from romdam.core.fingerprint import file_digest, fingerprint
from romdam.core.motion import GroundMotion
from romdam.core.sealed import changing
from romdam.error.statement import ErrorStatement
from romdam.pipelines.suites.tasks import Run, Suite, scaled
from romdam.postprocess.responses import PARAMETER
from romdam.results.dataset import (
    Timing,
    build_dataset,
    job_labels,
    record_labels,
    single_precision,
    write_dataset,
)
from romdam.results.stored_run import FOLDER, folder_from
from romdam.results.suite.rows import Kept, SuiteRow
from romdam.results.variables import Case

log = logging.getLogger(__name__)

RUN_KEY = "suite_run_key"  # attribute of a kept result
KEY_LETTERS = 12  # of the key, in a file's name
_MOST = 1e12  # bytes
Labels = dict[str, object]


def file_name(run: Run) -> str:
    """Of the result of a run."""
    return f"{run.name}-{run.key[:KEY_LETTERS]}.nc"


def write_kept(suite: Suite, run: Run, case: Case, estimate: ErrorStatement | None) -> Kept:
    """Write the result of a run.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it, and in a worker whose suite was killed: another may be at
        work in the folder by now.
    """
    parent = parent_process()
    if parent is not None and not parent.is_alive():
        raise ResultError(f"{suite.folder}: nothing more is written, the suite of this worker was killed")
    dataset = build_dataset(case, suite.job, Timing({}, {}), suite.files.get("model_file"))
    dataset.attrs.pop("solver_batch", None)  # how many runs were integrated together is not of this one
    labels = _labels(suite, job_labels(suite.job), run, case.motion)
    if estimate is not None:
        estimate.write_to(dataset)
    dataset.attrs.update(suite.files | labels | {RUN_KEY: run.key})
    keep = suite.config.keep
    if isinstance(keep, KeepConfig) and keep.precision == "single":
        dataset = single_precision(dataset)
    path = suite.folder / file_name(run)
    write_dataset(dataset, path, case.history.final if keep == "full" else None)
    return Kept(path.name, file_digest(path), fingerprint(labels), suite.files)


def _labels(suite: Suite, of_job: Labels, run: Run, motion: GroundMotion) -> Labels:
    """Attributes of a result that follow from the design and the configuration, not from its content."""
    values = suite.samples.values[run.index[2]]
    return (
        of_job
        | record_labels(motion)
        | {PARAMETER + name: value for name, value in values.items()}
        | {FOLDER: folder_from(suite.folder, suite.job.folder)}
    )


class KeptResults:
    """The kept results of a suite that are there already, brought to what its design calls them now."""

    def __init__(self, suite: Suite, motions: dict[str, GroundMotion]) -> None:
        self._suite, self._motions = suite, motions
        self._of_job = job_labels(suite.job)

    def placed(self, run: Run, row: SuiteRow) -> SuiteRow | None:
        """The row of a run with its result under the name and labels of this design.

        None where the result is not there, or is not what was written.

        Raises
        ------
        ResultError
            where the folder or the disk refuses a file.
        """
        if row.message:
            return row
        kept = row.kept
        if kept is None or kept.shared != self._suite.files or not self._is_whole(kept):
            return None
        labels = _labels(self._suite, self._of_job, run, scaled(self._motions[run.record], run))
        wanted = replace(kept, file=file_name(run), labels=fingerprint(labels))
        return row if wanted == kept else replace(row, kept=self._relabelled(kept, wanted, labels))

    def remove_former(self, before: SuiteRow, now: SuiteRow) -> None:
        """Remove a result whose row names another file by now."""
        if before.kept is not None and now.kept is not None and before.kept.file != now.kept.file:
            (self._suite.folder / before.kept.file).unlink(missing_ok=True)

    def _is_whole(self, kept: Kept) -> bool:
        """True where a file's bytes are as written; HDF5 is not asked, damage can make it hang."""
        path = self._suite.folder / kept.file
        if not path.exists():
            return False
        try:
            check_file(path, _MOST, ResultError)
            if file_digest(path) == kept.sha256:
                return True
            log.warning("%s: is not as it was written; its run is made again", path)
        except (OSError, ResultError) as error:
            log.warning("%s: cannot be read (%s); its run is made again", path, error)
        return False

    def _relabelled(self, kept: Kept, wanted: Kept, labels: Labels) -> Kept:
        source, target = self._suite.folder / kept.file, self._suite.folder / wanted.file
        with changing(source, target) as file:
            for name in [n for n in file.attrs if n.startswith(PARAMETER)]:
                del file.attrs[name]
            file.attrs.update(labels)
        return replace(wanted, sha256=file_digest(target))
