"""The page api/scene_keys.md: every key of a scene file, from the classes that files are read as."""

import inspect
import re

from cosserat_fenicsx.quantities import DIMENSIONS
from cosserat_fenicsx.files.read import KINDS, class_of
from cosserat_fenicsx.kinds import FAMILIES, Object, arguments_of, is_family, members

_TITLES = {"rods": "Files of rods", "well": "Files of strings in wells", "drilling": "Files of drill-strings in motion"}
_HEAD = """# Every key of a scene file

Made from the classes that files are read as. A key in **bold** must be given. An object is a table of the keys of its
class, with its `type` where several are possible; a number with a unit may be text, such as `"20 klbf"`.
"""


def classes_in(kind):
    """The classes of a kind of field, however deep."""
    if isinstance(kind, Object):
        return kind.classes
    inner = getattr(kind, "inner", None)
    return (() if inner is None else classes_in(inner)) + getattr(kind, "classes", ())


def table_of(cls):
    """Lines on a class: what it is, what its docstring says of its keys, and a table of them."""
    told = inspect.getdoc(cls) or ""
    args = re.search(r"^Args:\n(.*?)(?=^\S|\Z)", told, flags=re.M | re.S)
    lines = [told.partition("\n\n")[0], ""]
    lines += [*(f"- {' '.join(entry.split())}" for entry in re.split(r"\n    (?=\S)", args[1])), ""] if args else []
    lines += ["| key | takes |", "|---|---|"]
    before, several = len(lines), len(cls.constructors()) > 1
    for make in cls.constructors():
        for name, (kind, needed) in arguments_of(make).items():
            needed = needed and not several
            names = [f"[{x.__name__}](#{x.__name__.lower()})" for x in classes_in(kind) if not is_family(x)]
            names += [f"any [{x._of}](#{x._of.replace(' ', '-')})" for x in classes_in(kind) if is_family(x)]
            words = ", ".join(dict.fromkeys(names)) or kind.words.replace("any value", "see above")
            line = f"| {f'**`{name}`**' if needed else f'`{name}`'} | {words} |"
            lines += [line] if line not in lines else []
    return lines if len(lines) > before else lines[: before - 2]


def reachable(cls, found):
    """All classes that the tables of a class may hold, in the order in which they are met."""
    for make in cls.constructors():
        for kind, _ in arguments_of(make).values():
            for inner in classes_in(kind):
                for one in members(inner).values() if is_family(inner) else (inner,):
                    if one not in found:
                        found[one] = inner._of if is_family(inner) else ""
                        reachable(one, found)
    return found


def page():
    """The page as Markdown."""
    lines, found = [_HEAD], {}
    for name, cls in ((kind, class_of(kind)) for kind in KINDS):
        lines += [f"## {_TITLES[name]}", "", *table_of(cls), ""]
        reachable(cls, found)
    alone = [cls for cls, family in found.items() if not family]
    lines += ["## Tables and objects", ""]
    for cls in alone:
        lines += [f"### {cls.__name__}", "", *table_of(cls), ""]
    for family in FAMILIES:
        own = [cls for cls, of in found.items() if of == family]
        if own or f"(#{family.replace(' ', '-')})" in "\n".join(lines):
            lines += [f"## {family[0].upper()}{family[1:]}", ""]
            lines += [] if own else ["Classes of your own alone.", ""]
        for cls in own:
            lines += [f"### {cls.__name__}", "", *table_of(cls), ""]
    lines += ["## Units", "", "| dimension | without a unit | units |", "|---|---|---|"]
    for name, dimension in DIMENSIONS.items():
        lines.append(f"| {name} | {dimension.si} | {', '.join(f'`{unit}`' for unit in dimension.units)} |")
    return "\n".join(lines) + "\n"
