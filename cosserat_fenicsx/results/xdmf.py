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
    """Write point k, by default the last, in the format of meshio that the ending of a `pathlib.Path` names."""

    def mesh():
        points, lines, fields = meshes_of(path, [-1 if k is None else k])
        return points[0], lines, {name: values[0] for name, values in fields.items()} | constants_of(path)

    known = ".xdmf, .csv, .html, .vtu, .vtk, .ply or another ending that meshio knows"
    write_mesh(file, mesh, f"{known}; `save` writes a whole result as .h5")


def write_mesh(file, mesh, known):
    """Write nodes, lines and fields in a format of meshio; mesh: function that returns nodes (n, 3), lines (elements,
    2) and {name: (n, ...)}; known: the endings, for the SceneError on an unknown one."""
    import meshio

    if file.suffix not in meshio.extension_to_filetypes:
        raise SceneError(f"{file}: the ending '{file.suffix}' is not known: expected {known}")
    points, lines, fields = mesh()
    with replaced(file) as fresh:
        meshio.write(fresh, meshio.Mesh(points, [("line", lines)], point_data=fields))


def write_series(path, file, k=None):
    """Write all points of a path or a motion, over the load factor or the time; see `write_blocks`."""
    fields = {**_names(path), "arc_length": "s", "position": "position"}
    units = {name: path.quantities[field].unit for name, field in fields.items()}
    units[f"time axis ({path.axis})"] = "s" if path.axis == "time" else "1"
    write_blocks(file, "path", path, path.along_axis, _blocks(path), units)


def _blocks(path):
    """Reference, lines and fields of consecutive blocks of states, as `write_blocks` takes them."""
    for first in range(0, len(path), _BLOCK):
        points, lines, data = meshes_of(path, range(first, min(first + _BLOCK, len(path))))
        q = data.pop("quaternion")  # some readers support no arrays of four components
        fields = {"position": points, **data, "quaternion_a": q[..., 0], "quaternion_bcd": q[..., 1:]}
        yield points[0] - data["displacement"][0], lines, fields


def write_blocks(file, name, meshed, along, blocks, units):
    """Write states on one mesh: the arrays to the .h5 file, and the .xdmf file that refers to them; both appear when
    they are complete, the .xdmf last.

    name: of the series; meshed: a result with the `scene`, `layout` and `rule` of the nodes; along: (states,) their
    times; blocks: of consecutive states: nodes (n, 3) in m, lines (elements, 2) and fields {name: (states, n) or
    (states, n, 3)}; nodes and lines are the same in all of them; units: {name of a field: its unit}.
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
    """The text of one state, with {k} for its number and {along} for its load factor or time."""
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
    """Nodes (points, n, 3), m, lines (elements, 2) and fields {name: (points, n, ...)} of rods at several points."""
    names, of_rods = _names(path), []
    for rod in path.scene.rods:
        fields = path.fields_at(which, rod)
        own = {name: path.quantities[name].of(path, rod)[list(which)] for name in names.values() if name not in fields}
        of_rods.append(fields | own)
    joined = {name: np.concatenate([fields[field] for fields in of_rods], axis=1) for name, field in names.items()}
    points = np.concatenate([fields["position"] for fields in of_rods], axis=1)
    return points, lines_of([len(fields["s"]) for fields in of_rods]), joined


def lines_of(counts):
    """(elements, 2) lines between neighbours among the nodes of all rods, of which there are `counts`."""
    ends = np.cumsum(counts)
    first = np.delete(np.arange(ends[-1]), ends - 1)
    return np.column_stack([first, first + 1])


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
    positions = [found.equilibrium.position(rod) for rod in found.scene.rods]
    points, lines = np.concatenate(positions), lines_of([len(x) for x in positions])
    moved, turned = np.split(found.at_phase(), 2, axis=2)
    fields = {"displacement": moved, "rotation": turned, "position": np.broadcast_to(points, moved.shape)}

    def written():
        if file.suffix == ".xdmf":
            block = points, lines, fields
            write_blocks(file, "modes", found.equilibrium, range(len(found)), [block], _UNITS_OF_SHAPES)
        else:
            known = ".xdmf, .csv, .nc, .vtu, .vtk or another ending that meshio knows"
            write_mesh(file, lambda: (points, lines, {name: x[k] for name, x in fields.items()}), known)

    on_first(found.comm, written)
