/* First-order upwind waves; see upwind_torsion.py for the method. */
#include <math.h>
#include "upwind_torsion.h"

/* The bit over a step, by Euler's explicit rule: it stands where the static torque can stop it within the step. */
static double turn(const upwind *s, double wave, double om)
{
    double Z = s->impedance[1], driven = Z * (wave - om), stop = driven + s->inertia * om / s->dt;
    double size = fabs(om), torque = s->turning + (s->still - s->turning) * exp(-size / s->decay);
    if (fabs(stop) <= (size > 0 ? torque : s->still)) return 0.0;
    double sign = om != 0 ? om : stop;
    return om + s->dt / s->inertia * (driven - copysign(torque, sign));
}

void march(upwind *s, int steps, double *bit_speed, double *top_torque)
{
    int pipe = s->cells[0], all = pipe + s->cells[1];
    double *down = s->down, *up = s->up, ratio = s->impedance[1] / s->impedance[0], brake = s->dt * s->drag / 2;
    for (int k = 0; k < steps; k++) {
        /* what enters at the top, at the step of the impedance, and at the bit */
        double enters = 2 * s->top - up[0];
        double below = (2 * down[pipe - 1] + (ratio - 1) * up[pipe]) / (1 + ratio);
        double above = ((1 - ratio) * down[pipe - 1] + 2 * ratio * up[pipe]) / (1 + ratio);
        double returns = 2 * s->bit - down[all - 1], wave = down[all - 1];
        double came = enters;
        for (int i = 0; i < all; i++) {
            if (i == pipe) came = below;
            double lambda = s->courant[i >= pipe];
            double next = i == all - 1 ? returns : i == pipe - 1 ? above : up[i + 1];
            double D = down[i], U = up[i], source = brake * (D + U);
            down[i] = D - lambda * (D - came) - source;
            up[i] = U + lambda * (next - U) - source;
            came = D;
        }
        s->bit = turn(s, wave, s->bit);
        bit_speed[k] = s->bit;
        top_torque[k] = s->impedance[0] * (s->top - up[0]);
    }
}
