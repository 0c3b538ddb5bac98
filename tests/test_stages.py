"""Loads and supports in stages: independent truths, invariants of what is held and released, and refusals."""

import dataclasses
from math import inf, pi, sqrt

import cosserat_fenicsx as cf
import numpy as np
import pytest

P = 1.2 * pi**2 / 4
# EI = L = 1, inextensible: by a shooting method of its own, (x, z) of the tip, and the side force at which it snaps
THRUST_FIRST, SIDE_FIRST, SNAP = (
    (0.6318313739136124, 0.695606800523303),
    (-0.6623976983603624, 0.6554030492855906),
    (-0.20823910990836952),
)


def column(loads=(), stages=(), supports=None, section=None):
    section = section or cf.Stiffness((inf, inf), inf, (4.0, 1.0), 1.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1), d1=(1, 0, 0)), section, name="rod")
    return cf.Scene([rod], [cf.Clamp("rod.start")] if supports is None else supports, loads, stages=stages)


def tip(path):
    return path.position("rod.end")[-1]


def test_the_order_of_loads_on_a_buckled_column():
    thrust, side = cf.Force("rod.end", (0, 0, -P)), cf.Force("rod.end", (-0.05, 0, 0))
    path = cf.solve(column([thrust], [cf.Stage([side])]), tol=1e-9, branch=1)
    np.testing.assert_allclose(tip(path)[[0, 2]], THRUST_FIRST, rtol=0, atol=1e-8)
    assert path.stage.tolist() == sorted(path.stage) and set(path.stage) == {-1, 0} and path.error.max() <= 1e-9
    path = cf.solve(column([side], [cf.Stage([thrust])]), tol=1e-9)
    np.testing.assert_allclose(tip(path)[[0, 2]], SIDE_FIRST, rtol=0, atol=1e-8)


def test_a_stage_has_events_and_is_followed_in_arc_length():
    path = cf.solve(
        column([cf.Force("rod.end", (0, 0, -P))], [cf.Stage([cf.Force("rod.end", (-0.3, 0, 0))], name="side")]),
        branch=1, elements=24,
    )  # fmt: skip
    snap = next(event for event in path.events if event.stage == 0)
    assert snap.kind == "limit" and path.control == "arc" and path.stage[snap.after] == 0
    assert -0.3 * snap.load_factor == pytest.approx(SNAP, rel=1e-8)
    assert path.load_factors[-1] == 1 and path.stage[-1] == 0


def test_a_ring_that_is_bent_and_then_twisted():
    """A straight rod becomes a ring that a twist of 2 pi sqrt(3) EI/GJ makes unstable (Michell, Zajac)."""
    EI, GJ, most = 0.02, 0.016, 14.5
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 0.3), d1=(1, 0, 0)), cf.Stiffness((inf, inf), inf, (EI, EI), GJ), name="rod")
    end = rod.end
    stages = [
        cf.Stage(supports=[cf.Prescribed(end, rotation=(0, 2 * pi, 0))]),
        cf.Stage(supports=[cf.Prescribed(end, displacement=(0, 0, 0), rotation=(0, 0, most), frame="section")]),
    ]
    # the ring as a whole may turn about its tangent at the clamp: the roller prevents that alone
    scene = cf.Scene([rod], [cf.Clamp(rod.start), cf.Roller("rod@0.15", (0, 1, 0))], stages=stages)
    path = cf.solve(scene, elements=8)
    at = [most * event.load_factor for event in path.events if event.stage == 1]
    np.testing.assert_allclose(at, 2 * pi * sqrt(3) * EI / GJ, rtol=1e-5)
    closed = np.flatnonzero(path.stage == 1)[0]
    np.testing.assert_allclose(path.position(end)[closed:], np.zeros((len(path) - closed, 3)), rtol=0, atol=1e-12)
    force, moment = path.reaction(end)
    assert moment[closed] @ (0, 1, 0) == pytest.approx(2 * pi * EI / 0.3, rel=1e-6)
    assert moment[-1] @ (0, 0, 1) == pytest.approx(most * GJ / 0.3, rel=1e-6)
    # the truths' base state
    assert np.linalg.norm(force[-1]) == pytest.approx(moment[-1, 2] / (0.3 / (2 * pi)), rel=1e-6)


SOFT = cf.Stiffness((40.0, 60.0), 200.0, (4.0, 1.0), 2.0)


@pytest.mark.parametrize("how", [cf.Clamp, cf.Pin, lambda x: cf.Prescribed(x, displacement=(0, 0, 0))])
def test_a_support_holds_what_it_finds_and_leaves_as_its_reaction(how):
    push, hold = cf.Force("rod.end", (0.8, 0.3, -0.5)), how("rod.end")
    stages = [cf.Stage(supports=[hold], release=[push]), cf.Stage(release=[hold], load_factors=[0.5, 1.0])]
    path = cf.solve(column([push], stages, section=SOFT), elements=4)
    place, turned, (force, moment) = path.position("rod.end"), path.rotation("rod.end"), path.reaction(hold)
    pushed, held = path.stage <= 0, path.stage == 0
    begin = np.flatnonzero(held)[0]
    # the support takes over the load, and nothing moves
    np.testing.assert_allclose(place[held], place[[begin - 1] * held.sum()], rtol=0, atol=1e-9)
    np.testing.assert_allclose(turned[held], turned[[begin - 1] * held.sum()], rtol=0, atol=1e-9)
    np.testing.assert_allclose(force[held], path.load_factors[held, None] * push.force, rtol=0, atol=1e-8)
    np.testing.assert_allclose(force[~pushed], [np.multiply(x, push.force) for x in (0.5, 0.0)], rtol=0, atol=1e-8)
    np.testing.assert_allclose(moment, 0, rtol=0, atol=1e-8)
    # half of the load is left, then none
    half = cf.solve(column([push], section=SOFT), [0.5], elements=4)
    np.testing.assert_allclose(place[-2], tip(half), rtol=0, atol=1e-8)
    np.testing.assert_allclose(place[-1], (0, 0, 1), rtol=0, atol=1e-8)


def test_what_a_stage_has_reached_stays():
    """Loads with a unique equilibrium, in parts and one after another, as at once."""

    def loads():
        return (cf.Weight((1.0, 0, -2)), cf.FollowerForce("rod.end", (0, 0.4, 0)), cf.Actuation("rod", (0, 0.5, 0.2)))

    section = dataclasses.replace(SOFT, mass=0.2, inertia=(1e-3, 1e-3, 1e-3))
    weight, follower, muscle = loads()
    stages = [cf.Stage([follower], load_factors=(0, 0.5)), cf.Stage([muscle], load_factors=[0.25])]
    path = cf.solve(column([weight], stages, section=section), elements=6)
    weight, follower, muscle = loads()
    at_once = [weight, dataclasses.replace(follower, force=(0, 0.2, 0)),
               dataclasses.replace(muscle, curvature=(0, 0.125, 0.05))]  # fmt: skip
    other = cf.solve(column(at_once, section=section), [1.0], elements=6)
    np.testing.assert_allclose(tip(path), tip(other), rtol=0, atol=1e-9)
    for name, values in other.fields(-1, "rod").items():
        np.testing.assert_allclose(path.fields(-1, "rod")[name], values, rtol=0, atol=1e-8, err_msg=name)
