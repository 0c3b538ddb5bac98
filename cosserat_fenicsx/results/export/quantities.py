"""What the numbers of a result are: units, components and frames, for every file and table."""

from collections import namedtuple

#: label: in headings; unit: "1" for none; parts: names of the components; frame: of these, "" for a scalar.
Quantity = namedtuple("Quantity", "label unit parts frame", defaults=("1", "", ""))

#: The fields of `Result.fields`.
FIELDS = {
    "s": Quantity("s", "m"),
    "position": Quantity("position", "m", "xyz", "inertial"),
    "displacement": Quantity("displacement", "m", "xyz", "inertial"),
    "quaternion": Quantity("quaternion", "1", "abcd", "rotation from the reference, scalar first, inertial"),
    "d1": Quantity("d1", "1", "xyz", "inertial"),
    "d2": Quantity("d2", "1", "xyz", "inertial"),
    "d3": Quantity("d3", "1", "xyz", "inertial"),
    "force": Quantity("inertial contact force", "N", "xyz", "inertial"),
    "moment": Quantity("inertial contact moment", "N m", "xyz", "inertial"),
    "strain": Quantity("material strain", "1", ("shear 1", "shear 2", "stretch"), "material: along d1, d2, d3"),
    "curvature": Quantity(
        "material change of curvature", "1/m", ("bending 1", "bending 2", "twist"), "material: about d1, d2, d3"
    ),
    "bending_moment": Quantity("bending moment", "N m"),
    "von_mises": Quantity("von Mises stress", "Pa"),
    "axial_max": Quantity("largest axial stress", "Pa"),
    "axial_min": Quantity("smallest axial stress", "Pa"),
    "velocity": Quantity("velocity", "m/s", "xyz", "inertial"),
    "angular_velocity": Quantity("angular velocity", "rad/s", "xyz", "inertial"),
}

#: What belongs to every state of a path, and of a motion, by names in files; the attributes behind them.
OF_PATH = {
    "load_factor": ("load_factors", Quantity("load factor")),
    "steps": ("steps", Quantity("steps")),
    "negative_modes": ("negative_modes", Quantity("negative modes")),
    "stable": ("stable", Quantity("stable")),
    "iterations": ("iterations", Quantity("Newton iterations")),
    "error": ("error", Quantity("largest estimated error of those that tol bounds")),
    "error_position": ("errors.position", Quantity("estimated error of positions over the largest displacement")),
    "error_rotation": ("errors.rotation", Quantity("estimated error of rotations over the largest one")),
    "error_force": ("errors.force", Quantity("estimated error of contact forces over the largest one")),
    "error_moment": ("errors.moment", Quantity("estimated error of contact moments over the largest one")),
}
OF_HISTORY = {
    "time": ("times", Quantity("time", "s")),
    "steps": ("steps", Quantity("steps")),
    "iterations": ("iterations", Quantity("Newton iterations")),
    "kinetic_energy": ("kinetic", Quantity("kinetic energy", "J")),
    "strain_energy": ("strain", Quantity("strain energy", "J")),
    "work": ("work", Quantity("work", "J")),
    "dissipated": ("dissipated", Quantity("dissipated", "J")),
    "balance": ("balance", Quantity("balance", "J")),
    "linear_momentum": ("linear_momentum", Quantity("linear momentum", "kg m/s", "xyz", "inertial")),
    "angular_momentum": ("angular_momentum", Quantity("angular momentum", "kg m^2/s", "xyz", "inertial")),
}


def headings(quantity, before=""):
    """Headings of the columns of a quantity, such as 'position (m) x'."""
    name = f"{before}{quantity.label}" + ("" if quantity.unit == "1" else f" ({quantity.unit})")
    return [f"{name} {part}" for part in quantity.parts] or [name]
