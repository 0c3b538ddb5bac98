"""What data read from a file must be: somebody may have edited the file, or a copy may be incomplete.

An accepted kind of value is a pair: a function that tells whether a value is of the kind, and words for messages.
"""


def checked(data, entries):
    """The data of a file, if every entry is of its kind.

    Args:
        data: what `json` read.
        entries: {name: kind}; a name "a.b" is that of the entry b in the dict a.

    Raises:
        ValueError: naming the first entry that is not as expected.
    """
    for name, (accept, expected) in entries.items():
        value = data
        for key in name.split("."):
            if not isinstance(value, dict) or key not in value:
                raise ValueError(f"{name} is missing")
            value = value[key]
        if not accept(value):
            given = repr(value)
            raise ValueError(f"{name} = {given if len(given) < 80 else given[:77] + '...'}: expected {expected}")
    return data


def number(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300  # nor NaN, infinity


def positive(value):
    return number(value) and value > 0


def whole(value):
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value < 10**9


def index(value):
    return value == 0 and isinstance(value, int) and not isinstance(value, bool) or whole(value)


def numbers(value):
    return isinstance(value, list) and len(value) > 0 and all(map(number, value))


def text(value):
    return isinstance(value, str)


def texts(value):
    return isinstance(value, list) and all(map(text, value))


def or_none(accept):
    return lambda value: value is None or accept(value)


def below(count):
    """The kind of the numbers 0, 1, ... of `count` items."""
    return (lambda value: index(value) and value < count), f"a whole number from 0 to {count - 1}"


A_NUMBER, A_POSITIVE, A_WHOLE, AN_INDEX = (
    (number, "a number"),
    (positive, "a positive number"),
    (whole, "a whole number above zero"),
    (index, "a whole number, not negative"),
)
A_TEXT, SOME_TEXTS, SOME_NUMBERS = (text, "a text"), (texts, "a list of texts"), (numbers, "a list of numbers")
NUMBER_OR_NONE, POSITIVE_OR_NONE = (
    (or_none(number), "a number or null"),
    (or_none(positive), "a positive number or null"),
)
