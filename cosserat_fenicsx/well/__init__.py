"""Wells, the strings in them, and their equilibrium while they are moved, turned or held: torque and drag."""
