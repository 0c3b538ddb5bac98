"""Contact of rods in motion with walls, at the nodes: forces within a time step, and their books."""
