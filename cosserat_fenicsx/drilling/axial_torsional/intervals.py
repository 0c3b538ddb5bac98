"""Steps of a given length, cut where signals jump."""

import numpy as np


def intervals(signals, steps, dt):
    """Rows (h, signals at the begin, signals at the end, 1 where a step ends) of a range of steps.

    Args:
        signals: a list of `ScalarSignal`. steps: (first, last + 1). dt: s.
    """
    first, last = steps
    grid = np.arange(first, last + 1) * dt
    jumps = {t for signal in signals for t in signal.jumps if grid[0] <= t < grid[-1]}
    near = 1e-9 * dt
    inner = sorted(t for t in jumps if np.abs(grid - t).min() > near)
    times = np.sort(np.concatenate([grid, inner]))
    ends = np.ones(len(times) - 1)
    ends[np.searchsorted(times, inner) - 1] = 0.0
    rows = np.empty((len(times) - 1, 2 + 2 * len(signals)))
    rows[:, 0], rows[:, -1] = np.diff(times), ends
    rows[ends == 1.0, 0] = np.where(np.isclose(rows[ends == 1.0, 0], dt, rtol=1e-9), dt, rows[ends == 1.0, 0])
    for i, signal in enumerate(signals):
        if signal.constant:
            values = np.full(len(times), signal(0.0))
            before = after = values
        else:
            before = np.array([signal(t) for t in times])
            after = before.copy()
            for j in np.flatnonzero([any(abs(t - x) <= near for x in jumps) for t in times]):
                before[j], after[j] = signal(times[j] - 1e-6 * dt), signal(times[j] + 1e-6 * dt)
        rows[:, 1 + i], rows[:, 1 + len(signals) + i] = after[:-1], before[1:]
    return rows
