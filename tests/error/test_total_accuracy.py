"""`transient.accuracy: {total: ...}`: the mesh that is chosen where every error is known, and a run."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml
from arch_dams import arch_dam
from mesh_runs import mesh_run
from scene_builders import two_boxes
from test_cli import SMALL, call

from romdam.config import load_config, parse_config
from romdam.config.sections.transient import TotalAccuracy
from romdam.core.errors import ConfigError, ConvergenceError, MeshError
from romdam.error.statement import accuracy_warnings
from romdam.pipelines import run as run_module
from romdam.pipelines.automatic_mesh import Trial, choose_mesh
from romdam.pipelines.automatic_modes import with_modes

TIME = np.linspace(0.0, 4.0, 401)


def history_of(jump):
    """A run whose joint forces are as its jumps, without output nodes."""
    none = np.zeros((len(TIME), 0))
    forces = {"mean_traction": jump, "traction": jump, "water": np.zeros((0, 0))}
    return SimpleNamespace(time=TIME, jump=jump, disp=none, acc=none, **forces)


ABOUT = {"record": "pulse", "seconds": 4.0}
MATERIALS = {"concrete": {"E": 30e9, "nu": 0.18, "rho": 2440.0}}


def job_of(element="hex8", **joint):
    """Two boxes of 2 m in elements of 1 m; further keys of the joint."""
    raw = two_boxes(element) | {
        "materials": MATERIALS,
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": "auto"},
        "damping": {"rayleigh": {"frequencies": [2.0, 20.0], "ratio": 0.05}},
        "transient": {"accuracy": {"total": 0.02}},
    }
    for given in raw["joints"].values():
        given |= joint
    return load_config(parse_config(raw, "s.yaml").model_dump(mode="json"))


class Errors:
    """Runs whose openings are 1 + error(h): linear elements c h^2, quadratic ones d h^3."""

    def __init__(self, linear, quadratic=1.0, missing=()):
        self.linear, self.quadratic, self.missing, self.ran = linear, quadratic, missing, []

    def of(self, job):
        box = job.config.blocks["left"].box
        size, law = float(np.max(box.element_size)), (self.linear, 2.0)
        if box.element == "hex20":
            law = self.quadratic, 3.0
        return law[0] * size ** law[1], (2.0 / size) ** 3 * 24.0

    def __call__(self, job, name):
        self.ran.append(name)
        if name in self.missing:
            raise MeshError("fewer modes than asked for")
        error, unknowns = self.of(job)
        jump = (1.0 + error) * np.sin(3.0 * TIME)[:, None, None] * np.ones((1, 1, 1))
        history = history_of(jump)
        run = mesh_run(history, np.zeros((1, 3)), np.ones(1), {"c": slice(0, 1)}, int(unknowns))
        return Trial(run, 2.0)


def chosen(errors, total, element="hex8"):
    """Name of the chosen mesh, its true error and what is stated of it, both relative."""
    choice = choose_mesh(job_of(element), total, errors, ABOUT)
    assert choice.job.config.outputs == job_of(element).config.outputs
    (name,) = (entry["mesh"] for entry in choice.statement.details["meshes"] if entry["chosen"])
    return name, errors.of(choice.job)[0], choice.statement.errors["opening"].l2


@pytest.mark.parametrize(
    ("total", "mesh", "ran"),
    [
        # h = 2 m leaves 4 %: stated 1.5 x 3 % = 4.5 % of the difference to h = 1 m
        (0.06, "elements of twice the size", 2),
        # h = 1 m leaves 1 %: stated 0.5 x 3 % = 1.5 %
        (0.0225, "elements as given", 2),
        # the mesh may leave 1.2 %; quadratic elements of 2 m leave 0.8 %: stated 1.5 x 0.7 % = 1.05 %
        (0.015, "quadratic elements of twice the size, gaps at corners", 4),
        # 0.6 %: quadratic ones of 1 m leave 0.1 %: stated 0.35 %
        (0.0075, "quadratic elements as given, gaps at corners", 4),
        # 0.15 %: 0.5 m, run to judge 1 m, tell that this leaves 0.13 %, where 2 m told 0.35 %
        (0.001875, "quadratic elements as given, gaps at corners", 5),
        # 0.12 %: 0.5 m leave 0.0125 %: stated 0.5 x 0.0875 = 0.044 %
        (0.0015, "quadratic elements of 0.5 times the size, gaps at corners", 5),
    ],
)
def test_the_cheapest_mesh_that_keeps_its_share_is_chosen(total, mesh, ran):
    errors = Errors(linear=0.01, quadratic=0.001)
    name, true, stated = chosen(errors, total)
    assert name == mesh and len(errors.ran) == ran
    assert true <= stated * 1.1 and stated <= 0.8 * total


def test_where_gaps_at_corners_cannot_be_made_they_stay_as_given():
    errors = Errors(0.01, 0.001, missing=("quadratic elements as given, gaps at corners",))
    assert chosen(errors, 0.0075)[0] == "quadratic elements as given"


@pytest.mark.parametrize(
    ("keys", "at_corners"), [({}, True), ({"discretization": "mortar"}, False), ({"gaps": "corners"}, False)]
)
def test_gaps_of_quadratic_elements_stand_at_corners_unless_joints_are_to_be_mortar(keys, at_corners):
    job = job_of(**keys)
    choice = choose_mesh(job, 0.0075, Errors(0.01, 0.001), ABOUT)
    (name,) = (entry["mesh"] for entry in choice.statement.details["meshes"] if entry["chosen"])
    assert name.endswith(", gaps at corners") == at_corners
    (joint,), (given,) = choice.job.config.joints.values(), job.config.joints.values()
    assert joint.gaps == ("corners" if at_corners else given.gaps)


def test_a_large_error_that_a_coarser_mesh_states_is_asked_of_a_finer_one():
    """Openings of 1.0, 1.12 and 1.5 at 2, 1 and 0.5 m: 5 % from the coarser mesh, 38 % from the finer one."""
    openings = {
        "elements of twice the size": 0.0,
        "elements as given": 0.12,
        "elements as given, halved": 0.5,
    }
    errors = Errors(linear=0.0, quadratic=0.0)
    plain = errors.of
    errors.of = lambda job: (openings.get(errors.ran[-1], 0.5) if errors.ran else 0.0, plain(job)[1])
    choice = choose_mesh(job_of(), 0.15, errors, ABOUT)
    table = {entry["mesh"]: entry["opening_error"] for entry in choice.statement.details["meshes"]}
    assert table["elements as given"] == pytest.approx(1.5 * 0.38 / 1.5)
    assert "elements as given, halved" in errors.ran


def test_elements_that_are_quadratic_stay_so_and_are_refined():
    name, _, stated = chosen(Errors(0.0, quadratic=0.001), 0.0015, "hex20")
    assert name == "elements of 0.5 times the size, gaps at corners" and stated <= 0.0012


def arch_job(*, ground=False, **divisions):
    """An arch dam in hex20 elements, without rock unless it is to have some."""
    raw = arch_dam(ground, element="hex20", divisions=divisions) | {
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": "auto"},
        "damping": {"rayleigh": {"frequencies": [2.0, 20.0], "ratio": 0.05}},
        "transient": {"accuracy": {"total": 0.02}},
    }
    return load_config(parse_config(raw, "s.yaml").model_dump(mode="json"))


class DamErrors:
    """Runs of a dam with errors c n^-2.585 in each direction; layers of rock that are halved count twice.

    What one direction leaves has a shape of its own in time, as histories of two meshes have.

    Attributes
    ----------
    at : division -> a number of elements and the error there
    """

    def __init__(self, **at):
        self.at = at

    def of(self, job):
        counts = job.config.arch_dam.divisions
        finer = {"rock": 2.0 if counts.halved else 1.0}
        return {
            name: c * (n / (finer.get(name, 1.0) * getattr(counts, name))) ** np.log2(6.0)
            for name, (n, c) in self.at.items()
        }

    def __call__(self, job, name):
        d = job.config.arch_dam.divisions
        shapes = [np.sin(k * TIME) for k in (5.0, 7.0, 11.0, 13.0)]
        jump = np.sin(3.0 * TIME) + sum(
            e * shape for e, shape in zip(self.of(job).values(), shapes, strict=False)
        )
        gaps = np.array(
            [[0.0, b / d.through, c / d.up] for b in range(d.through + 1) for c in range(d.up + 1)]
        )
        history = history_of(jump[:, None, None] * np.ones((1, len(gaps), 1)))
        joints, unknowns = {"J1": slice(0, len(gaps))}, d.along * d.through * d.up + d.rock + d.halved
        return Trial(mesh_run(history, gaps, np.ones(len(gaps)), joints, unknowns, quadratic=True), 1.0)


def test_the_direction_of_a_dam_that_pays_is_refined():
    """Errors of 24, 12 and 6 % at (2, 4, 4) along, through and up, whose gaps cost."""
    runs = DamErrors(along=(2, 0.24), through=(4, 0.12), up=(4, 0.06))
    choice = choose_mesh(arch_job(along=2, through=4, up=4), 0.1, runs, ABOUT)
    divisions = choice.job.config.arch_dam.divisions
    # 24 % are 4 % at 4 along, 12 % are 4.2 % at 6 through; with the 6 % up that is 8.4 %
    assert (divisions.along, divisions.through, divisions.up) == (4, 6, 6)
    true, stated = np.linalg.norm(list(runs.of(choice.job).values())), choice.statement.errors["opening"].l2
    assert true <= 0.08 and stated <= 0.08 and 0.7 <= stated / true <= 1.5
    names = [entry["mesh"] for entry in choice.statement.details["meshes"]]
    assert (
        names[0] == "elements as given" and names[1] == "elements as given, finer along" and len(names) == 4
    )
    fine = choose_mesh(arch_job(along=16, through=16, up=16), 0.1, runs, ABOUT)
    assert fine.job.config.arch_dam.divisions.along == 8  # twice the size keeps it too


def test_rock_is_refined_where_it_pays_and_is_not_halved_for_a_total():
    """12 % of three layers are 2 % of six; a total that would hold six times the error has a coarser dam."""
    runs = DamErrors(along=(2, 0.01), through=(4, 0.01), up=(4, 0.01), rock=(3, 0.12))
    divisions = {"along": 2, "through": 4, "up": 4, "rock": 3}
    choice = choose_mesh(arch_job(ground=True, **divisions), 0.1, runs, ABOUT)
    refined = choice.job.config.arch_dam.divisions
    assert (refined.along, refined.through, refined.up, refined.rock) == (2, 4, 4, 6)
    true, stated = np.linalg.norm(list(runs.of(choice.job).values())), choice.statement.errors["opening"].l2
    assert true <= 0.08 and 0.7 <= stated / true <= 1.5
    fine = choose_mesh(arch_job(ground=True, along=16, through=16, up=16, rock=9), 0.1, runs, ABOUT)
    coarser = fine.job.config.arch_dam.divisions
    # (4, 4, 4) leaves 1.6 %, six times that is more than 8 %
    assert (coarser.along, coarser.through, coarser.rock, coarser.halved) == (4, 4, 9, 0)


def test_a_mesh_that_does_not_come_to_rest_is_named():
    """The user gave another mesh, which may rest."""
    runs = DamErrors(along=(2, 0.01), through=(4, 0.01), up=(4, 0.01))

    def run_mesh(job, name):
        if job.config.arch_dam.divisions.through == 2:
            raise ConvergenceError("initial state: no static equilibrium can be: C1")
        return runs(job, name)

    said = "transient.accuracy.total: on a mesh .*, elements as given, coarser up and through: initial state"
    with pytest.raises(ConvergenceError, match=said):
        choose_mesh(arch_job(along=2, through=4, up=4), 0.1, run_mesh, ABOUT)


def test_where_the_coarser_mesh_does_not_run_the_finer_one_judges():
    errors = Errors(0.01, 0.001, missing=("elements of twice the size",))
    name, _, stated = chosen(errors, 0.03)
    assert name == "elements as given" and stated == pytest.approx(1.5 * 0.0075 / 1.0025)


def test_what_cannot_be_reached_is_refused_with_its_cost_before_it_is_run():
    """Quadratic elements of 1 m leave 100 % stated of 57 %; 24 x 8 x 8^8 unknowns would be needed."""
    errors = Errors(linear=1.0, quadratic=1.0)
    with pytest.raises(ConfigError, match=r"limit 3e\+06, and take about .* s of CPU. Ask for a total of"):
        chosen(errors, 0.002)
    assert len(errors.ran) < 9


def test_a_run_chooses_states_and_keeps_its_total(tmp_path):
    time = np.arange(100) * 0.01
    np.savetxt(tmp_path / "pulse.txt", 6.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time))
    raw = yaml.safe_load(SMALL)
    raw["transient"] = {"accuracy": {"total": "10 %", "of": "opening"}}
    raw["model"] = {"modes": "auto"}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("run", tmp_path / "small.yaml", "--out", tmp_path / "out", "--quiet")
    assert code == 0, err
    with xr.open_dataset(tmp_path / "out" / "pulse.nc", engine="h5netcdf") as dataset:
        attrs = dict(dataset.attrs)
    document = json.loads(attrs["discretisation"])
    errors = [attrs[n] for n in ("discretisation_opening_l2", "solver_estimated_time_error")]
    errors.append(attrs.get("error_estimate_opening_l2", 0.0))
    assert document["asked"] == 0.1 and sum(errors) <= 0.1 and errors[0] <= 0.08
    assert attrs["solver_accuracy"] == pytest.approx((0.1 - errors[0]) / 2.0)  # half of what the mesh leaves
    assert sum(entry["chosen"] for entry in document["meshes"]) == 1
    assert "NOT kept" not in attrs["run_warnings"]
    code, text, _ = call("info", tmp_path / "out" / "pulse.nc")
    assert code == 0 and "was chosen: the mesh may leave 8 % of the total of 10 %" in text
    (tried,) = [line for line in text.splitlines() if line.startswith("meshes tried   ")]
    assert tried.count(" unknowns, ") == len(document["meshes"]) and ", chosen" in tried


def test_a_mesh_so_small_that_all_its_modes_are_taken_does_not_refine_with_all_modes(monkeypatch):
    """Every mesh that is tried after it chooses its own number; with all modes 15,918 are diagonalised."""
    taken = []

    def modes_of(job, motions, clock, store=None):
        small = len(taken) == 0
        taken.append(job.config.model.modes)
        return with_modes(job, "all" if small else 30)

    def build(job, clock, store):
        built.append(job.config.model.modes)
        raise ConfigError("enough")

    built = []
    monkeypatch.setattr(run_module, "with_modes_chosen", modes_of)
    monkeypatch.setattr(run_module, "build_model", build)
    job = job_of()
    transient = job.config.transient.model_copy(update={"accuracy": TotalAccuracy(total=0.02)})
    job = replace(job, config=job.config.model_copy(update={"transient": transient}))
    motion = SimpleNamespace(peak=1.0, name="pulse", duration=4.0)
    with pytest.raises(ConfigError, match="enough"):
        run_module.choose_mesh_and_modes(job, [motion], run_module.Clock(run_module.silent))
    assert taken[:2] == ["auto", "auto"] and built[0] == 30


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"damping": {}}, "transient.accuracy.total: needs damping"),
        ({"outputs": {"error_estimate": False}}, "transient.accuracy.total: needs outputs.error_estimate"),
        ({"outputs": {"mesh_error": "finer"}}, "outputs.mesh_error: transient.accuracy.total states"),
        ({"joints": {}}, "transient.accuracy.total: needs joints"),
        ({"transient": {"accuracy": {"total": 2.0}}}, "total"),
    ],
)
def test_what_no_run_could_state_is_refused(changed, message):
    raw = job_of().config.model_dump(mode="json", exclude_unset=True)
    with pytest.raises(ConfigError, match=message):
        parse_config(raw | changed, "s.yaml")


def test_accuracies_that_are_not_kept_are_warned_of():
    attrs = {
        "model_order": "reduced",
        "discretisation_opening_l2": 0.010,
        "error_estimate_opening_l2": 0.008,
        "solver_estimated_time_error": 0.004,
    }
    assert accuracy_warnings(attrs, 0.01, None) == []
    (modes,) = accuracy_warnings(attrs, 0.005, None)
    assert "leaving out modes changes the openings by about 0.8 %, wanted was an accuracy of 0.5 %" in modes
    assert accuracy_warnings(attrs, 0.004, 0.03) == []
    (total,) = accuracy_warnings(attrs, 0.004, 0.02)
    assert (
        "the total accuracy of 2 % is NOT kept: 2.2 % are stated (mesh 1 %, modes 0.8 %, steps 0.4 %)"
        in total
    )
    assert "model.modes: auto chooses the modes" in total
    del attrs["discretisation_opening_l2"]
    (unknown,) = accuracy_warnings(attrs, 0.004, 0.02)
    assert "is not known: the error of the mesh is not" in unknown
