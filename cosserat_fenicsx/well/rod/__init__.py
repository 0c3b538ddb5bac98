"""The exact rod in contact with the wall of its hole."""
