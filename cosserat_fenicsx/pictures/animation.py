"""Films of a motion: .gif by Pillow, a dependency of matplotlib, .mp4 by ffmpeg."""

import errno
import math
import shutil
import socket
import subprocess
import textwrap
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import number, positive, refuse
from cosserat_fenicsx.errors import LibraryMissing, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.pictures.between import Between
from cosserat_fenicsx.pictures.drawing import add_body, at_rest, frame, load_pyvista, points_of, prefix, thickening
from cosserat_fenicsx.pictures.enlarged import Enlarged
from cosserat_fenicsx.pictures.labels import plain
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.ranks import Alone, on_first
from cosserat_fenicsx.results.export.beside import replaced

#: Default frames per second, and width and height in pixels.
FPS, SIZE = 25, (960, 720)
# Least and largest duration (s) of a film in real time, largest duration (s) of others, and largest number of frames.
# A frame takes about 0.1 s to draw without a graphics card.
_SHORTEST_REAL_TIME, _LONGEST_REAL_TIME, _LONGEST, MOST_FRAMES = 2.0, 10.0, 5.0, 10_000
# Colours of a .gif whose channels are all above this become white: quantisation would give nearly white stains.
_WHITE = 244
# Segments along a rod; mean width of a letter of the title, pixels.
_PIECES, _LETTER = 100, 16


def film(history, file, *, fps=FPS, speed=None, magnify=1.0, enlarge=1.0, size=SIZE, progress=None):
    """Write a film of the rods, coloured by bending moment; the camera is fixed and shows the whole motion.

    Frames come at a constant rate, interpolated between the saved times (`between.Between`).

    Args:
        history: a `History` with at least two times.
        file: .gif or .mp4 (rank 0 writes). The time between frames of a .gif is rounded to 0.01 s.
        fps: frames per second, 1 to 100.
        speed: seconds of the motion per second of the film; None for 1 where the film then takes 2 to 10 s, and
            otherwise for 1, 2 or 5 times a power of ten.
        magnify: factor on displacements.
        enlarge: factor on distances from the axes of the holes that rods are in, and on their clearances.
        size: (width, height), pixels, even.
        progress: True, False, or None for a bar on long runs in a terminal.

    Raises:
        SceneError: fewer than two times, another ending, an argument outside its range, or pyvista, Pillow or ffmpeg is
            missing: says what to install.
        OSError: the file cannot be written.
        KeyboardInterrupt: Ctrl-C; the film ends with the frames drawn so far.
    """
    file = check_name(file)
    if len(history) < 2:
        raise SceneError(f"{file}: expected a history with at least two times")
    fps = number("animate", "fps", fps, "a number from 1 to 100", lambda x: 1 <= x <= 100)
    positive("animate", "magnify", magnify, "-")
    enlarged = Enlarged(history.scene, enlarge, "animate")
    width, height = pixels(size)
    if file.suffix == ".gif":
        fps = 100 / round(100 / fps)
    duration = history.times[-1] - history.times[0]
    speed = _round_speed(duration) if speed is None else positive("animate", "speed", speed, "-")
    times = _times(history.times[0], duration, speed, fps)
    pace = _pace_in_words(speed)
    on_first(
        history.comm,
        lambda: record(
            lambda: _Stage(history, times, magnify, enlarged, (width, height), pace), file, times, fps, progress
        ),
    )


def check_name(file):
    """The name of a film as a Path.

    Raises:
        SceneError: an ending other than .gif and .mp4, or the program that writes it is missing.
    """
    file = Path(file)
    if file.suffix not in _WRITERS:
        raise SceneError(f"{file}: expected a name that ends in .gif or .mp4")
    _WRITERS[file.suffix].check()
    return file


def pixels(size):
    """(width, height) of a film, checked."""
    expected = "(width, height), even numbers of pixels from 100 to 4000"
    if not isinstance(size, tuple | list) or len(size) != 2:
        refuse("animate", "size", size, expected)
    for side in size:
        number("animate", "size", side, expected, lambda x: 100 <= x <= 4000 and x % 2 == 0)
    return int(size[0]), int(size[1])


def _round_speed(duration):
    """1 where a film in real time has a suitable duration (s), or the smallest round number that makes it short
    enough."""
    if _SHORTEST_REAL_TIME <= duration <= _LONGEST_REAL_TIME:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(duration / _LONGEST))
    return next(x * decade for x in (1, 2, 5, 10) if duration / (x * decade) <= _LONGEST * (1 + 1e-9))


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
    """Draw and write all frames, on one rank.

    Args:
        make_stage: function that returns the stage: `at(t)` is the picture (height, width, 3) at t, and `close()` frees
            it.
        file: .gif or .mp4, a Path; times: t of each frame; fps: frames per second; progress: as of `film`.

    Raises:
        OSError: the file cannot be written.
        KeyboardInterrupt: Ctrl-C; the film ends with the frames drawn so far.
    """
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
    """The scene of the film: constant parts are drawn once, meshes of the rods are moved for every frame."""

    def __init__(self, history, times, magnify, enlarged, size, pace):
        pyvista = load_pyvista()
        self._between, self._magnify, self._pace = Between(history), magnify, pace
        self._x, self._enlarged = np.linspace(0, 1, _PIECES + 1), enlarged
        self._digits = max(0, 2 - math.floor(math.log10(times[-1] - times[0])))
        resting = at_rest(history.scene)
        bodies = [self._bodies(t) for t in times]
        everywhere = np.concatenate([*resting, *(body.line for made in bodies for body in made)])
        extent = float(np.ptp(everywhere, axis=0).max())
        peak = max(body.values.max() for made in bodies for body in made)
        self._scale, _ = prefix(peak)
        self._plotter = pyvista.Plotter(off_screen=True, window_size=size)
        self._plotter.set_background("white")
        self._plotter.enable_anti_aliasing("msaa")
        self._factors = [thickening(body, extent) for body in bodies[0]]
        self._meshes = [
            add_body(self._plotter, pyvista, body, factor, peak, moving=True)
            for body, factor in zip(bodies[0], self._factors, strict=True)
        ]
        radii = [factor * body.radius for body, factor in zip(bodies[0], self._factors, strict=True)]
        enlarged.add_holes(self._plotter, pyvista, radii)
        for line in resting:
            self._plotter.add_mesh(pyvista.lines_from_points(line), color="lightgrey", line_width=2)
        self._head, self._letters = history.scene.title or "Motion", size[0] // _LETTER
        self._notes = self._not_to_scale()
        frame(self._plotter, everywhere)

    def _bodies(self, t):
        return self._enlarged.bodies(self._between.bodies(t, self._x, self._magnify), self._x)

    def _not_to_scale(self):
        notes = [f"displacements magnified {self._magnify:g} times"] if self._magnify != 1 else []
        notes += self._enlarged.note
        thicker = sorted({f"{float(f'{factor:.2g}'):g}" for factor in self._factors if factor > 1})
        notes += [f"sections drawn {' and '.join(thicker)} times their size"] if thicker else []
        if self._between.smooth < 1:
            notes.append("saved too seldom to be smooth")
        return "".join(f"\n{note}" for note in notes)

    def at(self, t):
        """(height, width, 3) the picture at t (s)."""
        for mesh, body, factor in zip(self._meshes, self._bodies(t), self._factors, strict=True):
            mesh.points[:] = points_of(body, factor)
            mesh["value"][:] = np.repeat(body.values / self._scale, body.outline.shape[1])
            mesh.GetPoints().Modified()
            mesh.GetPointData().GetScalars().Modified()
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
    """Writes frames to a .gif with the colours of some sample frames, undithered: small and reproducible byte by
    byte."""

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
    """The path of ffmpeg: that of imageio-ffmpeg, else the system's."""
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
