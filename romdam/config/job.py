"""One job as a whole: what its sections ask of each other is checked."""

from __future__ import annotations

import difflib
from collections.abc import Collection
from typing import Self

from pydantic import ValidationInfo, model_validator

from romdam.config.construction import refuse_wrong_construction
from romdam.config.coupling import couplings, refuse_coupled
from romdam.config.effects import refuse_excluded
from romdam.config.linear_stage import refuse_linear_stage
from romdam.config.sections.attachments import PointConfig
from romdam.config.sections.combinations import refuse_wrong_combinations
from romdam.config.sections.geometry.cut import refuse_wrong_cuts
from romdam.config.sections.ground import refuse_wrong_ground
from romdam.config.sections.job import Sections
from romdam.config.sections.joints import (
    TOUCHING,
    JointConfig,
    TouchingConfig,
)
from romdam.config.sections.stress import StressConfig
from romdam.config.sections.suite import KeepConfig
from romdam.config.sections.supports import refuse_wrong_motions
from romdam.core.errors import listed, quote
from romdam.core.integrators import INTEGRATORS

OF_SAMPLE = "of_sample"  # in the context of a validation: `joints` may have those that dams and cuts make


class Config(Sections):
    """One job: scene, records, model, time integration and outputs."""

    @model_validator(mode="after")
    def _references(self, info: ValidationInfo) -> Self:
        self._refuse_no_blocks(of_sample=bool((info.context or {}).get(OF_SAMPLE)))
        for name, block in self.blocks.items():
            self._known(f"blocks.{name}.material", block.material, self.materials)
        if not self.unfound:  # else names of blocks and joints are known once they are found
            self._refuse_wrong_references()
        return self

    def _refuse_wrong_references(self) -> None:
        if self.model.order == "full" and self.transient.finest_step is None:
            raise ValueError(
                "transient.finest_step is missing; a full-order model needs a step, `accuracy` is for "
                "reduced ones"
            )
        if self.model.modes == "auto" and self.transient.accuracy is None:
            raise ValueError("model.modes: auto needs transient.accuracy, which it is to meet; give it")
        self._refuse_accuracy_of_no_slips()
        self._refuse_automatic_spacing_that_nothing_judges()
        self._refuse_state_of_no_such_model()
        self._refuse_damping_that_the_integrator_does_not_know()
        blocks = frozenset(self.block_names)
        self._refuse_total_that_no_run_states()
        self._refuse_interval_that_no_steps_divide()
        self._refuse_grouting_without_rest()
        self._refuse_two_moduli_without_rest()
        parameters = self.suite.parameters.values() if self.suite else ()
        varied = [path for parameter in parameters for path in parameter.paths]
        refuse_excluded(self)
        refuse_wrong_construction(self)
        if self.linear_stage is not None:
            refuse_linear_stage(self)
        refuse_wrong_ground(self.ground, self.arch_dam)
        refuse_coupled(couplings(self), self.transient.integrator, varied)
        several = len(self.records) > 1 or self.pipeline == "suite"
        refuse_wrong_motions(self.supports, self.ground.along, self.transient, several)
        for i, support in enumerate(self.supports):
            self._known(f"supports[{i}].block", support.block, blocks)
        for key, name in self.ground.named.items():
            self._known(f"ground.{key}", name, blocks)
        named = [(f"joints.{n}", j.between) for n, j in self.joints.items() if isinstance(j, JointConfig)]
        for key, between in (*named, *((f"ties.{name}", tie.between) for name, tie in self.ties.items())):
            for block_name in between:
                self._known(f"{key}.between", block_name, blocks)
        for key, (properties, joints) in self.joint_sections.items():
            for joint_name in properties.spacing if isinstance(properties.spacing, dict) and joints else ():
                self._known(f"{key}.spacing", joint_name, joints)
        for i, pressure in enumerate(self.loads.pressure):
            self._known(f"loads.pressure[{i}].block", pressure.block, blocks)
        for section in ("hydrostatic", "ice", "silt"):
            for i, load in enumerate(getattr(self.loads, section)):
                for k, face in enumerate(load.faces):
                    self._known(f"loads.{section}[{i}].faces[{k}].block", face.block, blocks)
        for i, line in enumerate(self.loads.line):
            self._known(f"loads.line[{i}].block", line.block, blocks)
        for i, wet in enumerate(self.loads.joint_water):
            for joint_name in wet.joints:
                self._known(f"loads.joint_water[{i}].joints", joint_name, self.every_joint)
        for i, warm in enumerate(self.loads.temperature):
            for block_name in warm.blocks or ():
                self._known(f"loads.temperature[{i}].blocks", block_name, blocks)
        for i, stage in enumerate(self.construction):
            for block_name in (
                *stage.pour,
                *(name for warm in stage.temperature for name in warm.blocks or ()),
            ):
                self._known(f"construction[{i}]", block_name, blocks)
            for zone in stage.grout:
                for joint_name in zone.joints:
                    self._known(f"construction[{i}].grout.joints", joint_name, self.every_joint)
        for i, force in enumerate(self.loads.force):
            self._known(f"loads.force[{i}].block", force.block, blocks)
        for i, history in enumerate(self.loads.force_history):
            self._known(f"loads.force_history[{i}].block", history.block, blocks)
        ends = [(f"anchors.{name}", anchor.head, anchor.foot) for name, anchor in self.anchors.items()]
        ends += [(f"dampers.{name}", damper.head, damper.foot) for name, damper in self.dampers.items()]
        for key, head, foot in ends:
            self._known(f"{key}.head.block", head.block, blocks)
            if isinstance(foot, PointConfig):
                self._known(f"{key}.foot.block", foot.block, blocks)
        for name, lumped in self.masses.items():
            self._known(f"masses.{name}.block", lumped.block, blocks)
        for joint_name in (self.post_earthquake.joints if self.post_earthquake else None) or ():
            self._known("post_earthquake.joints", joint_name, self.every_joint)
        refuse_wrong_combinations(self.combinations)
        for name, combination in self.combinations.items():
            for joint_name in combination.joints or ():
                self._known(f"combinations.{name}.joints", joint_name, self.every_joint)
        for name, node in self.outputs.nodes.items():
            self._known(f"outputs.nodes.{name}.block", node.block, blocks)
        self._refuse_floors_without_nodes()
        if self.outputs.stress is not None:
            self._known_in_stress(self.outputs.stress, blocks)
        for name, both in (self.comparison.relative if self.comparison else {}).items():
            for node_name in both:
                self._known(f"comparison.relative.{name}", node_name, self.outputs.nodes)
        for i, face in enumerate(self.water.faces if self.water else ()):
            self._known(f"water.faces[{i}].block", face.block, blocks)

    def _refuse_floors_without_nodes(self) -> None:
        asked, nodes = self.outputs.floor_spectra, self.outputs.nodes
        if asked is None:
            return
        if not nodes:
            raise ValueError(
                "outputs.floor_spectra: spectra are of the motion of `outputs.nodes`, and there is none; "
                "name at least one, such as crest: {block: C4, at: [0, 0, 120 m]}"
            )
        for place, names in (asked.places or {}).items():
            for name in names:
                self._known(f"outputs.floor_spectra.places.{place}", name, nodes)

    def _refuse_grouting_without_rest(self) -> None:
        grouted = [name for name, joint in self.every_joint.items() if joint.law_keys["grouting_pressure"]]
        if grouted and self.loads.initial_state == "undeformed":
            raise ValueError(
                f"joints.{grouted[0]}.grouting_pressure is what the joint has at rest, and "
                "loads.initial_state: undeformed starts without rest; set static, or leave the pressure out"
            )

    def _refuse_two_moduli_without_rest(self) -> None:
        two = [name for name, one in self.materials.items() if one.E_dynamic not in (None, one.E)]
        if not two:
            return
        key, state = f"materials.{two[0]}.E_dynamic", self.loads.initial_state
        if state != "static":
            given = state if isinstance(state, str) else state.result
            raise ValueError(
                f"{key}: E is the modulus of the state at rest, and loads.initial_state: {given} begins "
                "elsewhere; set static, or leave E_dynamic out"
            )
        for name, block in self.blocks.items():
            if block.matrices is not None and block.material in two:
                raise ValueError(
                    f"materials.{block.material}.E_dynamic: block {quote(name)} has the stiffness of "
                    "`matrices` for all loads; give it a material with one modulus"
                )

    def _refuse_state_of_no_such_model(self) -> None:
        state = self.loads.initial_state
        if isinstance(state, str):
            return
        key = "loads.initial_state"
        automatic = [name for name, joint in self.every_joint.items() if joint.spacing == "auto"]
        others: dict[str, tuple[bool, str]] = {
            "transient.accuracy.total tries other meshes": (
                self.transient.total_accuracy is not None,
                "give an accuracy of the steps, 1 %",
            ),
            f"joints.{next(iter(automatic), '')}.spacing: auto tries other gaps": (
                bool(automatic),
                "give the length that the state's run came to",
            ),
            f"outputs.mesh_error: {self.outputs.mesh_error} runs another mesh": (
                self.outputs.mesh_error in ("finer", "coarser"),
                "leave it out",
            ),
        }
        if state.take == "all":
            others |= {
                "model.modes: auto may choose others": (
                    self.model.modes == "auto",
                    "give the number that the state's run came to, or take: joints",
                ),
                "suite.parameters vary it": (
                    self.pipeline == "suite" and bool(self.suite and self.suite.parameters),
                    "set take: joints",
                ),
            }
        for why, (there, remedy) in others.items():
            if there:
                raise ValueError(f"{key}: a state belongs to one model, and {why}; {remedy}")

    def _refuse_no_blocks(self, *, of_sample: bool) -> None:
        if not self.block_names:
            raise ValueError("blocks: name at least one block, or give `arch_dam` or `gravity_dam`")
        if self.arch_dam and self.gravity_dam:
            raise ValueError("gravity_dam: a scene has one dam, and arch_dam is given too; leave one out")
        dam, key = self.dam, "gravity_dam" if self.gravity_dam else "arch_dam"
        for name in dam.block_names if dam else ():
            if name in self.blocks and not self.blocks[name].of_dam:
                raise ValueError(f"blocks.{name}: {key} makes a block of that name; rename this one")
        _refuse_wrong_matrices(self, dam.block_names if dam else ())
        self._refuse_bodies_of_taken_names()
        bodies = [body for name in self.blocks for body in self._bodies_of(name)]
        if not self.unfound:
            refuse_wrong_cuts(self.cut, bodies, dam.block_names if dam else ())
        makers = dict.fromkeys(dam.joint_pairs if dam else (), key)
        makers |= {name: f"cut.{whole}" for whole, cut in self.cut.items() for name in cut.joint_pairs}
        touching = self.touching
        makers |= dict.fromkeys((touching.pairs if touching else None) or {}, f"joints.{TOUCHING}")
        for name, section in self.joints.items():
            if isinstance(section, TouchingConfig) and name != TOUCHING:
                raise ValueError(
                    f"joints.{name}.pairs: is of joints.{TOUCHING}, the joints of all that touches; give "
                    "`between`, the names of two blocks"
                )
            if name in makers and not of_sample:
                raise ValueError(f"joints.{name}: {makers[name]} makes a joint of that name; rename this one")
        for inner, material in (dam.materials if dam else {}).items():
            self._known(f"{key}.{inner}", material, self.materials)

    def _refuse_bodies_of_taken_names(self) -> None:
        seen = dict[str, str]()
        for name in self.blocks:
            for body in self._bodies_of(name):
                other = seen.setdefault(body, name)
                if other != name or self._bodies_of(name).count(body) > 1:
                    raise ValueError(
                        f"blocks.{name}.mesh.bodies: the name {quote(body)} is that of another block or "
                        "body; rename one of the two"
                    )

    def _refuse_damping_that_the_integrator_does_not_know(self) -> None:
        name = self.transient.integrator
        if name is not None and not INTEGRATORS[name].damped and self.damped:
            raise ValueError(
                f"transient.integrator: {name} is for scenes without damping, and `damping` is given; "
                "leave the integrator out, adaptive is the default there"
            )

    def _refuse_total_that_no_run_states(self) -> None:
        if self.transient.total_accuracy is None:
            return
        lacking = {
            "joints, whose openings it is of": bool(self.every_joint),
            "damping, without which histories part in time whatever the mesh": self.damped,
            "outputs.error_estimate, which states what the modes leave": self.outputs.error_estimate,
        }
        for what, there in lacking.items():
            if not there:
                raise ValueError(
                    f"transient.accuracy.total: needs {what}; or give an accuracy of the steps, 1 %"
                )
        if self.outputs.mesh_error in ("finer", "coarser"):
            raise ValueError(
                "outputs.mesh_error: transient.accuracy.total states the error of the mesh that it chooses; "
                "leave one of the two out"
            )

    def _refuse_accuracy_of_no_slips(self) -> None:
        asked = next(iter(self.transient.slip_accuracies), None)
        if asked is None:
            return
        laws = [(law, joint.law_keys) for joint in self.every_joint.values() for law in joint.every_law]
        if not any(law.needs_shear(keys) for law, keys in laws):
            raise ValueError(
                f"transient.accuracy.{asked}: no joint of the job carries shear, so none has slips; "
                "leave it out, or give a joint `friction` and `shear_stiffness`"
            )
        if not self.damped:
            raise ValueError(
                f"transient.accuracy.{asked}: without `damping` runs are compared by their peak openings, "
                "not by slips; leave it out, or give damping"
            )

    def _refuse_automatic_spacing_that_nothing_judges(self) -> None:
        automatic = [name for name, joint in self.every_joint.items() if joint.spacing == "auto"]
        if not automatic:
            return
        lacking = {
            "transient.accuracy, which it is to meet": self.transient.accuracy is not None,
            "an accuracy of the steps (accuracy: 1 %), as accuracy.total chooses contact points itself": (
                self.transient.total_accuracy is None
            ),
            "model.order: reduced": self.model.order == "reduced",
        }
        for what, there in lacking.items():
            if not there:
                raise ValueError(f"spacing: auto of joint {automatic[0]} needs {what}; or give a length")

    def _refuse_interval_that_no_steps_divide(self) -> None:
        key, interval = "outputs.output_interval", self.outputs.output_interval
        if self.pipeline == "suite" and self.suite and isinstance(self.suite.keep, KeepConfig):
            key, interval = "suite.keep.output_interval", self.suite.keep.output_interval
        step = self.transient.finest_step
        if step is None or interval is None:
            return
        stride = round(interval / step)
        if step > interval and step >= 1.0:  # no dam is integrated in seconds
            raise ValueError(
                f"transient.finest_step: {step:g} s is longer than {key}, {interval:g} s; is "
                f"`{step:g} ms` meant?"
            )
        if stride < 1 or abs(interval / step - stride) > 1e-6 * interval / step:
            raise ValueError(
                f"{key} must be a whole multiple of transient.finest_step ({step:g} s), "
                f"got {interval:g} s; {max(1, stride) * step:g} s is the nearest"
            )

    def _known_in_stress(self, stress: StressConfig, blocks: Collection[str]) -> None:
        for name in stress.blocks if stress.blocks != "all" else ():
            self._known("outputs.stress.blocks", name, blocks)
        for i, face in enumerate(stress.faces):
            self._known(f"outputs.stress.faces[{i}].block", face.block, blocks)
        for name, node in stress.nodes.items():
            self._known(f"outputs.stress.nodes.{name}.block", node.block, blocks)
        for key, section in stress.sections.items():
            for name in section.blocks if section.blocks != "all" else ():
                self._known(f"outputs.stress.sections.{key}.blocks", name, blocks)

    @staticmethod
    def _known(key: str, name: str, among: Collection[str]) -> None:
        if name not in among:
            near = difflib.get_close_matches(name, among, n=1)
            meant = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{key}: no {quote(name)} is defined; defined are {listed(among)}{meant}")


def _refuse_wrong_matrices(config: Sections, made: Collection[str]) -> None:
    """Raise if a block with matrices has no shape, is cut, or has its own damping beside modal ratios.

    Parameters
    ----------
    made : names of the blocks that a dam of a few keys makes

    Raises
    ------
    ValueError
    """
    for name, block in config.blocks.items():
        if block.of_dam and name not in made:
            raise ValueError(
                f"blocks.{name}: give exactly one of `box` and `mesh`, the shape of what has these "
                f"matrices; without them it must be a dam's block, and those are {listed(made)}"
            )
        if block.matrices is not None and name in config.cut:
            raise ValueError(f"cut.{name}: a block with `matrices` cannot be cut; leave one of the two out")
        if block.matrices is not None and block.matrices.damping and config.damping.modal is not None:
            raise ValueError(
                f"blocks.{name}.matrices.damping: damping.modal gives ratios to modes that a damping matrix "
                "couples; give damping.rayleigh for the other blocks, or leave one of the two out"
            )
