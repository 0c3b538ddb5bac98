"""The constraint equations c = 0 of supports and joints, as functions of the motion (r, q) of two nodes a and b.

One equation serves all kinds; the data that a kind does not need are zero:

    c = n . (r_a - r_b - place) - eta rate + (R_a t) . (R_b w) + 2 axis . vec(q_a conj(p))

Along the direction n, a stays at `place` from b, or moves away in proportion to the load factor eta. t and w are fixed
to the sections at a and b and stay normal to each other. p is the quaternion of the rotation by `start` and then by eta
`angle` about the unit vector `about`; about `axis`, the rotation of a equals it. q need not have unit length: the
mean of two has not.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms.rotation import product_conjugate, rotation_matrix

#: Arguments of an equation and their sizes; `multiplier` is the reaction.
SIZES = {
    "r_a": 3, "q_a": 4, "r_b": 3, "q_b": 4,
    "n": 3, "place": 3, "rate": 1, "t": 3, "w": 3, "axis": 3, "about": 3, "angle": 1, "start": 4,
    "load_factor": 1, "multiplier": 1,
}  # fmt: skip
_SIZES = tuple(SIZES.values())
#: Where each stands in a row of numbers; the motion of both nodes comes first.
PLACES = {name: slice(sum(_SIZES[:i]), sum(_SIZES[: i + 1])) for i, name in enumerate(SIZES)}
COUNT, MOTION = sum(_SIZES), 14
_Given = namedtuple("_Given", SIZES)


def constraint(given):
    """c, from a namedtuple of UFL vectors with the fields `SIZES`."""
    half = given.load_factor[0] * given.angle[0] / 2
    c, about, (first, *others) = ufl.cos(half), ufl.sin(half) * given.about, given.start
    before = ufl.as_vector(others)
    ahead = c * before + first * about + ufl.cross(about, before)
    p = ufl.as_vector([c * first - ufl.dot(about, before), *ahead])
    held = ufl.dot(given.n, given.r_a - given.r_b - given.place) - given.load_factor[0] * given.rate[0]
    inclined = ufl.dot(rotation_matrix(given.q_a) * given.t, rotation_matrix(given.q_b) * given.w)
    return held + inclined + 2 * ufl.dot(given.axis, product_conjugate(given.q_a, p))


def derivatives(numbers):
    """Two expressions of a row of numbers (a UFL vector, see `PLACES`), by small displacements and small inertial
    rotations of both nodes: c and its gradient, (1 + 12,); and the change of the multiplier times the gradient,
    (12, 12)."""
    motion = ufl.variable(ufl.as_vector([numbers[i] for i in range(MOTION)]))
    row = [*motion, *(numbers[i] for i in range(MOTION, COUNT))]
    given = _Given(*(ufl.as_vector(row[place]) for place in PLACES.values()))
    c, directions = constraint(given), _directions(motion)
    gradient = ufl.dot(ufl.diff(c, motion), directions)
    change = given.multiplier[0] * ufl.dot(ufl.diff(gradient, motion), directions)
    return ufl.as_vector([c, *gradient]), change


def _directions(motion):
    """(14, 12): the changes of (r, q) of both nodes by small displacements and small rotations phi: dq = phi q/2."""
    rows = [[0] * 12 for _ in range(MOTION)]
    for first, column in ((0, 0), (7, 6)):
        a, b, c, d = (motion[first + i] / 2 for i in range(3, 7))
        for i in range(3):
            rows[first + i][column + i] = 1
        for i, changes in enumerate(((-b, -c, -d), (a, d, -c), (-d, a, b), (c, -b, a))):
            rows[first + 3 + i][column + 3 : column + 6] = changes
    return ufl.as_matrix(rows)
