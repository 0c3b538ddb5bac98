"""Torsional waves of a string along their characteristics: exact between nodes, friction and drives at the nodes."""
