"""What rods are coloured by in pictures: a field of a result as one number per section."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError, nearest

#: Colours from the smallest to the largest value: of sizes (viridis), and of values of either sign (coolwarm).
MAPS = {
    "viridis": ("#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151",
                "#bddf26", "#fde725"),
    "coolwarm": ("#3b4cc0", "#6282ea", "#8db0fe", "#b8d0f9", "#dddddd", "#f5c4ad", "#f49a7b", "#de604d", "#b40426"),
}  # fmt: skip

# Name: (the field of `Result.fields`, words, unit). Each has a size, and components along x, y, z.
_VECTORS = {
    "displacement": ("displacement", "displacement", "m"),
    "force": ("force", "contact force", "N"),
    "moment": ("moment", "contact moment", "N m"),
    "n": ("force", "contact force", "N"),
    "m": ("moment", "contact moment", "N m"),
    "velocity": ("velocity", "velocity", "m/s"),
    "angular_velocity": ("angular_velocity", "angular velocity", "rad/s"),
}
# Likewise with components along the directors alone.
_MATERIAL = {"strain": ("strain", "strain", "1"), "curvature": ("curvature", "curvature", "1/m")}
_DIRECTED = ("force", "moment", "n", "m", "strain", "curvature")
_WORDS = {
    "n.3": "tension",
    "m.3": "twisting moment",
    "strain.1": "shear strain along d1",
    "strain.2": "shear strain along d2",
    "strain.3": "stretch",
    "curvature.1": "bending about d1",
    "curvature.2": "bending about d2",
    "curvature.3": "twist",
}
_SIZES = {"shear_force": ("n", "shear force", "N"), "bending_moment": ("m", "bending moment", "N m")}
# Units of further scalar fields, by the beginning or end of their names.
_STRESS = ("stress", "mises")
# Values below this share of the scene's force or moment are rounding.
_ROUNDING = 1e-11


@dataclass(frozen=True)
class Colour:
    """A field that rods are coloured by.

    Attributes:
        name: as a user gives it; words, unit: on the colour bar.
        signed: whether it has values of either sign.
        of: a function from the dict of `Result.fields` to one number per node.
    """

    name: str
    words: str
    unit: str
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


def known(path):
    """{name: `Colour`} of everything that the rods of a path or a motion can be coloured by."""
    given = path.fields(0)
    found = {name: _size_across(name) for name in _SIZES}
    for name, (field, words, unit) in {**_VECTORS, **_MATERIAL}.items():
        if field not in given:
            continue
        found[name] = Colour(name, words, unit, False, lambda f, field=field: np.linalg.norm(f[field], axis=1))
        if name not in _MATERIAL:
            for i, axis in enumerate("xyz"):
                of = lambda f, field=field, i=i: f[field][:, i]
                found[f"{name}.{axis}"] = Colour(f"{name}.{axis}", f"{words} along {axis}", unit, True, of)
        if name in _DIRECTED:
            for i in range(3):
                found[f"{name}.{i + 1}"] = _component(name, field, words, unit, i)
    for name, values in given.items():
        if np.ndim(values) == 1 and name not in ("s", *found):
            unit = "Pa" if any(part in name for part in _STRESS) else "1"
            signed = any(np.min(path.fields(len(path) - 1, rod)[name]) < 0 for rod in path.scene.rods)
            found[name] = Colour(name, name.replace("_", " "), unit, signed, lambda f, name=name: f[name])
    return found


def colour_of(path, name):
    """The `Colour` of that name.

    Raises:
        SceneError: there is none; lists the names.
    """
    every = known(path)
    if name not in every:
        listed = ", ".join(x for x in every if "." not in x)
        hint = nearest(name, every) if isinstance(name, str) else ""
        hint = f"; {hint}" if hint.startswith("did") else ""
        raise SceneError(
            f"plot.color = {name!r}: expected one of {listed}; or a component of a vector such as n.x, or n.1 along d1 "
            f"(n, m, strain and curvature){hint}"
        )
    return every[name]


def rounding(path, colour):
    """The size below which values of a `Colour` are rounding."""
    scale = {"N": path.scales.force, "N m": path.scales.moment, "m": path.scales.length}.get(colour.unit, 0.0)
    return _ROUNDING * scale


def _component(name, field, words, unit, i):
    short = {"force": "n", "moment": "m"}.get(name, name)
    told = _WORDS.get(f"{short}.{i + 1}", f"{words} along d{i + 1}")
    if name in _MATERIAL:
        return Colour(f"{name}.{i + 1}", told, unit, True, lambda f: f[field][:, i])
    return Colour(f"{name}.{i + 1}", told, unit, True, lambda f: np.einsum("ni,ni->n", f[field], f[f"d{i + 1}"]))


def _size_across(name):
    """The size of a force or moment across the tangent."""
    short, words, unit = _SIZES[name]
    field = _VECTORS[short][0]
    return Colour(
        name, words, unit, False,
        lambda f: np.hypot(np.einsum("ni,ni->n", f[field], f["d1"]), np.einsum("ni,ni->n", f[field], f["d2"])),
    )  # fmt: skip
