"""Files of matrices changed at random: read, or refused with key and file; no traceback, never for long."""

import numpy as np
from bounded import bounded
from test_matrices import PLACE, WRITERS, of_mesh, read

from romdam.geometry.matrices.checks import check_matrices

SECONDS, MEMORY = 40.0, 6e8
WORDS = ["0", "-1", "1e300", "nan", "inf", "99999999999", "1.5", "x", "", "1_0", "2 2", "\n", ",", "."]


def damaged(data, rng):
    """The bytes of a file with a few words, lines or bytes changed, or cut."""
    kind = rng.integers(4)
    if kind == 0:
        return data[: rng.integers(len(data))]
    if kind == 1:
        changed = bytearray(data)
        for at in rng.integers(len(data), size=rng.integers(1, 6)):
            changed[at] = rng.integers(256)
        return bytes(changed)
    lines = data.split(b"\n")
    for at in rng.integers(len(lines), size=rng.integers(1, 4)):
        words = lines[at].split(b" ")
        words[rng.integers(len(words))] = WORDS[rng.integers(len(WORDS))].encode()
        lines[at] = b" ".join(words) if kind == 2 else lines[rng.integers(len(lines))]
    return b"\n".join(lines)


def test_files_changed_at_random(cases, tmp_path):
    names, wrong, refused = list(WRITERS), [], 0
    for seed in range(number := cases(16, 2000)):
        rng = np.random.default_rng(seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        keys = WRITERS[names[seed % len(names)]](folder, *of_mesh())
        files = sorted({value for value in keys.values() if isinstance(value, str)})
        path = folder / files[rng.integers(len(files))]
        path.write_bytes(damaged(path.read_bytes(), rng))

        def call(folder=folder, keys=keys):
            check_matrices(read(folder, **keys), PLACE)

        outcome = bounded(call, SECONDS)
        refused += bool(outcome.refusal)
        if outcome.crash or outcome.grown > MEMORY:
            wrong.append(f"seed {seed} ({path.name}): {outcome.crash[-400:]} {outcome.grown / 1e6:.0f} MB")
        elif outcome.refusal and (
            "\n" in outcome.refusal or not (PLACE in outcome.refusal or str(path) in outcome.refusal)
        ):
            wrong.append(f"seed {seed} ({path.name}): {outcome.refusal}")
    print(f"{refused} of {number} refused")
    assert not wrong, "\n".join(wrong)
