"""Continuation of an equilibrium path: load control, arc length, critical points and branches, and its record."""
