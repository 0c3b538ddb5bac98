"""Trials that compare ways to one final state: numbers of steps, orders of loads, rotated frames."""

import itertools
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from trials import problems
from trials.cells import Stopped, judged

#: Largest difference of the final states, over the length.
SAME = (
    "to 1e-6 of the length, or a difference that vanishes with the mesh and is a tenth at most of what twice the"
    " elements change"
)


def steps(method):
    """Dependence of the final state on the number of steps."""
    if method.spatial:
        make, note = problems.twisted, "the twisted rod"
    else:
        make, note = (lambda n: problems.column([0.5 * (k + 1) / n for k in range(n)])), "the column"

    def tips(**more):
        for n in (8, 10, 160):
            try:
                yield method.solve({**make(n), **more})
            except Stopped as stop:
                raise Stopped(f"{stop} ({n} steps)", stop.reached) from None

    return _one_and_the_same(tips, make(1)["length"], note)


def order(method):
    """Dependence of the final state on the order of the loads."""
    ways = (
        [(k / 10, k / 10) for k in range(1, 11)],
        [*((k / 5, 0) for k in range(1, 6)), *((1, k / 5) for k in range(1, 6))],
        [*((0, k / 5) for k in range(1, 6)), *((k / 5, 1) for k in range(1, 6))],
    )
    problem = problems.pushed_and_turned(not method.spatial)

    def tips(**more):
        return (method.solve({**problem, "history": history, **more}) for history in ways)

    return _one_and_the_same(tips, problem["length"])


def objective(method):
    """Objectivity: a loaded rod, and the same with rotated clamp and loads."""
    problem, turn = problems.pushed_and_turned(not method.spatial), method.turn
    start, back = np.array([problem["length"], 0, 0]), Rotation.from_rotvec(turn).inv()

    def tips(**more):
        yield method.solve({**problem, **more})
        answer = method.solve({**problem, "turn": turn, **more})
        yield replace(answer, tip=back.apply(start + answer.tip) - start)

    return _one_and_the_same(tips, problem["length"], f"turned by {np.linalg.norm(turn):.3g} rad")


def _one_and_the_same(tips, length, note=""):
    """The cell of several ways to one final state, of which tips(**more) gives the answers: they may differ by 1e-6 of
    the length; or by more, if the difference vanishes under mesh refinement and is at most a tenth of the
    discretisation error; `more` goes into the problem."""

    def apart(answers):
        ends = [answer.tip[-1] for answer in answers]
        return max(np.linalg.norm(a - b) for a, b in itertools.combinations(ends, 2)) / length

    answers = list(tips())
    found, unit = apart(answers), "difference / length"
    if found <= 1e-6:
        return judged(found, 1e-6, answers[-1], unit, note)
    finer = list(tips(finer=2))
    order = np.log2(found / apart(finer))
    mesh = np.linalg.norm(finer[0].tip[-1] - answers[0].tip[-1]) / length
    hidden = order > 0.8 and found <= 0.1 * mesh
    words = f"of order {order:.1f} in the mesh, {found / mesh:.2g} of what twice the elements change"
    return judged(
        found, found if hidden else 1e-6, answers[-1], unit, "; ".join(word for word in (note, words) if word)
    )
