"""`romdam modes`: files, tables, and measured frequencies beside the computed ones."""

import meshio
import numpy as np
import pytest
from cf_files import flaws

import romdam
from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.errors import ResultError
from romdam.pipelines.modes import ModesOptions, modes
from romdam.postprocess.measured_modes import MeasuredMode, match_modes
from romdam.results.dataset import open_dataset
from romdam.results.modes import read_measured
from romdam.terminal.tables import measured_table, modes_table

BOX = {"size": [5, 5, 20], "element_size": 5.0}
RAW = {
    "materials": {"concrete": {"E": "30 GPa", "nu": 0.18, "rho": "2440 kg/m3"}},
    "blocks": {
        "left": {"material": "concrete", "box": BOX | {"origin": [0, -5, 0]}},
        "right": {"material": "concrete", "box": BOX | {"origin": [0, 0, 0]}},
    },
    "supports": [{"block": "left", "face": "zmin"}, {"block": "right", "face": "zmin"}],
    "joints": {"gap": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m", "gap": "1 mm"}},
    "damping": {"rayleigh": {"frequencies": ["5 Hz", "50 Hz"], "ratio": "5 %"}},
    "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
    "model": {"modes": 5},
    "transient": {"finest_step": 0.01},
}


@pytest.fixture
def job(tmp_path):
    path = tmp_path / "dam.yaml"
    return Job(parse_config(RAW, "dam.yaml"), path, "0" * 64)


@pytest.mark.parametrize("joints", ["tied", "bonded", "open"])
def test_files_hold_what_the_table_tells(job, tmp_path, joints, caplog):
    found = modes(job, tmp_path, ModesOptions(joints, 4, vtu=True))
    assert ("initial gaps of up to 1 mm are taken as closed" in caplog.text) == (joints != "open")
    assert {path.name for path in found.paths} >= {f"dam-modes-{joints}.{end}" for end in ("nc", "vtu")}
    assert list(flaws(tmp_path / f"dam-modes-{joints}.nc")) == []
    stored = open_dataset(tmp_path / f"dam-modes-{joints}.nc")
    assert stored.identical(found.dataset.load()) or stored.equals(found.dataset)
    assert dict(stored.sizes) == {"mode": 4, "direction": 3, "node": 40}
    size = np.linalg.norm(stored["shape"], axis=2).max(axis=1)
    assert size == pytest.approx(1.0)
    assert stored.effective_mass.values == pytest.approx(
        (stored.participation_factor**2 * stored.modal_mass).T.values.T
    )
    mesh = meshio.read(tmp_path / f"dam-modes-{joints}.vtu")
    assert mesh.point_data["mode_02"] == pytest.approx(stored["shape"].sel(mode=2).values)
    assert mesh.points == pytest.approx(stored.position.values)
    table = modes_table(stored)
    assert table.row_count == 5 and f"{float(stored.frequency[0]):.4f}" in list(table.columns[1].cells)


def test_joints_order_the_frequencies(job, tmp_path):
    """Constraints stiffen: open <= bonded <= tied, mode by mode."""
    freq = [modes(job, tmp_path, ModesOptions(j, 5)).dataset.frequency for j in ("open", "bonded", "tied")]
    assert (freq[0] <= freq[1] * (1 + 1e-9)).all() and (freq[1] < freq[2]).all()


def test_measured_modes_stand_beside_the_computed(job, tmp_path):
    computed = modes(job, tmp_path, ModesOptions(count=4)).dataset
    freq, main = computed.frequency.values, computed.motion_share.values.argmax(axis=1)
    path = tmp_path / "test.csv"
    rows = [f"bending, {1.02 * freq[0]}, 0.03, {'xyz'[main[0]]}, ", f"other, {0.98 * freq[3]}, , , 4"]
    path.write_text("\ufeff# tests of 1999\nname, frequency, damping, direction, mode\n" + "\n".join(rows))
    found = modes(job, tmp_path, ModesOptions(count=4, measured=path))
    one = found.dataset
    assert one.measured.values.tolist() == ["bending", "other"]
    assert one.measured_mode.values.tolist() == [1, 4]
    assert one.frequency_difference.values == pytest.approx([1 / 1.02 - 1, 1 / 0.98 - 1])
    assert (tmp_path / "dam-modes-tied-measured.png") in found.paths
    assert list(measured_table(one).columns[4].cells) == ["-1.96", "+2.04"]


def measured(frequency, mode=None, direction=None):
    return MeasuredMode("m", frequency, float("nan"), mode, direction)


def test_partners_are_the_nearest_each_once():
    freq, motion = np.array([0.0, 2.0, 2.1, 4.0]), np.eye(3)[[0, 0, 1, 1]]
    assert match_modes([measured(2.1), measured(2.2)], freq, motion).tolist() == [2, 3]
    assert match_modes([measured(2.1, direction=0), measured(2.0)], freq, motion).tolist() == [2, 3]
    assert match_modes([measured(9.0, mode=2), measured(2.0)], freq, motion).tolist() == [2, 3]
    # by ratios: 15 is 1.5 of 10, and 10 is 1.67 of 6, which is nearer in Hz
    apart = np.array([6.0, 15.0])
    assert match_modes([measured(10.0)], apart, np.eye(3)[:2]).tolist() == [2]
    with pytest.raises(ResultError, match="0 move most along z and 1 are rigid"):
        match_modes([measured(2.0, direction=2)], freq, motion)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "frequency \\[Hz\\] is required, got none"),
        ("frequency\n", "has no measured mode"),
        ("freq\n2\n", "got freq"),
        ("frequency\ntwo\n", "line 2: frequency \\[Hz\\] must be a number above 0"),
        ("frequency\n2 Hz\n", "got '2 Hz'"),
        ("frequency\nnan\n", "got 'nan'"),
        ("frequency\n1\n2\n3\n", "has 3 measured modes, and 2 are computed"),
        ("frequency,mode\n1,3\n", "mode 3 is not computed, computed are 1 to 2"),
        ("frequency,mode\n1,2\n3,2\n", "mode 2 is named twice"),
        ("frequency,mode\n1,one\n", "mode is a whole number from 1, got 'one'"),
        ("frequency,direction\n1,up\n", "direction is x, y or z, got 'up'"),
        ("frequency,damping\n1,5\n", "damping ratio must be a number above 0 and below 1, got '5'"),
        ("frequency,name\n1,a,b\n", "line 2: has 3 values for 2 columns"),
    ],
)
def test_wrong_files_of_measured_modes(tmp_path, text, complaint):
    path = tmp_path / "test.csv"
    path.write_text(text)
    with pytest.raises(ResultError, match=complaint):
        read_measured(path, 2)
    with pytest.raises(ResultError, match="cannot be read"):
        read_measured(tmp_path / "none.csv", 2)


def test_name_is_in_the_package():
    assert romdam.modes is modes
