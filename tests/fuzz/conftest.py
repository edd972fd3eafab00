"""How much the fuzzers do: a small share with the tests, all of it with `make fuzz`."""

import pytest


def pytest_addoption(parser):
    parser.addoption("--fuzz", action="store_true", help="run every case of tests/fuzz, not a small share")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--fuzz", default=False):
        left = [item for item in items if item.get_closest_marker("fuzz")]
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item not in left]


@pytest.fixture
def cases(request):
    """Callable (a small share, all) -> how many cases to try."""
    whole = bool(request.config.getoption("--fuzz", default=False))
    return lambda share, everything: everything if whole else share
