"""Events lie between neighbouring points, where the tangent is
singular; each has one kind and is found on two meshes."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from path_scenes import clamped_ring, lees_frame, shallow_arch, torsion_pendulum
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.records import find_again, keep_confirmed
from cosserat_fenicsx.statics.path.recorder import Tracing

DEMOS = Path(__file__).parent.parent / "demos"


def lees_frame_with_a_follower():
    scene = cf.read(DEMOS / "lees_frame.toml").scene
    load = cf.FollowerForce(scene.rod("beam").at(24.0), (0, -1e4, 0))
    return cf.Scene(scene.rods, scene.supports, [load], scene.joints)


def spring():
    """A clamped spring of sixteen turns, compressed by a fifth of its height and more."""
    rod = cf.Rod(cf.Helix((0, 0, 0), (0.05, 0, 0), 16, 0.05), cf.Circle(0.005), cf.Material(E=200e9, nu=0.3))
    pressed = cf.Prescribed(rod.end, displacement=(0, 0, -0.8), rotation=(0, 0, 0))
    return cf.Scene([rod], [cf.Clamp(rod.start), pressed], [])


def told(path):
    return [sentence for sentence in path.why if "negative modes go" in sentence or "not listed" in sentence]


@pytest.mark.serial
def test_an_event_is_not_beyond_the_end_and_of_one_kind():
    scene = lees_frame_with_a_follower()
    assert cf.solve(scene, [3.5], elements=16).events == []
    path = cf.solve(scene, (0.0, 10.0), elements=16)
    assert [event.kind for event in path.events] == ["limit"] * 2
    np.testing.assert_allclose([event.load_factor for event in path.events], [3.53997598, -1.38118014], rtol=1e-8)
    lie_between_their_points(path)


def lie_between_their_points(path):
    eta = path.load_factors
    for event in path.events:
        before, after = eta[event.after], eta[event.after + 1]
        if event.kind == "limit":
            assert (event.load_factor - before) * (event.load_factor - after) > 0
        else:
            assert (event.load_factor - before) * (event.load_factor - after) < 0
        assert event.residual <= 1e-6


@pytest.mark.serial
@pytest.mark.parametrize(
    "scene, end",
    [(shallow_arch()[2], 45.0), (torsion_pendulum()[1], 20.0), (lees_frame()[1], 2e4), (clamped_ring(1.0)[1], 4.0)],
    ids=["arch", "pendulum", "Lee's frame", "ring"],
)
def test_events_lie_between_their_points(scene, end):
    path = cf.solve(scene, (0.0, end), elements=16)
    assert path.events and not told(path)
    lie_between_their_points(path)


def test_divergence_under_a_follower_load():
    """A pinned column, loaded at half its height: tan(k/2) = -k/2, P =
    k^2. The symmetric part is indefinite long before."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0)), cf.Stiffness((np.inf,) * 2, np.inf, (1.0, 4.0), 1.0))
    guides = [cf.Roller(rod.end, axis) for axis in ((1, 0, 0), (0, 1, 0))]
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (1, 0, 0)), *guides], [cf.FollowerForce(rod.at(0.5), (0, 0, -1.0))])
    exact = [4 * brentq(lambda z: np.tan(z) + z, *ends) ** 2 for ends in ((2.0, 2.1), (4.8, 5.0))]
    path = cf.solve(scene, [15.0, 16.0, 18.0, 50.0, 110.0], elements=16, model="spatial")
    assert [(event.kind, event.after) for event in path.events] == [("bifurcation", 1), ("bifurcation", 3)]
    np.testing.assert_allclose([event.load_factor for event in path.events], exact, rtol=1e-7)
    assert (path.negative_modes[:3] == 1).all()
    lie_between_their_points(path)


@pytest.mark.serial
def test_a_slender_spring_is_stable_where_it_bends_sideways():
    """With K bounded by the length of its wire there were negative modes, and a bifurcation at 0.807."""
    path = cf.solve(spring(), (0.0, 0.5), elements=128)
    assert path.stable.all() and path.events == [] and not told(path)


@pytest.mark.serial
def test_events_are_found_again_on_a_finer_mesh():
    path = cf.solve(shallow_arch()[2], [45.0], tol=1e-5)
    assert len(path.events) == 4 and all(0 < event.error <= 1e-5 for event in path.events)
    assert all(np.isnan(event.error) for event in cf.solve(shallow_arch()[2], [45.0], elements=8).events)


@pytest.mark.serial
def test_what_depends_on_the_mesh_is_told(monkeypatch):
    meet = Tracing._meet

    def drifting(self, crossing):
        eta = crossing.point.load_factor + 1e-3 / self.path.elements[0]
        point = dataclasses.replace(crossing.point, load_factor=eta)
        return meet(self, dataclasses.replace(crossing, point=point))

    monkeypatch.setattr(Tracing, "_meet", drifting)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Rectangle(0.2, 0.25), cf.Material(E=210e9, nu=0.3))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])
    path = cf.solve(scene, [0.5, 1.2])
    assert path.events == [] and path.error.max() <= 1e-6
    where, count = sorted(told(path))
    assert where.startswith("a bifurcation near the load factor 0.99") and "could not be confirmed" in where
    assert count.startswith("negative modes go from 0 to 1 on the way to the load factor 1.2")


def test_events_of_two_meshes_are_compared_kind_by_kind():
    def path(*events):
        listed = [cf.Event(kind, eta, np.zeros((1, 3)), 0) for kind, eta in events]
        return SimpleNamespace(events=listed, why=[], load_factors=np.array([0.0, 2.0]))

    fine = path(("limit", 1.0), ("bifurcation", 1.0 + 1e-9), ("bifurcation", 1.5), ("bifurcation", 1.5))
    coarse = path(("bifurcation", 1.0), ("limit", 1.0 + 1e-8), ("bifurcation", 1.5 + 3e-9), ("bifurcation", 1.9))
    left = find_again(fine, coarse)
    assert [event.load_factor for event in left] == [1.9]
    errors = [event.error for event in fine.events]
    np.testing.assert_allclose(errors, [1e-8, 1e-9, 2e-9, np.nan], rtol=1e-3)
    keep_confirmed(fine, 5e-9, left)
    assert [event.load_factor for event in fine.events] == [1.0 + 1e-9, 1.5]
    assert len(fine.why) == 3 and "1.9 of a coarser mesh was not found again" in fine.why[-1]
