"""Masses that move with the axis of rods, linear drag, and the mud that gives both."""

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.fluids import AddedMass, LinearDrag

SECTION = cf.Stiffness((1e8, 1e8), 1e8, (1e5, 1e5), 1e5, mass=2.0, inertia=(0.1, 0.15, 0.2))
ROD = cf.Rod(cf.Line((0, 0, 0), (1, 2, 2)), SECTION, name="rod")
TANGENT, ACROSS = np.array([1, 2, 2]) / 3, np.array([2, 1, -2]) / 3
SCHEMES = ("momentum", "energy", "generalised-alpha")


def test_across_and_along():
    """A force on the middle of a free rod: the acceleration is F/(m L) along it and F/((m + m_a) L) across it."""
    for axial in (False, True):
        loads = [AddedMass(ROD, 3.0, axial), cf.LineForce(ROD, 2.0 * TANGENT + 5.0 * ACROSS)]
        for scheme in SCHEMES:
            for model in ("planar", "spatial") if scheme != "energy" else ("spatial",):
                history = cf.simulate(cf.Scene([ROD], loads=loads), 1, dt=0.05, elements=2, degree=2, model=model,
                                      scheme=scheme)  # fmt: skip
                moved = history.displacement(ROD.at(1.5))[-1]
                expected = 2.0 / (5.0 if axial else 2.0) / 2 * TANGENT + 5.0 / 5.0 / 2 * ACROSS
                np.testing.assert_allclose(moved, expected, atol=2e-4)
                assert history.kinetic[-1] == pytest.approx(history.work[-1], rel=1e-3)
                p = history.linear_momentum[-1]
                np.testing.assert_allclose(p, 3 * (2.0 * TANGENT + 5.0 * ACROSS), rtol=1e-9)


def test_an_eccentric_rod_with_masses_on_its_axis():
    """Free, with the added mass and a point mass on the axis: energy and momenta as of the single bodies, and kept."""
    rod = cf.Rod(ROD.curve, SECTION, eccentricity=(0.1, -0.05))
    arm = rod.curve.frame(0.0) @ [0.1, -0.05, 0]
    v, w = np.array([1, 0.5, 0.2]), np.array([1, 2, -1.5])
    scene = cf.Scene([rod], loads=[AddedMass(rod, 3.0, axial=True), cf.PointMass(rod.end, 0.5, 0.01)],
                     velocities=[cf.InitialVelocity(rod, v, w, about=(0, 0, 0))])  # fmt: skip
    s, weights = np.polynomial.legendre.leggauss(4)
    places, weights = np.outer(1.5 * (1 + s), TANGENT), 1.5 * weights
    frame = rod.curve.frame(0.0)
    bodies = [(2.0 * k, y + arm, k * frame @ np.diag([0.1, 0.15, 0.2]) @ frame.T)
              for k, y in zip(weights, places, strict=True)]  # fmt: skip
    bodies += [(3.0 * k, y, np.zeros((3, 3))) for k, y in zip(weights, places, strict=True)]
    bodies += [(0.5, 3 * TANGENT, 0.01 * np.eye(3))]
    p = sum(m * (v + np.cross(w, y)) for m, y, _ in bodies)
    L = sum(m * np.cross(y, v + np.cross(w, y)) + J @ w for m, y, J in bodies)
    energy = sum(m * np.sum((v + np.cross(w, y)) ** 2) + w @ J @ w for m, y, J in bodies) / 2
    for scheme in SCHEMES:
        history = cf.simulate(scene, 0.2, dt=0.005, elements=2, degree=2, scheme=scheme)
        np.testing.assert_allclose(history.linear_momentum[0], p, rtol=1e-12)
        np.testing.assert_allclose(history.angular_momentum[0], L, rtol=1e-12)
        assert history.kinetic[0] == pytest.approx(energy, rel=1e-12)
        kept = 1e-10 if scheme == "momentum" else 2e-3
        np.testing.assert_allclose(history.angular_momentum, np.tile(L, (len(history), 1)), atol=kept * np.abs(L).max())


def test_frequencies_in_a_fluid():
    """Those of bending fall by sqrt(m/(m + m_a)), those along and about the axis stay."""
    section = cf.Stiffness((1e9, 1e9), 1e4, (1e3, 2e3), 3e3, mass=2.0, inertia=(1e-6, 1e-6, 0.5))
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2)), section)
    found = [
        cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)], loads), 4, elements=4).frequencies
        for loads in ([], [AddedMass(rod, [(0.5, 2.0), (None, 2.0)])], [AddedMass(rod, 2.0, axial=True)])
    ]
    axial, twist = np.sqrt(1e4 / 2) / 8, np.sqrt(3e3 / 0.5) / 8
    bending = found[0][:2]
    np.testing.assert_allclose(found[0][2:], [axial, twist], rtol=1e-4)
    np.testing.assert_allclose(found[1], [*bending / np.sqrt(2), axial, twist], rtol=1e-4)
    np.testing.assert_allclose(
        np.sort(found[2]), np.sort([*bending / np.sqrt(2), axial / np.sqrt(2), twist]), rtol=1e-4
    )


def test_drag_stops_a_rod():
    """m v' = -c v, across and along."""
    v = 2.0 * TANGENT + 5.0 * ACROSS
    scene = cf.Scene([ROD], loads=[LinearDrag(ROD, 4.0, 1.0)], velocities=[cf.InitialVelocity(ROD, v)])
    for scheme in SCHEMES:
        history = cf.simulate(scene, 0.5, dt=0.01, elements=2, degree=2, scheme=scheme)
        expected = 2.0 * np.exp(-1.0 * 0.5 / 2) * TANGENT + 5.0 * np.exp(-4.0 * 0.5 / 2) * ACROSS
        np.testing.assert_allclose(history.velocity(ROD.end)[-1], expected, atol=1e-4)
        assert np.abs(history.balance).max() < 1e-3 * history.energy[0]


def test_the_mud_around_a_collar():
    steel = cf.Material(206e9, 0.3, density=7850.0)
    line, mud = cf.Line((0, 0, 0), (0, 0, 12)), cf.well.Mud(1200.0, added_mass=1.7, drag=283.0)
    tube = cf.Rod(line, cf.Tube(0.1714, 0.0714), steel)
    mass, drag = mud.along(tube)
    assert mass.mass == pytest.approx(47.06972748986194 + 4.804714105288387, rel=1e-12) and mass.lateral
    assert (drag.normal, drag.tangential) == (283.0, 0.0)
    pieces = cf.Rod(line, [(5.0, cf.Tube(0.1714, 0.0714)), (None, cf.Circle(0.1))], steel)
    ends, masses = zip(*mud.along(pieces)[0].mass, strict=True)
    assert ends == (5.0, 12.0) and masses == pytest.approx([mass.mass, 1.7 * 1200 * np.pi / 4 * 0.01])
    bare = cf.Rod(line, SECTION, name="bare")
    assert mud.along(bare, 0.1714, 0.0714)[0].mass == pytest.approx(mass.mass)
    assert cf.well.Mud(1200.0).along(tube) == ()
    with pytest.raises(cf.SceneError, match=r"Mud.along.outer = None: expected the diameter of rod 'bare'"):
        mud.along(bare)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: cf.well.Mud(1200.0, added_mass=-1.0), "Mud.added_mass = -1.0: expected a coefficient, not negative"),
        (lambda: cf.well.Mud(1200.0, drag=np.inf), "Mud.drag = inf"),
        (lambda: AddedMass(ROD, 0.0), "AddedMass.mass = 0.0: expected a positive number"),
        (lambda: AddedMass(ROD, [(1.0, 2.0), (0.5, 1.0)]), r"AddedMass.mass\[1\].to"),
        (lambda: AddedMass(ROD, [(1.0, -2.0), (None, 1.0)]), r"AddedMass.mass\[0\] = -2.0"),
        (lambda: AddedMass(ROD, 1.0, axial=1), "AddedMass.axial = 1"),
        (lambda: LinearDrag(ROD, 0.0), "LinearDrag.normal = 0.0"),
    ],
)
def test_what_is_refused(make, words):
    with pytest.raises(cf.SceneError, match=words):
        make()
