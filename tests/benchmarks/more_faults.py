"""More planted faults, see `faults.py`: joints and their water, rest, spectra, samples and summaries."""

from __future__ import annotations

from fault import Fault, faults_in

_GROUTING = ("tests/fem/test_grouting.py", "-k", "closes_keeps or grout_fills or stays_at_rest")
_SOBOL = ("tests/suite/test_sobol.py", "-k", "stand_there or closed_form or scipy")
_LINEAR = ("tests/test_linear_stage.py", "-k", "by_hand")
_SAMPLES = ("tests/suite/test_distributions.py",)

MORE_FAULTS: list[Fault] = [
    *faults_in(
        "timestepping/grouting.py",
        _GROUTING,
        (
            "filled = np.maximum(gaps.jump[:, NORMAL], 0.0) + law.grout / law.K_n",
            "filled = gaps.jump[:, NORMAL] + law.grout / law.K_n",
        ),
        (
            "fills, np.maximum(at_rest, 0.0) - np.maximum(at_rest + more[:, NORMAL], 0.0), 0.0",
            "fills, np.maximum(at_rest, 0.0) - np.maximum(more[:, NORMAL], 0.0), 0.0",
        ),
        ("slip=np.where(fills[:, None], -(system.B @ q)", "slip=np.where(fills[:, None], (system.B @ q)"),
    ),
    *faults_in(
        "scene/joint_water/diagram.py",
        ("tests/scene/test_joint_water.py",),
        (
            "passed = np.divide(drains.at - tip, length - tip,",
            "passed = np.divide(drains.at - tip, length,",
        ),
        (
            "behind = drained + (low - drained) * (x - at) / (length - at)",
            "behind = drained + (low - drained) * (x - at) / length",
        ),
    ),
    *faults_in(
        "effects/free_field.py",
        ("tests/fem/test_free_field.py", "-k", "returns_the_record"),
        (
            "boundary_load(block, field, material_coefficients(block, damping.rayleigh)[1])",
            "boundary_load(block, field, 0.0)",
        ),
        ("follow = side + boundary_springs(block) @ moving", "follow = side"),
    ),
    *faults_in(
        "postprocess/response_spectrum.py",
        _LINEAR,
        (
            "above = 8.0 * np.sqrt(first * second) * (ratio * first + second) * ratio**1.5",
            "above = 8.0 * np.sqrt(first * second) * (first + ratio * second) * ratio**1.5",
        ),
        ("        columns[k, modes, count] = 0.0\n", ""),
    ),
    *faults_in(
        "postprocess/sobol.py",
        _SOBOL,
        (
            "variance = (weights @ (0.5 * (a**2 + b**2)).T / count - mean**2).sum(axis=1)",
            "variance = (weights @ (0.5 * (a**2 + b**2)).T / count).sum(axis=1)",
        ),
    ),
    *faults_in(
        "postprocess/hazard.py",
        ("tests/suite/test_hazard.py", "-k", "power_law"),
        (
            "inside += _integral(x[i], x[i + 1], m, beta, k, at)",
            "inside += _integral(ends[i], ends[i + 1], m, beta, k, at)",
        ),
    ),
    *faults_in(
        "results/suite/sampling.py",
        _SAMPLES,
        (
            "(1.0 + math.sqrt(1.0 + 4.0 * std_of_median**2)) / 2.0",
            "(1.0 + math.sqrt(1.0 + 2.0 * std_of_median**2)) / 2.0",
        ),
        ("ndtr(-b) + (1.0 - u) * (ndtr(-a) - ndtr(-b))", "ndtr(-b) + u * (ndtr(-a) - ndtr(-b))"),
        ("ranks = np.argsort(np.argsort(z @ L.T, axis=0), axis=0)", "ranks = np.argsort(z @ L.T, axis=0)"),
    ),
    *faults_in(
        "fem/balance.py",
        ("tests/fem/test_fem_by_hand.py", "-k", "middle_of_the_dam"),
        (
            "resultant[3:] + np.cross(about - other, resultant[:3])",
            "resultant[3:] + np.cross(other - about, resultant[:3])",
        ),
        (
            "            if name in dam:\n                loads[0]",
            "            if True:\n                loads[0]",
        ),
    ),
    *faults_in(
        "contact/strength.py",
        ("tests/contact/test_contact_by_hand.py", "-k", "bond"),
        (
            "bonded[row, i] or limit[TENSION] > 0.0 or limit[COHESION_J + a] > 0.0",
            "bonded[row, i] or limit[TENSION] > 0.0",
        ),
        (
            "pressed = max(compression[row, i] + limit[TENSION], 0.0)",
            "pressed = max(compression[row, i], 0.0)",
        ),
    ),
    *faults_in(
        "contact/laws/barton_bandis.py",
        ("tests/contact/test_steps_by_hand.py",),
        ("max(math.log10(parameters[STRENGTH] / p), 0.0)", "math.log10(parameters[STRENGTH] / p)"),
    ),
    *faults_in(
        "postprocess/measured_modes.py",
        ("tests/results/test_modes.py", "-k", "nearest"),
        (
            "cost[row, fits] = np.log(freq[fits] / mode.frequency) ** 2",
            "cost[row, fits] = (freq[fits] - mode.frequency) ** 2",
        ),
    ),
    *faults_in(
        "records/spectra.py",
        ("tests/records/test_values_by_hand.py", "-k", "long_period"),
        (
            "(rate + xi * omega * x) / omega_d * np.sin(omega_d * t)",
            "rate / omega_d * np.sin(omega_d * t)",
        ),
    ),
    *faults_in(
        "timestepping/modal/loop.py",
        ("tests/timestepping/test_modal_kernels_by_hand.py",),
        (
            "state.slip_rate[i, a] = work.y[run, 3 * i + SHEAR_J + a] / dt",
            "state.slip_rate[i, a] = work.y[run, 3 * i + SHEAR_J] / dt",
        ),
    ),
    *faults_in(
        "postprocess/stress/summary.py",
        ("tests/results/test_postprocess_by_hand.py", "-k", "eigenvalues"),
        (
            "xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)",
            "xy * (xy * c - yz * xz) + xz * (xy * yz + b * xz)",
        ),
    ),
    *faults_in(
        "geometry/cutting/triangulated.py",
        ("tests/geometry/test_cutting.py", "-k", "does_not_depend_on_the_triangles"),
        (
            "np.add.at(at_vertex, triangles[:, k], angle[:, None] * face)",
            "np.add.at(at_vertex, triangles[:, k], face)",
        ),
    ),
    *faults_in(
        "contact/solvers/gauss_seidel.py",
        ("tests/contact/test_gap_solver.py", "-k", "lets_go_without"),
        (
            "limits.cohesion[i, ALONG_J] > 0.0 or limits.cohesion[i, ALONG_K] > 0.0",
            "limits.cohesion[i, ALONG_J] > 0.0",
        ),
        ("p[3 * i + SHEAR_J], p[3 * i + SHEAR_K] = 0.0, 0.0", "p[3 * i + SHEAR_J] = 0.0"),
    ),
    *faults_in(
        "timestepping/modal/kernels.py",
        ("tests/timestepping/test_modal_kernels_by_hand.py", "-k", "answers_at_once"),
        ("work += 0.5 * (p[i] * new - s[i] * u_r[i])", "work += 0.5 * p[i] * (new - u_r[i])"),
    ),
    *faults_in(
        "timestepping/modal/massless_boundary.py",
        ("tests/timestepping/test_modal_kernels_by_hand.py", "-k", "without_mass"),
        (
            "energy += 0.5 * problem.tension[i] * g[d * i] ** 2",
            "energy += problem.tension[i] * g[d * i] ** 2",
        ),
    ),
    *faults_in(
        "timestepping/modal/massless_boundary.py",
        ("tests/timestepping/test_modal_kernels_by_hand.py", "-k", "that_slides"),
        ("slid -= memory.force[a] * y[a]", "slid -= 0.5 * memory.force[a] * y[a]"),
    ),
    *faults_in(
        "timestepping/modal/loop.py",
        ("tests/timestepping/test_modal_kernels_by_hand.py", "-k", "its_share"),
        ("shift[i] = start[i] + share * (end[i] - start[i])", "shift[i] = end[i]"),
    ),
    *faults_in(
        "records/spectra.py",
        ("tests/records/test_values_by_hand.py", "-k", "of_the_spring"),
        (
            "peak_a[j] = max(peak_a[j], abs(damping[j] * vj + omega2[j] * uj))",
            "peak_a[j] = max(peak_a[j], abs(omega2[j] * uj))",
        ),
    ),
    *faults_in(
        "effects/compressible_water.py",
        ("tests/fem/test_compressible_water.py", "-k", "supports_drive"),
        (
            "by_supports = -np.asarray(waves.at_dam @ carried)",
            "by_supports = np.asarray(waves.at_dam @ carried)",
        ),
    ),
    *faults_in(
        "geometry/cutting/triangulated.py",
        ("tests/geometry/test_cutting.py", "-k", "beyond_an_apex"),
        (
            "feature[nearer] = np.where(share == 0.0, i, np.where(share == 1.0, j, 3 + k))[nearer]",
            "feature[nearer] = np.where(share == 0.0, j, np.where(share == 1.0, i, 3 + k))[nearer]",
        ),
    ),
    *faults_in(
        "records/processing/correction.py",
        ("tests/records/test_record_correction.py", "-k", "pads_add_up"),
        (
            "return replace(noted, before=signal.before + count, after=signal.after + count)",
            "return replace(noted, before=count, after=count)",
        ),
    ),
    *faults_in(
        "contact/softening.py",
        ("tests/contact/test_steps_by_hand.py", "-k", "hold_back"),
        ("A -= across.T @ np.linalg.solve(inner, across)", "A += across.T @ np.linalg.solve(inner, across)"),
    ),
    *faults_in(
        "contact/solvers/newton.py",
        ("tests/contact/test_gap_solver.py", "-k", "farthest"),
        (
            "        if change > worst:\n            worst, at = change, i",
            "        if change < worst or i == 0:\n            worst, at = change, i",
        ),
    ),
    *faults_in(
        "contact/solvers/newton.py",
        ("tests/contact/test_gap_solver.py", "-k", "slides_on"),
        (
            "columns[m, SHEAR_K] = limits.mu[i, ALONG_K] * heading[i, ALONG_K]",
            "columns[m, SHEAR_K] = limits.mu[i, ALONG_J] * heading[i, ALONG_K]",
        ),
        ("heading[i, ALONG_K] = math.copysign(1.0, x_k)", "heading[i, ALONG_K] = math.copysign(1.0, x_j)"),
    ),
    *faults_in(
        "effects/damping.py",
        ("tests/fem/test_damping_of_rigid_motion.py", "-k", "brings_is_all"),
        (
            "braked = braked + drag * matrix.T @ (assemble_mass(block) @ (matrix @ mesh.rigid))",
            "braked = braked - drag * matrix.T @ (assemble_mass(block) @ (matrix @ mesh.rigid))",
        ),
    ),
    *faults_in(
        "effects/static_loads.py",
        ("tests/reduction/test_static_loads.py", "-k", "every_kind_of_load"),
        ("for kind in acting[1:]]", "for kind in acting[2:]]"),
    ),
    *faults_in(
        "error/replay.py",
        ("tests/reduction/test_defect.py", "-k", "near_resonance"),
        ("constant - load @ (a_0 + _GAMMA * (a_1 - a_0))", "constant - load @ a_0"),
    ),
    *faults_in(
        "error/replay.py",
        ("tests/reduction/test_defect.py", "-k", "finer_model"),
        ("_more_at_points(models[2].system, z)", "_more_at_points(models[1].system, q)"),
    ),
    *faults_in(
        "export/deck.py",
        ("tests/export/test_build.py", "-k", "three_masses"),
        ("yield point, float(mass[k]), axes[:, k]", "yield point, float(mass[k]), axes[k]"),
    ),
    *faults_in(
        "fem/column.py",
        ("tests/fem/test_free_field.py", "-k", "fine_columns"),
        ("inertia = omega**2 - 1j * alpha * omega", "inertia = omega**2 + 1j * alpha * omega"),
    ),
    *faults_in(
        "fem/column.py",
        ("tests/fem/test_free_field.py", "-k", "strains_below"),
        (
            "gradient = _lagrange(field.order, s)[1] * (z <= field.levels[0])[:, None]",
            "gradient = _lagrange(field.order, s)[1]",
        ),
    ),
    *faults_in(
        "fem/stress.py",
        ("tests/fem/test_temperature.py", "-k", "curved_temperature"),
        (
            "np.add.at(total, cells, values[cells] @ element.shape(xi).T @ carry.T)",
            "np.add.at(total, cells, values[cells])",
        ),
    ),
    *faults_in(
        "postprocess/dependence.py",
        ("tests/suite/test_analysis.py", "-k", "effect_of_a_sample"),
        ("y = y - np.nanmean(y, axis=0)", "y = y - np.nanmean(y)"),
    ),
    *faults_in(
        "postprocess/fragility.py",
        ("tests/suite/test_analysis.py", "-k", "of_a_threshold"),
        (
            "above.append((curve.intensity[-1], curve.weight))",
            "above.append((curve.intensity[0], curve.weight))",
        ),
    ),
    *faults_in(
        "postprocess/fragility.py",
        ("tests/suite/test_analysis.py", "-k", "groups_of_runs"),
        ("np.exp(np.log(x[i]).mean())", "x[i].mean()"),
    ),
    *faults_in(
        "records/processing/response.py",
        ("tests/records/test_responses.py", "-k", "last_sample"),
        ("moving[-1] * ramp[::-1]", "moving[-1] * ramp"),
        ("acc = acc + mean / first", "acc = acc + mean * first"),
    ),
    *faults_in(
        "scene/joint_water/cracked_base.py",
        ("tests/fem/test_cracked_base.py", "-k", "tip_between"),
        ("overlap = opening[last] if rigid[after]", "overlap = opening[last] if rigid[last]"),
    ),
    *faults_in(
        "scene/temperature.py",
        ("tests/fem/test_temperature.py", "-k", "conducts_at_once"),
        ("once = k in (0, 6)", "once = k == 0"),
    ),
    *faults_in(
        "visual/report/statistics.py",
        ("tests/suite/test_report.py", "-k", "negative_throughout"),
        ("worst = finite.min() if finite.max() <= 0.0 else finite.max()", "worst = finite.max()"),
    ),
    *faults_in(
        "contact/solvers/newton.py",
        ("tests/contact/test_gap_solver.py", "-k", "would_close_a_gap"),
        ("opening = max(opening, abs(y[b]) / W[b, b])", "opening = max(opening, abs(y[b]))"),
    ),
    *faults_in(
        "contact/laws/fracture.py",
        ("tests/contact/test_fracture.py", "-k", "widest_opening"),
        (
            "tension = (strength * grown + before * loaded) / (grown + loaded)",
            "tension = (before * grown + strength * loaded) / (grown + loaded)",
        ),
    ),
    *faults_in(
        "contact/step.py",
        ("tests/contact/test_steps_by_hand.py", "-k", "dashpot_takes"),
        ("if has_lost or laws.dashpot_share[i] > 0.0:", "if has_lost:"),
    ),
    *faults_in(
        "timestepping/modal/loop.py",
        ("tests/timestepping/test_modal_kernels_by_hand.py", "-k", "act_at_once"),
        ("disp += buffer.by_forces[a, b] * s[b]", "disp -= buffer.by_forces[a, b] * s[b]"),
    ),
]
