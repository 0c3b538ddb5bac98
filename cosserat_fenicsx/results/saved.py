"""A result in one HDF5 file that other programs can read, and back to the last digit.

Of a path or a motion:

scene, settings   JSON texts: the scene as data, see `parts.to_data`, and what the result was computed with
the root          what belongs to every state, reactions and events, in SI units
rods/<name>       the fields along each rod, in SI units
solution          dimensionless: what the result is made from again

Of other results `head`, a JSON text that says what the quantities are, and a dataset for each.

Datasets have the attributes units and, where they have components, frame; their dimensions have labels. Only the texts
and the solution are read back, and their check sums compared; no code is ever stored or run.
"""

import json
import os
import zlib
from contextlib import contextmanager
from dataclasses import fields

import numpy as np

from cosserat_fenicsx import __version__
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import h5py_for, new_hdf5, replaced
from cosserat_fenicsx.numerics import ElementRule
from cosserat_fenicsx.parts import NotData, from_data, to_data
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results.compared import NAMES, stored_criteria
from cosserat_fenicsx.results.records import KINDS, Event, Instant, Ledger, Record, Records
from cosserat_fenicsx.scene.scene import Scene

#: Format of files of paths and motions; version of both formats.
FORMAT, VERSION = "result of cosserat_fenicsx", 1
#: Format of files of quantities alone; attributes of a `Quantity` that are stored, which are no functions.
QUANTITIES = "quantities of cosserat_fenicsx"
SAID = [x.name for x in fields(Quantity) if x.name not in ("getter", "chart")]
# Fields of a record by the last dimensions of their arrays, in terms of the mesh: see `_sizes`.
_OF_RECORD = {"load_factor": "", "rq": "N7", "gauss_fields": "EG9", "negative_modes": "", "iterations": "",
              "steps": "", "reactions": "*", "neutral": "", "tie_forces": "T26"}  # fmt: skip
_OF_POINT = _OF_RECORD | {"clamp_loads": "C6", "rod_forces": "EP3"}
_OF_INSTANT = _OF_RECORD | {"time": "", "rates": "N6", "clamp_forces": "C6", "wall_forces": "*3",
                              "far_ends": "**"}  # fmt: skip
_OF_LEDGER = {name: "3" if "momentum" in name else "" for name in Ledger._fields}
_DENSITIES = {"densities_at_gauss_points": "EG6", "densities_at_nodes": "EP6"}
_OF_PATH = ("control", "left", "rounding", "galerkin")
_OF_EVENT = ("load_factor", "after", "residual", "error", "stage")


def save(result, file):
    """See `Result.save`; on one rank."""
    try:
        scene = json.dumps(to_data(result.scene))
    except NotData as problem:
        raise SceneError(
            f"{file}: {problem}: a result is saved with its scene, and code is never stored. Expected tables, signals "
            "and pieces instead of functions, such as Table, Ramp and AlongTable; write(), to_dict() and to_xarray() "
            "need no scene"
        ) from None
    with replaced(file) as fresh, new_hdf5(fresh) as store:
        store.attrs.update(format=FORMAT, version=VERSION, written_by=f"cosserat_fenicsx {__version__}",
                           kind=result._kind, title=result.scene.title)  # fmt: skip
        _put(store, "scene", scene)
        _put(store, "settings", json.dumps(_settings(result), default=lambda number: number.item()))
        for place, attributes, variables in result.in_groups():
            group = store if place == "/" else store.create_group(f"rods{place}")
            group.attrs.update(attributes)
            _write_variables(group, variables)
        solution = store.create_group("solution")
        solution.attrs["units"] = "1: lengths, forces and moments over the scales of the settings, inertial components"
        _write_solution(solution, result)


def _write_solution(place, result):
    """Write what a result is made of; of a path through stages, the paths of these in groups of their own."""
    for name, values in _solution(result).items():
        _put(place, name, values)
    for stage, part in result.parts.items() if result.scene.stages else ():
        group = place.create_group(f"stage {stage}")
        _put(group, "settings", json.dumps(_settings(part), default=lambda number: number.item()))
        _write_solution(group, part)


def save_quantities(result, file):
    """See `Result.save`; on one rank."""
    known = result.quantities
    values = {name: x.of(result) for name, x in known.items()}
    values = {name: np.asarray(x) for name, x in values.items() if x is not None}
    head = {
        "kind": type(result).__name__,
        "about": result._about(),
        "rows": len(result),
        "rows_axis": result._rows_axis,
        "over": result._over,
        "on_screen": [name for name in result._on_screen if name in values],
        "beside": dict(result._beside),
        "answer": list(result._answer(Units())),
        "quantities": [{name: getattr(known[key], name) for name in SAID} for key in values],
    }
    text = json.dumps(head, default=lambda x: x.tolist() if hasattr(x, "tolist") else str(x))
    for name, array in values.items():
        if array.dtype.kind == "O" and not all(isinstance(x, str) for x in array.flat):
            raise SceneError(f"{file}: '{name}' holds values that are neither numbers nor texts: expected such arrays")
    with replaced(file) as fresh, new_hdf5(fresh) as store:
        store.attrs.update(format=QUANTITIES, version=VERSION, written_by=f"cosserat_fenicsx {__version__}",
                           kind=head["kind"])  # fmt: skip
        _put(store, "head", text)
        for name, array in values.items():
            _put(store, name, array, units=known[name].unit, long_name=known[name].label)


def _put(place, name, values, **attributes):
    """Write a text, or an array of numbers or texts, with its check sum."""
    place[name] = _storable(values)
    place[name].attrs.update(attributes, crc32=_check_sum(values))


def _storable(values):
    """An array of texts as HDF5 takes it; others as they are."""
    return values.astype(object) if np.asarray(values).dtype.kind == "U" and np.ndim(values) else values


def _check_sum(values):
    """The check sum of a text, or of an array of numbers or of texts."""
    if isinstance(values, str | bytes):
        return zlib.crc32(values.encode() if isinstance(values, str) else values)
    if values.dtype.kind in "OU":
        return zlib.crc32(json.dumps(values.tolist()).encode())
    return zlib.crc32(np.ascontiguousarray(values))


def _write_variables(place, variables):
    for name, variable in variables.items():
        place[name] = _storable(variable.values)
        place[name].attrs.update(variable.attributes)
        for i, dim in enumerate(variable.dims):
            place[name].dims[i].label = dim


def _settings(result):
    names = ["model", "formulation", "degree", "unknowns", "why"]
    names += ["scheme", "time_unit"] if result.axis == "time" else [*_OF_PATH, "bounded", "judged", "cautions"]
    scales = {name: getattr(result.scales, name) for name in ("length", "force", "moment")}
    return {name: getattr(result, name) for name in names} | {"elements": list(result.elements), "scales": scales}


def _solution(result):
    """{name: array} the numbers that the result is made of."""
    moving, records = result.axis == "time", Records.of(list(result._records))
    rule = {name: getattr(result.rule, name) for name in ("nodes", "gauss", "weights")}
    found = {"element_ends": np.concatenate(result.layout.breaks), **rule}
    staged = not moving and result.scene.stages  # its states are those of the stages
    if staged:
        found |= {"stage": result.stage, "place": result.place}
    else:
        found |= {name: records[name] for name in (_OF_INSTANT if moving else _OF_POINT)}
    if moving:
        found |= records["ledger"]._asdict() | {"error": result.error}
    else:
        found |= {} if staged else dict(zip(_DENSITIES, records["densities"], strict=True))
        if result._errors is not None:
            found |= {"error": result.error, "errors": result._errors}
        found |= {f"event_{name}": [getattr(event, name) for event in result.events] for name in _OF_EVENT}
        found["event_mode"] = [event.mode for event in result.events] or np.empty((0, result._rest.shape[0], 3))
        found["event_kind"] = [KINDS.index(event.kind) for event in result.events]
    return {name: np.array(values) for name, values in found.items() if values is not None}


def read(file, kind, assemble, comm, joined=None):
    """The result that `save` wrote; every rank reads the file.

    Args:
        file: its name.
        kind: the class, `Path` or `History`.
        assemble: function of the scene, the element ends of every rod and the units of length, force and moment, that
            returns the layout, the scales and the connections.
        comm: the MPI communicator of the result.
        joined: of a path: the class of one through stages, of the scene and {stage: path}.
    """
    with opened(file, kind._kind) as store:
        check_format(file, store.attrs, kind._kind, FORMAT)
        if (found := store.attrs.get("kind")) != kind._kind:
            raise SceneError(f"{file}: it holds a {found}: expected a {kind._kind}; read_result reads any result")
        settings, data = (json.loads(checked(store, name)) for name in ("settings", "scene"))
        scene = from_data(Scene, data)
        numbers = _numbers(store["solution"])
        if not (joined and scene.stages):
            return _restored(kind, scene, settings, numbers, assemble, comm)
        parts = _restored_stages(kind, scene, numbers, assemble, comm)
        return _completed(joined(scene, parts).with_places(numbers["stage"], numbers["place"]), settings, numbers)


def _numbers(place):
    """{name: array, text, or the same of a group}."""
    return {name: _numbers(place[name]) if hasattr(place[name], "keys") else checked(place, name) for name in place}


@contextmanager
def opened(file, kind):
    """Context manager: an `h5py.File` that a `kind` of result was saved to; a missing or damaged one is refused."""
    h5py, expected = h5py_for(file), f"expected a file that `save` of a {kind} wrote"
    if not os.path.isfile(file):
        raise SceneError(f"{file}: there is no such file: {expected}")
    try:
        store = h5py.File(file, "r")
    except OSError as problem:
        raise SceneError(f"{file}: it cannot be read ({problem}): {expected}") from None
    with store:
        try:
            yield store
        except (KeyError, ValueError, TypeError, AttributeError, IndexError, OSError, RuntimeError, RecursionError,
                MemoryError) as problem:  # fmt: skip
            if isinstance(problem, SceneError) and str(problem).startswith(str(file)):
                raise
            raise SceneError(f"{file} is damaged ({type(problem).__name__}: {problem})") from None


def check_format(file, attributes, kind, *formats):
    """Refuse files of other formats, and of newer releases; `kind`: of result that is expected, in words."""
    if attributes.get("format") not in formats:
        raise SceneError(f"{file}: it is of another program: expected a file that `save` of a {kind} wrote")
    version = attributes.get("version")
    if not isinstance(version, np.integer) or version > VERSION:
        raise SceneError(
            f"{file}: its format is {version}, and this release reads up to {VERSION}: expected a newer one"
        )


def checked(place, name):
    """A text, or an array of numbers or texts, whose check sum agrees."""
    stored = place[name]
    texts = stored.dtype.kind == "O"
    if not texts and (stored.dtype.kind not in "fib" or stored.id.get_storage_size() < stored.nbytes):
        raise ValueError(f"{name} is neither a text nor an array of numbers")
    values = stored[()]
    if texts and stored.shape != ():
        values = np.array([x.decode() for x in values.flat], dtype=str).reshape(values.shape)
    if _check_sum(values if isinstance(values, bytes) else np.asarray(values)) != stored.attrs["crc32"]:
        raise ValueError(f"the check sum of {name} is wrong")
    return values


def _restored_stages(kind, scene, numbers, assemble, comm):
    """{stage: its path}, each on the scene that follows from the end of the one before."""
    parts, end = {}, None
    for leg in scene.legs:
        found = numbers.get(f"stage {leg.stage}")
        if found is None:
            break
        told = json.loads(found.pop("settings"))
        part = parts[leg.stage] = _restored(kind, scene.of_leg(leg, end), told, found, assemble, comm)
        end = part.at_points([len(part) - 1])
    return parts


def _restored(kind, scene, settings, numbers, assemble, comm):
    counts, rule = settings["elements"], ElementRule(*(numbers[name] for name in ("nodes", "gauss", "weights")))
    breaks = np.split(numbers["element_ends"], np.cumsum(np.add(counts, 1))[:-1])
    layout, scales, connections = assemble(scene, breaks, settings["scales"])
    p, moving = settings["degree"], kind.axis == "time"
    sizes = {"N": sum(p * count + 1 for count in counts), "E": sum(counts), "G": len(rule.gauss), "P": p + 1,
             "T": len(connections.ties), "C": len(connections.clamped)}  # fmt: skip
    expected = (_OF_INSTANT | _OF_LEDGER if moving else _OF_POINT | _DENSITIES).items()
    states = len(numbers["load_factor"])
    for name, dims in expected:
        if name in numbers:
            _check_shape(name, numbers[name].shape, (states, *(sizes.get(x, x) for x in dims)))
    common = {name: settings[name] for name in ("model", "formulation", "degree", "unknowns", "why")}
    result = kind(scene, layout, scales, rule, comm=comm, **common, connections=connections,
                                           expand=None)  # fmt: skip
    listed = [_record(numbers, k, moving) for k in range(states)]
    result._expanded = Records.of(listed) if listed else None
    if moving:
        result.scheme, result._time_unit = settings["scheme"], settings["time_unit"]
        if "error" in numbers:
            _check_shape("error", numbers["error"].shape, (states,))
            result.error = numbers["error"]
        return result
    return _completed(result, settings, numbers)


def _completed(path, settings, numbers):
    """A path with its settings, errors and events."""
    for name in _OF_PATH:
        setattr(path, name, settings[name])
    path.criteria = stored_criteria(settings.get("judged", NAMES)[len(NAMES) :])
    path._known_errors, path.events = _errors(numbers, len(path.judged), len(path)), _events(numbers)
    path.bounded, path.why = tuple(settings.get("bounded", NAMES[:1])), settings["why"]
    path.cautions = settings.get("cautions", [])
    return path


def _errors(numbers, count, states):
    """(count, states) estimated errors, or None; older files have errors of positions alone."""
    if "errors" in numbers:
        _check_shape("errors", numbers["errors"].shape, (count, states))
        return numbers["errors"]
    if "error" not in numbers:
        return None
    return np.concatenate([numbers["error"][None], np.full((count - 1, states), np.nan)])


def _check_shape(name, shape, expected):
    """Refuse another shape than the expected one, with "*" for any size."""
    if len(shape) != len(expected) or any(str(b) not in ("*", str(a)) for a, b in zip(shape, expected, strict=True)):
        raise ValueError(f"the shape of {name} is {shape}")


def _record(numbers, k, moving):
    """State k from the arrays of all states."""

    def of(names):
        rows = {name: numbers[name][k] for name in names if name in numbers}
        return {name: row if row.ndim else row.item() for name, row in rows.items()}

    if moving:
        return Instant(**of(_OF_INSTANT), ledger=Ledger(**of(_OF_LEDGER)))
    densities = of(_DENSITIES)
    return Record(**of(_OF_POINT), densities=tuple(densities.get(name) for name in _DENSITIES))


def _events(numbers):
    names = [name for name in _OF_EVENT if f"event_{name}" in numbers]  # older files know no stages
    columns = zip(*(numbers[f"event_{name}"].tolist() for name in names), strict=True)
    kinds = [KINDS[k] for k in numbers["event_kind"].astype(int)]
    return [
        Event(kind, mode=mode, **dict(zip(names, values, strict=True)))
        for kind, mode, values in zip(kinds, numbers["event_mode"], columns, strict=True)
    ]
