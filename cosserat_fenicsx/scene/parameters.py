"""A number of a scene by its name, and the scene with another value of it.

Scenes are immutable: every object that holds the number, directly or not, is made again by its constructor, with its
checks. An object that several others share, such as a material, is changed for all of them.
"""

import copy
import dataclasses
import math
import numbers
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import instance, number, store
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.kinds import Number, fields_of
from cosserat_fenicsx.scene.curves import Curve, Spline
from cosserat_fenicsx.scene.rod import Station
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.sections import Tube
from cosserat_fenicsx.scene.stages import OF_STAGE

_NOTHING = 1e-6  # vector components below this, relative to the vector, are rounding errors
_PARTS = ("rods", "materials", "supports", "loads", "joints")
_TOKEN = re.compile(r"\[(\d+)\]|\.?([^.\[\]]+)")
_UNITS = {
    **dict.fromkeys(("diameter", "outer_diameter", "inner_diameter", "width", "height", "radius", "offset"), "m"),
    **dict.fromkeys(("start", "end", "centre", "points", "displacement", "clearance", "length"), "m"),
    "E": "Pa", "nu": "1", "density": "kg/m^3", "force": "N", "moment": "N m", "rotation": "rad", "gravity": "m/s^2",
    "friction": "1", "rotational": "N m/rad", "stiffness": "N/m^2", "Spring.stiffness": "N/m",
    "TubeRing.stiffness": "N/m", "LineForce.force": "N/m", "LineMoment.moment": "N m/m", "shear": "N", "axial": "N",
    "curvature": "1/m", "rest_length": "m", "alpha": "1/K", "dT": "K", "gradient": "K/m",
    "bending": "N m^2", "torsion": "N m^2",
}  # fmt: skip


@dataclass(frozen=True)
class Parameter:
    """A number that a scene depends on, for derivatives.

    Args:
        name: its name in results.
        value: its value in the scene.
        scene_of: a function of a value that returns the `Scene` with it: the same rods, supports, joints and loads in
            the same order, at the same shares of the rods' lengths. It is called with values close to `value`.
        unit: for tables.
        scale: the size of a large change; None for the size of `value`, which then must not be zero.

    Raises:
        SceneError: an argument of the wrong kind, or no scale.
    """

    name: str
    value: float
    scene_of: Callable[[float], Scene]
    unit: str = ""
    scale: float | None = None

    def __post_init__(self):
        instance(self, "name", self.name, str, "a string")
        number(self, "value", self.value, "a finite number", math.isfinite)
        if not callable(self.scene_of):
            raise SceneError(f"Parameter '{self.name}': scene_of = {self.scene_of!r}: expected a function of a value")
        if not (self.value if self.scale is None else self.scale):
            raise SceneError(
                f"Parameter '{self.name}': its value is 0, so that its size is not known: expected "
                "Parameter(name, 0.0, scene_of, scale=...), with a change that is large"
            )

    @property
    def size(self):
        """The size of a large change."""
        return abs(self.value if self.scale is None else self.scale)


@dataclass(frozen=True)
class _OfScene(Parameter):
    """A parameter by its name; `place` identifies the number, whatever its name, with its `owner`."""

    place: tuple = ()
    owner: object = None


def check_once(scene, given):
    """Refuse (SceneError) two names (or `Parameter`s) of the same number, such as that of a shared material, whose
    uncertainty would count twice; or two parameters with one name; see also `parameter_of`."""
    names = {}
    for parameter in [parameter_of(scene, each) for each in given]:
        place = getattr(parameter, "place", parameter.name)
        if place in names:
            raise SceneError(
                f"parameter '{parameter.name}' is the same number of the scene as '{names[place]}': expected one of "
                "them, whose standard deviation counts once"
            )
        names[place] = parameter.name


def parameter_of(scene, given):
    """The `Parameter` given as one or by its name.

    Names are made of fields and numbers from 0: "rods.column.section.diameter" or "rods[0].section.diameter",
    "rods.column.material.E", "materials[0].E" (of the rods' different materials, in order) or "materials.steel.E" (of a
    scene file), "loads[1].force[2]", "supports[0].displacement[0]". Raises SceneError: there is no such number (names
    the nearest), or it is 0 and its scale is unknown."""
    if isinstance(given, Parameter):
        return given
    if not isinstance(given, str):
        raise SceneError(f"parameter = {given!r}: expected a name such as 'rods.column.material.E', or a Parameter")
    owner, field, keys = _find(scene, given)
    leaf, size = getattr(owner, field), None
    for key in keys:
        leaf, size = leaf[key], leaf
    if isinstance(leaf, bool) or not isinstance(leaf, numbers.Real):
        raise SceneError(f"parameter '{given}' is {_kind(leaf)}: expected the name of a number{_inside(leaf, given)}")
    unit = _UNITS.get(f"{type(owner).__name__}.{field}") or _UNITS.get(field) or _unit_of_field(owner, field)
    if isinstance(owner, Curve) and unit == "m":  # places change by parts of the curve, wherever its origin lies
        size = _extent(owner)
    elif isinstance(owner, Tube) and field != "shear_factor":  # small changes of a diameter remove a thin wall
        size = owner.outer_diameter - owner.inner_diameter
    elif size is not None:  # a component that is 0, or rounding of it: as large as the vector
        whole = math.hypot(*size) if all(isinstance(x, numbers.Real) for x in size) else math.inf
        size = whole if abs(leaf) <= (_NOTHING * whole if len(size) == 3 else 0) and whole < math.inf else None

    def scene_of(value):
        new = _put(getattr(owner, field), keys, value)
        return _Rebuilding({id(owner): _made(owner, {field: new})}).of(scene)

    return _OfScene(given, float(leaf), scene_of, unit, size or None, (id(owner), field, *keys), owner)


def scene_with(scene, names, values):
    """The scene, or another dataclass of parts such as a `Drilling`, with other numbers, by their names (see
    `parameter_of`); those of one object are changed at once."""
    groups = {}
    for name, value in zip(names, values, strict=True):
        groups.setdefault(id(_find(scene, name)[0]), []).append((name, float(value)))
    for group in groups.values():  # one may hold another, so that each is found again
        scene = _Rebuilding(_changed((*_find(scene, name), value) for name, value in group)).of(scene)
    return scene


def _changed(numbers):
    """{id of an object: the same with other numbers}, from (object, its field, indices within the field, value)s."""
    owners, fields = {}, {}
    for owner, field, keys, value in numbers:
        owners[id(owner)], of_owner = owner, fields.setdefault(id(owner), {})
        of_owner[field] = _put(of_owner.get(field, getattr(owner, field)), keys, value)
    return {key: _made(owners[key], changed) for key, changed in fields.items()}


def laws_with(scene, parameters, values):
    """K and J, (cases, rods, 3), N and N m^2, of uniform rods without couplings in a scene with other numbers of
    sections and materials, values (cases, parameters); NaN in cases that a constructor refuses."""
    found = np.empty((len(values), len(scene.rods), 6))
    for i, rod in enumerate(scene.rods):
        found[:, i, :3], found[:, i, 3:] = rod.profile.range[0].K, rod.profile.range[0].J
    places = [(parameter.owner, parameter.place[1], parameter.place[2:]) for parameter in parameters]
    of_rods = [i for i, rod in enumerate(scene.rods) if _holds(rod, parameters)]
    for row, numbers_of_case in zip(found, values.tolist(), strict=True):
        try:
            rebuilding = _Rebuilding(
                _changed((*place, value) for place, value in zip(places, numbers_of_case, strict=True))
            )
            for i in of_rods:
                rod = scene.rods[i]
                k = rebuilding.of(rod.section).stiffness(rebuilding.of(rod.material))
                row[i] = *k.shear, k.axial, *k.bending, k.torsion
        except SceneError:
            row[:] = np.nan
    return found[..., :3], found[..., 3:]


def admitted_laws(scene, parameters, values):
    """`laws_with` for values that the constructors admit, of all cases at once; raises if formulas take no arrays."""
    known = {}
    for parameter, column in zip(parameters, values.T, strict=True):
        _, field, *keys = parameter.place
        owner = known[id(parameter.owner)] = known.get(id(parameter.owner)) or copy.copy(parameter.owner)
        parts = getattr(owner, field)
        object.__setattr__(owner, field, _put(tuple(parts) if keys else parts, keys, column))
    rebuilding, found = _Rebuilding(known), np.empty((len(values), len(scene.rods), 6))
    for i, rod in enumerate(scene.rods):
        for k, modulus in enumerate(rebuilding.of(rod.section).moduli(rebuilding.of(rod.material))):
            found[:, i, k] = modulus
    return found[..., :3], found[..., 3:]


def _holds(rod, parameters):
    """Whether the section or the material of a rod depends on one of the parameters."""
    known = _Rebuilding({id(parameter.owner): None for parameter in parameters})
    try:
        return known.of(rod.section) is not rod.section or known.of(rod.material) is not rod.material
    except SceneError:  # an owner inside the section cannot be None
        return True


def _extent(curve):
    """The shortest length (m) that shapes a curve."""
    if isinstance(curve, Spline):
        return float(np.linalg.norm(np.diff(curve.points, axis=0), axis=1).min())
    arm = np.linalg.norm(np.subtract(curve.start, curve.centre)) if hasattr(curve, "centre") else curve.length
    return float(min(arm, curve.length))


def _find(scene, name):
    """(dataclass that holds the number, its field, indices within the field)."""
    tokens = [int(i) if i else word for i, word in _TOKEN.findall(name)]
    of_rods = isinstance(scene, Scene)
    parts = _PARTS if of_rods else [x.name for x in dataclasses.fields(scene) if x.init]
    if not tokens or tokens[0] not in parts:
        raise SceneError(f"parameter '{name}': {nearest(tokens[0] if tokens else '', parts)}")
    here = _materials(scene) if of_rods and tokens[0] == "materials" else getattr(scene, tokens[0])
    owner, field, keys = scene, tokens[0], []
    for token in tokens[1:]:
        if dataclasses.is_dataclass(here):
            fields = [x.name for x in dataclasses.fields(here) if x.init]
            if token not in fields:
                raise SceneError(f"parameter '{name}': {_kind(here)} has no '{token}': {nearest(token, fields)}")
            owner, field, keys, here = here, token, [], getattr(here, token)
            continue
        if of_rods and isinstance(token, str) and owner is scene and not keys and field in ("rods", "materials"):
            named = scene.materials if field == "materials" else {rod.name: rod for rod in scene.rods}
            if token not in named:
                what = "no material of a scene file" if field == "materials" else "no rod"
                raise SceneError(f"parameter '{name}': {what} is named '{token}': {nearest(token, named)}")
            keys, here = [*keys, token], named[token]
            continue
        if not isinstance(here, tuple | list | np.ndarray) or not isinstance(token, int) or token >= len(here):
            holds = f"{len(here)} items, numbered from 0" if isinstance(here, tuple | list | np.ndarray) else "no parts"
            raise SceneError(f"parameter '{name}': the part before '{token}' has {holds}")
        keys, here = [*keys, token], here[token]
    if owner is scene:
        raise SceneError(f"parameter '{name}' is {_kind(here)}: expected the name of a number{_inside(here, name)}")
    leaf = getattr(owner, field)
    if not keys and isinstance(leaf, tuple) and len(leaf) == 1 and np.shape(leaf[0]) == (2,):
        keys = [0, 1]  # one number for all of a length, kept as a piece (end, number)
    return owner, field, keys


def _unit_of_field(owner, field):
    """The SI unit that a part declares for a field."""
    kind = fields_of(type(owner)).get(field)
    kind = getattr(kind, "inner", kind)
    return (getattr(kind, "unit", None) or "1") if isinstance(kind, Number) else "its SI unit"


def _materials(scene):
    """The different materials of the rods, in order."""
    return tuple({id(rod.material): rod.material for rod in scene.rods if rod.material is not None}.values())


def _kind(value):
    return f"a {type(value).__name__}"


def _inside(value, name):
    """Examples of longer names, for messages."""
    if dataclasses.is_dataclass(value):
        return ", such as " + " or ".join(f"'{name}.{x.name}'" for x in dataclasses.fields(value)[:3] if x.init)
    return f", such as '{name}[0]'" if isinstance(value, tuple | list | np.ndarray) else ""


def _put(value, keys, leaf):
    """A value with another number at the place of indices."""
    if not keys:
        return leaf
    if isinstance(value, np.ndarray):
        new = np.array(value, dtype=float)
        new[tuple(keys)] = leaf
        return new
    parts = list(value)
    parts[keys[0]] = _put(parts[keys[0]], keys[1:], leaf)
    return type(value)(parts)


def _made(item, changes):
    """A dataclass of the package, made again with other fields."""
    if isinstance(item, Station):
        return dataclasses.replace(item, **changes)
    given = item.arguments()  # in the order of the fields, whose names may differ
    names = dict(zip([x.name for x in dataclasses.fields(item) if x.init], given, strict=True))
    made = type(item)(**given | {names[field]: value for field, value in changes.items()})
    store(made, **{name: vars(item)[name] for name in OF_STAGE if name in vars(item)})
    return made


class _Rebuilding:
    """Copies of objects that hold, directly or not, one that is replaced ({its id: replacement}); others are kept."""

    def __init__(self, known):
        self._known, self._alive = known, []

    def of(self, item):
        """The copy of an object, or itself."""
        if id(item) not in self._known:
            self._known[id(item)] = self._copy(item)
            self._alive.append(item)
        return self._known[id(item)]

    def _copy(self, item):
        if isinstance(item, Station):
            rod = self.of(item.rod)
            if rod is item.rod:
                return item
            share = item.s / item.rod.length
            return Station(rod, rod.length if share == 1 else share * rod.length)
        if isinstance(item, tuple | list) and not hasattr(item, "_fields"):
            parts = [self.of(x) for x in item]
            return item if all(a is b for a, b in zip(parts, item, strict=True)) else type(item)(parts)
        if not dataclasses.is_dataclass(item) or isinstance(item, type):
            return item
        fields = [x.name for x in dataclasses.fields(item) if x.init]
        changed = {x: self.of(getattr(item, x)) for x in fields}
        same = all(changed[x] is getattr(item, x) for x in fields)
        return item if same else _made(item, changed)
