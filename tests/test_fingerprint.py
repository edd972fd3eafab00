"""A fingerprint is of the content: the same in every process, whatever has been set or imported there."""

import subprocess
import sys
from pathlib import PurePosixPath

import numpy as np
import pytest

from romdam.core.fingerprint import fingerprint

CONTENT = {
    "slices": [slice(np.int64(0), np.int64(12)), slice(3, 5), slice(None)],
    "numbers": [1, 2.5, np.float64(0.1), np.int64(7), np.bool_(True), float("inf")],
    "texts": ["left", np.str_("left"), b"left", None, PurePosixPath("a/b")],
    "array": np.linspace(0.0, 1.0, 5),
}


@pytest.mark.parametrize("options", [{"legacy": "1.13"}, {"legacy": "1.25"}, {"precision": 3}])
def test_what_numpy_is_set_to_print_does_not_count(options):
    plain = fingerprint(CONTENT)
    with np.printoptions(**options):
        assert fingerprint(CONTENT) == plain


@pytest.mark.parametrize(
    ("numpys", "pythons"),
    [
        (np.float64(0.1), 0.1),
        (np.int64(7), 7),
        (np.int32(-7), -7),
        (np.bool_(True), True),
        (np.str_("left"), "left"),
        (slice(np.int64(2), np.int64(9), None), slice(2, 9)),
    ],
)
def test_scalars_of_numpy_are_those_of_python(numpys, pythons):
    assert fingerprint([numpys]) == fingerprint([pythons])


def test_what_differs_has_a_fingerprint_of_its_own():
    values = [
        None,
        True,
        1,
        1.0,
        "1",
        b"1",
        "",
        0.0,
        -0.0,
        slice(1),
        slice(1, None),
        slice(0, 1),
        (),
        [0],
        ((),),
    ]
    values += [np.array(1.0), np.array([1.0]), np.array([[1.0]]), "None", (None, 1, None), {"slice": 1}]
    assert len({fingerprint(value) for value in values}) == len(values)


@pytest.mark.slow
def test_nastran_leaves_numpy_as_it_prints(tmp_path):
    """PyYeti sets numpy to print as version 1.13 did; who reads its files has not asked for that."""
    pytest.importorskip("pyyeti")
    code = (
        "from pathlib import Path\n"
        "import numpy as np\n"
        "from romdam.core.errors import MeshError\n"
        "from romdam.geometry.matrices.nastran import read_nastran\n"
        "try:\n"
        "    read_nastran(Path('none.op4'), 'stiffness', 'blocks.left')\n"
        "except MeshError:\n"
        "    print(np.get_printoptions()['legacy'], 'pyyeti.nastran.op4' in __import__('sys').modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", "True"]
