"""The page api/defaults.md: the defaults of the arguments that several functions share, from their signatures."""

import inspect

import cosserat_fenicsx as cf

_MEANINGS = {
    "tol": "largest estimated error, relative, of what the function's page names",
    "model": "`'auto'`: the cheapest one that is valid, and enough",
    "elements": "of each rod; None: as many as `tol` needs",
    "degree": "of the polynomials; None: 4",
    "folder": "where results are kept as they come, and gone on with; None: nowhere",
    "progress": "True, False, or None: in terminals, where it lasts",
    "comm": "MPI communicator; None: all ranks",
}


def _cell(parameter):
    return "must be given" if parameter.default is inspect.Parameter.empty else f"`{parameter.default!r}`"


def page():
    """The page as Markdown."""
    lines = ["# Defaults", "", "| argument | means |", "|---|---|"]
    lines += [f"| `{name}` | {words} |" for name, words in _MEANINGS.items()]
    lines += ["", f"| function | {' | '.join(f'`{name}`' for name in _MEANINGS)} |", f"|---|{'---|' * len(_MEANINGS)}"]
    for module in (cf, cf.well, cf.drilling):
        for name in module.__all__:
            function = getattr(module, name)
            if inspect.isfunction(function):
                found = inspect.signature(function).parameters
                cells = [_cell(found[x]) if x in found else "" for x in _MEANINGS]
                if any(cells):
                    package = module.__name__.replace("cosserat_fenicsx", "cf")
                    lines.append(f"| `{package}.{name}` | {' | '.join(cells)} |")
    lines += ["", "An empty cell: the function has no such argument."]
    return "\n".join(lines) + "\n"
