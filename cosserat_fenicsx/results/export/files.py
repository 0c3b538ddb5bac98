"""Which file is written how: by the ending of its name."""

from pathlib import Path

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.export import columns, xdmf


def _page(result, file, k=None):
    from cosserat_fenicsx.pictures import viewer  # here, since pictures import results

    viewer.write(result, file)


#: By endings: functions of the result, the file, the index of a state or None, and options by name; all other endings
#: are meshio's.
WRITERS = {".csv": columns.write_csv, ".xdmf": xdmf.write_series, ".html": _page}
# Options of `Result.write` that only some endings have.
_OPTIONS = {"rod": (".csv",), "station": (".csv",)}


def write(result, file, k=None, **options):
    """See `Result.write`; options that are None are left out."""
    file = Path(file)
    if len(result) == 0:
        raise SceneError(f"{file}: the {type(result).__name__.lower()} has no point to write")
    if k is not None:
        try:
            result._index(k, f"{file}: k = {k!r}")
        except IndexError as problem:
            raise SceneError(str(problem)) from None
    options = {name: value for name, value in options.items() if value is not None}
    for name in options:
        if file.suffix not in _OPTIONS[name]:
            expected = " or ".join(_OPTIONS[name])
            raise SceneError(f"{file}: {name} is not for the ending '{file.suffix}': expected a file {expected}")
    writer = WRITERS.get(file.suffix, xdmf.write_state)
    on_first(result.comm, lambda: writer(result, file, k, **options))
