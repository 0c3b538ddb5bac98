"""Answers, sweeps and fits as tables: for the screen, and as .csv."""

import math
from pathlib import Path

import numpy as np
from rich.table import Table

from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.results.tables import as_text
from cosserat_fenicsx.well import criteria

# Notes of a sweep that are shown; more are counted.
_NOTES = 12


def answer_table(answer):
    """Text: the state along the string, surface loads, and what decided for the model."""
    path, operation = answer.hole.path, answer.operation
    table = Table(
        title=f"{operation.name}, bit at {answer.depth:g} m, {answer.words}",
        caption="md, inclination: of the hole. tension: effective. side force: of the wall, per length, without forces "
        "at points.\n"
        f"moment: {answer.moment_words}. state: buckling, by criteria.",
    )
    for heading in ("md (m)", "component", "inclination (deg)", "tension (kN)", "torque (kN m)", "side force (N/m)",
                    "moment (N m)", "von Mises (MPa)", "state"):  # fmt: skip
        table.add_column(heading, justify="left" if heading in ("component", "state") else "right")
    states = answer.buckling
    for i in _shown(answer):
        part = answer.string.components[answer.component[i]]
        table.add_row(
            f"{answer.md[i]:.6g}", part.name, f"{math.degrees(path.inclination_at(answer.md[i])):.2f}",
            f"{answer.tension[i] / 1e3:.3f}", f"{round(answer.torque[i] / 1e3, 3) + 0.0:.3f}",
            f"{answer.distributed_force[i]:.1f}",
            _known(answer.bending_moment[i], 1, ".0f"), _known(answer.von_mises[i], 1e-6, ".1f"),
            criteria.STATES[states[i]],
        )  # fmt: skip
    return "\n".join([as_text(table), *summary(answer)])


def _shown(answer):
    """Indices of rows: the ends of components, and about every tenth of the depth between."""
    md, ends = answer.md, [answer.depth, *(place.top for place in answer.laid)]
    rows = {0, len(md) - 1, *(i + side for i in np.flatnonzero(np.diff(answer.component)) for side in (0, 1))}
    for depth in np.linspace(0.0, answer.depth, 11)[1:-1]:
        if min(abs(depth - end) for end in ends) > answer.depth / 25:
            rows.add(int(np.argmin(np.abs(md - depth))))
    return sorted(rows)


def summary(answer):
    """Lines: surface loads and their errors, what follows from them, and why this model."""
    friction = f"friction {answer.drag / 1e3:+.3f} kN" if abs(answer.drag) > 1e-9 * abs(answer.hook_load) else "no drag"
    lines = [
        f"hook load {answer.hook_load / 1e3:.3f} kN ({friction}), surface torque "
        f"{round(answer.surface_torque / 1e3, 3) + 0.0:.3f} kN m (convention: {answer.torque_convention})",
        f"estimated relative errors: of the solution {answer.error:.0e}, of the model {answer.model_error:.0e}; asked "
        f"for {answer.tol:g}: {'enough' if answer.enough else 'NOT ENOUGH'}",
    ]
    more = [f"{name} {value:.4g} {unit}" for name, value, unit in (
        ("stretch", answer.stretch, "m"), ("twist", answer.twist / (2 * math.pi), "turns"),
        ("neutral point at", answer.neutral_point, "m")) if math.isfinite(value)]  # fmt: skip
    if more:
        lines.append(", ".join(more))
    if answer.hook_load < 0:
        lines.append("the string does not go down by its own weight: a negative hook load is a push at the surface")
    at_points = [contact for contact in answer.contacts if contact[0] == contact[1]]
    if at_points:
        md, _, force, side = max(at_points, key=lambda contact: contact[2])
        lines.append(
            f"{len(at_points)} forces of the wall at points (contacts), the largest {force / 1e3:.3f} kN at {md:.5g} m "
            f"({side} side)"
        )
        rough = getattr(answer.solved, "rough", ())
        if rough:
            lines.append(
                f"{len(rough)} of them are ROUGH, some off by a factor of three: the mesh is fine enough for tol, not "
                "for them, and a smaller tol makes it finer"
            )
    states = answer.buckling
    for state in (criteria.SNAKE, criteria.HELIX):
        ends = np.flatnonzero(np.diff(states == state, prepend=False, append=False)).reshape(-1, 2) - (0, 1)
        stretches = [f"{answer.md[a]:.5g} to {answer.md[b]:.5g}" for a, b in ends if answer.md[b] > answer.md[a]]
        if stretches:
            lines.append(f"{criteria.STATES[state]} buckling at md = {', '.join(stretches)} m")
    lines.append(f"{answer.model}: {'; '.join(answer.why)}.")
    return lines


def _known(value, factor, form):
    return "-" if math.isnan(value) else format(value * factor, form)


def write_answer(answer, file):
    """The .csv file of an answer; angles in degrees."""
    position = answer.hole.path.position(answer.md)
    columns = {
        "md (m)": answer.md, "north (m)": position[:, 0], "east (m)": position[:, 1], "down (m)": position[:, 2],
        "inclination (deg)": np.degrees(answer.inclination), "effective tension (N)": answer.tension,
        "true tension (N)": answer.true_tension, "torque (N m)": answer.torque, "side force (N/m)": answer.side_force,
        "distributed side force (N/m)": answer.distributed_force,
        "contact side (deg from high side)": np.degrees(answer.contact_side), "stand-off": answer.standoff,
        "bending moment (N m)": answer.bending_moment, "von Mises (Pa)": answer.von_mises,
    }  # fmt: skip
    rows = np.stack(list(columns.values()), axis=1)
    names = [part.name for part in answer.string.components]
    lines = [",".join([*columns, "state", "component"])]
    for row, state, part in zip(rows, answer.buckling, answer.component, strict=True):
        numbers = ("" if math.isnan(x) else f"{x:.9g}" for x in row)
        lines.append(",".join([*numbers, criteria.STATES[state], names[part]]))
    text = "\n".join(lines) + "\n"
    on_first(world(), lambda: Path(file).write_text(text, encoding="utf-8"))


def sweep_table(sweep):
    """Text: hook loads and torques over the depth of the bit."""
    table = Table(title="hook load (kN), and surface torque (kN m) where the string rotates, over the depth of the bit")
    table.add_column("depth (m)", justify="right")
    columns = []
    for i, operation in enumerate(sweep.operations):
        for j in range(len(sweep.friction)):
            columns.append(sweep.hook_load[i, j] / 1e3)
            table.add_column(sweep.label(i, j), justify="right", overflow="fold")
            if operation.direction(1.0)[1]:
                columns.append(sweep.surface_torque[i, j] / 1e3)
                table.add_column("torque", justify="right")
    for k, depth in enumerate(sweep.depths):
        table.add_row(f"{depth:.6g}", *(_known(values[k], 1, ".3f") for values in columns))
    lines = [as_text(table)]
    notes = sweep.noted()
    lines += notes[:_NOTES]
    if len(notes) > _NOTES:
        lines.append(f"and {len(notes) - _NOTES} more, see `notes`")
    if len(sweep):
        worst = np.nanmax(sweep.values["model_error"], initial=0.0)
        lines.append(f"largest estimated relative error of the model {worst:.0e}")
    return "\n".join(lines)


def fit_table(fit):
    """Text: coefficients of friction with their intervals."""
    table = Table(title="coefficients of friction by least squares",
                  caption=f"misfit {fit.misfit:.3g} (1: as the standard deviations say)")  # fmt: skip
    for heading in ("section", "to (m)", "friction", f"{100 * fit.confidence:g} % interval"):
        table.add_column(heading, justify="left" if heading == "section" else "right")
    for i, section in enumerate(fit.hole.sections):
        low, high = fit.interval[i]
        bound = ", at its bound: the readings ask for less than none" if fit.friction[i] < 1e-6 else ""
        table.add_row(section.name or str(i + 1), f"{section.to:.6g}", f"{fit.friction[i]:.4f}{bound}",
                      f"{low:.4f} to {high:.4f}")  # fmt: skip
    if np.isfinite(fit.block_interval).all():
        low, high = fit.block_interval / 1e3
        table.add_row("block weight", "", f"{fit.block_weight / 1e3:.2f} kN", f"{low:.2f} to {high:.2f} kN")
    return as_text(table)
