"""Tables of a drill-string in motion for the screen."""

import numpy as np

from cosserat_fenicsx.results import screen

# Rows of the table of `details`.
_ROWS = 16
_RPM = 30 / np.pi
_SHOWN = ("time", "drive_speed", "bit_speed", "surface_torque", "torque_on_bit", "hook_load", "weight_on_bit",
          "bit_advance")  # fmt: skip
_CAPTION = (
    "A row holds for the end of a step, forces and torques in it are means over the step, or of torsion alone over two "
    "(at the first one, the time before the start counts with zero): history.mean_times. The motion begins at t = 0, "
    "and ends with the step that reaches its duration."
)


def over_time(history, units, rows):
    """The table of the state at some times."""
    halved = history.counts.get("halved", 0)
    told = f", {halved} times halved where the motion needs it" if halved else ""
    given = [(history.quantities[name], getattr(history, "times" if name == "time" else name)) for name in _SHOWN]
    given = [(x, values) for x, values in given if x.name == "time" or not np.isnan(values).all()]
    return screen.table(given, units, min(rows, _ROWS), f"{history.model} model, steps of {history.dt:.4g} s{told}",
                        _CAPTION if rows == screen.ROWS else None)  # fmt: skip


def answer_in_words(history):
    """Sentences: what the bit does, estimated errors, cautions, and why this model."""
    if len(history) > 5:
        yield str(history.stick_slip())
    if history.errors is not None:
        period, peak, *torques = history.errors
        told = "" if np.isnan(period) else f"period {period:.2g} s, "
        yield (
            f"Estimated errors by the step: {told}peak {peak * _RPM:.2g} rpm, surface torque "
            f"{max(torques) / 1e3:.2g} kN m."
        )
    caution = alias(history)
    if caution:
        yield f"{caution[0].upper()}{caution[1:]}."
    yield from history.why[:1]


def more_in_words(history):
    """Sentences of `details`: energies, impacts, and all reasons."""
    if len(history) > 5:
        worked = {name: np.nan_to_num(getattr(history, f"work_of_{name}")[-1]) for name in ("drive", "hook", "weight")}
        done = ", ".join(f"of the {name} {x / 1e3:.5g} kJ" for name, x in worked.items() if x or name == "drive")
        yield f"Energy: work {done}; the ledger does not account for {history.balance[-1] / 1e3:.3g} kJ."
    yield from _impacts(history)
    yield from history.why[1:]


def _impacts(history):
    """A sentence on the impacts of the bit on rigid rock, where there are some."""
    told = np.nan_to_num(history.impulse_on_bit)
    if not len(told) or told[-1] == 0:
        return []
    each = np.diff(told, prepend=0.0)
    return [
        f"Impacts of the bit on rigid rock: the largest impulse {each.max():.4g} N s, at t = "
        f"{history.times[each.argmax()]:.5g} s, together {told[-1]:.4g} N s; the weight on bit is without them."
    ]


def advance_unit(metres):
    """(unit, factor from m) of a way: mm up to a metre."""
    return ("m", 1.0) if np.nan_to_num(np.abs(metres)).max(initial=0.0) >= 1 else ("mm", 1e3)


def alias(history):
    """Words where profiles along the string are further apart than half the period of stick-slip; else ""."""
    if len(history) <= 5 or len(history.profile_times) < 3:
        return ""
    apart, period = float(np.diff(history.profile_times).max()), history.stick_slip().period
    if not apart > period / 2:  # also where there is none
        return ""
    return (f"profiles are {apart:.3g} s apart, and the period of stick-slip is {period:.3g} s: maps and films show a "
            f"pattern that is not there; profile_every = {period / 10:.2g} (s) avoids it")  # fmt: skip


def turns(history):
    """Whether drive or bit turn."""
    return bool(np.any(history.drive_speed) or np.any(history.bit_speed))
