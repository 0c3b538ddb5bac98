"""What the soft string says that it leaves out, against the rod in contact; its numbers were found independently."""

import math

import pytest
import random_wells
from reference_wells import well

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
STIFF = cf.Stiffness((1e9, 1e9), 7e8, (1228200.0, 1228200.0), 9.4e5)
STRING = cf.well.DrillString([cf.well.Component(None, STIFF, 241.13, 0.0635)])

#: Well, operation, clearance (m), hook load of the rod in contact less that of the soft string (N): finite elements in
#: space with a penalty, on 2 m elements.
IN_SPACE = [
    ("P", cf.well.TripOut(), 0.001, -426),
    ("P", cf.well.TripOut(), 0.010, -1343),
    ("P", cf.well.TripOut(), 0.04445, -2776),
    ("P", cf.well.TripIn(), 0.04445, 316),
    ("P", cf.well.RotateOffBottom(), 0.04445, 7),
    ("F-12", cf.well.TripOut(), 0.04445, -7705),
    ("F-12", cf.well.TripIn(), 0.04445, 4554),
    ("ISCWSA 2", cf.well.TripOut(), 0.04445, -3575),
]
#: Radius of the build section (m), its end (degrees), straight hole below (m), pull at the bottom (N), operation,
#: friction, hook loads of the stiff and of the soft string (N): by shooting.
PLANE = [
    (100.0, 40.0, 40.0, 150e3, cf.well.TripOut, 0.3, 215232.69479833, 216392.47901719),
    (100.0, 40.0, 40.0, 150e3, cf.well.TripIn, 0.3, 147221.08801421, 146483.90087545),
    (100.0, 40.0, 40.0, 150e3, cf.well.Static, 0.3, 177717.66167666, 177710.78949514),
    (200.0, 50.0, 1000.0, 0.0, cf.well.TripOut, 0.3, 312052.92537158, 313898.00773871),
    (200.0, 50.0, 1000.0, 0.0, cf.well.TripIn, 0.3, 119200.52736823, 118617.76502673),
]


def soft(path, clearance, operation, mu):
    hole = cf.well.Borehole(path, cf.well.HoleSection(path.length, 2 * (0.0635 + clearance), mu))
    return cf.well.torque_and_drag(hole, STRING, operation, model="soft", tol=1e-9)


@pytest.mark.parametrize(("name", "operation", "clearance", "differs"), IN_SPACE)
def test_the_difference_of_whole_wells_is_covered(name, operation, clearance, differs):
    answer = soft(well(name), clearance, operation, 0.25)
    told = answer.model_error * abs(answer.tension).max()
    assert abs(differs) <= told
    if operation.slip[0]:
        assert told < 6 * abs(differs)  # and not by far too much


@pytest.mark.parametrize(("radius", "angle", "below", "pull", "operation", "mu", "stiff", "flexible"), PLANE)
def test_build_sections(radius, angle, below, pull, operation, mu, stiff, flexible):
    arc = radius * math.radians(angle)
    path = cf.well.WellPath.from_survey([0, 20, 20 + arc, 20 + arc + below], [0, 0, angle, angle], [0, 0, 0, 0])
    answer = soft(path, 0.04445, operation(weight=-pull), mu)
    assert answer.hook_load == pytest.approx(flexible, rel=1e-10)
    told = answer.model_error * abs(answer.tension).max()
    assert abs(stiff - flexible) <= told < 8 * abs(stiff - flexible)


@pytest.mark.parametrize(
    ("md", "inc", "differs"),
    [
        ([0, 200, 600], [0, 40, 40], -103.52),
        ([0, 300], [0, 60], -110.03),
        ([0, 100, 400], [30, 30, 70], -13.84),
    ],
)
def test_a_bend_at_an_end_takes_from_the_tension(md, inc, differs):
    """Without friction, with a pull of 300 kN; the rod in contact on 1024 elements."""
    answer = soft(cf.well.WellPath.from_survey(md, inc, [20] * len(md)), 0.04445, cf.well.Static(-300e3), 0.25)
    assert abs(differs) <= answer.model_error * answer.tension.max() < 6 * abs(differs)


def test_torque_of_rotating_strings_is_covered():
    """The rod in contact gives 0.54 and 3.4 % less torque than the soft string by Coulomb's law."""
    for name, less in (("P", 0.0054), ("F-12", 0.034)):
        assert less <= soft(well(name), 0.04445, cf.well.RotateOffBottom(), 0.25).model_error < 4 * less


def test_a_snake_that_is_a_small_part_of_a_piece():
    """Above the helix of a vertical string: mu times the wall force of a helix that goes on to its top, by hand."""
    EI, weight, radius, friction = 1228200.0, 241.13, 0.0635, 0.3
    stiffness = cf.Stiffness((1e9, 1e9), 7e8, (EI, EI), 9.4e5)
    path = cf.well.WellPath.from_survey([0, 3000], [0, 0], [0, 0])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(3000, 0.2159, friction)])
    string = cf.well.DrillString([cf.well.Component(None, stiffness, weight, radius)])
    answer = cf.well.torque_and_drag(hole, string, cf.well.Sliding(60e3))
    most, least = (factor * math.cbrt(EI * weight**2) for factor in (5.55, 0.14))
    snake = friction * (0.10795 - radius) * (most**3 - least**3) / (12 * EI * weight)
    assert answer.helical.any() and answer.model_error * 662.6e3 == pytest.approx(snake, rel=0.05)


@pytest.mark.parametrize("length", [3500.0, 4000.0, 4500.0, 4800.0, 5000.0])
def test_snakes_that_a_helix_above_multiplies(length):
    """A string pushed into a horizontal hole whose snake has half the wall force of a helix, in closed form: near
    lock-up this changes the hook load to a multiple."""
    EI, w, r, mu = 2063790.0, 315.0, 0.041, 0.3
    snake = 2 * math.sqrt(EI * w / r)
    thrust, place = snake, snake / (mu * w)
    for part, end in ((0.5, math.sqrt(2) * snake), (1.0, math.inf)):
        k = math.sqrt(part * r / (4 * EI * w))
        angle = min(math.atan(k * end), math.atan(k * thrust) + mu * w * k * (length - place))
        place += (angle - math.atan(k * thrust)) / (mu * w * k)
        thrust = math.tan(angle) / k if angle < math.pi / 2 - 1e-12 else math.inf
    hole = cf.well.Borehole(
        cf.well.WellPath.from_survey([0, 6000], [90, 90], [0, 0]), [cf.well.HoleSection(6000, 2 * (0.064 + r), mu)]
    )
    string = cf.well.DrillString([cf.well.Component(None, cf.Stiffness((1e9, 1e9), 2.6e9, (EI, EI), 1.59e6), w, 0.064)])
    for model in ("soft", "buckled"):
        answer = cf.well.torque_and_drag(hole, string, cf.well.TripIn(), depth=length, model=model)
        told = answer.model_error * abs(answer.tension).max()
        assert thrust + answer.hook_load <= told and not answer.enough
        if length < 4600:
            assert told < 4 * abs(thrust + answer.hook_load)
        else:
            assert math.isinf(told) and "may lock up" in str(answer)


def test_tension_beyond_what_a_pipe_carries_is_told():
    path = cf.well.WellPath.from_survey([0, 1000], [0, 0], [0, 0])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(1000, 0.2159, 0.3)])
    for weight, told in ((-6e6, False), (-8e6, True)):
        answer = cf.well.torque_and_drag(hole, STRING, cf.well.TripOut(weight=weight), model="soft")
        assert ("BEYOND WHAT ANY PIPE CARRIES" in str(answer)) == told


def test_a_random_well():
    """`make random-wells` compares 100 of them; here the rod's answers in one."""
    drawn = random_wells.draw(2)
    for operation in drawn.operations[:2]:
        said, _, _, errors = random_wells.compare(drawn, operation)
        assert said == "rod" and len(errors) == 3 and all(true <= told for told, true in errors.values())
