"""The table of a `Stability` on the screen, and sentences on it."""

import math

import numpy as np
from rich.table import Table

from cosserat_fenicsx.drilling.linear.frequencies import own_rule

# Number of the fastest modes that are listed with their places and drives.
_LISTED = 12
_DRIVES = {
    "stiff": "it turns at the speed asked for",
    "matched": "it reflects no waves",
    "SoftTorque": "PI control of the string's impedance at its first mode",
    "SoftSpeed": "the same with four times the impedance",
}


class Growing:
    """The growing modes of a `Stability`: where they move, in how many cases, and their growth with other drives."""

    def __init__(self, answer):
        self.answer, self.rows, known = answer, [], {}
        grows = [k for k in range(answer.roots.shape[2]) if (answer.growth[:, :, k] > 0).any()]
        grows.sort(key=lambda k: -np.nanmax(answer.growth[:, :, k]))
        self.count = len(grows)
        for k in grows[:_LISTED]:
            i, j = _middle(answer, k)
            if (i, j) not in known:
                known[i, j] = answer.with_drives(i, j)
            self.rows.append((k, i, j, {name: growth[k] for name, growth in known[i, j].items()}))
        self.names, self.own = list(self.rows[0][3]) if self.rows else [], own_rule(answer.scene)

    def in_words(self):
        """Sentences: the cases, whether a mode grows, and the effect of each drive."""
        answer = self.answer
        yield f"{_range(answer)}, all modes up to {answer.up_to:.4g} Hz."
        yield from (f"{caution}." for caution in answer.cautions)
        if not self.rows:
            k = int(np.nanargmax(np.nanmax(answer.growth, axis=(0, 1))))
            i, j = answer.worst(k)
            least = f"{answer.frequency[i, j, k]:.4g} Hz, which decays by {-answer.growth[i, j, k]:.3g} 1/s"
            yield f"No mode grows. Least damped: {least} at {_case(answer, i, j)}."
            return
        yield f"{self.count} modes grow."
        yield from map("{}.".format, _advice(answer, self.rows, [name for name in self.names if name != self.own]))

    @property
    def more(self):
        """Sentences of `details`: the meaning of the columns, and where the modes move."""
        if not self.rows:
            return
        drive = self.own or type(self.answer.scene.drive.control).__name__
        yield (
            "growth: in 1/s. fastest: the largest of all cases. at: the middle one of those in which the mode grows, "
            f"its frequency and growth there, with the drive of the scene, {drive}. mode: counted from 0 by frequency "
            f"there. To the right the growth with {'each drive' if self.own else 'other drives'}: "
            f"{_words(self.names)}. gone: with that drive no mode is near."
        )
        for k, i, j, _ in self.rows:
            yield f"{self.answer.frequency[i, j, k]:.4g} Hz moves: {self.answer.shape(k, i, j).where}"
        if self.count > _LISTED:
            yield f"{self.count - _LISTED} more modes grow: to_dataframe() has all."

    def table(self, rows):
        """The rich table of the fastest modes that grow; None where none does."""
        if not self.rows:
            return None
        answer, cases = self.answer, self.answer.growth.shape[0] * self.answer.growth.shape[1]
        table = Table()
        headings = [f"{name} (own)" if name == self.own else name for name in self.names]
        for heading in ("mode", "grows in", "fastest", "at rpm", "kN", "frequency (Hz)", "growth", *headings):
            table.add_column(heading, justify="right", overflow="fold")
        for k, i, j, drives in self.rows[:rows]:
            share = f"{int((answer.growth[:, :, k] > 0).sum())} of {cases}"
            cells = [share, f"{np.nanmax(answer.growth[:, :, k]):.3g}", *_numbers(answer, i, j)]
            here = f"{answer.frequency[i, j, k]:.4f}", f"{answer.growth[i, j, k]:.3g}"
            table.add_row(str(k), *cells, *here, *("gone" if math.isnan(x) else f"{x:.3g}" for x in drives.values()))
        return table


def _words(names):
    """Descriptions of other drives, and why some are missing."""
    found = [f"{name}, {_DRIVES[name]}" for name in names if name in _DRIVES]
    if "SoftTorque" not in names and "SoftSpeed" not in names:
        found.append("SoftTorque and SoftSpeed are compared where the drive has an inertia")
    return "; ".join(found)


def _middle(answer, k):
    """(i, j) of the case of median growth among those in which a mode grows."""
    i, j = np.nonzero(answer.growth[:, :, k] > 0)
    middle = np.argsort(answer.growth[i, j, k])[len(i) // 2]
    return int(i[middle]), int(j[middle])


def _advice(answer, rows, names):
    """Sentences on the modes that each drive damps, and those that still grow."""
    for name in names:
        calmed = [row for row in rows if not row[3][name] > 0]
        left = [row for row in rows if row[3][name] > 0]
        if calmed:
            text = f"{name} calms {_frequencies(answer, calmed)}"
            yield text + (f" and leaves {_frequencies(answer, left)} growing" if left else "")
        else:
            yield f"{name} calms none of them"


def _frequencies(answer, rows):
    return ", ".join(f"{answer.frequency[i, j, k]:.3g}" for k, i, j, _ in sorted(rows)) + " Hz"


def _numbers(answer, i, j):
    """Speed in rpm and weight in kN of a case, "" without one."""
    weight = answer.weights[j]
    return f"{answer.speeds[i] * 30 / math.pi:.4g}", "" if math.isnan(weight) else f"{weight / 1e3:.4g}"


def _case(answer, i, j):
    speed, weight = _numbers(answer, i, j)
    return f"{speed} rpm" + (f", {weight} kN" if weight else "")


def _range(answer):
    rpm = answer.speeds * 30 / math.pi
    text = f"{len(rpm)} speeds from {rpm.min():.4g} to {rpm.max():.4g} rpm"
    if np.isnan(answer.weights).all():
        return text
    kN = answer.weights / 1e3
    if len(kN) == 1:
        return f"{text}, {kN[0]:.4g} kN on bit"
    return f"{text}, {len(kN)} weights on bit from {kN.min():.4g} to {kN.max():.4g} kN"
