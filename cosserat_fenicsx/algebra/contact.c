/* Contact of nodes with the wall of a tube, with Coulomb friction, where the motion responds linearly to the forces:
   block Gauss-Seidel over the nodes, each of which is solved with its exact law (wall_law.c, which comes before). Along
   a rod a sweep knows the exact response: forces on one side of a node between two elements move the other side by
   this node's motion alone. */
#include "chain.h"

#include <math.h>
#include <string.h>

enum { MOTIONS = 6, PASSES = 3 };
/* Arrays of responses: as they were found; without others; those before. */
enum { RAW, CLEARED, BEFORE };
/* Share of others in a node's own response from which they cannot be left out. */
static const double OF_OTHERS = 0.5;
/* Compliance times stiffness below which an iteration needs no help. */
static const double LITTLE = 0.1;
/* Of the moment along the tube where the surface is at the axis, dimensionless; least compliance of a node that is not
   held, over the largest one. */
static const double LEAST_LEVER = 1e-9, HELD = 1e-10;

/* The motion of nodes by T (count, 6), and numbers v of them or of those before. */
static inline void add_by(const float *T, int count, const vector *v, vector *motion)
{
    for (int k = 0; k < count; k++)
        for (int r = 0; r < MOTIONS; r++) motion[r] += widen(T + LANES * (MOTIONS * k + r)) * v[k];
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

/* Take what stays in a step to where nodes are solved together. */
void pack_contact(contact *c)
{
    for (int i = 0; i < c->positions; i++) {
        walled *w = walled_at(c, i);
        axes *a = axes_at(c, i);
        for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++) {
            const double *t = c->tangent + 3 * j, *u = c->across + 3 * j;
            double v[3];
            cross3(t, u, v);
            for (int k = 0; k < 3; k++) {
                a->t[k][lane] = t[k], a->u[k][lane] = u[k], a->v[k][lane] = v[k];
                w->law[k][lane] = c->law[3 * j + k];
            }
            a->arm[lane] = c->arm[j], w->start[0][lane] = c->start[2 * j], w->start[1][lane] = c->start[2 * j + 1];
            w->clearance[lane] = c->clearance[j], w->stiffness[lane] = c->stiffness[j];
            w->friction[lane] = c->friction[j], w->damping[lane] = c->damping[j];
            w->multiplier[lane] = c->multiplier[j], w->inner[lane] = c->inner[j];
        }
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

/* Axes u and v across the tube of node i, and the direction round it times the arm, at the start of the step; returns
   the lever of the moment along the tube, not zero, so that all rotations pass on. */
static double axes_of(const contact *c, int i, double *v, double *round)
{
    const double *u = c->across + 3 * i, *x = c->start + 2 * i, arm = c->arm[i];
    const double size = sqrt(x[0] * x[0] + x[1] * x[1]), share = size > 0 ? arm / size : 0;
    cross3(c->tangent + 3 * i, u, v);
    for (int k = 0; k < 3; k++) round[k] = share * (x[0] * v[k] - x[1] * u[k]);
    return arm > 0 ? arm : LEAST_LEVER;
}

/* Forces and moments (nodes, 6): the unit force of this component, see `compliance`, of the nodes from `first` on that
   are `apart`; or, beyond these, a unit moment about u or v. */
void unit_forces(const contact *c, int first, int apart, int component, double *forces)
{
    memset(forces, 0, 6 * c->nodes * sizeof *forces);
    for (int i = first; i < c->nodes; i += apart) {
        const double *t = c->tangent + 3 * i, *u = c->across + 3 * i;
        double *force = forces + 6 * i, v[3], round[3];
        const double lever = axes_of(c, i, v, round);
        const double *of[MOTIONS] = {u, v, t, t, u, v};
        for (int k = 0; k < 3; k++) {
            force[component < 3 ? k : 3 + k] = of[component][k] * (component == 3 ? lever : 1);
            if (component == 2) force[3 + k] = -round[k];
        }
    }
}

/* The responses of node j to node i, at most an element apart, in one of their arrays: columns by unit forces. */
static inline double *response(const contact *c, int kept, int i, int j)
{
    const size_t near = c->inside + 1, width = 2 * near + 1;
    return c->responses + MOTIONS * MOTIONS * (width * ((size_t)kept * c->nodes + i) + j - i + near);
}

/* Keep the responses to these of every node and of the ones beside it: changes of the nodes' unknowns (nodes, 7) with
   quaternions q (nodes, 4). */
void keep_responses(contact *c, int first, int apart, int component, const double *q, const double *changes)
{
    const int near = c->inside + 1;
    for (int i = first; i < c->nodes; i += apart)
        for (int j = i > near ? i - near : 0; j <= i + near && j < c->nodes; j++) {
            const double *t = c->tangent + 3 * j, *u = c->across + 3 * j, *d = changes + 7 * j;
            double *to = response(c, RAW, i, j) + MOTIONS * component;
            double v[3], round[3], turned[3];
            const double lever = axes_of(c, j, v, round);
            rotation_by(q + 4 * j, d + 3, turned);
            to[0] = dot3(u, d), to[1] = dot3(v, d), to[2] = dot3(t, d) - dot3(round, turned);
            to[3] = lever * dot3(t, turned), to[4] = dot3(u, turned), to[5] = dot3(v, turned);
        }
}

/* The inverse of a matrix that is nearly symmetric and positive; zero in rows and columns whose pivots are not larger
   than `least` of them, as where a node is held. */
static void invert(const double *G, const double *least, double *inverse)
{
    enum { n = MOTIONS };
    double A[n][n];
    memcpy(A, G, sizeof A);
    for (int k = 0; k < n; k++) {
        const int held = !(A[k][k] > least[k] && A[k][k] > 1e-12 * fabs(G[(n + 1) * k]));
        const double pivot = held ? 0 : 1 / A[k][k];
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n && i != k; j++)
                if (j != k) A[i][j] -= A[i][k] * A[k][j] * pivot;
        for (int i = 0; i < n; i++) A[i][k] *= i == k ? 0 : -pivot, A[k][i] *= i == k ? 0 : pivot;
        A[k][k] = pivot;
    }
    memcpy(inverse, A, sizeof A);
}

/* The numbers of node j in an array (positions, columns, 6, LANES) of transfers. */
static inline float *passed_by(const contact *c, float *of, int columns, int j)
{
    return of + (size_t)LANES * MOTIONS * columns * (j % c->positions) + j / c->positions;
}

/* From the responses of this number the compliance, and how the motion of the last node between two elements moves
   those up to the next one: what lies beyond is free, so that it follows. Nodes inside elements move these also. */
static void take_transfers(contact *c, int kept)
{
    enum { n = MOTIONS };
    double least[n] = {0}, inverse[n * n];
    for (int i = 0; i < c->nodes; i++)
        for (int k = 0; k < n; k++) least[k] = fmax(least[k], HELD * response(c, kept, i, i)[(n + 1) * k]);
    for (int i = 0; i < c->nodes; i++) {
        const double *own = response(c, kept, i, i);
        const int columns = c->inner[i] ? 4 : n;
        float *to = passed_by(c, c->compliance, 4, i);
        for (int k = 0; k < 4 * n; k++) to[LANES * k] = own[k];
        if (!c->inner[i]) invert(own, least, inverse);
        for (int side = -1; side <= 1; side += 2)
            for (int j = i + side, b = 0; j >= 0 && j < c->nodes && !c->parted[side > 0 ? j - 1 : j]; j += side, b++) {
                const double *G = response(c, kept, i, j); /* columns one after the other, as all here */
                float *of = c->inner[i] ? (side < 0 ? c->following : c->preceding) : side < 0 ? c->left : c->right;
                to = passed_by(c, of, c->inner[i] ? 4 * c->inside : n, j) + LANES * 4 * n * b * c->inner[i];
                for (int k = 0; k < columns; k++)
                    for (int r = 0; r < n; r++) {
                        double sum = c->inner[i] ? G[n * k + r] : 0;
                        for (int l = 0; l < n && !c->inner[i]; l++) sum += G[n * l + r] * inverse[n * k + l];
                        to[LANES * (n * k + r)] = sum;
                    }
                if (!c->inner[j]) break;
            }
    }
}

/* The responses without what nodes that were loaded at the same time, `apart` from each other, do there: by the
   transfers, from one of them to the next. */
static void leave_out_others(contact *c, int apart)
{
    enum { n = MOTIONS };
    const int near = c->inside + 1;
    const size_t all = (size_t)c->nodes * (2 * near + 1) * n * n;
    memcpy(c->responses + all * BEFORE, c->responses + all * CLEARED, all * sizeof *c->responses);
    memcpy(c->responses + all * CLEARED, c->responses + all * RAW, all * sizeof *c->responses);
    for (int side = -1; side <= 1; side += 2)
        for (int first = 0; first < apart; first++) {
            double d[n * n] = {0}, moved[n * n]; /* of the last node between two elements, by those behind */
            int j = side > 0 ? 0 : c->nodes - 1, from = j;
            for (int i = side > 0 ? first : first + (j - first) / apart * apart; i >= 0 && i < c->nodes;
                 i += side * apart) {
                for (; j >= 0 && j < c->nodes && (i - j) * side >= -near; j += side) {
                    const float *T = passed_by(c, side < 0 ? c->left : c->right, n, j);
                    memset(moved, 0, sizeof moved);
                    for (int m = 0; m < n; m++)
                        for (int k = 0; k < n; k++)
                            for (int r = 0; r < n; r++) moved[n * m + r] += T[LANES * (n * k + r)] * d[n * m + k];
                    double *G = response(c, CLEARED, i, j);
                    for (int k = 0; k < n * n && (i - j) * side <= near; k++) G[k] -= moved[k];
                    if (!c->inner[j]) memcpy(d, moved, sizeof d), from = j;
                }
                for (int k = 0; k < n * n && (from - i) * side >= 0; k++) d[k] += response(c, BEFORE, i, from)[k];
            }
        }
}

/* Whether the own responses, before the others were left out, were largely those to others: without these a series
   that need not converge would be left. */
static int muddled(const contact *c)
{
    for (int i = 0; i < c->nodes; i++) {
        const double *raw = response(c, RAW, i, i), *own = response(c, CLEARED, i, i);
        for (int k = 0; k < MOTIONS * MOTIONS; k += MOTIONS + 1)
            if (!(fabs(own[k] - raw[k]) <= OF_OTHERS * fabs(raw[k]))) return 1;
    }
    return 0;
}

/* The compliance and the transfers from the responses, for which nodes that were `apart` were loaded together. Returns
   whether this was too near; the responses are taken as they are then. */
int find_transfers(contact *c, int apart)
{
    const size_t all = (size_t)c->nodes * (2 * c->inside + 3) * MOTIONS * MOTIONS;
    memcpy(c->responses + all * CLEARED, c->responses + all * RAW, all * sizeof *c->responses);
    take_transfers(c, RAW);
    for (int again = 0; again < PASSES && apart < c->nodes; again++) {
        leave_out_others(c, apart);
        if (again == 0 && muddled(c)) return 1;
        take_transfers(c, CLEARED);
    }
    return 0;
}

/* The motion of nodes from unknowns `before` to `now` (nodes, 7): displacements and, at the end of each of these
   (nodes, width), rotations, by the mean rotation; with them the work of a force and a moment in a step is exact. */
void find_motion(int nodes, int width, const double *before, const double *now, double *moved)
{
    for (int i = 0; i < nodes; i++, before += 7, now += 7, moved += width) {
        double q[4], d[4];
        for (int k = 0; k < width - 3; k++) moved[k] = k < 3 ? now[k] - before[k] : 0;
        for (int k = 0; k < 4; k++) q[k] = (before[3 + k] + now[3 + k]) / 2, d[k] = now[3 + k] - before[3 + k];
        rotation_by(q, d, moved + width - 3);
    }
}

/* Size of the slip of every node in the step, for the given motion, also of nodes that do not touch. */
void slips(const contact *c, double *size)
{
    for (int i = 0; i < c->positions; i++) {
        vector motion[4];
        const place p = motion_of(c, i, motion);
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

/* Solve the nodes at position i, whose motion is that by the forces of all others and their own; returns the size of
   the change of their motion by the change of their own. */
static vector settle_nodes(contact *c, int i, const vector *motion, vector *change)
{
    double *forces = c->forces + LANES * 4 * i;
    walled *here = walled_at(c, i);
    const vector none = {0};
    vector W[4][4], by[3][4], slip[4], moving[4], T[2] = {none, none}, size = none;
    vector multiplier = here->multiplier;
    const place p = place_of(c, here->start, motion);
    const mask idle = (p.R0 <= here->clearance) & (p.R <= here->clearance) & (here->law[0] == 0) & (here->law[1] == 0)
                      & (here->law[2] == 0);
    if (!any(~idle)) return none;
    for (int k = 0; k < 4; k++)
        for (int l = 0; l < 4; l++) W[k][l] = widen(c->compliance + LANES * (MOTIONS * (4 * (size_t)i + k) + l));
    const vector inward[4] = {-p.share * p.e[0], -p.share * p.e[1], none, none};
    const vector round[4] = {-p.e[1], p.e[0], none, 1 + none}, along[4] = {none, none, 1 + none, none};
    respond(W, inward, by[0]);
    const vector give = only(p.R > 0, -(p.x[0] * by[0][0] + p.x[1] * by[0][1]) / p.R);
    const vector N = settle_normal(c, here, ~idle, p.R0, p.R, give);
    const mask rubs = ~idle & (here->friction > 0) & (N > 0);
    if (any(rubs)) {
        respond(W, round, by[1]), respond(W, along, by[2]);
        for (int k = 0; k < 4; k++) slip[k] = motion[k] + by[0][k] * (N - here->law[0]);
        const vector A[3] = {dot4(round, by[1]), (dot4(round, by[2]) + by[1][2]) / 2, by[2][2]};
        const vector b[2] = {dot4(round, slip) - A[0] * here->law[1] - A[1] * here->law[2],
                             slip[2] - A[1] * here->law[1] - A[2] * here->law[2]};
        settle_friction(A, b, here->friction * N, rubs, &multiplier, T);
    }
    here->multiplier = multiplier, here->law[0] = only(~idle, N), here->law[1] = T[0], here->law[2] = T[1];
    for (int k = 0; k < 4; k++)
        change[k] = only(~idle, N * inward[k] + T[0] * round[k] + T[1] * along[k] - load(forces + LANES * k));
    foretell_turning(W, &p, here->law[0], change);
    for (int k = 0; k < 4; k++) keep(load(forces + LANES * k) + change[k], forces + LANES * k);
    respond(W, change, moving);
    for (int k = 0; k < 4; k++) size = greater(size, absolute(moving[k]));
    return size;
}

static inline int any_of(const vector *v, int count)
{
    mask other = v[0] != 0;
    for (int k = 1; k < count; k++) other |= v[k] != 0;
    return any(other);
}

/* One sweep over the nodes, from one end to the other: each moves as the last one between two elements does by all
   forces that have changed on that side since a sweep came this way, and by the forces of nodes inside its element; in
   `passing` those beyond the lanes. Where nodes are to be `solved` their own forces change; returns the size of these
   changes. What the other side does not know yet is in `late`. */
static double sweep_nodes(contact *c, int back, int solved)
{
    const vector none = {0};
    const int inside = c->inside, carried = MOTIONS + 4 * inside;
    vector largest = none, d[carried], *recent = d + MOTIONS; /* of the nodes inside, the last one first */
    double *passing = c->passing + (size_t)LANES * carried * back, size = 0;
    for (int k = 0; k < carried; k++)
        for (int lane = 0; lane < LANES; lane++) {
            const int from = back ? lane + 1 : lane - 1;
            d[k][lane] = from >= 0 && from < c->lanes ? passing[LANES * k + from] : 0;
        }
    for (int step = 0; step < c->positions; step++) {
        const int i = back ? c->positions - 1 - step : step;
        const float *own = c->compliance + (size_t)LANES * 4 * MOTIONS * i;
        const float *direct = (back ? c->following : c->preceding) + (size_t)LANES * 4 * MOTIONS * inside * i;
        double *motion = c->motion + LANES * MOTIONS * i, *late = c->late + LANES * 4 * i;
        vector passed[MOTIONS] = {none}, moved[MOTIONS], change[4] = {none};
        if (any_of(d, MOTIONS))
            add_by((back ? c->left : c->right) + (size_t)LANES * MOTIONS * MOTIONS * i, MOTIONS, d, passed);
        for (int b = 0; b < inside; b++)
            if (any_of(recent + 4 * b, 4)) add_by(direct + LANES * 4 * MOTIONS * b, 4, recent + 4 * b, passed);
        for (int k = 0; k < MOTIONS; k++) moved[k] = load(motion + LANES * k) + passed[k];
        if (solved) largest = greater(largest, settle_nodes(c, i, moved, change));
        if (any_of(change, 4)) add_by(own, 4, change, moved);
        for (int k = 0; k < MOTIONS; k++) keep(moved[k], motion + LANES * k);
        for (int k = 0; k < 4; k++) {
            const vector known = change[k];
            change[k] += load(late + LANES * k), keep(known, late + LANES * k);
        }
        const mask inner = walled_at(c, i)->inner != 0;
        for (int k = 4 * inside; k-- > 0;) recent[k] = only(inner, k < 4 ? change[k] : recent[k - 4]);
        if (any_of(change, 4)) add_by(own, 4, change, passed);
        for (int k = 0; k < MOTIONS; k++) d[k] = choose(inner, d[k], passed[k]);
    }
    for (int k = 0; k < carried; k++) keep(d[k], passing + LANES * k);
    for (int k = 0; k < LANES; k++) size = fmax(size, largest[k]);
    return size;
}

/* Motions and forces of all nodes by their axes, before they are settled. */
static void take_axes(contact *c)
{
    for (int i = 0; i < c->positions; i++) {
        const axes *a = axes_at(c, i);
        const walled *w = walled_at(c, i);
        vector motion[MOTIONS] = {0}, force[3]; /* of rotations about u and v only the change is asked for */
        motion_of(c, i, motion), gather(c, c->force, 6, i, 0, force);
        const vector forces[4] = {dot3v(a->u, force), dot3v(a->v, force), w->law[2], w->law[1]};
        for (int k = 0; k < MOTIONS; k++) keep(motion[k], c->motion + LANES * (MOTIONS * i + k));
        for (int k = 0; k < 4; k++) keep(forces[k], c->forces + LANES * (4 * i + k));
    }
    memset(c->late, 0, (size_t)LANES * 4 * c->positions * sizeof *c->late);
    memset(c->passing, 0, (size_t)2 * LANES * (MOTIONS + 4 * c->inside) * sizeof *c->passing);
}

/* The forces and moments of the nodes at position i by their law, where they are. */
static void put_forces(contact *c, int i, const place *p)
{
    const axes *a = axes_at(c, i);
    const walled *w = walled_at(c, i);
    const vector law[3] = {w->law[0], w->law[1], w->law[2]}, inward = -law[0] * p->share;
    const vector in_u = inward * p->e[0] - law[1] * p->e[1], in_v = inward * p->e[1] + law[1] * p->e[0];
    vector force[6];
    for (int k = 0; k < 3; k++) {
        force[k] = in_u * a->u[k] + in_v * a->v[k] + law[2] * a->t[k] + 0.0; /* never -0 */
        force[3 + k] = a->arm * (law[1] * a->t[k] + law[2] * (p->e[1] * a->u[k] - p->e[0] * a->v[k])) + 0.0;
    }
    for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++)
        for (int k = 0; k < 6; k++) c->force[6 * j + k] = force[k][lane];
}

/* Turn the last forces of all nodes to where the given motion takes these. */
void aim(contact *c)
{
    for (int i = 0; i < c->positions; i++) {
        vector motion[4];
        const place p = motion_of(c, i, motion);
        put_forces(c, i, &p);
    }
}

/* The motion and the forces of all nodes after they are settled. */
static void leave_axes(contact *c)
{
    for (int i = 0; i < c->positions; i++) {
        const walled *w = walled_at(c, i);
        const axes *a = axes_at(c, i);
        vector change[4], motion[MOTIONS], more[6];
        const place before = motion_of(c, i, change);
        for (int k = 0; k < MOTIONS; k++) motion[k] = load(c->motion + LANES * (MOTIONS * i + k));
        for (int k = 0; k < 4; k++) change[k] = motion[k] - change[k];
        const vector *turned = motion + 4, spin = change[3] / choose(a->arm > 0, a->arm, LEAST_LEVER + 0 * a->arm);
        const vector tilt = before.e[0] * turned[1] - before.e[1] * turned[0];
        const vector slid = change[2] + a->arm * tilt; /* of the displacement alone */
        for (int k = 0; k < 3; k++) {
            more[k] = change[0] * a->u[k] + change[1] * a->v[k] + slid * a->t[k];
            more[3 + k] = turned[0] * a->u[k] + turned[1] * a->v[k] + spin * a->t[k];
        }
        const place p = place_of(c, w->start, motion);
        put_forces(c, i, &p);
        for (int lane = 0, j; lane < c->lanes && (j = node_of(c, i, lane)) >= 0; lane++) {
            for (int k = 0; k < 6; k++) c->moved[6 * j + k] += more[k][lane];
            for (int k = 0; k < 3; k++) c->law[3 * j + k] = w->law[k][lane];
            c->multiplier[j] = w->multiplier[lane];
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
    while (sweeps < c->most && change > fmax(c->share * first, c->smallest))
        change = sweep_nodes(c, sweeps++ % 2, 1), first = fmax(first, change);
    if (first == 0) return sweeps; /* as where nothing touches */
    for (int more = 0; more < (c->lanes > 1 ? 3 : 1); more++) sweep_nodes(c, (sweeps + more) % 2, 0);
    leave_axes(c);
    return sweeps;
}

/* Whether the normal forces differ from those of the given motion, or a node has crossed the axis while it touches: the
   iteration may converge to a spurious motion. */
int broken(const contact *c)
{
    for (int i = 0; i < c->positions; i++) {
        vector slope, motion[4];
        const walled *w = walled_at(c, i);
        const place p = motion_of(c, i, motion);
        const vector off = absolute(normal_force(c, w, p.R0, p.R, &slope) - w->law[0]);
        if (any(~(off <= 1e-6 * w->law[0] + 1e-10 * w->stiffness))) return 1;
        const vector turned = p.x[0] * w->start[0] + p.x[1] * w->start[1];
        if (any((w->law[0] > 0) & (w->clearance > 0) & (turned <= 0))) return 1;
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
        const walled *w = walled_at(c, i);
        const place p = motion_of(c, i, motion);
        const vector deep = greater(p.R - w->clearance, none), before = greater(p.R0 - w->clearance, none);
        end += w->stiffness * deep * deep / 2, start += w->stiffness * before * before / 2;
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
        vector motion[4], start[3];
        const walled *w = walled_at(c, i);
        const place p = motion_of(c, i, motion);
        gather(c, before, 3, i, 0, start);
        const vector k = w->stiffness, p0 = greater(p.R0 - w->clearance, none);
        const vector at_end = w->law[0] - k * greater(p.R - w->clearance, none);
        const vector damping = at_end + choose((p0 > 0) & (start[0] == 0), at_end, start[0] - k * p0);
        const vector round = slip_round(&p, motion) * (start[1] + w->law[1]);
        const vector along = motion[2] * (start[2] + w->law[2]);
        sum += greater(damping * (p.R - p.R0) / 2, none) + greater(-(round + along) / 2, none);
    }
    return sum_of(sum);
}
