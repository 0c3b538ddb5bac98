"""Actions on rods that depend on their state: springs, fluids, walls, the inertia of a rotation.

Each holds its data and its virtual work in UFL; no solver, model or time stepper refers to it by name
(scene/action.py)."""

import cosserat_fenicsx.compat  # noqa: F401  it raises a readable error if dolfinx is missing
