"""A rod that is brought to rest against a wall: Newton's method from a state without contact, in stages.

Newton's method finds a contact only where it knows about which part of the rod touches which side. A soft spring to the
axis in place of the wall gives a state that is right on the whole; the wall takes over while the spring goes, and is
then made stiffer by tens, each time with the contact nearly known.
"""

import math

from cosserat_fenicsx.algebra.newton import LimitedNewton
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey

#: From a state close to the solution, such as that of a coarser mesh: the wall as it is, or softer by ten before.
LAST = ((1.0, 0.0, False),)
LAST_TWO = ((0.1, 0.0, False), *LAST)
#: The last stages of a start, from which follows how the solution depends on the wall's stiffness.
DECADES = ((1e-2, 0.0, False), *LAST_TWO)
#: From such a state where these fail.
BACK = ((1e-3, 0.0, False), *DECADES)
# The wall that takes over from the spring is so much stiffer; smallest spring over the wall's stiffness.
_TAKES_OVER, _SOFTEST = 10.0, 1e-12
# Powers of ten by which the spring fades before it is left out; factors of its steps and of those of the wall, usual
# ones and small ones. (A spring that fades by ten at once lets a string with weight on bit buckle.)
_FADED, _STEPS, _SMALL_STEPS = 2, (10.0 ** (2 / 3), 10.0), (2.0, 2.0)
# Steps of a viscous motion at most; movement of a step that is wanted, over the clearance; bounds of the change of the
# viscosity after a step, and of the viscosity, over the first one.
_VISCOUS, _WANTED, _CHANGE, _BOUNDS = 300, 0.3, (0.5, 4.0), (1e-4, 30.0)
# Longest displacement of a node in a Newton step, over the clearance, or over the longest rod, the unit of length; and
# largest rotation, rad.
_LONGEST, _OF_LENGTH, _WIDEST = 10.0, 1e-4, 0.5
# A stage ends at a step below this share of the clearance: the first ones, those with full results (`careful`), the
# last one, which is not asked for less than rounding allows, in the unit of length.
_ROUGH, _CAREFUL, _ENOUGH, _ROUNDING = 0.1, 1e-7, 1e-8, 1e-13
# Larger by this factor where the rod is free to turn as a whole: rounding does turn it.
_FREE = 50.0
# Newton steps of a stage.
_MOST = 60
# Newton's method alternates between two contacts where steps do not shrink by this factor, so many times: then a share
# of a step is taken, which ends between the two.
_SLOW, _STALLED, _SHARES = 0.6, 2, (0.5, 0.35, 0.7)
# Residual force of a node at equilibrium, over the norm of the loads.
_BALANCED = 1e-6


def stages_from(spring, way="fast"):
    """The stages of a start on the axis: (stiffness of the wall, of a spring to its axis, over the wall's own; whether
    the rod moves as in a viscous fluid instead, see `_relax`), in turn.

    Args:
        spring: the first spring, with which the loads move the rod by about the clearance.
        way: "fast"; "gentle", by small steps; "relaxed", for a rod that is compressed beyond its buckling load; or
            "helix", for one that begins buckled, at the wall: the same without the spring to the axis.
    """
    least = DECADES[0][0]
    spring = min(max(spring, _SOFTEST), least / _TAKES_OVER)
    wall, (fades, step) = _TAKES_OVER * spring, _STEPS if way == "fast" else _SMALL_STEPS
    if way == "helix":
        wall = min(_TAKES_OVER * wall, least)
    count = max(0, math.ceil(math.log(least / wall, step) - 1e-9))
    stiffer = [(least * (wall / least) ** (1 - k / count), 0.0, False) for k in range(1, count)]
    if way in ("relaxed", "helix"):
        fading = [(wall, spring, True)]
    else:
        fading = [(wall, spring / fades**k, False) for k in range(1, 1 + math.ceil(_FADED / math.log10(fades) - 1e-9))]
    to_axis = () if way == "helix" else ((0.0, spring, False),)
    return (*to_axis, *fading, (wall, 0.0, False), *stiffer, *DECADES)


def settle(problem, walls, clearance, rounding, stages, careful=(), on_stage=None, hold=0.0):
    """Bring a problem to equilibrium at its walls, from its state.

    Args:
        problem: a `Problem` at its load factor.
        walls: the `Stage`s of the scene's walls; they are left as in the last stage.
        clearance: smallest distance from the axis at which the rod touches, in the model's unit of length.
        rounding: residual force of a node that rounding may leave, in the model's unit of force.
        stages: see `stages_from`. careful: indices of those that are to be solved more precisely.
        on_stage: called with the index of each stage when it has been solved.
        hold: for a rod that is free, or almost free, to turn as a whole, such as a helix in a straight tube: stiffness
            over the wall's own of springs that lead to where it is, from step to step. They keep the tangent regular,
            and bear nothing in the end.

    Returns:
        int: the number of Newton steps.

    Raises:
        NotConverged: a stage was not solved, or what was found is no equilibrium.
    """
    newton = LimitedNewton(problem, max(_LONGEST * clearance, _OF_LENGTH), _WIDEST)
    for k, (stiffness, spring, viscous) in enumerate(stages):
        for wall in walls:
            wall.wall, wall.spring, wall.anchor = stiffness, spring, None
        last = k == len(stages) - 1
        share = _ENOUGH if last else _CAREFUL if k in careful else _ROUGH
        name = f"stage {k + 1} of {len(stages)} of the start"
        if viscous:
            _relax(newton, walls, spring, clearance, name)
        else:
            enough = share * clearance * (_FREE if hold else 1.0)
            _solve_stage(newton, max(enough, _ROUNDING), name, walls, hold)
        if on_stage:
            on_stage(k)
    off = newton.imbalance()
    if not off <= _BALANCED * problem.load_norm + rounding:
        raise NotConverged(
            f"the contact alternates: a force of {off * problem.model.scales.force:.3g} N is left over at a node"
        )
    return newton.iterations


def _solve_stage(newton, enough, name, walls, hold):
    moved, stalled = math.inf, 0
    for _ in range(_MOST):
        obey()
        if hold:
            _fasten(newton, walls, hold)
        share = _SHARES[stalled // _STALLED % len(_SHARES)] if stalled and stalled % _STALLED == 0 else 1.0
        step = newton.step(share)
        if step is None:
            raise NotConverged(f"the tangent is singular in {name}")
        if step.share == 1.0 and step.moved <= enough:
            return
        stalled = stalled + 1 if step.moved > _SLOW * moved else 0
        moved = step.moved
    raise NotConverged(f"Newton's method has not converged after {_MOST} steps in {name}")


def _fasten(newton, walls, stiffness):
    """Springs to where the rod is, of a stiffness over the wall's own."""
    newton.imbalance()  # with the rod's position
    for wall in walls:
        wall.fasten()
        wall.spring = stiffness


def _relax(newton, walls, spring, clearance, name):
    """Let the rod move as in a viscous fluid until it rests: at every step the spring leads to where the rod is, and so
    resists the step alone. The steps are of an implicit scheme in time, of one Newton step each."""
    viscosity = spring
    for _ in range(_VISCOUS):
        obey()
        _fasten(newton, walls, viscosity)
        step = newton.step()
        if step is None:
            raise NotConverged(f"the tangent is singular in {name}")
        if step.moved <= _ROUGH * clearance and viscosity <= _BOUNDS[0] * spring:
            break
        change = min(max(step.moved / (_WANTED * clearance), _CHANGE[0]), _CHANGE[1])
        viscosity = min(max(change * viscosity, _BOUNDS[0] * spring), _BOUNDS[1] * spring)
    else:
        raise NotConverged(f"the rod has not come to rest in {name}")
