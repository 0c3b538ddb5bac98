/* Contacts of rods with each other in a time step, with Coulomb friction, where the motion responds linearly to the
   forces: block Gauss-Seidel over the contacts, as contact.c has it for nodes at walls. */
#include "chain.h"

#include <math.h>
#include <string.h>

/* Solve contact i with the forces of all others; returns the size of the change of its motion by its own. */
static double settle_pair(pairs *c, int i)
{
    const int parts = c->parts, all = c->count * parts;
    const double *A = c->compliance + (size_t)i * parts * all + i * parts; /* A[k all + j]: j by a unit force k */
    double *motion = c->motion + i * parts, *force = c->force + i * parts, change[3] = {0}, T[2] = {0};
    const double slope = c->slope[i];
    const double gap = motion[0] - A[0] * force[0];
    const double N = fmax((c->normal[i] - slope * (gap - c->gap[i])) / (1 + slope * A[0]), 0);
    change[0] = N - force[0];
    if (parts == 3) {
        const double B[3] = {A[all + 1], (A[all + 2] + A[2 * all + 1]) / 2, A[2 * all + 2]};
        const double b[2] = {motion[1] + A[1] * change[0] - B[0] * force[1] - B[1] * force[2],
                             motion[2] + A[2] * change[0] - B[1] * force[1] - B[2] * force[2]};
        settle_friction(B, b, c->friction * N, c->multiplier + i, T);
        change[1] = T[0] - force[1], change[2] = T[1] - force[2];
    }
    double size = 0;
    for (int k = 0; k < parts; k++) {
        const double *column = c->compliance + ((size_t)i * parts + k) * all, by = change[k];
        force[k] += by;
        if (by == 0) continue;
        for (int j = 0; j < all; j++) c->motion[j] += column[j] * by;
        size = fmax(size, fabs(column[i * parts + k] * by));
    }
    return size;
}

/* Forces of all contacts with which their laws hold; the motion follows. Returns the number of sweeps. */
int settle_pairs(pairs *c)
{
    double first = 0;
    for (int sweep = 0; sweep < c->most; sweep++) {
        double change = 0;
        for (int i = 0; i < c->count; i++) change = fmax(change, settle_pair(c, sweep % 2 ? c->count - 1 - i : i));
        if (!isfinite(change)) return c->most;
        first = fmax(first, change);
        if (change <= fmax(c->share * first, c->smallest)) return sweep + 1;
    }
    return c->most;
}
