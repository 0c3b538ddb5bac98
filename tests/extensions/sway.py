"""An extension: a quantity of paths, its sway, and one along the rods, the slope, each in tables, files and charts."""

import numpy as np

import cosserat_fenicsx as cf


def steps(panel, along, values):
    """A chart of its own: steps, and a dashed line at the largest sway."""
    panel.step(along, values)
    panel.axhline(values.max(), linestyle="--")


@cf.Path.quantity("sway of the tip", unit="m", chart=steps)
def sway(path):
    """(n,) horizontal distance of the end of the first rod from where it was at rest, m."""
    return np.linalg.norm(path.displacement(path.rod().end)[:, :2], axis=1)


@cf.Path.quantity("slope", unit="deg", axes=("point", "s"))
def slope(path, rod):
    """(n, nodes) angle between the director d3 and the vertical, degrees."""
    d3 = path.fields_at(range(len(path)), rod)["d3"]
    return np.degrees(np.arccos(np.clip(np.abs(d3[..., 2]), 0.0, 1.0)))
