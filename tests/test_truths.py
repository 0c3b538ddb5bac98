"""The reference solutions of the tests (bvp.py, random_scenes.py)
against closed forms, published numbers and the energy."""

import json
import sys
from pathlib import Path

import bvp
import numpy as np
import pytest
from random_scenes import draw
from strong_form import matrix, shoot

pytestmark = [pytest.mark.serial, pytest.mark.once]
STRAIGHT = np.eye(3)


def straight(s):
    return np.broadcast_to(STRAIGHT, (len(s), 3, 3))


def column(J, force, K=(np.inf, np.inf, np.inf), **loads):
    return bvp.Problem(2.0, straight, K, J, np.array(force) / 4.0, **loads)


@pytest.mark.parametrize("load, w, u", [
    (1, 0.3017207738, 0.0564332363), (5, 0.7137915236, 0.3876283607), (10, 0.8106090249, 0.5549955978),
])  # fmt: skip
def test_elastica(load, w, u):
    """Mattiasson, Int. J. Numer. Methods Eng. 17 (1981) 145."""
    found = bvp.equilibrium(column((1.0, 1.0, 1.0), (load, 0, 0)))
    np.testing.assert_allclose(found(2.0)["r"][:, 0] / 2, [w, 0, 1 - u], atol=1e-9)
    assert found.verdict == "connected"


def test_a_circle_is_bent_straight_and_a_twisted_strip_untwisted():
    u = np.array([0.9, 0.0, -2.0])
    size = np.linalg.norm(u)

    def frame(s):
        k = np.cross(np.eye(3), u / size)
        s = s[:, None, None]
        return np.eye(3) + np.sin(s * size) * k + (1 - np.cos(s * size)) * k @ k

    problem = bvp.Problem(3.0, frame, (1e3, 1e3, 1e3), (2.0, 5.0, 1.0), moment=-np.array([2.0, 5.0, 1.0]) * u)
    found = bvp.equilibrium(problem)(np.linspace(0, 3, 7))
    np.testing.assert_allclose(found["r"], np.outer([0, 0, 1], np.linspace(0, 3, 7)), atol=1e-9)


def test_straight_rods_are_those_of_the_other_truth():
    K, J, f = (300.0, 50.0, 200.0), (1.0, 3.0, 0.5), (0.1, -0.2, 0.3)
    F, M, arm = (0.6, -0.8, 0.5), (0.3, 0.2, 0.4), (0.1, 0.2)
    turned = matrix(np.array([0.5, 0.1, -0.7, 0.3]))
    other = shoot(1.3, turned, K, J, f, [(1.3, np.array(F), np.array(M), arm)])
    problem = bvp.Problem(1.3, lambda s: np.broadcast_to(turned, (len(s), 3, 3)), K, J, F, M, arm, f)
    found = bvp.equilibrium(problem)
    for s in (0.5, 1.3):
        for name, values in found(s).items():
            np.testing.assert_allclose(values[:, 0], other(s)[name], atol=1e-9)


def test_line_moments_and_stiffness_that_varies():
    """A torque per length with GJ = 1/(1 + s), and a tension with EA =
    40/(1 + 3 s): twist and stretch in closed form."""

    def J(s):
        return np.array([1 + 0 * s, 2 + 0 * s, 1 / (1 + s)]).T

    def K(s):
        return np.array([30 + 0 * s, 30 + 0 * s, 40 / (1 + 3 * s)]).T

    problem = bvp.Problem(2.0, straight, K, J, force=(0, 0, 0.8), line_moment=(0, 0, 0.3))
    found = bvp.equilibrium(problem)
    s = np.array([0.5, 2.0])
    twist = 0.3 * (2 * s + s**2 / 2 - s**3 / 3)  # of 0.3 (2 - s)(1 + s)
    np.testing.assert_allclose(found(s)["q"][3], np.sin(twist / 2), atol=1e-12)
    np.testing.assert_allclose(found(s)["r"][2], s + 0.8 / 40 * (s + 1.5 * s**2), atol=1e-12)
    assert found.index is None


@pytest.mark.parametrize("J, critical, modes, shape", [
    ((1.0, 3.0, 0.8), np.pi**2 / 4, 1, "end"),
    ((1.0, 1.0, 0.8), np.pi**2 / 4, 2, "end"),
    ((1.0, 3.0, 0.8), 9 * np.pi**2 / 4, 3, "end"),
    ((1.0, 3.0, 0.8), 7.8373474, 1, "weight"),
    ((1e5, 1.0, 0.7), 4.0126 * np.sqrt(0.7), 1, "sideways"),
])  # fmt: skip
def test_negative_modes_begin_at_the_critical_loads(J, critical, modes, shape):
    """Euler, Greenhill, and lateral buckling (Timoshenko & Gere)."""
    for load, expected in ((0.9998 * critical, None), (1.0002 * critical, modes)):
        if shape == "end":
            problem, bending = column(J, (0, 0, -load)), 0.0
        elif shape == "weight":
            problem, bending = column(J, (0, 0, 0), line_force=(0, 0, -load / 8)), 0.0
        else:
            problem, bending = column(J, (0, load, 0)), -load
        found = bvp.index(problem, np.array([bending, 0, 0, 1.0]))
        assert found == expected if expected else found < modes


def energy(problem, x, q, first):
    """Energy of rotations q(x) (n, 4), r eliminated, by central
    differences and the trapezoidal rule, without the strong form."""
    T = bvp.matrix(q.T) @ first
    h = (x[1] - x[0]) * problem.length

    def curvature(T):
        W = np.swapaxes(T[1:] + T[:-1], 1, 2) @ (T[1:] - T[:-1]) / (2 * h)
        return np.array([W[:, 2, 1] - W[:, 1, 2], W[:, 0, 2] - W[:, 2, 0], W[:, 1, 0] - W[:, 0, 1]]) / 2

    k = curvature(T) - curvature(first)
    n = np.array(problem.force) + np.outer((1 - x) * problem.length, problem.line_force)
    N = np.einsum("sji,sj->is", T, n)
    work = N[2] + (N**2 / np.array(problem.K)[:, None]).sum(axis=0) / 2
    return 0.5 * h * (np.array(problem.J) @ k**2).sum() - h * (work.sum() - (work[0] + work[-1]) / 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["random", "unstable"])
def test_the_energy_is_stationary_and_its_negative_modes_are_counted(name):
    if name == "random":
        problem = next(drawn for drawn in map(draw, range(4, 99, 5)) if not any(drawn.moment)).problem()
        found = bvp.equilibrium(problem)
    else:  # the nearly straight, unstable state of a column that is pressed a little off its axis
        problem = column((1.0, 1.6, 0.8), (0.04, 0.03, -14.0), K=(400.0, 300.0, 1000.0))
        stable = bvp.equilibrium(problem)
        found = bvp.at(problem, np.zeros(3))
        assert (stable.index, found.index, found.verdict) == (0, 2, "near a clamp moment")
    L, EI = problem.length, problem.units["EI"]
    x = np.linspace(0, 1, 401)
    q, first = found(x * L)["q"].T, problem.frame(x * L)
    shapes = [np.outer(np.sin((k + 0.5) * np.pi * x), e) for k in range(5) for e in np.eye(3)]

    def moved(a):
        """The energy, after a rotation by the sum of a_k shapes."""
        theta = sum((size * shapes[k] for k, size in a), np.zeros((len(x), 3)))
        turn = np.linalg.norm(theta, axis=1)[:, None]
        p = np.hstack([np.cos(turn / 2), np.sinc(turn / 2 / np.pi) * theta / 2])
        w = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
        return energy(problem, x, np.c_[p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(axis=1), w], first) * L / EI

    e, count = 1e-3, len(shapes)
    slope = np.array([moved([(k, e)]) - moved([(k, -e)]) for k in range(count)]) / (2 * e)
    corners = [(a, b) for a in (e, -e) for b in (e, -e)]
    hessian = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            hessian[i, j] = sum(a * b * moved([(i, a), (j, b)]) for a, b in corners) / (4 * e**4)
            hessian[j, i] = hessian[i, j]
    assert np.abs(slope).max() < 1e-3 * np.abs(hessian).max()
    assert (np.linalg.eigvalsh(hessian) < 0).sum() == found.index


@pytest.mark.slow
def test_what_is_not_reached_is_refused():
    problem = column((1.0, 1.0, 1.0), (4, 0, 0))
    with pytest.raises(bvp.NoTruth, match="stopped at load factor 0"):
        bvp.follow(problem, most=3)
    with pytest.raises(bvp.NoTruth, match="did not converge"):
        bvp.at(problem, (30.0, -20.0, 10.0))
    with pytest.raises(bvp.NoTruth, match="differ by|maximum number"):
        bvp.at(problem, bvp.equilibrium(problem).clamp_moment, tol=1e-13, nodes=1000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_are_what_they_say(seed):
    drawn = draw(seed)
    s = np.linspace(0, drawn.length, 6)
    h = 1e-5 * drawn.length
    tangent = (drawn.rest(s + h) - drawn.rest(s - h)) / (2 * h)
    np.testing.assert_allclose(tangent.T, drawn.rest_frame(s)[:, :, 2], atol=1e-7)
    found = bvp.equilibrium(drawn.problem())
    assert found.accuracy < 1e-10 and found.folds == 0
    assert 20 <= drawn.slenderness <= 3e4 and max(drawn.J[:2]) <= 4 * min(drawn.J[:2])
    assert draw(seed) == drawn


@pytest.mark.parametrize("name", ["critical_loads", "follower_force", "hinged_frame"])
def test_reference_numbers_come_from_their_script(name, monkeypatch):
    folder = Path(__file__).parent / "reference"
    monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
    import make_statics

    def numbers(entry):
        if isinstance(entry, dict):
            return [x for key, value in sorted(entry.items()) if key != "checks" for x in numbers(value)]
        return [x for value in entry for x in numbers(value)] if isinstance(entry, list) else [entry]

    made = numbers(getattr(make_statics, name)())
    kept = numbers(json.loads((folder / "statics.json").read_text(encoding="utf-8"))[name])
    assert made == [pytest.approx(x, rel=1e-9, abs=1e-9) if isinstance(x, float) else x for x in kept]
