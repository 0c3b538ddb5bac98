"""Motion: where it starts, what it lands on, steps in time and their length, `simulate`, `resume` and `modes`."""
