"""Elimination along the rods against dense linear algebra: solutions, singular tangents, numbers of negative modes."""

from contextlib import contextmanager

import numpy as np
import pytest
import scipy.sparse
from conftest import COMM
from dense import tangent
from frame_scenes import grid_shell
from mpi4py import MPI
from scipy.linalg import eigvalsh_tridiagonal

import cosserat_fenicsx as cf
from cosserat_fenicsx.algebra import eigen, elimination
from cosserat_fenicsx.algebra.pool import ProblemPool
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.statics.problem import solvers_of

SOFT = cf.Stiffness(shear=(3e3, 5e3), axial=8e3, bending=(1.0, 2.5), torsion=0.7)
RIGID = cf.Stiffness(shear=(np.inf, np.inf), axial=np.inf, bending=(1.0, 2.5), torsion=0.7)
INEXTENSIBLE = cf.Stiffness(shear=(3e3, 5e3), axial=np.inf, bending=(1.0, 2.5), torsion=0.7)


def line(a, b, section=SOFT, **more):
    return cf.Rod(cf.Line(a, b, **more), section)


def held_at(*which, section=SOFT):
    """A rod clamped at its ends."""
    rod = line((0, 0, 0), (0.3, 0.4, 1.0), section)
    free = rod.at(0.5 * rod.length) if len(which) > 1 else rod.start if which == ("end",) else rod.end
    return cf.Scene([rod], [cf.Clamp(getattr(rod, end)) for end in which], [cf.Force(free, (0.4, 0.5, -0.6))])


def straight_between_points(section):
    """Along z, whose axial force is not determined before the last element."""
    rod = line((0, 0, 0), (0, 0, 1.0), section)
    supports = [cf.Clamp(rod.start), cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
    return cf.Scene([rod], supports, [cf.Force(rod.at(0.5), (0.4, 0.5, 0))])


def hinged_in_the_middle(section=SOFT):
    rods = [line((0, 0, 0), (0, 0, 0.5), section), line((0, 0, 0.5), (0, 0.2, 1.0), section)]
    joint = cf.Joint(rods[0].end, rods[1].start, (0, 1, 0))
    return cf.Scene(
        rods, [cf.Clamp(rods[0].start), cf.Pin(rods[1].end)], [cf.Force(rods[1].start, (0.4, 0, -1))], [joint]
    )


def branches(section=SOFT):
    """A rod on the interior of another one, with a twig of its own, and a rod joined start to start."""
    trunk, bough = line((0, 0, 0), (0, 0, 1), section), line((0, 0, 0.5), (1, 0.1, 0.6), section)
    twig, other = line((1, 0.1, 0.6), (1.5, 0.8, 1), section), line((0, 0, 0.5), (0, -1, 1), section)
    joints = [cf.Joint(trunk.at(0.5), bough.start), cf.Joint(bough.end, twig.start), cf.Joint(bough.start, other.start)]
    loads = [cf.Force(rod.end, (0.1, 0.3, -0.4)) for rod in (trunk, twig, other)]
    return cf.Scene([trunk, bough, twig, other], [cf.Clamp(trunk.start)], loads, joints)


def ring(count, section=SOFT):
    """A closed ring of rods."""
    turn, ends = 2 * np.pi / count, np.exp(2j * np.pi * np.arange(count) / count)
    rods = [cf.Rod(cf.Arc((0, 0, 0), (z.real, z.imag, 0), turn), section) for z in ends]
    joints = [cf.Joint(rod.end, rods[(i + 1) % count].start) for i, rod in enumerate(rods)]
    far = rods[-1].at(0.5 * rods[-1].length)
    return cf.Scene(rods, [cf.Clamp(rods[0].start)], [cf.Force(far, (-1, 0.2, 0.5))], joints)


def end_to_end(section=SOFT):
    """Joined end to end, and start to start with a third one."""
    a, b = line((0, 0, 0), (0, 0, 1), section), line((0, 1, 1), (0, 0, 1), section)
    c = line((0, 1, 1), (1, 1, 1), section)
    joints = [cf.Joint(a.end, b.end), cf.Joint(b.start, c.start)]
    return cf.Scene([a, b, c], [cf.Clamp(a.start)], [cf.Force(c.end, (0.2, 0.3, -0.4))], joints)


def lattice(section=SOFT):
    """Rods between the points of a grid, most of them of one element, two of them hinged."""
    points = {(i, j): (float(i), float(j), 0.1 * i * j) for i in range(3) for j in range(3)}
    rods, first, joints = [], {}, []
    for i, j in points:
        for to in ((i + 1, j), (i, j + 1)):
            if to in points:
                rods.append(line(points[i, j], points[to], section))
                for at, station in (((i, j), rods[-1].start), (to, rods[-1].end)):
                    if at in first:
                        release = (0, 0, 1) if len(rods) in (4, 9) and station.s == 0 else None
                        joints.append(cf.Joint(first[at], station, release))
                    else:
                        first[at] = station
    supports = [cf.Clamp(first[0, 0]), cf.Pin(first[2, 0])]
    return cf.Scene(rods, supports, [cf.Force(first[2, 2], (0.1, 0.2, -0.5))], joints)


def in_a_plane(section=SOFT):
    a, b = line((0, 0, 0), (0, 0, 1), section, d1=(1, 0, 0)), line((0, 0, 1), (1, 0, 1), section, d1=(0, 0, 1))
    return cf.Scene([a, b], [cf.Clamp(a.start)], [cf.Force(b.end, (0.2, 0, -0.5))], [cf.Joint(a.end, b.start)])


def column(section=SOFT):
    """Statically determinate in a plane."""
    rod = line((0, 0, 0), (0, 0, 1), section, d1=(1, 0, 0))
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.5, 0, -2))])


SCENES = {
    "clamped at its start": held_at("start"), "clamped at its end": held_at("end"), "at both": held_at("start", "end"),
    "rigid, start": held_at("start", section=RIGID), "rigid, end": held_at("end", section=RIGID),
    "inextensible between points": straight_between_points(INEXTENSIBLE),
    "rigid between points": straight_between_points(RIGID),
    "hinge": hinged_in_the_middle(), "rigid with hinge": hinged_in_the_middle(RIGID),
    "tree": branches(), "rigid tree": branches(RIGID), "ring of one": ring(1), "ring of three": ring(3),
    "rigid ring of two": ring(2, RIGID), "end to end": end_to_end(), "lattice": lattice(),
    "rigid lattice": lattice(INEXTENSIBLE),
}  # fmt: skip


@contextmanager
def bent(scene, elements=2, *, comm=MPI.COMM_SELF, amount=0.1, **options):
    """Loaded solvers whose state is near the reference one, without symmetry."""
    with solvers_of(scene, Layout.of(scene, elements), comm=comm, **options) as solvers:
        problem = solvers[0]
        bend(problem, amount)
        yield solvers


def bend(problem, amount):
    """The same motion on all ranks."""
    numbering = problem.numbering
    problem.set_load_factor(0.8)
    change = amount * np.random.default_rng(5).normal(size=numbering.total)
    problem.x.array_w[:] += change[numbering.first : numbering.first + numbering.size]
    problem.function(problem.x, problem.b)
    for live in problem._live:
        live[:] = 0.3


def check_solution(problem):
    problem.factor()
    A, b = tangent(problem), np.random.default_rng(6).normal(size=problem.numbering.total)
    problem.b.array_w[:] = b
    x = problem.numbering.vector()
    assert problem.solve(problem.b, x)
    scale = np.abs(A) @ np.abs(x.array_r) + np.abs(b)
    assert (np.abs(A @ x.array_r - b) / scale.max()).max() < 1e-12
    exact = np.linalg.solve(A, b)
    room = 1e-15 * np.linalg.cond(A) + 1e-12
    np.testing.assert_allclose(x.array_r, exact, rtol=0, atol=room * np.abs(exact).max())


#: Scenes, elements of a rod, how far they are bent, and options: at a bent state and, where the tangent is not singular
#: there, at a straight one; pivots of the axial force are zero in every element of a straight rod between two points.
SOLVED = {
    **{name: (scene, 2, 0.1, {}) for name, scene in SCENES.items()},
    **{f"{formulation} {degree}": (hinged_in_the_middle(), 3, 0.1, {"formulation": formulation, "degree": degree})
       for formulation in ("mixed", "displacement", "multiplier") for degree in (1, 2, 3, 4)},
    **{f"{name} {degree}": (scene, 3, 0.1, {"model": name.split()[-1], "degree": degree}) for degree in (1, 4)
       for name, scene in {"planar": in_a_plane(), "rigid planar": in_a_plane(RIGID), "determinate": column()}.items()},
    **{f"straight {name} {elements}": (straight_between_points(section), elements, 0.0, {}) for elements in (1, 5)
       for name, section in {"inextensible": INEXTENSIBLE, "rigid": RIGID}.items()},
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("name", SOLVED)
def test_solution_is_that_of_dense_factors(name):
    scene, elements, amount, options = SOLVED[name]
    with bent(scene, elements, amount=amount, **options) as (problem, _, _):
        check_solution(problem)


@pytest.mark.serial
@pytest.mark.parametrize("elements", [1, 2, 6])
def test_an_axial_force_that_is_not_determined_makes_the_tangent_singular(elements):
    """Between two clamps, and in the middle of a rod that is held at both ends along its axis."""
    rod = line((0, 0, 0), (0, 0, 1.0), INEXTENSIBLE)
    for supports in ([cf.Clamp(rod.start), cf.Clamp(rod.end)], [cf.Clamp(rod.start), cf.Pin(rod.end)]):
        scene = cf.Scene([rod], supports, [cf.Force(rod.at(0.5), (0.3, 0.2, 0))])
        with bent(scene, elements, amount=0.0) as (problem, newton, _):
            problem.factor()
            assert not problem.solve(problem.b, problem.x)
            assert not np.isfinite(problem.x.array_r).any()
        with bent(scene, elements, amount=0.0) as (problem, newton, _):
            newton.allow(5)
            assert newton.solve().reason == "the tangent is singular"


def eigenvalues(stability):
    """Of the assembled second variation, scaled to a diagonal of ones; with the signs that they have in any scaling."""
    found = []
    for part in stability.parts:
        part.assemble()
        rows = np.arange(part.variation.numbering.total, dtype=np.int32)
        K = part.K.getValues(rows, rows)
        size = np.sqrt(np.abs(np.diag(K)))
        found.append(np.linalg.eigvalsh((K + K.T) / (2 * size * size[:, None])))
    return np.concatenate(found)


def soft_on_stiff():
    """A rod whose stiffness is a millionth of that of its neighbour, and one between both."""
    a, b = line((0, 0, 0), (0, 0, 1), SOFT), line((0, 0, 1), (0, 0.3, 2), times(SOFT, 1e6))
    c = line((0, 0, 1), (1, 0, 1.5), times(SOFT, 1e3))
    joints = [cf.Joint(a.end, b.start), cf.Joint(b.start, c.start, (0, 1, 0))]
    loads = [cf.Force(a.end, (0, 0, -1e2)), cf.Force(b.end, (0, 0.3, -1e6)), cf.Force(c.end, (1, 0, -20))]
    return cf.Scene([a, b, c], [cf.Clamp(a.start), cf.Pin(c.end)], loads, joints)


def times(section, factor):
    return cf.Stiffness(
        shear=[factor * k for k in (3e3, 5e3)], axial=factor * 8e3, bending=[factor, 2.5 * factor],
        torsion=0.7 * factor,
    )  # fmt: skip


def slender():
    """L/d = 1e5: axial and bending stiffness of the elements differ by eleven orders of magnitude."""
    rod = line((0, 0, 0), (0, 0, 1), cf.Stiffness(shear=(6e10, 6e10), axial=1.6e11, bending=(1.0, 1.0), torsion=0.8))
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.1, 0.2, -1.0))])


COUNTED = {
    "clamped at its end": (held_at("end"), {}), "at both": (held_at("start", "end"), {"formulation": "displacement"}),
    "hinge": (hinged_in_the_middle(), {"degree": 2}), "rigid tree": (branches(RIGID), {}),
    "ring of one": (ring(1), {"formulation": "multiplier"}), "lattice": (lattice(), {}),
    "in a plane": (in_a_plane(), {"model": "planar"}), "determinate": (column(), {"model": "determinate"}),
    "soft on stiff": (soft_on_stiff(), {}), "slender": (slender(), {}),
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("name", COUNTED)
def test_negative_pivots_are_negative_eigenvalues(name):
    """Under contact forces of all signs, so that up to a third of the eigenvalues are negative."""
    scene, options = COUNTED[name]
    found = []
    with bent(scene, 3, amount=1e-3, **options) as (problem, _, stability):
        for size in (0.0, 30.0, 1e3):
            for live in problem._live:
                live[:] = size * np.random.default_rng(3).normal(size=len(live))
            values = eigenvalues(stability)
            assert stability.count() == np.count_nonzero(values < 0)
            found.append(np.count_nonzero(values < 0))
    if problem._live:
        assert found[0] < found[-1]


@pytest.mark.serial
@pytest.mark.parametrize("length", [0.1, 0.03])
@pytest.mark.parametrize("elements", [2, 8])
def test_slender_rods_with_hinges_are_stable(length, elements):
    """A rod of L/d = 1e5 on a short one: the smallest eigenvalue of the interface is 1e-15 of the largest."""
    section = cf.Stiffness(shear=(6e10, 6e10), axial=1.6e11, bending=(1.0, 1.0), torsion=0.8)
    top = (0, 0.6 * length, 1 + 0.8 * length)
    rod, strut = line((0, 0, 0), (0, 0, 1), section), line((0, 0, 1), top, section)
    joint = cf.Joint(rod.end, strut.start, (0.3, 0.3, -0.9))
    scene = cf.Scene(
        [rod, strut], [cf.Clamp(rod.start), cf.Pin(strut.end)], [cf.Force(rod.at(0.5), (0.1, 0, 0))], [joint]
    )
    with bent(scene, elements, amount=0.0) as (_, _, stability):
        assert stability.count() == 0


@pytest.mark.parametrize("name", ["hinge", "rigid tree", "lattice", "ring of three"])
def test_ranks_share_the_elimination(name):
    """The same solution and count on all ranks together as on each alone."""
    scene, found = SCENES[name], []
    for comm in (MPI.COMM_SELF, COMM):
        with bent(scene, 2, comm=comm, amount=0.0) as (problem, newton, stability):
            problem.set_load_factor(0.4)
            newton.allow(30)
            assert newton.solve().converged
            problem.factor()
            model, numbering = problem.model, problem.numbering
            problem._force = problem.load_derivative(problem.x)
            x = numbering.vector()
            assert problem.solve(problem._force, x)
            nodal, _ = model.snapshot()
            found.append((nodal, model.inner(x.array_r, x.array_r), stability.count()))
    for alone, together in zip(*found, strict=True):
        np.testing.assert_allclose(together, alone, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("zeros", [0, 1, 7])
def test_signs_of_a_large_system_without_a_pivot_on_its_diagonal(zeros):
    """Of a sparse symmetric matrix whose factors need pivots off the diagonal; a dense one would take minutes."""
    rng, size = np.random.default_rng(5), 3000
    system = elimination._Sparse(size)
    i = np.arange(size)
    rows, columns = np.concatenate([i, i[1:], i[:-1]]), np.concatenate([i, i[:-1], i[1:]])
    entry = system.entries(rows, columns)
    beside, diagonal = rng.normal(size=size - 1), rng.normal(size=size)
    diagonal[::2] = 0.0  # no pivots
    beside[1::2] *= 0.1
    for k in range(zeros):
        diagonal[10 * k + 40] = beside[10 * k + 39] = beside[10 * k + 40] = 0.0
    values = np.zeros(system.room)
    np.add.at(values, entry, np.concatenate([diagonal, beside, beside]))
    eigenvalues = eigvalsh_tridiagonal(diagonal, beside)
    expected = int((eigenvalues < -1e-12).sum()), int((np.abs(eigenvalues) <= 1e-12).sum())
    *found, logarithm = system.signs(values)
    assert expected[1] == zeros and tuple(found) == expected
    product = np.nan if zeros else np.log(np.abs(eigenvalues)).sum()
    np.testing.assert_allclose(logarithm, product, rtol=1e-10)


def test_signs_of_large_systems_in_turn():
    """Positive definite ones, whose factors need no exchange of pivots; one that is singular beside rounding; and one
    with a negative eigenvalue, after which others still count right."""
    size = 3000
    i, diagonal = np.arange(size), np.full(size, 2.0)
    system = elimination._Sparse(size)
    entry = system.entries(np.concatenate([i, i[1:], i[:-1]]), np.concatenate([i, i[:-1], i[1:]]))
    least = 2 * np.cos(np.pi / (size + 1)) - 2  # minus the least of the eigenvalues 2 - 2 cos(k pi/(n + 1))
    for shift, expected in ((0.01, (0, 0)), (0.0, (0, 0)), (least - 5e-7, (1, 0)), (-1.0, (1000, 0)), (0.01, (0, 0))):
        values = np.zeros(system.room)
        np.add.at(values, entry, np.concatenate([diagonal + shift, np.full(2 * size - 2, -1.0)]))
        *found, logarithm = system.signs(values)
        eigenvalues = eigvalsh_tridiagonal(diagonal + shift, np.full(size - 1, -1.0))
        assert tuple(found) == expected == (int((eigenvalues < 0).sum()), 0)
        np.testing.assert_allclose(logarithm, np.log(np.abs(eigenvalues)).sum(), rtol=1e-8, atol=1e-9)


def sparse_system(seed, change):
    """(starts, columns, values, dense matrix) of a diagonally heavy unsymmetric matrix; `change` of its entries."""
    rng = np.random.default_rng(seed)
    matrix = scipy.sparse.random(300, 300, 0.02, random_state=seed, format="csr") + 4 * scipy.sparse.identity(300)
    matrix = matrix.tocsr()
    matrix.sort_indices()
    matrix.data *= 1 + change * rng.standard_normal(matrix.nnz)
    return matrix.indptr, matrix.indices, matrix.data, matrix.toarray()


def test_newton_takes_the_factors_that_counted_signs(monkeypatch):
    """No others are made of the equations where rods meet; where these do not serve, the path is the same."""
    scene = cf.Scene(*grid_shell(7))

    def displacements(kept):
        monkeypatch.setattr(eigen, "_KEPT", kept)
        monkeypatch.setattr("cosserat_fenicsx.statics.problem.PROBLEMS", ProblemPool())
        path = cf.solve(scene, [20.0], elements=1)
        return np.array([path.displacement(rod.end) for rod in scene.rods])

    expected, made, renewed = displacements(10**9), [], eigen.RepeatedFactors._renewed
    assert np.abs(expected).max() > 0.01
    monkeypatch.setattr(eigen.RepeatedFactors, "_renewed", lambda factors: made.append(1) or renewed(factors))
    np.testing.assert_allclose(displacements(100), expected, rtol=0, atol=1e-10)
    assert not made
    monkeypatch.setattr(elimination._Near, "apply", lambda near, pc, b, x: x.set(1.0))
    np.testing.assert_allclose(displacements(100), expected, rtol=0, atol=1e-10)
    assert made


@pytest.mark.serial  # ranks share points within rods, whose number differs
def test_a_finer_mesh_begins_with_the_factors_of_a_coarse_one(monkeypatch):
    """The equations where rods meet have one pattern on all meshes: one analysis, though a large problem on the coarse
    mesh ends before that on the finer one begins, and the path of separate ones."""
    scene, found, analysed, begin = cf.Scene(*grid_shell(7)), [], [], eigen.RepeatedInertia._begin
    monkeypatch.setattr("cosserat_fenicsx.statics.problem._LARGE", 0)
    monkeypatch.setattr(eigen, "_KEPT", 100)
    monkeypatch.setattr(eigen.RepeatedInertia, "_begin", lambda self: analysed.append(1) or begin(self))
    for shared in (eigen.inertia_of, eigen.RepeatedInertia):
        monkeypatch.setattr("cosserat_fenicsx.statics.problem.PROBLEMS", ProblemPool())
        monkeypatch.setattr(eigen, "_LAST", eigen._Last())
        monkeypatch.setattr(eigen, "inertia_of", shared)
        path = cf.solve(scene, [10.0, 20.0])
        assert (len(analysed) == 1) == (not found) and not path.negative_modes.any()
        found.append([path.displacement(rod.end) for rod in scene.rods])
        analysed.clear()
    np.testing.assert_allclose(*found, rtol=0, atol=1e-11)


def test_factors_of_an_earlier_matrix_serve(monkeypatch):
    """They precondition; a matrix that is too far from the earlier one is factorised, a singular one is found out."""
    monkeypatch.setattr(eigen, "_KEPT", 100)
    starts, columns, values, _ = sparse_system(0, 0.0)
    factors, b = eigen.RepeatedFactors(starts, columns), np.sin(np.arange(300.0))
    assert factors.factor(values)
    made = []
    monkeypatch.setattr(factors, "_renewed", lambda renewed=factors._renewed: made.append(1) or renewed())
    for change, renewals in ((0.0, 0), (1e-3, 0), (3.0, 1)):
        *_, values, dense = sparse_system(0, change)
        assert factors.factor(values)
        exact = np.linalg.solve(dense, b)
        for kept in (1e-5, 0.01):  # Newton's method corrects the first; the second is a step that hardly moves
            assert np.abs(factors.solve(b, corrected=True) - exact).max() < kept
        np.testing.assert_allclose(factors.solve(b), exact, rtol=0, atol=1e-10)
        assert len(made) == renewals
    values[starts[7] : starts[8]] = 0.0
    assert factors.factor(values) and np.isnan(factors.solve(b)).all()
    assert not factors.factor(values)
    *_, values, dense = sparse_system(0, 0.0)  # a singular matrix spoils none that follows
    assert factors.factor(values)
    np.testing.assert_allclose(factors.solve(b), np.linalg.solve(dense, b), rtol=0, atol=1e-10)
