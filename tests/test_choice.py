"""The cheapest valid model is chosen, with reasons; planar solutions that buckle sideways are continued in space."""

import numpy as np
import pytest
from conftest import column
from plane_scenes import STEEL, Drawn, hinged_arch, lee_frame, thin_cantilever

import cosserat_fenicsx as cf
from cosserat_fenicsx.scene import action

pytestmark = pytest.mark.serial  # the choice does not depend on ranks


def test_what_buckles_sideways_is_promoted():
    rod, scene = thin_cantilever()
    below, above = cf.solve(scene, [0.99]), cf.solve(scene, [0.99, 1.1])
    assert below.model == "determinate" and below.stable.all()
    assert above.model == "spatial" and above.negative_modes.tolist() == [0, 1]
    assert "buckles sideways before the load factor" in above.why[0]
    (event,) = above.events
    assert event.kind == "bifurcation" and event.load_factor == pytest.approx(1.0, abs=2e-3)
    np.testing.assert_allclose(above.displacement(rod.end)[0], below.displacement(rod.end)[0], atol=1e-8)


def test_what_buckles_in_its_plane_is_promoted_too():
    """A flat strip that is wide across the plane buckles in its
    plane: the spatial model locates events and branches."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (50.0, 1.0), 30.0)  # bends about d2, the normal
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -(np.pi**2) / 4))])
    path = cf.solve(scene, [0.9, 1.1], elements=8)
    assert path.model == "spatial" and path.negative_modes.tolist() == [0, 1]
    assert "loses its stability in its plane before the load factor" in path.why[0]
    assert [event.kind for event in path.events] == ["bifurcation"]
    path = cf.solve(scene, [0.9, 1.1], elements=8, model="determinate")
    assert path.model == "determinate" and path.negative_modes.tolist() == [0, 1]


def leaves(kind):
    """The column with something that leaves its plane."""
    rod, scene = column()
    P = cf.euler_load(rod)
    extra, supports = [], list(scene.supports)
    if kind == "force":
        extra = [cf.Force(rod.at(10.0), (0, 1e-6 * P, 0))]
    elif kind == "moment":
        extra = [cf.Moment(rod.at(10.0), (0, 0, 1e-3 * P))]
    elif kind == "support":
        supports.append(cf.Roller(rod.end, (1, 1, 0)))
    elif kind == "section":
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0), d1=(1, 1, 0)), cf.Rectangle(0.2, 0.3), STEEL, name="column")
        supports = [cf.Clamp(rod.start)]
        return rod, cf.Scene([rod], supports, [cf.Force(rod.end, (P, 0, -P))])
    return rod, cf.Scene([rod], supports, [*scene.loads, *extra])


@pytest.mark.parametrize(
    "kind, words",
    [
        ("force", "load 3 (Force at column@10) points out of the plane of the rods"),
        ("moment", "load 3 (Moment at column@10) does not turn in the plane of the rods"),
        ("support", "support 2 (Roller at column.end) constrains motions oblique to the plane of the rods"),
        ("section", "a section of rod 'column' has its principal axes (EI) oblique to the plane"),
    ],
)
def test_what_leaves_the_plane_is_named(kind, words):
    _, scene = leaves(kind)
    path = cf.solve(scene, [0.1], elements=2)
    assert path.model == ("spatial" if kind == "support" else "determinate") and words in " ".join(path.why)
    with pytest.raises(cf.SceneError) as refusal:
        cf.solve(scene, [0.1], model="planar")
    assert "model = 'planar' is not possible: " in str(refusal.value) and words in str(refusal.value)


def test_why_not_determinate():
    for draw, words in (
        (hinged_arch, "because of the Hinge at arch.start"),
        (lee_frame, "because of the Hinge at post.start"),
    ):
        path = cf.solve(draw(Drawn()), [0.1], elements=2)
        assert path.model == "planar" and any(words in why for why in path.why)
    rod, scene = column()
    follower = cf.Scene(scene.rods, scene.supports, [*scene.loads, cf.FollowerForce(rod.end, (1.0, 0, 0))])
    path = cf.solve(follower, [0.1], elements=2)
    assert path.model == "planar" and any("FollowerForce, turns with the rod" in why for why in path.why)
    path = cf.solve(scene, [0.1], elements=2, formulation="displacement")
    assert path.model == "spatial" and "'displacement'" in path.why[0]
    path = cf.solve(scene, [0.1], elements=2, degree=2, gauss_points=3)
    assert path.model == "planar"


@pytest.mark.parametrize("turns", [8, 16, 32])
def test_a_helix_is_in_no_plane(turns):
    """Whatever the positions of its turns relative to the sampling points."""
    rod = cf.Rod(cf.Helix((0, 0, 0), (0.1, 0, 0), turns, 0.05), cf.Stiffness((1e3, 1e3), 1e3, (1.0, 1.0), 0.7))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 0.05))])
    assert scene.plane is None and "do not lie in one plane" in scene.flatness[1]
    twisted = cf.Rod(cf.UniformCurvature(1.0, (0, 0, turns * np.pi)), cf.Stiffness((1e3, 1e3), 1e3, (1.0, 5.0), 0.7))
    scene = cf.Scene([twisted], [cf.Clamp(twisted.start)], [cf.Force(twisted.end, (1.0, 0, 0))])
    assert "oblique to the plane" in scene.flatness[1]


class Towards(cf.Force):
    """A force of 1 N per metre of distance to a point."""

    def refreshed(self, rod, s, r):
        return (action.vector(np.array([[0.3, 0.0, 0.8]]) - r, "N"),)


def test_data_that_depend_on_the_position_are_no_matter_of_statics_alone():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e3, 1e3), 1e3, (1, 1), 1))
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [Towards(rod.end, (1.0, 0, 0))]), [1.0])
    assert path.model != "determinate"
    force = path.force(rod.end)[-1]
    np.testing.assert_allclose(force, [0.3, 0, 0.8] - path.position(rod.end)[-1], atol=1e-8)
