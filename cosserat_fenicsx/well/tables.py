"""Answers, sweeps and fits as tables: for the screen, and the columns of files."""

import math

import numpy as np
from rich.table import Table

from cosserat_fenicsx.results.screen import as_text
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.components import DrillPipe
from cosserat_fenicsx.well.contacts import ROUGH, stretches

# Notes of a sweep that are shown; more are counted.
_NOTES = 12
# Places of rough forces that are told.
_PLACES = 8


def answer_table(answer):
    """Text: the state along the string, surface loads, and what decided for the model."""
    path, operation = answer.hole.path, answer.operation
    table = Table(
        title=f"{operation.name}, bit at {answer.depth:g} m, {answer.words}",
        caption="md, inclination: of the hole. tension: effective. side force: of the wall, per length, without forces "
        "at points.\n"
        f"moment: {answer._moment_words}. state: buckling, by criteria.",
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
    return "\n".join([as_text(table), *_at_the_lower_end(answer), *summary(answer)])


def _at_the_lower_end(answer):
    """Text: the contacts of the bottom-hole assembly, all that is below the drill pipe, where they were solved for."""
    pipes = [i for i, place in enumerate(answer.laid) if isinstance(place.component, DrillPipe)]
    top = answer.laid[min([*pipes, len(answer.laid) - 1])].bottom
    contacts = [contact for contact in answer.contacts if contact.bottom > top]
    if top == answer.depth or not any(contact.at_point for contact in contacts):
        return
    table = Table(title=f"where the string touches the wall below md = {top:.6g} m")
    for heading in ("from md (m)", "to md (m)", "force (kN)", "est. error (kN)", "side", "component"):
        table.add_column(heading, justify="left" if heading in ("side", "component") else "right")
    for contact in contacts:
        below = "at this point" if contact.at_point else f"{contact.bottom:.6g}"
        table.add_row(f"{contact.top:.6g}", below, f"{contact.force / 1e3:.3f}", _known(contact.error, 1e-3, ".3f"),
                      contact.side, _parts(answer, contact))  # fmt: skip
    yield as_text(table)


def _parts(answer, contact):
    """The names of the components at a contact, from the top down."""
    at = np.searchsorted(answer.md, [contact.top, contact.bottom]).clip(max=len(answer.md) - 1)
    return " to ".join(dict.fromkeys(answer.string.components[i].name for i in answer.component[at]))


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
        f"estimated relative errors of these: of the solution {answer.error:.0e}, of the model {_estimate(answer)}; "
        f"asked for {answer.tol:g}: {'enough' if answer.enough else 'NOT ENOUGH'}",
    ]
    lines += _on_bit(answer)
    more = [f"{name} {value:.4g} {unit}" for name, value, unit in (
        ("stretch", answer.stretch, "m"), ("twist", round(answer.twist / (2 * math.pi), 9) + 0.0, "turns"),
        ("neutral point at", answer.neutral_point, "m")) if math.isfinite(value)]  # fmt: skip
    if more:
        lines.append(", ".join(more))
    if answer.hook_load < 0:
        lines.append("the string does not go down by its own weight: a negative hook load is a push at the surface")
    at_points = [contact for contact in answer.contacts if contact.at_point]
    if at_points:
        md, _, force, side = max(at_points, key=lambda contact: contact.force)
        lines.append(
            f"{len(at_points)} forces of the wall at points (contacts), the largest {force / 1e3:.3f} kN at {md:.5g} m "
            f"({side} side)"
        )
        rough = getattr(answer.solved, "rough", ())
        if rough:
            places = ", ".join(f"{np.interp(x.start, answer.solved.s, answer.md):.5g}" for x in rough[:_PLACES])
            more = f" and {len(rough) - _PLACES} more" if len(rough) > _PLACES else ""
            which = f"of these forces, those at md = {places}{more} m"
            if len(rough) == len(at_points):
                which = "all of these forces"
            lines.append(
                f"{which} are ROUGH, with estimated errors above {100 * ROUGH:g} % of them, up to "
                f"{max(x.error for x in rough) / 1e3:.2g} kN (contacts[i].error): a smaller tol helps, but not where "
                "the end of a contact or component, or a survey station, is near"
            )
    states = answer.buckling
    for state in (criteria.SNAKE, criteria.HELIX):
        found = [f"{a:.5g} to {b:.5g}" for a, b in stretches(answer.md, states == state)]
        if found:
            lines.append(f"{criteria.STATES[state]} buckling at md = {', '.join(found)} m")
    lines.append(f"{answer.model}: {'; '.join(answer.why)}.")
    return lines


def _known(value, factor, form):
    return "-" if math.isnan(value) else format(value * factor, form)


def _estimate(answer):
    """The estimated error of the model in words."""
    left_out = f" (it leaves out {answer._leaves_out})" if answer._leaves_out else ""
    if math.isnan(answer.model_error):
        return f"not estimated{left_out}"
    return "without a bound" if math.isinf(answer.model_error) else f"{answer.model_error:.0e}"


def _on_bit(answer):
    """A sentence where the bit's own friction makes weight and torque in the string other than those on bit."""
    weight, torque = answer.operation.weight, answer.operation.torque
    more = answer.tension[-1] + weight, answer.torque[-1] - torque
    if any(abs(x) > 1e-3 * np.abs(y).max() for x, y in zip(more, (answer.tension, answer.torque), strict=True)):
        yield (
            f"on the bit {weight / 1e3:.3f} kN and {torque / 1e3:.3f} kN m, as asked; the bit's own friction on the "
            f"wall adds {round(more[0] / 1e3, 3) + 0.0:+.3f} kN to the tension and "
            f"{round(more[1] / 1e3, 3) + 0.0:+.3f} kN m to the torque above it"
        )


def answer_columns(answer):
    """{heading: (n,)} along the string; angles in degrees."""
    position = answer.hole.path.position(answer.md)
    columns = {
        "md (m)": answer.md, "north (m)": position[:, 0], "east (m)": position[:, 1], "down (m)": position[:, 2],
        "inclination (deg)": np.degrees(answer.inclination), "azimuth (deg)": np.degrees(answer.azimuth),
        "effective tension (N)": answer.tension,
        "true tension (N)": answer.true_tension, "torque (N m)": answer.torque, "side force (N/m)": answer.side_force,
        "distributed side force (N/m)": answer.distributed_force,
        "contact side (deg from high side)": np.degrees(answer.contact_side), "stand-off": answer.standoff,
        "clearance (m)": answer.clearance,
        "bending moment (N m)": answer.bending_moment, "von Mises (Pa)": answer.von_mises,
    }  # fmt: skip
    names = [part.name for part in answer.string.components]
    columns["state"] = [criteria.STATES[state] for state in answer.buckling]
    return columns | {"component": [names[part] for part in answer.component]}


def contact_columns(answer):
    """{heading: (contacts,)} of the forces on the wall."""
    names = {"top": "from md (m)", "bottom": "to md (m)", "force": "force (N)", "side": "side"}
    if any(math.isfinite(x.error) for x in answer.contacts):
        names["error"] = "error (N)"
    columns = {heading: [getattr(x, name) for x in answer.contacts] for name, heading in names.items()}
    return columns | {"component": [_parts(answer, x) for x in answer.contacts]}


def sweep_table(sweep):
    """Text: hook loads and torques over the depth of the bit."""
    table = Table(title="hook load (kN), and surface torque (kN m) where the string rotates, over the depth of the bit")
    table.add_column("depth (m)", justify="right")
    columns, used = [], sorted({*sweep.models.ravel()} - {""})
    for i, operation in enumerate(sweep.operations):
        for j in range(len(sweep.friction)):
            columns.append([_known(x, 1e-3, ".3f") for x in sweep.hook_load[i, j]])
            table.add_column(sweep.label(i, j), justify="right", overflow="fold")
            if operation.direction(1.0)[1]:
                columns.append([_known(x, 1e-3, ".3f") for x in sweep.surface_torque[i, j]])
                table.add_column("torque", justify="right")
            if len(used) > 1:
                columns.append(sweep.models[i, j])
                table.add_column("model")
    for k, depth in enumerate(sweep.depths):
        table.add_row(f"{depth:.6g}", *(values[k] for values in columns))
    lines = [as_text(table), *(f"model: {name}" for name in used if len(used) == 1)]
    notes = sweep.noted()
    lines += notes[:_NOTES]
    if len(notes) > _NOTES:
        lines.append(f"and {len(notes) - _NOTES} more, see `notes`")
    told = sweep.values["model_error"]
    if not np.isnan(told).all():
        i, j, k = np.unravel_index(np.nanargmax(told), told.shape)
        worst = "without a bound: it may lock up" if np.isinf(told[i, j, k]) else f"{told[i, j, k]:.0e}"
        lines.append(
            "largest relative error of hook load and surface torque by what the model leaves out, estimated: "
            f"{worst} ({sweep.label(i, j)}, bit at {sweep.depths[k]:.6g} m)"
        )
    return "\n".join(lines)


def sweep_columns(sweep):
    """{heading: (depths,)} of loads, models and notes."""
    columns = {"depth_m": sweep.depths}
    for i in range(len(sweep.operations)):
        for j in range(len(sweep.friction)):
            label = sweep.label(i, j)
            columns[f"{label}: hook load (N)"] = sweep.hook_load[i, j]
            columns[f"{label}: surface torque (N m)"] = sweep.surface_torque[i, j]
            columns[f"{label}: model"] = sweep.models[i, j].tolist()
    return columns | {"notes": ["; ".join(sweep.noted(k)) for k in range(len(sweep.depths))]}


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
    return "\n".join([as_text(table), *(f"DOUBTFUL: {x}" for x in fit.doubts)])
