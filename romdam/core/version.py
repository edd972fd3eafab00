"""The version of romdam, and what files and pages say that they were made with."""

from __future__ import annotations

from pathlib import Path

VERSION = "0.3.0"
SOURCE = f"romdam {VERSION}"
_PATIENCE = 10.0  # s, for each question to git


def commit(root: Path = Path(__file__).parents[2]) -> str:
    """The commit of the checkout that romdam runs from, and whether its files differ; empty without one.

    Parameters
    ----------
    root : folder that holds the package; that of an installed one is no checkout, whatever stands above it
    """
    import os
    import subprocess

    if not (root / ".git").exists():
        return ""
    outside = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    said = []
    for words in (("rev-parse", "--short=10", "HEAD"), ("status", "--porcelain", "--untracked-files=no")):
        try:
            done = subprocess.run(
                ["git", "-C", str(root), *words],
                capture_output=True,
                text=True,
                timeout=_PATIENCE,
                env=outside,
            )
        except (OSError, subprocess.TimeoutExpired):  # no git here
            return ""
        if done.returncode:  # an empty repository, or one of somebody else
            return ""
        said.append(done.stdout.strip())
    return f"{said[0]}, with changes" if said[1] else said[0]
