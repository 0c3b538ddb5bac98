"""A result as one interactive file: HTML that needs no library and no network, drawn by the browser's WebGL 2."""

import base64
import html
import json
import math
import string
from importlib import resources

import numpy as np
from scipy.spatial.transform import Rotation

from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.pictures.charts import asked, chosen_unit
from cosserat_fenicsx.pictures.drawing import (
    MAPS,
    at_rest,
    default_colour,
    girth,
    known,
    outlines,
    peak_of,
    seen,
    thickening,
    thicker,
    too_small,
)
from cosserat_fenicsx.pictures.signs import (
    Deformed,
    joints_of,
    marks_of,
    marks_of_supports,
    sign_size,
    span_of,
    without_sign,
)
from cosserat_fenicsx.pictures.symbols import COLOURS, GROUPS, arrows_along
from cosserat_fenicsx.pictures.view import axes_of, seen_moving, view_of
from cosserat_fenicsx.quantities import BY_UNIT
from cosserat_fenicsx.scene.signals import at, signals_of

#: Fields that can be chosen in the file, where the result has them, beside that of `default_colour`, which is first.
FIELDS = ("bending_moment", "twisting_moment", "tension", "shear_force", "displacement", "von_mises")
# Stands for a missing value, drawn grey.
_NONE = 1e30
# Maximum numbers of states, of sections of a rod (per element, in all), and of states times sections of all rods (64
# bytes each).
_STATES, _PER_ELEMENT, _SECTIONS, _MOST = 400, 8, 121, 50_000
_FEWEST = 9
# Duration (s) of the play of paths, and of motions outside the range of durations that are shown in real time.
_PLAY, _REAL_TIME = 8.0, (4.0, 20.0)
_PARTS = ("rods.js", "signs.js", "camera.js", "axes.js", "app.js")


def write(result, file, magnify=1.0, units="SI"):
    """Write a path or a motion to an interactive .html file (a `pathlib.Path`), on one rank: a slider over the states,
    turning, zooming and moving by mouse and touch, a play button, and choices of the field that colours the rods and of
    the factor of displacements, which is `magnify` at first; numbers are in some `Units`.

    States beyond some hundreds are left out evenly, which the file says.
    """
    with replaced(file) as fresh:
        fresh.write_text(page(result, magnify, units), encoding="utf-8")


def page(result, magnify=1.0, units="SI"):
    """The text of the file, see `write`."""
    place = resources.files(__package__) / "page"
    with asked(units=units):
        found = _data(result, magnify)
    data = json.dumps(found, allow_nan=False, ensure_ascii=False).replace("<", "\\u003c")
    return string.Template((place / "page.html").read_text("utf-8")).substitute(
        title=html.escape(_title(result)),
        style=(place / "style.css").read_text("utf-8"),
        data=data,
        script='"use strict";\n' + "".join((place / part).read_text("utf-8") for part in _PARTS),
    )


def _title(result):
    return result.scene.title or ("Deformed rods" if result.axis != "time" else "Motion")


def _data(result, magnify):
    rods = result.scene.rods
    counts = [min(_SECTIONS, _PER_ELEMENT * n + 1) for n in result.elements]
    while sum(counts) > _MOST // min(len(result), 20) and max(counts) > _FEWEST:
        counts = [max(_FEWEST, n * 2 // 3) for n in counts]
    most = max(2, min(_STATES, _MOST // sum(counts)))
    shown = np.unique(np.linspace(0, len(result) - 1, min(len(result), most)).round().astype(int))
    every = known(result)
    names = dict.fromkeys((default_colour(result, shown), *FIELDS))
    colours = [every[name] for name in names if name in every]
    shapes = [_Shapes(result, rod, colours, np.linspace(0, 1, n), shown) for rod, n in zip(rods, counts, strict=True)]
    moved = [shape.rest + magnify * (shape.positions - shape.rest) for shape in shapes]
    everywhere = np.concatenate([*at_rest(result.scene), *(line.reshape(-1, 3) for line in moved)])
    extent, axes = float(np.ptp(everywhere, axis=0).max()), axes_of(everywhere)
    low, high = (np.array([getattr(axis, end) for axis in axes]) for end in ("low", "high"))
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    factors = [thickening(shape, extent, len(shapes)) for shape in shapes]
    for shape, factor in zip(shapes, factors, strict=True):
        shape.radius *= factor
    span = span_of(result.scene, [Deformed(result, int(k), {}, magnify, 0.0) for k in shown[-1:]], everywhere)
    span = seen_moving(span, np.concatenate([(shape.positions - shape.rest).reshape(-1, 3) for shape in shapes]))
    drawn, undrawn = signs(result, shown, shapes, span, lambda points: (points - middle) / size)
    largest = float(max(np.linalg.norm(shape.positions - shape.rest, axis=-1).max() for shape in shapes))
    return {
        "title": _title(result),
        "notes": _notes(result, shown, factors) + too_small(result, shown, extent, magnify) + undrawn,
        "magnify": {"start": magnify, "choices": _choices(largest, extent, magnify)},
        "axis": _along(result, shown),
        "axes": [
            {
                "name": axis.name,
                "low": (axis.low - middle[i]) / size,
                "high": (axis.high - middle[i]) / size,
                "ticks": [((x - middle[i]) / size, text) for x, text in axis.ticks],
            }
            for i, axis in enumerate(axes)
        ],
        "box": [[(getattr(axis, end) - middle[i]) / size for i, axis in enumerate(axes)] for end in ("low", "high")],
        "view": _view(span),
        "fields": [
            _field(result, i, colour, [shape.values[i] for shape in shapes]) for i, colour in enumerate(colours)
        ],
        "maps": MAPS,
        "units": {unit: chosen[::-1] for unit in BY_UNIT if (chosen := chosen_unit(unit))},
        **drawn,
        "rods": [shape.packed(middle, size, factor) for shape, factor in zip(shapes, factors, strict=True)],
    }


class _Shapes:
    """One rod in all states shown, at arc lengths x (n,) over its length."""

    def __init__(self, result, rod, colours, x, shown):
        self.name, self.outline = rod.name, outlines(rod, x * rod.length)
        self.radius = float(np.linalg.norm(self.outline, axis=2).max())
        if rod.profile.constant:
            self.outline = self.outline[:1]
        positions, turns, values = [], [], []
        for k in map(int, shown):
            line, directors = result.sample(k, rod, x)
            fields = result.fields(k, rod)
            positions.append(line)
            turns.append(np.roll(Rotation.from_matrix(directors).as_quat(), 1, axis=1))
            values.append([np.interp(x, fields["s"] / rod.length, colour.of(fields)) for colour in colours])
        self.positions, self._turns, self.nodes = np.array(positions), np.array(turns), len(x)
        self.rest = rod.curve.position(x * rod.length)
        self.values = np.array(values).swapaxes(0, 1)  # (fields, states, n)

    def packed(self, middle, size, factor):
        """Its data for the file: positions relative to `middle` over `size`, m; sections enlarged by a factor."""
        places = (self.positions - middle) / size
        first, *others = np.nan_to_num(self.values, nan=_NONE)[..., None]
        states = np.concatenate([places, first, self._turns, *others], axis=-1)
        states = np.concatenate([states, np.zeros((*states.shape[:2], -states.shape[2] % 4))], axis=-1)
        return {
            "name": self.name,
            "nodes": states.shape[1],
            "texels": states.shape[2] // 4,
            "corners": self.outline.shape[1],
            "outline": floats(factor / size * self.outline),
            "rest": floats((self.rest - middle) / size),
            "states": floats(states),
        }


def _choices(largest, extent, start):
    """Factors of displacements, 1, 2, 5 ... until `largest` (m) is as large as the structure, and the first one."""
    found = {1.0, start}
    for decade in range(-1, 13):
        for factor in (f * 10.0**decade for f in (1, 2, 5)):
            if 1 < factor and 1e-12 * extent < largest and factor * largest <= extent:
                found.add(float(f"{factor:.0e}"))
    return sorted(found)


def _along(result, shown):
    values = result.along_axis[shown]
    timed = result.axis == "time"
    duration = float(values[-1] - values[0])
    return {
        "name": "t =" if timed else result.axis,
        "unit": " s" if timed else "",
        "timed": timed,
        "digits": max(0, 2 - math.floor(math.log10(duration))) if duration > 0 else 0,
        "values": values.tolist(),
        "stable": [bool(result.stable[k]) for k in shown] if result.counts_modes else [True] * len(shown),
        "seconds": _seconds(result),
    }


def _seconds(result):
    """How long the play takes, s."""
    duration = float(result.along_axis[-1] - result.along_axis[0])
    real = result.axis == "time" and _REAL_TIME[0] <= duration <= _REAL_TIME[1]
    return duration if real else _PLAY


def _notes(result, shown, factors):
    """Notes under the title: the states shown, the speed of the play, and what is not to scale."""
    kind, whole = f"{result.counted}s", len(result)
    notes = [f"{len(shown)} of {whole} {kind} shown, evenly chosen" if len(shown) < whole else f"{whole} {kind}"]
    notes[0] += ", straight lines between them"
    duration = float(result.along_axis[-1] - result.along_axis[0])
    if result.axis == "time" and duration > 0:
        speed = duration / _seconds(result)
        notes.append("played in real time" if speed == 1 else f"played at {speed:.3g} times the real speed")
    return notes + thicker(factors)


def _view(span):
    """(yaw, pitch) of the first view, rad."""
    to_camera, right, _, _ = view_of(span)
    return [math.atan2(-right[0], right[1]), math.asin(np.clip(to_camera[2], -1, 1))]


def _field(result, channel, colour, values):
    peak = peak_of(result, colour, values)
    colour = seen(colour, values, peak)
    low, high = colour.limits(peak)
    return {
        "words": colour.words,
        "unit": colour.unit,
        "channel": channel,
        "map": colour.map,
        "low": low,
        "high": high,
        "peak": peak,
    }


# Maximum number of arrows and other signs; of those beyond it the file says how many are left out.
_MOST_SIGNS = 200


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
        shape = shapes[rods[rod]]
        return {"kind": mark.kind, "rod": rods[rod], "at": [s / rod.length * (shape.nodes - 1)], "end": end,
                "colour": COLOURS[GROUPS[mark.kind]], "girth": girth(station) * unit * shape.radius}  # fmt: skip

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
    drawn = np.cumsum([len(one.get("at", [0])) for one in found]) <= _MOST_SIGNS
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
