"""Geometrically exact rods on FEniCSx: equilibrium paths of special Cosserat rods under large displacements.

The public names stand in `__init__.pyi`. Modules are imported when their names are first used, so that `import
cosserat_fenicsx` and --help stay instant.
"""

import importlib
from os import path as _path

from cosserat_fenicsx.ranks import watch as _watch

__version__ = "0.1.0"


def _homes():
    """{public name: its module} from the lines "from module import name as name" of the stub."""
    with open(_path.join(_path.dirname(__file__), "__init__.pyi"), encoding="utf-8") as stub:
        lines = [line.split() for line in stub if line.startswith("from ")]
    return {line[3]: line[1] for line in lines}


_HOME = _homes()
__all__ = sorted(_HOME)

_watch()


def names_in(subpackage):
    """The public names defined in a subpackage."""
    return [name for name, home in _HOME.items() if home.startswith(f"{__name__}.{subpackage}.")]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module 'cosserat_fenicsx' has no attribute '{name}'")
    if _HOME[name] == __name__:  # a public module
        return importlib.import_module(f"{__name__}.{name}")
    from cosserat_fenicsx.checks import in_words

    home = importlib.import_module(_HOME[name])
    value = globals()[name] = in_words(getattr(home, name))
    setattr(home, name, value)  # the same object, as pickle expects
    return value


def __dir__():
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
