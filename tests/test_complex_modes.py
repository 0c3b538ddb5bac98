"""Complex modes: dampers, loads without a potential, steady rotations. Truths of other methods: closed forms, and 40
digits of the determinants of boundary value problems (EI = m = L = 1)."""

import numpy as np
import pytest

import cosserat_fenicsx as cf


def cantilever(EI=(1.0, 1.0), stiff=1e5, J=1e-6, start=(0, 0, 0), **more):
    """A clamped rod along x, and its clamp; d1 = y."""
    section = cf.Stiffness((stiff, stiff), stiff, EI, 1.0, mass=1.0, inertia=(J, J, 2 * J))
    line = cf.Line(start, (start[0] + 1, 0, 0), d1=(0, 1, 0))
    rod = cf.Rod(line, section, name="beam", **more)
    return rod, cf.Clamp(rod.start)


def off(found, exact):
    return np.abs(found.eigenvalues / np.array(exact) - 1)


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.9, 2.8])
def test_of_a_pair_that_flutters_the_one_that_grows_is_first(angle):
    """Both have one size: rounding, and so the orientation, does not decide on their order."""
    section = cf.Stiffness((1e5, 1e5), 1e5, (1.0, 2.0), 1.0, mass=1.0, inertia=(1e-6, 1e-6, 2e-6))
    rod = cf.Rod(cf.Line((0, 0, 0), (np.cos(angle), 0.3, np.sin(angle))), section)
    thrust = cf.FollowerForce(rod.end, (0, 0, -22.0 / rod.length**2))
    found = cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)], [thrust]), 3, load_factor=1.0, elements=4)
    flutters = found.eigenvalues[np.abs(found.growth_rates) > 1e-3]
    assert flutters[0].real > 0 > flutters[1].real and np.ptp(np.abs(flutters)) < 1e-6


@pytest.mark.serial
def test_a_dashpot_at_the_end_may_overdamp(truth):
    """Roots of Euler's beam with a dashpot c = 2 and Kelvin-Voigt's damping; shear changes the third by about 4e-6."""
    rod, clamp = cantilever(stiff=1e7, J=1e-9)
    found = cf.modes(cf.Scene([rod], [clamp], [cf.Dashpot(rod.end, 2.0)]), 8, elements=8)
    exact = [-1.93970800974, -3.649734575226 + 20.34901540283j, -3.873655659255 + 60.72439620323j]
    for root in exact:  # in both directions across the rod
        nearest = found.eigenvalues[np.argsort(np.abs(found.eigenvalues / root - 1))[1]]
        truth(f"cantilever with a dashpot at its end, eigenvalue {root:.4g} without shear", nearest, root, 6e-6)
    assert found.kind.tolist() == ["overdamped"] * 4 + ["oscillates"] * 4 and found.stable and found.left_out == ()
    assert found.damping_ratios[4] == pytest.approx(3.649734575 / abs(exact[1]), rel=1e-5)
    near = cf.modes(cf.Scene([rod], [clamp], [cf.Dashpot(rod.end, 2.0)]), 2, elements=8, near=60j)
    assert found.damping_ratios[0] == 1 and off(near, exact[2]).max() < 6e-6


def test_kelvin_voigt_and_drag_of_the_rod_and_as_an_action(truth):
    """l^2 + (drag + tau w^2) l + w^2 = 0; linear drag along the rod is the same as drag times a mass of 1 kg/m."""
    w = np.repeat([3.5160152685, 22.0344915647, 61.6972144134], 2)
    ratio = 0.4 / 2 / w + 0.01 * w / 2
    exact = w * (-ratio + 1j * np.sqrt(1 - ratio**2))
    rod, clamp = cantilever(stiff=1e7, J=1e-9, damping=cf.Damping(time=0.01, drag=0.4))
    found = cf.modes(cf.Scene([rod], [clamp]), 6, elements=8)
    truth("cantilever, Kelvin-Voigt and drag, without shear", found.eigenvalues, exact, 6e-6)
    rod, clamp = cantilever(stiff=1e7, J=1e-9, damping=cf.Damping(time=0.01))
    again = cf.modes(cf.Scene([rod], [clamp], [cf.LinearDrag(rod, 0.4, 0.4)]), 6, elements=8)
    np.testing.assert_allclose(again.eigenvalues, found.eigenvalues, rtol=1e-6)


@pytest.mark.serial
def test_a_stepped_rod_with_a_tip_mass_and_an_oblique_dashpot(truth):
    """Sections that jump and bend unequally, Kelvin-Voigt and drag, which slows the mass too; roots by shooting through
    both pieces. Estimates are at least the errors."""
    stiff = cf.Stiffness((400.0, 300.0), 900.0, (1.0, 1.7), 1.1, mass=1.0, inertia=(2e-3, 3e-3, 5e-3))
    thin = cf.Stiffness((150.0, 200.0), 500.0, (0.3, 0.2), 0.25, mass=0.5, inertia=(5e-4, 8e-4, 1.3e-3))
    line = cf.Line((0, 0, 0), (1 / 3, 2 / 3, 2 / 3), d1=(0, 0, 1))
    rod = cf.Rod(line, [(0.4, stiff), (None, thin)], damping=cf.Damping(time=0.004, drag=0.3))
    loads = [cf.PointMass(rod.end, 0.2, (1e-3, 2e-3, 4e-3)), cf.Dashpot(rod.end, 0.6, direction=(1, -1, 0.5))]
    exact = np.array([-0.16300679749947 + 2.54459736318609j, -1.15101396950535 + 2.27582137351785j,
                      -0.31769362175323 + 9.15127759601428j, -0.52712024055066 + 13.49579838223156j,
                      -0.66811761783810 + 14.27488153712484j, -1.69541122766444 + 27.73836110697201j])  # fmt: skip
    for tol, degree, most in ((1e-6, 4, 1e-8), (1e-2, 2, 1e-2)):
        found = cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)], loads), 6, tol=tol, degree=degree)
        at = np.abs(found.eigenvalues[:, None] / exact - 1).argmin(axis=0)
        truth(f"stepped rod with an oblique dashpot, degree {degree}", found.eigenvalues[at], exact, most)
        assert (found.error[at] + 1e-10 > np.abs(found.eigenvalues[at] / exact - 1)).all()


BECK = {
    10.0: [5.17578505732j, 18.5865406058j, 57.8508704062j],
    21.0: [-2.12520036617 + 10.9373182007j, 2.12520036617 + 10.9373182007j, 53.297504332j],
}


@pytest.mark.serial
@pytest.mark.parametrize("load", BECK)
def test_a_column_under_a_follower_load_flutters(load, truth):
    rod, clamp = cantilever(stiff=1e6, J=1e-7)
    found = cf.modes(cf.Scene([rod], [clamp], [cf.FollowerForce(rod.end, (0, 0, -load))]), 6, load_factor=1.0)
    exact = np.repeat(BECK[load], 2)
    at = np.lexsort((found.eigenvalues.real.round(3), found.eigenvalues.imag.round(3)))
    truth(f"Beck's column under the load {load:g}, six eigenvalues", found.eigenvalues[at], exact, 1e-7)
    assert (found.error[at] > 0.8 * np.abs(found.eigenvalues[at] / exact - 1)).all()
    assert found.kind.tolist().count("flutter") == 2 * (load > 20.05) and found.stable == (load < 20.05)
    assert not found.conservative and found.caution == "" and found.complex


@pytest.mark.parametrize(
    "EI, hub, rate, tau, exact",
    [
        ((1.0, 4.0), 0.5, 6.0, 0.0,
         [9.0375380489j, 9.1625678979j, 29.5362303346j, 47.8635852903j, 69.8845089356j]),
        ((1.0, 1.0), 0.0, 3.0, 0.004,
         [-0.0248853921108 + 3.74295004637j, -0.0248849191573 + 4.79703169747j, -0.970623415118 + 23.1013819027j]),
    ],
)  # fmt: skip
@pytest.mark.serial
def test_a_rotating_blade(EI, hub, rate, tau, exact, truth):
    """About a hub; flap and lag, damped or not."""
    rod, clamp = cantilever(EI, start=(hub, 0, 0), damping=cf.Damping(time=tau))
    found = cf.modes(cf.Scene([rod], [clamp], [cf.Centrifugal((0, 0, rate))]), len(exact), elements=8)
    truth(f"rotating cantilever, {'damped' if tau else 'undamped'}, eigenvalues", found.eigenvalues, exact, 1e-7)
    assert found.stable


@pytest.mark.slow
def test_flutter_is_an_event_of_a_path(tmp_path_all, truth):
    """Beck's column; with a little Kelvin-Voigt damping at about half the load (Ziegler's paradox). The exact loads are
    20.0509536 and 10.9391220 without shear, whose effect is 1.2e-5 and 6e-6 here."""
    for time, exact in ((0.0, 20.0507172), (1e-3, 10.9390562)):
        rod, clamp = cantilever(stiff=1e6, J=1e-7, damping=cf.Damping(time=time))
        scene = cf.Scene([rod], [clamp], [cf.FollowerForce(rod.end, (0, 0, -1))])
        path = cf.solve(scene, [5.0, 10.0, 19.0, 21.0], elements=8, model="spatial")
        along = path.modes(4)
        (event,) = path.events
        assert event.kind == "flutter" and event.after == (2 if time == 0 else 1)
        damped = "with Kelvin-Voigt's damping" if time else "without damping"
        truth(f"Beck's column {damped}, load of flutter along a path", event.load_factor, exact, 1e-6)
        assert event.error < 2e-6
        assert [x.stable for x in along.modes] == [True, True, time == 0, False]
    path.save(tmp_path_all / "path.h5")
    assert cf.read_path(tmp_path_all / "path.h5").events[0].kind == "flutter" and "Flutter at" in str(path)
    with pytest.raises(cf.SceneError, match="the onset of flutter: expected a limit point or a bifurcation"):
        path.sensitivity(event, ["rods.beam.length"])


@pytest.mark.serial
def test_whirl_of_a_shaft_between_bearings(tmp_path_all, truth):
    """Timoshenko's shaft, whirl rates in space at 300 rad/s (closed form); forward and backward; Campbell diagram."""
    E, d, nu, rho, spin = 210e9, 0.1, 0.3, 7850.0, 300.0
    A, I = np.pi * d**2 / 4, np.pi * d**4 / 64
    section = cf.Stiffness((570924049.5466067,) * 2, E * A, (E * I,) * 2, E * I / (1 + nu), mass=rho * A,
                           inertia=(rho * I, rho * I, 2 * rho * I))  # fmt: skip
    shaft = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), section)
    bearings = [cf.Pin(shaft.start), cf.Roller(shaft.end, (1, 0, 0)), cf.Roller(shaft.end, (0, 1, 0))]
    held = [cf.Spring(shaft.start, rotational=1e-3), cf.Centrifugal((0, 0, 1.0))]
    found = cf.campbell(cf.Scene([shaft], bearings, held), [0.0, spin], 6, elements=8)
    rates = {1: [], -1: [], 0: []}
    for k, f in enumerate(found[1].inertial_frequencies):
        rates[found[1].whirl(k)].append(2 * np.pi * f)
    truth("Timoshenko's shaft at 300 rad/s, forward whirl", rates[1], [1262.994162319, 4886.078979331], 2e-8)
    truth("Timoshenko's shaft at 300 rad/s, backward whirl", rates[-1], [1259.441927398, 4873.4134679], 2e-8)
    assert found[1].eigenvalues.imag[1] == pytest.approx(1262.994162319 - spin, rel=1e-7)
    found.plot(tmp_path_all / "campbell.png", seen="inertial", width=400)
    assert (tmp_path_all / "campbell.png").stat().st_size > 3000 and found.rates.tolist() == [0, spin]


@pytest.mark.serial
def test_the_unbalance_of_a_rotation_stiffens_the_twist(truth):
    """A rod along the axis of rotation at the distance R from it, its mass at the arm a further out, twists at
    w^2 = (GJ (pi/2L)^2 + m W^2 R a)/(J3 + m a^2). At the load factor 0 the state lacks the unbalance, which is said."""
    R, a, W, GJ, J3 = 2.0, 0.1, 30.0, 1.0, 0.02
    section = cf.Stiffness((1e9, 1e9), 1e9, (1e8, 1e8), GJ, mass=1.0, inertia=(0.01, 0.01, J3))
    rod = cf.Rod(cf.Line((R, 0, 0), (R, 0, 1), d1=(1, 0, 0)), section, eccentricity=(a, 0.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Centrifugal((0, 0, W))])
    found = cf.modes(scene, 1, load_factor=1.0, elements=2)
    exact = np.sqrt((GJ * (np.pi / 2) ** 2 + W**2 * R * a) / (J3 + a**2))
    truth("twist of an eccentric rod in a rotation, rad/s", found.eigenvalues.imag, [exact], 1e-4)
    with pytest.warns(cf.SceneWarning, match="the load factor multiplies the unbalance .* expected load_factor=1"):
        assert cf.modes(scene, 1, elements=2).eigenvalues.imag[0] < 0.2 * exact


def test_a_rotor_with_damping_inside_and_outside(truth):
    """s^2 + c s + w1^2 tau (s - i W) + w1^2 = 0 in the inertial frame: stable below 30.13 rad/s, at 60 it grows."""
    W, J = 60.0, 1e-9
    section = cf.Stiffness((1e7, 1e7), 1e7, (1.0, 1.0), 1.0, mass=1.0, inertia=(J, J, 2 * J))
    shaft = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), section, damping=cf.Damping(time=0.002, drag=0.4))
    bearings = [cf.Pin(shaft.start), cf.Roller(shaft.end, (1, 0, 0)), cf.Roller(shaft.end, (0, 1, 0))]
    held = [cf.Spring(shaft.start, rotational=1e-6), cf.Centrifugal((0, 0, W))]
    found = cf.modes(cf.Scene([shaft], bearings, held), 1, elements=4, near=0.3 + 50.1j)
    exact = 0.293974563757 + 1j * (W - 9.88283226073)
    truth("rotor with damping inside and outside, eigenvalue", found.eigenvalues[0], exact, 1e-6)
    assert found.kind.tolist() == ["flutter"] and not found.stable and found.whirl(0) == 1


@pytest.mark.serial
def test_a_string_with_a_damper(truth):
    """A dashpot c at a = L/50 on a taut string, c = 5 sqrt(T m): sinh(x) + 5 sinh(x/50) sinh(49 x/50) = 0, with
    x = lambda L sqrt(m/T). The rod's EI/T L^2 is 1e-8."""
    section = cf.Stiffness((1e4, 1e4), 1e4, (1e-8, 1e-8), 1e-8, mass=1.0, inertia=(1e-12, 1e-12, 2e-12))
    wire = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    loads = [cf.Pretension(wire, force=1.0), cf.Dashpot(wire.at(0.02), 5.0, direction=(0, 1, 0)),
             cf.Spring(wire.start, rotational=1e-3)]  # fmt: skip
    scene = cf.Scene([wire], [cf.Pin(wire.start), cf.Pin(wire.end)], loads)
    found = cf.modes(scene, 4, near=3.15j, tol=1e-5).eigenvalues
    exact = -0.01810027925704 + 3.14705773154j
    nearest = found[np.argmin(np.abs(found - exact))]
    truth("taut string with a damper at L/50, eigenvalue", nearest, exact, 1e-3)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("rpm", "sweep", "hertz"),
    [
        (0, 0, (1.48721362, 9.32008145, 23.5930445, 26.0959222)),
        (750, 45, (13.5653517, 24.9004048, 26.0807308, 42.9989091)),
    ],
)
def test_a_blade_with_a_swept_tip(rpm, sweep, hertz, truth):
    """That of Epps & Chandra (J. Am. Helicopter Soc. 41 (1996) 29), lb, in, s; by collocation of the intrinsic
    equations."""
    E, nu, rho, b, h = 1.06e7, 0.325, 2.51e-4, 1.0, 0.063
    G, A, flap, lag = E / 2 / (1 + nu), b * h, b * h**3 / 12, h * b**3 / 12
    J = b * h**3 * (1 / 3 - 0.21 * h / b * (1 - h**4 / (12 * b**4)))
    section = cf.Stiffness((5 / 6 * G * A,) * 2, E * A, (E * flap, E * lag), G * J, mass=rho * A,
                           inertia=(rho * flap, rho * lag, rho * (flap + lag)))  # fmt: skip
    along = np.array([np.cos(np.deg2rad(sweep)), -np.sin(np.deg2rad(sweep)), 0])
    blade = cf.Rod(cf.Line((2.5, 0, 0), (34, 0, 0), d1=(0, 1, 0)), section)
    tip = cf.Rod(cf.Line((34, 0, 0), (34, 0, 0) + 6 * along, d1=(-along[1], along[0], 0)), section)
    spin = [cf.Centrifugal((0, 0, rpm * np.pi / 30))] if rpm else []
    scene = cf.Scene([blade, tip], [cf.Clamp(blade.start)], spin, [cf.Joint(blade.end, tip.start)])
    found = cf.modes(scene, 4, elements=8)
    truth(f"blade with a tip swept by {sweep} degrees at {rpm} rpm, Hz", found.frequencies, hertz, 2e-6)


@pytest.mark.serial
def test_what_modes_refuse():
    rod, clamp = cantilever()
    for loads, more, words in (
        ([cf.Centrifugal((0, 0, 1.0))] * 2, {}, "2 steady rotations"),
        ([cf.Centrifugal((0, 0, 1.0)), cf.Weight((0, -9.81, 0))], {}, "Weight is not the same in all positions"),
        ([cf.Centrifugal((0, 0, 1.0)), cf.LinearDrag(rod, 1.0)], {}, "acts on the rods in the steady rotation"),
        ([], {"near": complex("nan")}, "near = .*expected a finite complex number"),
        ([], {"near": -1j}, "near = .*upper half plane"),
        ([], {"damped": "no"}, "damped = 'no': expected True, False, or None"),
        ([cf.Centrifugal((0, 0, 1.0))], {"damped": False}, "damped = False: expected None or True"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            cf.modes(cf.Scene([rod], [clamp], loads), elements=2, **more)
    path = cf.solve(cf.Scene([rod], [clamp], [cf.Centrifugal((0, 0, 1.0))]), [0.0], elements=2)
    with pytest.raises(cf.SceneError, match="Path.modes: damped = False: expected None or True"):
        path.modes(1, damped=False)
    with pytest.raises(cf.SceneError, match="0 steady rotations"):
        cf.campbell(cf.Scene([rod], [clamp]), [1.0])
    with pytest.raises(cf.SceneError, match="rates from 0 on"):
        cf.campbell(cf.Scene([rod], [clamp], [cf.Centrifugal((0, 0, 1.0))]), [-1.0])


@pytest.mark.serial
def test_free_motions_and_their_decay_are_found_as_such():
    """A free rod has six motions for nothing; with drag each of them decays, too."""
    for drag, kinds in ((0.0, ["free"] * 6 + ["oscillates"]), (0.1, ["free"] * 6 + ["overdamped"])):
        rod, _ = cantilever((1.0, 2.0), stiff=1e4, J=1e-3, damping=cf.Damping(drag=drag))
        found = cf.modes(cf.Scene([rod]), 7, damped=True, elements=4)
        assert found.kind.tolist() == kinds and found.eigenvalues[:6].tolist() == [0j] * 6


@pytest.mark.serial
def test_slow_decay_is_no_free_motion_and_free_motions_are_not_nearer_than_others():
    """l^2 + c l + w^2 = 0 with a strong drag, whose small root is about -w^2/c."""
    for drag in (1e4, 1e6):
        rod, clamp = cantilever(stiff=1e6)
        found = cf.modes(cf.Scene([rod], [clamp], [cf.LinearDrag(rod, drag, drag)]), 4, elements=4)
        exact = -(np.repeat([3.5160152685, 22.0344915647], 2) ** 2) / drag
        assert found.kind.tolist() == ["overdamped"] * 4 and off(found, exact).max() < 2e-4
    rod, _ = cantilever((1.0, 2.0), stiff=1e4, J=1e-3, damping=cf.Damping(time=0.01))
    assert (cf.modes(cf.Scene([rod]), 2, near=20j, elements=2).frequencies > 3).all()
    assert cf.modes(cf.Scene([rod]), 2, near=0, elements=2).kind.tolist() == ["free"] * 2


@pytest.mark.serial
def test_a_tendon_and_a_free_spin_in_complex_modes():
    """Without anything that damps, complex modes are the undamped ones."""
    rod, clamp = cantilever((1.0, 1.5), J=1e-4)
    hanging = cf.Rod(cf.Line((0, 0, 0), (0, 0, -1)), rod.section)
    for scene in (
        cf.Scene([rod], [clamp], [cf.Tendon(rod, (0.05, 0.02), 3.0)]),
        cf.Scene([hanging], [cf.Pin(hanging.start)], [cf.Weight((0, 0, -9.81))]),
    ):
        found, plain = (cf.modes(scene, 3, load_factor=1, damped=x, elements=4) for x in (True, False))
        np.testing.assert_allclose(found.frequencies, plain.frequencies, rtol=1e-8)
        assert found.negative_modes == plain.negative_modes == 0


@pytest.mark.serial
def test_modes_are_followed_from_free_ones():
    """A rod hinged on the axis of its rotation: free at rest, it flaps with the rate of the rotation."""
    rod, _ = cantilever()
    held = [cf.Hinge(rod.start, (0, 1, 0))]
    found = cf.campbell(cf.Scene([rod], held, [cf.Centrifugal((0, 0, 1.0))]), [0.0, 1.0, 2.0], 2, elements=2)
    assert [x.kind[0] for x in found.modes] == ["free", "oscillates", "oscillates"]
    np.testing.assert_allclose([x.eigenvalues.imag[0] for x in found.modes], found.rates, atol=1e-4)


@pytest.mark.serial
@pytest.mark.parametrize("damped", [False, True])
def test_the_error_covers_the_bounds_in_place_of_infinite_stiffnesses(damped):
    """A cantilever without shear: cos x cosh x = -1. Rounding of the last mode was up to 4.4 times the estimate, by the
    direction of the rod: its vector was less accurate than the others; of all modes it is now at most 0.38."""
    stiff = cf.Stiffness((np.inf,) * 2, np.inf, (1.0, 1.0), 1.0, mass=1.0, inertia=(1e-12,) * 3)
    exact = np.repeat([1.875104068711961, 4.694091132974175, 7.854757438237613], 2) ** 2
    for end in ((0, 0, 1), (-0.09, 0.93, -0.36), (-0.64, 0.47, 0.61)):
        rod = cf.Rod(cf.Line((0, 0, 0), end / np.linalg.norm(end)), stiff)
        found = cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)]), 6, tol=1e-5, damped=damped)
        off = np.abs(np.abs(found.eigenvalues) / exact - 1) * (1 if damped else 2)
        assert (off <= found.error).all() and off.max() < 3e-6  # without the correction 7.7e-6
