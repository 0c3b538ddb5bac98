"""Answers, sweeps and fits as tables: for the screen, and the columns of files."""

import math
import re
from dataclasses import replace

import numpy as np

from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.components import Bit, DrillPipe
from cosserat_fenicsx.well.contacts import ROUGH, stretches

# What the sentence on the accuracy says too.
_SAID = re.compile(r"NOT ENOUGH for tol = \S+ in the ")
# A sentence with a word in capitals is a warning.
_WARNS = re.compile(r"\b[A-Z]{4,}\b")


def along(answer, units, rows):
    """The table of the state along the string: the ends of components, and about every tenth of the depth between."""
    known, which = answer.quantities, np.array(shown_rows(answer))
    which = which[screen.rows_of(len(which), rows)]
    still = np.abs(answer.torque).max() <= known["torque"].noise
    names = [name for name in answer._on_screen if not (name == "torque" and still)]
    return screen.table(
        [(known[name], np.asarray(known[name].of(answer))[which]) for name in names],
        units,
        rows,
        f"{answer.operation.name}, bit at {answer._told('md', units, answer.depth)}, {answer.words}",
        "md, inclination: of the hole. tension: effective. side force: of the wall, per length, without forces at "
        f"points. moment: {answer._moment_words}. state: buckling, by criteria.",
    )


def _at_the_lower_end(answer, units):
    """Text: the contacts of the bottom-hole assembly, all that is below the drill pipe, where they were solved for."""
    pipes = [i for i, place in enumerate(answer.laid) if isinstance(place.component, DrillPipe)]
    top = answer.laid[min([*pipes, len(answer.laid) - 1])].bottom
    contacts = [contact for contact in answer.contacts if contact.bottom > top]
    if top == answer.depth or not any(contact.at_point for contact in contacts):
        return
    which = [i for i, x in enumerate(answer.contacts) if x in contacts and not x.error >= x.force]
    if not which:
        return
    unknown = len(contacts) - len(which)
    caption = (
        f"left out: {unknown} of forces at points, with estimated errors as large as the forces" if unknown else None
    )
    names = ("contact_top", "contact_bottom", "contact_force", "contact_error", "contact_where", "contact_component")
    given = [(answer.quantities[name], answer.quantities[name].of(answer)[which]) for name in names]
    title = f"where the string touches the wall below md = {answer._told('md', units, top)}"
    yield screen.as_text(screen.table(given, units, len(which), title, caption))


def parts_at(answer, contact):
    """The names of the components at a contact, from the top down."""
    at = np.searchsorted(answer.md, [contact.top, contact.bottom]).clip(max=len(answer.md) - 1)
    return " to ".join(dict.fromkeys(answer.string.components[i].name for i in answer.component[at]))


def shown_rows(answer):
    """Indices of rows: the ends of components, and about every tenth of the depth between."""
    md, ends = answer.md, [answer.depth, *(place.top for place in answer.laid)]
    rows = {0, len(md) - 1, *(i + side for i in np.flatnonzero(np.diff(answer.component)) for side in (0, 1))}
    for depth in np.linspace(0.0, answer.depth, 11)[1:-1]:
        if min(abs(depth - end) for end in ends) > answer.depth / 25:
            rows.add(int(np.argmin(np.abs(md - depth))))
    return sorted(rows)


def answer_in_words(answer, units):
    """Sentences: surface loads, whether the model is enough, cautions, buckling, and why this model."""
    friction = "no drag"
    if abs(answer.drag) > max(1e-9 * abs(answer.hook_load), answer.quantities["drag"].noise):
        friction = f"friction {answer._told('drag', units, form='+.6g')}"
    yield (
        f"{answer.operation.name}, bit at {answer._told('md', units, answer.depth)}: hook load "
        f"{answer._told('hook_load', units)} ({friction}), surface torque {answer._told('surface_torque', units)} "
        f"(convention: {answer.torque_convention})."
    )
    asked = not answer.enough and answer.why[0].endswith("as asked") and answer.model != "rod"
    yield (
        f"{'Enough' if answer.enough else 'NOT ENOUGH'} for tol = {answer.tol:g}: estimated relative errors of these "
        f"are {answer.error:.0e} of the solution; of the model: {_estimate(answer)}"
        f"{asked * '; model=auto looks for a better one'}."
    )
    yield from _without_bit(answer)
    if answer.hook_load < 0:
        yield "The string does not go down by its own weight: a negative hook load is a push at the surface."
    for state in (criteria.SNAKE, criteria.HELIX):
        size = units.on_screen(answer.quantities["md"])[1]
        found = [f"{a / size:.5g} to {b / size:.5g}" for a, b in stretches(answer.md, answer.buckling == state)]
        if found:
            unit = units.on_screen(answer.quantities["md"])[0]
            yield f"{criteria.STATES[state]} buckling at md = {', '.join(found)} {unit}."
    yield units.sentence(f"{answer.model}: {answer.why[0]}.")
    last = len(answer.why) - 1  # why a model that is not enough was not followed by a better one
    for i, line in enumerate(answer.why[1:], start=1):
        if _SAID.match(line):
            continue
        if _WARNS.search(line) or "lock up" in line or (i == last and not answer.enough):
            yield units.sentence(f"{line}.")


# Signs of the forces of a bit on the wall and of the tilts of its axis, in words; a force across that is rounding, over
# that towards the high or low side.
_SIDES, _ROUNDED = (("high side", "low side"), ("right", "left")), 1e-6


def _sided(told, value, sides):
    return f"{told} to the {sides[int(value < 0)]}"


def of_operations(answers, uses, units):
    """Text: a table of the surface loads of several operations and, where there are any, their `Utilisation`."""
    known = answers[0].quantities
    given = [
        (Quantity("operation"), [answer.operation.name for answer in answers]),
        *((known[name], np.array([getattr(x, name) for x in answers])) for name in ("hook_load", "surface_torque")),
        (Quantity("model"), [answer.words for answer in answers]),
        (Quantity("enough for tol"), ["yes" if answer.enough else "NO" for answer in answers]),
    ]
    if uses:
        given.append((Quantity("utilisation", digits=3), np.array([use.largest for use in uses])))
    return screen.as_text(screen.table(given, units, len(answers), "surface loads of all operations"))


def more_in_words(answer, units):
    """Contacts of the bottom-hole assembly, and sentences: what follows from the loads, contacts, all reasons."""
    yield from _at_the_lower_end(answer, units)
    yield from _on_bit(answer, units)
    if np.isfinite(answer.bit_side_force).all():
        up, across = (float(x) for x in answer.bit_side_force)
        told = [answer._told("hook_load", units, abs(x), ".5g") for x in (up, across)]
        tilts = [
            _sided(f"{abs(x):.4g} deg", x, sides) for x, sides in zip(np.degrees(answer.bit_tilt), _SIDES, strict=True)
        ]
        across = 0.0 if abs(across) < _ROUNDED * abs(up) else across
        tilts = tilts[: 2 if across else 1]
        forces = [_sided(told[0], up, _SIDES[0]), _sided(told[1], across, _SIDES[1])][: len(tilts)]
        yield (
            f"the bit presses with {' and '.join(forces)}{', looking down the hole' if across else ''}; its axis is "
            f"{' and '.join(tilts)} off the hole's"
        )
    more = [f"{name} {told}" for name, value, told in (
        ("stretch", answer.stretch, answer._told("stretch", units)),
        ("twist", answer.twist, f"{(answer.twist if abs(answer.twist) > 1e-8 else 0.0) / (2 * math.pi):.4g} turns"),
        ("neutral point at md =", answer.neutral_point, answer._told("neutral_point", units)),
    ) if math.isfinite(value)]  # fmt: skip
    if more:
        yield ", ".join(more)
    at_points = [contact for contact in answer.contacts if contact.at_point]
    if at_points:
        md, _, force, side = max(at_points, key=lambda contact: contact.force)
        yield (
            f"{len(at_points)} forces of the wall at points (contacts), the largest "
            f"{answer._told('hook_load', units, force)} at md = {answer._told('md', units, md)} ({side} side)"
        )
        rough = getattr(answer.solved, "rough", ())
        if rough:
            most = 8
            unit, size = units.on_screen(answer.quantities["md"], [answer.depth])
            places = ", ".join(f"{np.interp(x.start, answer.solved.s, answer.md) / size:.5g}" for x in rough[:most])
            more = f" and {len(rough) - most} more" if len(rough) > most else ""
            which = f"of these forces, those at md = {places} {unit}{more}"
            if len(rough) == len(at_points):
                which = "all of these forces"
            yield (
                f"{which} are ROUGH, with estimated errors above {100 * ROUGH:g} % of them, up to "
                f"{answer._told('hook_load', units, max(x.error for x in rough), '.2g')} (contacts[i].error); "
                f"hook load and surface torque have their own estimated errors, {answer.error:.0e}. A smaller tol "
                "helps, but not where the end of a contact or component, or a survey station, is near"
            )
    yield units.sentence(f"{answer.model}: {'; '.join(answer.why)}.")


def _without_bit(answer):
    """Sentences on a weight on bit of a string that rotates, where there is no torque on bit, or no bit."""
    operation, lowest = answer.operation, answer.string.components[0]
    if operation.weight > 0 and operation.direction(1.0)[1]:
        if operation.torque == 0:
            yield (
                "No bit torque given: the surface torque is that of friction along the string alone; expected a "
                "torque on bit beside its weight."
            )
        if not any(isinstance(part, Bit) for part in answer.string.components):
            yield f"No Bit in the string: the weight on bit acts at the lower end of the {lowest.name}."


def _estimate(answer):
    """The estimated error of the model in words."""
    left_out = f" (it leaves out {answer._leaves_out})" if answer._leaves_out else ""
    if math.isnan(answer.model_error):
        return f"not estimated{left_out}"
    return "without a bound" if math.isinf(answer.model_error) else f"{answer.model_error:.0e}"


def _on_bit(answer, units):
    """A sentence where the bit's own friction makes weight and torque in the string other than those on bit."""
    weight, torque = answer.operation.weight, answer.operation.torque
    more = answer.tension[-1] + weight, answer.torque[-1] - torque
    if any(abs(x) > 1e-3 * np.abs(y).max() for x, y in zip(more, (answer.tension, answer.torque), strict=True)):
        on_bit = f"{answer._told('hook_load', units, weight)} and {answer._told('surface_torque', units, torque)}"
        yield (
            f"on the bit {on_bit}, as asked; the bit's own friction on the wall adds "
            f"{answer._told('hook_load', units, more[0], '+.4g')} to the tension and "
            f"{answer._told('surface_torque', units, more[1], '+.4g')} to the torque above it"
        )


def sweep_in_words(sweep, units):
    """Sentences: what was found, notes, and the largest error of a model."""
    yield f"{len(sweep)} of {sweep.done.size} answers over {len(sweep.depths)} depths of the bit."
    notes, most = sweep.noted(units=units), 12
    yield from notes[:most]
    if len(notes) > most:
        yield f"and {len(notes) - most} more, see `notes`"
    for name, kept in (("hook_load", "hook_left_out"), ("surface_torque", "torque_left_out")):
        told, loads = sweep.values[kept], sweep.values[name]
        if not np.nanmax(told, initial=0.0) > 0:
            continue
        i, j, k = np.unravel_index(np.nanargmax(told), told.shape)
        worst, most = told[i, j, k], np.nanmax(np.abs(loads), initial=1e-300)
        size = f"at most {sweep._told(name, units, worst, '.3g')}, {100 * worst / most:.1g} % of the largest one"
        size = "without a bound, since it may lock up or is bent" if np.isinf(worst) else size
        yield (
            f"{sweep.quantities[name].label}: what the model leaves out is {size} "
            f"({sweep.label(i, j)}, bit at {sweep._told('depth', units, sweep.depths[k])}), estimated"
        )
    used = sorted({*sweep.models.ravel()} - {""})
    if len(used) == 1:
        yield f"model: {used[0]}"


def over_depths(sweep, units, rows):
    """The table of hook loads, torques and models over the depth of the bit."""
    known, used = sweep.quantities, {*sweep.models.ravel()} - {""}
    given = []
    for i, operation in enumerate(sweep.operations):
        for j in range(len(sweep.friction)):
            label = sweep.label(i, j)
            given.append((replace(known["hook_load"], short=label), sweep.hook_load[i, j]))
            if operation.direction(1.0)[1]:
                given.append((replace(known["surface_torque"], short=f"{label}, torque"), sweep.surface_torque[i, j]))
            if len(used) > 1:
                given.append((replace(known["models"], label=f"{label}, model"), sweep.models[i, j]))
    count = len(sweep.depths)
    some = f" ({len(screen.rows_of(count, rows))} of {count}; to_dataframe() has all)" if count > rows else ""
    title = f"loads over the depth of the bit{some}"
    return screen.table([(known["depth"], sweep.depths), *given], units, rows, title)
