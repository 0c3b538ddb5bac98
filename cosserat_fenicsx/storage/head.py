"""What `motion.json` must hold: somebody may have edited it, or a copy may be incomplete."""

import math

from cosserat_fenicsx.storage import entries
from cosserat_fenicsx.storage.entries import (
    A_NUMBER,
    A_POSITIVE,
    A_TEXT,
    A_WHOLE,
    NUMBER_OR_NONE,
    POSITIVE_OR_NONE,
    SOME_NUMBERS,
    SOME_TEXTS,
)


def checked(head):
    """The data of the file, if they are those of a motion.

    Raises:
        ValueError: naming the first entry that is not as expected.
    """
    entries.checked(head, _ENTRIES)
    asked, told = head["asked"], head["told"]
    rule = told["rule"]
    for fits, words in (
        (asked["tol"] is None or asked["dt"] is None, "asked: expected at most one of tol and dt"),
        (head["durations"][0] == asked["duration"], "durations: expected that of asked first"),
        (told["degree"] == asked["degree"], "told.degree: expected that of asked"),
        (told["scheme"] == asked["scheme"], "told.scheme: expected that of asked"),
        (len(rule["nodes"]) == told["degree"] + 1, "told.rule.nodes: expected one more than the degree"),
        (len(rule["gauss"]) == len(rule["weights"]), "told.rule: expected as many weights as Gauss points"),
    ):
        if not fits:
            raise ValueError(words)
    return head


def _ascending(value):
    return entries.numbers(value) and value[0] > 0 and sorted(value) == value


def _plain(value):
    """Whether it is what a fingerprint holds: numbers (infinite ones too), texts, None, or lists of these."""
    if isinstance(value, list):
        return all(map(_plain, value))
    if isinstance(value, int):
        return abs(value) < 1e300
    return value is None or isinstance(value, str) or (isinstance(value, float) and not math.isnan(value))


def _fingerprint(value):
    return isinstance(value, dict) and all(map(_plain, value.values()))


def _ahead(value):
    return isinstance(value, list) and all(
        isinstance(entry, list) and len(entry) == 2 and entries.number(entry[0]) and _fingerprint(entry[1])
        for entry in value
    )


_ENTRIES = {
    "ranks": A_WHOLE,
    "durations": (_ascending, "ascending positive numbers (s)"),
    "scene": (_fingerprint, "the numbers of a scene"),
    "asked.duration": A_POSITIVE,
    "asked.tol": POSITIVE_OR_NONE,
    "asked.dt": POSITIVE_OR_NONE,
    "asked.scheme": A_TEXT,
    "asked.save_every": POSITIVE_OR_NONE,
    "asked.load_factor": A_NUMBER,
    "asked.elements": A_WHOLE,
    "asked.degree": (lambda value: entries.whole(value) and value <= 4, "1, 2, 3 or 4"),
    "asked.rho_inf": NUMBER_OR_NONE,
    "told.model": (lambda value: value in ("planar", "spatial"), "'planar' or 'spatial'"),
    "told.degree": A_WHOLE,
    "told.unknowns": A_WHOLE,
    "told.why": SOME_TEXTS,
    "told.scheme": A_TEXT,
    "told.time_unit": A_POSITIVE,
    "told.rule.nodes": SOME_NUMBERS,
    "told.rule.gauss": SOME_NUMBERS,
    "told.rule.weights": SOME_NUMBERS,
    "ahead": (_ahead, "a list of times with the numbers of the scene then"),
}
