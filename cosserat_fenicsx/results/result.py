"""`Result`, the base class of all results: a class declares its quantities once; dicts, data frames, xarray, files, and
tables on the screen and in notebooks follow from them."""

import csv
from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.errors import InstallationError, SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.quantities import Quantities, Quantity, Units
from cosserat_fenicsx.ranks import on_first, world
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.compared import cell_nodes
from cosserat_fenicsx.scene.rod import Rod, RodOrName

#: dims: names of the dimensions of `values`, the components included; attributes: texts by names, such as units.
Variable = namedtuple("Variable", "dims values attributes")

# Dimensions of components by their names.
_COMPONENTS = {("x", "y", "z"): "component", ("a", "b", "c", "d"): "quaternion_component"}
# How texts begin that spreadsheet programs take for formulas.
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")


class Result:
    """A result: named quantities with units, for files, tables, data frames and charts.

    `units` of its methods are "SI", "field" (ft, in, klbf, ft-lbf, ppg, rpm, psi), or {dimension or unit: unit}, such
    as {"force": "klbf", "[length]": "ft"}. `print` shows the answer and a short table; `details()` has more.
    """

    _quantities: ClassVar[dict[str, Quantity]] = {}
    # Axis of the rows of data frames, .csv files and tables; {suffix of the name: axis} of further .csv files.
    _rows_axis: ClassVar[str] = "point"
    _beside: ClassVar[dict[str, str]] = {}
    # Whether its table can be written without rows.
    _may_be_empty: ClassVar[bool] = False
    # Quantities of the table on the screen; () for all along `_rows_axis`.
    _on_screen: ClassVar[tuple[str, ...]] = ()
    # The abscissa of charts; "" for the first quantity along `_rows_axis`.
    _over: ClassVar[str] = ""
    # Coordinates in xarray, beside quantities with the name of their axis.
    _coordinates: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def quantity(cls, label: str = "", unit: str = "1", **more: Any) -> Callable:
        """Decorator: a function of a result becomes a quantity of this class of results, by the function's name.

        It is then in `quantities`, `to_dict`, `to_dataframe`, `to_xarray`, .csv files and charts, and in those of
        results that were stored before.

        Args:
            label: in words, by default the name. unit: in which the function returns it.
            more: further attributes of `Quantity`: parts, frame, axes, shown, dimension, noise. By default it is one
                number a row, (n,). Along the rods of a path or a motion, axes = ("point", "s"), the function takes the
                rod as its second argument and returns (n, nodes).
        """

        def register(function):
            cls.add_quantities(Quantity(function.__name__, label, unit, getter=function, **more))
            return function

        more.setdefault("axes", (cls._rows_axis,))
        return register

    @classmethod
    def add_quantities(cls, *quantities: Quantity) -> None:
        """Give this class of results more quantities, or others by the same names."""
        cls._quantities = {**vars(cls).get("_quantities", {}), **{x.name: x for x in quantities}}

    @property
    def quantities(self) -> dict[str, Quantity]:
        """{name: `Quantity`}: label, unit, frame and axes of all that the result holds."""
        found = Quantities()
        for kind in reversed(type(self).__mro__):
            found.update(vars(kind).get("_quantities", {}))
        return found

    def value(self, name: str, units: str | Mapping = "SI") -> Any:
        """A quantity by its name, in some units.

        Raises:
            SceneError: an unknown name, or unknown units.
        """
        known = self.quantities
        if name not in known:
            raise SceneError(f"value({name!r}): expected one of {', '.join(known)}")
        size = Units(units).of(known[name])[1]
        return known[name].of(self) if size == 1.0 else known[name].of(self) / size

    # -- other libraries ---------------------------------------------------------------------------------------------

    def to_dict(self, units: str | Mapping = "SI") -> dict[str, Any]:
        """All of the result as a dict of numpy arrays, numbers and texts: its `kind`, what it is, every quantity by its
        name, and `units` and `frames`, {name: text}. `json.dumps(result.to_dict(), default=lambda a: a.tolist())` makes
        text of it, with NaN for the unknown."""
        found = self._variables(Units(units))
        return {**self._about(), **_values(found), **_said(found)}

    def to_dataframe(self, units: str | Mapping = "SI") -> Any:
        """A pandas DataFrame with the columns of the .csv of `write`.

        Raises:
            InstallationError: pandas is missing.
            SceneError: an empty result.
        """
        return self._frame(self.columns(units), self._rows_axis)

    def to_xarray(self, units: str | Mapping = "SI") -> Any:
        """An xarray Dataset of all quantities over their axes, with the attributes units, long_name and frame.

        Raises:
            InstallationError: xarray is missing.
            SceneError: an empty result.
        """
        xarray = import_library("xarray", "to_xarray")
        self._refuse_empty("to_xarray")
        about = {
            name: "\n".join(x) if isinstance(x, tuple | list) and all(isinstance(y, str) for y in x) else x
            for name, x in self._about().items()
        }
        return dataset(xarray, self._variables(Units(units)), self._coordinates, about)

    def columns(self, units: str | Mapping = "SI", axis: str = "") -> dict[str, np.ndarray]:
        """{heading with unit: (n,)} of the quantities along an axis, by default that of the rows of tables; without
        those that are not known anywhere."""
        units, found = Units(units), {}
        for quantity in self.quantities.values():
            if quantity.axes == (axis or self._rows_axis,):
                values = quantity.of(self)
                if values is not None and not _unknown(values):
                    found |= quantity.columns(values, units)
        return found

    def write(self, file: File, *, units: str | Mapping = "SI") -> None:
        """Write a table (.csv) or all quantities (.nc, NetCDF 4). An old file is replaced once the new one is complete.
        Rank 0 writes.

        Raises:
            SceneError: another ending, or an empty result.
            InstallationError: xarray or h5netcdf is missing, for .nc.
            OSError: it cannot be written; an old one stays.
        """
        file = Path(file)
        if not self._may_be_empty or file.suffix.lower() != ".csv":
            self._refuse_empty(f"{file}")
        if file.suffix.lower() == ".csv":
            for ending, axis in {"": self._rows_axis, **self._beside}.items():
                columns = self.columns(units, axis)
                beside = file.with_name(f"{file.stem}{ending}{file.suffix}")
                on_first(self._ranks, lambda beside=beside, columns=columns: write_columns(beside, columns))
        elif file.suffix.lower() == ".nc":
            import_library("h5netcdf", "write")
            found = self.to_xarray(units)

            def written():
                with replaced(file) as fresh:
                    found.to_netcdf(fresh, engine="h5netcdf")

            on_first(self._ranks, written)
        else:
            raise SceneError(f"{file}: expected a name that ends in .csv or .nc")

    def save(self, file: File) -> None:
        """Write all quantities, with their units, to one HDF5 file, from which `read_result` makes a result with the
        same digits in tables, charts and data frames. An old file is replaced once the new one is complete.

        Raises:
            OSError: the file cannot be written; an old one stays.
            SceneError: an empty result.
        """
        from cosserat_fenicsx.results import saved

        self._refuse_empty("save")
        on_first(self._ranks, lambda: saved.save_quantities(self, file))

    def plot_quantity(self, name: str, file: File | None = None, *, units: str | Mapping = "SI",
                      width: int | None = None):  # fmt: skip
        """Chart of a quantity along the axis of the tables: of a path over the load factor, of a motion over time, of a
        string over the measured depth.

        Args:
            name: of one with a value for each row, see `quantities`; with its own chart where it has one.
            file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.
            units: see `Result`. width: of the picture, pixels.

        Raises:
            SceneError: an unknown name, another kind of quantity, or one that is NaN everywhere; matplotlib is missing,
                or an unknown ending.
        """
        from cosserat_fenicsx.pictures.charts import draw_quantity

        known = {key: x for key, x in self.quantities.items() if x.axes == (self._rows_axis,)}
        given = {key: values for key in known if (values := np.asarray(known[key].of(self))).dtype.kind in "fiub"}
        if name not in given:
            raise SceneError(f"plot_quantity({name!r}): expected one of {', '.join(given)}")
        if _unknown(given[name]):
            others = ", ".join(key for key, values in given.items() if not _unknown(values))
            raise SceneError(f"plot_quantity({name!r}): this result does not know it: expected one of {others}")
        over = self._over if self._over in given else next(iter(given))
        shown = [(known[key], given[key]) for key in (over, name)]
        title = getattr(getattr(self, "scene", None), "title", "")
        return draw_quantity(*shown, title, file, self._ranks, units=units, width=width)

    # -- on the screen -----------------------------------------------------------------------------------------------

    def __str__(self) -> str:
        return self.summary()

    def summary(self, units: str | Mapping = "SI") -> str:
        """The text that `print` shows, in some units: the answer in sentences, then one table; at most 30 lines of 100
        characters."""
        units = Units(units)
        return screen.page(self._answer(units), lambda rows: self._table(units, rows))

    def details(self, units: str | Mapping = "SI") -> str:
        """A longer table, the answer, and all further sentences on the result."""
        units = Units(units)
        table = self._table(units, screen.ROWS)
        text = [] if table is None else [screen.as_text(table)]
        return "\n".join([*text, *self._answer(units), *self._more(units)])

    def _repr_html_(self) -> str:
        return screen.as_html(self)

    def _answer(self, units: Units) -> Iterable[str]:
        """Sentences: the answer first, whether it is enough, and why."""
        return [repr(self)]

    def _more(self, units: Units) -> Iterable[str]:
        """Sentences of `details` after the table."""
        return ()

    def _table(self, units: Units, rows: int):
        """The table of `summary`, of at most `rows` rows."""
        known = self.quantities
        names = self._on_screen or [x.name for x in known.values() if x.axes == (self._rows_axis,)]
        given = [(known[name], known[name].of(self)) for name in names]
        return screen.table([(x, values) for x, values in given if not _unknown(values)], units, rows,
                            *self._titles(units))  # fmt: skip

    def _titles(self, units: Units) -> tuple[str | None, str | None]:
        """The title of the table, and what stands under it."""
        return None, None

    def _told(self, name: str, units: Units, value: float | None = None, form: str = ".6g") -> str:
        """A number with the unit of a quantity: the quantity's own value, or another one."""
        quantity = self.quantities[name]
        value = float(quantity.of(self)) if value is None else value
        unit, size = units.on_screen(quantity, [value])
        number = 0.0 if abs(value) <= quantity.noise else value / size
        return f"{number:{form}} {unit}" if unit != "1" else f"{number:{form}}"

    def _drawn(self, chart, file, units, width, *given):
        """Draw the Figure `chart(self, *given)`, a function with its module below the package, see `draw_chart`."""
        from cosserat_fenicsx.pictures.charts import draw_chart

        module, _, name = chart.rpartition(".")
        make = getattr(import_module(f"cosserat_fenicsx.{module}"), name)
        return draw_chart(lambda: make(self, *given), file, self._ranks, units=units, width=width)

    # -- of subclasses -----------------------------------------------------------------------------------------------

    @property
    def _ranks(self):
        """The MPI communicator whose rank 0 writes files."""
        return world()

    def _about(self) -> dict[str, Any]:
        """Attributes that describe the result: texts, numbers and lists of these."""
        return {"kind": type(self).__name__}

    def _variables(self, units: Units) -> dict[str, Variable]:
        """{name: `Variable`} of all quantities that the result knows."""
        found = {name: (x, x.of(self)) for name, x in self.quantities.items() if "s" not in x.axes}
        return {name: variable(x, values, units) for name, (x, values) in found.items() if values is not None}

    def _refuse_empty(self, method):
        if not len(self):
            axis = getattr(self, "axis", self._rows_axis)
            raise SceneError(f"{method}: expected a result with at least one {axis}, this one is empty")

    def _frame(self, columns, axis):
        pandas = import_library("pandas", "to_dataframe")
        self._refuse_empty("to_dataframe")
        return pandas.DataFrame(columns).rename_axis(axis)


class Charted(Result):
    """A result with one chart."""

    # The function of the result that makes the Figure, with its module below the package.
    _chart: ClassVar[str] = ""

    def plot(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Draw the chart that the class describes.

        Args:
            file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.
            units: "SI", "field", or a dict of units by dimensions, such as {"force": "klbf"}.
            width: of the picture, pixels, which its fonts and legends are arranged for; None for 150 to the inch.

        Raises:
            SceneError: matplotlib is missing, the ending is unknown, or there is nothing to draw.
            OSError: the file cannot be written.
        """
        return self._drawn(self._chart, file, units, width)


class ChartedBetween(Charted):
    """A result with one chart over measured depths or times, of which a part can be drawn."""

    def plot(self, file: File | None = None, between: tuple[float, float] | None = None, *, units: Any = "SI",
             width: int | None = None):  # fmt: skip
        """Draw the chart that the class describes.

        Args:
            file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.
            between: measured depths (m), such as those of the bottom-hole assembly, or times (s), from which to which;
                None for all.
            units: "SI", "field", or a dict of units by dimensions, such as {"force": "klbf"}.
            width: of the picture, pixels, which its fonts and legends are arranged for; None for 150 to the inch.

        Raises:
            SceneError: matplotlib is missing, the ending is unknown, depths that the string has not, or fewer than two
                times.
            OSError: the file cannot be written.
        """
        return self._drawn(self._chart, file, units, width, between)


# Most rods whose numbers of elements are listed one by one.
_FEW_RODS = 6


def elements_in_words(counts):
    """The numbers of elements of all rods as text: one by one of a few rods, else from the least to the largest."""
    if len(counts) <= _FEW_RODS:
        return f"{' + '.join(map(str, counts))} elements"
    least, largest = min(counts), max(counts)
    return f"{len(counts)} rods of {least if least == largest else f'{least} to {largest}'} elements"


class OnNodes:
    """A result on a mesh; subclasses have the `scene`, the `layout`, the `rule` and the `degree` of the elements."""

    def rod(self, rod: RodOrName | None = None) -> Rod:
        """A rod of the scene, given as a `Rod` or by its name; default the first.

        Raises:
            SceneError: the scene has no such rod.
        """
        if isinstance(rod, str):
            return self.scene.rod(rod)
        rods = self.scene.rods
        if rod is not None and rod not in rods:
            known = ", ".join(x.name for x in rods)
            raise SceneError(f"{rod!r} is not a rod of this result's scene: expected one of {known}")
        return rods[0] if rod is None else rod

    def _rows(self, rod=None):
        """(index of a rod, slice of its nodes, numbered over all rods)."""
        i = self.scene.rods.index(self.rod(rod))
        return i, cell_nodes(self.layout, self.degree)[i][1]

    def _between(self, rod, x):
        """Nodes (n, nodes per element), numbered over all rods, and weights, at x (n,), arc lengths over the rod's."""
        i, _ = self._rows(rod)
        cells, weights = self.rule.locate_all(self.layout.breaks[i], x)
        return cell_nodes(self.layout, self.degree)[i][0][cells], weights


def by_name(*quantities):
    """{name: quantity}, as classes of results have them."""
    return {quantity.name: quantity for quantity in quantities}


def variable(quantity, values, units):
    """The `Variable` of a quantity's values."""
    unit, size = units.of(quantity)
    values = np.asarray(values) if size == 1.0 else np.asarray(values) / size
    more = (components_of(quantity),) if quantity.parts else ()
    attributes = {"units": unit, "long_name": quantity.label}
    return Variable((*quantity.axes, *more), values, attributes | ({"frame": quantity.frame} if quantity.frame else {}))


def components_of(quantity):
    """The name of the dimension of a quantity's components."""
    return _COMPONENTS.get(tuple(quantity.parts), f"{quantity.name}_component")


def component_names(quantities, variables):
    """{name: `Variable`} with the names of the components of `variables`."""
    parts = {components_of(x): x.parts for name, x in quantities.items() if x.parts and name in variables}
    return {name: Variable((name,), np.array(list(x)), {}) for name, x in parts.items()}


def dataset(xarray, variables, coordinates, attributes):
    """A Dataset; coordinates are the named variables, and those with the name of their only dimension."""
    named = {name for name, x in variables.items() if name in coordinates or x.dims == (name,)}
    data = {name: x for name, x in variables.items() if name not in named}
    return xarray.Dataset(data, {name: variables[name] for name in variables if name in named}, attributes)


def plain_text(text):
    """A text for a table, with a quote before it where a spreadsheet program would take it for a formula."""
    return f"'{text}" if text.startswith(_FORMULAS) else text


def write_columns(file, columns):
    """Write columns {heading: (n,)} as CSV, numbers with all digits, and nothing where one is not known."""
    with replaced(file) as fresh, open(fresh, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(map(plain_text, columns))
        writer.writerows(zip(*map(_cells, columns.values()), strict=True))


def _cells(column):
    values = np.asarray(column)
    if values.dtype.kind == "f":
        return ["" if x != x else x for x in values.tolist()]
    return [plain_text(x) if isinstance(x, str) else x for x in values.tolist()]


def _unknown(values):
    """Whether nothing in an array of numbers is known."""
    values = np.asarray(values)
    return values.dtype.kind == "f" and values.size > 0 and bool(np.isnan(values).all())


def _values(variables):
    return {name: variable.values for name, variable in variables.items()}


def _said(variables):
    """The units and the frames of variables, {name: text} each."""
    return {
        key: {name: x.attributes[attribute] for name, x in variables.items() if attribute in x.attributes}
        for key, attribute in (("units", "units"), ("frames", "frame"))
    }


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
