"""Words and units of what a string in motion records, see `protocol`."""

#: {name: (words, unit)}.
QUANTITIES = {
    "drive_speed": ("drive speed", "rad/s"),
    "drive_angle": ("drive angle", "rad"),
    "surface_torque": ("surface torque", "N m"),
    "bit_speed": ("bit speed", "rad/s"),
    "bit_angle": ("bit angle", "rad"),
    "torque_on_bit": ("torque on bit", "N m"),
    "hook_load": ("hook load", "N"),
    "bit_velocity": ("bit velocity", "m/s"),
    "bit_advance": ("bit advance", "m"),
    "weight_on_bit": ("weight on bit", "N"),
    "impulse_on_bit": ("impulse of impacts on bit", "N s"),
    "kinetic": ("kinetic energy", "J"),
    "strain": ("strain energy", "J"),
    "work_of_drive": ("work of drive", "J"),
    "work_of_hook": ("work of hook", "J"),
    "work_of_weight": ("work of weight", "J"),
    "lost_at_bit": ("lost at bit", "J"),
    "lost_at_wall": ("lost at wall", "J"),
    "lost_in_mud": ("lost in mud", "J"),
    "balance": ("not accounted for", "J"),
    "angle": ("angle along the string", "rad"),
    "speed": ("speed of rotation along the string", "rad/s"),
    "torque": ("torque along the string", "N m"),
    "displacement": ("displacement along the string", "m"),
    "velocity": ("velocity along the string", "m/s"),
    "tension": ("tension along the string", "N"),
    "sticking": ("1 where the wall holds the string", "1"),
}


def heading(name):
    """The words of a quantity with its unit, for tables and axes."""
    words, unit = QUANTITIES[name]
    return f"{words} ({unit})"
