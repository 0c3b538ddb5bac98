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

/* ---- four nodes at once ------------------------------------------------------------------------------------------ */

/* Nodes far apart are solved together, one in each lane of a vector: the forces of one do not move the others. */
typedef double vector __attribute__((vector_size(LANES * sizeof(double))));
typedef double place_of_vector __attribute__((vector_size(LANES * sizeof(double)), aligned(sizeof(double)), may_alias));
typedef float place_of_floats __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));
typedef __typeof__((vector){0} < (vector){0}) mask;

static inline vector load(const double *from)
{
    return *(const place_of_vector *)from;
}

static inline vector widen(const float *from)
{
    return __builtin_convertvector(*(const place_of_floats *)from, vector);
}

static inline void keep(vector a, double *to)
{
    *(place_of_vector *)to = a;
}

static inline int any(mask m)
{
    int found = 0;
    for (int k = 0; k < LANES; k++) found |= m[k] != 0;
    return found;
}

static inline vector choose(mask m, vector yes, vector no)
{
    return (vector)((m & (mask)yes) | (~m & (mask)no));
}

static inline vector only(mask m, vector a)
{
    return (vector)(m & (mask)a);
}

static inline vector root(vector a)
{
    for (int k = 0; k < LANES; k++) a[k] = sqrt(a[k]); /* hypot is slow */
    return a;
}

static inline vector greater(vector a, vector b)
{
    return choose(a < b, b, a);
}

static inline vector absolute(vector a)
{
    return greater(a, -a);
}

/* The law of a wall for nodes: from the tube's axis to the rod at the start, by u and v; sizes; the last forces
   (normal, friction round and along) and multiplier. */
typedef struct {
    vector start[2], clearance, stiffness, friction, damping, law[3], multiplier;
} walled;
enum { WALLED = sizeof(walled) / sizeof(vector) };

/* Node of a lane at a position, or -1. */
static inline int node_of(const contact *c, int i, int lane)
{
    const int node = lane * c->positions + i;
    return lane < c->lanes && node < c->nodes ? node : -1;
}

static walled walled_at(const contact *c, int i)
{
    walled w = {0};
    for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++) {
        for (int k = 0; k < 2; k++) w.start[k][lane] = c->start[2 * j + k];
        w.clearance[lane] = c->clearance[j], w.stiffness[lane] = c->stiffness[j];
        w.friction[lane] = c->friction[j], w.damping[lane] = c->damping[j], w.multiplier[lane] = c->multiplier[j];
        for (int k = 0; k < 3; k++) w.law[k][lane] = c->law[3 * j + k];
    }
    return w;
}

/* The normal force of a node, and its derivative by the distance R from the axis at the end of the step; R0: at its
   start. By the discrete gradient of k <R - clearance>^2/2, so that its work is the change of this energy (Gonzalez, J.
   Nonlinear Sci. 6 (1996) 449), or at the end of the step; times 1 + damping * (R - R0)/h (Hunt & Crossley, J. Appl.
   Mech. 42 (1975) 440). */
static inline vector normal_force(const contact *c, const walled *w, vector R0, vector R, vector *slope)
{
    const vector none = {0}, k = w->stiffness;
    const vector p0 = greater(R0 - w->clearance, none), p = greater(R - w->clearance, none);
    vector n, by_R;
    if (c->at_end)
        n = k * p, by_R = only(p > 0, k);
    else {
        const mask both = (p0 > 0) & (p > 0), either = ~both & ((p0 > 0) | (p > 0));
        n = only(both, k * (p0 + p) / 2), by_R = only(both, k / 2);
        if (any(either)) {
            const vector way = R - R0; /* at least the penetration, in size */
            const vector less = k * (p * p + p0 * p0) / (2 * absolute(way));
            n = choose(either, less, n);
            by_R = choose(either, choose(p > 0, k * p / way - less / way, less / -way), by_R);
        }
    }
    const vector by_h = w->damping / c->h, factor = 1 + by_h * (R - R0);
    *slope = only(factor > 0, by_R * factor + n * by_h);
    return only(factor > 0, n * factor);
}

/* The normal force N where R = R_now - give (N - now), of nodes that are `live`: by Newton's method within bounds. */
static inline vector settle_normal(const contact *c, const walled *w, mask live, vector R0, vector R_now, vector give)
{
    const vector now = w->law[0];
    vector slope, R = R_now, n = normal_force(c, w, R0, R, &slope);
    const vector other = R_now - give * (n - now);
    vector low = choose(R_now < other, R_now, other), high = greater(R_now, other);
    live &= (give > 0) & (high > low);
    for (int j = 0; j < MOST_LOCAL && any(live); j++) {
        const vector off = n - now - (R_now - R) / give;
        high = choose(live & (off > 0), R, high), low = choose(live & ~(off > 0), R, low);
        vector next = R - off / (slope + 1 / give), steep = slope;
        next = choose((next >= low) & (next <= high), next, (low + high) / 2);
        const mask done = absolute(next - R) <= 1e-15 * (absolute(R) + w->clearance);
        R = choose(live, next, R), next = normal_force(c, w, R0, R, &slope);
        n = choose(live, next, n), slope = choose(live, slope, steep);
        live &= ~(done | (slope == steep)) & (high > low); /* it is linear there */
    }
    return n;
}

/* T with |T| <= most that makes the slip A T + b zero, or else opposite to T: the minimum of T A T/2 + b T in that
   disc, by Newton's method for the multiplier (More & Sorensen, SIAM J. Sci. Stat. Comput. 4 (1983) 553), from the
   given one. From above its step goes below, and from there it rises to the solution. `live`: where it is asked for;
   zero elsewhere. */
static inline void settle_friction(const vector A[3], const vector b[2], vector most, mask live, vector *multiplier,
                                   vector T[2])
{
    const vector trace = A[0] + A[2], floor = 1e-14 * trace, none = {0};
    vector shift = *multiplier, size = none;
    T[0] = T[1] = none;
    live &= (most > 0) & (trace > 0);
    for (int j = 0; j < MOST_LOCAL && any(live); j++) {
        const vector a = A[0] + shift + floor, d = A[2] + shift + floor, inverse = 1 / (a * d - A[1] * A[1]);
        const vector x = -(d * b[0] - A[1] * b[1]) * inverse, y = -(a * b[1] - A[1] * b[0]) * inverse;
        const vector square = x * x + y * y, length = root(square);
        T[0] = choose(live, x, T[0]), T[1] = choose(live, y, T[1]), size = choose(live, length, size);
        live &= ~(((shift == 0) & (length <= most)) | (absolute(length - most) <= 1e-12 * most));
        const vector steep = (d * x * x - 2 * A[1] * x * y + a * y * y) * inverse;
        const vector next = greater(shift + square * (length - most) / (steep * most), none);
        live &= absolute(next - shift) > 1e-16 * (shift + trace);
        shift = choose(live, next, shift);
    }
    *multiplier = shift;
    const vector less = choose(size > most, most / size, 1 + none);
    T[0] *= less, T[1] *= less;
}

static double dot3(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
}

/* Where nodes are across their tubes, by the axes u and v there: x from the tube's axis to the rod at the end, e and
   its size where the force acts. The direction round the tube is tau = (-e[1], e[0]). */
typedef struct {
    vector x[2], R0, R, both, e[2], share;
} place;

/* moved: motion along u and v in the step. */
static inline place place_of(const contact *c, const vector *x0, const vector *moved)
{
    place p;
    vector m[2];
    for (int k = 0; k < 2; k++) {
        p.x[k] = x0[k] + moved[k];
        m[k] = c->at_end ? p.x[k] : x0[k] + p.x[k];
    }
    p.R0 = root(x0[0] * x0[0] + x0[1] * x0[1]), p.R = root(p.x[0] * p.x[0] + p.x[1] * p.x[1]);
    const vector size = c->at_end ? p.R : root(m[0] * m[0] + m[1] * m[1]);
    p.both = c->at_end ? p.R : p.R0 + p.R, p.share = only(p.both > 0, size / p.both);
    for (int k = 0; k < 2; k++) p.e[k] = only(size > 0, m[k] / size);
    return p;
}

/* Where the nodes at position i are after their motion `moved` (6,), and this motion (4,): along u and v, the slip
   along the tube, and what the rotation about the tube adds to the slip round it. */
static place motion_of(const contact *c, int i, const walled *w, vector *motion)
{
    vector tilt[2] = {0};
    for (int k = 0; k < 4; k++) motion[k] = tilt[0];
    for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++) {
        const double *t = c->tangent + 3 * j, *u = c->across + 3 * j, *moved = c->moved + 6 * j, arm = c->arm[j];
        double v[3];
        cross3(t, u, v);
        motion[0][lane] = dot3(u, moved), motion[1][lane] = dot3(v, moved), motion[2][lane] = dot3(t, moved);
        motion[3][lane] = arm * dot3(t, moved + 3);
        tilt[0][lane] = arm * dot3(u, moved + 3), tilt[1][lane] = arm * dot3(v, moved + 3);
    }
    const place p = place_of(c, w->start, motion);
    motion[2] += p.e[1] * tilt[0] - p.e[0] * tilt[1];
    return p;
}

static inline vector slip_round(const place *p, const vector *motion)
{
    return p->e[0] * motion[1] - p->e[1] * motion[0] + motion[3];
}

static inline vector dot4(const vector *a, const vector *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

/* The motion of nodes themselves by their forces v, (4,) each; W (4, 4): their compliance. */
static inline void respond(vector W[4][4], const vector *v, vector *Wv)
{
    for (int k = 0; k < 4; k++) Wv[k] = W[0][k] * v[0] + W[1][k] * v[1] + W[2][k] * v[2] + W[3][k] * v[3];
}

/* Numbers of nodes by the forces v of others. */
static inline vector by_forces(const float *W, int width, const vector *v)
{
    return widen(W) * v[0] + widen(W + width) * v[1] + widen(W + 2 * width) * v[2] + widen(W + 3 * width) * v[3];
}

/* Add numbers to the nodes at a position beyond the ends of lanes, whose nodes follow each other. */
static void add_beyond(const contact *c, int j, const float *W, int width, int each, const vector *v, double *all)
{
    for (int k = 0; k < each; k++) {
        const vector more = by_forces(W + LANES * k, width, v);
        for (int lane = j < 0; lane < c->lanes && lane * c->positions + j < c->nodes; lane++) {
            const int node = lane * c->positions + j;
            all[LANES * (each * (node % c->positions) + k) + node / c->positions] += more[lane];
        }
    }
}

/* Add numbers of all neighbours of the nodes at position i, and of themselves, by their forces v: `each` of a node. */
static inline void add_by(const contact *c, int i, const float *by, int each, const vector *v, double *all)
{
    const int reach = c->reach, width = LANES * each * (2 * reach + 1), step = LANES * each;
    const float *W = by + (size_t)i * 4 * width + step * reach;
    const int first = i < reach ? -i : -reach, last = i + reach < c->positions ? reach : c->positions - 1 - i;
    double *to = all + step * (i + first);
    const vector a[4] = {v[0], v[1], v[2], v[3]};
    for (int j = step * first; j < step * (last + 1); j += LANES, to += LANES)
        keep(load(to) + by_forces(W + j, width, a), to);
    for (int j = -reach; j < first; j++) add_beyond(c, i + j, W + step * j, width, each, v, all);
    for (int j = last + 1; j <= reach; j++) add_beyond(c, i + j, W + step * j, width, each, v, all);
}

/* Where the nodes `slots` of a wall begin a step: vectors `away` from the axis of its tube and tangents of that,
   (count, 3). The axes across the tube stay as close to those before as can be. */
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
    const int reach = c->reach;
    const size_t width = 2 * reach + 1;
    for (int i = first; i < c->nodes; i += apart)
        for (int j = i - reach; j <= i + reach; j++) {
            const size_t at = ((i % c->positions) * 4 + component) * width + j - i + reach;
            const int lane = i / c->positions;
            float *by = c->compliance + LANES * 4 * at + lane, *turning = c->turning + LANES * 2 * at + lane;
            if (j < 0 || j >= c->nodes || abs(c->points[j] - c->points[i]) > c->coupled) {
                for (int k = 0; k < 4; k++) by[LANES * k] = turning[LANES * (k / 2)] = 0;
                continue;
            }
            const double *t = c->tangent + 3 * j, *u = c->across + 3 * j, *d = changes + 7 * j;
            double v[3], round[3], turned[3];
            axes_of(c, j, v, round);
            rotation_by(q + 4 * j, d + 3, turned);
            by[0] = dot3(u, d), by[LANES] = dot3(v, d), by[2 * LANES] = dot3(t, d) - dot3(round, turned);
            by[3 * LANES] = c->arm[j] * dot3(t, turned);
            turning[0] = dot3(u, turned), turning[LANES] = dot3(v, turned);
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
    for (int i = 0; i < c->positions; i++) {
        vector motion[4];
        const walled w = walled_at(c, i);
        const place p = motion_of(c, i, &w, motion);
        const vector slip = slip_round(&p, motion);
        for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++)
            size[j] = hypot(slip[lane], motion[2][lane]);
    }
}

/* Foretell how the normal force N of a node turns as the node moves round the axis by a change of its force: near the
   axis directions found one after the other would grow apart. Nothing is left of this where the change is none. */
static inline void foretell_turning(vector W[4][4], const place *p, vector N, vector *change)
{
    const vector none = {0}, stiffness = only(p->both > 0, N / p->both);
    const mask needed = stiffness * (W[0][0] + W[1][1]) > LITTLE;
    if (!any(needed)) return;
    const vector round[4] = {-p->e[1], p->e[0], none, none};
    vector by[4], moving[4];
    respond(W, round, by), respond(W, change, moving);
    const vector more = only(needed, -stiffness * dot4(round, moving) / (1 + stiffness * dot4(round, by)));
    for (int k = 0; k < 2; k++) change[k] += more * round[k];
}

/* Solve the nodes at position i with the forces of all others; returns the size of the change of their motion by their
   own. */
static vector settle_nodes(contact *c, int i)
{
    double *w = c->walled + (size_t)LANES * WALLED * i, *forces = c->forces + LANES * 4 * i;
    walled here;
    const vector none = {0};
    vector motion[4], W[4][4], by[3][4], slip[4], change[4], moving[4], T[2] = {none, none}, size = none;
    memcpy(&here, w, sizeof here);
    for (int k = 0; k < 4; k++) motion[k] = load(c->motion + LANES * (4 * i + k));
    const place p = place_of(c, here.start, motion);
    const mask idle = (p.R0 <= here.clearance) & (p.R <= here.clearance) & (here.law[0] == 0) & (here.law[1] == 0)
                      & (here.law[2] == 0);
    if (!any(~idle)) return none;
    for (int k = 0; k < 4; k++)
        for (int l = 0; l < 4; l++)
            W[k][l] = widen(c->compliance + LANES * (4 * ((4 * (size_t)i + k) * (2 * c->reach + 1) + c->reach) + l));
    const vector inward[4] = {-p.share * p.e[0], -p.share * p.e[1], none, none};
    const vector round[4] = {-p.e[1], p.e[0], none, 1 + none}, along[4] = {none, none, 1 + none, none};
    respond(W, inward, by[0]);
    const vector give = only(p.R > 0, -(p.x[0] * by[0][0] + p.x[1] * by[0][1]) / p.R);
    const vector N = settle_normal(c, &here, ~idle, p.R0, p.R, give);
    const mask rubs = ~idle & (here.friction > 0) & (N > 0);
    if (any(rubs)) {
        respond(W, round, by[1]), respond(W, along, by[2]);
        for (int k = 0; k < 4; k++) slip[k] = motion[k] + by[0][k] * (N - here.law[0]);
        const vector A[3] = {dot4(round, by[1]), (dot4(round, by[2]) + by[1][2]) / 2, by[2][2]};
        const vector b[2] = {dot4(round, slip) - A[0] * here.law[1] - A[1] * here.law[2],
                             slip[2] - A[1] * here.law[1] - A[2] * here.law[2]};
        settle_friction(A, b, here.friction * N, rubs, &here.multiplier, T);
    }
    here.law[0] = only(~idle, N), here.law[1] = T[0], here.law[2] = T[1];
    for (int k = 0; k < 4; k++)
        change[k] = only(~idle, N * inward[k] + T[0] * round[k] + T[1] * along[k] - load(forces + LANES * k));
    foretell_turning(W, &p, here.law[0], change);
    for (int k = 0; k < 4; k++) keep(load(forces + LANES * k) + change[k], forces + LANES * k);
    memcpy(w, &here, sizeof here);
    respond(W, change, moving);
    for (int k = 0; k < 4; k++) size = greater(size, absolute(moving[k]));
    add_by(c, i, c->compliance, 4, change, c->motion);
    return size;
}

/* Motions and forces of all nodes by their axes, before they are settled. */
static void take_axes(contact *c)
{
    for (int i = 0; i < c->positions; i++) {
        const walled w = walled_at(c, i);
        vector motion[4], forces[4] = {0};
        motion_of(c, i, &w, motion);
        forces[2] = w.law[2], forces[3] = w.law[1];
        for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++) {
            const double *u = c->across + 3 * j, *force = c->force + 6 * j;
            double v[3];
            cross3(c->tangent + 3 * j, u, v);
            forces[0][lane] = dot3(u, force), forces[1][lane] = dot3(v, force);
        }
        memcpy(c->walled + (size_t)LANES * WALLED * i, &w, sizeof w);
        memcpy(c->motion + LANES * 4 * i, motion, sizeof motion);
        memcpy(c->forces + LANES * 4 * i, forces, sizeof forces);
    }
    memcpy(c->earlier, c->forces, (size_t)LANES * 4 * c->positions * sizeof *c->forces);
}

/* The motion and the forces of all nodes after they are settled. */
static void leave_axes(contact *c)
{
    memset(c->turned, 0, LANES * 2 * c->positions * sizeof *c->turned);
    for (int i = 0; i < c->positions; i++) {
        vector change[4];
        for (int k = 0; k < 4; k++) {
            const int at = LANES * (4 * i + k);
            change[k] = load(c->forces + at) - load(c->earlier + at);
        }
        if (any(dot4(change, change) > 0)) add_by(c, i, c->turning, 2, change, c->turned);
    }
    for (int i = 0; i < c->positions; i++) {
        walled w;
        vector change[4], motion[4], turned[2];
        memcpy(&w, c->walled + (size_t)LANES * WALLED * i, sizeof w);
        const place before = motion_of(c, i, &w, change);
        for (int k = 0; k < 4; k++) {
            motion[k] = load(c->motion + LANES * (4 * i + k));
            change[k] = motion[k] - change[k];
        }
        for (int k = 0; k < 2; k++) turned[k] = load(c->turned + LANES * (2 * i + k));
        const place p = place_of(c, w.start, motion);
        const vector tilt = before.e[0] * turned[1] - before.e[1] * turned[0], inward = -w.law[0] * p.share;
        const vector in_u = inward * p.e[0] - w.law[1] * p.e[1], in_v = inward * p.e[1] + w.law[1] * p.e[0];
        for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++) {
            const double *t = c->tangent + 3 * j, *u = c->across + 3 * j, arm = c->arm[j];
            const double spin = arm > 0 ? change[3][lane] / arm : 0, round = w.law[1][lane], along = w.law[2][lane];
            const double slid = change[2][lane] + arm * tilt[lane]; /* of the displacement alone */
            double *moved = c->moved + 6 * j, *force = c->force + 6 * j, v[3];
            cross3(t, u, v);
            for (int k = 0; k < 3; k++) {
                moved[k] += change[0][lane] * u[k] + change[1][lane] * v[k] + slid * t[k];
                moved[3 + k] += turned[0][lane] * u[k] + turned[1][lane] * v[k] + spin * t[k];
                force[k] = in_u[lane] * u[k] + in_v[lane] * v[k] + along * t[k] + 0.0; /* never -0 */
                force[3 + k] = arm * (round * t[k] + along * (p.e[1][lane] * u[k] - p.e[0][lane] * v[k])) + 0.0;
                c->law[3 * j + k] = w.law[k][lane];
            }
            c->multiplier[j] = w.multiplier[lane];
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
        vector largest = {0};
        for (int i = 0; i < c->positions; i++)
            largest = greater(largest, settle_nodes(c, sweeps % 2 ? c->positions - 1 - i : i));
        change = 0;
        for (int k = 0; k < LANES; k++) change = fmax(change, largest[k]);
        first = fmax(first, change), sweeps++;
    }
    leave_axes(c);
    return sweeps;
}

/* Whether the normal forces differ from those of the given motion, or a node has crossed the axis while it touches: the
   iteration may converge to a spurious motion. */
int broken(const contact *c)
{
    for (int i = 0; i < c->positions; i++) {
        vector slope, motion[4];
        const walled w = walled_at(c, i);
        const place p = motion_of(c, i, &w, motion);
        const vector off = absolute(normal_force(c, &w, p.R0, p.R, &slope) - w.law[0]);
        if (any(~(off <= 1e-6 * w.law[0] + 1e-10 * w.stiffness))) return 1;
        const vector turned = p.x[0] * w.start[0] + p.x[1] * w.start[1];
        if (any((w.law[0] > 0) & (w.clearance > 0) & (turned <= 0))) return 1;
    }
    return 0;
}

static double sum_of(vector a)
{
    double sum = 0;
    for (int k = 0; k < LANES; k++) sum += a[k];
    return sum;
}

/* Stored energy of all nodes at the end of the step, whose motion is given, over that at its start. */
double gained(const contact *c)
{
    vector end = {0}, start = end;
    const vector none = {0};
    for (int i = 0; i < c->positions; i++) {
        vector motion[4];
        const walled w = walled_at(c, i);
        const place p = motion_of(c, i, &w, motion);
        const vector deep = greater(p.R - w.clearance, none), before = greater(p.R0 - w.clearance, none);
        end += w.stiffness * deep * deep / 2, start += w.stiffness * before * before / 2;
    }
    return sum_of(end) - sum_of(start);
}

/* Energy that friction and damping took in a step whose forces are those of its end: by the mean of both ends, but no
   less than zero at a node. A force that begins or ends in the step is no source of energy; the error of the scheme
   there remains in the energy balance. before: `law` at the start. The motion is given. */
double lost(const contact *c, const double *before)
{
    vector sum = {0};
    const vector none = {0};
    for (int i = 0; i < c->positions; i++) {
        vector motion[4], start[3] = {0};
        const walled w = walled_at(c, i);
        const place p = motion_of(c, i, &w, motion);
        for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++)
            for (int k = 0; k < 3; k++) start[k][lane] = before[3 * j + k];
        const vector k = w.stiffness, p0 = greater(p.R0 - w.clearance, none);
        const vector at_end = w.law[0] - k * greater(p.R - w.clearance, none);
        const vector damping = at_end + choose((p0 > 0) & (start[0] == 0), at_end, start[0] - k * p0);
        const vector round = slip_round(&p, motion) * (start[1] + w.law[1]), along = motion[2] * (start[2] + w.law[2]);
        sum += greater(damping * (p.R - p.R0) / 2, none) + greater(-(round + along) / 2, none);
    }
    return sum_of(sum);
}

/* ---- rods that touch each other ---------------------------------------------------------------------------------- */

/* Solve contact i with the forces of all others; returns the size of the change of its motion by its own. */
static double settle_pair(pairs *c, int i)
{
    const int parts = c->parts, all = c->count * parts;
    const double *A = c->compliance + (size_t)i * parts * all + i * parts; /* A[k all + j]: j by a unit force k */
    double *motion = c->motion + i * parts, *force = c->force + i * parts, change[3] = {0};
    const double slope = c->slope[i];
    const double gap = motion[0] - A[0] * force[0];
    const double N = fmax((c->normal[i] - slope * (gap - c->gap[i])) / (1 + slope * A[0]), 0);
    change[0] = N - force[0];
    if (parts == 3) {
        const double B[3] = {A[all + 1], (A[all + 2] + A[2 * all + 1]) / 2, A[2 * all + 2]};
        const vector none = {0}, C[3] = {none + B[0], none + B[1], none + B[2]};
        const vector b[2] = {none + motion[1] + A[1] * change[0] - B[0] * force[1] - B[1] * force[2],
                             none + motion[2] + A[2] * change[0] - B[1] * force[1] - B[2] * force[2]};
        vector T[2], multiplier = none + c->multiplier[i];
        settle_friction(C, b, none + c->friction * N, none == 0, &multiplier, T);
        c->multiplier[i] = multiplier[0], change[1] = T[0][0] - force[1], change[2] = T[1][0] - force[2];
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
