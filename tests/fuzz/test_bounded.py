"""The fuzzers' own tool tells right from refused, crashed, slow and greedy."""

import time

import numpy as np
from bounded import bounded

from romdam.core.errors import ConfigError


def _refuse():
    raise ConfigError("job.yaml: no")


def test_each_end_is_told():
    assert bounded(lambda: 3).value == 3
    assert bounded(_refuse).refusal == "job.yaml: no"
    assert "ZeroDivisionError" in bounded(lambda: 1 / 0).crash
    assert "killed" in bounded(lambda: time.sleep(9), seconds=0.2).crash


def test_memory_is_measured():
    assert bounded(lambda: 0).grown < 30e6
    assert bounded(lambda: float(np.ones(30_000_000).sum())).grown > 200e6
