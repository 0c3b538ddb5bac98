"""TOML files as tables, and checks of their shape."""

import inspect
import tomllib
from pathlib import Path

from cosserat_fenicsx.checks import text_of
from cosserat_fenicsx.errors import SceneError, nearest


def tables_of(file):
    """The tables of a TOML file.

    Raises:
        SceneError: the file is missing, or not TOML.
    """
    file = Path(file)
    try:
        return tomllib.loads(text_of(file, "a scene file in TOML", pipes=True))
    except tomllib.TOMLDecodeError as problem:
        hint = "; text, and a number with its unit, stand in quotes" if "Invalid value" in str(problem) else ""
        raise SceneError(f"{file}: not valid TOML: {problem}{hint}") from None
    except ValueError as problem:  # of a whole number of thousands of digits
        raise SceneError(f"{file}: not valid TOML: {str(problem).partition(';')[0]}") from None
    except RecursionError:
        raise SceneError(f"{file}: not valid TOML: nested too deeply") from None


def entries(key, tables):
    """The tables of an array of tables, numbered."""
    found = tables.get(key, [])
    if not isinstance(found, list):
        raise SceneError(f"{key} = {found!r}: expected an array of tables, [[{key}]]")
    return [(i, table(f"{key}[{i}]", entry)) for i, entry in enumerate(found)]


def table(where, value):
    """`value`, refused where it is no table."""
    if not isinstance(value, dict):
        raise SceneError(f"{where} = {value!r}: expected a table")
    return value


def known_keys(where, given, known):
    """Refuse keys that are not known, with the nearest one that is."""
    for key in given:
        if key not in known:
            raise SceneError(f"{where}: unknown key '{key}', {nearest(key, known)}")


def class_named(where, kind, classes):
    """The class of a name, among some.

    Raises:
        SceneError: there is none.
    """
    names = {cls.__name__: cls for cls in classes}
    if not isinstance(kind, str) or kind not in names:
        raise SceneError(f"{where}.type = {kind!r}: {nearest(kind, names)}")
    return names[kind]


def check_arguments(where, cls, entry):
    """The parameters of a class by name, where a table gives all that it needs and nothing else.

    Raises:
        SceneError: an unknown argument, or one that is missing.
    """
    arguments = inspect.signature(cls).parameters
    known_keys(f"{where} ({cls.__name__})", entry, arguments)
    for name, argument in arguments.items():
        if name not in entry and argument.default is inspect.Parameter.empty:
            raise SceneError(f"{where} ({cls.__name__}): '{name}' is missing")
    return arguments
