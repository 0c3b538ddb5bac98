"""Derivatives of hook load and surface torque by friction, weights and loads on the bit: closed forms, differences."""

import math

import numpy as np
import pytest
from reference_wells import well

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import PLACES, derivative

pytestmark = [pytest.mark.serial, pytest.mark.once]
PATH = well("P")
COLLAR = cf.well.Collar(200.0, outer_diameter=0.165, inner_diameter=0.07)
PIPE = cf.well.DrillPipe(outer_diameter=0.127, inner_diameter=0.1086)
#: names of parameters, the argument of `answer` and its value
NAMES = {
    "hole.sections[0].friction": ("cased", 0.2),
    "hole.sections[1].friction": ("open", 0.32),
    "mud.density": ("density", 1200.0),
    "operation.weight": ("weight", 5e4),
    "operation.torque": ("torque", 3e3),
}


def answer(operation, convention, *, cased=0.2, open=0.32, density=1200.0, weight=5e4, torque=3e3, tol=1e-11):
    hole = cf.well.Borehole(
        PATH, [cf.well.HoleSection(2000, 0.22, cased), cf.well.HoleSection(PATH.length, 0.2159, open)]
    )
    return cf.well.torque_and_drag(
        hole,
        cf.well.DrillString([COLLAR, PIPE]),
        operation(weight=weight, torque=torque),
        mud=cf.well.Mud(density),
        model="soft",
        tol=tol,
        torque_convention=convention,
    )


def capstan(pull=900e3, mu=0.3, weight=0.0):
    """A string without weight on a quarter circle."""
    path = cf.well.WellPath.from_survey([0, 200 * math.pi], [0, 90], [350, 350])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(path.length, 0.2159, mu)])
    string = cf.well.DrillString([cf.well.Component(weight=weight, contact_radius=0.0635)])
    return cf.well.torque_and_drag(hole, string, cf.well.TripOut(weight=-pull), model="soft", tol=1e-11)


def test_capstan():
    """T = F e^(mu pi/2): by friction pi/2 T, by the pull e^(mu pi/2); and by weight, of the closed form of the arc."""
    turn, mu, pull, radius = math.pi / 2, 0.3, 900e3, 400.0
    found = capstan().sensitivity(["friction", "operation.weight", "weight"])
    assert found["friction"] == pytest.approx(turn * pull * math.exp(mu * turn), rel=1e-10)
    assert found["operation.weight"] == pytest.approx(-math.exp(mu * turn), rel=1e-10)
    # Aadnoy's form of a build: A sin(i) + B cos(i) + C e^(-mu i), linear in the weight
    A, B = -radius * (1 - mu**2) / (1 + mu**2), -2 * mu * radius / (1 + mu**2)
    assert found["weight"] == pytest.approx(B - A * math.exp(mu * turn), rel=1e-9)


@pytest.mark.parametrize("convention", ["coulomb", "johancsik"])
@pytest.mark.parametrize("operation", [cf.well.TripOut, cf.well.TripIn, cf.well.RotaryDrilling])
def test_a_well_as_by_differences_of_answers(operation, convention):
    here = answer(operation, convention)
    for query in ("hook_load", "surface_torque"):
        found = here.sensitivity(NAMES, query)
        for name, (argument, value) in NAMES.items():
            step = 2e-3 * value
            near = [getattr(answer(operation, convention, **{argument: value + k * step}), query) for k in PLACES]
            by, _ = derivative(near, step)
            assert abs(found[name] - by) <= 1e-9 * abs(by) + 1e-11 * abs(found.value / value)
    along = here.sensitivity(["friction"], "tension")["friction"]
    assert along.shape == here.md.shape
    sections = [here.sensitivity([f"hole.sections[{i}].friction"])[f"hole.sections[{i}].friction"] for i in (0, 1)]
    assert along[0] == pytest.approx(sum(sections), rel=1e-12, abs=1e-6)


def test_weights_of_components_add_up():
    found = answer(cf.well.TripOut, "coulomb").sensitivity(
        ["weight", "string.components[0].weight", "string.components[1].weight"]
    )
    all_of_it, *parts = found.values()
    assert all_of_it == pytest.approx(sum(parts), rel=1e-12)


def test_uncertainty_of_a_hook_load_with_a_fit():
    """The coefficients of a fit, with their correlation, tell how uncertain a hook load is: as readings of exactly
    this load would."""
    hole = cf.well.Borehole(
        PATH, [cf.well.HoleSection(2000, 0.22, 0.2), cf.well.HoleSection(PATH.length, 0.2159, 0.32)]
    )
    string, rng, measurements = cf.well.DrillString([COLLAR, PIPE]), np.random.default_rng(5), []
    for depth in (1500.0, 2500.0, 3500.0, 4500.0):
        for operation in (cf.well.TripOut(), cf.well.TripIn()):
            exact = cf.well.torque_and_drag(hole, string, operation, mud=cf.well.Mud(1200.0), depth=depth, model="soft")
            measurements.append(cf.well.RigMeasurement(depth, operation, exact.hook_load + 5e3 * rng.normal()))
    fit = cf.well.calibrate_friction(hole, string, measurements, mud=cf.well.Mud(1200.0))
    half = np.diff(fit.interval)[:, 0] / 2
    assert half / fit.standard_error == pytest.approx([half[0] / fit.standard_error[0]] * 2)  # Student's quantile
    here = cf.well.torque_and_drag(fit.hole, string, cf.well.TripOut(), mud=cf.well.Mud(1200.0), model="soft")
    names = ["hole.sections[0].friction", "hole.sections[1].friction"]
    given = dict(zip(names, fit.standard_error, strict=True))
    found = here.uncertainty(given, correlation=fit.correlation)
    slopes = np.array(list(here.sensitivity(names).values()))
    covariance = fit.correlation * np.outer(fit.standard_error, fit.standard_error)
    assert found.standard_deviation == pytest.approx(math.sqrt(slopes @ covariance @ slopes), rel=1e-12)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert "% from hole.sections[1].friction" in str(found)


def test_refusals_in_words():
    here = capstan()
    for name, words in (
        ("hole.sections[3].friction", r"hole.sections\[i\].friction with i from 0 to 0"),
        (
            "operation.rpm",
            r"known: friction, weight, operation.weight, operation.torque, hole.sections\[i\].friction "
            r"with i from 0 to 0, string.components\[i\].weight with i from 0 to 0$",
        ),
        ("mud.density", "known: friction"),  # there is no mud
        (3, "known"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            here.sensitivity([name])
    with pytest.raises(cf.SceneError, match="did you mean 'hook_load'"):
        here.sensitivity(["friction"], "hook")
    hole = cf.well.Borehole(PATH, [cf.well.HoleSection(PATH.length, 0.2159, 0.25)])
    buckled = cf.well.torque_and_drag(
        hole, cf.well.DrillString([COLLAR, PIPE]), cf.well.Sliding(90e3), mud=cf.well.Mud(1200.0), model="buckled"
    )
    assert buckled.solved.helical.any()
    with pytest.raises(cf.SceneError, match="a string with a helix .model = 'buckled'.*model='soft'"):
        buckled.sensitivity(["friction"])


def test_what_is_printed_has_names_and_units():
    found = capstan().sensitivity(["friction", "operation.weight"])
    first, by_friction, by_weight = str(found).splitlines()
    assert first == f"hook_load = {found.value:.6g} N"
    assert by_friction == f"d/d(friction) = {found['friction']:.6g} N"  # of all sections: it has no one value
    assert by_weight == f"d/d(operation.weight) = {found['operation.weight']:.6g} N per N, at -900000"
    told = str(found.uncertainty({"operation.weight": 1e3}))
    assert told.startswith(f"hook_load = {found.value:.6g} +- {1e3 * abs(found['operation.weight']):.6g} N (one")
