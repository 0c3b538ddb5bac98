"""Scenes as plain data and back: the same numbers to the last digit, and no code in data."""

import json

import numpy as np
import pytest
import ufl

import cosserat_fenicsx as cf
from cosserat_fenicsx.parts import NotData, from_data, to_data
from cosserat_fenicsx.scene import action

pytestmark = [pytest.mark.serial, pytest.mark.once]
STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
MATRIX = np.diag([3e6, 4e6, 9e6, 5.0, 6.0, 7.0]) + np.diag([0.1] * 3, 3) + np.diag([0.1] * 3, -3)


def everything():
    """A scene with an item of every class of the package."""
    curves = (
        cf.Line((0, 0, 0), (0.1, 0.2, 1.7)),
        cf.Arc((0, 0, 0), (1.3, 0, 0), 1.1, axis=(0.3, 1.0, 0)),
        cf.Helix((0, 0, 0), (1.0, 0, 0), 3.0, 0.2),
        cf.Spline([(0, 0, 0), (1, 0.1, 0), (2, 0, 0.3), (3, 0.5, 0)], d1=(0, 1, 0.2)),
        cf.UniformCurvature(2.0, (0.3, 0.1, 0.7), frame=(0.5, 0.1, 0.7, 0.3) / np.sqrt(0.84)),
        cf.Line((5, 0, 0), (6, 0, 0)),
        cf.Line((6, 0, 0), (6, 1, 0)),
    )
    sections = (
        cf.Circle(0.1), cf.Tube(0.2, 0.1), cf.Rectangle(0.1, 0.2),
        cf.Stiffness((1e6, float("inf")), 1e7, (10.0, 12.0), 8.0, mass=2.0, inertia=(0.1, 0.2, 0.3)),
        [(0.7, cf.Circle(0.2)), (None, cf.Circle(0.1))], cf.Stiffness(matrix=MATRIX, mass=1.0),
        cf.Circle(0.1),
    )  # fmt: skip
    rods = [
        cf.Rod(curve, section, STEEL, name=f"rod {i}", damping=cf.Damping(drag=0.3) if i == 1 else None)
        for i, (curve, section) in enumerate(zip(curves, sections, strict=True))
    ]
    supports = [
        cf.Clamp(rods[0].start), cf.Pin(rods[1].start), cf.Hinge(rods[2].start, (0.1, 0.7, 0.2)),
        cf.Roller(rods[3].at(0.3), (0.6, 0.7, 0.1)),
        cf.Prescribed(rods[4].start, cf.signals.Ramp((0, 0.1, 0), 0.0, 2.0), (0, 0, 0)),
    ]  # fmt: skip
    end = rods[0].end
    loads = [
        cf.Force(end, (0, 0, -1.0)), cf.Moment(end, cf.signals.Sine((0, 1.0, 0), 2.0, phase=0.3)),
        cf.EccentricForce(end, (1.0, 0, 0), (0.1, 0.2)),
        cf.FollowerForce(end, cf.signals.Triangle((1.0, 0, 0), 0, 1.0, 3.0)),
        cf.FollowerMoment(end, cf.signals.Table([0, 1.0], [(0, 0, 0), (1.0, 0, 0)])),
        cf.LineForce(rods[1], cf.signals.AlongTable([0, 1.0], [(0, 0, 0), (0, 0, 1.0)]), permanent=True),
        cf.LineMoment(rods[2], cf.signals.AlongPieces([(0.5, (0, 0, 1.0))])), cf.Weight(permanent=True),
        cf.Force(end, cf.signals.Step((0, 0, 1.0), 0.5), jumps=(0.7,)),
        cf.Force(end, cf.signals.RunUp((0, 0, 1.0), 0.0, 0.5)),
        cf.Foundation(rods[1], 3.0, direction=(0.3, 0.4, 0.7)), cf.Spring(end, 3.0, rotational=0.1),
        cf.Dashpot(end, 3.0), cf.Drag(rods[1], 0.3, 0.1, current=(0.1, 0, 0)), cf.PointMass(end, 3.0),
        cf.Wall(rods[5], (5, 0, 0), (1, 0, 0), 0.1),
    ]  # fmt: skip
    joints = [cf.Joint(rods[5].end, rods[6].start, release=(0.2, 0.5, 0.9))]
    velocities = [cf.InitialVelocity(rods[5], linear=(0, 1.0, 0), angular=(0, 0, 0.3))]
    return cf.Scene(rods, supports, loads, joints, "everything", velocities)


def test_back_to_the_last_digit():
    scene = everything()
    data = to_data(scene)
    text = json.dumps(data)
    again = from_data(cf.Scene, json.loads(text))
    assert json.dumps(to_data(again)) == text
    for one, other in zip(scene.rods, again.rods, strict=True):
        s = np.linspace(0, one.length, 7)
        assert np.array_equal(one.curve.position(s), other.curve.position(s))
        assert np.array_equal(one.curve.frame(s), other.curve.frame(s))
        assert all(map(np.array_equal, one.stiffness_at(s)[:4], other.stiffness_at(s)[:4]))
    assert again.title == "everything" and again.loads[0].station.rod is again.rods[0]


def test_what_has_no_form_as_data_is_named():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Circle(0.1), STEEL, name="rod")
    cone = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), lambda s: cf.Circle(0.1 + 0.01 * s), STEEL, name="cone")

    class Own(cf.PointAction):
        station = rod.end
        work = staticmethod(lambda point, test, f: ufl.dot(f, test.phi_r))

        def data(self, rod, s):
            return (action.vector((0, 0, 1.0), "N"),)

    for scene, words in (
        (cf.Scene([cone]), r"rods\[0\].section: a function written in Python"),
        (
            cf.Scene([rod], loads=[cf.Force(rod.end, lambda t: (t, 0, 0))]),
            r"loads\[0\].force: a function",
        ),
        (cf.Scene([rod], loads=[Own()]), r"loads\[0\]: a part of the class Own cannot"),
    ):
        with pytest.raises(NotData, match=words):
            to_data(scene)


@pytest.mark.parametrize("damage", [
    None, [], {}, {"title": "", "rods": 3}, {"type": "os.system"},
    {"title": "", "rods": [{"type": "Popen", "args": "true"}], "supports": [], "loads": [], "joints": [],
     "velocities": []},
    {"title": "", "rods": [{"type": "Circle", "diameter": 1.0}], "supports": [], "loads": [], "joints": [],
     "velocities": []},
])  # fmt: skip
def test_data_of_anything_else_are_refused(damage):
    with pytest.raises(cf.SceneError):
        from_data(cf.Scene, damage)
