"""All models valid for a scene give the same results and the same number of negative modes."""

import numpy as np
import pytest
from conftest import column
from mpi4py import MPI
from plane_scenes import SCENES, STEEL, Drawn, thin_cantilever, tree

import cosserat_fenicsx as cf


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


@pytest.mark.parametrize("seed", [None, 1, 2])
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


@pytest.mark.parametrize("model", ["determinate", "planar"])
@pytest.mark.parametrize("slenderness", [1e2, 1e4, 1e5])
def test_against_the_exact_rod(model, slenderness):
    rod, scene = column(diameter=20.0 / slenderness)
    k = rod.stiffness
    exact = cf.analytic.reissner([0.9, 1.5], 0.2, 20.0, bending=k.bending[1], axial=k.axial, shear=k.shear[0])
    for elements in (8, 64):
        path = cf.solve(scene, [0.9, 1.5], model=model, elements=elements)
        np.testing.assert_allclose(path.displacement(rod.end)[:, 0], exact.delta, rtol=1e-7)
        assert path.stable.all() and path.iterations.sum() < 100


@pytest.mark.parametrize("model", ["determinate", "planar"])
@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.serial
def test_tip_converges_with_order_2p(model, degree, reference):
    rod, scene = column(arm=True)
    truth = cf.solve(scene, [0.9], model="spatial", elements=48).displacement(rod.end)[0, 0]
    errors = []
    for elements in (8, 16, 32):
        path = cf.solve(scene, [0.9], model=model, degree=degree, elements=elements)
        errors.append(abs(path.displacement(rod.end)[0, 0] / truth - 1))
    orders = [np.log2(a / b) for a, b in zip(errors[:-1], errors[1:], strict=True) if b > 1e-11]
    assert orders and orders[-1] == pytest.approx(2 * degree, abs=0.3), errors


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


@pytest.mark.parametrize("model", ["determinate", "planar"])
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


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_a_perfect_round_column_loses_two_motions_at_once(model):
    """One in the plane and one out of it; planar models count both."""
    _, scene = column(eccentricity=0.0)
    path = cf.solve(scene, [0.5, 0.999, 1.001, 8.9, 9.1], model=model, elements=8)
    assert path.negative_modes.tolist() == [0, 0, 2, 2, 4]


@pytest.mark.parametrize("model", ["determinate", "planar"])
@pytest.mark.parametrize("rigid", [False, True])
def test_lateral_buckling_is_seen_in_the_plane(model, rigid):
    _, scene = thin_cantilever(*([(np.inf, np.inf), np.inf] if rigid else []))
    path = cf.solve(scene, [0.9, 0.998, 1.002, 1.1], model=model, elements=8)
    assert path.model == model and path.negative_modes.tolist() == [0, 0, 1, 1]


def test_supports_count_out_of_the_plane_too():
    """A strip that would buckle sideways on a pin, but not on a hinge about the normal."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 4.0), 2.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0)), section)
    roller = [cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
    loads = [cf.Force(rod.end, (0, 0, -(np.pi**2))), cf.Force(rod.at(0.5), (0.1, 0, 0))]
    for foot, expected in ((cf.Clamp(rod.start), 2.0457), (cf.Hinge(rod.start, (0, 1, 0)), 2.0457)):
        path = cf.solve(
            cf.Scene([rod], [foot, *roller], loads), [expected - 0.02, expected + 0.02], model="planar", elements=8
        )
        assert path.negative_modes.tolist() == [0, 1]
        spatial = cf.solve(path.scene, [expected - 0.02, expected + 0.02], model="spatial", elements=8)
        assert spatial.negative_modes.tolist() == [0, 1]


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
    section = (
        cf.Stiffness((300.0, 50.0), 200.0, (169.0, 1014.0), 84.5, mass=0.04)
        if kind == "soft"
        else cf.Rectangle(0.1, 0.3)
    )
    if kind == "helix":
        rod = cf.Rod(cf.Helix((1, 2, 3), (1.05, 2, 3), 3, 0.03), cf.Circle(0.004), STEEL, name="spring")
        return cf.Scene([rod], [cf.Clamp(rod.end)], [cf.Force(rod.start, (2, 1, 40.0)), cf.Weight()])
    rod = cf.Rod(cf.Line((100.0, -50.0, 7.0), (103.0, -46.0, 19.0), d1=(1.0, 0.5, 0.0)), section, STEEL, name="stem")
    F, L = rod.stiffness.bending[0] / rod.length**2, rod.length
    loads = [
        cf.Weight((1.0, -3.0, -9.0)),
        cf.EccentricForce(rod.end, (0.3 * F, 0.4 * F, -0.2 * F), (0.05 * L, -0.08 * L)),
        cf.Moment(rod.at(0.4 * L), (0.1 * F * L, 0, 0.2 * F * L)),
    ]
    twig = cf.Rod(
        cf.Line(rod.curve.position(0.6 * L), rod.curve.position(0.6 * L) + np.array([0, 3.0, 1.0])),
        section,
        STEEL,
        name="twig",
    )
    loads.append(cf.Force(twig.end, (0.2 * F, 0, -0.4 * F)))
    return cf.Scene([twig, rod], [cf.Clamp(rod.at(0.1 * L))], loads, [cf.Joint(rod.at(0.6 * L), twig.start)])


@pytest.mark.parametrize("kind", ["helix", "soft", "steel"])
def test_determinate_in_space_agrees(kind):
    scene = in_space(kind)
    path, truth = (cf.solve(scene, [0.3, 1.0], elements=24, model=model) for model in ("auto", "spatial"))
    assert path.model == "determinate" and path.unknowns == 4 * truth.unknowns // 7
    assert "statics gives the contact force" in " ".join(path.why)
    assert path.negative_modes.tolist() == truth.negative_modes.tolist()
    same(path, truth, 5e-9)
    alone = cf.solve(scene, [0.3, 1.0], elements=24, comm=MPI.COMM_SELF)
    same(path, alone, 1e-9)


def test_determinate_in_space_counts_what_the_spatial_counts():
    """Under a dead moment in space, which has no potential, and past lateral buckling."""
    rod, scene = thin_cantilever()
    tilted = cf.Scene(
        [rod], scene.supports, [*scene.loads, cf.Force(rod.end, (1e-5, 0, 0)), cf.Moment(rod.end, (0, 0, 0.1))]
    )
    etas = [0.5, 0.98, 1.1]
    paths = [cf.solve(tilted, etas, model=model, elements=8) for model in ("determinate", "spatial")]
    assert paths[0].negative_modes.tolist() == paths[1].negative_modes.tolist()
    column_, up = column(eccentricity=0.0)
    twisted = cf.Scene(up.rods, up.supports, [*up.loads, cf.Moment(column_.end, (0, 0, 1e3))])
    paths = [cf.solve(twisted, [0.5, 0.95, 1.05, 9.5], model=model, elements=8) for model in ("determinate", "spatial")]
    assert paths[0].negative_modes.tolist() == paths[1].negative_modes.tolist() != [0, 0, 0, 0]


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
