"""Torsion of a string with friction along its hole, by numpy alone: an independent check of `TorsionWaves`.

Cells hold the waves P = M + Z om and Q = M - Z om, which move on by one cell in a step, exactly; then the friction of a
cell, which is set-valued at rest, brakes its speed, implicitly. At the ends waves pass from cells of one parity to
those of the other, so that none is left to itself.
"""

import numpy as np


def turn(parts, friction, drive, drag, dx, duration):
    """Times (s), speed (rad/s) and angle (rad) of the free lower end of a string that starts from rest.

    Args:
        parts: (length, impedance, rho J) from the top down, of one speed of waves.
        friction: function of measured depths (m) and of the numbers of their parts that gives the static and the
            kinetic torque per length (N m/m), and the decay (rad/s).
        drive: (I, Kp, Ki, speed). drag: 1/s. dx: m, of a cell.
    """
    counts = [round(part[0] / dx) for part in parts]
    which = np.repeat(range(len(parts)), counts)
    Z, inertia = (np.array([part[i] for part in parts])[which] for i in (1, 2))
    dt = dx * inertia[0] / Z[0]
    still, sliding, decay = friction((np.arange(len(Z)) + 0.5) * dx, which)
    slide, more = dt / inertia * sliding, dt / inertia * (still - sliding)
    I, Kp, Ki, asked = drive
    om, M = np.zeros(len(Z)), np.zeros(len(Z))
    joints, speed, missing, angle = np.cumsum(counts)[:-1], 0.0, 0.0, 0.0
    rows = np.empty((round(duration / dt), 2))
    for row in rows:
        P, Q = M + Z * om, M - Z * om
        down, up = np.append(0.0, P[:-1]), np.append(Q[1:], -P[-1])
        for j in joints:
            between = (P[j - 1] - Q[j]) / (Z[j - 1] + Z[j])
            up[j - 1], down[j] = P[j - 1] - 2 * Z[j - 1] * between, Q[j] + 2 * Z[j] * between
        given = 2 * I / dt * speed + Kp * asked + Ki * (missing + dt / 2 * asked) - Q[0]
        mean = given / (2 * I / dt + Kp + Ki * dt / 2 + Z[0])
        speed, missing = 2 * mean - speed, missing + dt * (asked - mean)
        down[0] = Q[0] + 2 * Z[0] * mean
        om, M = (down - up) / (2 * Z), (down + up) / 2
        size = np.abs(om) * np.exp(-drag * dt)
        new = np.maximum(size - slide, 0)
        for _ in range(5):  # size = new + slide + more exp(-new/decay)
            falling = more * np.exp(-new / decay)
            new = np.maximum(new - (new + slide + falling - size) / (1 - falling / decay), 0)
        om = np.where(size > slide + more, np.sign(om) * new, 0.0)
        angle += dt * om[-1]
        row[:] = om[-1], angle
    return np.arange(1, len(rows) + 1) * dt, *rows.T
