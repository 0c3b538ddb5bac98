"""Joints: a rod cut in two and joined equals the whole rod, forces and moments balance at joints, releases work."""

from dataclasses import dataclass

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf
from cosserat_fenicsx.scene.action import vector

SECTION = cf.Stiffness(shear=(3e3, 5e3), axial=8e3, bending=(1.0, 2.5), torsion=0.7, mass=1.0)
FORCE = np.array([0.5, 0.9, -0.7])


def line(a, b, name, section=SECTION, **more):
    return cf.Rod(cf.Line(a, b, **more), section, name=name)


@pytest.mark.parametrize("turned_round", [False, True])
def test_a_cut_rod_is_the_whole_rod(turned_round):
    """Also if the second half runs in the opposite direction, with rotated axes."""
    a, b, c = np.array([1.0, 2.0, 3.0]), np.array([1.2, 2.4, 3.2]), np.array([1.5, 3.0, 3.5])
    whole = line(a, c, "whole", d1=(1, 0, 0))
    lower = line(a, b, "lower", d1=(1, 0, 0))
    if turned_round:  # d3 and d1 x d3 change sign, d1 does not
        upper = line(c, b, "upper", d1=(1, 0, 0))
        joint, tip = cf.Joint(lower.end, upper.end), upper.start
    else:
        upper = line(b, c, "upper", d1=(1, 0, 0))
        joint, tip = cf.Joint(lower.end, upper.start), upper.end
    one = cf.solve(cf.Scene([whole], [cf.Clamp(whole.start)], [cf.Force(whole.end, 3 * FORCE)]), [1.0], elements=10)
    two = cf.solve(
        cf.Scene([lower, upper], [cf.Clamp(lower.start)], [cf.Force(tip, 3 * FORCE)], [joint]),
        [1.0],
        elements=5,
        comm=MPI.COMM_SELF,
    )
    np.testing.assert_allclose(two.position(tip), one.position(whole.end), atol=2e-9)
    np.testing.assert_allclose(two.rotation(tip), one.rotation(whole.end), atol=2e-8)
    assert np.linalg.norm(one.displacement(whole.end)) > 0.3


def star(release=None, elements=3):
    """Four rods that meet at one point, at arbitrary angles."""
    tips = [(0, 0, -1.0), (1.0, 0.2, 0.3), (-0.4, 0.9, 0.5), (-0.3, -0.8, 0.9)]
    rods = [line((0, 0, 0), tip, f"arm{i}") for i, tip in enumerate(tips)]
    joints = [cf.Joint(rods[0].start, rod.start, release if i == 1 else None) for i, rod in enumerate(rods) if i]
    supports = [cf.Clamp(rods[0].end), *([cf.Pin(rods[1].end)] if release is not None else [])]
    loads = [cf.Force(rods[2].end, FORCE), cf.Force(rods[3].end, (-0.4, 0.2, -0.6)), cf.Weight((0, 0, -0.5)),
             cf.Moment(rods[0].start, (0.1, 0.2, 0.3))]  # fmt: skip
    return rods, cf.Scene(rods, supports, loads, joints), elements


@pytest.mark.parametrize("release", [None, (0.3, 1.0, -0.2), "all"])
def test_balance_at_a_joint_of_four(release):
    if release == "all":
        rods, scene, elements = star((1.0, 0, 0))
        joints = [cf.Joint(j.first, j.second, "all" if j.release else None) for j in scene.joints]
        scene = cf.Scene(rods, [scene.supports[0], cf.Clamp(rods[1].end)], scene.loads, joints)
    else:
        rods, scene, elements = star(release)
    path = cf.solve(scene, [1.0], elements=elements)
    force = sum(path.force(rod.start)[0] for rod in rods)
    moment = sum(path.moment(rod.start)[0] for rod in rods) + np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(force, 0, atol=1e-9)
    np.testing.assert_allclose(moment, 0, atol=1e-11)
    ends = np.array([path.position(rod.start)[0] for rod in rods])
    np.testing.assert_allclose(ends, ends[:1].repeat(4, axis=0), atol=1e-13)
    q = np.array([path.rotation(rod.start)[0] for rod in rods])
    np.testing.assert_allclose(q[2:], q[:1].repeat(2, axis=0), atol=1e-13)
    if release is None:
        np.testing.assert_allclose(q[1], q[0], atol=1e-13)
        return
    relative = Rotation.from_quat(q[0, [1, 2, 3, 0]]).inv() * Rotation.from_quat(q[1, [1, 2, 3, 0]])
    transmitted = path.moment(rods[1].start)[0]
    assert relative.magnitude() > 0.02
    if release == "all":
        np.testing.assert_allclose(transmitted, 0, atol=1e-11)
    else:  # it rotates about the axis only, and transmits no moment about the current axis
        axis = np.array(release) / np.linalg.norm(release)
        np.testing.assert_allclose(np.cross(relative.as_rotvec(), axis), 0, atol=1e-12)
        assert abs(transmitted @ Rotation.from_quat(q[0, [1, 2, 3, 0]]).apply(axis)) < 1e-11
        assert np.linalg.norm(transmitted) > 1e-3


@pytest.mark.ranks
@pytest.mark.parametrize("release", [None, (0.3, 1.0, -0.2)])
def test_ranks_agree_on_branching_structures(release):
    rods, scene, elements = star(release)
    together = cf.solve(scene, [0.5, 1.0], elements=elements)
    alone = cf.solve(scene, [0.5, 1.0], elements=elements, comm=MPI.COMM_SELF)
    assert together.unknowns == alone.unknowns
    assert together.iterations.tolist() == alone.iterations.tolist()
    assert together.negative_modes.tolist() == alone.negative_modes.tolist()
    for rod in rods:
        np.testing.assert_allclose(together.centreline(rod=rod), alone.centreline(rod=rod), atol=1e-10)
        np.testing.assert_allclose(together.force(rod.start), alone.force(rod.start), atol=1e-7)


def test_number_of_unknowns():
    """The shared node counts once; nodes have seven unknowns; a hinge adds five equations."""
    _, rigid, elements = star()
    path = cf.solve(rigid, [0.1], elements=elements, degree=2, model="spatial")
    nodes = 4 * 2 * elements + 1
    assert path.unknowns == 7 * (nodes - 1)
    _, hinged, elements = star((1.0, 0, 0))
    assert cf.solve(hinged, [0.1], elements=elements, degree=2).unknowns == 7 * nodes + 5 + 3


@pytest.mark.parametrize("elements", [1, 8])
def test_a_closed_ring(elements):
    """A closed ring, held at one point, equals two half rings joined at both ends."""
    ring = cf.Rod(cf.Arc((0, 0, 0), (1, 0, 0), 2 * np.pi), SECTION, name="ring")
    far = ring.at(np.pi)
    loads = [cf.Force(far, (-1.5, 0.3, 1.0))]
    path = cf.solve(cf.Scene([ring], [cf.Clamp(ring.start)], loads, [cf.Joint(ring.start, ring.end)]), [1.0],
                    elements=2 * elements)  # fmt: skip
    halves = [cf.Rod(cf.Arc((0, 0, 0), (side, 0, 0), np.pi), SECTION, name=f"half{side}") for side in (1, -1)]
    scene = cf.Scene(halves, [cf.Clamp(halves[0].start)], [cf.Force(halves[0].end, (-1.5, 0.3, 1.0))],
                     [cf.Joint(halves[0].end, halves[1].start), cf.Joint(halves[1].end, halves[0].start)])  # fmt: skip
    both = cf.solve(scene, [1.0], elements=elements)
    np.testing.assert_allclose(path.displacement(far), both.displacement(halves[0].end), atol=1e-10)
    np.testing.assert_allclose(path.displacement(ring.end), 0, atol=1e-14)
    assert np.linalg.norm(path.displacement(far)) > 0.3


def test_apart():
    a, b = line((0, 0, 0), (1, 0, 0), "a"), line((1, 0, 1e-3), (2, 0, 0), "b")
    with pytest.raises(cf.SceneError, match=r"a.end at .* with b.start at .* 0.001 m apart"):
        cf.Joint(a.end, b.start)
    with pytest.raises(cf.SceneError, match="Joint.release = 'hinge'"):
        cf.Joint(a.end, line((1, 0, 0), (2, 0, 0), "c").start, "hinge")
    with pytest.raises(cf.SceneError, match=r"joints\[0\].*twice"):
        c = line((1, 0, 0), (2, 0, 0), "c")
        y = (0, 1, 0)
        cf.Scene([a, c], [cf.Clamp(a.start)], [], [cf.Joint(a.end, c.start, y), cf.Joint(c.start, a.end, y)])
    with pytest.raises(cf.SceneError, match="mechanism: rod 'c' can turn about the axis"):
        cf.solve(cf.Scene([a, c], [cf.Clamp(a.start)], [cf.Force(c.end, y)], [cf.Joint(a.end, c.start, y)]), [1.0])


def test_scene_file(tmp_path):
    file = tmp_path / "frame.toml"
    file.write_text("""
[[rods]]
name = "leg"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 1] }
section = { type = "Stiffness", shear = [1e4, 1e4], axial = 1e4, bending = [1.0, 1.0], torsion = 1.0 }
[[rods]]
name = "bow"
curve = { type = "Arc", centre = [1, 0, 1], start = [0, 0, 1], angle = 1.5, axis = [0, 1, 0] }
section = { type = "Stiffness", shear = [1e4, 1e4], axial = 1e4, bending = [1.0, 1.0], torsion = 1.0 }
[[joints]]
first = "leg.end"
second = "bow.start"
release = [0, 1, 0]
[[supports]]
type = "Clamp"
station = "leg.start"
[[supports]]
type = "Roller"
station = "bow.end"
normal = [0, 0, 1]
[[loads]]
type = "LineForce"
rod = "bow"
force = [0, 0, -0.1]
[[loads]]
type = "FollowerForce"
station = "leg@0.5"
force = [0.2, 0, 0]
""")
    scene = cf.read(file).scene
    path = cf.solve(scene, [1.0], elements=3, comm=MPI.COMM_SELF)
    assert path.stable[0] and np.abs(path.displacement(scene.rod("leg").end)).max() > 1e-3
    for old, new, words in (
        ('"leg.end"', '"lag.end"', "joints[0].first = 'lag.end': no rod is named 'lag', did you mean 'leg'?"),
        ('rod = "bow"', "rod = 3", "loads[0]: LineForce.rod = 3: expected a Rod, or its name"),
        ("release", "relaese", "unknown key 'relaese', did you mean 'release'?"),
    ):
        file.write_text(file.read_text().replace(old, new))
        with pytest.raises(cf.SceneError) as refusal:
            cf.read(file)
        assert words in str(refusal.value)
        file.write_text(file.read_text().replace(new, old))


@dataclass(frozen=True)
class Pressure(cf.LineAction):
    """A complete user-defined load: a force along a rod that stays normal to it."""

    rod: cf.Rod
    pressure: float

    follows = True

    @staticmethod
    def work(point, test, f):
        return ufl.dot(point.R * f, test.phi_r)

    def data(self, rod, s):
        return (vector(self.pressure * rod.curve.frame(s)[:, :, 1], "N/m"),)


def test_a_new_kind_of_load_takes_no_change_elsewhere():
    """A ring under outer pressure p shrinks by the hoop force p R, wherever it is supported."""
    ring = cf.Rod(cf.Arc((0, 0, 0), (2.0, 0, 0), 2 * np.pi), cf.Stiffness((50.0, 50.0), 90.0, (1.0, 1.0), 0.7))
    inwards = np.sign(ring.curve.frame(np.array([0.0]))[0, 0, 1]) * -0.2
    scene = cf.Scene([ring], [cf.Clamp(ring.start)], [Pressure(ring, inwards)], [cf.Joint(ring.start, ring.end)])
    path = cf.solve(scene, [1.0], elements=8)
    np.testing.assert_allclose(path.displacement(ring.at(2 * np.pi))[0], (2 * 2.0 * 0.2 * 2.0 / 90.0, 0, 0), atol=1e-7)


def test_every_pair_of_three_rods_may_be_joined():
    rods = [line((0, 0, 0), tip, f"r{i}") for i, tip in enumerate([(0, 0, -1.0), (1.0, 0, 0.3), (-0.4, 0.9, 0.5)])]
    pairs = [(0, 1), (1, 2), (2, 0)]
    loads = [cf.Force(rods[1].end, FORCE)]
    shapes = []
    for joined in (pairs, pairs[:2]):
        joints = [cf.Joint(rods[i].start, rods[j].start) for i, j in joined]
        path = cf.solve(cf.Scene(rods, [cf.Clamp(rods[0].end)], loads, joints), [1.0], elements=3)
        shapes.append(path.position(rods[2].end))
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-13)


def test_a_forgotten_joint_is_named():
    first = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), SECTION, name="leg")
    second = cf.Rod(cf.Line((0, 0, 1.0), (1.0, 0, 1.0)), SECTION, name="beam")
    scene = cf.Scene([first, second], [cf.Clamp(first.start)], [cf.Force(second.end, (0, 0, 1.0))])
    with pytest.raises(cf.SceneError, match=r"Clamp\(beam.start\), or a Joint\(beam.start, leg.end\)"):
        cf.solve(scene, [1.0])
