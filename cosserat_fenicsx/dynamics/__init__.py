"""Motions in time: initial state, times that steps end at, time steppers, step size control; `simulate`, `resume`,
`modes`."""
