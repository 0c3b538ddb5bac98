/* The laws of contact by the compliance, of the normal force and of Coulomb friction: for nodes at a wall, four at
   once, for contact.c; and for contacts of rods with each other. */
#include "chain.h"

#include <math.h>
#include <string.h>

enum { MOST_LOCAL = 60 };

/* ---- four nodes at once ------------------------------------------------------------------------------------------ */

/* Nodes far apart are solved together, one in each lane of a vector: the forces of one do not move the others. */
typedef float place_of_floats __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));
typedef __typeof__((vector){0} < (vector){0}) mask;

static inline vector widen(const float *from)
{
    return __builtin_convertvector(*(const place_of_floats *)from, vector);
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
   (normal, friction round and along) and multiplier; whether they are inside an element. Zero in lanes without a
   node. */
typedef struct {
    place_of_vector start[2], clearance, stiffness, friction, damping, law[3], multiplier, inner;
} walled;

/* Axes of nodes along and across their tubes, and their arms. */
typedef struct {
    place_of_vector t[3], u[3], v[3], arm;
} axes;

/* Those at position i: what is asked for is read from there, as copies of all of it take longer than the laws. */
static inline walled *walled_at(const contact *c, int i)
{
    return (walled *)c->walled + i;
}

static inline axes *axes_at(const contact *c, int i)
{
    return (axes *)c->axes + i;
}

/* Node of a lane at a position, or -1. */
static inline int node_of(const contact *c, int i, int lane)
{
    const int node = lane * c->positions + i;
    return lane < c->lanes && node < c->nodes ? node : -1;
}

/* Three numbers, from the k-th on, of the nodes at position i of an array (nodes, width); of others in lanes without a
   node. */
static inline void gather(const contact *c, const double *of, int width, int i, int k, vector *to)
{
    int at[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        const int j = node_of(c, i, lane);
        at[lane] = width * (j < 0 ? 0 : j) + k;
    }
    for (int l = 0; l < 3; l++)
        for (int lane = 0; lane < LANES; lane++) to[l][lane] = of[at[lane] + l];
}

static inline vector dot3v(const place_of_vector *a, const vector *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
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
    /* not from what a step that failed has left */
    vector shift = choose(absolute(*multiplier) < INFINITY, *multiplier, none), size = none;
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
static inline place place_of(const contact *c, const place_of_vector *x0, const vector *moved)
{
    place p;
    vector m[2];
    for (int k = 0; k < 2; k++) {
        m[k] = p.x[k] = x0[k] + moved[k];
        if (!c->at_end) m[k] += x0[k];
    }
    p.R0 = root(x0[0] * x0[0] + x0[1] * x0[1]), p.R = root(p.x[0] * p.x[0] + p.x[1] * p.x[1]);
    const vector size = c->at_end ? p.R : root(m[0] * m[0] + m[1] * m[1]);
    p.both = c->at_end ? p.R : p.R0 + p.R, p.share = only(p.both > 0, size / p.both);
    for (int k = 0; k < 2; k++) p.e[k] = only(size > 0, m[k] / size);
    return p;
}

/* Where the nodes at position i are after their motion `moved` (6,), and this motion (4,): along u and v, the slip
   along the tube, and what the rotation about the tube adds to the slip round it. */
static inline place motion_of(const contact *c, int i, vector *motion)
{
    const axes *a = axes_at(c, i);
    const walled *w = walled_at(c, i);
    vector moved[3], turned[3];
    gather(c, c->moved, 6, i, 0, moved), gather(c, c->moved, 6, i, 3, turned);
    motion[0] = dot3v(a->u, moved), motion[1] = dot3v(a->v, moved), motion[3] = a->arm * dot3v(a->t, turned);
    const place p = place_of(c, w->start, motion);
    motion[2] = dot3v(a->t, moved) + a->arm * (p.e[1] * dot3v(a->u, turned) - p.e[0] * dot3v(a->v, turned));
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

/* ---- the axis of a tube ------------------------------------------------------------------------------------------ */

/* A point of an axis at an arc length x from the start of section i; tangent t and curvature vector k there. */
static void point_on_arc(const arcs *a, int i, double x, double *r, double *t, double *k)
{
    const double *from = a->position + 3 * i, *t0 = a->tangent + 3 * i, *k0 = a->curvature + 3 * i;
    const double half = a->bend[i] * x / 2, sine = half != 0 ? sin(half) : 0, chord = half != 0 ? x * sine / half : x;
    const double level = 1 - 2 * sine * sine, along = half != 0 ? chord * cos(half) : x, aside = chord * chord / 2;
    const double bent = along * dot3(k0, k0);
    for (int j = 0; j < 3; j++) {
        r[j] = from[j] + along * t0[j] + aside * k0[j];
        t[j] = level * t0[j] + along * k0[j], k[j] = level * k0[j] - bent * t0[j];
    }
}

/* Arc length from the start of section i to the point of its circle that is closest to r, nearest to its middle. */
static double projected(const arcs *a, int i, const double *r)
{
    const double *from = a->position + 3 * i, away[3] = {r[0] - from[0], r[1] - from[1], r[2] - from[2]};
    const double along = dot3(away, a->tangent + 3 * i), bend = a->bend[i], middle = bend * a->length[i] / 2;
    if (bend == 0) return along;
    const double angle = atan2(bend * along, 1 - dot3(away, a->curvature + 3 * i));
    return (middle + remainder(angle - middle, 2 * M_PI)) / bend;
}

static double within(const arcs *a, int i, double x)
{
    return x < 0 ? 0 : x > a->length[i] ? a->length[i] : x; /* NaN stays */
}

/* The points of an axis that are closest to points (count, 3): on the `whole` of it; or from depths md on, from section
   to section in one direction, so that it ends: neighbours share the plane across their station. */
void nearest_on_arcs(const arcs *a, int count, const double *points, int whole, double *md, double *position,
                     double *tangent, double *curvature)
{
    const int last = a->sections - 1;
    for (int n = 0; n < count; n++, points += 3, position += 3, tangent += 3, curvature += 3) {
        double x = 0, least = INFINITY;
        int i = 0;
        for (int j = 0; whole && j <= last; j++) {
            const double there = within(a, j, projected(a, j, points));
            double away[3], t[3], k[3];
            point_on_arc(a, j, there, away, t, k);
            for (int l = 0; l < 3; l++) away[l] -= points[l];
            if (dot3(away, away) < least) least = dot3(away, away), i = j, x = there;
        }
        if (!whole) {
            for (int end = last; i < end;) {
                const int middle = (i + end + 1) / 2;
                if (a->start[middle] <= md[n]) i = middle;
                else end = middle - 1;
            }
            x = projected(a, i, points);
            const int way = (x > a->length[i]) - (x < 0);
            while ((way < 0 && x < 0 && i > 0) || (way > 0 && x > a->length[i] && i < last))
                i += way, x = projected(a, i, points);
            x = within(a, i, x);
        }
        md[n] = a->start[i] + x;
        point_on_arc(a, i, x, position, tangent, curvature);
        if (md[n] <= 0 || (i == last && x >= a->length[last])) memset(curvature, 0, 3 * sizeof *curvature);
    }
}

/* ---- rods that touch each other ---------------------------------------------------------------------------------- */

/* Solve contact i with the forces of all others; returns the size of the change of its motion by its own. */
static double settle_pair(pairs *c, int i)
{
    const int parts = c->parts, *own = c->own + i * parts;
    const double *A = c->compliance + own[0]; /* by the normal force */
    double *motion = c->motion + i * parts, *force = c->force + i * parts, change[3] = {0};
    const double slope = c->slope[i];
    const double gap = motion[0] - A[0] * force[0];
    const double N = fmax((c->normal[i] - slope * (gap - c->gap[i])) / (1 + slope * A[0]), 0);
    change[0] = N - force[0];
    if (parts == 3) {
        const double *by_first = c->compliance + own[1], *by_second = c->compliance + own[2];
        const double B[3] = {by_first[1], (by_first[2] + by_second[1]) / 2, by_second[2]};
        const vector none = {0}, C[3] = {none + B[0], none + B[1], none + B[2]};
        const vector b[2] = {none + motion[1] + A[1] * change[0] - B[0] * force[1] - B[1] * force[2],
                             none + motion[2] + A[2] * change[0] - B[1] * force[1] - B[2] * force[2]};
        vector T[2], multiplier = none + c->multiplier[i];
        settle_friction(C, b, none + c->friction * N, none == 0, &multiplier, T);
        c->multiplier[i] = multiplier[0], change[1] = T[0][0] - force[1], change[2] = T[1][0] - force[2];
    }
    double size = 0;
    for (int k = 0; k < parts; k++) {
        const double by = change[k];
        force[k] += by;
        if (by == 0) continue;
        for (int e = c->start[i * parts + k]; e < c->start[i * parts + k + 1]; e++)
            c->motion[c->place[e]] += c->compliance[e] * by;
        size = fmax(size, fabs(c->compliance[own[k] + k] * by));
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
