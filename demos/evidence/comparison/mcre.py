"""A reconstruction of the Modified Cosserat Rod Element (MCRE), in a plane.

After Liu, Cao, Rosing, Wang & Richardson, Int. J. Solids Struct. 44 (2007) 7785, doi:10.1016/j.ijsolstr.2007.05.020.
Their full text was not available. Known are: shape functions with up to third-order terms of the nodal displacements,
from a quasi-static solution; a rotation vector; nodal unknowns measured from the undeformed frame; an element energy of
fourth order in them. So: within an element the rod is in equilibrium, solved order by order in the nodal unknowns, and
the energy of that solution is kept to fourth order (for which the second-order terms of the solution are enough:
third-order ones enter the energy from the fifth order on). Under mesh refinement it converges to the truncated energy
of truncated.py (`mcre_limit`); see `limit`.

With a = u', g = w' - phi, b = w' phi - phi^2/2, c = -u' phi, the strains' expansions give the energy per length, by
order,
    2 W_2 = EA a^2 + GA g^2 + EI phi'^2,    2 W_3 = 2 EA a b + 2 GA g c,
    2 W_4 = EA (b^2 - u'^2 phi^2) + GA (c^2 + 2 g (phi^3/6 - w' phi^2/2)).
"""

from functools import partial
from itertools import permutations

import numpy as np
from numpy.polynomial import Polynomial as P

from comparison import chain
from comparison.column import LimitPoint
from comparison.follow import limit_point, trace


def law(length, axial, shear):
    """The law of elements, see `chain`."""
    return partial(derivatives, energy(length, axial, shear))


problem, solve = chain.of(law)


def limit(problem):
    """Where the path's load factor is largest, as a `LimitPoint`.

    For the paper's column at 0.3111, 0.4644, 0.5837, 0.6065, 0.6085, 0.6107 with 1, 2, 4, 8, 16, 32 elements: a plateau
    at 0.61, but not the limit. With 64, 128, 256 elements it is at 0.6158, 0.6219, 0.6251, and for the truncated energy
    itself, the limit under mesh refinement, at 0.62655. Returns None where the load factor passes 10 without one."""
    found = limit_point(problem)
    return found and LimitPoint(found.eta, *problem.tip(found.x), found.x)


def branch(problem, beyond):
    """Points along the arc length through the limit point to the tip displacement `beyond` (m)."""
    return trace(problem, lambda eta, tip: tip[0] > beyond or eta < 0)


def energy(length, axial, shear, bending=1.0):
    """Symmetric tensors T_2, T_3, T_4 of the element's energy T_2[q, q] + T_3[q, q, q] + T_4[q, q, q, q]. length: of
    the element; axial, shear, bending: EA, GA, EI. Returns Arrays of shape (6, 6), (6, 6, 6), (6, 6, 6, 6) for q = (u,
    w, phi) at both ends."""
    x, weights = np.polynomial.legendre.leggauss(10)
    s, ds = length * (x + 1) / 2, length * weights / 2
    linear = _at(_linear_solution(length, shear, bending), s)
    bubbles = _at(_bubbles(length), s)

    second = _second_order(linear, linear, ds, axial, shear, bending)
    third = _third_order(linear, linear, linear, ds, axial, shear)
    fourth = _fourth_order(linear, ds, axial, shear)
    # the second-order part of the solution: bubble functions in equilibrium with the forces due to W_3
    force = (
        _third_order(bubbles, linear, linear, ds, axial, shear)
        + np.moveaxis(_third_order(linear, bubbles, linear, ds, axial, shear), 1, 0)
        + np.moveaxis(_third_order(linear, linear, bubbles, ds, axial, shear), 2, 0)
    )
    stiffness = 2 * _second_order(bubbles, bubbles, ds, axial, shear, bending)
    answer = np.linalg.solve(stiffness, force.reshape(len(force), -1)).reshape(force.shape)
    fourth = fourth - np.einsum("aij,akl->ijkl", force, answer) / 2
    return _symmetric(second), _symmetric(third), _symmetric(fourth)


def derivatives(tensors, nodal):
    """Gradient (n, 6) and Hessian (n, 6, 6) of the elements' energies at the nodal unknowns (n, 6)."""
    second, third, fourth = tensors
    linear = np.einsum("ijkl,nl->nijk", fourth, nodal)
    quadratic = np.einsum("nijk,nk->nij", linear, nodal)
    cubic = np.einsum("ijk,nk->nij", third, nodal)
    gradient = np.einsum("nij,nj->ni", 2 * second + 3 * cubic + 4 * quadratic, nodal)
    return gradient, 2 * second + 6 * cubic + 12 * quadratic


def _linear_solution(length, shear, bending):
    """(u, w, phi) of the linear Timoshenko beam for a unit of each nodal unknown, as polynomials of s."""
    s, zero = P([0, 1]), P([0])

    # GA (w' - phi) = Q and EI phi'' = -Q: phi = a + b s - Q s^2/(2 EI), w = d + a s + b s^2/2 - Q s^3/(6 EI) + Q s/GA
    def bent(a, b, d, Q):
        return d + a * s + b * s**2 / 2 - Q * s**3 / (6 * bending) + Q * s / shear, a + b * s - Q * s**2 / (2 * bending)

    basis = [bent(*row) for row in np.eye(4)]
    ends = np.array([[w(0), phi(0), w(length), phi(length)] for w, phi in basis])
    shapes = []
    for row in np.linalg.inv(ends):  # coefficients of the basis for one unit of one nodal value
        shapes.append((zero, sum(c * w for c, (w, _) in zip(row, basis, strict=True)),
                       sum(c * phi for c, (_, phi) in zip(row, basis, strict=True))))  # fmt: skip
    axial = [(1 - s / length, zero, zero), (s / length, zero, zero)]
    return [axial[0], shapes[0], shapes[1], axial[1], shapes[2], shapes[3]]


def _bubbles(length, degree=6):
    """Polynomials that vanish at both ends, for u, w and phi each; degree 5 holds the second-order solution."""
    s, zero = P([0, 1]) / length, P([0])
    legendre = [
        s * (1 - s) * np.polynomial.Legendre.basis(k, domain=[0, length]).convert(kind=P) for k in range(degree - 1)
    ]
    return [tuple(b if field == k else zero for field in range(3)) for k in range(3) for b in legendre]


def _at(shapes, s):
    """Values (u', w', phi, phi') of shape functions at the points s, each (shapes, points)."""
    return tuple(
        np.array([(shape[field].deriv() if slope else shape[field])(s) for shape in shapes])
        for field, slope in ((0, True), (1, True), (2, False), (2, True))
    )


def _second_order(a, b, ds, axial, shear, bending):
    """W_2 as a bilinear form."""
    gamma, delta = a[1] - a[2], b[1] - b[2]
    return (axial * _sum("ip,jp,p->ij", a[0], b[0], ds) + shear * _sum("ip,jp,p->ij", gamma, delta, ds)
            + bending * _sum("ip,jp,p->ij", a[3], b[3], ds)) / 2  # fmt: skip


def _third_order(a, b, c, ds, axial, shear):
    """W_3 = EA u' (w' phi - phi^2/2) - GA (w' - phi) u' phi as a trilinear form, one factor from each of a, b, c."""
    return (axial * _sum("ip,jp,kp,p->ijk", a[0], b[1] - b[2] / 2, c[2], ds)
            - shear * _sum("ip,jp,kp,p->ijk", a[1] - a[2], b[0], c[2], ds))  # fmt: skip


def _fourth_order(a, ds, axial, shear):
    """W_4 as a quadrilinear form."""
    u, w, phi, _ = a
    bow, gamma = w - phi / 2, w - phi
    product = "ip,jp,kp,lp,p->ijkl"
    return (axial * (_sum(product, bow, phi, bow, phi, ds) - _sum(product, u, u, phi, phi, ds))
            + shear * (_sum(product, u, phi, u, phi, ds)
                       + 2 * _sum(product, gamma, phi / 6 - w / 2, phi, phi, ds))) / 2  # fmt: skip


def _sum(subscripts, *operands):
    return np.einsum(subscripts, *operands, optimize=True)


def _symmetric(tensor):
    """The mean over all orders of the indices."""
    orders = list(permutations(range(tensor.ndim)))
    return sum(np.transpose(tensor, order) for order in orders) / len(orders)
