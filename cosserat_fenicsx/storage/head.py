"""What `motion.json` must hold: somebody may have edited it, or a copy may be incomplete."""

import math


def checked(head):
    """The data of the file, if they are those of a motion.

    Raises:
        ValueError: naming the first entry that is not as expected.
    """
    for name, (accept, expected) in _ENTRIES.items():
        value = head
        for key in name.split("."):
            if not isinstance(value, dict) or key not in value:
                raise ValueError(f"{name} is missing")
            value = value[key]
        if not accept(value):
            given = repr(value)
            raise ValueError(f"{name} = {given if len(given) < 80 else given[:77] + '...'}: expected {expected}")
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


def _number(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300  # nor NaN, infinity


def _positive(value):
    return _number(value) and value > 0


def _whole(value):
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value < 10**9


def _numbers(value):
    return isinstance(value, list) and len(value) > 0 and all(map(_number, value))


def _ascending(value):
    return _numbers(value) and value[0] > 0 and sorted(value) == value


def _texts(value):
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


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
        isinstance(entry, list) and len(entry) == 2 and _number(entry[0]) and _fingerprint(entry[1]) for entry in value
    )


def _or_none(accept):
    return lambda value: value is None or accept(value)


_A_NUMBER, _A_POSITIVE, _A_WHOLE = (
    (_number, "a number"),
    (_positive, "a positive number"),
    (_whole, "a whole number above zero"),
)
_OR_NONE = _or_none(_positive), "a positive number or null"
_A_TEXT = (lambda value: isinstance(value, str)), "a text"
_SOME_NUMBERS = _numbers, "a list of numbers"
_ENTRIES = {
    "ranks": _A_WHOLE,
    "durations": (_ascending, "ascending positive numbers (s)"),
    "scene": (_fingerprint, "the numbers of a scene"),
    "asked.duration": _A_POSITIVE,
    "asked.tol": _OR_NONE,
    "asked.dt": _OR_NONE,
    "asked.scheme": _A_TEXT,
    "asked.save_every": _OR_NONE,
    "asked.load_factor": _A_NUMBER,
    "asked.elements": _A_WHOLE,
    "asked.degree": (lambda value: _whole(value) and value <= 4, "1, 2, 3 or 4"),
    "asked.rho_inf": (_or_none(_number), "a number or null"),
    "told.model": (lambda value: value in ("planar", "spatial"), "'planar' or 'spatial'"),
    "told.degree": _A_WHOLE,
    "told.unknowns": _A_WHOLE,
    "told.why": (_texts, "a list of texts"),
    "told.scheme": _A_TEXT,
    "told.time_unit": _A_POSITIVE,
    "told.rule.nodes": _SOME_NUMBERS,
    "told.rule.gauss": _SOME_NUMBERS,
    "told.rule.weights": _SOME_NUMBERS,
    "ahead": (_ahead, "a list of times with the numbers of the scene then"),
}
