"""Pictures and films of shapes about an equilibrium: modes of buckling and of natural vibrations."""

import math
import textwrap
from collections.abc import Collection
from functools import lru_cache

import numpy as np

from cosserat_fenicsx.checks import number, positive, refuse
from cosserat_fenicsx.pictures.animation import MOST_FRAMES, check_name, frame_rate, pixels, record
from cosserat_fenicsx.pictures.drawing import (
    add_lines,
    body_of,
    coloured,
    frame,
    load_pyvista,
    move,
    places,
    stage,
    thickening,
    thicker,
)
from cosserat_fenicsx.pictures.plot import deliver
from cosserat_fenicsx.pictures.view import seen_moving, view_of
from cosserat_fenicsx.ranks import on_first

# Panels of a picture, and in a row of it.
_MOST_PANELS, _IN_A_ROW = 6, 3
# Width of a panel, its least and largest height, height of the bar of colours, of a line of the title, pixels.
_WIDTH, _HEIGHTS, _BAR_ROW, _LINE = 640, (560, 680), 60, 38
# Largest rotation that is drawn, as the tangent of its angle.
_STEEPEST = 1.0
# Largest displacement in a picture, over the structure's size, that could not be seen; least share of it that moves.
_SEEN, _MOVES = 0.02, 0.2
# Displacement of a rod over its length and its rotation, below which it only twists.
_IN_PLACE = 0.01
# Memory for frames of a film, which are drawn once, bytes.
_MEMORY = 200_000_000
# Phases, as exp(i phase), that a picture has to hold.
_EXTREMES = (1, -1, 1j, -1j)
# Of sizes of the motion, from none to the largest, which stands out beside rods at rest.
_COLOURS = ["#86a0bd", "#d9b29c", "#f08a4b", "#d63a2a", "#8c0c1e"]
# Mean width of a letter of the titles, pixels.
_LETTER = 15


def draw(found, file, which, amplitude, units):
    """Picture of some shapes, a panel each; see `Shapes.plot`."""
    found.require_modes(file)
    positive("plot", "amplitude", amplitude, "-")
    which = range(min(len(found), _MOST_PANELS)) if which is None else which
    if not isinstance(which, Collection) or not 1 <= len(which) <= _MOST_PANELS:
        refuse("plot", "which", which, f"a list of the numbers of one to {_MOST_PANELS} modes")
    shown = [found.number(k) for k in which]
    return deliver(found.comm, file, lambda: _panels(found, shown, amplitude), units)


def film(found, file, k, *, fps, seconds, cycles, amplitude, size, progress):
    """Film of one shape that swings to both sides; see `Shapes.animate`."""
    file = check_name(file)
    found.require_modes(file)
    k, size, fps = found.number(k), pixels(size), frame_rate(file, fps)
    number("animate", "seconds", seconds, "a number from 0.2 to 60", lambda x: 0.2 <= x <= 60)
    positive("animate", "amplitude", amplitude, "-")
    repeats = file.suffix == ".gif"
    cycles = (1 if repeats else 3) if cycles is None else cycles
    if isinstance(cycles, bool) or not isinstance(cycles, int) or not 1 <= cycles <= 100:
        refuse("animate", "cycles", cycles, "a whole number from 1 to 100")
    frames = 2 * max(2, round(fps * seconds / 2))  # even: the frame in the middle is the opposite of the first
    if frames * cycles > MOST_FRAMES:
        refuse("animate", "cycles", cycles, f"fewer: at most {MOST_FRAMES} frames, not {frames * cycles}")
    shares = np.exp(2j * math.pi * np.arange(frames * cycles) / frames)
    if not np.iscomplexobj(found.shapes):  # it swings to and fro
        shares = shares.real
    shares = np.round(shares, 12)  # equal ones are drawn once
    on_first(found.comm, lambda: record(lambda: _Stage(found, k, amplitude, size), file, shares, fps, progress))


class Drawn:
    """The k-th of `Shapes` as it is drawn: scaled, about its equilibrium, with displacements up to `amplitude`, a share
    of the structure's size; smaller with large rotations: the tangent of the largest is `_STEEPEST`. factor: of
    displacements and rotations; note: how large they are drawn, in words."""

    def __init__(self, found, k, amplitude):
        rods, self._x = found.scene.rods, places(len(found.scene.rods))
        self._rest = [(rod, *found.equilibrium.sample(rod, self._x)) for rod in rods]
        self._motions = [found.equilibrium.between(rod, self._x, found.shapes[k]) for rod in rods]
        self.lines = [line for _, line, _ in self._rest]
        size = float(np.ptp(np.concatenate(self.lines), axis=0).max())
        moved, turned = (np.linalg.norm(found.shapes[k, :, part], axis=1).max() for part in (slice(0, 3), slice(3, 6)))
        self.factor = min(amplitude * size / (moved or 1e-300), _STEEPEST / (turned or 1e-300))
        share = self.factor * moved / size
        self.by_turning = found.twists(k) or (share < _SEEN and self._turns_in_place())
        self._peak = turned if self.by_turning else moved
        if self.by_turning:
            angle = math.degrees(math.atan(self.factor * turned))
            self.note = f"largest rotation drawn as {angle:.0f} degrees"
        else:
            self.note = f"largest displacement drawn as {100 * share:.2g} % of the structure's size"
        self._unseen = not self.by_turning and share < _SEEN
        if self._unseen:
            self.note += ", around the rods that move"

    def _turns_in_place(self):
        """Whether the rod that turns most turns about its own axis, which hardly moves."""
        sizes = [[np.linalg.norm(motion[:, part], axis=1).max() for part in (slice(0, 3), slice(3, 6))]
                 for motion in self._motions]  # fmt: skip
        k = int(np.argmax([turned for _, turned in sizes]))
        return sizes[k][0] < _IN_PLACE * sizes[k][1] * self._rest[k][0].length

    def bodies(self, share=1.0):
        """The `Body` of every rod, displaced by `share` of the amplitude, from -1 to 1, or exp(i phase) of a complex
        mode. Its values, in the place of the bending moment, are displacements (rotations, where nothing is displaced),
        1 at most."""
        made = []
        for (rod, line, frames), whole in zip(self._rest, self._motions, strict=True):
            motion = np.real(share * whole)
            moved, turned = motion[:, :3], motion[:, 3:]
            values = np.linalg.norm(turned if self.by_turning else moved, axis=1) / self._peak
            directors = _turned(frames, self.factor * turned)
            made.append(body_of(rod, self._x, line + self.factor * moved, directors, values))
        return made

    def shown(self, everywhere):
        """The points (n, 3) of `everywhere` that a picture shows: of rods whose motion could not be seen in all."""
        if not self._unseen:
            return everywhere
        rods = zip(self.lines, *(self.bodies(share) for share in _EXTREMES), strict=True)
        moving = [(line, *bodies) for line, *bodies in rods if max(body.values.max() for body in bodies) > _MOVES]
        return np.concatenate([points for line, *bodies in moving for points in (line, *(x.line for x in bodies))])

    def everywhere(self):
        """(n, 3) points of the equilibrium and of the shape on both sides."""
        return np.concatenate([*self.lines, *(body.line for share in _EXTREMES for body in self.bodies(share))])


def _turned(frames, slopes):
    """Frames (n, 3, 3) rotated about `slopes` (n, 3) by angles of these tangents: sections stay across a drawn line."""
    sizes = np.linalg.norm(slopes, axis=1)
    angles = np.arctan(sizes)
    axes = slopes / np.maximum(sizes, 1e-300)[:, None]
    cos, sin = np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    around = np.cross(axes[:, None, :], frames.transpose(0, 2, 1)).transpose(0, 2, 1)
    along = axes[:, :, None] * np.einsum("ni,nij->nj", axes, frames)[:, None, :]
    return cos * frames + sin * around + (1 - cos) * along


def _panels(found, shown, amplitude):
    pyvista = load_pyvista()
    across = len(shown) if len(shown) <= _IN_A_ROW else _IN_A_ROW if len(shown) > 4 else 2
    down = math.ceil(len(shown) / across)
    drawn = [Drawn(found, k, amplitude) for k in shown]
    everywhere = np.concatenate([shape.everywhere() for shape in drawn])
    span = _span(found, shown, everywhere)
    panel = _height(everywhere, span)
    width = across * _WIDTH
    head = _head(found, width)
    top = _LINE * (head.count("\n") + 1) + _BAR_ROW
    height = down * panel + top
    plotter = stage(  # not with supersampling, which leaves all panels but one black
        pyvista, (width, height), border=False, shape=(down + 1, across),
        row_weights=[top, *[panel] * down], groups=[(0, slice(None))],
    )  # fmt: skip
    plotter.subplot(0, 0)
    plotter.add_text(head, position="upper_edge", color="black", font_size=14)
    for i, (k, shape) in enumerate(zip(shown, drawn, strict=True)):
        plotter.subplot(1 + i // across, i % across)
        seen = shape.shown(everywhere)
        bodies = shape.bodies()
        mapper = _add(plotter, pyvista, shape, bodies, seen)[2]
        text = f"{_filled(f'k = {k}: {found.label(k)}{_most_at(found, k, shape)}', _WIDTH)}\n"
        text += _below(shape, bodies, seen, _WIDTH)
        plotter.add_text(text, position="upper_edge", color="black", font_size=11)
        frame(plotter, seen, panel=True, span=span)
    plotter.subplot(0, 0)
    low, size = (_BAR_ROW - _LINE) / top, {"width": 0.2, "height": _LINE / top}
    plotter.add_scalar_bar("", mapper=mapper, n_labels=0, vertical=False, position_x=0.4, position_y=low, **size)
    for words, x in (("no motion", 0.4 - 140 / width), ("largest", 0.6 + 20 / width)):
        plotter.add_text(words, position=(x, low), color="black", font_size=11, viewport=True)
    return plotter


def _most_at(found, k, shape):
    """Where a mode moves most, in words; nothing of one rod alone, or of rods that turn."""
    shown = len(found.scene.rods) > 1 and not shape.by_turning
    return f", most at {found.farthest(k)[0]}" if shown else ""


def _span(found, modes, everywhere):
    """(3,) the extents that decide on the view of points (n, 3), m, see `seen_moving`, so that all modes are seen."""
    span = np.ptp(everywhere, axis=0)
    for k in modes:
        span = seen_moving(span, np.abs(found.shapes[k][:, :3]))
    return span


def _height(everywhere, span):
    """The height of a panel that suits a drawing of points (n, 3), pixels; span: see `_span`."""
    _, right, above, _ = view_of(span)
    across, high = np.ptp(everywhere @ right), np.ptp(everywhere @ above)
    return int(np.clip(_WIDTH * high / max(across, 1e-9 * high), *_HEIGHTS))


def _head(found, width):
    at = f" about the equilibrium at the load factor {found.load_factor:g}" if found.load_factor else ""
    what = f"{found.scene.title}: {found.title.lower()}" if found.scene.title else found.title
    return textwrap.fill(f"{what}{at}", width // _LETTER)


def _below(shape, bodies, everywhere, width):
    """The lines under a title: notes on what is not to scale."""
    extent = float(np.ptp(everywhere, axis=0).max())
    notes = [shape.note, *thicker(_factors(bodies, extent))]
    return "\n".join(_filled(note, width) for note in notes)


def _factors(bodies, extent):
    """What the sections of each body are enlarged by: the few that move are drawn thicker than the many that do not."""
    moves = [body.values.max() > _MOVES for body in bodies]
    return [thickening(body, extent, sum(moves) if it else len(bodies)) for body, it in zip(bodies, moves, strict=True)]


def _filled(text, width):
    """A text of a panel of a width, pixels, in lines that fit it."""
    return textwrap.fill(text, round(width / _LETTER * 1.2), break_long_words=False)


def _add(plotter, pyvista, shape, bodies, everywhere):
    """Draw the equilibrium as grey lines, and rods; returns the mesh of the rods, what enlarges each of them, and the
    mapper of their colours."""
    from matplotlib.colors import LinearSegmentedColormap

    extent = float(np.ptp(everywhere, axis=0).max())
    factors = _factors(bodies, extent)
    surface = coloured(pyvista, bodies, factors)
    colours = LinearSegmentedColormap.from_list("", _COLOURS)
    actor = plotter.add_mesh(surface, scalars="value", cmap=colours, clim=(0, 1), show_scalar_bar=False)
    add_lines(plotter, pyvista, shape.lines)
    return surface, factors, actor.mapper


class _Stage:
    """The scene of a film: `at(share)` is the picture (height, width, 3) at a share of the amplitude, see `Drawn`."""

    def __init__(self, found, k, amplitude, size):
        pyvista = load_pyvista()
        self._shape = Drawn(found, k, amplitude)
        self._everywhere = self._shape.shown(self._shape.everywhere())
        bodies = self._shape.bodies()
        self._plotter = stage(pyvista, size)
        self._surface, self._factors, _ = _add(self._plotter, pyvista, self._shape, bodies, self._everywhere)
        colours = textwrap.fill("no motion is pale blue, the largest dark red", size[0] // _LETTER)
        text = f"{_head(found, size[0])}\n{colours}\nk = {k}: {found.label(k)}{_most_at(found, k, self._shape)}\n"
        text += _below(self._shape, bodies, self._everywhere, size[0])
        self._plotter.add_text(text, position="upper_edge", color="black", font_size=10)
        frame(self._plotter, self._everywhere, panel=True, span=_span(found, [k], self._everywhere))
        self.at = lru_cache(maxsize=max(1, _MEMORY // (3 * size[0] * size[1])))(self._draw)

    def _draw(self, share):
        move(self._surface, self._shape.bodies(share), self._factors)
        self._plotter.render()
        return self._plotter.screenshot(return_img=True)

    def close(self):
        self.at.cache_clear()  # the frames and the stage refer to each other
        self._plotter.close()
