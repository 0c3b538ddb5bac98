"""Colours of rods in pictures: a field of a result as one number per section."""

from dataclasses import dataclass, replace

import numpy as np

from cosserat_fenicsx.errors import SceneError, nearest

#: Colours from the smallest to the largest value: of sizes (viridis), and of values of either sign (coolwarm).
MAPS = {
    "viridis": ("#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151",
                "#bddf26", "#fde725"),
    "coolwarm": ("#3b4cc0", "#6282ea", "#8db0fe", "#b8d0f9", "#dddddd", "#f5c4ad", "#f49a7b", "#de604d", "#b40426"),
}  # fmt: skip

# Fields of `Result.fields`: words, unit, and frames of their components: "xyz", inertial, or "123", along d1, d2, d3.
_VECTORS = {
    "displacement": ("displacement", "m", ("xyz",)),
    "force": ("contact force", "N", ("xyz", "123")),
    "moment": ("contact moment", "N m", ("xyz", "123")),
    "strain": ("strain", "1", ("123",)),
    "curvature": ("curvature", "1/m", ("123",)),
    "velocity": ("velocity", "m/s", ("xyz",)),
    "angular_velocity": ("angular velocity", "rad/s", ("xyz",)),
}
# Fields whose components are along d1, d2, d3 already.
_MATERIAL = ("strain", "curvature")
_SHORT = {"n": "force", "m": "moment"}
_ALIASES = {"tension": "n.3", "twisting_moment": "m.3"}
# Words, unit, and whether there are values of either sign.
_SCALARS = {
    "bending_moment": ("bending moment", "N m", False),
    "von_mises": ("von Mises stress", "Pa", False),
    "axial_max": ("largest axial stress", "Pa", True),
    "axial_min": ("smallest axial stress", "Pa", True),
}
_WORDS = {
    "force.3": "tension",
    "moment.3": "twisting moment",
    "strain.1": "shear strain along d1",
    "strain.2": "shear strain along d2",
    "strain.3": "stretch",
    "curvature.1": "bending about d1",
    "curvature.2": "bending about d2",
    "curvature.3": "twist",
}
# Values below this share of the scene's force, moment or length are rounding.
_ROUNDING = 1e-11
# Negative values of at most this share of the largest size are taken for zero.
_UNSIGNED = 1e-6


@dataclass(frozen=True)
class Colour:
    """A field that rods are coloured by, by a user's name; words, unit: on the colour bar; field: of `Result.fields`
    that it is computed from, by `of`, a function from their dict to one number per node; signed: whether it has either
    sign."""

    name: str
    words: str
    unit: str
    field: str
    signed: bool
    of: object

    @property
    def map(self):
        """The name of its colours, see `MAPS`."""
        return "coolwarm" if self.signed else "viridis"

    def limits(self, peak):
        """The smallest and the largest value of the colours; `peak`: the largest size of all values."""
        top = peak or 1.0
        return (-top if self.signed else 0.0), top


def _every():
    """{name: `Colour`} of all that rods can be coloured by."""
    every = {
        name: Colour(name, words, unit, name, signed, lambda f, name=name: f[name])
        for name, (words, unit, signed) in _SCALARS.items()
    }
    every["shear_force"] = Colour("shear_force", "shear force", "N", "force", False, _shear)
    for name in (*_VECTORS, *_SHORT):
        field = _SHORT.get(name, name)
        words, unit, frames = _VECTORS[field]
        every[name] = Colour(name, words, unit, field, False, lambda f, field=field: np.linalg.norm(f[field], axis=1))
        for part in "".join(frames):
            told = _WORDS.get(f"{field}.{part}", f"{words} along {part if part in 'xyz' else f'd{part}'}")
            every[f"{name}.{part}"] = Colour(f"{name}.{part}", told, unit, field, True, _component(field, part))
    every.update({name: replace(every[other], name=name) for name, other in _ALIASES.items()})
    return every


def _component(field, part):
    """A function from the dict of `Result.fields` to a component of a vector."""
    if part in "xyz" or field in _MATERIAL:
        i = ("xyz" if part in "xyz" else "123").index(part)
        return lambda f: f[field][:, i]
    return lambda f: np.einsum("ni,ni->n", f[field], f[f"d{part}"])


def _shear(fields):
    """The size of the contact force across the tangent."""
    return np.hypot(*(np.einsum("ni,ni->n", fields["force"], fields[d]) for d in ("d1", "d2")))


#: {name: `Colour`} of all that rods can be coloured by.
EVERY = _every()


def known(path):
    """{name: `Colour`} of all that the rods of a path or a motion can be coloured by."""
    given = path.fields(0)
    return {name: colour for name, colour in EVERY.items() if colour.field in given}


def colour_of(name, among=EVERY, where="plot"):
    """The `Colour` of that name among some; a SceneError with the names, and `where`, where there is none."""
    if isinstance(name, str) and name in among:
        return among[name]
    plain = ", ".join(x for x in among if "." not in x)
    hint = nearest(name, among)
    hint = f"; {hint}" if hint.startswith("did") else ""
    raise SceneError(
        f"{where}.color = {name!r}: expected {plain}, or a component such as n.x or n.3 (x, y, z: inertial; 1, 2, 3: "
        f"along d1, d2, d3, which strain and curvature have alone){hint}"
    )


def seen(colour, values, peak):
    """The `Colour` for a list of arrays of values up to a size `peak`: where none is negative, its colours begin at 0,
    so that all of them are used."""
    least = min(float(np.nan_to_num(array).min()) for array in values)
    return replace(colour, signed=colour.signed and not (peak and least >= -_UNSIGNED * peak))


def peak_of(path, colour, values):
    """The largest size of a list of arrays of values, 0 where it is rounding; NaN where there is no value."""
    peak = max(float(np.nan_to_num(np.abs(array)).max()) for array in values)
    scale = {"N": path.scales.force, "N m": path.scales.moment, "m": path.scales.length}.get(colour.unit, 0.0)
    return peak if peak > _ROUNDING * scale else 0.0


# sqrt(EI/N) over the length below which a rod is a cable; share of the rods' whole length above which a picture is one
# of cables.
_CABLE, _MOST = 0.1, 0.5
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
    """The name of the field by which the rods of a path or a motion are coloured where none is asked for: "tension" of
    cables, else the resultant whose strain energy times its variation is largest, of all rods and states `shown`.

    A rod in tension N resists loads across it by N where sqrt(EI/N), the distance from its ends over which bending
    decays, is much shorter than the rod: it is a cable, and its tension matters, whatever bends it near its ends.
    Elsewhere that resultant matters which stores most strain energy, unless it is nearly the same everywhere and would
    show one colour: each energy counts in proportion to the range of the values over their largest size.
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
        cables += rod.length if tension > 0 and stiffness < tension * (_CABLE * rod.length) ** 2 else 0.0
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
