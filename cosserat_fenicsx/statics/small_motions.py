"""The matrices of small motions about an equilibrium or a steady rotation, and the gradients of their constraints;
whether loads have a potential, and where they have none, the skew-symmetric part of the second variation and the static
bifurcations, which are the real eigenvalues of an unsymmetric pencil.

lambda^2 M + lambda C + K, dimensionless, in displacements and inertial rotations of the nodes, in the numbering of the
second variation. About a steady rotation they are those in the rotating frame.
"""

import contextlib
from collections import namedtuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.algebra.building import Packed
from cosserat_fenicsx.algebra.pencil import constraint_rows, on_every_rank
from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.models.spatial import CirculatoryModel, ResistingModel
from cosserat_fenicsx.models.rod_data import nodal_inertia
from cosserat_fenicsx.models.signature import Signature
from cosserat_fenicsx.numerics import directors, gauss, lobatto_weights
from cosserat_fenicsx.results.contacts import first_contacts_at, shares_of

# Share of a first-order change of an eigenvalue that is assumed to remain as error: at most this, or this times the
# relative change.
_REMAINING, _SQUARED = 0.1, 100.0
# Rounding errors of an eigenvalue with such a change, a difference of large entries, over those without.
_OF_CHANGE = 8.0
# Error where such a change is not above rounding errors of the eigenvalue, over these: they, the change and its own.
_HIDING = 4.0
# Largest force, over EI/L^2, with which what resists velocities may act on the rods in a steady rotation.
_DRIVEN = 1e-6

# Places between two nodes, over their distance, where gaps are looked at; bisections of the place where one vanishes.
_SAMPLED, _BISECTIONS = (0.0, 0.25, 0.5, 0.75), 45


def stiffness(problem, bounds=1.0):
    """K (sparse), the row numbers of all nodes (N, 6), -1 where clamped, and the gradients (equations, size) of the
    constraints of supports and joints; bounds: factor of those in place of infinite stiffnesses."""
    model = problem.model
    (variation,) = model.second_variations
    tied = variation.tied
    K = variation.numbering.matrix(variation.cell_dofs, tied, model.signature.connections.pattern)
    true = model.section.K  # stability counts bound finite ones as well
    model.stiffen(np.where(np.isfinite(true), true, bounds * model.bounded_stiffness()))
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


def softness(problem, K):
    """The loss of K (sparse) by bounds in place of infinite stiffnesses, to first order in their inverse: they are in
    series with the others, so that twice the bound takes half of it. None where all stiffnesses are finite."""
    if np.isfinite(problem.model.section.K).all():
        return None
    return stiffness(problem, 2.0)[0] - K


#: Edges of the contact of rods with walls: lacking: what K lacks (sparse), where nodes beside an edge act with all of
#: their share of the length; unknown: what of that the state does not tell (sparse); places: for every rod those of its
#: edges over its length.
Edges = namedtuple("Edges", "lacking unknown places")


def edges_of_contact(model, state):
    """The `Edges` of an `Equilibrium`, where gaps vanish; None without an edge.

    In an element with an edge K has the stiffness of walls on the part that touches, by a Gauss rule there instead of
    at nodes. The state has the pressures of the nodes: their sum is off by the error of Lobatto's rule for a pressure
    that rises from the edge, q times its slope, and moves the edge by about q over the shorter of element and contact.
    """
    if not state.scene.has_walls:
        return None
    rule, p, at, blocks, places = state.rule, state.degree, [], [], [np.empty(0) for _ in state.scene.rods]
    of_nodes = rows_of_rods(model, state)
    samples = np.unique(np.concatenate([rule.nodes[:-1] + t * np.diff(rule.nodes) for t in _SAMPLED] + [[1.0]]))
    nodes, gauss_points = np.searchsorted(samples, rule.nodes), gauss(p + 1)
    for i, contact in first_contacts_at(state):
        breaks, rod = state.layout.breaks[i], state.scene.rods[i]
        sizes = np.diff(breaks)
        x = breaks[:-1, None] + sizes[:, None] * samples
        gap, stiff = (found.reshape(*x.shape, *found.shape[1:]) for found in contact(x.ravel()))
        cells, first = np.nonzero((gap[:, 1:] < 0) != (gap[:, :-1] < 0))
        low, high, begins = x[cells, first], x[cells, first + 1], gap[cells, first] >= 0
        for _ in range(_BISECTIONS if len(cells) else 0):
            middle = (low + high) / 2
            before = (contact(middle)[0] >= 0) == begins
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        places[i] = np.sort(np.append(places[i], high))
        ends = np.concatenate([[0.0], high, [1.0]])
        for cell in np.unique(cells):
            of_cell, h = cells == cell, sizes[cell] * rod.length
            cut = np.concatenate([[0.0], (high[of_cell] - breaks[cell]) / sizes[cell], [1.0]])
            inner = begins[of_cell][0] == (np.arange(len(cut) - 1) % 2)  # parts that touch
            y = (cut[:-1, None] + np.diff(cut)[:, None] * (gauss_points.points + 1) / 2)[inner].ravel()
            weights = (np.diff(cut)[:, None] * gauss_points.weights / 2)[inner].ravel()
            basis, unit = rule.basis(y), model.scales.force / model.scales.length
            lacks = np.einsum("g,ga,gb,gij->aibj", weights, basis, basis, contact(breaks[cell] + sizes[cell] * y)[1])
            touching = rule.lobatto * (gap[cell, nodes] < 0)
            lacks[np.arange(p + 1), :, np.arange(p + 1)] -= touching[:, None, None] * stiff[cell, nodes]
            edge = cut[1:-1]
            off = np.where(begins[of_cell], 1 - edge, edge)  # Lobatto's rule is symmetric
            q = np.abs(off**2 / 2 - np.maximum(off[:, None] - rule.nodes, 0.0) @ rule.lobatto)
            which = np.flatnonzero(of_cell)
            reach = np.where(begins[of_cell], ends[which + 2] - ends[which + 1], ends[which + 1] - ends[which])
            q, basis = q / np.minimum(1.0, reach / sizes[cell]), rule.basis(edge)
            unknown = np.einsum("g,ga,gb,gij->aibj", q, basis, basis, contact(high[of_cell])[1])
            size = 3 * (p + 1)
            blocks.append(np.array([x.reshape(size, size) * h / unit for x in (lacks, unknown)]))
            at.append(of_nodes[i][p * cell : p * cell + p + 1, :3].ravel())
    if not blocks:
        return None
    size = model.rows_of_nodes.max(initial=-1) + 1
    return Edges(*(of_blocks(x, np.array(at), size) for x in np.swapaxes(blocks, 0, 1)), places)


def switched(model, here, there):
    """What the stiffness of walls at nodes lacks `there` since other nodes touch than at another `Equilibrium`, `here`;
    None where the same ones do."""
    changes, at = [], []
    of_nodes = rows_of_rods(model, here)
    for (i, contact), (_, moved) in zip(first_contacts_at(here), first_contacts_at(there), strict=True):
        x = here.s(here.scene.rods[i]) / here.scene.rods[i].length
        (before, _), (after, stiff) = contact(x), moved(x)
        which = np.flatnonzero((before < 0) != (after < 0))
        size = np.where(before < 0, 1.0, -1.0) * shares_of(here, i)
        changes.append(size[which, None, None] * stiff[which] / (model.scales.force / model.scales.length))
        at.append(of_nodes[i][which, :3])
    if not sum(map(len, at)):
        return None
    return of_blocks(np.concatenate(changes), np.concatenate(at), model.rows_of_nodes.max() + 1)


def rows_of_rods(model, state):
    """[(nodes, 6) row numbers of the nodes of each rod]."""
    return np.split(model.rows_of_nodes, np.cumsum([len(state.s(rod)) for rod in state.scene.rods])[:-1])


def of_blocks(blocks, of_node, size):
    """A sparse matrix of blocks (..., n, n) in rows (..., n), -1 where clamped."""
    i, j = (np.broadcast_to(x, blocks.shape).ravel() for x in (of_node[..., :, None], of_node[..., None, :]))
    free = (i >= 0) & (j >= 0)
    return sparse.csr_matrix((blocks.ravel()[free], (i[free], j[free])), shape=(size, size))


def beside_edges(edges, M, C, values, vectors):
    """(n,) relative errors of eigenvalues by what the `Edges` leave unknown; arguments as of `corrected`."""
    if edges is None:
        return np.zeros(len(values))
    found, _ = corrected(edges.unknown, M, C, values, vectors, np.zeros(len(values)), True)
    return np.abs(found - values) / np.where(values == 0, 1.0, np.abs(values))


def corrected(softness, M, C, values, vectors, rounding, trusted):
    """Eigenvalues without `softness`, by which K is too small, to first order with left eigenvectors taken for right
    ones, unless that is within their relative rounding errors (n,); and these with what is left, or with what rounding
    may hide of the change. M, C: see the head of this file; C is None where `values` are squares of frequencies;
    values: (n,) dimensionless; vectors: (size, n). trusted: whether the stiffness is symmetric, so that the left
    eigenvectors are known."""
    if softness is None:
        return values, rounding
    left = vectors.conj()
    change, inertia = (np.einsum("in,in->n", left, A @ vectors) for A in (softness, M))
    if C is not None:
        change, inertia = -change, 2 * values * inertia + np.einsum("in,in->n", left, C @ vectors)
    change = np.where((values == 0) | (inertia == 0), 0.0, change / np.where(inertia == 0, 1.0, inertia))
    share = np.abs(change) / np.where(values == 0, 1.0, np.abs(values))
    known, left = share > rounding, share * (np.minimum(_REMAINING, _SQUARED * share) if trusted else 1.0)
    return np.where(known, values + change, values), np.where(known, _OF_CHANGE * rounding + left, _HIDING * rounding)


class Bodies:
    """The masses of the nodes of a spatial model at the state, by Lobatto quadrature with the nodes as points; unit: of
    mass per length, kg/m; size: of the matrices, which have one diagonal 6 x 6 block per node."""

    def __init__(self, model, unit):
        scene, layout, scales, p = model.scene, model.layout, model.scales, model.signature.degree
        q, self._rows = model.snapshot()[0][:, 3:], model.rows_of_nodes
        self.size = self._rows.max(initial=-1) + 1
        weights, sizes = lobatto_weights(model.nodes), layout.sizes(scene) / scales.length
        first = p * np.arange(sum(layout.counts)) + np.repeat(np.arange(len(layout.counts)), layout.counts)
        self._slots = slots = first[:, None] + np.arange(p + 1)
        at_nodes = nodal_inertia(scene, layout, model.nodes)
        R = directors(q[slots.ravel()]).reshape(at_nodes.frames.shape)
        w = sizes[:, None] * weights / unit
        T, of_arms = R @ at_nodes.frames, (w / scales.length**2)[..., None]
        self._mass = (w * at_nodes.mass)[..., None, None]
        self._J = np.einsum("...ik,...k,...jk->...ij", T, at_nodes.J * of_arms, T)
        self._arm = None
        if model.signature.eccentric:
            self._arm = hat(np.einsum("...ij,...j->...i", R, at_nodes.offset) / scales.length)
            self._J = self._J + R @ at_nodes.apart @ R.swapaxes(2, 3) * of_arms[..., None]
        lateral = at_nodes.lateral * np.sqrt(w)[..., None]
        self._lateral = lateral[..., :, None] * lateral[..., None, :]
        drags = [rod.damping.drag if rod.damping else 0.0 for rod in scene.rods]
        #: of the elements, 1/s
        self._drag = np.repeat(drags, layout.counts)[:, None, None, None]

    def mass(self):
        """M, a bsr_matrix."""
        return self._assembled(self._mass_blocks()).tobsr((6, 6))

    def gyroscopic(self, w):
        """G of a steady rotation w (3,), rad per unit of time."""
        of_spin = np.trace(self._J, axis1=-2, axis2=-1)[..., None, None] * hat(w) - 2 * hat(self._J @ w)
        return self._assembled(self._blocks(2 * self._mass * hat(w), of_spin))

    def dragged(self, w, time):
        """(C, K) of `Damping.drag`, which acts on the inertial velocities; time: the unit, s."""
        drag = self._drag * time
        C = self._assembled(drag * self._mass_blocks())
        return C, self._assembled(drag * self._blocks(self._mass * hat(w), self._J @ hat(w) - hat(self._J @ w)))

    def _mass_blocks(self):
        block = self._blocks(self._mass * np.eye(3), self._J)
        block[..., :3, :3] -= self._lateral
        return block

    def _blocks(self, of_centre, of_spin):
        """(elements, nodes, 6, 6) from matrices for the mass centre's u + rotation x arm, and for the rotation."""
        block = np.zeros((*self._slots.shape, 6, 6))
        block[..., :3, :3], block[..., 3:, 3:] = of_centre, of_spin
        if self._arm is not None:
            z = self._arm
            block[..., :3, 3:], block[..., 3:, :3] = -of_centre @ z, z @ of_centre
            block[..., 3:, 3:] -= z @ of_centre @ z
        return block

    def _assembled(self, block):
        return of_blocks(block, self._rows[self._slots], self.size)


def hat(a):
    """(..., 3, 3) the matrices of a x, (..., 3)."""
    return np.cross(np.eye(3), np.asarray(a)[..., None, :])


def resisting(scene, layout, degree, comm, rq, load_factor, time, bodies, rotation=None):
    """(C, K): what resists velocities, and what it adds to K in the frame of a rotation (w (3,), rad per unit of time;
    positions (N, 3) from a point of its axis, dimensionless) or None; rq: (N, 7) state of all nodes, dimensionless;
    time: the unit, s. A SceneError where it drives the rods in a steady rotation, whose equilibrium is another one
    then."""
    signature = Signature.of(scene, layout, formulation="mixed", degree=degree)
    with PROBLEMS.lend(("resisting", signature), comm, lambda: ResistingModel(comm, signature), NotConverged) as model:
        model.load(scene, layout, time)
        part = CirculatoryPart(model)
        C = on_every_rank(part.matrix(rq, load_factor))
        if rotation is not None:
            for function in filter(None, model.viscosity):  # no rotation strains a rod
                function.x.array[:] = 0.0
            acting, rows = on_every_rank(part.matrix(rq, load_factor)), model.rows_of_nodes
    w, from_axis = rotation or (np.zeros(3), None)
    dragged, K = bodies.dragged(w, time)
    if rotation is None:
        return C + dragged, K
    rigid, free = np.zeros(bodies.size), rows >= 0
    rigid[rows[free]] = np.concatenate([np.cross(w, from_axis), np.tile(w, (len(rows), 1))], axis=1)[free]
    driven = abs((acting + dragged) @ rigid).max(initial=0.0)
    if driven > _DRIVEN:
        raise SceneError(
            f"modes: what resists velocities acts on the rods in the steady rotation, by {driven:.1g} of their "
            "stiffness EI/L^2 at a node, and `Centrifugal` has no drive: expected Damping.drag, dashpots and drag on "
            "the axis alone, or Damping.time, which resists strains"
        )
    moved = (rows[:, :3] >= 0).all(axis=1)
    i, j = (np.broadcast_to(x, (moved.sum(), 3, 3)).ravel() for x in (rows[moved, :3, None], rows[moved, None, :3]))
    turned = sparse.csr_matrix((np.tile(hat(w).ravel(), moved.sum()), (i, j)), shape=acting.shape)
    return C + dragged, K + acting @ turned


# Rounding error of d omega over the terms that cancel in it.
_ROUNDING = 1e-10


@contextlib.contextmanager
def circulatory_part(scene, layout, degree, comm):
    """Context manager that gives the `CirculatoryPart` of a scene on a mesh; collective over the communicator."""
    signature = Signature.of(scene, layout, formulation="mixed", degree=degree)
    key = ("circulatory", signature)
    with PROBLEMS.lend(key, comm, lambda: CirculatoryModel(comm, signature), NotConverged) as model:
        model.load(scene, layout)
        yield CirculatoryPart(model)


def conservative_along(path):
    """Whether the loads have a potential in the neighbourhood of every point of a path; each rank computes it alone."""
    if any(load.rough for load in path.scene.actions):
        return False
    with circulatory_part(path.scene, path.layout, path.degree, MPI.COMM_SELF) as part:
        return all(part.vanishes(record.rq, record.load_factor) for record in path._records)


class CirculatoryPart:
    """Exterior derivative d omega of the virtual work omega of a scene's loads, by a loaded `CirculatoryModel`;
    matrices have the numbering of the spatial model's second variation."""

    def __init__(self, model):
        self._model = model
        (self._variation,) = model.second_variations
        self._form = self._variation.form and Packed(self._variation.form, (), ())

    def skew(self, rq, load_factor):
        """The skew-symmetric part of the second variation, a PETSc matrix, dimensionless; rq: (N, 7) of all nodes."""
        skew = self.matrix(rq, load_factor)
        skew.axpy(-1.0, skew.copy().transpose(), PETSc.Mat.Structure.DIFFERENT)
        skew.scale(-0.5)
        return skew

    def matrix(self, rq, load_factor):
        """The matrix of the bilinear form h of `models.circulatory`: d omega(w, psi) = h(w, psi) - h(psi, w)."""
        model, variation = self._model, self._variation
        model.take(rq, load_factor)
        matrix = variation.numbering.matrix(variation.cell_dofs, variation.tied, model.signature.connections.pattern)
        if self._form:
            self._form.refresh()
            self._form.add_to_matrix(matrix)
        matrix.assemble()
        return matrix

    def vanishes(self, rq, load_factor):
        """Whether the loads have a potential in the neighbourhood of a state, for all motions that the supports allow;
        False for loads that depend on the history of the motion."""
        if self._model.remembers:
            return False
        if not self._form:
            return True
        h, tied = on_every_rank(self.matrix(rq, load_factor)), self._variation.tied
        total = h.shape[0]
        held = sparse.csr_matrix(constraint_rows(self._model.held(rq, load_factor), tied, total))
        solve = sparse.csr_matrix(np.linalg.pinv((held @ held.T).toarray(), rcond=_ROUNDING))
        allowed = sparse.identity(total) - held.T @ solve @ held
        return bool(abs(allowed @ (h - h.T) @ allowed).max() <= _ROUNDING * abs(h).max())


# Eigenvalues computed: the first number times the requested count, plus the second; complex ones and those of the
# opposite load are discarded.
_PER_REQUESTED, _EXTRA = 4, 12


def static_bifurcations(slack, K, count):
    """Changes mu of the load factor, from the state, at which the linearised second variation K - mu slack is singular:
    (1/mu (n,), descending; null vectors as PETSc vectors), n <= count. Both K and slack, its decrease per unit of load
    factor, are pairs (symmetric part, skew-symmetric part) of PETSc matrices with the same numbering."""
    A, B = (symmetric.copy() for symmetric, _ in (slack, K))
    for total, (_, skew) in ((A, slack), (B, K)):
        total.axpy(1.0, skew, PETSc.Mat.Structure.DIFFERENT)
    values, vectors = eigen.real_of_pencil(A, B, _PER_REQUESTED * count + _EXTRA)
    return values[:count], vectors[:count]
