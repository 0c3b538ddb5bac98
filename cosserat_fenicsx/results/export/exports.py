"""Results for other libraries: dicts of arrays, pandas and xarray."""

from typing import Any

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.errors import InstallationError, SceneError
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.export import columns, contents
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.rod import RodOrName, StationOrName


class Exports(OnNodes):
    """A result as data of other libraries. All values are in SI units."""

    def save(self, file: File) -> None:
        """Write all of the result to one HDF5 file, from which `read_path` or `read_history` makes it again.

        Every query then gives the same digits. Other programs find, with units, what belongs to every state in the
        root, and fields along each rod in rods/<name>, see `results.export.saved`. An old file is replaced once the new
        one is complete.

        Raises:
            OSError: the file cannot be written; an old one stays.
            SceneError: an empty result, or a scene with functions written in Python, or with actions of your own,
                which are code: no file holds any.
        """
        from cosserat_fenicsx.results.export import saved

        _refuse_empty(self, "save")
        on_first(self.comm, lambda: saved.save(self, file))

    def to_dict(self) -> dict[str, Any]:
        """All of the result as a dict of numpy arrays, numbers and texts.

        Returns:
            dict with the keys kind, title, model, formulation, degree, unknowns, elements and why; load_factor,
            negative_modes, stable, iterations, error and control of a path, or time, steps, iterations, scheme,
            energies and momenta of a motion, arrays (n, ...); support, texts, reaction_force and reaction_moment
            (supports, n, 3), inertial, NaN where unknown; event_kind, event_load_factor, event_after, event_residual
            and event_error of a path, empty where it has no events; rods, {name: {field: array}} with those of `fields`
            (n, nodes, ...), s (nodes,) and the modes of events (events, nodes, 3); units and frames, {name: text} of
            all these.
            `json.dumps(result.to_dict(), default=lambda a: a.tolist())` makes text of it, with NaN for the unknown.
        """
        whole = contents.of_states(self) | contents.of_supports(self) | contents.of_events(self, empty=True)
        rods = {rod.name: contents.of_rod(self, rod) for rod in self.scene.rods}
        told = {name: variable for variables in (whole, *rods.values()) for name, variable in variables.items()}
        return {
            **contents.about(self),
            **_values(whole),
            "rods": {name: _values(variables) for name, variables in rods.items()},
            **{
                key: {name: x.attributes[attribute] for name, x in told.items() if attribute in x.attributes}
                for key, attribute in (("units", "units"), ("frames", "frame"))
            },
        }

    def to_dataframe(
        self, k: int | None = None, rod: RodOrName | None = None, station: StationOrName | None = None
    ) -> Any:
        """A pandas DataFrame with the columns of the .csv of `write`, whose arguments it has.

        Without k and rod it has a row per load factor or time, and the index `point` counts them, since load factors
        repeat where a path turns back. Else it has a row per node along the rods, at point k, and takes no station.

        Raises:
            InstallationError: pandas is missing.
            SceneError: an empty result, no such rod or station, or a station beside k or rod.
        """
        pandas = import_library("pandas", "to_dataframe")
        _refuse_empty(self, "to_dataframe")
        along = k is not None or rod is not None
        return pandas.DataFrame(columns.table(self, k, rod, station)).rename_axis("node" if along else "point")

    def to_xarray(self) -> Any:
        """An xarray DataTree: what belongs to every state in its root, and a group per rod with the fields along it.

        Dimensions are `point` (load factors or times) and, in the group of a rod, `s` (m), an index. `load_factor` or
        `time` is a coordinate of `point` without an index, since load factors repeat where a path turns back: select by
        `isel(point=...)`. Variables have the attributes units and, where they have components, frame. The root holds
        reactions by `support` and the events of a path, whose modes are in the groups. Characters that names of groups
        cannot have are replaced; the attribute rod is the name. `tree.to_netcdf("file.nc", engine="h5netcdf")` writes
        a file.

        Raises:
            InstallationError: xarray is missing, or older than 2024.10.
            SceneError: an empty result.
        """
        xarray = import_library("xarray", "to_xarray", "DataTree")
        _refuse_empty(self, "to_xarray")
        states = contents.of_states(self)
        axis = dict([next(iter(states.items()))])
        about = {**contents.about(self), "why": "\n".join(self.why)}
        tree = {"/": _dataset(xarray, states | contents.of_supports(self) | contents.of_events(self), axis, about)}
        for rod, group in zip(self.scene.rods, contents.group_names(self.scene), strict=True):
            tree[f"/{group}"] = _dataset(xarray, contents.of_rod(self, rod), axis, {"rod": rod.name})
        return xarray.DataTree.from_dict(tree)

    def _repr_html_(self):
        from cosserat_fenicsx.results.export.notebook import as_html

        return as_html(self)


def _values(variables):
    return {name: variable.values for name, variable in variables.items()}


def _dataset(xarray, variables, axis, attributes):
    """A Dataset; coordinates are `axis`, the names of components, and what is named as its dimension."""
    variables = variables | axis | contents.component_names(variables)
    coordinates = {name: x for name, x in variables.items() if name in axis or x.dims == (name,)}
    data = {name: x for name, x in variables.items() if name not in coordinates}
    return xarray.Dataset(data, coordinates, attributes)


def _refuse_empty(result, method):
    if len(result) == 0:
        raise SceneError(f"{method}: expected a result with at least one {result.axis}, this one is empty")


def import_library(library, method, needed=None):
    """A library, which may be missing or too old to have the name `needed`."""
    try:
        found = __import__(library)
    except ImportError as missing:
        problem = f"cannot be imported ({missing})"
    else:
        if needed is None or hasattr(found, needed):
            return found
        problem = f"is too old: version {found.__version__} has no {needed}"
    raise InstallationError(
        f"{method} needs {library}, which {problem}: pip install 'cosserat-fenicsx[data]', or pip install {library}; "
        "where dolfinx is the distribution's, hold its numpy fixed by pip's --constraint"
    )
