"""`DrillingHistory`: a drill-string in motion over time."""

from dataclasses import replace
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File, number, positive, refuse
from cosserat_fenicsx.drilling.choose import chosen, fastest, model_of
from cosserat_fenicsx.drilling.joints import fastest_rotor
from cosserat_fenicsx.drilling.linear_control import ZTorque
from cosserat_fenicsx.drilling.protocol import LEDGER, PROFILE, SERIES, columns
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.stick_slip import SPEED, TORQUE, StickSlip, alias, stick_slip_of
from cosserat_fenicsx.drilling.top_drive import TopDrive
from cosserat_fenicsx.errors import NotConverged, SceneError, nearest
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.quantities import Quantity, as_text
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.result import ChartedBetween, by_name

#: Columns of the rows of a `StringModel`.
COLUMNS = ("times", *SERIES, *LEDGER)
_TIME, _ALONG = ("time",), ("profile_time", "depth")
_QUANTITIES = by_name(
    Quantity("time", unit="s", axes=_TIME, getter="times"),
    Quantity("drive_speed", unit="rad/s", axes=_TIME, shown="rpm", digits=5, short="drive"),
    Quantity("drive_angle", unit="rad", axes=_TIME),
    Quantity("surface_torque", unit="N m", axes=_TIME, digits=5),
    Quantity("bit_speed", unit="rad/s", axes=_TIME, shown="rpm", digits=5, noise=1e-9, short="bit"),
    Quantity("bit_angle", unit="rad", axes=_TIME),
    Quantity("torque_on_bit", unit="N m", axes=_TIME, digits=5),
    Quantity("hook_load", unit="N", axes=_TIME, digits=5),
    Quantity("bit_velocity", unit="m/s", axes=_TIME),
    Quantity("bit_advance", unit="m", axes=_TIME, digits=5),
    Quantity("weight_on_bit", unit="N", axes=_TIME, digits=5),
    Quantity("impulse_on_bit", "impulse of impacts on bit", "N s", axes=_TIME),
    Quantity("motor_speed", "motor's own speed", "rad/s", axes=_TIME, shown="rpm", digits=5, short="motor",
             getter=lambda x: x.motor_speed if x.scene.motor else np.full(len(x), np.nan)),
    Quantity("pressure", "pressure over the motor", "Pa", axes=_TIME, shown="bar"),
    Quantity("kinetic", "kinetic energy", "J", axes=_TIME),
    Quantity("strain", "strain energy", "J", axes=_TIME),
    *(Quantity(name, unit="J", axes=_TIME) for name in LEDGER[2:]),
    Quantity("balance", "not accounted for", "J", axes=_TIME),
    Quantity("profile_time", unit="s", axes=("profile_time",), getter="profile_times"),
    Quantity("depth", unit="m", axes=("depth",), getter="depths"),
    Quantity("angle", "angle along the string", "rad", axes=_ALONG),
    Quantity("speed", "speed of rotation along the string", "rad/s", axes=_ALONG),
    Quantity("torque", "torque along the string", "N m", axes=_ALONG),
    Quantity("displacement", "displacement along the string", "m", axes=_ALONG),
    Quantity("velocity", "velocity along the string", "m/s", axes=_ALONG),
    Quantity("tension", "tension along the string", "N", axes=_ALONG),
    Quantity("sticking", "1 where the wall holds the string", axes=_ALONG, getter=lambda x: x.sticking.astype(np.int8)),
)  # fmt: skip


# Quantities of the table beside the time; its rows in `details`.
_SHOWN = ("drive_speed", "bit_speed", "surface_torque", "torque_on_bit", "hook_load", "weight_on_bit", "bit_advance")
_ROWS = 16
# Speed, over the one asked for, above which a motion counts as unbounded; smallest speed asked for, rad/s.
_BEYOND, _USUAL = 100.0, 10.0
# Beginnings of the sentences of `why` that are part of the answer.
_LOUD = ("APPROXIMATE", "CAUTION", "UNSTABLE")
_CAPTION = (
    "A row holds for the end of a step, forces and torques in it are means over the step, or of torsion alone over two "
    "(at the first one, the time before the start counts with zero): history.mean_times. The motion begins at t = 0, "
    "and ends with the step that reaches its duration."
)


def _without_torque(scene):
    """A sentence on a `ZTorque` from rest that stands before it frees the bit; else ""."""
    control, speed = scene.drive.control, scene.drive.speed
    if scene.start != "rest" or not isinstance(control, ZTorque) or callable(speed):
        return ""
    Z, level = control.impedance or scene.segments[0].torsional_impedance, control.torque
    has = "is 0 from rest where it is not given" if level is None else f"is {level / 1e3:.4g} kN m"
    most = ((level or 0.0) + Z * speed) / 1e3
    return (f"A ZTorque turns slower the larger the torque, and stands at {most:.4g} kN m: torque=, at which it has "
            f"the speed asked for, {has}. Expected that of the steady rotation"
            f'{_steady_torque(scene)}, or start="steady".')  # fmt: skip


@per_scene
def _steady_torque(scene):
    """" (about ... kN m)": that at the surface in steady rotation; "" where none is found."""
    turning = replace(scene, drive=TopDrive(scene.drive.speed), start="steady")
    try:
        name, _ = chosen(turning)
        torque = model_of(turning, name).advance(1)[0, 1 + SERIES.index("surface_torque")]
    except (SceneError, NotConverged):
        return ""
    return f" (about {torque / 1e3:.3g} kN m)"


class DrillingHistory(ChartedBetween):
    """The motion of a drill-string, from `drilling.simulate`.

    SI units, angles in rad. Angles, speeds and torques are positive in the sense of drilling; displacements, velocities
    and the advance of the bit are positive downwards, tension and hook load where they pull. Axial quantities are NaN
    in a model of torsion alone.

    A row holds for the end of a step. Forces, torques and speeds along the string are means over the last step, in a
    string with torsion alone over the last two, there except the speeds of a drive or a bit with inertia. Means hold
    for `mean_times`, to second order in the step; as values at `times` they are late by half a step, or by one.

    `plot` draws the speeds of drive and bit and the torques over time; of a model with motion along the axis also hook
    load, weight on bit, and the velocities of block and bit.

    Arrays (n,) over `times`:

    - ``drive_speed``, ``bit_speed``: rad/s; ``drive_angle``, ``bit_angle``: rad;
    - ``surface_torque``, ``torque_on_bit``: N m; ``hook_load``, ``weight_on_bit``: N;
    - ``motor_speed``, ``pressure``, ``stalled``: speed of a `MudMotor`'s rotor against its housing, rad/s, the pressure
      over it, Pa, and whether that speed is not above 0; 0, NaN and False without one. Of several motors the sums, and
      whether one of them stalls; ``motor_speeds``, ``pressures``, ``stalls`` (n, motors) are those of each, from the
      top down;
    - ``bit_velocity``: m/s; ``bit_advance``: m;
    - ``kinetic``, ``strain``: energies, J; ``work_of_drive``, ``work_of_hook``, ``work_of_weight``, ``work_of_tools``:
      done on the string since the start, J; ``lost_at_bit``, ``lost_at_wall``, ``lost_in_mud``: J.

    Arrays (k, m) over `profile_times` and `depths`: ``angle``, ``speed``, ``torque``, ``displacement``, ``velocity``,
    ``tension`` in the same units, and ``sticking``: True where wall or rock hold the string.

    Attributes:
        scene: the `Drilling`.
        model: "torsion", "axial and torsional", or "rod below pipe" (`MixedScene`).
        dt: step, s. counts: {name: number} of the solver, such as steps that were halved.
        times: (n,) s, each at the end of a step. mean_times: (n,) s, the middles of those over which means are taken.
        profile_times: (k,) s. depths: (m,) measured depths, m.
        errors: with `check`, estimated errors by the step of the second half: `period` (s) of stick-slip, `peak`
            (rad/s) of the bit, `least_torque` and `largest_torque` (N m) at the surface; else None.
        folder: the `pathlib.Path` that it is stored in, or None.
    """

    #: For messages.
    axis = _rows_axis = "time"
    _chart = "drilling.charts.over_time_figure"
    _quantities = _QUANTITIES

    def __init__(self, scene, model, why, dt, depths, rows=None, profiles=None, counts=None, folder=None):
        self.scene: Drilling = scene
        self.model, self._why, self.dt, self.depths = model, tuple(why), float(dt), np.asarray(depths, dtype=float)
        self.counts: dict[str, int] = dict(counts or {})
        self.folder, self.errors = folder, None
        self._pieces = [np.empty((0, columns(scene))) if rows is None else rows]
        shape = (0, 1 + len(PROFILE) * len(self.depths))
        self._profiles = [np.empty(shape) if profiles is None else profiles]

    def append(self, rows):
        """Add (n, `columns`) rows."""
        self._pieces.append(rows)

    def append_profile(self, time, profile):
        """Add the profile (len(PROFILE), m) at a time (s), and return the row that it is stored as."""
        row = np.concatenate([[time], np.ravel(profile)])
        self._profiles.append(row[None])
        return row

    def __len__(self):
        return sum(map(len, self._pieces))

    @property
    def rows(self):
        """(n, `columns`) all columns."""
        if len(self._pieces) > 1:  # joined once
            self._pieces = [np.concatenate(self._pieces)]
        return self._pieces[0]

    def _along(self):
        """(k, 1 + len(PROFILE) m) all profiles."""
        if len(self._profiles) > 1:
            self._profiles = [np.concatenate(self._profiles)]
        return self._profiles[0]

    def __getattr__(self, name):
        if name in COLUMNS:
            return self.rows[:, COLUMNS.index(name)]
        if name == "profile_times":
            return self._along()[:, 0]
        if name in PROFILE:
            k, m = PROFILE.index(name), len(self.depths)
            values = self._along()[:, 1 + k * m : 1 + (k + 1) * m]
            return values > 0.5 if name == "sticking" else values
        raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")

    def __getstate__(self):  # beside __getattr__, for pickles and copies
        return vars(self)

    def __setstate__(self, state):
        vars(self).update(state)

    def __dir__(self):
        return sorted({*super().__dir__(), *COLUMNS, *PROFILE, "profile_times"})

    @property
    def why(self) -> tuple[str, ...]:
        """Sentences on the choice of the model, its approximations, and a motion that grows without bound."""
        speed, most = self._speeds
        if not speed > most:
            return self._why
        return (*self._why, f"UNSTABLE: drive or bit reach {speed:.3g} rad/s, more than {most:.3g} rad/s, {_BEYOND:g} "
                "times what drives turn at: the motion grows without bound, and its numbers mean nothing. stability "
                "with a high up_to says which mode grows; a control may grow by itself, and a free string under a "
                "given torque without drag")  # fmt: skip

    @property
    def _speeds(self):
        """The largest speed of drive and bit, and the one above which a motion grows without bound, rad/s."""
        if not len(self):
            return 0.0, np.inf
        usual = max(_USUAL, fastest(self.scene, float(self.times[-1])))
        usual += fastest_rotor(self.scene)
        return max(float(np.abs(x).max()) for x in (self.drive_speed, self.bit_speed)), _BEYOND * usual

    @property
    def mean_times(self) -> np.ndarray:
        """(n,) s: the middles of the steps over which forces, torques and some speeds are means, see the class."""
        over_two = self.model == "torsion" and not self.scene.by_elements
        return self.times - (self.dt if over_two else self.dt / 2)

    @property
    def motor_speeds(self) -> np.ndarray:
        """(n, motors) of the rotors against their housings, rad/s, from the top down."""
        each = self.rows[:, len(COLUMNS) :]
        return each if each.shape[1] else self.rows[:, [COLUMNS.index("motor_speed")] * len(self.scene.motors)]

    @property
    def pressures(self) -> np.ndarray:
        """(n, motors) over each motor, Pa, at `mean_times`."""
        return self._of_motors(lambda motor, speed, flow: motor.pressure_at(speed, flow))

    @property
    def stalls(self) -> np.ndarray:
        """(n, motors) bool: a rotor stands or turns backwards, while its flow would turn it without load."""
        return self._of_motors(lambda motor, speed, flow: (speed <= 0) & (motor.driven(flow) > motor.lost_torque)) > 0

    def _of_motors(self, function):
        """(n, motors) of a function of a motor, its speeds and its flows (n,), rad/s, m^3/s."""
        found = np.empty((len(self), len(self.scene.motors)))
        for k, motor in enumerate(self.scene.motors):
            asked = motor.flow_at if callable(motor.flow) else lambda t, motor=motor: motor.flow
            flow = np.array([asked(max(t, 0.0)) for t in self.mean_times])
            found[:, k] = function(motor, self.motor_speeds[:, k], flow)
        return found

    @property
    def pressure(self) -> np.ndarray:
        """(n,) over all motors, Pa, at `mean_times`."""
        return self.pressures.sum(axis=1) if self.scene.motors else np.full(len(self), np.nan)

    @property
    def stalled(self) -> np.ndarray:
        """(n,) bool: whether a motor stalls, see `stalls`."""
        return self.stalls.any(axis=1)

    @property
    def balance(self) -> np.ndarray:
        """(n,) residual of the ledger, J: energies and losses less works, the negative loss of the scheme. Of a motion
        that starts in steady rotation, less its first value, the initial energy."""
        if len(self) and np.isnan(self.kinetic).all():  # of a model without a ledger
            return np.full(len(self), np.nan)
        signs = {name: -1 if name.startswith("work") else 1 for name in LEDGER}
        missing = sum(sign * np.nan_to_num(getattr(self, name)) for name, sign in signs.items())
        return missing - missing[:1] if self.scene.start == "steady" else missing

    def mean(self, name: str, periods: int, frequency: float) -> float:
        """The mean of a quantity over time, over the last whole periods of a frequency.

        Args:
            name: such as "hook_load". periods: how many. frequency: Hz, such as that of an `OscillationTool`.

        Raises:
            SceneError: an unknown name, or a motion that is shorter.
        """
        if name not in SERIES and name != "pressure":
            raise SceneError(f"mean.name = {name!r}: {nearest(str(name), [*SERIES, 'pressure'])}")
        frequency = positive("mean", "frequency", frequency, "Hz")
        periods = number("mean", "periods", periods, "a whole number from 1", lambda x: x >= 1 and x == int(x))
        t, values = self.mean_times, getattr(self, name)
        first = t[-1] - periods / frequency if len(t) else 0.0
        if not len(t) or first < t[0]:
            refuse("mean", "periods", periods, f"a motion that is longer than these, {periods / frequency:g} s")
        inside = t > first
        t, values = np.append(first, t[inside]), np.append(np.interp(first, t, values), values[inside])
        return float(np.diff(t) @ (values[1:] + values[:-1]) / 2 / (t[-1] - first))

    def stick_slip(self, since: float | None = None) -> StickSlip:
        """Period, peaks, and when the bit starts and stops.

        Args:
            since: s; None for the second half.

        Raises:
            SceneError: fewer than three times from there on.
        """
        last = float(self.times[-1]) if len(self) else 0.0
        since = last / 2 if since is None else number("stick_slip", "since", since, "a time (s)", np.isfinite)
        if len(self) < 3 or (self.times >= since).sum() < 3:
            raise SceneError(f"stick_slip.since = {since:g}: expected a time with at least three rows after it, up to "
                             f"{last:g} s")  # fmt: skip
        from cosserat_fenicsx.drilling.linear.stability import undisturbed

        found, (speed, most) = stick_slip_of(self, since), self._speeds
        caution = _without_torque(self.scene) if found.stuck == 1 else ""
        caution = caution or undisturbed(self.scene, found.least, found.peak)
        return replace(found, caution=caution, unbounded=speed > most)

    # -- tables ------------------------------------------------------------------------------------------------------

    def _about(self):
        return {"kind": "DrillingHistory", "model": self.model, "why": self.why, "dt": self.dt}

    def _answer(self, units):
        cycle = self.stick_slip() if len(self) > 5 else None
        if cycle:
            yield cycle.summary(units)
        if self.errors is not None:
            period, peak, *torques = self.errors
            (rpm, turning), (moment, size) = (units.on_screen(x) for x in (SPEED, TORQUE))
            first = "" if np.isnan(period) else f"period {period:.2g} s, "
            yield (
                f"Estimated errors by the step: {first}peak {peak / turning:.2g} {rpm}, surface torque "
                f"{max(torques) / size:.2g} {moment}."
            )
            if cycle and cycle.irregular:
                yield "The motion is not periodic: its numbers depend on any step, and may differ by more than that."
        yield from self._on_motor(units)
        caution = alias(self)
        if caution and not cycle.unbounded:
            yield f"{caution[0].upper()}{caution[1:]}."
        yield from map(units.sentence, (*self.why[:1], *(x for x in self.why[1:] if x.startswith(_LOUD))))

    def _on_motor(self, units):
        """Sentences on the motors, and on when they stall."""
        if not self.scene.motors or len(self) < 3:
            return
        late = self.times >= self.times[-1] / 2
        shown = [units.on_screen(self.quantities[name]) for name in ("motor_speed", "pressure")]
        several = len(self.scene.motors) > 1
        for k, (values, stalled) in enumerate(zip(
            zip(self.motor_speeds.T, self.pressures.T, strict=True), self.stalls.T, strict=True)):  # fmt: skip
            mean = [f"{np.mean(x[late]) / size:.4g} {unit}" for x, (unit, size) in zip(values, shown, strict=True)]
            which, above = (f" {k + 1} from the top", "what is above it") if several else ("", "the string")
            yield f"Motor{which} in the second half: {mean[0]} faster than {above}, {mean[1]} over it, in the mean."
            if stalled.any():
                first = self.mean_times[stalled.argmax()]
                yield (f"THE MOTOR{which.upper()} STALLS from t = {max(first, 0.0):.4g} s on, in "
                       f"{100 * stalled.mean():.3g} % of the time: the bit holds its rotor, or turns it backwards; no "
                       "motor bears that for long.")  # fmt: skip

    def _more(self, units):
        if len(self) > 5 and not np.isnan(self.balance).all():
            worked = {
                name: np.nan_to_num(getattr(self, f"work_of_{name}")[-1])
                for name in ("drive", "hook", "weight", "tools")
            }
            unit, size = units.on_screen(Quantity("energy", unit="J", shown="kJ"))
            done = ", ".join(
                f"of the {name} {as_text(x / size, 5)} {unit}" for name, x in worked.items() if x or name == "drive"
            )
            yield f"Energy: work {done}; the ledger does not account for {self.balance[-1] / size:.3g} {unit}."
        impulse = np.nan_to_num(self.impulse_on_bit)
        if len(impulse) and impulse[-1]:
            each = np.diff(impulse, prepend=0.0)
            yield (
                f"Impacts of the bit on rigid rock: the largest impulse {each.max():.4g} N s, at t = "
                f"{self.times[each.argmax()]:.5g} s, together {impulse[-1]:.4g} N s; the weight on bit is without them."
            )
        yield from (units.sentence(x) for x in self.why[1:] if not x.startswith(_LOUD))

    def _table(self, units, rows):
        if not len(self):
            return None
        halved = self.counts.get("halved", 0)
        parts = f", {halved} times halved where the motion needs it" if halved else ""
        given = [
            (self.quantities[name], getattr(self, name)) for name in _SHOWN if not np.isnan(getattr(self, name)).all()
        ]
        given = [(self.quantities["time"], self.times), *given]
        return screen.table(given, units, min(rows, _ROWS), f"{self.model} model, steps of {self.dt:.4g} s{parts}",
                            _CAPTION if rows == screen.ROWS else None)  # fmt: skip

    # -- pictures ----------------------------------------------------------------------------------------------------

    def plot_map(
        self,
        file: File | None = None,
        what: str | None = None,
        between: tuple[float, float] | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ):
        """Draw a quantity over time and depth, which runs downwards, and where friction holds the string.

        Args:
            what: "speed", "torque", "angle", "tension", "displacement" or "velocity"; None for the speed of rotation,
                or the velocity along the axis where nothing turns or the block moves up and down.
            file, between, units, width: see `plot`.

        Raises:
            SceneError: see `plot`; a quantity that the model does not have.
        """
        return self._drawn("drilling.charts.map_figure", file, units, width, what, between)

    def plot_phase(
        self,
        file: File | None = None,
        since: float | None = None,
        *,
        units: Any = "SI",
        width: int | None = None,
    ):
        """Draw the phase portrait of the bit: its speed over the twist between drive and bit.

        Args:
            since: s; None for the second half.
            file, units, width: see `plot`.
        """
        return self._drawn("drilling.charts.phase_figure", file, units, width, since)

    def plot_energy(self, file: File | None = None, *, units: Any = "SI", width: int | None = None):
        """Draw the ledger of energy and its residual over time; for the arguments see `plot`."""
        return self._drawn("drilling.charts.energy_figure", file, units, width)

    def animate(self, file: File, *, speed: float | None = None, fps: float = 25, progress: bool | None = None,
                units: Any = "SI") -> None:  # fmt: skip
        """Write a film of the string: twist and speed of rotation along it, or displacement and velocity along the axis
        where nothing turns or the block moves up and down.

        Args:
            file: .gif, or .mp4, which needs ffmpeg (rank 0 writes).
            speed: seconds of the motion in a second of the film; None for one of at most ten seconds.
            fps: frames per second, 1 to 100. progress: see `drilling.simulate`. units: see `plot`.

        Raises:
            SceneError: matplotlib, Pillow or ffmpeg is missing, another ending, or fewer than two profiles.
        """
        from cosserat_fenicsx.drilling.charts import film

        film(self, file, speed, fps, progress, units)

    def __repr__(self):
        last = f" up to t = {self.times[-1]:g} s" if len(self) else ""
        return f"DrillingHistory({self.model}: {len(self)} times{last}, {len(self.profile_times)} profiles)"
