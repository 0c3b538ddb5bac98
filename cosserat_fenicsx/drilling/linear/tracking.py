"""Modes followed from one case to the next, with all roots of every case counted."""

import numpy as np

from cosserat_fenicsx.drilling.linear.roots import all_roots, each

#: A root that moves farther than this share of their distance is followed in smaller steps, so often at most.
_FAR, _HALVINGS = 0.25, 7
#: Roots nearer to each other than this share of their size are the same.
_SAME = 1e-8


def follow(equation, points, parents, box, spacing):
    """The roots of a family of functions at many points, each mode in a column of its own.

    Args:
        equation: function of the parameters (d,) that returns a characteristic function.
        points: (n, d).
        parents: for each point the indices of those before it from which modes are followed to it, the first one first;
            none for the first point.
        box: function of a characteristic function that gives the `Box`.
        spacing: typical distance of roots, rad/s.

    Returns:
        (n, m) complex; NaN where a mode is outside the box. Modes that come into the box add columns.

    Raises:
        NotConverged: the roots of a case differ from their count.
    """
    rows, followed, following = [], [], 0
    for point, origins in zip(points, parents, strict=True):
        f, here, lost = equation(point), {}, {}
        for k in origins:
            here = _moved(equation, points[k], point, followed[k], spacing) | here
            lost = followed[k] | lost
        found, counted = all_roots(f, box(f), f.spacing, np.array(list(here.values())))
        lost = {name: s for name, s in lost.items() if name not in here}
        row, following = _named(found, here, lost, spacing, following)
        rows.append(row)
        # those that leave the box are followed on, to know them when they come back
        beyond = {name: s for name, s in here.items() if not counted.holds(s) and counted.near(s, 2 * spacing)}
        followed.append(beyond | row)
    names = sorted({name for row in rows for name in row})
    roots = np.full((len(rows), len(names)), np.nan + 0j)
    for k, row in enumerate(rows):
        for name, s in row.items():
            roots[k, name] = s
    return roots


def _moved(equation, start, end, roots, spacing, depth=0):
    """Roots by name, followed by Newton's method from one point to another, without those that are lost."""
    names = list(roots)
    if not names:
        return {}
    old = np.array([roots[name] for name in names])
    new = each(equation(end), old, spacing / 2)
    new = np.where(new.imag < 0, new.conj(), new)
    apart = np.abs(new[:, None] - new[None, :]) + np.diag(np.full(len(new), np.inf))
    safe = np.isfinite(new) & (np.abs(new - old) < _FAR * np.maximum(spacing, np.abs(old.real)))
    safe &= ~(apart < _SAME * np.abs(new)[:, None]).any(axis=1)
    moved = {name: s for name, s, good in zip(names, new, safe, strict=True) if good}
    rest = {name: roots[name] for name in names if name not in moved}
    if rest and depth < _HALVINGS:
        middle = (start + end) / 2
        half = _moved(equation, start, middle, rest, spacing, depth + 1)
        for name, s in _moved(equation, middle, end, half, spacing, depth + 1).items():
            if all(abs(s - other) > _SAME * abs(s) for other in moved.values()):
                moved[name] = s
    return moved


def _named(found, here, lost, spacing, following):
    """The roots of a case by name: those that were followed, then those near where one was lost, then new ones."""
    row, free = {}, list(range(len(found)))
    for name, s in here.items():
        near = [k for k in free if abs(found[k] - s) < 1e-7 * max(abs(s), 1e-3)]
        if near:
            row[name] = found[near[0]]
            free.remove(near[0])
    for distance, k, name in sorted((abs(found[k] - s), k, name) for k in free for name, s in lost.items()):
        if distance < spacing / 2 and k in free and name not in row:
            row[name] = found[k]
            free.remove(k)
    return row | {following + i: found[k] for i, k in enumerate(free)}, following + len(free)
