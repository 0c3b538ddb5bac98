"""Stability of strings, hung at length and on the low side of a hole; the snake beyond, by a small-slope theory."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import ufl
from scipy.integrate import trapezoid
from scipy.special import ai_zeros

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import TubeWall
from cosserat_fenicsx.algebra.newton import LimitedNewton
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.statics.problem import solvers_of
from cosserat_fenicsx.well.rod.rod_in_hole import solve_in_hole

pytestmark = pytest.mark.serial
EI, W, R, KP = 1228200.0, 241.13, 0.04445, 1e9
#: Wave number of the snake, and the load at which it begins.
K, F_SNAKE = (W / (EI * R)) ** 0.25, 2 * math.sqrt(EI * W / R)


@pytest.mark.parametrize("length", [1000.0, 8050.0])  # w L^3/EI = 2e5 and 1e8
def test_a_hanging_string_is_stable_until_its_lower_end_buckles(length):
    """Pushed up by F at its free end: EI theta'' = (w x - F) theta, theta'(0) = 0, so that Ai' has a zero there."""
    pipe = cf.Stiffness((1.35e8, 1.35e8), 7e8, (EI, EI), 1e6)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -length)), pipe)
    critical = -ai_zeros(1)[1][0] * (W**2 * EI) ** (1 / 3)
    for share, negative in ((0.0, 0), (0.995, 0), (1.005, 2)):
        push = [cf.Force(rod.end, (0, 0, share * critical))] if share else []
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.LineForce(rod, (0, 0, -W)), *push])
        steps = cf.StepControl(adaptive=False)
        path = cf.solve(scene, [1.0], model="spatial", elements=int(length / 12), degree=3, steps=steps)
        assert path.negative_modes.tolist() == [negative]


@dataclass(frozen=True)
class Level(cf.PointAction):
    """Holds the rotation of a station about the second axis, almost."""

    station: cf.PointAction

    scaled = False

    def data(self, rod, s):
        return action.vector((0, 1.0, 0), "1"), action.scalar(1e4 * EI, "N m/rad")

    @staticmethod
    def work(point, test, axis, c):
        return -c * ufl.dot(point.theta, axis) * ufl.dot(test.phi, axis)


@dataclass(frozen=True)
class FullWeight(cf.LineAction):
    """A weight that the load factor does not multiply."""

    rod: cf.Rod

    scaled, work = False, "force"

    def data(self, rod, s):
        return (action.vector(np.tile((0, 0, W), (len(s), 1)), "N/m"),)


def half_wave():
    """A rod of half a wave on the low side of a horizontal hole, its ends on the line where it lies, and its load."""
    length, low = math.pi / K, R + W / KP
    path = cf.well.WellPath.from_survey([0, length + 20], [90, 90], [0, 0])
    pipe = cf.Stiffness((math.inf, math.inf), math.inf, (EI, EI), 1e6)
    rod = cf.Rod(cf.Line((10, 0, low), (10 + length, 0, low)), pipe)
    wall = TubeWall(rod, path, radius=0.0635 + R, contact_radius=0.0635, stiffness=KP, begins=10.0)
    held = [cf.Hinge(rod.start, (0, 0, 1)), cf.Roller(rod.end, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1))]
    loads = [FullWeight(rod), cf.Force(rod.end, (-F_SNAKE, 0, 0)), wall, Level(rod.end)]
    return cf.Scene([rod], held, loads), rod, low


def test_the_snake_begins_at_its_load_and_has_its_amplitude():
    """theta'''' - 6 theta'^2 theta'' + beta theta'' + sin theta = 0 with wave number 1: amplitudes 0.2708936 at beta =
    2.1 and 0.5486839 at 2.4, where its pressures over w are 0.639169 to 1.858649."""
    scene, rod, low = half_wave()
    layout = Layout.of(scene, 16)
    with solvers_of(scene, layout, degree=3) as (problem, _, stability):
        model = problem.model
        s = layout.node_s(model.nodes)[0] * rod.length
        for share, amplitude, negative in (
            (0.9999, 0.0, 0),
            (1.0001, 0.0, 1),
            (1.05, 0.27089361, 0),
            (1.2, 0.5486839, 0),
        ):
            problem.set_load_factor(share)
            theta, slope = amplitude * np.sin(K * s), amplitude * K * np.cos(K * s)
            side, down = np.sin(theta), np.cos(theta)
            r = np.stack([s, low * side, low * (down - 1)], axis=1) / model.scales.length
            q = np.stack([np.ones_like(s), 0 * s, low * side * slope / 2, low * down * slope / 2], axis=1)
            rq = np.concatenate([r, q / np.linalg.norm(q, axis=1)[:, None]], axis=1)
            n = np.tile((-share * F_SNAKE / model.scales.force, 0.0, 0.0), (16, 3, 1))
            problem.begin_at(model.unknowns_of(rq), n, np.zeros_like(problem.multipliers()))
            newton = LimitedNewton(problem, 0.1, 0.1)
            assert min(newton.step().moved for _ in range(8)) < 1e-12
            y, z = (model.snapshot()[0][:, 1:3] * model.scales.length + (0.0, low)).T
            assert np.abs(np.arctan2(y, z)).max() == pytest.approx(amplitude, rel=2e-4, abs=1e-9)
            assert stability.count() == negative
        force = model.densities.here()[1][..., :3] * model.scales.force / model.scales.length / W
        pressure = np.linalg.norm(force, axis=2)[1:-1]  # at the ends supports share the load
        assert pressure.min() == pytest.approx(0.639169, rel=0.03)
        assert pressure.max() == pytest.approx(1.858649, rel=3e-3)


@pytest.mark.parametrize("share, stable", [(0.9, True), (1.1, False)])
def test_a_long_string_on_the_low_side_says_that_it_would_snake(share, stable):
    path = cf.well.WellPath.from_survey([0, 300], [90, 90], [0, 0])
    pipe = cf.Stiffness((1.35e8, 1.35e8), 7e8, (EI, EI), 1e6)
    given = {"radius": 0.0635 + R, "rings": [(200.0, 0.0, 0.1)], "bottom_tension": -share * F_SNAKE}
    answer = solve_in_hole(path, [200.0], pipe, W, 0.0635, elements=512, **given)
    assert (answer.negative_modes == 0) is stable
    assert answer.hook_load == pytest.approx(-share * F_SNAKE, rel=1e-9)


@pytest.mark.parametrize("name", ["helix", "helix at 400 kN"])
def test_the_helix_of_a_thrust(name):
    """A weightless rod with finite EA and GA in a frictionless cylinder: a Cosserat helix in the middle."""
    case = json.loads((Path(__file__).parent / "reference" / "rod_in_hole.json").read_text(encoding="utf-8"))[name]
    length, radius = 250.0, case["r"]
    path = cf.well.WellPath.from_survey([0, length + 10], [0, 0], [0, 0])
    pipe = cf.Stiffness((case["GA"],) * 2, case["EA"], (case["EI"],) * 2, case["EI"])
    answer = solve_in_hole(
        path, [length], pipe, 1e-6, 0.05, radius=0.05 + radius, rings=[(length, 0.0, 0.05)],
        bottom_tension=-case["F"], extensible=True, helix=True, tol=1e-3,
    )  # fmt: skip
    middle = (answer.s > 0.35 * length) & (answer.s < 0.65 * length)
    turns = np.polyfit(answer.s[middle], np.unwrap(answer.side[middle]), 1)[0]
    assert abs(turns) == pytest.approx(case["turn_rate"], rel=1e-6) and answer.negative_modes == 0
    assert answer.side_force[middle] == pytest.approx(case["contact_per_reference_length"], rel=1e-4)
    s, z = answer.s[middle], answer.position[middle, 2]
    shortening = 1 - (z[-1] - z[0]) / (s[-1] - s[0])
    assert shortening == pytest.approx(case["shortening"], rel=3e-5)  # the wall gives way


def test_a_string_that_is_pressed_on_its_bit_is_a_helix():
    """In a vertical hole, hung from a clamp: it is as slender a helix everywhere as its compression F there asks for,
    with sqrt(F/(2 EI)) rad per m and r F^2/(4 EI) of the wall, and it is stable, unlike the straight string."""
    length, thrust = 500.0, 150e3
    path = cf.well.WellPath.from_survey([0, length + 10], [0, 0], [0, 0])
    pipe = cf.Stiffness((1.35e8, 1.35e8), 7e8, (EI, EI), 1e6)
    given = {"radius": 0.0635 + R, "rings": [(length, 0.0, 0.1)], "bottom_tension": -thrust}
    straight = solve_in_hole(path, [length], pipe, W, 0.0635, elements=256, **given)
    answer = solve_in_hole(path, [length], pipe, W, 0.0635, helix=True, **given)
    assert straight.distance.max() < 1e-9 and straight.negative_modes > 10
    assert answer.negative_modes == 0 and answer.error < 1e-4
    assert answer.hook_load == pytest.approx(W * length - thrust, rel=1e-9)
    wound = (answer.s > 50) & (answer.s < 480)
    F = thrust - W * (length - answer.s)
    rate = np.gradient(np.unwrap(answer.side), answer.s)
    assert rate[wound] == pytest.approx(np.sqrt(F / (2 * EI))[wound], rel=1e-3)
    pressure = (answer.node_force / answer.node_length)[wound]
    assert pressure == pytest.approx((R * F**2 / (4 * EI))[wound], rel=2e-2)
    s, z = answer.s[wound], answer.position[wound, 2]
    assert np.ptp(s) - np.ptp(z) == pytest.approx(trapezoid((R**2 * F / (4 * EI))[wound], s), rel=1e-3)


@pytest.mark.parametrize(("inclination", "operation"), [(45, cf.well.Static(250e3)), (60, cf.well.Sliding(240e3))])
def test_a_string_in_a_plane_hole_leaves_the_plane_where_it_would_buckle(inclination, operation):
    """Straight, and beyond the load of a snake: in the plane Newton's method keeps the symmetry."""
    path = cf.well.WellPath.from_survey([0, 300, 650], [inclination] * 3, [0, 0, 0])
    hole = cf.well.Borehole(path, cf.well.HoleSection(650.0, 0.2159, 0.2))
    string = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    found = cf.well.torque_and_drag(hole, string, operation, mud=cf.well.Mud(1200.0), depth=600.0, model="rod")
    assert found.solved.negative_modes == 0 and found.enough and any("begun as a helix" in line for line in found.why)
    assert np.abs(found.offset[:, 1]).max() > 0.01
