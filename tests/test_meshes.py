"""Unequal elements: boundary layers of length sqrt(EI/T), notches, and the accuracy of the estimated error there."""

import numpy as np
import pytest
from mpi4py import MPI
from wire_truth import Wire, natural_frequency

import cosserat_fenicsx as cf
from cosserat_fenicsx.models.rodmesh import Layout

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
STRAIN = 1e-3
SMALL_STEPS = cf.StepControl(first=1e-5, smallest=1e-12)


def stiffnesses(rod):
    """EI, EA, GA of a round rod."""
    low = rod.profile.range[0]
    return {"EI": low.J[0], "EA": low.K[2], "GA": low.K[0]}


def taut_wire(slenderness, load=1e-2, diameter=1e-3):
    """A clamped steel wire, stretched by a thousandth, with a transverse force at mid-span of `load` times its tension.

    Returns:
        scene, rod, Wire, tension.
    """
    length = slenderness * diameter
    rod = cf.Rod(cf.Line((0, 0, 0), (length, 0, 0)), cf.Circle(diameter), STEEL, name="wire")
    tension = stiffnesses(rod)["EA"] * STRAIN
    held = [cf.Clamp(rod.start), cf.Prescribed(rod.end, displacement=(STRAIN * length, 0, 0), rotation=(0, 0, 0))]
    loads = [cf.Force(rod.at(length / 2), (0, 0, -load * tension))] if load else []
    wire = Wire(length, **stiffnesses(rod), load=-load * tension, stretch=STRAIN * length)
    return cf.Scene([rod], held, loads), rod, wire, tension


def cable(diameter, length=110.0, angle=1.0):
    """A clamped steel cable under its weight: an arc whose tangents at
    the ends are at an angle (rad) to the horizontal."""
    radius, half = length / (2 * angle), length * np.sin(angle) / (2 * angle)
    arc = cf.Arc((half, 0, radius * np.cos(angle)), (0, 0, 0), 2 * angle, axis=(0, -1, 0))
    rod = cf.Rod(arc, cf.Circle(diameter), STEEL, name="cable")
    weight = 9.81 * float(rod.profile.range[0].mass)
    wire = Wire(length, **stiffnesses(rod), sag=angle, weight=weight)
    scene = cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], [cf.Weight((0, 0, -9.81))])
    return scene, rod, wire, weight * length / 2


def true_error(path, rod, truth):
    """Largest error of the positions over the largest displacement, of
    the last point, at many places of every element."""
    breaks = path.layout.breaks[0]
    inside = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(8) / 8).ravel()
    x = np.unique(np.concatenate([np.linspace(0, 1, 1001), inside]))
    displacement = path.motion(rod, x)[-1, :, :3] * path.scales.length
    found = displacement + rod.curve.position(x * rod.length) - rod.curve.position(0.0)
    off = np.linalg.norm(found[:, [0, 2]] - truth(x * rod.length).T, axis=1).max()
    return off / np.linalg.norm(displacement, axis=1).max()


def sizes(path):
    return np.diff(path.layout.breaks[0])


@pytest.mark.serial
@pytest.mark.parametrize("slenderness", [1e3, 1e4, 1e5])
def test_taut_wires(slenderness):
    scene, rod, wire, tension = taut_wire(slenderness)
    steps = SMALL_STEPS if slenderness > 3e4 else None
    path = cf.solve(scene, [1.0], tol=1e-6, bound=["position"], model="planar", steps=steps)
    truth = wire.solve(tension)
    error = true_error(path, rod, truth)
    assert error <= path.errors.position[-1] <= min(1e-6, 30 * error) and path.error[-1] <= 1e-6
    assert np.allclose(sizes(path), sizes(path)[::-1], rtol=1e-6)  # as symmetric as the wire and its load
    if slenderness == 1e4:
        uniform = cf.solve(scene, [1.0], elements=4 * path.elements[0], model="planar")
        assert true_error(uniform, rod, truth) > 1e-6


@pytest.mark.serial
@pytest.mark.parametrize("tol", [1e-4, 1e-5])
@pytest.mark.parametrize("diameter", [0.02, 0.005, 0.001])
def test_cables_between_two_points(diameter, tol):
    scene, rod, wire, tension = cable(diameter)
    path = cf.solve(scene, [1.0], tol=tol, bound=["position"], model="planar")
    error = true_error(path, rod, wire.solve(tension))
    assert error <= path.errors.position[-1] <= min(tol, 30 * error) and path.error[-1] <= tol
    assert np.allclose(sizes(path), sizes(path)[::-1], rtol=1e-5) and max(path.elements) <= 64


@pytest.mark.serial
@pytest.mark.parametrize("tol", [1e-3, 1e-6])
@pytest.mark.parametrize("slenderness", [3e2, 1e3, 1e4, 1e5])
def test_modes_of_taut_wires(slenderness, tol):
    scene, rod, wire, _ = taut_wire(slenderness, load=0.0)
    found = cf.modes(scene, 1, load_factor=1.0, tol=tol)
    section = rod.profile.range[0]
    exact = natural_frequency(
        wire.length, wire.EI, wire.EA, wire.GA, float(section.mass), float(section.inertia[0]), STRAIN
    )
    layer = np.sqrt(wire.EI / (wire.EA * STRAIN)) / wire.length
    string = np.pi / wire.length * np.sqrt(wire.EA * STRAIN / section.mass)
    assert exact / string == pytest.approx(1 + 2 * layer, abs=20 * layer**2 + STRAIN)
    error = abs(found.squares[0] / exact**2 - 1)
    assert error <= found.error[0] <= min(tol, max(30 * error, 2e-9)) and max(found.elements) <= 52


@pytest.mark.serial
def test_modes_about_a_state_of_permanent_loads():
    """As about that of the same load with the load factor 1: boundary layers, estimates, negative modes."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10.0, 0, 0)), cf.Circle(1e-3), STEEL)
    guides = [cf.Clamp(rod.start), cf.Roller(rod.end, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1))]
    taut, permanent = (
        cf.Scene([rod], guides, [cf.Force(rod.end, (2000.0, 0, 0), permanent=kind)]) for kind in (False, True)
    )
    exact, found = cf.modes(taut, 5, load_factor=1.0, tol=1e-6), cf.modes(permanent, 5, tol=1e-3)
    assert (np.abs(found.squares / exact.squares - 1) <= found.error + exact.error).all()
    section = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.0), 1.0, mass=1.0, inertia=(1e-4, 1e-4, 2e-4))
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    heavy = cf.Scene([column], [cf.Clamp(column.start)], [cf.LineForce(column, (0, 0, -9.0), permanent=True)])
    found = cf.modes(heavy, 2, elements=8)
    assert (found.squares < 0).all() and found.negative_modes == 2


@pytest.mark.serial
def test_rounding_of_modes_is_told():
    """Two rods of 30 m, 3 mm thick, at a right angle: squares scatter by 3e-5 from mesh to mesh."""
    upright = cf.Rod(cf.Line((0, 0, 0), (0, 0, 30.0)), cf.Circle(0.003), STEEL)
    level = cf.Rod(cf.Line((0, 0, 30.0), (30.0, 0, 30.0)), cf.Circle(0.003), STEEL)
    supports = [cf.Clamp(upright.start), cf.Pin(level.end)]
    scene = cf.Scene([upright, level], supports, joints=[cf.Joint(upright.end, level.start)])
    with pytest.raises(cf.NotConverged, match="out of reach: rounding"):
        cf.modes(scene, 1, tol=1e-5)
    fixed = np.array([cf.modes(scene, 1, elements=n).squares[0] for n in (8, 10, 12, 16)])
    found = cf.modes(scene, 1, tol=1e-3)
    assert abs(found.squares[0] / fixed.mean() - 1) <= found.error[0] <= 1e-3


def notched(width):
    """A cantilever of 1 m, 20 mm thick and half as thick at a notch with
    a Gaussian profile of this width (over the length)."""

    def diameter(s):
        return 0.02 * (1 - 0.5 * np.exp(-(((np.asarray(s) - 0.4) / width) ** 2)))

    line = cf.Line((0, 0, 0), (1.0, 0, 0))
    rod = cf.Rod(line, lambda s: cf.Circle(float(diameter(s))), STEEL, name="rod")
    return rod, diameter


@pytest.mark.serial
@pytest.mark.parametrize("width", [0.02, 0.005, 0.002])
def test_a_notch(width):
    """Against the integrals of linear theory, under a load so small that it is exact to 1e-9."""
    rod, diameter = notched(width)
    force = 1e-3
    path = cf.solve(
        cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -force))]), [1.0], tol=1e-6, bound=["position"]
    )
    ends = np.unique(np.concatenate([np.linspace(0, 1, 201), 0.4 + width * np.linspace(-6, 6, 241)]))
    points, weights = np.polynomial.legendre.leggauss(6)
    s = (ends[:-1, None] + np.diff(ends)[:, None] * (points + 1) / 2).ravel()
    w = (np.diff(ends)[:, None] * weights / 2).ravel()
    EI, GA = (210e9 * np.pi / 64 * diameter(s) ** 4, 210e9 / 2.6 * np.pi / 4 * diameter(s) ** 2 * 7.8 / 8.8)
    exact = np.array([
        np.sum(w[s < x] * force * ((x - s[s < x]) * (1 - s[s < x]) / EI[s < x] + 1 / GA[s < x])) for x in ends
    ])  # fmt: skip
    found = -path.motion(rod, ends)[-1, :, 2] * path.scales.length
    error = np.abs(found - exact).max() / exact[-1]
    assert error <= path.errors.position[-1] <= min(1e-6, 30 * error) and path.error[-1] <= 1e-6
    assert max(path.elements) <= 64 and sizes(path).min() < width


@pytest.mark.serial
def test_equal_elements_where_the_error_is_everywhere():
    """The paper's column, and a wire whose layers the first mesh resolves."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), STEEL, name="column")
    load = cf.euler_load(rod)
    column = cf.Scene([rod], [cf.Clamp(rod.start)],
                      [cf.Force(rod.end, (0, 0, -load)), cf.Moment(rod.end, (0, 0.2 * load, 0))])  # fmt: skip
    for scene in (column, taut_wire(30, load=1e-2)[0]):
        for tol in (1e-4, 1e-8):
            assert np.ptp(sizes(cf.solve(scene, [0.9], tol=tol, model="planar"))) < 1e-12


@pytest.mark.ranks
def test_ranks_make_the_same_mesh():
    scene, rod, *_ = taut_wire(1e3)
    places = np.linspace(0, 1, 101)
    together, alone = (cf.solve(scene, [1.0], comm=comm, model="planar") for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert together.elements == alone.elements
    assert np.allclose(together.layout.breaks[0], alone.layout.breaks[0], rtol=0, atol=1e-9)
    moved = [path.motion(rod, places)[0, :, :3] for path in (together, alone)]
    assert np.abs(moved[0] - moved[1]).max() < 1e-9 * np.abs(moved[1]).max()


def beam_with_load_at(s):
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), cf.Circle(0.01), STEEL, name="beam")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.at(s), (0, 0, 1.0))])


@pytest.mark.serial
def test_layouts():
    scene = beam_with_load_at(0.25)
    layout = Layout.of(scene, 8)
    assert np.allclose(layout.breaks[0], np.linspace(0, 1, 9), atol=1e-15)
    assert layout.pieces(scene) == [[slice(0, 2), slice(2, 8)]]
    assert layout.finer(scene, 1.25).counts == (3 + 8,)  # rounded up in every piece
    short = layout.with_short_ends(scene, [np.array([1, 1, 0.02, 1, 1, 1, 1, 0.05])])
    near, far = 0.125 * 0.5 ** np.array([3, 3, 2, 1]), 0.125 * 0.5 ** np.array([1, 2, 2])
    assert np.allclose(np.diff(short.breaks[0]), [0.125, 0.125, *near, *[0.125] * 4, *far])
    halved = short.finer(scene, 2)
    assert np.allclose(halved.breaks[0][::2], short.breaks[0], atol=1e-15)
    assert np.allclose(np.diff(halved.breaks[0])[::2], np.diff(halved.breaks[0])[1::2])
    one = Layout.of(scene, 1).with_short_ends(scene, [np.array([1.0, 0.2])])
    assert np.allclose(one.breaks[0], [0, 0.25, 0.25 + 0.1875, 0.625, 0.8125, 1])


@pytest.mark.serial
def test_layouts_of_another_density():
    scene = beam_with_load_at(0.25)
    layout = Layout.of(scene, 4)
    other = layout.resized(scene, [np.array([1.5, 2.0, 0.5, 0.5])])
    assert other.counts == (2 + 3,)
    assert 0.25 in other.breaks[0] and np.allclose(np.diff(other.breaks[0])[:4], [0.125, 0.125, 0.125, 0.125])


@pytest.mark.serial
@pytest.mark.parametrize(("width", "centre", "degree"), [(0.001, 0.37, 2), (0.001, 0.11, 4), (0.01, 0.52, 2)])
def test_narrow_loads_are_seen(width, centre, degree):
    """A load in a part of the rod that is narrower than the distance of its quadrature points; small, so that the tip
    moves by the sum of what s^2 (3L - s)/6EI + s/GA gives."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((3e3, 3e3), 8e3, (1.0, 1.0), 0.7))
    load = cf.LineForce(rod, cf.signals.Along(lambda s: (1e-6 / width * np.exp(-(((s - centre) / width) ** 2)), 0, 0)))
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [load]), [1.0], degree=degree, tol=1e-3)
    moved = 1e-6 * np.sqrt(np.pi) * (centre**2 * (3 - centre) / 6 + width**2 * (1 - centre) / 4 + centre / 3e3)
    assert path.displacement(rod.end)[0, 0] == pytest.approx(moved, rel=1e-3)
