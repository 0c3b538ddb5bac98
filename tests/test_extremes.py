"""The largest contact force and moment, below the table."""

import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
SECTION = cf.Stiffness(shear=(1e6, 1e6), axial=1e6, bending=(100.0, 100.0), torsion=80.0)


def test_the_largest_moment_is_found_beyond_a_jump_and_between_nodes():
    """A rod that is clamped inside; a beam under a line load and an end moment, by textbook."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SECTION, name="rod")
    held = cf.Scene([rod], [cf.Clamp(rod.at(3))], [cf.Force(rod.end, (0, 0, 0.01))])
    found = cf.solve(held, [1.0]).largest()["bending moment"]
    assert found.size == pytest.approx(0.07, rel=1e-4) and found.station.s == pytest.approx(3)
    q, M, L = 1e-3, 4e-3, 10.0
    loads = [cf.LineForce(rod, (0, 0, -q)), cf.Moment(rod.start, (0, M, 0))]
    beam = cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1))], loads)
    path = cf.solve(beam, [-1.0, 0.5], elements=2, model="planar")
    found = path.largest()["bending moment"]
    place = L / 2 - M / (q * L)
    assert found.size == pytest.approx(q * place * (L - place) / 2 + M * (1 - place / L), rel=1e-3)
    assert found.station.s == pytest.approx(place, abs=0.2) and found.point == 0


def test_what_is_zero_is_left_out():
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SECTION, name="rod")
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (2.0, 0, 0))]), [1.0])
    assert set(path.largest()) == {"tension"} and path.largest()["tension"].size == pytest.approx(2.0)
