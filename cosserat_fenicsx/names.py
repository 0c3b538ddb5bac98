"""Public names of a package, said once in its stub `__init__.pyi`, whose modules are imported at their first use."""

import importlib
from os import path


# Names of the trade, and those of the package.
_USUAL = {"HWDP": "HeavyWeight", "DP": "DrillPipe", "DC": "Collar", "DrillCollar": "Collar", "Survey": "WellPath",
          "Motor": "MudMotor", "Casing": "HoleSection", "BHA": "DrillString"}  # fmt: skip


def _hint(name, known):
    """'did you mean ...?' for a name that a package does not have."""
    from cosserat_fenicsx.errors import nearest

    other = _USUAL.get(name)
    found = f"did you mean '{other}'?" if other in known else nearest(name, known)
    return found if found.startswith("did") else "dir() of it lists what it has"


def public(package, file):
    """Lazy public names for a package's `__init__.py`.

    Args:
        package, file: its __name__ and __file__.

    Returns:
        (__getattr__, __dir__, __all__): the names are those of the lines "from module import name as name" of the stub.
    """
    with open(path.join(path.dirname(file), "__init__.pyi"), encoding="utf-8") as stub:
        lines = [line.split() for line in stub if line.startswith("from ")]
    homes = {line[3]: line[1] for line in lines}

    def get(name):
        if name not in homes:
            hint = "" if name.startswith("_") else f": {_hint(name, homes)}"
            raise AttributeError(f"module '{package}' has no attribute '{name}'{hint}", name=name)
        if homes[name] == package:  # a public module
            return importlib.import_module(f"{package}.{name}")
        from cosserat_fenicsx.checks import in_words

        home = importlib.import_module(homes[name])
        value = in_words(getattr(home, name))
        setattr(importlib.import_module(package), name, value)
        setattr(home, name, value)  # the same object, as pickle expects
        return value

    def known():
        return sorted({*homes, "__doc__", "__file__", "__name__", "__path__"})

    return get, known, sorted(homes)
