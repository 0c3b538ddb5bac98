"""TOML: files as tables, the places of their keys, and tables as text."""

import json
import math
import re
import tomllib
from pathlib import Path

from cosserat_fenicsx.checks import text_of
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import spoken

_BLANK = re.compile(r"(?:\s|#[^\n]*)*")
_KEY = re.compile(r"""[ \t]*("(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[A-Za-z0-9_-]+)[ \t]*(\.?)""")
_TEXT = re.compile(r'''"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|'[^'\n]*\'''', re.S)
_OTHER = re.compile(r"[^,\]}\n#]*")
_AT = re.compile(r" \(at line (\d+), column (\d+)\)$")


class _GivenTwice(Exception):
    """A table or a key is defined twice; `args`: its name, and the offsets of both definitions."""


def text_and_tables(file):
    """(text, tables) of a TOML file; SceneError where it is missing, or not TOML."""
    file = Path(file)
    text = text_of(file, "a scene file in TOML", pipes=True)
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise SceneError(f"{file}{_refused(text, str(problem))}") from None
    except ValueError as problem:  # of a whole number of thousands of digits
        raise SceneError(f"{file}: not valid TOML: {str(problem).partition(';')[0]}") from None
    except RecursionError:
        raise SceneError(f"{file}: not valid TOML: nested too deeply") from None


def _refused(text, problem):
    """Line, column and reason of a text that `tomllib` refuses with this message."""
    if problem.startswith(("Cannot ", "Duplicate ")):
        try:
            places(text)
        except _GivenTwice as twice:
            name, offset, first = twice.args
            return f"{_at(text, offset)}: {name} is given twice, first at{_at(text, first)[1:]}: expected it once"
        except (AttributeError, IndexError, ValueError):  # the text is no TOML further down
            pass
    at = _AT.search(problem)
    hint = "; text, and a number with its unit, stand in quotes" if "Invalid value" in problem else ""
    where = f", line {at[1]}, column {at[2]}" if at else ""
    return f"{where}: not valid TOML: {_AT.sub('', problem)}{hint}"


def _at(text, offset):
    """ ", line ..., column ..." of an offset."""
    line, column = _line_and_column(text, offset)
    return f", line {line}, column {column}"


def _line_and_column(text, offset):
    before = text[:offset]
    return before.count("\n") + 1, len(before) - before.rfind("\n")


def place_of(text, where):
    """(line, column), from 1, of the innermost key or item of a place that valid TOML has, see `places`; or None."""
    found = places(text)
    inner = next((where[:n] for n in range(len(where), 0, -1) if where[:n] in found), None)
    return None if inner is None else _line_and_column(text, found[inner])


def places(text):
    """{place: offset} of all keys and items of TOML, or `_GivenTwice`; a place is a tuple of keys and numbers."""
    found, counts, table, i = {}, {}, (), 0
    while (i := _BLANK.match(text, i).end()) < len(text):
        if text[i] != "[":
            i = _pair(text, i, table, found)
            continue
        begin, many = i, text.startswith("[[", i)
        keys, i = _keys(text, i + 1 + many)
        i += 1 + many
        table = ()
        for key in keys[:-1]:  # within the last table of an array
            table = (*table, key)
            table = (*table, counts[table] - 1) if table in counts else table
        table = (*table, keys[-1])
        if table in found and not (many and table in counts):
            raise _GivenTwice(f"[{'[' * many}{spoken(table)}]{']' * many}", begin, found[table])
        found.setdefault(table, begin)
        if many:
            counts[table] = counts.get(table, 0) + 1
            table = (*table, counts[table] - 1)
            found[table] = begin
    return found


def _keys(text, i):
    keys, more = [], "."
    while more:
        match = _KEY.match(text, i)
        key = match[1]
        keys.append(json.loads(key) if key[0] == '"' else key.strip("'"))
        more, i = match[2], match.end()
    return keys, i


def _pair(text, i, table, found):
    """Note a key and what its value holds; returns where it ends."""
    keys, end = _keys(text, i)
    if (*table, *keys) in found:
        raise _GivenTwice(spoken((*table, *keys)), i, found[(*table, *keys)])
    for n in range(1, len(keys) + 1):
        found.setdefault((*table, *keys[:n]), i)
    return _value(text, end + 1, (*table, *keys), found)


def _value(text, i, place, found):
    i = _BLANK.match(text, i).end()
    if text[i] not in "[{":
        return (_TEXT if text[i] in "\"'" else _OTHER).match(text, i).end()
    close, count = "]" if text[i] == "[" else "}", 0
    i = _BLANK.match(text, i + 1).end()
    while text[i] != close:
        if close == "]":
            found[(*place, count)] = i
            i = _value(text, i, (*place, count), found)
        else:
            i = _pair(text, i, place, found)
        i = _BLANK.match(text, i).end()
        if text[i] == ",":
            i, count = _BLANK.match(text, i + 1).end(), count + 1
    return i + 1


def to_toml(tables):
    """Tables of numbers, texts, lists and tables as TOML; None is left out. Lists of tables become [[arrays]], and
    tables [tables], at the top; within these they stand in line."""
    plain = {name: value for name, value in tables.items() if not _is_tables(value)}
    blocks = ["\n".join(f"{_key(name)} = {_inline(value)}" for name, value in plain.items() if value is not None)]
    for name, value in tables.items():
        for table in (value if isinstance(value, list) else [value]) if _is_tables(value) else ():
            head = f"[[{_key(name)}]]" if isinstance(value, list) else f"[{_key(name)}]"
            pairs = [f"{_key(key)} = {_inline(inner)}" for key, inner in table.items() if inner is not None]
            blocks.append("\n".join([head, *pairs]))
    return "\n\n".join(block for block in blocks if block) + "\n"


def _is_tables(value):
    return isinstance(value, dict) or (isinstance(value, list) and value and all(isinstance(x, dict) for x in value))


def _key(name):
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def _inline(value):
    if isinstance(value, dict):
        inner = ", ".join(f"{_key(name)} = {_inline(x)}" for name, x in value.items() if x is not None)
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
