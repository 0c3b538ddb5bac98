"""Loads and supports in stages: independent truths, invariants of what is held and released, and refusals."""

import dataclasses
from math import inf, pi, sqrt

import cosserat_fenicsx as cf
import numpy as np
import pytest
from cosserat_fenicsx.cli.explain import explain

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


def test_the_order_of_loads_on_a_buckled_column(truth):
    thrust, side = cf.Force("rod.end", (0, 0, -P)), cf.Force("rod.end", (-0.05, 0, 0))
    path = cf.solve(column([thrust], [cf.Stage([side])]), tol=1e-9, branch=1)
    truth("buckled column, thrust before side load, end over length", tip(path)[[0, 2]], THRUST_FIRST, 1e-8, of=1.0)
    assert path.stage.tolist() == sorted(path.stage) and set(path.stage) == {-1, 0} and path.error.max() <= 1e-9
    path = cf.solve(column([side], [cf.Stage([thrust])]), tol=1e-9)
    truth("buckled column, side load before thrust, end over length", tip(path)[[0, 2]], SIDE_FIRST, 1e-8, of=1.0)


@pytest.mark.serial
def test_a_stage_has_events_and_is_followed_in_arc_length(truth):
    path = cf.solve(
        column([cf.Force("rod.end", (0, 0, -P))], [cf.Stage([cf.Force("rod.end", (-0.3, 0, 0))], name="side")]),
        branch=1, elements=24,
    )  # fmt: skip
    snap = next(event for event in path.events if event.stage == 0)
    assert snap.kind == "limit" and path.control == "arc" and path.stage[snap.after] == 0
    truth("buckled column, side load at which it snaps", -0.3 * snap.load_factor, SNAP, 1e-8)
    assert path.load_factors[-1] == 1 and path.stage[-1] == 0


@pytest.mark.serial
def test_a_ring_that_is_bent_and_then_twisted(truth):
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
    for angle in at:
        truth("twist at which a bent ring becomes unstable (Michell, Zajac)", angle, 2 * pi * sqrt(3) * EI / GJ, 1e-5)
    closed = np.flatnonzero(path.stage == 1)[0]
    np.testing.assert_allclose(path.position(end)[closed:], np.zeros((len(path) - closed, 3)), rtol=0, atol=1e-12)
    force, moment = path.reaction(end)
    assert moment[closed] @ (0, 1, 0) == pytest.approx(2 * pi * EI / 0.3, rel=1e-6)
    assert moment[-1] @ (0, 0, 1) == pytest.approx(most * GJ / 0.3, rel=1e-6)
    # the truths' base state
    assert np.linalg.norm(force[-1]) == pytest.approx(moment[-1, 2] / (0.3 / (2 * pi)), rel=1e-6)


SOFT = cf.Stiffness((40.0, 60.0), 200.0, (4.0, 1.0), 2.0)
HEAVY = dataclasses.replace(SOFT, mass=0.2, inertia=(1e-3, 1e-3, 1e-3))


@pytest.mark.serial
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


@pytest.mark.serial
def test_a_reaction_that_the_structure_cannot_carry():
    """A column is pressed with more than its load as a cantilever, and released: it would jump."""
    press = cf.Prescribed("rod.end", displacement=(0, 0, -0.02))
    stages = [cf.Stage(supports=[press], load_factors=[1.0]), cf.Stage(release=[press])]
    with pytest.raises(cf.NotConverged, match=r"^stages\[1\]: .* may be unstable: then release it where"):
        cf.solve(column([cf.Force("rod@0.5", (0.5, 0, 0))], stages, section=SOFT), elements=2, control="load")


def test_what_a_stage_has_reached_stays():
    """Loads with a unique equilibrium, in parts and one after another, as at once."""

    def loads():
        return (cf.Weight((1.0, 0, -2)), cf.FollowerForce("rod.end", (0, 0.4, 0)), cf.Actuation("rod", (0, 0.5, 0.2)))

    weight, follower, muscle = loads()
    stages = [cf.Stage([follower], load_factors=(0, 0.5)), cf.Stage([muscle], load_factors=[0.25])]
    path = cf.solve(column([weight], stages, section=HEAVY), elements=6)
    weight, follower, muscle = loads()
    at_once = [weight, dataclasses.replace(follower, force=(0, 0.2, 0)),
               dataclasses.replace(muscle, curvature=(0, 0.125, 0.05))]  # fmt: skip
    other = cf.solve(column(at_once, section=HEAVY), [1.0], elements=6)
    np.testing.assert_allclose(tip(path), tip(other), rtol=0, atol=1e-9)
    for name, values in other.fields(-1, "rod").items():
        np.testing.assert_allclose(path.fields(-1, "rod")[name], values, rtol=0, atol=1e-8, err_msg=name)


def test_a_permanent_load_alone_is_there_before_the_first_stage():
    """A support holds what it has bent, and takes it over."""
    push, hold = cf.Force("rod.end", (0.8, 0.3, -0.5), permanent=True), cf.Pin("rod.end")
    path = cf.solve(column([push], [cf.Stage(supports=[hold], release=[push], load_factors=[1.0])], section=SOFT),
                    elements=4)  # fmt: skip
    bent = cf.solve(column([dataclasses.replace(push, permanent=False)], section=SOFT), [1.0], elements=4)
    np.testing.assert_allclose(path.position("rod.end"), tip(bent)[None].repeat(len(path), 0), rtol=0, atol=1e-9)
    np.testing.assert_allclose(path.reaction(hold)[0][-1], push.force, rtol=0, atol=1e-8)


@pytest.fixture(scope="module")
def held():
    """A push, a pin that takes over from it, a side force, and the pin's release."""
    push, pin, side = cf.Force("rod.end", (0.8, 0.3, -0.5)), cf.Pin("rod@0.5"), cf.Force("rod@0.7", (0.1, 0.2, 0))
    stages = [
        cf.Stage(supports=[pin], release=[push], name="hold"),
        cf.Stage([side]),
        cf.Stage(release=["rod@0.5"]),
    ]
    return cf.solve(column([push], stages, section=SOFT))


@pytest.mark.serial
def test_errors_of_stages_are_those_of_the_whole_history(held):
    """Against the same path on a mesh four times as fine."""
    fine = cf.solve(held.scene, elements=4 * max(held.elements))
    assert fine.stage.tolist() == held.stage.tolist() and held.error.max() <= 1e-6
    off = np.abs(held.displacement("rod.end") - fine.displacement("rod.end")).max(axis=1)
    assert (off[1:] <= held.errors.position[1:] * held.largest_displacement()[1:]).all()


def test_a_saved_path_has_its_stages(held, tmp_path_all):
    held[3:14].save(tmp_path_all / "path.h5")
    back = cf.read_path(tmp_path_all / "path.h5")
    np.testing.assert_array_equal(back.stage, held.stage[3:14])
    for a, b in zip(back.reaction("rod@0.5"), held.reaction("rod@0.5"), strict=True):
        np.testing.assert_array_equal(a, b[3:14])
    np.testing.assert_array_equal(back.force("rod@0.3"), held.force("rod@0.3")[3:14])
    held.write(tmp_path_all / "path.csv")
    assert (tmp_path_all / "path.csv").read_text().startswith("load factor,stage,")


def test_a_path_goes_on_from_another_one(held):
    scene = held.scene
    path = cf.solve(dataclasses.replace(scene, stages=()), elements=8)
    for count in (1, 3):
        path = cf.solve(dataclasses.replace(scene, stages=scene.stages[:count]), elements=8, start=path)
    whole = cf.solve(scene, elements=8)
    np.testing.assert_allclose(path.position("rod.end"), whole.position("rod.end"), rtol=0, atol=1e-9)
    assert path.iterations[path.stage < 0].sum() == whole.iterations[whole.stage < 0].sum()
    ended = cf.solve(scene, elements=8, until=lambda p: p.stage[-1] == 1 and p.load_factors[-1] > 0.5)
    assert ended.stage[-1] == 1 and 0.5 < ended.load_factors[-1] < 1
    again = cf.solve(scene, elements=8, start=ended)  # the stage that was not followed to its end anew
    np.testing.assert_allclose(again.position("rod.end"), whole.position("rod.end"), rtol=0, atol=1e-9)
    assert str(cf.Interrupted(ended)).startswith(f"interrupted after {len(ended)} load factors")
    with pytest.raises(cf.SceneError, match=r"start: expected a Path of this scene with fewer stages: dataclasses"):
        cf.solve(column([], [cf.Stage([cf.Force("rod.end", (1, 0, 0))])]), start=whole)
    kept = dataclasses.replace(scene.stages[0], release=())
    for other in ({"loads": [*scene.loads, cf.Force("rod.end", (1, 0, 0))]}, {"stages": [kept, *scene.stages[1:]]}):
        with pytest.raises(cf.SceneError, match="start: expected a Path of this scene"):
            cf.solve(dataclasses.replace(scene, **other), elements=8, start=path)
    with pytest.raises(cf.SceneError, match="start: expected a Path of degree 4 with 5 Gauss points"):
        cf.solve(scene, elements=8, gauss_points=5, start=path)


@pytest.mark.serial
def test_stages_in_a_scene_file(held, tmp_path_all):
    cf.write(held.scene, tmp_path_all / "scene.toml")
    text = (tmp_path_all / "scene.toml").read_text()
    assert 'release = ["stages[0].supports[0]"]' in text and 'load_factors = "0.0:1.0"' in text
    path = cf.read(tmp_path_all / "scene.toml").run(elements=8)
    np.testing.assert_array_equal(path.position("rod.end"), cf.solve(held.scene, elements=8).position("rod.end"))
    told = explain(held.scene, (0.0, 1.0), {})
    assert (
        "Stage hold: holds Pin at rod@0.5; releases Force at rod.end." in told and "Stage 1: applies Force at" in told
    )
    assert "Then stages[0] ('hold'): load factor 0 to 1 in steps the solver chooses; model: spatial: " in told


PUSH, SIDE = cf.Force("rod.end", (1, 0, 0)), cf.Force("rod@0.7", (0, 1, 0))
PIN = cf.Pin("rod.end")


@pytest.mark.serial
@pytest.mark.parametrize(
    ("refused", "words"),
    [
        (lambda: cf.Stage(), "expected a load, a support or a release: a stage without any changes nothing"),
        (lambda: column([PUSH], [cf.Stage([PUSH])]), "is loads[0] already: expected each load and support in one"),
        (lambda: column([PUSH], [cf.Stage([SIDE, SIDE])]), "loads[1], Force at rod@0.7, is stages[0].loads[0] already"),
        (lambda: column([PUSH], [cf.Stage(release=[SIDE])]), "names Force at rod@0.7, which is not there: expected"),
        (lambda: column([PUSH], [cf.Stage(release="rod.end")]), "names rod.end, which is not there: expected"),
        (lambda: column([PUSH], 2 * [cf.Stage(release=[PUSH])]), "loads[0] has been released, or replaced, before"),
        (lambda: column([PUSH], [cf.Stage(release=[PUSH, "loads[0]"])]), "names loads[0] twice: expected it once"),
        (lambda: column([PUSH], [cf.Stage([cf.Spring("rod.end", 1.0)])]), "a Spring is not multiplied by the"),
        (lambda: cf.solve(column([PUSH], [cf.Stage(release="rod.start")])), "stages[0]: Scene.supports: nothing holds"),
        (lambda: column([PUSH], [cf.Stage(supports=[cf.Pin("rod.start")])]), "hold the same motion twice"),
        (lambda: cf.solve(column([PUSH], [cf.Stage([SIDE])]), [0.5]), "load_factors end at 0.5, and stages[0] goes on"),
        (lambda: cf.solve(column([PUSH, cf.Plane((0, 0, -1), (0, 0, 1), friction=0.1, contact_radius=0.1)],
                                 [cf.Stage([SIDE])])), "has a memory, which stages do not pass on"),
        (lambda: column([PUSH], [cf.Stage(supports=[PIN]), cf.Stage(release=[PIN], load_factors=[0.5]),
                                 cf.Stage([SIDE])]),
         "stages[1].load_factors end at 0.5, and a stage follows: expected 1"),
        (lambda: cf.solve(column([PUSH], [cf.Stage([SIDE])]), elements=2).modes(1), "path.part(stage).modes(count)"),
        (lambda: cf.buckling(column([PUSH], [cf.Stage([SIDE])]), 1), "buckling does not support stages: expected"),
        (lambda: cf.modes(column([PUSH], [cf.Stage([SIDE])], section=HEAVY), 1), "modes does not support stages"),
        (lambda: cf.simulate(column([PUSH], [cf.Stage([SIDE])], section=HEAVY), 1), "simulate does not support stages"),
        (lambda: cf.solve(column([PUSH], [cf.Stage([SIDE])]), elements=2).sensitivity(tip, ["loads[0].force[0]"]),
         "not known along a path through stages"),
    ],
)  # fmt: skip
def test_what_stages_refuse(refused, words):
    with pytest.raises(cf.SceneError) as found:
        refused()
    assert words in str(found.value)
