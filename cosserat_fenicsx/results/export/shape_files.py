"""Files of shapes about an equilibrium: XDMF, CSV, or one shape in a format of meshio."""

from pathlib import Path

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.export.beside import replaced
from cosserat_fenicsx.results.export.columns import write_columns
from cosserat_fenicsx.results.export.xdmf import write_blocks
from cosserat_fenicsx.results.shapes import require_modes

_UNITS = {
    "displacement": "m",
    "rotation": "rad",
    "position": "m",
    "arc_length": "m",
    "time axis (number of a mode)": "1",
}


def write(found, file, k=0):
    """Write shapes to a file; see `Shapes.write`."""
    file = Path(file)
    if file.suffix == ".csv":
        on_first(found.comm, lambda: write_columns(file, csv_columns(found)))
        return
    require_modes(found, file)
    k = found.number(k)
    on_first(found.comm, lambda: _write(found, file, k))


def csv_columns(found):
    """{heading: (n,)} the numbers of all modes, and where and how each moves most."""
    columns = {"k": np.arange(len(found)), **found.columns}
    places = [found.farthest(k) for k in range(len(found))]
    columns["moves most at"] = np.array(["" if place is None else str(place) for place, _ in places])
    along = np.array([np.full(3, np.nan) if axis is None else axis for _, axis in places]).reshape(-1, 3)
    return columns | {f"direction there {axis}": along[:, i] for i, axis in enumerate("xyz")}


def _write(found, file, k):
    import meshio

    points, lines = _mesh(found)
    if file.suffix == ".xdmf":
        block = points, lines, _fields(found, points, slice(None))
        write_blocks(file, "modes", found.equilibrium, range(len(found)), [block], _UNITS)
        return
    if file.suffix not in meshio.extension_to_filetypes:
        known = ".xdmf, .csv, .vtu, .vtk or another ending that meshio knows"
        raise SceneError(f"{file}: the ending '{file.suffix}' is not known: expected {known}")
    fields = {name: values[0] for name, values in _fields(found, points, slice(k, k + 1)).items()}
    with replaced(file) as fresh:
        meshio.write(fresh, meshio.Mesh(points, [("line", lines)], point_data=fields))


def _mesh(found):
    """Positions (N, 3), m, of all nodes in the equilibrium, and lines (cells, 2) between neighbours."""
    points, lines, first = [], [], 0
    for rod in found.scene.rods:
        points.append(found.equilibrium.position(rod))
        n = len(points[-1])
        lines.append(first + np.column_stack([np.arange(n - 1), np.arange(1, n)]))
        first += n
    return np.concatenate(points), np.concatenate(lines)


def _fields(found, points, which):
    """{name: (n, N, 3)} of modes, a slice of all."""
    moved, turned = found.shapes[which, :, :3], found.shapes[which, :, 3:]
    return {"displacement": moved, "rotation": turned, "position": np.broadcast_to(points, moved.shape)}
