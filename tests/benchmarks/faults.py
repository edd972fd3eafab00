"""Faults that the tests must notice: slips of a programmer in code that computes numbers, room by room.

`mutants.py` plants each into a copy of the tree. The texts must stand in their files exactly once; when code
moves, the text here moves with it (`tests/test_mutants_table.py` says which). `more_faults.py` has others.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fault import COMPILED, Fault, faults_in
from more_faults import MORE_FAULTS

__all__ = ["COMPILED", "FAULTS", "Fault", "misplaced"]

_SLOW = ("-k", "not peer_record and not pyrotd and not eqsig and not p695")  # of these files, and not needed
_RECORDS = ("tests/records/test_values_by_hand.py",)
_RESULTS = ("tests/results/test_values_by_hand.py",)
_POSTPROCESS = ("tests/results/test_postprocess_by_hand.py",)
_CONTACT = ("tests/contact/test_contact_by_hand.py",)
_TIMESTEPPING = ("tests/timestepping/test_timestepping_by_hand.py",)
_GEOMETRY = ("tests/geometry/test_geometry_by_hand.py",)
_SCENE = ("tests/scene/test_scene_by_hand.py",)
_FEM = ("tests/fem/test_fem_by_hand.py",)
_EFFECTS = ("tests/fem/test_effects_by_hand.py",)
_REDUCTION = ("tests/reduction/test_reduction_by_hand.py",)
_ERROR = ("tests/error/test_error_by_hand.py",)
_UGLY = ("tests/effects/test_ugly_scene.py",)
_STEPS = ("tests/contact/test_steps_by_hand.py",)
_KERNELS = ("tests/timestepping/test_modal_kernels_by_hand.py",)
_FIGURES = ("tests/results/test_run_report.py", "-k", "own_rows or worst_of or in_g")
_UNITS = ("tests/config/test_unit_tables.py",)

_FAULTS = [
    *faults_in(
        "timestepping/construction.py",
        _UGLY,
        ("slip[gaps] = -(system.B @ q)", "slip[gaps] = (system.B @ q)"),
    ),
    *faults_in(
        "scene/build.py",
        _UGLY,
        ("if np.any(changes.get(name, 0.0))}", "if name in config.loads.temperature}"),
    ),
    *faults_in(
        "scene/ground/motion_along.py",
        _UGLY,
        (
            "station.delay, station.factor, station=",
            "station.delay, config.stations[-1 - k].factor, station=",
        ),
    ),
    *faults_in(
        "effects/added_mass.py",
        _UGLY,
        (
            "below = np.maximum(water.level - x[..., 2], 0.0)",
            "below = np.maximum(x[..., 2] - water.level + water.depth, 0.0)",
        ),
    ),
    *faults_in(
        "scene/construction.py",
        _UGLY,
        ("inside = (z >= low) & (z < high)", "inside = (z > low) & (z <= high)"),
    ),
    *faults_in(
        "config/sections/loads.py",
        _UGLY,
        ("abs(self.gravity[2])) or 9.81", "9.81) or 9.81"),
    ),
    *faults_in(
        "results/joint_traction.py",
        _UGLY,
        ("select = 0.5 * _on_plane", "select = (1.0 - side) * _on_plane"),
    ),
    *faults_in(
        "results/sliding.py",
        _RESULTS,
        (
            'c.history.bonded * c.of_gaps("area")),\n',
            'c.history.bonded) * c.of_gaps("area").mean(),\n',
        ),
    ),
    *faults_in(
        "core/display_units.py",
        _UNITS,
        ("_INCH**3", "_FOOT**3"),
    ),
    *faults_in(
        "visual/report/sections.py",
        ("tests/suite/test_report.py", "-k", "unlike_parts"),
        ("np.sum(list(errors.values()), axis=0)", "np.max(list(errors.values()), axis=0)"),
    ),
    *faults_in(
        "records/processing/correction_steps.py",
        _RECORDS,
        ("@ coefficients[1:] / ((n - 1) * dt)", "@ coefficients[1:] / (n * dt)"),
        ("np.ceil(1.5 * order / corner / dt)", "np.ceil(order / corner / dt)"),
        ("slope = (time[:, None] >= starts)", "slope = (time[:, None] > starts)"),
    ),
    *faults_in(
        "records/processing/integrate.py",
        _RECORDS,
        (
            "dt**2 / 6.0 * (2.0 * acc[..., :-1] + acc[..., 1:])",
            "dt**2 / 4.0 * (acc[..., :-1] + acc[..., 1:])",
        ),
    ),
    *faults_in(
        "records/processing/resampling.py", _RECORDS, ("spectrum[..., -1] *= 0.5", "spectrum[..., -1] *= 1.0")
    ),
    *faults_in(
        "records/processing/corners.py",
        (*_RECORDS, "tests/records/test_record_changes.py", *_SLOW),
        ("10.0 ** (1.5 * magnitude + 16.05)", "10.0 ** (1.5 * magnitude + 16.1)"),
    ),
    *faults_in(
        "records/measures.py",
        _RECORDS,
        ("significant_duration(rows, dt, 0.05, 0.75)", "significant_duration(rows, dt, 0.05, 0.7)"),
        ("- (row[after] - level) / rise", "- 0.0 * (row[after] - level) / rise"),
    ),
    *faults_in(
        "records/spectra.py",
        (*_RECORDS, "tests/records/test_record_measures.py", *_SLOW),
        (
            "undecayed = x * np.cos(omega_d * t) + (rate + xi * omega * x)",
            "undecayed = x * np.cos(omega_d * t) + (rate)",
        ),
    ),
    *faults_in(
        "records/components.py",
        _RECORDS,
        ("np.sqrt(combined[0] * combined[1])", "0.5 * (combined[0] + combined[1])"),
    ),
    *faults_in(
        "records/processing/offset.py",
        ("tests/records/test_record_changes.py", *_SLOW),
        (
            "half = acc.shape[-1], max(1, round(0.5 * WINDOW / dt))",
            "half = acc.shape[-1], max(1, round(WINDOW / dt))",
        ),
    ),
    *faults_in(
        "records/clipping.py",
        ("tests/records/test_clipping.py", *_SLOW),
        ("TOP * np.max(around)) |", "TOP * np.max(around)) &"),
    ),
    *faults_in(
        "geometry/facets.py",
        _GEOMETRY,
        ("middle = dA @ at / dA.sum()", "middle = at.mean(axis=0)"),
        (
            "np.add.at(total, facets, vectors[:, None, :])",
            "np.add.at(total, facets, facet_normals(points, facets)[:, None, :])",
        ),
    ),
    *faults_in(
        "geometry/facets.py",
        ("tests/geometry/test_gap_weights.py", "-k", "consistent_force"),
        ("linear.rule_of(5 if linear.box else 8)", "linear.rule_of(2 if linear.box else 4)"),
    ),
    *faults_in(
        "geometry/gravity_dam.py",
        _GEOMETRY,
        (
            "after = walls[:, -1:] + down * (toe + config.rock.downstream - walls[:, -1:])",
            "after = walls[:, -1:] + down * config.rock.downstream",
        ),
    ),
    *faults_in(
        "geometry/arch_dam/shape.py",
        _GEOMETRY,
        ("if share is None else share) ** 2", "if share is None else share)"),
    ),
    *faults_in(
        "scene/mortar/dual.py",
        _SCENE,
        ("np.linalg.solve(change.T, np.ones(m))", "np.linalg.solve(change, np.ones(m))"),
    ),
    *faults_in(
        "scene/mortar/gaps.py",
        ("tests/scene/test_mortar_joints.py", "-k", "too_little_overlap"),
        ("np.ones(len(kept)), 1.0 / count[pairs[:, 1]]", "np.ones(len(kept)), np.ones(len(pairs))"),
    ),
    *faults_in(
        "scene/joint_water/diagram.py",
        ("tests/scene/test_joint_water.py", "-k", "resultant_and_moment and usace"),
        ("drains.share_left * (level - least) * left", "drains.share_left * (level - low) * left"),
    ),
    *faults_in(
        "scene/joints.py",
        _SCENE,
        ("np.add.at(share, taker, joint.area[~keep])", "share[taker] = joint.area[~keep]"),
    ),
    *faults_in(
        "scene/stress/sites.py",
        _SCENE,
        ("total += normal / (distance +", "total += normal * (distance +"),
    ),
    *faults_in(
        "fem/stress.py",
        _FEM,
        ("-(3.0 * lam + 2.0 * mu)", "-(3.0 * lam + mu)"),
        ("stress[:, :, v, :, k] += mu * g[..., l]", "stress[:, :, v, :, k] += mu * g[..., k]"),
    ),
    *faults_in(
        "fem/loads.py",
        _FEM,
        ("(change) / (1.0 - 2.0 * material.nu)", "(change) / (1.0 - material.nu)"),
    ),
    *faults_in(
        "fem/absorbing.py",
        _FEM,
        ("_ALONG, _ACROSS = 4.0 / 3.0, 2.0 / 3.0", "_ALONG, _ACROSS = 2.0 / 3.0, 4.0 / 3.0"),
    ),
    *faults_in(
        "fem/damping.py",
        _FEM,
        ('ratio[np.argsort(omega2, kind="stable")] = ranked', "ratio[:] = ranked"),
    ),
    *faults_in(
        "fem/column.py",
        _FEM,
        ("np.array([mu, mu, lam + 2.0 * mu])", "np.array([mu, mu, lam + mu])"),
    ),
    *faults_in(
        "effects/added_mass.py",
        _EFFECTS,
        ("M = np.eye(len(k)) + B.T @ water.times(B)", "M = np.eye(len(k)) + B.T @ B"),
    ),
    *faults_in(
        "effects/channel.py",
        _EFFECTS,
        ("c**2 * square, density * c**2 * flux", "c**2 * square, density * c * flux"),
    ),
    *faults_in(
        "effects/compressible_water.py",
        _EFFECTS,
        ("factor.solve(unit) - at_dam.T @ (at_dam / omega2[:, None])", "factor.solve(unit)"),
    ),
    *faults_in(
        "reduction/methods/craig_bampton.py",
        _REDUCTION,
        ("[elastic] / size[elastic]).max())", "[elastic] / size[elastic]).min())"),
    ),
    *faults_in(
        "reduction/methods/craig_bampton.py",
        _REDUCTION,
        ("FINER_VECTORS, FINER_LEAST, block.wet)", "FINER_VECTORS, FINER_LEAST, None)"),
    ),
    *faults_in(
        "reduction/natural_modes.py",
        ("tests/reduction/test_natural_modes.py", "-k", "effective_masses_sum or bonded_stiff"),
        ("effective_mass=(factor / scale[:, None]) ** 2", "effective_mass=(factor * scale[:, None]) ** 2"),
        ("np.column_stack([law.K_n, law.K_s, law.K_s])", "np.column_stack([law.K_n, law.K_n, law.K_s])"),
    ),
    *faults_in(
        "reduction/refinement.py",
        ("tests/fem/test_water.py", "-k", "written_in_another"),
        ("matrix = turn.new(matrix)", "matrix = turn.old(matrix)"),
    ),
    *faults_in(
        "reduction/methods/merged_part.py",
        _REDUCTION,
        ("(2.0 * (loads.T @ inertia) - along", "((loads.T @ inertia) - along"),
    ),
    *faults_in(
        "contact/problem.py",
        _CONTACT,
        ("2.0 / _HALF_WAY * single_flexibility", "1.0 / _HALF_WAY * single_flexibility"),
        ("np.hypot(0.5 * (jj - kk), blocks", "np.hypot(jj - kk, blocks"),
    ),
    *faults_in(
        "contact/step.py",
        _CONTACT,
        ("0.0, 0.0, 0.0, problem.theta_ratio[3 * i + SHEAR_J]", "0.0, 0.0, 0.0, problem.theta_ratio[3 * i]"),
    ),
    *faults_in(
        "contact/strength.py",
        _CONTACT,
        ("limit[COHESION_J + a] - mu * limit[TENSION], 0.0", "limit[COHESION_J + a], 0.0"),
        ("strength = mu * np.maximum(force[..., NORMAL], 0.0)", "strength = mu * np.abs(force[..., NORMAL])"),
    ),
    *faults_in(
        "contact/laws/slip_weakening.py",
        _CONTACT,
        ("path = memory[PATH] + math.hypot(step[SLIP_J], step[SLIP_K])", "path = memory[PATH]"),
    ),
    *faults_in(
        "timestepping/energy.py",
        _TIMESTEPPING,
        ("- (stored - stored[0]) - friction", "- stored - friction"),
    ),
    *faults_in(
        "timestepping/peaks.py",
        ("tests/timestepping/test_peaks.py",),
        (
            "at_position.max(axis=0) + peaks[name] - seen",
            "at_position.max(axis=0) + 0.0 * seen",
        ),
    ),
    *faults_in(
        "timestepping/steps.py",
        _TIMESTEPPING,
        ("max(1.0, 1.0 / rows)", "max(1.0, rows)"),
    ),
    *faults_in(
        "timestepping/step_control.py",
        _TIMESTEPPING,
        ("1.0 / ((fine / coarse) ** order - 1.0)", "1.0 / ((fine / coarse) ** order)"),
        ("(slip**2).sum(axis=(1, 2)).max()", "(slip**2).sum(axis=(1, 2)).mean()"),
    ),
    *faults_in(
        "timestepping/support_motion.py",
        _TIMESTEPPING,
        ("+ strain - strain[:1]", "+ strain"),
    ),
    *faults_in(
        "error/metrics.py",
        _ERROR,
        ("near = np.maximum(opening, better) >=", "near = np.minimum(opening, better) >="),
        ("np.linalg.norm(scale, axis=0).max()", "np.linalg.norm(scale, axis=0).mean()"),
    ),
    *faults_in(
        "error/two_results.py",
        _ERROR,
        ("within = 0.5 * (before - after)", "within = 0.5 * (after - before)"),
    ),
    *faults_in(
        "error/estimate.py",
        _ERROR,
        ("(finer - opening[rows])[-rest:].mean(axis=0)", "(finer - opening[rows])[-1:].mean(axis=0)"),
        ("/ (history.time[row] - history.time[row - 1])", "/ history.time[row]"),
        ("(jump, history.jump) if longer", "(history.jump, jump) if longer"),
        ("motion[-1] - late * size", "motion[-1] - QUIET * size"),
    ),
    *faults_in(
        "error/discretisation.py",
        _ERROR,
        (
            'np.einsum("g,tga->ta", area, run.jump[:, gaps, SHEAR_J:]) / area.sum()',
            "run.jump[:, gaps, SHEAR_J:].mean(axis=1)",
        ),
    ),
    *faults_in(
        "error/study.py",
        _ERROR,
        ("cpu_seconds=median(cpu)", "cpu_seconds=max(cpu)"),
    ),
    *faults_in(
        "results/variables.py",
        _RESULTS,
        (
            'mean_traction[:, :, 0] / c.of_gaps("area")',
            'mean_traction[:, :, 0] / c.of_gaps("whole_area")',
        ),
        (
            'peaks["compression"] / c.of_gaps("area")',
            'peaks["compression"] / c.of_gaps("whole_area")',
        ),
        ('c.water_at_rest / c.of_gaps("area")', 'c.water_at_rest / c.of_gaps("whole_area")'),
        ("lambda part: part[part[:, 0].argmax(), 1])", "lambda part: part[part[:, 1].argmax(), 1])"),
    ),
    *faults_in(
        "results/sliding.py",
        _RESULTS,
        ('c.history.bonded * c.of_gaps("area")', 'c.history.bonded * c.of_gaps("whole_area")'),
        ('"tgd,gdx->tgx", jump - jump[0],', '"tgd,gdx->tgx", jump,'),
        ("_slip(case)[time >= time[-1] - REST].mean(axis=0)", "_slip(case)[-1]"),
        ('area[:, None] * case.of_gaps("axes")[:, 0]', 'case.of_gaps("axes")[:, 0]'),
    ),
    *faults_in(
        "results/suite/rows.py",
        _RESULTS,
        ("seconds[part.any(axis=0)]", "seconds[part.all(axis=0)]"),
        ("_at_rest(c.history)[:, 1:3].T", "_at_rest(c.history)[:, :2].T"),
    ),
    *faults_in(
        "results/stress/variables.py",
        _RESULTS,
        ("ratio[first[face.block] + face.rows]", "ratio[face.rows]"),
        ("stress_summary.sections[..., 3:]", "stress_summary.sections[..., :3]"),
    ),
    *faults_in(
        "results/stress/faces.py",
        _RESULTS,
        ("(first[face.block] + face.rows[counted], face", "(face.rows[counted], face"),
    ),
    *faults_in(
        "postprocess/stress/summary.py",
        _POSTPROCESS,
        ("(1.0 if k == l else 2.0)", "1.0"),
    ),
    *faults_in(
        "postprocess/stress/sections.py",
        _POSTPROCESS,
        ("np.stack([-forces[:, 5], forces[:, 4]])", "np.stack([forces[:, 5], forces[:, 4]])"),
    ),
    *faults_in(
        "postprocess/stress/faces.py",
        _RESULTS,
        ("share = np.cumsum(area[there][order])", "share = np.cumsum(np.ones(there.sum()))"),
    ),
    *faults_in(
        "postprocess/sliding.py",
        _POSTPROCESS,
        ("root = np.sqrt(area)[:, None]", "root = area[:, None]"),
        ("arm = position - area @ position / area.sum()", "arm = position - position.mean(axis=0)"),
    ),
    *faults_in(
        "postprocess/dependence.py",
        _POSTPROCESS,
        ("left @ left / max(len(x) - 2, 1)", "left @ left / max(len(x) - 1, 1)"),
    ),
    *faults_in(
        "postprocess/fragility.py",
        _POSTPROCESS,
        ("of_above[seen.above >= x].sum()", "of_above[seen.above > x].sum()"),
    ),
    *faults_in(
        "postprocess/record_measures.py",
        _POSTPROCESS,
        ('"sa": 1, "arias": 2}', '"sa": 1, "arias": 1}'),
    ),
    *faults_in(
        "postprocess/record_curves.py",
        _POSTPROCESS,
        ("weights=amplitude[1:] ** 2)", "weights=amplitude[1:])"),
    ),
    *faults_in(
        "postprocess/maxima.py",
        _POSTPROCESS,
        ("100.0 * float(of_face.overstressed_area[0])", "100.0 * float(of_face.overstressed_area[-1])"),
    ),
    *faults_in(
        "config/quantities.py",
        _GEOMETRY,
        ("standard_gravity = 9.80665 m/s^2", "standard_gravity = 9.81 m/s^2"),
    ),
    *faults_in(
        "config/sections/joint_water.py",
        _GEOMETRY,
        ("return 1.0 - (USBR_EFFECTIVENESS", "return (USBR_EFFECTIVENESS"),
    ),
    *faults_in(
        "config/sections/geometry/gravity_dam.py",
        _GEOMETRY,
        ("self.gallery.upstream + self.gallery.width, last", "self.gallery.width, last"),
        ("(self.bases[0], self.bases[-1])", "(self.bases[0], self.bases[0])"),
    ),
    *faults_in(
        "export/build.py",
        ("tests/export/test_build.py", "-k", "rigid_gaps"),
        ("material.E * j.area / _GIVE", "material.E * j.area * _GIVE"),
    ),
    *faults_in(
        "export/deck.py",
        ("tests/export/test_build.py", "-k", "rigid_gaps"),
        ("self.law.mu.min(axis=1)", "self.law.mu.max(axis=1)"),
    ),
    *faults_in(
        "export/code_aster.py",
        ("tests/export/test_code_aster.py", "-k", "law_of_a_gap or loads_are"),
        ("of_jumps[:, 0] = -law.K_nz", "of_jumps[:, 0] = law.K_nz"),
    ),
    *faults_in(
        "linalg/modes/eigen.py",
        _REDUCTION,
        ("return (1.0 / mu[finite] + shift)", "return (1.0 / mu[finite] - shift)"),
    ),
    *faults_in(
        "linalg/modes/flexibility.py",
        _REDUCTION,
        ("(self.rigid.T @ (self.M @ answer))", "(self.rigid.T @ answer)"),
    ),
    *faults_in(
        "linalg/modes/rigid.py",
        _REDUCTION,
        ("R @ (V / np.sqrt(mass))", "R @ (V / mass)"),
    ),
    *faults_in(
        "linalg/conjugate.py",
        _REDUCTION,
        ("tolerance * np.linalg.norm(R, axis=0)\n", "tolerance * np.linalg.norm(R) * np.ones(R.shape[1])\n"),
    ),
    *faults_in(
        "error/discretisation.py",
        ("tests/error/test_mesh_error.py", "-k", "quadratic"),
        ("if not run.quadratic or quantity not in _MOVING:", "if not run.quadratic:"),
    ),
    *faults_in(
        "pipelines/run.py",
        ("tests/error/test_total_accuracy.py", "-k", "a_run_chooses"),
        ("min(share / 2.0, MOST_ACCURACY)", "min(share, MOST_ACCURACY)"),
    ),
    *faults_in(
        "pipelines/error/sibling.py",
        ("tests/error/test_mesh_error.py", "-k", "every_run"),
        ('store, finer=asked == "finer")', 'store, finer=asked != "coarser")'),
    ),
    *faults_in(
        "pipelines/error/study.py",
        ("tests/error/test_study_meshes.py", "-k", "scene_and_reduction"),
        ("return system, mesh.cpu_seconds + cpu_time() - start", "return system, mesh.cpu_seconds"),
    ),
    *faults_in(
        "pipelines/cost.py",
        ("tests/test_cost.py", "-k", "share or costs_are or length or estimate_ends"),
        ("(seconds - slope * more) / _PARTS + slope", "(seconds - slope * more) + slope"),
        ("every = runs * sum(", "every = sum("),
        ("middles = [(k + 0.5) * whole", "middles = [k * whole"),
        ("LATE if rocks_on_joints(system) else QUIET", "QUIET"),
        ("moving(motion.acc[:, : math.ceil(whole / motion.dt) + 1])", "moving(motion.acc)"),
    ),
    *faults_in(
        "pipelines/simulation.py",
        ("tests/test_ground_at_steps.py",),
        ("cut_or_extended(acc, round(duration / dt) + 1)", "cut_or_extended(acc, round(duration / dt))"),
    ),
    *faults_in(
        "contact/cone.py",
        _STEPS,
        ("(near_k > 0.0 and abs(t_k) >= near_k)", "(near_k > 0.0 and abs(t_j) >= near_k)"),
    ),
    *faults_in(
        "contact/step.py",
        _STEPS,
        ("0.5 * (1.0 - dashpot_share[i]) / k * min(", "0.5 / k * min("),
        (
            "energy[i] += 0.5 * problem.compliance[d * i + a] * force[i, a] ** 2",
            "energy[i] += 0.5 * problem.compliance[d * i] * force[i, a] ** 2",
        ),
        (
            "fed += memory.water[i] * (jump[i, NORMAL] - old[i, NORMAL])",
            "fed += memory.water[i] * jump[i, NORMAL]",
        ),
        (
            "given = before[i] - after[i] + stored_before - stored",
            "given = before[i] - after[i] + stored - stored_before",
        ),
        (
            "p = min(p_c, memory.force[b]) + memory.limits.tension[i]",
            "p = max(p_c, memory.force[b]) + memory.limits.tension[i]",
        ),
        ("p = min(p_c, memory.force[b]) + memory.limits.tension[i]", "p = min(p_c, memory.force[b])"),
    ),
    *faults_in(
        "contact/softening.py",
        _STEPS,
        ("step[PULLED] = 1.0 if p <= 0.0 and y[b] > 0.0 else 0.0", "step[PULLED] = 1.0 if p <= 0.0 else 0.0"),
        (
            "y_free[b] -= sign * problem.compliance[b] * memory.water[i]",
            "y_free[b] -= 0.0 * sign * problem.compliance[b] * memory.water[i]",
        ),
        (
            "step[NORMAL_FORCE] = problem.whole[i] * memory.force[b]",
            "step[NORMAL_FORCE] = memory.force[b] / problem.whole[i]",
        ),
    ),
    *faults_in(
        "contact/laws/fracture.py",
        _STEPS,
        ("        return r - 1.5 * r * r", "        return r - 3.0 * r * r"),
        ("limit[TENSION] = before * crack / widest", "limit[TENSION] = strength * crack / widest"),
        ("loaded = widest - memory[CRACK]", "loaded = memory[CRACK]"),
        ("stored = 0.5 * left * crack**2 / widest", "stored = 0.5 * left * crack"),
        (
            "memory[DISSIPATED] += 0.5 * left * min(crack, widest) ** 2 / widest",
            "memory[DISSIPATED] += 0.5 * left * crack ** 2 / widest",
        ),
    ),
    *faults_in(
        "contact/laws/barton_bandis.py", _STEPS, ("angle = max(_STEEPEST, basic)", "angle = _STEEPEST")
    ),
    *faults_in(
        "contact/laws/static_friction.py",
        _STEPS,
        (
            "limit[MU_K] = max(limit[MU_K], parameters[STATIC_K])",
            "limit[MU_K] = max(limit[MU_K], parameters[STATIC_J])",
        ),
        (
            "or parameters[STATIC_K] > parameters[DYNAMIC_K]",
            "or parameters[STATIC_J] > parameters[DYNAMIC_K]",
        ),
    ),
    *faults_in(
        "contact/laws/shear_key.py",
        _STEPS,
        (
            "return (1.0 if past.opening > parameters[DEPTH] else 0.0,)",
            "return (1.0 if past.widest > parameters[DEPTH] else 0.0,)",
        ),
    ),
    *faults_in(
        "contact/laws/crack_water.py",
        _STEPS,
        ("step[NORMAL_FORCE] >= -parameters[EXCESS]", "step[NORMAL_FORCE] >= 0.0"),
    ),
    *faults_in(
        "contact/laws/velocity_friction.py",
        _STEPS,
        ("memory[RATE] = step[STEP_RATE]", "memory[RATE] = 0.5 * step[STEP_RATE]"),
    ),
    *faults_in(
        "contact/solvers/single_contact.py",
        _STEPS,
        (
            "-b[NORMAL] - cohesion * pull, A[NORMAL, NORMAL] + mu * pull",
            "-b[NORMAL], A[NORMAL, NORMAL] + mu * pull",
        ),
        (
            "good = good and _row(A, SHEAR_J + a, solution, b) * moves[a] <= 0.0",
            "good = good and _row(A, SHEAR_J, solution, b) * moves[a] <= 0.0",
        ),
    ),
    *faults_in(
        "timestepping/modal/kernels.py",
        _KERNELS,
        ("acc = 0.5 * start + share * change / 6.0", "acc = 0.5 * start + share * change / 3.0"),
        ("loss += 0.5 * (1.0 - decay * decay) *", "loss += 0.5 * (1.0 - decay) *"),
        ("D[RR, j] * s * s", "D[RR, j] * s"),
        ("A[VEL, j] * v[j] + A[FORCE, j] * F", "A[VEL, j] * v[j] + A[FORCE, j] * f[j]"),
        ("jump[i] += model.ground_jump[a, i] * acc[a]", "jump[i] += model.ground_jump[i, a] * acc[a]"),
    ),
    *faults_in(
        "timestepping/peaks.py",
        _KERNELS,
        ("np.sqrt(jump[i, SHEAR_J] ** 2 + jump[i, SHEAR_K] ** 2)", "np.abs(jump[i, SHEAR_J])"),
    ),
    *faults_in(
        "timestepping/modal/loop.py",
        _KERNELS,
        ("further = dt / (dt + last_step)", "further = 0.5"),
        (
            "state.mean[PLACE(d * i)] -= problem.tension[i] * gaps.jump[i, NORMAL]",
            "state.mean[PLACE(d * i)] -= 0.5 * problem.tension[i] * gaps.jump[i, NORMAL]",
        ),
        ("moved[b] = -problem.compliance[b] * change[b]", "moved[b] = 0.0 * change[b]"),
        ("        input_ -= carried", "        input_ += carried"),
        ("energies.joint_work -= fed", "energies.joint_work += fed"),
    ),
    *faults_in(
        "postprocess/stability.py",
        _POSTPROCESS,
        (
            "along = position @ (-shear / size if on_J else shear / size)",
            "along = position @ (shear / size if on_J else -shear / size)",
        ),
        ("return float(np.average(values, weights=weights))", "return float(np.average(values))"),
        ("1.0 if blocks[name][1] in group else -1.0", "1.0 if blocks[name][0] in group else 1.0"),
        (
            "strength += float(of_joint.joint_shear_strength.values.min())",
            "strength += float(of_joint.joint_shear_strength.values.max())",
        ),
    ),
    *faults_in(
        "postprocess/floor_spectra.py", _POSTPROCESS, ("right[-1] -= slopes[-1]", "right[-1] -= slopes[0]")
    ),
    *faults_in(
        "scene/ground/motion_along.py",
        ("tests/effects/test_ugly_scene.py", "-k", "turns_back or wave_starts"),
        (
            "SupportMotion(k, max(0.0, slowness * (place - start)), station=place)",
            "SupportMotion(k, max(0.0, slowness * (place - low)), station=place)",
        ),
        (
            "distance = np.linalg.norm(points - start - within[:, None] * (end - start), axis=1)",
            "distance = np.linalg.norm(points - start - share[:, None] * (end - start), axis=1)",
        ),
    ),
    *faults_in(
        "postprocess/wedge_displacement.py",
        ("tests/results/test_wedges_that_move.py",),
        ("max(0.0, 1.0 - braked / speed)", "max(0.0, 1.0 - 0.9 * braked / speed)"),
        ("0.5 * h * (velocity + after)", "0.45 * h * (velocity + after)"),
    ),
    *faults_in(
        "postprocess/floor_spectra.py",
        ("tests/results/test_floor_spectra.py",),
        ("inside = (x >= ends[0]) & (x <= ends[1])", "inside = (x > ends[0]) & (x <= at)"),
        (
            "ends = at - np.log1p(share), at - np.log1p(-share)",
            "ends = at - np.log1p(share), at + np.log1p(share)",
        ),
    ),
    *faults_in(
        "records/processing/support_motions.py",
        _UGLY,
        ("rows.append(factor * own - of_base)", "rows.append(factor * (own - of_base))"),
    ),
    *faults_in(
        "records/processing/support_motions.py",
        ("tests/records/test_support_rows.py",),
        ("np.where(x < 0.0, 0.5 * (1.0 + x) ** 2, 1.0 - 0.5 * (1.0 - x) ** 2)", "0.5 * (1.0 + x)"),
    ),
    *faults_in(
        "visual/report/one_run.py",
        _FIGURES,
        (
            "left = max(joint.residual_slip for joint in bearing or slides)",
            "left = min(joint.residual_slip for joint in bearing or slides)",
        ),
        (
            "worst = float(dataset.face_principal_stress.sel(area_percentile=HEADLINE).max())",
            "worst = float(dataset.face_principal_stress.sel(area_percentile=HEADLINE).mean())",
        ),
        (
            "float(dataset.gap_area.values[of_gaps == name].sum())",
            "float(dataset.gap_area.values[of_gaps == name].max())",
        ),
        (
            "largest[i, present] = np.nanmax(opening[present], axis=1)",
            "largest[i, present] = np.nanmean(opening[present], axis=1)",
        ),
        ("lines[len(kinds) * k + i]", "lines[len(kinds) * k]"),
        (
            "peaks = peak_ground_acceleration(dataset) / _GRAVITY",
            "peaks = peak_ground_acceleration(dataset) / 9.7",
        ),
        (
            "lengths = [(j.residual_slip, j.largest_slip, j.cumulative_slip) for j in joints]",
            "lengths = [(j.residual_slip, j.cumulative_slip, j.largest_slip) for j in joints]",
        ),
    ),
    *faults_in(
        "visual/report/statistics.py",
        ("tests/suite/test_report.py", "-k", "numbers_on or unlike"),
        ("weighted_quantiles(finite, (0.16, 0.5, 0.84)", "weighted_quantiles(finite, (0.84, 0.5, 0.16)"),
        (
            'row = [factor * about["threshold"], theta, next(bounds), beta, next(bounds)',
            'row = [factor * about["threshold"], beta, next(bounds), theta, next(bounds)',
        ),
    ),
    *faults_in(
        "visual/report/sections.py",
        ("tests/suite/test_report.py", "-k", "numbers_on or unlike"),
        ("error.tolist()].count(MISSED)", "error.tolist()].count(MISSED) + 1"),
        (
            "area = float(summary.gap_area.values[chosen].sum())",
            "area = float(summary.gap_area.values[chosen].mean())",
        ),
    ),
    *faults_in(
        "records/design/target.py",
        ("tests/records/test_design_records.py",),
        ("plateau * tc * td / periods**2", "plateau * tc * td / periods"),
        ("asce7.SDS * (0.4 + 0.6 * periods / t0)", "asce7.SDS * (0.6 + 0.4 * periods / t0)"),
    ),
    *faults_in(
        "postprocess/hazard.py", ("tests/suite/test_hazard.py",), ("0.5 * (k * beta) ** 2", "(k * beta) ** 2")
    ),
    *faults_in(
        "scene/strength_field.py",
        ("tests/scene/test_strength_field.py",),
        ("np.exp(np.sqrt(variance) * normal - 0.5 * variance)", "np.exp(np.sqrt(variance) * normal)"),
    ),
    *faults_in(
        "scene/joint_stiffness.py",
        ("tests/scene/test_automatic_stiffness.py",),
        ("E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))", "E / ((1.0 + nu) * (1.0 - 2.0 * nu))"),
    ),
    *faults_in(
        "postprocess/run_warnings.py",
        ("tests/results/test_concerns.py",),
        ("moved[..., 0] -= joint.gap", "moved[..., 0] += joint.gap"),
    ),
    *faults_in(
        "postprocess/run_warnings.py",
        ("tests/fem/test_uplift.py",),
        ("share = opened @ joint.area / joint.area.sum()", "share = opened.mean(axis=1)"),
    ),
    *faults_in(
        "fem/sections.py",
        ("tests/fem/test_sections.py",),
        (
            "share -= (motions @ operators[name].T).toarray()",
            "share += (motions @ operators[name].T).toarray()",
        ),
    ),
    *faults_in(
        "scene/build.py",
        ("tests/effects/test_ugly_scene.py", "-k", "still_water"),
        ("load.level, load.density * size) for", "load.level, 1000.0 * size) for"),
    ),
    *faults_in(
        "timestepping/construction.py",
        ("tests/effects/test_ugly_scene.py", "-k", "pouring or bonds_what"),
        ("slipped[grouted], memory[:, grouted] = 0.0, filled_memory[:, grouted]", "slipped[grouted] = 0.0"),
    ),
    *faults_in(
        "scene/ground/viscous.py",
        ("tests/fem/test_fem_by_hand.py", "-k", "mean_distance"),
        (
            "away = float((vectors * (points[facets] - foot)).sum() / area)",
            "away = float(np.abs(points[facets] - foot).max())",
        ),
    ),
    *faults_in(
        "core/display_units.py",
        ("tests/results/test_run_report.py", "-k", "prefix"),
        ("if largest >= size", "if largest > size"),
    ),
    *faults_in(
        "timestepping/construction.py",
        ("tests/fem/test_construction.py", "-k", "grout"),
        (
            "take_off(grouted, filled + grout / law.K_n, points)",
            "take_off(grouted, filled - grout / law.K_n, points)",
        ),
    ),
    *faults_in(
        "postprocess/lognormal.py",
        ("tests/suite/test_analysis.py",),
        (
            "climbed.height + known * float(np.log(slope))",
            "climbed.height + self.observations.count * float(np.log(slope))",
        ),
    ),
    *faults_in(
        "scene/temperature.py",
        ("tests/fem/test_temperature.py", "-k", "conduction"),
        ("6.0 / z * (1.0 / tanh - 2.0 / z)", "6.0 / z * (1.0 / tanh - 1.0 / z)"),
    ),
    *faults_in(
        "scene/temperature.py",
        ("tests/fem/test_fem_by_hand.py",),
        (
            "return np.where(thin, 1.0 - share, upstream), np.where(thin, share, downstream)",
            "return np.where(thin, share, upstream), np.where(thin, 1.0 - share, downstream)",
        ),
    ),
    *faults_in(
        "effects/construction.py", _UGLY, ("level=min(water.level, stage.level)", "level=stage.level")
    ),
    *faults_in(
        "scene/construction.py",
        _UGLY,
        ("level = stage.level if stage.level is not None else level", "level = stage.level"),
    ),
    *faults_in(
        "scene/force_histories.py",
        _UGLY,
        ("ForceSignal(name, time + entry.start, force", "ForceSignal(name, time, force"),
    ),
    *faults_in(
        "timestepping/construction.py",
        _UGLY,
        (
            "opening[k, present] += ((system.at_point @ q).reshape(n, d) + shift)[present, NORMAL]",
            "opening[k, present] += ((system.at_point @ q).reshape(n, d))[present, NORMAL]",
        ),
    ),
]
FAULTS: dict[str, list[Fault]] = {}
for _fault in (*_FAULTS, *MORE_FAULTS):
    FAULTS.setdefault(_fault.room, []).append(_fault)


def misplaced(root: Path, faults: Iterable[Fault]) -> list[str]:
    """Faults whose text does not stand exactly once in its file, or whose tests are not there, in words."""
    wrong = []
    for fault in faults:
        path = root / fault.file
        count = path.read_text(encoding="utf-8").count(fault.old) if path.is_file() else 0
        if count != 1:
            wrong.append(f"{fault.file}: {fault.old!r} stands there {count} times, wanted once")
        missing = [name for name in fault.tests if name.endswith(".py") and not (root / name).is_file()]
        wrong += [f"{fault.file}: {fault.old!r}: no such test file {name}" for name in missing]
    return wrong
