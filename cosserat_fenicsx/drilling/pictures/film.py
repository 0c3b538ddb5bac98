"""Films of a drill-string that turns: a line painted along it, its speed over depth, and drive and bit over time."""

import numpy as np

from cosserat_fenicsx.checks import number, positive
from cosserat_fenicsx.drilling.pictures.shown import BIT, DRIVE, RPM, times_between, title_of
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.animation import MOST_FRAMES, check_name, record
from cosserat_fenicsx.pictures.figures import empty_figure
from cosserat_fenicsx.ranks import on_first, world

# Longest film, s, where no speed is asked for; pixels across the string and along it; dots per inch.
_LONGEST, _ACROSS, _ALONG, _DPI = 10.0, 60, 400, 100


def film(history, file, speed=None, fps=25, progress=None):
    """See `DrillingHistory.animate`."""
    file = check_name(file)
    times_between("animate", history.profile_times, None)
    fps = number("animate", "fps", fps, "a number from 1 to 100", lambda x: 1 <= x <= 100)
    if file.suffix == ".gif":
        fps = 100 / round(100 / fps)
    first, last = history.profile_times[[0, -1]]
    speed = max(1.0, (last - first) / _LONGEST) if speed is None else positive("animate", "speed", speed, "-")
    count = int(np.ceil((last - first) * fps / speed)) + 1
    if count > MOST_FRAMES:
        raise SceneError(
            f"animate.speed = {speed:g}: expected one that needs at most {MOST_FRAMES} frames, not {count}"
        )
    times = np.linspace(first, last, count)
    on_first(world(), lambda: record(lambda: _Stage(history, speed), file, times, fps, progress))


class _Stage:
    """The picture at a time; the constant parts are drawn once."""

    def __init__(self, history, speed):
        self._history, self._speed = history, speed
        self._figure = figure = empty_figure(9.6, 6.0)
        figure.set_dpi(_DPI)
        string, along, over = figure.subplots(1, 3, width_ratios=(0.35, 1.0, 2.0))
        top, bottom = history.depths[[0, -1]]
        self._places = np.linspace(top, bottom, _ALONG)
        self._across = np.arcsin(np.linspace(-1, 1, _ACROSS) * 0.999)  # round a string that is seen from the side
        blank, box = np.zeros((_ALONG, _ACROSS)), (0, 1, bottom, top)
        self._stripes = string.imshow(blank, extent=box, aspect="auto", cmap="gray", vmin=-0.4, vmax=1.2)
        string.set(xticks=[], ylabel="measured depth (m)", title="string")
        speeds = history.speed * RPM
        (self._line,) = along.plot(speeds[0], history.depths, color="tab:purple")
        (self._held,) = along.plot([], [], ".", color="0.6", markersize=4, label="held by friction")
        low, high = float(min(np.nanmin(speeds), 0.0)), float(np.nanmax(speeds))
        room = 0.05 * max(high - low, 1.0)
        along.set(xlim=(low - room, high + room), ylim=(bottom, top), xlabel="speed (rpm)", yticklabels=[])
        if history.sticking.any():
            along.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
        over.plot(history.times, history.drive_speed * RPM, color=DRIVE, label="drive", linewidth=1.0)
        over.plot(history.times, history.bit_speed * RPM, color=BIT, label="bit", linewidth=1.0)
        over.set(xlabel="time (s)", ylabel="speed (rpm)", xlim=(0, history.times[-1]))
        over.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
        self._now = over.axvline(0.0, color="black", linewidth=0.8)
        for panel in (along, over):
            panel.grid(alpha=0.3)
        figure.suptitle(self._title(float(history.profile_times[0])), fontsize=10)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # found once: it would take half of the time of each frame

    def at(self, t):
        """(height, width, 3) the picture at t (s)."""
        history = self._history
        k = int(np.clip(np.searchsorted(history.profile_times, t) - 1, 0, len(history.profile_times) - 2))
        begin, end = history.profile_times[k : k + 2]
        share = (t - begin) / (end - begin)
        angle, speed = ((1 - share) * x[k] + share * x[k + 1] for x in (history.angle, history.speed))
        turned = np.interp(self._places, history.depths, angle)[:, None] + self._across
        self._stripes.set_data(np.cos(self._across) * np.where(np.cos(turned) > 0.0, 1.0, 0.25))
        self._line.set_xdata(speed * RPM)
        held = history.sticking[k + round(share)]
        self._held.set_data(speed[held] * RPM, history.depths[held])
        self._now.set_xdata([t, t])
        self._figure.suptitle(self._title(t), fontsize=10)
        self._figure.canvas.draw()
        return np.asarray(self._figure.canvas.buffer_rgba())[..., :3].copy()

    def _title(self, t):
        pace = "real time" if self._speed == 1 else f"{self._speed:.3g} times faster than real"
        return f"{title_of(self._history)}\nt = {t:.2f} s ({pace})"

    def close(self):
        """Nothing to free."""
