"""The report of one run: what was assumed, what came of it, how far to trust it, from its file alone.

`RUN_SECTIONS` lists the sections in their order. Each is a function that takes the run (`RunSubject`) and
returns the tables, figures and sentences of its subject, or None where the run has nothing of it. Values are
in SI in the result; `RunSubject.column` brings those of a column to one unit that suits the largest of them,
in the units of the report.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr

from romdam.config.job import Config
from romdam.config.sections.job import RayleighConfig
from romdam.config.stated import StatedKey, stated_keys
from romdam.core.display_units import SI, DisplayUnits, unit_text
from romdam.core.round_off import NOTHING, ROUND_OFF, without_round_off
from romdam.core.version import SOURCE
from romdam.postprocess.attached import attached_forces
from romdam.postprocess.checks import NOT_JUDGED, run_checks
from romdam.postprocess.joint_roles import bearing_first, bearing_joints
from romdam.postprocess.maxima import (
    explained,
    joint_peaks,
    limits_of,
    maxima,
    peak_ground_acceleration,
    water_at_rest,
    written_note,
)
from romdam.postprocess.record_measures import stated_warnings
from romdam.postprocess.responses import PARAMETER
from romdam.postprocess.sliding import least_factor, sliding
from romdam.postprocess.stated_errors import total_text
from romdam.postprocess.stress.faces import HEADLINE, verdict
from romdam.visual.plots import FIGURES
from romdam.visual.report.parts import (
    Code,
    Fact,
    Folded,
    PageCell,
    PagePicture,
    PageSection,
    PageTable,
    Part,
    Report,
    Text,
    Value,
    number,
    picture,
    side_by_side,
)
from romdam.visual.style import STYLE

_GRAVITY = 9.80665  # m/s2, standard: in both systems of units a record's peak is stated in g
_LONG_LIST = 8  # members of a list that a table shows
_CAPTIONS = {
    "ground_motion": "Ground acceleration.",
    "top_displacements": "Displacement of the output nodes, relative to the base.",
    "joint_opening": "Opening of every joint: widest gap, and range over the joint.",
    "opening_envelope": "Largest opening of every gap.",
    "joint_displacement": "Mean displacement of block J relative to block I.",
    "joint_slip": "Slip of the gap that slips most, and range over the joint.",
    "sliding": "Factor of safety against sliding, and mean slip.",
    "energy": "Energy: input, and where it is.",
    "dissipated_energy": "Energy that each joint has dissipated.",
    "floor_spectra": "Absolute acceleration of oscillators on the places; broken: broadened.",
    "stress": "Stress at named nodes.",
    "stress_damage": "Duration and extent of stress above the strength, beside the limits.",
    "stress_sections": "Forces, moments and linearised stress of sections.",
}
_LIMITS = (
    "Materials are linear, strains and rotations are small: concrete that cracks or crushes away from joints "
    "is not modelled.",
    "Every gap connects the same two points throughout: blocks that slide far or overturn are not modelled.",
    "The joint force at one instant of an impact depends on the step. Use means over the writing interval.",
    "The stress at a re-entrant corner grows with refinement. Use values of whole faces, outside the ring.",
    "The manual's page on limits lists them all. No decision about a dam may rest on this report alone.",
)
_SLIDING_LIMIT = (
    "Histories of blocks that slide on their bases are sensitive to any change of the model or the motion. "
    "Trust peaks and residual slips, the latter to about 10 %."
)


@dataclass(frozen=True)
class RunSubject:
    """A run, and how its report shows it.

    Attributes
    ----------
    dataset : of the result
    config : of the run [SI]
    errors : stated errors of the openings in L2: "mesh", "modes", "steps", those that are known
    statements : "estimate", "certificate", "verification", "discretisation" -> sentence, as far as stated
    system : units of the report
    scene : PNG of the scene; None where none is drawn
    command : that made the report
    """

    dataset: xr.Dataset
    config: Config
    errors: Mapping[str, float]
    statements: Mapping[str, str]
    system: DisplayUnits = SI
    scene: bytes | None = None
    command: str = ""

    def column(self, units: str, values: Sequence[float]) -> tuple[list[float], str]:
        """Values of one quantity in the unit that suits the largest of them, round-off as 0; its name.

        Parameters
        ----------
        units : of the values in SI, such as "Pa"
        """
        largest = max((abs(value) for value in values if np.isfinite(value)), default=0.0)
        size, unit = self.system.suited(units, largest)
        return [0.0 if abs(value) < NOTHING else value / size for value in values], unit

    def text(self, units: str, value: float) -> str:
        """A number with its unit."""
        (shown,), unit = self.column(units, [value])
        return f"{number(shown)} {unit}".strip()

    def figures(self, *names: str) -> list[Part]:
        """The named ones of `FIGURES` that the result has data for, side by side."""
        drawn = list[PagePicture | None]()
        for name in names:
            with mpl.rc_context(STYLE):
                figure = FIGURES[name](self.dataset, self.system)
            drawn.append(None if figure is None else picture(figure, _CAPTIONS[name]))
        return [side_by_side(*drawn)]


def run_report(subject: RunSubject) -> Report:
    """Make the report: the headline facts, then the sections; bases and lifts come before other joints."""
    subject = replace(subject, dataset=bearing_first(subject.dataset))
    attrs = subject.dataset.attrs
    created = str(attrs["date_created"]).replace("T", " ").replace("+00:00", " UTC")
    about = f"Record {attrs['record']}; run of {created}, {attrs['source']}; {subject.system.name} units"
    sections = [section for make in RUN_SECTIONS if (section := make(subject)) is not None]
    return Report(str(attrs["title"]), about, _facts(subject), sections)


def _facts(subject: RunSubject) -> list[Fact]:
    """The numbers that stand above the sections: sliding, opening, stress, stated error, warnings."""
    dataset, facts = subject.dataset, list[Fact]()
    slides = sliding(dataset)
    if slides:
        bearing = [joint for joint in slides if joint.bears]
        least, where = least_factor(slides), "base and lift" if bearing else "joint"
        text = f"least factor of safety against sliding, every {where}"
        facts.append(Fact(text, "–" if least is None else f"{number(least.factor)} ({least.joint})"))
        left = max(joint.residual_slip for joint in bearing or slides)
        text = "largest residual slip" + " of bases and lifts" * bool(bearing)
        facts.append(Fact(text, subject.text("m", left)))
    if "peak_opening" in dataset and dataset.joint.size:
        facts.append(Fact("largest opening", subject.text("m", float(dataset.peak_opening.max()))))
    if "face_principal_stress" in dataset:
        worst = float(dataset.face_principal_stress.sel(area_percentile=HEADLINE).max())
        facts.append(Fact(f"{HEADLINE:g} % stress of the worst face", subject.text("Pa", worst)))
    errors = subject.errors
    if errors:
        facts.append(Fact("stated error of the openings, L2, at most", total_text(errors)))
    warnings = len(stated_warnings(dataset.attrs))
    return [*facts, Fact("warnings", str(warnings), warnings > 0)]


def dam_section(subject: RunSubject) -> PageSection:
    """Geometry, materials and joints, as the job states them."""
    config, dataset, parts = subject.config, subject.dataset, list[Part]()
    if subject.scene:
        parts.append(side_by_side(picture(subject.scene, "The blocks with their joints.")))
    materials = list(config.materials.values())
    E, stress = subject.column("Pa", [material.E for material in materials])
    rho, density = subject.column("kg m-3", [material.rho for material in materials])
    nu = [material.nu for material in materials]
    rows: list[list[Value]] = [list(row) for row in zip(config.materials, E, nu, rho, strict=True)]
    head = ["material", f"E [{stress}]", "Poisson's ratio", f"density [{density}]"]
    if any(material.E_dynamic is not None for material in materials):
        dynamic, unit = subject.column("Pa", [one.E_dynamic or one.E for one in materials])
        rows = [[*row, value] for row, value in zip(rows, dynamic, strict=True)]
        head[1] = f"E at rest [{stress}]"
        head.append(f"E of the record [{unit}]")
    if any(material.damping is not None for material in materials):
        rows = [
            [*row, _damping_text(material.damping)] for row, material in zip(rows, materials, strict=True)
        ]
        head.append("damping")
    parts.append(PageTable(head, rows, "Materials"))
    if any(material.damping is not None for material in materials) and "mode_damping_ratio" in dataset:
        parts.append(_ratios_table(dataset))
    if "joint" in dataset:
        parts.append(_joints_table(subject))
    sample: list[list[Value]] = [
        [name.removeprefix(PARAMETER), f"{value:.6g}"]
        for name, value in dataset.attrs.items()
        if str(name).startswith(PARAMETER) and isinstance(value, float)
    ]
    parts.append(
        PageTable(["parameter", "value [SI]"], sample, "Sample of a suite: in place of what the job states")
    )
    parts.append(
        keys_table(subject, "Geometry", "blocks", "arch_dam", "gravity_dam", "cut", "supports", "ties")
    )
    return PageSection("dam", "The dam", parts)


def _damping_text(damping: RayleighConfig | None) -> str:
    """Rayleigh damping of a material."""
    if damping is None:
        return "of all"
    if damping.ratio is not None and damping.frequencies is not None:
        first, second = damping.frequencies
        return f"{100.0 * damping.ratio:g} % at {first:g} and {second:g} Hz"
    return f"alpha {damping.alpha:g} 1/s, beta {damping.beta:g} s"


def _ratios_table(dataset: xr.Dataset) -> PageTable:
    """Effective damping ratios of the lowest modes that strain."""
    freq, ratio = dataset.mode_frequency.values, dataset.mode_damping_ratio.values
    strained = np.flatnonzero(np.isfinite(ratio))
    lowest = strained[np.argsort(freq[strained])][:_LONG_LIST]
    rows: list[list[Value]] = [[f"{freq[k]:.4g}", f"{100.0 * ratio[k]:.3g}"] for k in lowest]
    head = ["frequency [Hz]", "effective damping ratio [%]"]
    return PageTable(head, rows, "Lowest modes with joints open")


def _joints_table(subject: RunSubject) -> PageTable:
    """Blocks, gaps, area and law of every joint."""
    dataset, laws = subject.dataset, dict[str, str]()
    for name, joint in subject.config.every_joint.items():
        keys = [key for key in stated_keys(joint) if key.path != "between"]
        laws[name] = ", ".join(f"{key.path.replace('_', ' ')} {_value_text(subject, key)}" for key in keys)
    names, of_gaps = [str(name) for name in dataset.joint.values], dataset.gap_joint.values
    area, unit = subject.column(
        "m2", [float(dataset.gap_area.values[of_gaps == name].sum()) for name in names]
    )
    rows = list[list[Value]]()
    for name, size in zip(names, area, strict=True):
        between = " – ".join(str(block) for block in dataset.joint_blocks.sel(joint=name).values)
        rows.append([name, between, int((of_gaps == name).sum()), size, laws.get(name, "")])
    return PageTable(["joint", "blocks I–J", "gaps", f"area [{unit}]", "law"], rows, "Joints")


def loads_section(subject: RunSubject) -> PageSection:
    """Loads, water, ground and damping; resultants of the water in joints."""
    dataset, parts = subject.dataset, list[Part]()
    parts.append(
        keys_table(
            subject,
            "Loads, what is attached, water, ground and damping",
            *("loads", "anchors", "masses", "construction", "water", "ground", "damping"),
        )
    )
    if "construction_opening" in dataset:
        parts.append(_construction_table(subject))
    if (water := water_at_rest(dataset)) is not None:
        shown = without_round_off(water.transpose("joint", "component").values)
        values, unit = subject.column("N", shown.ravel().tolist())
        of_joints = np.reshape(values, shown.shape)
        rows: list[list[Value]] = [
            [str(name), *row]
            for name, row in zip(dataset.joint.values, of_joints.tolist(), strict=True)
            if any(row)
        ]
        head = ["joint", *(f"{axis} [{unit}]" for axis in "xyz")]
        parts.append(
            PageTable(head, rows, "Resultant of the water in joints and their cracks at rest, on block J")
        )
    if forces := attached_forces(dataset):
        values, unit = subject.column("N", [x for one in forces for x in (one.rest, one.least, one.largest)])
        head = ["of", "name", *(f"{what} [{unit}]" for what in ("at rest", "least", "largest"))]
        each = enumerate(forces)
        lines: list[list[Value]] = [[one.of, one.name, *values[3 * k : 3 * k + 3]] for k, one in each]
        parts.append(PageTable(head, lines, "Forces of what is attached, over all steps; tension positive"))
    if "loads_at_rest" in dataset:
        parts.append(_balance_table(subject))
    return PageSection("loads", "Loads", parts)


def _balance_table(subject: RunSubject) -> PageTable:
    """Forces and moments on the dam and its bodies at rest."""
    dataset, rows, kinds = subject.dataset, list[list[Value]](), ("loads", "joints", "supports")
    every = np.stack([dataset[f"{kind}_at_rest"].values for kind in kinds], axis=1)
    forces, force_unit = subject.column("N", every[..., :3].ravel().tolist())
    moments, moment_unit = subject.column("N m", every[..., 3:].ravel().tolist())
    both = [np.reshape(values, (-1, 3)) for values in (forces, moments)]
    for values in both:
        values[np.abs(values) < ROUND_OFF * np.abs(values).max(initial=0.0)] = 0.0
    lines = np.hstack(both).tolist()
    for k, body in enumerate(map(str, dataset.body.values)):
        left = f"{float(dataset.imbalance_at_rest[k]):.1e}"
        rows += [
            [body, kind, *lines[len(kinds) * k + i], PageCell(left if i == 0 else "", "n")]
            for i, kind in enumerate(kinds)
        ]
    head = ["body", "of", *(f"F {axis} [{force_unit}]" for axis in "xyz")]
    head += [*(f"M {axis} [{moment_unit}]" for axis in "xyz"), "left, share"]
    return PageTable(head, rows, "Forces at rest, moments about the middle of each body")


def _construction_table(subject: RunSubject) -> PageTable:
    """Largest opening of every joint by stage of construction, and where it is grouted."""
    dataset, of_gaps = subject.dataset, subject.dataset.gap_joint.values
    stages = [str(name) for name in dataset.construction_stage.values]
    names = [str(name) for name in dataset.joint.values]
    largest = np.full((len(names), len(stages)), np.nan)
    for i, name in enumerate(names):
        opening = dataset.construction_opening.values[:, of_gaps == name]
        present = ~np.isnan(opening).all(axis=1)
        largest[i, present] = np.nanmax(opening[present], axis=1)
    shown, unit = subject.column("m", largest.ravel().tolist())
    rows = list[list[Value]]()
    for i, name in enumerate(names):
        cells: list[Value] = [name]
        grouted = dataset.construction_grouted.values[:, of_gaps == name]
        for k in range(len(stages)):
            value, share = shown[i * len(stages) + k], float(grouted[k].mean())
            then = "" if share == 0.0 else ", then grouted" if share == 1.0 else ", then grouted in part"
            cells.append("–" if np.isnan(value) else f"{number(value)}{then}")
        rows.append(cells)
    title = f"Largest opening by stage of construction, before its grouting [{unit}]"
    return PageTable(["joint", *stages], rows, title)


def motion_section(subject: RunSubject) -> PageSection:
    """The record: what was analysed, and its peak along every axis."""
    dataset, attrs = subject.dataset, subject.dataset.attrs
    rows: list[list[Value]] = [
        ["record", str(attrs["record"])],
        ["sampling interval", f"{attrs['record_dt']:g} s"],
        ["analysed", f"{float(dataset.time[-1]):g} s"],
    ]
    peaks = peak_ground_acceleration(dataset) / _GRAVITY
    rows += [
        [f"peak acceleration {axis}", f"{number(float(peaks.sel(component=axis)))} g"]
        for axis in dataset.component.values
        if float(peaks.sel(component=axis)) > 0.0
    ]
    keys = keys_table(subject, "As the job states it", "records")
    return PageSection(
        "motion", "Ground motion", [PageTable([], rows), *subject.figures("ground_motion"), keys]
    )


def checks_section(subject: RunSubject) -> PageSection:
    """Model and time stepping, what was checked of the run, and its stated errors."""
    attrs, rows = subject.dataset.attrs, list[list[Value]]()
    for check in run_checks(attrs, subject.errors, subject.config.transient.tolerance):
        value, limit = (
            "–" if x is None else f"{number(100 * x, 2)} %" if check.is_share else f"{x:.2g}"
            for x in (check.value, check.limit)
        )
        rows.append([check.text, "unknown" if check.value is None else value, limit, check.verdict])
    rows.append(["error of the openings together, L2, at most", total_text(subject.errors), "–", NOT_JUDGED])
    head = ["check", "value", "limit", "verdict"]
    words = {"estimate": "Modes", "certificate": "Certificate", "verification": "Against the full mesh",
             "discretisation": "Mesh"}  # fmt: skip
    said = [Text(f"{words[kind]}: {sentence}") for kind, sentence in subject.statements.items()]
    order, count = str(attrs["model_order"]), attrs.get("unknowns", "–")
    size = Text(f"{order.capitalize()} model of {count} unknowns, integrator {attrs.get('integrator', '–')}.")
    keys = keys_table(subject, "Model and time stepping", "model", "transient", "outputs")
    return PageSection("checks", "Checks and stated errors", [size, PageTable(head, rows), *said, keys])


def bases_section(subject: RunSubject) -> PageSection | None:
    """Bases and lifts, which the dam stands on: their peaks, how they slide, and figures of all joints."""
    bearing = bearing_joints(subject.dataset)
    if not bearing:
        return None
    parts = [*_joint_tables(subject, bearing), *subject.figures("opening_envelope", "sliding")]
    return PageSection("bases", "Bases and lifts", parts)


def joints_section(subject: RunSubject) -> PageSection | None:
    """Joints that are no bases or lifts: their peaks and how they slide; histories of all joints."""
    if "joint" not in subject.dataset or not subject.dataset.joint.size:
        return None
    bearing = bearing_joints(subject.dataset)
    others = [str(name) for name in subject.dataset.joint.values if name not in bearing]
    of_all = [] if bearing else ["opening_envelope", "sliding"]
    histories = ("joint_opening", "joint_slip", "joint_displacement", "dissipated_energy")
    parts = [*_joint_tables(subject, others), *subject.figures(*of_all, *histories)]
    return PageSection("joints", "Joints", parts)


def _joint_tables(subject: RunSubject, names: Collection[str]) -> list[Part]:
    """Peaks of joints, and how they slide."""
    if not names:
        return []
    peaks = [joint for joint in joint_peaks(subject.dataset) if joint.joint in names]
    columns: list[tuple[str, str, list[float]]] = [
        ("largest opening", "m", [joint.opening for joint in peaks]),
        ("compression, mean of an interval", "Pa", [joint.mean_compression for joint in peaks]),
        ("compression at one instant", "Pa", [joint.compression for joint in peaks]),
        ("largest slip", "m", [joint.slip for joint in peaks]),
    ]
    head, values = ["joint"], list[list[Value]]()
    for text, units, column in columns:
        if not np.isnan(column).all():
            numbers, unit = subject.column(units, column)
            head.append(f"{text} [{unit}]")
            values.append(list(numbers))
    # behind the largest opening, which every result has
    times = [joint.opening_time for joint in peaks]
    head.insert(2, "at [s]")
    values.insert(1, [PageCell("–" if when is None else f"{when:.2f}", "n", when) for when in times])
    rows = [list(row) for row in zip([joint.joint for joint in peaks], *values, strict=True)]
    peaks_table = PageTable(head, rows, "Peaks over all steps; compression is negative")
    return [peaks_table, *_sliding_tables(subject, names)]


def _sliding_tables(subject: RunSubject, names: Collection[str]) -> Iterator[PageTable]:
    """How block J slides on block I, a row for each joint."""
    joints = [joint for joint in sliding(subject.dataset) if joint.joint in names]
    if not joints:
        return
    lengths = [(j.residual_slip, j.largest_slip, j.cumulative_slip) for j in joints]
    flat, unit = subject.column("m", [value for row in lengths for value in row])
    shown = np.reshape(flat, (-1, 3)).tolist()
    rows: list[list[Value]] = [
        [
            j.joint,
            f"{j.blocks[1]} on {j.blocks[0]}",
            j.verdict,
            j.factor,
            j.sliding_time,
            j.open_time,
            *numbers,
        ]
        for j, numbers in zip(joints, shown, strict=True)
    ]
    head = ["joint", "block", "verdict", "least factor of safety", "slides [s]", "open [s]"]
    head += [f"residual slip [{unit}]", f"largest of a gap [{unit}]", f"path [{unit}]"]
    note = written_note(subject.dataset)
    yield PageTable(head, rows, f"Sliding, {note}" if note else "Sliding")


def stress_section(subject: RunSubject) -> PageSection | None:
    """Stress of faces and their acceptance, by the limits of linear analysis."""
    dataset, parts = subject.dataset, list[Part]()
    faces = [str(name) for name in dataset.stress_face.values] if "face_principal_stress" in dataset else []
    if faces:
        percentiles = (HEADLINE, 100.0)
        stress = dataset.face_principal_stress.sel(area_percentile=list(percentiles)).transpose(
            "stress_face", ...
        )
        flat, unit = subject.column("Pa", stress.values.ravel().tolist())
        head = ["face", f"{HEADLINE:g} % of the area [{unit}]", f"largest [{unit}]", "ring [% of area]"]
        rows: list[list[Value]] = [
            [name, *numbers, float(dataset.ring_share.sel(stress_face=name))]
            for name, numbers in zip(faces, np.reshape(flat, (-1, 2)).tolist(), strict=True)
        ]
        parts.append(PageTable(head, rows, "Major principal stress, outside the ring; tension is positive"))
    if faces and "acceptance" in dataset:
        kinds = limits_of(dataset)
        strength = subject.text("Pa", float(dataset.tensile_strength))
        judged = list[list[Value]]()
        for name in faces:
            of_face = dataset.sel(stress_face=name)
            for basis in dataset.stress_basis.values:
                met = of_face.acceptance.sel(stress_basis=basis)
                ratio = float(of_face.face_demand_capacity_ratio.sel(stress_basis=basis))
                words = [verdict(met.sel(dam_kind=kind).values) for kind in kinds]
                judged.append([name, str(basis), ratio, *words])
        head = ["face", "stress", "demand-capacity ratio", *kinds]
        parts.append(PageTable(head, judged, f"Acceptance for a tensile strength of {strength}"))
        parts += [Text(f"Limits of {kind}s: {limits}.", soft=True) for kind, limits in kinds.items()]
        source = "After EM 1110-2-6053 (2007), chapter 4, as later papers quote it: check the limits there."
        parts.append(
            Text(f"{source} A face that fails calls for nonlinear analysis of its concrete.", soft=True)
        )
    parts += subject.figures("stress_damage", "stress", "stress_sections")
    section = PageSection("stress", "Stress and acceptance", parts)
    return section if section.shown else None


def floors_section(subject: RunSubject) -> PageSection | None:
    """Floor spectra and how far they may be off."""
    if "floor_spectrum" not in subject.dataset:
        return None
    parts: list[Part] = [*subject.figures("floor_spectra")]
    parts.append(Text(str(subject.dataset.attrs["floor_spectrum_statement"])))
    return PageSection("floors", "Floor spectra", parts)


def maxima_section(subject: RunSubject) -> PageSection:
    """The largest values, where and when, with the motion and the energy."""
    dataset = subject.dataset
    if "stress_position" in dataset:
        dataset = dataset.assign(stress_position=dataset.stress_position / subject.system.foot[0])
    every, rows = maxima(dataset), list[list[Value]]()
    # joints have a table of their own
    stated = [row for row in every if not row.quantity.startswith("joint ")]
    for row in stated:
        (value,), unit = subject.column(row.unit, [row.value])
        rows.append(
            [
                row.quantity,
                value,
                unit or unit_text(row.unit),
                row.where,
                PageCell(row.when or "–", "n"),
                row.note,
            ]
        )
    head = ["quantity", "value", "unit", "where", "time [s]", "note"]
    notes = [Text(text, soft=True) for text in explained(stated)]
    return PageSection("maxima", "Largest values", [
        PageTable(head, rows, f"Positions (x, y, z) in {subject.system.foot[1]}"), *notes,
        *subject.figures("top_displacements", "energy"),
    ])  # fmt: skip


def limits_section(subject: RunSubject) -> PageSection:
    """Warnings of the run, and what the model leaves out."""
    warnings = stated_warnings(subject.dataset.attrs)
    rows: list[list[Value]] = [[str(k), text] for k, text in enumerate(warnings, 1)]
    slides = [Text(_SLIDING_LIMIT)] if "sliding_safety_factor" in subject.dataset else []
    return PageSection(
        "limits",
        "Warnings and limits",
        [PageTable(["no.", "warning"], rows, "Warnings"), *slides, *map(Text, _LIMITS)],
    )


def reproduction_section(subject: RunSubject) -> PageSection:
    """What makes the same run again: digests, versions, commands and the configuration."""
    attrs = subject.dataset.attrs
    versions = json.loads(str(attrs.get("versions", "{}")))
    rows: list[list[Value]] = [
        ["configuration", str(attrs["configuration_file"])],
        ["its SHA-256", str(attrs["configuration_sha256"])],
        ["SHA-256 of the record", str(attrs.get("record_sha256", "–"))],
        ["run with", ", ".join([str(attrs["source"]), *(f"{name} {v}" for name, v in versions.items())])],
        ["machine", str(attrs.get("machine", "–"))],
        ["report made with", SOURCE],
    ]
    commands = (
        f"romdam run {Path(str(attrs['configuration_file'])).name} --out DIR\n{subject.command}".rstrip()
    )
    whole = json.dumps(json.loads(str(attrs["configuration"])), indent=1, ensure_ascii=False)
    parts: list[Part] = [PageTable([], rows), Code(commands), Folded("The configuration, in SI units", whole)]
    return PageSection("reproduce", "How to reproduce", parts)


def keys_table(subject: RunSubject, caption: str, *sections: str) -> PageTable:
    """Keys of sections of the job that are not at their defaults."""
    keys = [
        key for key in stated_keys(subject.config) if key.path.partition(".")[0].partition("[")[0] in sections
    ]
    rows: list[list[Value]] = [
        [key.path, _value_text(subject, key), PageCell(key.text.replace("`", ""), "text")] for key in keys
    ]
    return PageTable(["key", "value", "meaning"], rows, f"{caption}; what is not listed has its default")


def _value_text(subject: RunSubject, key: StatedKey) -> str:
    """The value of a key in the report's units: a word, a number or a list, which may be cut."""
    if isinstance(key.value, bool):
        return str(key.value).lower()
    numbers = list(_numbers(key.value))
    if not numbers:
        values = key.value if isinstance(key.value, tuple) else (key.value,)
        more = f" and {len(values) - _LONG_LIST} more" if len(values) > _LONG_LIST else ""
        return ", ".join(str(value) for value in values[:_LONG_LIST]) + more
    largest = max(abs(value) for value in numbers)
    foot, length = subject.system.foot
    size, unit = (
        (foot, length) if key.units == "m" and largest >= foot else subject.system.suited(key.units, largest)
    )
    value = key.value
    if isinstance(value, tuple) and len(set(numbers)) == 1 and len(numbers) == 2:
        value = numbers[0]  # equal along both directions of a joint, at both ends
    return f"{_scaled_text(value, size)} {unit}".strip()


def _numbers(value: object) -> Iterator[float]:
    """All numbers in a value and in the lists within it."""
    if isinstance(value, int | float):
        yield float(value)
    for member in value if isinstance(value, tuple) else ():
        yield from _numbers(member)


def _scaled_text(value: object, size: float) -> str:
    """Text of a value whose numbers are divided by the size of their unit."""
    if isinstance(value, tuple):
        shown = [_scaled_text(member, size) for member in value[:_LONG_LIST]]
        more = ", …" if len(value) > _LONG_LIST else ""
        return f"({', '.join(shown)}{more})"
    return number(float(value) / size, 4) if isinstance(value, int | float) else str(value)


RUN_SECTIONS: tuple[Callable[[RunSubject], PageSection | None], ...] = (
    bases_section,
    dam_section,
    loads_section,
    motion_section,
    checks_section,
    joints_section,
    stress_section,
    floors_section,
    maxima_section,
    limits_section,
    reproduction_section,
)
