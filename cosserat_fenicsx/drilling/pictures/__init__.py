"""Charts and films of a drill-string in motion."""
