"""What a scene alone decides: free motions and redundant constraints, the model, what is remembered."""

import gc
import time
import weakref

import numpy as np
import pytest
from conftest import column
from frame_scenes import SECTION, grid_shell, random_frame
from plane_scenes import STEEL, Drawn, hinged_arch, lee_frame, thin_cantilever

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.signature import Signature, choose
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.numerics import svd
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.scene import action, statical
from cosserat_fenicsx.scene.statical import check_no_mechanism, free_motions

pytestmark = pytest.mark.serial


def held_by(holder):
    """[[(station, row (6,)), ...]] of a support or a joint, over displacement and rotation."""
    both = [holder.first, holder.second] if isinstance(holder, cf.Joint) else [holder.station]
    moved, turned = np.eye(6)[:3], np.eye(6)[3:]
    axis = getattr(holder, "release", None) if len(both) == 2 else getattr(holder, "axis", None)
    if isinstance(holder, cf.Clamp) or (len(both) == 2 and axis is None):
        rows = [*moved, *turned]
    elif isinstance(holder, cf.Prescribed):
        rows = turned
    elif isinstance(holder, cf.Roller):
        rows = [np.r_[holder.normal, 0, 0, 0]]
    else:  # across the axis of a hinge the rotation is held
        across = np.linalg.svd(np.array([axis]))[2][1:] if axis not in (None, "all") else []
        rows = [*moved, *(np.r_[0, 0, 0, v] for v in across)]
    return [[(station, sign * row) for station, sign in zip(both, (1, -1), strict=False)] for row in rows]


def dense_rows(rods, constraints):
    """The constraints' matrix by the rigid motions of the rods."""
    size = max(rod.length for rod in rods)
    matrix = np.zeros((len(constraints), len(rods), 6))
    for i, parts in enumerate(constraints):
        for station, row in parts:
            arm = (station.rod.curve.position(station.s) - station.rod.curve.position(0.0)) / size
            matrix[i, rods.index(station.rod)] += np.r_[row[:3], row[3:] + np.cross(arm, row[:3])]
    return matrix.reshape(len(constraints), 6 * len(rods))


def kernel(matrix):
    _, sizes, right = svd(matrix)
    return right[np.count_nonzero(sizes > 1e-9 * sizes.max(initial=0)) :]


def dense_redundant(supports, joints):
    """Whether constraints of stations are dependent, rigid joints that close a loop of such apart."""
    stations, rows, loops = [], [], {}
    for holder in (*supports, *joints):
        if isinstance(holder, cf.Joint) and holder.release is None:
            one, other = (loops.setdefault(x, {x}) for x in (holder.first, holder.second))
            if one is other:
                continue
            one |= other
            loops |= dict.fromkeys(one, one)
        rows += held_by(holder)
    for parts in rows:
        stations += [station for station, _ in parts if station not in stations]
    matrix = np.zeros((len(rows), 6 * len(stations)))
    for i, parts in enumerate(rows):
        for station, row in parts:
            k = stations.index(station)
            matrix[i, 6 * k : 6 * k + 6] += row
    return len(kernel(matrix.T)) > 0


@pytest.mark.once
@pytest.mark.parametrize("dense", [150, 0])
def test_random_frames_have_the_free_motions_of_a_dense_decomposition(monkeypatch, dense):
    monkeypatch.setattr(statical, "_DENSE", dense)
    rng, free, redundant = np.random.default_rng(3), [], 0
    for _ in range(100):
        rods, supports, loads, joints = random_frame(rng)
        if dense_redundant(supports, joints):
            redundant += 1
            with pytest.raises(cf.SceneError, match="hold the same motion twice"):
                cf.Scene(rods, supports, loads, joints)
            continue
        scene = cf.Scene(rods, supports, loads, joints)
        rows = [row for holder in (*supports, *joints) for row in held_by(holder)]
        rows += [[(load.station, np.r_[load.direction, 0, 0, 0])] for load in loads]
        expected = kernel(dense_rows(rods, rows))
        found, complete = free_motions(scene)
        assert complete and len(found) == len(expected)
        found = found.reshape(len(found), 6 * len(rods))
        assert np.abs(found.T @ found - expected.T @ expected).max(initial=0) < 1e-9
        free.append(len(found))
        if len(found):
            with pytest.raises(cf.SceneError, match="mechanism|nothing holds"):
                check_no_mechanism(scene)
        else:
            check_no_mechanism(scene)
    assert 5 < redundant < 70 and free.count(0) > 5 and sum(n > 8 for n in free) > 5


def gate(angle):
    """A rod with a hinge at both ends, one axis of which is turned by an angle away from the rod."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2.0)), SECTION, name="gate")
    joined = cf.Rod(cf.Line((0, 0, 2.0), (1.0, 0, 2.0)), SECTION, name="wall")
    turned = cf.Joint(rod.end, joined.start, (np.sin(angle), 0, np.cos(angle)))
    return cf.Scene([rod, joined], [cf.Hinge(rod.start, (0, 0, 1.0)), cf.Clamp(joined.end)], [], [turned])


@pytest.mark.once
@pytest.mark.parametrize("dense", [150, 0])
def test_what_is_nearly_free_is_told_from_what_is_free(monkeypatch, dense):
    """Hinges that are out of line by 1e-8 rad and more hold a rod, as the largest of dense decompositions say."""
    monkeypatch.setattr(statical, "_DENSE", dense)
    for angle in (1e-2, 1e-5, 1e-6, 1e-7, 1e-8):
        check_no_mechanism(gate(angle))
    with pytest.raises(cf.SceneError, match="rod 'gate' can turn about its own axis: expected at one end"):
        check_no_mechanism(gate(0.0))


def chain(sag, count, feet=cf.Hinge):
    """Rods with parallel hinges from support to support, the middle of the straight line of them lower by `sag`."""
    half = count // 2
    points = [(k, 0.0, -sag * (half - abs(k - half))) for k in range(count + 1)]
    rods = [cf.Rod(cf.Line(a, b), SECTION, name=f"r{k}") for k, (a, b) in enumerate(zip(points, points[1:]))]
    y = (0.0, 1.0, 0.0)
    joints = [cf.Joint(a.end, b.start, y if k + 1 == half else None) for k, (a, b) in enumerate(zip(rods, rods[1:]))]
    return cf.Scene(rods, [feet(rods[0].start, y), feet(rods[-1].end, y)], [], joints)


@pytest.mark.once
@pytest.mark.parametrize("count", [2, 400])
def test_the_flat_arch_of_three_hinges(count):
    """Three hinges in line leave an infinitesimal mechanism; a little off it they hold."""
    for sag in (1e-1, 1e-4, 1e-6):
        check_no_mechanism(chain(sag, count))
    with pytest.raises(cf.SceneError, match=r"can turn about the axis \(0, -?1, 0\)"):
        check_no_mechanism(chain(0.0, count))


def processor_time(act):
    begun = time.process_time()
    act()
    return time.process_time() - begun


@pytest.mark.once
@pytest.mark.parametrize(("size", "rods", "most"), [
    ((18,), 1008, 0.5), pytest.param((57, 58), 10_033, 5.0, marks=pytest.mark.slow),
])  # fmt: skip
def test_frames_of_thousands_of_rods_are_built_in_no_time(size, rods, most):
    """1008 rods take 0.02 s; a dense decomposition took 27 s for 208 rods, and grows with the cube."""
    parts = grid_shell(size[0], m=size[-1])
    assert len(parts[0]) == rods
    assert processor_time(lambda: check_no_mechanism(cf.Scene(*parts))) < most


@pytest.mark.once
def test_the_free_motion_of_one_rod_among_a_thousand_is_named():
    rods, supports, loads, joints = grid_shell(18)
    held = cf.Scene(rods, supports, loads, joints)
    check_no_mechanism(held)
    # r499 has a ball joint at its start and a hinge along it at its end
    axis = rods[499].curve.frame(0.0)[:, 2]
    ends = [k for k, joint in enumerate(joints) if joint.second.rod is rods[499]]
    assert len(ends) == 2 and all(joint.first.rod is not rods[499] for joint in joints)
    for k, release in zip(ends, ("all", tuple(axis)), strict=True):
        joints[k] = cf.Joint(joints[k].first, joints[k].second, release)
    scene = cf.Scene(rods, supports, loads, joints)
    with pytest.raises(cf.SceneError, match="mechanism: rod 'r499' can turn about its own axis") as refusal:
        check_no_mechanism(scene)
    assert "more motion" not in str(refusal.value)
    (found,), _ = free_motions(scene)
    np.testing.assert_allclose(np.abs(found[499, 3:]), np.abs(axis), atol=1e-9)
    assert np.abs(np.delete(found, 499, axis=0)).max() < 1e-9


@pytest.mark.once
def test_many_loose_rods_are_refused_in_seconds():
    """With ball joints everywhere every rod spins about its axis; so many motions are counted up to a limit."""
    scene = cf.Scene(*grid_shell(12, lambda joint: "all"))

    def refused():
        with pytest.raises(cf.SceneError, match=r"rod 'r\d+' can turn about the axis .* at least 63 more motion"):
            check_no_mechanism(scene)

    assert processor_time(refused) < 6.0


@pytest.mark.once
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_larger_frames_have_the_free_motions_of_a_dense_decomposition(monkeypatch, share):
    """56 rods, a share of whose joints are ball joints and hinges in random directions, or all hinges vertical."""
    rng = np.random.default_rng(round(10 * share))

    def release(joint):
        if share == 0.9:
            return (0.0, 0.0, 1.0)
        return None if rng.random() > share else "all" if rng.random() < 0.5 else tuple(rng.standard_normal(3))

    scene, found = cf.Scene(*grid_shell(4, release)), []
    for dense in (0, 1000):
        monkeypatch.setattr(statical, "_DENSE", dense)
        motions, complete = free_motions(scene)
        assert complete
        found.append(motions.reshape(len(motions), 6 * len(scene.rods)))
    assert len(found[0]) == len(found[1])
    assert np.abs(found[0].T @ found[0] - found[1].T @ found[1]).max(initial=0) < 1e-9


@pytest.mark.once
def test_redundant_constraints_of_many_are_named():
    """One doubled hinge among a thousand joints, and one among 200 rods that meet at a point."""
    rods, supports, loads, joints = grid_shell(18)
    first, second = joints[700].first, joints[700].second
    joints[700] = cf.Joint(first, second, (0, 0, 1.0))
    cf.Scene(rods, supports, loads, joints)
    with pytest.raises(cf.SceneError, match=rf"Scene: joints\[700\].* and joints\[{len(joints)}\] \({second}"):
        cf.Scene(rods, supports, loads, [*joints, cf.Joint(second, first, "all")])
    ends = [(np.cos(k), np.sin(k), 0.1 * k) for k in range(200)]
    spokes = [cf.Rod(cf.Line((0, 0, 0), end), SECTION, name=f"s{k}") for k, end in enumerate(ends)]
    hub = [cf.Joint(spokes[0].start, rod.start, "all") for rod in spokes[1:]]
    feet = [cf.Clamp(rod.end) for rod in spokes]
    check_no_mechanism(cf.Scene(spokes, feet, [], hub))
    with pytest.raises(
        cf.SceneError, match=r"joints\[6\] .* and joints\[7\] .* and joints\[199\] .* same motion twice"
    ):
        cf.Scene(spokes, feet, [], [*hub, cf.Joint(spokes[7].start, spokes[8].start, "all")])


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
    loads, supports = [], []
    if kind == "section":
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0), d1=(1, 1, 0)), cf.Rectangle(0.2, 0.3), STEEL, name="column")
        return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (P, 0, -P))])
    if kind == "support":
        supports = [cf.Roller(rod.end, (1, 1, 0))]
    else:
        loads = [
            cf.Force(rod.at(10.0), (0, 1e-6 * P, 0)) if kind == "force" else cf.Moment(rod.at(10.0), (0, 0, 1e-3 * P))
        ]
    return cf.Scene([rod], [*scene.supports, *supports], [*scene.loads, *loads])


@pytest.mark.parametrize("kind, words", [
    ("force", "loads[2] (Force at column@10) points out of the plane of the rods"),
    ("moment", "loads[2] (Moment at column@10) does not turn in the plane of the rods"),
    ("support", "supports[1] (Roller at column.end) constrains motions oblique to the plane of the rods"),
    ("section", "a section of rod 'column' has its principal axes (EI) oblique to the plane"),
])  # fmt: skip
def test_what_leaves_the_plane_is_named(kind, words):
    scene = leaves(kind)
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


@pytest.mark.once
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


def test_the_same_is_found_once():
    _, scene = column()
    layout = Layout.of(scene, 3)
    assert Layout.of(scene, 3) is layout and layout.finer(scene, 2.0) is layout.finer(scene, 2.0)
    assert choose(scene) is choose(scene) and choose(scene, model="spatial").model == "spatial"
    arguments = {"formulation": "mixed", "model": "planar"}
    assert Signature.of(scene, layout, degree=4, **arguments) is Signature.of(scene, layout, degree=4, **arguments)
    assert Signature.of(scene, layout, degree=1, **arguments).degree == 1
    with pytest.raises(cf.SceneError, match="degree = True"):
        Signature.of(scene, layout, degree=True, **arguments)


@pytest.mark.once
def test_nothing_is_kept_of_a_scene_that_is_gone():
    calls = []

    @per_scene
    def doubled(scene, numbers):
        calls.append(numbers)
        return [2 * x for x in numbers]

    _, scene = column()
    assert doubled(scene, (1, 2)) is doubled(scene, (1, 2)) and calls == [(1, 2)]
    assert doubled(scene, [1, 2]) == doubled(scene, [1, 2]) and len(calls) == 3  # a list may change
    for k in range(1000):
        doubled(scene, (k,))
    gone = weakref.ref(scene)
    del scene
    gc.collect()
    assert gone() is None
