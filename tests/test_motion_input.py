"""Motions: invalid input is refused with a message; functions of time are named in it."""

import math

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
SECTION = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.1, 0.2))
ROD = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SECTION, name="rod")
FREE = cf.Scene([ROD])
LATE_NAN = cf.Scene([ROD], loads=[cf.Force(ROD.end, lambda t: (0, 0, 1 if t < 0.05 else math.nan))])


def sections(**more):
    return cf.Stiffness(
        **{**dict(shear=(1, 1), axial=1, bending=(1, 1), torsion=1, mass=1.0, inertia=(1, 1, 1)), **more}
    )


def moving(*velocities, supports=(), joints=(), rods=(ROD,)):
    return cf.simulate(cf.Scene(rods, supports, joints=joints, velocities=velocities), 0.1, dt=0.1)


OTHER = cf.Rod(cf.Line((2, 0, 0), (3, 0, 0)), SECTION, name="other")
REFUSED = {
    "negative mass": (lambda: sections(mass=-1.0), "Stiffness.mass = -1.0: expected a positive number (kg/m)"),
    "negative inertia": (lambda: sections(inertia=(1, -1, 1)), "Stiffness.inertia = -1"),
    "two inertias": (lambda: sections(inertia=(1, 1)), "Stiffness.inertia = (1, 1): expected three numbers"),
    "no scene": (lambda: cf.simulate(ROD, 1.0), "simulate.scene = "),
    "duration": (lambda: cf.simulate(FREE, 0.0), "simulate.duration = 0.0: expected a positive number (s)"),
    "NaN duration": (lambda: cf.simulate(FREE, math.nan), "simulate.duration = nan"),
    "dt": (lambda: cf.simulate(FREE, 1.0, dt=-0.1), "simulate.dt = -0.1: expected a positive number (s)"),
    "tol": (lambda: cf.simulate(FREE, 1.0, tol=2), "simulate.tol = 2"),
    "dt and tol": (lambda: cf.simulate(FREE, 1.0, dt=0.1, tol=1e-3), "expected one of them"),
    "save_every": (lambda: cf.simulate(FREE, 1.0, save_every=0), "simulate.save_every = 0"),
    "scheme": (lambda: cf.simulate(FREE, 1.0, scheme="momentun"), "scheme = 'momentun': did you mean 'momentum'?"),
    "elements": (lambda: cf.simulate(FREE, 1.0, elements=0), "simulate.elements = 0"),
    "start": (lambda: cf.simulate(FREE, 1.0, start="a"), "simulate.start = 'a': expected a load factor, a Path"),
    "start at 0": (lambda: cf.simulate(FREE, 1.0, start=0),
                   "simulate.start = 0: expected a load factor that is finite and not 0"),
    "start of nothing": (lambda: cf.simulate(FREE, 1.0, start=3), "Scene.loads is empty"),
    "run-up": (lambda: cf.signals.RunUp((1, 0, 0), 2.0, 1.0), "RunUp.end = 1.0: expected a time after 2 s"),
    "no mass": (lambda: moving(rods=[cf.Rod(ROD.curve, sections(mass=None), name="a")]), "'a': Stiffness.mass = None"),
    "no inertia": (lambda: moving(rods=[cf.Rod(ROD.curve, sections(inertia=None), name="a")]),
                   "Stiffness.inertia = None"),
    "no density": (lambda: moving(rods=[cf.Rod(ROD.curve, cf.Circle(0.1), cf.Material(1e9), name="a")]),
                   "Material.density"),
    "late NaN": (lambda: cf.simulate(LATE_NAN, 1.0, dt=0.02, model="spatial"), "numbers (N), at the time t = 0.05 s"),
    "two numbers": (lambda: cf.Moment(ROD.end, lambda t: (1, 2)),
                    "Moment.moment = (1, 2): expected 3 finite numbers (N m), at the time t = 0 s"),
    "jumps of a vector": (lambda: cf.Force(ROD.end, (1, 2, 3), jumps=(1,)), "Force.jumps = (1,): expected none"),
    "jumps": (lambda: cf.Force(ROD.end, cf.signals.Step((1, 2, 3)), jumps=("a",)), "Force.jumps = 'a'"),
    "ramp": (lambda: cf.signals.Ramp((1, 0, 0), 2.0, 1.0), "Ramp.end = 1.0: expected a time after 2 s"),
    "triangle": (lambda: cf.signals.Triangle((1, 0, 0), 0, 3, 2), "Triangle.end = 2"),
    "sine": (lambda: cf.signals.Sine((1, 0, 0), math.nan), "Sine.frequency = nan"),
    "table": (lambda: cf.signals.Table((0, 0), ((0, 0, 0), (1, 1, 1))), "Table.times = (0, 0): expected ascending"),
    "table rows": (lambda: cf.signals.Table((0, 1), ((0, 0, 0),)), "Table.values"),
    "against a clamp": (lambda: moving(cf.InitialVelocity(ROD, (1, 0, 0)), supports=[cf.Clamp(ROD.start)]),
                        "goes against supports[0] (Clamp"),
    "against a pin": (lambda: moving(cf.InitialVelocity(ROD, (1, 0, 0)), supports=[cf.Pin(ROD.end)]),
                      "goes against supports[0] (Pin"),
    "against a joint": (lambda: moving(cf.InitialVelocity(ROD, (1, 0, 0)), rods=[ROD, OTHER],
                                       joints=[cf.Joint(ROD.end, OTHER.start)]), "joints[0]"),
    "two velocities": (lambda: moving(cf.InitialVelocity(ROD), cf.InitialVelocity(ROD)), "the second of rod 'rod'"),
    "a velocity elsewhere": (lambda: moving(cf.InitialVelocity(OTHER)), "Scene.velocities[0] acts at"),
    "velocity of NaN": (lambda: moving(cf.InitialVelocity(ROD, lambda s: (0, 0, 1 / s if s else math.nan))),
                        "InitialVelocity.linear(0) = (0, 0, nan): expected 3 finite numbers (m/s)"),
    "about with a function": (lambda: cf.InitialVelocity(ROD, lambda s: (0, 0, 0), about=(0, 0, 0)),
                              "InitialVelocity.about"),
    "a support that jumps": (lambda: cf.simulate(cf.Scene([ROD], [cf.Prescribed(ROD.end, (0, 0, 1))]), 1.0),
                             "does not hold at the time 0"),
    "statics in time": (lambda: cf.solve(LATE_NAN, [1.0]),
                        "the Force depends on time, which a static analysis excludes"),
    "a step longer than the motion": (lambda: cf.simulate(FREE, 1.0, dt=50.0),
                                      "simulate.dt = 50.0: expected at most the duration, 1 s"),
    "a number for a vector": (lambda: cf.Force(FREE.rods[0].end, cf.signals.Sine(5.0, 2.0)),
                              "Force.force = (0.0,): expected 3 finite numbers (N)"),
    "no end of steps": (lambda: cf.simulate(FREE, 1.0, dt=1e-18),
                        "simulate: duration = 1 s and dt = 1e-18 s: expected at most 1e+09 steps"),
    "no end of states": (lambda: cf.simulate(FREE, 1.0, save_every=1e-12),
                         "save_every = 1e-12 s: expected at most 1e+06 saved states"),
    "no end": (lambda: cf.simulate(FREE, 1e308),
               "simulate.duration = 1e+308: expected a positive number (s), from 1e-30 to 1e30"),
    "no step": (lambda: cf.simulate(FREE, 1.0, dt=1e-300),
                "simulate.dt = 1e-300: expected a positive number (s), from"),
    "schemes": (lambda: cf.simulate(FREE, 1.0, scheme=["energy"]), "scheme = ['energy']: did you mean 'energy'?"),
    "true start": (lambda: cf.simulate(FREE, 1.0, start=True), "simulate.start = True: expected a load factor, a Path"),
    "infinite stiffness": (lambda: moving(rods=[cf.Rod(ROD.curve, sections(axial=math.inf), name="a")]),
                           "infinite axial or shear stiffness: expected finite ones, for a motion"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    make, words = REFUSED[case]
    with pytest.raises(cf.SceneError) as refusal:
        make()
    assert words in str(refusal.value)


def driven(**motion):
    return cf.Scene([ROD], [cf.Prescribed(ROD.start, **motion)], [cf.Force(ROD.end, cf.signals.Step((0, 1, 0), 0.5))])


@pytest.mark.parametrize("scheme", ["momentum", "energy", "triple-jump", "generalised-alpha"])
def test_a_support_that_jumps_is_refused(scheme):
    """The result would depend on the step size alone."""

    def jumping(t):
        return (0, 0, 0) if t < 0.5 else (0, 0.01 + 1e-3 * (t - 0.5), 0)

    refused = {
        "displacement jumps at t = 0.5 s, by 0.05 m": {"displacement": cf.signals.Step((0, 0.05, 0), 0.5)},
        "rotation jumps at t = 1 s, by 0.3 rad": {"rotation": cf.signals.Step((0, 0, 0.3), 1.0)},
        "displacement jumps at t = 0.5 s, by 0.03 m": {
            "displacement": cf.signals.Table((0.5, 0.5 + 1e-12), ((0, 0, 0), (0, 0.03, 0)))
        },
        "displacement jumps at t = 0.25 s, by 0.02 m": {
            "displacement": cf.signals.Sine((0, 0.02, 0), 1.0, math.pi / 2, 0.25)
        },
        "displacement jumps at t = 0.5 s, by 0.01 m": {"displacement": jumping, "jumps": (0.25, 0.5)},
    }
    for words, motion in refused.items():
        with pytest.raises(
            cf.SceneError,
            match=rf"supports\[0\] \(Prescribed at rod.start\): its {words}: expected .* a Ramp or a RunUp",
        ):
            cf.simulate(driven(**motion), 1.0, dt=0.25, scheme=scheme)


def test_a_support_that_bends_and_a_load_that_jumps_are_taken():
    back = cf.signals.Table((0, 0.5, 0.6), ((0, 0, 0), (0, 0.05, 0), (0, 0, 0)))

    def run_up(t):
        """Small values have the rounding error of 1 - cos; it is not defined after the end."""
        assert t <= 1
        return (0, max(0.0, t - 0.25) ** 2 / 2 + (math.cos(max(0.0, t - 0.25)) - 1), 0)

    assert (
        cf.simulate(driven(displacement=run_up, jumps=(0.25, 1.0)), 1.0, dt=0.25, elements=1, degree=2).times[-1] == 1.0
    )
    for motion in (back, cf.signals.Ramp((0, 1e-3, 0), 0.25, 0.5), cf.signals.RunUp((0, 1e-3, 0), 0.25, 0.5)):
        assert cf.simulate(driven(displacement=motion), 1.0, dt=0.25, elements=1, degree=2).times[-1] == 1.0


def raising(t):
    return (0, 1 / (1.0 if t < 0.5 else 0), 0)


def no_number(t):
    return (0, 1.0 if t < 0.5 else math.nan, 0)


@pytest.mark.parametrize("force", [raising, no_number])
def test_a_function_of_time_that_fails_late_leaves_the_history(force):
    """And the message names the load and the time."""
    scene = cf.Scene([ROD], loads=[cf.Force(ROD.start, (0, 1, 0)), cf.Force(ROD.end, force)])
    how = {"dt": 0.1, "model": "spatial", "elements": 1, "degree": 2}
    with pytest.raises(cf.SceneError, match=r"at the time t = 0.55 s, of the Force at rod.end") as failure:
        cf.simulate(scene, 1.0, **how)
    np.testing.assert_allclose(failure.value.path.times, [0, 0.1, 0.2, 0.3, 0.4, 0.5])
    if force is raising:
        assert "Force.force: its function raised ZeroDivisionError (" in str(failure.value)
        assert isinstance(failure.value.__cause__, ZeroDivisionError)


def test_functions_of_time():
    v = (2.0, 0, -4.0)
    cases = {
        cf.signals.Step(v, 1.0, 2.0): ({0.9: 0, 1.0: 1, 1.9: 1, 2.0: 0}, (1, 2)),
        cf.signals.Step(v): ({-1: 0, 0: 1, 99: 1}, (0,)),
        cf.signals.Ramp(v, 1, 3): ({1: 0, 2: 0.5, 3: 1, 4: 1}, (1, 3)),
        cf.signals.Triangle(v, 0, 1, 3): ({0.5: 0.5, 1: 1, 2: 0.5, 3: 0, 4: 0, -1: 0}, (0, 1, 3)),
        cf.signals.Sine(v, 0.25, start=1): ({0: 0, 1: 0, 2: 1, 4: -1}, (1,)),
        cf.signals.Table((0, 2), ((0, 0, 0), v)): ({-1: 0, 1: 0.5, 3: 1}, (0, 2)),
    }
    for signal, (values, jumps) in cases.items():
        for t, factor in values.items():
            np.testing.assert_allclose(signal(t), np.multiply(factor, v), atol=1e-12)
        assert signal.jumps == jumps


def test_steps_land_on_jumps_and_on_saved_times():
    load = cf.Force(ROD.end, lambda t: (0, 0, 1.0 if t < 0.37 else 0.0), jumps=(0.37,))
    scene = cf.Scene([ROD], loads=[load])
    history = cf.simulate(scene, 1.0, dt=0.1, elements=2, degree=2)
    assert 0.37 in history.times and history.times[-1] == 1.0 and np.diff(history.times).max() < 0.1 + 1e-12
    np.testing.assert_allclose(history.linear_momentum[-1], [0, 0, 0.37], atol=1e-12)
    saved = cf.simulate(scene, 1.0, dt=0.1, save_every=0.3, elements=2, degree=2)
    np.testing.assert_allclose(saved.times, [0, 0.3, 0.6, 0.9, 1.0])
    line = cf.Scene([ROD], loads=[cf.LineForce(ROD, cf.signals.Ramp((0, 3, 0), 0, 1))])
    pushed = cf.simulate(line, 2.0, dt=0.1, elements=2, degree=2)
    np.testing.assert_allclose(pushed.linear_momentum[-1], [0, 3 * 2 * 1.5, 0], atol=1e-10)
    assert repr(pushed).startswith("<History: 21 times, t = 0 .. 2 s, planar, 15 unknowns")


def test_a_motion_that_is_lost_keeps_what_it_had(monkeypatch):
    from cosserat_fenicsx.algebra.newton import Solved
    from cosserat_fenicsx.dynamics import time_loop
    from cosserat_fenicsx.dynamics.schemes import Momentum

    whole = Momentum.step

    def step(self, t, h):
        return whole(self, t, h) if t < 0.45 else Solved(False, 1, "Newton's iterations ran out")

    monkeypatch.setattr(Momentum, "step", step)
    monkeypatch.setattr(time_loop, "_HALVINGS", 2)
    with pytest.raises(cf.NotConverged, match="lost at t = 0.5 s, where a step of 0.025 s still fails") as lost:
        cf.simulate(FREE, 1.0, dt=0.1)
    np.testing.assert_allclose(lost.value.path.times, [0, 0.1, 0.2, 0.3, 0.4, 0.5])


def test_a_moving_scene_in_toml(tmp_path):
    file = tmp_path / "flight.toml"
    file.write_text(
        """
        [[rods]]
        name = "rod"
        curve = { type = "Line", start = [0, 0, 0], end = [2, 0, 0] }
        [rods.section]
        type = "Stiffness"
        shear = [1e5, 1e5]
        axial = 1e5
        bending = [1e3, 1e3]
        torsion = 1e3
        mass = 2.0
        inertia = [0.1, 0.1, 0.2]
        [rods.damping]
        time = 1e-3
        [[loads]]
        type = "Force"
        station = "rod.end"
        force = { type = "Ramp", value = [0, 0, 4], end = 0.5 }
        [[velocities]]
        rod = "rod"
        linear = [1, 0, 0]
        """
    )
    scene = cf.read(file).scene
    history = cf.simulate(scene, 1.0, dt=0.1, elements=2, degree=2)
    np.testing.assert_allclose(history.linear_momentum[-1], [4, 0, 3], atol=1e-11)
    file.write_text(file.read_text().replace('"Ramp"', '"Rampe"'))
    with pytest.raises(cf.SceneError, match=r"loads\[0\].force.type = 'Rampe': did you mean 'Ramp'"):
        cf.read(file)


def test_a_motion_may_start_under_permanent_loads_alone():
    weight = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.LineForce(ROD, (0, 0, -1.0), permanent=True)])
    history = cf.simulate(weight, 0.2, dt=0.05, start=0.0, elements=2)
    assert np.ptp(history.displacement(ROD.end), axis=0).max() < 1e-12 < np.abs(history.displacement(ROD.end)).max()
