"""Which field colours the rods of a picture where none is asked for.

A rod in tension N resists loads across it by N where sqrt(EI/N), the distance from its ends over which bending decays,
is much shorter than the rod: it is a cable, and its tension matters, whatever bends it near its ends. Elsewhere that
resultant matters which stores most strain energy, unless it is nearly the same everywhere and would show one colour:
each energy counts in proportion to the range of the values over their largest size.
"""

import numpy as np

# sqrt(EI/N) over the length below which a rod is a cable; share of the rods' whole length above which a picture is one
# of cables.
_SHORT, _MOST = 0.1, 0.5
# Components of forces and strains along d1, d2, d3, and whether they are the moment and the curvature; the first field
# is taken where nothing is strained.
_PARTS = {
    "bending_moment": ((0, 1), True),
    "twisting_moment": ((2,), True),
    "tension": ((2,), False),
    "shear_force": ((0, 1), False),
}
# Least share by which the energy of a resultant without variation counts.
_LEAST = 0.1
# States whose fields are looked at.
_SAMPLES = 20


def default_colour(result, shown):
    """The name of the field by which the rods of a path or a motion are coloured: "tension" of cables, else the
    resultant whose strain energy times its variation is largest, of all rods and states together.

    Args:
        shown: indices of the states in the picture.
    """
    shown = [shown[i] for i in np.unique(np.linspace(0, len(shown) - 1, min(len(shown), _SAMPLES)).astype(int))]
    energies, ranges = dict.fromkeys(_PARTS, 0.0), {name: [np.inf, -np.inf] for name in _PARTS}
    cables, whole = 0.0, 0.0
    for rod in result.scene.rods:
        fields = result.fields_at(shown, rod)
        frame = np.stack([fields["d1"], fields["d2"], fields["d3"]], axis=-2)
        n, m = (np.einsum("ksij,ksj->ksi", frame, fields[name]) for name in ("force", "moment"))
        for name, (parts, turns) in _PARTS.items():
            stored = (m * fields["curvature"] if turns else n * fields["strain"])[..., parts].sum(axis=-1) / 2
            energies[name] += _integral(fields["s"], stored).sum()
            values = (m if turns else n)[..., parts]
            values = values[..., 0] if len(parts) == 1 else np.linalg.norm(values, axis=-1)
            ranges[name] = [min(ranges[name][0], values.min()), max(ranges[name][1], values.max())]
        tension = _integral(fields["s"], n[..., 2]).max() / rod.length
        stiffness = rod.stiffness_at(fields["s"], "left").J[..., :2].max()
        cables += rod.length if tension > 0 and stiffness < tension * (_SHORT * rod.length) ** 2 else 0.0
        whole += rod.length
    if cables > _MOST * whole:
        return "tension"
    return max(energies, key=lambda name: energies[name] * _variation(*ranges[name]))


def _variation(low, high):
    """The range of values from `low` to `high` over their largest size, from `_LEAST` to 1."""
    return float(np.clip((high - low) / (max(abs(low), abs(high)) or 1.0), _LEAST, 1.0))


def _integral(s, values):
    """(k,) integrals over s (n,) of values (k, n) by the trapezoidal rule."""
    return (values[:, 1:] + values[:, :-1]) @ np.diff(s) / 2
