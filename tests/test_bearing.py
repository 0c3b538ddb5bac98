"""What is told below the table: the largest contact force and moment, and what supports hold with."""

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.bearing import reactions_in_words

pytestmark = pytest.mark.serial
SECTION = cf.Stiffness(shear=(1e6, 1e6), axial=1e6, bending=(100.0, 100.0), torsion=80.0)


def balance(path, supports, loads):
    """(force, moment about the origin) of reactions and of (position, force, moment) of loads, over what they sum up."""
    parts = [(path.position(x.station)[-1], *(values[-1] for values in path.reaction(x))) for x in supports] + loads
    total = np.array([np.concatenate([f, np.cross(at, f) + m]) for at, f, m in parts])
    return np.abs(total.sum(axis=0)).max() / np.abs(total).max()


@pytest.mark.parametrize("off", [0.0, 1e-15, 2e-10, 1e-4])
def test_reactions_balance_the_loads(off):
    """Loads at a support's own station, next to it by rounding, and beside it; supports at both ends and inside."""
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 1)), SECTION, name="beam")
    L = rod.length
    inside = rod.at(0.6 * L)
    supports = [cf.Hinge(rod.end, (0, 1, 0)), cf.Roller(inside, (1, 0, 0)), cf.Clamp(rod.start)]
    places = [rod.at(L * (1 - off)), rod.at(L * (0.6 + off))]
    vectors = [((0, 0, -40.0), (0, 3.0, 0)), ((5.0, 0, -20.0), (0, 1.0, 0))]
    loads = [cf.Force(at, f) for at, (f, _) in zip(places, vectors)] + [
        cf.Moment(at, m) for at, (_, m) in zip(places, vectors)
    ]
    path = cf.solve(cf.Scene([rod], supports, loads), [0.5, 1.0], model="spatial")
    acting = [(path.position(at)[-1], np.array(f), np.array(m)) for at, (f, m) in zip(places, vectors)]
    assert balance(path, supports, acting) < 1e-6
    force, moment = path.reaction(supports[0])
    assert force.shape == moment.shape == (2, 3)
    assert (abs(moment[:, 1]) < 1e-6 * abs(force).max() * L).all()  # a hinge has none about its axis


def test_what_shares_its_place_is_not_told():
    one = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), SECTION, name="one")
    two = cf.Rod(cf.Line((1, 0, 0), (2, 0, 0)), SECTION, name="two")
    supports = [cf.Clamp(one.start), cf.Roller(two.start, (0, 0, 1)), cf.Roller(two.end, (0, 0, 1))]
    loads = [cf.Force(two.end, (0, 0, -1.0)), cf.FollowerForce(one.start, (1.0, 0, 0))]
    path = cf.solve(cf.Scene([one, two], supports, loads, [cf.Joint(one.end, two.start)]), [1.0])
    told = list(reactions_in_words(path))
    assert "Clamp at one.start shares its place with the FollowerForce" in told[0]
    assert "Roller at two.start shares its place with a Joint" in told[1]
    assert "Roller at two.end holds with" in told[2]
    with pytest.raises(cf.SceneError, match="Roller at two.start shares its place with a Joint"):
        path.reaction(supports[1])
    with pytest.raises(cf.SceneError, match="no support of this path's scene"):
        path.reaction(cf.Clamp(one.start))


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
