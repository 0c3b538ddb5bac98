/* Contact of nodes with the wall of a tube, with Coulomb friction, where the motion responds linearly to the forces:
   block Gauss-Seidel over the nodes, each of which is solved with its exact law. And, in the same way, contacts of rods
   with each other. */
#include "chain.h"

#include <math.h>
#include <stdlib.h>
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

/* Faster than fmax. */
static double most_of(double a, double b)
{
    return a < b ? b : a;
}

static double dot3(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
}

/* Where a node is across its tube, by its axes u and v there: x from the tube's axis to the rod at the end, e and its
   size where the force acts. The direction round the tube is tau = (-e[1], e[0]). */
typedef struct {
    double x[2], R0, R, both, e[2], share;
} place;

/* moved: motion along u and v in the step. */
static place place_of(const contact *c, int i, const double *moved)
{
    place p;
    const double *x0 = c->start + 2 * i;
    double m[2];
    for (int k = 0; k < 2; k++) {
        p.x[k] = x0[k] + moved[k];
        m[k] = c->at_end ? p.x[k] : x0[k] + p.x[k];
    }
    p.R0 = sqrt(x0[0] * x0[0] + x0[1] * x0[1]), p.R = sqrt(p.x[0] * p.x[0] + p.x[1] * p.x[1]);
    const double size = sqrt(m[0] * m[0] + m[1] * m[1]);
    p.both = c->at_end ? p.R : p.R0 + p.R, p.share = p.both > 0 ? size / p.both : 0;
    for (int k = 0; k < 2; k++) p.e[k] = size > 0 ? m[k] / size : 0;
    return p;
}

/* Where node i is after its motion `moved` (6,), and this motion (4,): along u and v, the slip along the tube, and what
   the rotation about the tube adds to the slip round it. */
static place motion_of(const contact *c, int i, const double *moved, double *motion)
{
    const double *t = c->tangent + 3 * i, *u = c->across + 3 * i, arm = c->arm[i];
    double v[3];
    cross3(t, u, v);
    motion[0] = dot3(u, moved), motion[1] = dot3(v, moved), motion[3] = arm * dot3(t, moved + 3);
    const place p = place_of(c, i, motion);
    motion[2] = dot3(t, moved) + arm * (p.e[1] * dot3(u, moved + 3) - p.e[0] * dot3(v, moved + 3));
    return p;
}

static double slip_round(const place *p, const double *motion)
{
    return p->e[0] * motion[1] - p->e[1] * motion[0] + motion[3];
}

static double dot4(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

/* The motion of node i itself by its forces v, (4,) each. */
static void respond(const contact *c, int i, const double *v, double *Wv)
{
    const size_t width = 4 * (2 * (size_t)c->reach + 1);
    const float *W = c->compliance + i * 4 * width + 4 * c->reach;
    for (int k = 0; k < 4; k++, W++)
        Wv[k] = W[0] * v[0] + W[width] * v[1] + W[2 * width] * v[2] + W[3 * width] * v[3];
}

/* Add numbers of all neighbours of node i, and of itself, by its forces v: `each` of a node. */
static void add_by(const contact *c, int i, const float *by, int each, const double *v, double *all)
{
    const size_t width = each * (2 * (size_t)c->reach + 1);
    const int first = i < c->reach ? 0 : i - c->reach, end = i + c->reach < c->nodes ? i + c->reach + 1 : c->nodes;
    const float *W = by + i * 4 * width + each * (first + c->reach - i);
    double *restrict to = all + each * first;
    for (int j = 0; j < each * (end - first); j++)
        to[j] += W[j] * v[0] + W[j + width] * v[1] + W[j + 2 * width] * v[2] + W[j + 3 * width] * v[3];
}

/* Where the nodes `slots` of a wall begin a step: vectors `away` from the axis of its tube and tangents of that, (count,
   3). The axes across the tube stay as close to those before as can be. */
void begin_contact(contact *c, const int *slots, int count, const double *away, const double *tangent)
{
    for (int k = 0; k < count; k++, away += 3, tangent += 3) {
        double *t = c->tangent + 3 * slots[k], *u = c->across + 3 * slots[k], *x = c->start + 2 * slots[k], v[3];
        memcpy(t, tangent, 3 * sizeof *t);
        if (u[0] == 0 && u[1] == 0 && u[2] == 0) {
            int least = fabs(t[1]) < fabs(t[0]);
            if (fabs(t[2]) < fabs(t[least])) least = 2;
            u[least] = 1;
        }
        const double along = dot3(u, t);
        for (int j = 0; j < 3; j++) u[j] -= along * t[j];
        const double size = sqrt(dot3(u, u));
        for (int j = 0; j < 3; j++) u[j] /= size;
        cross3(t, u, v);
        x[0] = dot3(away, u), x[1] = dot3(away, v);
    }
}

/* The rotation for a change d of the quaternion q. */
static void rotation_by(const double *q, const double *d, double *turned)
{
    const double factor = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    turned[0] = factor * (q[0] * d[1] - q[1] * d[0] - q[3] * d[2] + q[2] * d[3]);
    turned[1] = factor * (q[0] * d[2] - q[2] * d[0] + q[3] * d[1] - q[1] * d[3]);
    turned[2] = factor * (q[0] * d[3] - q[3] * d[0] - q[2] * d[1] + q[1] * d[2]);
}

/* Axes u and v across the tube of node i, and the direction round it times the arm, at the start of the step. */
static void axes_of(const contact *c, int i, double *v, double *round)
{
    const double *u = c->across + 3 * i, *x = c->start + 2 * i, arm = c->arm[i];
    const double size = sqrt(x[0] * x[0] + x[1] * x[1]), share = size > 0 ? arm / size : 0;
    cross3(c->tangent + 3 * i, u, v);
    for (int k = 0; k < 3; k++) round[k] = share * (x[0] * v[k] - x[1] * u[k]);
}

/* Forces and moments (nodes, 6): the unit force of this component, see `compliance`, of the nodes from `first` on that
   are `apart`. */
void unit_forces(const contact *c, int first, int apart, int component, double *forces)
{
    memset(forces, 0, 6 * c->nodes * sizeof *forces);
    for (int i = first; i < c->nodes; i += apart) {
        const double *t = c->tangent + 3 * i, *u = c->across + 3 * i;
        double *force = forces + 6 * i, v[3], round[3];
        axes_of(c, i, v, round);
        for (int k = 0; k < 3; k++) {
            force[k] = component == 0 ? u[k] : component == 1 ? v[k] : component == 2 ? t[k] : 0;
            force[3 + k] = component == 2 ? -round[k] : component == 3 ? c->arm[i] * t[k] : 0;
        }
    }
}

/* Keep the responses to these as compliance: changes of the nodes' unknowns (nodes, 7) with quaternions q (nodes, 4) */
void keep_responses(contact *c, int first, int apart, int component, const double *q, const double *changes)
{
    const int reach = c->reach, width = 2 * reach + 1;
    for (int i = first; i < c->nodes; i += apart)
        for (int j = i - reach; j <= i + reach; j++) {
            const size_t at = ((size_t)i * 4 + component) * width + j - i + reach;
            float *by = c->compliance + 4 * at, *turning = c->turning + 2 * at;
            if (j < 0 || j >= c->nodes || abs(c->points[j] - c->points[i]) > c->coupled) {
                memset(by, 0, 4 * sizeof *by), memset(turning, 0, 2 * sizeof *turning);
                continue;
            }
            const double *t = c->tangent + 3 * j, *u = c->across + 3 * j, *d = changes + 7 * j;
            double v[3], round[3], turned[3];
            axes_of(c, j, v, round);
            rotation_by(q + 4 * j, d + 3, turned);
            by[0] = dot3(u, d), by[1] = dot3(v, d), by[2] = dot3(t, d) - dot3(round, turned);
            by[3] = c->arm[j] * dot3(t, turned);
            turning[0] = dot3(u, turned), turning[1] = dot3(v, turned);
        }
}

/* The motion of all nodes in the step from `before` to unknowns `now`: displacements and rotations, by the mean
   rotation; with them the work of a force and a moment in a step is exact. */
void find_motion(contact *c, const double *now)
{
    const double *before = c->before;
    double *moved = c->moved;
    for (int i = 0; i < c->nodes; i++, before += 7, now += 7, moved += 6) {
        double q[4], d[4];
        for (int k = 0; k < 3; k++) moved[k] = now[k] - before[k];
        for (int k = 0; k < 4; k++) q[k] = (before[3 + k] + now[3 + k]) / 2, d[k] = now[3 + k] - before[3 + k];
        rotation_by(q, d, moved + 3);
    }
}

/* Size of the slip of every node in the step, for the given motion, also of nodes that do not touch. */
void slips(const contact *c, double *size)
{
    for (int i = 0; i < c->nodes; i++) {
        double motion[4];
        const place p = motion_of(c, i, c->moved + 6 * i, motion);
        size[i] = hypot(slip_round(&p, motion), motion[2]);
    }
}

/* Foretell how the normal force N of a node turns as the node moves round the axis by a change of its force: near the
   axis directions found one after the other would grow apart. Nothing is left of this where the change is none. */
static void foretell_turning(const contact *c, int i, const place *p, double N, double *change)
{
    const size_t width = 4 * (2 * (size_t)c->reach + 1);
    const float *W = c->compliance + i * 4 * width + 4 * c->reach;
    const double stiffness = p->both > 0 ? N / p->both : 0;
    if (!(stiffness * (W[0] + W[width + 1]) > LITTLE)) return;
    const double round[4] = {-p->e[1], p->e[0]};
    double by[4], moving[4];
    respond(c, i, round, by), respond(c, i, change, moving);
    const double more = -stiffness * dot4(round, moving) / (1 + stiffness * dot4(round, by));
    for (int k = 0; k < 2; k++) change[k] += more * round[k];
}

/* Solve a node with the forces of all others; returns the size of the change of its motion by its own. */
static double settle_node(contact *c, int i)
{
    double *forces = c->forces + 4 * i, *motion = c->motion + 4 * i, *law = c->law + 3 * i;
    const place p = place_of(c, i, motion);
    if (p.R0 <= c->clearance[i] && p.R <= c->clearance[i] && law[0] == 0 && law[1] == 0 && law[2] == 0) return 0;
    const double inward[4] = {-p.share * p.e[0], -p.share * p.e[1]}, round[4] = {-p.e[1], p.e[0], 0, 1};
    const double along[4] = {0, 0, 1, 0};
    double by[3][4], slip[4], change[4];
    respond(c, i, inward, by[0]);
    const double give = p.R > 0 ? -(p.x[0] * by[0][0] + p.x[1] * by[0][1]) / p.R : 0;
    const double N = settle_normal(c, i, p.R0, p.R, law[0], give);
    double T[2] = {0, 0};
    if (c->friction[i] > 0 && N > 0) {
        respond(c, i, round, by[1]), respond(c, i, along, by[2]);
        for (int k = 0; k < 4; k++) slip[k] = motion[k] + by[0][k] * (N - law[0]);
        const double A[3] = {dot4(round, by[1]), (dot4(round, by[2]) + by[1][2]) / 2, by[2][2]};
        const double b[2] = {dot4(round, slip) - A[0] * law[1] - A[1] * law[2],
                             slip[2] - A[1] * law[1] - A[2] * law[2]};
        settle_friction(A, b, c->friction[i] * N, c->multiplier + i, T);
    }
    law[0] = N, law[1] = T[0], law[2] = T[1];
    for (int k = 0; k < 4; k++) change[k] = N * inward[k] + T[0] * round[k] + T[1] * along[k] - forces[k];
    foretell_turning(c, i, &p, N, change);
    for (int k = 0; k < 4; k++) forces[k] += change[k];
    double moving[4], size = 0;
    respond(c, i, change, moving);
    for (int k = 0; k < 4; k++) size = most_of(size, fabs(moving[k]));
    add_by(c, i, c->compliance, 4, change, c->motion);
    return size;
}

/* Motions and forces of all nodes by their axes, before they are settled. */
static void take_axes(contact *c)
{
    for (int i = 0; i < c->nodes; i++) {
        const double *t = c->tangent + 3 * i, *u = c->across + 3 * i, *force = c->force + 6 * i, *law = c->law + 3 * i;
        double *forces = c->forces + 4 * i, v[3];
        cross3(t, u, v);
        motion_of(c, i, c->moved + 6 * i, c->motion + 4 * i);
        forces[0] = dot3(u, force), forces[1] = dot3(v, force), forces[2] = law[2], forces[3] = law[1];
        for (int k = 0; k < 4; k++) c->earlier[4 * i + k] = forces[k];
    }
}

/* The motion and the forces of all nodes after they are settled. */
static void leave_axes(contact *c)
{
    memset(c->turned, 0, 2 * c->nodes * sizeof *c->turned);
    for (int i = 0; i < c->nodes; i++) {
        double change[4];
        for (int k = 0; k < 4; k++) change[k] = c->forces[4 * i + k] - c->earlier[4 * i + k];
        if (dot4(change, change) > 0) add_by(c, i, c->turning, 2, change, c->turned);
    }
    for (int i = 0; i < c->nodes; i++) {
        const double *t = c->tangent + 3 * i, *u = c->across + 3 * i, *turned = c->turned + 2 * i;
        const double *law = c->law + 3 * i, *motion = c->motion + 4 * i, arm = c->arm[i];
        double *moved = c->moved + 6 * i, *force = c->force + 6 * i, v[3], change[4];
        cross3(t, u, v);
        const place before = motion_of(c, i, moved, change), p = place_of(c, i, motion);
        for (int k = 0; k < 4; k++) change[k] = motion[k] - change[k];
        change[2] += arm * (before.e[0] * turned[1] - before.e[1] * turned[0]); /* of the displacement alone */
        const double spin = arm > 0 ? change[3] / arm : 0;
        const double inward = -law[0] * p.share, in_u = inward * p.e[0] - law[1] * p.e[1];
        const double in_v = inward * p.e[1] + law[1] * p.e[0];
        for (int k = 0; k < 3; k++) {
            moved[k] += change[0] * u[k] + change[1] * v[k] + change[2] * t[k];
            moved[3 + k] += turned[0] * u[k] + turned[1] * v[k] + spin * t[k];
            force[k] = in_u * u[k] + in_v * v[k] + law[2] * t[k] + 0.0; /* never -0 */
            force[3 + k] = arm * (law[1] * t[k] + law[2] * (p.e[1] * u[k] - p.e[0] * v[k])) + 0.0;
        }
    }
}

/* Forces of all nodes with which their law holds, to a share of the first change; the motion follows. Returns the
   number of sweeps. */
int settle(contact *c)
{
    double first = 0, change = INFINITY;
    int sweeps = 0;
    take_axes(c);
    while (sweeps < c->most && change > fmax(c->share * first, c->smallest)) {
        change = 0;
        for (int i = 0; i < c->nodes; i++) change = most_of(change, settle_node(c, sweeps % 2 ? c->nodes - 1 - i : i));
        first = fmax(first, change), sweeps++;
    }
    leave_axes(c);
    return sweeps;
}

/* Whether the normal forces differ from those of the given motion, or a node has crossed the axis while it touches: the
   iteration may converge to a spurious motion. */
int broken(const contact *c)
{
    for (int i = 0; i < c->nodes; i++) {
        const double *law = c->law + 3 * i, *x0 = c->start + 2 * i;
        double slope, motion[4];
        const place p = motion_of(c, i, c->moved + 6 * i, motion);
        const double off = fabs(normal_force(c, i, p.R0, p.R, &slope) - law[0]);
        if (!(off <= 1e-6 * law[0] + 1e-10 * c->stiffness[i])) return 1;
        if (law[0] > 0 && c->clearance[i] > 0 && p.x[0] * x0[0] + p.x[1] * x0[1] <= 0) return 1;
    }
    return 0;
}

/* Stored energy of all nodes at the end of the step, whose motion is given, over that at its start. */
double gained(const contact *c)
{
    double end = 0, start = 0;
    for (int i = 0; i < c->nodes; i++) {
        double motion[4];
        const place p = motion_of(c, i, c->moved + 6 * i, motion);
        const double deep = fmax(p.R - c->clearance[i], 0), before = fmax(p.R0 - c->clearance[i], 0);
        end += c->stiffness[i] * deep * deep / 2, start += c->stiffness[i] * before * before / 2;
    }
    return end - start;
}

/* Energy that friction and damping took in a step whose forces are those of its end: by the mean of both ends, but no
   less than zero at a node. A force that begins or ends in the step is no source of energy; the error of the scheme
   there remains in the energy balance. before: `law` at the start. The motion is given. */
double lost(const contact *c, const double *before)
{
    double sum = 0;
    for (int i = 0; i < c->nodes; i++) {
        const double *end = c->law + 3 * i, *start = before + 3 * i;
        double motion[4];
        const place p = motion_of(c, i, c->moved + 6 * i, motion);
        const double k = c->stiffness[i], gap = c->clearance[i], p0 = fmax(p.R0 - gap, 0);
        const double at_end = end[0] - k * fmax(p.R - gap, 0);
        const double damping = at_end + (p0 > 0 && start[0] == 0 ? at_end : start[0] - k * p0);
        const double friction = (start[1] + end[1]) * slip_round(&p, motion) + (start[2] + end[2]) * motion[2];
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
