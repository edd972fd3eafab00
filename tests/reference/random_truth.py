"""What runs of random scenes state of their errors, over the true errors.

Draws scenes (`random_scenes.py`), runs each as a user would, and compares every error that the result states
with the truth:

    modes, steps  the same mesh with all of its modes, each of them dynamic, at equal steps (`integrator:
                  modal`), halved until the openings change by a tenth of the run's error; no quasi-static
                  mode, no cut step. `--cross` integrates the mesh's own matrices too (generalised-alpha)
    mesh          hex20 elements of a quarter, third or half of the size, a gap at every of their places, no
                  spacing; against the mesh as it is, both at the same equal steps
    total         the run against that finer mesh

Openings of other meshes are interpolated linearly over the joint to the gaps of the run. Every quantity
counts from its value at rest (the first row), and its error is relative to what it does from there on.

    python tests/reference/random_truth.py --seed 7 --count 30 --out truth.json [--keep DIR] [--only K]
    python tests/reference/random_truth.py --out truth.json --count 0          # the summary of what is there

A run that is stopped goes on where it was with the same `--out`. Scenes that the library refuses are listed.
"""

from __future__ import annotations

import argparse
import copy
import json
import logging
import math
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import xarray as xr
import yaml
from random_scenes import count_nodes, draw_scene
from scipy.spatial import Delaunay, QhullError, cKDTree

import romdam
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import RomdamError, describe_error, recoverable
from romdam.core.files import replacing

Raw = dict[str, Any]
_LAST = 1.0  # [s] at the end, over which a slip that is left is averaged
_STILL = 0.05  # share of the residual slip by which a joint at rest may still vary in the last second
_FIRST_STEP, _LEAST_STEP = 1e-4, 3.125e-6  # [s] of the truth of modes and steps
_ORDER = 0.7  # of equal steps at impacts, at least
_MESH_STEP = 2e-4  # [s] of both meshes
_AGREEMENT = 0.1  # of the error that is judged, by which the truth may change when its step is halved
_MOST_NODES = 6000  # of the finer mesh
_MOST_SECONDS = 40.0  # CPU of one truth, from which its step is not halved any more
_LOW, _HIGH, _THIRD = 0.5, 2.5, 1.0 / 3.0  # stated over true


@dataclass(frozen=True)
class Response:
    """What a run answers, from its value at rest on.

    Attributes
    ----------
    histories : quantity -> (nt, ...) less its first row
    opening, slip : (nt, ng), (nt, ng, 2) less their first rows; slip is None without tangential forces
    places : joint -> (numbers of its gaps, their positions in the joint's plane (n, 2), areas (n,))
    faces : face -> percentiles of its major principal stress, less those at rest
    """

    histories: dict[str, Floats]
    opening: Floats
    slip: Floats | None
    places: dict[str, tuple[Ints, Floats, Floats]]
    faces: dict[str, Floats]
    time: Floats

    @classmethod
    def of(cls, ds: xr.Dataset) -> Response:
        """Read it from a result."""

        def moved(name: str) -> Floats:
            values = np.array(ds[name], dtype=np.float64)
            return np.asarray(values - values[0])

        names, joint_of = [str(name) for name in ds.joint.values], np.array(ds.gap_joint)
        tangent, position = np.array(ds.gap_tangent), np.array(ds.gap_position)
        area, rest = np.array(ds.gap_area), np.array(ds.normal_force)[0]
        places, forces = dict[str, tuple[Ints, Floats, Floats]](), list[Floats]()
        for k, name in enumerate(names):
            gaps = np.flatnonzero(joint_of == (k if joint_of.dtype.kind in "iu" else name))
            plane = position[gaps] @ tangent[gaps[0]].T
            places[name] = gaps, plane, area[gaps]
            forces.append((np.array(ds.mean_normal_force)[1:, gaps] - rest[gaps]).sum(axis=1))
        histories = {"joint_force": np.stack(forces, axis=1)}
        for name in ("displacement", "acceleration", "section_force", "section_moment"):
            if name in ds:
                histories[name] = moved(name)
        faces = {}
        for k, face in enumerate(ds.stress_face.values if "stress_face" in ds.coords else ()):
            faces[str(face)] = np.array(ds.face_principal_stress)[k]
        slip = moved("slip") if "slip" in ds else None
        return cls(histories, moved("opening"), slip, places, faces, np.array(ds.time))

    def at_gaps_of(self, other: Response) -> Response:
        """The same with openings and slips at the gaps of another run, linear in between."""
        opening = np.zeros((len(self.time), other.opening.shape[1]))
        slip = None if self.slip is None else np.zeros((*opening.shape, 2))
        for name, (gaps, plane, _) in other.places.items():
            own, own_plane, _ = self.places[name]
            weights = interpolation(own_plane, plane)
            opening[:, gaps] = self.opening[:, own] @ weights.T
            if slip is not None and self.slip is not None:
                slip[:, gaps] = np.einsum("tgc,ng->tnc", self.slip[:, own], weights)
        return Response(self.histories, opening, slip, other.places, self.faces, self.time)

    def slips_left(self, own: Response | None = None) -> dict[str, Floats]:
        """Mean slip (2,) of each joint over its area and the last second, of those that have come to rest."""
        left = {}
        for name, (gaps, _, area) in (own or self).places.items():
            assert self.slip is not None
            tail = self.slip[self.time >= self.time[-1] - _LAST][:, gaps]
            mean = np.einsum("tgc,g->tc", tail, area) / area.sum()
            size = float(np.linalg.norm(mean.mean(axis=0)))
            if np.linalg.norm(np.ptp(mean, axis=0)) <= _STILL * size:
                left[name] = mean.mean(axis=0)
        return left


def interpolation(points: Floats, wanted: Floats) -> Floats:
    """Weights (wanted, points) of linear interpolation in the plane; the nearest point outside of them."""
    weights = np.zeros((len(wanted), len(points)))
    distance, nearest = cKDTree(points).query(wanted)
    weights[np.arange(len(wanted)), nearest] = 1.0
    try:
        mesh = Delaunay(points)
    except QhullError:  # on a line
        return weights
    simplex = mesh.find_simplex(wanted, tol=1e-9)
    for k in np.flatnonzero((simplex >= 0) & (distance > 1e-6)):
        transform, corners = mesh.transform[simplex[k]], mesh.simplices[simplex[k]]
        first = transform[:2] @ (wanted[k] - transform[2])
        weights[k] = 0.0
        weights[k, corners] = [*first, 1.0 - first.sum()]
    return weights


Errors = dict[str, dict[str, float]]  # quantity -> "l2", "peak" -> relative error


def errors_between(judged: Response, better: Response) -> Errors:
    """Relative errors of all quantities that both have; the gaps are those of both."""
    errors = {
        "opening": {"l2": _l2(judged.opening, better.opening), "peak": _peak_of_openings(judged, better)}
    }
    histories = [(name, judged.histories[name], values) for name, values in better.histories.items()
                 if name in judged.histories]  # fmt: skip
    if judged.slip is not None and better.slip is not None:
        histories.append(("slip", judged.slip, better.slip))
        left, wanted = judged.slips_left(), better.slips_left()
        rest = [name for name in wanted if name in left]
        largest = max((float(np.linalg.norm(wanted[name])) for name in rest), default=0.0)
        if largest > 0.0:
            off = max(float(np.linalg.norm(left[name] - wanted[name])) for name in rest) / largest
            errors["residual_slip"] = {"l2": off, "peak": off}
    for name, values, wanted_values in histories:
        errors[name] = {"l2": _l2(values, wanted_values), "peak": _peaks(values, wanted_values)}
    if judged.faces and better.faces:
        pairs = np.array(
            [(judged.faces[name], better.faces[name]) for name in better.faces if name in judged.faces]
        )
        headline = np.abs(pairs[:, 0, 4] - pairs[:, 1, 4]).max() / np.abs(pairs[:, 1, 4]).max()  # of 98 %
        errors["principal_stress"] = {"l2": _l2(pairs[:, 0], pairs[:, 1]), "peak": float(headline)}
    return errors


def _l2(values: Floats, better: Floats) -> float:
    size = float(np.linalg.norm(better))
    return float(np.linalg.norm(values - better)) / size if size > 0.0 else 0.0


def _peaks(values: Floats, better: Floats) -> float:
    """The largest of all places, or what the peaks of the places differ by in root mean square."""
    each, wanted = np.abs(values).max(axis=0), np.abs(better).max(axis=0)
    largest = float(wanted.max())
    return max(abs(float(each.max()) - largest) / largest, _l2(each, wanted)) if largest > 0.0 else 0.0


def _peak_of_openings(judged: Response, better: Response) -> float:
    """The same of how far gaps open."""
    each, wanted = judged.opening.max(axis=0), better.opening.max(axis=0)
    largest = float(wanted.max()) or float(np.abs(better.opening).max())
    return max(abs(float(each.max() - wanted.max())) / largest, _l2(each, wanted)) if largest > 0.0 else 0.0


@dataclass
class Run:
    """A finished run: its response, the attributes of its result, and CPU seconds."""

    response: Response
    attrs: dict[str, Any]
    cpu: float


def finished(raw: Raw) -> Run:
    """Run a job as a user would."""
    start = time.process_time()
    (result,) = romdam.run(raw).results
    dataset = result.dataset.load()
    return Run(Response.of(dataset), dict(dataset.attrs), time.process_time() - start)


def plain(raw: Raw, model: Raw, transient: Raw) -> Raw:
    """The job with another basis and other steps, and nothing stated of its errors."""
    job = copy.deepcopy(raw)
    job["model"] = model
    job["transient"] = transient | {"duration": raw["transient"]["duration"]}
    job["outputs"] |= {"error_estimate": False, "mesh_error": False}
    return job


def on_its_mesh(raw: Raw, step: float) -> Run:
    """All modes of the mesh, all of them dynamic, at equal steps."""
    return finished(plain(raw, {"modes": "all"}, {"finest_step": step, "integrator": "modal"}))


def at_full_order(raw: Raw, step: float) -> Run:
    """The mesh's own matrices, by generalised-alpha."""
    return finished(plain(raw, {"order": "full"}, {"finest_step": step}))


def converged(
    raw: Raw, judged: Response, run: Callable[[Raw, float], Run]
) -> tuple[Run, Errors, float, float]:
    """The run with the smallest step that the error of another one asks for.

    Returns
    -------
    the run; by how much it may be wrong; its step [s]; CPU seconds of all
    """
    step = _FIRST_STEP
    coarse, fine = run(raw, 2.0 * step), run(raw, step)
    cpu = coarse.cpu + fine.cpu
    left = 1.0 / (2.0**_ORDER - 1.0)  # of what halving the step has changed
    while True:
        change = errors_between(coarse.response, fine.response)
        doubt = {name: {m: left * value for m, value in each.items()} for name, each in change.items()}
        error = errors_between(judged, fine.response)
        settled = doubt["opening"]["l2"] <= _AGREEMENT * error["opening"]["l2"]
        if settled or step <= 1.01 * _LEAST_STEP or cpu > _MOST_SECONDS:
            return fine, doubt, step, cpu
        step /= 2.0
        coarse, fine = fine, run(raw, step)
        cpu += fine.cpu


def quadratic(raw: Raw, share: int) -> Raw:
    """The job on hex20 elements of one `share`th of the size, its gaps without spacing."""
    job = copy.deepcopy(raw)
    for block in job["blocks"].values():
        box = block["box"]
        box |= {"element": "hex20", "element_size": [edge / share for edge in box["element_size"]]}
    for joint in job["joints"].values():
        joint.pop("spacing", None)
    return job


def finest_share(raw: Raw) -> int | None:
    """How many times smaller the elements of the finer mesh are; None where that has too many nodes."""

    def nodes(share: int) -> float:
        boxes = [block["box"] for block in quadratic(raw, share)["blocks"].values()]
        return sum(count_nodes(box["size"], box["element_size"], "hex20") for box in boxes)

    return next((share for share in (4, 3, 2) if nodes(share) <= _MOST_NODES), None)


@dataclass
class Row:
    """One stated error beside the true one.

    Attributes
    ----------
    of : "modes+steps", "mesh" or "total"
    stated : None where the result says that it does not know
    unsure : by how much the true one may be wrong
    lost : whether the result says that it is not resolved
    """

    of: str
    quantity: str
    measure: str
    stated: float | None
    true: float
    unsure: float
    lost: bool = False

    @property
    def ratio(self) -> float | None:
        """Stated over true."""
        return None if self.stated is None else self.stated / max(self.true, 1e-12)

    @property
    def judged(self) -> bool:
        """Whether the truth is known well enough: to a third of itself."""
        return self.true > 1e-7 and self.unsure <= self.true / 3.0

    @property
    def text(self) -> str:
        def percent(value: float | None) -> str:
            return "unknown" if value is None else f"{100.0 * value:.3g} %"

        ratio = "" if self.ratio is None else f"{self.ratio:7.2f}"
        notes = "" if self.judged else f"  (truth good to {percent(self.unsure)})"
        values = f"{percent(self.stated):>9s} {percent(self.true):>9s} {ratio}"
        return f"    {self.of:12s} {self.quantity:16s} {self.measure:5s} {values}{notes}" + (
            "  not resolved, it says" if self.lost else ""
        )


@dataclass
class Judged:
    """A scene: what it has, its rows, and what the run warns of; `refused` is why there are none.

    `asked` is the accuracy that the job asks for, by what it is of: "modes+steps" or "total".
    """

    words: list[str]
    rows: list[Row] = field(default_factory=list)
    refused: str = ""
    asked: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    statements: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cpu: dict[str, float] = field(default_factory=dict)


def stated_errors(attrs: dict[str, Any]) -> tuple[dict[str, Errors], set[str]]:
    """What a result states of modes and steps, of the mesh, in total; and what it says is not resolved."""

    def of(kind: str) -> Errors:
        errors: Errors = {}
        for key, value in attrs.items():
            for measure in ("l2", "peak"):
                if key.startswith(f"{kind}_") and key.endswith(f"_{measure}"):
                    quantity = key.removeprefix(f"{kind}_").removesuffix(f"_{measure}")
                    errors.setdefault(quantity, {})[measure] = float(value)
        return errors

    mesh, modes, steps = of("discretisation"), of("error_estimate"), dict[str, float]()
    for measure, ending in (("l2", ""), ("peak", "_peaks")):
        stated = attrs.get(f"solver_estimated_time_error{ending}", math.inf)
        if math.isfinite(stated):  # it is infinite where the run says that it is not known
            steps[measure] = float(stated)
    if "error_estimate" not in attrs:  # all modes of the mesh are there, and nothing is stated of them
        modes = {"opening": {"l2": 0.0, "peak": 0.0}}
    both = {
        name: {m: v + steps[m] for m, v in each.items() if m in steps}
        for name, each in modes.items() if steps
    }  # fmt: skip
    total = {
        name: {m: v + both[name][m] for m, v in each.items() if m in both[name]}
        for name, each in mesh.items() if name in both
    }  # fmt: skip
    lost = set(json.loads(attrs.get("discretisation", "{}")).get("not_resolved", ()))
    return {"modes+steps": both, "mesh": mesh, "total": total}, lost


def judge(raw: Raw, *, mesh: bool = True, cross: bool = False) -> Judged:
    """Run a scene and its truths.

    Parameters
    ----------
    mesh : whether the error of the mesh is judged too
    cross : whether the mesh's own matrices are integrated at full order too
    """
    scene = Judged([])
    try:
        own = finished(raw)
    except RomdamError as error:
        scene.refused = describe_error(error)
        return scene
    attrs = own.attrs
    scene.cpu["run"] = own.cpu
    scene.warnings = [str(w) for w in json.loads(attrs.get("run_warnings", "[]"))]
    for key in ("error_estimate", "discretisation_statement"):
        scene.statements += [str(attrs[key])] if key in attrs else []
    stated, lost = stated_errors(attrs)
    accuracy = raw["transient"].get("accuracy")
    chosen = isinstance(accuracy, dict)  # its mesh is not the job's
    if accuracy is not None:
        scene.asked = {"total": accuracy["total"]} if chosen else {"modes+steps": accuracy}

    def add(of: str, true: Errors, unsure: Errors, factor: float = 1.0) -> None:
        for quantity, errors in true.items():
            for measure, value in errors.items():
                said = stated[of].get(quantity, {}).get(measure)
                if of != "mesh" and quantity != "opening" and said is None:
                    continue  # no such statement is made
                doubt = factor * unsure.get(quantity, {}).get(measure, value)
                scene.rows.append(
                    Row(of, quantity, measure, said, value, doubt, of == "mesh" and quantity in lost)
                )

    steps_doubt: Errors = {}
    if not chosen:
        truth, steps_doubt, step, scene.cpu["truth"] = converged(raw, own.response, on_its_mesh)
        scene.notes.append(f"truth of modes and steps at {1e6 * step:g} us")
        add("modes+steps", errors_between(own.response, truth.response), steps_doubt)
        if cross:
            scene.notes.append(_crossed(raw, own.response, truth.response, step))
    share = finest_share(raw) if mesh else None
    if share is None:
        return scene
    better, doubt, scene.cpu["mesh truth"] = _mesh_truth(raw, share)
    scene.notes.append(f"mesh truth: hex20, 1/{share} of the size, {better.attrs['unknowns']} unknowns")
    same = on_its_mesh(raw, _MESH_STEP)
    wanted = better.response.at_gaps_of(own.response)
    if not chosen:
        add("mesh", errors_between(same.response, better.response.at_gaps_of(same.response)), doubt)
    add("total", errors_between(own.response, wanted), doubt)
    return scene


def _mesh_truth(raw: Raw, share: int) -> tuple[Run, Errors, float]:
    """The run on a finer mesh; what its own mesh may still be off by, from one of larger elements; CPU."""
    basis = {"modes": 60, "residual_vectors": 30}
    steps = {"finest_step": _MESH_STEP, "integrator": "modal"}
    coarser = share // 2
    better, coarse = (finished(plain(quadratic(raw, k), basis, steps)) for k in (share, coarser))
    change = errors_between(coarse.response, better.response.at_gaps_of(coarse.response))
    left = 1.0 / ((share / coarser) ** 2 - 1.0)  # of the change, for an order of 2
    doubt = {name: {m: left * value for m, value in each.items()} for name, each in change.items()}
    return better, doubt, better.cpu + coarse.cpu


def _crossed(raw: Raw, judged: Response, truth: Response, step: float) -> str:
    """How far the truth is from the mesh's own matrices at full order."""
    full = at_full_order(raw, step).response
    apart, error = (
        errors_between(run, better)["opening"]["l2"] for run, better in ((full, truth), (judged, full))
    )
    return f"full order at this step: {100 * apart:.3g} % from the truth, {100 * error:.3g} % from the run"


def judge_scene(seed: int, number: int, folder: Path | None, *, mesh: bool, cross: bool) -> dict[str, Any]:
    """Draw and judge a scene; plain values, for JSON."""
    drawn = draw_scene(seed, number)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        text = yaml.safe_dump(drawn.raw, sort_keys=False)
        (folder / f"scene_{seed}_{number}.yaml").write_text(f"# {' | '.join(drawn.words)}\n{text}")
    try:
        scene = judge(drawn.raw, mesh=mesh, cross=cross)
    except recoverable() as error:
        scene = Judged([], notes=[f"no truth: {describe_error(error)}"])
    scene.words = drawn.words
    return {**vars(scene), "rows": [vars(row) for row in scene.rows]}


def as_text(number: int, scene: dict[str, Any]) -> str:
    """A scene for the terminal."""
    cpu = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in scene["cpu"].items())
    lines = [f"{number:3d}  {' | '.join(scene['words'])}", f"    {'; '.join([*scene['notes'], cpu])}"]
    if scene["refused"]:
        lines.append(f"    refused: {scene['refused']}")
    lines += [f"    warns: {warning}" for warning in scene["warnings"]]
    lines += [Row(**row).text for row in scene["rows"]]
    return "\n".join(lines)


def summary(scenes: dict[str, dict[str, Any]]) -> str:
    """For each quantity how many statements are near the truth, too low, and unknown."""
    kinds: dict[tuple[str, str, str], list[tuple[str, Row]]] = {}
    for number, scene in scenes.items():
        for plain_row in scene["rows"]:
            row = Row(**plain_row)
            kinds.setdefault((row.of, row.quantity, row.measure), []).append((number, row))
    lines = [f"{'':36s} judged  0.5-2.5  median  <1/3  unknown  truth not known"]
    low: dict[str, list[str]] = {}
    for (of, quantity, measure), rows in sorted(kinds.items()):
        known = [(number, row) for number, row in rows if row.judged and row.ratio is not None]
        ratios = [row.ratio or 0.0 for _, row in known]
        near = sum(_LOW <= ratio <= _HIGH for ratio in ratios)
        third = [number for number, row in known if (row.ratio or 0.0) < _THIRD]
        unknown = sum(row.stated is None for _, row in rows)
        doubtful = sum(not row.judged and row.stated is not None for _, row in rows)
        middle = f"{median(ratios):6.2f}" if ratios else "      "
        lines.append(
            f"{of:12s} {quantity:16s} {measure:5s} {len(known):8d} {near:8d}  {middle} {len(third):5d} "
            f"{unknown:8d} {doubtful:8d}"
        )
        for number in third:
            low.setdefault(number, []).append(f"{of} {quantity} {measure}")
    lines += _kept(scenes)
    for number, names in low.items():
        lines.append(f"below a third, scene {number}: {', '.join(names)}")
        lines += [f"    warns: {warning}" for warning in scenes[number]["warnings"]] or [
            "    without a warning"
        ]
    for number, scene in scenes.items():
        if scene["refused"]:
            lines.append(f"refused, scene {number}: {scene['refused']}")
        elif not scene["rows"]:
            lines.append(f"not judged, scene {number}: {'; '.join(scene['notes'])}")
    return "\n".join(lines)


def _kept(scenes: dict[str, dict[str, Any]]) -> list[str]:
    """How many jobs keep the accuracy of the openings that they ask for, and which do not."""
    lines = []
    for of in ("modes+steps", "total"):
        pairs = {
            number: (row["true"], scene["asked"][of])
            for number, scene in scenes.items()
            for row in scene["rows"]
            if of in scene["asked"] and (row["of"], row["quantity"], row["measure"]) == (of, "opening", "l2")
        }
        missed = [
            f"{number} ({100 * true:.2g} for {100 * wanted:g} %)"
            for number, (true, wanted) in pairs.items() if true > wanted
        ]  # fmt: skip
        if pairs:
            lines.append(
                f"accuracy of {of} kept: {len(pairs) - len(missed)} of {len(pairs)}; not in {missed}"
            )
    return lines


def judge_all(asked: argparse.Namespace) -> Iterator[tuple[int, dict[str, Any]]]:
    """Judge the scenes that are asked for and are not in the file yet, each in a process of its own."""
    done = read_scenes(asked.out)
    numbers = [asked.only] if asked.only is not None else range(asked.first, asked.first + asked.count)
    context = multiprocessing.get_context("fork")
    for number in numbers:
        if f"{asked.seed}/{number}" in done and asked.only is None:
            continue
        with context.Pool(1) as pool:
            options = {"mesh": not asked.no_mesh, "cross": asked.cross}
            task = pool.apply_async(judge_scene, (asked.seed, number, asked.keep), options)
            try:
                scene = task.get(asked.limit)
            except multiprocessing.TimeoutError:
                words = draw_scene(asked.seed, number).words
                scene = vars(Judged(words, notes=[f"not done after {asked.limit:g} s"]))
        done[f"{asked.seed}/{number}"] = scene
        if asked.out is not None:
            with replacing(asked.out) as unfinished:
                unfinished.write_text(json.dumps({"scenes": done}, indent=1), encoding="utf-8")
        yield number, scene


def read_scenes(path: Path | None) -> dict[str, dict[str, Any]]:
    """What has been judged before: seed/number -> scene."""
    if path is None or not path.exists():
        return {}
    scenes: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["scenes"]
    return scenes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--only", type=int, help="number of the one scene")
    parser.add_argument("--out", type=Path, help="JSON file of what is judged, to go on with too")
    parser.add_argument("--keep", type=Path, help="folder for the scenes as YAML")
    parser.add_argument("--no-mesh", action="store_true", help="leave out the error of the mesh")
    parser.add_argument("--cross", action="store_true", help="check the truth by the mesh's own matrices")
    parser.add_argument("--limit", type=float, default=900.0, help="seconds that a scene may take")
    asked = parser.parse_args()
    logging.getLogger("romdam").setLevel(logging.ERROR)
    scenes = read_scenes(asked.out)
    for number, scene in judge_all(asked):
        scenes[f"{asked.seed}/{number}"] = scene
        sys.stdout.write(as_text(number, scene) + "\n")
        sys.stdout.flush()
    sys.stdout.write(summary(scenes) + "\n")


if __name__ == "__main__":
    main()
