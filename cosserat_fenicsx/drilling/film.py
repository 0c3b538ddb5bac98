"""A film of a drill-string in motion, by matplotlib: the string from the side, a quantity along it and over time."""

import math

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.drilling.charts import (
    BIT,
    DRIVE,
    MAPPED,
    lower_end,
    moves_along,
    times_between,
    title_of,
    velocity_of_block,
)
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.animation import MOST_FRAMES, check_name, frame_rate, record
from cosserat_fenicsx.pictures.charts import arrange, empty_figure, legend, scale, styled
from cosserat_fenicsx.ranks import on_first, world

# Longest film, s, where no speed is asked for; pixels across the string and along it; dots per inch; bands along a
# string that moves along the axis.
_LONGEST, _ACROSS, _ALONG, _DPI, _IN_BANDS = 10.0, 60, 400, 100, 20


def film(history, file, speed=None, fps=25, progress=None):
    """See `DrillingHistory.animate`."""
    file = check_name(file)
    times_between("animate", history.profile_times, None)
    fps = frame_rate(file, fps)
    first, last = history.profile_times[[0, -1]]
    speed = max(1.0, (last - first) / _LONGEST) if speed is None else positive("animate", "speed", speed, "-")
    count = int(np.ceil((last - first) * fps / speed)) + 1
    if count > MOST_FRAMES:
        raise SceneError(
            f"animate.speed = {speed:g}: expected one that needs at most {MOST_FRAMES} frames, not {count}"
        )
    times = np.linspace(first, last, count)
    on_first(world(), lambda: record(lambda: Stage(history, speed), file, times, fps, progress))


class Stage:
    """The picture at a time; the constant parts are drawn once. The string is seen from the side: its nearer half has a
    bright stripe along it; where it moves along the axis, its bands move with it."""

    def __init__(self, history, speed):
        self._history, self._speed = history, speed
        self._along = moves_along(history)
        with styled():
            self._figure = self._constant_parts(history)

    def _constant_parts(self, history):
        figure = empty_figure(9.6, 6.0)
        figure.set_dpi(_DPI)
        string, along, over = figure.subplots(1, 3, width_ratios=(0.35, 1.0, 2.0))
        top, bottom = history.depths[[0, -1]]
        self._places = np.linspace(top, bottom, _ALONG)
        self._across = np.arcsin(np.linspace(-1, 1, _ACROSS) * 0.999)  # round a string that is seen from the side
        if self._along:  # the largest displacement is drawn about as long as two bands
            self._band = (bottom - top) / _IN_BANDS
            largest = max(float(np.nanmax(np.abs(history.displacement))), 1e-9)
            self._enlarge = float(f"{max(1.0, 2 * self._band / largest):.1g}")
        blank, box = np.zeros((_ALONG, _ACROSS)), (0, 1, bottom, top)
        self._stripes = string.imshow(blank, extent=box, aspect="auto", cmap="gray", vmin=-0.4, vmax=1.2)
        string.set(xticks=[], ylabel="measured depth (m)", title="string")
        quantity = MAPPED["velocity" if self._along else "speed"][0]
        heading, self._size = scale(quantity)
        values = self._shown() / self._size
        (self._line,) = along.plot(values[0], history.depths, color="tab:purple")
        (self._held,) = along.plot([], [], ".", color="0.6", markersize=4, label="held by friction")
        low, high = float(min(np.nanmin(values), 0.0)), float(np.nanmax(values))
        room = 0.05 * max(high - low, 1.0 if not self._along else 1e-3)
        along.set(xlim=(low - room, high + room), ylim=(bottom, top), xlabel=heading, yticklabels=[])
        if history.sticking.any():
            legend(along)
        for at_ends, label, colour in self._over_time():
            over.plot(history.times, at_ends / self._size, color=colour, label=label, linewidth=1.0)
        over.set(xlabel="time (s)", ylabel=heading, xlim=(0, history.times[-1]))
        legend(over)
        self._now = over.axvline(0.0, color="black", linewidth=0.8)
        string.grid(visible=False)
        figure.suptitle(self._title(float(history.profile_times[0])))
        arrange(figure)
        figure.set_layout_engine("none")  # found once: it would take half of the time of each frame
        return figure

    def _shown(self):
        """(k, m) what is drawn along the string, and moves it."""
        return self._history.velocity if self._along else self._history.speed

    def _over_time(self):
        """[(values over time at an end, label, colour)]."""
        history, lower = self._history, lower_end(self._history)
        if self._along:
            block = velocity_of_block(history, history.times)
            return (block, "block", DRIVE), (history.bit_velocity, lower, BIT)
        return (history.drive_speed, "drive", DRIVE), (history.bit_speed, lower, BIT)

    def at(self, t):
        """(height, width, 3) the picture at t (s)."""
        history = self._history
        k = int(np.clip(np.searchsorted(history.profile_times, t) - 1, 0, len(history.profile_times) - 2))
        begin, end = history.profile_times[k : k + 2]
        share = (t - begin) / (end - begin)
        by = history.displacement * self._enlarge if self._along else history.angle
        moved, values = ((1 - share) * x[k] + share * x[k + 1] for x in (by, self._shown() / self._size))
        moved = np.interp(self._places, history.depths, moved)[:, None]
        if self._along:
            bright = np.cos(2 * math.pi / self._band * (self._places[:, None] - moved)) + 0 * self._across
        else:
            bright = np.cos(moved + self._across)
        self._stripes.set_data(np.cos(self._across) * np.where(bright > 0.0, 1.0, 0.25))
        self._line.set_xdata(values)
        held = history.sticking[k + round(share)]
        self._held.set_data(values[held], history.depths[held])
        self._now.set_xdata([t, t])
        self._figure.suptitle(self._title(t))
        self._figure.canvas.draw()
        return np.asarray(self._figure.canvas.buffer_rgba())[..., :3].copy()

    def _title(self, t):
        pace = "real time" if self._speed == 1 else f"{self._speed:.3g} times faster than real"
        moved = f"; displacements drawn {self._enlarge:g} times their size" if self._along else ""
        return f"{title_of(self._history)}\nt = {t:.2f} s ({pace}){moved}"

    def close(self):
        """Nothing to free."""
