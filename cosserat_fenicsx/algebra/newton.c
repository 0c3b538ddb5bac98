/* Newton's method for equilibria, and the iterations of a time step. Hooks let Python add constraint equations,
   exchange with other ranks, and evaluate loads. */
#include "chain.h"

#include <math.h>
#include <string.h>

enum { STATE = 1, RESIDUAL = 2, TANGENT = 4, INTERFACE = 8, ADD_UP = 16, SUM = 32, MATRICES = 64, CONTACT = 256,
       NODES = 512 };
enum { FAILED = 1 };
/* Increments at a wall that no longer shrink, by rounding, are measured anew after some steps without them; one that is
   this many times larger than before may have stopped for another reason, such as an old tangent. */
static const double FADES = 0.9, RISES = 10;
/* How many times as far from each other nodes are loaded, at most, where they move each other. */
enum { FARTHEST = 4 };
/* A tangent serves a second step that is expected to be below the first of these shares of the limit of increments, and
   has served if it is below the second. The residual alone does not tell: that of stretch may outweigh all others. */
static const double SLIGHT = 1e-2, SERVED = 0.1;

static int python_hook(void *self, int what, double *a, double *b);

static int hook(const problem *p, int what, double *a, double *b)
{
    return p->hooks & what ? python_hook(p->self, what, a, b) : 0;
}

/* ---- equations --------------------------------------------------------------------------------------------------- */

/* Add forces (nodes, 6), or what they are more than others, times a factor to this rank's unknowns. */
static void add_forces(const contact *c, const double *forces, const double *others, double factor, double *b)
{
    for (int i = 0; i < c->nodes; i++)
        for (int k = 0; k < 6; k++) {
            const int row = c->rows[7 * i + (k < 3 ? k : k + 1)], j = 6 * i + k;
            if (row >= 0) b[row] += factor * (others ? forces[j] - others[j] : forces[j]);
        }
}

static int put_state(problem *p, const double *x, int evaluated)
{
    if (p->serial)
        for (int i = 0; i < p->frees; i++) p->state[p->free[i]] = x[p->of_free[i]];
    if (p->serial && p->ties) see_ties(p->ties, x);
    return hook(p, STATE, (double *)x, evaluated ? p->state : 0);
}

/* The state from the unknowns. */
int take_state(problem *p, const double *x)
{
    return put_state(p, x, 0);
}

/* The state follows x, before the elements' residuals are added to `local`. */
int begin_residual(problem *p, const double *x)
{
    memset(p->local, 0, p->locals * sizeof *p->local);
    return put_state(p, x, 1);
}

/* The residual b at x, after that. */
int end_residual(problem *p, const double *x, double *b)
{
    memset(b, 0, p->size * sizeof *b);
    if (p->serial)
        for (int i = 0; i < p->frees; i++) b[p->of_free[i]] += p->local[p->free[i]];
    else if (hook(p, ADD_UP, p->local, b))
        return FAILED;
    if (p->ties && add_ties(p->ties, *p->tie_load_factor, b)) return FAILED;
    if (hook(p, RESIDUAL, (double *)x, b)) return FAILED;
    if (p->contact) add_forces(p->contact, p->contact->force, 0, -1, b);
    for (int k = 0; k < 3 && p->load[k]; k++)
        for (int i = 0; i < p->size; i++) b[i] -= *p->factor[k] * p->load[k][i];
    return 0;
}

/* The residual b at x; the state follows x. */
int residual(problem *p, const double *x, double *b)
{
    if (begin_residual(p, x)) return FAILED;
    add_vector(p->residual, p->dofs, p->local);
    return end_residual(p, x, b);
}

/* Turn the quaternions' parts of x, a change of the unknowns by the tangent, by each node's rotation since that was
   found: q r with r = q_tangent^-1 q_now. By rotations in space, as moments are, an old tangent serves a rod that
   turns about its axis. */
static void turn_on(const problem *p, double *x)
{
    for (int i = 0; i < p->turns; i++) {
        const double *o = p->turned + 7 * i + 3, *n = p->now + 7 * i + 3;
        const double r[4] = {o[0] * n[0] + o[1] * n[1] + o[2] * n[2] + o[3] * n[3],
                             o[0] * n[1] - o[1] * n[0] - o[2] * n[3] + o[3] * n[2],
                             o[0] * n[2] - o[2] * n[0] - o[3] * n[1] + o[1] * n[3],
                             o[0] * n[3] - o[3] * n[0] - o[1] * n[2] + o[2] * n[1]};
        const double size = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
        if (!(size > 0)) continue;
        double *q = x + 7 * i + 3;
        const double a = q[0] / size, b = q[1] / size, c = q[2] / size, d = q[3] / size;
        q[0] = a * r[0] - b * r[1] - c * r[2] - d * r[3];
        q[1] = a * r[1] + b * r[0] + c * r[3] - d * r[2];
        q[2] = a * r[2] + c * r[0] + d * r[1] - b * r[3];
        q[3] = a * r[3] + d * r[0] + b * r[2] - c * r[1];
    }
}

/* Factors of the tangent at the state. */
int tangent(problem *p)
{
    if (p->turns) memcpy(p->turned, p->now, 7 * p->turns * sizeof *p->now);
    if (p->matrices) {
        tabulate_all(p->tangent, p->matrices);
        if (hook(p, MATRICES, p->matrices, 0)) return FAILED;
    }
    p->singular = eliminate(p->chain, p->tangent, p->matrices);
    if (p->system && !p->singular) {
        if (p->ties && differentiate_ties(p->ties, *p->tie_load_factor)) return FAILED;
        assemble_dense(p->system, p->chain->condensed, p->ties ? p->ties->derivatives : 0);
        p->singular = factor_matrix(p->system, p->chain->zero_pivot);
    }
    return hook(p, TANGENT, 0, 0);
}

/* x with tangent * x = b; NaN where it is singular. */
int solve(problem *p, const double *b, double *x)
{
    for (int i = 0; i < p->interfaces; i++) p->interface[i] = p->of_interface[i] < 0 ? 0 : b[p->of_interface[i]];
    if (!p->singular) forward(p->chain, b, p->interface);
    if (p->system && !p->singular) solve_matrix(p->system, p->interface);
    if (hook(p, INTERFACE, p->interface, 0)) return FAILED;
    if (!p->singular) backward(p->chain, p->interface, x);
    for (int i = 0; i < p->interfaces; i++)
        if (p->of_interface[i] >= 0) x[p->of_interface[i]] = p->interface[i];
    if (p->singular)
        for (int i = 0; i < p->size; i++) x[i] = NAN;
    turn_on(p, x);
    return 0;
}

/* Update the carried contact force by the step from `before` to the state. */
void advance(problem *p)
{
    if (!p->advance) return;
    for (int i = 0; i < p->locals; i++) p->step[i] = p->state[i] - p->before[i];
    put_values(p->advance, p->advance_dofs, p->carried);
    memcpy(p->before, p->state, p->locals * sizeof *p->state);
}

/* ---- convergence ------------------------------------------------------------------------------------------------- */

/* Whether the error estimated from two successive Newton steps is below `allowed`.

   With their ratio c the error is step * c/(1 - c) for linear convergence. Where convergence is quadratic the next
   ratio is c^2 or less, and the estimate is multiplied by min(1, 100 c), with a margin. */
static int error_is_small(double step, double before, int quadratic, double allowed)
{
    const double c = step / before;
    return c < 0.9 && step * c * (quadratic ? fmin(1, 100 * c) : 1) <= allowed * (1 - c);
}

/* ---- contact ----------------------------------------------------------------------------------------------------- */

/* Unknowns of the nodes that may touch (nodes, 7), of all ranks: in x, or x - change; zero where clamped. */
static int at_nodes(problem *p, const double *x, const double *change, double *now)
{
    const contact *c = p->contact;
    for (int i = 0; i < 7 * c->nodes; i++) {
        const int row = c->rows[i];
        now[i] = row < 0 ? 0 : change ? x[row] - change[row] : x[row];
    }
    return hook(p, NODES, now, 0);
}

/* The motion of these nodes in the step to x, or x - change. */
static int move_nodes(problem *p, const double *x, const double *change)
{
    contact *c = p->contact;
    if (at_nodes(p, x, change, c->now)) return FAILED;
    for (int i = 0; i < 7 * c->nodes; i++) c->now[i] += c->fixed[i];
    find_motion(c->nodes, 6, c->before, c->now, c->moved);
    return 0;
}

/* Keep the responses to the unit forces of nodes from `first` on that are `apart`; see `find_compliance`. */
static int respond_to_units(problem *p, int first, int apart, double *forces, const double *q)
{
    contact *c = p->contact;
    const int together = c->loads && !p->singular;
    for (int component = 0; component < AT_ONCE; component++) {
        unit_forces(c, first, apart, component, forces);
        memset(c->load, 0, p->size * sizeof *c->load);
        add_forces(c, forces, 0, 1, c->load);
        for (int i = 0; together && i < p->size; i++) c->loads[AT_ONCE * i + component] = c->load[i];
        if (together) continue;
        if (solve(p, c->load, c->response) || at_nodes(p, c->response, 0, c->now)) return FAILED;
        keep_responses(c, first, apart, component, q, c->now);
    }
    if (together) substitute(p->chain, c->loads, c->responded, c->substituted);
    for (int component = 0; together && component < AT_ONCE; component++) {
        for (int i = 0; i < p->size; i++) c->response[i] = c->responded[AT_ONCE * i + component];
        turn_on(p, c->response);
        if (at_nodes(p, c->response, 0, c->now)) return FAILED;
        keep_responses(c, first, apart, component, q, c->now);
    }
    return 0;
}

/* Find the compliance by the current tangent, at the unknowns x. */
static int find_compliance(problem *p, const double *x)
{
    contact *c = p->contact;
    double *q = c->free, *forces = c->last; /* work space, before they are found */
    c->known_for = c->h, c->usual = INFINITY, c->stale = 0;
    if (at_nodes(p, x, 0, c->now)) return FAILED;
    for (int i = 0; i < c->nodes; i++)
        for (int k = 0; k < 4; k++) q[4 * i + k] = c->now[7 * i + 3 + k] + c->fixed[7 * i + 3 + k];
    for (int times = 1, near = 1; near && times <= FARTHEST; times *= 2) {
        const int wanted = times * (2 * c->reach + 1), apart = wanted < c->nodes ? wanted : c->nodes;
        for (int first = 0; first < apart; first++)
            if (respond_to_units(p, first, apart, forces, q)) return FAILED;
        near = find_transfers(c, apart);
    }
    return 0;
}

/* Add the exact response to the last change of the forces to Newton's step, and judge the compliance by it. */
static int respond_exactly(problem *p, double *change)
{
    contact *c = p->contact;
    double size = 0, missed = 0;
    memset(c->load, 0, p->size * sizeof *c->load);
    add_forces(c, c->force, c->last, -1, c->load);
    if (solve(p, c->load, c->response)) return FAILED;
    for (int i = 0; i < p->size; i++) change[i] += c->response[i];
    if (at_nodes(p, c->response, 0, c->now)) return FAILED;
    for (int i = 0; i < c->nodes; i++)
        for (int k = 0; k < 3; k++) {
            const double foretold = c->moved[6 * i + k] - c->free[6 * i + k];
            size = fmax(size, fabs(foretold)), missed = fmax(missed, fabs(foretold + c->now[7 * i + k]));
        }
    if (!(size > c->rounding)) return 0;
    c->missing = fmax(missed / size, c->least);
    c->usual = fmin(c->usual, c->missing);
    c->stale = c->missing > c->worse * c->usual;
    return 0;
}

/* Add the response to the last change of the forces, by the compliance, to Newton's step. What that leaves out is in
   the next residual. */
static void respond_nearby(contact *c, double *change)
{
    double sum = 0;
    for (int i = 0; i < c->nodes; i++) {
        const int *rows = c->rows + 7 * i;
        const double *q = c->now + 7 * i + 3, *free = c->free + 6 * i, *moved = c->moved + 6 * i;
        const int again = i > 0 && memcmp(rows, rows - 7, 7 * sizeof *rows) == 0;
        double by[7], phi[3];
        for (int k = 0; k < 3; k++) by[k] = moved[k] - free[k], phi[k] = (moved[3 + k] - free[3 + k]) / 2;
        by[3] = -phi[0] * q[1] - phi[1] * q[2] - phi[2] * q[3];
        by[4] = phi[0] * q[0] + phi[1] * q[3] - phi[2] * q[2];
        by[5] = -phi[0] * q[3] + phi[1] * q[0] + phi[2] * q[1];
        by[6] = phi[0] * q[2] - phi[1] * q[1] + phi[2] * q[0];
        for (int k = 0; k < 7; k++) {
            sum += by[k] * by[k];
            if (!again && rows[k] >= 0) change[rows[k]] -= by[k];
        }
    }
    c->omitted = c->missing * sqrt(sum);
}

/* Find the forces with which the laws of contact hold after Newton's step, which is subtracted from x, and add the
   response to their change: the exact one to the first change in a step, which judges the compliance. */
static int meet(problem *p, const double *x, double *change, int first)
{
    contact *c = p->contact;
    const size_t size = 6 * c->nodes * sizeof *c->force;
    if (c->stale && find_compliance(p, x)) return FAILED;
    if (move_nodes(p, x, change)) return FAILED;
    memcpy(c->free, c->moved, size), memcpy(c->last, c->force, size), c->omitted = 0;
    settle(c);
    if (memcmp(c->last, c->force, size) == 0) return 0;
    if (first || c->exact) return respond_exactly(p, change);
    respond_nearby(c, change);
    return 0;
}

/* ---- time steps -------------------------------------------------------------------------------------------------- */

/* The root mean square of the nodal unknowns in a - b, or in a where b is 0. */
static int motion_in(const stepping *s, const double *a, const double *b, double *size)
{
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < s->motions; i++) {
        const double c = b ? a[i] - b[i] : a[i];
        sum += c * c;
    }
    if (hook(s->problem, SUM, &sum, 0)) return FAILED;
    *size = sqrt(sum) / s->root;
    return 0;
}

/* Decide after an increment whether to stop, and whether to continue with a new tangent. */
static void judge_increment(stepping *s, double step, double before)
{
    const double rate = s->iterations > 1 ? step / before : 1;
    const contact *c = s->problem->contact;
    const int complete = !c || c->omitted <= s->enough * s->root;
    if (!isfinite(step)) s->verdict = NOT_A_NUMBER;
    else if (step > s->diverged) s->verdict = GROWN;
    else if (complete && (step <= s->enough || (s->iterations > 1 && error_is_small(step, before, 0, s->enough))))
        s->verdict = CONVERGED, s->noise *= FADES;
    else if (step <= s->rounding && rate > 0.5 && s->iterations > 1)
        s->verdict = CONVERGED, s->noise = !c ? 0 : s->noise > 0 ? fmin(step, RISES * s->noise) : step;
    else if (s->iterations >= s->most) s->verdict = RAN_OUT;
    else if (s->iterations > 1) {
        const double left = log(s->enough / step);
        const int by_tangent = !c || c->omitted == 0; /* else what is omitted limits the contraction */
        s->fresh = rate > 0.9 || (by_tangent && left / log(rate) > s->price + left / log(s->rate));
    }
}

/* Scale the quaternions of a guess to |q| = 1: what they differ from it by moves the rotations by an old tangent. */
static void normalise(double *x, int turning)
{
    for (double *q = x + 3; turning > 0; turning--, q += 7) {
        const double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int k = 0; k < 4 && size > 0; k++) q[k] /= size;
    }
}

/* Newton's method from the guess x; the state follows. */
int iterate(stepping *s)
{
    problem *p = s->problem;
    double step = 0, before;
    normalise(s->x, s->turning);
    if (motion_in(s, s->x, s->start, &s->enough)) return FAILED;
    s->enough = fmax(fmax(s->smallest, s->increment * s->enough), s->of_noise * s->noise);
    s->iterations = 0, s->verdict = ITERATING;
    if (p->contact) {
        if (move_nodes(p, s->x, 0)) return FAILED;
        aim(p->contact);
    }
    while (s->verdict == ITERATING) {
        if (residual(p, s->x, s->b)) return FAILED;
        if (s->fresh) {
            if (tangent(p)) return FAILED;
            s->fresh = 0, s->spent = s->price, s->served = 0;
        }
        if (solve(p, s->b, s->change)) return FAILED;
        const contact *c = p->contact;
        if (!p->singular && c && meet(p, s->x, s->change, s->iterations == 0)) return FAILED;
        if (!p->singular && hook(p, CONTACT, s->x, s->change)) return FAILED;
        if (p->singular) {
            s->verdict = SINGULAR;
            break;
        }
        for (int i = 0; i < p->size; i++) s->x[i] -= s->change[i];
        before = step, s->iterations++;
        if (motion_in(s, s->change, 0, &step)) return FAILED;
        judge_increment(s, step, before);
    }
    if (p->contact && move_nodes(p, s->x, 0)) return FAILED;
    return take_state(p, s->x);
}

/* ---- equilibria -------------------------------------------------------------------------------------------------- */

/* See `error_is_small`. Convergence is not taken for quadratic (`contracts`) on slender rods whose contact force is
   carried or unknown: rounding makes their tangent inexact for motions of low stiffness. Where n follows from the
   motion alone, Newton steps alternate between bending and the correction of the stretch that this causes; the larger
   ones of successive pairs of steps (`period`) are compared then, because one small step does not imply convergence. A
   step by the tangent of the one before is judged by its size alone. */
static int has_converged(const newton *n)
{
    double before = 0, step = 0;
    if (n->keeps) return n->steps[0] <= SERVED * n->increment;
    if (n->steps[0] <= n->increment) return 1;
    if (n->iterations < 2 * n->period) return 0;
    for (int i = 1; i <= n->period; i++) {
        step = fmax(step, n->steps[i - 1]);
        before = fmax(before, n->steps[n->period + i - 1]);
    }
    return error_is_small(step, before, n->contracts, n->increment);
}

/* Root of the sum of squares over all ranks. */
static int root_of(const problem *p, double sum, double *root)
{
    if (hook(p, SUM, &sum, 0)) return FAILED;
    *root = sqrt(sum);
    return 0;
}

/* Judge the residual b after a step, or at the start where `change` is 0. Of the step only the part that is motion
   counts: forces and multipliers differ in scale and in rounding error. */
int judge_residual(newton *n, const double *b, const double *change)
{
    const problem *p = n->problem;
    double norm = 0, step = 0;
    for (int i = 0; i < p->size; i++) norm += b[i] * b[i];
    if (root_of(p, norm, &norm)) return FAILED;
    const double ratio = norm / n->norm; /* about that of the next step to the last one */
    n->norm = norm;
    n->verdict = isfinite(norm) ? ITERATING : NOT_A_NUMBER;
    if (n->verdict != ITERATING || !change) return 0;
    for (int i = 0; i < n->nodes; i++)
        for (int j = i * n->block; j < i * n->block + n->motion; j++) step += change[j] * change[j];
    if (root_of(p, step, &step)) return FAILED;
    step /= n->root;
    memmove(n->steps + 1, n->steps, 3 * sizeof step);
    n->steps[0] = step, n->iterations++;
    const int balanced = norm <= 1e-6 * (1 + n->loads) + n->rounding;
    if (!(step < 1e3)) n->verdict = GROWN;
    else if (balanced && has_converged(n)) n->verdict = CONVERGED;
    else if (n->iterations >= n->most) n->verdict = RAN_OUT;
    n->keeps = n->verdict == ITERATING && !n->keeps && n->contracts && n->period == 1
               && ratio * step <= SLIGHT * n->increment;
    return 0;
}

/* Begin Newton's method at the state. */
void begin_newton(newton *n)
{
    const problem *p = n->problem;
    n->iterations = 0, n->verdict = ITERATING, n->keeps = 0;
    if (p->advance) memcpy(p->before, p->state, p->locals * sizeof *p->state);
}

/* Newton's method with full steps from the states of the sweeps that take part, whose unknowns are x; these, the
   states and the carried contact forces follow; who fails leaves. It takes the steps that SNES takes
   (algebra/newton.py), without the time that SNES takes for its options; one whose error is slight is by the tangent
   of the step before, where sweeps are not in lock step. */
void equilibrate(const group *g, int *in)
{
    double *x[LANES], *b[LANES], *change[LANES];
    int going[LANES], asked[LANES], first = 1;
    for (int k = 0; k < g->count; k++) {
        newton *n = g->sweep[k]->newton;
        x[k] = g->sweep[k]->x, b[k] = n->b, change[k] = n->change, going[k] = in[k];
        if (in[k]) begin_newton(n);
    }
    for (;; first = 0) {
        memcpy(asked, going, sizeof asked);
        residuals(g, going, x, b);
        int any = 0;
        for (int k = 0; k < g->count; k++) {
            newton *n = g->sweep[k]->newton;
            if (!asked[k]) continue;
            in[k] = going[k] && !judge_residual(n, b[k], first ? 0 : change[k]);
            going[k] = in[k] && n->verdict == ITERATING;
            n->keeps &= !g->together;
            if (in[k] && (n->verdict == CONVERGED || (going[k] && !first))) advance(n->problem);
            any |= asked[k] = going[k];
        }
        if (!any) return;
        directions(g, going, b, change);
        for (int k = 0; k < g->count; k++) {
            newton *n = g->sweep[k]->newton;
            if (asked[k] && !going[k]) in[k] = 0;
            if (going[k] && n->problem->singular) n->verdict = SINGULAR, going[k] = 0;
            for (int i = 0; going[k] && i < n->problem->size; i++) x[k][i] -= change[k][i];
        }
    }
}
