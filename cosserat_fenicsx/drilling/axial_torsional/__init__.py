"""A string with axial and torsional motion, by finite elements and set-valued friction, and strings of discs."""
