"""Published problems of statics against independently computed
numbers (tests/reference/statics.json, make_statics.py)."""

import json
from pathlib import Path

import numpy as np
import pytest
import random_comparison
import random_scenes
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.accuracy import on_mesh
from cosserat_fenicsx.statics.problem import solvers_of

pytestmark = pytest.mark.serial  # the references are computed by scipy and slow
TRUTH = json.loads((Path(__file__).parent / "reference" / "statics.json").read_text(encoding="utf-8"))
RIGID = (np.inf, np.inf)


def unit_line(section, **more):
    return cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0), **more), section)


def held(rod, *loads):
    return cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def number(x):
    return np.inf if x == "inf" else x


def test_elastica():
    """Mattiasson 1981: w, u and tip angle of an inextensible cantilever."""
    rod = unit_line(cf.Stiffness(RIGID, np.inf, (1.0, 1.0), 1.0))
    values = TRUTH["elastica"]["values"]
    path = cf.solve(held(rod, cf.Force(rod.end, (0, 0, 1.0))), [v["load"] for v in values], tol=1e-9)
    exact = [(-v["u"], 0, v["w"]) for v in values]
    np.testing.assert_allclose(path.displacement(rod.end), exact, atol=2e-10)
    np.testing.assert_allclose(path.rotation_angle(rod.end), [v["angle"] for v in values], atol=2e-10)


@pytest.mark.parametrize("value", TRUTH["bend_45"]["values"], ids=lambda v: f"{v['section']}, {v['load']}")
def test_45_degree_bend(value):
    """Bathe & Bolourchi 1979; tol 1e-7 holds between element ends too."""
    rod = cf.Rod(
        cf.Arc((0, 100.0, 0), (0, 0, 0), np.pi / 4),
        cf.Stiffness((value["GA"],) * 2, 1e7, (1e7 / 12,) * 2, value["GJ"]),
    )
    path = cf.solve(held(rod, cf.Force(rod.end, (0, 0, value["load"]))), [1.0], tol=1e-7)
    np.testing.assert_allclose(path.position(rod.end)[0], value["position"], rtol=1e-8)
    np.testing.assert_allclose(path.rotation(rod.end)[0], value["quaternion"], atol=1e-8)
    assert path.stable[0] and path.error[0] <= 1e-7


def test_helical_roll_up():
    """Ibrahimbegovic 1997: ten turns under an end moment and a force normal to their plane."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10.0, 0, 0)), cf.Stiffness((1e4, 1e4), 1e4, (1e2, 1e2), 1e2))
    scene = held(rod, cf.Force(rod.end, (0, 0, 50.0)), cf.Moment(rod.end, (0, 0, 200 * np.pi)))
    values = TRUTH["helical_roll_up"]["values"]
    path = cf.solve(scene, [v["load_factor"] for v in values], elements=40)
    np.testing.assert_allclose(path.position(rod.end), [v["position"] for v in values], atol=1e-6)
    found = path.rotation(rod.end)
    for q, v in zip(found, values, strict=True):
        assert abs(q @ v["quaternion"]) == pytest.approx(1, abs=1e-10)


@pytest.mark.parametrize("value", [v for v in TRUTH["follower_force"]["values"] if v["load"] <= 10],
                         ids=lambda v: f"{v['load']}, EA {v['EA']}")  # fmt: skip
def test_follower_force(value):
    rod = unit_line(cf.Stiffness((number(value["GA"]),) * 2, number(value["EA"]), (1.0, 1.0), 1.0), d1=(0, 1, 0))
    path = cf.solve(held(rod, cf.FollowerForce(rod.end, (1.0, 0, 0))), [value["load"]], tol=1e-7)
    np.testing.assert_allclose(path.position(rod.end)[0], (value["x"], value["y"], 0), atol=1e-8)
    assert path.rotation_angle(rod.end)[0] == pytest.approx(abs(value["angle"]), abs=1e-8)


def test_hinged_frame():
    """Two legs and a hinge between them, turned into an odd plane."""
    turn = Rotation.from_rotvec([0.3, 0.8, -0.5])

    def at(x, y):
        return tuple(turn.apply([x, y, 0.0]))

    section = cf.Stiffness((5e3, 5e3), 1e4, (1.0, 1.0), 1.0)
    column = cf.Rod(cf.Line(at(0, 0), at(0, 1)), section, name="column")
    beam = cf.Rod(cf.Line(at(0, 1), at(1, 1)), section, name="beam")
    scene = cf.Scene(
        [column, beam],
        [cf.Clamp(column.start), cf.Clamp(beam.end)],
        [cf.Force(column.at(0.5), at(1, 0))],
        [cf.Joint(column.end, beam.start, release=tuple(turn.apply([0, 0, 1.0])))],
    )
    values = TRUTH["hinged_frame"]["values"]
    path = cf.solve(scene, [v["load"] for v in values], tol=1e-8)
    for name, station in (("mid_column", column.at(0.5)), ("elbow", column.end), ("elbow", beam.start)):
        moved = turn.inv().apply(path.displacement(station))
        np.testing.assert_allclose(moved, [(*v[name], 0) for v in values], atol=1e-8)


def test_path_independence():
    """A load in 1, 8, 10 or 160 steps, or by way of twice or minus the load: one state to round-off."""
    rod = cf.Rod(cf.UniformCurvature(1.0, (0.8, -0.5, 1.0)), cf.Stiffness((1e3, 2e3), 3e3, (1.0, 2.0), 0.8))
    scene = held(rod, cf.Force(rod.end, (0.7, 1.0, -0.8)), cf.Moment(rod.end, (0.5, -0.4, 0.6)))
    ways = [[1.0], np.arange(1, 9) / 8, np.arange(1, 11) / 10, np.arange(1, 161) / 160, [2.0, 1.0], [-1.0, 1.0]]
    shapes = [cf.solve(scene, way, elements=6).centreline() for way in ways]
    for shape in shapes[1:]:
        np.testing.assert_allclose(shape, shapes[0], atol=1e-12)


def test_order_of_loads_does_not_matter():
    """Force then moment, moment then force, both at once."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((1e3, 2e3), 3e3, (1.0, 2.0), 0.8))
    force, moment = cf.Force(rod.end, (0.7, 1.0, -0.8)), cf.Moment(rod.end, (0.5, -0.4, 0.6))
    together = cf.solve(held(rod, force, moment), [1.0], elements=6)
    with solvers_of(held(rod, force, moment), together.layout) as (problem, newton, _):
        newton.allow(10)
        for first in (force, moment):
            alone = cf.solve(held(rod, first), [1.0], elements=6)
            problem.load(held(rod, force, moment), together.layout)
            problem.set_load_factor(1.0)
            (rq,), (n,) = on_mesh(alone, together.layout)
            problem.begin_at(problem.model.unknowns_of(rq), n, alone._records[0].reactions)
            assert newton.solve().converged
            rq, _ = problem.model.snapshot()
            np.testing.assert_allclose(rq, together._records[0].rq, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "drawn", [*random_scenes.scenes(10, first=20), random_scenes.draw(5097)], ids=lambda drawn: str(drawn.seed)
)
def test_random_scenes(drawn):
    """`make random` solves 200 of them. The last is so slender that rounding makes its tangent inexact for bending."""
    verdict, rows = random_comparison.compare(drawn)
    assert verdict.startswith("connected")
    for tol, said, errors, estimates, rounding, _ in rows:
        assert (errors <= np.where(rounding, np.maximum(estimates, tol), tol)).all(), (tol, said)
        assert (estimates[~rounding] <= tol).all()
        assert (errors[0] <= max(estimates[0], 1e-10)) and estimates[0] <= 30 * max(errors[0], 1e-11)
        told = ~rounding & (errors > random_comparison.LEAST)
        assert (0.8 * errors <= estimates)[told].all() and (estimates <= 30 * errors)[told].all(), (errors, estimates)
