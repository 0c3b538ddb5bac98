"""The default scheme: averaged stress, exact balances of linear and of angular momentum (forms/inertia.py)."""

from cosserat_fenicsx.steppers.one_step import OneStep
from cosserat_fenicsx.steppers.step_problem import StepProblem


class Momentum(OneStep):
    """See `protocol.Stepper`."""

    forms, problem_class = "momentum", StepProblem
