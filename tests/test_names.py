"""Stations and rods by their names in Python, requests in the forms that files have, and short messages."""

from dataclasses import dataclass

import numpy as np
import pytest

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9, density=7850.0)
FRAME = """
rods = [
  { name = "post", curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 2] }, section = { type = "Circle", diameter = 0.02 }, material = { E = 210e9, density = 7850.0 } },
]
supports = [{ type = "Clamp", station = "post.start" }]
loads = [{ type = "Force", station = "post.end", force = [10, 0, 0] }]
solve = { load_factors = "0:1", elements = 2, degree = 2 }
"""  # noqa: E501


def rods():
    post = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2)), cf.Circle(0.02), STEEL, name="post")
    beam = cf.Rod(cf.Line((0, 0, 2), (1, 0, 2)), cf.Circle(0.02), STEEL, name="beam")
    return [post, beam]


def by_names():
    return cf.Scene(
        rods(),
        supports=[cf.Clamp("post.start"), cf.Roller("beam.end", (0, 0, 1))],
        loads=[
            cf.Force("beam@0.5", (0, 0, -5.0)),
            cf.LineForce("post", cf.signals.AlongTable([0, 2], [(0, 0, 0), (3.0, 0, 0)])),
            cf.Foundation("beam", 10.0),
            cf.Wall("post", (0, 0, 0), (0, 0, 1), 0.5, 1e3),
            cf.Spring("post.end", stiffness=20.0),
            cf.Drag("post", 1.0, current=(1.0, 0, 0)),
        ],
        joints=[cf.Joint("post.end", "beam.start")],
    )


def by_objects():
    post, beam = rods()
    return cf.Scene(
        [post, beam],
        supports=[cf.Clamp(post.start), cf.Roller(beam.end, (0, 0, 1))],
        loads=[
            cf.Force(beam.at(0.5), (0, 0, -5.0)),
            cf.LineForce(post, cf.signals.AlongTable([0, 2], [(0, 0, 0), (3.0, 0, 0)])),
            cf.Foundation(beam, 10.0),
            cf.Wall(post, (0, 0, 0), (0, 0, 1), 0.5, 1e3),
            cf.Spring(post.end, stiffness=20.0),
            cf.Drag(post, 1.0, current=(1.0, 0, 0)),
        ],
        joints=[cf.Joint(post.end, beam.start)],
    )


def test_names_and_objects_are_the_same():
    named, plain = (cf.solve(scene, [1.0], elements=2, degree=2) for scene in (by_names(), by_objects()))
    np.testing.assert_array_equal(named.position("beam.end"), plain.position("beam.end"))
    for given in ("beam.end", named.scene.station("beam.end"), named.scene.supports[1]):
        np.testing.assert_array_equal(named.reaction(given), plain.reaction(plain.scene.supports[1]))
    with pytest.raises(cf.SceneError, match=r"post\.end is no support .*Clamp at post\.start, Roller at beam\.end"):
        named.reaction("post.end")


@pytest.mark.serial
def test_a_support_given_by_name_is_known_as_it_was_given():
    post = rods()[0]
    held = cf.Clamp("post.start")

    def push(t):
        return t, 0, 0

    loads = [cf.Force("post.end", push), cf.PointMass("post.end", 1.0)]
    scene = cf.Scene([post], [held], loads, velocities=[cf.InitialVelocity("post", angular=(0, 0, 0))])
    assert held.station == "post.start" and scene.supports[0].station == post.start
    assert scene.supports_of(held) == scene.supports_of(scene.supports[0]) == [0]
    assert scene.loads[0].force.place == "post.end" and scene.loads[0].force.function is push
    assert scene.loads[0].force(2.0) == (2.0, 0.0, 0.0) and scene.velocities[0].rod is post
    # the same parts belong to another scene too
    other = rods()[0]
    assert cf.Scene([other], [held], loads).loads[0].station.rod is other


@dataclass(frozen=True)
class Own(cf.PointAction):
    station: object


@pytest.mark.serial
def test_a_class_of_ones_own_has_names_too():
    post = rods()[0]
    assert cf.Scene([post], (), [Own("post.end")]).loads[0].station == post.end
    with pytest.raises(cf.SceneError, match=r"Scene.loads\[0\].station = 3: expected a station"):
        cf.Scene([post], (), [Own(3)])


REFUSED = {
    "an unknown station": (lambda r: cf.Scene(r, [cf.Clamp("pots.start")]), "Scene.supports[0].station = 'pots.start'"),
    "its nearest": (lambda r: cf.Scene(r, [cf.Clamp("pots.start")]), "did you mean 'post'?"),
    "no station": (lambda r: cf.Scene(r, [cf.Clamp("post")]), "expected 'rod.start', 'rod.end' or 'rod@s'"),
    "an unknown rod": (lambda r: cf.Scene(r, (), [cf.Foundation("pier", 1.0)]), "Scene.loads[0].rod = 'pier'"),
    "a place inside a wall": (
        lambda r: cf.Scene(r, (), [cf.Wall("beam", (0, 0, 0), (0, 0, 1), 0.1)]), "rod 'beam' lies outside it"),
    "a joint apart": (lambda r: cf.Scene(r, (), (), [cf.Joint("post.start", "beam.start")]), "they are 2 m apart"),
    "a number": (lambda r: cf.Clamp(3), "Clamp.station = 3: expected a station such as rod.end, or its name"),
    "a rod for a station": (lambda r: cf.Clamp(r[0]), "Clamp.station = <Rod 'post': Line, length 2 m>: expected"),
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    make, words = REFUSED[case]
    with pytest.raises(cf.SceneError) as refusal:
        make(rods())
    assert words in str(refusal.value)


def test_what_a_file_says_is_what_solve_takes(tmp_path):
    file = tmp_path / "post.toml"
    file.write_text(FRAME)
    found = cf.read(file)
    scene, settings = found.scene, found.settings
    assert settings["load_factors"] == (0.0, 1.0)
    path = cf.solve(scene, **settings)
    assert path.load_factors[-1] == 1.0
    assert (cf.solve(scene, elements=2, degree=2).load_factors == path.load_factors).all()
    file.write_text(FRAME.replace("0:1", "0.25,1"))
    assert cf.read(file).settings["load_factors"] == [0.25, 1.0]
    file.write_text(FRAME.replace("0:1", "0:1:2"))
    with pytest.raises(cf.SceneError, match="load factors '0:1:2': expected A:B"):
        cf.read(file)


@pytest.mark.parametrize("given", [(0, 1, 2), (1,), (), "0:1"])
def test_tuples_that_are_no_pair_are_refused(given):
    with pytest.raises(cf.SceneError, match=r"expected a tuple \(a, b\), between which .* or a list"):
        cf.solve(by_objects(), given)


def test_one_point_of_a_path_is_a_path():
    path = cf.solve(by_names(), [0.5, 1.0], elements=1, degree=2)
    last, both = path[-1], path[:]
    assert type(last) is type(path) and last.load_factors.tolist() == [1.0] and len(both) == 2
    np.testing.assert_array_equal(last.position("post.end")[0], path.position("post.end")[1])
    assert [part.load_factors[0] for part in path] == [0.5, 1.0]
    with pytest.raises(IndexError, match=r"\[2\]: expected the index of a load factor, a whole number from -2 to 1"):
        path[2]


def soft():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Circle(0.02), cf.Material(E=210.0, density=1.0), name="rod")
    return cf.Scene([rod], [cf.Clamp("rod.start")], [cf.Force("rod.end", (1e-9, 0, 0))])


@pytest.mark.serial
def test_a_probable_mistake_in_units_is_a_warning_where_the_caller_is():
    for call in (lambda: cf.solve(soft(), 1.0, elements=1), lambda: cf.simulate(soft(), 0.01, dt=0.01, elements=1)):
        with pytest.warns(cf.SceneWarning, match="E = 210 Pa is softer than most rubbers") as told:
            call()
        assert told[0].filename == __file__


def test_scenes_and_rods_in_one_line():
    assert repr(by_objects()) == "<Scene: rods post, beam; 2 supports, 6 loads, 1 joints>"
    assert repr(rods()[0]) == "<Rod 'post': Line, length 2 m>"
