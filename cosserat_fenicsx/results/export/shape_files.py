"""Files of shapes about an equilibrium: XDMF, CSV, or one shape in a format of meshio."""

from pathlib import Path

import numpy as np

from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.export.columns import write_columns
from cosserat_fenicsx.results.export.xdmf import lines_of, write_blocks, write_mesh
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
    positions = [found.equilibrium.position(rod) for rod in found.scene.rods]
    points, lines = np.concatenate(positions), lines_of(map(len, positions))
    if file.suffix == ".xdmf":
        block = points, lines, _fields(found, points, slice(None))
        write_blocks(file, "modes", found.equilibrium, range(len(found)), [block], _UNITS)
        return
    fields = {name: values[0] for name, values in _fields(found, points, slice(k, k + 1)).items()}
    known = ".xdmf, .csv, .vtu, .vtk or another ending that meshio knows"
    write_mesh(file, lambda: (points, [("line", lines)], fields), known)


def _fields(found, points, which):
    """{name: (n, N, 3)} of modes, a slice of all."""
    moved, turned = found.shapes[which, :, :3], found.shapes[which, :, 3:]
    return {"displacement": moved, "rotation": turned, "position": np.broadcast_to(points, moved.shape)}
