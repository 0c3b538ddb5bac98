"""All models and formulations of a scene give the same results and the same number of negative modes."""

import dense
import numpy as np
import pytest
from conftest import column
from mpi4py import MPI
from path_scenes import LEE_LIMITS, lees_frame
from plane_scenes import SCENES, STEEL, Drawn, thin_cantilever, tree

import cosserat_fenicsx as cf
from cosserat_fenicsx.algebra.newton import Newton
from cosserat_fenicsx.models.formulation import OF_MOTION, Multiplier, formulation_of
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.statics.problem import Problem
from cosserat_fenicsx.statics.stability import NegativeModes


def same(found, truth, tolerance):
    """Compare all fields of all rods at all points, relative to their size, and to their rounding errors: strains are
    differences of r over the spacing of nodes, and forces are strains times stiffnesses."""
    for k in range(len(truth)):
        for rod in truth.scene.rods:
            a, b = found.fields(k, rod), truth.fields(k, rod)
            K = rod.profile.range[1].K
            rounding = 1e-15 * len(a["s"]) * max(1.0, np.abs(a["position"] - a["position"][0]).max() / rod.length)
            for name in a:
                noise = {"force": rounding * K[np.isfinite(K)].max(initial=0), "strain": 10 * rounding}.get(name, 1e-12)
                size = np.abs(b[name]).max()
                np.testing.assert_allclose(
                    a[name], b[name], rtol=0, atol=tolerance * size + noise, err_msg=f"{found.model} {rod.name} {name}"
                )


@pytest.mark.serial
@pytest.mark.parametrize("seed", [None, pytest.param(1, marks=pytest.mark.serial)])
@pytest.mark.parametrize("name", SCENES)
def test_rungs_agree(name, seed):
    draw, known = SCENES[name]
    scene = draw(Drawn(seed))
    truth = cf.solve(scene, [0.5, 1.0], model="spatial", elements=24)
    models = ("determinate", "planar") if known else ("planar",)
    for model in models:
        path = cf.solve(scene, [0.5, 1.0], model=model, elements=24)
        assert path.model == model and path.unknowns <= truth.unknowns / 2
        assert path.negative_modes.tolist() == truth.negative_modes.tolist() == [0, 0]
        same(path, truth, 2e-9)
    auto = cf.solve(scene, [0.5, 1.0], elements=24)
    assert auto.model == models[0]
    if not known:
        with pytest.raises(cf.SceneError, match="model = 'determinate' is not possible: statics alone does not"):
            cf.solve(scene, [1.0], model="determinate")


@pytest.mark.serial
@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
@pytest.mark.parametrize("slenderness", [1e2, 1e4, 1e5])
def test_against_the_exact_rod(model, slenderness):
    rod, scene = column(diameter=20.0 / slenderness)
    k = rod.stiffness
    exact = cf.analytic.reissner([0.9, 1.5], 0.2, 20.0, bending=k.bending[1], axial=k.axial, shear=k.shear[0])
    for elements in (8, 64):
        path = cf.solve(scene, [0.9, 1.5], model=model, elements=elements)
        np.testing.assert_allclose(path.displacement(rod.end)[:, 0], exact.delta, rtol=1e-7)
        assert path.stable.all() and path.iterations.sum() < 100


@pytest.mark.serial
@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_full_turns(model):
    """M = 2 pi EI/L per turn: the sign of q is continuous along rod and path, although the ring closes twice."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2.0, 0, 0)), cf.Circle(0.01), STEEL)
    M = 2 * np.pi * rod.stiffness.bending[0] / rod.length
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, (0, -M, 0))])
    turns = [0.4, 0.6, 1.0, 1.5, 2.0]
    path = cf.solve(scene, turns, model=model, elements=20)
    half = np.pi * np.array(turns)
    expected = np.column_stack([np.cos(half), 0 * half, -np.sin(half), 0 * half])
    np.testing.assert_allclose(path.rotation(rod.end), expected, atol=1e-9)
    np.testing.assert_allclose(path.position(rod.end)[[2, 4]], 0, atol=1e-9)


@pytest.mark.serial
@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_units_change_nothing(model):
    rod, scene = column(arm=True)
    si = cf.solve(scene, [0.5, 1.2], model=model, elements=8)
    other_rod, other = column(length=20e3, diameter=200.0, eccentricity=200.0, E=210e9 * 1e-12, arm=True)
    mm = cf.solve(other, [0.5, 1.2], model=model, elements=8)
    np.testing.assert_allclose(mm.displacement(other_rod.end) / 1e3, si.displacement(rod.end), atol=1e-10 * 20)
    np.testing.assert_allclose(mm.moment(other_rod.start) * 1e3, si.moment(rod.start), rtol=1e-10, atol=1e-3)
    assert mm.iterations.tolist() == si.iterations.tolist()


@pytest.mark.parametrize("name", SCENES)
def test_number_of_ranks_changes_nothing(name):
    draw, known = SCENES[name]
    scene = draw(Drawn(3))
    for model in ("determinate", "planar") if known else ("planar",):
        for elements in (1, 9):
            together = cf.solve(scene, [0.4], model=model, elements=elements)
            alone = cf.solve(scene, [0.4], model=model, elements=elements, comm=MPI.COMM_SELF)
            assert together.unknowns == alone.unknowns
            assert together.negative_modes.tolist() == alone.negative_modes.tolist()
            same(together, alone, 1e-9)


@pytest.mark.serial
@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_a_perfect_round_column_loses_two_motions_at_once(model):
    """One in the plane and one out of it; planar models count both."""
    _, scene = column(eccentricity=0.0)
    path = cf.solve(scene, [0.5, 0.999, 1.001, 8.9, 9.1], model=model, elements=8)
    assert path.negative_modes.tolist() == [0, 0, 2, 2, 4]


@pytest.mark.serial
@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
@pytest.mark.parametrize("rigid", [False, True])
def test_lateral_buckling_is_seen_in_the_plane(model, rigid):
    _, scene = thin_cantilever(*([(np.inf, np.inf), np.inf] if rigid else []))
    path = cf.solve(scene, [0.9, 0.998, 1.002, 1.1], model=model, elements=8)
    assert path.model == model and path.negative_modes.tolist() == [0, 0, 1, 1]


@pytest.mark.serial
def test_supports_count_out_of_the_plane_too():
    """A strip that would buckle sideways on a pin, but not on a hinge about the normal."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 4.0), 2.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0)), section)
    roller = [cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
    loads = [cf.Force(rod.end, (0, 0, -(np.pi**2))), cf.Force(rod.at(0.5), (0.1, 0, 0))]
    for foot in (cf.Clamp(rod.start), cf.Hinge(rod.start, (0, 1, 0))):
        for model in ("planar", "spatial"):
            path = cf.solve(cf.Scene([rod], [foot, *roller], loads), [2.0257, 2.0657], model=model, elements=8)
            assert path.negative_modes.tolist() == [0, 1]


@pytest.mark.serial
def test_points_keep_their_own_numbers_when_another_scene_is_solved():
    """States expanded later must not be affected by a scene that was loaded in between."""
    first, second = tree(Drawn(1)), tree(Drawn(2))
    path = cf.solve(first, [1.0], elements=4)
    fresh = cf.solve(first, [1.0], elements=4)
    before = fresh.position(first.rods[0].start).copy()
    cf.solve(second, [0.3], elements=4)
    np.testing.assert_array_equal(path.position(first.rods[0].start), before)


def in_space(kind):
    """Scenes that are not plane, and whose contact force is given by statics."""
    soft = cf.Stiffness((300.0, 50.0), 200.0, (169.0, 1014.0), 84.5, mass=0.04)
    section = soft if kind == "soft" else cf.Rectangle(0.1, 0.3)
    if kind == "helix":
        rod = cf.Rod(cf.Helix((1, 2, 3), (1.05, 2, 3), 3, 0.03), cf.Circle(0.004), STEEL, name="spring")
        return cf.Scene([rod], [cf.Clamp(rod.end)], [cf.Force(rod.start, (2, 1, 40.0)), cf.Weight()])
    rod = cf.Rod(cf.Line((100.0, -50.0, 7.0), (103.0, -46.0, 19.0), d1=(1.0, 0.5, 0.0)), section, STEEL, name="stem")
    F, L = rod.stiffness.bending[0] / rod.length**2, rod.length
    foot = rod.curve.position(0.6 * L)
    twig = cf.Rod(cf.Line(foot, foot + np.array([0, 3.0, 1.0])), section, STEEL, name="twig")
    loads = [
        cf.Weight((1.0, -3.0, -9.0)),
        cf.EccentricForce(rod.end, (0.3 * F, 0.4 * F, -0.2 * F), (0.05 * L, -0.08 * L)),
        cf.Moment(rod.at(0.4 * L), (0.1 * F * L, 0, 0.2 * F * L)),
        cf.Force(twig.end, (0.2 * F, 0, -0.4 * F)),
    ]
    return cf.Scene([twig, rod], [cf.Clamp(rod.at(0.1 * L))], loads, [cf.Joint(rod.at(0.6 * L), twig.start)])


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["helix", "soft", "steel"])
def test_determinate_in_space_agrees(kind):
    scene = in_space(kind)
    path, truth = (cf.solve(scene, [0.3, 1.0], elements=24, model=model) for model in ("auto", "spatial"))
    assert path.model == "determinate" and path.unknowns == 4 * truth.unknowns // 7
    assert "statics gives the internal force" in " ".join(path.why)
    assert path.negative_modes.tolist() == truth.negative_modes.tolist()
    same(path, truth, 5e-9)
    alone = cf.solve(scene, [0.3, 1.0], elements=24, comm=MPI.COMM_SELF)
    same(path, alone, 1e-9)


@pytest.mark.serial
def test_determinate_in_space_counts_what_the_spatial_counts():
    """Under a dead moment in space, which has no potential, and past lateral buckling."""
    rod, scene = thin_cantilever()
    more = [cf.Force(rod.end, (1e-5, 0, 0)), cf.Moment(rod.end, (0, 0, 0.1))]
    column_, up = column(eccentricity=0.0)
    twisted = cf.Scene(up.rods, up.supports, [*up.loads, cf.Moment(column_.end, (0, 0, 1e3))])
    for tilted, etas in ((cf.Scene([rod], scene.supports, [*scene.loads, *more]), [0.5, 0.98, 1.1]),
                         (twisted, [0.5, 0.95, 1.05, 9.5])):  # fmt: skip
        found, truth = (
            cf.solve(tilted, etas, model=model, elements=8).negative_modes for model in ("determinate", "spatial")
        )
        assert found.tolist() == truth.tolist() and (tilted is not twisted or found.any())


@pytest.mark.parametrize("seed, release", [(0, None), (1, "all"), (2, "normal"), (4, "all")])
def test_stability_with_ties_is_the_spatial_one(seed, release):
    """With reactions of hinges and prescribed rotations, in the plane and out of it, up to the loss of stability."""
    draw, random = Drawn(seed), np.random.default_rng(seed)
    section = cf.Stiffness((1e5, 2e5), 3e5, tuple(random.uniform(0.3, 0.9, 2)), random.uniform(0.2, 0.5))
    post = cf.Rod(cf.Line(draw.point(0, 0, 0), draw.point(0, 0, 1), d1=draw.vector(1, 0, 0)), section, name="post")
    beam = cf.Rod(cf.Line(draw.point(0, 0, 1), draw.point(0.5, 0, 2), d1=draw.normal), section, name="beam")
    supports = [cf.Clamp(post.start), cf.Hinge(beam.end, draw.normal)]
    if seed == 4:
        supports.append(cf.Prescribed(post.at(0.5), rotation=draw.vector(0, 0.1, 0)))
    loads = [
        cf.Force(beam.at(beam.length / 2), draw.vector(1, 0, -12)),
        cf.Moment(beam.at(0.3), draw.vector(0, 1, 0)),
        cf.FollowerForce(post.at(0.5), (1.0, 0, 0)),
    ]
    joint = cf.Joint(post.end, beam.start, release=draw.normal if release == "normal" else release)
    scene = cf.Scene([post, beam], supports, loads, [joint])
    etas = np.linspace(0.5, 6, 12)
    paths = []
    for model in ("planar", "spatial"):
        try:
            paths.append(cf.solve(scene, etas, model=model, elements=6))
        except cf.NotConverged as stopped:
            paths.append(stopped.path)
    planar, spatial = paths
    assert len(planar) == len(spatial) >= 4
    assert planar.negative_modes.tolist() == spatial.negative_modes.tolist() and planar.negative_modes[-1] == 1
    np.testing.assert_allclose(planar.position(beam.at(0.7)), spatial.position(beam.at(0.7)), atol=1e-7)


SECTION = cf.Stiffness(shear=(3e3, 5e3), axial=8e3, bending=(1.0, 2.5), torsion=0.7, mass=1.0)


def bow():
    """A bent and twisted rod of length 1 in a general position."""
    curve = cf.UniformCurvature(1.0, (0.4, 0.9, 0.5), start=(3.0, 1.0, -2.0), frame=(0.1, -0.5, 0.7, -0.5))
    return cf.Rod(curve, SECTION, name="bow")


def supported(*supports):
    def scene():
        rod = bow()
        loads = [cf.Force(rod.at(0.5), (0.9, -0.6, 0.3)), cf.LineForce(rod, (0.2, 0.6, 0.1)),
                 cf.LineMoment(rod, (0.1, -0.2, 0.3))]  # fmt: skip
        return cf.Scene([rod], [cf.Clamp(rod.start), *(support(rod) for support in supports)], loads)

    return scene


def loaded(*loads):
    def scene():
        rod = bow()
        return cf.Scene([rod], [cf.Clamp(rod.start)], [load(rod) for load in loads])

    return scene


def joined(release):
    """A clamped rod, a second one joined to its end and held at the other, and a third joined at the same point."""

    def scene():
        ends = [(0, 0, 1.0), (1.0, 0.2, 1.3), (-0.3, 0.8, 1.4)]
        first = cf.Rod(cf.Line((0, 0, 0), ends[0]), SECTION, name="first")
        second, third = (cf.Rod(cf.Line(ends[0], end), SECTION, name=f"to {end}") for end in ends[1:])
        joints = [cf.Joint(first.end, second.start, release), cf.Joint(first.end, third.start)]
        supports = [cf.Clamp(first.start), cf.Clamp(second.end) if release == "all" else cf.Pin(second.end)]
        loads = [cf.Force(third.end, (0.5, -0.4, -0.6)), cf.Moment(first.end, (0.1, 0.2, 0.3)), cf.Weight((0, 0, -0.5))]
        return cf.Scene([first, second, third], supports, loads, joints)

    return scene


HELD = {
    "pin": supported(lambda rod: cf.Pin(rod.end)),
    "pin inside": supported(lambda rod: cf.Pin(rod.at(0.37))),
    "hinge": supported(lambda rod: cf.Hinge(rod.end, (0.2, 0.9, 0.3))),
    "rollers": supported(lambda rod: cf.Roller(rod.end, (0.2, 0.9, 0.3)),
                         lambda rod: cf.Roller(rod.at(0.5), (1, 0, 0))),
    "moved": supported(lambda rod: cf.Prescribed(rod.end, displacement=(0.02, -0.03, 0.01), rotation=(0.3, -0.4, 0.2))),
    "turned": supported(lambda rod: cf.Prescribed(rod.end, rotation=(1.1, 0.7, -0.4))),
    "rigid joints": joined(None),
    "a hinge between": joined((0.3, 1.0, -0.2)),
    "a ball joint": joined("all"),
    "dead": loaded(lambda rod: cf.Force(rod.end, (0.5, 0.8, 2.0)), lambda rod: cf.Moment(rod.end, (0.3, -0.6, 0.5))),
    "eccentric": loaded(lambda rod: cf.EccentricForce(rod.end, (0.5, 0.8, -1.0), offset=(0.2, -0.1))),
    "follower": loaded(
        lambda rod: cf.FollowerForce(rod.end, (0.9, -0.4, 0.6)),
        lambda rod: cf.FollowerMoment(rod.at(0.5), (0.2, 0.3, -0.5))
    ),
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("name", HELD)
def test_every_support_joint_and_load_as_mixed_has_them(name):
    """Both converge to the same solution; P4 on 8 elements differ by less than 1e-8 at element ends (order 2p)."""
    scene = HELD[name]()
    paths = [
        cf.solve(scene, [0.5, 1.0], model="spatial", formulation=f, degree=4, elements=8)
        for f in ("mixed", "multiplier")
    ]
    for rod in scene.rods:
        one, other = (path.fields(-1, rod) for path in paths)
        assert np.abs(one["displacement"]).max() > 1e-3 or rod.name == "first"
        for field, atol in (("position", 1e-8), ("quaternion", 1e-8), ("force", 2e-7), ("moment", 2e-7)):
            np.testing.assert_allclose(other[field][::4], one[field][::4], atol=atol)
    np.testing.assert_array_equal(paths[1].negative_modes, paths[0].negative_modes)
    for support in scene.supports:
        reactions = [path.reaction(support) for path in paths]
        for one, other in zip(*reactions, strict=True):
            np.testing.assert_allclose(other, one, atol=2e-7)
    q = paths[1]._records[-1].rq[:, 3:]
    assert np.abs(np.linalg.norm(q, axis=1) - 1).max() < 1e-12
    assert paths[1].iterations.sum() <= 1.3 * paths[0].iterations.sum() + 2


@pytest.mark.serial
def test_the_largest_compression_is_the_load_on_every_mesh():
    rod, scene = column()
    for elements in (4, 16, 32, 64, 128):
        path = cf.solve(scene, [1.5], model="spatial", formulation="multiplier", degree=2, elements=elements)
        assert path.largest()["compression"].size == pytest.approx(1.5 * cf.euler_load(rod), rel=1e-9)


@pytest.mark.serial
@pytest.mark.parametrize(("degree", "meshes"), [(1, (16, 32)), (2, (8, 16)), (3, (8, 16))])
def test_moments_are_of_order_2p_at_element_ends(degree, meshes):
    rod, scene = column()
    path = cf.solve(scene, [0.9, 1.5], model="spatial", degree=4, elements=32)
    truth, errors = path.moment(rod.start), []
    for elements in meshes:
        path = cf.solve(scene, [0.9, 1.5], formulation="multiplier", degree=degree, elements=elements)
        errors.append(np.linalg.norm(path.moment(rod.start) - truth, axis=1))
        lever = 0.2 + path.displacement(rod.end)[:, 0]  # balance of the whole rod, on every mesh
        np.testing.assert_allclose(path.moment(rod.start)[:, 1], [0.9, 1.5] * lever * cf.euler_load(rod), rtol=1e-9)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * degree, abs=0.2)


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("name", ["moved", "hinge", "follower", "eccentric", "a hinge between"])
def test_the_tangent_of_reactions_and_live_loads_is_their_derivative(name):
    """Taylor test with non-zero multipliers; n is that of the motion,
    since the tangent with a carried n is not the derivative."""
    scene = HELD[name]()
    layout = Layout.of(scene, 2)
    signature = Signature.of(scene, layout, formulation=Multiplier(force=OF_MOTION), degree=2)
    problem = Problem(SpatialModel(MPI.COMM_SELF, signature))
    problem.load(scene, layout)
    random = np.random.default_rng(1)
    x = problem.x.array + 0.1 * random.normal(size=problem.x.getSize())
    direction = random.normal(size=len(x))
    problem.set_load_factor(0.7)

    def residual(values):
        y, b = problem.x.duplicate(), problem.b.duplicate()
        y.array_w[:] = values
        problem.function(y, b)
        return b.array.copy()

    F = residual(x)
    slope = dense.tangent(problem) @ direction
    steps = 1e-3 * 0.5 ** np.arange(3)
    errors = [np.linalg.norm(residual(x + h * direction) - F - h * slope) for h in steps]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2, atol=0.05)


def propped():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((3e3, 5e3), 8e3, (1.0, 1.5), 0.7))
    supports = [cf.Hinge(rod.start, (0, 1, 0)), cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
    return cf.Scene([rod], supports, [cf.Force(rod.end, (0, 0, -(np.pi**2)))])


@pytest.mark.serial
@pytest.mark.parametrize("make", [lambda: column(eccentricity=0.0)[1], propped], ids=["column", "propped"])
def test_the_saddle_points_own_inertia_says_the_same(make):
    """Negative eigenvalues of the tangent minus those due to constraints
    equal those of the second variation in (r, theta)."""
    scene = make()
    layout, counts = Layout.of(scene, 5), []
    problem = Problem(SpatialModel(MPI.COMM_SELF, Signature.of(scene, layout, formulation="multiplier", degree=2)))
    stability = NegativeModes(problem)
    problem.load(scene, layout)
    stability.load()
    newton = Newton(problem)
    newton.allow(10)
    for eta in (0.5, 1.3, 1.7, 9.5):
        problem.set_load_factor(eta)
        assert newton.solve().converged
        problem.function(problem.x, problem.b)
        saddle = dense.tangent(problem)
        np.testing.assert_allclose(saddle, saddle.T, atol=1e-9 * np.abs(saddle).max())
        scale = 1 / np.sqrt(np.abs(saddle).max(axis=1))
        negative = np.count_nonzero(np.linalg.eigvalsh(scale[:, None] * saddle * scale) < 0)
        constraints = problem.numbering.nodes + problem.numbering.multipliers
        counts.append(stability.count())
        assert negative - constraints == counts[-1]
    assert counts[0] == 0 and counts[-1] >= 3 and sorted(counts) == counts


def test_limit_points_and_branches():
    _, scene = lees_frame()
    path = cf.solve(scene, (0, 20000.0), formulation="multiplier", elements=4)
    limits = [event.load_factor for event in path.events if event.kind == "limit"]
    np.testing.assert_allclose(limits, LEE_LIMITS, rtol=1e-4)
    rod, scene = column(eccentricity=0.0)
    ends = []
    for formulation in ("mixed", "multiplier"):
        path = cf.solve(scene, (0, 1.5), model="spatial", formulation=formulation, elements=4, branch=1)
        assert path.left and [event.kind for event in path.events][0] == "bifurcation"
        ends.append(np.array([path.events[0].load_factor, np.linalg.norm(path.displacement(rod.end)[-1])]))
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-6)


def mixed_and_multiplier(scene, **more):
    return (cf.solve(scene, [0.9, 1.5], model="spatial", formulation=f, **more) for f in ("mixed", "multiplier"))


def test_meshes_are_refined_from_coarser_ones():
    """As many iterations as with `mixed`, and the true error is below the estimate."""
    rod, scene = column()
    k = rod.stiffness
    exact = cf.analytic.reissner([0.9, 1.5], 0.2, 20.0, bending=k.bending[1], axial=k.axial, shear=k.shear[0]).delta
    mixed, path = mixed_and_multiplier(scene, degree=2, tol=1e-6)
    error = np.abs(path.displacement(rod.end)[:, 0] - exact) / path.largest_displacement()
    assert (error <= path.error).all() and (path.error <= 1e-6).all()
    assert path.iterations.sum() <= mixed.iterations.sum() + 4
    assert sum(path.elements) <= 2 * sum(mixed.elements)


@pytest.mark.slow
@pytest.mark.serial
def test_infinite_and_very_large_stiffnesses_make_the_force_an_unknown():
    k = column()[0].stiffness
    rod, scene = column(section=cf.Stiffness((np.inf, np.inf), np.inf, k.bending, k.torsion))
    mixed, path = mixed_and_multiplier(scene, elements=8)
    np.testing.assert_allclose(path.displacement(rod.end), mixed.displacement(rod.end), rtol=1e-9, atol=1e-12)
    assert path.stable.all() and any("an unknown (formulation 'multiplier')" in why for why in path.why)


@pytest.mark.serial
def test_names_are_resolved_once():
    assert formulation_of(None).name == "mixed" and formulation_of("multiplier") == Multiplier()
    with pytest.raises(cf.SceneError, match="formulation = 'multiplyer': did you mean 'multiplier'"):
        cf.solve(column()[1], [0.5], formulation="multiplyer")
    with pytest.raises(cf.SceneError, match="'multiplier' exists only in the spatial model"):
        cf.solve(column()[1], [0.5], formulation="multiplier", model="planar")
