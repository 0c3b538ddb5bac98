"""Plane scenes, in planes that need not be aligned with the axes, to compare the models."""

import numpy as np
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)


class Drawn:
    """A plane with coordinates (x, z) and a depth; seed None is the x-z plane itself."""

    def __init__(self, seed=None):
        self.turn = np.eye(3) if seed is None else Rotation.random(random_state=seed).as_matrix()
        self.origin = np.zeros(3) if seed is None else np.array([30.0, -70.0, 110.0])
        self.normal = self.vector(0, 1, 0)

    def vector(self, *a):
        return tuple(self.turn @ np.array(a, dtype=float))

    def point(self, *a):
        return tuple(self.origin + self.turn @ np.array(a, dtype=float))


def arc_with_weight(plane, section=None):
    """Clamped at its end; weight, line moment and an arm that turns."""
    curve = cf.Arc(plane.point(0, 0, 0), plane.point(2, 0, 0), 2.0, axis=plane.normal)
    rod = cf.Rod(curve, section or cf.Circle(0.02), STEEL, name="arc")
    flat = abs(rod.curve.frame(0.0)[:, 1] @ plane.normal) < 0.5  # d2 in the plane
    loads = [
        cf.Weight(plane.vector(1, 0, -9.81)),
        cf.EccentricForce(rod.start, plane.vector(30, 0, 10), (0, 0.05) if flat else (0.05, 0)),
        cf.LineMoment(rod, plane.vector(0, 3, 0)),
    ]
    return cf.Scene([rod], [cf.Clamp(rod.end)], loads)


def tree(plane):
    """A stem clamped in its middle, a branch on it and another at its end."""
    stem = cf.Rod(cf.Line(plane.point(0, 0, 0), plane.point(2, 0, 0)), cf.Circle(0.02), STEEL, name="stem")
    twig = cf.Rod(cf.Line(plane.point(1.5, 0, 1), plane.point(1.5, 0, 0)), cf.Circle(0.015), STEEL, name="twig")
    tip = cf.Rod(cf.Line(plane.point(2, 0, 0), plane.point(3, 0, 1)), cf.Circle(0.02), STEEL, name="tip")
    loads = [
        cf.Weight(plane.vector(0, 0, -9.81)),
        cf.Force(twig.start, plane.vector(40, 0, 5)),
        cf.Force(stem.start, plane.vector(0, 0, 50)),
        cf.Force(tip.end, plane.vector(0, 0, -30)),
        cf.Moment(stem.at(1.1), plane.vector(0, -12, 0)),
    ]
    joints = [cf.Joint(stem.at(1.5), twig.end), cf.Joint(tip.start, stem.end)]
    return cf.Scene([twig, stem, tip], [cf.Clamp(stem.at(0.7))], loads, joints)


def hinged_arch(plane):
    """Hinges about the normal at both ends."""
    curve = cf.Arc(plane.point(0, 0, 0), plane.point(-1, 0, 0), 0.9 * np.pi, axis=plane.normal)
    rod = cf.Rod(curve, cf.Circle(0.02), STEEL, name="arch")
    hinges = [cf.Hinge(end, plane.normal) for end in (rod.start, rod.end)]
    return cf.Scene([rod], hinges, [cf.Force(rod.at(0.45 * rod.length), plane.vector(5, 0, -900))])


def moved_arch(plane):
    """One end moved and turned, a follower force."""
    curve = cf.Arc(plane.point(0, 0, 0), plane.point(-1, 0, 0), 0.9 * np.pi, axis=plane.normal)
    rod = cf.Rod(curve, cf.Circle(0.02), STEEL, name="arch")
    moved = cf.Prescribed(rod.end, plane.vector(-0.2, 0, 0.1), plane.vector(0, 0.7, 0))
    flat = abs(rod.curve.frame(0.0)[:, 0] @ plane.normal) < 0.5  # d1 in the plane
    follower = cf.FollowerForce(rod.at(rod.length / 2), (12.0, 0, 20.0) if flat else (0, 12.0, 20.0))
    return cf.Scene([rod], [cf.Clamp(rod.start), moved], [follower])


def hinged_portal(plane):
    """A hinge between two rods, a roller in the plane, one across it, and a prescribed turn."""
    post = cf.Rod(cf.Line(plane.point(0, 0, 0), plane.point(0, 0, 1)), cf.Circle(0.02), STEEL, name="post")
    beam = cf.Rod(cf.Line(plane.point(0, 0, 1), plane.point(1, 0, 1)), cf.Circle(0.02), STEEL, name="beam")
    supports = [
        cf.Clamp(post.start),
        cf.Roller(beam.end, plane.vector(0, 0, 1)),
        cf.Roller(beam.end, plane.normal),
        cf.Prescribed(beam.end, rotation=plane.vector(0, 0.3, 0)),
    ]
    joints = [cf.Joint(post.end, beam.start, release=plane.normal)]
    return cf.Scene([post, beam], supports, [cf.Force(beam.at(0.4), plane.vector(100, 0, -300))], joints)


def lee_frame(plane, factor=0.5):
    """Lee's frame (Lee, Manuel & Rossow, J. Eng. Mech. 94 (1968) 521): two rods of 120 cm, 3 cm x 2 cm, hinged at
    both feet; P a fifth along the beam, up to a part of its limit load of 18.5 kN."""
    steel = cf.Material(E=70.6e9, nu=0.3)
    post = cf.Rod(cf.Line(plane.point(0, 0, 0), plane.point(0, 0, 1.2), d1=plane.vector(1, 0, 0)),
                  cf.Rectangle(0.02, 0.03), steel, name="post")  # fmt: skip
    beam = cf.Rod(cf.Line(plane.point(0, 0, 1.2), plane.point(1.2, 0, 1.2), d1=plane.vector(0, 0, 1)),
                  cf.Rectangle(0.02, 0.03), steel, name="beam")  # fmt: skip
    hinges = [cf.Hinge(end, plane.normal) for end in (post.start, beam.end)]
    load = cf.Force(beam.at(0.24), plane.vector(0, 0, -18.5e3 * factor))
    return cf.Scene([post, beam], hinges, [load], [cf.Joint(post.end, beam.start)])


def rigid_cantilever(plane):
    """Inextensible and unshearable, clamped at its end."""
    section = cf.Stiffness((np.inf, np.inf), np.inf, (200.0, 200.0), 100.0, mass=3.0)
    rod = cf.Rod(cf.Line(plane.point(0, 0, 0), plane.point(2, 0, 1)), section, name="cantilever")
    loads = [cf.Weight(plane.vector(0, 0, -9.81)), cf.Moment(rod.start, plane.vector(0, 50, 0))]
    return cf.Scene([rod], [cf.Clamp(rod.end)], loads)


def swinging_pair(plane):
    """Two separate clamped rods, one of them tapering and with a flat section, and a closed ring on springs."""
    taper = cf.Rod(cf.Line(plane.point(0, 0, 0), plane.point(1, 0, 0), d1=plane.vector(0, 0, 1)),
                   lambda s: cf.Rectangle(0.02 - 0.01 * s, 0.03), STEEL, name="taper")  # fmt: skip
    other = cf.Rod(cf.Line(plane.point(0, 3, 1), plane.point(1, 3, 1)), cf.Circle(0.02), STEEL, name="other")
    loads = [
        cf.Weight(plane.vector(0, 0, -9.81)),
        cf.Force(taper.end, plane.vector(0, 0, -40)),
        cf.Force(other.end, plane.vector(-10, 0, 60)),
    ]
    return cf.Scene([taper, other], [cf.Clamp(taper.start), cf.Clamp(other.start)], loads)


def thin_cantilever(stiff=(1e6, 1e6), axial=1e6):
    """P L^2/sqrt(EI GJ) = 4.0126 (Timoshenko & Gere) at load factor
    1, the load in the plane of the larger stiffness."""
    section = cf.Stiffness(bending=(1e5, 1.0), torsion=0.7, shear=stiff, axial=axial)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 4.0126 * np.sqrt(0.7), 0))])


#: Scene and whether statics gives its contact force.
SCENES = {
    scene.__name__: (scene, known)
    for scene, known in (
        (arc_with_weight, True), (tree, True), (hinged_arch, False), (moved_arch, False), (hinged_portal, False),
        (lee_frame, False), (rigid_cantilever, True), (swinging_pair, True),
    )
}  # fmt: skip
