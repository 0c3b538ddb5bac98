"""Files: a path as XDMF and HDF5 for ParaView, or one of its points in a format of meshio.

Written from the results with the system's h5py and with meshio, so that the files are the same for every release of
dolfinx; an element of degree p becomes p straight lines. (meshio's own time series does not support quaternions, and
some readers crash on dolfinx's XDMF or misinterpret it: README, Files.)
"""

from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.ranks import on_first

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


def write(path, file, k=-1):
    """Write a path: all points to .xdmf with the load factor as time axis or to .html, point k to any other format.

    Args:
        path: a `Path` with at least one point.
        file: the file's name, whose ending sets the format.
        k: index of the point, for other formats than .xdmf.

    Raises:
        SceneError: an empty path, or an ending that meshio does not support.
        OSError: the file cannot be written.
    """
    if len(path) == 0:
        raise SceneError(f"{file}: the path has no point to write")
    if Path(file).suffix == ".html":
        from cosserat_fenicsx.pictures import viewer

        on_first(path.comm, lambda: viewer.write(path, Path(file)))
        return
    on_first(path.comm, lambda: _write(path, Path(file), k))


def _write(path, file, k):
    import meshio

    file.parent.mkdir(parents=True, exist_ok=True)
    if file.suffix != ".xdmf":
        if file.suffix not in meshio.extension_to_filetypes:
            known = ".xdmf, .html, .vtu, .vtk, .ply or another ending that meshio knows"
            raise SceneError(f"{file}: the ending '{file.suffix}' is not known: expected {known}")
        with open(file, "wb"):
            pass  # raises a plain OSError here if the file cannot be written
        points, cells, data = mesh_of(path, k)
        meshio.write(file, meshio.Mesh(points, cells, point_data=data))
        return
    _write_series(path, file)


def _write_series(path, file):
    """Write the arrays to the .h5 file, then the .xdmf file that refers to them, so that every .xdmf is complete."""
    try:
        import h5py
    except ImportError:
        raise SceneError(
            f"{file}: writing .xdmf needs h5py: install the system's, 'apt install python3-h5py'"
        ) from None
    numbers = file.with_suffix(".h5")
    root = xml.Element("Xdmf", Version="3.0")
    series = xml.SubElement(
        xml.SubElement(root, "Domain"), "Grid", Name="path", GridType="Collection", CollectionType="Temporal"
    )
    with h5py.File(numbers, "w") as store:

        def item(parent, name, array):
            array = np.ascontiguousarray(array)
            if name not in store:
                store[name] = array
            xml.SubElement(
                parent,
                "DataItem",
                Dimensions=" ".join(map(str, array.shape)),
                NumberType="Int" if array.dtype.kind == "i" else "Float",
                Precision="8",
                Format="HDF",
            ).text = f"{numbers.name}:/{name}"

        for k, eta in enumerate(path.along_axis):
            points, cells, data = mesh_of(path, k)
            grid = xml.SubElement(series, "Grid", Name=f"point {k}", GridType="Uniform")
            xml.SubElement(grid, "Time", Value=repr(float(eta)))
            geometry = xml.SubElement(grid, "Geometry", GeometryType="XYZ")
            item(geometry, "reference", points - data["displacement"])
            lines = cells[0][1]
            topology = xml.SubElement(
                grid, "Topology", TopologyType="Polyline", NodesPerElement="2", NumberOfElements=str(len(lines))
            )
            item(topology, "lines", lines)
            q = data.pop("quaternion")  # some readers support no arrays of four components
            for name, array in {
                "position": points,
                **data,
                "quaternion_a": q[:, 0],
                "quaternion_bcd": q[:, 1:],
            }.items():
                kind = {1: "Scalar", 2: "Vector"}[array.ndim]
                attribute = xml.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center="Node")
                item(attribute, f"{name}_{k}", array)
    xml.indent(root)
    xml.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def mesh_of(path, k):
    """Nodes, lines and fields of all rods at point k.

    Returns:
        points (n, 3), m; cells in meshio's format; dict of arrays (n, ...).
    """
    names = {**FIELDS, **path.more_fields}
    points, lines, data, first = [], [], {name: [] for name in names}, 0
    for rod in path.scene.rods:
        fields = path.fields(k, rod)
        n = len(fields["s"])
        points.append(fields["position"])
        lines.append(first + np.column_stack([np.arange(n - 1), np.arange(1, n)]))
        for name, field in names.items():
            data[name].append(fields[field])
        first += n
    joined = {name: np.concatenate(values) for name, values in data.items()}
    return np.concatenate(points), [("line", np.concatenate(lines))], joined
