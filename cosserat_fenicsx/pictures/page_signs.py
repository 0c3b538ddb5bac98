"""Supports, joints and loads in the interactive file: what its script draws in every state."""

import base64

import numpy as np

from cosserat_fenicsx.pictures.signs import joints_of, marks_of, marks_of_supports, sign_size, without_sign
from cosserat_fenicsx.pictures.symbols import COLOURS, GROUPS, arrows_along
from cosserat_fenicsx.pictures.view import view_of
from cosserat_fenicsx.scene.signals import at, signals_of

# Maximum number of arrows and other signs; of those beyond it the file says how many are left out.
_MOST = 200


def signs(result, shown, shapes, span, place):
    """The signs of a path or a motion.

    Args:
        shown: indices of the states in the file.
        shapes: of each rod its number of `nodes` and the `radius` (m) that it is drawn with.
        span: (3,) the extents that decide on the view.
        place: function from points (..., 3), m, to those of the file.

    Returns:
        the data, and notes on what is left out.
    """
    scene, rods = result.scene, {rod: i for i, rod in enumerate(result.scene.rods)}
    unit = float(np.linalg.norm(place(np.array([1.0, 0, 0])) - place(np.zeros(3))))

    def held(mark):
        station = mark.station
        rod, s = station.rod, station.s
        end = -1 if s == 0 else 1 if s == rod.length else 0
        nodes = shapes[rods[rod]].nodes
        return {"kind": mark.kind, "rod": rods[rod], "at": [s / rod.length * (nodes - 1)], "end": end,
                "colour": COLOURS[GROUPS[mark.kind]]}  # fmt: skip

    found = []
    for mark in marks_of_supports(result.supports_at(shown[-1])):
        axis = mark.vector if mark.kind in ("hinge", "roller") else None
        found.append({**held(mark), "axis": None if axis is None else np.asarray(axis, dtype=float).tolist()})
    for mark in joints_of(scene):
        found.append({**held(mark), "axis": None if mark.vector is None else _material(mark, mark.vector).tolist()})
    loads = [pair for load in scene.all_loads for pair in _over_states(load, result, shown)]
    count = len(found) + sum(mark.station is not None for _, mark, _ in loads)
    size = sign_size(span, count)
    top = {}
    for _, mark, vectors in loads:
        if mark.unit:
            top[mark.unit] = max(top.get(mark.unit, 0.0), float(np.linalg.norm(vectors, axis=-1).max()))
    for name, mark, vectors in loads:
        if mark.unit and top[mark.unit] == 0:
            continue
        if mark.station is not None:
            one = held(mark)
            if mark.unit and mark.turns:
                vectors = vectors @ mark.station.rod.curve.frame(mark.station.s)
            if mark.arm is not None:
                one["arm"] = (unit * _material(mark, mark.arm)).tolist()
            if not mark.unit:
                one["axis"] = None if mark.vector is None else np.asarray(mark.vector, dtype=float).tolist()
        elif mark.rod is not None:
            number, nodes = arrows_along(mark.rod.length, size), shapes[rods[mark.rod]].nodes
            vectors = vectors[:, np.linspace(0, vectors.shape[1] - 1, number).round().astype(int)]
            one = {"kind": mark.kind, "rod": rods[mark.rod], "at": np.linspace(0, nodes - 1, number).tolist()}
        else:
            vectors, one = vectors[:, :1], {"kind": "everywhere", "text": name}
        one["colour"] = COLOURS[GROUPS[mark.kind]]
        if mark.unit:
            one |= {"turns": mark.turns, "unit": mark.unit, "top": top[mark.unit]}
            one["vectors"] = floats(vectors.reshape(len(shown), -1, 3) / top[mark.unit])
        found.append(one)
    drawn = np.cumsum([len(one.get("at", [0])) for one in found]) <= _MOST
    left_out, words = int((~drawn).sum()), without_sign(scene, False, threads=False)
    notes = [f"not drawn: {words}"] if words else []
    notes += [f"{left_out} supports, joints or loads not drawn"] if left_out else []
    notes += ["supports of the last state"] if scene.stages else []
    _, right, _, up = view_of(span)
    data = {
        "size": unit * size,
        "radii": [unit * shape.radius for shape in shapes],
        "up": up.tolist(),
        "right": right.tolist(),
        "signs": [one for one, kept in zip(found, drawn, strict=True) if kept],
    }
    return data, notes


def _material(mark, vector):
    """A vector of the reference along d1, d2, d3 of the section."""
    return np.asarray(vector) @ mark.station.rod.curve.frame(mark.station.s)


def _over_states(load, result, shown):
    """[(name of its class, mark, vectors (states, 3), along a rod (states, n, 3), or None)] of a load in all states."""
    along, scene = result.along_axis[shown], result.scene
    if result.axis == "time" and signals_of(load):
        every = [marks_of(at(load, t), scene, 1.0) for t in along]
        return [
            (type(load).__name__, marks[0], np.array([mark.vector for mark in marks]) if marks[0].unit else None)
            for marks in zip(*every, strict=False)  # a spring may be none at some time
        ]
    factors = np.array([result.share_of(load, k) for k in shown])
    return [
        (type(load).__name__, mark, np.multiply.outer(factors, np.asarray(mark.vector)) if mark.unit else None)
        for mark in marks_of(at(load, 0.0), scene, 1.0)
    ]


def floats(array):
    """An array as text, which the script of the file reads."""
    return base64.b64encode(np.ascontiguousarray(array, "<f4").tobytes()).decode()
