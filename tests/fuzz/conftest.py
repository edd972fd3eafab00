"""How much the fuzzers do: a small share with the tests, all of it with `make fuzz`."""

import pytest


def pytest_addoption(parser):
    parser.addoption("--fuzz", action="store_true", help="run every case of tests/fuzz, not a small share")


@pytest.fixture
def cases(request):
    """Callable (a small share, all) -> how many cases to try."""
    whole = bool(request.config.getoption("--fuzz", default=False))
    return lambda share, everything: everything if whole else share
