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
