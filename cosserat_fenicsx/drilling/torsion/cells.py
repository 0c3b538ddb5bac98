"""The cells of a string: every one is passed by waves in the same time, a step.

A uniform part of the travel time t and the impedance Z has the inertia Z t and the compliance t/Z. Parts that are too
short for a cell are joined with a piece of their neighbour to a uniform part of the same inertia and compliance. Where
a travel time is no whole number of steps, one cell of the part is longer, by the all-pass filter of first order whose
delay is exact at low frequencies: J. P. Thiran, IEEE Trans. Circuit Theory 18 (1971) 659,
doi:10.1109/TCT.1971.1083363. It keeps energy, and the error of its travel time is at most 0.16 dt (omega dt)^2.
"""

import math
from collections import namedtuple

import numpy as np

_EXACT = 1e-9  # steps; travel times nearer to a whole number of steps are one
_SHORTEST = 1.5  # steps
_LEAST = 0.75  # of the step asked for: the shortest that is tried so that travel times fit

#: A uniform part: travel time (s), impedance (N m s/rad), measured depths of its ends (m).
Part = namedtuple("Part", "time impedance top bottom")
#: dt: s. depths: (n + 1,) of the nodes, m. impedance, time: (n,) of the cells. turn: (n,) coefficients of the filters,
#: 0 where there is none. joined: parts that were too short. unfit: the largest distance of a travel time from a whole
#: number of steps, in steps.
Cells = namedtuple("Cells", "dt depths impedance time turn joined unfit")


def cells_of(segments, dt):
    """The `Cells` of `Segment`s from the top down, for a step of dt (s) or the next shorter one that fits better."""
    parts, top = [], 0.0
    for segment in segments:
        bottom = top + segment.length
        part = Part(segment.length / segment.torsional_speed, segment.torsional_impedance, top, bottom)
        same = parts and math.isclose(parts[-1].impedance, part.impedance, rel_tol=1e-12)
        speeds = [(x.bottom - x.top) / x.time for x in (parts[-1], part)] if same else [0.0, 1.0]
        if math.isclose(*speeds, rel_tol=1e-12):
            part = Part(parts[-1].time + part.time, part.impedance, parts.pop().top, bottom)
        parts.append(part)
        top = bottom
    dt = min(dt, math.fsum(part.time for part in parts) / 4)
    dt = _step([part.time for part in parts], dt)
    parts, joined = _long_enough(parts, dt)
    depths, impedance, time, turn = [0.0], [], [], []
    unfit = 0.0
    for part in parts:
        delays, coefficient = _delays(part.time / dt)
        unfit = max(unfit, abs(part.time / dt - round(part.time / dt)))
        ends = part.top + (part.bottom - part.top) * np.cumsum(delays) / math.fsum(delays)
        depths.extend(ends[:-1].tolist() + [part.bottom])
        impedance.extend([part.impedance] * len(delays))
        time.extend(delays * dt)
        turn.extend(np.where(delays == delays.max(), coefficient, 0.0))
    return Cells(dt, *(np.array(x) for x in (depths, impedance, time, turn)), joined, unfit)


def _delays(steps):
    """Travel times of the cells of a part, in steps, and the coefficient of the filter of the longest one."""
    whole = round(steps)
    if abs(steps - whole) <= _EXACT * max(1.0, steps):
        return np.ones(whole), 0.0
    short = math.floor(steps - _SHORTEST)
    delays, extra = np.ones(short + 1), steps - short - 1
    delays[short // 2] += extra
    return delays, (1 - extra) / (1 + extra)


def _step(times, dt):
    """The step from 0.75 dt to dt for which travel times of so many seconds are nearest to whole numbers of steps."""
    times = np.array([time for time in times if time >= _SHORTEST * dt])
    tried = [dt]
    for time in times:
        tried.append(time / np.arange(math.ceil(time / dt * (1 - 1e-12)), math.floor(time / (_LEAST * dt)) + 1))
    tried = np.unique(np.concatenate([np.atleast_1d(x) for x in tried]))[::-1]
    steps = times[:, None] / tried
    off = np.abs(steps - np.round(steps)).max(axis=0, initial=0.0)  # of none where all are short
    return float(tried[np.argmax(off <= max(off.min(), _EXACT) * (1 + 1e-6))])


def _fits(part, dt):
    steps = part.time / dt
    return steps >= _SHORTEST or abs(steps - 1) <= _EXACT


def _joined(a, b):
    """The uniform part with the inertia and the compliance of two that follow each other."""
    inertia, compliance = a.impedance * a.time + b.impedance * b.time, a.time / a.impedance + b.time / b.impedance
    return Part(math.sqrt(inertia * compliance), math.sqrt(inertia / compliance), a.top, b.bottom)


def _cut(part, time, above):
    """A part in two, the upper one first; `time` is the travel time of one of them, `above` whether of the upper."""
    upper = time if above else part.time - time
    middle = part.top + (part.bottom - part.top) * upper / part.time
    return part._replace(time=upper, bottom=middle), part._replace(time=part.time - upper, top=middle)


def _long_enough(parts, dt):
    """Parts of which each has room for a cell, and how many had not."""
    parts, short = list(parts), sum(not _fits(part, dt) for part in parts)
    while len(parts) > 1 and (i := next((i for i, part in enumerate(parts) if not _fits(part, dt)), -1)) >= 0:
        j = max((j for j in (i - 1, i + 1) if 0 <= j < len(parts)), key=lambda j: parts[j].time)
        small, large = parts[i], parts[j]
        # a piece of the time x of the large part makes inertia times compliance (2 dt)^2
        half = (small.impedance / large.impedance + large.impedance / small.impedance) * small.time / 2
        x = math.sqrt(half**2 + 4 * dt**2 - small.time**2) - half
        left = Part(large.time - x, large.impedance, 0.0, 0.0)
        if not 0 < x < large.time or not _fits(left, dt):
            parts[min(i, j) : max(i, j) + 1] = [_joined(*parts[min(i, j) : max(i, j) + 1])]
        elif j > i:
            near, far = _cut(large, x, above=True)
            parts[i : j + 1] = [_joined(small, near), far]
        else:
            far, near = _cut(large, x, above=False)
            parts[j : i + 1] = [far, _joined(near, small)]
    return parts, short
