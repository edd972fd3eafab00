"""Values that a configuration may have and hardly can mean: they are told, not refused."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from pydantic import BaseModel

from romdam.config.job import Config
from romdam.config.parameters import joints_at
from romdam.config.sections.job import (
    BoxConfig,
    DampingConfig,
    MaterialConfig,
    ModelConfig,
    OutputsConfig,
    RayleighConfig,
)
from romdam.config.sections.joint_laws import LawSection
from romdam.config.sections.joint_water import JointWaterConfig
from romdam.config.sections.joints import JointConfig, JointProperties
from romdam.config.sections.loads import ForceConfig, HydrostaticConfig, PressureConfig, TemperatureConfig
from romdam.config.sections.motion_along import IncoherenceConfig, MotionAlongConfig, StationConfig
from romdam.config.sections.motions.correction import CornersStep
from romdam.config.sections.motions.records import RecordConfig, ScaleConfig, unit_in_si
from romdam.config.sections.stress import StressConfig
from romdam.config.sections.suite import IntensityConfig, SuiteConfig
from romdam.config.sections.transient import TransientConfig
from romdam.config.sections.water import WaterConfig
from romdam.core.integrators import INTEGRATORS

Range = tuple[float, float, str, str]  # least and largest magnitude in SI, the unit, what is usual
_RATIO = (0.0, 0.2, "", "structural damping is commonly 0.02 to 0.1 (2 % to 10 %)")
_WATER = (900.0, 1400.0, "kg/m3", "water has 1000 kg/m3")
_STRENGTH = (1e4, 2e7, "Pa", "concrete has 1 to 5 MPa")
_JOINT: dict[str, Range] = {
    "friction": (0.1, 1.2, "", "concrete joints have about 0.6"),
    "friction_static": (0.1, 1.2, "", "concrete joints have about 0.6"),
    "gap": (0.0, 0.1, "m", "joints open by millimetres"),
    "tensile_strength": _STRENGTH,
    "cohesion": _STRENGTH,
    "grouting_pressure": (1e4, 5e6, "Pa", "joints are grouted at 0.1 to 1 MPa"),
    "viscosity": (1e2, 1e9, "N*s/m3", "0.01 to 1 % of normal_stiffness, in seconds, is usual"),
    "tolerance": (0.0, 0.1, "m", "1 mm, and less than the distance of two nodes, finds what coincides"),
}
_OF_LAWS: dict[str, Range] = {  # keys of laws' own sections
    "depth": (0.005, 2.0, "m", "keys are 5 to 50 cm deep"),
    "mu_s": (0.1, 1.2, "", "concrete joints have about 0.6"),
    "mu_d": (0.1, 1.2, "", "concrete joints have about 0.6"),
    "v_c": (1e-4, 1.0, "m/s", "friction changes over millimetres to centimetres a second"),
    "d_c": (1e-4, 1.0, "m", "friction falls over millimetres to decimetres of slip"),
    "JRC": (1.0, 20.0, "", "joints have 2 (smooth) to 20 (rough)"),
    "JCS": (1e6, 3e8, "Pa", "walls of rock joints have 10 to 200 MPa"),
    "mu_b": (0.3, 1.0, "", "rock has basic friction angles of 25 to 35 degrees"),
}
_FALLING = {"velocity_friction": "the speed", "slip_weakening": "the slip"}
_AT_REST = ("joints.", "materials.", "loads.", "arch_dam.", "gravity_dam.", "cut.")
_USUAL: dict[type[BaseModel], dict[str, Range]] = {
    MaterialConfig: {
        "E": (1e8, 2.5e11, "Pa", "concrete has about 30 GPa, rock 1 to 100 GPa"),
        "E_dynamic": (1e8, 2.5e11, "Pa", "concrete has about 35 GPa"),
        "nu": (0.05, 0.45, "", "concrete has about 0.18, rock 0.2 to 0.3"),
        "rho": (500.0, 8000.0, "kg/m3", "concrete has about 2400 kg/m3"),
        "expansion": (1e-6, 1e-4, "1/K", "concrete has about 1e-5 1/K"),
    },
    JointConfig: _JOINT,
    JointProperties: _JOINT,
    HydrostaticConfig: {"density": _WATER},
    JointWaterConfig: {"density": _WATER},
    ForceConfig: {"force": (1.0, 1e9, "N", "1 GN is the weight of 40,000 m3 of concrete")},
    WaterConfig: {
        "density": _WATER,
        "sound_speed": (1000.0, 1600.0, "m/s", "water has 1440 m/s, with bubbles less"),
        "cutoff": (5.0, 200.0, "Hz", "records shake dams up to 30 Hz"),
    },
    PressureConfig: {"value": (0.0, 1e7, "Pa", "1000 m of water have 10 MPa")},
    TemperatureConfig: {"change": (0.0, 60.0, "K", "dams warm and cool by up to 20 K")},
    RayleighConfig: {
        "ratio": _RATIO,
        "frequencies": (0.05, 500.0, "Hz", "dams have their modes between 1 and 30 Hz"),
    },
    DampingConfig: {"modal": _RATIO},
    BoxConfig: {"size": (0.01, 5000.0, "m", "dams are metres to hundreds of metres")},
    ModelConfig: {
        "cutoff": (1.0, 5000.0, "Hz", "50 Hz suits most dams"),
        "memory": (1e8, 1e14, "bytes", "write 8 GB for example"),
    },
    TransientConfig: {"finest_step": (1e-6, 0.02, "s", "a step of 1 to 5 ms suits most dams")},
    OutputsConfig: {"output_interval": (1e-6, 0.1, "s", "0.01 s shows the openings")},
    StressConfig: {"strength": _STRENGTH},
    RecordConfig: {
        "dt": (5e-4, 0.1, "s", "records are sampled at 50 to 1000 Hz"),
        "x_azimuth": (0.0, 360.0, "degrees", "an azimuth is 0 to 360 degrees"),
    },
    ScaleConfig: {
        "factor": (0.02, 20.0, "", "records are scaled by 0.2 to 5"),
        "pga": (0.02, 30.0, "m/s2", "the strongest ground motions have 1 to 2 g"),
        "sa": (0.02, 60.0, "m/s2", "the strongest ground motions have 1 to 5 g"),
        "period": (0.02, 10.0, "s", "dams have 0.1 to 1 s"),
        "damping": _RATIO,
    },
    MotionAlongConfig: {
        "velocity": (100.0, 2e4, "m/s", "waves pass rock at 1000 to 5000 m/s"),
        "cutoff": (5.0, 100.0, "Hz", "joints and dams answer little above 25 Hz"),
    },
    StationConfig: {"delay": (0.0, 10.0, "s", "waves pass a dam in less than a second")},
    IncoherenceConfig: {
        "shear_velocity": (100.0, 5000.0, "m/s", "rock has 500 to 3500 m/s"),
    },
    IntensityConfig: {
        "values": (0.02, 60.0, "m/s2", "the strongest ground motions have 1 to 5 g"),
        "period": (0.02, 10.0, "s", "dams have 0.1 to 1 s"),
        "damping": _RATIO,
    },
    SuiteConfig: {
        "scales": (0.02, 20.0, "", "records are scaled by 0.2 to 5"),
        "period": (0.02, 10.0, "s", "dams have 0.1 to 1 s"),
    },
    CornersStep: {
        "highpass": (0.01, 2.0, "Hz", "high-pass corners are 0.02 to 0.5 Hz"),
        "lowpass": (5.0, 200.0, "Hz", "low-pass corners are 20 to 50 Hz"),
    },
}


def check_assumptions(config: Config) -> tuple[str, ...]:
    """Tell what is unusual in a configuration, a line for each with key, value and what is usual."""
    remarks = [*_unusual(config, "")]
    loads, gravity, water = config.loads, config.loads.gravity, config.water
    if gravity is not None and gravity[2] == 0.0 and (loads.hydrostatic or loads.joint_water):
        remarks.append(
            f"loads.gravity: {list(gravity)} m/s2 has no vertical part; still water and water in joints "
            f"weigh with {loads.gravity_of_water:g} m/s2 (leave them out for none)"
        )
    if gravity is not None and any(gravity):
        size = math.hypot(*gravity)
        if gravity[2] >= 0.0:
            downwards = "z is up, [0, 0, -9.81] makes weight"
            remarks.append(f"loads.gravity: {list(gravity)} m/s2 does not point down; {downwards}")
        if not 9.7 <= size <= 9.9:
            remarks.append(f"loads.gravity: its size is {size:g} m/s2, on earth it is 9.81 m/s2")
    for i, record in enumerate(config.records):
        factor = 1.0 if record.unit is None else unit_in_si(record.unit)
        if not 1e-4 <= factor <= 10.0:
            remarks.append(
                f"records[{i}].unit: one unit is {factor:g} m/s2, which is unusual: files are in g, m/s2, "
                "cm/s2 or mm/s2; is the unit right?"
            )
    for i, still in enumerate(loads.hydrostatic):
        if water is not None and still.level != water.level:
            remarks.append(
                f"loads.hydrostatic[{i}].level: {still.level:g} m is not water.level, "
                f"{water.level:g} m; is it the same reservoir?"
            )

    # keys that are given and do nothing
    model, transient = config.model, config.transient
    if model.order == "full":
        for key in ("modes", "cutoff", "residual_vectors", "solver"):
            if key in model.model_fields_set:
                remedy = "leave it out, or set order: reduced"
                remarks.append(f"model.{key}: does nothing at full order; {remedy}")
    for name, entry in INTEGRATORS.items():
        for key in entry.keys:
            if transient.integrator not in (None, name) and key in transient.model_fields_set:
                remarks.append(f"transient.{key}: does nothing with {transient.integrator}, but with {name}")
    if config.pipeline == "run" and config.suite is not None:
        remarks.append("suite: does nothing with pipeline: run; set pipeline: suite, or leave it out")
    if loads.weight == "staged" and gravity is None:
        remarks.append("loads.weight: staged does nothing without loads.gravity; give gravity: [0, 0, -9.81]")
    parameters = (config.suite.parameters if config.suite else {}).values()
    varied = {
        joint for parameter in parameters for path in parameter.paths for joint in joints_at(config, path)
    }
    for name, joint in config.every_joint.items():
        if joint.has_idle_shear and name not in varied:
            remarks.append(
                f"joints.{name}.shear_stiffness: does nothing by itself (but in `romdam modes --joints "
                "bonded`): it acts up to a limit that friction, cohesion or a shear_key gives; give one of "
                "these (friction: 0 says that none is meant), or, for an elastic joint, tension_stiffness "
                "equal to normal_stiffness"
            )
    return tuple(remarks)


def odd_at_rest(config: Config, remarks: Iterable[str]) -> tuple[str, ...]:
    """What a state at rest may fail over: values that the job hardly can mean, of joints alike the first.

    Parameters
    ----------
    remarks : of its scene
    """
    doubtful = dict[str, str]()
    for text in (*check_assumptions(config), *remarks):
        key = text.partition(" ")[0].rstrip(":")
        if key == "loads.gravity" or (text.endswith("?") and key.startswith(_AT_REST)):
            root, _, last = key.rpartition(".")
            doubtful.setdefault(last if root.startswith("joints.") else key, text)
    return tuple(doubtful.values())


def _unusual(model: BaseModel, path: str) -> Iterator[str]:
    """Numbers far from the usual, of a model and all that stand in it."""
    usual = _OF_LAWS if isinstance(model, LawSection) else _USUAL.get(type(model), {})
    for field in type(model).model_fields:
        for key, value in _values(getattr(model, field), f"{path}{field}"):
            if isinstance(value, BaseModel):
                yield from _unusual(value, f"{key}.")
                if field in _FALLING and getattr(value, "mu_s", 0.0) > getattr(value, "mu_d", 0.0):
                    yield (
                        f"{key}: friction falls with {_FALLING[field]}, so that stiff joints stick and "
                        "slide by turns, at times that hang on the step: slips of runs at several steps say "
                        "more than the stated error of one; compare transient.finest_step of 0.2 and 0.05 ms"
                    )
            elif isinstance(value, float) and field in usual:
                least, most, unit, text = usual[field]
                if not least <= abs(value) <= most and value != 0.0:
                    yield f"{key}: {f'{value:g} {unit}'.strip()} is unusual: {text}; is the unit right?"


def _values(value: object, path: str) -> Iterator[tuple[str, object]]:
    """The values in mappings and lists, each with where it stands."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _values(inner, f"{path}.{key}")
    elif isinstance(value, tuple):
        alike = len(value) > 1 and all(inner == value[0] for inner in value)  # one number for all directions
        for i, inner in enumerate(value[:1] if alike else value):
            yield from _values(inner, path if alike else f"{path}[{i}]")
    else:
        yield path, value
