"""Derivatives of the constraint equations of supports and joints against finite differences."""

import numpy as np
import pytest
from dense import tangent_of_ties
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics.simulate import solvers_of as moving_solvers
from cosserat_fenicsx.models.connections import TiePattern, Ties
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.scene.supports import AngleTie, PositionTie, TurnTie
from cosserat_fenicsx.statics.problem import solvers_of as static_solvers

pytestmark = pytest.mark.serial
ETA, STEP = 0.4, 1e-6
NODES = [(0, 1), (0, -1), (0, 1), (2, -1), (2, -1), (0, -1), (1, 2)]


def moved(rq, node, direction, amount):
    """(r, q) after a small displacement (directions 0 to 2) or inertial rotation (3 to 5) of one node."""
    rq, change = rq.copy(), np.zeros(3)
    change[direction % 3] = amount
    if direction < 3:
        rq[node, :3] += change
        return rq
    half, (a, v) = np.linalg.norm(change) / 2, (rq[node, 3], rq[node, 4:])
    c, s = np.cos(half), change / 2
    rq[node, 3:] = np.append(c * a - s @ v, c * v + a * s + np.cross(s, v))
    return rq


def test_gradient_and_tangent():
    rng = np.random.default_rng(7)

    def vector():
        return tuple(rng.normal(size=3))

    q = rng.normal(size=(3, 4))
    rq = np.hstack([rng.normal(size=(3, 3)), q / np.linalg.norm(q, axis=1, keepdims=True)])
    ties = [
        PositionTie(0, 1, vector(), 0.3), PositionTie(0, None, vector(), 0.7), AngleTie(0, 1, vector(), vector()),
        AngleTie(2, None, vector(), vector()), TurnTie(2, None, vector(), vector()),
        TurnTie(0, None, vector(), (0, 0, 0)),
        AngleTie(1, 2, vector(), vector()),
    ]  # fmt: skip
    known, multipliers = Ties(ties, TiePattern(NODES, 3), rng.normal(size=(3, 3)), 2.0), rng.normal(size=len(ties))
    gradient = known.pattern.on_nodes(known.evaluate(rq, ETA)[1])
    tangent = known.pattern.full(known.change(rq, ETA, multipliers)).reshape(3, 6, 3, 6)
    for node in range(3):
        for direction in range(6):
            (c1, g1), (c0, g0) = (known.evaluate(moved(rq, node, direction, sign * STEP), ETA) for sign in (1, -1))
            np.testing.assert_allclose((c1 - c0) / (2 * STEP), gradient[:, node, direction], atol=1e-8)
            reactions = known.reactions(g1 - g0, multipliers) / (2 * STEP)
            np.testing.assert_allclose(reactions, tangent[:, :, node, direction], atol=1e-8)


SECTION = cf.Stiffness((1e4, 1e4), 1e4, (500.0, 500.0), 500.0, mass=1.0, inertia=(10.0, 10.0, 20.0))


def held_twice():
    """Two rods with a hinge between them, moved at one end, on a roller at the other."""
    a, b = cf.Rod(cf.Line((0, 0, 0), (5, 0, 0)), SECTION, name="a"), cf.Rod(cf.Line((5, 0, 0), (9, 3, 0)), SECTION)
    moved = cf.Prescribed(a.start, displacement=(0.1, 0.2, 0.0))
    return cf.Scene([a, b], [moved, cf.Roller(b.end, (0, 1, 0))], [], joints=[cf.Joint(a.end, b.start, (0, 0, 1))])


def solvers_of(kind, model):
    """The solvers of a static formulation or of a scheme for motion."""
    scene = held_twice()
    layout = Layout.of(scene, 2)
    if kind in ("mixed", "multiplier"):
        return static_solvers(scene, layout, formulation=kind, degree=2, model=model)
    return moving_solvers(scene, layout, 2, kind, 1.0, MPI.COMM_WORLD, model)


@pytest.mark.parametrize(
    ("kind", "model"),
    [
        ("mixed", "spatial"), ("mixed", "planar"), ("multiplier", "spatial"), ("momentum", "spatial"),
        ("momentum", "planar"), ("generalised-alpha", "spatial"),
    ],
)  # fmt: skip
def test_blocks_of_a_problem(kind, model):
    """The derivatives in the rows of a solver, of statics and of a step, are those of the residual."""
    rng = np.random.default_rng(3)
    with solvers_of(kind, model) as (problem, *_):
        rows, model = problem.ties, problem.model
        problem.set_state(problem.x)
        count, added = model.tied_at_rest.size, list(model.signature.connections.equations)

        def see(y):
            multipliers = np.zeros(len(rows.seen[1]))
            multipliers[added] = y[count:]
            rows.seen = y[:count].reshape(model.tied_at_rest.shape), multipliers
            rows._forget()

        def residual(y):
            see(y)
            return np.concatenate(rows.residual_blocks(ETA))

        def random(size):
            return np.append(model.tied_at_rest, np.zeros(len(added))) + size * rng.normal(size=count + len(added))

        if hasattr(rows, "begin"):
            see(random(0.05))
            rows.begin(model.ties)
        y = random(0.2)
        see(y)
        of_nodes, reactions, equations = tangent_of_ties(rows, ETA)
        J = np.block([[of_nodes, reactions], [equations, np.zeros((len(added), len(added)))]])
        for j, column in enumerate(np.eye(len(y))):
            change = (residual(y + STEP * column) - residual(y - STEP * column)) / (2 * STEP)
            np.testing.assert_allclose(change, J[:, j], atol=1e-8)
