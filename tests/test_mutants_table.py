"""The table of planted faults (`make mutants`) follows the code: each text stands in its file once."""

from pathlib import Path

from faults import COMPILED, FAULTS, Fault, misplaced

ROOT = Path(__file__).parents[1]
EVERY = [fault for faults in FAULTS.values() for fault in faults]
ROOMS = {
    "config", "contact", "core", "effects", "error", "export", "fem", "geometry", "linalg", "pipelines",
    "postprocess", "records", "reduction", "results", "scene", "timestepping", "visual",
}  # fmt: skip


def test_every_fault_can_be_planted():
    """Where code has moved, the text in `tests/benchmarks/faults.py` moves too, or another replaces it."""
    assert misplaced(ROOT, EVERY) == []
    assert all(fault.old != fault.new for fault in EVERY)
    assert len({(fault.file, fault.old, fault.new) for fault in EVERY}) == len(EVERY)


def test_faults_are_in_every_room_that_computes():
    assert set(FAULTS) == ROOMS
    assert len(EVERY) >= 160 and 8 * len(FAULTS["records"]) <= len(EVERY)  # of which there is most code


def test_what_is_misplaced_is_told(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\nx = 1\n")
    assert misplaced(tmp_path, [Fault("a", "a.py", "x = 1", "x = 2", ("none.py",))]) == [
        "a.py: 'x = 1' stands there 2 times, wanted once",
        "a.py: 'x = 1': no such test file none.py",
    ]
    assert set(COMPILED) < ROOMS
