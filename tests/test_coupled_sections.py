"""Sections that couple strains, at rest and in motion: closed forms, and equivalent descriptions of one rod."""

import numpy as np
import pytest

import cosserat_fenicsx as cf

ONCE = pytest.mark.once
L = 1.3
ANGLE = 0.6
#: Principal stiffnesses of a section with rotated principal axes, or with rotated directors.
PRINCIPAL = dict(shear=(3e3, 5e3), axial=8e3, bending=(1.0, 2.5), torsion=0.7)


def random_matrix(seed=0):
    """A matrix that couples all strains, with the magnitudes of a rod whose thickness is a tenth of its length."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(6, 6))
    size = np.sqrt([3e2, 5e2, 8e2, 1.0, 2.5, 0.7])
    unit = root @ root.T
    unit /= np.sqrt(np.outer(np.diag(unit), np.diag(unit)))
    return size[:, None] * (0.5 * unit + 0.5 * np.eye(6)) * size


def straight(section, **more):
    return cf.Rod(cf.Line((0, 0, 0), (0, 0, L), **more), section, name="rod")


def turned_and_plain(**more):
    """One rod described twice: by the matrix of rotated principal axes, or with directors along these axes."""
    d1 = (np.cos(ANGLE), np.sin(ANGLE), 0)
    yield straight(cf.Stiffness.offset(**PRINCIPAL, angle=ANGLE, **more))
    yield straight(cf.Stiffness(**PRINCIPAL, **more), d1=d1)


def exponential(k, s):
    """exp(s k x) and its integral from 0 to s."""
    size = np.linalg.norm(k)
    axis = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]]) / size
    c, t = np.cos(size * s), np.sin(size * s)
    whole = np.eye(3) * s + (1 - c) / size * axis + (s - t / size) * axis @ axis
    return np.eye(3) + t * axis + (1 - c) * axis @ axis, whole


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "formulation"), [("determinate", "mixed"), ("spatial", "mixed"), ("spatial", "displacement")]
)
def test_a_moment_along_an_eigenvector_bends_to_a_helix(model, formulation):
    """m = S k with S k along k: k and m are constant, and so are the stretch and shear -G k."""
    M = random_matrix()
    rod = straight(cf.Stiffness(matrix=M))
    compliance = np.linalg.inv(M)
    flexible, axes = np.linalg.eigh(compliance[3:, 3:])
    k = 5.0 * axes[:, 1]
    moment = k / flexible[1]
    strains = compliance[:3, 3:] @ moment
    assert np.abs(k).min() > 0.3 and np.abs(strains).max() > 0.02
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, moment)])
    path = cf.solve(scene, [0.5, 1.0], model=model, formulation=formulation, elements=8, degree=4)
    R, whole = exponential(k, L)
    expected = whole @ (strains + [0, 0, 1])
    np.testing.assert_allclose(path.position(rod.end)[-1], expected, atol=1e-6 * L)
    fields = path.fields(-1)
    np.testing.assert_allclose(np.column_stack([fields[d][-1] for d in ("d1", "d2", "d3")]), R, atol=1e-6)
    np.testing.assert_allclose(fields["curvature"], np.tile(k, (len(fields["s"]), 1)), atol=1e-5)
    np.testing.assert_allclose(fields["strain"], np.tile(strains, (len(fields["s"]), 1)), atol=1e-6)


@pytest.mark.serial
def test_small_bending_twists_and_shears():
    """Linear theory: curvature and strain are linear in s; displacement and rotation of the tip are their integrals."""
    M = random_matrix(1)
    C = np.linalg.inv(M)
    rod = straight(cf.Stiffness(matrix=M))
    n, arm = 1e-6 * np.array([1.0, -0.5, 0.3]), np.array([0, 0, 1.0])
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, n)])
    path = cf.solve(scene, [1.0], elements=2)
    m = np.cross(arm, n)  # times L - s
    theta = C[3:, 3:] @ m * L**2 / 2 + C[3:, :3] @ n * L
    turned = C[3:, 3:] @ m * L**3 / 3 + C[3:, :3] @ n * L**2 / 2  # the integral of theta
    u = C[:3, :3] @ n * L + C[:3, 3:] @ m * L**2 / 2 + np.cross(turned, arm)
    np.testing.assert_allclose(path.displacement(rod.end)[-1], u, atol=2e-5 * np.abs(u).max())
    d = path.fields(-1)
    found = [d["d2"][-1, 2], -d["d1"][-1, 2], d["d1"][-1, 1]]
    np.testing.assert_allclose(found, theta, atol=2e-5 * np.abs(theta).max())
    assert abs(theta[2]) > 0.05 * np.abs(theta).max()


@pytest.mark.serial
def test_a_rope_unwinds_under_tension():
    """n3 = EA e + c k, m3 = c e + GJ k; its end is free to rotate, or held by a support or by a moment."""
    EA, GJ, c, F = 900.0, 0.8, 12.0, 40.0
    M = np.diag([400.0, 400.0, EA, 1.5, 1.5, GJ])
    M[2, 5] = M[5, 2] = c
    rod = straight(cf.Stiffness(matrix=M))
    for moment in (0.0, 0.3):
        stretch, twist = np.linalg.solve([[EA, c], [c, GJ]], [F, moment])
        loads = [cf.Force(rod.end, (0, 0, F)), cf.Moment(rod.end, (0, 0, moment))]
        path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], loads), [1.0], elements=4)
        assert path.displacement(rod.end)[-1, 2] == pytest.approx(stretch * L, rel=1e-9)
        d1 = path.fields(-1)["d1"][-1]
        assert np.exp(1j * twist * L) == pytest.approx(complex(*d1[:2]), abs=1e-8)


def offset_and_shifted(P):
    """A rod whose line is off its centroid and shear centre, and one
    whose line passes through them, its load on an arm."""
    place = np.array([0.03, -0.05])
    one = straight(cf.Stiffness.offset(**PRINCIPAL, centroid=place, shear_centre=place))
    two = cf.Rod(cf.Line((*place, 0), (*place, L)), cf.Stiffness(**PRINCIPAL), name="rod")
    loads = [cf.Force(one.end, P)], [cf.EccentricForce(two.end, P, tuple(-place))]
    for rod, acting in zip((one, two), loads, strict=True):
        yield rod, cf.Scene([rod], [cf.Clamp(rod.start)], acting)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "formulation"),
    [
        ("spatial", "mixed"),
        *(pytest.param(*x, marks=ONCE) for x in [("determinate", "mixed"), ("spatial", "displacement")]),
    ],
)
@pytest.mark.serial
def test_a_line_off_the_centroid_is_a_shifted_rod(model, formulation):
    """Also at large displacements; Newton's method with n carried takes the same iterations."""
    (rod, scene), (shifted, other) = offset_and_shifted((0.4, 0.2, -2.2))
    etas = [0.5, 1.0, 1.5]
    a, b = (cf.solve(x, etas, model=model, formulation=formulation, elements=12, degree=4) for x in (scene, other))
    fa, fb = a.fields(-1), b.fields(-1)
    moved = fb["position"] - fb["d1"] * 0.03 + fb["d2"] * 0.05
    np.testing.assert_allclose(fa["position"], moved, atol=1e-7 * L)
    np.testing.assert_allclose(fa["force"], fb["force"], atol=1e-5)
    np.testing.assert_allclose(fa["curvature"], fb["curvature"], atol=1e-5)
    assert a.negative_modes.tolist() == b.negative_modes.tolist()
    assert formulation != "mixed" or a.iterations.tolist() == b.iterations.tolist()
    stretched = fb["strain"] - np.cross(fb["curvature"], [0.03, -0.05, 0])
    np.testing.assert_allclose(fa["strain"], stretched, atol=1e-6)


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize("load", [cf.Force, cf.FollowerForce])
@pytest.mark.parametrize("formulation", ["mixed", pytest.param("displacement", marks=ONCE)])
def test_turned_principal_axes_are_turned_directors(load, formulation):
    """To rounding, step by step, with stability and reactions."""
    paths = []
    for rod in turned_and_plain(mass=1.0):
        tip = cf.Force(rod.end, (0.3, 0.7, -1)) if load is cf.Force else cf.FollowerForce(rod.end, (0, 0, -1.5))
        loads = [tip, cf.Weight((0.3, 0.1, -0.5)), cf.Moment(rod.end, (0.2, 0.3, 0.4))]
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
        paths.append(cf.solve(scene, [0.5, 1.0, 2.0], model="spatial", formulation=formulation, elements=4, degree=4))
    a, b = paths
    assert a.iterations.tolist() == b.iterations.tolist() and a.negative_modes.tolist() == b.negative_modes.tolist()
    for name in ("position", "force", "moment"):
        np.testing.assert_allclose(a.fields(-1)[name], b.fields(-1)[name], atol=1e-9, err_msg=name)
    turn = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])
    for name in ("strain", "curvature"):
        np.testing.assert_allclose(a.fields(-1)[name], b.fields(-1)[name] @ turn.T, atol=1e-9, err_msg=name)


@pytest.mark.serial
def test_critical_loads_of_turned_principal_axes():
    for rod, count in zip(turned_and_plain(), (4, 4), strict=True):
        assert cf.euler_load(rod) == pytest.approx(np.pi**2 * 1.0 / (2 * L) ** 2)
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1.0))])
        found = cf.buckling(scene, count=count).load_factors
        expected = [
            np.pi**2 * EI * (2 * n - 1) ** 2 / (2 * L) ** 2 for n, EI in ((1, 1.0), (1, 2.5), (2, 1.0), (2, 2.5))
        ]
        if rod.profile.coupled:
            coupled = found
    np.testing.assert_allclose(coupled, found, rtol=1e-6)
    np.testing.assert_allclose(found, np.array(expected), rtol=0.02)  # shear and shortening


@pytest.mark.serial
def test_a_tapered_matrix_has_the_euler_load_of_its_principal_axes():
    plain, turned = (
        cf.Rod(cf.Line((0, 0, 0), (0, 0, L)), lambda s, angle=angle: cf.Stiffness.offset(
            (1e3, 1e3), 1e3, (1.0 + s, 3.0 - s), 1.0, angle=angle))
        for angle in (0.0, 0.7)
    )  # fmt: skip
    diagonal = cf.Rod(plain.curve, lambda s: cf.Stiffness((1e3, 1e3), 1e3, (1.0 + s, 3.0 - s), 1.0))
    expected = cf.euler_load(diagonal)
    assert [cf.euler_load(plain), cf.euler_load(turned)] == pytest.approx([expected] * 2, rel=1e-12)


@pytest.mark.slow
@pytest.mark.serial
def test_infinite_stiffness_beside_a_matrix():
    """Another rod of the scene may be rigid against stretch and shear; the contact force is an unknown then."""
    tips = []
    for rod in turned_and_plain():
        rigid = cf.Stiffness((np.inf, np.inf), np.inf, (1.0, 2.0), 0.5)
        arm = cf.Rod(cf.Line((0, 0, L), (0.5, 0, L)), rigid, name="arm")
        loads = [cf.Force(arm.end, (0.3, 0.6, -0.4))]
        scene = cf.Scene([rod, arm], [cf.Clamp(rod.start)], loads, [cf.Joint(rod.end, arm.start)])
        path = cf.solve(scene, [1.0, 2.0], model="spatial", elements=4)
        assert path.negative_modes.tolist() == [0, 0]
        tips.append(path.displacement(arm.end))
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-10)


def test_rotating_the_scene_turns_the_answer():
    q, r = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    Q = q * np.sign(np.diag(r)) * np.sign(np.linalg.det(q * np.sign(np.diag(r))))
    found, force = [], np.array([0.3, 0.5, -0.8])
    for turn in (np.eye(3), Q):
        rod = cf.Rod(cf.Line((0, 0, 0), turn @ [0, 0, L], d1=turn[:, 0]), cf.Stiffness(matrix=random_matrix(2)))
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, turn @ force)])
        path = cf.solve(scene, [1.0], elements=5)
        found.append((path.position(rod.end)[-1] @ turn, path.fields(-1)["curvature"], path.fields(-1)["strain"]))
    for a, b in zip(*found, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-10)


@pytest.mark.serial
@pytest.mark.parametrize("model", ["determinate", "spatial"])
def test_negative_modes_of_a_column_off_its_line(model):
    """Compressed through its centroid it stays straight, for any offset of its line; it buckles about both axes."""
    place = (0.03, -0.05)
    section = cf.Stiffness.offset((3e3, 5e3), 8e3, (1.0, 2.5), 0.7, centroid=place, shear_centre=place, angle=ANGLE)
    rod = straight(section)
    axes = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])
    P = np.pi**2 / (2 * L) ** 2  # of the weak axis; then 2.5, 9, 22.5
    load = cf.EccentricForce(rod.end, (0, 0, -P), tuple(axes @ place))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [load])
    path = cf.solve(scene, [0.9, 1.1, 2.7, 9.5, 23.5], model=model, elements=6)
    np.testing.assert_allclose(path.displacement(rod.end)[:, :2], 0, atol=1e-6)
    assert path.negative_modes.tolist() == [0, 1, 2, 3, 4]


@pytest.mark.serial
@pytest.mark.parametrize("tension", [1e4, 1e7])
def test_a_taut_wire_off_its_line_has_no_negative_modes(tension):
    """T L^2/EI is far above the usual bound of K in the second variation."""
    slender = dict(shear=(4e11, 4e11), axial=1e12, bending=(1.0, 2.5), torsion=0.7)
    section = cf.Stiffness.offset(**slender, centroid=(1e-6, 2e-6), shear_centre=(3e-6, 0), angle=ANGLE)
    rod = straight(section)
    loads = [cf.Force(rod.end, (1e-3 * tension, 0, tension))]
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], loads), [1.0], model="spatial", elements=16)
    assert path.negative_modes.tolist() == [0]


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


@pytest.mark.serial
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
