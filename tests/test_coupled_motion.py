"""Motions with sections that couple strains: frequencies in closed form, and every scheme against rotated directors."""

import numpy as np
import pytest
from test_coupled_sections import ANGLE, L, straight, turned_and_plain

import cosserat_fenicsx as cf

MOVING = dict(mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
STEADY = pytest.mark.serial


#: A rope: stiffnesses against stretch and twist, their coupling, and its mass.
WAVES = np.array([[90.0, 4.0], [4.0, 0.8]])
ROPE = dict(mass=1.5, inertia=(0.01, 0.01, 0.02))


def rope():
    M = np.diag([1e5, 1e5, 0, 1e4, 1e4, 0])
    M[np.ix_([2, 5], [2, 5])] = WAVES
    return M


@STEADY
def test_frequencies_of_a_rope_that_couples_stretch_and_twist():
    """Coupled waves have the speeds c with det [[EA - mass c^2, C], [C, GJ - Jrho_3 c^2]] = 0; f = c/4L."""
    rod = straight(cf.Stiffness(matrix=rope(), **ROPE))
    modes = cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)]), 4, tol=1e-6)
    squares = np.linalg.eigvals(np.diag([1 / ROPE["mass"], 1 / ROPE["inertia"][2]]) @ WAVES)
    expected = np.sort(np.multiply.outer([1, 3, 5], np.sqrt(squares)).ravel() / (4 * L))[:4]
    np.testing.assert_allclose(modes.frequencies, expected, rtol=1e-6)


@STEADY
def test_frequencies_of_turned_principal_axes():
    one, two = (
        cf.modes(
            cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.1, 0.2, -0.3))]), 6, load_factor=1.0
        ).frequencies
        for rod in turned_and_plain(**MOVING)
    )
    np.testing.assert_allclose(one, two, rtol=1e-9)


def whirl(rod):
    """A load with components in all directions that ends, drag, and viscosity proportional to the stiffness."""
    load = cf.Force(rod.end, cf.signals.Triangle((0.5, 0.8, 0.4), 0, 0.1, 0.2))
    turning = cf.Moment(rod.end, cf.signals.Step((0.1, -0.2, 0.1), end=0.15))
    return cf.Scene([rod], [cf.Clamp(rod.start)], [load, turning])


def damped(**damping):
    for rod in turned_and_plain(**MOVING):
        yield cf.Rod(rod.curve, rod.section, name="rod", damping=cf.Damping(**damping))


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_turned_principal_axes_move_as_turned_directors(scheme):
    """To rounding, energies and dissipation included."""
    a, b = (
        cf.simulate(whirl(rod), 0.4, dt=0.02, elements=3, degree=2, scheme=scheme, model="spatial")
        for rod in damped(time=0.02, drag=0.1)
    )
    size = np.abs(b.displacement(b.rod().end)).max()
    np.testing.assert_allclose(a.displacement(a.rod().end), b.displacement(b.rod().end), atol=1e-8 * size)
    for name in ("kinetic", "strain", "dissipated", "work"):
        given, expected = getattr(a, name), getattr(b, name)
        np.testing.assert_allclose(given, expected, atol=1e-8 * np.abs(expected).max(), err_msg=name)
    assert b.dissipated[-1] > 0.05 * b.work[-1]
    for name in ("force", "moment"):
        np.testing.assert_allclose(a.fields(-1)[name], b.fields(-1)[name], atol=1e-6)


@STEADY
def test_a_section_of_its_own_viscosity():
    """Kt and Jt are along d_1, d_2 and d_3; a viscosity proportional to the matrix is given by `time`."""
    rod = straight(cf.Stiffness.offset((30.0, 30.0), 80.0, (1.0, 1.0), 0.7, centroid=(0.05, 0), **MOVING))
    M, time = np.array(rod.section.matrix), 0.03
    at = rod.stiffness_at(np.array([0.5]))
    np.testing.assert_allclose(cf.Damping(time=time).viscosity(at).matrix[0], time * M)
    own = cf.Damping(time=time, Kt=(1.0, 2.0, 3.0)).viscosity(at).matrix[0]
    np.testing.assert_allclose(own[:3, :3], np.diag([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(own[3:, 3:], time * M[3:, 3:])
    assert not own[:3, 3:].any() and not own[3:, :3].any()


def off_centroid(**damping):
    """Stretch is coupled with bending, in the plane of the motion and across it."""
    section = cf.Stiffness.offset((3e2, 5e2), 8e2, (1.0, 2.5), 0.7, centroid=(0.05, 0.03), angle=ANGLE, **MOVING)
    rod = straight(section)
    return cf.Rod(rod.curve, section, name="rod", damping=cf.Damping(**damping) if damping else None)


@STEADY
def test_energy_is_exact_and_momentum_too():
    """A free rod with initial velocities and no load."""
    rod = off_centroid()
    load = cf.Force(rod.end, cf.signals.Triangle((2.0, 1.0, 3.0), 0, 0.1, 0.2))
    for scheme in ("energy", "momentum"):
        history = cf.simulate(cf.Scene([rod], loads=[load]), 1.0, dt=0.01, elements=4, degree=2, scheme=scheme)
        free = history.times > 0.2 + 1e-9
        assert np.ptp(history.linear_momentum[free], axis=0).max() < 1e-10
        drift = {"energy": history.energy, "momentum": history.angular_momentum}[scheme][free]
        assert np.ptp(drift, axis=0).max() < 1e-9 * np.abs(drift).max()
        assert history.strain[free].max() > 0.01 * history.energy[-1]
        assert np.abs(history.balance).max() < (1e-9 if scheme == "energy" else 2e-2) * history.energy[-1]


@pytest.mark.slow
@STEADY
def test_a_mode_of_a_rope_decays_as_it_should():
    """Viscosity proportional to the matrix: the energy of every mode decays as exp(-time omega^2 t)."""
    speeds, shapes = np.linalg.eig(np.diag([1 / ROPE["mass"], 1 / ROPE["inertia"][2]]) @ WAVES)
    for square, shape in zip(speeds, shapes.T, strict=True):
        omega = np.sqrt(square) * np.pi / (2 * L)
        time, small, period = 0.02 / omega, 1e-4 * shape, 2 * np.pi / omega
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, L)), cf.Stiffness(matrix=rope(), **ROPE), damping=cf.Damping(time=time))
        linear, angular = (lambda s, a=a: (0, 0, a * np.sin(np.pi * s / (2 * L))) for a in small)
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], velocities=[cf.InitialVelocity(rod, linear, angular)])
        history = cf.simulate(scene, 10 * period, dt=period / 40, elements=4, save_every=10 * period)
        rate = -np.log(history.energy[-1] / history.energy[0]) / history.times[-1]
        assert rate == pytest.approx(time * omega**2, rel=1e-2)


@pytest.mark.slow
@STEADY
def test_a_plane_motion_of_a_coupled_section_is_one_in_space():
    section = cf.Stiffness.offset((3e2, 5e2), 8e2, (1.0, 2.5), 0.7, centroid=(0.05, 0), **MOVING)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, L)), section, name="rod", damping=cf.Damping(time=0.01))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, cf.signals.Triangle((2.0, 0, 3.0), 0, 0.1, 0.2))])
    for scheme in ("momentum", "generalised-alpha"):
        flat, space = (
            cf.simulate(scene, 0.3, dt=0.02, elements=3, degree=2, scheme=scheme, model=model)
            for model in ("auto", "spatial")
        )
        assert flat.model == "planar"
        np.testing.assert_allclose(flat.displacement(rod.end), space.displacement(rod.end), atol=1e-4)
        np.testing.assert_allclose(flat.dissipated, space.dissipated, rtol=1e-2, atol=1e-9)
