"""A rod that is brought to rest against a wall: Newton's method from a state without contact, in stages.

Newton's method finds a contact only where it knows about which part of the rod touches which side. A soft spring to the
axis in place of the wall gives a state that is right on the whole; the wall takes over while the spring goes, and is
then made stiffer by tens, each time with the contact nearly known.
"""

import math

from cosserat_fenicsx.algebra.limited_newton import LimitedNewton
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey

#: From a state close to the solution, such as that of a coarser mesh: the wall as it is, or softer by ten before.
LAST = ((1.0, 0.0),)
LAST_TWO = ((0.1, 0.0), *LAST)
# The wall that takes over from the spring is so much stiffer; smallest spring over the wall's stiffness.
_TAKES_OVER, _SOFTEST = 10.0, 1e-12
# Powers of ten by which the spring fades before it is left out; factor of a small step.
_FADED, _SMALL_STEP = 2, 2.0
# Longest displacement of a node in a Newton step, over the clearance, or over the longest rod, the unit of length; and
# largest rotation, rad.
_LONGEST, _OF_LENGTH, _WIDEST = 10.0, 1e-4, 0.5
# A stage ends at a step below this share of the clearance: the first ones, those with full results (`careful`), the
# last one, which is not asked for less than rounding allows, in the unit of length.
_ROUGH, _CAREFUL, _ENOUGH, _ROUNDING = 0.1, 1e-7, 1e-8, 1e-13
# Newton steps of a stage.
_MOST = 60
# Newton's method alternates between two contacts where steps do not shrink by this factor, so many times: then a share
# of a step is taken, which ends between the two.
_SLOW, _STALLED, _SHARES = 0.6, 2, (0.5, 0.35, 0.7)
# Residual force of a node at equilibrium, over the norm of the loads.
_BALANCED = 1e-6


def stages_from(spring, gentle=False):
    """The stages of a start on the axis: (stiffness of the wall, of a spring to its axis), over the wall's own.

    Args:
        spring: the first spring, with which the loads move the rod by about the clearance.
        gentle: whether to go on by small steps, for a rod that is compressed beyond its buckling load.
    """
    spring = min(max(spring, _SOFTEST), 0.1 / _TAKES_OVER)
    wall, step = _TAKES_OVER * spring, _SMALL_STEP if gentle else 10.0
    softer = [(wall, spring / step**k) for k in range(1, 1 + math.ceil(_FADED / math.log10(step)))]
    count = max(0, math.ceil(math.log(0.1 / wall, step) - 1e-9))
    stiffer = [(0.1 * (wall / 0.1) ** (1 - k / count), 0.0) for k in range(1, count + 1)]
    return ((0.0, spring), *softer, (wall, 0.0), *stiffer, *LAST)


def settle(problem, walls, clearance, rounding, stages, careful=(), on_stage=None):
    """Bring a problem to equilibrium at its walls, from its state.

    Args:
        problem: a `Problem` at its load factor.
        walls: the `Stage`s of the scene's walls; they are left as in the last stage.
        clearance: smallest distance from the axis at which the rod touches, in the model's unit of length.
        rounding: residual force of a node that rounding may leave, in the model's unit of force.
        stages: see `stages_from`. careful: indices of those that are to be solved more precisely.
        on_stage: called with the index of each stage when it has been solved.

    Returns:
        int: the number of Newton steps.

    Raises:
        NotConverged: a stage was not solved, or what was found is no equilibrium.
    """
    newton = LimitedNewton(problem, max(_LONGEST * clearance, _OF_LENGTH), _WIDEST)
    for k, (stiffness, spring) in enumerate(stages):
        for wall in walls:
            wall.wall, wall.spring = stiffness, spring
        last = k == len(stages) - 1
        share = _ENOUGH if last else _CAREFUL if k in careful else _ROUGH
        _solve_stage(newton, max(share * clearance, _ROUNDING), f"stage {k + 1} of {len(stages)}")
        if on_stage:
            on_stage(k)
    off = newton.imbalance()
    if not off <= _BALANCED * problem.load_norm + rounding:
        raise NotConverged(
            f"the contact alternates: a force of {off * problem.model.scales.force:.3g} N is left over at a node"
        )
    return newton.iterations


def _solve_stage(newton, enough, name):
    moved, stalled = math.inf, 0
    for _ in range(_MOST):
        obey()
        share = _SHARES[stalled // _STALLED % len(_SHARES)] if stalled and stalled % _STALLED == 0 else 1.0
        step = newton.step(share)
        if step is None:
            raise NotConverged(f"the tangent is singular in {name} of the start")
        if step.share == 1.0 and step.moved <= enough:
            return
        stalled = stalled + 1 if step.moved > _SLOW * moved else 0
        moved = step.moved
    raise NotConverged(f"Newton's method has not converged after {_MOST} steps in {name} of the start")
