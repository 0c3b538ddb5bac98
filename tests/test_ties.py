"""Derivatives of the constraint equations of supports and joints against finite differences."""

import numpy as np
import pytest

from cosserat_fenicsx.models.ties import Ties
from cosserat_fenicsx.scene.ties import AngleTie, PositionTie, TurnTie

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
    known, multipliers = Ties(ties, NODES, rng.normal(size=(3, 3)), 2.0), rng.normal(size=len(ties))
    gradient, tangent = known.on_nodes(known.evaluate(rq, ETA)[1]), known.change(rq, ETA, multipliers)
    for node in range(3):
        for direction in range(6):
            (c1, g1), (c0, g0) = (known.evaluate(moved(rq, node, direction, sign * STEP), ETA) for sign in (1, -1))
            np.testing.assert_allclose((c1 - c0) / (2 * STEP), gradient[:, node, direction], atol=1e-8)
            reactions = known.reactions(g1 - g0, multipliers) / (2 * STEP)
            np.testing.assert_allclose(reactions, tangent[:, :, node, direction], atol=1e-8)
