"""Curves (arc length, tangent and frame to round-off), and sections computed by finite elements."""

import math
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import refuses
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf
from cosserat_fenicsx.scene.sections import inverse

pytestmark = [pytest.mark.serial, pytest.mark.once]
BEND = [(0, 0, 0), (1.0, 0.2, 0.1), (1.8, 1.1, 0.7), (2.0, 2.3, 0.4), (1.2, 3.0, -0.9), (0.1, 3.1, -1.0)]
RING = [(1.0, 0, 0), (0.8, 0.9, 0.5), (-0.3, 1.2, -0.2), (-1.1, 0.1, 0.6), (-0.2, -1.3, 0.3)]
HALF = math.sqrt(0.5)
CURVES = {
    "line": cf.Line((1, 2, 3), (4, -3, 20)),
    "arc": cf.Arc((1, 2, 3), (4, 2.5, 1), 2.1, axis=(1, 2, 2)),
    "arc turned back": cf.Arc((1, 2, 3), (4, 2.5, 1), -0.4, axis=(1, 2, 2), d1=(0.1, 1, 0.3)),
    "two rings": cf.Arc((0, 0, 0), (2, 0, 0), 4 * math.pi),
    "helix": cf.Helix((0, 0, 0), (0.5, 0, 1), 3.25, 0.2),
    "left-handed helix": cf.Helix((0, 1, 0), (0.5, 0, 1), -2, 0.7, axis=(1, 0, 3), d1=(1, 1, 1)),
    "uniform": cf.UniformCurvature(3.0, (0.4, -1.1, 0.8), (1, 2, 3), (HALF, 0.5, 0, -0.5)),
    "uniform, all but straight": cf.UniformCurvature(3.0, (1e-9, -2e-9, 1e-9)),
    "uniform, straight": cf.UniformCurvature(3.0, (0, 0, 0)),
    "spline": cf.Spline(BEND),
    "spline of two points": cf.Spline([(1, 2, 3), (4, -3, 20)]),
    "spline of three points": cf.Spline(BEND[:3], d1=(0, 0, 1)),
    "spline with a sharp bend": cf.Spline([(0, 0, 0), (1, 0, 0), (0.25, 0.15, 0.05)]),
    "closed spline": cf.Spline(RING, closed=True),
    "closed spline of three points": cf.Spline(RING[:3], closed=True),
}
NEAR = dict(rtol=0, atol=2e-14)


def inside(curve, margin, count=60):
    """Arc lengths at least `margin` away from the ends and the breaks of a curve."""
    ends = np.array([0.0, *curve.breaks, curve.length])
    s = np.random.default_rng(5).uniform(0, curve.length, 20 * count)
    return s[np.abs(s[:, None] - ends).min(axis=1) > margin][:count]


def slope(function, s, h):
    """d/ds of an array-valued function by central differences of order 8."""
    weights = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
    return sum(w * function(s + (i - 4) * h) for i, w in enumerate(weights)) / h


def curvature(curve, s):
    """The material curvature u: R' = R (u x), the axial vector of R^T R'."""
    h = 2e-4 * curve.length
    W = curve.frame(s).transpose(0, 2, 1) @ slope(curve.frame, s, h)
    return np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)


@pytest.mark.parametrize("name", CURVES)
def test_frames_are_rotations_with_the_tangent(name):
    curve = CURVES[name]
    h = 2e-4 * curve.length * (0.01 if "sharp" in name else 1)
    s = inside(curve, 5 * h)
    R = curve.frame(s)
    np.testing.assert_allclose(R.transpose(0, 2, 1) @ R, np.broadcast_to(np.eye(3), R.shape), **NEAR)
    np.testing.assert_allclose(np.linalg.det(R), 1, **NEAR)
    scale = 1 + np.abs(curve.position(s)).max() / curve.length
    np.testing.assert_allclose(slope(curve.position, s, h), R[:, :, 2], atol=1e-15 / h * curve.length * scale * 10)


@pytest.mark.parametrize("name", CURVES)
def test_shapes_and_continuity(name):
    curve = CURVES[name]
    assert curve.position(0.3).shape == (3,) and curve.frame(0.3).shape == (3, 3)
    s = np.linspace(0, curve.length, 6).reshape(2, 3)
    assert curve.position(s).shape == (2, 3, 3) and curve.frame(s).shape == (2, 3, 3, 3)
    np.testing.assert_array_equal(curve.frame(s)[1, 0], curve.frame(s[1, 0]))
    dense = np.linspace(0, curve.length, 20001)
    assert np.abs(np.diff(curve.frame(dense), axis=0)).max() < 0.1  # no flips
    assert all(0 < a < curve.length for a in curve.breaks) and list(curve.breaks) == sorted(curve.breaks)
    for s in curve.breaks:
        around = np.array([s * (1 - 1e-13), s, s * (1 + 1e-13)])
        assert np.ptp(curve.position(around), axis=0).max() < 1e-11
        assert np.ptp(curve.frame(around), axis=0).max() < 1e-10


@pytest.mark.parametrize("angle", [0.3, -2.0, 2 * math.pi, 9.0])
def test_arc(angle):
    """Also a metre of a circle with R = 1e6 m, whose rise s^2/(2 R) of 5e-7 m has nine correct digits; more than a turn
    is doubted, as degrees."""
    centre, start, axis = np.array([1.0, 2, 3]), np.array([4.0, 2.5, 1]), np.array([1.0, 2, 2]) / 3
    doubt = pytest.warns(cf.SceneWarning, match="9 rad are 1.43 turns, .* '9 deg'") if angle == 9 else nullcontext()
    with doubt:
        arc = cf.Arc(centre, start, angle, axis=3 * axis)
    radius = np.linalg.norm(np.cross(axis, start - centre))
    assert arc.length == pytest.approx(radius * abs(angle), rel=1e-15)
    s = np.linspace(0, arc.length, 7)
    turns = Rotation.from_rotvec(np.outer(s / arc.length * angle, axis)).as_matrix()
    np.testing.assert_allclose(arc.position(s), centre + turns @ (start - centre), **NEAR)
    np.testing.assert_allclose(arc.frame(s), turns @ arc.frame(0.0), **NEAR)
    np.testing.assert_allclose(arc.frame(s)[:, :, 0], np.tile(axis, (7, 1)), **NEAR)
    u = curvature(arc, inside(arc, 0.01 * arc.length))
    np.testing.assert_allclose(u, np.tile([np.sign(angle) / radius, 0, 0], (len(u), 1)), atol=1e-10)
    np.testing.assert_allclose(cf.Arc((0, 1e6, 0), (0, 0, 0), 1e-6).position(1.0), (1.0, 5e-7, 0), rtol=1e-9)
    given = cf.Arc((0, 0, 5), (2, 0, 0), angle, d1=(1, 0, 1))
    np.testing.assert_allclose(given.frame(0.0)[:, 0], (HALF, 0, HALF), **NEAR)


@pytest.mark.parametrize("turns", [2.5, -2.5])
@pytest.mark.parametrize("pitch", [0.6, -0.6, 0.0])
def test_helix(turns, pitch):
    a, b, sense = 0.5, pitch / (2 * math.pi), math.copysign(1, turns)
    helix = cf.Helix((0, 0, -1), (a, 0, 0), turns, pitch)
    assert helix.length == pytest.approx(2.5 * math.hypot(2 * math.pi * a, pitch), rel=1e-15)
    x = np.linspace(0, 1, 9)
    angle = 2 * math.pi * turns * x
    expected = np.column_stack([a * np.cos(angle), a * np.sin(angle), pitch * 2.5 * x])
    np.testing.assert_allclose(helix.position(x * helix.length), expected, **NEAR)
    np.testing.assert_allclose(helix.frame(0.0)[:, 0], (-1, 0, 0), **NEAR)
    u = curvature(helix, inside(helix, 0.01 * helix.length))
    kappa, tau = a / (a * a + b * b), sense * b / (a * a + b * b)
    np.testing.assert_allclose(u, np.tile([0, kappa, tau], (len(u), 1)), atol=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-3, 0.9, 1.0, 1.1, 30.0])
def test_uniform_curvature(size):
    """Any part of the curve is congruent to its beginning, for any angle; and its curvature is u."""
    u = size * np.array([2.0, -1, 2]) / 3
    whole = cf.UniformCurvature(2.0, u, (1, 2, 3), (0.5, 0.5, -0.5, 0.5))
    np.testing.assert_allclose(whole.frame(0.0), [[0, -1, 0], [0, 0, -1], [1, 0, 0]], **NEAR)
    middle = Rotation.from_matrix(whole.frame(0.7)).as_quat()[[3, 0, 1, 2]]
    rest = cf.UniformCurvature(1.3, u, whole.position(0.7), middle)
    s = np.linspace(0, 1.3, 30)
    np.testing.assert_allclose(rest.position(s), whole.position(0.7 + s), **NEAR)
    np.testing.assert_allclose(rest.frame(s), whole.frame(0.7 + s), rtol=0, atol=1e-14 * max(2, size))
    np.testing.assert_allclose(curvature(whole, inside(whole, 0.01)), np.tile(u, (60, 1)), atol=1e-9)


def test_uniform_curvature_is_arc_and_helix():
    s = np.linspace(0, 3, 20)
    circle = cf.UniformCurvature(3.0, (0, 0.5, 0))  # bending about d2 = y takes d3 = z towards x
    expected = np.column_stack([2 - 2 * np.cos(s / 2), 0 * s, 2 * np.sin(s / 2)])
    np.testing.assert_allclose(circle.position(s), expected, **NEAR)
    twisted = cf.UniformCurvature(3.0, (0, 0, 0.8))
    np.testing.assert_allclose(twisted.position(s), np.outer(s, (0, 0, 1)), **NEAR)
    np.testing.assert_allclose(twisted.frame(s)[:, 1, 0], np.sin(0.8 * s), **NEAR)


@pytest.mark.parametrize("closed", [False, True])
def test_spline_by_arc_length(closed):
    """Against SciPy's spline and its quadrature."""
    points = np.array(RING + RING[:1] if closed else BEND, dtype=float)
    spline = cf.Spline(points, closed=closed)
    knots = np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    cubic = CubicSpline(knots, points, bc_type="periodic" if closed else "not-a-knot")

    def arc(a, b):
        return quad(lambda t: np.linalg.norm(cubic(t, 1)), a, b, epsabs=0, epsrel=2e-14, limit=200)[0]

    arcs = np.append(0, np.cumsum([arc(a, b) for a, b in zip(knots[:-1], knots[1:], strict=True)]))
    assert spline.length == pytest.approx(arcs[-1], rel=2e-15)
    np.testing.assert_allclose([0, *spline.breaks, spline.length], arcs, rtol=2e-15)
    np.testing.assert_allclose(spline.position(arcs), points, **NEAR)
    t = np.random.default_rng(3).uniform(0, knots[-1], 50)
    span = np.searchsorted(knots, t) - 1
    s = np.array([arcs[i] + arc(knots[i], x) for i, x in zip(span, t, strict=True)])
    np.testing.assert_allclose(spline.position(s), cubic(t), **NEAR)
    tangent = cubic(t, 1) / np.linalg.norm(cubic(t, 1), axis=1, keepdims=True)
    np.testing.assert_allclose(spline.frame(s)[:, :, 2], tangent, **NEAR)


@pytest.mark.parametrize("name", [name for name in CURVES if "spline" in name and "closed" not in name])
def test_the_frame_of_a_spline_does_not_twist(name):
    spline = CURVES[name]
    h = 1e-4 * spline.length * (0.02 if "sharp" in name else 1)
    s = inside(spline, 5 * h)
    twist = np.einsum("ni,ni->n", slope(spline.frame, s, h)[:, :, 0], spline.frame(s)[:, :, 1])
    np.testing.assert_allclose(twist, 0, atol=1e-9)



@pytest.mark.parametrize("top", [(0, 0, 5), (0.1, 0, 5), (3, 1, 2)])
def test_a_bow_does_not_turn_the_axes_by_default(top):
    s = np.linspace(0, 1, 21)[:, None]
    bow = 1e-3 * np.sin(np.pi * s) * np.cross(top, (1, 2, 0.3))
    bowed = cf.Spline(s * np.array(top, dtype=float) + bow)
    (straight, turned) = (curve.frame(np.array([0.0]))[0] for curve in (cf.Line((0, 0, 0), top), bowed))
    assert np.abs(straight - turned).max() < 0.05


def test_the_frame_of_a_spline_against_bishops_equation():
    """d1' = -(d1 . t') t, integrated by DOP853 from knot to knot."""
    spline = CURVES["spline"]
    points = np.array(BEND, dtype=float)
    knots = np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    cubic = CubicSpline(knots, points)

    def rate(t, d1):
        c, c_t = cubic(t, 1), cubic(t, 2)
        return -np.dot(d1, c_t) / np.dot(c, c) * c

    d1 = spline.frame(0.0)[:, 0]
    for i, s in enumerate([*spline.breaks, spline.length]):
        d1 = solve_ivp(rate, knots[i : i + 2], d1, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        np.testing.assert_allclose(spline.frame(s)[:, 0], d1, atol=1e-12)


def test_a_plane_spline_keeps_its_normal():
    x = np.linspace(0, 5, 12)
    spline = cf.Spline(np.column_stack([x, np.sin(x), 0 * x]), d1=(0, 0, 1))
    frames = spline.frame(np.linspace(0, spline.length, 200))
    np.testing.assert_allclose(frames[:, :, 0], np.tile([0, 0, 1], (200, 1)), **NEAR)
    level = cf.Spline(np.column_stack([x, 0 * x, np.sin(x)]))  # as for a Line: d1 horizontal, d2 upwards
    frames = level.frame(np.linspace(0, level.length, 200))
    np.testing.assert_allclose(np.abs(frames[:, 1, 0]), 1, **NEAR)
    assert (frames[:, 2, 1] > 0).all()


@pytest.mark.parametrize("name", ["closed spline", "closed spline of three points"])
def test_a_closed_spline_closes(name):
    """Position, tangent and frame agree at both ends; the twist that this takes is uniform."""
    spline = CURVES[name]
    np.testing.assert_allclose(spline.position(spline.length), spline.position(0.0), **NEAR)
    np.testing.assert_allclose(spline.frame(spline.length), spline.frame(0.0), **NEAR)
    u = curvature(spline, inside(spline, 5e-3 * spline.length))
    np.testing.assert_allclose(u[:, 2], u[0, 2], atol=1e-9)
    ends = curvature(spline, np.array([1e-3, 1 - 1e-3]) * spline.length)
    np.testing.assert_allclose(ends[0], ends[1], atol=0.1)  # the curvature is continuous there too
    if len(spline.points) > 3:
        assert abs(u[0, 2]) > 1e-2  # the ring is not plane: without the twist its frame would not close
    again = cf.Spline([*spline.points, spline.points[0]], closed=True)
    assert again == spline and again.length == spline.length


def test_points_of_a_circle_to_fourth_order_up_to_the_ends():
    errors = []
    for count in (17, 33):
        a = np.linspace(0, 2, count)
        spline = cf.Spline(np.column_stack([np.cos(a), np.sin(a), 0 * a]))
        s = np.linspace(0, spline.length, 400)
        errors.append(np.abs(np.linalg.norm(spline.position(s), axis=1) - 1).max())
        at_start = slope(lambda s, spline=spline: spline.frame(s)[:, :, 2], np.array([1e-3]), 1e-4)
        assert np.linalg.norm(at_start) == pytest.approx(1, abs=0.02)  # a natural spline would say 0
    assert errors[0] < 1e-5 and errors[0] / errors[1] > 15


def test_a_rigid_motion_of_the_input_moves_the_curve():
    Q = Rotation.from_rotvec([0.7, -1.9, 0.4]).as_matrix()
    shift, d1 = np.array([3.0, -4.0, 12.0]), np.array([0.2, 0.3, 1.0])

    def moved(*points):
        return [Q @ p + shift for p in points]

    quaternion = Rotation.from_matrix(Q).as_quat()[[3, 0, 1, 2]]
    pairs = [
        (cf.Arc((1, 0, 0), (3, 0, 1), 1.7, (0, 1, 1), d1),
         cf.Arc(*moved((1, 0, 0), (3, 0, 1)), 1.7, Q @ (0, 1, 1), Q @ d1)),
        (cf.Helix((1, 0, 0), (3, 0, 1), 2, -1, (0, 1, 1)),
         cf.Helix(*moved((1, 0, 0), (3, 0, 1)), 2, -1, Q @ (0, 1, 1))),
        (cf.UniformCurvature(2, (1, 2, 3)), cf.UniformCurvature(2, (1, 2, 3), shift, quaternion)),
        (cf.Spline(BEND, d1), cf.Spline(moved(*BEND), Q @ d1)),
        (cf.Spline(RING, d1, closed=True), cf.Spline(moved(*RING), Q @ d1, closed=True)),
    ]  # fmt: skip
    points = np.round(np.array(BEND) * 1024) / 1024  # where a spline stands costs no digits: the sums below are exact
    near, far = cf.Spline(points), cf.Spline(points + [2.0**22, -(2.0**23), 0])
    np.testing.assert_array_equal(
        near.frame(np.linspace(0, near.length, 50)), far.frame(np.linspace(0, far.length, 50))
    )
    for curve, turned in pairs:
        s = np.linspace(0, curve.length, 41)
        assert turned.length == pytest.approx(curve.length, rel=1e-14)
        np.testing.assert_allclose(turned.position(s), curve.position(s) @ Q.T + shift, atol=1e-13)
        np.testing.assert_allclose(turned.frame(s), Q @ curve.frame(s), atol=1e-13)


def test_thousands_of_points():
    x = np.linspace(0, 300, 3000)
    spline = cf.Spline(np.column_stack([x, np.cos(x), np.sin(x)]))
    R = spline.frame(np.linspace(0, spline.length, 5000))
    np.testing.assert_allclose(R.transpose(0, 2, 1) @ R, np.broadcast_to(np.eye(3), R.shape), **NEAR)
    assert spline.length == pytest.approx(300 * math.sqrt(2), rel=1e-5)


nan, inf = math.nan, math.inf
REFUSED = {
    "arc of no angle": (lambda: cf.Arc((0, 0, 0), (1, 0, 0), 0.0),
                        "Arc.angle = 0.0: expected a finite number other than 0"),
    "arc of infinite angle": (lambda: cf.Arc((0, 0, 0), (1, 0, 0), inf), "Arc.angle = inf"),
    "arc of no radius": (lambda: cf.Arc((0, 0, 0), (0, 0, 1), 1.0),
                         "Arc.start = (0.0, 0.0, 1.0): expected a point off the axis"),
    "arc too short": (lambda: cf.Arc((0, 0, 0), (1, 0, 0), 1e-14), "Arc.length = 1e-14"),
    "arc of no axis": (lambda: cf.Arc((0, 0, 0), (1, 0, 0), 1.0, axis=(0, 0, 0)), "Arc.axis = (0.0, 0.0, 0.0)"),
    "arc, NaN": (lambda: cf.Arc((0, nan, 0), (1, 0, 0), 1.0),
                 "Arc.centre = (0, nan, 0): expected 3 finite numbers (m)"),
    "arc, d1 along": (lambda: cf.Arc((0, 0, 0), (1, 0, 0), 1.0, d1=(0, 2, 0)),
                      "Arc.d1 = (0.0, 2.0, 0.0): expected a direction across"),
    "helix of no turns": (lambda: cf.Helix((0, 0, 0), (1, 0, 0), 0, 1.0), "Helix.turns = 0"),
    "helix, pitch": (lambda: cf.Helix((0, 0, 0), (1, 0, 0), 1, nan), "Helix.pitch = nan"),
    "helix of no radius": (lambda: cf.Helix((0, 0, 0), (0, 0, 0), 1, 1.0), "Helix.start"),
    "helix, d1": (lambda: cf.Helix((0, 0, 0), (1, 0, 0), 1, 1.0, d1="x"), "Helix.d1 = 'x'"),
    "uniform of no length": (lambda: cf.UniformCurvature(0, (0, 0, 0)), "UniformCurvature.length = 0"),
    "uniform, curvature": (lambda: cf.UniformCurvature(1, (0, inf, 0)), "UniformCurvature.curvature = (0, inf, 0)"),
    "uniform, no quaternion": (lambda: cf.UniformCurvature(1, (0, 0, 0), frame=(1, 0, 0)),
                               "UniformCurvature.frame = (1, 0, 0): expected 4"),
    "uniform, quaternion of length 2": (lambda: cf.UniformCurvature(1, (0, 0, 0), frame=(2, 0, 0, 0)),
                                        "expected a quaternion of length 1"),
}  # fmt: skip


test_refused = refuses(REFUSED)


STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
_STEEL = SimpleNamespace(elastic_modulus=210e9, poissons_ratio=0.3, density=7850.0)
_STEEL_MM = SimpleNamespace(elastic_modulus=210e3, poissons_ratio=0.3, density=7.85e-6)
_ALUMINIUM_MM = SimpleNamespace(elastic_modulus=70e3, poissons_ratio=0.3, density=2.7e-6)


class Computed:
    """What a section of sectionproperties returns."""

    def __init__(self, materials=(), outline=None, **returned):
        self.materials = list(materials)
        self.geometry = SimpleNamespace(geom=outline)
        returned |= {"is_composite": bool(materials)}
        vars(self).update({name: lambda value=value: value for name, value in returned.items()})


#: 200 x 75 mm, flanges 11.5 mm, web 8.5 mm, in m; with a material of its own, and without
CHANNEL = Computed(
    [_STEEL],
    get_mass=25.81080978, get_ea=690480261.5, get_eic=(4137410.789, 359772.5697, 2.56113708e-09),
    get_eip=(4137410.789, 359772.5697), get_c=(0.02181628768, 0.1), get_sc=(-0.02106112392, 0.1000000514), get_phi=0.0,
    get_ej=25218.35637, get_eas=(199515015.4, 319682474.3), get_eas_p=(199515015.4, 319682474.3),
    get_e_eff=210e9, get_g_eff=80769230770.0,
)  # fmt: skip
BARE_CHANNEL = Computed(
    get_area=0.003288001245, get_ic=(1.970195614e-05, 1.713202713e-06, 8.470329473e-21),
    get_ip=(1.970195614e-05, 1.713202713e-06), get_c=(0.02181628768, 0.1), get_sc=(-0.02106258071, 0.1000000395),
    get_phi=0.0, get_j=1.200874113e-07, get_as=(0.0009534675402, 0.00152230205),
    get_as_p=(0.0009534675402, 0.00152230205),
)  # fmt: skip
#: an angle, 150 x 90 x 12, in mm
ANGLE = Computed(
    [_STEEL_MM],
    get_mass=0.02160260909, get_ea=577904192.2, get_eic=(1317015321000.0, 358598074200.0, -393659396400.0),
    get_eip=(1457974921000.0, 217638474400.0), get_c=(21.15419354, 50.80698801), get_sc=(6.22705473, 8.297981112),
    get_phi=-160.2988222, get_ej=28998169530.0, get_eas=(181439917.3, 323389701.4),
    get_eas_p=(186236479.6, 309196097.4), get_e_eff=210000.0, get_g_eff=80769.23077,
)  # fmt: skip
#: steel and aluminium side by side, 50 x 100 each, in mm
PAIR = Computed(
    [_STEEL_MM, _ALUMINIUM_MM],
    get_mass=0.05275, get_ea=1.4e9, get_eic=(1166666667000.0, 947916666700.0, -0.01171875),
    get_eip=(1166666667000.0, 947916666700.0), get_c=(37.5, 50.0), get_sc=(38.58266962, 50.00001809), get_phi=0.0,
    get_ej=1676185019000.0, get_eas=(998638565.4, 1159348368.0), get_eas_p=(998638565.4, 1159348368.0),
    get_e_eff=140000.0, get_g_eff=53846.15385,
)  # fmt: skip


def rectangle(b, h, outline=None):
    """A rectangle by formulas, its corner at the origin, without materials; Poisson's ratio zero."""
    k = cf.Rectangle(b, h, shear_factor=5 / 6).stiffness(cf.Material(E=1.0, nu=-0.5))  # E = G = 1
    return Computed(outline=outline, get_area=k.axial, get_ic=(*k.bending, 0.0), get_ip=k.bending,
                    get_c=(b / 2, h / 2), get_sc=(b / 2, h / 2 + 1e-9), get_phi=0.0 if b < h else -90.0,
                    get_j=k.torsion, get_as=k.shear, get_as_p=k.shear)  # fmt: skip


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_symmetric_section_is_the_same_as_by_formulas(unit):
    corners = [(0, 0), (0, 0.3 / unit), (0.2 / unit, 0.3 / unit), (0.2 / unit, 0), (0, 0)]  # clockwise and closed
    outline = SimpleNamespace(exterior=SimpleNamespace(coords=corners))
    k = cf.Stiffness.from_section(rectangle(0.2 / unit, 0.3 / unit, outline), STEEL, unit=unit)
    exact = cf.Rectangle(0.2, 0.3, shear_factor=5 / 6).stiffness(STEEL)
    for name in ("shear", "axial", "bending", "torsion", "mass", "inertia"):
        assert getattr(k, name) == pytest.approx(getattr(exact, name), rel=1e-12), name
    assert k.matrix is None
    x, y = np.array(k.outline).T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2 == pytest.approx(0.06)  # counterclockwise, in m


def test_a_channel():
    """Its numbers with and without E; a force through the shear centre, and no other, turns nothing."""
    one, other = cf.Stiffness.from_section(CHANNEL), cf.Stiffness.from_section(BARE_CHANNEL, STEEL)
    M, flexible = np.array(one.matrix), inverse(np.array(one.matrix))
    np.testing.assert_allclose(M, other.matrix, rtol=0.01, atol=1e-6 * M.max())
    np.testing.assert_allclose(np.diag(M)[:5], [STEEL.G * 0.0009500715, STEEL.G * 0.0015222975, 690480261.5,
                                                4137410.789, 359772.5697], rtol=1e-6)  # fmt: skip
    assert 1 / flexible[5, 5] == pytest.approx(25218.35637 * STEEL.G / 210e9, rel=1e-9)
    arm = -0.02106112392 - 0.02181628768
    force = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert (flexible @ force)[5] == pytest.approx(-arm / (25218.35637 * STEEL.G / 210e9), rel=1e-6)
    assert abs((flexible @ (force + [0, 0, 0, 0, 0, arm]))[5]) < 1e-6 * (flexible @ force)[5]
    assert one.mass == pytest.approx(25.81080978) and one.inertia[0] == pytest.approx(7850 * 1.970195614e-05, rel=1e-6)


def test_an_angle_in_mm():
    """Principal axes turn back to the moments about x and y; a section that is skew leaves its inertia out."""
    k = cf.Stiffness.from_section(ANGLE, unit=1e-3)
    EIx, EIy, EIxy = (value * 1e-6 for value in ANGLE.get_eic())
    np.testing.assert_allclose(np.array(k.matrix)[3:5, 3:5], [[EIx, -EIxy], [-EIxy, EIy]], rtol=1e-8)
    assert k.mass == pytest.approx(21.60260909) and k.inertia is None
    # the shear flexibility along x and y and along the principal axes, whose coupling cannot be told from either alone
    flexible = np.linalg.inv(np.array(k.matrix)[:2, :2])
    angle = np.radians(ANGLE.get_phi())
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for axes, areas in ((np.eye(2), ANGLE.get_eas()), (turn, ANGLE.get_eas_p())):
        expected = 210 / 80.76923077 / np.array(areas)
        np.testing.assert_allclose(np.diag(axes @ flexible @ axes.T), expected, rtol=1e-8)


def test_the_line_elsewhere():
    """Steiner's theorem; mass off the line is left out."""
    k = cf.Stiffness.from_section(CHANNEL, line=(0.0, 0.05))
    (x, y), EA = (0.02181628768, 0.05), 690480261.5
    np.testing.assert_allclose(
        np.array(k.matrix)[3:5, 3:5],
        [[4137410.789 + EA * y * y, -EA * x * y], [-EA * x * y, 359772.5697 + EA * x * x]],
        rtol=1e-9,
    )
    assert k.mass is None and k.inertia is None


def test_two_materials():
    """The centre of mass is not the centroid of E: mass is kept for a line through it alone."""
    k = cf.Stiffness.from_section(PAIR, unit=1e-3)
    assert k.mass is None and k.inertia is None  # regions unknown
    assert np.diag(k.matrix)[2:5] == pytest.approx([1.4e9, 1166666.667, 947916.6667])
    halves = [
        SimpleNamespace(material=material, geom=SimpleNamespace(area=5000.0, centroid=SimpleNamespace(x=x, y=50.0)))
        for material, x in ((_STEEL_MM, 25.0), (_ALUMINIUM_MM, 75.0))
    ]
    known = Computed(PAIR.materials, **{name: get() for name, get in vars(PAIR).items() if name.startswith("get_")})
    known.geometry.geoms = halves
    assert cf.Stiffness.from_section(known, unit=1e-3).mass is None
    k = cf.Stiffness.from_section(known, unit=1e-3, line=((7850 * 25 + 2700 * 75) / 10550, 50.0))
    assert k.mass == pytest.approx(0.5 * 0.01 * (7850 + 2700)) and k.inertia is None


def raising(message):
    def method():
        raise RuntimeError(message)

    return method


WITHOUT_WARPING = rectangle(1.0, 2.0)
WITHOUT_WARPING.get_sc = raising("Conduct a warping analysis.")
MIXED = Computed([_STEEL, SimpleNamespace(elastic_modulus=30e9, poissons_ratio=0.2, density=2400.0)],
                 **{name: getattr(CHANNEL, name)() for name in vars(CHANNEL) if name.startswith("get_")})  # fmt: skip
REFUSED_SECTIONS = {
    "no section": ((cf.Circle(0.1), STEEL), "expected a Section of sectionproperties"),
    "no material": ((BARE_CHANNEL,), "material = None: expected a Material, since the section has none"),
    "two materials": ((CHANNEL, STEEL), "expected None, since the section has materials of its own"),
    "no warping analysis": ((WITHOUT_WARPING, STEEL), "Conduct a warping analysis. Expected a section after"),
    "Poisson's ratios": ((MIXED,), "its materials have the Poisson's ratios 0.2, 0.3"),
}


test_refused_sections = refuses(REFUSED_SECTIONS, lambda arguments: cf.Stiffness.from_section(*arguments))


def test_tables_take_the_numbers_of_a_data_frame():
    """Of mixed columns a frame gives objects; a function along a rod is smooth, and a name that is none is refused."""
    rows = np.ones((2, 3), dtype=object)
    assert cf.signals.AlongTable(np.array([0, 1], dtype=object), rows)(np.array([0.5])).tolist() == [[1.0, 1.0, 1.0]]
    assert cf.signals.Table((0, 1), rows)(0.5) == (1.0, 1.0, 1.0)
    assert (
        cf.signals.Table((0, 1), np.array([2.0, 4.0]))(0.5) == (3.0,)
        and cf.signals.Along(lambda s: (s, 0, 0)).breaks == ()
    )
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), cf.Circle(0.01), cf.Material(E=210e9), name="rod")
    with pytest.raises(cf.SceneError, match="no rod is named"):
        cf.Scene([rod], [cf.Clamp(rod.start)]).rod([])
    force = cf.Force(rod.end, lambda t: (t, 0, 0), jumps=("1 s",))
    assert force.jumps == (1.0,) == force.force.jumps
