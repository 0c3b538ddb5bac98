"""The multiplier formulation with every support, joint and load; its moments, stability and mesh refinement."""

import dense
import numpy as np
import pytest
from conftest import column
from mpi4py import MPI
from path_scenes import LEE_LIMITS, lees_frame

import cosserat_fenicsx as cf
from cosserat_fenicsx.algebra.newton import Newton
from cosserat_fenicsx.models.formulation import OF_MOTION, Multiplier, formulation_of
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.statics.problem import Problem
from cosserat_fenicsx.statics.stability import NegativeModes

SECTION = cf.Stiffness(shear=(3e3, 5e3), axial=8e3, bending=(1.0, 2.5), torsion=0.7, mass=1.0)


def bow():
    """A bent and twisted rod of length 1 in a general position."""
    return cf.Rod(
        cf.UniformCurvature(1.0, (0.4, 0.9, 0.5), start=(3.0, 1.0, -2.0), frame=(0.1, -0.5, 0.7, -0.5)),
        SECTION,
        name="bow",
    )


def supported(*supports):
    def scene():
        rod = bow()
        loads = [
            cf.Force(rod.at(0.5), (0.9, -0.6, 0.3)),
            cf.LineForce(rod, (0.2, 0.6, 0.1)),
            cf.LineMoment(rod, (0.1, -0.2, 0.3)),
        ]
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


SCENES = {
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


@pytest.mark.parametrize("name", SCENES)
def test_every_support_joint_and_load_as_mixed_has_them(name):
    """Both converge to the same solution; P4 on 8 elements differ by less than 1e-8 at element ends (order 2p)."""
    scene = SCENES[name]()
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


@pytest.mark.serial
@pytest.mark.parametrize(
    ("name", "degree"), [("moved", 1), ("hinge", 2), ("follower", 1), ("eccentric", 2), ("a hinge between", 2)]
)
def test_the_tangent_of_reactions_and_live_loads_is_their_derivative(name, degree):
    """Taylor test with non-zero multipliers; n is that of the motion,
    since the tangent with a carried n is not the derivative."""
    scene = SCENES[name]()
    layout = Layout.of(scene, 2)
    signature = Signature.of(scene, layout, formulation=Multiplier(force=OF_MOTION), degree=degree)
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


def test_meshes_are_refined_from_coarser_ones():
    """As many iterations as with `mixed`, and the true error is below the estimate."""
    rod, scene = column()
    exact = cf.analytic.reissner(
        [0.9, 1.5], 0.2, 20.0, bending=rod.stiffness.bending[1], axial=rod.stiffness.axial, shear=rod.stiffness.shear[0]
    ).delta
    mixed, path = (
        cf.solve(scene, [0.9, 1.5], model="spatial", formulation=f, degree=2, tol=1e-6) for f in ("mixed", "multiplier")
    )
    error = np.abs(path.displacement(rod.end)[:, 0] - exact) / path.largest_displacement()
    assert (error <= path.error).all() and (path.error <= 1e-6).all()
    assert path.iterations.sum() <= mixed.iterations.sum() + 4
    assert sum(path.elements) <= 2 * sum(mixed.elements)


def test_infinite_and_very_large_stiffnesses_make_the_force_an_unknown():
    k = column()[0].stiffness
    rod, scene = column(section=cf.Stiffness((np.inf, np.inf), np.inf, k.bending, k.torsion))
    mixed, path = (
        cf.solve(scene, [0.9, 1.5], model="spatial", formulation=f, elements=8) for f in ("mixed", "multiplier")
    )
    np.testing.assert_allclose(path.displacement(rod.end), mixed.displacement(rod.end), rtol=1e-9, atol=1e-12)
    assert path.stable.all() and any("an unknown (formulation 'multiplier')" in why for why in path.why)


def test_names_are_resolved_once():
    assert formulation_of(None).name == "mixed" and formulation_of("multiplier") == Multiplier()
    with pytest.raises(cf.SceneError, match="formulation = 'multiplyer': did you mean 'multiplier'"):
        cf.solve(column()[1], [0.5], formulation="multiplyer")
    with pytest.raises(cf.SceneError, match="'multiplier' exists only in the spatial model"):
        cf.solve(column()[1], [0.5], formulation="multiplier", model="planar")
