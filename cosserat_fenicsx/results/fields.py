"""All fields at the nodes of a rod, in many states at once."""

import numpy as np

from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.results.recovery import at_nodes


def fields_at(result, which, rod):
    """The fields of `Result.fields` in several states.

    Args:
        which: indices of states (n,); rod: a rod of the scene.

    Returns:
        {name: array (n, nodes, ...)}, but "s" (nodes,).
    """
    i, rows = result._rows(rod)
    s = result.layout.node_s(result.rule.nodes)[i] * rod.length
    rq = np.array([result._records[k].rq[rows] for k in which])
    contact = np.array([at_nodes(result._contact_of(k)[result._cells(i)]) for k in which])
    displacement = (rq[..., :3] - result._rest[rows]) * result.scales.length
    q = rq[..., 3:] / np.linalg.norm(rq[..., 3:], axis=-1, keepdims=True)
    d = directors(q.reshape(-1, 4)).reshape(*q.shape[:2], 3, 3) @ rod.curve.frame(s)
    n, m = contact[..., :3] * result.scales.force, contact[..., 3:] * result.scales.moment
    n_material, m_material = np.einsum("nkij,nki->nkj", d, n), np.einsum("nkij,nki->nkj", d, m)
    # at a jump those of the element before, as n and m
    viscous = result._viscous(which, rod)
    strain, curvature = rod.stiffness_at(s, "left").strains(n_material - viscous[0], m_material - viscous[1])
    found = {
        "s": s,
        "position": rod.curve.position(s) + displacement,
        "displacement": displacement,
        "quaternion": q,
        "d1": d[..., 0],
        "d2": d[..., 1],
        "d3": d[..., 2],
        "force": n,
        "moment": m,
        "strain": strain,
        "curvature": curvature,
        "bending_moment": np.linalg.norm(m_material[..., :2], axis=-1),
    }
    if result.knows_stresses:
        found |= rod.profile.stresses(s, "left", n_material, m_material)._asdict()
    return found
