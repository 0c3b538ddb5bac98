"""The drill-string in motion: torsional and axial waves, friction, bit laws, drives, and where they are stable."""
