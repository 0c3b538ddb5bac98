"""Invariance of results under rotation of the scene, change of units, the number of ranks and the load steps."""

import numpy as np
import pytest
from conftest import column
from mpi4py import MPI

import cosserat_fenicsx as cf

ETAS = [0.5, 0.9, 1.1, 1.5]


def random_rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


@pytest.mark.parametrize("arm", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_rotating_the_scene_turns_the_answer(seed, arm):
    rod, scene = column(arm=arm)
    plain = cf.solve(scene, ETAS, elements=8)
    Q, origin = random_rotation(seed), np.array([30.0, -70.0, 110.0])
    P = cf.euler_load(rod)
    turned_rod = cf.Rod(cf.Line(origin, origin + Q @ [0, 0, 20.0], d1=Q[:, 0]), rod.section, rod.material)
    loads = (
        [cf.EccentricForce(turned_rod.end, Q @ [0, 0, -P], (0.2, 0))]
        if arm
        else [cf.Force(turned_rod.end, Q @ [0, 0, -P]), cf.Moment(turned_rod.end, Q @ [0, 0.2 * P, 0])]
    )
    turned = cf.solve(cf.Scene([turned_rod], [cf.Clamp(turned_rod.start)], loads), ETAS, elements=8)
    u, moment = plain.displacement(rod.end) @ Q.T, plain.moment(rod.start) @ Q.T
    np.testing.assert_allclose(turned.displacement(turned_rod.end), u, atol=1e-12 * 20)
    np.testing.assert_allclose(turned.moment(turned_rod.start), moment, atol=1e-12 * np.abs(moment).max())
    assert turned.iterations.tolist() == plain.iterations.tolist()
    a, b = turned.fields(-1, turned_rod), plain.fields(-1, rod)
    np.testing.assert_allclose(a["curvature"], b["curvature"], atol=1e-11 * np.abs(b["curvature"]).max())  # material


def test_units_change_nothing():
    """Newton and metre against meganewton and millimetre."""
    rod, scene = column()
    si = cf.solve(scene, ETAS, elements=8)
    other_rod, other = column(length=20e3, diameter=200.0, eccentricity=200.0, E=210e9 * 1e-12)
    mm = cf.solve(other, ETAS, elements=8)
    np.testing.assert_allclose(mm.displacement(other_rod.end) / 1e3, si.displacement(rod.end), atol=1e-10 * 20)
    np.testing.assert_allclose(mm.moment(other_rod.start) * 1e3, si.moment(rod.start), rtol=1e-10, atol=1e-3)
    assert mm.iterations.tolist() == si.iterations.tolist()


def rich_scene():
    """Loads of every kind on an inclined rod, an interior station, both n carried and n as a field."""
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    curve = cf.Line((1, 2, 3), (4, -3, 20))
    k = cf.Rectangle(0.2, 0.3).stiffness(steel)
    stiff = cf.Stiffness(shear=(np.inf, np.inf), axial=np.inf, bending=k.bending, torsion=k.torsion, mass=k.mass)
    rods = [cf.Rod(curve, cf.Rectangle(0.2, 0.3), steel, name="a"), cf.Rod(curve, stiff, name="b")]
    for rod in rods:
        yield (
            rod,
            cf.Scene(
                [rod],
                [cf.Clamp(rod.start)],
                [
                    cf.Weight(),
                    cf.Force(rod.end, (2e4, 1e4, -3e4)),
                    cf.EccentricForce(rod.end, (0, 5e3, 0), (0.3, 0.4)),
                    cf.Moment(rod.at(7.0), (1e4, 0, 2e4)),
                ],
            ),
        )


@pytest.mark.ranks
def test_number_of_ranks_changes_nothing():
    """All ranks together against every rank alone (trivial with one process)."""
    cases = [column(), *rich_scene()]
    for rod, scene in cases:
        arguments = dict(elements=9)
        together = cf.solve(scene, (0.0, 1.3), **arguments)
        alone = cf.solve(scene, (0.0, 1.3), comm=MPI.COMM_SELF, **arguments)
        assert together.unknowns == alone.unknowns
        assert together.iterations.tolist() == alone.iterations.tolist()
        assert together.negative_modes.tolist() == alone.negative_modes.tolist()
        np.testing.assert_allclose(together.load_factors, alone.load_factors, rtol=1e-9)
        for k in (1, len(alone) - 1):
            a, b = together.fields(k, rod), alone.fields(k, rod)
            for name in a:
                np.testing.assert_allclose(a[name], b[name], atol=1e-9 * np.abs(b[name]).max(), err_msg=name)


@pytest.mark.ranks
@pytest.mark.parametrize("elements", [1, 2])
def test_ranks_without_an_element(elements):
    for rod, scene in (column(), *rich_scene()):
        together = cf.solve(scene, [0.5], elements=elements)
        alone = cf.solve(scene, [0.5], elements=elements, comm=MPI.COMM_SELF)
        np.testing.assert_allclose(together.centreline(), alone.centreline(), atol=1e-9 * rod.length)
        np.testing.assert_allclose(together.force(rod.start), alone.force(rod.start), rtol=1e-6, atol=1e-3)


def test_an_unstable_path_is_counted_alike_in_parallel():
    rod, scene = column(eccentricity=0.0)
    path = cf.solve(scene, [0.9, 1.2, 9.5], elements=8)
    assert path.negative_modes.tolist() == [0, 2, 4]


def test_the_way_does_not_matter():
    """8, 10 or 160 steps to one load give the same result to round-off."""
    rod, scene = next(rich_scene())
    ends = [cf.solve(scene, np.linspace(0, 1, n + 1)[1:], elements=6).position(rod.end)[-1] for n in (8, 10, 160)]
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-11 * rod.length)
    np.testing.assert_allclose(ends[2], ends[0], atol=1e-11 * rod.length)


def test_one_problem_serves_every_scene_of_its_shape():
    """Data of a first scene must not affect a second one, and nothing is compiled again for it."""
    from cosserat_fenicsx.algebra.pool import PROBLEMS

    first, scene = column()
    before = cf.solve(scene, [0.9], elements=8).displacement(first.end)
    made = PROBLEMS.made
    other_rod, other = column(length=31.0, diameter=0.3, eccentricity=0.5)
    cf.solve(other, [0.3, 1.2], elements=8)
    np.testing.assert_array_equal(cf.solve(scene, [0.9], elements=8).displacement(first.end), before)
    assert PROBLEMS.made == made
