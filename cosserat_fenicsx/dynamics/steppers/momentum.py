"""The default scheme: averaged stress, exact balances of linear and of angular momentum (forms/inertia.py)."""

from cosserat_fenicsx.dynamics.steppers.one_step import OneStep
from cosserat_fenicsx.dynamics.steppers.step_problem import StepProblem


class Momentum(OneStep):
    """See `protocol.Stepper`."""

    forms, problem_class = "momentum", StepProblem
