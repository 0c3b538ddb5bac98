"""A result in a notebook: a small table and a small picture, as HTML."""

import html

import numpy as np

from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.screen import rows_of

# Rows of the table, states and points of the picture, and its size in pixels.
_ROWS, _STATES, _POINTS, _SIZE, _MARGIN = 8, 4, 240, 200, 6


def as_html(result):
    """HTML of about 3 kB: what the result is, a table of some rows and, of rods, a picture."""
    title = getattr(getattr(result, "scene", None), "title", "")
    whole = f"<b>{html.escape(title)}</b><br/>" if title else ""
    whole += f"<code>{html.escape(repr(result))}</code>"
    if len(result) == 0:
        return f"<div>{whole}</div>"
    picture = f"<div>{_picture(result)}</div>" if hasattr(result, "sample") else ""
    return (
        f'<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start"><div>{whole}{_table(result)}</div>'
        f"{picture}</div>"
    )


def _table(result):
    columns = result._table(Units(), _ROWS).columns
    rows = [("th", [column.header for column in columns])]
    rows += [("td", row) for row in zip(*(column.cells for column in columns), strict=True)]
    lines = ("".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in row) for tag, row in rows)
    left_out = f"{len(rows) - 1} of {len(result)} shown" if len(rows) - 1 < len(result) else ""
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>{left_out}"


def _picture(result):
    """SVG of the rods in some states, the last one darkest, in the plane that shows most of them."""
    shown, rods = rows_of(len(result), _STATES), result.scene.rods
    x = np.linspace(0, 1, max(2, _POINTS // (len(shown) * len(rods))))
    lines = [(k, result.sample(k, rod, x)[0]) for k in shown.tolist() for rod in rods]
    points = np.concatenate([places for _, places in lines])
    axes = _plane(points)
    flat = points @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = (_SIZE - 2 * _MARGIN) / max((high - low).max(), 1e-300)
    width, height = (high - low) * scale + 2 * _MARGIN
    drawn = []
    for k, places in lines:
        across, up = ((places @ axes.T - low) * scale + _MARGIN).T
        corners = " ".join(f"{a:.1f},{height - b:.1f}" for a, b in zip(across, up, strict=True))
        ink = 1.0 if k == shown[-1] else 0.25 + 0.4 * k / shown[-1]
        drawn.append(
            f'<polyline points="{corners}" fill="none" stroke="#2a788e" stroke-width="2" opacity="{ink:.2f}"/>'
        )
    normal = ", ".join(f"{a:.2g}" for a in np.round(-np.cross(*axes), 2) + 0.0)
    return (
        f'<svg width="{width:.0f}" height="{height:.0f}" role="img">{"".join(drawn)}</svg>'
        f"<br/><small>seen along ({normal})</small>"
    )


def _plane(points):
    """(2, 3) two directions, to the right and up, of the plane in which points lie farthest apart; up is near z."""
    _, _, directions = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    normal = directions[2]
    up = np.array([0, 0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0, 1.0, 0])
    up = up - normal * (normal @ up)
    up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    return np.array([right if right[np.argmax(np.abs(right))] > 0 else -right, up])
