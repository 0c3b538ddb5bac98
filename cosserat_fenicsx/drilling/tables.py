"""Tables of a drill-string in motion for the screen."""

import numpy as np
from rich.table import Table

from cosserat_fenicsx.results.screen import as_text

# Rows that are shown.
_ROWS = 16
_RPM = 30 / np.pi
#: (heading, attribute, factor).
_SHOWN = (
    ("t (s)", "times", 1.0),
    ("drive (rpm)", "drive_speed", _RPM),
    ("bit (rpm)", "bit_speed", _RPM),
    ("surface torque (kN m)", "surface_torque", 1e-3),
    ("torque on bit (kN m)", "torque_on_bit", 1e-3),
    ("hook load (kN)", "hook_load", 1e-3),
    ("weight on bit (kN)", "weight_on_bit", 1e-3),
    ("bit advance", "bit_advance", 1.0),
)
_CAPTION = (
    "A row holds for the end of a step, forces and torques in it are means over the step, or of torsion alone over two "
    "(at the first one, the time before the start counts with zero): history.mean_times. The motion begins at t = 0, "
    "and ends with the step that reaches its duration."
)


def history_table(history):
    """Text: the state at some times, what the bit does, and what decided for the model."""
    halved = history.counts.get("halved", 0)
    told = f", {halved} times halved where the motion needs it" if halved else ""
    table = Table(title=f"{history.model} model, steps of {history.dt:.4g} s{told}", caption=_CAPTION)
    rows = np.unique(np.linspace(0, len(history) - 1, _ROWS).astype(int)) if len(history) else []
    columns = [(head, getattr(history, name) * factor) for head, name, factor in _SHOWN]
    columns = [(head, values) for head, values in columns if head == "t (s)" or not np.isnan(values).all()]
    unit, factor = advance_unit(history.bit_advance)
    columns = [(f"{head} ({unit})", values * factor) if head == "bit advance" else (head, values)
               for head, values in columns]  # fmt: skip
    for head, _ in columns:
        table.add_column(head, justify="right")
    for k in rows:
        table.add_row(*(f"{round(values[k], 9) + 0.0:.5g}" for _, values in columns))
    lines = [as_text(table)]
    if len(history) > 5:
        lines.append(str(history.stick_slip()))
        worked = {name: np.nan_to_num(getattr(history, f"work_of_{name}")[-1]) for name in ("drive", "hook", "weight")}
        done = ", ".join(f"of the {name} {x / 1e3:.5g} kJ" for name, x in worked.items() if x or name == "drive")
        lines.append(f"Energy: work {done}; the ledger does not account for "
                     f"{history.balance[-1] / 1e3:.3g} kJ.")  # fmt: skip
    lines += _impacts(history)
    if history.errors is not None:
        period, peak, *torques = history.errors
        told = "" if np.isnan(period) else f"period {period:.2g} s, "
        lines.append(f"Estimated errors by the step: {told}peak {peak * _RPM:.2g} rpm, surface torque "
                     f"{max(torques) / 1e3:.2g} kN m.")  # fmt: skip
    caution = alias(history)
    if caution:
        lines.append(f"{caution[0].upper()}{caution[1:]}.")
    return "\n".join([*lines, *history.why])


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
