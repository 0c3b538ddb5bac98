"""Files: a path as XDMF and HDF5 for ParaView, or one of its points in a format of meshio.

Written from the results with the system's h5py and with meshio, so that the files are the same for every release of
dolfinx; an element of degree p becomes p straight lines. (meshio's own time series does not support quaternions, and
some readers crash on dolfinx's XDMF or misinterpret it: docs/results.md.)
"""

from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import arrays_in, replaced
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.scene.stresses import Stress

#: Names in the files, as in eq. (1), and the fields of `Path.fields` behind them.
FIELDS = {
    "displacement": "displacement",
    "quaternion": "quaternion",
    "d1": "d1",
    "d2": "d2",
    "d3": "d3",
    "n": "force",
    "m": "moment",
    "strain": "strain",
    "curvature": "curvature",
    "bending_moment": "bending_moment",
}
_STRESSES = {name: name for name in Stress._fields}
# States that are computed at once.
_BLOCK = 256
_HEAD = """<?xml version='1.0' encoding='utf-8'?>
<Xdmf Version="3.0">
  <Domain>
    {about}
    <Grid Name="{name}" GridType="Collection" CollectionType="Temporal">
"""
_TAIL = """    </Grid>
  </Domain>
</Xdmf>
"""


def write_state(path, file, k=None):
    """Write one point in a format of meshio.

    Args:
        file: a `pathlib.Path`, whose ending sets the format; k: index of the point, None for the last.

    Raises:
        SceneError: an ending that meshio does not support.
        OSError: the file cannot be written.
    """
    known = (
        ".xdmf, .csv, .html, .vtu, .vtk, .ply or another ending that meshio knows; `save` writes a whole result as .h5"
    )
    write_mesh(file, lambda: mesh_of(path, -1 if k is None else k), known)


def write_mesh(file, mesh, known):
    """Write nodes, lines and fields in a format of meshio.

    Args:
        file: a `pathlib.Path`; mesh: function that returns them as `mesh_of` does; known: the endings, in words.

    Raises:
        SceneError: an ending that meshio does not support.
        OSError: the file cannot be written.
    """
    import meshio

    if file.suffix not in meshio.extension_to_filetypes:
        raise SceneError(f"{file}: the ending '{file.suffix}' is not known: expected {known}")
    points, cells, data = mesh()
    with replaced(file) as fresh:
        meshio.write(fresh, meshio.Mesh(points, cells, point_data=data))


def write_series(path, file, k=None):
    """Write all points of a path or a motion, over the load factor or the time; see `write_blocks`."""
    fields = {**_names(path), "arc_length": "s", "position": "position"}
    units = {name: path.quantities[field].unit for name, field in fields.items()}
    units[f"time axis ({path.axis})"] = "s" if path.axis == "time" else "1"
    write_blocks(file, "path", path, path.along_axis, _blocks(path), units)


def _blocks(path):
    """Reference, lines and fields of some states after others, as `write_blocks` takes them."""
    for first in range(0, len(path), _BLOCK):
        points, cells, data = meshes_of(path, range(first, min(first + _BLOCK, len(path))))
        q = data.pop("quaternion")  # some readers support no arrays of four components
        fields = {"position": points, **data, "quaternion_a": q[..., 0], "quaternion_bcd": q[..., 1:]}
        yield points[0] - data["displacement"][0], cells[0][1], fields


def write_blocks(file, name, meshed, along, blocks, units):
    """Write states on one mesh: the arrays to the .h5 file, and the .xdmf file that refers to them.

    Both appear when they are complete, the .xdmf last.

    Args:
        file: the .xdmf; name: of the series.
        meshed: what has the `scene`, `layout` and `rule` of the nodes.
        along: (states,) their times.
        blocks: of some states after others: nodes (n, 3) in m, lines (elements, 2) and fields {name: (states, n) or
            (states, n, 3)}; nodes and lines are the same in all of them.
        units: {name of a field: its unit}, for information in the file.

    Raises:
        OSError: they cannot be written; the old ones stay.
    """
    numbers, constants, k = file.with_suffix(".h5"), constants_of(meshed), 0
    with replaced(file) as text, replaced(numbers) as fresh:
        with arrays_in(fresh) as put, open(text, "w", encoding="utf-8") as stream:
            stream.write(_HEAD.format(name=name, about=_about(meshed.scene, units)))
            for name, array in constants.items():
                put(name, array)
            for nodes, lines, fields in blocks:
                if k == 0:
                    put("reference", nodes)
                    put("lines", lines)
                grid = _grid(numbers.name, lines, fields, constants)
                for arrays in zip(*fields.values(), strict=True):
                    for field, array in zip(fields, arrays, strict=True):
                        put(f"{field}_{k}", array)
                    stream.write(grid.format(k=k, along=repr(float(along[k]))))
                    k += 1
            stream.write(_TAIL)


def _about(scene, units):
    """The text of Information elements: the names of the rods by their numbers, and the units of the fields."""
    told = {"rods": {i: rod.name for i, rod in enumerate(scene.rods)}, "units": units}
    words = {name: "; ".join(f"{key}: {value}" for key, value in values.items()) for name, values in told.items()}
    elements = (xml.Element("Information", Name=name, Value=value) for name, value in words.items())
    return "\n    ".join(xml.tostring(element, encoding="unicode") for element in elements)


def _grid(store, lines, fields, constants):
    """The text of one state, with {k} for its number and {along} for its load factor or time.

    Args:
        store: the name of the .h5 file; lines: (elements, 2); fields: {name: (states, nodes, ...)}; constants: {name:
            (nodes,)} of all states.
    """
    grid, store = xml.Element("Grid", Name="point {k}", GridType="Uniform"), store.replace("{", "{{").replace("}", "}}")

    def item(parent, name, array):
        size, kind = " ".join(map(str, array.shape)), "Int" if array.dtype.kind == "i" else "Float"
        entry = xml.SubElement(parent, "DataItem", Dimensions=size, NumberType=kind, Precision="8", Format="HDF")
        entry.text = f"{store}:/{name}"

    xml.SubElement(grid, "Time", Value="{along}")
    item(xml.SubElement(grid, "Geometry", GeometryType="XYZ"), "reference", next(iter(fields.values()))[0])
    about = {"TopologyType": "Polyline", "NodesPerElement": "2", "NumberOfElements": str(len(lines))}
    item(xml.SubElement(grid, "Topology", about), "lines", lines)
    for name, array in fields.items():
        kind = {2: "Scalar", 3: "Vector"}[array.ndim]
        item(xml.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center="Node"), f"{name}_{{k}}", array[0])
    for name, array in constants.items():
        item(xml.SubElement(grid, "Attribute", Name=name, AttributeType="Scalar", Center="Node"), name, array)
    xml.indent(grid, level=3)
    return f"      {xml.tostring(grid, encoding='unicode').rstrip()}\n"


def mesh_of(path, k):
    """Nodes, lines and fields of all rods at point k.

    Returns:
        points (n, 3), m; cells in meshio's format; dict of arrays (n, ...).
    """
    points, cells, data = meshes_of(path, [k])
    return points[0], cells, {name: values[0] for name, values in data.items()} | constants_of(path)


def constants_of(meshed):
    """{name: (n,)} at all nodes: the arc length, m, and the number of the rod, from 0."""
    nodes = meshed.layout.node_s(meshed.rule.nodes)
    return {
        "arc_length": np.concatenate([x * rod.length for x, rod in zip(nodes, meshed.scene.rods, strict=True)]),
        "rod": np.concatenate([np.full(len(x), i) for i, x in enumerate(nodes)]),
    }


def _names(path):
    """Names in the files, and the fields of `Path.fields` behind them."""
    own = {name: name for name, x in path.quantities.items() if x.axes == ("point", "s") and x.getter is not None}
    return {**FIELDS, **path.more_fields, **(_STRESSES if path.knows_stresses else {}), **own}


def meshes_of(path, which):
    """`mesh_of` at several points: arrays (points, n, ...)."""
    names = _names(path)
    points, data = [], {name: [] for name in names}
    for rod in path.scene.rods:
        fields = path.fields_at(which, rod)
        points.append(fields["position"])
        for name, field in names.items():
            data[name].append(fields[field] if field in fields else path.quantities[field].of(path, rod)[list(which)])
    joined = {name: np.concatenate(values, axis=1) for name, values in data.items()}
    return np.concatenate(points, axis=1), [("line", lines_of(p.shape[1] for p in points))], joined


def lines_of(counts):
    """(elements, 2) lines between neighbours among the nodes of all rods, of which there are `counts`."""
    lines, first = [], 0
    for n in counts:
        lines.append(first + np.column_stack([np.arange(n - 1), np.arange(1, n)]))
        first += n
    return np.concatenate(lines)


_UNITS_OF_SHAPES = {
    "displacement": "m",
    "rotation": "rad",
    "position": "m",
    "arc_length": "m",
    "time axis (number of a mode)": "1",
}


def write_shapes(found, file, k=0):
    """Write shapes to a file; see `Shapes.write`."""
    file = Path(file)
    found.require_modes(file)
    k = found.number(k)
    on_first(found.comm, lambda: _write_shapes(found, file, k))


def _write_shapes(found, file, k):
    positions = [found.equilibrium.position(rod) for rod in found.scene.rods]
    points, lines = np.concatenate(positions), lines_of(map(len, positions))
    if file.suffix == ".xdmf":
        block = points, lines, _shape_fields(found, points, slice(None))
        write_blocks(file, "modes", found.equilibrium, range(len(found)), [block], _UNITS_OF_SHAPES)
        return
    fields = {name: values[0] for name, values in _shape_fields(found, points, slice(k, k + 1)).items()}
    known = ".xdmf, .csv, .nc, .vtu, .vtk or another ending that meshio knows"
    write_mesh(file, lambda: (points, [("line", lines)], fields), known)


def _shape_fields(found, points, which):
    """{name: (n, N, 3)} of modes, a slice of all."""
    moved, turned = found.shapes[which, :, :3], found.shapes[which, :, 3:]
    return {"displacement": moved, "rotation": turned, "position": np.broadcast_to(points, moved.shape)}
