"""What pictures of a string in its hole share: the depths that they show, sides and their colours, forces."""

import numpy as np

from cosserat_fenicsx.checks import finite_array, refuse
from cosserat_fenicsx.well.contacts import name_of_side

#: Colours of the sides of the hole, the same in all pictures.
SIDES = {"low": "tab:blue", "high": "tab:red", "left": "tab:green", "right": "tab:orange", "wall": "dimgray"}

#: Inclinations (rad) below this have no high side.
VERTICAL = 1e-9
# What remains is cut off beyond so many times what this part of the string has.
_USUAL, _MOSTLY = 1.5, 0.995


def depths_between(where, between, depth):
    """(top, bottom), m, of the depths that a picture shows, at most from 0 to the depth of the bit.

    Raises:
        SceneError: they are not two depths of the string, the upper one first.
    """
    if between is None:
        return 0.0, float(depth)
    ends = finite_array(where, "between", between, "two measured depths (m), such as (3000, 3400)")
    if ends.shape != (2,) or not 0 <= ends[0] < min(ends[1], depth):
        refuse(where, "between", between, f"two measured depths of the string, from 0 to {depth:.10g} m, ascending")
    return float(ends[0]), float(min(ends[1], depth))


def rows_between(md, top, bottom):
    """A slice of ascending depths that holds those from top to bottom, and one more at each end."""
    first, last = np.searchsorted(md, (top, bottom), side="left"), np.searchsorted(md, (top, bottom), side="right")
    return slice(max(0, int(first[0]) - 1), int(last[1]) + 1)


def sides_along(answer):
    """(n,) names of the sides that the string touches at `md`, see `SIDES`; "" where it touches none."""
    names = np.array([name_of_side(side) for side in answer.contact_side])
    vertical = (answer.inclination < VERTICAL) & (answer.side_force > 0)
    return np.where(np.isfinite(answer.contact_side) | vertical, names, "")


def points_between(answer, top, bottom):
    """[(md, force, side)] of the wall's forces at points, m and N."""
    at = [contact for contact in answer.contacts if contact.at_point and top <= contact.top <= bottom]
    return [(contact.top, contact.force, contact.side) for contact in at]


def usual_side_force(answer, force, md):
    """N/m, up to which axes and colours reach, of a regular side force (n,) at depths (n,): of the rod less than the
    largest where some short part of it has much more, such as what is left of a peak."""
    known = np.isfinite(force)
    most = float(force[known].max(initial=0.0))
    if answer.model != "rod" or not most > 0:
        return most
    values, lengths = force[known], np.gradient(md)[known]
    order = np.argsort(values)
    so_far = np.cumsum(lengths[order])
    at = min(int(np.searchsorted(so_far, _MOSTLY * so_far[-1])), len(order) - 1)
    return min(most, _USUAL * float(values[order][at]))
