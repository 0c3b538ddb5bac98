"""Frames: straight rods between points, joined where they meet, from arrays or from a file with a mesh of lines."""

import copy
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from os import PathLike
from pathlib import Path
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import File, Numbers, Rows, direction, finite_array, refuse, store
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.parts import FileName, Part, Several, positive
from cosserat_fenicsx.scene.curves import Line
from cosserat_fenicsx.scene.profiles import Section
from cosserat_fenicsx.scene.rod import Rod, Station
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.sections import Material, Stiffness
from cosserat_fenicsx.scene.supports import Clamp, Hinge, Joint, Pin

#: Points of a mesh by their names or numbers, one or several.
Points = str | int | Sequence[str | int]
# Arrays of a mesh that may number the groups of its lines, in the order in which they are looked for.
_GROUPS = ("section", "gmsh:physical", "medit:ref", "cell_tags")


class Frame:
    """Straight rods between points, which `frame` and `frame_from` make.

    Attributes:
        points: (n, 3) m.
        edges: (rods, 2) numbers of the points at the start and at the end of each rod.
        rods: the rods, "rod0", "rod1" and so on where they have no other names.
        joints: of the rods that meet at a point, each to the first one there.
        supports: a `Clamp` at each clamped point, then a `Pin` (with `hinge_axis` a `Hinge`) at each pinned one.
    """

    def __init__(self, points, edges, rods, held, hinged, release):
        self.points, self.edges, self.rods, self._releases = points, edges, rods, dict.fromkeys(hinged, release)
        self.supports = tuple(kind(self.at(point)) for kind, numbers in held.items() for point in numbers)
        self._points_of, self._rods_of = {}, {}  # {name or number in a mesh: numbers of points; (rods,) of bool}

    def at(self, point: int) -> Station:
        """The station at a point, to put loads and supports there and to ask for results: an end of the first rod
        that meets it.

        Raises:
            SceneError: no such point, or no rod meets it.
        """
        if not isinstance(point, int | np.integer) or not 0 <= point < len(self.points):
            raise SceneError(
                f"Frame.at({point}): expected the number of a point, from 0 to {len(self.points) - 1}; "
                "Frame.nearest(place) finds it"
            )
        if point not in self._ends:
            raise SceneError(f"Frame.at({point}): no rod meets this point: expected an end of an edge")
        return self._ends[point][0]

    def nearest(self, place: Numbers) -> int:
        """The number of the point nearest to a place (x, y, z), m, among those that rods meet."""
        place = finite_array("Frame.nearest", "place", place, "a point (x, y, z), m")
        met = np.array(sorted(self._ends))
        return int(met[np.argmin(np.linalg.norm(self.points[met] - place, axis=1))])

    def points_in(self, name: str) -> list[int]:
        """The numbers of the points that a mesh gives a name, as in `clamped` of `frame_from`, in ascending order.

        Raises:
            SceneError: no points have it; names those that are known.
        """
        return sorted(_points_named("Frame.points_in", name, self._points_of))

    def rods_in(self, group: str | int) -> tuple[Rod, ...]:
        """The rods of a group of a mesh, by its name or number, as in `section` of `frame_from`.

        Raises:
            SceneError: no such group; names those that are known.
        """
        if group not in self._rods_of:
            raise SceneError(f"Frame.rods_in: no rods are in the group {group!r}: {_known(group, self._rods_of)}")
        return tuple(rod for rod, belongs in zip(self.rods, self._rods_of[group], strict=True) if belongs)

    def places_of(self, kind, name):
        """The stations of the points ("station"), or the rods ("rod"), that a mesh gives this name; none has it: ()."""
        if kind == "station":
            return [self.at(int(k)) for k in self._points_of.get(name, ())]
        return self.rods_in(name) if name in self._rods_of else ()

    def names_of(self, kind):
        """The names that `places_of` knows of a kind, as texts in alphabetical order."""
        return sorted(map(str, self._points_of if kind == "station" else self._rods_of))

    @cached_property
    def _ends(self):
        """{point: the ends of rods there}."""
        ends = {}
        for rod, (a, b) in zip(self.rods, self.edges.tolist(), strict=True):
            ends.setdefault(a, []).append(rod.start)
            ends.setdefault(b, []).append(rod.end)
        return ends

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        found = []
        for point, (first, *others) in self._ends.items():
            found += [Joint(first, other, release=self._releases.get(point)) for other in others]
        return tuple(found)

    def scene(self, loads: Sequence = (), supports: Sequence = (), **more) -> Scene:
        """The `Scene` of this frame: with these loads, and with supports beside those of the frame.

        Args:
            more: further arguments of `Scene`, such as velocities.

        Raises:
            SceneError: see `Scene`.
        """
        return Scene(self.rods, (*self.supports, *supports), tuple(loads), self.joints, **more)

    def __len__(self):
        return len(self.rods)

    def __repr__(self):
        counts = Counter(type(support) for support in self.supports)
        known = (Clamp, "clamped"), (Pin, "pinned"), (Hinge, "on hinges")
        words = [f"{counts[kind]} {word}" for kind, word in known if counts[kind]]
        held = " and ".join(words) or "none clamped"
        return f"<Frame: {len(self.rods)} rods between {len(self.points)} points, {held}>"


def frame(
    points: Rows,
    edges: Rows,
    section: Section | Stiffness | Sequence,
    material: Material | Sequence | None = None,
    *,
    clamped: Sequence[int] = (),
    pinned: Sequence[int] = (),
    hinged: Sequence[int] = (),
    hinge_axis: Numbers | None = None,
    d1: Numbers | None = None,
    names: Sequence[str] | None = None,
) -> Frame:
    """Straight rods between points, welded where they meet.

    Args:
        points: (n, 3) m.
        edges: (rods, 2) numbers of the points that each rod connects, from 0.
        section, material: of all rods; or one for every edge. Without a material each section is a `Stiffness`.
        clamped, pinned: numbers of points that are clamped, or held by a `Pin`.
        hinged: numbers of points at which rods meet in hinges.
        hinge_axis: about which rods turn at hinged and pinned points, a direction in space: (0, 1, 0) of a portal in
            the x-z plane. None for balls, which let rods turn about every axis, so that a portal falls over sideways.
        d1: see `Line`, of all rods.
        names: of the rods.

    Returns:
        A `Frame`; `frame.scene(loads)` is what `solve`, `buckling` and `modes` take.

    Raises:
        SceneError: a number of a point that is not there, an edge without length or that occurs twice, not as many
            sections, materials or names as edges, or an axis that is no direction, or without hinges.
    """
    points = finite_array("frame", "points", points, "rows of three numbers, m")
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise SceneError(f"frame.points has the shape {points.shape}: expected (points, 3)")
    ends = np.asarray(edges)
    if ends.ndim != 2 or ends.shape[1] != 2 or not len(ends):
        raise SceneError(f"frame.edges has the shape {ends.shape}: expected (rods, 2) whole numbers of points")
    if not np.issubdtype(ends.dtype, np.integer):
        raise SceneError(f"frame.edges[0] = {ends[0].tolist()}: expected whole numbers of points, such as [0, 1]")
    wrong = np.flatnonzero(((ends < 0) | (ends >= len(points))).any(axis=1))
    if len(wrong):
        edge, last = ends[wrong[0]].tolist(), len(points) - 1
        raise SceneError(f"frame.edges[{wrong[0]}] = {edge}: expected numbers of points from 0 to {last}")
    _, first, count = np.unique(np.sort(ends, axis=1), axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        raise SceneError(f"frame.edges: {ends[first[count > 1][0]].tolist()} occurs twice: expected each rod once")
    sections, materials = _one_each("section", section, len(ends)), _one_each("material", material, len(ends))
    names = [f"rod{i}" for i in range(len(ends))] if names is None else _one_each("names", list(names), len(ends))
    places = [tuple(x) for x in points.tolist()]
    try:
        rods = []
        for i, (a, b) in enumerate(ends.tolist()):
            rods.append(Rod(Line(places[a], places[b], d1=d1), sections[i], materials[i], name=names[i]))
    except SceneError as problem:
        raise SceneError(f"frame: {names[i]!r}, from point {a} to {b}: {problem}") from None
    given = {"clamped": clamped, "pinned": pinned, "hinged": hinged}
    held, pins, loose = (_numbers(field, value, len(points)) for field, value in given.items())
    meet = np.bincount(ends.ravel(), minlength=len(points))
    alone = next((k for k in loose if meet[k] < 2), None)
    if alone is not None:
        raise SceneError(f"frame.hinged: {meet[alone]} rods meet point {alone}: expected points where two or more do")
    on_pin, release = Pin, "all"
    if hinge_axis is not None:
        release = direction("frame", "hinge_axis", hinge_axis)
        on_pin = partial(Hinge, axis=release)
        if not (pins or loose):
            raise SceneError(f"frame.hinge_axis = {release}: expected points that are pinned or hinged beside it")
    return Frame(points, ends, tuple(rods), {Clamp: held, on_pin: pins}, loose, release)


def _one_each(field, value, count):
    """A value for every edge, from one value for all or from a list."""
    if not isinstance(value, list | tuple):
        return [value] * count
    if len(value) != count:
        raise SceneError(f"frame.{field} has {len(value)} values: expected one, or {count}, one for every edge")
    return value


def _numbers(field, value, count):
    """The numbers of points, each once."""
    found = np.atleast_1d(np.asarray(value))
    if found.size and not np.issubdtype(found.dtype, np.integer):
        raise SceneError(f"frame.{field} = {value!r}: expected numbers of points")
    wrong = found[(found < 0) | (found >= count)]
    if wrong.size:
        raise SceneError(f"frame.{field} has {wrong[0]}: expected numbers of points from 0 to {count - 1}")
    return np.unique(found).astype(int).tolist()


def frame_from(
    mesh: File,
    section: Section | Stiffness | Mapping,
    material: Material | Mapping | None = None,
    *,
    clamped: Points = (),
    pinned: Points = (),
    hinged: Points = (),
    hinge_axis: Numbers | None = None,
    scale: float = 1.0,
    d1: Numbers | None = None,
) -> Frame:
    """The frame of the lines of a mesh, as gmsh, Abaqus, VTK and other programs write it.

    Args:
        mesh: a file that meshio reads, or a `meshio.Mesh`.
        section, material: of all rods; or {group: section}, a group being the name or the number that the mesh gives
            to its lines: an element set (Abaqus), a physical group (gmsh), or the integers of the cell data "section".
        clamped, pinned, hinged: the points that are clamped, held by a `Pin`, or at which rods meet in hinges, by their
            numbers in the mesh or by names: node sets (Abaqus), physical groups of points (gmsh), or point data that
            are 1 there and 0 elsewhere (VTK).
        scale: m per unit of the mesh.
        hinge_axis, d1: see `frame`.

    Returns:
        A `Frame`, whose points have the numbers of the mesh; `Frame.points_in` and `Frame.rods_in` know the names of
        the mesh, to put loads and supports there.

    Raises:
        SceneError: it cannot be read, has no straight lines, or a group or name is not in it, which lists those that
            are.
    """
    import meshio  # slow to import, and few scenes need it

    if isinstance(mesh, str | PathLike):
        try:
            mesh = meshio.read(mesh)
        except (OSError, meshio.ReadError, KeyError, ValueError, SystemExit) as problem:
            raise SceneError(
                f"frame_from: {mesh} cannot be read ({problem}): expected a mesh that meshio reads"
            ) from None
    blocks = [i for i, block in enumerate(mesh.cells) if block.type == "line"]
    if not blocks:
        kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "no cells"
        raise SceneError(f"frame_from: the mesh has {kinds}: expected cells of the type line, with two points each")
    edges = np.concatenate([mesh.cells[i].data for i in blocks]).astype(int)
    curved = sum(len(block.data) for block in mesh.cells if block.type.startswith("line") and block.type != "line")
    if curved:
        raise SceneError(f"frame_from: the mesh has {curved} lines with more than two points: expected straight ones")
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points * scale
    groups = _groups(mesh, blocks, len(edges))
    chosen = [_by_group(field, value, groups, len(edges))
              for field, value in (("section", section), ("material", material))]  # fmt: skip
    sets = _point_sets(mesh)
    given = {"clamped": clamped, "pinned": pinned, "hinged": hinged}
    held = {field: _points_named(f"frame_from.{field}", names, sets) for field, names in given.items()}
    found = frame(points, edges, *chosen, **held, hinge_axis=hinge_axis, d1=d1)
    found._points_of, found._rods_of = sets, groups
    return found


def _groups(mesh, blocks, count):
    """{name or number: (count,) of bool} of the lines of a mesh."""
    groups = {}
    for name, parts in mesh.cell_sets.items():
        marked, first = np.zeros(count, dtype=bool), 0
        for i in blocks:
            if parts[i] is not None:
                marked[first + np.asarray(parts[i], dtype=int)] = True
            first += len(mesh.cells[i].data)
        if marked.any() and ":" not in name:  # meshio's own sets have a colon
            groups[name] = marked
    array = next((name for name in _GROUPS if name in mesh.cell_data), None)
    if array is None:
        return groups
    values = np.concatenate([np.ravel(mesh.cell_data[array][i]) for i in blocks])
    numbers = np.round(values).astype(int)
    if not np.array_equal(numbers, values):
        raise SceneError(f"frame_from: the cell data {array!r} are not whole numbers: expected those of groups")
    names = {tag: name for name, (tag, dimension) in mesh.field_data.items() if dimension == 1}
    for number in np.unique(numbers).tolist():
        groups.setdefault(number, numbers == number)
        if array == "gmsh:physical" and number in names:
            groups.setdefault(names[number], numbers == number)
    return groups


def _by_group(field, value, groups, count):
    """A section or a material for every line, from one or from {group: it}."""
    if not isinstance(value, Mapping):
        return value
    found, owner = [None] * count, [None] * count
    for group, item in value.items():
        if group not in groups:
            raise SceneError(f"frame_from.{field}: no lines are in the group {group!r}: {_known(group, groups)}")
        for i in np.flatnonzero(groups[group]).tolist():
            if owner[i] is not None:
                both = f"{owner[i]!r} and {group!r}"
                raise SceneError(f"frame_from.{field}: line {i} is in {both}: expected groups without common lines")
            found[i], owner[i] = item, group
    missing = next((i for i, item in enumerate(found) if item is None), None)
    if missing is not None:
        left = [repr(name) for name, marked in groups.items() if marked[missing]] or ["no group"]
        raise SceneError(f"frame_from.{field}: line {missing} is in {', '.join(left)}: expected a {field} for it")
    return found


def _point_sets(mesh):
    """{name: numbers of points} of a mesh; of point data those that are only 0 and 1."""
    sets = {name: np.asarray(numbers, dtype=int) for name, numbers in mesh.point_sets.items()}
    tags = mesh.cell_data.get("gmsh:physical")
    for name, (tag, dimension) in mesh.field_data.items():
        if dimension == 0 and tags is not None:
            at = [block.data[np.ravel(numbers) == tag].ravel()
                  for block, numbers in zip(mesh.cells, tags, strict=True) if block.type == "vertex"]  # fmt: skip
            sets.setdefault(name, np.concatenate([*at, np.empty(0, dtype=int)]).astype(int))
    for name, values in mesh.point_data.items():
        if np.size(values) == len(mesh.points) and np.isin(values, (0, 1)).all():
            sets.setdefault(name, np.flatnonzero(np.ravel(values)))
    return {name: numbers for name, numbers in sets.items() if len(numbers)}


def _points_named(where, names, sets):
    """Numbers of the points of these names, or numbers; `where`: what asks for them, in messages."""
    names = [names] if np.ndim(names) == 0 else list(names)
    for name in names:
        if isinstance(name, str) and name not in sets:
            more = "" if sets else "; expected numbers of points, such as [0, 3]"
            raise SceneError(f"{where}: no points are named {name!r}: {_known(name, sets)}{more}")
    return [k for name in names for k in (sets[name].tolist() if isinstance(name, str) else [name])]


def _known(name, known):
    """The end of a message on a name that a mesh does not have."""
    if not known:
        return "the mesh names none"
    return nearest(name, [str(x) for x in known])


@dataclass(frozen=True)
class MeshGroup(Part):
    """The section and the material of the lines of a group of a mesh. name: of the group, or its number. section: of
    its rods. material: None for that of the mesh."""

    name: str | int
    section: Section
    material: Material | None = None


@dataclass(frozen=True)
class Mesh(Part):
    """Straight rods along the lines of a mesh, in a scene file. They are called "rod0", "rod1" and so on.

    Args:
        file: the mesh, beside the scene file.
        section, material: of all rods, or of the groups that name none.
        groups: a section for each group of lines, instead of one `section`.
        clamped, pinned, hinged: points by names or numbers, one or a list. hinge_axis, scale, d1: as for `frame_from`.

    Attributes:
        frame: the `Frame`.

    Raises:
        SceneError: see `frame_from`.
    """

    file: Annotated[File, FileName()]
    section: Section | None = None
    material: Material | None = None
    groups: Sequence[MeshGroup] = ()
    clamped: Points = ()
    pinned: Points = ()
    hinged: Points = ()
    hinge_axis: Annotated[tuple, Several()] | None = None
    scale: Annotated[float, positive()] = 1.0
    d1: Annotated[tuple, Several()] | None = None

    called = "mesh"

    def validate(self):
        if (self.section is None) == (not self.groups):
            refuse(self, "section", self.section, "either a section of all rods, or groups with a section each")
        names = [group.name for group in self.groups]
        if len(set(names)) < len(names):
            refuse(self, "groups", names, "each group once")
        store(self, file=str(Path(self.file).absolute()))
        section = {group.name: group.section for group in self.groups} or self.section
        material = {group.name: group.material or self.material for group in self.groups} or self.material
        held = {name: getattr(self, name) for name in ("clamped", "pinned", "hinged", "hinge_axis", "scale", "d1")}
        store(self, frame=frame_from(self.file, section, material, **held))

    def everywhere(self, field, items, others):
        """Loads, supports or velocities (`field`); one whose station or rod is a name of the mesh at each place of that
        name: at the first in its own place of the list, which messages count by, at the others behind all. Refuses a
        name that neither the mesh nor one of its rods or of `others`, a list of rods, has."""
        found, more = list(items), []
        rods = {rod.name for rod in (*self.frame.rods, *others)}
        for i, item in enumerate(items):
            key = next((key for key in ("station", "rod") if isinstance(getattr(item, key, None), str)), None)
            name = getattr(item, key) if key else ""
            places = self.frame.places_of(key, name) if key else ()
            if key and not places and re.sub(r"(@[^@]*|\.(start|end))$", "", name) not in rods:
                known = self.frame.names_of(key)
                raise SceneError(
                    f"Scene.{field}[{i}].{key} = '{name}': no name of a rod or of the mesh: {_known(name, known)} (the "
                    f"mesh names {'points' if key == 'station' else 'groups of lines'} {', '.join(known) or 'none'}; "
                    f"its rods are '{self.frame.rods[0].name}' to '{self.frame.rods[-1].name}')"
                )
            copies = [copy.copy(item) for _ in places]
            for one, place in zip(copies, places, strict=True):
                store(one, **{key: place})
            found[i], more = [*copies, item][0], [*more, *copies[1:]]
        return found + more
