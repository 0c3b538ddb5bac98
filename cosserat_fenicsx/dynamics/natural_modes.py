"""Natural frequencies and modes about a static state, by SLEPc."""

import math
import numbers
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI
from scipy import sparse

from cosserat_fenicsx.algebra.packed import Packed
from cosserat_fenicsx.algebra.pencil import Pencil
from cosserat_fenicsx.checks import instance, number, refuse
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.models.compiled import lobatto_weights
from cosserat_fenicsx.models.rod_data import check_inertia, nodal_inertia
from cosserat_fenicsx.quaternions import directors
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.statical import without_mechanism
from cosserat_fenicsx.statics.continuation import StepControl
from cosserat_fenicsx.statics.first_mesh import FIRST_ELEMENTS
from cosserat_fenicsx.statics.follow import Follower
from cosserat_fenicsx.statics.refinement import until_two_meshes_agree
from cosserat_fenicsx.statics.solve import check_arguments
from cosserat_fenicsx.statics.solvers import solvers_of

_MOST_ELEMENTS = 128
# Newton iterations from an equilibrium that is held fast to the same one that is not.
_CORRECTIONS = 10
# A mode that displaces less than this, over the longest rod's length times its largest turn, is one of twist.
_TWIST = 1e-6


@dataclass(frozen=True, eq=False)
class Modes(OnNodes):
    """Result of `modes`.

    Attributes:
        scene: the scene.
        squares: (n,) omega^2, rad^2/s^2, ascending; below zero the state is unstable; zero for free rigid motions.
        error: (n,) estimated relative error of the squares; NaN where the mesh was given.
        shapes: (n, N, 6) displacements (m) and rotations (rad), inertial, of all nodes of all rods in the scene's
            order; the largest displacement has length 1, or the largest turn times the longest rod's length, where
            nothing is displaced.
        negative_modes: negative squares of the second variation at that state, as `Path.negative_modes`.
        elements: of each rod; degree: of the elements.
    """

    scene: object = field(repr=False)
    squares: np.ndarray
    error: np.ndarray
    shapes: np.ndarray = field(repr=False)
    negative_modes: int
    elements: tuple
    degree: int

    @property
    def frequencies(self):
        """(n,) Hz; 0 for what is unstable."""
        return np.sqrt(np.maximum(self.squares, 0.0)) / (2 * math.pi)

    @property
    def growth(self):
        """(n,) 1/s: what is unstable grows as exp(growth t); 0 for what is stable."""
        return np.sqrt(np.maximum(-self.squares, 0.0))

    def mode(self, k, rod=None):
        """(nodes, 3) displacements of the k-th mode at the nodes of a rod (default the first)."""
        return self.shapes[k, self._rows(rod)[1], :3]

    def turns(self, k, rod=None):
        """(nodes, 3) small rotations of the k-th mode at the nodes of a rod (default the first), rad."""
        return self.shapes[k, self._rows(rod)[1], 3:]


def modes(scene, count=1, *, load_factor=0.0, tol=1e-6, elements=None, degree=4, comm=None):
    """Natural frequencies and shapes of small undamped vibrations about a static state.

    Of the second variation in (r, theta) and the inertia of the sections: K x = omega^2 M x, subject to what supports
    and joints hold. Where moments or follower loads have no potential the symmetric part of K counts, which does not see
    flutter.

    Args:
        scene: a `Scene`; every rod needs a mass and inertia. Without a load factor it may be free to move.
        count: how many, from the smallest square on.
        load_factor: eta of the state, a point of the path of load control from the unloaded reference. A mechanism must be
            drawn where its loads keep it, but for strains, such as a rod that hangs on a hinge.
        tol: relative accuracy of the squares: elements are doubled until two meshes agree to it, unless `elements` is
            given.
        elements: elements per rod; fixes the mesh.
        degree: 1 to 4.
        comm: MPI communicator; default all ranks. Every rank calls; each solves the whole eigenproblem.

    Returns:
        Modes. It holds fewer than `count` where the mesh has no more.

    Raises:
        SceneError: an argument outside its range, or a rod without inertia.
        NotConverged: the load factor is not reached, or the accuracy is not met.
    """
    instance("modes", "scene", scene, Scene, "a Scene")
    check_inertia(scene)
    number("modes", "load_factor", load_factor, "a finite number", math.isfinite)
    for name, value in (("count", count), ("elements", 1 if elements is None else elements)):
        if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < 1:
            refuse("modes", name, value, "a whole number above zero")
    number("modes", "tol", tol, "a number from 1e-12 to below 1", lambda x: 1e-12 <= x < 1)
    if load_factor:
        check_arguments(without_mechanism(scene), tol, elements)
    comm = comm or MPI.COMM_WORLD

    def apart(fine, coarse):
        return np.abs(fine - coarse) / np.where(fine == 0, np.inf, np.abs(fine))

    (squares, shapes, negative), error, layout = until_two_meshes_agree(
        scene,
        lambda layout: _on_mesh(scene, layout, count, load_factor, degree, comm),
        apart,
        tol,
        first=FIRST_ELEMENTS,
        most=_MOST_ELEMENTS,
        elements=elements,
        degree=degree,
        advice="a larger tol or fewer modes",
    )
    return Modes(scene, squares, error, shapes, negative, layout.counts, degree)


def _on_mesh(scene, layout, count, load_factor, degree, comm):
    """Squares (n,), shapes (n, N, 6) and the number of negative modes on one mesh."""
    problem, stability = _loaded(scene, layout, load_factor, degree, comm)
    negative = stability.count() if load_factor else 0
    K, rows, held = _stiffness(problem)
    unit = max(float(rod.profile.range[1].mass) for rod in scene.rods)
    M = _mass(problem.model, rows, K.shape[0], unit)
    squares, vectors = Pencil(K, M, held).lowest(count)
    if (squares == 0).any():  # those below are known then, and rounding has given these a sign
        negative = np.count_nonzero(squares < 0)
    scales = problem.model.scales
    shapes = np.array([_shape(vector, rows) for vector in vectors.T]).reshape(len(squares), -1, 6)
    shapes[:, :, 3:] /= scales.length
    return squares * scales.force / (unit * scales.length**2), shapes, negative


def _loaded(scene, layout, load_factor, degree, comm):
    """The problem, in equilibrium at a load factor, and its stability.

    A mechanism that its loads keep in place has no path from the unloaded state: its equilibrium is the one where it is held
    fast, from where Newton's method goes on without.
    """
    held = without_mechanism(scene) if load_factor else scene
    problem, newton, stability = solvers_of(held, layout, degree=degree, comm=comm)
    if load_factor:
        follower = Follower(problem, newton, stability, StepControl(), control="load")
        if not follower.to(load_factor, abs(load_factor)):
            _give_up(load_factor, follower.track.failure)
    if held is not scene:
        rq, n = problem.model.snapshot()  # on the same mesh
        problem, newton, stability = solvers_of(scene, layout, degree=degree, comm=comm)
        problem.set_load_factor(load_factor)
        problem.begin_at(problem.model.unknowns_of(rq), n[..., :3], np.zeros(len(problem.multipliers())))
        newton.allow(_CORRECTIONS)
        solved = newton.solve()
        if not solved.converged:
            _give_up(load_factor, f"{solved.reason} next to the reference, where the scene is a mechanism")
    return problem, stability


def _give_up(load_factor, why):
    raise NotConverged(f"no equilibrium was found at the load factor {load_factor:g}: {why}")


def _shape(vector, rows):
    """(N, 6) motion of the nodes, scaled as `Modes.shapes`; the first node that moves farthest does so along a positive axis."""
    shape = np.where(rows >= 0, vector[rows], 0.0)
    moved, turned = shape[:, :3], shape[:, 3:]
    part = moved if np.abs(moved).max() > _TWIST * np.abs(turned).max() else turned
    sizes = np.linalg.norm(part, axis=1)
    farthest = part[np.flatnonzero(sizes >= (1 - 1e-6) * sizes.max())[0]]
    return shape * (np.sign(farthest[np.argmax(np.abs(farthest))]) / sizes.max())


def _stiffness(problem):
    """K (sparse), the numbers of all nodes in it (N, 6), -1 where clamped, and the gradients of what supports and
    joints hold, (equations, size)."""
    model = problem.model
    (variation,) = model.second_variations
    tied = variation.tied
    K = variation.numbering.matrix(variation.cell_dofs, tied[tied >= 0])
    stiff, true = model.data.K_stiff.x.array, model.data.K.x.array
    kept = stiff.copy()
    stiff[true > 0] = true[true > 0]  # bounded otherwise, which is enough for signs
    Packed(variation.form, ()).add_to_matrix(K)
    stiff[:] = kept
    if problem.ties:
        problem.ties.add_second_variation(K, tied, variation.axes, problem.load_factor, held=False)
    K.assemble()
    size = K.getSize()[0]
    parts = model.comm.allgather(K.getValuesCSR())
    K = sparse.vstack([sparse.csr_matrix((v, j, i), shape=(len(i) - 1, size)) for i, j, v in parts])
    held = np.zeros((0, size + 1))
    if problem.ties:
        gradients = problem.ties.gradients()
        held = np.zeros((len(gradients), size + 1))  # what is clamped goes to the last column
        held[:, tied.ravel()] = gradients.reshape(len(gradients), -1)
    return (K + K.T) / 2, model.rows_of_nodes, held[:, :size]


def _mass(model, rows, size, unit):
    """M (sparse, in blocks): one for each node, by the rule that has the nodes as points."""
    scene, layout, scales, p = model.scene, model.layout, model.scales, model.shape.degree
    q = model.snapshot()[0][:, 3:]
    first = 0
    weights, sizes = lobatto_weights(model.nodes), layout.sizes(scene) / scales.length
    slots = []
    for cells in layout.counts:
        slots.append(first + p * np.arange(cells)[:, None] + np.arange(p + 1))
        first = slots[-1][-1, -1] + 1
    slots = np.concatenate(slots)
    mass, J, frames = nodal_inertia(scene, layout, model.nodes)
    T = directors(q[slots.ravel()]).reshape(frames.shape) @ frames
    w = sizes[:, None] * weights / unit
    block = np.zeros((*slots.shape, 6, 6))
    block[..., [0, 1, 2], [0, 1, 2]] = (w * mass)[..., None]
    block[..., 3:, 3:] = np.einsum("...ik,...k,...jk->...ij", T, J * (w / scales.length**2)[..., None], T)
    of_node = rows[slots]
    i, j = (np.broadcast_to(x, block.shape).ravel() for x in (of_node[..., :, None], of_node[..., None, :]))
    free = (i >= 0) & (j >= 0)
    return sparse.csr_matrix((block.ravel()[free], (i[free], j[free])), shape=(size, size)).tobsr((6, 6))
