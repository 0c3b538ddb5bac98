/* Contact of nodes with the wall of a tube, with Coulomb friction, where the motion responds linearly to the forces:
   block Gauss-Seidel over the nodes, each of which is solved with its exact law. And, in the same way, contacts of rods
   with each other. */
#include "chain.h"

#include <math.h>
#include <string.h>

enum { MOST_LOCAL = 60 };
/* Compliance times stiffness below which an iteration needs no help. */
static const double LITTLE = 0.1;

/* The normal force of a node, and its derivative by the distance R from the axis at the end of the step; R0: at its
   start. By the discrete gradient of k <R - clearance>^2/2, so that its work is the change of this energy (Gonzalez, J.
   Nonlinear Sci. 6 (1996) 449), or at the end of the step; times 1 + damping * (R - R0)/h (Hunt & Crossley, J. Appl.
   Mech. 42 (1975) 440). */
static double normal_force(const contact *c, int i, double R0, double R, double *slope)
{
    const double k = c->stiffness[i], gap = c->clearance[i], p0 = fmax(R0 - gap, 0), p = fmax(R - gap, 0);
    double n = 0, by_R = 0;
    if (c->at_end)
        n = k * p, by_R = p > 0 ? k : 0;
    else if (p0 > 0 && p > 0)
        n = k * (p0 + p) / 2, by_R = k / 2;
    else if (p0 > 0 || p > 0) {
        const double way = R - R0; /* at least the penetration, in size */
        n = k * (p * p + p0 * p0) / (2 * fabs(way));
        by_R = p > 0 ? k * p / way - n / way : n / -way;
    }
    const double factor = 1 + c->damping[i] * (R - R0) / c->h;
    *slope = 0;
    if (!(factor > 0)) return 0;
    *slope = by_R * factor + n * c->damping[i] / c->h;
    return n * factor;
}

/* The normal force N where R = R_now - give (N - now): by Newton's method within bounds. */
static double settle_normal(const contact *c, int i, double R0, double R_now, double now, double give)
{
    double slope, low, high, R = R_now, n = normal_force(c, i, R0, R, &slope);
    if (!(give > 0)) return n;
    const double other = R_now - give * (n - now);
    low = fmin(R_now, other), high = fmax(R_now, other);
    for (int j = 0; j < MOST_LOCAL && high > low; j++) {
        const double off = n - now - (R_now - R) / give;
        if (off > 0) high = R;
        else low = R;
        double next = R - off / (slope + 1 / give);
        if (!(next >= low && next <= high)) next = (low + high) / 2;
        const double steep = slope;
        const int done = fabs(next - R) <= 1e-15 * (fabs(R) + c->clearance[i]);
        R = next, n = normal_force(c, i, R0, R, &slope);
        if (done || slope == steep) break; /* it is linear there */
    }
    return n;
}

/* T with |T| <= most that makes the slip A T + b zero, or else opposite to T: the minimum of T A T/2 + b T in that
   disc, by Newton's method for the multiplier (More & Sorensen, SIAM J. Sci. Stat. Comput. 4 (1983) 553), from the
   given one. From above its step goes below, and from there it rises to the solution. */
static void settle_friction(const double A[3], const double b[2], double most, double *multiplier, double T[2])
{
    double shift = *multiplier, size = 0;
    T[0] = T[1] = 0;
    const double trace = A[0] + A[2], floor = 1e-14 * trace;
    if (!(most > 0) || !(trace > 0)) return;
    for (int j = 0; j < MOST_LOCAL; j++) {
        const double a = A[0] + shift + floor, d = A[2] + shift + floor, inverse = 1 / (a * d - A[1] * A[1]);
        T[0] = -(d * b[0] - A[1] * b[1]) * inverse, T[1] = -(a * b[1] - A[1] * b[0]) * inverse;
        const double square = T[0] * T[0] + T[1] * T[1];
        size = sqrt(square); /* hypot is slow */
        if ((shift == 0 && size <= most) || fabs(size - most) <= 1e-12 * most) break;
        const double steep = (d * T[0] * T[0] - 2 * A[1] * T[0] * T[1] + a * T[1] * T[1]) * inverse;
        const double next = fmax(shift + square * (size - most) / (steep * most), 0);
        if (!(fabs(next - shift) > 1e-16 * (shift + trace))) break;
        shift = next;
    }
    *multiplier = shift;
    if (size > most) T[0] *= most / size, T[1] *= most / size;
}

static double dot3(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
}

/* Directions at a node: x from the axis to the rod at the end, e and its size where the force acts, tau round it. */
typedef struct {
    double x[3], R0, R, both, e[3], share, tau[3];
} place;

static place place_of(const contact *c, int i)
{
    place p;
    const double *t = c->tangent + 3 * i, *x0 = c->start + 3 * i, *moved = c->moved + 6 * i;
    const double along = dot3(moved, t);
    double m[3];
    for (int k = 0; k < 3; k++) {
        p.x[k] = x0[k] + moved[k] - along * t[k];
        m[k] = c->at_end ? p.x[k] : x0[k] + p.x[k];
    }
    p.R0 = sqrt(dot3(x0, x0)), p.R = sqrt(dot3(p.x, p.x));
    const double size = sqrt(dot3(m, m));
    p.both = c->at_end ? p.R : p.R0 + p.R, p.share = p.both > 0 ? size / p.both : 0;
    for (int k = 0; k < 3; k++) p.e[k] = size > 0 ? m[k] / size : 0;
    cross3(t, p.e, p.tau);
    return p;
}

static double dot6(const double *a, const double *b)
{
    double sum = 0;
    for (int k = 0; k < 6; k++) sum += a[k] * b[k];
    return sum;
}

/* The motion (displacement, rotation) of node i itself by a force and a moment v. */
static void respond(const contact *c, int i, const double *v, double *Wv)
{
    const size_t width = 6 * (2 * (size_t)c->reach + 1);
    const float *W = c->compliance + i * 6 * width + 6 * c->reach;
    for (int k = 0; k < 6; k++) Wv[k] = 0;
    for (int m = 0; m < 6; m++, W += width)
        for (int k = 0; k < 6; k++) Wv[k] += W[k] * v[m];
}

/* Add the motion of all neighbours of node i, and of itself, by a force and a moment v. */
static void move_by(const contact *c, int i, const double *v)
{
    const size_t width = 6 * (2 * (size_t)c->reach + 1);
    const int first = i < c->reach ? 0 : i - c->reach, end = i + c->reach < c->nodes ? i + c->reach + 1 : c->nodes;
    const float *W = c->compliance + i * 6 * width + 6 * (first + c->reach - i);
    double *restrict to = c->moved + 6 * first;
    for (int j = 0; j < 6 * (end - first); j++)
        to[j] += W[j] * v[0] + W[j + width] * v[1] + W[j + 2 * width] * v[2] + W[j + 3 * width] * v[3]
               + W[j + 4 * width] * v[4] + W[j + 5 * width] * v[5];
}

/* The motion of all nodes in the step from `before` to unknowns `now`: displacements and rotations, by the mean
   rotation; with them the work of a force and a moment in a step is exact. */
void find_motion(contact *c, const double *now)
{
    const double *before = c->before;
    double *moved = c->moved;
    for (int i = 0; i < c->nodes; i++, before += 7, now += 7, moved += 6) {
        double q[4], d[4], size = 0;
        for (int k = 0; k < 3; k++) moved[k] = now[k] - before[k];
        for (int k = 0; k < 4; k++) {
            q[k] = (before[3 + k] + now[3 + k]) / 2, d[k] = now[3 + k] - before[3 + k];
            size += q[k] * q[k];
        }
        moved[3] = 2 / size * (q[0] * d[1] - q[1] * d[0] - q[3] * d[2] + q[2] * d[3]);
        moved[4] = 2 / size * (q[0] * d[2] - q[2] * d[0] + q[3] * d[1] - q[1] * d[3]);
        moved[5] = 2 / size * (q[0] * d[3] - q[3] * d[0] - q[2] * d[1] + q[1] * d[2]);
    }
}

/* Forces and moments of unit friction round and along the axis; their work by a motion is the slip. */
static void slip_directions(const contact *c, int i, const place *p, double *across, double *along)
{
    const double *t = c->tangent + 3 * i, arm = c->arm[i];
    for (int k = 0; k < 3; k++) {
        across[k] = p->tau[k], across[3 + k] = arm * t[k];
        along[k] = t[k], along[3 + k] = -arm * p->tau[k];
    }
}

/* Size of the slip of every node in the step, for the given motion, also of nodes that do not touch. */
void slips(const contact *c, double *size)
{
    for (int i = 0; i < c->nodes; i++) {
        double across[6], along[6];
        const place p = place_of(c, i);
        slip_directions(c, i, &p, across, along);
        size[i] = hypot(dot6(across, c->moved + 6 * i), dot6(along, c->moved + 6 * i));
    }
}

/* Foretell how the normal force N of a node turns as the node moves round the axis by a change of its force: near the
   axis directions found one after the other would grow apart. Nothing is left of this where the change is none. */
static void foretell_turning(const contact *c, int i, const place *p, double N, double *change)
{
    const size_t width = 6 * (2 * (size_t)c->reach + 1);
    const float *W = c->compliance + i * 6 * width + 6 * c->reach;
    const double stiffness = p->both > 0 ? N / p->both : 0;
    if (!(stiffness * (W[0] + W[width + 1] + W[2 * width + 2]) > LITTLE)) return;
    double round[6] = {p->tau[0], p->tau[1], p->tau[2]}, by[6], moving[6];
    respond(c, i, round, by), respond(c, i, change, moving);
    const double more = -stiffness * dot3(round, moving) / (1 + stiffness * dot3(round, by));
    for (int k = 0; k < 3; k++) change[k] += more * round[k];
}

/* Solve a node with the forces of all others; returns the size of the change of its motion by its own. */
static double settle_node(contact *c, int i)
{
    double *force = c->force + 6 * i, *moved = c->moved + 6 * i, *law = c->law + 3 * i;
    const place p = place_of(c, i);
    if (p.R0 <= c->clearance[i] && p.R <= c->clearance[i] && law[0] == 0 && law[1] == 0 && law[2] == 0) return 0;
    double inward[6] = {0}, across[6], along[6], out[6] = {0}, by[3][6], slip[6], change[6];
    for (int k = 0; k < 3; k++) inward[k] = -p.share * p.e[k], out[k] = p.R > 0 ? p.x[k] / p.R : 0;
    slip_directions(c, i, &p, across, along);
    respond(c, i, inward, by[0]);
    const double N = settle_normal(c, i, p.R0, p.R, law[0], -dot6(out, by[0]));
    double T[2] = {0, 0};
    if (c->friction[i] > 0 && N > 0) {
        respond(c, i, across, by[1]), respond(c, i, along, by[2]);
        for (int k = 0; k < 6; k++) slip[k] = moved[k] + by[0][k] * (N - law[0]);
        const double A[3] = {dot6(across, by[1]), (dot6(across, by[2]) + dot6(along, by[1])) / 2, dot6(along, by[2])};
        const double b[2] = {dot6(across, slip) - A[0] * law[1] - A[1] * law[2],
                             dot6(along, slip) - A[1] * law[1] - A[2] * law[2]};
        settle_friction(A, b, c->friction[i] * N, c->multiplier + i, T);
    }
    law[0] = N, law[1] = T[0], law[2] = T[1];
    for (int k = 0; k < 6; k++) change[k] = N * inward[k] + T[0] * across[k] + T[1] * along[k] - force[k];
    foretell_turning(c, i, &p, N, change);
    for (int k = 0; k < 6; k++) force[k] += change[k];
    double moving[6], size = 0;
    respond(c, i, change, moving);
    for (int k = 0; k < 6; k++) size = fmax(size, fabs(moving[k]) * (k < 3 ? 1 : c->arm[i]));
    move_by(c, i, change);
    return size;
}

/* Forces of all nodes with which their law holds, to a share of the first change; the motion follows. Returns the
   number of sweeps. */
int settle(contact *c)
{
    double first = 0;
    for (int sweep = 0; sweep < c->most; sweep++) {
        double change = 0;
        for (int i = 0; i < c->nodes; i++) change = fmax(change, settle_node(c, sweep % 2 ? c->nodes - 1 - i : i));
        if (!isfinite(change)) return c->most;
        first = fmax(first, change);
        if (change <= fmax(c->share * first, c->smallest)) return sweep + 1;
    }
    return c->most;
}

/* Whether the normal forces differ from those of the given motion, or a node has crossed the axis while it touches: the
   iteration may converge to a spurious motion. */
int broken(const contact *c)
{
    for (int i = 0; i < c->nodes; i++) {
        const double *law = c->law + 3 * i;
        double slope;
        const place p = place_of(c, i);
        const double off = fabs(normal_force(c, i, p.R0, p.R, &slope) - law[0]);
        if (!(off <= 1e-6 * law[0] + 1e-10 * c->stiffness[i])) return 1;
        if (law[0] > 0 && c->clearance[i] > 0 && dot3(p.x, c->start + 3 * i) <= 0) return 1;
    }
    return 0;
}

/* Stored energy of all nodes at the end of the step, whose motion is given, or at its start. */
double stored(const contact *c, int at_start)
{
    double sum = 0;
    for (int i = 0; i < c->nodes; i++) {
        const place p = place_of(c, i);
        const double deep = fmax((at_start ? p.R0 : p.R) - c->clearance[i], 0);
        sum += c->stiffness[i] * deep * deep / 2;
    }
    return sum;
}

/* Energy that friction and damping took in a step whose forces are those of its end: by the mean of both ends, but no
   less than zero at a node. A force that begins or ends in the step is no source of energy; the error of the scheme
   there remains in the energy balance. before: `law` at the start. The motion is given. */
double lost(const contact *c, const double *before)
{
    double sum = 0;
    for (int i = 0; i < c->nodes; i++) {
        const double *t = c->tangent + 3 * i, *moved = c->moved + 6 * i, *end = c->law + 3 * i, *start = before + 3 * i;
        const place p = place_of(c, i);
        const double k = c->stiffness[i], arm = c->arm[i], gap = c->clearance[i], p0 = fmax(p.R0 - gap, 0);
        const double round = dot3(p.tau, moved) + arm * dot3(t, moved + 3);
        const double along = dot3(t, moved) - arm * dot3(p.tau, moved + 3);
        const double at_end = end[0] - k * fmax(p.R - gap, 0);
        const double damping = at_end + (p0 > 0 && start[0] == 0 ? at_end : start[0] - k * p0);
        const double friction = (start[1] + end[1]) * round + (start[2] + end[2]) * along;
        sum += fmax(damping * (p.R - p.R0) / 2, 0) + fmax(-friction / 2, 0);
    }
    return sum;
}

/* ---- rods that touch each other ---------------------------------------------------------------------------------- */

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
