"""Small motions about a steady rotation: impedances, natural frequencies, roots of characteristic equations."""
