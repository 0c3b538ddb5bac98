"""Films of a motion: .gif by Pillow, a dependency of matplotlib, .mp4 by ffmpeg."""

import errno
import math
import shutil
import socket
import subprocess
import textwrap
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from cosserat_fenicsx.checks import number, positive, refuse
from cosserat_fenicsx.errors import LibraryMissing, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.numerics import spun
from cosserat_fenicsx.pictures.charts import asked
from cosserat_fenicsx.pictures.drawing import (
    add_bodies,
    add_lines,
    add_tubes,
    at_rest,
    body_of,
    colour_of,
    default_colour,
    frame,
    known,
    load_pyvista,
    move,
    peak_of,
    seen,
    stage,
    suited,
    thickening,
    thicker,
)
from cosserat_fenicsx.pictures.view import plain, round_step, seen_moving
from cosserat_fenicsx.ranks import Alone, on_first

#: Default frames per second, and width and height in pixels.
FPS, SIZE = 25, (960, 720)
# Least and largest duration (s) of a film in real time, largest duration (s) of others, and largest number of frames.
# A frame takes about 0.1 s to draw without a graphics card.
_SHORTEST_REAL_TIME, _LONGEST_REAL_TIME, _LONGEST, MOST_FRAMES = 2.0, 10.0, 5.0, 10_000
# Colours of a .gif with all channels above this become white, since quantisation leaves nearly white stains.
_WHITE = 244
# Segments along a rod; mean width of a letter of the title, pixels.
_PIECES, _LETTER = 100, 16


def film(history, file, *, fps=FPS, speed=None, magnify=1.0, enlarge=1.0, size=SIZE, color=None, progress=None,
         units="SI"):  # fmt: skip
    """See `History.animate`."""
    file = check_name(file)
    if len(history) < 2:
        raise SceneError(f"{file}: expected a history with at least two times")
    fps, size = frame_rate(file, fps), pixels(size)
    positive("animate", "magnify", magnify, "-")
    enlarged = Enlarged(history.scene, enlarge, "animate")
    colour = colour_of(color or default_colour(history, range(len(history))), known(history), "animate")
    duration = history.times[-1] - history.times[0]
    speed = _round_speed(duration) if speed is None else positive("animate", "speed", speed, "-")
    times = _times(history.times[0], duration, speed, fps)
    pace = _pace_in_words(speed)

    def prepared():
        with asked(units=units):
            return _Stage(history, times, magnify, enlarged, size, pace, colour)

    on_first(history.comm, lambda: record(prepared, file, times, fps, progress))


def check_name(file):
    """The name of a film as a Path; a SceneError for another ending, or where the program that writes it is missing."""
    file = Path(file)
    if file.suffix not in _WRITERS:
        raise SceneError(f"{file}: expected a name that ends in .gif or .mp4")
    _WRITERS[file.suffix].check()
    return file


def frame_rate(file, fps):
    """Frames per second of a film, checked; of a .gif such that the time between frames is a multiple of 0.01 s."""
    fps = number("animate", "fps", fps, "a number from 1 to 100", lambda x: 1 <= x <= 100)
    return 100 / round(100 / fps) if file.suffix == ".gif" else fps


def pixels(size):
    """(width, height) of a film, checked."""
    expected = "(width, height), even numbers of pixels from 100 to 4000"
    if not isinstance(size, tuple | list) or len(size) != 2:
        refuse("animate", "size", size, expected)
    for side in size:
        number("animate", "size", side, expected, lambda x: 100 <= x <= 4000 and x % 2 == 0)
    return int(size[0]), int(size[1])


def _round_speed(duration):
    """1 where a film in real time has a suitable duration (s), or the smallest round number that is fast enough."""
    if _SHORTEST_REAL_TIME <= duration <= _LONGEST_REAL_TIME:
        return 1.0
    return round_step(duration, _LONGEST)


def _times(start, duration, speed, fps):
    """The times (s) of the frames, the last one at the end."""
    step = speed / fps
    count = math.ceil(duration / step - 1e-6)
    if count > MOST_FRAMES:
        expected = f"one that needs at most {MOST_FRAMES} frames, not {count}: more, or fewer fps"
        refuse("animate", "speed", speed, expected)
    return start + np.append(step * np.arange(count), duration)


def _pace_in_words(speed):
    if speed == 1:
        return "real time"
    return f"{speed:g} times faster than real" if speed > 1 else f"{1 / speed:g} times slower than real"


def record(make_stage, file, times, fps, progress):
    """Draw and write all frames, on one rank. make_stage: function that returns the stage: `at(t)` is the picture
    (height, width, 3) at t, and `close()` frees it; file: .gif or .mp4, a Path; times: t of each frame; fps: frames per
    second; progress: as of `film`."""
    stage, stopped = make_stage(), None
    try:
        samples = [stage.at(t) for t in times[:: max(1, len(times) // 6)]]
        with (
            replaced(file) as fresh,
            _WRITERS[file.suffix](fresh, fps, samples[0].shape[1::-1], samples) as writer,
            Progress([len(times)], progress, Alone, "frame") as bar,
        ):
            bar.start(file.name)
            try:
                for i, t in enumerate(times):
                    obey()
                    writer.add(stage.at(t))
                    bar.reached(i + 1)
            except KeyboardInterrupt as stop:  # raised again once the frames so far are in the file
                stopped = stop
    finally:
        stage.close()
    if stopped:
        raise stopped


class _Stage:
    """The scene of the film: constant parts are drawn once, the mesh of the rods is moved for every frame."""

    def __init__(self, history, times, magnify, enlarged, size, pace, colour):
        pyvista = load_pyvista()
        self._between, self._magnify, self._pace = Between(history, colour), magnify, pace
        self._x, self._enlarged = np.linspace(0, 1, _PIECES + 1), enlarged
        self._digits = max(0, 2 - math.floor(math.log10(times[-1] - times[0])))
        resting = at_rest(history.scene)
        bodies = [self._bodies(t) for t in times]
        everywhere = np.concatenate([*resting, *(body.line for made in bodies for body in made)])
        extent = float(np.ptp(everywhere, axis=0).max())
        values = [body.values for made in bodies for body in made]
        peak = peak_of(history, colour, values)
        colour = seen(colour, values, peak)
        self._scale, _ = suited(peak, colour.unit)
        self._plotter = stage(pyvista, size)
        self._factors = [thickening(body, extent, len(bodies[0])) for body in bodies[0]]
        self._mesh = add_bodies(self._plotter, pyvista, bodies[0], self._factors, peak, colour, moving=True)
        drawn = zip(history.scene.rods, bodies[0], self._factors, strict=True)
        radii = {rod: factor * body.radius for rod, body, factor in drawn}
        add_tubes(self._plotter, pyvista, history.scene, radii, enlarged.factor)
        add_lines(self._plotter, pyvista, resting, "lightgrey")
        self._head, self._letters = history.scene.title or "Motion", size[0] // _LETTER
        self._notes = self._not_to_scale()
        moved = [body.line - first.line for made in bodies for body, first in zip(made, bodies[0], strict=True)]
        frame(self._plotter, everywhere, span=seen_moving(np.ptp(everywhere, axis=0), np.concatenate(moved)))

    def _bodies(self, t):
        return self._enlarged.bodies(self._between.bodies(t, self._x, self._magnify), self._x)

    def _not_to_scale(self):
        notes = [f"displacements magnified {self._magnify:g} times"] if self._magnify != 1 else []
        notes += self._enlarged.note
        notes += thicker(self._factors)
        if self._between.smooth < 1:
            notes.append("saved too seldom to be smooth")
        return "".join(f"\n{note}" for note in notes)

    def at(self, t):
        """(height, width, 3) the picture at t (s)."""
        move(self._mesh, self._bodies(t), self._factors, self._scale)
        text = f"{self._head}: t = {t:.{self._digits}f} s ({self._pace}){self._notes}"
        self._plotter.add_text(
            plain("\n".join(textwrap.fill(line, self._letters) for line in text.split("\n"))),
            position="upper_edge",
            color="black",
            font_size=10,
            name="time",
        )
        return self._plotter.screenshot(return_img=True)

    def close(self):
        self._plotter.close()


class _Gif:
    """Writes frames to a .gif with the colours of some frames, undithered: small and reproducible byte by byte."""

    def __init__(self, file, fps, size, samples):
        self._file, self._pause, self._frames, image = file, round(1000 / fps), [], _pillow()
        self._kind, self._plain = image.fromarray, image.Dither.NONE
        self._palette = self._kind(np.concatenate(samples)).quantize(255, dither=self._plain)
        colours = np.reshape(self._palette.getpalette(), (-1, 3))
        colours[colours.min(axis=1) > _WHITE] = 255
        self._palette.putpalette(colours.ravel().tolist())

    @staticmethod
    def check():
        _pillow()

    def __enter__(self):
        return self

    def add(self, picture):
        self._frames.append(self._kind(picture).quantize(palette=self._palette, dither=self._plain))

    def __exit__(self, *exception):
        if self._frames:
            first, *others = self._frames
            first.save(self._file, save_all=True, append_images=others, duration=self._pause, loop=0, optimize=False)


def _pillow():
    try:
        from PIL import Image
    except ImportError:
        raise LibraryMissing("films as .gif need Pillow: pip install 'cosserat-fenicsx[pictures]'") from None
    return Image


class _Mp4:
    """Writes frames to a .mp4 (H.264) by ffmpeg; the file does not depend on the date or the machine's name."""

    def __init__(self, file, fps, size, samples):
        command = [_ffmpeg(), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
                   "-s", f"{size[0]}x{size[1]}", "-r", f"{fps:g}", "-i", "-", "-an", "-c:v", "libx264", "-threads", "1",
                   "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-fflags", "+bitexact",
                   "-flags:v", "+bitexact", "-map_metadata", "-1", str(file)]  # fmt: skip
        self._file = file
        # A socket instead of a pipe, since PETSc ends the process on the SIGPIPE of a pipe to a dead ffmpeg. A session
        # of its own, so that Ctrl-C does not kill ffmpeg, which completes the file.
        self._socket, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                command, stdin=theirs, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
            )

    @staticmethod
    def check():
        _ffmpeg()

    def __enter__(self):
        return self

    def add(self, picture):
        try:
            self._socket.sendall(np.ascontiguousarray(picture), socket.MSG_NOSIGNAL)
        except OSError:
            self._end()
            raise

    def __exit__(self, kind, *exception):
        if kind is None:
            self._end()
        else:
            self._socket.close()
            self._process.kill()
            self._process.wait()

    def _end(self):
        """Wait for ffmpeg; raise its message where it failed."""
        self._socket.close()
        _, said = self._process.communicate()
        if self._process.returncode:
            words = said.decode(errors="replace").strip().splitlines() or ["it gave no reason"]
            raise OSError(errno.EIO, f"ffmpeg could not write the film: {words[-1]}", str(self._file)) from None


def _ffmpeg():
    """The path of ffmpeg: from imageio-ffmpeg, else the system's."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        found = shutil.which("ffmpeg")
    if found is None:
        raise LibraryMissing(
            "films as .mp4 need ffmpeg: pip install 'cosserat-fenicsx[films]', or apt install ffmpeg; a .gif needs "
            "neither"
        )
    return found


_WRITERS = {".gif": _Gif, ".mp4": _Mp4}


# Error of the trapezoidal rule on the velocities of an interval up to which interpolation is cubic: relative to the
# change of position (a full turn saved six times is within it), or as an invisible share of the longest rod.
_AGREEMENT, _INVISIBLE = 0.1, 2e-3


class Between:
    """A `History` at any time of its duration, with a `Colour` whose values are interpolated linearly. Between two
    saved states, positions and quaternions are cubic Hermite polynomials by the values and velocities there. Where the
    velocities do not agree with the change of position, because states were saved too seldom, interpolation is linear,
    and where a section turns by more than half a turn the nearest state is taken."""

    def __init__(self, history, colour):
        self._history, self._times, self._colour = history, history.times, colour
        self._saved = lru_cache(maxsize=2)(self._read)  # few: all states of a stored motion may exceed the memory
        self._smooth = [self._fits(k) for k in range(len(history) - 1)]

    def _read(self, k):
        """r and q of the saved state k, (N, 7), and their rates, (N, 7), 1/s."""
        record = self._history._records[k]
        rates = record.rates / self._history.time_unit
        return record.rq, np.concatenate([rates[:, :3], spun(record.rq[:, 3:], rates[:, 3:])], axis=1)

    @property
    def smooth(self):
        """The share of the duration where states were saved often enough for cubic interpolation."""
        steps = np.diff(self._times)
        return float(steps[self._smooth].sum() / steps.sum())

    def bodies(self, t, x, magnify=1.0):
        """The `Body` of every rod at t (s), at arc lengths x (n,) over its length."""
        k = int(np.clip(np.searchsorted(self._times, t, side="right") - 1, 0, len(self._times) - 2))
        h = self._times[k + 1] - self._times[k]
        z = float(np.clip((t - self._times[k]) / h, 0.0, 1.0))
        state, history = SimpleNamespace(rq=self._state(k, z, h)), self._history
        made = []
        for rod in history.scene.rods:
            line, directors = history.sample(state, rod, x)
            values = []
            for i in (k, k + 1):
                fields = history.fields(i, rod)
                values.append(np.interp(x, fields["s"] / rod.length, self._colour.of(fields)))
            made.append(body_of(rod, x, line, directors, (1 - z) * values[0] + z * values[1], magnify))
        return made

    def _fits(self, k):
        """Whether the change of position agrees with the velocities between the saved states k and k + 1."""
        h = self._times[k + 1] - self._times[k]
        (one, slope), (two, slope_there) = self._saved(k), self._saved(k + 1)
        moved, before, after = two - one, h * slope, h * slope_there
        for part in (slice(0, 3), slice(3, 7)):
            off, *sizes = (
                np.linalg.norm(v[:, part], axis=1).max() for v in ((before + after) / 2 - moved, before, after, moved)
            )
            if off > _AGREEMENT * max(sizes) + _INVISIBLE:
                return False
        return True

    def _state(self, k, z, h):
        """(N, 7) r and q at the share z in [0, 1] of the interval k, of length h (s)."""
        (one, slope), (two, slope_there) = self._saved(k), self._saved(k + 1)
        if self._smooth[k]:
            slopes = z * (1 - z) ** 2 * h * slope - z**2 * (1 - z) * h * slope_there
            return (1 + 2 * z) * (1 - z) ** 2 * one + z**2 * (3 - 2 * z) * two + slopes
        if (np.einsum("ni,ni->n", one[:, 3:], two[:, 3:]) <= 0).any():
            return two if z >= 0.5 else one
        return (1 - z) * one + z * two


class Enlarged:
    """Enlarges the clearance of rods in the holes of a scene, for pictures, by a factor of the distance between the
    axes of the hole and of a rod; rods without a wall stay as they are. where: the called function, for messages."""

    def __init__(self, scene, factor, where):
        self.factor = positive(where, "enlarge", factor, "-")
        self._walls = {}
        for wall in (action for action in scene.loads if action.touches):
            for rod in scene.rods:
                if wall.acts_on(rod) if wall.station is None else wall.station.rod is rod:
                    self._walls.setdefault(rod, wall)
        self._scene = scene
        if self.factor != 1 and not self._walls:
            refuse(where, "enlarge", factor, "1, since no rod is in a hole with a wall of motions, such as a HoleWall")

    def bodies(self, bodies, x):
        """The `Body` of every rod with its line moved off the axis of its hole; x: (n,) arc lengths over its length."""
        if self.factor == 1:
            return bodies
        return [self._moved(rod, body, x) for rod, body in zip(self._scene.rods, bodies, strict=True)]

    def _moved(self, rod, body, x):
        wall = self._walls.get(rod)
        if wall is None:
            return body
        s = np.asarray(x) * rod.length
        axis = wall.path.nearest(body.line, s + wall.begins).position
        return replace(body, line=axis + self.factor * (body.line - axis))

    @property
    def note(self):
        """A line for the picture, or none."""
        return [f"distances from the axis of the hole enlarged {self.factor:g} times"] if self.factor != 1 else []
