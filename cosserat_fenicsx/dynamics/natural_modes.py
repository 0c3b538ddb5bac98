"""Natural frequencies and modes of small vibrations about a static state."""

import contextlib
import math

import numpy as np
from mpi4py import MPI
from scipy import sparse

from cosserat_fenicsx.algebra.packed import Packed
from cosserat_fenicsx.algebra.pencil import Pencil, constraint_rows, on_every_rank
from cosserat_fenicsx.checks import instance, number, tolerance, whole
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.models.rod_data import check_inertia, nodal_inertia
from cosserat_fenicsx.models.traits import traits_of
from cosserat_fenicsx.numerics import directors, lobatto_weights
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.modes import Modes
from cosserat_fenicsx.results.shapes import Equilibrium
from cosserat_fenicsx.scene.action import has_permanent
from cosserat_fenicsx.scene.describe import describe
from cosserat_fenicsx.scene.scene import Scene, check_magnitudes
from cosserat_fenicsx.scene.statical import without_mechanism
from cosserat_fenicsx.statics.circulatory import circulatory_part
from cosserat_fenicsx.statics.meshes import layers_of, until_two_meshes_agree
from cosserat_fenicsx.statics.path.follower import standing
from cosserat_fenicsx.statics.problem import solvers_of
from cosserat_fenicsx.statics.solve import check_arguments
from cosserat_fenicsx.statics.stability import shapes_of

_MOST_ELEMENTS = 128
_CORRECTIONS = 10  # Newton iterations after the added constraints of a mechanism are removed


def modes(
    scene: Scene,
    count: int = 1,
    *,
    load_factor: float = 0.0,
    tol: float = 1e-6,
    elements: int | None = None,
    degree: int = 4,
    comm: MPI.Comm | None = None,
    progress: bool | None = None,
) -> Modes:
    """Natural frequencies and shapes of small undamped vibrations about a static state.

    K x = omega^2 M x under the constraints of supports and joints, with K the second variation in (r, theta) and M the
    inertia of the sections. What depends on velocities (damping of rods, dashpots, drag, friction, walls that act in
    motions) is left out, and named in `Modes.left_out`. Where the loads have no potential (`Modes.conservative`) the
    symmetric part of K is used, which does not detect flutter.

    Args:
        scene: a `Scene`; every rod needs a mass and inertia. Without a load factor it may be free to move.
        count: number of modes, from the smallest square on.
        load_factor: eta of the state, a point of the path of load control from the unloaded reference. The reference
            of a mechanism, such as a rod that hangs on a hinge, must be its equilibrium position but for strains.
        tol: relative accuracy of the squares: elements are doubled until two meshes agree to it, unless `elements` is
            given.
        elements: elements per rod; fixes the mesh.
        degree: 1 to 4, of r and q.
        comm: MPI communicator; default all ranks. Every rank calls; each solves the whole eigenproblem.
        progress: True, False, or None to show it in runs of more than two seconds.

    Returns:
        Modes. It holds fewer than `count` where the mesh has fewer degrees of freedom.

    Raises:
        SceneError: an argument outside its range, or a rod without inertia.
        NotConverged: the load factor or the accuracy is not reached.
    """
    instance("modes", "scene", scene, Scene, "a Scene")
    check_inertia(scene)
    for action in scene.actions:
        if action.delayed is not None:
            raise SceneError(
                f"modes: {describe(action)}: expected no actions whose forces come from earlier motion: rods in "
                "its place, or the spectrum of a simulated motion, show the modes"
            )
    number("modes", "load_factor", load_factor, "a finite number", math.isfinite)
    whole("modes", "count", count)
    whole("modes", "elements", 1 if elements is None else elements)
    tolerance("modes", tol)
    if load_factor or has_permanent(scene):
        check_arguments(without_mechanism(scene), tol, elements, owner="modes")
        check_magnitudes(scene, load_factor)
    comm = communicator(comm)

    (squares, _, rounding, shapes, negative, state, conservative), error = until_two_meshes_agree(
        "modes", scene, lambda layout: _on_mesh(scene, layout, count, load_factor, degree, comm), tol,
        most=_MOST_ELEMENTS, elements=elements, degree=degree, advice="a larger tol or fewer modes", progress=progress,
        comm=comm, gains=True,
    )  # fmt: skip
    error = np.maximum(error, rounding)  # NaN stays
    if (error > tol).any():
        raise NotConverged(
            f"the accuracy tol = {tol:g} is out of reach: rounding alone may change the squares by {error.max():.2g} "
            "of themselves, since the rods are so slender. Ask for a larger tol."
        )
    return Modes(state, shapes, error, conservative, comm, squares, negative, _left_out(scene))


def _left_out(scene):
    """The parts of a scene that depend on velocities, in words."""
    damped = [rod for rod in scene.rods if rod.damping is not None and np.any(rod.damping.sizes)]
    acting = [x for x in scene.actions if x.touches or x.resists or traits_of(x, scene.rods).rates]
    return (*(f"Damping of {rod.name}" for rod in damped), *map(describe, acting))


def _on_mesh(scene, layout, count, load_factor, degree, comm):
    """The result on one mesh.

    Returns:
        Squares (n,), the lengths of boundary layers or None, relative rounding errors (n,), shapes (n, N, 6), the
        number of negative modes, the `Equilibrium`, and whether the loads have a potential.
    """
    loaded = load_factor or has_permanent(scene)
    with _loaded(scene, layout, load_factor, degree, comm) as (problem, stability):
        model, scales = problem.model, problem.model.scales
        negative = stability.count() if loaded else 0
        K, rows, held = _stiffness(problem)
        unit = max(float(rod.profile.range[1].mass) for rod in scene.rods)
        squares, vectors, rounding = Pencil(K, _mass(model, rows, K.shape[0], unit), held).lowest(count)
        if (squares == 0).any():  # `stability` counts these by the sign of their rounding; all below are known here
            negative = np.count_nonzero(squares < 0)
        shapes = shapes_of(vectors.T, squares, rows, scales.length)
        layers = layers_of(model) if loaded else None
        state, rq = Equilibrium.of(model, load_factor), model.snapshot()[0]
    rounding = np.where(squares == 0, 0.0, rounding / np.abs(np.where(squares == 0, 1.0, squares)))
    squares = squares * scales.force / (unit * scales.length**2)
    with circulatory_part(scene, layout, degree, comm) as circulatory:
        return squares, layers, rounding, shapes, negative, state, circulatory.vanishes(rq, load_factor)


@contextlib.contextmanager
def _loaded(scene, layout, load_factor, degree, comm):
    """Context manager that gives the problem, in equilibrium at a load factor, and its `NegativeModes`.

    A mechanism that its loads stabilise has no path from the unloaded state: its equilibrium is computed with added
    constraints (`without_mechanism`), then corrected without them.
    """
    loaded = load_factor or has_permanent(scene)
    held = without_mechanism(scene) if loaded else scene
    with solvers_of(held, layout, degree=degree, comm=comm) as (problem, newton, stability):
        if loaded:
            standing(problem, newton, stability, load_factor)
        if held is scene:
            yield problem, stability
            return
        # the initial guess of the problem without added constraints, on the same mesh
        rq, n = problem.model.snapshot()
    with solvers_of(scene, layout, degree=degree, comm=comm) as (problem, newton, stability):
        problem.end_beginning()
        problem.set_load_factor(load_factor)
        problem.begin_at(problem.model.unknowns_of(rq), n[..., :3], np.zeros(len(problem.multipliers())))
        newton.allow(_CORRECTIONS)
        solved = newton.solve()
        if not solved.converged:
            raise NotConverged(
                f"no equilibrium was found at the load factor {load_factor:g}: {solved.reason} next to the reference, "
                "where the scene is a mechanism"
            )
        yield problem, stability


def _stiffness(problem):
    """K (sparse), the row numbers of all nodes (N, 6), -1 where clamped, and the gradients (equations, size) of the
    constraints of supports and joints."""
    model = problem.model
    (variation,) = model.second_variations
    tied = variation.tied
    K = variation.numbering.matrix(variation.cell_dofs, tied, model.signature.connections.pattern)
    true = model.section.K
    model.stiffen(np.where(np.isfinite(true), true, model.bounded_K))  # stability counts bound finite ones as well
    Packed(variation.form, (), ()).add_to_matrix(K)
    model.stiffen(model.bounded_K)
    if problem.ties:
        of_ties = problem.ties.second_variation(variation.axes, problem.tie_load_factor)
        if model.comm.rank == 0:
            problem.ties.add_to_matrix(K, tied, of_ties)
    K.assemble()
    K = on_every_rank(K)
    gradients = problem.ties.gradients() if problem.ties else np.empty((0, *tied.shape))
    return (K + K.T) / 2, model.rows_of_nodes, constraint_rows(gradients, tied, K.shape[0])


def _mass(model, rows, size, unit):
    """M over `unit` (sparse, one diagonal 6 x 6 block per node), by Lobatto quadrature with the nodes as points."""
    scene, layout, scales, p = model.scene, model.layout, model.scales, model.signature.degree
    q = model.snapshot()[0][:, 3:]
    weights, sizes = lobatto_weights(model.nodes), layout.sizes(scene) / scales.length
    first = p * np.arange(sum(layout.counts)) + np.repeat(np.arange(len(layout.counts)), layout.counts)
    slots = first[:, None] + np.arange(p + 1)
    at_nodes = nodal_inertia(scene, layout, model.nodes)
    T = directors(q[slots.ravel()]).reshape(at_nodes.frames.shape) @ at_nodes.frames
    w = sizes[:, None] * weights / unit
    block = np.zeros((*slots.shape, 6, 6))
    block[..., [0, 1, 2], [0, 1, 2]] = (w * at_nodes.mass)[..., None]
    block[..., 3:, 3:] = np.einsum("...ik,...k,...jk->...ij", T, at_nodes.J * (w / scales.length**2)[..., None], T)
    lateral = at_nodes.lateral * np.sqrt(w)[..., None]
    if model.signature.eccentric:
        _off_axis(block, at_nodes, T @ at_nodes.frames.swapaxes(2, 3), w, scales.length)
    block[..., :3, :3] -= lateral[..., :, None] * lateral[..., None, :]
    of_node = rows[slots]
    i, j = (np.broadcast_to(x, block.shape).ravel() for x in (of_node[..., :, None], of_node[..., None, :]))
    free = (i >= 0) & (j >= 0)
    return sparse.csr_matrix((block.ravel()[free], (i[free], j[free])), shape=(size, size)).tobsr((6, 6))


def _off_axis(block, at_nodes, R, w, length):
    """Add the contribution of mass centres off the axis to the mass matrices of nodes, block (elements, nodes, 6, 6):
    z x rotation to their velocities; at_nodes: the `NodalInertia`; R: rotations of the nodes; w: quadrature weights."""
    z, more = np.einsum("...ij,...j->...i", R, at_nodes.offset) / length, R @ at_nodes.apart @ R.swapaxes(2, 3)
    mass, across = block[..., 0, 0][..., None, None], np.cross(np.eye(3), z[..., None, :])  # across @ v = z x v
    block[..., :3, 3:], block[..., 3:, :3] = -mass * across, mass * across
    block[..., 3:, 3:] += mass * (across.swapaxes(2, 3) @ across) + more * (w / length**2)[..., None, None]
