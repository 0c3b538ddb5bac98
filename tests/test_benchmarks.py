"""A hinged frame, Figure 3, and imperfect symmetric structures; see test_published.py for published problems."""

import json
from pathlib import Path

import imperfect_structures
import numpy as np
import pytest
import random_comparison
import random_scenes
from comparison import bar_mesh, corotational, curves, mcre, truncated
from comparison.column import Column
from comparison.follow import follow
from comparison.mcre_limit import TruncatedColumn
from comparison.solid_bar import SolidBar
from numpy.polynomial import Legendre
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic
from cosserat_fenicsx.results.accuracy import on_mesh
from cosserat_fenicsx.statics.path.events import Locator
from cosserat_fenicsx.statics.path.track import PathPoint
from cosserat_fenicsx.statics.problem import solvers_of

pytestmark = pytest.mark.serial
TRUTH = json.loads((Path(__file__).parent / "reference" / "statics.json").read_text(encoding="utf-8"))


def held(rod, *loads):
    return cf.Scene([rod], [cf.Clamp(rod.start)], loads)


@pytest.mark.once
def test_hinged_frame():
    """Two legs and a hinge between them, turned into an odd plane."""
    turn = Rotation.from_rotvec([0.3, 0.8, -0.5])

    def at(x, y):
        return tuple(turn.apply([x, y, 0.0]))

    section = cf.Stiffness((5e3, 5e3), 1e4, (1.0, 1.0), 1.0)
    column = cf.Rod(cf.Line(at(0, 0), at(0, 1)), section, name="column")
    beam = cf.Rod(cf.Line(at(0, 1), at(1, 1)), section, name="beam")
    hinge = cf.Joint(column.end, beam.start, release=tuple(turn.apply([0, 0, 1.0])))
    clamps = [cf.Clamp(column.start), cf.Clamp(beam.end)]
    scene = cf.Scene([column, beam], clamps, [cf.Force(column.at(0.5), at(1, 0))], [hinge])
    values = TRUTH["hinged_frame"]["values"]
    path = cf.solve(scene, [v["load"] for v in values], tol=1e-8)
    for name, station in (("mid_column", column.at(0.5)), ("elbow", column.end), ("elbow", beam.start)):
        moved = turn.inv().apply(path.displacement(station))
        np.testing.assert_allclose(moved, [(*v[name], 0) for v in values], atol=1e-8)


@pytest.mark.once
def test_path_independence():
    """A load in 1, 8, 10 or 160 steps, or by way of twice or minus the load: one state to round-off."""
    rod = cf.Rod(cf.UniformCurvature(1.0, (0.8, -0.5, 1.0)), cf.Stiffness((1e3, 2e3), 3e3, (1.0, 2.0), 0.8))
    scene = held(rod, cf.Force(rod.end, (0.7, 1.0, -0.8)), cf.Moment(rod.end, (0.5, -0.4, 0.6)))
    ways = [[1.0], np.arange(1, 9) / 8, np.arange(1, 11) / 10, np.arange(1, 161) / 160, [2.0, 1.0], [-1.0, 1.0]]
    shapes = [cf.solve(scene, way, elements=6).centreline() for way in ways]
    for shape in shapes[1:]:
        np.testing.assert_allclose(shape, shapes[0], atol=1e-12)


@pytest.mark.once
def test_order_of_loads_does_not_matter():
    """Force then moment, moment then force, both at once."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((1e3, 2e3), 3e3, (1.0, 2.0), 0.8))
    force, moment = cf.Force(rod.end, (0.7, 1.0, -0.8)), cf.Moment(rod.end, (0.5, -0.4, 0.6))
    together = cf.solve(held(rod, force, moment), [1.0], elements=6)
    with solvers_of(held(rod, force, moment), together.layout) as (problem, newton, _):
        newton.allow(10)
        for first in (force, moment):
            alone = cf.solve(held(rod, first), [1.0], elements=6)
            problem.load(held(rod, force, moment), together.layout)
            problem.set_load_factor(1.0)
            (rq,), (n,) = on_mesh(alone, together.layout)
            problem.begin_at(problem.model.unknowns_of(rq), n, alone._records[0].reactions)
            assert newton.solve().converged
            rq, _ = problem.model.snapshot()
            np.testing.assert_allclose(rq, together._records[0].rq, atol=1e-12)


@pytest.mark.once
@pytest.mark.slow
@pytest.mark.parametrize("drawn", [random_scenes.draw(seed) for seed in (20, 22, 23, 5097)], ids=lambda x: str(x.seed))
def test_random_scenes(drawn):
    """`make random` solves 200 of them. The last is so slender that rounding makes its tangent inexact for bending."""
    verdict, rows = random_comparison.compare(drawn)
    assert verdict.startswith("connected")
    for tol, said, errors, estimates, rounding, _ in rows:
        assert (errors <= np.where(rounding, np.maximum(estimates, tol), tol)).all(), (tol, said)
        assert (estimates[~rounding] <= tol).all()
        assert (errors[0] <= max(estimates[0], 1e-10)) and estimates[0] <= 30 * max(errors[0], 1e-11)
        told = ~rounding & (errors > random_comparison.LEAST)
        assert (0.8 * errors <= estimates)[told].all() and (estimates <= 30 * errors)[told].all(), (errors, estimates)


ETAS = (0.5, 0.9, 1.0, 1.5)


def difference(function, x, direction, step):
    """Central difference of a function along a direction."""
    return (function(x + step * direction) - function(x - step * direction)) / (2 * step)


@pytest.mark.once
@pytest.mark.parametrize("arm", [False, True])
def test_the_corotational_beam_tends_to_the_rod_with_second_order(arm):
    """Order 2 at every load factor, and the extrapolated limit is Reissner's rod to 1e-6."""
    column, truth = Column(arm=arm), curves.exact(ETAS, arm)
    delta = np.array([corotational.solve(ETAS, n, column=column).delta for n in (32, 64, 128)])
    errors = np.abs(delta / truth - 1)
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.01)
    assert (4 * delta[2] - delta[1]) / 3 == pytest.approx(truth, rel=3e-6)


@pytest.mark.once
def test_one_jump_of_the_corotational_beam_is_not_the_path():
    """From the unloaded state Newton's method finds an unstable equilibrium at eta = 1.5, with its negative modes."""
    jumped = corotational.solve([1.5], 32, adaptive=False)
    followed = corotational.solve([1.5], 32)
    assert jumped.negative_modes[0] > 0 and jumped.delta[0] < 0
    assert followed.negative_modes[0] == 0 and followed.delta[0] == pytest.approx(curves.exact([1.5])[0], rel=1e-3)


@pytest.mark.once
@pytest.mark.parametrize(
    "law",
    [lambda q: corotational.beam(q, 0.7, 400.0, 150.0), lambda q: mcre.derivatives(mcre.energy(0.7, 400.0, 150.0), q)],
    ids=["co-rotational", "MCRE"],
)
def test_elements_have_consistent_tangents(law):
    q = 0.3 * np.random.default_rng(0).normal(size=(3, 6))
    hessian = law(q)[1]
    by_difference = np.stack([difference(lambda x: law(x)[0], q, unit, 1e-6) for unit in np.eye(6)], axis=-1)
    assert hessian == pytest.approx(by_difference, abs=1e-7 * np.abs(hessian).max())


def exact_strains(u_s, w_s, phi):
    """Stretch and shear of the rod."""
    return (1 + u_s) * np.cos(phi) + w_s * np.sin(phi) - 1, w_s * np.cos(phi) - (1 + u_s) * np.sin(phi)


@pytest.mark.once
def test_the_truncated_energy_is_the_rods_to_fourth_order():
    """Its difference from the exact energy is of fifth order; that of a pure rotation by phi is -EA phi^6/8."""
    EA, GA, EI = 300.0, 120.0, 1.7

    def error(size):
        u_s, w_s, phi, phi_s = size * np.array([0.3, -0.5, 0.8, 0.4])
        stretch, shear = exact_strains(u_s, w_s, phi)
        exact = (EA * stretch**2 + GA * shear**2 + EI * phi_s**2) / 2
        return truncated.energy(u_s, w_s, phi, phi_s, EA, GA, EI) - exact

    assert np.log2(error(0.02) / error(0.01)) == pytest.approx(5.0, abs=0.05)
    phi = 0.01
    left = truncated.energy(np.cos(phi) - 1, np.sin(phi), phi, 0.0, EA, 0.0, EI)
    assert left == pytest.approx(-EA * phi**6 / 8, rel=1e-3)


@pytest.mark.once
def test_the_energy_of_an_mcre_is_that_of_the_rod_within_to_fourth_order():
    """Against the energy of the exact strains, minimised over the motions between the nodes."""
    length, stiffness = 0.7, (400.0, 150.0, 1.3)
    second, third, fourth = mcre.energy(length, *stiffness)
    x, weights = np.polynomial.legendre.leggauss(24)
    bubbles = [Legendre.basis(k + 2) - Legendre.basis(k) for k in range(8)]
    values = np.array([bubble(x) for bubble in bubbles])
    slopes = np.array([bubble.deriv()(x) for bubble in bubbles]) * 2 / length
    weight = np.sqrt(np.outer(stiffness, weights * length / 4))

    def strains(coefficients, start, end):
        (u_s, w_s, phi_s), phi = (end - start)[:, None] / length + coefficients @ slopes, coefficients[2] @ values
        phi = phi + (start[2] * (1 - x) + end[2] * (1 + x)) / 2
        return (weight * [*exact_strains(u_s, w_s, phi), phi_s]).ravel()

    def gap(size):
        q, most = size * np.array([0.2, 0.3, -0.5, -0.1, 0.9, 0.7]), {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
        found = least_squares(lambda c: strains(c.reshape(3, -1), q[:3], q[3:]), np.zeros(24), **most)
        cubic, quartic = np.einsum("ijk,i,j,k", third, q, q, q), np.einsum("ijkl,i,j,k,l", fourth, q, q, q, q)
        return q @ second @ q + cubic + quartic - 2 * found.cost

    assert np.log2(gap(0.1) / gap(0.05)) == pytest.approx(5.0, abs=0.2)


@pytest.mark.once
@pytest.mark.parametrize(
    ("elements", "eta"), [(1, 0.311), (2, 0.464), (4, 0.584), (8, 0.606), (16, 0.609), (32, 0.611)]
)
def test_limit_points_of_the_mcre(elements, eta):
    """Shear factor 0.9: at a limit point the tangent is singular, and beyond it one mode is unstable."""
    problem = mcre.problem(elements, Column(shear_factor=0.9))
    found = mcre.limit(problem)
    assert found.eta == pytest.approx(eta, abs=6e-4)
    tangent = problem.linearise(found.x, found.eta, found.x)(np.eye(problem.size))
    softest = 1 / np.abs(np.linalg.eigvalsh((tangent + tangent.T) / 2)).max()
    assert softest < 1e-4 * np.pi**2 / 4
    stable = [point.negative_modes == 0 for point in mcre.branch(problem, 1.2 * found.delta)]
    assert stable[0] and not stable[-1] and stable == sorted(stable, reverse=True)


@pytest.mark.once
def test_the_mcre_before_and_beyond_its_limit_point():
    curve = mcre.solve([0.3, 0.6, 0.7], 32, column=Column(shear_factor=0.9))
    assert curve.delta[1] == pytest.approx(0.4215, abs=1e-4)
    assert curves.exact([0.6])[0] == pytest.approx(0.3768, abs=1e-4)
    assert len(curve.eta) == 2 and "beyond the load factor 0.61" in curve.stopped
    with pytest.raises(cf.SceneError, match="elements = 0: expected a whole number above zero"):
        mcre.solve([0.1], 0)
    with pytest.raises(cf.SceneError, match="ascending"):
        corotational.solve([0.5, 0.2], 4)
    assert corotational.solve([0.0, 0.5, 0.5], 4).delta[0] == 0.0


@pytest.mark.slow
def test_ever_more_elements_tend_to_the_truncated_energy():
    """The limit point of the truncated energy on two meshes; those of elements converge to it with second order."""
    limit = mcre.limit(TruncatedColumn())
    assert limit.eta == pytest.approx(mcre.limit(TruncatedColumn(8, 3)).eta, rel=1e-6)
    gaps = [limit.eta - mcre.limit(mcre.problem(n)).eta for n in (256, 512)]
    assert 0 < gaps[1] < gaps[0] / 3 < 1e-3


@pytest.mark.once
def test_the_mesh_of_the_bar():
    """Second moment of area (exactly) and area (to 1e-6) are those of the circle; its nodes are off it by 4e-4."""
    points, cells = bar_mesh.half_disc(0.1, 1)
    area, second = bar_mesh.moments(points, cells)
    assert second == pytest.approx(np.pi * 0.1**4 / 8, rel=1e-12)
    assert area == pytest.approx(np.pi * 0.1**2 / 2, rel=1e-6)
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(0.1, rel=4e-4)


@pytest.mark.slow
def test_the_solid_bar():
    """Its tangent is the derivative of its residual; a small load bends it as it bends the rod."""
    bar = SolidBar(Column(arm=True), along=8, refinement=1)
    rng = np.random.default_rng(1)
    x, direction = 1e-3 * rng.normal(size=(2, bar.size))
    for vector in (x, direction):
        vector[bar._fixed] = 0.0
    slope = difference(lambda y: bar.residual(y, 0.3), x, direction, 1e-4)
    assert bar.linearise(x, 0.3, x)(slope) == pytest.approx(direction, abs=1e-7)
    (point,), k = follow(bar, [0.01], tolerance=1e-8), bar.column
    truth = analytic.reissner(0.01, 0.2, 20.0, bending=k.bending, axial=k.axial, shear=k.shear, arm=True)
    delta, shortening, _ = bar.tip(point.x)
    assert delta == pytest.approx(truth.delta, rel=1e-3) and shortening == pytest.approx(truth.shortening, rel=1e-3)


@pytest.mark.once
@pytest.mark.slow
def test_figure3_is_broken_off_and_goes_on(tmp_path, monkeypatch, capsys):
    import figure3
    import harness

    def broken(self, name, curve, points):
        keep(self, name, curve, points)
        if name == "solid" and len(curve["eta"]) == 2:
            raise KeyboardInterrupt

    keep = figure3.Store.keep_part
    monkeypatch.setattr(harness, "draw_both", lambda plot, file: plot(file=file))  # once, not for two widths of pages
    monkeypatch.setattr(figure3.Store, "keep_part", broken)
    with pytest.raises(KeyboardInterrupt):
        figure3.main(tmp_path, quick=True)
    half = json.loads((tmp_path / "figure3.json").read_text(encoding="utf-8"))
    assert len(half["curves"]["solid"]["eta"]) == 2 and not half["complete"]

    monkeypatch.setattr(figure3.Store, "keep_part", keep)
    data = figure3.main(tmp_path, quick=True)
    assert "goes on from" in capsys.readouterr().err
    found = data["curves"]
    assert data["complete"] and data["machine"]["dolfinx"] and not list(tmp_path.glob("*.npz"))
    assert found["mixed"] == half["curves"]["mixed"] and found["solid"]["delta"][:2] == half["curves"]["solid"]["delta"]
    assert found["mixed"]["error"] < 1e-9 and found["displacement"]["error"] < 1e-6 and found["arm"]["error"] < 1e-9
    solid = np.array(found["solid"]["delta"])
    assert found["solid"]["eta"] == list(curves.QUICK.coarse_etas)
    assert solid == pytest.approx(curves.exact(found["solid"]["eta"], arm=True), rel=0.04)
    finer = found["solid"]["finer"]
    assert finer["eta"] == list(curves.QUICK.finer_etas) and finer["along"] == curves.QUICK.finer
    model = np.abs(np.array(finer["delta"]) / curves.exact(finer["eta"], arm=True) - 1)
    coarse = [found["solid"]["delta"][found["solid"]["eta"].index(eta)] for eta in finer["eta"]]
    assert (model < 0.7 * np.abs(np.array(coarse) / curves.exact(finer["eta"], arm=True) - 1)).all()
    table = (tmp_path / "figure3.md").read_text(encoding="utf-8")
    assert "16 hexahedra of second order along the bar" in table and "by the mesh alone" in table
    assert "+3.8 % at 0.9" in table and "0.311 with 1, 0.464 with 2, 0.611 with 32 elements" in table
    assert (tmp_path / "figure3.png").stat().st_size > 50000


def hinged_arch(sideways):
    """A hinged circular arch of half-angle 0.6 rad with a force on its crown, a part of it sideways: (crown, scene)."""
    R, half, axis = 10.0, 0.6, (0, 1, 0)
    curve = cf.Arc((0, 0, 0), (-R * np.sin(half), 0, R * np.cos(half)), 2 * half, axis)
    rod = cf.Rod(curve, cf.Stiffness((1e5, 1e5), 1e5, (1.0, 100.0), 100.0))
    crown = rod.at(R * half)
    supports = [cf.Hinge(end, axis) for end in (rod.start, rod.end)]
    return crown, cf.Scene([rod], supports, [cf.Force(crown, (sideways, 0, -1.0))])


#: By small steps (and, of 1e-2, by shooting of the strong form): the limit points, and the crown at load factor 0.6.
ARCH = {
    3e-2: ((0.18983433, -0.10203886), (4.12838e-4, 0, -3.692597)),
    1e-2: ((0.19421969, -0.10447634), (1.37607e-4, 0, -3.692603)),
    1e-3: ((0.19759409, -0.10636187), (1.37607e-5, 0, -3.692604)),
    1e-4: ((0.19834251, -0.10678178), (1.37607e-6, 0, -3.692604)),
}


@pytest.mark.once
@pytest.mark.parametrize(
    ("sideways", "given"),
    [*((x, {"elements": 8, "control": control}) for x in ARCH for control in ("auto", "arc")), (3e-2, {}), (1e-4, {})],
    ids=str,
)
def test_an_imperfect_arch_snaps_through(sideways, given):
    crown, scene = hinged_arch(sideways)
    limits, end = ARCH[sideways]
    path = cf.solve(scene, (0, 0.6), **given)
    assert [event.kind for event in path.events] == ["limit", "limit"] and (given or path.error.max() <= 1e-6)
    np.testing.assert_allclose([event.load_factor for event in path.events], limits, rtol=2e-6)
    np.testing.assert_allclose(path.displacement(crown)[-1], end, atol=3e-6)
    assert path.stable[-1] and not [said for said in path.why if "negative modes go" in said]


@pytest.mark.once
@pytest.mark.parametrize(("sideways", "top"), [(1e-3, 0.3), (3e-4, 5.0), (1e-4, 1.0), (1e-5, 0.3), (1e-5, 5.0)])
def test_the_first_event_of_an_imperfect_arch_is_a_limit_point(sideways, top):
    _, scene = hinged_arch(sideways)
    path = cf.solve(scene, (0, top), elements=8, control="arc", until=lambda path: path.events)
    assert path.events[0].kind == "limit"


# a toggle that is nearly perfect, a dome of six arcs
@pytest.mark.once
@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 12])
def test_structures_follow_small_steps(seed):
    given = imperfect_structures.structure(seed)
    truth = imperfect_structures.small_steps(given, imperfect_structures.STEP)
    assert truth.events and truth.reached
    for control in imperfect_structures.CONTROLS:
        verdict, words, _ = imperfect_structures.outcome(given, truth, control, elements=8)
        assert verdict == "right", f"{given.kind}, {control}: {words}"


@pytest.mark.once
def test_load_control_does_not_step_over_limit_points():
    """It went on at 5.98 on another path with a negative mode. And a gable frame whose ridge snaps through from 7.24 to
    7.13: one step of load control was as long as that."""
    given = imperfect_structures.structure(103)
    by_load, by_arc = (cf.solve(given.scene, (0, given.top), elements=8, control=c) for c in ("auto", "arc"))
    assert [event.kind for event in by_load.events] == ["limit", "limit"] and by_load.stable[-1]
    apex = given.stations[0]
    np.testing.assert_allclose(by_load.displacement(apex)[-1], by_arc.displacement(apex)[-1], atol=1e-8)
    rise, height, axis = 0.3945717, 0.7556963, (0, 1, 0)
    rafter = cf.Stiffness((6931.0, 6931.0), 20793.5, (1.0, 100.0), 100.0)
    post = cf.Stiffness((146830.0, 146830.0), 146830.0, (14.683, 1468.3), 1468.3)
    points = [(-1, 0, 0), (-1, 0, height), (0, 0, height + rise), (1, 0, height), (1, 0, 0)]
    ends = [(0, 1), (1, 2), (2, 3), (4, 3)]
    rods = [cf.Rod(cf.Line(points[a], points[b], d1=axis), section, name=f"rod {a}")
            for (a, b), section in zip(ends, (post, rafter, rafter, post), strict=True)]  # fmt: skip
    left, right = rods[1:3]
    joints = [cf.Joint(rods[0].end, left.start), cf.Joint(left.end, right.start), cf.Joint(right.end, rods[3].end)]
    load = cf.Force(left.end, (0.01089104, 0, -1.0))
    scene = cf.Scene(rods, [cf.Clamp(rods[0].start), cf.Clamp(rods[3].start)], [load], joints)
    path = cf.solve(scene, (0, 19.029), elements=8)
    assert [event.kind for event in path.events] == ["limit", "limit"]
    np.testing.assert_allclose([event.load_factor for event in path.events], [7.2426, 7.1325], atol=1e-3)


@pytest.mark.once
@pytest.mark.slow
def test_two_paths_beside_each_other_are_no_bifurcation():
    """Two arches whose crowns are tied: at its tenth limit point the path turns off by 3e-4 of the load factor before a
    bifurcation of the path beside it."""
    half, gap, axis, load = 0.38413884, 2.9, (0, 1, 0), 1.00076
    R = 1 / half
    section = imperfect_structures._section(880.0, 2.0)
    rods = [
        cf.Rod(cf.Arc((x, 0, 0), (x - R * np.sin(half), 0, R * np.cos(half)), 2 * half, axis), section, name=f"at {x}")
        for x in (0.0, gap)
    ]
    tie = cf.Rod(cf.Line((0, 0, R), (gap, 0, R), d1=axis), imperfect_structures._section(880.0, gap), name="tie")
    crowns = [rod.at(rod.length / 2) for rod in rods]
    hinges = [cf.Hinge(end, axis) for rod in rods for end in (rod.start, rod.end)]
    loads = [cf.Force(crowns[0], (0, 0, -load)), cf.Force(crowns[1], (0, 0, -1.0))]
    joints = [cf.Joint(crown, end) for crown, end in zip(crowns, (tie.start, tie.end), strict=True)]
    scene = cf.Scene([*rods, tie], hinges, loads, joints)
    path = cf.solve(scene, (0, 18), elements=8, control="arc", until=lambda path: len(path.events) == 10)
    assert {event.kind for event in path.events} == {"limit"}
    assert path.events[-1].load_factor == pytest.approx(-3.1996880, abs=1e-6)  # by small steps


@pytest.mark.once
@pytest.mark.parametrize(("end", "follows"), [(8.71102, True), (8.71139, False)])
def test_the_load_factor_changes_in_the_direction_of_the_path(end, follows):
    """Of two arches that cross at their crowns: a step led upwards between two points where the load factor falls."""

    class Straight:
        without_potential = False

    a, b = (PathPoint(eta, [], 1, 3, rise=rise) for eta, rise in ((8.71115, -0.025), (end, -0.069)))
    assert Locator(Straight())._explained(a, b, []) is follows
