"""Points of a polyline: from numbers, from a .csv file, or from any file with line cells that meshio reads."""

import contextlib
import csv
import io
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import refuse, text_of
from cosserat_fenicsx.dimensions import LARGEST
from cosserat_fenicsx.errors import SceneError

# Smallest distance of neighbouring points over the extent of all: nearer ones leave the curvature to rounding errors.
_APART = 1e-7


def polyline(owner, field, given, *, closed):
    """The points (n, 3), m, of an array or a file, without repetitions.

    Args:
        owner, field: named in error messages.
        given: an array, or the path of a file: .csv (three columns, m, with or without a header) or one that meshio
            reads.
        closed: whether the last point is joined to the first; it may then repeat it.

    Raises:
        SceneError: a file that cannot be read or holds no single polyline without branches, too few points, numbers
            that are not finite, or a point that repeats the one before.
    """
    points, what = given, f"{given!r:.60}"
    if isinstance(given, str | Path):
        what = str(given)
        if Path(given).suffix.lower() == ".csv":
            points = _from_csv(owner, field, Path(given))
        else:
            points = _from_mesh(owner, field, Path(given), closed)
    try:
        points = np.asarray(points)
    except ValueError:
        refuse(owner, field, what, "points of three numbers each (m)")
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "iuf":
        refuse(owner, field, what, "points of three numbers each (m)")
    points = points.astype(float)
    usable = (np.abs(points) <= LARGEST).all(axis=1)
    if not usable.all():
        row = int(np.argmin(usable))
        refuse(owner, f"{field}[{row}]", tuple(points[row].tolist()), f"finite numbers (m), none beyond {LARGEST:g}")
    if closed and len(points) > 1 and _coincide(points[-1:], points[:1], points)[0]:
        points = points[:-1]
    if len(points) < 2 + closed:
        refuse(owner, field, what, f"{'three' if closed else 'two'} points or more")
    again = np.flatnonzero(_coincide(points[1:], points[:-1], points))
    if len(again):
        row = int(again[0]) + 1
        apart = f"a point apart from the one before, by more than {_APART:g} of the extent of all"
        refuse(owner, f"{field}[{row}]", tuple(points[row].tolist()), apart)
    return points


def _coincide(a, b, points):
    near = max(1e-12 * np.abs(points).max(), _APART * np.ptp(points, axis=0).max())
    return ~(np.linalg.norm(a - b, axis=1) > near)


def _from_csv(owner, field, file):
    rows = []
    try:
        table = list(csv.reader(io.StringIO(text_of(file, "points as .csv"), newline="")))
    except (SceneError, csv.Error) as problem:
        refuse(owner, field, str(file), f"a text file that can be read ({problem})")
    for number, row in enumerate(table, start=1):
        if not any(cell.strip() for cell in row):
            continue
        try:
            x, y, z = map(float, row)
        except ValueError:
            if rows or number > 1:
                refuse(owner, field, str(file), f"three numbers in line {number}, which is {','.join(row)!r:.60}")
        else:
            rows.append((x, y, z))
    return rows or np.empty((0, 3))


def _from_mesh(owner, field, file, closed):
    import meshio  # imported here, since few scenes need it

    if not file.is_file():
        refuse(owner, field, str(file), "a file that exists")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            mesh = meshio.read(file)
    except (Exception, SystemExit) as problem:  # its readers may raise anything, even SystemExit
        refuse(owner, field, str(file), f"a .csv file or a mesh file that meshio reads ({problem!r:.120})")
    segments = [cells.data for cells in mesh.cells if cells.type == "line"]
    for cells in mesh.cells:
        if cells.type == "line3":  # its third node is the midpoint
            segments.append(cells.data[:, [0, 2, 2, 1]].reshape(-1, 2))
    if not segments:
        refuse(owner, field, str(file), "a file with line cells, which form the polyline")
    points = np.asarray(mesh.points, dtype=float)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    return points[_chain(owner, field, file, np.concatenate(segments).tolist(), closed)]


def _chain(owner, field, file, segments, closed):
    """The nodes of segments, ordered along the polyline that they form, from an end that is the first node of a
    segment."""
    neighbours = {}
    for a, b in segments:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    branching = [node for node, others in neighbours.items() if len(others) > 2]
    if branching:
        refuse(
            owner, field, str(file), f"a polyline without branches, but three or more lines meet at node {branching[0]}"
        )
    ends = [node for node, others in neighbours.items() if len(others) == 1]
    if not ends and not closed:
        refuse(owner, field, str(file), "a polyline with two ends, or closed = true for this ring")
    firsts = {a for a, _ in segments}
    previous, node = None, next((end for end in ends if end in firsts), (ends or [segments[0][0]])[0])
    following = segments[0][1] if not ends else neighbours[node][0]
    chain, start = [node], node
    while following is not None and following != start:
        previous, node = node, following
        chain.append(node)
        following = next((other for other in neighbours[node] if other != previous), None)
    if len(chain) != len(neighbours):
        refuse(owner, field, str(file), "a single polyline, but its lines form several")
    return chain
